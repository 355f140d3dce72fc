#include "reenact/observation/depth_frame.h"

#include "base/clamp.h"
#include "reenact/skeleton/skeleton_track.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- depth agreement

int depth_pixel_at(const struct lens *lens, struct vec3 p)
{
    if (!(p.z > 0.05))
        return -1;
    const struct pixel px = lens_project(lens, p);
    const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
    return x >= 0 && y >= 0 && x < lens->width && y < lens->height ? (int)y * lens->width + (int)x : -1;
}

bool depth_agrees(const struct depth_frame *frame, int pixel, double depth_m, int margin_px)
{
    return frame->part[pixel] < PART_COUNT && frame->edge_distance[pixel] >= margin_px &&
           fabs(frame->depth[pixel] * 1e-3 - depth_m) <= DEPTH_AGREEMENT_M;
}

bool depth_agrees_with_bone(const struct depth_frame *frame, const struct lens *lens, struct vec3 p, int bone,
                            int margin_px)
{
    const int pixel = depth_pixel_at(lens, p);
    return pixel >= 0 && depth_agrees(frame, pixel, p.z, margin_px) &&
           bones_adjacent(frame->part[pixel], (int)bone_part(bone));
}

// ---------------------------------------------------------------- part label

struct part_capsules part_capsules_of(const struct skeleton *skeleton, const struct body *body)
{
    struct part_capsules b = {0};
    for (int p = 0; p < PART_COUNT; p++) {
        if (!part_is_known(body, skeleton, (enum part)p))
            continue;
        int i = b.count++;
        b.part[i] = (enum part)p;
        b.from[i] = skeleton->joint[part_ends[p].from];
        b.along[i] = v3_sub(skeleton->joint[part_ends[p].to], b.from[i]);
        b.along2[i] = v3_dot(b.along[i], b.along[i]);
        b.radius[i] = body->radius_rate[p] * sqrt(b.along2[i]);
        b.middle[i] = v3_add(b.from[i], v3_scale(b.along[i], 0.5));
        b.bounding_radius[i] = 0.5 * sqrt(b.along2[i]) + b.radius[i];
    }
    return b;
}

uint16_t part_label(const struct part_capsules *capsules, struct vec3 p, double shared_m, double outside_m)
{
    double gap[PART_COUNT], best = outside_m;
    for (int i = 0; i < capsules->count; i++) {
        struct vec3 d = v3_sub(p, capsules->from[i]);
        double t = capsules->along2[i] > 0 ? v3_dot(d, capsules->along[i]) / capsules->along2[i] : 0;
        t = clamp_double(t, 0, 1);
        gap[i] = v3_length(v3_sub(d, v3_scale(capsules->along[i], t))) - capsules->radius[i];
        best = fmin(best, gap[i]);
    }
    if (!(best < outside_m))
        return 0;
    uint16_t parts = PART_LABEL_PERSON;
    for (int i = 0; i < capsules->count; i++)
        if (gap[i] <= best + shared_m)
            parts |= (uint16_t)(1 << capsules->part[i]);
    return parts;
}

// The nearest part, the lowest on a tie; -1: p is more than outside_m outside every part.
static int part_nearest(const struct part_capsules *capsules, struct vec3 p, double outside_m)
{
    double best = outside_m;
    int nearest = -1;
    for (int i = 0; i < capsules->count; i++) {
        struct vec3 d = v3_sub(p, capsules->from[i]), from_middle = v3_sub(p, capsules->middle[i]);
        double away = best + capsules->bounding_radius[i];
        if (v3_dot(from_middle, from_middle) > away * away)
            continue; // the bounding ball is farther than the nearest part
        double t = capsules->along2[i] > 0 ? v3_dot(d, capsules->along[i]) / capsules->along2[i] : 0;
        t = clamp_double(t, 0, 1);
        d = v3_sub(d, v3_scale(capsules->along[i], t));
        double away2 = v3_dot(d, d), reach = best + capsules->radius[i];
        if (!(reach > 0) || away2 > reach * reach)
            continue; // farther than the nearest part, found without a square root
        double gap = sqrt(away2) - capsules->radius[i];
        if (gap < best)
            best = gap, nearest = (int)capsules->part[i];
    }
    return nearest;
}

double part_max_distance_m(bool has_mask) { return has_mask ? 0.25 : 0.10; }

