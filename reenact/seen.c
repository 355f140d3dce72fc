#include "reenact/seen.h"

#include <stdlib.h>
#include <string.h>

enum { NOBODY = PART_COUNT, RIM, RIM_PX = 1, GAP_PX = 5, SPREAD_PX = 6, MOST_VERTICES = 60000 };

// One frame on its way to be a surface.
struct work {
    int width, height, step;
    const struct source_rays *rays;
    uint8_t *part;                // of each depth pixel; NOBODY
    uint16_t *depth;              // smoothed, millimetres
    int32_t *slot;                // number of the pixel's vertex in the surface being made; -1
    int left, top, right, bottom; // of the person's pixels
};

static void work_free(struct work *w)
{
    free(w->part);
    free(w->depth);
    free(w->slot);
}

void seen_free(struct seen *seen)
{
    for (int p = 0; p < PART_COUNT; p++)
        cylinder_mesh_free(&seen->surface[p]);
    free(seen->depth);
    source_picture_free(&seen->picture);
    *seen = (struct seen){.frame = -1};
}

// How far two neighbouring readings of one surface may differ; as part_pixel_solid.
static int same_mm(int depth) { return 30 + (int)((int64_t)depth * depth / 160000); }

// ---------------------------------------------------------------- whose, and how far

static void label(struct work *w, const struct take *take, int64_t frame, const struct take_pictures *pictures)
{
    struct part_bones bones = part_bones_of(&take_entry(take, frame)->skeleton, take_body(take));
    double outside = part_outside_m(pictures->mask != NULL);
    w->left = w->width, w->top = w->height, w->right = w->bottom = -1;
    for (int i = 0; i < w->width * w->height; i++) {
        w->part[i] = NOBODY;
        if (!part_pixel_solid(pictures->depth, pictures->mask, w->width, w->height, i))
            continue;
        uint16_t parts = part_label(&bones, source_rays_point(w->rays, i, pictures->depth[i]), 0, outside);
        for (int p = 0; p < PART_COUNT && parts && w->part[i] == NOBODY; p++)
            if (parts >> p & 1)
                w->part[i] = (uint8_t)p;
        if (w->part[i] == NOBODY)
            continue;
        int x = i % w->width, y = i / w->width;
        w->left = x < w->left ? x : w->left, w->right = x > w->right ? x : w->right;
        w->top = y < w->top ? y : w->top, w->bottom = y > w->bottom ? y : w->bottom;
    }
}

// One pass over readings `apart` pixels from each other.
static void smooth_once(struct work *w, const uint16_t *depth, int apart, uint16_t *out)
{
    static const int weight[] = {1, 4, 6, 4, 1};
    for (int y = w->top; y <= w->bottom; y++)
        for (int x = w->left; x <= w->right; x++) {
            int i = y * w->width + x;
            if (w->part[i] == NOBODY)
                continue;
            int same = same_mm(depth[i]);
            int64_t sum = 0, total = 0;
            for (int dy = -2; dy <= 2; dy++)
                for (int dx = -2; dx <= 2; dx++) {
                    int cx = x + dx * apart, cy = y + dy * apart, n = cy * w->width + cx;
                    if (cx < w->left || cx > w->right || cy < w->top || cy > w->bottom || w->part[n] == NOBODY ||
                        abs(depth[n] - depth[i]) > same)
                        continue;
                    int64_t k = weight[dx + 2] * weight[dy + 2];
                    sum += k * depth[n];
                    total += k;
                }
            out[i] = (uint16_t)((sum + total / 2) / total);
        }
}

// Readings are noisy, come in steps and waver together over several pixels; the
// mean of those on the same surface, in rings of growing width, does so less.
static void smooth(struct work *w, const uint16_t *depth)
{
    uint16_t *spare = (uint16_t *)w->slot; // not in use yet
    smooth_once(w, depth, 1, w->depth);
    smooth_once(w, w->depth, 2, spare);
    smooth_once(w, spare, 3, w->depth);
}

