// The live screen "room": person and actor as the tablet's own camera sees them, in the place where the take was
// recorded. A film and a folder of images stand in for the sensor and the camera.
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "tests/support/live_glass.h"
#include "tests/support/live_rehearsal.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <string.h>

enum { LONG = GLASS_LONG, SHORT = GLASS_SHORT, FRAMES = 46 };
// The smallest at which the sensor is located by the world's tags.
static const double SCALE = 0.75;

static struct live_rehearsal rehearsal;

static void open_room(struct glass *g, const char *sensor, const char *camera)
{
    const struct live_glass how = {.file = rehearsal.file, .sensor = sensor, .camera = camera};
    live_glass_open(g, LONG / 2, SHORT / 2, &how);
}

static bool is_in_the_room(const struct glass *g)
{
    const struct view_state *s = g->state;
    // The actor is shown once the body is whole.
    return live_glass_sees_person(g) && s->camera.placed && s->presence >= 1 && s->live.sight.in_place &&
           g->image->actor;
}

// Person and actor as the tablet's own camera sees the room: each where they are in it, the actor at the instant that
// is done, the mistakes in their colour.
static void test_both_stand_in_the_room(void **state)
{
    (void)state;
    struct glass g;
    open_room(&g, rehearsal.wrong, rehearsal.camera);
    live_glass_draw_until(&g, live_glass_sees_person);
    g.state->live.hands_free = false;
    for (int i = 0; i < 2; i++)
        view_state_do(g.state, DO_SCREEN, glass_now_ns(&g));
    EXPECT_INT(g.state->live.screen, LIVE_ROOM);
    live_glass_draw_until(&g, is_in_the_room);
    glass_draw(&g);
    EXPECT_TRUE(g.image->camera && g.image->actor && viewer_live_view(g.viewer).page->person);
    EXPECT_TRUE(!view_state_hint_warns(g.state));
    const struct vec3 actor = g.image->skeleton.joint[JOINT_WAIST],
                      person = viewer_live_view(g.viewer).page->person->joint[JOINT_WAIST];
    print_message("the person is %.2f, %.2f, %.2f m from the actor\n", person.x - actor.x, person.y - actor.y,
                  person.z - actor.z);
    EXPECT_NEAR(person.x - actor.x, LIVE_REHEARSAL_ASIDE_M, 0.1);
    EXPECT_NEAR(person.y - actor.y, 0, 0.15);
    const struct live_tally t = live_glass_do_attempt(&g);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 6);
    EXPECT_AT_LEAST(t.wrong_pixels, 20);
    EXPECT_TRUE(viewer_live_view(g.viewer).attempt->compared);
    glass_close(&g);
}

// The actor's instant, not that of the player which watches takes.
static void test_the_room_shows_the_instant_that_is_done(void **state)
{
    (void)state;
    struct glass g;
    open_room(&g, rehearsal.right, rehearsal.camera);
    g.state->live.screen = LIVE_ROOM;
    live_glass_draw_until(&g, live_glass_sees_person);
    g.state->live.screen = LIVE_ROOM;
    g.state->live.hands_free = false;
    live_glass_draw_until(&g, is_in_the_room);
    view_state_do(g.state, DO_PACE, glass_now_ns(&g)); // keep up: it moves, whatever the person does
    view_state_do(g.state, DO_PLAY_PAUSE, glass_now_ns(&g));
    live_glass_draw_until(&g, live_glass_is_doing);
    int drawn = 0;
    double gap_m = 0;
    int64_t drawing_ns = 0;
    while (live_glass_is_doing(&g) && drawn < 200) {
        live_glass_draw_what_is_new(&g);
        const struct live_page *page = viewer_live_view(g.viewer).page;
        if (!live_glass_is_doing(&g) || !page->person || !g.image->has_skeleton ||
            viewer_drawing_ns(g.viewer) == drawing_ns)
            continue; // not drawn: time has gone on since
        drawing_ns = viewer_drawing_ns(g.viewer);
        drawn++;
        const struct vec3 now = g.image->skeleton.joint[JOINT_RIGHT_HAND];
        struct take_view_request again = {.lens = g.image->lens,
                                          .detail = DETAIL_AUTO,
                                          .world_from_camera = g.image->world_from_camera,
                                          .time_ns = g.state->live.at_ns,
                                          .camera_lost = true,
                                          .resolution_scale = 1};
        struct take_view_image there;
        EXPECT_STATUS(take_view_draw(viewer_take_view(g.viewer), &again, &there), OK);
        gap_m = fmax(gap_m, v3_distance(now, there.skeleton.joint[JOINT_RIGHT_HAND]));
    }
    print_message("%d drawings, the hand at most %.3f m from where it is at the instant that is done\n", drawn, gap_m);
    EXPECT_AT_LEAST(drawn, 5);
    EXPECT_AT_MOST(gap_m, 1e-3);
    glass_close(&g);
}

// Before a wall on which the place knows nothing, it is said what is missing.
static void test_the_room_says_what_is_missing(void **state)
{
    (void)state;
    struct glass g;
    char blind[300];
    rehearse_camera(&rehearsal.scratch, "blind", NULL, 1);
    snprintf(blind, sizeof blind, "folder:%s", scratch_file(&rehearsal.scratch, "blind"));
    open_room(&g, rehearsal.right, blind);
    struct view_state *s = g.state;
    s->live.screen = LIVE_ROOM;
    live_glass_draw_until(&g, live_glass_sees_person);
    s->live.screen = LIVE_ROOM;
    s->live.hands_free = false;
    for (int64_t until_ns = clock_now_ns() + 60000000000; clock_now_ns() < until_ns;) {
        live_glass_draw_what_is_new(&g);
        if (view_state_hint(s) && strstr(view_state_hint(s), "Point the camera at a tag"))
            break;
    }
    EXPECT_TRUE(view_state_hint(s) && strstr(view_state_hint(s), "Point the camera at a tag"));
    EXPECT_TRUE(view_state_hint_warns(s));
    s->live.sight.in_place = false; // a sensor that is not located in the place is said first
    s->live.sight.located = false;
    EXPECT_TRUE(strstr(view_state_hint(s), "The sensor sees nothing of the room"));
    s->live.sight.located = true;
    EXPECT_TRUE(strstr(view_state_hint(s), "from the next attempt on"));
    s->live.screen = LIVE_MIRROR; // where neither matters
    EXPECT_TRUE(!view_state_hint(s) || !strstr(view_state_hint(s), "room"));
    glass_close(&g);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = live_rehearsal_make(FRAMES, SCALE);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    live_rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_both_stand_in_the_room),
        cmocka_unit_test(test_the_room_shows_the_instant_that_is_done),
        cmocka_unit_test(test_the_room_says_what_is_missing),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
