#include "tests/support/film.h"

#include "capture/mapping/mapper.h"
#include "tests/support/align.h"

#include "platform/file.h"
#include "platform/jpeg.h"
#include "platform/png.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(enum status status)
{
    if (status != OK) {
        fprintf(stderr, "filming the small world failed: %s\n", status_message());
        abort();
    }
}

static void write_calibration(const struct scratch *scratch, const char *name, const struct calibration *c)
{
    char text[1024], path[300], lens[300];
    const struct lens *l = &c->color; // registered: the same lens for both
    snprintf(lens, sizeof lens,
             "{\"width\": %d, \"height\": %d, \"fx\": %.9g, \"fy\": %.9g, \"cx\": %.9g, \"cy\": %.9g, "
             "\"distortion\": [0, 0, 0, 0, 0], \"unit_m\": 0.001}",
             l->width, l->height, l->fx, l->fy, l->cx, l->cy);
    snprintf(text, sizeof text, "{\"color\": %s, \"depth\": %s, \"registered\": true}", lens, lens);
    snprintf(path, sizeof path, "%s/calibration.json", name);
    scratch_text(scratch, path, text);
}

// sweep: the hand-held sensor in the empty room, over all of its sweep; else on its stand, from first_s on.
static void film(const struct world *w, const struct scratch *scratch, const char *name, double scale, double first_s,
                 int frames, bool sweep)
{
    struct calibration c = world_calibration(scale);
    size_t pixels = (size_t)c.color.width * (size_t)c.color.height;
    uint8_t *color = malloc(3 * pixels);
    uint16_t *depth = malloc(sizeof *depth * pixels);
    char *rgb_list = calloc(64, (size_t)frames), *depth_list = calloc(64, (size_t)frames), path[300];
    write_calibration(scratch, name, &c);
    for (int i = 0; i < frames; i++) {
        double time_s = sweep ? (double)WORLD_SWEEP_S * i / frames : first_s + i / 30.0;
        struct world_shot shot = {c.color, sweep ? world_sweep_pose(w, time_s) : world_sensor_pose(w), time_s, !sweep};
        check(world_render(w, &shot, &(struct world_image){.color = color, .depth = depth}));
        check(world_depth_noise(&c.depth, depth, (uint64_t)i + 1, depth));
        uint8_t *bytes;
        size_t count;
        check(jpeg_encode(color, c.color.width, c.color.height, 92, &bytes, &count));
        snprintf(path, sizeof path, "%s/rgb/%04d.jpg", name, i);
        scratch_write(scratch, path, bytes, count);
        free(bytes);
        check(png_encode(&(struct png_layout){PNG_GRAY16, c.depth.width, c.depth.height}, depth, 1, &bytes, &count));
        snprintf(path, sizeof path, "%s/depth/%04d.png", name, i);
        scratch_write(scratch, path, bytes, count);
        free(bytes);
        sprintf(rgb_list + strlen(rgb_list), "%.6f rgb/%04d.jpg\n", 50 + time_s, i);
        sprintf(depth_list + strlen(depth_list), "%.6f depth/%04d.png\n", 50 + time_s, i);
    }
    snprintf(path, sizeof path, "%s/rgb.txt", name);
    scratch_text(scratch, path, rgb_list);
    snprintf(path, sizeof path, "%s/depth.txt", name);
    scratch_text(scratch, path, depth_list);
    free(rgb_list);
    free(depth_list);
    free(color);
    free(depth);
}

void film_sensor(const struct world *w, const struct scratch *scratch, const char *name, double scale, double first_s,
                 int frames)
{
    film(w, scratch, name, scale, first_s, frames, false);
}

void film_sweep(const struct world *w, const struct scratch *scratch, const char *name, double scale, int frames)
{
    film(w, scratch, name, scale, 0, frames, true);
}

struct place film_true_place(const struct world *w, double scale)
{
    struct place place = {.calibration = world_calibration(scale)};
    const struct place_tag *tags = world_tags(w, &place.tag_count);
    place.tags = malloc(sizeof *tags * (size_t)place.tag_count);
    if (!place.tags)
        abort();
    memcpy(place.tags, tags, sizeof *tags * (size_t)place.tag_count);
    return place;
}

struct place film_mapped_place(struct world **world, int images, struct pose *world_from_place)
{
    struct world_options still = world_default_options();
    still.motion = "still";
    still.threads = 2;
    check(world_open(world, &still));
    const struct world *w = *world;
    struct calibration sensor = world_calibration(1);
    size_t pixels = (size_t)sensor.color.width * (size_t)sensor.color.height;
    uint8_t *color = malloc(pixels * 3);
    uint16_t *depth = malloc(pixels * sizeof *depth);
    struct mapper_tag listed[32];
    struct mapper_report report;
    struct mapper *m;
    struct place place;
    int32_t count;
    const struct place_tag *tags = world_tags(w, &count);
    if (!color || !depth || count > (int32_t)COUNT_OF(listed))
        abort();
    for (int32_t i = 0; i < count; i++)
        listed[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    check(mapper_open(&m, &sensor, listed, count, NULL));
    for (int i = 0; i < images; i++) {
        double t = (double)WORLD_SWEEP_S * i / images;
        struct world_shot shot = {sensor.color, world_sweep_pose(w, t), 0, false};
        struct world_image image = {.color = color, .depth = depth};
        check(world_render(w, &shot, &image));
        check(world_depth_noise(&sensor.color, depth, (uint64_t)i, depth));
        struct frame frame = {.time_ns = (int64_t)(t * 1e9), .color = color, .depth = depth};
        check(mapper_add(m, &frame));
    }
    check(mapper_finish(m, &place, &report));
    mapper_close(&m);
    free(color);
    free(depth);
    align_tags(&place, tags, count, world_from_place);
    return place;
}
