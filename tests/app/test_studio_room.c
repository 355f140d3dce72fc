// The room swept in the studio, kept and filmed in; a take that pauses and is trimmed; takes in a row; a sensor that is
// unplugged and comes back. The small world through OpenNI2's fake sensor and folders.
//
//     test_studio_room             the tests
//     test_studio_room FOLDER      images of the screens, for the documents
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/recorder.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/film.h"
#include "tests/support/studio_stage.h"

#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the state machine

static bool next_command(struct studio_state *s, enum studio_command wanted)
{
    enum studio_command got;
    return studio_take_command(s, &got) && got == wanted;
}

static void test_room_states(void **state)
{
    (void)state;
    struct studio_state s = studio_start(true);
    studio_do(&s, STUDIO_MAP_ROOM, 0); // not before there is a sensor
    EXPECT_INT(s.page, STUDIO_SENSORS);
    s.page = STUDIO_LIVE;
    studio_do(&s, STUDIO_MAP_ROOM, 0);
    EXPECT_TRUE(s.page == STUDIO_ROOM && next_command(&s, STUDIO_BEGIN_SWEEP));
    studio_do(&s, STUDIO_BACK, 0);
    EXPECT_TRUE(s.page == STUDIO_LIVE && next_command(&s, STUDIO_DROP_SWEEP));
    studio_do(&s, STUDIO_MAP_ROOM, 0);
    studio_do(&s, STUDIO_START, 0);
    EXPECT_TRUE(s.page == STUDIO_ROOM_FINISHING && next_command(&s, STUDIO_BEGIN_SWEEP) &&
                next_command(&s, STUDIO_END_SWEEP));
    studio_do(&s, STUDIO_BACK, 0); // the map is being computed
    EXPECT_INT(s.page, STUDIO_ROOM_FINISHING);
    studio_sweep_ready(&s, 0);
    studio_do(&s, STUDIO_PLAY, 0); // means nothing here
    EXPECT_INT(s.page, STUDIO_ROOM_REVIEW);
    studio_do(&s, STUDIO_RETAKE, 0);
    EXPECT_TRUE(s.page == STUDIO_ROOM && next_command(&s, STUDIO_DROP_ROOM) && next_command(&s, STUDIO_BEGIN_SWEEP));
    studio_sweep_finishing(&s, 0);
    studio_sweep_ready(&s, 0);
    studio_do(&s, STUDIO_KEEP, 0);
    EXPECT_TRUE(s.page == STUDIO_LIVE && next_command(&s, STUDIO_KEEP_ROOM));
}

static void test_pause_row_and_trim_states(void **state)
{
    (void)state;
    struct studio_state s = studio_start(true);
    s.page = STUDIO_RECORDING;
    studio_do(&s, STUDIO_PAUSE, 0);
    EXPECT_TRUE(s.paused && next_command(&s, STUDIO_PAUSE_TAKE) && next_command(&s, STUDIO_TONE));
    studio_do(&s, STUDIO_PAUSE, 0);
    EXPECT_TRUE(!s.paused && next_command(&s, STUDIO_RESUME_TAKE) && next_command(&s, STUDIO_TONE));
    studio_do(&s, STUDIO_IN_A_ROW, 0);
    studio_take_ready(&s, 60, 0);
    EXPECT_TRUE(s.page == STUDIO_LIVE && s.kept == 1 && s.number == 2 && !s.queued);
    s.page = STUDIO_FINISHING;
    studio_take_ready(&s, 0, 0); // not a picture
    EXPECT_TRUE(s.page == STUDIO_LIVE && s.kept == 1 && s.number == 2 && !s.queued && *s.notice);
    s.page = STUDIO_PLAYBACK;
    studio_do(&s, STUDIO_TRIM, 0);
    EXPECT_TRUE(s.page == STUDIO_REVIEW && next_command(&s, STUDIO_CLOSE_PLAYBACK) && !s.queued);
    EXPECT_INT(s.waiting.kind, ERASES_ENDS); // it can be taken back
    s.waiting.kind = ERASES_NOTHING;
    // What was plugged in again is found within some seconds.
    studio_fail(&s, "unplugged", 0);
    studio_tick(&s, SECOND);
    EXPECT_INT(s.queued, 0);
    studio_tick(&s, 3 * SECOND);
    EXPECT_TRUE(next_command(&s, STUDIO_OPEN_SENSOR));
    studio_tick(&s, 4 * SECOND);
    EXPECT_INT(s.queued, 0);
    studio_sensor_ready(&s, 5 * SECOND);
    EXPECT_INT(s.page, STUDIO_LIVE);
}

