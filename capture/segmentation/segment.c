#include "capture/segmentation/segment_internal.h"

#include <stdlib.h>
#include <string.h>

static int depth_step_limit_mm(const struct segmenter *s, int depth_mm)
{
    // Two readings of one surface differ by noise (3 sigma of a difference) or by
    // slope (a surface up to 76 degrees off the picture plane).
    double z = depth_mm * 0.001, noise = 3 * 1.4142 * depth_sigma_m(z), slope = 4 * z * s->step / s->lens.fx;
    return (int)(1000 * (fmax(noise, slope) + 0.005));
}

static void fill_tables(struct segmenter *s)
{
    for (int d = 0; d < DEPTH_TABLE_SIZE; d++) {
        s->max_step_mm[d] = (uint16_t)depth_step_limit_mm(s, d);
        s->noise_mm[d] = (uint16_t)(1000 * (3 * 1.4142 * depth_sigma_m(d * 0.001) + 0.01));
    }
    s->step_slope_16 = (int)fmin(65536 * 4 * s->step / s->lens.fx, INT16_MAX);
    int front = 0;
    for (int b = 0; b <= UINT16_MAX; b++) { // both rise together
        while (front < b && (front + 1) * 0.001 <= b * 0.001 - (3 * depth_sigma_m((front + 1) * 0.001) + 0.02))
            front++;
        s->front_limit[b] = (uint16_t)(b ? front : UINT16_MAX);
    }
}

// By the floor and what is given: up to which depth a cell may be the person. Where a ray runs down, the
// height over the floor falls faster with depth than its doubt grows.
static void compute_depth_limits(struct segmenter *s)
{
    for (int i = 0; i < s->width * s->height; i++) {
        int low = s->front_limit[s->known_background[i]];
        if (s->have_floor) {
            double slant = v3_dot(s->up, v3((double)s->ray[i].x, (double)s->ray[i].y, 1)); // height a metre of depth
            int high = low + 1;
            for (low = 0; high - low > 1;) {
                int d = (low + high) / 2;
                double z = d * 0.001;
                if (slant * z + s->height_m < 0.02 + 3 * depth_sigma_m(z) * fabs(slant))
                    high = d;
                else
                    low = d;
            }
        }
        s->static_limit[i] = (uint16_t)low;
        segmenter_update_limit(s, i);
    }
}

enum status segmenter_open(struct segmenter **out, const struct lens *lens)
{
    *out = NULL;
    enum status status = lens_check(lens, "depth");
    if (status != OK)
        return status;
    struct segmenter *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "not enough memory to segment depth pictures");
    s->lens = *lens;
    s->step = (lens->width + COLUMNS_MAX - 1) / COLUMNS_MAX;
    s->width = (lens->width + s->step - 1) / s->step;
    s->height = (lens->height + s->step - 1) / s->step;
    size_t n = (size_t)s->width * (size_t)s->height;
    s->ray = calloc(n, sizeof *s->ray);
    s->depth = calloc(n, sizeof *s->depth);
    s->label = calloc(n, sizeof *s->label);
    s->parent = calloc(n, sizeof *s->parent);
    s->candidate = calloc(n, sizeof *s->candidate);
    s->background = calloc(n, sizeof *s->background);
    s->observed_count = calloc(n, 1);
    s->nearer_count = calloc(n, 1);
    s->known_background = calloc(n, sizeof *s->known_background);
    s->static_limit = calloc(n, sizeof *s->static_limit);
    s->depth_limit = calloc(n, sizeof *s->depth_limit);
    s->front_limit = calloc(UINT16_MAX + 1, sizeof *s->front_limit);
    s->person = calloc(n, 1);
    s->previous = calloc(n, 1);
    s->mean_depth = calloc(n, sizeof *s->mean_depth);
    s->mean_count = calloc(n, 1);
    s->mean_updated = calloc(n, sizeof *s->mean_updated);
    if (!s->ray || !s->depth || !s->label || !s->parent || !s->candidate || !s->background || !s->observed_count ||
        !s->nearer_count || !s->known_background || !s->static_limit || !s->depth_limit || !s->front_limit ||
        !s->person || !s->previous || !s->mean_depth || !s->mean_count || !s->mean_updated) {
        segmenter_close(&s);
        return fail(ERR_MEMORY, "not enough memory to segment depth pictures of %d x %d", lens->width, lens->height);
    }
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            double middle = (s->step - 1) / 2.0;
            struct vec3 r = lens_ray(lens, (struct pixel){x * s->step + middle, y * s->step + middle});
            s->ray[y * s->width + x] = (struct grid_ray){(float)r.x, (float)r.y};
        }
    fill_tables(s);
    s->up = v3(0, -1, 0);
    compute_depth_limits(s);
    *out = s;
    return OK;
}