// The outermost readings hang between the person and what is behind: no surface, but no empty room either.
static void shave(struct work *w)
{
    for (int pass = 0; pass < RIM_PX; pass++) {
        for (int y = w->top; y <= w->bottom; y++)
            for (int x = w->left; x <= w->right; x++) {
                int i = y * w->width + x;
                if (w->part[i] >= NOBODY)
                    continue;
                const int around[] = {i - 1, i + 1, i - w->width, i + w->width};
                for (int n = 0; n < 4; n++)
                    if (w->part[around[n]] == NOBODY ||
                        (w->part[around[n]] < NOBODY && abs(w->depth[around[n]] - w->depth[i]) > same_mm(w->depth[i])))
                        w->slot[i] = -2;
            }
        for (int y = w->top; y <= w->bottom; y++)
            for (int x = w->left; x <= w->right; x++) {
                int i = y * w->width + x;
                if (w->slot[i] == -2)
                    w->part[i] = RIM;
                w->slot[i] = -1;
            }
    }
}

// ---------------------------------------------------------------- surface

static bool joined(const struct work *w, const int corners[3])
{
    for (int c = 0; c < 3; c++) {
        int a = corners[c], b = corners[(c + 1) % 3];
        if (w->part[a] >= NOBODY || w->part[b] >= NOBODY ||
            abs(w->depth[a] - w->depth[b]) > w->step * same_mm(w->depth[a]))
            return false;
    }
    return true;
}

static uint16_t vertex_of(struct work *w, struct cylinder_mesh *m, int pixel)
{
    if (w->slot[pixel] < 0) {
        struct vec3 p = source_rays_point(w->rays, pixel, w->depth[pixel]);
        float *v = m->vertices + 3 * (size_t)m->vertex_count;
        v[0] = (float)p.x, v[1] = (float)p.y, v[2] = (float)p.z;
        w->slot[pixel] = m->vertex_count++;
    }
    return (uint16_t)w->slot[pixel];
}

// A triangle belongs to the part of its first corner.
static enum status make_surface(struct work *w, enum part p, struct cylinder_mesh *m)
{
    int s = w->step;
    size_t pixels = 0;
    for (int y = w->top; y <= w->bottom; y += s)
        for (int x = w->left; x <= w->right; x += s) {
            w->slot[y * w->width + x] = -1;
            pixels += w->part[y * w->width + x] == p;
        }
    if (!pixels)
        return OK;
    // Each pixel begins three triangles at most, with five other corners, which may be another part's.
    m->vertices = malloc(sizeof(float) * 3 * pixels * 6);
    m->indices = malloc(sizeof(uint16_t) * 6 * pixels * 2);
    if (!m->vertices || !m->indices)
        return fail(ERR_MEMORY, "out of memory");
    for (int y = w->top; y + s <= w->bottom; y += s)
        for (int x = w->left; x + s <= w->right; x += s) {
            int a = y * w->width + x, b = a + s, c = a + s * w->width, d = c + s;
            // Along the diagonal that stands less deep.
            bool falling = w->part[a] < NOBODY && w->part[d] < NOBODY &&
                           (w->part[b] >= NOBODY || w->part[c] >= NOBODY ||
                            abs(w->depth[a] - w->depth[d]) <= abs(w->depth[b] - w->depth[c]));
            const int both[2][3] = {{a, c, falling ? d : b}, {falling ? a : c, d, b}};
            for (int t = 0; t < 2; t++) {
                if (w->part[both[t][0]] != p || !joined(w, both[t]) || m->vertex_count > UINT16_MAX - 3)
                    continue;
                for (int k = 0; k < 3; k++)
                    m->indices[m->index_count++] = vertex_of(w, m, both[t][k]);
            }
        }
    return OK;
}

// ---------------------------------------------------------------- pictures

// Readings are missing on hair and at the person's own edges: what lies close between person's pixels is no empty room.
static bool in_gap(const struct work *w, int x, int y)
{
    static const int steps[2][2] = {{1, 0}, {0, 1}};
    for (int s = 0; s < 2; s++) {
        bool found[2] = {false, false};
        for (int side = 0; side < 2; side++)
            for (int d = 1; d <= GAP_PX && !found[side]; d++) {
                int cx = x + (side ? d : -d) * steps[s][0], cy = y + (side ? d : -d) * steps[s][1];
                found[side] =
                    cx >= 0 && cy >= 0 && cx < w->width && cy < w->height && w->part[cy * w->width + cx] != NOBODY;
            }
        if (found[0] && found[1])
            return true;
    }
    return false;
}