// ---------------------------------------------------------------- the room

// Until the page is left or `frames` were seen on it.
static void wait_page(struct stage *g, enum studio_page page, int64_t frames)
{
    const int64_t until = clock_now_ns() + 200 * SECOND;
    while (clock_now_ns() < until && (g->studio.state.page != page || g->studio.shown.number < frames)) {
        stage_draw(g);
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    }
    EXPECT_INT(g->studio.state.page, page);
    stage_draw(g);
}

static void open_stage(struct stage *g, const char *uri)
{
    EXPECT_STATUS(gpu_open(&g->gpu), OK);
    stage_size(g, 1280, 800);
    static char file[300];
    snprintf(file, sizeof file, "%s", scratch_file(&g->scratch, "film.reenact"));
    const struct studio_options options = {.file = file, .sensor = uri, .refresh_hz = 60};
    EXPECT_STATUS(studio_open(&g->studio, g->gpu, &options), OK);
}

static void sweep_and_keep(struct stage *g, int frames)
{
    const struct studio_room_view *room = &g->studio.shown.room;
    wait_page(g, STUDIO_LIVE, 2);
    EXPECT_TRUE(!g->studio.shown.has_place);
    stage_press(g, 'm');
    EXPECT_INT(g->studio.state.page, STUDIO_ROOM);
    const int64_t until = clock_now_ns() + 200 * SECOND;
    while (room->plan.frames < 2 * frames / 3 && g->studio.state.page == STUDIO_ROOM && clock_now_ns() < until)
        stage_draw(g);
    printf("sweep: %d of %d images located, %d tags; %s\n", room->plan.frames_located, room->plan.frames,
           room->plan.tags_seen, room->plan.text);
    EXPECT_AT_LEAST(room->plan.tags_seen, 3);
    EXPECT_AT_LEAST(stage_colors(g), 20);
    stage_save_all(g, "room");
    wait_page(g, STUDIO_ROOM_REVIEW, 1); // the film ends by itself
    printf("map: %s; %s%s\n", room->advice.summary, room->advice.count ? room->advice.line[0] : "no gaps",
           room->failure);
    EXPECT_TRUE(!*room->failure && room->plan.tags_seen >= 3 && *room->advice.summary);
    stage_save_all(g, "room-review");
    stage_press(g, 'k');
    EXPECT_INT(g->studio.state.page, STUDIO_LIVE);
}

static void film_room(struct stage *g, int frames)
{
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "kata";
    o.threads = 2;
    EXPECT_STATUS(world_open(&world, &o), OK);
    g->scratch = scratch_make();
    film_sweep(world, &g->scratch, "sensor", 1, frames, "tags.json");
    film_sensor(world, &g->scratch, "actor", 1, 0, g->folder ? 60 : 15);
    world_close(&world);
}

// Swept, kept, and filmed in by the same sensor: the file has the place, and the take stands in it.
static void room_and_take(struct stage *g, int frames)
{
    char uri[300], sensor[256], actor[256], away[256];
    struct recording *recording;
    struct place place;
    film_room(g, frames);
    snprintf(sensor, sizeof sensor, "%s", scratch_file(&g->scratch, "sensor"));
    snprintf(actor, sizeof actor, "%s", scratch_file(&g->scratch, "actor"));
    snprintf(away, sizeof away, "%s", scratch_file(&g->scratch, "away"));
    snprintf(uri, sizeof uri, "folder:%s", sensor);
    open_stage(g, uri);
    sweep_and_keep(g, frames);
    // From here on the sensor stands still and sees the actor.
    EXPECT_TRUE(!rename(sensor, away) && !rename(actor, sensor));
    stage_press(g, ' ');
    g->skipped_ns += 6 * SECOND;
    stage_draw(g);
    wait_page(g, STUDIO_REVIEW, 1);
    EXPECT_TRUE(!*g->studio.shown.failure && g->studio.shown.has_place);
    stage_press(g, 'k');
    const int64_t until = clock_now_ns() + 100 * SECOND;
    while ((!g->studio.shown.located || !g->studio.shown.has_skeleton || g->studio.shown.counters.mb_per_s <= 0) &&
           clock_now_ns() < until)
        stage_draw(g);
    const struct sensor_sight *sight = &g->studio.shown.sight;
    printf("the place is known to %.1f mm, %d tags in sight, depth %.3f of the tags'\n", sight->position_sigma_m * 1e3,
           sight->tag_count, sight->depth_scale);
    EXPECT_TRUE(g->studio.shown.located && sight->tag_count > 0);
    EXPECT_AT_MOST(sight->position_sigma_m, 0.05);
    EXPECT_TRUE(g->studio.shown.counters.mb_per_s > 0 && g->studio.shown.counters.minutes_left > 0);
    stage_save_all(g, "place");
    EXPECT_STATUS(recording_open(&recording, g->studio.options.file), OK);
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    struct take *take;
    EXPECT_STATUS(take_open(&take, recording, "take-1"), OK);
    EXPECT_TRUE(place.tag_count >= 3 && take_entry(take, take_frame_count(take) - 1)->located);
    take_close(&take);
    place_free(&place);
    recording_free(&recording);
    studio_close(&g->studio);
}

