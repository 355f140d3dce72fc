// Times that no sensor gives are named with their cause, and judged by a clock that a sensor could have.
#include "tests/support/test.h"

#include "capture/take_verdict.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

static const struct clock {
    const char *what;
    double scale;         // of the times of a film of 30 Hz
    double jump_s;        // ahead, in the middle
    const char *sentence; // part of it; NULL: nothing is wrong with the times
} clocks[] = {
    {"seconds", 1, 0, NULL},
    {"10 Hz", 3, 0, NULL},
    {"2 Hz", 15, 0, NULL},
    {"120 Hz", 0.25, 0, NULL},
    {"a pause of 5 s", 1, 5, "a gap of 5.0 s"},
    {"milliseconds", 1e3, 0, "milliseconds taken for seconds"},
    {"microseconds", 1e6, 0, "microseconds taken for seconds"},
    {"nanoseconds", 1e9, 0, "nanoseconds taken for seconds"},
    {"numbers of frames", 30, 0, "its times cannot be right"},
    {"thousandths", 1e-3, 0, "its times cannot be right, 30000 pictures a second"},
    {"a day ahead", 1, 86400, "the clock jumped ahead by 24.0 h at 1.0 s"},
    {"an hour ahead", 1, 3600, "the clock jumped ahead by 60.0 min at 1.0 s"},
};

static void write_film(const struct clock *clock, const char *path)
{
    struct recording_writer *w;
    const struct calibration c = world_calibration(0.1);
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "a", &c), OK);
    for (int i = 0; i < 60; i++) {
        const double time_s = i / 30.0 * clock->scale + (i > 30 ? clock->jump_s : 0);
        const struct take_frame frame = {.time_ns = (int64_t)(time_s * 1e9), .world_from_camera = POSE_IDENTITY};
        EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
}

static void test_absurd_times_are_named(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT_OF(clocks); i++) {
        struct scratch scratch = scratch_make();
        struct recording *r;
        struct take_verdict v;
        char text[VERDICT_TEXT_BYTES];
        write_film(&clocks[i], scratch_file(&scratch, "film.reenact"));
        EXPECT_STATUS(recording_open(&r, scratch_file(&scratch, "film.reenact")), OK);
        EXPECT_STATUS(take_verdict_get(r, "a", NULL, &v), OK);
        recording_free(&r);
        printf("%-18s %s\n", clocks[i].what, verdict_text(&v, text));
        EXPECT_TRUE(!verdict_is_good(&v)); // nobody is in it
        if (clocks[i].sentence)
            EXPECT_TRUE(strstr(text, clocks[i].sentence));
        else
            EXPECT_TRUE(!strstr(text, "time") && !strstr(text, "clock") && !strstr(text, "gap"));
        scratch_remove(&scratch);
    }
}

// Of three quarters of a minute at 30 Hz not more is looked at than of half a minute, and of a second each frame.
static void test_few_images_are_looked_at(void **state)
{
    (void)state;
    static const struct {
        int frames;
        double rate_hz;
        int looks;
    } films[] = {{30, 30, 30}, {270, 30, 90}, {270, 10, 270}, {1350, 30, 270}};
    const struct calibration c = world_calibration(0.02);
    const size_t pixels = lens_pixels(&c.depth);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    uint8_t *mask = malloc(pixels);
    for (size_t i = 0; i < pixels; i++) {
        depth[i] = 2000;
        mask[i] = 1;
    }
    struct world *world;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.plain = true;
    EXPECT_STATUS(world_open(&world, &o), OK);
    const struct skeleton skeleton = world_joints_in_camera(world, 0, world_sensor_pose(world));
    world_close(&world);
    for (size_t k = 0; k < COUNT_OF(films); k++) {
        struct scratch scratch = scratch_make();
        struct recording_writer *w;
        struct take_judgement judgement;
        const char *path = scratch_file(&scratch, "film.reenact");
        EXPECT_STATUS(recording_create(&w, path), OK);
        EXPECT_STATUS(recording_begin_take(w, "a", &c), OK);
        for (int i = 0; i < films[k].frames; i++) {
            const struct take_frame frame = {.time_ns = (int64_t)(i / films[k].rate_hz * 1e9),
                                             .world_from_camera = POSE_IDENTITY,
                                             .depth = depth,
                                             .mask = mask,
                                             .has_skeleton = true,
                                             .skeleton = skeleton};
            EXPECT_STATUS(recording_add_frame(w, &frame), OK);
        }
        EXPECT_STATUS(recording_end_take(w), OK);
        EXPECT_STATUS(recording_close(&w), OK);
        EXPECT_STATUS(take_verdict_keep(path, "a", NULL, &judgement), OK);
        printf("%d frames at %.0f Hz: %u looks\n", films[k].frames, films[k].rate_hz, judgement.seen.looks);
        EXPECT_INT(judgement.seen.looks, films[k].looks);
        EXPECT_INT(judgement.seen.frames, films[k].frames);
        scratch_remove(&scratch);
    }
    free(depth);
    free(mask);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_absurd_times_are_named),
        cmocka_unit_test(test_few_images_are_looked_at),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
