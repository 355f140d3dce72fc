// Images of tags whose truth is known: rendered through a distorting lens with 6 x 6 samples a pixel in linear light,
// then sRGB-encoded with a camera's noise. Shares no code with what it tests but the lens and the tag's bits.
#pragma once
#include "platform/vision/tag_detector.h"
#include "recording/place.h"
#include "tests/support/random.h"

#include <stdlib.h>

struct tag_picture {
    struct lens lens;
    const struct place_tag *tags; // the nearest to the camera first where they overlap
    int tag_count;
    struct pose world_from_camera;
    double noise;    // grey levels, standard deviation
    bool linear;     // no sRGB encoding: what careless code assumes
    double blur_px;  // of the lens in addition to the pixel's own square: standard deviation, at most 0.6. 0: none, and
                     // fewer samples a pixel, so that an edge along the rows may be off by a twelfth of a pixel
    uint64_t seed;   // of the noise
    uint8_t *rgb;    // out, lens.width * lens.height * 3
    uint16_t *depth; // out, exact; NULL: not wanted
};

static inline struct lens tag_picture_lens(int width, int height, double f)
{
    return (struct lens){
        .width = width, .height = height, .fx = f, .fy = f, .cx = (width - 1) / 2.0, .cy = (height - 1) / 2.0};
}

static inline uint8_t tag_picture_encode(double light, bool linear, double noise)
{
    double v = linear ? light : light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
    v = v * 255 + noise + 0.5;
    return (uint8_t)(v < 0 ? 0 : v > 255 ? 255 : v);
}

#define TAG_PICTURE_BACK 0.3 // light of the background

struct tag_picture_plane {
    struct vec3 centre, x, y, normal; // camera axes
    double half;
    struct tag_pattern pattern;
};

// Linear light along a ray; *z: its depth, 0 for the background.
static inline double tag_picture_light(const struct tag_picture_plane *planes, int count, struct vec3 ray, double *z)
{
    *z = 0;
    for (int i = 0; i < count; i++) {
        double slant = v3_dot(planes[i].normal, ray);
        if (!(slant < 0))
            continue;
        double distance = v3_dot(planes[i].normal, planes[i].centre) / slant;
        struct vec3 d = v3_sub(v3_scale(ray, distance), planes[i].centre);
        double u = v3_dot(d, planes[i].x) / planes[i].half, v = v3_dot(d, planes[i].y) / planes[i].half;
        if (!(distance > 0) || fabs(u) > 1.4 || fabs(v) > 1.4)
            continue;
        *z = distance;
        if (fabs(u) >= 1 || fabs(v) >= 1)
            return 0.7;
        int column = (int)((u + 1) * TAG_CELLS / 2), row = (int)((1 - v) * TAG_CELLS / 2);
        row = row > TAG_CELLS - 1 ? TAG_CELLS - 1 : row;
        return planes[i].pattern.cell[row][column] ? 0.7 : 0.02;
    }
    return TAG_PICTURE_BACK;
}

// Images with a lens's blur: SIDE x SIDE samples a pixel, blurred along the rows, then along the columns. light: out,
// linear.
static inline void tag_picture_blurred(const struct tag_picture *p, const struct tag_picture_plane *planes,
                                       double *light)
{
    enum { SIDE = 12, REACH = 3 * SIDE, TAPS = 2 * REACH + SIDE }; // three pixels to both sides of the pixel
    int width = p->lens.width, height = p->lens.height, across = width * SIDE, rows = TAPS;
    double taps[TAPS], z;
    double *samples = malloc((size_t)across * sizeof *samples),
           *narrow = malloc((size_t)rows * (size_t)width * sizeof *narrow);
    assert(samples && narrow);
    struct pixel low = {1e9, 1e9}, high = {-1e9, -1e9}; // of the tags and their paper
    for (int i = 0; i < 4 * p->tag_count; i++) {
        const struct tag_picture_plane *t = &planes[i / 4];
        struct vec3 u = v3_scale(t->x, (i & 1 ? 1.4 : -1.4) * t->half),
                    v = v3_scale(t->y, (i & 2 ? 1.4 : -1.4) * t->half);
        struct pixel at = lens_project(&p->lens, v3_add(t->centre, v3_add(u, v)));
        low = (struct pixel){fmin(low.x, at.x - 1), fmin(low.y, at.y - 1)};
        high = (struct pixel){fmax(high.x, at.x + 1), fmax(high.y, at.y + 1)};
    }
    for (int k = 0; k < TAPS; k++) {
        double x = (k + 0.5 - TAPS / 2.0) / SIDE, s = p->blur_px * 1.4142135623730951;
        taps[k] = 0.5 * (erf((x + 0.5) / s) - erf((x - 0.5) / s)) / SIDE;
    }
    int first = (int)fmax(0, low.x - 4), end = (int)fmin(width, high.x + 5); // the columns with tags
    first = first < width ? first : 0, end = end > first ? end : first + 1;
    for (int line = -REACH; line < height * SIDE + REACH;
         line++) { // rows of samples; `narrow` is a ring of the last TAPS
        double *out = narrow + (size_t)((line + REACH) % rows) * (size_t)width;
        for (int i = first * SIDE; i < end * SIDE; i++) {
            struct pixel at = {(i + 0.5) / SIDE - 0.5, (line + 0.5) / SIDE - 0.5};
            bool tag = at.x > low.x && at.y > low.y && at.x < high.x && at.y < high.y;
            samples[i] = tag ? tag_picture_light(planes, p->tag_count, lens_ray(&p->lens, at), &z) : TAG_PICTURE_BACK;
        }
        for (int x = first; x < end; x++) {
            out[x] = 0;
            for (int k = 0; k < TAPS; k++) {
                int i = x * SIDE + k - REACH;
                out[x] += taps[k] * samples[i < first * SIDE ? first * SIDE : i >= end * SIDE ? end * SIDE - 1 : i];
            }
        }
        int y = (line - REACH - SIDE + 1) / SIDE; // the pixel row whose last sample row this is
        if (line < REACH + SIDE - 1 || (line - REACH + 1) % SIDE)
            continue;
        for (int x = 0; x < width; x++) {
            double sum = x >= first && x < end ? 0 : TAG_PICTURE_BACK;
            for (int k = 0; k < TAPS && x >= first && x < end; k++)
                sum += taps[k] * narrow[(size_t)((y * SIDE + k) % rows) * (size_t)width + (size_t)x];
            light[(size_t)y * (size_t)width + (size_t)x] = sum;
        }
    }
    free(samples);
    free(narrow);
}

