#include "surround/depth/point_colors.h"

#include "base/clamp.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand. So many nearest pictures are asked, and so many must agree; levels that a channel may differ by.
enum { ASKED = 5, AGREEING = 3, ALIKE = 40 };
// A gain is measured over points within this, from so many; the histogram's bins of a ratio, each 1 / PER_ONE.
#define NEAR_M 10.0f
enum { FEWEST = 200, BINS = 256, PER_ONE = 64, DARKEST = 12, BRIGHTEST = 243 };

void point_colors_free(struct point_colors *colors)
{
    free(colors->rgb);
    *colors = (struct point_colors){0};
}

// Points hide each other: the distance of the nearest in each of a picture's coarse cells.
enum { CELLS_ACROSS = 256, CELLS_DOWN = 128 };
#define HIDDEN 1.15f // farther than the cell's nearest by this factor

static float *cell_of(float *nearest, const struct surround_picture *p, const struct picture_point *at)
{
    int x = (int)((at->u + 0.5f) * CELLS_ACROSS / (float)p->width);
    int y = (int)((at->v + 0.5f) * CELLS_DOWN / (float)p->height);
    x = clamp_int(x, 0, CELLS_ACROSS - 1);
    y = clamp_int(y, 0, CELLS_DOWN - 1);
    return &nearest[y * CELLS_ACROSS + x];
}

static void find_nearest(const struct surround_picture *p, const struct world_points *points, float *nearest)
{
    for (int i = 0; i < CELLS_ACROSS * CELLS_DOWN; i++)
        nearest[i] = 1e9f;
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        struct picture_point at;
        if (!surround_picture_project(p, world, &at))
            continue;
        float *cell = cell_of(nearest, p, &at);
        *cell = at.distance < *cell ? at.distance : *cell;
    }
}

static const uint8_t *pixel_at(const struct surround_picture *p, const struct picture_point *at)
{
    const int u = clamp_int((int)floorf(at->u + 0.5f), 0, p->width - 1);
    const int v = clamp_int((int)floorf(at->v + 0.5f), 0, p->height - 1);
    return p->rgb + 3 * ((size_t)v * (size_t)p->width + (size_t)u);
}

static bool alike(const uint8_t *a, const uint8_t *b)
{
    for (int c = 0; c < 3; c++)
        if (abs((int)a[c] - (int)b[c]) > ALIKE)
            return false;
    return true;
}

struct seen_color {
    float distance;
    uint8_t rgb[3];
};

// The colours in the nearest pictures to which no other point hides the point, nearest first; returns how many.
static int ask(const double world[3], const struct surround_picture *pictures, int count, float *nearest,
               struct seen_color *out)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        const struct surround_picture *p = &pictures[i];
        const struct vec3 to = v3_sub(v3(world[0], world[1], world[2]), p->world_from_camera.translation);
        const float distance = (float)v3_length(to);
        struct picture_point at;
        if ((n == ASKED && out[n - 1].distance <= distance) || !surround_picture_project(p, world, &at) ||
            at.distance > HIDDEN * *cell_of(nearest + (size_t)i * CELLS_ACROSS * CELLS_DOWN, p, &at))
            continue;
        int k = n < ASKED ? n++ : n - 1;
        for (; k > 0 && out[k - 1].distance > distance; k--)
            out[k] = out[k - 1];
        out[k].distance = distance;
        const uint8_t *rgb = pixel_at(p, &at);
        for (int c = 0; c < 3; c++) {
            const float value = rgb[c] * p->gain[c];
            out[k].rgb[c] = (uint8_t)(value < 255 ? value : 255);
        }
    }
    return n;
}

// The colour that the most others are like, and of those the one least apart from all.
static void choose(const struct seen_color *list, int count, uint8_t rgb[4])
{
    int most = AGREEING, least = 1 << 30;
    memset(rgb, 0, 4);
    for (int i = 0; i < count; i++) {
        int agree = 0, apart = 0;
        for (int k = 0; k < count; k++) {
            agree += alike(list[i].rgb, list[k].rgb);
            for (int c = 0; c < 3; c++)
                apart += abs((int)list[i].rgb[c] - (int)list[k].rgb[c]);
        }
        if (agree < most || (agree == most && apart >= least))
            continue;
        most = agree;
        least = apart;
        memcpy(rgb, list[i].rgb, 3);
        rgb[3] = 255;
    }
}

enum status point_colors_make(struct point_colors *colors, const struct world_points *points,
                              const struct surround_picture *pictures, int count)
{
    const size_t wanted = (size_t)points->count;
    if (wanted + 1 > colors->room) {
        uint8_t(*rgb)[4] = realloc(colors->rgb, (wanted + wanted / 4 + 1) * sizeof *rgb);
        if (!rgb)
            return fail(ERR_MEMORY, "out of memory");
        colors->rgb = rgb;
        colors->room = wanted + wanted / 4 + 1;
    }
    float *nearest = malloc(((size_t)count * CELLS_ACROSS * CELLS_DOWN + 1) * sizeof *nearest);
    if (!nearest)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < count; i++)
        find_nearest(&pictures[i], points, nearest + (size_t)i * CELLS_ACROSS * CELLS_DOWN);
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        struct seen_color list[ASKED];
        choose(list, ask(world, pictures, count, nearest, list), colors->rgb[i]);
    }
    free(nearest);
    return OK;
}

void point_colors_gain(const struct surround_picture *p, const struct world_points *points, float gain[3])
{
    int histogram[3][BINS] = {{0}}, n = 0;
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        const uint8_t *rgb = points->rgb[i];
        struct picture_point at;
        if (!rgb[3] || !surround_picture_project(p, world, &at) || at.distance > NEAR_M)
            continue;
        const uint8_t *pixel = pixel_at(p, &at);
        bool usable = true;
        for (int c = 0; c < 3; c++)
            usable = usable && pixel[c] > DARKEST && pixel[c] < BRIGHTEST && rgb[c] > DARKEST && rgb[c] < BRIGHTEST;
        if (!usable)
            continue;
        for (int c = 0; c < 3; c++) {
            const int bin = (int)(PER_ONE * (float)rgb[c] / (float)pixel[c]);
            histogram[c][bin < BINS ? bin : BINS - 1]++;
        }
        n++;
    }
    for (int c = 0; c < 3; c++) {
        int bin = 0;
        for (int sum = histogram[c][0]; 2 * sum < n && bin + 1 < BINS;)
            sum += histogram[c][++bin];
        gain[c] = n < FEWEST ? p->gain[c] : ((float)bin + 0.5f) / PER_ONE;
    }
}

bool point_color_agrees(const struct surround_picture *p, int u, int v, const float gain[3], const uint8_t rgb[4])
{
    if (!rgb[3])
        return true;
    for (int k = 0; k < 9; k++) {
        const int x = surround_picture_column(p, u + k % 3 - 1), y = v + k / 3 - 1;
        if (x < 0 || x >= p->width || y < 0 || y >= p->height)
            continue;
        const uint8_t *pixel = p->rgb + 3 * ((size_t)y * (size_t)p->width + (size_t)x);
        bool agrees = true;
        for (int c = 0; c < 3 && agrees; c++) {
            const float value = pixel[c] * gain[c];
            agrees = fabsf((value < 255 ? value : 255) - rgb[c]) <= ALIKE;
        }
        if (agrees)
            return true;
    }
    return false;
}
