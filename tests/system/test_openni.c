// Depth sensors and .oni files through the real OpenNI2: the fake sensor
// (openni_driver/) plays a folder made here, and make-oni records it. The frames that
// arrive must be the folder's images, bit for bit, unmirrored, in order.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { W = 64, H = 48, FRAMES = 20, STEP_US = 33333 };
static const int64_t BEGIN_US = 1305031102000123;

struct openni_case {
    struct scratch scratch;
    char oni[256]; // the URI of a recording
};

static void picture(int index, uint16_t mm[W * H], uint8_t rgb[W * H * 3])
{
    struct rng rng = {(uint64_t)index};
    for (int i = 0; i < W * H; i++)
        mm[i] = i % 5 ? (uint16_t)(400 + rng_uniform(&rng) * 6000) : 0;
    for (int i = 0; i < W * H * 3; i++)
        rgb[i] = (uint8_t)(rng_uniform(&rng) * 256);
}

// Every `color_every`-th frame has colour.
static void put_lists(const struct openni_case *setup, int color_every)
{
    char depth[FRAMES * 48] = "", rgb[FRAMES * 48] = "";
    for (int i = 0; i < FRAMES; i++) {
        int64_t us = BEGIN_US + (int64_t)i * STEP_US;
        size_t n = strlen(depth), m = strlen(rgb);
        snprintf(depth + n, sizeof depth - n, "%lld.%06lld d%02d.png\n", (long long)(us / 1000000),
                 (long long)(us % 1000000), i);
        if (i % color_every == 0)
            snprintf(rgb + m, sizeof rgb - m, "%lld.%06lld c%02d.png\n", (long long)(us / 1000000),
                     (long long)(us % 1000000), i);
    }
    scratch_text(&setup->scratch, "depth.txt", depth);
    scratch_text(&setup->scratch, "rgb.txt", rgb);
}

static void put_calibration(const struct openni_case *setup, const char *relation)
{
    char text[600];
    snprintf(text, sizeof text,
             "{\"color\": {\"width\": 64, \"height\": 48, \"fx\": 53.5, \"fy\": 54.25, \"cx\": 31.5, \"cy\": 23.5},"
             "\"depth\": {\"width\": 64, \"height\": 48, \"fx\": 57, \"fy\": 57.5, \"cx\": 31.5, \"cy\": 23.5},%s}",
             relation);
    scratch_text(&setup->scratch, "calibration.json", text);
}

static void set(const char *name, const char *value)
{
    char full[64];
    snprintf(full, sizeof full, "REENACT_FAKE_SENSOR%s%s", *name ? "_" : "", name);
    if (value)
        setenv(full, value, 1);
    else
        unsetenv(full);
}

static int make_case(void **state)
{
    struct openni_case *setup = calloc(1, sizeof *setup);
    setup->scratch = scratch_make();
    snprintf(setup->oni, sizeof setup->oni, "oni:%s/take.oni", setup->scratch.path);
    static uint16_t mm[W * H];
    static uint8_t rgb[W * H * 3];
    for (int i = 0; i < FRAMES; i++) {
        char path[sizeof setup->scratch.path + 16];
        picture(i, mm, rgb);
        snprintf(path, sizeof path, "%s/d%02d.png", setup->scratch.path, i);
        assert_int_equal(png_write(path, PNG_GRAY16, mm, W, H), OK);
        snprintf(path, sizeof path, "%s/c%02d.png", setup->scratch.path, i);
        assert_int_equal(png_write(path, PNG_RGB8, rgb, W, H), OK);
    }
    put_lists(setup, 1);
    put_calibration(setup, "\"registered\": true");
    static const char *const names[] = {"UNPLUG_AFTER", "AT_END", "DEPTH", "MIRROR"};
    for (size_t i = 0; i < COUNT_OF(names); i++)
        set(names[i], NULL);
    set("", setup->scratch.path);
    set("FPS", "100");
    *state = setup;
    return 0;
}

static int clear_case(void **state)
{
    struct openni_case *setup = *state;
    scratch_remove(&setup->scratch);
    free(setup);
    return 0;
}

