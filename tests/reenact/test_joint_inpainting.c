// A joint that is lost for a moment moves with the trunk, interpolated between the frames that know it; a take's
// skeletons hold the same joints as inpaint_skeleton gives, in bounded memory.
#include "tests/support/test.h"

#include "reenact/skeleton/skeleton_track.h"
#include "tests/support/painted_person.h"

#include <string.h>

enum { FRAMES = 71, LOST_FROM = 10, LOST_TO = 20, GONE_FROM = 11 }; // 40 ms apart

#define SIGMA_M 0.02 // of every joint

static struct painted film;

// The left forearm rises by 1 cm a frame. All turn with the trunk by a twentieth of a radian a frame.
static struct skeleton truth_at(int frame)
{
    struct skeleton s = whole_body(0.01 * frame);
    const struct vec3 middle = s.joint[JOINT_TORSO];
    const struct quat turn = quat_from_rotation_vector(v3(0, -0.05 * frame, 0));
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3_add(middle, quat_rotate(turn, v3_sub(s.joint[j], middle)));
    const struct covariance3 c = covariance3_isotropic(SIGMA_M * SIGMA_M);
    for (int j = 0; j < JOINT_COUNT; j++)
        joint_set_covariance(&s, (enum joint)j, &c);
    return s;
}

// The left hand is lost from the first to the last of these frames.
static void open_take(struct painted_take *stage, int first, int last)
{
    static struct one_frame frames[FRAMES];
    for (int i = 0; i < FRAMES; i++) {
        frames[i] = (struct one_frame){truth_at(i), NULL, film.depth, film.mask};
        if (i >= first && i <= last) {
            frames[i].skeleton.confidence[JOINT_LEFT_HAND] = 0;
            frames[i].skeleton.joint[JOINT_LEFT_HAND] = v3(9, 9, 9);
        }
    }
    painted_take_open(stage, &ideal, frames, FRAMES, &whole_measures);
}

static void test_lost_hand_follows_trunk(void **state)
{
    (void)state;
    struct painted_take stage;
    double worst = 0;
    open_take(&stage, LOST_FROM, LOST_TO);
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton s = inpaint_skeleton(stage.take, i), truth = truth_at(i);
        const bool lost = i >= LOST_FROM && i <= LOST_TO;
        EXPECT_NEAR(s.confidence[JOINT_LEFT_HAND], lost ? 0.5 : 1, 1e-6);
        if (lost)
            worst = fmax(worst, v3_distance(s.joint[JOINT_LEFT_HAND], truth.joint[JOINT_LEFT_HAND]));
        else
            EXPECT_NEAR(v3_distance(s.joint[JOINT_LEFT_HAND], truth.joint[JOINT_LEFT_HAND]), 0, 1e-5);
    }
    print_message("a hand lost for %d frames is off by %.1f mm\n", LOST_TO - LOST_FROM + 1, 1000 * worst);
    EXPECT_AT_MOST(worst, 0.006);
    painted_take_close(&stage);
}

// What is inpainted is known the less the farther the frames are that know it, and no better than the elbow.
static void test_inpainted_joints_are_uncertain(void **state)
{
    (void)state;
    struct painted_take stage;
    double sigma_m[FRAMES];
    open_take(&stage, LOST_FROM, LOST_TO);
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton s = inpaint_skeleton(stage.take, i);
        sigma_m[i] = joint_sigma_m(&s, JOINT_LEFT_HAND);
        if (i < LOST_FROM || i > LOST_TO)
            EXPECT_NEAR(sigma_m[i], SIGMA_M, 1e-4);
        else
            EXPECT_AT_LEAST(sigma_m[i], 1.5 * SIGMA_M);
    }
    EXPECT_AT_LEAST(sigma_m[(LOST_FROM + LOST_TO) / 2], sigma_m[LOST_FROM]);
    EXPECT_NEAR(sigma_m[LOST_FROM], sigma_m[LOST_TO], 1e-3);
    painted_take_close(&stage);
    open_take(&stage, GONE_FROM, FRAMES - 1); // never known again: it wanders off
    for (int i = GONE_FROM; i < GONE_FROM + 20; i++) {
        const struct skeleton s = inpaint_skeleton(stage.take, i);
        const double since_s = 0.04 * (i - GONE_FROM + 1);
        EXPECT_NEAR(joint_sigma_m(&s, JOINT_LEFT_HAND), sqrt(SIGMA_M * SIGMA_M + 0.04 * since_s), 2e-3);
    }
    painted_take_close(&stage);
}