bool part_pixel_on_surface(const uint16_t *depth, const uint8_t *mask, int width, int height, int i)
{
    int same_mm = 30 + depth_step_mm(depth[i]);
    int x = i % width, y = i / width;
    if (!depth[i] || (mask && !mask[i]) || x == 0 || y == 0 || x == width - 1 || y == height - 1)
        return false;
    const int around[] = {i - 1, i + 1, i - width, i + width};
    int same = 0;
    for (int n = 0; n < 4; n++)
        same += abs(depth[around[n]] - depth[i]) <= same_mm;
    return same >= 2;
}

struct source_rays {
    int count;
    struct pose color_from_depth;
    bool same_axes;
    float xy[][2]; // z = 1
};

enum status source_rays_open(struct source_rays **out, const struct calibration *calibration)
{
    *out = NULL;
    int width = calibration->depth.width, height = calibration->depth.height;
    struct source_rays *r = malloc(sizeof *r + sizeof r->xy[0] * (size_t)width * (size_t)height);
    if (!r)
        return fail(ERR_MEMORY, "no memory for the labels of body parts");
    r->count = width * height;
    r->color_from_depth = calibration->color_from_depth;
    r->same_axes = calibration->registered;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            struct vec3 ray = lens_ray(&calibration->depth, (struct pixel){x, y});
            r->xy[y * width + x][0] = (float)ray.x;
            r->xy[y * width + x][1] = (float)ray.y;
        }
    *out = r;
    return OK;
}

void source_rays_close(struct source_rays **rays)
{
    free(*rays);
    *rays = NULL;
}

int source_rays_count(const struct source_rays *rays) { return rays->count; }

struct vec3 source_rays_point(const struct source_rays *rays, int i, uint16_t depth_mm)
{
    double z = depth_mm * 1e-3;
    struct vec3 p = v3(rays->xy[i][0] * z, rays->xy[i][1] * z, z);
    return rays->same_axes ? p : pose_apply(rays->color_from_depth, p);
}

// ---------------------------------------------------------------- depth frame

enum { UNASSIGNED = 0 }; // of a pixel of the actor before depth_frame_relabel: any value below PART_COUNT

// Chosen by hand.
enum { SURFACE_MM = 60, SHADOW_SLACK_PX = 2 };
enum { NOISE_STEPS = 2 };     // noise does not separate two depth samples by more of depth_step_mm
enum { BACKGROUND_MM = 100 }; // so far behind the actor a sample is certainly background

static const double PROJECTOR_BASELINE_M = 0.08; // between lens and projector of structured-light sensors, at most

enum status depth_frame_open(struct depth_frame *out, const struct take *take, const struct source_rays *rays)
{
    const struct lens *lens = &take_calibration(take)->depth;
    *out = (struct depth_frame){.width = lens->width,
                                .height = lens->height,
                                .fx = lens->fx,
                                .rays = rays,
                                .body = take_body(take),
                                .max_edge_distance = DEPTH_FRAME_MAX_EDGE_PX};
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    out->depth = malloc(sizeof(uint16_t) * pixels);
    out->part = malloc(pixels);
    out->edge_distance = malloc(pixels);
    out->half_width = malloc(pixels);
    if (out->depth && out->part && out->edge_distance && out->half_width)
        return OK;
    depth_frame_close(out);
    return fail(ERR_MEMORY, "no memory for a depth frame");
}

void depth_frame_close(struct depth_frame *frame)
{
    free(frame->depth);
    free(frame->part);
    free(frame->edge_distance);
    free(frame->half_width);
    *frame = (struct depth_frame){0};
}

// Bounds of the actor's pixels within the current bounds.
static void find_bounds(struct depth_frame *frame)
{
    int top = frame->top, bottom = frame->bottom, left = frame->left, right = frame->right;
    frame->left = frame->width, frame->top = frame->height, frame->right = frame->bottom = -1;
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++)
            if (frame->part[y * frame->width + x] < PART_COUNT) {
                frame->left = x < frame->left ? x : frame->left, frame->right = x > frame->right ? x : frame->right;
                frame->top = y < frame->top ? y : frame->top, frame->bottom = y > frame->bottom ? y : frame->bottom;
            }
}

