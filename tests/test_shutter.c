// A camera with a rolling shutter, carried at 1 m/s and swung at up to 60 degrees a second through the small
// world: it must be placed about as well as one that reads all rows at once. Every row is rendered from where
// the camera is when it is read.
#include "locate/locate.h"
#include "locate/shutter.h"
#include "locate/track.h"
#include "tests/support/film.h"
#include "tests/test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SWEEP = 20, PICTURES = 12, WIDTH = 640, HEIGHT = 480, BYTES = WIDTH * HEIGHT * 3 };
static const double HZ = 30, AT_MOST_WORSE = 1.5;
static const double READOUT_S[3] = {0, 0.02, 0.03};

static struct {
    struct world *world;
    struct place place;
    struct pose world_from_place;
    struct lens lens; // with the readout that each film has
    uint8_t film[3][PICTURES][BYTES];
} room;

// Sideways at 1 m/s through the middle of the room; the view swings to one side and up and down.
static struct pose path(const void *context, double time_s)
{
    (void)context;
    double yaw = 0.5 + 1.0472 / 4 * sin(4 * time_s), pitch = 0.1 + 0.5 / 9 * sin(9 * time_s + 1);
    struct quat level = {-0.7071067811865476, 0, 0, 0.7071067811865476}; // z forward along the world's y, y down
    struct quat turn = quat_multiply(quat_from_rotation_vector(v3(0, 0, yaw)), level);
    turn = quat_multiply(turn, quat_from_rotation_vector(v3(pitch, 0, 0)));
    return (struct pose){quat_unit(turn), {0.5 - time_s, -0.8, 1.4}};
}

static double time_of(int picture) { return picture / HZ; }

static int enter(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&room.world, &o), OK);
    room.place = film_mapped_place(room.world, SWEEP, &room.world_from_place);
    room.lens = world_viewer_calibration(1).color;
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < PICTURES; i++) {
            struct world_shot shot = {.lens = room.lens};
            struct world_picture picture = {.color = room.film[r][i]};
            shot.lens.readout_s = READOUT_S[r];
            EXPECT_STATUS(world_render_rolling(room.world, &shot, path, NULL, time_of(i), &picture), OK);
            world_color_noise(room.film[r][i], WIDTH, HEIGHT, 70 + (uint64_t)i);
        }
    return 0;
}

static int leave(void **state)
{
    (void)state;
    place_free(&room.place);
    world_close(&room.world);
    return 0;
}

struct errors {
    int found;
    double m, rad;  // root mean square
    double worst_m;
    double off; // mean of the squared errors over what is said of them, of the position: 3 if that is true
};

static void count(struct errors *e, int picture, const struct location *at)
{
    struct pose truth = path(NULL, time_of(picture)),
                found = pose_multiply(room.world_from_place, at->world_from_camera);
    double m = v3_distance(found.translation, truth.translation), rad = pose_angle(found, truth);
    e->found++;
    e->m += m * m;
    e->rad += rad * rad;
    e->worst_m = fmax(e->worst_m, m);
}

enum how { ANEW, FOLLOWED };

// film: which; believed_s: the readout that the camera is said to have.
static struct errors place_all(const struct place *place, int film, double believed_s, enum how how)
{
    struct errors e = {0};
    struct locator *l = NULL;
    struct camera_track *t = NULL;
    struct lens lens = room.lens;
    struct camera_motion motion;
    lens.readout_s = believed_s;
    if (how == ANEW)
        EXPECT_STATUS(locator_open(&l, place, &lens, NULL), OK);
    else
        EXPECT_STATUS(camera_track_open(&t, place, &lens, NULL), OK);
    for (int i = 0; i < PICTURES; i++) {
        struct location at;
        const uint8_t *rgb = room.film[film][i];
        enum status status = how == ANEW ? locator_find(l, rgb, NULL, &at)
                                         : camera_track_look(t, rgb, NULL, (int64_t)(time_of(i) * 1e9), &at, &motion);
        EXPECT_TRUE(status >= 0);
        if (status == OK)
            count(&e, i, &at);
    }
    locator_close(&l);
    camera_track_close(&t);
    e.m = sqrt(e.m / e.found);
    e.rad = sqrt(e.rad / e.found);
    return e;
}

static void tell(const char *what, const struct errors *e)
{
    printf("  %-28s %2d of %d, %6.2f mm rms, worst %6.2f, %.3f degrees\n", what, e->found, PICTURES, e->m * 1e3,
           e->worst_m * 1e3, e->rad * 57.2958);
}

static void compare(const char *name, const struct place *place, enum how how)
{
    struct errors whole = place_all(place, 0, 0, how);
    printf("%s\n", name);
    tell("all rows at once", &whole);
    EXPECT_INT(whole.found, PICTURES);
    for (int r = 1; r < 3; r++) {
        char what[64];
        struct errors without = place_all(place, r, 0, how), with = place_all(place, r, READOUT_S[r], how);
        snprintf(what, sizeof what, "read in %.0f ms, unmodelled", READOUT_S[r] * 1e3);
        tell(what, &without);
        snprintf(what, sizeof what, "read in %.0f ms", READOUT_S[r] * 1e3);
        tell(what, &with);
        EXPECT_INT(with.found, PICTURES);
        EXPECT_AT_MOST(with.m, AT_MOST_WORSE * whole.m);
        EXPECT_AT_MOST(with.rad, AT_MOST_WORSE * whole.rad);
    }
}

static void by_tags_and_points(void **state)
{
    (void)state;
    compare("tags and points, found anew", &room.place, ANEW);
    compare("tags and points, followed", &room.place, FOLLOWED);
}

static void by_tags_alone(void **state)
{
    (void)state;
    struct place tags = room.place;
    tags.points = NULL;
    tags.point_count = 0;
    compare("tags, found anew", &tags, ANEW);
    compare("tags, followed", &tags, FOLLOWED);
}

static void by_points_alone(void **state)
{
    (void)state;
    struct place points = room.place;
    points.tags = NULL;
    points.tag_count = 0;
    compare("points, found anew", &points, ANEW);
    compare("points, followed", &points, FOLLOWED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(by_tags_and_points),
        cmocka_unit_test(by_tags_alone),
        cmocka_unit_test(by_points_alone),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
