#include "reenact/observation/source_texture.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// Neighbouring parts share the pixels between them up to this distance. Chosen by hand.
static const double SHARED_M = 0.03;

void source_image_free(struct source_image *image)
{
    free(image->rgb);
    free(image->parts);
    *image = (struct source_image){.frame = -1};
}

// ---------------------------------------------------------------- labels

// Labels the colour pixels that a depth pixel covers.
static void label_footprint(struct source_image *image, struct pixel at, double half, uint16_t parts)
{
    int x0 = (int)ceil(at.x - half), x1 = (int)floor(at.x + half);
    int y0 = (int)ceil(at.y - half), y1 = (int)floor(at.y + half);
    for (int y = y0 < 0 ? 0 : y0; y <= y1 && y < image->height; y++)
        for (int x = x0 < 0 ? 0 : x0; x <= x1 && x < image->width; x++)
            image->parts[y * image->width + x] |= parts;
}

static void label_pixels(struct source_image *image, const struct take *take, const struct take_images *images,
                         const struct source_rays *rays)
{
    const struct calibration *c = take_calibration(take);
    struct part_capsules bones = part_capsules_of(&take_entry(take, image->frame)->skeleton, take_body(take));
    bool same = c->registered && c->depth.width == c->color.width && c->depth.height == c->color.height;
    double half = fmax(0.5, 0.55 * c->color.fx / c->depth.fx);
    double outside = part_max_distance_m(images->mask != NULL);
    for (int i = 0; i < source_rays_count(rays); i++) {
        if (!part_pixel_on_surface(images->depth, images->mask, c->depth.width, c->depth.height, i))
            continue;
        struct vec3 p = source_rays_point(rays, i, images->depth[i]);
        uint16_t parts = part_label(&bones, p, SHARED_M, outside);
        if (!parts)
            continue;
        if (same)
            image->parts[i] = parts;
        else if (p.z > 1e-3)
            label_footprint(image, lens_project(&c->color, p), half, parts);
    }
}

// Removes the labels of the actor's outermost pixels, whose colours are mixed with the background's.
static enum status erode_labels(struct source_image *image)
{
    int w = image->width, h = image->height;
    uint16_t *rows = malloc(sizeof(uint16_t) * 2 * (size_t)w);
    if (!rows)
        return fail(ERR_MEMORY, "no memory for a frame's texture");
    uint16_t *above = rows, *here = rows + w; // labels before erosion
    memset(above, 0, sizeof(uint16_t) * (size_t)w);
    for (int y = 0; y < h; y++) {
        uint16_t *row = image->parts + (size_t)y * w;
        memcpy(here, row, sizeof(uint16_t) * (size_t)w);
        for (int x = 0; x < w; x++) {
            bool inner =
                here[x] && x > 0 && here[x - 1] && x + 1 < w && here[x + 1] && above[x] && y + 1 < h && row[w + x];
            if (!inner)
                row[x] = 0;
        }
        uint16_t *swap = above;
        above = here;
        here = swap;
    }
    free(rows);
    return OK;
}

enum status source_image_load(struct source_image *image, struct take *take, int64_t frame,
                              const struct source_rays *rays)
{
    const struct calibration *c = take_calibration(take);
    size_t pixels = (size_t)c->color.width * (size_t)c->color.height;
    if (!image->rgb)
        image->rgb = malloc(pixels * 3);
    if (rays && !image->parts)
        image->parts = malloc(pixels * sizeof(uint16_t));
    if (!image->rgb || (rays && !image->parts)) {
        source_image_free(image);
        return fail(ERR_MEMORY, "no memory for a frame's texture");
    }
    image->frame = -1;
    image->labelled = false;
    image->width = c->color.width;
    image->height = c->color.height;
    struct take_images images = {0};
    unsigned want = rays ? TAKE_COLOR | TAKE_DEPTH | TAKE_MASK : TAKE_COLOR;
    enum status status = take_read(take, frame, want, &images);
    if (status != OK && status != ERR_CORRUPT) { // a damaged frame costs itself alone
        source_image_free(image);
        return status;
    }
    if (!images.color)
        return NOTHING;
    memcpy(image->rgb, images.color, pixels * 3);
    image->frame = frame;
    if (!rays)
        return OK;
    memset(image->parts, 0, pixels * sizeof(uint16_t));
    if (images.depth && take_entry(take, frame)->has_skeleton)
        label_pixels(image, take, &images, rays);
    status = erode_labels(image);
    image->labelled = true;
    if (status != OK)
        source_image_free(image);
    return status;
}

// ---------------------------------------------------------------- a part's patch