// The window never leaves the image: no pixel of the image's border is the actor's (part_pixel_on_surface).
int depth_frame_median_mm(const struct depth_frame *frame, int i)
{
    int samples[9], count = 0;
    for (int dy = -frame->width; dy <= frame->width; dy += frame->width)
        for (int dx = -1; dx <= 1; dx++) {
            if (frame->part[i + dy + dx] >= PART_COUNT)
                continue;
            int k = count++;
            for (; k > 0 && samples[k - 1] > frame->depth[i + dy + dx]; k--)
                samples[k] = samples[k - 1];
            samples[k] = frame->depth[i + dy + dx];
        }
    return (samples[(count - 1) / 2] + samples[count / 2]) / 2;
}

// Whether two neighbouring pixels lie on one surface. A step larger than any noise is an edge; a smaller one is an edge
// only if the medians confirm it.
static bool same_surface(const struct depth_frame *frame, int a, int b)
{
    const bool is_actor = frame->part[a] < PART_COUNT;
    if (is_actor != (frame->part[b] < PART_COUNT))
        return false;
    if (!is_actor)
        return true;
    const int step_mm = depth_step_mm(frame->depth[a]), max_mm = step_mm > SURFACE_MM ? step_mm : SURFACE_MM;
    const int apart_mm = abs(frame->depth[a] - frame->depth[b]);
    return apart_mm <= max_mm || (apart_mm <= NOISE_STEPS * step_mm &&
                                  abs(depth_frame_median_mm(frame, a) - depth_frame_median_mm(frame, b)) <= max_mm);
}

// Distance transform step: at most the neighbour's distance and one; 0 for both pixels between two surfaces.
static inline void relax_edge(struct depth_frame *frame, int i, int from)
{
    if (same_surface(frame, i, from)) {
        int far = frame->edge_distance[from] + 1;
        frame->edge_distance[i] = (uint8_t)(far < frame->edge_distance[i] ? far : frame->edge_distance[i]);
    } else {
        frame->edge_distance[i] = frame->edge_distance[from] = 0;
    }
}

// City-block distance transform in two passes (Rosenfeld and Pfaltz 1966), no farther from the actor's bounds than the
// distance that is distinguished.
static void find_edge_distances(struct depth_frame *frame)
{
    const int w = frame->width, h = frame->height, max = frame->max_edge_distance;
    int left = frame->left > max ? frame->left - max : 0;
    int top = frame->top > max ? frame->top - max : 0;
    int right = frame->right + max < w ? frame->right + max : w - 1;
    int bottom = frame->bottom + max < h ? frame->bottom + max : h - 1;
    memset(frame->edge_distance, max, (size_t)w * (size_t)h);
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++) {
            if (x > left)
                relax_edge(frame, y * w + x, y * w + x - 1);
            if (y > top)
                relax_edge(frame, y * w + x, y * w + x - w);
        }
    for (int y = bottom; y >= top; y--)
        for (int x = right; x >= left; x--) {
            if (x < right)
                relax_edge(frame, y * w + x, y * w + x + 1);
            if (y < bottom)
                relax_edge(frame, y * w + x, y * w + x + w);
        }
}

// Lowers half_width to half the length of each run of one surface along a line of pixels `step` apart.
static void find_runs(struct depth_frame *frame, int first, int step, int count)
{
    for (int from = 0, to; from < count; from = to) {
        for (to = from + 1; to < count && same_surface(frame, first + (to - 1) * step, first + to * step);)
            to++;
        int half = (to - from) / 2;
        for (int i = from; i < to; i++)
            if (half < frame->half_width[first + i * step])
                frame->half_width[first + i * step] = (uint8_t)half;
    }
}

static void find_widths(struct depth_frame *frame)
{
    memset(frame->half_width, UINT8_MAX, (size_t)frame->width * (size_t)frame->height);
    for (int y = frame->top; y <= frame->bottom; y++)
        find_runs(frame, y * frame->width + frame->left, 1, frame->right - frame->left + 1);
    for (int x = frame->left; x <= frame->right; x++)
        find_runs(frame, frame->top * frame->width + x, frame->width, frame->bottom - frame->top + 1);
}

