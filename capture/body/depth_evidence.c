#include "capture/body/depth_evidence.h"

#include "base/depth_noise.h"

#include <stdlib.h>
#include <string.h>

enum {
    CELLS_ACROSS = 160,
    FAR_AWAY = 4000,  // cells: no inside cell found yet
    AREA_MARGIN = 12, // cells
    PIXELS_MIN = 40,
    POINTS_MIN = 30,
};

#define SURFACE_SIGMA_M  0.012 // standard deviation of cloth and of the model's coarseness
#define OCCLUDER_FRONT_M 0.15  // an occluder is at least this much nearer, and three standard deviations
#define VISIBLE_SLACK_M  0.05  // a joint's surface may be this far off, its radius, and twice the noise
#define PROBE_OFFSET     0.6   // probes around a joint, of its radius

enum status evidence_open(struct depth_evidence **out, const struct lens *lens)
{
    *out = NULL;
    struct depth_evidence *e = calloc(1, sizeof *e);
    if (e) {
        e->lens = *lens;
        e->step = (lens->width + CELLS_ACROSS - 1) / CELLS_ACROSS;
        e->width = (lens->width + e->step - 1) / e->step;
        e->height = (lens->height + e->step - 1) / e->step;
        size_t n = (size_t)e->width * (size_t)e->height;
        e->inside = calloc(n, 1);
        e->nearest = calloc(n, sizeof *e->nearest);
    }
    if (!e || !e->inside || !e->nearest) {
        evidence_close(&e);
        return fail(ERR_MEMORY, "not enough memory to track a person in images of %d x %d", lens->width, lens->height);
    }
    *out = e;
    return OK;
}

void evidence_close(struct depth_evidence **evidence)
{
    if (!*evidence)
        return;
    free((*evidence)->inside);
    free((*evidence)->nearest);
    free(*evidence);
    *evidence = NULL;
}

// Takes over a neighbour's nearest cell if that is nearer.
static void propagate_nearest(struct depth_evidence *evidence, int x, int y, int i, int j)
{
    int16_t *mine = evidence->nearest[y * evidence->width + x];
    const int16_t *theirs = evidence->nearest[(y + j) * evidence->width + x + i];
    int dx = theirs[0] + i, dy = theirs[1] + j;
    if (theirs[0] != FAR_AWAY && dx * dx + dy * dy < mine[0] * mine[0] + mine[1] * mine[1]) {
        mine[0] = (int16_t)dx;
        mine[1] = (int16_t)dy;
    }
}

// Vector distance transform in two sweeps (Danielsson 1980), within the area; exact to a fraction of a cell.
static void compute_nearest(struct depth_evidence *evidence)
{
    const struct cell_area a = evidence->area;
    for (int y = a.top; y <= a.bottom; y++)
        for (int x = a.left; x <= a.right; x++) {
            int i = y * evidence->width + x;
            evidence->nearest[i][0] = evidence->nearest[i][1] = evidence->inside[i] ? 0 : FAR_AWAY;
        }
    for (int y = a.top; y <= a.bottom; y++) {
        for (int x = a.left; x <= a.right; x++) {
            if (y > a.top)
                propagate_nearest(evidence, x, y, 0, -1);
            if (y > a.top && x > a.left)
                propagate_nearest(evidence, x, y, -1, -1);
            if (y > a.top && x < a.right)
                propagate_nearest(evidence, x, y, 1, -1);
            if (x > a.left)
                propagate_nearest(evidence, x, y, -1, 0);
        }
        for (int x = a.right - 1; x >= a.left; x--)
            propagate_nearest(evidence, x, y, 1, 0);
    }
    for (int y = a.bottom; y >= a.top; y--) {
        for (int x = a.right; x >= a.left; x--) {
            if (y < a.bottom)
                propagate_nearest(evidence, x, y, 0, 1);
            if (y < a.bottom && x < a.right)
                propagate_nearest(evidence, x, y, 1, 1);
            if (y < a.bottom && x > a.left)
                propagate_nearest(evidence, x, y, -1, 1);
            if (x < a.right)
                propagate_nearest(evidence, x, y, 1, 0);
        }
        for (int x = a.left + 1; x <= a.right; x++)
            propagate_nearest(evidence, x, y, -1, 0);
    }
}

static int clamp_int(int low, int x, int high) { return x < low ? low : x > high ? high : x; }

// The person's cells and a margin.
static void find_cell_area(struct depth_evidence *evidence)
{
    evidence->area.left = clamp_int(0, evidence->left / evidence->step - AREA_MARGIN, evidence->width - 1);
    evidence->area.right = clamp_int(0, evidence->right / evidence->step + AREA_MARGIN, evidence->width - 1);
    evidence->area.top = clamp_int(0, evidence->top / evidence->step - AREA_MARGIN, evidence->height - 1);
    evidence->area.bottom = clamp_int(0, evidence->bottom / evidence->step + AREA_MARGIN, evidence->height - 1);
}

