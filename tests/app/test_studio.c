// The studio: its state machine, and the whole of it drawn into memory while it films the small world: from the sensor
// to a take kept, played back, renamed, discarded.
//
//     test_studio             the tests
//     test_studio FOLDER      images of the screens, for the documents
#include "tests/support/test.h"

#include "app/studio/studio.h"
#include "app/studio/studio_screen.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "recording/recording.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/film.h"
#include "tests/support/process.h"
#include "tests/support/studio_stage.h"

#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the state machine

static bool next_command(struct studio_state *s, enum studio_command wanted)
{
    enum studio_command got;
    return studio_take_command(s, &got) && got == wanted;
}

static void test_from_sensor_to_kept(void **state)
{
    (void)state;
    struct studio_state s = studio_start(true);
    studio_set_sensors(&s, 2, 0);
    studio_choose_sensor(&s, 2, 0); // there is none
    EXPECT_INT(s.page, STUDIO_SENSORS);
    studio_choose_sensor(&s, 1, 0);
    EXPECT_INT(s.page, STUDIO_OPENING);
    EXPECT_TRUE(next_command(&s, STUDIO_OPEN_SENSOR));
    studio_do(&s, STUDIO_START, 0); // not yet
    EXPECT_INT(s.page, STUDIO_OPENING);
    studio_sensor_ready(&s, 0);
    studio_do(&s, STUDIO_START, 0);
    EXPECT_INT(s.page, STUDIO_COUNTDOWN);
    int tones = 0;
    enum studio_command command = STUDIO_TONE;
    for (int64_t t = 0; s.page == STUDIO_COUNTDOWN && t < 10 * SECOND; t += SECOND / 20) {
        studio_tick(&s, t);
        while (s.page == STUDIO_COUNTDOWN && studio_take_command(&s, &command))
            tones += command == STUDIO_TONE;
    }
    EXPECT_INT(tones, STUDIO_COUNTDOWN_S);
    EXPECT_INT(s.page, STUDIO_RECORDING);
    EXPECT_TRUE(next_command(&s, STUDIO_BEGIN_TAKE) && !strcmp(s.take, "take-1"));
    EXPECT_TRUE(next_command(&s, STUDIO_TONE_BEGIN));
    studio_do(&s, STUDIO_BACK, 0); // a key loses no take
    EXPECT_INT(s.page, STUDIO_RECORDING);
    studio_do(&s, STUDIO_START, 0);
    EXPECT_INT(s.page, STUDIO_FINISHING);
    EXPECT_TRUE(next_command(&s, STUDIO_END_TAKE) && next_command(&s, STUDIO_TONE_END));
    studio_take_ready(&s, 60, 0);
    EXPECT_INT(s.page, STUDIO_REVIEW);
    studio_do(&s, STUDIO_PLAY, 0);
    EXPECT_TRUE(s.page == STUDIO_PLAYBACK && next_command(&s, STUDIO_OPEN_PLAYBACK));
    studio_do(&s, STUDIO_BACK, 0);
    EXPECT_TRUE(s.page == STUDIO_REVIEW && next_command(&s, STUDIO_CLOSE_PLAYBACK));
    studio_do(&s, STUDIO_EDIT_NAME, 0);
    for (int i = 0; i < 6; i++)
        studio_type_back(&s);
    EXPECT_TRUE(!*s.name);
    studio_type(&s, "Kata");
    studio_type(&s, "ü\n"); // no line break in a name
    EXPECT_TRUE(!strcmp(s.name, "Kataü"));
    studio_type_back(&s);
    studio_type_done(&s, 0);
    EXPECT_TRUE(next_command(&s, STUDIO_RENAME_TAKE));
    studio_renamed(&s, true, 0);
    EXPECT_TRUE(s.page == STUDIO_REVIEW && !strcmp(s.take, "Kata"));
    studio_do(&s, STUDIO_KEEP, 0);
    EXPECT_TRUE(s.page == STUDIO_LIVE && s.kept == 1 && s.number == 2);
}

