// The studio: its state machine, and the whole of it drawn into memory while it films the small world: from the sensor
// to a take kept, played back, renamed, discarded.
//
//     test_studio             the tests
//     test_studio FOLDER      images of the screens, for the documents
#include "app/studio/studio.h"

#include "base/clock.h"
#include "capture/recording/recording.h"
#include "platform/file.h"
#include "platform/png.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/film.h"
#include "tests/support/process.h"
#include "tests/support/test.h"

#include <stdio.h>
#include <string.h>

static const int64_t SECOND = 1000000000;

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
    studio_take_ready(&s, 0);
    EXPECT_INT(s.page, STUDIO_REVIEW);
    studio_do(&s, STUDIO_PLAY, 0);
    EXPECT_TRUE(s.page == STUDIO_PLAYBACK && next_command(&s, STUDIO_OPEN_PLAYBACK));
    studio_do(&s, STUDIO_BACK, 0);
    EXPECT_TRUE(s.page == STUDIO_REVIEW && next_command(&s, STUDIO_CLOSE_PLAYBACK));
    studio_do(&s, STUDIO_EDIT_NAME, 0);
    for (const char *key = "\b\b\b\b\b\bkata"; *key; key++)
        studio_type(&s, *key, 0);
    EXPECT_TRUE(!strcmp(s.name, "kata"));
    studio_type(&s, 13, 0);
    EXPECT_TRUE(next_command(&s, STUDIO_RENAME_TAKE));
    studio_renamed(&s, true, 0);
    EXPECT_TRUE(s.page == STUDIO_REVIEW && !strcmp(s.take, "kata"));
    studio_do(&s, STUDIO_KEEP, 0);
    EXPECT_TRUE(s.page == STUDIO_LIVE && s.kept == 1 && s.number == 2);
}

static void test_takes_are_discarded_and_made_again(void **state)
{
    (void)state;
    struct studio_state s = studio_start(true);
    s.page = STUDIO_REVIEW;
    studio_do(&s, STUDIO_RETAKE, 0);
    EXPECT_TRUE(s.page == STUDIO_COUNTDOWN && next_command(&s, STUDIO_DELETE_TAKE) && s.number == 1);
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

// ---------------------------------------------------------------- drawn into memory

struct stage {
    struct scratch scratch;
    struct studio studio;
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    int64_t skipped_ns; // added to the clock, so that countdowns take no time
    uint8_t *rgba;
    const char *folder; // for images of the screens; NULL: none
};

static void stage_size(struct stage *g, int width, int height)
{
    gpu_target_close(&g->target);
    free(g->rgba);
    g->width = width;
    g->height = height;
    g->rgba = malloc((size_t)width * (size_t)height * 4);
    EXPECT_STATUS(gpu_target_open(&g->target, g->gpu, width, height), OK);
}

static void draw(struct stage *g)
{
    const int64_t now_ns = clock_now_ns() + g->skipped_ns;
    const struct viewer_surface surface = {g->target, g->width, g->height, 0, viewer_px_per_dp(149)};
    studio_update(&g->studio, now_ns);
    EXPECT_STATUS(studio_draw(&g->studio, &surface, now_ns), OK);
    if (g->studio.playing)
        viewer_presented(&g->studio.viewer, now_ns);
}

static void wait_for(struct stage *g, enum studio_page page, int64_t frames)
{
    const int64_t until = clock_now_ns() + 200 * SECOND;
    do {
        draw(g);
        clock_sleep_until_ns(clock_now_ns() + 20000000);
    } while (clock_now_ns() < until &&
             (g->studio.state.page != page || g->studio.shown.number < frames || !g->studio.shown.has_skeleton));
    EXPECT_INT(g->studio.state.page, page);
    draw(g);
}

// How many colours the screen has: tells a picture from a plain page.
static int colors(struct stage *g)
{
    static bool seen[4096];
    int count = 0;
    EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK);
    memset(seen, 0, sizeof seen);
    for (int i = 0; i < g->width * g->height; i++) {
        const uint8_t *p = g->rgba + 4 * i;
        const int which = p[0] >> 4 << 8 | p[1] >> 4 << 4 | p[2] >> 4;
        count += !seen[which];
        seen[which] = true;
    }
    return count;
}

static void save(struct stage *g, const char *name)
{
    char path[600];
    if (!g->folder)
        return;
    EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK);
    uint8_t *rgb = malloc(3 * (size_t)g->width * (size_t)g->height);
    for (int i = 0; i < g->width * g->height; i++)
        memcpy(rgb + 3 * i, g->rgba + 4 * i, 3);
    snprintf(path, sizeof path, "%s/studio-%s.png", g->folder, name);
    EXPECT_STATUS(png_write(path, PNG_RGB8, rgb, g->width, g->height), OK);
    free(rgb);
}

