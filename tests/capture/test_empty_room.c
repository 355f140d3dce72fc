// Images of a furnished room without a person, each as the first of a film: boxes as tall as people are the hardest of
// it.
#include "tests/support/test.h"

#include "tests/support/tracked_film.h"

enum { EVERY_S = 4 }; // images a second of the sweep

static const struct world_box furniture[] = {
    {{-2.2, 1.0, 0}, {-1.6, 1.4, 1.7}}, // a cupboard
    {{1.2, 1.8, 0}, {1.6, 2.1, 1.2}},   // a narrow chest
    {{-0.6, 2.2, 0}, {-0.2, 2.6, 0.9}}, // a stool
    {{0.4, -0.8, 0}, {0.7, -0.5, 2.2}}, // a post
};

static void test_less_of_a_room_is_taken_for_a_person(void **state)
{
    (void)state;
    struct world *world;
    struct world_options options = world_default_options();
    options.plain = true;
    options.boxes = COUNT_OF(furniture);
    memcpy(options.box, furniture, sizeof furniture);
    EXPECT_STATUS(world_open(&world, &options), OK);
    const struct calibration calibration = world_calibration(0.5);
    const struct lens *lens = &calibration.depth;
    uint16_t *depth = calloc((size_t)lens->width * (size_t)lens->height, sizeof *depth);
    assert_non_null(depth);
    int taken = 0, looked = 0;
    for (int k = 0; k < WORLD_SWEEP_S * EVERY_S; k += TRACKED_EACH) {
        const double time_s = (double)k / EVERY_S;
        const struct world_shot shot = {*lens, world_sweep_pose(world, time_s), 0, false};
        struct tracker *tracker;
        struct skeleton got;
        EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.depth = depth}), OK);
        EXPECT_STATUS(world_depth_noise(lens, depth, (uint64_t)k, depth), OK);
        EXPECT_STATUS(tracker_open(&tracker, &calibration, NULL), OK);
        const enum status status = tracker_next(tracker, nanoseconds(time_s), depth, &got, NULL);
        assert_true(status >= 0);
        if (status == OK)
            print_message("taken at %.2f s\n", time_s);
        taken += status == OK;
        looked++;
        tracker_close(&tracker);
    }
    print_message("%d of %d images\n", taken, looked);
    EXPECT_AT_MOST(taken, 20 / TRACKED_EACH); // 34 where whatever fits somehow is a person
    free(depth);
    world_close(&world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_less_of_a_room_is_taken_for_a_person)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
