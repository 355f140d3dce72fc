// A lower leg that was fitted beside its place: what sticks out of the silhouette shows where it is.
#include "tests/support/test.h"

#include "capture/body/two_bone_ik.h"
#include "capture/tracking/occluded_shin.h"
#include "capture/tracking/tracker_backward.h"
#include "tests/support/tracked_film.h"

#include <stdlib.h>

enum { FPS = 30, FRAMES = 30, EVERY = 5 };
#define MISPLACED_RADIANS 0.3

static const enum joint foot[2] = {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT};
static const enum segment shin[2] = {SEG_LEFT_SHIN, SEG_RIGHT_SHIN};

struct shin_tally {
    int tried, found, kept;          // kept: fitted poses that are left as they are
    double misplaced_m, corrected_m; // sums over those found, distance of the foot from where it was fitted
};

// Rotates a lower leg about its knee, in the image plane.
static struct body_pose rotated_aside(const struct body_shape *shape, const struct body_pose *pose, int leg,
                                      double radians)
{
    struct body_pose out = *pose;
    struct body_build build;
    body_forward_kinematics(shape, pose, &build);
    struct vec3 knee = build.origin[shin[leg]], along = v3_unit(v3_sub(build.joint[foot[leg]], knee)),
                across = v3_unit(v3_cross(along, knee));
    body_aim_segment(shape, &out, shin[leg], v3_add(v3_scale(along, cos(radians)), v3_scale(across, sin(radians))));
    return out;
}

static void try_leg(struct fit_task *task, const struct body_pose *fitted, int leg, struct fit_scratch *scratch,
                    struct shin_tally *tally)
{
    const struct body_shape *shape = &task->shape.mean;
    struct body_build build, misplaced, back;
    struct body_pose found;
    body_forward_kinematics(shape, fitted, &build);
    body_evaluate(task, fitted, shape, &scratch->best);
    tally->kept += shin_alternative_log_odds(task, FIRST_LEG + leg, scratch, &found) == 0;
    for (int side = -1; side <= 1; side += 2) {
        struct body_pose pose = rotated_aside(shape, fitted, leg, side * MISPLACED_RADIANS);
        body_evaluate(task, &pose, shape, &scratch->best);
        tally->tried++;
        if (!(shin_alternative_log_odds(task, FIRST_LEG + leg, scratch, &found) > 0))
            continue;
        body_forward_kinematics(shape, &pose, &misplaced);
        body_forward_kinematics(shape, &found, &back);
        tally->found++;
        tally->misplaced_m += v3_distance(misplaced.joint[foot[leg]], build.joint[foot[leg]]);
        tally->corrected_m += v3_distance(back.joint[foot[leg]], build.joint[foot[leg]]);
    }
}

// The fit is taken as the truth here: the leg is visible from everywhere but behind the other leg.
static void film(double azimuth_degrees, struct shin_tally *tally)
{
    struct tracked_film f;
    struct depth_evidence *evidence;
    struct fit_scratch *scratch = calloc(1, sizeof *scratch);
    double half = azimuth_degrees * 3.14159265358979323846 / 360;
    assert_non_null(scratch);
    tracked_film_open(&f, "man", "kata");
    EXPECT_STATUS(evidence_open(&evidence, &f.calibration.depth), OK);
    struct pose from =
        pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(f.world));
    for (int k = 0; k < FRAMES; k++) {
        struct skeleton tracked;
        tracked_film_shoot(&f, from, (double)k / FPS, (uint64_t)k);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds((double)k / FPS), f.depth, &tracked, f.mask), OK);
        if (k % EVERY)
            continue;
        for (size_t i = 0; i < f.pixels; i++)
            f.truth_mask[i] = f.truth_mask[i] ? 255 : 0;
        assert_true(evidence_read(evidence, f.depth, f.truth_mask, 600));
        struct fit_task task = {.point_stride = 1, .evidence = evidence, .kernel_m = 0.12};
        task.shape.mean = *tracker_shape(f.tracker);
        for (int leg = 0; leg < 2; leg++)
            try_leg(&task, tracker_pose(f.tracker), leg, scratch, tally);
    }
    evidence_close(&evidence);
    tracked_film_close(&f);
    free(scratch);
}

static void test_misplaced_shin_is_corrected(void **state)
{
    (void)state;
    static const double azimuth[] = {0, 45, 90};
    for (size_t i = 0; i < COUNT_OF(azimuth); i += TRACKED_EACH) {
        struct shin_tally t = {0};
        film(azimuth[i], &t);
        print_message("seen from %g degrees: %d of %d found, %.0f mm off before, %.0f after; %d of %d left as fitted\n",
                      azimuth[i], t.found, t.tried, 1000 * t.misplaced_m / t.found, 1000 * t.corrected_m / t.found,
                      t.kept, t.tried / 2);
        EXPECT_INT(t.found, t.tried);
        EXPECT_AT_MOST(t.corrected_m, 0.22 * t.misplaced_m); // 0.18
        EXPECT_AT_LEAST(t.kept, 0.8 * t.tried / 2);          // 10 of 12
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_misplaced_shin_is_corrected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