static void test_takes_are_discarded_and_made_again(void **state)
{
    (void)state;
    struct studio_state s = studio_start(true);
    s.page = STUDIO_REVIEW;
    studio_do(&s, STUDIO_RETAKE, 0);
    EXPECT_TRUE(s.page == STUDIO_COUNTDOWN && s.waiting.kind == ERASES_TAKE && s.number == 2);
    s.queued = 0;
    studio_do(&s, STUDIO_START, 0); // taken back
    EXPECT_INT(s.page, STUDIO_LIVE);
    // Leaving while a take is made ends it first.
    s.page = STUDIO_RECORDING;
    s.queued = 0;
    studio_do(&s, STUDIO_QUIT, 0);
    EXPECT_TRUE(s.quit && s.page == STUDIO_FINISHING && next_command(&s, STUDIO_END_TAKE));
    studio_fail(&s, "unplugged", 0);
    EXPECT_TRUE(s.page == STUDIO_TROUBLE);
    studio_do(&s, STUDIO_SENSORS_AGAIN, 0);
    EXPECT_TRUE(s.page == STUDIO_SENSORS);
}

static struct studio_state reviewing(const char *take)
{
    struct studio_state s = studio_start(true);
    s.page = STUDIO_REVIEW;
    snprintf(s.take, sizeof s.take, "%s", take);
    return s;
}

// Whether the file is to be changed at this time. Nothing but that is asked for.
static bool erases(struct studio_state *s, enum studio_command wanted, int64_t now_ns)
{
    enum studio_command got;
    studio_tick(s, now_ns);
    if (!studio_take_command(s, &got))
        return false;
    EXPECT_INT(got, wanted);
    return true;
}

static void test_discarding_can_be_taken_back(void **state)
{
    (void)state;
    struct studio_state s = reviewing("take-1");
    studio_do(&s, STUDIO_DISCARD, 0);
    EXPECT_INT(s.page, STUDIO_LIVE);
    EXPECT_INT(studio_undo_left_s(&s, 1), STUDIO_UNDO_S);
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, STUDIO_UNDO_S * SECOND - 1));
    studio_do(&s, STUDIO_UNDO, STUDIO_UNDO_S * SECOND - 1); // back to its verdict
    EXPECT_TRUE(s.page == STUDIO_REVIEW && !s.kept && !strcmp(s.take, "take-1"));
    EXPECT_INT(studio_undo_left_s(&s, 0), 0);
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, 100 * SECOND));
    studio_do(&s, STUDIO_DISCARD, 100 * SECOND);
    EXPECT_TRUE(erases(&s, STUDIO_DELETE_TAKE, 110 * SECOND));
    assert_string_equal(s.erasing.take, "take-1");
    EXPECT_INT(s.discarded, 1);
    studio_do(&s, STUDIO_UNDO, 111 * SECOND); // too late
    EXPECT_INT(s.page, STUDIO_LIVE);
    // Another program has the file: tried again.
    studio_erasure_failed(&s, "in use", true, 111 * SECOND);
    EXPECT_INT(s.discarded, 0);
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, 120 * SECOND) && erases(&s, STUDIO_DELETE_TAKE, 121 * SECOND));
    studio_erasure_failed(&s, "no such take", false, 121 * SECOND);
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, 200 * SECOND));
}

// While another take is made the file has another writer, and the next take has another name.
static void test_discarding_waits_for_a_take(void **state)
{
    (void)state;
    struct studio_state s = reviewing("take-1");
    studio_do(&s, STUDIO_RETAKE, 0);
    s.queued = 0;
    for (int64_t at = 0; s.page == STUDIO_COUNTDOWN && at < 10 * SECOND; at += SECOND / 20) {
        studio_tick(&s, at);
        s.queued = 0;
    }
    assert_string_equal(s.take, "take-2");
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, 60 * SECOND));
    EXPECT_INT(studio_undo_left_s(&s, 60 * SECOND), 1); // and can still be taken back
    s.page = STUDIO_FINISHING;
    EXPECT_TRUE(!erases(&s, STUDIO_DELETE_TAKE, 60 * SECOND));
    struct studio_state other = s;
    studio_do(&other, STUDIO_UNDO, 60 * SECOND);
    EXPECT_TRUE(other.page == STUDIO_FINISHING && other.kept == 1);
    studio_take_ready(&s, 10, 61 * SECOND);
    EXPECT_TRUE(erases(&s, STUDIO_DELETE_TAKE, 61 * SECOND));
    assert_string_equal(s.erasing.take, "take-1");
    // Two in a row: the first is gone when the second is discarded.
    struct studio_state two = reviewing("take-1");
    studio_do(&two, STUDIO_DISCARD, 0);
    two.page = STUDIO_REVIEW;
    snprintf(two.take, sizeof two.take, "take-2");
    studio_do(&two, STUDIO_DISCARD, SECOND);
    EXPECT_TRUE(next_command(&two, STUDIO_DELETE_TAKE));
    assert_string_equal(two.erasing.take, "take-1");
    assert_string_equal(two.waiting.take, "take-2");
}

