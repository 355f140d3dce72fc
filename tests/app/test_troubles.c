// Faults of the camera while watching, and a take that has no place in its pictures: each has its sentence on the
// screen, and is gone once it is mended, without any input.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "tests/support/glass.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <string.h>

static struct rehearsal rehearsal;

static void open_file(struct glass *g, const char *file, const char *camera)
{
    static char uri[300]; // must outlive the glass
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&rehearsal.scratch, camera));
    const struct viewer_options options = {
        .file = file, .take = "turn", .camera = uri, .fixed_resolution = true, .refresh_hz = 60};
    glass_open(g, GLASS_LONG / 4, GLASS_SHORT / 4, &options);
}

static void open_glass(struct glass *g, const char *camera) { open_file(g, rehearsal.file, camera); }

static void move(const char *from, const char *to)
{
    EXPECT_INT(rename(scratch_file(&rehearsal.scratch, from), scratch_file(&rehearsal.scratch, to)), 0);
}

// Draws until the screen shows a hint with that word in it.
static void expect_hint(struct glass *g, const char *word)
{
    const int64_t until_ns = clock_now_ns() + 60000000000;
    const char *hint;
    do {
        glass_draw(g);
        hint = view_state_hint(g->state);
        clock_sleep_until_ns(clock_now_ns() + 2000000);
    } while ((!hint || !strstr(hint, word)) && clock_now_ns() < until_ns);
    print_message("%s\n", hint ? hint : "no hint");
    EXPECT_TRUE(hint && strstr(hint, word));
}

static void expect_camera_works(struct glass *g)
{
    glass_wait_located(g, true);
    EXPECT_TRUE(g->state->presence == 1 && !view_state_hint(g->state));
    glass_body(g);
    EXPECT_TRUE(!g->state->orbiting && g->image->camera && g->image->parts > 0);
}

static void test_missing_camera_is_awaited(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, "later");
    expect_hint(&g, "later");
    EXPECT_TRUE(g.state->orbiting && g.state->playback.playing); // the take can be watched all the same
    glass_body(&g);
    EXPECT_AT_LEAST(g.image->parts, 1);
    move("viewer", "later");
    expect_camera_works(&g);
    move("later", "viewer");
    glass_close(&g);
}

static void test_camera_can_be_replugged(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, "viewer");
    expect_camera_works(&g);
    for (int times = 0; times < 2; times++) {
        move("viewer", "pulled");
        expect_hint(&g, "viewer");
        EXPECT_TRUE(g.state->playback.playing && g.state->page == PAGE_WATCH);
        move("pulled", "viewer");
        expect_camera_works(&g);
    }
    glass_close(&g);
}

// Images of a quarter of the size, with the full size's calibration.
static void test_wrong_size_is_distinguished_from_no_images(void **state)
{
    (void)state;
    struct glass g;
    rehearse_camera(&rehearsal.scratch, "small", NULL, 0.25);
    move("small/calibration.json", "kept.json");
    move("viewer/calibration.json", "small/calibration.json");
    open_glass(&g, "small");
    expect_hint(&g, "calibration.json says");
    move("small/calibration.json", "viewer/calibration.json");
    move("small", "was-small");
    move("viewer", "small");
    expect_camera_works(&g);
    move("small", "viewer");
    glass_close(&g);
}

static void test_camera_without_tag_continues(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, "wall");
    expect_hint(&g, "Point the camera at a tag");
    EXPECT_NEAR(g.state->presence, 0, 0);
    move("wall", "blank");
    move("viewer", "wall");
    expect_camera_works(&g);
    move("wall", "viewer");
    move("blank", "wall");
    glass_close(&g);
}

// A place where one tag hangs elsewhere, and the take copied to it, which was not filmed there.
static void make_take_of_elsewhere(const char *file)
{
    struct recording *from;
    struct recording_writer *w;
    struct place place;
    struct take_copy_report report;
    EXPECT_STATUS(recording_open(&from, rehearsal.file), OK);
    EXPECT_STATUS(recording_read_place(from, &place), OK);
    recording_free(&from);
    place.tags[0].world_from_tag.translation.x += 0.5;
    EXPECT_STATUS(recording_create(&w, file), OK);
    EXPECT_STATUS(recording_put_place(w, &place), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    place_free(&place);
    EXPECT_STATUS(recording_copy_take(rehearsal.file, "turn", file, "turn", &report), OK);
    EXPECT_TRUE(report.place_differs);
}

// The sensor saw nothing of the place. The actor is looked at from all round, and drawn nowhere in the camera's
// pictures, where they would stand wrong.
static void test_actor_without_a_position(void **state)
{
    (void)state;
    struct glass g;
    char file[300], camera[300], out[300];
    snprintf(file, sizeof file, "%s", scratch_file(&rehearsal.scratch, "elsewhere.reenact"));
    snprintf(camera, sizeof camera, "folder:%s", scratch_file(&rehearsal.scratch, "viewer"));
    snprintf(out, sizeof out, "%s", scratch_file(&rehearsal.scratch, "pictures"));
    make_take_of_elsewhere(file);
    open_file(&g, file, "viewer");
    expect_hint(&g, "recognised nothing of the place");
    EXPECT_TRUE(g.state->orbiting && !g.image->camera);
    glass_body(&g);
    EXPECT_AT_LEAST(g.image->parts, 1);
    EXPECT_TRUE(g.state->room.filmed && !viewer_room_view(g.viewer).wants_filmed); // it would be seen from elsewhere
    EXPECT_TRUE(viewer_room_view(g.viewer).page->apart && !viewer_room_view(g.viewer).page->actor &&
                !viewer_room_view(g.viewer).page->viewer_known);
    glass_close(&g);
    const struct process_result said =
        PROCESS(PROGRAM_DIR "/reenact", "render", file, "--take", "turn", "--camera", camera, "--out", out);
    print_message("%s", said.err);
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(strstr(said.err, "not known where the actor") && !file_exists(out));
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_missing_camera_is_awaited),
        cmocka_unit_test(test_camera_can_be_replugged),
        cmocka_unit_test(test_wrong_size_is_distinguished_from_no_images),
        cmocka_unit_test(test_camera_without_tag_continues),
        cmocka_unit_test(test_actor_without_a_position),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
