// A smoothed take: nearer to the truth than the online estimate, with less jitter, constant bone lengths and no jumps;
// the turning point of a fast motion is not clipped.
#include "tests/support/test.h"

#include "capture/tracking/skeleton_smoother.h"
#include "tests/support/tracked_film.h"

#include <string.h>

enum { FRAMES_MOST = 72 };
#define FRAME_S (1.0 / 30)

struct smoothing_case {
    int frames;
    struct skeleton truth[FRAMES_MOST], online[FRAMES_MOST], smoothed[FRAMES_MOST];
};

struct smoothing_take {
    const char *motion;
    double from_s;
    int frames, dark, light; // frames `dark` to `light` - 1 have no depth
    double azimuth_degrees;  // the sensor stands this far to the left of the direction the figure faces
};

static void run_smoothing(const struct smoothing_take *take, struct smoothing_case *out)
{
    static uint16_t *depth[FRAMES_MOST];
    struct tracked_film f;
    struct smoother *smoother;
    int frames = take->frames;
    double half = take->azimuth_degrees * 3.14159265358979323846 / 360;
    tracked_film_open(&f, "man", take->motion);
    EXPECT_STATUS(smoother_open(&smoother, &f.calibration), OK);
    struct pose from =
        pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(f.world));
    memset(out, 0, sizeof *out);
    out->frames = frames;
    for (int k = 0; k < frames; k++) {
        double t = take->from_s + k * FRAME_S;
        bool black = k >= take->dark && k < take->light;
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        if (black)
            memset(f.depth, 0, f.pixels * sizeof *f.depth);
        depth[k] = malloc(f.pixels * sizeof *f.depth);
        assert_non_null(depth[k]);
        memcpy(depth[k], f.depth, f.pixels * sizeof *f.depth);
        out->truth[k] = world_joints_in_camera(f.world, t, from);
        enum status status = tracker_next(f.tracker, nanoseconds(t), depth[k], &out->online[k], NULL);
        EXPECT_INT(status, black ? NOTHING : OK);
        EXPECT_STATUS(smoother_push(smoother, f.tracker, nanoseconds(t), status == OK ? &out->online[k] : NULL), OK);
    }
    for (int k = frames - 1; k >= 0; k--) {
        EXPECT_STATUS(smoother_backward(smoother, f.tracker, k, depth[k]), OK);
        free(depth[k]);
    }
    EXPECT_STATUS(smoother_solve(smoother), OK);
    for (int k = 0; k < frames; k++) {
        const struct skeleton *s = smoother_skeleton(smoother, k);
        EXPECT_INT(s != NULL, k < take->dark || k >= take->light);
        if (s)
            out->smoothed[k] = *s;
    }
    smoother_close(&smoother);
    tracked_film_close(&f);
}

static double mean_error_m(const struct smoothing_case *t, const struct skeleton *got)
{
    double sum = 0;
    int count = 0;
    for (int k = 0; k < t->frames; k++)
        for (int j = 0; j < JOINT_COUNT; j++)
            if (got[k].confidence[j] > 0) {
                sum += v3_distance(got[k].joint[j], t->truth[k].joint[j]);
                count++;
            }
    return sum / count;
}

// The mean second difference of the error over three frames in a row.
static double jitter_m(const struct smoothing_case *t, const struct skeleton *got)
{
    double sum = 0;
    for (int k = 1; k + 1 < t->frames; k++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            struct vec3 e[3];
            for (int i = 0; i < 3; i++)
                e[i] = v3_sub(got[k - 1 + i].joint[j], t->truth[k - 1 + i].joint[j]);
            sum += v3_length(v3_sub(v3_add(e[0], e[2]), v3_scale(e[1], 2)));
        }
    return sum / (JOINT_COUNT * (t->frames - 2));
}

// The mean squared Mahalanobis distance of the known joints of a confidence from `from` to `to`; 3 where the
// covariances are right.
static double mean_mahalanobis_squared(const struct smoothing_case *t, const struct skeleton *got, double from,
                                       double to)
{
    double sum = 0;
    int count = 0;
    for (int k = 0; k < t->frames; k++)
        for (int j = 0; j < JOINT_COUNT; j++)
            if ((double)got[k].confidence[j] >= from && (double)got[k].confidence[j] <= to) {
                sum += joint_mahalanobis_squared(&got[k], &t->truth[k], (enum joint)j);
                count++;
            }
    return count ? sum / count : 3;
}

static void test_covariances_say_how_far_off(void **state)
{
    (void)state;
    static struct smoothing_case t;
    const struct smoothing_take takes[] = {{"kata", 2, FRAMES_MOST, 0, 0, 0}, {"walk", 0, 48, 0, 0, 135}};
    for (size_t i = 0; i < COUNT_OF(takes); i++) {
        run_smoothing(&takes[i], &t);
        double seen = mean_mahalanobis_squared(&t, t.smoothed, 1, 1),
               inferred = mean_mahalanobis_squared(&t, t.smoothed, 0.5, 0.5);
        print_message("%s: mean squared Mahalanobis distance %.2f of joints seen, %.2f inferred, instead of 3\n",
                      takes[i].motion, seen, inferred);
        EXPECT_AT_LEAST(seen, 0.75);
        EXPECT_AT_MOST(seen, 6);
        EXPECT_AT_MOST(inferred, 9);
    }
}