// False: no such tag.
static inline bool tag_picture_draw(struct tag_picture *p)
{
    enum { SIDE = 6, MOST = 16 };
    struct tag_picture_plane planes[MOST];
    struct pose camera_from_world = pose_inverse(p->world_from_camera);
    struct rng rng = {p->seed};
    assert(p->tag_count <= MOST);
    for (int i = 0; i < p->tag_count; i++) {
        struct pose c = pose_multiply(camera_from_world, p->tags[i].world_from_tag);
        planes[i] = (struct tag_picture_plane){c.translation,
                                               quat_rotate(c.rotation, v3(1, 0, 0)),
                                               quat_rotate(c.rotation, v3(0, 1, 0)),
                                               quat_rotate(c.rotation, v3(0, 0, 1)),
                                               p->tags[i].side_m / 2,
                                               {{{0}}}};
        if (!tag_pattern(p->tags[i].id, &planes[i].pattern))
            return false;
    }
    double *blurred = NULL;
    if (p->blur_px > 0) {
        blurred = malloc((size_t)p->lens.width * (size_t)p->lens.height * sizeof *blurred);
        assert(blurred && p->blur_px <= 0.6);
        tag_picture_blurred(p, planes, blurred);
    }
    for (int y = 0; y < p->lens.height; y++) {
        for (int x = 0; x < p->lens.width; x++) {
            size_t at = (size_t)y * (size_t)p->lens.width + (size_t)x;
            // Far from an edge one sample suffices; near one, sample the whole pixel.
            double sum = 0, z, low = 1, high = 0;
            struct vec3 middle = lens_ray(&p->lens, (struct pixel){x, y});
            double light = tag_picture_light(planes, p->tag_count, middle, &z);
            for (int k = 0; k < 8 && !blurred; k++) {
                double far, l = tag_picture_light(planes, p->tag_count,
                                                  v3(middle.x + ((k + (k > 3)) % 3 - 1) * 0.8 / p->lens.fx,
                                                     middle.y + ((k + (k > 3)) / 3 - 1) * 0.8 / p->lens.fy, 1),
                                                  &far);
                low = fmin(low, l);
                high = fmax(high, l);
            }
            for (int k = 0; k < SIDE * SIDE && !blurred && (high != low || high != light); k++) {
                double far;
                struct pixel px = {x + (k % SIDE + 0.5) / SIDE - 0.5, y + (k / SIDE + 0.5) / SIDE - 0.5};
                sum += tag_picture_light(planes, p->tag_count, lens_ray(&p->lens, px), &far);
            }
            if (blurred)
                light = blurred[at];
            else if (high != low || high != light)
                light = sum / (SIDE * SIDE);
            for (int c = 0; c < 3; c++)
                p->rgb[3 * at + (size_t)c] =
                    tag_picture_encode(light, p->linear, p->noise > 0 ? p->noise * rng_normal(&rng) : 0);
            if (p->depth)
                p->depth[at] = (uint16_t)(z * 1000 + 0.5);
        }
    }
    free(blurred);
    return true;
}

// A camera looking at the square at the origin (world axes: x right, y up, z towards the reader) from `distance`,
// rotated by yaw about y and pitch about x.
static inline struct pose tag_picture_view(double distance, double yaw, double pitch, double roll)
{
    struct quat face = {1, 0, 0, 0}; // camera y down and z into the wall
    struct quat view_rotation =
        quat_multiply(quat_from_rotation_vector(v3(0, yaw, 0)), quat_from_rotation_vector(v3(pitch, 0, 0)));
    view_rotation = quat_multiply(view_rotation, quat_from_rotation_vector(v3(0, 0, roll)));
    struct pose world_from_camera = {quat_multiply(view_rotation, face), {0, 0, 0}};
    world_from_camera.translation = v3_scale(quat_rotate(world_from_camera.rotation, v3(0, 0, 1)), -distance);
    return world_from_camera;
}

// The true corners, in pixels.
static inline void tag_picture_corners(const struct tag_picture *p, int tag, struct pixel out[4])
{
    struct vec3 world[4];
    place_tag_corners(&p->tags[tag], world);
    for (int k = 0; k < 4; k++)
        out[k] = lens_project(&p->lens, pose_apply(pose_inverse(p->world_from_camera), world[k]));
}
