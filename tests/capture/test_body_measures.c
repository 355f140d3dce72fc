// A person's measures as a tracker learns them, beside their true ones.
#include "tests/support/tracked_film.h"
#include "tests/support/test.h"

enum { FPS = 30, FRAMES = 120 };

// From the figure's left by this angle, at the same distance of the room's middle.
static struct pose seen_from(const struct tracked_film *f, double aside_degrees)
{
    double half = aside_degrees * 3.14159265358979323846 / 360;
    return pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(f->world));
}

static double breadth_m(const struct skeleton *s)
{
    return v3_distance(s->joint[JOINT_LEFT_SHOULDER], s->joint[JOINT_RIGHT_SHOULDER]);
}

// How much wider shoulders are tracked in the end than they are.
static double too_broad_m(const char *figure, double aside_degrees)
{
    struct tracked_film f;
    struct skeleton tracked, truth;
    tracked_film_open(&f, figure, "kata");
    struct pose from = seen_from(&f, aside_degrees);
    for (int k = 0; k < FRAMES; k++) {
        double t = (double)k / FPS;
        tracked_film_shoot(&f, from, t, (uint64_t)k);
        EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(t), f.depth, &tracked, NULL), OK);
        truth = world_joints_in_camera(f.world, t, from);
    }
    tracked_film_close(&f);
    print_message("%s, from %g degrees: %.0f mm broad between the shoulders, %.0f in truth\n", figure, aside_degrees,
                  1000 * breadth_m(&tracked), 1000 * breadth_m(&truth));
    return breadth_m(&tracked) - breadth_m(&truth);
}

// What stands out beside the person says that a body is too broad; points on its surface alone do not.
static void test_shoulder_width(void **state)
{
    (void)state;
    static const struct {
        const char *figure;
        double aside_degrees;
    } cases[] = {{"man", 20}, {"child", 20}, {"coat", 20}, {"man", 60}};
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(cases); i++)
        sum += fabs(too_broad_m(cases[i].figure, cases[i].aside_degrees)) / COUNT_OF(cases);
    print_message("off by %.1f mm in the mean\n", 1000 * sum);
    EXPECT_AT_MOST(sum, 0.007);
}

// Of who stands so near that no feet are in sight, the level of the crown says how tall they are, and a hem above the
// picture's lower edge that they wear a skirt: the trunk does not grow to be all that is seen.
static void test_close_person_has_true_size(void **state)
{
    (void)state;
    static const struct {
        const char *figure, *motion;
        double nearer_m, most_m;
    } cases[] = {{"child", "kata", 1.75, 0.032}, {"skirt", "bend", 1.4, 0.045}};
    enum { LAST = 45 };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        struct tracked_film f;
        struct skeleton tracked;
        double sum = 0;
        tracked_film_open(&f, cases[i].figure, cases[i].motion);
        struct pose from = moved(world_sensor_pose(f.world), v3(0, 0, cases[i].nearer_m));
        for (int k = 0; k < LAST; k++) {
            double t = (double)k / FPS;
            tracked_film_shoot(&f, from, t, (uint64_t)k);
            EXPECT_STATUS(tracker_next(f.tracker, nanoseconds(t), f.depth, &tracked, NULL), OK);
            struct skeleton truth = world_joints_in_camera(f.world, t, from);
            sum += error_of(&tracked, &truth) / LAST;
        }
        tracked_film_close(&f);
        print_message("%s, %s, %g m nearer: %.0f mm off\n", cases[i].figure, cases[i].motion, cases[i].nearer_m,
                      1000 * sum);
        EXPECT_AT_MOST(sum, cases[i].most_m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shoulder_width),
        cmocka_unit_test(test_close_person_has_true_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
