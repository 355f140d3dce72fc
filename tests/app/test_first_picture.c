// The sequence of pictures from a cold start: a take that was never opened begins with what the sensor saw, until the
// actor's body is whole; for good where none can be made. No picture shows parts of one.
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <string.h>

static struct rehearsal rehearsal;

// Mean difference of the screen, between the controls, from the recorded image of that frame, which fills its height.
static double difference_from_sensor(struct glass *g, const char *file, int64_t frame)
{
    struct recording *recording;
    struct take *take;
    struct take_images images;
    EXPECT_STATUS(recording_open(&recording, file), OK);
    EXPECT_STATUS(take_open(&take, recording, "once more"), OK);
    EXPECT_STATUS(take_read(take, frame, TAKE_COLOR, &images), OK);
    const struct lens *lens = &take_calibration(take)->color;
    const double scale = fmin((double)g->width / lens->width, (double)g->height / lens->height);
    double sum = 0;
    int count = 0;
    glass_read(g);
    for (int y = (int)(0.25 * lens->height); y < 0.55 * lens->height; y++)
        for (int x = (int)(0.2 * lens->width); x < 0.8 * lens->width; x++) {
            const int sx = (int)(g->width / 2.0 + scale * (x + 0.5 - lens->width / 2.0));
            const int sy = (int)(g->height / 2.0 + scale * (y + 0.5 - lens->height / 2.0));
            for (int c = 0; c < 3; c++, count++)
                sum += abs(g->rgba[4 * (sy * g->width + sx) + c] - images.color[3 * (y * lens->width + x) + c]);
        }
    take_close(&take);
    recording_free(&recording);
    return sum / count;
}

// From a cold start: what the sensor saw, then the whole body. No picture shows parts of one.
static void expect_no_parts(struct glass *g, int *with_sensor)
{
    const struct take_view_image *p = g->image;
    if (p->making) {
        EXPECT_TRUE(!p->actor && !p->shadow && p->sensor && !p->parts && !p->prepared);
        EXPECT_AT_MOST(difference_from_sensor(g, rehearsal.file, p->frame), 8);
        ++*with_sensor;
    } else {
        EXPECT_TRUE(p->prepared && p->actor);
        EXPECT_AT_LEAST(p->parts, 8);
    }
}

static void test_take_opens_immediately_and_refines(void **state)
{
    (void)state;
    struct glass g;
    const struct viewer_options options = {.file = rehearsal.file, .take = "once more", .refresh_hz = 60};
    glass_open(&g, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    glass_draw(&g);
    EXPECT_TRUE(g.image->making);
    int with_sensor = 0;
    expect_no_parts(&g, &with_sensor);
    glass_seek(&g, 0.3);
    int plain = 0, both = 0, simple = 0, better = 0;
    double share = 0;
    const int64_t making = clock_now_ns();
    for (int64_t until = making + 200000000000; (g.state->crossfade < 1 || !g.image->full) && clock_now_ns() < until;) {
        glass_draw_and_wait(&g);
        expect_no_parts(&g, &with_sensor);
        EXPECT_AT_LEAST(g.state->avatar_progress, share);
        share = g.state->avatar_progress;
        plain += !g.image->prepared;
        both += g.image->prepared && g.image->sensor;
        simple += g.image->prepared && !g.image->full;
    }
    glass_draw(&g);
    better = g.image->prepared && !g.image->sensor;
    EXPECT_AT_LEAST(with_sensor, 2);
    print_message("%d frames without the avatar, %d with both, %d with the simple one\n", plain, both, simple);
    EXPECT_AT_LEAST(simple, 1);
    EXPECT_AT_LEAST(plain, 1);
    EXPECT_AT_LEAST(both, 1);
    EXPECT_INT(better, 1);
    const int64_t made_ns = clock_now_ns() - making;
    glass_close(&g); // after the avatar was written into the recording
    const int64_t reading = clock_now_ns();
    glass_open(&g, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    int made_again = 0;
    do { // with the first drawing, but on a machine that is busy with more
        glass_draw(&g);
        made_again += g.image->prepared && !g.image->full; // the simple one, which is shown while one is made
    } while (!g.image->full && clock_now_ns() < reading + 200000000000);
    EXPECT_INT(made_again, 0);
    print_message("full after %.1f s, when opened again after %.1f s\n", (double)made_ns * 1e-9,
                  (double)(clock_now_ns() - reading) * 1e-9);
    EXPECT_AT_MOST((double)(clock_now_ns() - reading), 0.5 * (double)made_ns);
    glass_draw(&g);
    EXPECT_NEAR(g.state->avatar_progress, 1, 0);
    glass_close(&g);
}

// "once more" in a recording of its own, its depth images without a reading.
static void write_without_depth(const char *file)
{
    struct recording *recording;
    struct take *take;
    struct recording_writer *writer;
    EXPECT_STATUS(recording_open(&recording, rehearsal.file), OK);
    EXPECT_STATUS(take_open(&take, recording, "once more"), OK);
    const struct lens *depth = &take_calibration(take)->depth;
    uint16_t *no_reading = calloc((size_t)depth->width * (size_t)depth->height, sizeof *no_reading);
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_begin_take(writer, "once more", take_calibration(take)), OK);
    EXPECT_STATUS(recording_put_body(writer, take_body(take)), OK);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        const uint8_t *bytes;
        struct take_images images;
        struct take_frame frame = {.time_ns = e->time_ns,
                                   .world_from_camera = e->world_from_camera,
                                   .located = e->located,
                                   .depth = no_reading,
                                   .has_skeleton = e->has_skeleton,
                                   .skeleton = e->skeleton};
        EXPECT_STATUS(take_read_jpeg(take, i, &bytes, &frame.jpeg_bytes), OK);
        uint8_t *jpeg = malloc(frame.jpeg_bytes);
        assert_non_null(jpeg);
        memcpy(jpeg, bytes, frame.jpeg_bytes);
        frame.jpeg = jpeg;
        EXPECT_STATUS(take_read(take, i, TAKE_MASK, &images), OK);
        frame.mask = images.mask;
        EXPECT_STATUS(recording_add_frame(writer, &frame), OK);
        free(jpeg);
    }
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    free(no_reading);
    take_close(&take);
    recording_free(&recording);
}

// No avatar can be made of it: what the sensor saw stays, and the screen says why.
static void test_a_take_without_an_avatar_shows_no_parts(void **state)
{
    (void)state;
    struct glass g;
    char file[256];
    snprintf(file, sizeof file, "%s", scratch_file(&rehearsal.scratch, "bodiless.reenact"));
    write_without_depth(file);
    const struct viewer_options options = {.file = file, .take = "once more", .refresh_hz = 60};
    glass_open(&g, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    const struct take_view_image *p = g.image;
    int after = 0; // pictures after it was known
    glass_draw(&g);
    glass_seek(&g, 0.3);
    for (const int64_t until = clock_now_ns() + 200000000000; after < 5 && clock_now_ns() < until;) {
        glass_draw_and_wait(&g);
        EXPECT_TRUE(!p->actor && !p->shadow && !p->parts && !p->prepared && p->sensor);
        EXPECT_TRUE(p->making != p->bodiless);
        EXPECT_AT_MOST(difference_from_sensor(&g, file, p->frame), 8);
        after += p->bodiless;
    }
    EXPECT_INT(after, 5);
    EXPECT_NEAR(g.state->avatar_progress, 1, 0);
    glass_close(&g);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_take_opens_immediately_and_refines),
        cmocka_unit_test(test_a_take_without_an_avatar_shows_no_parts),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
