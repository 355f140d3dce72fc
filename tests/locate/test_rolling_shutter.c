// A camera with a rolling shutter that moves at 1 m/s and rotates at up to 60 degrees a second through the small world:
// it must be localised about as well as one with a global shutter. Every row is rendered from where the camera is when
// it is read.
#include "tests/support/test.h"

#include "base/linear_algebra.h"
#include "locate/camera_tracker.h"
#include "locate/locator.h"
#include "locate/pose_solver.h"
#include "locate/rolling_shutter.h"
#include "tests/support/film.h"
#include "tests/support/random.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef EMULATED
enum { IMAGES = 3 };
#else
enum { IMAGES = 6 };
#endif
enum { SWEEP = 20, FILMS = 3, WIDTH = 640, HEIGHT = 480, BYTES = WIDTH * HEIGHT * 3 };
static const double HZ = 30, AT_MOST_WORSE = 1.5, DETECTED_AT_MOST_WORSE = 2;
static const double READOUT_S[FILMS] = {0, 0.02, 0.03};

static struct {
    struct world *world;
    struct place place;
    struct pose world_from_place;
    struct lens lens; // without the read-out time, which differs from film to film
    uint8_t film[FILMS][IMAGES][BYTES];
} room;

// Sideways at 1 m/s through the middle of the room, rotating to either side and up and down.
static struct pose path(const void *context, double time_s)
{
    (void)context;
    double yaw = 0.5 + 1.0472 / 4 * sin(4 * time_s), pitch = 0.1 + 0.5 / 9 * sin(9 * time_s + 1);
    struct quat level = {-0.7071067811865476, 0, 0, 0.7071067811865476}; // z forward along the world's y, y down
    struct quat rotation = quat_multiply(quat_from_rotation_vector(v3(0, 0, yaw)), level);
    rotation = quat_multiply(rotation, quat_from_rotation_vector(v3(pitch, 0, 0)));
    return (struct pose){quat_unit(rotation), {0.5 - time_s, -0.8, 1.4}};
}

static double time_of(int image) { return (image + 1) / HZ; }