static struct source *open_it(const char *uri)
{
    struct source *s;
    EXPECT_STATUS(source_open(&s, uri, SOURCE_SENSOR), OK);
    return s;
}

// `f` is the folder's frame number `index`, bit for bit.
static void same(const struct frame *f, int index, bool color)
{
    static uint16_t mm[W * H];
    static uint8_t rgb[W * H * 3];
    picture(index, mm, rgb);
    assert_non_null(f->depth);
    assert_memory_equal(f->depth, mm, sizeof mm);
    EXPECT_INT(f->color != NULL, color);
    if (color)
        assert_memory_equal(f->color, rgb, sizeof rgb);
    assert_null(f->jpeg);
}

// Reads a live sensor until it is disconnected. Which frames arrive depends on this machine's speed;
// that each is correct, later than the last, and counted, does not.
static void read_live(const char *uri, int wanted_frames)
{
    struct source *s = open_it(uri);
    assert_true(source_is_live(s));
    EXPECT_INT(source_remaining(s), -1);
    struct frame f;
    enum status status;
    int frames = 0, first = -1, last = -1;
    while ((status = source_next(s, &f)) == OK) {
        int index = (int)((f.time_ns / 1000 - BEGIN_US) / STEP_US);
        EXPECT_INT(f.time_ns, (BEGIN_US + (int64_t)index * STEP_US) * 1000);
        EXPECT_AT_LEAST(index, last + 1);
        if (first < 0)
            first = index; // frames before the first call are not counted
        last = index;
        same(&f, index, f.color != NULL); // colour may be missing, but not wrong
        frames++;
    }
    EXPECT_STATUS(status, ERR_DEVICE);
    EXPECT_SAYS("fake sensor");
    EXPECT_SAYS("unplugged");
    EXPECT_STATUS(source_next(s, &f), ERR_DEVICE);
    EXPECT_INT(last, wanted_frames - 1);
    EXPECT_INT(frames + source_dropped(s), wanted_frames - first);
    EXPECT_AT_LEAST(frames, wanted_frames / 4);
    source_close(&s);
}

static void record(const struct openni_case *setup)
{
    struct process_result said = PROCESS(MAKE_ONI, "--from", setup->scratch.path, "--out", setup->oni + 4);
    EXPECT_INT(said.exit_code, 0);
}

// ------------------------------------------------------------- sensors

static void test_sensor(void **state)
{
    (void)state;
    read_live("openni", FRAMES);
    set("MIRROR", "fixed"); // the source mirrors it back
    read_live("openni:0", FRAMES);
}

static void test_sensor_in_tenths_of_millimetres(void **state)
{
    (void)state;
    set("DEPTH", "100um");
    read_live("openni", FRAMES);
}

static void test_unplugged(void **state)
{
    (void)state;
    set("UNPLUG_AFTER", "7");
    set("AT_END", "loop");
    int64_t begin_ns = clock_now_ns();
    read_live("openni", 7);
    EXPECT_AT_MOST(1e-9 * (double)(clock_now_ns() - begin_ns), 3);
}

static void test_silent(void **state)
{
    (void)state;
    set("AT_END", "stop");
    struct source *s = open_it("openni");
    struct frame f;
    enum status status;
    while ((status = source_next(s, &f)) == OK)
        ;
    EXPECT_STATUS(status, ERR_DEVICE);
    EXPECT_SAYS("no picture for 5 seconds");
    source_close(&s);
}

static void test_looping_time_rises(void **state)
{
    (void)state;
    set("AT_END", "loop");
    set("FPS", "200");
    struct source *s = open_it("openni");
    struct frame f;
    int64_t last_ns = 0;
    for (int i = 0; i < 2 * FRAMES; i++) {
        EXPECT_STATUS(source_next(s, &f), OK);
        EXPECT_AT_LEAST((double)f.time_ns, (double)last_ns + 1);
        last_ns = f.time_ns;
    }
    source_close(&s);
}

