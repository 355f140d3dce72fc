// People on the floor and on chairs: nothing is in the floor, something rests on it, they move without jumps, and the
// same seed gives the same.
#include "tests/support/test.h"

#include "tests/world/motion.h"
#include "tests/world/posture.h"

#include <string.h>

static struct physique physique_named(const char *name)
{
    struct world_figure figure;
    EXPECT_TRUE(world_figure_named(name, &figure));
    return physique_of(&figure);
}

static struct skeleton joints_of(const struct physique *physique, const struct stance *stance)
{
    struct posed posed;
    physique_pose(physique, stance, &posed);
    return posed.joints;
}

static double lowest_joint(const struct skeleton *skeleton)
{
    double low = INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++)
        low = fmin(low, skeleton->joint[j].z);
    return low;
}

static void test_names(void **state)
{
    (void)state;
    enum posture found;
    for (int k = 0; k < POSTURES; k++) {
        EXPECT_TRUE(posture_named(posture_name((enum posture)k), &found));
        EXPECT_INT(found, k);
    }
    EXPECT_TRUE(!posture_named("handstand", &found));
    static const char *const refused[] = {"push-up:", "push-up:x", "push-up:-3", "push-up:1.5", ":1", "handstand:1"};
    const struct physique physique = physique_named("man");
    struct figure_motion *motion;
    for (size_t i = 0; i < COUNT_OF(refused); i++)
        EXPECT_STATUS(world_motion_open(&motion, refused[i], &physique, false), ERR_INPUT);
    EXPECT_STATUS(world_motion_open(&motion, "push-up:7", &physique, false), OK);
    world_motion_close(&motion);
}

// A joint is inside the body, 2 to 12 cm from the skin that rests.
static void test_postures_rest_on_the_floor(void **state)
{
    (void)state;
    enum { SEEDS = 12 };
    static const char *const figures[] = {"woman", "child", "heavy", "tall"};
    for (size_t f = 0; f < COUNT_OF(figures); f++) {
        const struct physique physique = physique_named(figures[f]);
        const double h = physique.figure.height_m;
        for (int k = 0; k < POSTURES; k++)
            for (int seed = 1; seed <= SEEDS; seed++) {
                const struct posture_motion motion = posture_motion_draw((enum posture)k, (uint64_t)seed);
                for (double t = 0; t <= posture_motion_seconds(); t += 0.5) {
                    const struct stance stance = posture_motion_at(&motion, &physique, t);
                    const struct skeleton s = joints_of(&physique, &stance);
                    const double low = lowest_joint(&s) / h;
                    if (!(low > 0.012 && low < 0.13))
                        print_error("%s, %s:%d at %.1f s: the lowest joint is %.3f heights up\n", figures[f],
                                    posture_name((enum posture)k), seed, t, low);
                    EXPECT_TRUE(low > 0.012 && low < 0.13);
                }
            }
    }
}

// How high the pelvis is tells the postures apart.
static void test_postures_are_what_they_are_called(void **state)
{
    (void)state;
    static const struct {
        enum posture posture;
        double low, high; // of the waist, in heights
    } wanted[] = {
        {POSTURE_STANDING, 0.5, 0.6},    {POSTURE_SITTING, 0.25, 0.42},        {POSTURE_SITTING_ON_FLOOR, 0.08, 0.17},
        {POSTURE_KNEELING, 0.28, 0.38},  {POSTURE_ON_HEELS, 0.1, 0.3},         {POSTURE_ALL_FOURS, 0.24, 0.4},
        {POSTURE_PUSH_UP, 0.05, 0.4},    {POSTURE_LYING_ON_BACK, 0.03, 0.16},  {POSTURE_BRIDGE, 0.1, 0.32},
        {POSTURE_CROUCHING, 0.12, 0.45}, {POSTURE_LYING_ON_FRONT, 0.03, 0.16},
    };
    const struct physique physique = physique_named("man");
    for (size_t k = 0; k < COUNT_OF(wanted); k++)
        for (int seed = 1; seed <= 20; seed++) {
            const struct posture_motion motion = posture_motion_draw(wanted[k].posture, (uint64_t)seed);
            const struct stance stance = posture_motion_at(&motion, &physique, 0.7);
            const double waist = joints_of(&physique, &stance).joint[JOINT_WAIST].z / physique.figure.height_m;
            if (!(waist > wanted[k].low && waist < wanted[k].high))
                print_error("%s:%d: the waist is %.3f heights up\n", posture_name(wanted[k].posture), seed, waist);
            EXPECT_TRUE(waist > wanted[k].low && waist < wanted[k].high);
        }
}