static int enter(void **state)
{
    (void)state;
    room.place = film_mapped_place(&room.world, SWEEP, &room.world_from_place);
    room.lens = world_viewer_calibration(1).color;
    for (int r = 0; r < FILMS; r++)
        for (int i = 0; i < IMAGES; i++) {
            struct world_shot shot = {.lens = room.lens};
            struct world_image image = {.color = room.film[r][i]};
            shot.lens.readout_s = READOUT_S[r];
            shot.world_from_camera = path(NULL, time_of(i));
            EXPECT_STATUS(r ? world_render_rolling(room.world, &shot, path, NULL, time_of(i), &image)
                            : world_render(room.world, &shot, &image),
                          OK);
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

struct pose_errors {
    int found;
    double m, rad;                // root mean square
    double worst_m, worst_sigmas; // the second: the worst error in standard deviations
};

static void count(struct pose_errors *e, int image, const struct location *at)
{
    struct pose truth = path(NULL, time_of(image)), found = pose_multiply(room.world_from_place, at->world_from_camera);
    double m = v3_distance(found.translation, truth.translation), rad = pose_angle(found, truth);
    e->found++;
    e->m += m * m;
    e->rad += rad * rad;
    e->worst_m = fmax(e->worst_m, m);
    e->worst_sigmas = fmax(e->worst_sigmas, m / at->position_sigma_m);
}

enum how { RELOCATE, TRACKED };

// given_s: the read-out time of the given lens.
static struct pose_errors localize_all(const struct place *place, int film, double given_s, enum how how)
{
    struct pose_errors e = {0};
    struct locator *l = NULL;
    struct camera_tracker *t = NULL;
    struct lens lens = room.lens;
    struct camera_motion motion;
    lens.readout_s = given_s;
    if (how == RELOCATE)
        EXPECT_STATUS(locator_open(&l, place, &lens, NULL), OK);
    else
        EXPECT_STATUS(camera_tracker_open(&t, place, &lens, NULL), OK);
    for (int i = 0; i < IMAGES; i++) {
        struct location at;
        const uint8_t *rgb = room.film[film][i];
        enum status status = how == RELOCATE
                                 ? locator_localize(l, rgb, NULL, &at)
                                 : camera_tracker_process(t, rgb, NULL, (int64_t)(time_of(i) * 1e9), &at, &motion);
        EXPECT_TRUE(status >= 0);
        if (status == OK)
            count(&e, i, &at);
    }
    locator_close(&l);
    camera_tracker_close(&t);
    e.m = sqrt(e.m / e.found);
    e.rad = sqrt(e.rad / e.found);
    return e;
}

static void print_errors(const char *what, const struct pose_errors *e)
{
    printf("  %-28s %d of %d, %6.2f mm rms, worst %6.2f, %.3f degrees\n", what, e->found, IMAGES, e->m * 1e3,
           e->worst_m * 1e3, e->rad * 57.2958);
}

// With the films from `first` on. strict: errors are bounded by AT_MOST_WORSE; else by their covariance only.
static void compare(const char *name, const struct place *place, enum how how, int first, bool strict)
{
    struct pose_errors whole = localize_all(place, 0, 0, how);
    printf("%s\n", name);
    print_errors("global shutter", &whole);
    EXPECT_INT(whole.found, IMAGES);
    for (int r = first; r < FILMS; r++) {
        char what[64];
        struct pose_errors unknown = localize_all(place, r, 0, how), with = localize_all(place, r, READOUT_S[r], how);
        print_errors("not given, as the next", &unknown);
        snprintf(what, sizeof what, "read in %.0f ms", READOUT_S[r] * 1e3);
        print_errors(what, &with);
        EXPECT_INT(with.found, IMAGES);
        EXPECT_INT(unknown.found, IMAGES);
        EXPECT_AT_MOST(unknown.worst_sigmas, 3);
        if (strict) {
            // Tags that contradict each other reveal a rolling shutter; where they hardly do, the error is small.
            EXPECT_AT_MOST(unknown.worst_m, r == FILMS - 1 ? DETECTED_AT_MOST_WORSE * whole.worst_m : 0.05);
            EXPECT_AT_MOST(with.m, AT_MOST_WORSE * whole.m);
            EXPECT_AT_MOST(with.rad, AT_MOST_WORSE * whole.rad);
        } else {
            EXPECT_AT_MOST(with.worst_sigmas, 3);
        }
    }
}

static void test_tags_and_landmarks(void **state)
{
    (void)state;
    compare("tags and landmarks, from scratch", &room.place, RELOCATE, 1, true);
    compare("tags and landmarks, tracked", &room.place, TRACKED, 1, true);
}

static void test_tags_alone(void **state)
{
    (void)state;
    struct place tags = room.place;
    tags.points = NULL;
    tags.point_count = 0;
    compare("tags, from scratch", &tags, RELOCATE, FILMS - 1, true);
    compare("tags, tracked", &tags, TRACKED, FILMS - 1, true);
}

static void test_landmarks_alone(void **state)
{
    (void)state;
    struct place points = room.place;
    points.tags = NULL;
    points.tag_count = 0;
    // A hundred landmarks on distant walls: the error of a single image varies widely, so it is bounded by its
    // covariance only; test_many_point_sets compares.
    compare("landmarks, from scratch", &points, RELOCATE, FILMS - 1, false);
    compare("landmarks, tracked", &points, TRACKED, FILMS - 1, false);
}

// ---------------------------------------------------------------- points, without images

enum { POINTS = 120, SETS = 200 };
static const double POINT_PX = 0.6;

static struct vec3 any_direction(struct rng *rng) { return v3_unit(rng_normal3(rng, 1)); }

// The camera `time_s` after the middle row, at constant velocity, in its axes at the middle row.
static struct pose pose_at(struct vec3 angular, struct vec3 linear, double time_s)
{
    return (struct pose){quat_from_rotation_vector(v3_scale(angular, time_s)), v3_scale(linear, time_s)};
}

// Observes POINTS points in front of a lens, each in the row that is read when it is there.
static void observe(const struct lens *lens, struct vec3 angular, struct vec3 linear, struct rng *rng,
                    struct pnp_point *out)
{
    for (int i = 0; i < POINTS; i++) {
        struct pixel start = {.x = rng_between(rng, 20, WIDTH - 21)};
        start.y = rng_between(rng, 20, HEIGHT - 21);
        struct vec3 ray = lens_ray(lens, start);
        struct vec3 world =
            v3_scale(ray, rng_between(rng, 1.5, 4)); // the camera's axes at the middle row are the world's
        double low = 0, high = HEIGHT - 1;
        for (int k = 0; k < 40; k++) { // the row by bisection: above the point before, below it after
            double row = (low + high) / 2, time_s = lens->readout_s * (row / (HEIGHT - 1) - 0.5);
            struct vec3 p = pose_apply(pose_inverse(pose_at(angular, linear, time_s)), world);
            if (lens_project(lens, p).y > row)
                low = row;
            else
                high = row;
        }
        double time_s = lens->readout_s * (low / (HEIGHT - 1) - 0.5);
        struct pixel at = lens_project(lens, pose_apply(pose_inverse(pose_at(angular, linear, time_s)), world));
        at.x += POINT_PX * rng_normal(rng);
        at.y += POINT_PX * rng_normal(rng);
        ray = lens_ray(lens, at);
        out[i] = (struct pnp_point){
            .world = world, .x = ray.x, .y = ray.y, .sigma_px = POINT_PX, .time_s = shutter_row_time(lens, at.y)};
    }
}

enum known { GLOBAL_SHUTTER, UNMODELLED, UNKNOWN, EXPECTED };

// The root of the mean squared error of the position, metres; *within: of how many sets it lies within 95 %.
static double solve_sets(enum known known, double readout_s, int *within)
{
    static const double ANGULAR_SIGMA = 0.2, LINEAR_SIGMA = 0.1,
                        WITHIN_95 = 7.815; // the last: chi squared, 3 degrees of freedom
    struct rng rng = {5};
    struct lens lens = room.lens;
    double sum = 0;
    *within = 0;
    for (int i = 0; i < SETS; i++) {
        struct pnp_point seen[POINTS];
        struct vec3 angular = v3_scale(any_direction(&rng), 1.0472), linear = any_direction(&rng);
        struct shutter_motion motion = shutter_motion_unknown();
        struct pose found = {quat_from_rotation_vector(v3(0.01, -0.01, 0.01)), {0.02, -0.02, 0.02}};
        double covariance[36] = {0}, inverse[9];
        lens.readout_s = known == GLOBAL_SHUTTER ? 0 : readout_s;
        observe(&lens, angular, linear, &rng, seen);
        if (known == EXPECTED) {
            const double truth[6] = {angular.x, angular.y, angular.z, linear.x, linear.y, linear.z};
            double velocity[6];
            for (int k = 0; k < 6; k++) {
                double sigma = k < 3 ? ANGULAR_SIGMA : LINEAR_SIGMA;
                velocity[k] = truth[k] + sigma * rng_normal(&rng);
                covariance[k * 7] = sigma * sigma;
            }
            motion = shutter_motion_prior(velocity, covariance);
        }
        struct pose_problem problem = {.points = seen,
                                       .point_count = POINTS,
                                       .fx = lens.fx,
                                       .fy = lens.fy,
                                       .motion = known >= UNKNOWN ? &motion : NULL};
        for (problem.point_px = 8; problem.point_px > 0.1; problem.point_px /= 4)
            pnp_refine(&problem, &found);
        problem.point_px = 0;
        pnp_refine(&problem, &found);
        EXPECT_TRUE(pnp_covariance(&problem, &found, covariance));
        struct vec3 off = pose_inverse(found).translation;
        const double d[3] = {off.x, off.y, off.z},
                     translation[9] = {covariance[21], covariance[22], covariance[23], covariance[27], covariance[28],
                                       covariance[29], covariance[33], covariance[34], covariance[35]};
        double chi2 = 0;
        EXPECT_TRUE(invert_symmetric(translation, 3, inverse));
        for (int k = 0; k < 9; k++)
            chi2 += d[k / 3] * inverse[k] * d[k % 3];
        *within += chi2 < WITHIN_95;
        sum += v3_dot(off, off);
    }
    return sqrt(sum / SETS);
}

static void test_many_point_sets(void **state)
{
    (void)state;
    int within;
    double whole = solve_sets(GLOBAL_SHUTTER, 0, &within);
    printf("%d sets of %d points, global shutter: %.2f mm, %.1f %% within 95 %%\n", SETS, POINTS, whole * 1e3,
           100.0 * within / SETS);
    for (int r = 1; r < FILMS; r++) {
        double unmodelled = solve_sets(UNMODELLED, READOUT_S[r], &within);
        printf("  read in %.0f ms, unmodelled: %.2f mm\n", READOUT_S[r] * 1e3, unmodelled * 1e3);
        double unknown = solve_sets(UNKNOWN, READOUT_S[r], &within);
        printf("  no prior of the velocity: %.2f mm, %.1f %% within 95 %%\n", unknown * 1e3, 100.0 * within / SETS);
        EXPECT_NEAR((double)within / SETS, 0.95, 0.04);
        EXPECT_AT_MOST(unknown, AT_MOST_WORSE * whole);
        double expected = solve_sets(EXPECTED, READOUT_S[r], &within);
        printf("  velocity known as when tracked: %.2f mm, %.1f %% within 95 %%\n", expected * 1e3,
               100.0 * within / SETS);
        EXPECT_NEAR((double)within / SETS, 0.95, 0.04);
        EXPECT_AT_MOST(expected, AT_MOST_WORSE * whole);
    }
}

// A single image of one tag leaves the velocity undetermined, and with it the pose; the covariance must include that.
static void test_single_image_of_one_tag(void **state)
{
    (void)state;
    struct place one = room.place;
    struct locator_options options = locator_default_options();
    options.max_position_sigma_m = 10;
    one.points = NULL;
    one.point_count = 0;
    one.tag_count = 1;
    for (int tag = 0; tag < room.place.tag_count; tag++) {
        struct lens lens = room.lens;
        struct location at;
        struct locator *l;
        one.tags = &room.place.tags[tag];
        lens.readout_s = READOUT_S[FILMS - 1];
        EXPECT_STATUS(locator_open(&l, &one, &lens, &options), OK);
        enum status status = locator_localize(l, room.film[FILMS - 1][0], NULL, &at);
        locator_close(&l);
        if (status == NOTHING)
            continue;
        struct pose_errors e = {0}, other = {.worst_m = INFINITY};
        count(&e, 0, &at);
        if (status == AMBIGUOUS) {
            at.world_from_camera = at.other;
            other.worst_m = 0;
            count(&other, 0, &at);
        }
        double off = fmin(e.worst_m, other.worst_m);
        printf("one tag, number %d: %.1f mm, sigma %.1f mm\n", (int)one.tags->id, off * 1e3, at.position_sigma_m * 1e3);
        EXPECT_AT_MOST(off, 3 * at.position_sigma_m);
        EXPECT_AT_LEAST(at.position_sigma_m, 0.02);
    }
}

// A clock that jumps makes the velocity invalid, and must not disturb the pose.
static void test_clock_jump(void **state)
{
    (void)state;
    // Error of the clock from one image on.
    static const int64_t jumps_ns[] = {-33000000, 1000000000, 100000000000};
    struct lens lens = room.lens;
    lens.readout_s = READOUT_S[FILMS - 1];
    for (size_t k = 0; k < COUNT_OF(jumps_ns); k++) {
        struct camera_tracker *t;
        struct pose_errors e = {0};
        struct camera_motion motion;
        EXPECT_STATUS(camera_tracker_open(&t, &room.place, &lens, NULL), OK);
        for (int i = 0; i < IMAGES; i++) {
            struct location at;
            int64_t time_ns = (int64_t)(time_of(i) * 1e9) + (i > IMAGES / 2 ? jumps_ns[k] : 0);
            EXPECT_STATUS(camera_tracker_process(t, room.film[FILMS - 1][i], NULL, time_ns, &at, &motion), OK);
            count(&e, i, &at);
        }
        camera_tracker_close(&t);
        printf("the clock jumps by %.3f s: worst %.2f mm\n", (double)jumps_ns[k] * 1e-9, e.worst_m * 1e3);
        EXPECT_INT(e.found, IMAGES);
        EXPECT_AT_MOST(e.worst_m, 0.006);
    }
}

static void test_invalid_velocities(void **state)
{
    (void)state;
    const double nan[6] = {NAN, 0, 0, 0, 0, 0}, fast[6] = {1e9, 0, 0, 0, -1e9, 0}, slow[6] = {0.1, 0, 0, 0, 0.5, 0};
    double sure[36] = {0}, none[36] = {0};
    for (int i = 0; i < 6; i++)
        sure[i * 7] = 0.01;
    struct shutter_motion unknown = shutter_motion_unknown(), m = shutter_motion_prior(nan, sure);
    EXPECT_NEAR(m.velocity[0], 0, 0);
    EXPECT_NEAR(m.information[0], unknown.information[0], 0);
    m = shutter_motion_prior(fast, sure);
    EXPECT_NEAR(m.velocity[4], 0, 0);
    m = shutter_motion_prior(slow, none);
    EXPECT_NEAR(m.velocity[4], 0, 0);
    m = shutter_motion_prior(slow, sure);
    EXPECT_NEAR(m.velocity[4], 0.5, 0);
    EXPECT_NEAR(m.information[7], 100, 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tags_and_landmarks),      cmocka_unit_test(test_tags_alone),
        cmocka_unit_test(test_landmarks_alone),         cmocka_unit_test(test_many_point_sets),
        cmocka_unit_test(test_single_image_of_one_tag), cmocka_unit_test(test_clock_jump),
        cmocka_unit_test(test_invalid_velocities),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
