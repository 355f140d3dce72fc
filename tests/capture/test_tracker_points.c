// The tracker with points of the colour image, which are the true joints projected, so that no network is needed: what
// depth alone has wrong is corrected, wrong points do little harm, and furniture is no person.
#include "tests/support/test.h"

#include "capture/body/point_evidence.h"
#include "capture/body/two_bone_ik.h"
#include "capture/tracking/skeleton_smoother.h"
#include "capture/tracking/tracker_backward.h"
#include "capture/tracking/tracker_internal.h"
#include "tests/support/tracked_film.h"

#include <string.h>

static const struct {
    enum body_point_name point;
    enum joint joint;
} shown[] = {
    {BODY_POINT_LEFT_SHOULDER, JOINT_LEFT_SHOULDER}, {BODY_POINT_RIGHT_SHOULDER, JOINT_RIGHT_SHOULDER},
    {BODY_POINT_LEFT_ELBOW, JOINT_LEFT_ELBOW},       {BODY_POINT_RIGHT_ELBOW, JOINT_RIGHT_ELBOW},
    {BODY_POINT_LEFT_WRIST, JOINT_LEFT_HAND},        {BODY_POINT_RIGHT_WRIST, JOINT_RIGHT_HAND},
    {BODY_POINT_LEFT_HIP, JOINT_LEFT_HIP},           {BODY_POINT_RIGHT_HIP, JOINT_RIGHT_HIP},
    {BODY_POINT_LEFT_KNEE, JOINT_LEFT_KNEE},         {BODY_POINT_RIGHT_KNEE, JOINT_RIGHT_KNEE},
    {BODY_POINT_LEFT_ANKLE, JOINT_LEFT_FOOT},        {BODY_POINT_RIGHT_ANKLE, JOINT_RIGHT_FOOT},
};

// The points of true joints: shifted in the room, and with left and right exchanged.
static struct body_points points_of(const struct calibration *c, const struct skeleton *truth, struct vec3 by,
                                    bool exchanged)
{
    struct body_points points = {.person = true};
    for (size_t i = 0; i < COUNT_OF(shown); i++) {
        const struct pixel px = lens_project(&c->color, v3_add(truth->joint[shown[exchanged ? i ^ 1 : i].joint], by));
        points.at[shown[i].point] = (struct body_point){(float)px.x, (float)px.y, 1};
    }
    return points;
}

enum points_kind { NO_POINTS, TRUE_POINTS, EXCHANGED, SHIFTED, OTHER_POSE, NO_PERSON };
enum { EVERY = 3 }; // frames between images that were looked at
#define SHIFT_M 0.3

static void set_points(struct tracked_film *f, enum points_kind kind, struct pose from, double time_s)
{
    const double then_s = kind == OTHER_POSE ? time_s + 0.7 : time_s;
    const struct skeleton truth = world_joints_in_camera(f->world, then_s, from);
    const struct vec3 by = kind == SHIFTED ? v3(SHIFT_M, 0, 0) : v3(0, 0, 0);
    struct body_points points = points_of(&f->calibration, &truth, by, kind == EXCHANGED);
    points.person = kind != NO_PERSON;
    tracker_set_body_points(f->tracker, kind == NO_POINTS ? NULL : &points);
}

static struct pose turned_to(const struct world *w, double degrees)
{
    const double half = degrees * 3.14159265358979323846 / 360;
    return pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(w));
}

static bool is_right_way(const struct skeleton *got, const struct skeleton *truth, enum joint left, enum joint right)
{
    return v3_dot(v3_sub(got->joint[left], got->joint[right]), v3_sub(truth->joint[left], truth->joint[right])) > 0;
}