static void test_motions_do_not_jump(void **state)
{
    (void)state;
    const double rate_hz = 60;
    const struct physique physique = physique_named("woman");
    double worst_m = 0;
    for (int k = 0; k < POSTURES; k++)
        for (int seed = 1; seed <= 6; seed++) {
            const struct posture_motion motion = posture_motion_draw((enum posture)k, (uint64_t)seed);
            struct skeleton before = {0};
            for (int n = 0; n <= (int)(posture_motion_seconds() * rate_hz); n++) {
                const struct stance stance = posture_motion_at(&motion, &physique, n / rate_hz);
                const struct skeleton s = joints_of(&physique, &stance);
                for (int j = 0; j < JOINT_COUNT && n; j++) {
                    const double way_m = v3_distance(s.joint[j], before.joint[j]);
                    if (way_m > worst_m)
                        print_message("%s:%d, joint %d at %.2f s: %.0f mm in a sixtieth of a second\n",
                                      posture_name((enum posture)k), seed, j, n / rate_hz, 1e3 * way_m);
                    worst_m = fmax(worst_m, way_m);
                }
                before = s;
            }
        }
    EXPECT_AT_MOST(worst_m, 0.12); // 0.089 seen, of a hand
}

static void test_seeds(void **state)
{
    (void)state;
    const struct physique physique = physique_named("man");
    const struct posture_motion a = posture_motion_draw(POSTURE_PUSH_UP, 3),
                                b = posture_motion_draw(POSTURE_PUSH_UP, 3),
                                c = posture_motion_draw(POSTURE_PUSH_UP, 4);
    const struct stance sa = posture_motion_at(&a, &physique, 1.3), sb = posture_motion_at(&b, &physique, 1.3),
                        sc = posture_motion_at(&c, &physique, 1.3);
    EXPECT_TRUE(!memcmp(&sa, &sb, sizeof sa));
    EXPECT_TRUE(v3_distance(sa.waist, sc.waist) > 1e-3);
}

static void test_a_chair_is_under_who_sits(void **state)
{
    (void)state;
    const struct physique physique = physique_named("woman");
    struct posture_box box[POSTURE_BOXES];
    for (int seed = 1; seed <= 10; seed++) {
        const struct posture_motion motion = posture_motion_draw(POSTURE_WHEELCHAIR, (uint64_t)seed);
        const struct stance stance = posture_motion_at(&motion, &physique, 0);
        const struct skeleton s = joints_of(&physique, &stance);
        EXPECT_INT(posture_furniture(POSTURE_WHEELCHAIR, &stance, &physique, box), POSTURE_BOXES);
        for (int side = 0; side < 2; side++) {
            const struct vec3 hip = s.joint[side ? JOINT_RIGHT_HIP : JOINT_LEFT_HIP];
            EXPECT_TRUE(box[0].high.z < hip.z && box[0].high.z > hip.z - 0.2);
            EXPECT_TRUE(hip.x > box[0].low.x && hip.x < box[0].high.x && hip.y > box[0].low.y && hip.y < box[0].high.y);
        }
    }
    const struct posture_motion motion = posture_motion_draw(POSTURE_STANDING, 1);
    const struct stance stance = posture_motion_at(&motion, &physique, 0);
    EXPECT_INT(posture_furniture(POSTURE_STANDING, &stance, &physique, box), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_postures_rest_on_the_floor),
        cmocka_unit_test(test_postures_are_what_they_are_called),
        cmocka_unit_test(test_motions_do_not_jump),
        cmocka_unit_test(test_seeds),
        cmocka_unit_test(test_a_chair_is_under_who_sits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