// Between two frames a joint is known no better than in the better of them.
static void test_covariance_between_frames(void **state)
{
    (void)state;
    struct painted_take stage;
    struct take_skeletons *skeletons;
    struct skeleton_track *track;
    struct track_sample sample;
    open_take(&stage, LOST_FROM, LOST_TO);
    EXPECT_STATUS(take_skeletons_open(&skeletons, stage.take), OK);
    EXPECT_STATUS(skeleton_track_open(&track, stage.take, skeletons), OK);
    const int64_t step_ns = take_entry(stage.take, 1)->time_ns - take_entry(stage.take, 0)->time_ns;
    EXPECT_STATUS(skeleton_track_at(track, 4 * step_ns + step_ns / 2, true, &sample), OK);
    EXPECT_NEAR(joint_sigma_m(&sample.skeleton, JOINT_LEFT_HAND), SIGMA_M, 1e-4);
    const struct skeleton lost = inpaint_skeleton(stage.take, LOST_FROM);
    const double lost_m = joint_sigma_m(&lost, JOINT_LEFT_HAND);
    EXPECT_STATUS(skeleton_track_at(track, LOST_FROM * step_ns - step_ns / 2, true, &sample), OK);
    EXPECT_NEAR(joint_sigma_m(&sample.skeleton, JOINT_LEFT_HAND), sqrt((SIGMA_M * SIGMA_M + lost_m * lost_m) / 2),
                1e-3);
    skeleton_track_close(&track);
    take_skeletons_close(&skeletons);
    painted_take_close(&stage);
}

static void test_long_lost_joint_stays_unknown(void **state)
{
    (void)state;
    struct painted_take stage;
    open_take(&stage, GONE_FROM, FRAMES - 1);
    const int64_t step_ns = take_entry(stage.take, 1)->time_ns - take_entry(stage.take, 0)->time_ns;
    const int inpainted = (int)(INPAINT_MAX_GAP_NS / step_ns);
    EXPECT_TRUE(GONE_FROM + inpainted < FRAMES);
    for (int i = GONE_FROM; i < FRAMES; i++)
        EXPECT_NEAR(inpaint_skeleton(stage.take, i).confidence[JOINT_LEFT_HAND], i < GONE_FROM + inpainted ? 0.5 : 0,
                    1e-6);
    painted_take_close(&stage);
}

static void test_take_skeletons_are_the_inpainted_ones(void **state)
{
    (void)state;
    struct painted_take stage;
    struct take_skeletons *skeletons;
    struct skeleton_track *track;
    open_take(&stage, LOST_FROM, LOST_TO);
    EXPECT_STATUS(take_skeletons_open(&skeletons, stage.take), OK);
    EXPECT_STATUS(skeleton_track_open(&track, stage.take, skeletons), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton wanted = inpaint_skeleton(stage.take, i), *got = take_skeletons_at(skeletons, i);
        EXPECT_TRUE(!memcmp(wanted.joint, got->joint, sizeof wanted.joint));
        EXPECT_TRUE(!memcmp(wanted.confidence, got->confidence, sizeof wanted.confidence));
        if (i < LOST_FROM || i > LOST_TO) // no copy where nothing was inpainted
            EXPECT_TRUE(got == &take_entry(stage.take, i)->skeleton);
    }
    skeleton_track_close(&track);
    take_skeletons_close(&skeletons);
    painted_take_close(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lost_hand_follows_trunk),
        cmocka_unit_test(test_inpainted_joints_are_uncertain),
        cmocka_unit_test(test_covariance_between_frames),
        cmocka_unit_test(test_long_lost_joint_stays_unknown),
        cmocka_unit_test(test_take_skeletons_are_the_inpainted_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