// A take of `frames`; the number of frames that show it the right way round.
static int facing_right(enum points_kind kind, int frames)
{
    struct tracked_film f;
    tracked_film_open(&f, "man", "walk");
    const struct pose from = turned_to(f.world, 180);
    int right = 0;
    for (int k = 0; k < frames; k++) {
        const double t = k / 30.0;
        struct skeleton got, truth = world_joints_in_camera(f.world, 0, from);
        tracked_film_shoot(&f, from, 0, (uint64_t)k); // stands
        if (k % EVERY == 0)
            set_points(&f, kind, from, 0);
        if (tracker_next(f.tracker, nanoseconds(t), f.depth, &got, NULL) == OK)
            right += is_right_way(&got, &truth, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
    }
    tracked_film_close(&f);
    return right;
}

static void test_person_seen_from_behind(void **state)
{
    (void)state;
    enum { FRAMES = 8 };
    const int depth = facing_right(NO_POINTS, FRAMES), both = facing_right(TRUE_POINTS, FRAMES);
    print_message("the right way round: %d of %d frames from depth alone, %d with points\n", depth, FRAMES, both);
    EXPECT_INT(both, FRAMES);
}

// First frames in mid-motion: depth alone has them far off, or takes them for no person.
static void test_first_frame_in_mid_motion(void **state)
{
    (void)state;
    static const struct {
        const char *figure, *motion;
        double degrees, time_s;
    } starts[] = {{"man", "pirouette", -45, 4.94}, {"coat", "kata", -40, 6.36}, {"skirt", "kata", 43, 4.71}};
    for (size_t i = 0; i < COUNT_OF(starts); i++) {
        double error_m[2];
        for (int both = 0; both < 2; both++) {
            struct tracked_film f;
            tracked_film_open(&f, starts[i].figure, starts[i].motion);
            const struct pose from = turned_to(f.world, starts[i].degrees);
            struct skeleton got, truth = world_joints_in_camera(f.world, starts[i].time_s, from);
            tracked_film_shoot(&f, from, starts[i].time_s, i);
            set_points(&f, both ? TRUE_POINTS : NO_POINTS, from, starts[i].time_s);
            const enum status status = tracker_next(f.tracker, 1, f.depth, &got, NULL);
            error_m[both] = status == OK ? error_of(&got, &truth) : 1;
            tracked_film_close(&f);
        }
        print_message("%s, %s: %.0f mm from depth alone, %.0f with points\n", starts[i].figure, starts[i].motion,
                      1000 * error_m[0], 1000 * error_m[1]);
        EXPECT_AT_MOST(error_m[1], 0.09);
    }
}

// Puts the followed body into another pose, as a mistake in earlier frames would have.
static void follow_instead(struct tracker *t, struct body_pose pose)
{
    t->pose = t->previous_pose = pose;
    t->has_velocity = false;
    t->flip_log_odds = 0;
    pose_filter_start(&t->filter, &t->scratch->best.shape, &t->pose);
}

// Each leg where the other one is.
static struct body_pose legs_exchanged(const struct fit_result *fit)
{
    struct body_pose pose = fit->pose;
    for (int k = FIRST_LEG; k < LIMB_COUNT; k++) {
        const struct body_limb *other = &body_limbs[k ^ 1];
        two_bone_ik(&fit->shape, &pose, body_limbs[k].upper, fit->build.origin[other->end],
                    body_axis(&fit->build, SEG_PELVIS, 2));
    }
    return pose;
}

// Frames until the body is the right way round again after it was put the wrong way; `most` + 1: not within those.
static int frames_until_right(enum points_kind kind, bool legs, int most)
{
    struct tracked_film f;
    tracked_film_open(&f, "man", "kata");
    const struct pose from = world_sensor_pose(f.world);
    const enum joint left = legs ? JOINT_LEFT_KNEE : JOINT_LEFT_SHOULDER,
                     right = legs ? JOINT_RIGHT_KNEE : JOINT_RIGHT_SHOULDER;
    enum { BEFORE = 4 };
    int k = 0;
    for (; k < BEFORE + most; k++) {
        const double t = k / 30.0;
        struct skeleton got, truth = world_joints_in_camera(f.world, t, from);
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        if (k == BEFORE) {
            const struct fit_result *best = &f.tracker->scratch->best;
            follow_instead(f.tracker, legs ? legs_exchanged(best) : body_pose_flip_facing(&best->shape, &best->pose));
        }
        if (k % EVERY == 0)
            set_points(&f, kind, from, t);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(t), f.depth, &got, NULL), OK);
        if (k > BEFORE && is_right_way(&got, &truth, left, right))
            break;
    }
    tracked_film_close(&f);
    return k - BEFORE + 1;
}