// The sensor's projector stands beside its lens, so the actor shadows a strip of the background along one side. Pixels
// without a depth sample there take the depth of the background beyond.
static void fill_projector_shadow(struct depth_frame *frame, double fx)
{
    for (int y = frame->top; y <= frame->bottom; y++) {
        const int row = y * frame->width;
        for (int x = 0, last = -1; x < frame->width; x++) { // last: the last pixel with a depth sample
            if (!frame->depth[row + x])
                continue;
            const int from = last;
            last = x;
            if (from < 0 || from + 1 == x ||
                (frame->part[row + from] == DEPTH_FRAME_BACKGROUND) == (frame->part[row + x] == DEPTH_FRAME_BACKGROUND))
                continue;
            const bool background_first = frame->part[row + from] == DEPTH_FRAME_BACKGROUND;
            const uint16_t background = frame->depth[row + (background_first ? from : x)];
            const uint16_t actor = frame->depth[row + (background_first ? x : from)];
            const double wide = fx * PROJECTOR_BASELINE_M * 1000 * (1.0 / actor - 1.0 / background);
            for (int i = row + from + 1; i < row + x && x - from - 1 <= wide + SHADOW_SLACK_PX; i++)
                if (frame->part[i] == DEPTH_FRAME_BACKGROUND)
                    frame->depth[i] = background;
        }
    }
}

// Labels every pixel of the actor UNASSIGNED, until depth_frame_relabel, or DEPTH_FRAME_MIXED, all others background.
static void find_actor_pixels(struct depth_frame *frame, const struct take_images *images)
{
    const int count = frame->width * frame->height;
    memset(frame->part, DEPTH_FRAME_BACKGROUND, (size_t)count);
    const uint8_t *mask = images->mask, *end = mask ? mask + count : NULL;
    for (int i = 0; i < count; i++) {
        if (mask && !mask[i]) { // most of an image: on to the next pixel of the mask
            const uint8_t *next = memchr(mask + i, 1, (size_t)(end - mask - i));
            if (!next)
                break;
            i = (int)(next - mask);
        }
        frame->part[i] =
            part_pixel_on_surface(images->depth, mask, frame->width, frame->height, i) ? UNASSIGNED : DEPTH_FRAME_MIXED;
    }
}

void depth_frame_label(struct depth_frame *frame, const struct take_images *images, const struct skeleton *joints)
{
    memcpy(frame->depth, images->depth, sizeof(uint16_t) * (size_t)frame->width * (size_t)frame->height);
    frame->has_mask = images->mask != NULL;
    find_actor_pixels(frame, images);
    frame->left = frame->top = 0, frame->right = frame->width - 1, frame->bottom = frame->height - 1;
    find_bounds(frame);
    depth_frame_relabel(frame, joints);
    find_bounds(frame);
    fill_projector_shadow(frame, frame->fx);
    find_edge_distances(frame);
    find_widths(frame);
}

int depth_frame_step_inside(const struct depth_frame *frame, int i, int step)
{
    int inside = i + step;
    for (int k = 1; k < DEPTH_FRAME_INWARD_PX && frame->part[inside] == DEPTH_FRAME_MIXED; k++)
        inside += step;
    return frame->part[inside] < PART_COUNT && frame->depth[i] >= frame->depth[inside] + BACKGROUND_MM ? inside : -1;
}

void depth_frame_relabel(struct depth_frame *frame, const struct skeleton *skeleton)
{
    struct part_capsules bones = part_capsules_of(skeleton, frame->body);
    double outside = part_max_distance_m(frame->has_mask);
    const uint8_t unlabelled =
        frame->has_mask ? DEPTH_FRAME_MIXED : DEPTH_FRAME_BACKGROUND; // a mask is trusted more than the joints
    for (int y = frame->top; y <= frame->bottom; y++)
        for (int x = frame->left; x <= frame->right; x++) {
            int i = y * frame->width + x;
            if (frame->part[i] >= PART_COUNT)
                continue;
            int part = part_nearest(&bones, source_rays_point(frame->rays, i, frame->depth[i]), outside);
            frame->part[i] = part < 0 ? unlabelled : (uint8_t)part;
        }
}

enum { INTERIOR_PX = 2 }; // JPEG subsamples chroma, which spreads colour over two pixels

// A pixel well within a surface; x < 0: none.
struct interior_pixel {
    int16_t x, y;
};

// Replaces *from by `other` where that is nearer to pixel (x, y), by city-block distance.
static inline void keep_nearer(struct interior_pixel *from, struct interior_pixel other, int x, int y)
{
    if (other.x < 0)
        return;
    if (from->x < 0 || abs(other.x - x) + abs(other.y - y) < abs(from->x - x) + abs(from->y - y))
        *from = other;
}

// The actor's bounds and one pixel on each side, for bilinear sampling.
struct actor_box {
    int left, top, w, h;
};

