// People who lie, kneel, sit and prop themselves up, from the first image on, from depth alone.
#include "tests/support/test.h"

#include "tests/support/tracked_film.h"

enum { FRAMES = 20, FOUND_BY = 10 };

static const struct {
    const char *figure, *motion;
    double degrees; // of the sensor about the person
} cases[] = {
    {"man", "lying-on-back:3", 60},  {"woman", "push-up:4", -70},        {"child", "kneeling:5", 20},
    {"tall", "all-fours:6", 80},     {"man", "sitting:7", 30},           {"woman", "wheelchair:8", -20},
    {"heavy", "lying-on-side:9", 0}, {"woman", "lying-on-front:10", 90},
};

static struct pose turned_about_person(const struct world *world, double degrees)
{
    const struct quat turn = quat_from_rotation_vector(v3(0, 0, degrees * 0.017453292519943295));
    const struct pose pose = world_sensor_pose(world);
    const struct vec3 middle = v3(0, 0, pose.translation.z);
    return (struct pose){quat_multiply(turn, pose.rotation),
                         v3_add(middle, quat_rotate(turn, v3_sub(pose.translation, middle)))};
}

static void test_postures_are_found(void **state)
{
    (void)state;
    int found = 0, right = 0, films = 0;
    for (size_t i = 0; i < COUNT_OF(cases); i += TRACKED_EACH) {
        struct tracked_film f;
        double error_m = 0;
        int frames = 0;
        tracked_film_open(&f, cases[i].figure, cases[i].motion);
        const struct pose from = turned_about_person(f.world, cases[i].degrees);
        for (int k = 0; k < FRAMES; k++) {
            const double time_s = k / 30.0;
            struct skeleton got;
            const struct skeleton truth = world_joints_in_camera(f.world, time_s, from);
            tracked_film_shoot(&f, from, time_s, (uint64_t)k);
            const enum status status = tracker_next(f.tracker, nanoseconds(time_s), f.depth, &got, NULL);
            assert_true(status >= 0);
            if (k < FOUND_BY || status != OK)
                continue;
            error_m += error_of(&got, &truth);
            frames++;
        }
        tracked_film_close(&f);
        print_message("%s, %s: %.0f mm in %d of %d frames\n", cases[i].figure, cases[i].motion,
                      frames ? 1e3 * error_m / frames : 0, frames, FRAMES - FOUND_BY);
        films++;
        found += frames > (FRAMES - FOUND_BY) / 2;
        right += frames && error_m / frames < 0.12;
    }
    EXPECT_AT_LEAST(found, films - 1);
    EXPECT_AT_LEAST(2 * right, films);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_postures_are_found)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