bool evidence_read(struct depth_evidence *evidence, const uint16_t *depth, const uint8_t *mask, int wanted)
{
    const struct lens *l = &evidence->lens;
    evidence->depth = depth;
    evidence->mask = mask;
    evidence->count = evidence->pixels = 0;
    evidence->left = l->width, evidence->top = l->height, evidence->right = evidence->bottom = -1;
    memset(evidence->inside, 0, (size_t)evidence->width * (size_t)evidence->height);
    for (int y = 0; y < l->height; y++) {
        const uint8_t *row = mask + (size_t)y * (size_t)l->width;
        if (!memchr(row, 255, (size_t)l->width))
            continue;
        for (int x = 0; x < l->width; x++)
            if (row[x]) {
                evidence->inside[(y / evidence->step) * evidence->width + x / evidence->step] = 1;
                evidence->pixels++;
                evidence->left = x < evidence->left ? x : evidence->left;
                evidence->right = x > evidence->right ? x : evidence->right;
                evidence->top = y < evidence->top ? y : evidence->top;
                evidence->bottom = y;
            }
    }
    if (evidence->pixels < PIXELS_MIN)
        return false;
    evidence->bounds = find_image_bounds(depth, l);
    find_cell_area(evidence);
    compute_nearest(evidence);
    if (wanted > EVIDENCE_POINTS_MAX)
        wanted = EVIDENCE_POINTS_MAX;
    int stride = (int)ceil(sqrt((double)evidence->pixels / wanted));
    if (stride < 1)
        stride = 1;
    evidence->low = v3(1e9, 1e9, 1e9);
    evidence->high = v3(-1e9, -1e9, -1e9);
    double z2 = 0;
    for (int y = evidence->top; y <= evidence->bottom; y += stride)
        for (int x = evidence->left + (y / stride % 2) * (stride / 2); x <= evidence->right; x += stride) {
            int d = depth[y * l->width + x];
            if (!mask[y * l->width + x] || !d || evidence->count == EVIDENCE_POINTS_MAX)
                continue;
            double z = d * 0.001, sigma = depth_sigma_m(z);
            struct vec3 p = v3_scale(lens_ray(l, (struct pixel){x, y}), z);
            z2 += z * z;
            evidence->point[evidence->count++] =
                (struct evidence_point){p, 1 / (SURFACE_SIGMA_M * SURFACE_SIGMA_M + sigma * sigma)};
            evidence->low = v3(fmin(evidence->low.x, p.x), fmin(evidence->low.y, p.y), fmin(evidence->low.z, p.z));
            evidence->high = v3(fmax(evidence->high.x, p.x), fmax(evidence->high.y, p.y), fmax(evidence->high.z, p.z));
        }
    evidence->extent_m2 = evidence->count ? evidence->pixels * z2 / evidence->count / (l->fx * l->fy) : 0;
    return evidence->count >= POINTS_MIN;
}

unsigned evidence_cropped_edges(const struct depth_evidence *evidence)
{
    return (evidence->left <= evidence->bounds.left + CROP_MARGIN ? CROP_LEFT : 0) |
           (evidence->right >= evidence->bounds.right - CROP_MARGIN ? CROP_RIGHT : 0) |
           (evidence->top <= evidence->bounds.top + CROP_MARGIN ? CROP_TOP : 0) |
           (evidence->bottom >= evidence->bounds.bottom - CROP_MARGIN ? CROP_BOTTOM : 0);
}

enum evidence_kind evidence_at(const struct depth_evidence *e, struct pixel px, double z, double *depth_m, double *dx,
                               double *dy)
{
    *depth_m = *dx = *dy = 0;
    if (!(px.x >= e->bounds.left && px.y >= e->bounds.top && px.x <= e->bounds.right && px.y <= e->bounds.bottom))
        return EVIDENCE_OUTSIDE;
    int x = (int)(px.x + 0.5), y = (int)(px.y + 0.5);
    x = x < e->lens.width ? x : e->lens.width - 1;
    y = y < e->lens.height ? y : e->lens.height - 1;
    double there = e->depth[y * e->lens.width + x] * 0.001;
    if (e->mask[y * e->lens.width + x]) {
        *depth_m = there;
        return EVIDENCE_PERSON;
    }
    if (there > 0 && there < z - OCCLUDER_FRONT_M - 3 * depth_sigma_m(z))
        return EVIDENCE_OCCLUDED;
    x /= e->step;
    y /= e->step;
    int at_x = clamp_int(e->area.left, x, e->area.right), at_y = clamp_int(e->area.top, y, e->area.bottom);
    const int16_t *way = e->nearest[at_y * e->width + at_x];
    if (way[0] == 0 && way[1] == 0 && x == at_x && y == at_y)
        return EVIDENCE_PERSON;
    *dx = (way[0] + at_x - x) * e->step; // outside the area: via the area's edge
    *dy = (way[1] + at_y - y) * e->step;
    return EVIDENCE_OFF_PERSON;
}

int evidence_visible_count(const struct depth_evidence *evidence, struct vec3 c, double radius, bool *outside)
{
    int shown = 0;
    *outside = true;
    for (int k = 0; k < EVIDENCE_PROBES; k++) {
        struct vec3 p = v3_add(c, v3((k == 1) * PROBE_OFFSET * radius - (k == 2) * PROBE_OFFSET * radius,
                                     (k == 3) * PROBE_OFFSET * radius - (k == 4) * PROBE_OFFSET * radius, 0));
        if (p.z < 0.1)
            continue;
        double measured, dx, dy;
        enum evidence_kind kind = evidence_at(evidence, lens_project(&evidence->lens, p), p.z, &measured, &dx, &dy);
        *outside = *outside && kind == EVIDENCE_OUTSIDE;
        if (kind == EVIDENCE_PERSON && measured > 0 &&
            fabs(measured - (p.z - radius)) < VISIBLE_SLACK_M + radius + 2 * depth_sigma_m(measured))
            shown++;
    }
    return shown;
}