static void test_calibration(void **state)
{
    struct openni_case *setup = *state;
    struct source *s = open_it("openni");
    const struct calibration *c = source_calibration(s);
    assert_true(c->registered);
    EXPECT_INT(c->depth.width, W);
    EXPECT_INT(c->color.height, H);
    EXPECT_NEAR(c->color.fx, 53.5, 1e-4); // a field of view comes as a float
    EXPECT_NEAR(c->color.fy, 54.25, 1e-4);
    EXPECT_NEAR(c->depth.fx, 53.5, 1e-4); // registered: projected into the colour camera
    EXPECT_NEAR(c->depth.cx, 31.5, 0);
    assert_true(lens_is_ideal(&c->depth));
    source_close(&s);
    put_calibration(setup, "\"registered\": false, \"color_from_depth\": "
                           "{\"translation_m\": [0.025, 0, 0], \"rotation\": [0, 0, 0, 1]}");
    s = open_it("openni");
    c = source_calibration(s);
    assert_false(c->registered);
    EXPECT_NEAR(c->depth.fx, 57, 1e-4);
    EXPECT_NEAR(c->depth.fy, 57.5, 1e-4);
    EXPECT_NEAR(c->color.fx, 53.5, 1e-4);
    source_close(&s);
}

// What was measured of a sensor is kept and used the next time it is opened: the lens, and colour to depth where depth
// is not registered.
static void test_measured_calibration(void **state)
{
    struct openni_case *setup = *state;
    setenv("XDG_CONFIG_HOME", setup->scratch.path, 1);
    for (int registered = 0; registered < 2; registered++) {
        put_calibration(setup, registered ? "\"registered\": true"
                                          : "\"registered\": false, \"color_from_depth\": {\"translation_m\": "
                                            "[0, 0, 0], \"rotation\": [0, 0, 0, 1]}");
        struct source *s = open_it("openni");
        struct calibration measured = *source_calibration(s);
        EXPECT_INT(measured.registered, registered);
        measured.color.fx = 54.5 + registered;
        measured.color.k1 = -0.02;
        measured.color_from_depth.translation = v3(registered ? 0 : 0.024, 0.001, 0);
        EXPECT_STATUS(source_save_calibration(s, &measured), OK);
        source_close(&s);
        s = open_it("openni");
        const struct calibration *c = source_calibration(s);
        EXPECT_NEAR(c->color.fx, 54.5 + registered, 1e-9);
        EXPECT_NEAR(c->color.k1, -0.02, 1e-9);
        EXPECT_NEAR(c->depth.fx, registered ? 55.5 : 57, 1e-4);
        EXPECT_NEAR(c->color_from_depth.translation.x, registered ? 0 : 0.024, 1e-9);
        source_close(&s);
    }
    // One of another shape is refused, with what to do.
    struct source *s = open_it("openni");
    struct calibration wrong = *source_calibration(s);
    wrong.color.height = 40;
    wrong.depth = wrong.color;
    EXPECT_STATUS(source_save_calibration(s, &wrong), OK);
    source_close(&s);
    EXPECT_STATUS(source_open(&s, "openni", SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("calibrate it again");
    unsetenv("XDG_CONFIG_HOME");
}

static void test_devices(void **state)
{
    struct openni_case *setup = *state;
    struct source_device list[8];
    struct source *s;
    int count;
    char two[2 * sizeof setup->scratch.path];
    snprintf(two, sizeof two, "%s:%s", setup->scratch.path, setup->scratch.path);
    set("", two);
    EXPECT_STATUS(source_devices(list, COUNT_OF(list), &count), OK);
    EXPECT_AT_LEAST(count, 2); // a camera may be there, too
    assert_string_equal(list[0].uri, "openni:0");
    assert_string_equal(list[1].uri, "openni:1");
    assert_string_equal(list[1].name, "Reenact fake sensor");
    EXPECT_STATUS(source_devices(list, 1, &count), OK);
    EXPECT_AT_LEAST(count, 2);
    read_live("openni:1", FRAMES);
    EXPECT_STATUS(source_open(&s, "openni:2", SOURCE_SENSOR), ERR_MISSING);
    EXPECT_SAYS("number 2");
    static const char *const none[] = {"openni:x", "openni:+1", "openni: 1", "openni:-1", "openni:1x", "openni:1000"};
    for (size_t i = 0; i < COUNT_OF(none); i++) {
        EXPECT_STATUS(source_open(&s, none[i], SOURCE_SENSOR), ERR_INPUT);
        EXPECT_SAYS(none[i]);
    }
    EXPECT_STATUS(source_open(&s, "openni:-1", SOURCE_SENSOR), ERR_INPUT);
    set("", NULL);
    EXPECT_STATUS(source_open(&s, "openni", SOURCE_SENSOR), ERR_MISSING);
    assert_null(s);
    EXPECT_SAYS("/OpenNI2/Drivers");
    set("", "/nowhere");
    EXPECT_STATUS(source_open(&s, "openni", SOURCE_SENSOR), ERR_DEVICE);
    EXPECT_SAYS("does not open");
}

// ------------------------------------------------------------- recordings

static void test_recording(void **state)
{
    struct openni_case *setup = *state;
    record(setup);
    for (int slow = 0; slow < 2; slow++) {
        struct source *s = open_it(setup->oni);
        assert_false(source_is_live(s));
        EXPECT_NEAR(source_calibration(s)->color.fx, 53.5, 1e-4);
        struct frame f;
        for (int i = 0; i < FRAMES; i++) {
            if (slow)
                clock_sleep_until_ns(clock_now_ns() + (i % 3) * 20000000);
            EXPECT_INT(source_remaining(s), FRAMES - i);
            EXPECT_STATUS(source_next(s, &f), OK);
            EXPECT_INT(f.time_ns, (int64_t)i * STEP_US * 1000);
            char name[8];
            snprintf(name, sizeof name, "%04d", i);
            assert_string_equal(f.name, name);
            same(&f, i, true);
        }
        EXPECT_STATUS(source_next(s, &f), NOTHING);
        EXPECT_STATUS(source_next(s, &f), NOTHING);
        EXPECT_INT(source_dropped(s), 0);
        EXPECT_INT(source_remaining(s), 0);
        source_close(&s);
    }
}

static void test_recording_with_less_colour(void **state)
{
    struct openni_case *setup = *state;
    put_lists(setup, 3);
    record(setup);
    struct source *s = open_it(setup->oni);
    struct frame f;
    for (int i = 0; i < FRAMES; i++) {
        EXPECT_STATUS(source_next(s, &f), OK);
        same(&f, i, i % 3 == 0);
    }
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    source_close(&s);
}

static void test_recording_mirrored(void **state)
{
    struct openni_case *setup = *state;
    set("MIRROR", "fixed");
    record(setup);
    struct source *s = open_it(setup->oni);
    struct frame f;
    EXPECT_STATUS(source_next(s, &f), OK);
    same(&f, 0, true);
    int64_t begin_ns = clock_now_ns();
    source_close(&s); // in the middle
    EXPECT_AT_MOST(1e-9 * (double)(clock_now_ns() - begin_ns), 1);
}

static void test_recording_closed_unread(void **state)
{
    struct openni_case *setup = *state;
    record(setup);
    int64_t begin_ns = clock_now_ns();
    for (int i = 0; i < 5; i++) {
        struct source *s = open_it(setup->oni);
        source_close(&s);
    }
    EXPECT_AT_MOST(1e-9 * (double)(clock_now_ns() - begin_ns), 5);
}

// Replaces each 8 bytes that hold the number. Returns how many.
static int replace_number(uint8_t *bytes, size_t count, uint64_t number, uint64_t by)
{
    int replaced = 0;
    for (size_t i = 0; i + sizeof number <= count; i++)
        if (!memcmp(bytes + i, &number, sizeof number)) {
            memcpy(bytes + i, &by, sizeof by);
            replaced++;
        }
    return replaced;
}

// The last two images' times are so late that their nanoseconds would overflow: the first of them is the last to come.
static void test_recording_of_no_clock(void **state)
{
    struct openni_case *setup = *state;
    record(setup);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(setup->oni + 4, &bytes, &count), OK);
    for (int i = 1; i <= 2; i++)
        EXPECT_AT_LEAST(replace_number(bytes, count, (uint64_t)(FRAMES - i) * STEP_US, UINT64_MAX / 3 - (uint64_t)i),
                        1);
    EXPECT_STATUS(file_write(setup->oni + 4, bytes, count), OK);
    free(bytes);
    struct source *s = open_it(setup->oni);
    struct frame f;
    for (int i = 0; i < FRAMES - 2; i++) {
        EXPECT_STATUS(source_next(s, &f), OK);
        EXPECT_INT(f.time_ns, (int64_t)i * STEP_US * 1000);
    }
    EXPECT_STATUS(source_next(s, &f), OK);
    print_message("%lld ns\n", (long long)f.time_ns);
    EXPECT_TRUE(f.time_ns > 1000000000000000000 && f.time_ns <= INT64_MAX / 2);
    EXPECT_STATUS(source_next(s, &f), NOTHING);
    EXPECT_INT(source_dropped(s), 1);
    source_close(&s);
}

static void test_recording_damaged(void **state)
{
    struct openni_case *setup = *state;
    struct source *s;
    EXPECT_STATUS(source_open(&s, setup->oni, SOURCE_SENSOR), ERR_MISSING);
    EXPECT_SAYS("take.oni");
    scratch_text(&setup->scratch, "take.oni", "this is no recording, however long the text may be that it holds");
    EXPECT_STATUS(source_open(&s, setup->oni, SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("take.oni is no recording of OpenNI2: it is a text file");
    scratch_text(&setup->scratch, "take.oni", "");
    EXPECT_STATUS(source_open(&s, setup->oni, SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("it is empty");
    char folder[sizeof setup->oni];
    snprintf(folder, sizeof folder, "oni:%s", setup->scratch.path);
    EXPECT_STATUS(source_open(&s, folder, SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("is a folder");
    record(setup);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(setup->oni + 4, &bytes, &count), OK);
    // The recorder leaves the file twice as long as what it wrote, so half of the frames are before this.
    memset(bytes + count / 4, 0, count / 16);
    EXPECT_STATUS(file_write(setup->oni + 4, bytes, count), OK);
    s = open_it(setup->oni);
    struct frame f;
    enum status status;
    int frames = 0, damaged = 0;
    while ((status = source_next(s, &f)) != NOTHING) {
        if (status == OK) {
            if (frames++ < FRAMES / 2 - 3) // where the damage begins a frame may be wrong: the file has no checksum
                same(&f, frames - 1, true);
            continue;
        }
        EXPECT_STATUS(status, ERR_INPUT);
        EXPECT_SAYS("take.oni");
        EXPECT_SAYS("damaged");
        EXPECT_AT_MOST(++damaged, FRAMES);
    }
    EXPECT_AT_LEAST(frames, FRAMES / 2 - 3);
    EXPECT_AT_LEAST(damaged, 1);
    EXPECT_AT_MOST(frames + (double)source_dropped(s), FRAMES);
    EXPECT_INT(source_remaining(s), 0);
    source_close(&s);
    EXPECT_STATUS(file_write(setup->oni + 4, bytes, count / 4), OK); // its table of contents is gone
    EXPECT_STATUS(source_open(&s, setup->oni, SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("take.oni is cut short or damaged");
    free(bytes);
}

// ------------------------------------------------------------- the process that plays

// The child process of `parent`; 0: it has none.
static pid_t child_of(pid_t parent)
{
    pid_t found = 0;
    DIR *processes = opendir("/proc");
    assert_non_null(processes);
    for (struct dirent *entry; !found && (entry = readdir(processes));) {
        char path[300], line[512] = "";
        int of = 0;
        snprintf(path, sizeof path, "/proc/%s/stat", entry->d_name);
        FILE *file = *entry->d_name >= '1' && *entry->d_name <= '9' ? fopen(path, "r") : NULL;
        if (!file)
            continue;
        const char *after = fgets(line, sizeof line, file) ? strrchr(line, ')') : NULL;
        if (after && sscanf(after, ") %*c %d", &of) == 1 && of == parent)
            found = (pid_t)atoi(entry->d_name);
        fclose(file);
    }
    closedir(processes);
    return found;
}

// OpenNI2 crashes on bytes above 127 in a path, and takes no path of more than 255 bytes.
static void test_recording_of_any_name(void **state)
{
    struct openni_case *setup = *state;
    static const char *const names[] = {"ü.oni", "日本 \xff\x80.oni", "of no ending"};
    char path[1200];
    record(setup);
    for (size_t i = 0; i <= COUNT_OF(names); i++) {
        char folder[600];
        int used = snprintf(folder, sizeof folder, "%s", setup->scratch.path);
        for (int k = 0; i == COUNT_OF(names) && k < 4; k++) // deep
            used += snprintf(folder + used, sizeof folder - (size_t)used, "/%0100d", k);
        EXPECT_STATUS(folder_make(folder), OK);
        snprintf(path, sizeof path, "oni:%s/%s", folder, names[i % COUNT_OF(names)]);
        EXPECT_INT(rename(setup->oni + 4, path + 4), 0);
        struct source *s = open_it(path);
        struct frame f;
        for (int k = 0; k < FRAMES; k++) {
            EXPECT_STATUS(source_next(s, &f), OK);
            same(&f, k, true);
        }
        EXPECT_STATUS(source_next(s, &f), NOTHING);
        source_close(&s);
        EXPECT_INT(rename(path + 4, setup->oni + 4), 0);
    }
    // The recorder likewise.
    snprintf(path, sizeof path, "%s/ö.oni", setup->scratch.path);
    struct process_result said = PROCESS(MAKE_ONI, "--from", setup->scratch.path, "--out", path);
    EXPECT_INT(said.exit_code, 0);
}

// Whatever ends OpenNI2 ends its own process alone, and is said once.
static void test_player_that_dies(void **state)
{
    struct openni_case *setup = *state;
    static const int signals[] = {SIGSEGV, SIGABRT, SIGKILL};
    record(setup);
    for (size_t i = 0; i < COUNT_OF(signals); i++) {
        struct source *s = open_it(setup->oni);
        struct frame f;
        for (int k = 0; k < 3; k++) {
            EXPECT_STATUS(source_next(s, &f), OK);
            same(&f, k, true);
        }
        const pid_t player = child_of(getpid());
        EXPECT_TRUE(player > 0 && getpgid(player) != getpgid(0)); // Ctrl-C does not reach it
        EXPECT_INT(kill(player, signals[i]), 0);
        EXPECT_STATUS(source_next(s, &f), signals[i] == SIGKILL ? ERR_MEMORY : ERR_INPUT);
        EXPECT_SAYS("take.oni");
        EXPECT_SAYS(signals[i] == SIGKILL ? "was killed" : "is damaged: OpenNI2 breaks down after 3 of its pictures");
        EXPECT_STATUS(source_next(s, &f), NOTHING);
        EXPECT_INT(source_remaining(s), 0);
        source_close(&s);
        EXPECT_INT(child_of(getpid()), 0);
    }
}

static void test_player_ends_with_its_program(void **state)
{
    struct openni_case *setup = *state;
    record(setup);
    const pid_t program = fork();
    if (program == 0) {
        struct source *s;
        if (source_open(&s, setup->oni, SOURCE_SENSOR) != OK)
            _exit(1);
        for (;;)
            pause();
    }
    pid_t player = 0;
    for (int tries = 0; tries < 500 && !player; tries++) {
        player = child_of(program);
        usleep(20000);
    }
    EXPECT_TRUE(player > 0);
    EXPECT_INT(kill(program, SIGKILL), 0);
    EXPECT_INT(waitpid(program, NULL, 0), program);
    const int64_t since_ns = clock_now_ns();
    while (!kill(player, 0) && clock_now_ns() - since_ns < 2000000000)
        usleep(20000);
    char path[64], line[512] = "";
    snprintf(path, sizeof path, "/proc/%d/stat", (int)player);
    FILE *file = fopen(path, "r");
    const char *after = file && fgets(line, sizeof line, file) ? strrchr(line, ')') : NULL;
    if (file)
        fclose(file);
    print_message("%s\n", after ? after : "gone");
    EXPECT_TRUE(!after || after[2] == 'Z');
}

// Damaged files end in a sentence, however OpenNI2 takes them: its own process breaks down in one of ten.
// ONI_MUTANTS=150 for a long look; one takes up to 3 s, for which a silent file is waited for.
static void test_mutants(void **state)
{
    struct openni_case *setup = *state;
    const uint64_t seed = (uint64_t)clock_now_ns();
    struct rng rng = {seed};
    const char *more = getenv("ONI_MUTANTS");
    const int mutants = more ? atoi(more) : 8;
    uint8_t *bytes;
    size_t count, at = 0;
    int broken = 0, whole = 0, refused = 0;
    print_message("seed %llu\n", (unsigned long long)seed);
    record(setup);
    EXPECT_STATUS(file_read(setup->oni + 4, &bytes, &count), OK);
    while (count && !bytes[count - 1])
        count--; // the recorder leaves it longer than what it wrote
    uint8_t *mutant = malloc(count);
    assert_non_null(mutant);
    for (int i = 0; i < mutants; i++) {
        memcpy(mutant, bytes, count);
        for (int k = 0; k < 1 << i % 6; k++) {
            at = (size_t)(rng_uniform(&rng) * (double)count);
            at = i % 3 ? at : at % 2000; // its header and first records
            mutant[at < 8 ? 8 : at] = (uint8_t)(rng_uniform(&rng) * 256);
        }
        EXPECT_STATUS(file_write(setup->oni + 4, mutant, i % 10 == 9 ? at : count), OK);
        struct source *s;
        struct frame f;
        enum status status = source_open(&s, setup->oni, SOURCE_SENSOR);
        int steps = 0;
        if (status != OK) {
            refused++;
            broken += strstr(status_message(), "breaks down") != NULL;
        }
        while (status == OK || (status == ERR_INPUT && s)) {
            status = source_next(s, &f);
            broken += status == ERR_INPUT && strstr(status_message(), "breaks down") != NULL;
            EXPECT_AT_MOST(++steps, 4 * FRAMES);
        }
        whole += status == NOTHING;
        if (status != NOTHING && !strstr(status_message(), "take.oni"))
            print_error("mutant %d: %s\n", i, status_message());
        EXPECT_TRUE(status == NOTHING || strstr(status_message(), "take.oni"));
        source_close(&s);
    }
    print_message("%d mutants: %d refused, %d read to their end; OpenNI2 broke down in %d\n", mutants, refused, whole,
                  broken);
    EXPECT_INT(refused + whole, mutants);
    free(mutant);
    free(bytes);
}

int main(void)
{
    keep_player();
#define WITH_CASE(test) cmocka_unit_test_setup_teardown(test, make_case, clear_case)
    const struct CMUnitTest tests[] = {
        WITH_CASE(test_sensor),
        WITH_CASE(test_sensor_in_tenths_of_millimetres),
        WITH_CASE(test_unplugged),
        WITH_CASE(test_silent),
        WITH_CASE(test_looping_time_rises),
        WITH_CASE(test_calibration),
        WITH_CASE(test_measured_calibration),
        WITH_CASE(test_devices),
        WITH_CASE(test_recording),
        WITH_CASE(test_recording_with_less_colour),
        WITH_CASE(test_recording_mirrored),
        WITH_CASE(test_recording_closed_unread),
        WITH_CASE(test_recording_of_no_clock),
        WITH_CASE(test_recording_damaged),
        WITH_CASE(test_recording_of_any_name),
        WITH_CASE(test_player_that_dies),
        WITH_CASE(test_player_ends_with_its_program),
        WITH_CASE(test_mutants),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