static struct scratch swept; // what test_room_and_take leaves: the room's film in "away", and its tags

static void test_room_and_take(void **state)
{
    (void)state;
    static struct stage g;
    room_and_take(&g, 24);
    swept = g.scratch;
    g.scratch = scratch_make();
    stage_close(&g);
}

// The sensor's film, at a quarter of its size, in a scratch folder. tags: as world_options has them, 0: all. Returns
// the URI, valid until the next call.
static const char *film_for(struct stage *g, const char *motion, uint32_t tags, int frames)
{
    static char uri[300];
    struct world *world;
    struct world_options o = world_default_options();
    o.plain = true;
    o.motion = motion;
    if (tags)
        o.tags = tags;
    EXPECT_STATUS(world_open(&world, &o), OK);
    g->scratch = scratch_make();
    film_sensor(world, &g->scratch, "sensor", 0.25, 0, frames);
    world_close(&world);
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&g->scratch, "sensor"));
    return uri;
}

// Tags that are nowhere in the pictures: no map, a reason, and nothing is kept.
static void test_no_map_is_said(void **state)
{
    (void)state;
    static struct stage g;
    const char *uri = film_for(&g, "pirouette", 1, 12);
    scratch_text(&g.scratch, "tags.json", "{\"family\": \"tag36h11\", \"side_m\": {\"77\": 0.2}}");
    open_stage(&g, uri);
    wait_page(&g, STUDIO_LIVE, 2);
    stage_press(&g, 'm');
    wait_page(&g, STUDIO_ROOM_REVIEW, 1);
    printf("no map: %s\n", g.studio.shown.room.failure);
    EXPECT_TRUE(strstr(g.studio.shown.room.failure, "none of the listed tags") != NULL);
    stage_press(&g, 'x');
    EXPECT_TRUE(g.studio.state.page == STUDIO_LIVE && stage_takes_in(g.studio.options.file) == 0);
    studio_close(&g.studio);
    stage_close(&g);
}

// ---------------------------------------------------------------- a live sensor

static void fake(const char *name, const char *value)
{
    char full[64];
    snprintf(full, sizeof full, "REENACT_FAKE_SENSOR%s%s", *name ? "_" : "", name);
    setenv(full, value, 1);
}