static void test_trimming_can_be_taken_back(void **state)
{
    (void)state;
    struct studio_state s = reviewing("take-1");
    for (int turn = 0; turn < 2; turn++) {
        s.page = STUDIO_PLAYBACK;
        s.trim_from_ns = 2 * SECOND;
        s.trim_to_ns = 5 * SECOND;
        studio_do(&s, STUDIO_TRIM, 0);
        EXPECT_TRUE(s.page == STUDIO_REVIEW && next_command(&s, STUDIO_CLOSE_PLAYBACK));
        EXPECT_TRUE(!erases(&s, STUDIO_TRIM_TAKE, 9 * SECOND));
        if (!turn) {
            studio_do(&s, STUDIO_UNDO, 9 * SECOND);
            EXPECT_TRUE(s.page == STUDIO_REVIEW && !s.kept && !erases(&s, STUDIO_TRIM_TAKE, 20 * SECOND));
        }
    }
    // Looked at once more, and renamed meanwhile.
    studio_do(&s, STUDIO_PLAY, 9 * SECOND);
    EXPECT_TRUE(next_command(&s, STUDIO_OPEN_PLAYBACK));
    EXPECT_TRUE(!erases(&s, STUDIO_TRIM_TAKE, 60 * SECOND));
    studio_do(&s, STUDIO_BACK, 60 * SECOND);
    EXPECT_TRUE(next_command(&s, STUDIO_CLOSE_PLAYBACK));
    snprintf(s.name, sizeof s.name, "kata");
    studio_renamed(&s, true, 61 * SECOND);
    EXPECT_TRUE(!erases(&s, STUDIO_TRIM_TAKE, 69 * SECOND) && erases(&s, STUDIO_TRIM_TAKE, 70 * SECOND));
    assert_string_equal(s.erasing.take, "kata");
    EXPECT_TRUE(s.erasing.from_ns == 2 * SECOND && s.erasing.to_ns == 5 * SECOND);
    // Who discards a take need not wait for its trimming.
    s.page = STUDIO_PLAYBACK;
    studio_do(&s, STUDIO_TRIM, 80 * SECOND);
    s.queued = 0;
    studio_do(&s, STUDIO_DISCARD, 81 * SECOND);
    EXPECT_TRUE(!s.queued && erases(&s, STUDIO_DELETE_TAKE, 91 * SECOND));
}

// A take at its verdict is in the file: whoever leaves is asked, and leaving again keeps it.
static void test_leaving_asks(void **state)
{
    (void)state;
    static const enum studio_page pages[] = {STUDIO_REVIEW, STUDIO_RENAME, STUDIO_PLAYBACK};
    for (size_t i = 0; i < COUNT_OF(pages); i++) {
        struct studio_state s = reviewing("take-1");
        s.page = pages[i];
        studio_do(&s, STUDIO_QUIT, 0);
        EXPECT_TRUE(s.page == STUDIO_LEAVING && !s.quit);
        struct studio_state stays = s, discards = s;
        studio_do(&s, STUDIO_QUIT, 0);
        EXPECT_TRUE(s.quit && s.kept == 1 && s.waiting.kind == ERASES_NOTHING);
        studio_do(&stays, STUDIO_BACK, 0);
        EXPECT_TRUE(stays.page == STUDIO_REVIEW && !stays.quit);
        discards.queued = 0;
        studio_do(&discards, STUDIO_DISCARD, 0);
        EXPECT_TRUE(discards.quit && erases(&discards, STUDIO_DELETE_TAKE, 1)); // not after ten seconds
    }
    struct studio_state s = reviewing("take-1"); // leaving carries out what waits
    studio_do(&s, STUDIO_DISCARD, 0);
    studio_do(&s, STUDIO_QUIT, 1);
    EXPECT_TRUE(s.quit && erases(&s, STUDIO_DELETE_TAKE, 2));
    s = reviewing("take-1"); // who left while it was made has kept it
    s.page = STUDIO_RECORDING;
    studio_do(&s, STUDIO_QUIT, 0);
    studio_take_ready(&s, 30, 0);
    EXPECT_TRUE(s.quit && s.kept == 1);
}