static void make_depth(const struct work *w, const uint16_t *depth, uint8_t *out)
{
    for (int y = 0; y < w->height; y++)
        for (int x = 0; x < w->width; x++) {
            int i = y * w->width + x;
            bool person = w->part[i] != NOBODY;
            uint16_t d = person ? w->depth[i] : depth[i];
            bool gap = !d && x >= w->left && x <= w->right && y >= w->top && y <= w->bottom && in_gap(w, x, y);
            out[4 * i] = (uint8_t)(d >> 8);
            out[4 * i + 1] = (uint8_t)(d & 255);
            out[4 * i + 2] = w->part[i] < NOBODY ? 255 : person || gap ? 128 : 0;
            out[4 * i + 3] = 255;
        }
}

// The person's colours go on outwards a little, over the pixels that are half background.
static void spread(struct source_picture *picture)
{
    int w = picture->width, h = picture->height;
    for (int ring = 0; ring < SPREAD_PX; ring++) {
        uint16_t fresh = (uint16_t)(1 << (ring % 2 ? 13 : 14)), stale = (uint16_t)(1 << (ring % 2 ? 14 : 13));
        for (int y = 1; y + 1 < h; y++)
            for (int x = 1; x + 1 < w; x++) {
                int i = y * w + x;
                if (picture->parts[i])
                    continue;
                const int around[] = {i - 1, i + 1, i - w, i + w, i - w - 1, i - w + 1, i + w - 1, i + w + 1};
                int sum[3] = {0, 0, 0}, count = 0;
                for (int n = 0; n < 8; n++)
                    if (picture->parts[around[n]] && picture->parts[around[n]] != fresh) {
                        for (int c = 0; c < 3; c++)
                            sum[c] += picture->rgb[3 * around[n] + c];
                        count++;
                    }
                if (!count)
                    continue;
                for (int c = 0; c < 3; c++)
                    picture->rgb[3 * i + c] = (uint8_t)((sum[c] + count / 2) / count);
                picture->parts[i] = fresh;
            }
        for (int i = 0; i < w * h; i++) // so that the next ring takes this one for the person
            if (picture->parts[i] == fresh || picture->parts[i] == stale)
                picture->parts[i] = PART_LABEL_PERSON;
    }
}

// ---------------------------------------------------------------- all of it

static enum status make(struct seen *seen, struct work *w, struct take *take, int64_t frame)
{
    struct take_pictures pictures;
    enum status status = take_read(take, frame, TAKE_DEPTH | TAKE_MASK, &pictures);
    if (status != OK)
        return status;
    label(w, take, frame, &pictures);
    smooth(w, pictures.depth);
    for (int i = 0; i < w->width * w->height; i++)
        w->slot[i] = -1;
    shave(w);
    make_depth(w, pictures.depth, seen->depth);
    size_t most = 0;
    for (int y = w->top; y <= w->bottom; y++)
        for (int x = w->left; x <= w->right; x++)
            most += w->part[y * w->width + x] != NOBODY;
    while (most / (size_t)(w->step * w->step) > MOST_VERTICES)
        w->step++;
    for (int p = 0; p < PART_COUNT && status == OK; p++)
        status = make_surface(w, (enum part)p, &seen->surface[p]);
    if (status == OK)
        status = source_picture_load(&seen->picture, take, frame, w->rays);
    if (status == OK)
        spread(&seen->picture);
    return status;
}

enum status seen_load(struct seen *seen, struct take *take, int64_t frame, const struct source_rays *rays)
{
    const struct take_entry *e = take_entry(take, frame);
    seen_free(seen);
    if (!rays || !e->has_depth || !e->has_color || !e->has_skeleton)
        return NOTHING;
    const struct lens *lens = &take_calibration(take)->depth;
    size_t pixels = (size_t)lens->width * (size_t)lens->height;
    struct work w = {.width = lens->width, .height = lens->height, .step = 1, .rays = rays};
    w.part = malloc(pixels);
    w.depth = malloc(sizeof(uint16_t) * pixels);
    w.slot = malloc(sizeof(int32_t) * pixels);
    seen->depth = malloc(4 * pixels);
    enum status status = w.part && w.depth && w.slot && seen->depth ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = make(seen, &w, take, frame);
    work_free(&w);
    if (status != OK)
        seen_free(seen);
    else
        seen->frame = frame;
    return status;
}
