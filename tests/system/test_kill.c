// kill -9 while recording: what stays on the disk.
//
// test_kill [COUNT]: that many kills, at random moments; default 4.
// The sensor is live: OpenNI2 with the fake sensor's driver, 30 frames a second.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "recording/recording.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 160, HEIGHT = 120, FRAMES = 30, FRAME_MS = 33 };

static int kills = 4;
static const uint64_t SEED = 20140901;

static struct scratch scratch;

// An empty room, at the cost of a normal recording.
static void make_folder(void)
{
    static uint8_t color[3 * WIDTH * HEIGHT];
    static uint16_t depth[WIDTH * HEIGHT];
    char rgb_list[2048] = "", depth_list[2048] = "", name[64];
    for (int i = 0; i < FRAMES; i++) {
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            depth[k] = (uint16_t)(2000 + k % WIDTH);
            memset(color + 3 * k, (k + i) % 256, 3);
        }
        uint8_t *bytes;
        size_t count;
        EXPECT_STATUS(jpeg_encode(color, WIDTH, HEIGHT, 90, &bytes, &count), OK);
        snprintf(name, sizeof name, "sensor/rgb/%d.jpg", i);
        scratch_write(&scratch, name, bytes, count);
        free(bytes);
        EXPECT_STATUS(png_encode(&(struct png_layout){PNG_GRAY16, WIDTH, HEIGHT}, depth, 1, &bytes, &count), OK);
        snprintf(name, sizeof name, "sensor/depth/%d.png", i);
        scratch_write(&scratch, name, bytes, count);
        free(bytes);
        sprintf(rgb_list + strlen(rgb_list), "%.6f rgb/%d.jpg\n", 10 + i / 30.0, i);
        sprintf(depth_list + strlen(depth_list), "%.6f depth/%d.png\n", 10 + i / 30.0, i);
    }
    scratch_text(&scratch, "sensor/rgb.txt", rgb_list);
    scratch_text(&scratch, "sensor/depth.txt", depth_list);
    const char *lens = "{\"width\": 160, \"height\": 120, \"fx\": 131.25, \"fy\": 131.25, \"cx\": 79.5, \"cy\": 59.5, "
                       "\"distortion\": [0, 0, 0, 0, 0], \"unit_m\": 0.001}";
    char text[600];
    snprintf(text, sizeof text, "{\"color\": %s, \"depth\": %s, \"registered\": true}", lens, lens);
    scratch_text(&scratch, "sensor/calibration.json", text);
}

// How many frames the file holds now, read as another program would; -1: no file or no take yet.
static int64_t frames_in(const char *path)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    int64_t frames = -1;
    if (recording_open(&recording, path) == OK && take_open(&take, recording, "long") == OK)
        frames = take_frame_count(take);
    take_close(&take);
    recording_free(&recording);
    return frames;
}

// Records until `filmed_ms` after the first frame is in the file, then kills. Returns a lower bound of the
// frames that the sensor had delivered by then.
static int64_t film_and_kill(const char *path, double filmed_ms)
{
    const char *const argv[] = {
        PROGRAM_DIR "/reenact-capture", "record", "--sensor", "openni", "--out", path, "--take", "long", NULL};
    pid_t child = process_start(argv);
    int64_t give_up_ns = clock_now_ns() + 20000000000, seen = -1, at_first;
    while ((seen = frames_in(path)) < 1 && clock_now_ns() < give_up_ns)
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    EXPECT_AT_LEAST((double)seen, 1);
    at_first = seen;
    int64_t first_ns = clock_now_ns();
    clock_sleep_until_ns(first_ns + (int64_t)(filmed_ms * 1e6));
    int64_t elapsed_ns = clock_now_ns() - first_ns;
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    return at_first + elapsed_ns * 30 / 1000000000;
}

static void test_killed_take_loses_at_most_a_second(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %llu, %d kills\n", (unsigned long long)SEED, kills);
    int64_t worst = 0;
    for (int i = 0; i < kills; i++) {
        char name[32], path[512];
        snprintf(name, sizeof name, "killed%d.reenact", i);
        snprintf(path, sizeof path, "%s", scratch_file(&scratch, name));
        int64_t filmed = film_and_kill(path, 1500 * rng_uniform(&rng));
        struct recording_report report;
        EXPECT_STATUS(recording_verify(path, &report), OK);
        EXPECT_INT(report.interrupted_takes, 1);
        int64_t kept = frames_in(path);
        worst = filmed - kept > worst ? filmed - kept : worst;
        EXPECT_AT_LEAST((double)kept, (double)filmed - 30);
        // and it can be added to
        struct recording_writer *writer;
        EXPECT_STATUS(recording_append(&writer, path), OK);
        EXPECT_STATUS(recording_close(&writer), OK);
        EXPECT_INT(frames_in(path), kept);
    }
    print_message("at most %lld frames (%.2f s) short\n", (long long)worst, (double)worst / 30);
}

// After Ctrl-C the take ends complete, with all its frames.
static void test_interrupt_ends_take_cleanly(void **state)
{
    (void)state;
    const char *path = scratch_file(&scratch, "stopped.reenact");
    const char *const argv[] = {
        PROGRAM_DIR "/reenact-capture", "record", "--sensor", "openni", "--out", path, "--take", "long", NULL};
    pid_t child = process_start(argv);
    int64_t give_up_ns = clock_now_ns() + 20000000000;
    while (frames_in(path) < 1 && clock_now_ns() < give_up_ns)
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    kill(child, SIGINT);
    int status;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_INT(WEXITSTATUS(status), 0);
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.interrupted_takes, 0);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    make_folder();
    setenv("REENACT_FAKE_SENSOR", scratch_file(&scratch, "sensor"), 1);
    setenv("REENACT_FAKE_SENSOR_AT_END", "loop", 1);
    setenv("LD_LIBRARY_PATH", OPENNI2_DIR, 1);
    // OpenNI2 unloads its drivers before the leak check runs in the child, which then cannot
    // attribute their leaks; test_recorder checks for leaks in one process.
    setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_killed_take_loses_at_most_a_second),
        cmocka_unit_test(test_interrupt_ends_take_cleanly),
    };
    if (argc > 1)
        kills = atoi(argv[1]);
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