// The next take's number is one that no take has, whatever the last one was renamed to.
static void test_numbers_of_takes(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int number;
    } names[] = {{"take-7", 7},
                 {"take-", 0},
                 {"take", 0},
                 {"", 0},
                 {"take-7b", 0},
                 {"take--7", 0},
                 {"retake-7", 0},
                 {"take-+7", 0},
                 {"take-999999999", 999999999},
                 {"take-4294967303", 0}};
    for (size_t i = 0; i < COUNT_OF(names); i++)
        EXPECT_INT(studio_take_number(names[i].name), names[i].number);
    struct studio_state s = studio_start(true);
    s.page = STUDIO_RENAME;
    snprintf(s.name, sizeof s.name, "take-7");
    studio_renamed(&s, true, 0);
    studio_do(&s, STUDIO_KEEP, 0);
    EXPECT_INT(s.number, 8);
}

// ---------------------------------------------------------------- drawn into memory

static void record_a_take(struct stage *g)
{
    stage_press(g, ' ');
    EXPECT_INT(g->studio.state.page, STUDIO_COUNTDOWN);
    stage_save_all(g, "countdown");
    g->skipped_ns += 6 * SECOND;
    stage_draw(g);
    EXPECT_INT(g->studio.state.page, STUDIO_RECORDING);
}

// Pages that pass too quickly, or not at all here.
static void save_other_pages(struct stage *g)
{
    static const struct {
        enum studio_page page;
        const char *name;
    } pages[] = {{STUDIO_OPENING, "opening"},
                 {STUDIO_FINISHING, "finishing"},
                 {STUDIO_SENSORS, "sensors"},
                 {STUDIO_TROUBLE, "trouble"}};
    struct studio *s = &g->studio;
    studio_session_close(&s->session); // it would lead on to the next page
    for (size_t i = 0; i < COUNT_OF(pages) && g->folder; i++) {
        studio_fail(&s->state, "the depth sensor PrimeSense Xtion Pro Live was unplugged", clock_now_ns());
        s->state.page = pages[i].page;
        s->state.looked_ns = clock_now_ns() + 1000 * SECOND; // or it would look for the sensor
        stage_save_all(g, pages[i].name);
    }
    s->state.page = STUDIO_SENSORS;
    s->device_count = 0;
    stage_save_all(g, "no-sensor");
}

static void film_takes(struct stage *g, const char *uri)
{
    char file[300];
    snprintf(file, sizeof file, "%s", scratch_file(&g->scratch, "film.reenact"));
    EXPECT_STATUS(gpu_open(&g->gpu), OK);
    stage_size(g, 1280, 800);
    const struct studio_options options = {.file = file, .sensor = uri, .refresh_hz = 60};
    EXPECT_STATUS(studio_open(&g->studio, g->gpu, &options), OK);
    stage_wait_for(g, STUDIO_LIVE, 20);
    EXPECT_AT_LEAST(stage_colors(g), 100);
    EXPECT_TRUE(g->studio.shown.has_color && g->studio.shown.has_depth);
    stage_save_all(g, "live");
    record_a_take(g);
    stage_wait_for(g, STUDIO_REVIEW, 1); // the film ends by itself
    EXPECT_TRUE(g->studio.shown.judgement.frames > 20 && !*g->studio.shown.failure);
    printf("take of %lld frames: %s\n", (long long)g->studio.shown.judgement.frames,
           g->studio.shown.judgement.verdict.line[0].text);
    EXPECT_TRUE(!verdict_is_good_for(&g->studio.shown.judgement.verdict, USE_WATCH)); // nothing of the back was shown
    stage_save_all(g, "review");
    stage_press(g, 'p');
    EXPECT_TRUE(g->studio.playing);
    for (int i = 0; i < 10; i++)
        stage_draw(g);
    EXPECT_AT_LEAST(stage_colors(g), 20);
    stage_save_all(g, "playback");
    stage_press(g, 'd'); // what is chosen there holds for the studio's own pages
    viewer_state(g->studio.viewer)->quit = true;
    stage_draw(g);
    stage_draw(g);
    EXPECT_TRUE(!g->studio.playing && g->studio.state.page == STUDIO_REVIEW);
    EXPECT_TRUE(!g->studio.state.dark);
    stage_press(g, 'd');
    stage_press(g, 'n');
    EXPECT_TRUE(studio_types(&g->studio));
    for (int i = 0; i < 6; i++)
        stage_press(g, WINDOW_KEY_BACKSPACE);
    stage_press(g, 'f'); // comes as text, too
    stage_type(g, "First Übung");
    stage_save_all(g, "rename");
    stage_press(g, WINDOW_KEY_ENTER);
    EXPECT_TRUE(!studio_types(&g->studio));
    EXPECT_TRUE(!strcmp(g->studio.state.take, "First Übung") && g->studio.state.page == STUDIO_REVIEW);
    stage_press(g, 'k');
    EXPECT_INT(stage_takes_in(file), 1);
    // A second one, stopped by hand and discarded.
    stage_wait_for(g, STUDIO_LIVE, 1);
    record_a_take(g);
    // Not before its first frame: a take that has none is dropped. A busy machine may come to the film's end first.
    for (int64_t until = clock_now_ns() + 60 * SECOND;
         g->studio.state.page == STUDIO_RECORDING && !g->studio.shown.counters.frames && clock_now_ns() < until;)
        stage_draw(g);
    stage_save_all(g, "recording");
    if (g->studio.state.page == STUDIO_RECORDING)
        stage_press(g, ' ');
    stage_wait_for(g, STUDIO_REVIEW, 1);
    stage_press(g, 'x');
    EXPECT_INT(g->studio.state.page, STUDIO_LIVE);
    stage_save_all(g, "discarded");
    EXPECT_INT(stage_takes_in(file), 2); // it can be taken back
    stage_press(g, 'u');
    EXPECT_INT(g->studio.state.page, STUDIO_REVIEW);
    stage_press(g, 'q');
    EXPECT_INT(g->studio.state.page, STUDIO_LEAVING);
    stage_save_all(g, "leaving");
    stage_press(g, WINDOW_KEY_ESCAPE);
    stage_press(g, 'x');
    g->skipped_ns += STUDIO_UNDO_S * SECOND;
    stage_draw(g);
    EXPECT_INT(stage_takes_in(file), 1);
    save_other_pages(g);
    studio_close(&g->studio);
}