static struct actor_box padded_actor_box(const struct depth_frame *frame)
{
    int left = frame->left > 0 ? frame->left - 1 : 0, top = frame->top > 0 ? frame->top - 1 : 0;
    int right = frame->right + 1 < frame->width ? frame->right + 1 : frame->right;
    int bottom = frame->bottom + 1 < frame->height ? frame->bottom + 1 : frame->bottom;
    return (struct actor_box){left, top, right - left + 1, bottom - top + 1};
}

// For each pixel of the box the nearest pixel well within a surface, in two passes.
static void find_interior_pixels(const struct depth_frame *frame, const struct actor_box *box,
                                 struct interior_pixel *from)
{
    const int w = box->w, h = box->h;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x, at = (box->top + y) * frame->width + box->left + x;
            bool within = frame->part[at] < PART_COUNT && frame->edge_distance[at] >= INTERIOR_PX;
            from[i] = within ? (struct interior_pixel){(int16_t)x, (int16_t)y} : (struct interior_pixel){-1, -1};
            if (x > 0)
                keep_nearer(&from[i], from[i - 1], x, y);
            if (y > 0)
                keep_nearer(&from[i], from[i - w], x, y);
        }
    for (int y = h - 1; y >= 0; y--)
        for (int x = w - 1; x >= 0; x--) {
            int i = y * w + x;
            if (x + 1 < w)
                keep_nearer(&from[i], from[i + 1], x, y);
            if (y + 1 < h)
                keep_nearer(&from[i], from[i + w], x, y);
        }
}

enum status depth_frame_clean_colors(const struct depth_frame *frame, const struct calibration *calibration,
                                     const uint8_t *rgb, uint8_t *out)
{
    const struct lens *color = &calibration->color;
    if (out != rgb)
        memcpy(out, rgb, 3 * (size_t)color->width * (size_t)color->height);
    if (!calibration->registered || color->width != frame->width || color->height != frame->height ||
        frame->right < frame->left)
        return OK;
    const struct actor_box box = padded_actor_box(frame);
    struct interior_pixel *from = malloc(sizeof *from * (size_t)box.w * (size_t)box.h);
    if (!from)
        return fail(ERR_MEMORY, "no memory for a depth frame");
    find_interior_pixels(frame, &box, from);
    for (int i = 0; i < box.w * box.h; i++) {
        const int at = (box.top + i / box.w) * frame->width + box.left + i % box.w;
        const int of = (box.top + from[i].y) * frame->width + box.left + from[i].x;
        if (from[i].x >= 0 && of != at)
            memcpy(out + 3 * (size_t)at, rgb + 3 * (size_t)of, 3);
    }
    free(from);
    return OK;
}

// ---------------------------------------------------------------- depth frame cache

enum { PIXEL_BYTES = 5 }; // depth 2, part, edge_distance and half_width 1 each

struct cached_window {
    uint8_t *bytes; // planes of the window: depth, part, edge_distance, half_width; NULL: not kept
    int left, top, width, height;
    struct depth_frame bounds; // only the actor's bounds and has_mask are used
};

struct depth_frame_cache {
    struct frame_source source;
    int64_t *frames;
    struct cached_window *windows; // of each frame
    int count;
    size_t bytes, max_bytes;
};

enum status depth_frame_cache_open(struct depth_frame_cache **out, const struct frame_source *source,
                                   const int64_t *frames, int count, size_t max_bytes)
{
    struct depth_frame_cache *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the cache of depth frames");
    s->source = *source;
    s->count = count;
    s->max_bytes = max_bytes;
    s->frames = malloc(sizeof *s->frames * (size_t)count);
    s->windows = calloc((size_t)count, sizeof *s->windows);
    if (!s->frames || !s->windows) {
        depth_frame_cache_close(out);
        return fail(ERR_MEMORY, "no memory for the cache of depth frames");
    }
    memcpy(s->frames, frames, sizeof *s->frames * (size_t)count);
    return OK;
}

void depth_frame_cache_close(struct depth_frame_cache **out)
{
    struct depth_frame_cache *cache = *out;
    if (!cache)
        return;
    for (int i = 0; i < cache->count && cache->windows; i++)
        free(cache->windows[i].bytes);
    free(cache->windows);
    free(cache->frames);
    free(cache);
    *out = NULL;
}

static int at_least(int value, int min) { return value > min ? value : min; }
static int at_most(int value, int max) { return value < max ? value : max; }