static void test_facing_is_corrected(void **state)
{
    (void)state;
    enum { MOST = 24 };
    const int depth = frames_until_right(NO_POINTS, false, MOST), both = frames_until_right(TRUE_POINTS, false, MOST);
    print_message("flipped body: right after %d frames from depth alone, %d with points (%d: never)\n", depth, both,
                  MOST + 1);
    EXPECT_AT_MOST(both, 12);
}

static void test_exchanged_legs_are_corrected(void **state)
{
    (void)state;
    enum { MOST = 24 };
    const int depth = frames_until_right(NO_POINTS, true, MOST), both = frames_until_right(TRUE_POINTS, true, MOST);
    print_message("exchanged legs: right after %d frames from depth alone, %d with points (%d: never)\n", depth, both,
                  MOST + 1);
    EXPECT_AT_MOST(both, 18);
}

struct outcome {
    double error_m, worst_m; // mean, and of one joint
};

static struct outcome track(enum points_kind kind, int frames, struct skeleton out[])
{
    struct tracked_film f;
    struct outcome outcome = {0};
    tracked_film_open(&f, "woman", "kata");
    const struct pose from = world_sensor_pose(f.world);
    for (int k = 0; k < frames; k++) {
        const double t = 1 + k / 30.0;
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        if (k % EVERY == 0 && k) // the start is another test's
            set_points(&f, kind, from, t);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(t), f.depth, &out[k], NULL), OK);
        const struct skeleton truth = world_joints_in_camera(f.world, t, from);
        outcome.error_m += error_of(&out[k], &truth) / frames;
        for (int j = 0; j < JOINT_COUNT; j++)
            outcome.worst_m = fmax(outcome.worst_m, v3_distance(out[k].joint[j], truth.joint[j]));
    }
    tracked_film_close(&f);
    return outcome;
}

enum { TRACKED = 24 };

static void test_wrong_points_do_little_harm(void **state)
{
    (void)state;
    static struct skeleton got[TRACKED];
    static const char *const names[] = {[TRUE_POINTS] = "true",
                                        [EXCHANGED] = "exchanged",
                                        [SHIFTED] = "shifted",
                                        [OTHER_POSE] = "of another pose",
                                        [NO_PERSON] = "none found"};
    const struct outcome depth = track(NO_POINTS, TRACKED, got);
    print_message("depth alone: %.1f mm off, at most %.1f\n", 1000 * depth.error_m, 1000 * depth.worst_m);
    for (int kind = TRUE_POINTS; kind <= NO_PERSON; kind++) {
        const struct outcome both = track((enum points_kind)kind, TRACKED, got);
        print_message("points %s: %.1f mm off, at most %.1f\n", names[kind], 1000 * both.error_m, 1000 * both.worst_m);
        EXPECT_AT_MOST(both.error_m, depth.error_m + 0.005); // 1 mm, of points shifted by 300
    }
}