static void film_world(struct stage *g, double scale, int frames)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "kata";
    o.plain = !g->folder;
    EXPECT_STATUS(world_open(&world, &o), OK);
    g->scratch = scratch_make();
    film_sensor(world, &g->scratch, "sensor", scale, 0, frames);
    world_close(&world);
}

static const char *folder_of(const struct stage *g)
{
    static char uri[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&g->scratch, "sensor"));
    return uri;
}

static void test_takes_of_a_film(void **state)
{
    (void)state;
    static struct stage g;
    film_world(&g, 0.25, 45);
    film_takes(&g, folder_of(&g));
    stage_close(&g);
}

// The same through OpenNI2 and its driver for recordings.
static void test_takes_through_openni(void **state)
{
    (void)state;
    static struct stage g;
    char oni[300], uri[320];
    film_world(&g, 0.25, 45);
    snprintf(oni, sizeof oni, "%s", scratch_file(&g.scratch, "film.oni"));
    snprintf(uri, sizeof uri, "oni:%s", oni);
    const struct process_result said = PROCESS(MAKE_ONI, "--from", scratch_file(&g.scratch, "sensor"), "--out", oni);
    if (said.exit_code)
        print_error("%s", said.err);
    EXPECT_INT(said.exit_code, 0);
    film_takes(&g, uri);
    stage_close(&g);
}

// What was copied of a picture belongs to the lens that is said with it.
static void test_a_snapshot_follows_the_sensor(void **state)
{
    (void)state;
    static const uint8_t rgb[3 * 8 * 6] = {7};
    static const uint16_t depth[8 * 6] = {9};
    struct studio_snapshot from = {0}, to = {0};
    const struct lens large = {.width = 8, .height = 6}, small = {.width = 8, .height = 2};
    const struct calibration first = {.color = large, .depth = large}, second = {.color = small, .depth = large};
    studio_snapshot_calibrate(&from, &first);
    studio_snapshot_pictures(&from, rgb, depth, NULL);
    from.number = 1;
    EXPECT_TRUE(studio_snapshot_copy(&from, &to) && to.has_color && to.has_depth && to.color[0] == 7);
    studio_snapshot_calibrate(&from, &first); // opened again
    from.number = 2;
    EXPECT_TRUE(studio_snapshot_copy(&from, &to) && to.has_color && to.has_depth);
    studio_snapshot_calibrate(&from, &second);
    from.number = 3;
    EXPECT_TRUE(studio_snapshot_copy(&from, &to) && !to.has_color && to.has_depth && to.depth[0] == 9);
    studio_snapshot_pictures(&from, rgb, depth, NULL);
    from.number = 4;
    EXPECT_TRUE(studio_snapshot_copy(&from, &to) && to.has_color && to.color_bytes == 3 * 8 * 2);
    for (int i = 0; i < 30; i++) { // its colour camera fails; one lost image is nothing
        EXPECT_TRUE(studio_snapshot_sees_color(&from) == (i < 15));
        studio_snapshot_pictures(&from, NULL, depth, NULL);
    }
    studio_snapshot_pictures(&from, rgb, depth, NULL);
    EXPECT_TRUE(studio_snapshot_sees_color(&from));
    studio_snapshot_calibrate(&from, &(struct calibration){.depth = large});
    EXPECT_TRUE(!studio_snapshot_sees_color(&from));
    studio_snapshot_free(&from);
    studio_snapshot_free(&to);
}