// Two takes in a row with a pause in the first; then the plug is pulled, and put back.
static void test_a_live_sensor(void **state)
{
    (void)state;
    static struct stage g;
    struct recording *recording;
    struct take *take;
    film_for(&g, "kata", 0, 40);
    fake("", scratch_file(&g.scratch, "sensor"));
    fake("FPS", "15");
    fake("AT_END", "loop");
    open_stage(&g, "openni");
    wait_page(&g, STUDIO_LIVE, 5);
    stage_press(&g, 'r');
    for (int i = 0; i < 2; i++) {
        stage_press(&g, ' ');
        g.skipped_ns += 6 * SECOND;
        stage_draw(&g);
        const int64_t until = clock_now_ns() + 60 * SECOND;
        while (clock_now_ns() < until &&
               (g.studio.shown.doing != STUDIO_DOING_TAKE || g.studio.shown.counters.frames < 15))
            stage_draw(&g);
        if (i == 0) {
            stage_press(&g, 'p');
            while (!strstr(g.studio.shown.text, "paused") && clock_now_ns() < until) // frames were on their way
                stage_draw(&g);
            EXPECT_TRUE(strstr(g.studio.shown.text, "paused") != NULL);
            stage_save(&g, "paused");
            stage_press(&g, 'p');
            while (g.studio.shown.counters.frames < 25 && clock_now_ns() < until)
                stage_draw(&g);
        }
        stage_press(&g, ' ');
        wait_page(&g, STUDIO_LIVE, 1);
        printf("%s\n", g.studio.state.notice);
        EXPECT_INT(g.studio.state.kept, i + 1);
    }
    // Stopped as soon as it was started, before the sensor's next picture or after it: it ends.
    stage_press(&g, ' ');
    g.skipped_ns += 6 * SECOND;
    stage_draw(&g);
    EXPECT_INT(g.studio.state.page, STUDIO_RECORDING);
    stage_press(&g, ' ');
    wait_page(&g, STUDIO_LIVE, 1);
    EXPECT_INT(stage_takes_in(g.studio.options.file), g.studio.state.kept);
    EXPECT_STATUS(recording_open(&recording, g.studio.options.file), OK);
    EXPECT_STATUS(take_open(&take, recording, "take-1"), OK);
    int64_t longest = 0;
    for (int64_t i = 1; i < take_frame_count(take); i++)
        longest = take_entry(take, i)->time_ns - take_entry(take, i - 1)->time_ns > longest
                      ? take_entry(take, i)->time_ns - take_entry(take, i - 1)->time_ns
                      : longest;
    EXPECT_INT(longest, RECORDER_PAUSE_NS);
    take_close(&take);
    recording_free(&recording);
    // Unplugged: said. Plugged in again: used again.
    studio_close(&g.studio);
    fake("UNPLUG_AFTER", "12");
    const struct studio_options options = {
        .file = scratch_file(&g.scratch, "film.reenact"), .sensor = "openni", .refresh_hz = 60};
    EXPECT_STATUS(studio_open(&g.studio, g.gpu, &options), OK);
    wait_page(&g, STUDIO_TROUBLE, 1);
    printf("%s\n", g.studio.state.trouble);
    EXPECT_TRUE(strstr(g.studio.state.trouble, "unplugged") != NULL);
    fake("UNPLUG_AFTER", "-1");
    g.skipped_ns += 3 * SECOND;
    wait_page(&g, STUDIO_LIVE, 3);
    studio_close(&g.studio);
    stage_close(&g);
}

// Unplugged while it sweeps: what was swept until then is a map, which can be kept; then the sensor is opened again.
static void test_a_sweep_cut_off(void **state)
{
    (void)state;
    static struct stage g = {.skipped_ns = 0};
    struct recording *recording;
    struct place place;
    g.scratch = swept;
    EXPECT_TRUE(!remove(scratch_file(&swept, "film.reenact")));
    fake("", scratch_file(&swept, "away"));
    fake("FPS", "4");
    fake("AT_END", "loop");
    fake("UNPLUG_AFTER", "16");
    open_stage(&g, "openni");
    wait_page(&g, STUDIO_LIVE, 1);
    stage_press(&g, 'm');
    wait_page(&g, STUDIO_ROOM_REVIEW, 1);
    const struct studio_room_view *room = &g.studio.shown.room;
    printf("%d tags; %s; %s%s\n", room->plan.tags_seen, room->advice.summary,
           room->advice.count ? room->advice.line[0] : "", room->failure);
    EXPECT_TRUE(!*room->failure && room->advice.count > 0);
    EXPECT_TRUE(strstr(room->advice.line[0], "unplugged: the map is of what was swept until then") != NULL);
    EXPECT_AT_LEAST(room->plan.tags_seen, 3);
    stage_save(&g, "room-cut");
    fake("UNPLUG_AFTER", "-1");
    stage_press(&g, 'k');
    const int64_t until = clock_now_ns() + 60 * SECOND;
    while ((!g.studio.shown.has_place || g.studio.state.page != STUDIO_LIVE) && clock_now_ns() < until)
        stage_draw(&g);
    EXPECT_TRUE(g.studio.shown.has_place && g.studio.state.page == STUDIO_LIVE);
    const int64_t seen = g.studio.shown.number; // the sensor goes on
    wait_page(&g, STUDIO_LIVE, seen + 2);
    EXPECT_STATUS(recording_open(&recording, g.studio.options.file), OK);
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    EXPECT_AT_LEAST(place.tag_count, 3);
    place_free(&place);
    recording_free(&recording);
    studio_close(&g.studio);
    g.scratch = scratch_make(); // the film is used once more
    stage_close(&g);
}