void segmenter_close(struct segmenter **s)
{
    if (!*s)
        return;
    free((*s)->ray);
    free((*s)->depth);
    free((*s)->label);
    free((*s)->parent);
    free((*s)->candidate);
    free((*s)->background);
    free((*s)->observed_count);
    free((*s)->nearer_count);
    free((*s)->known_background);
    free((*s)->static_limit);
    free((*s)->depth_limit);
    free((*s)->front_limit);
    free((*s)->person);
    free((*s)->previous);
    free((*s)->mean_depth);
    free((*s)->mean_count);
    free((*s)->mean_updated);
    free((*s)->components);
    free(*s);
    *s = NULL;
}

void segmenter_drop_person(struct segmenter *s)
{
    s->following = false;
    s->static_frames = 0;
    s->update_count++; // what was known of their cells is not known any more
    memset(s->previous, 0, (size_t)s->width * (size_t)s->height);
}

void segmenter_reset(struct segmenter *s)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    segmenter_drop_person(s);
    memset(s->background, 0, n * sizeof *s->background);
    memset(s->observed_count, 0, n);
    memset(s->nearer_count, 0, n);
    if (!s->floor_given) {
        s->have_floor = false;
        s->up = v3(0, -1, 0);
        s->height_m = 0;
    }
    s->floor_tries = 0;
    compute_depth_limits(s);
}

// A cell's depth: the first reading of its pixels, its first pixel first.
static uint16_t cell_depth(const struct segmenter *s, const uint16_t *image, int x, int y)
{
    for (int j = 0; j < s->step; j++)
        for (int i = 0; i < s->step; i++) {
            int px = x * s->step + i, py = y * s->step + j;
            if (px < s->lens.width && py < s->lens.height && image[py * s->lens.width + px])
                return image[py * s->lens.width + px];
        }
    return 0;
}

void segmenter_set_background(struct segmenter *s, const uint16_t *depth)
{
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++)
            s->known_background[y * s->width + x] = depth ? cell_depth(s, depth, x, y) : 0;
    compute_depth_limits(s);
}

void segmenter_set_floor(struct segmenter *s, struct vec3 up, double height_m)
{
    s->up = v3_unit(up);
    s->height_m = height_m;
    s->have_floor = s->floor_given = true;
    compute_depth_limits(s);
}

bool segmenter_floor(const struct segmenter *s, struct vec3 *up, double *height_m)
{
    *up = s->up;
    *height_m = s->height_m;
    return s->have_floor;
}

static struct vec3 cell_point(const struct segmenter *s, int i, double z)
{
    return v3((double)s->ray[i].x * z, (double)s->ray[i].y * z, z);
}

// Lies in the air between two surfaces; a, b: the cells on both sides.
static bool is_flying(int a, int d, int b, int far)
{
    return a && b && ((a - d > far && d - b > far) || (d - a > far && b - d > far));
}

static void read_row(const struct segmenter *s, const uint16_t *image, int y, uint16_t out[COLUMNS_MAX])
{
    if (y >= s->height)
        return;
    const uint16_t *row = image + (size_t)y * (size_t)s->step * (size_t)s->lens.width;
    for (int x = 0; x < s->width; x++)
        out[x] = row[x * s->step] ? row[x * s->step] : cell_depth(s, image, x, y);
}