enum { WALL_WIDTH = 160, WALL_HEIGHT_MOST = 200, WALL_MM = 2000 };

static void write_calibration(const struct scratch *scratch, const char *name, int height, bool color)
{
    const struct lens lens = {.width = WALL_WIDTH, .height = height, .fx = 140, .fy = 140, .cx = 80, .cy = 60};
    const struct calibration calibration = {
        .color = color ? lens : (struct lens){0}, .depth = lens, .registered = true, .color_from_depth = POSE_IDENTITY};
    char path[300];
    snprintf(path, sizeof path, "%s/calibration.json", scratch_file(scratch, name));
    EXPECT_STATUS(calibration_write(path, &calibration), OK);
}

// A sensor of that height that sees a wall, one frame of it.
static void film_wall(const struct scratch *scratch, const char *name, int height, bool color)
{
    static uint8_t rgb[3 * WALL_WIDTH * WALL_HEIGHT_MOST];
    static uint16_t depth[WALL_WIDTH * WALL_HEIGHT_MOST];
    char path[100];
    uint8_t *bytes;
    size_t count;
    for (int i = 0; i < WALL_WIDTH * WALL_HEIGHT_MOST; i++)
        depth[i] = WALL_MM;
    snprintf(path, sizeof path, "%s/depth.txt", name);
    scratch_text(scratch, path, "50.0 d.png\n");
    EXPECT_STATUS(png_encode(&(struct png_layout){PNG_GRAY16, WALL_WIDTH, height}, depth, 1, &bytes, &count), OK);
    snprintf(path, sizeof path, "%s/d.png", name);
    scratch_write(scratch, path, bytes, count);
    free(bytes);
    write_calibration(scratch, name, height, color);
    if (!color)
        return;
    snprintf(path, sizeof path, "%s/rgb.txt", name);
    scratch_text(scratch, path, "50.0 c.jpg\n");
    EXPECT_STATUS(jpeg_encode(rgb, WALL_WIDTH, height, 90, &bytes, &count), OK);
    snprintf(path, sizeof path, "%s/c.jpg", name);
    scratch_write(scratch, path, bytes, count);
    free(bytes);
}

// The colour in the middle of the large picture, which is at the top of an upright screen: of the wall black where the
// sensor has colour, else as its depth is drawn.
static void expect_large_picture(struct stage *g, bool color)
{
    const uint16_t wall = WALL_MM;
    uint8_t wanted[3] = {0};
    const uint8_t *got = g->rgba + 4 * ((size_t)g->height * 3 / 10 * (size_t)g->width + (size_t)g->width / 2);
    if (!color)
        studio_depth_colors(&wall, 1, 1, wanted);
    EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK);
    for (int c = 0; c < 3; c++)
        EXPECT_NEAR(got[c], wanted[c], 3);
}

// One sensor after another, whose pictures are as wide, and higher or lower, or depth alone.
static void test_sensors_of_different_kinds(void **state)
{
    (void)state;
    static struct stage g;
    static const char *const names[] = {"low", "high", "low", "depth", "high"};
    char uri[300];
    g.scratch = scratch_make();
    film_wall(&g.scratch, "low", 120, true);
    film_wall(&g.scratch, "high", 200, true);
    film_wall(&g.scratch, "depth", 120, false);
    EXPECT_STATUS(gpu_open(&g.gpu), OK);
    stage_size(&g, 800, 1280);
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&g.scratch, "low"));
    const struct studio_options options = {.file = scratch_file(&g.scratch, "film.reenact"), .sensor = uri};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    for (size_t i = 0; i < COUNT_OF(names); i++) {
        struct studio *s = &g.studio;
        const bool color = strcmp(names[i], "depth") != 0;
        const int height = strcmp(names[i], "high") ? 120 : 200;
        snprintf(s->devices[0].uri, sizeof s->devices[0].uri, "folder:%s", scratch_file(&g.scratch, names[i]));
        if (i) {
            studio_fail(&s->state, "unplugged", clock_now_ns());
            studio_do(&s->state, STUDIO_BACK, clock_now_ns());
            studio_choose_sensor(&s->state, 0, clock_now_ns());
        }
        const int64_t until = clock_now_ns() + 60 * SECOND;
        do
            stage_draw(&g);
        while ((s->state.page != STUDIO_LIVE || !s->shown.has_depth || s->shown.has_color != color ||
                s->shown.calibration.depth.height != height) &&
               clock_now_ns() < until);
        EXPECT_INT(s->shown.calibration.depth.height, height);
        EXPECT_TRUE(s->shown.has_depth && s->shown.has_color == color);
        stage_draw(&g);
        expect_large_picture(&g, color);
    }
    studio_close(&g.studio);
    stage_close(&g);
}

