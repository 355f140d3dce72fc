#include "tests/support/film.h"

#include "capture/mapping/mapper.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "tests/support/align.h"

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

// A film is written frame by frame.
struct film {
    const struct world *world;
    const struct scratch *scratch;
    const char *name;
    struct calibration calibration;
    uint8_t *color;
    uint16_t *depth;
    char *rgb_list, *depth_list;
    int count;
    const struct film_board *boards;
    int board_count;
};

static void film_open(struct film *f, const char *name, double scale, int frames)
{
    f->name = name;
    f->calibration = world_calibration(scale);
    const size_t pixels = (size_t)f->calibration.color.width * (size_t)f->calibration.color.height;
    f->color = malloc(3 * pixels);
    f->depth = malloc(sizeof *f->depth * pixels);
    f->rgb_list = calloc(64, (size_t)frames);
    f->depth_list = calloc(64, (size_t)frames);
    if (!f->color || !f->depth || !f->rgb_list || !f->depth_list)
        abort();
    write_calibration(f->scratch, name, &f->calibration);
}

// Where the board is nearer than what the picture shows.
static void put_board(struct film *f, const struct film_board *b, struct pose world_from_camera)
{
    const struct lens *l = &f->calibration.color;
    const struct pose board_from_camera = pose_multiply(pose_inverse(b->world_from_board), world_from_camera);
    for (int i = 0; i < l->width * l->height; i++) {
        const struct vec3 ray = lens_ray(l, (struct pixel){i % l->width, i / l->width}); // its z is 1
        const struct vec3 along = quat_rotate(board_from_camera.rotation, ray);
        const double z = -board_from_camera.translation.z / along.z;
        const struct vec3 at = v3_add(board_from_camera.translation, v3_scale(along, z));
        const double u = at.x / b->width_m + 0.5, v = at.y / b->height_m + 0.5;
        if (!(along.z > 0 && z > 0.1 && u >= 0 && u < 1 && v >= 0 && v < 1) || (f->depth[i] && 1e3 * z > f->depth[i]))
            continue;
        const int x = (int)(u * b->front->width), y = (int)(v * b->front->height);
        memcpy(f->color + 3 * (size_t)i, b->front->rgb + 3 * ((size_t)y * (size_t)b->front->width + (size_t)x), 3);
        f->depth[i] = (uint16_t)(1e3 * z + 0.5);
    }
}

static void film_shoot(struct film *f, struct pose camera, double time_s, bool actor)
{
    char path[300];
    uint8_t *bytes;
    size_t count;
    const int i = f->count++;
    const struct calibration *c = &f->calibration;
    const struct world_shot shot = {c->color, camera, time_s, actor};
    check(world_render(f->world, &shot, &(struct world_image){.color = f->color, .depth = f->depth}));
    for (int k = 0; k < f->board_count; k++)
        put_board(f, &f->boards[k], camera);
    check(world_depth_noise(&c->depth, f->depth, (uint64_t)i + 1, f->depth));
    check(jpeg_encode(f->color, c->color.width, c->color.height, 92, &bytes, &count));
    snprintf(path, sizeof path, "%s/rgb/%04d.jpg", f->name, i);
    scratch_write(f->scratch, path, bytes, count);
    free(bytes);
    check(png_encode(&(struct png_layout){PNG_GRAY16, c->depth.width, c->depth.height}, f->depth, 1, &bytes, &count));
    snprintf(path, sizeof path, "%s/depth/%04d.png", f->name, i);
    scratch_write(f->scratch, path, bytes, count);
    free(bytes);
    sprintf(f->rgb_list + strlen(f->rgb_list), "%.6f rgb/%04d.jpg\n", 50 + time_s, i);
    sprintf(f->depth_list + strlen(f->depth_list), "%.6f depth/%04d.png\n", 50 + time_s, i);
}

static void film_close(struct film *f)
{
    char path[300];
    snprintf(path, sizeof path, "%s/rgb.txt", f->name);
    scratch_text(f->scratch, path, f->rgb_list);
    snprintf(path, sizeof path, "%s/depth.txt", f->name);
    scratch_text(f->scratch, path, f->depth_list);
    free(f->rgb_list);
    free(f->depth_list);
    free(f->color);
    free(f->depth);
}

void film_sensor(const struct world *w, const struct scratch *scratch, const char *name, double scale, double first_s,
                 int frames)
{
    struct film f = {.world = w, .scratch = scratch};
    film_open(&f, name, scale, frames);
    for (int i = 0; i < frames; i++)
        film_shoot(&f, world_sensor_pose(w), first_s + i / 30.0, true);
    film_close(&f);
}

void film_sensor_at(const struct world *w, const struct scratch *scratch, const char *name, double scale, double hz,
                    int frames)
{
    struct film f = {.world = w, .scratch = scratch};
    film_open(&f, name, scale, frames);
    for (int i = 0; i < frames; i++)
        film_shoot(&f, world_sensor_pose(w), i / hz, true);
    film_close(&f);
}

static void sweep(struct film *f, const char *name, double scale, int frames, const char *tags)
{
    char list[1024] = "{\"family\": \"tag36h11\", \"side_m\": {";
    int32_t count;
    const struct place_tag *tag = world_tags(f->world, &count);
    film_open(f, name, scale, frames);
    for (int i = 0; i < frames; i++) {
        const double time_s = (double)WORLD_SWEEP_S * i / frames;
        film_shoot(f, world_sweep_pose(f->world, time_s), time_s, false);
    }
    film_close(f);
    for (int32_t i = 0; tags && i < count; i++)
        sprintf(list + strlen(list), "%s\"%d\": %g", i ? ", " : "", (int)tag[i].id, tag[i].side_m);
    if (tags)
        scratch_text(f->scratch, tags, strcat(list, "}}"));
}

void film_sweep(const struct world *w, const struct scratch *scratch, const char *name, double scale, int frames,
                const char *tags)
{
    struct film f = {.world = w, .scratch = scratch};
    sweep(&f, name, scale, frames, tags);
}

void film_sweep_of_boards(const struct world *w, const struct film_boards *boards, const struct scratch *scratch,
                          const char *name, int frames, const char *tags)
{
    struct film f = {.world = w, .scratch = scratch, .boards = boards->boards, .board_count = boards->count};
    sweep(&f, name, 1, frames, tags);
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
