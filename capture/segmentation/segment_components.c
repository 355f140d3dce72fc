// Components of continuous depth among the cells that may be the person, and their measures.
#include "capture/segmentation/segment_internal.h"

#include <stdlib.h>

// Chosen by hand.
static const double NEAR_BODY_M = 0.10;   // a cell this close to a sphere, and twice the noise, is near the body
static const double REACH_MARGIN_M = 0.2; // more than NEAR_BODY_M and twice the noise at the farthest depth in use
static const double TOP_M = 0.2;          // the height over which a component's top width is measured

static struct vec3 cell_point(const struct segmenter *s, int i, double z)
{
    return v3((double)s->ray[i].x * z, (double)s->ray[i].y * z, z);
}

static int find_root(int32_t *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void union_cells(struct segmenter *s, int a, int b)
{
    int za = s->depth[a], zb = s->depth[b];
    if (!zb || s->label[b] < 0 || abs(za - zb) > by_depth(s->max_step_mm, za < zb ? za : zb))
        return;
    a = find_root(s->parent, a);
    b = find_root(s->parent, b);
    if (a != b)
        s->parent[a < b ? b : a] = a < b ? a : b;
}

enum status segmenter_label_components(struct segmenter *s)
{
    int w = s->width;
    s->candidate_count = 0;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x;
            if (!s->depth[i] || !may_be_person(s, i, s->depth[i])) {
                s->label[i] = -1;
                continue;
            }
            s->label[i] = 0;
            s->parent[i] = i;
            s->candidate[s->candidate_count++] = i;
            if (x > 0)
                union_cells(s, i, i - 1);
            if (x > 1 && !s->depth[i - 1]) // across a gap of one cell
                union_cells(s, i, i - 2);
            if (y > 0)
                union_cells(s, i, i - w);
            if (y > 1 && !s->depth[i - w])
                union_cells(s, i, i - 2 * w);
        }
    s->component_count = 0;
    for (int k = 0; k < s->candidate_count; k++) { // a root precedes its cells, so its label is final
        int i = s->candidate[k];
        if (find_root(s->parent, i) == i) {
            if (s->component_count == s->component_capacity) {
                int capacity = s->component_capacity ? 2 * s->component_capacity : 256;
                struct component *more = realloc(s->components, (size_t)capacity * sizeof *more);
                if (!more)
                    return fail(ERR_MEMORY, "not enough memory for %d components of a depth image", capacity);
                s->components = more;
                s->component_capacity = capacity;
            }
            s->label[i] = s->component_count++;
        } else {
            s->label[i] = s->label[find_root(s->parent, i)];
        }
    }
    return OK;
}

// Two horizontal axes: lateral, and away from the camera.
static void horizontal_axes(const struct segmenter *s, struct vec3 *across, struct vec3 *away)
{
    *across = v3_unit(v3_cross(v3(0, 0, 1), v3_scale(s->up, -1)));
    *across = v3_scale(*across, across->x < 0 ? -1 : 1);
    *away = v3_unit(v3_cross(*across, v3_scale(s->up, -1)));
}

static void clear_components(struct segmenter *s)
{
    for (int c = 0; c < s->component_count; c++)
        s->components[c] = (struct component){.top = -1e9,
                                              .bottom = 1e9,
                                              .low = {1e9, 1e9, 1e9},
                                              .high = {-1e9, -1e9, -1e9},
                                              .top_low = 1e9,
                                              .top_high = -1e9};
}

void segmenter_count_near_body(struct segmenter *s, const struct bounding_sphere *spheres, int sphere_count)
{
    clear_components(s);
    // One sphere around all spheres rejects most cells early.
    struct vec3 middle = v3(0, 0, 0);
    double reach = 0;
    int last = 0;
    for (int b = 0; b < sphere_count; b++)
        middle = v3_add(middle, v3_scale(spheres[b].centre, 1.0 / sphere_count));
    for (int b = 0; b < sphere_count; b++)
        reach = fmax(reach, v3_distance(middle, spheres[b].centre) + spheres[b].radius + REACH_MARGIN_M);
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        struct component *c = &s->components[s->label[i]];
        double z = s->depth[i] * 0.001, margin = NEAR_BODY_M + 2 * depth_sigma_m(z);
        struct vec3 p = cell_point(s, i, z), far = v3_sub(p, middle);
        c->cells++;
        if (!(v3_dot(far, far) < reach * reach))
            continue;
        for (int k = -1; k < sphere_count; k++) {
            int b = k < 0 ? last : k; // first the one that matched the previous cell
            double r = spheres[b].radius + margin;
            struct vec3 d = v3_sub(p, spheres[b].centre);
            if (v3_dot(d, d) < r * r) {
                c->near_body++;
                last = b;
                break;
            }
        }
    }
}

// The lateral extent of each component's top.
static void measure_top_widths(struct segmenter *s, struct vec3 across)
{
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        double z = s->depth[i] * 0.001;
        struct vec3 p = cell_point(s, i, z);
        struct component *c = &s->components[s->label[i]];
        if (v3_dot(s->up, p) + s->height_m > c->top - TOP_M) {
            c->top_low = fmin(c->top_low, v3_dot(across, p));
            c->top_high = fmax(c->top_high, v3_dot(across, p));
        }
    }
    for (int c = 0; c < s->component_count; c++)
        s->components[c].top_width = fmax(0, s->components[c].top_high - s->components[c].top_low);
}

void segmenter_measure_components(struct segmenter *s)
{
    struct vec3 across, away;
    horizontal_axes(s, &across, &away);
    clear_components(s);
    int w = s->width;
    double cell = s->step / s->lens.fx;
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        struct component *c = &s->components[s->label[i]];
        double z = s->depth[i] * 0.001;
        struct vec3 p = cell_point(s, i, z);
        double h = v3_dot(s->up, p) + s->height_m, level[3] = {v3_dot(across, p), v3_dot(away, p), z};
        c->cells++;
        c->area_m2 += cell * cell * z * z;
        c->top = fmax(c->top, h);
        c->bottom = fmin(c->bottom, h);
        for (int k = 0; k < 3; k++) {
            c->low[k] = fmin(c->low[k], level[k]);
            c->high[k] = fmax(c->high[k], level[k]);
        }
        c->sum[0] += p.x, c->sum[1] += p.y, c->sum[2] += p.z;
        c->overlap += s->previous[i];
        int x = i % w, y = i / w;
        c->border_left += x < s->bounds.left / s->step + 2;
        c->border_right += x >= s->bounds.right / s->step - 1;
        c->border_top += y < s->bounds.top / s->step + 2;
        c->border_bottom += y >= s->bounds.bottom / s->step - 1;
    }
    measure_top_widths(s, across);
}

double segmenter_continued_share(const struct segmenter *s, int component)
{
    const int w = s->width;
    int edge = 0, continued = 0;
    for (int n = 0; n < s->candidate_count; n++) {
        const int i = s->candidate[n], x = i % w, y = i / w;
        if (s->label[i] != component)
            continue;
        const int next[4] = {x ? i - 1 : -1, x + 1 < w ? i + 1 : -1, y ? i - w : -1, y + 1 < s->height ? i + w : -1};
        for (int k = 0; k < 4; k++) {
            if (next[k] < 0 || s->label[next[k]] == component)
                continue;
            const int there = s->depth[next[k]];
            edge++;
            continued +=
                there && s->label[next[k]] < 0 &&
                abs(there - s->depth[i]) <= by_depth(s->max_step_mm, there < s->depth[i] ? there : s->depth[i]);
        }
    }
    return edge ? (double)continued / edge : 0;
}