// What was pressed before a page was seen is not meant for it: not the key that came right behind the one that led to
// it, nor what came while the program was busy; and a finger that was lifted meanwhile presses nothing.
static void test_input_older_than_the_page_is_dropped(void **state)
{
    (void)state;
    static struct stage g;
    g.scratch = scratch_make();
    EXPECT_STATUS(gpu_open(&g.gpu), OK);
    stage_size(&g, 1280, 800);
    const struct studio_options options = {.file = scratch_file(&g.scratch, "film.reenact")};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    struct studio *s = &g.studio;
    static const struct window_event key = {.kind = WINDOW_KEY, .key = 'x'};
    const struct window_event text = {.kind = WINDOW_TEXT, .text = "x"}, shown = {.kind = WINDOW_SHOWN};
    studio_event(s, &key, 1, 0); // before the first frame
    s->state.page = STUDIO_REVIEW;
    snprintf(s->state.take, sizeof s->state.take, "take-1");
    stage_draw(&g);
    for (int turn = 0; turn < 2; turn++) {
        s->state.page = STUDIO_LIVE; // busy: the page has changed, and is not drawn
        stage_draw(&g);
        s->state.page = STUDIO_REVIEW;
        if (turn)
            stage_draw(&g);
        studio_event(s, &key, 1, clock_now_ns());
        EXPECT_INT(s->state.waiting.kind, turn ? ERASES_TAKE : ERASES_NOTHING);
    }
    s->state.waiting.kind = ERASES_NOTHING;
    s->state.page = STUDIO_REVIEW;
    stage_draw(&g);
    s->state.page = STUDIO_RENAME;
    *s->state.name = 0;
    studio_event(s, &text, 1, clock_now_ns());
    EXPECT_TRUE(!*s->state.name);
    s->state.changed = false; // what is no input arrives
    studio_event(s, &shown, 1, clock_now_ns());
    EXPECT_TRUE(s->state.changed);
    stage_draw(&g);
    studio_event(s, &text, 1, clock_now_ns());
    assert_string_equal(s->state.name, "x");
    // A finger goes down on one page and up on the next one.
    struct window_event finger = {.kind = WINDOW_POINTER_DOWN, .pointer = 1, .x = 60, .y = 740};
    s->state.page = STUDIO_LIVE;
    stage_draw(&g);
    studio_event(s, &finger, 1, clock_now_ns());
    EXPECT_TRUE(s->input.pointer_down);
    s->state.page = STUDIO_REVIEW;
    finger.kind = WINDOW_POINTER_UP;
    EXPECT_TRUE(!studio_event(s, &finger, 1, clock_now_ns()));
    EXPECT_TRUE(!s->input.pointer_down && !s->input.gesture.count);
    stage_draw(&g);
    EXPECT_INT(s->state.page, STUDIO_REVIEW);
    studio_close(&g.studio);
    stage_close(&g);
}