// The page wide and upright, dark and light.
static void save_all(struct stage *g, const char *page)
{
    static const char *const themes[] = {"dark", "light"};
    for (int light = 0; light < 2 && g->folder; light++)
        for (int upright = 0; upright < 2; upright++) {
            char name[64];
            stage_size(g, upright ? 800 : 1280, upright ? 1280 : 800);
            g->studio.state.dark = !light;
            draw(g);
            snprintf(name, sizeof name, "%s-%s-%s", page, upright ? "upright" : "wide", themes[light]);
            save(g, name);
        }
    g->studio.state.dark = true;
    stage_size(g, 1280, 800);
}

static void press(struct stage *g, int key)
{
    const struct window_event event = {.kind = WINDOW_KEY, .key = key};
    studio_event(&g->studio, &event, 1, clock_now_ns() + g->skipped_ns);
    draw(g);
}

static int takes_in(const char *file)
{
    struct recording *recording;
    if (!file_exists(file) || recording_open(&recording, file) != OK)
        return 0;
    int count = recording_take_count(recording);
    recording_free(&recording);
    return count;
}

static void record_a_take(struct stage *g)
{
    press(g, ' ');
    EXPECT_INT(g->studio.state.page, STUDIO_COUNTDOWN);
    save_all(g, "countdown");
    g->skipped_ns += 6 * SECOND;
    draw(g);
    EXPECT_INT(g->studio.state.page, STUDIO_RECORDING);
}

static void film_takes(struct stage *g, const char *uri)
{
    char file[300];
    snprintf(file, sizeof file, "%s", scratch_file(&g->scratch, "film.reenact"));
    EXPECT_STATUS(gpu_open(&g->gpu), OK);
    stage_size(g, 1280, 800);
    const struct studio_options options = {.file = file, .sensor = uri, .refresh_hz = 60};
    EXPECT_STATUS(studio_open(&g->studio, g->gpu, &options), OK);
    wait_for(g, STUDIO_LIVE, 20);
    EXPECT_AT_LEAST(colors(g), 100);
    EXPECT_TRUE(g->studio.shown.has_color && g->studio.shown.has_depth);
    save_all(g, "live");
    record_a_take(g);
    wait_for(g, STUDIO_REVIEW, 1); // the film ends by itself
    EXPECT_TRUE(g->studio.shown.take_frames > 20 && !*g->studio.shown.failure);
    printf("take of %lld frames: %s\n", (long long)g->studio.shown.take_frames, g->studio.shown.verdict.line[0]);
    EXPECT_TRUE(!g->studio.shown.verdict.good); // nothing of the back was shown
    save_all(g, "review");
    press(g, 'p');
    EXPECT_TRUE(g->studio.playing);
    for (int i = 0; i < 10; i++)
        draw(g);
    EXPECT_AT_LEAST(colors(g), 20);
    save(g, "playback");
    g->studio.viewer.state.quit = true;
    draw(g);
    draw(g);
    EXPECT_TRUE(!g->studio.playing && g->studio.state.page == STUDIO_REVIEW);
    press(g, 'n');
    for (const char *key = "\b\b\b\b\b\bfirst"; *key; key++)
        press(g, *key);
    save(g, "rename");
    press(g, WINDOW_KEY_ENTER);
    EXPECT_TRUE(!strcmp(g->studio.state.take, "first") && g->studio.state.page == STUDIO_REVIEW);
    press(g, 'k');
    EXPECT_INT(takes_in(file), 1);
    // A second one, stopped by hand and discarded.
    wait_for(g, STUDIO_LIVE, 1);
    record_a_take(g);
    for (int64_t until = clock_now_ns() + 60 * SECOND;
         g->studio.shown.doing != STUDIO_DOING_TAKE && clock_now_ns() < until;)
        draw(g);
    save_all(g, "recording");
    press(g, ' ');
    wait_for(g, STUDIO_REVIEW, 1);
    press(g, 'x');
    EXPECT_INT(g->studio.state.page, STUDIO_LIVE);
    EXPECT_INT(takes_in(file), 1);
    studio_close(&g->studio);
}

static void stage_close(struct stage *g)
{
    gpu_target_close(&g->target);
    gpu_close(&g->gpu);
    free(g->rgba);
    scratch_remove(&g->scratch);
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
    keep_player();
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
        draw(&g);
    EXPECT_INT(g.studio.state.page, STUDIO_TROUBLE);
    EXPECT_TRUE(strstr(g.studio.state.trouble, "/nowhere") != NULL);
    draw(&g);
    studio_close(&g.studio);
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
        cmocka_unit_test(test_from_sensor_to_kept),      cmocka_unit_test(test_takes_are_discarded_and_made_again),
        cmocka_unit_test(test_a_missing_sensor_is_said), cmocka_unit_test(test_takes_of_a_film),
        cmocka_unit_test(test_takes_through_openni),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
