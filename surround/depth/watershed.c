#include "surround/depth/watershed.h"

#include <stdlib.h>
#include <string.h>

enum { LEVELS = 64, STEP = 4 /* parts of a pixel that distances count in */ };

struct flood {
    const struct surround_picture *p;
    int32_t *label, *next;
    uint16_t *distance;
    int32_t head[LEVELS], tail[LEVELS];
    int lowest, highest;
};

static void push(struct flood *f, int level, int32_t pixel)
{
    f->next[pixel] = -1;
    if (f->head[level] < 0)
        f->head[level] = pixel;
    else
        f->next[f->tail[level]] = pixel;
    f->tail[level] = pixel;
    if (level < f->lowest)
        f->lowest = level;
}

static int edge_between(const uint8_t *rgb, int32_t a, int32_t b)
{
    int most = 0;
    for (int c = 0; c < 3; c++) {
        const int d = abs((int)rgb[3 * (size_t)a + (size_t)c] - (int)rgb[3 * (size_t)b + (size_t)c]);
        most = d > most ? d : most;
    }
    return most;
}

// Noise of a JPEG is no edge: differences below 4 are level 0; above, 3 to a level.
static int level_of(int edge)
{
    const int level = edge < 4 ? 0 : (edge - 1) / 3;
    return level < LEVELS ? level : LEVELS - 1;
}

static void spread(struct flood *f, int32_t from, int level, int most)
{
    const int w = f->p->width, h = f->p->height, u = from % w, v = from / w;
    const int row_step =
        f->p->panorama ? (int)(STEP * f->p->ray_table[2 * (w + v)] + 1) : STEP; // sine of the angle from the zenith
    for (int k = 0; k < 4; k++) {
        const int x = surround_picture_column(f->p, u + (k == 0) - (k == 1)), y = v + (k == 2) - (k == 3);
        if (x < 0 || x >= w || y < 0 || y >= h)
            continue;
        const int32_t to = y * w + x;
        if (f->label[to] != WATERSHED_FREE)
            continue;
        const int distance = f->distance[from] + (k < 2 ? row_step : STEP);
        if (distance > most)
            continue;
        const int edge = level_of(edge_between(f->p->rgb, from, to));
        if (edge > f->highest)
            continue;
        f->label[to] = f->label[from];
        f->distance[to] = (uint16_t)distance;
        push(f, edge > level ? edge : level, to);
    }
}

enum status watershed_grow(const struct surround_picture *p, int reach, int most_edge, int32_t *label)
{
    const size_t pixels = (size_t)p->width * (size_t)p->height;
    struct flood f = {.p = p, .label = label, .lowest = LEVELS, .highest = level_of(most_edge)};
    f.next = malloc(pixels * sizeof *f.next);
    f.distance = calloc(pixels, sizeof *f.distance);
    enum status status = f.next && f.distance ? OK : fail(ERR_MEMORY, "out of memory");
    memset(f.head, 0xff, sizeof f.head);
    for (size_t i = 0; status == OK && i < pixels; i++)
        if (label[i] >= 0)
            push(&f, 0, (int32_t)i);
    while (status == OK && f.lowest < LEVELS) {
        const int level = f.lowest;
        const int32_t pixel = f.head[level];
        if (pixel < 0) {
            f.lowest++;
            continue;
        }
        f.head[level] = f.next[pixel];
        spread(&f, pixel, level, reach * STEP);
    }
    free(f.next);
    free(f.distance);
    return status;
}