// What cannot be kept waits until it can be, and the sensor may be unplugged meanwhile.
static void test_a_room_that_cannot_be_kept_at_once(void **state)
{
    (void)state;
    static struct stage g = {.skipped_ns = 0};
    struct recording_writer *writer;
    g.scratch = swept;
    EXPECT_TRUE(!remove(scratch_file(&swept, "film.reenact")));
    fake("FPS", "8");
    fake("UNPLUG_AFTER", "40"); // after 5 s
    open_stage(&g, "openni");
    const int64_t begun = clock_now_ns();
    wait_page(&g, STUDIO_LIVE, 1);
    stage_press(&g, 'm');
    wait_page(&g, STUDIO_ROOM, 12);
    stage_press(&g, ' ');
    wait_page(&g, STUDIO_ROOM_REVIEW, 1);
    assert_string_equal(g.studio.shown.room.failure, "");
    // Another writer's file.
    EXPECT_STATUS(recording_create(&writer, g.studio.options.file), OK);
    stage_press(&g, 'k');
    const int64_t until = clock_now_ns() + 60 * SECOND;
    while (!strstr(g.studio.state.notice, "written by another program") && clock_now_ns() < until)
        stage_draw(&g);
    EXPECT_TRUE(strstr(g.studio.state.notice, "written by another program") != NULL);
    EXPECT_INT(g.studio.state.page, STUDIO_ROOM_REVIEW);
    stage_save(&g, "room-not-kept");
    EXPECT_STATUS(recording_close(&writer), OK);
    clock_sleep_until_ns(begun + 7 * SECOND);
    fake("UNPLUG_AFTER", "-1");
    stage_press(&g, 'k');
    while ((!g.studio.shown.has_place || g.studio.state.page != STUDIO_LIVE) && clock_now_ns() < until)
        stage_draw(&g);
    EXPECT_TRUE(g.studio.shown.has_place && g.studio.state.page == STUDIO_LIVE);
    studio_close(&g.studio);
    stage_close(&g);
}

// ---------------------------------------------------------------- cutting off the ends

static void test_trim_while_it_plays(void **state)
{
    (void)state;
    static struct stage g;
    struct recording *recording;
    struct take *take;
    open_stage(&g, film_for(&g, "kata", 0, 45));
    wait_page(&g, STUDIO_LIVE, 2);
    stage_press(&g, ' ');
    g.skipped_ns += 6 * SECOND;
    stage_draw(&g);
    wait_page(&g, STUDIO_REVIEW, 1);
    stage_press(&g, 'p');
    EXPECT_TRUE(g.studio.playing && viewer_state(g.studio.viewer)->trim.offered);
    stage_draw(&g);
    struct view_state *v = viewer_state(g.studio.viewer);
    const int64_t now_ns = clock_now_ns() + g.skipped_ns;
    stage_press(&g, 's'); // nothing is marked
    EXPECT_TRUE(g.studio.playing);
    playback_play(&v->playback, now_ns, false);
    playback_seek(&v->playback, now_ns, 400000000);
    stage_press(&g, ',');
    playback_seek(&v->playback, now_ns, 1000000000);
    stage_press(&g, '.');
    EXPECT_TRUE(v->trim.from_ns == 400000000 && v->trim.to_ns == 1000000000);
    stage_save(&g, "trim");
    stage_press(&g, 's');
    stage_draw(&g);
    EXPECT_TRUE(!g.studio.playing && g.studio.state.page == STUDIO_REVIEW);
    EXPECT_INT(g.studio.state.waiting.kind, ERASES_ENDS);
    g.skipped_ns += STUDIO_UNDO_S * SECOND; // nobody takes it back
    for (const int64_t until = clock_now_ns() + 100 * SECOND;
         g.studio.shown.judgement.frames != 19 && clock_now_ns() < until;)
        stage_draw(&g);
    printf("%s\n", g.studio.state.notice);
    EXPECT_INT(g.studio.shown.judgement.frames, 19); // judged anew
    EXPECT_STATUS(recording_open(&recording, g.studio.options.file), OK);
    EXPECT_STATUS(take_open(&take, recording, "take-1"), OK);
    EXPECT_INT(take_frame_count(take), 19); // from 0.4 s to 1.0 s, both included
    take_close(&take);
    recording_free(&recording);
    studio_close(&g.studio);
    stage_close(&g);
}

int main(int argc, char **argv)
{
    keep_player();
    if (argc > 1) {
        static struct stage g;
        g.folder = argv[1];
        room_and_take(&g, 72);
        stage_close(&g);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_room_states),     cmocka_unit_test(test_pause_row_and_trim_states),
        cmocka_unit_test(test_no_map_is_said),  cmocka_unit_test(test_trim_while_it_plays),
        cmocka_unit_test(test_room_and_take),
        cmocka_unit_test(test_a_live_sensor), // last: the fake sensor's library leaves cJSON with functions of its own
        cmocka_unit_test(test_a_sweep_cut_off), cmocka_unit_test(test_a_room_that_cannot_be_kept_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