// What was chosen in the studio, or by the app, is found again by both.
static void test_colours_and_text_size_are_found_again(void **state)
{
    (void)state;
    static struct stage g;
    char why[200], path[300];
    g.scratch = scratch_make();
    snprintf(path, sizeof path, "%s", scratch_file(&g.scratch, "settings"));
    scratch_text(&g.scratch, "settings", "dark 0\ntext 1.25\nspeed 0.50\n"); // by the app
    EXPECT_STATUS(gpu_open(&g.gpu), OK);
    stage_size(&g, 640, 400);
    struct studio_options options = {.file = "none.reenact", .settings = path};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    EXPECT_TRUE(!g.studio.state.dark);
    EXPECT_NEAR(g.studio.state.text_size, 1.25, 0);
    stage_draw(&g);
    stage_press(&g, 'd');
    stage_press(&g, 'y');
    studio_close(&g.studio);
    const struct view_state start = view_state_start(0, false, 0);
    struct settings read = settings_of(&start);
    settings_file_read(path, &read, why, sizeof why);
    EXPECT_TRUE(read.dark && !*why);
    EXPECT_NEAR(read.text_size, 1.5, 0);
    EXPECT_NEAR(read.speed, 0.5, 0); // which is not the studio's
    // What one start asks for holds for that start alone.
    options.light = true;
    options.text_size = 1;
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    EXPECT_TRUE(!g.studio.state.dark);
    EXPECT_NEAR(g.studio.state.text_size, 1, 0);
    stage_draw(&g);
    studio_close(&g.studio);
    settings_file_read(path, &read, why, sizeof why);
    EXPECT_TRUE(read.dark);
    EXPECT_NEAR(read.text_size, 1.5, 0);
    stage_close(&g);
}

static void test_a_missing_sensor_is_said(void **state)
{
    (void)state;
    static struct stage g;
    g.scratch = scratch_make();
    EXPECT_STATUS(gpu_open(&g.gpu), OK);
    stage_size(&g, 800, 1280);
    const struct studio_options options = {.file = scratch_file(&g.scratch, "film.reenact"),
                                           .sensor = "folder:/nowhere"};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    for (int64_t until = clock_now_ns() + 20 * SECOND; g.studio.state.page != STUDIO_TROUBLE && clock_now_ns() < until;)
        stage_draw(&g);
    EXPECT_INT(g.studio.state.page, STUDIO_TROUBLE);
    EXPECT_TRUE(strstr(g.studio.state.trouble, "/nowhere") != NULL);
    stage_draw(&g);
    studio_close(&g.studio);
    stage_close(&g);
}

// Without the networks the person is tracked from depth alone; a sentence says why.
static void test_missing_networks_are_said(void **state)
{
    (void)state;
    static struct stage g;
    film_world(&g, 0.25, 10);
    const char *data = getenv("XDG_DATA_HOME");
    EXPECT_INT(setenv("XDG_DATA_HOME", scratch_file(&g.scratch, "none"), true), 0);
    EXPECT_STATUS(gpu_open(&g.gpu), OK);
    stage_size(&g, 800, 1280);
    char file[300];
    snprintf(file, sizeof file, "%s", scratch_file(&g.scratch, "film.reenact"));
    const struct studio_options options = {.file = file, .sensor = folder_of(&g), .body_points = true};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    for (int64_t until = clock_now_ns() + 60 * SECOND;
         !strstr(g.studio.state.notice, "from depth alone") && clock_now_ns() < until;)
        stage_draw(&g);
    EXPECT_TRUE(strstr(g.studio.state.notice, "from depth alone") != NULL);
    studio_close(&g.studio);
    if (data)
        EXPECT_INT(setenv("XDG_DATA_HOME", data, true), 0);
    else
        EXPECT_INT(unsetenv("XDG_DATA_HOME"), 0);
    stage_close(&g);
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        static struct stage g;
        g.folder = argv[1];
        film_world(&g, 0.75, 75);
        film_takes(&g, folder_of(&g));
        stage_close(&g);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_from_sensor_to_kept),
        cmocka_unit_test(test_takes_are_discarded_and_made_again),
        cmocka_unit_test(test_discarding_can_be_taken_back),
        cmocka_unit_test(test_discarding_waits_for_a_take),
        cmocka_unit_test(test_trimming_can_be_taken_back),
        cmocka_unit_test(test_leaving_asks),
        cmocka_unit_test(test_input_older_than_the_page_is_dropped),
        cmocka_unit_test(test_numbers_of_takes),
        cmocka_unit_test(test_a_snapshot_follows_the_sensor),
        cmocka_unit_test(test_sensors_of_different_kinds),
        cmocka_unit_test(test_colours_and_text_size_are_found_again),
        cmocka_unit_test(test_missing_networks_are_said),
        cmocka_unit_test(test_a_missing_sensor_is_said),
        cmocka_unit_test(test_takes_of_a_film),
        cmocka_unit_test(test_takes_through_openni),
    };
    keep_player(); // before the first test that starts OpenNI2, which loads it
    return cmocka_run_group_tests(tests, NULL, NULL);
}