static void test_smoothing_reduces_error(void **state)
{
    (void)state;
    static struct smoothing_case t;
    run_smoothing(&(struct smoothing_take){"kata", 2, FRAMES_MOST, 0, 0, 0}, &t);
    double online = mean_error_m(&t, t.online), smoothed = mean_error_m(&t, t.smoothed);
    double online_jitter = jitter_m(&t, t.online), smoothed_jitter = jitter_m(&t, t.smoothed);
    print_message("online: %.1f mm off, jitter %.1f; smoothed: %.1f, %.1f\n", 1000 * online, 1000 * online_jitter,
                  1000 * smoothed, 1000 * smoothed_jitter);
    EXPECT_AT_MOST(smoothed, 0.91 * online);               // 0.88
    EXPECT_AT_MOST(smoothed_jitter, 0.40 * online_jitter); // 0.38
    static const enum joint bone[4][2] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
                                          {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
                                          {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
                                          {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}};
    for (int k = 1; k < t.frames; k++) {
        for (int j = 0; j < JOINT_COUNT; j++)
            EXPECT_AT_MOST(v3_distance(t.smoothed[k].joint[j], t.smoothed[k - 1].joint[j]), 0.25);
        for (int b = 0; b < 4; b++)
            EXPECT_NEAR(v3_distance(t.smoothed[k].joint[bone[b][0]], t.smoothed[k].joint[bone[b][1]]),
                        v3_distance(t.smoothed[0].joint[bone[b][0]], t.smoothed[0].joint[bone[b][1]]), 1e-9);
    }
}

static double step_m(const struct world *w, double t, enum joint j)
{
    return v3_distance(world_joints(w, t).joint[j], world_joints(w, t - FRAME_S).joint[j]);
}

// The time of the fastest step of the motion.
static double fastest_s(const char *motion, enum joint j, double *speed_m_s)
{
    struct tracked_film f;
    double when = 0;
    *speed_m_s = 0;
    tracked_film_open(&f, "man", motion);
    for (double t = FRAME_S; t < world_seconds(f.world); t += FRAME_S)
        if (step_m(f.world, t, j) / FRAME_S > *speed_m_s) {
            *speed_m_s = step_m(f.world, t, j) / FRAME_S;
            when = t;
        }
    tracked_film_close(&f);
    return when;
}

// The largest distance of a joint from where it was in the first frame.
static double reach_m(const struct skeleton *s, int frames, enum joint j)
{
    double most = 0;
    for (int k = 0; k < frames; k++)
        most = fmax(most, v3_distance(s[k].joint[j], s[0].joint[j]));
    return most;
}

static void test_fast_motion_is_not_clipped(void **state)
{
    (void)state;
    static struct smoothing_case t;
    static const enum joint tip[2] = {JOINT_RIGHT_HAND, JOINT_RIGHT_FOOT};
    for (int i = 0; i < 2; i++) {
        double speed, when = fastest_s("kata", tip[i], &speed);
        run_smoothing(&(struct smoothing_take){"kata", fmax(0, when - 0.8), 48, 0, 0, 0}, &t);
        double truth = reach_m(t.truth, t.frames, tip[i]), online = reach_m(t.online, t.frames, tip[i]),
               smoothed = reach_m(t.smoothed, t.frames, tip[i]);
        print_message("%s, up to %.1f m/s, goes %.0f mm; online %.0f, smoothed %.0f\n", joint_name(tip[i]), speed,
                      1000 * truth, 1000 * online, 1000 * smoothed);
        EXPECT_AT_MOST(fabs(smoothed - truth), fabs(online - truth)); // 21 and 7 mm nearer
    }
}

// Long enough for the person to be lost and detected again in both passes.
static void test_frames_without_actor_stay_empty(void **state)
{
    (void)state;
    static struct smoothing_case t, again;
    run_smoothing(&(struct smoothing_take){"kata", 2, 64, 24, 50, 0}, &t);
    run_smoothing(&(struct smoothing_take){"kata", 2, 64, 24, 50, 0}, &again);
    double online = mean_error_m(&t, t.online), smoothed = mean_error_m(&t, t.smoothed);
    print_message("with 0.9 s of darkness, online: %.1f mm off; smoothed: %.1f\n", 1000 * online, 1000 * smoothed);
    EXPECT_AT_MOST(smoothed, 0.93 * online); // 0.88
    EXPECT_AT_MOST(smoothed, 0.03);          // the person is detected again in the middle of a kick
    assert_memory_equal(t.smoothed, again.smoothed, sizeof t.smoothed);
}

static bool faces_opposite(const struct skeleton *got, const struct skeleton *truth)
{
    struct vec3 left = v3_sub(got->joint[JOINT_LEFT_HIP], got->joint[JOINT_RIGHT_HIP]),
                true_left = v3_sub(truth->joint[JOINT_LEFT_HIP], truth->joint[JOINT_RIGHT_HIP]);
    return v3_dot(left, true_left) < 0;
}

// With feet outside the image, a person who walks away could be taken for one who faces the sensor, as most do.
static void test_facing_is_right_from_first_frame(void **state)
{
    (void)state;
    static struct smoothing_case t;
    int online = 0, smoothed = 0;
    run_smoothing(&(struct smoothing_take){"walk", 0, 48, 0, 0, 135}, &t);
    for (int k = 0; k < t.frames; k++) {
        online += faces_opposite(&t.online[k], &t.truth[k]);
        smoothed += faces_opposite(&t.smoothed[k], &t.truth[k]);
    }
    print_message("facing the opposite way: online %d of %d frames, smoothed %d, %.1f mm off\n", online, t.frames,
                  smoothed, 1000 * mean_error_m(&t, t.smoothed));
    EXPECT_INT(smoothed, 0);
    EXPECT_AT_MOST(mean_error_m(&t, t.smoothed), 0.035);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_smoothing_reduces_error),          cmocka_unit_test(test_covariances_say_how_far_off),
        cmocka_unit_test(test_fast_motion_is_not_clipped),       cmocka_unit_test(test_frames_without_actor_stay_empty),
        cmocka_unit_test(test_facing_is_right_from_first_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