// The window about a part and the part's area in it, pixels. False: the part is outside the image.
static bool part_window(const struct take *take, int64_t frame, enum part part, struct source_patch *patch,
                        double *area)
{
    const struct lens *lens = &take_calibration(take)->color;
    const struct skeleton *s = &take_entry(take, frame)->skeleton;
    struct vec3 ends[2] = {s->joint[part_ends[part].from], s->joint[part_ends[part].to]};
    double reach = take_body(take)->radius_rate[part] * v3_distance(ends[0], ends[1]);
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9, thick = 0;
    struct pixel at[2];
    for (int i = 0; i < 2; i++) {
        if (!(ends[i].z > 0.1))
            return false;
        at[i] = lens_project(lens, ends[i]);
        double r = lens->fx * reach / ends[i].z;
        thick += r;
        x0 = fmin(x0, at[i].x - 1.8 * r);
        x1 = fmax(x1, at[i].x + 1.8 * r);
        y0 = fmin(y0, at[i].y - 1.8 * r);
        y1 = fmax(y1, at[i].y + 1.8 * r);
    }
    x0 = fmax(x0, 0), y0 = fmax(y0, 0), x1 = fmin(x1, lens->width - 1), y1 = fmin(y1, lens->height - 1);
    if (!(x1 - x0 >= 2 && y1 - y0 >= 2))
        return false;
    *patch = (struct source_patch){.left = (int)x0, .top = (int)y0};
    patch->width = (int)x1 - patch->left + 1;
    patch->height = (int)y1 - patch->top + 1;
    *area = thick * portable_hypot(at[1].x - at[0].x, at[1].y - at[0].y) + thick * thick / 4;
    return true;
}

// For each pixel of the window the row of the nearest usable pixel in its column; -1: none.
static void nearest_in_columns(const struct source_image *image, const struct source_patch *patch, uint16_t bit,
                               int16_t *row)
{
    for (int x = 0; x < patch->width; x++) {
        int last = -1;
        for (int y = 0; y < patch->height; y++) {
            size_t at = (size_t)(patch->top + y) * image->width + patch->left + x;
            if (image->parts[at] & bit)
                last = y;
            row[y * patch->width + x] = (int16_t)last;
        }
        last = -1;
        for (int y = patch->height - 1; y >= 0; y--) {
            int16_t *r = &row[y * patch->width + x];
            if (*r == y)
                last = y;
            if (last >= 0 && (*r < 0 || last - y < y - *r))
                *r = (int16_t)last;
        }
    }
}

// The exact nearest usable pixel of the window to (x, y); the leftmost, then the upper one on a tie. row: as
// nearest_in_columns fills it.
static void find_nearest(const struct source_patch *patch, const int16_t *row, const int at[2], int nearest[2])
{
    const int x = at[0], y = at[1];
    long best = -1;
    nearest[0] = nearest[1] = 0;
    for (int d = 0; d < patch->width && (best < 0 || (long)d * d < best); d++)
        for (int side = -1; side <= 1; side += 2) {
            int cx = x + side * d;
            int cy = cx >= 0 && cx < patch->width ? row[y * patch->width + cx] : -1;
            long distance = (long)d * d + (long)(cy - y) * (cy - y);
            if (cy >= 0 && (best < 0 || distance < best)) {
                best = distance;
                nearest[0] = cx;
                nearest[1] = cy;
            }
        }
}

static void fill_patch(const struct source_image *image, struct source_patch *patch, const int16_t *row)
{
    for (int y = 0; y < patch->height; y++)
        for (int x = 0; x < patch->width; x++) {
            int nearest[2];
            find_nearest(patch, row, (const int[2]){x, y}, nearest);
            size_t from = ((size_t)(patch->top + nearest[1]) * image->width + patch->left + nearest[0]) * 3;
            memcpy(patch->rgb + ((size_t)y * patch->width + x) * 3, image->rgb + from, 3);
        }
}

enum status source_patch_make(const struct source_image *image, const struct take *take, enum part p,
                              struct source_patch *out)
{
    assert(image->frame >= 0 && image->labelled);
    *out = (struct source_patch){0};
    struct source_patch w;
    double area;
    if (!part_window(take, image->frame, p, &w, &area))
        return NOTHING;
    uint16_t bit = (uint16_t)(1 << p);
    long usable = 0;
    for (int y = 0; y < w.height; y++)
        for (int x = 0; x < w.width; x++)
            usable += (image->parts[(size_t)(w.top + y) * image->width + w.left + x] & bit) != 0;
    if (usable < 12 || usable < area * 0.25) // chosen by hand
        return NOTHING;
    int16_t *row = malloc(sizeof(int16_t) * (size_t)w.width * (size_t)w.height);
    w.rgb = malloc(3 * (size_t)w.width * (size_t)w.height);
    if (!row || !w.rgb) {
        free(row);
        free(w.rgb);
        return fail(ERR_MEMORY, "no memory for a frame's texture");
    }
    nearest_in_columns(image, &w, bit, row);
    fill_patch(image, &w, row);
    free(row);
    *out = w;
    return OK;
}
