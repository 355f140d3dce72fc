// A sweep by a sensor with a rolling shutter: the map must be about as accurate as with a global shutter. Every row is
// rendered from the sensor's pose at the time it is read.
#include "tests/support/test.h"

#include "capture/mapping/mapper.h"
#include "tests/support/align.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <stdlib.h>

enum { IMAGES = 18 };
static const double READOUT_S = 0.03, STEP_S = 0.07;
static const double REMAINS = 0.02; // share of the rolling shutter's error that may remain

static struct pose path(const void *context, double time_s)
{
    return world_sweep_pose(context, fmin(fmax(time_s, 0), WORLD_SWEEP_S));
}

struct rolling_sweep {
    const struct world *world;
    struct calibration sensor; // with the read-out time it was filmed with
    uint8_t *color[IMAGES];
    uint16_t *depth[IMAGES];
};

static double time_of(int image) { return (image + 1) * STEP_S; }

static struct rolling_sweep make_film(const struct world *w, double readout_s)
{
    struct rolling_sweep f = {.world = w, .sensor = world_calibration(1)};
    f.sensor.color.readout_s = readout_s;
    const struct lens *lens = &f.sensor.color;
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    for (int i = 0; i < IMAGES; i++) {
        f.color[i] = malloc(pixels * 3);
        f.depth[i] = malloc(pixels * sizeof *f.depth[i]);
        EXPECT_TRUE(f.color[i] && f.depth[i]);
        struct world_shot shot = {*lens, path(w, time_of(i)), 0, false};
        struct world_image image = {.color = f.color[i], .depth = f.depth[i]};
        EXPECT_STATUS(readout_s > 0 ? world_render_rolling(w, &shot, path, w, time_of(i), &image)
                                    : world_render(w, &shot, &image),
                      OK);
        world_color_noise(f.color[i], lens->width, lens->height, (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(lens, f.depth[i], (uint64_t)i, f.depth[i]), OK);
    }
    return f;
}

static void free_film(struct rolling_sweep *f)
{
    for (int i = 0; i < IMAGES; i++) {
        free(f->color[i]);
        free(f->depth[i]);
    }
}

// Maps the film with a modelled read-out time. Returns the tags' rms error, metres.
static double map_film(const char *name, const struct rolling_sweep *f, double modelled_s)
{
    struct calibration sensor = f->sensor;
    struct mapper_tag listed[32];
    struct mapper *m;
    struct mapper_report report;
    struct place place;
    int32_t count;
    const struct place_tag *tags = world_tags(f->world, &count);
    EXPECT_AT_MOST(count, 32);
    for (int32_t i = 0; i < count; i++)
        listed[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    sensor.color.readout_s = modelled_s;
    EXPECT_STATUS(mapper_open(&m, &sensor, listed, count, NULL), OK);
    for (int i = 0; i < IMAGES; i++) {
        struct frame frame = {.time_ns = (int64_t)(time_of(i) * 1e9), .color = f->color[i], .depth = f->depth[i]};
        EXPECT_STATUS(mapper_add(m, &frame), OK);
    }
    EXPECT_STATUS(mapper_finish(m, &place, &report), OK);
    struct pose world_from_place;
    double off = align_tags(&place, tags, count, &world_from_place);
    printf("%s: %d of %d images, %d tags within %.2f mm rms, %.3f px, %d points\n", name, (int)report.frames_placed,
           IMAGES, (int)place.tag_count, off * 1e3, place.rms_px, (int)place.point_count);
    EXPECT_INT(report.frames_placed, IMAGES);
    EXPECT_AT_LEAST(place.tag_count, 4);
    place_free(&place);
    mapper_close(&m);
    return off;
}

static void test_mapping_with_rolling_shutter(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    struct world *w;
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&w, &o), OK);
    struct rolling_sweep whole = make_film(w, 0), rolling = make_film(w, READOUT_S);
    double wanted = map_film("global shutter", &whole, 0);
    double unmodelled = map_film("read out in 30 ms, not modelled", &rolling, 0);
    double modelled = map_film("read out in 30 ms, modelled", &rolling, READOUT_S);
    EXPECT_AT_LEAST(unmodelled, 20 * wanted); // else there was nothing to correct
    EXPECT_AT_MOST(modelled - wanted, (unmodelled - wanted) * REMAINS);
    free_film(&whole);
    free_film(&rolling);
    world_close(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_mapping_with_rolling_shutter)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