// Reads the cells and drops those that lie in the air between two surfaces.
static void read_cells(struct segmenter *s, const uint16_t *image)
{
    uint16_t rows[3][COLUMNS_MAX];
    int w = s->width;
    read_row(s, image, 0, rows[0]);
    for (int y = 0; y < s->height; y++) {
        read_row(s, image, y + 1, rows[(y + 1) % 3]);
        bool inner = y > 0 && y < s->height - 1;
        const uint16_t *here = rows[y % 3], *above = inner ? rows[(y + 2) % 3] : here,
                       *below = inner ? rows[(y + 1) % 3] : here;
        uint16_t *out = s->depth + y * w;
        for (int x = 0; x < w; x++) {
            int d = here[x], left = x > 0 && x < w - 1 ? here[x - 1] : d, right = x > 0 && x < w - 1 ? here[x + 1] : d,
                up = above[x], down = below[x];
            int least = 2 * (d * s->step_slope_16 >> 16); // between two cells on both sides, if one in the middle flies
            out[x] = (uint16_t)d;
            if (!d || (abs(left - right) <= least && abs(up - down) <= least))
                continue;
            int far = by_depth(s->max_step_mm, d);
            if (is_flying(left, d, right, far) || is_flying(up, d, down, far))
                out[x] = 0;
        }
    }
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

// Labels the components of continuous depth among the cells that may be person.
static enum status label_components(struct segmenter *s)
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
            if (x > 1 && !s->depth[i - 1]) // over a gap of one cell
                union_cells(s, i, i - 2);
            if (y > 0)
                union_cells(s, i, i - w);
            if (y > 1 && !s->depth[i - w])
                union_cells(s, i, i - 2 * w);
        }
    s->component_count = 0;
    for (int k = 0; k < s->candidate_count; k++) { // roots come first, so every label before is final
        int i = s->candidate[k];
        if (find_root(s->parent, i) == i) {
            if (s->component_count == s->component_capacity) {
                int capacity = s->component_capacity ? 2 * s->component_capacity : 256;
                struct component *more = realloc(s->components, (size_t)capacity * sizeof *more);
                if (!more)
                    return fail(ERR_MEMORY, "not enough memory for %d parts of a depth picture", capacity);
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

// Two level axes: across and away.
static void horizontal_axes(const struct segmenter *s, struct vec3 *across, struct vec3 *away)
{
    *across = v3_unit(v3_cross(v3(0, 0, 1), v3_scale(s->up, -1)));
    *across = v3_scale(*across, across->x < 0 ? -1 : 1);
    *away = v3_unit(v3_cross(*across, v3_scale(s->up, -1)));
}

static void clear_components(struct segmenter *s)
{
    for (int c = 0; c < s->component_count; c++)
        s->components[c] =
            (struct component){.top = -1e9, .bottom = 1e9, .low = {1e9, 1e9, 1e9}, .high = {-1e9, -1e9, -1e9}};
}

// How many cells each component has, and how many of them are close to the spheres.
static void count_near_body(struct segmenter *s, const struct bounding_sphere *spheres, int sphere_count)
{
    clear_components(s);
    // The spheres' common sphere spares most cells the search.
    struct vec3 middle = v3(0, 0, 0);
    double reach = 0;
    int last = 0;
    for (int b = 0; b < sphere_count; b++)
        middle = v3_add(middle, v3_scale(spheres[b].centre, 1.0 / sphere_count));
    for (int b = 0; b < sphere_count; b++)
        reach = fmax(reach, v3_distance(middle, spheres[b].centre) + spheres[b].radius + 0.2);
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        struct component *c = &s->components[s->label[i]];
        double z = s->depth[i] * 0.001, margin = 0.10 + 2 * depth_sigma_m(z);
        struct vec3 p = cell_point(s, i, z), far = v3_sub(p, middle);
        c->cells++;
        if (!(v3_dot(far, far) < reach * reach))
            continue;
        for (int k = -1; k < sphere_count; k++) {
            int b = k < 0 ? last : k; // a neighbour's first
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

static void measure_components(struct segmenter *s)
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
    double *edge = malloc((size_t)(s->component_count + 1) * 2 * sizeof *edge);
    if (!edge)
        return; // without widths every component counts as narrow
    for (int c = 0; c < s->component_count; c++)
        edge[2 * c] = 1e9, edge[2 * c + 1] = -1e9;
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        double z = s->depth[i] * 0.001;
        struct vec3 p = cell_point(s, i, z);
        int c = s->label[i];
        if (v3_dot(s->up, p) + s->height_m > s->components[c].top - 0.2) {
            edge[2 * c] = fmin(edge[2 * c], v3_dot(across, p));
            edge[2 * c + 1] = fmax(edge[2 * c + 1], v3_dot(across, p));
        }
    }
    for (int c = 0; c < s->component_count; c++)
        s->components[c].top_width = fmax(0, edge[2 * c + 1] - edge[2 * c]);
    free(edge);
}

// How like a person a component is, 0 = not at all. A person is 0.4 m high at
// least (cut by the picture's edge) and 2.4 m at most with the arms up, stands
// on the floor or is cut off below, is narrower on top than a cupboard, and no
// wall runs from edge to edge.
static double person_score(const struct segmenter *s, const struct component *c)
{
    double tall = c->top - c->bottom, wide = c->high[0] - c->low[0], deep = c->high[1] - c->low[1];
    if (c->area_m2 < 0.12 || c->area_m2 > 2.2 || tall < 0.4 || tall > 2.5 || wide > 2.3 || deep > 1.8)
        return 0;
    if (c->border_left && c->border_right)
        return 0;
    bool cut = c->border_bottom > 0;
    if (!cut && tall < 0.8)
        return 0;
    if (s->have_floor && !cut && c->bottom > 1.0)
        return 0;
    double score = s->have_floor && !cut && c->bottom > 0.5 ? 0.5 : 1; // legs hidden, or parted by a hem
    score *= c->top_width < 0.45 ? 1 : fmax(0.05, 1 - 3 * (c->top_width - 0.45));
    score *= fmin(1, tall / 1.3) * fmin(1, c->area_m2 / 0.35);
    double x = c->sum[0] / c->cells, z = c->sum[2] / c->cells;
    score *= 1 / (1 + 0.15 * fabs(x) + 0.1 * fabs(z - 2)); // the one in the middle, not too far
    if (c->border_left || c->border_right)
        score *= 0.6;
    if (tall / fmax(wide, 0.1) < 0.7)
        score *= 0.3;
    return score;
}

static int choose_main(const struct segmenter *s, int sphere_count)
{
    int best = -1;
    double most = 0;
    for (int c = 0; c < s->component_count; c++) {
        const struct component *k = &s->components[c];
        double score;
        if (sphere_count)
            score = k->near_body > 20 && k->near_body > 0.15 * k->cells ? k->near_body : 0;
        else if (s->following)
            score = k->overlap > 20 && k->area_m2 < 2.5 ? k->overlap : 0;
        else
            score = person_score(s, k);
        if (score > most) {
            most = score;
            best = c;
        }
    }
    return best;
}

// Counts, for every other component, the cells beside the person's so far: an
// arm held forward is cut off by the jump in depth, and a head behind that arm.
static void count_adjacent(struct segmenter *s)
{
    int w = s->width;
    for (int c = 0; c < s->component_count; c++)
        s->components[c].adjacent = 0;
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n], c = s->label[i], x = i % w, y = i / w;
        if (s->components[c].is_person)
            continue;
        int reach = 3; // over the shadow that a near limb throws
        bool found = false;
        for (int k = 1; k <= reach && !found; k++) {
            int at[4] = {x >= k ? i - k : -1, x + k < w ? i + k : -1, y >= k ? i - k * w : -1,
                         y + k < s->height ? i + k * w : -1};
            for (int q = 0; q < 4 && !found; q++)
                found = at[q] >= 0 && s->label[at[q]] >= 0 && s->components[s->label[at[q]]].is_person &&
                        abs(s->depth[at[q]] - s->depth[i]) < 800;
        }
        s->components[c].adjacent += found;
    }
}

static bool belongs(const struct segmenter *s, const struct component *c, const struct component *main,
                    int sphere_count)
{
    if (c->cells < 4)
        return false;
    if (sphere_count)
        return c->near_body > 0.5 * c->cells || (c->adjacent > 0.12 * c->cells && c->near_body > 0.1 * c->cells);
    double away[3];
    for (int k = 0; k < 3; k++)
        away[k] = c->sum[k] / c->cells - main->sum[k] / main->cells;
    // As large as the main part: somebody else, unless both are in one place, parted by an arm before them.
    bool stacked =
        fabs(away[0]) < 0.3 && fabs(away[2]) < 0.3 && fmax(c->top, main->top) - fmin(c->bottom, main->bottom) < 2.4;
    if (c->area_m2 > 0.6 * main->area_m2 && !stacked)
        return false;
    if (fabs(away[2]) > 0.9 || fabs(away[0]) > 1.1)
        return false;
    if (s->have_floor && c->top < 0.15)
        return c->adjacent > 0;
    return c->adjacent > 3 || c->adjacent > 0.1 * c->cells;
}

static void try_floor(struct segmenter *s)
{
    if (s->have_floor || s->floor_tries > 30)
        return;
    s->floor_tries++;
    struct floor_plane plane;
    if (floor_plane_fit(s->depth, s->ray, s->width, s->height, &plane)) {
        s->have_floor = true;
        s->up = plane.up;
        s->height_m = plane.height_m;
        compute_depth_limits(s);
    }
}

// The person's cells: the main component's and those that belong to it.
static void collect_person_cells(struct segmenter *s, int main, int sphere_count)
{
    s->components[main].is_person = true;
    bool more = true;
    for (int round = 0; round < 3 && more; round++) { // a hand on an arm on the body
        more = false;
        count_adjacent(s);
        for (int c = 0; c < s->component_count; c++)
            if (!s->components[c].is_person && belongs(s, &s->components[c], &s->components[main], sphere_count))
                s->components[c].is_person = more = true;
    }
    for (int n = 0; n < s->candidate_count; n++)
        s->person[s->candidate[n]] = s->components[s->label[s->candidate[n]]].is_person;
}

enum status segmenter_next(struct segmenter *s, const uint16_t *image, const struct bounding_sphere *spheres,
                           int sphere_count, uint8_t *mask)
{
    memset(mask, 0, (size_t)s->lens.width * (size_t)s->lens.height);
    read_cells(s, image);
    s->bounds = find_image_bounds(image, &s->lens);
    try_floor(s);
    enum status status = label_components(s);
    if (status != OK)
        return status;
    if (sphere_count)
        count_near_body(s, spheres, sphere_count);
    else
        measure_components(s);
    int main = choose_main(s, sphere_count);
    memset(s->person, 0, (size_t)s->width * (size_t)s->height);
    if (main < 0)
        return NOTHING;
    collect_person_cells(s, main, sphere_count);
    segmenter_upsample_mask(s, image, mask);
    memcpy(s->previous, s->person, (size_t)s->width * (size_t)s->height);
    s->following = true;
    return OK;
}

#define PERSON_SCORE_MIN 0.4 // who is a metre aside and cut by the picture's edge is still as like a person

enum status segmenter_second_person(struct segmenter *s, const uint16_t *image, uint8_t *mask)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    int best = -1;
    double most = PERSON_SCORE_MIN;
    memset(mask, 0, (size_t)s->lens.width * (size_t)s->lens.height);
    measure_components(s);
    for (int c = 0; c < s->component_count; c++)
        if (!s->components[c].overlap && person_score(s, &s->components[c]) > most)
            most = person_score(s, &s->components[best = c]);
    if (best < 0)
        return NOTHING;
    memset(s->person, 0, n);
    collect_person_cells(s, best, 0);
    segmenter_upsample_mask(s, image, mask);
    memcpy(s->person, s->previous, n); // the one who is followed stays that
    return OK;
}