static void test_without_points_nothing_changes(void **state)
{
    (void)state;
    static struct skeleton before[TRACKED], after[TRACKED], twice[TRACKED];
    track(NO_POINTS, TRACKED, before); // sets NULL
    struct tracked_film f;
    tracked_film_open(&f, "woman", "kata");
    for (int k = 0; k < TRACKED; k++) {
        tracked_film_shoot(&f, world_sensor_pose(f.world), 1 + k / 30.0, (uint64_t)k);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(1 + k / 30.0), f.depth, &after[k], NULL), OK);
    }
    tracked_film_close(&f);
    assert_memory_equal(before, after, sizeof before);
    track(TRUE_POINTS, TRACKED, after);
    track(TRUE_POINTS, TRACKED, twice);
    assert_memory_equal(after, twice, sizeof after);
    EXPECT_TRUE(memcmp(before, after, sizeof before));
}

// Where colour shows no person, what depth takes for a person is refused for 2 s.
static void test_person_whom_colour_does_not_show(void **state)
{
    (void)state;
    struct tracked_film f;
    struct skeleton got;
    tracked_film_open(&f, "woman", "still");
    const struct pose from = world_sensor_pose(f.world);
    tracked_film_shoot(&f, from, 0, 1);
    int k = 0;
    for (; k < 100; k++) {
        if (k % EVERY == 0)
            set_points(&f, NO_PERSON, from, 0);
        if (tracker_next(f.tracker, nanoseconds(k / 30.0), f.depth, &got, NULL) == OK)
            break;
    }
    print_message("believed after %d frames\n", k);
    EXPECT_INT(k, 60);
    tracked_film_close(&f);
    tracked_film_open(&f, "woman", "still"); // and with points from the first frame on
    tracked_film_shoot(&f, from, 0, 1);
    set_points(&f, TRUE_POINTS, from, 0);
    EXPECT_STATUS(tracker_next(f.tracker, 0, f.depth, &got, NULL), OK);
    tracked_film_close(&f);
}

static void test_smoother_keeps_points_within_its_limit(void **state)
{
    (void)state;
    struct tracked_film f;
    struct smoother *s;
    struct skeleton got;
    tracked_film_open(&f, "woman", "kata");
    const struct pose from = world_sensor_pose(f.world);
    EXPECT_STATUS(smoother_open(&s, &f.calibration), OK);
    for (int k = 0; k < 4; k++) {
        tracked_film_shoot(&f, from, k / 30.0, (uint64_t)k);
        if (k % 2 == 0)
            set_points(&f, TRUE_POINTS, from, k / 30.0);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(k / 30.0), f.depth, &got, NULL), OK);
        EXPECT_STATUS(smoother_push(s, f.tracker, nanoseconds(k / 30.0), &got), OK);
    }
    const struct skeleton truth = world_joints_in_camera(f.world, 1 / 30.0, from);
    const struct body_points late = points_of(&f.calibration, &truth, v3(0, 0, 0), false);
    EXPECT_STATUS(smoother_set_points(s, 1, &late), OK);
    for (int k = 3; k >= 0; k--) {
        tracked_film_shoot(&f, from, k / 30.0, (uint64_t)k);
        EXPECT_STATUS(smoother_backward(s, f.tracker, k, f.depth), OK);
        EXPECT_INT(tracker_points(f.tracker) != NULL, k != 3);
    }
    EXPECT_STATUS(smoother_solve(s), OK);
    smoother_close(&s);
    EXPECT_STATUS(smoother_open(&s, &f.calibration), OK);
    smoother_limit_memory(s, 1000);
    set_points(&f, TRUE_POINTS, from, 0);
    EXPECT_STATUS(smoother_push(s, f.tracker, 0, NULL), ERR_MEMORY);
    smoother_close(&s);
    tracked_film_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_person_seen_from_behind),
        cmocka_unit_test(test_first_frame_in_mid_motion),
        cmocka_unit_test(test_facing_is_corrected),
        cmocka_unit_test(test_exchanged_legs_are_corrected),
        cmocka_unit_test(test_wrong_points_do_little_harm),
        cmocka_unit_test(test_without_points_nothing_changes),
        cmocka_unit_test(test_person_whom_colour_does_not_show),
        cmocka_unit_test(test_smoother_keeps_points_within_its_limit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