// The window that is kept: the actor's bounds, and as far about them as edge distances are measured.
static void set_window(struct cached_window *window, const struct depth_frame *frame)
{
    window->left = at_least(frame->left - DEPTH_FRAME_MAX_EDGE_PX, 0);
    window->top = at_least(frame->top - DEPTH_FRAME_MAX_EDGE_PX, 0);
    window->width = at_most(frame->right + DEPTH_FRAME_MAX_EDGE_PX, frame->width - 1) + 1 - window->left;
    window->height = at_most(frame->bottom + DEPTH_FRAME_MAX_EDGE_PX, frame->height - 1) + 1 - window->top;
}

static void store_window(struct depth_frame_cache *all, int i, const struct depth_frame *frame)
{
    struct cached_window *window = &all->windows[i];
    if (frame->right < frame->left)
        return;
    set_window(window, frame);
    size_t pixels = (size_t)window->width * (size_t)window->height, row = (size_t)window->width;
    if (all->bytes + PIXEL_BYTES * pixels > all->max_bytes)
        return;
    window->bytes = malloc(PIXEL_BYTES * pixels);
    if (!window->bytes)
        return; // it is read from the take each time instead
    all->bytes += PIXEL_BYTES * pixels;
    window->bounds = *frame;
    uint8_t *part = window->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    for (int y = 0; y < window->height; y++) {
        size_t from = (size_t)(window->top + y) * (size_t)frame->width + (size_t)window->left, to = (size_t)y * row;
        memcpy(window->bytes + 2 * to, frame->depth + from, 2 * row);
        memcpy(part + to, frame->part + from, row);
        memcpy(edge + to, frame->edge_distance + from, row);
        memcpy(half + to, frame->half_width + from, row);
    }
}

static void restore_window(const struct cached_window *window, struct depth_frame *frame)
{
    size_t pixels = (size_t)window->width * (size_t)window->height, row = (size_t)window->width,
           all = (size_t)frame->width * (size_t)frame->height;
    const uint8_t *part = window->bytes + 2 * pixels, *edge = part + pixels, *half = edge + pixels;
    frame->has_mask = window->bounds.has_mask;
    frame->left = window->bounds.left, frame->top = window->bounds.top, frame->right = window->bounds.right,
    frame->bottom = window->bounds.bottom;
    memset(frame->depth, 0, sizeof *frame->depth * all);
    memset(frame->part, DEPTH_FRAME_BACKGROUND, all);
    memset(frame->edge_distance, DEPTH_FRAME_MAX_EDGE_PX, all);
    memset(frame->half_width, UINT8_MAX, all);
    for (int y = 0; y < window->height; y++) {
        size_t to = (size_t)(window->top + y) * (size_t)frame->width + (size_t)window->left, from = (size_t)y * row;
        memcpy(frame->depth + to, window->bytes + 2 * from, 2 * row);
        memcpy(frame->part + to, part + from, row);
        memcpy(frame->edge_distance + to, edge + from, row);
        memcpy(frame->half_width + to, half + from, row);
    }
}

static void copy_colors(const struct depth_frame_cache *cache, const struct take_images *images, uint8_t *rgb)
{
    const struct lens *lens = &take_calibration(cache->source.take)->color;
    memcpy(rgb, images->color, 3 * (size_t)lens->width * (size_t)lens->height);
}

enum status depth_frame_cache_read(struct depth_frame_cache *cache, int i, struct depth_frame *into, uint8_t *rgb)
{
    assert(i >= 0 && i < cache->count);
    const bool is_kept = cache->windows[i].bytes != NULL;
    const struct take_entry *e = take_entry(cache->source.take, cache->frames[i]);
    if (!e->has_depth || !e->has_skeleton)
        return NOTHING;
    struct take_images images;
    const unsigned want = (is_kept ? 0u : TAKE_DEPTH | TAKE_MASK) | (rgb ? TAKE_COLOR : 0u);
    enum status status = take_read(cache->source.take, cache->frames[i], want, &images);
    if (status != OK)
        return status == ERR_CORRUPT ? NOTHING : status; // a damaged frame costs itself alone
    if (is_kept) {
        restore_window(&cache->windows[i], into);
    } else {
        depth_frame_label(into, &images, take_skeletons_at(cache->source.skeletons, cache->frames[i]));
        store_window(cache, i, into);
    }
    if (rgb && !images.color)
        return NOTHING;
    if (rgb)
        copy_colors(cache, &images, rgb);
    return OK;
}
