#include "capture/segmentation/segment.h"

#include "base/depth_noise.h"
#include "base/floor_plane.h"
#include "capture/segmentation/image_bounds.h"

#include <stdlib.h>
#include <string.h>

enum {
    COLUMNS_MAX = 320,
    DEPTH_TABLE_SIZE = 10001, // depths whose jump and noise are looked up, mm
    // Updates at 15 Hz (every second frame of 30 Hz), chosen by hand:
    CONFIRMED_FRAMES = 3,    // a background value is used after so many samples
    REPLACEMENT_FRAMES = 24, // something nearer that stays this long (1.6 s) becomes background
};

struct segmenter {
    struct lens lens;
    int step, width, height;                // grid: pixels a cell, cells
    struct grid_ray *ray;                   // per cell: the ray's x/z, y/z
    uint16_t max_step_mm[DEPTH_TABLE_SIZE]; // by depth: how far two neighbouring samples of one surface may differ
    uint16_t noise_mm[DEPTH_TABLE_SIZE];    // by depth: how far two samples of one cell's surface may differ
    int step_slope_16;                      // max_step_mm[d] is at least d * step_slope_16 / 65536
    uint16_t *depth;                        // per cell, mm, flying pixels removed
    int32_t *label;                         // per cell: component, -1 none
    int32_t *parent;                        // union-find
    int32_t *candidate;                     // the cells that may be the person, in raster order
    int candidate_count;
    uint16_t *background; // per cell, learned; 0 unknown
    uint8_t *observed_count, *nearer_count;
    uint16_t *known_background; // per cell, set by the caller; 0 unknown
    uint16_t *static_limit;     // per cell: the largest depth in front of the floor and of known_background, mm
    uint16_t *depth_limit;      // the same, and in front of the learned background: up to there it may be the person
    uint16_t *front_limit;      // by a surface's depth, mm: the largest depth that is significantly in front of it
    uint8_t *person, *previous; // per cell: this frame's person, and the last one's
    float *mean_depth;          // per cell: running mean of the person's depth there, mm
    uint8_t *mean_count;        // number of consecutive samples in that mean
    int32_t *mean_updated, update_count; // the update in which a cell's mean was last used; number of updates
    int static_frames;                   // number of consecutive updates in which no part of the person moved
    struct component *components;
    int component_count, component_capacity;
    bool have_floor, floor_given, following;
    struct vec3 up;
    double height_m;
    int floor_tries;
    struct image_bounds bounds; // of this frame
};

struct component {
    int cells;
    double area_m2;
    double top, bottom;     // along up, metres (over the floor when known)
    double low[3], high[3]; // bounds: lateral, horizontal distance, and depth along z
    double sum[3];          // of the points
    int border_left, border_right, border_bottom, border_top;
    int overlap;                         // cells that were the person's in the last frame
    int near_body;                       // cells close to the predicted body
    int adjacent;                        // cells next to cells already taken for the person
    bool is_person;                      // it is the person, or a part of the person
    bool was_candidate;                  // it was returned for this frame
    double top_low, top_high, top_width; // lateral bounds and extent within 0.2 m of its top
};

static inline int by_depth(const uint16_t table[DEPTH_TABLE_SIZE], int depth_mm)
{
    return table[depth_mm < DEPTH_TABLE_SIZE ? depth_mm : DEPTH_TABLE_SIZE - 1];
}

// To be called where a cell's background changed: sets its depth_limit.
static inline void segmenter_update_limit(struct segmenter *segmenter, int i)
{
    int front = segmenter->observed_count[i] >= CONFIRMED_FRAMES ? segmenter->front_limit[segmenter->background[i]]
                                                                 : UINT16_MAX;
    segmenter->depth_limit[i] = (uint16_t)(front < segmenter->static_limit[i] ? front : segmenter->static_limit[i]);
}

// In front of everything that is known not to be the person.
static inline bool may_be_person(const struct segmenter *segmenter, int i, int depth_mm)
{
    return depth_mm <= segmenter->depth_limit[i];
}

static void segmenter_detect_motion(struct segmenter *segmenter);

// ---------------------------------------------------------------- background model

// The background model: a running mean of the empty room's depth in each cell, updated outside the person.

// Grid cells, of 2 pixels at 640 columns; chosen by hand.
enum {
    PERSON_MARGIN = 4,      // hair, flying pixels and depth shadows around the person are no background
    BOUNDS_MARGIN = 8,      // around the person's bounding box, within which only clearly farther depth is learned
    BOUNDS_MARGIN_DOWN = 4, // the same below it
    BEHIND_MM = 400,        // clearly farther: this much behind the person's farthest cell
    MEAN_FRAMES = 30,       // window of the running mean
    MOVED_CELLS_MIN = 500,  // a moved sensor is judged by at least so many known cells,
};
#define MOVED_SHARE 0.4 // of which more than this share disagree

struct cell_box { // cells, inclusive
    int left, top, right, bottom;
};

// label[] becomes positive within PERSON_MARGIN cells of the person, along the rows and then down the columns, else 0.
static void dilate_person(struct segmenter *segmenter, struct cell_box person)
{
    int w = segmenter->width, h = segmenter->height;
    memset(segmenter->label, 0, (size_t)w * (size_t)h * sizeof *segmenter->label);
    int x0 = person.left > PERSON_MARGIN ? person.left - PERSON_MARGIN : 0,
        x1 = person.right + PERSON_MARGIN < w ? person.right + PERSON_MARGIN : w - 1,
        y0 = person.top > PERSON_MARGIN ? person.top - PERSON_MARGIN : 0,
        y1 = person.bottom + PERSON_MARGIN < h ? person.bottom + PERSON_MARGIN : h - 1;
    for (int y = person.top; y <= person.bottom;
         y++) { // distance along the row to the nearest cell of the person, from the left and from the right
        int far = PERSON_MARGIN + 1;
        for (int x = person.left; x <= x1; x++) {
            far = segmenter->person[y * w + x] ? 0 : far + 1;
            segmenter->label[y * w + x] = far <= PERSON_MARGIN;
        }
        far = PERSON_MARGIN + 1;
        for (int x = person.right; x >= x0; x--) {
            far = segmenter->person[y * w + x] ? 0 : far + 1;
            segmenter->label[y * w + x] |= far <= PERSON_MARGIN;
        }
    }
    // Down the columns, row by row; parent[] holds the distance to the last marked row.
    for (int x = x0; x <= x1; x++)
        segmenter->parent[x] = PERSON_MARGIN + 1;
    for (int y = person.top; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            segmenter->parent[x] = segmenter->label[y * w + x] & 1 ? 0 : segmenter->parent[x] + 1;
            segmenter->label[y * w + x] |= 2 * (segmenter->parent[x] <= PERSON_MARGIN);
        }
    for (int x = x0; x <= x1; x++)
        segmenter->parent[x] = PERSON_MARGIN + 1;
    for (int y = person.bottom; y >= y0; y--)
        for (int x = x0; x <= x1; x++) {
            segmenter->parent[x] = segmenter->label[y * w + x] & 1 ? 0 : segmenter->parent[x] + 1;
            segmenter->label[y * w + x] |= 2 * (segmenter->parent[x] <= PERSON_MARGIN);
        }
}

// Updates a cell by one depth sample. Returns 1: it agrees with the background, -1: it does not, 0: none was known.
static int update_background_cell(struct segmenter *segmenter, int i, int d)
{
    int b = segmenter->background[i], same = by_depth(segmenter->noise_mm, d);
    if (b && d <= b + same && d >= b - same) {
        int n = segmenter->observed_count[i] < MEAN_FRAMES ? segmenter->observed_count[i] : MEAN_FRAMES;
        segmenter->background[i] = (uint16_t)((b * n + d + (n + 1) / 2) / (n + 1));
        segmenter->observed_count[i] += segmenter->observed_count[i] < 255;
        segmenter->nearer_count[i] = 0;
    } else if (!b || d > b ||
               ++segmenter->nearer_count[i] >=
                   REPLACEMENT_FRAMES) { // farther than the background replaces it immediately
        segmenter->background[i] = (uint16_t)d;
        segmenter->observed_count[i] = 1;
        segmenter->nearer_count[i] = 0;
    }
    segmenter_update_limit(segmenter, i);
    if (!b)
        return 0;
    return d <= b + same && d >= b - same ? 1 : -1;
}

void segmenter_update_background(struct segmenter *segmenter)
{
    int disagree = 0, known = 0, far = 0;
    segmenter_detect_motion(segmenter);
    struct cell_box person = {segmenter->width, segmenter->height, -1, -1};
    for (int n = 0; n < segmenter->candidate_count; n++)
        if (segmenter->person[segmenter->candidate[n]]) {
            int i = segmenter->candidate[n], x = i % segmenter->width, y = i / segmenter->width;
            person.left = x < person.left ? x : person.left, person.right = x > person.right ? x : person.right;
            person.top = y < person.top ? y : person.top, person.bottom = y;
            far = segmenter->depth[i] > far ? segmenter->depth[i] : far;
        }
    dilate_person(segmenter, person);
    for (int y = 0; y < segmenter->height; y++)
        for (int x = 0; x < segmenter->width; x++) {
            int i = y * segmenter->width + x, d = segmenter->depth[i];
            if (!d || segmenter->label[i])
                continue;
            // Inside the person's bounds only depth clearly behind the person is learned: the rest may be a part of
            // the person that the mask lost.
            if (d < far + BEHIND_MM && x > person.left - BOUNDS_MARGIN && x < person.right + BOUNDS_MARGIN &&
                y > person.top - BOUNDS_MARGIN && y < person.bottom + BOUNDS_MARGIN_DOWN)
                continue;
            int agreement = update_background_cell(segmenter, i, d);
            known += agreement != 0;
            disagree += agreement < 0;
        }
    if (known > MOVED_CELLS_MIN && disagree > MOVED_SHARE * known) { // the sensor was moved: start from scratch
        size_t n = (size_t)segmenter->width * (size_t)segmenter->height;
        memset(segmenter->background, 0, n * sizeof *segmenter->background);
        memset(segmenter->observed_count, 0, n);
        memcpy(segmenter->depth_limit, segmenter->static_limit, n * sizeof *segmenter->depth_limit);
    }
}

// ---------------------------------------------------------------- mask upsample

// Upsamples the grid's mask to pixels: a pixel joins the person if its depth continues a neighbouring cell's.

// Marks the pixels of cell (x, y) whose depth continues that of the person's cells around it, its own first.
static void upsample_cell(const struct segmenter *segmenter, const uint16_t *image, int x, int y, uint8_t *mask)
{
    int neighbor_mm[9], count = 0, w = segmenter->width, centre = y * w + x;
    if (segmenter->person[centre])
        neighbor_mm[count++] = segmenter->depth[centre];
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++)
            if ((i || j) && x + i >= 0 && x + i < w && y + j >= 0 && y + j < segmenter->height &&
                segmenter->person[centre + j * w + i])
                neighbor_mm[count++] = segmenter->depth[centre + j * w + i];
    if (!count || (!segmenter->person[centre] && segmenter->step == 1))
        return;
    for (int j = 0; j < segmenter->step; j++)
        for (int i = 0; i < segmenter->step; i++) {
            int px = x * segmenter->step + i, py = y * segmenter->step + j;
            if (px >= segmenter->lens.width || py >= segmenter->lens.height)
                continue;
            int d = image[py * segmenter->lens.width + px];
            if (!d || (!segmenter->person[centre] && !may_be_person(segmenter, centre, d)))
                continue;
            int limit = by_depth(segmenter->max_step_mm, d);
            for (int k = 0; k < count; k++)
                if (abs(neighbor_mm[k] - d) <= limit) {
                    mask[py * segmenter->lens.width + px] = 255;
                    break;
                }
        }
}

// Upsamples the person's cells to every pixel; mask must be all 0.
static void segmenter_upsample_mask(const struct segmenter *segmenter, const uint16_t *image, uint8_t *mask)
{
    int w = segmenter->width, left[3] = {w, w, w}, right[3] = {-1, -1, -1}; // of the person, in three neighbouring rows
    for (int y = -1; y < segmenter->height; y++) {
        int next = (y + 2) % 3;
        left[next] = w;
        right[next] = -1;
        const uint8_t *row = segmenter->person + (y + 1) * w,
                      *first = y + 1 < segmenter->height ? memchr(row, 1, (size_t)w) : NULL;
        if (first) {
            left[next] = (int)(first - row);
            for (right[next] = w - 1; !row[right[next]];)
                right[next]--;
        }
        int from = left[0] < left[1] ? left[0] : left[1], to = right[0] > right[1] ? right[0] : right[1];
        from = from < left[2] ? from : left[2];
        to = to > right[2] ? to : right[2];
        for (int x = from > 0 ? from - 1 : 0; y >= 0 && x <= to + 1 && x < w; x++)
            upsample_cell(segmenter, image, x, y, mask);
    }
}

// ---------------------------------------------------------------- segment components

// Components of continuous depth among the cells that may be the person, and their measures.

// Chosen by hand.
static const double NEAR_BODY_M = 0.10;   // a cell this close to a sphere, and twice the noise, is near the body
static const double REACH_MARGIN_M = 0.2; // more than NEAR_BODY_M and twice the noise at the farthest depth in use
static const double TOP_M = 0.2;          // the height over which a component's top width is measured

static struct vec3 cell_point(const struct segmenter *segmenter, int i, double z)
{
    return v3((double)segmenter->ray[i].x * z, (double)segmenter->ray[i].y * z, z);
}

static int find_root(int32_t *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void union_cells(struct segmenter *segmenter, int a, int b)
{
    int za = segmenter->depth[a], zb = segmenter->depth[b];
    if (!zb || segmenter->label[b] < 0 || abs(za - zb) > by_depth(segmenter->max_step_mm, za < zb ? za : zb))
        return;
    a = find_root(segmenter->parent, a);
    b = find_root(segmenter->parent, b);
    if (a != b)
        segmenter->parent[a < b ? b : a] = a < b ? a : b;
}

// Labels the components of continuous depth among the cells that may be the person. ERR_MEMORY.
static enum status segmenter_label_components(struct segmenter *segmenter)
{
    int w = segmenter->width;
    segmenter->candidate_count = 0;
    for (int y = 0; y < segmenter->height; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x;
            if (!segmenter->depth[i] || !may_be_person(segmenter, i, segmenter->depth[i])) {
                segmenter->label[i] = -1;
                continue;
            }
            segmenter->label[i] = 0;
            segmenter->parent[i] = i;
            segmenter->candidate[segmenter->candidate_count++] = i;
            if (x > 0)
                union_cells(segmenter, i, i - 1);
            if (x > 1 && !segmenter->depth[i - 1]) // across a gap of one cell
                union_cells(segmenter, i, i - 2);
            if (y > 0)
                union_cells(segmenter, i, i - w);
            if (y > 1 && !segmenter->depth[i - w])
                union_cells(segmenter, i, i - 2 * w);
        }
    segmenter->component_count = 0;
    for (int k = 0; k < segmenter->candidate_count; k++) { // a root precedes its cells, so its label is final
        int i = segmenter->candidate[k];
        if (find_root(segmenter->parent, i) == i) {
            if (segmenter->component_count == segmenter->component_capacity) {
                int capacity = segmenter->component_capacity ? 2 * segmenter->component_capacity : 256;
                struct component *more = realloc(segmenter->components, (size_t)capacity * sizeof *more);
                if (!more)
                    return fail(ERR_MEMORY, "not enough memory for %d components of a depth image", capacity);
                segmenter->components = more;
                segmenter->component_capacity = capacity;
            }
            segmenter->label[i] = segmenter->component_count++;
        } else {
            segmenter->label[i] = segmenter->label[find_root(segmenter->parent, i)];
        }
    }
    return OK;
}

// Two horizontal axes: lateral, and away from the camera.
static void horizontal_axes(const struct segmenter *segmenter, struct vec3 *across, struct vec3 *away)
{
    *across = v3_unit(v3_cross(v3(0, 0, 1), v3_scale(segmenter->up, -1)));
    *across = v3_scale(*across, across->x < 0 ? -1 : 1);
    *away = v3_unit(v3_cross(*across, v3_scale(segmenter->up, -1)));
}

static void clear_components(struct segmenter *segmenter)
{
    for (int c = 0; c < segmenter->component_count; c++)
        segmenter->components[c] = (struct component){.top = -1e9,
                                                      .bottom = 1e9,
                                                      .low = {1e9, 1e9, 1e9},
                                                      .high = {-1e9, -1e9, -1e9},
                                                      .top_low = 1e9,
                                                      .top_high = -1e9};
}

// Counts each component's cells, and those of them that are close to the spheres.
static void segmenter_count_near_body(struct segmenter *segmenter, const struct bounding_sphere *spheres,
                                      int sphere_count)
{
    clear_components(segmenter);
    // One sphere around all spheres rejects most cells early.
    struct vec3 middle = v3(0, 0, 0);
    double reach = 0;
    int last = 0;
    for (int b = 0; b < sphere_count; b++)
        middle = v3_add(middle, v3_scale(spheres[b].centre, 1.0 / sphere_count));
    for (int b = 0; b < sphere_count; b++)
        reach = fmax(reach, v3_distance(middle, spheres[b].centre) + spheres[b].radius + REACH_MARGIN_M);
    for (int n = 0; n < segmenter->candidate_count; n++) {
        int i = segmenter->candidate[n];
        struct component *c = &segmenter->components[segmenter->label[i]];
        double z = segmenter->depth[i] * 0.001, margin = NEAR_BODY_M + 2 * depth_sigma_m(z);
        struct vec3 p = cell_point(segmenter, i, z), far = v3_sub(p, middle);
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
static void measure_top_widths(struct segmenter *segmenter, struct vec3 across)
{
    for (int n = 0; n < segmenter->candidate_count; n++) {
        int i = segmenter->candidate[n];
        double z = segmenter->depth[i] * 0.001;
        struct vec3 p = cell_point(segmenter, i, z);
        struct component *c = &segmenter->components[segmenter->label[i]];
        if (v3_dot(segmenter->up, p) + segmenter->height_m > c->top - TOP_M) {
            c->top_low = fmin(c->top_low, v3_dot(across, p));
            c->top_high = fmax(c->top_high, v3_dot(across, p));
        }
    }
    for (int c = 0; c < segmenter->component_count; c++)
        segmenter->components[c].top_width =
            fmax(0, segmenter->components[c].top_high - segmenter->components[c].top_low);
}

// Fills every other measure of the components. Without memory the top widths stay 0: every top then counts as narrow.
static void segmenter_measure_components(struct segmenter *segmenter)
{
    struct vec3 across, away;
    horizontal_axes(segmenter, &across, &away);
    clear_components(segmenter);
    int w = segmenter->width;
    double cell = segmenter->step / segmenter->lens.fx;
    for (int n = 0; n < segmenter->candidate_count; n++) {
        int i = segmenter->candidate[n];
        struct component *c = &segmenter->components[segmenter->label[i]];
        double z = segmenter->depth[i] * 0.001;
        struct vec3 p = cell_point(segmenter, i, z);
        double h = v3_dot(segmenter->up, p) + segmenter->height_m, level[3] = {v3_dot(across, p), v3_dot(away, p), z};
        c->cells++;
        c->area_m2 += cell * cell * z * z;
        c->top = fmax(c->top, h);
        c->bottom = fmin(c->bottom, h);
        for (int k = 0; k < 3; k++) {
            c->low[k] = fmin(c->low[k], level[k]);
            c->high[k] = fmax(c->high[k], level[k]);
        }
        c->sum[0] += p.x, c->sum[1] += p.y, c->sum[2] += p.z;
        c->overlap += segmenter->previous[i];
        int x = i % w, y = i / w;
        c->border_left += x < segmenter->bounds.left / segmenter->step + 2;
        c->border_right += x >= segmenter->bounds.right / segmenter->step - 1;
        c->border_top += y < segmenter->bounds.top / segmenter->step + 2;
        c->border_bottom += y >= segmenter->bounds.bottom / segmenter->step - 1;
    }
    measure_top_widths(segmenter, across);
}

// Of the outline of that component, the share along which its surface continues, within max_step_mm, in cells that
// cannot be the person: a person's feet on the floor; disoccluded background nearly all round. Cell sides, 0 to 1.
static double segmenter_continued_share(const struct segmenter *segmenter, int component)
{
    const int w = segmenter->width;
    int edge = 0, continued = 0;
    for (int n = 0; n < segmenter->candidate_count; n++) {
        const int i = segmenter->candidate[n], x = i % w, y = i / w;
        if (segmenter->label[i] != component)
            continue;
        const int next[4] = {x ? i - 1 : -1, x + 1 < w ? i + 1 : -1, y ? i - w : -1,
                             y + 1 < segmenter->height ? i + w : -1};
        for (int k = 0; k < 4; k++) {
            if (next[k] < 0 || segmenter->label[next[k]] == component)
                continue;
            const int there = segmenter->depth[next[k]];
            edge++;
            continued +=
                there && segmenter->label[next[k]] < 0 &&
                abs(there - segmenter->depth[i]) <=
                    by_depth(segmenter->max_step_mm, there < segmenter->depth[i] ? there : segmenter->depth[i]);
        }
    }
    return edge ? (double)continued / edge : 0;
}

// ---------------------------------------------------------------- static object

// Static object rejection: whether any part of the person moves. People sway and breathe; what does not move at all for
// seconds is furniture that was taken for a person. Tested against the running mean of each cell's depth: the whole
// person's mean shift, and that of blocks of cells.

enum {
    BLOCK = 8, // cells of 2 pixels: an arm's width at 3 m
    BLOCKS_MAX = (COLUMNS_MAX / BLOCK + 1) * (COLUMNS_MAX / BLOCK + 1),
    MEAN_CONFIRMED = 3,   // a cell's mean is used after so many samples,
    MEAN_WINDOW = 8,      // and averages over as many
    BLOCK_CELLS_MIN = 15, // confirmed cells that a block needs
};

// Chosen by hand; real people in recordings reached 3 static frames (STATIC_FRAMES_MIN in tracker_decide.c is 12).
#define STATIC_MM           2.0 // a smaller shift is no motion: sensors drift while they warm up
#define PERSON_SIGMAS       3.0 // significance of the whole person's mean shift,
#define BLOCK_SIGMAS        4.5 // and of one block's, of which there are about a hundred
#define CONFIRMED_SHARE_MIN 0.5 // of the cells; less is motion: edges flicker, a walking person changes most cells
#define INTERIOR_SHARE      0.8 // of a block's cells: no edge of the person runs through it

struct motion_block {
    int cells, confirmed;
    double shift_mm, variance_mm2; // summed over the confirmed ones
};

static void add_motion_block(struct motion_block *to, const struct motion_block *from)
{
    to->cells += from->cells;
    to->confirmed += from->confirmed;
    to->shift_mm += from->shift_mm;
    to->variance_mm2 += from->variance_mm2;
}

static bool has_moved(const struct motion_block *block, double sigmas)
{
    return fabs(block->shift_mm) > STATIC_MM * block->confirmed + sigmas * sqrt(block->variance_mm2);
}

static bool is_interior(const struct motion_block *block)
{
    return block->confirmed >= BLOCK_CELLS_MIN && block->confirmed >= INTERIOR_SHARE * block->cells;
}

// Compares one of the person's cells with its mean, and updates that.
static struct motion_block update_cell_mean(struct segmenter *segmenter, int i)
{
    double d = segmenter->depth[i], sigma = 1000 * depth_sigma_m(0.001 * d), off = d - (double)segmenter->mean_depth[i];
    struct motion_block b = {.cells = 1};
    bool known = segmenter->mean_updated[i] && segmenter->mean_updated[i] == segmenter->update_count - 1;
    segmenter->mean_updated[i] = segmenter->update_count;
    if (!known || fabs(off) > by_depth(segmenter->noise_mm, segmenter->depth[i])) {
        segmenter->mean_depth[i] = segmenter->depth[i];
        segmenter->mean_count[i] = 1;
        return b;
    }
    if (segmenter->mean_count[i] >= MEAN_CONFIRMED)
        b = (struct motion_block){1, 1, off, sigma * sigma};
    segmenter->mean_count[i] += segmenter->mean_count[i] < MEAN_WINDOW;
    segmenter->mean_depth[i] += (float)(off / segmenter->mean_count[i]);
    return b;
}

// Compares the person's cells with their running means and updates static_frames.
static void segmenter_detect_motion(struct segmenter *segmenter)
{
    struct motion_block blocks[BLOCKS_MAX], all = {0};
    int side = BLOCK;
    while ((segmenter->width / side + 1) * (segmenter->height / side + 1) >
           BLOCKS_MAX) // an image much higher than wide
        side *= 2;
    int across = segmenter->width / side + 1, down = segmenter->height / side + 1;
    memset(blocks, 0, sizeof *blocks * (size_t)(across * down));
    segmenter->update_count++;
    for (int n = 0; n < segmenter->candidate_count; n++) {
        int i = segmenter->candidate[n];
        if (!segmenter->person[i])
            continue;
        struct motion_block cell = update_cell_mean(segmenter, i);
        add_motion_block(&blocks[i / segmenter->width / side * across + i % segmenter->width / side], &cell);
        add_motion_block(&all, &cell);
    }
    if (!all.cells) // no person, or occluded
        return;
    bool moved = all.confirmed < CONFIRMED_SHARE_MIN * all.cells || has_moved(&all, PERSON_SIGMAS);
    for (int k = 0; k < across * down && !moved; k++)
        moved = is_interior(&blocks[k]) && has_moved(&blocks[k], BLOCK_SIGMAS);
    // One frame in which a person touches the object, or an edge flickers, only halves the count.
    segmenter->static_frames = moved ? segmenter->static_frames / 2 : segmenter->static_frames + 1;
}

int segmenter_static_frames(const struct segmenter *segmenter) { return segmenter->static_frames; }

void segmenter_absorb_static(struct segmenter *segmenter)
{
    for (int i = 0; i < segmenter->width * segmenter->height; i++)
        if (segmenter->person[i] && segmenter->depth[i]) {
            segmenter->background[i] = segmenter->depth[i];
            segmenter->observed_count[i] = CONFIRMED_FRAMES;
            segmenter->nearer_count[i] = 0;
            segmenter_update_limit(segmenter, i);
        }
    segmenter_drop_person(segmenter);
}

// ---------------------------------------------------------------- segment

static const double SLOPE_MAX = 4; // depth over lateral distance: a surface up to 76 degrees off the image plane

// In front of the background, or over the floor, by this and three standard deviations. Chosen by hand.
static const double BACKGROUND_MARGIN_M = 0.02, FLOOR_MARGIN_M = 0.02;

static int depth_step_limit_mm(const struct segmenter *segmenter, int depth_mm)
{
    // Two samples of one surface differ by noise or by slope.
    double z = depth_mm * 0.001, noise = depth_difference_m(z),
           slope = SLOPE_MAX * z * segmenter->step / segmenter->lens.fx;
    return (int)(1000 * (fmax(noise, slope) + 0.005));
}

static void fill_tables(struct segmenter *segmenter)
{
    for (int d = 0; d < DEPTH_TABLE_SIZE; d++) {
        segmenter->max_step_mm[d] = (uint16_t)depth_step_limit_mm(segmenter, d);
        segmenter->noise_mm[d] = (uint16_t)(1000 * (depth_difference_m(d * 0.001) + 0.01));
    }
    segmenter->step_slope_16 = (int)fmin(65536 * SLOPE_MAX * segmenter->step / segmenter->lens.fx, INT16_MAX);
    int front = 0;
    for (int b = 0; b <= UINT16_MAX; b++) { // both increase monotonically
        while (front < b &&
               (front + 1) * 0.001 <= b * 0.001 - (3 * depth_sigma_m((front + 1) * 0.001) + BACKGROUND_MARGIN_M))
            front++;
        segmenter->front_limit[b] = (uint16_t)(b ? front : UINT16_MAX);
    }
}

// From the floor and the known background: the largest depth at which a cell may be the person. Where a ray runs down,
// the height over the floor falls faster with depth than its standard deviation grows, so that a bisection finds it.
static void compute_depth_limits(struct segmenter *segmenter)
{
    for (int i = 0; i < segmenter->width * segmenter->height; i++) {
        int low = segmenter->front_limit[segmenter->known_background[i]];
        if (segmenter->have_floor) {
            double slant = v3_dot(segmenter->up, v3((double)segmenter->ray[i].x, (double)segmenter->ray[i].y,
                                                    1)); // height a metre of depth
            int high = low + 1;
            for (low = 0; high - low > 1;) {
                int d = (low + high) / 2;
                double z = d * 0.001;
                if (slant * z + segmenter->height_m < FLOOR_MARGIN_M + 3 * depth_sigma_m(z) * fabs(slant))
                    high = d;
                else
                    low = d;
            }
        }
        segmenter->static_limit[i] = (uint16_t)low;
        segmenter_update_limit(segmenter, i);
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
        return fail(ERR_MEMORY, "not enough memory to segment depth images");
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
        return fail(ERR_MEMORY, "not enough memory to segment depth images of %d x %d", lens->width, lens->height);
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

void segmenter_close(struct segmenter **segmenter)
{
    if (!*segmenter)
        return;
    free((*segmenter)->ray);
    free((*segmenter)->depth);
    free((*segmenter)->label);
    free((*segmenter)->parent);
    free((*segmenter)->candidate);
    free((*segmenter)->background);
    free((*segmenter)->observed_count);
    free((*segmenter)->nearer_count);
    free((*segmenter)->known_background);
    free((*segmenter)->static_limit);
    free((*segmenter)->depth_limit);
    free((*segmenter)->front_limit);
    free((*segmenter)->person);
    free((*segmenter)->previous);
    free((*segmenter)->mean_depth);
    free((*segmenter)->mean_count);
    free((*segmenter)->mean_updated);
    free((*segmenter)->components);
    free(*segmenter);
    *segmenter = NULL;
}

void segmenter_drop_person(struct segmenter *segmenter)
{
    segmenter->following = false;
    segmenter->static_frames = 0;
    segmenter->update_count++; // invalidates the running means of the person's cells
    memset(segmenter->previous, 0, (size_t)segmenter->width * (size_t)segmenter->height);
}

void segmenter_reset(struct segmenter *segmenter)
{
    size_t n = (size_t)segmenter->width * (size_t)segmenter->height;
    segmenter_drop_person(segmenter);
    memset(segmenter->background, 0, n * sizeof *segmenter->background);
    memset(segmenter->observed_count, 0, n);
    memset(segmenter->nearer_count, 0, n);
    if (!segmenter->floor_given) {
        segmenter->have_floor = false;
        segmenter->up = v3(0, -1, 0);
        segmenter->height_m = 0;
    }
    segmenter->floor_tries = 0;
    compute_depth_limits(segmenter);
}

// A cell's depth: that of the first of its pixels that has any.
static uint16_t cell_depth(const struct segmenter *segmenter, const uint16_t *image, int x, int y)
{
    for (int j = 0; j < segmenter->step; j++)
        for (int i = 0; i < segmenter->step; i++) {
            int px = x * segmenter->step + i, py = y * segmenter->step + j;
            if (px < segmenter->lens.width && py < segmenter->lens.height && image[py * segmenter->lens.width + px])
                return image[py * segmenter->lens.width + px];
        }
    return 0;
}

void segmenter_set_background(struct segmenter *segmenter, const uint16_t *depth)
{
    for (int y = 0; y < segmenter->height; y++)
        for (int x = 0; x < segmenter->width; x++)
            segmenter->known_background[y * segmenter->width + x] = depth ? cell_depth(segmenter, depth, x, y) : 0;
    compute_depth_limits(segmenter);
}

void segmenter_set_floor(struct segmenter *segmenter, struct vec3 up, double height_m)
{
    segmenter->up = v3_unit(up);
    segmenter->height_m = height_m;
    segmenter->have_floor = segmenter->floor_given = true;
    compute_depth_limits(segmenter);
}

bool segmenter_floor(const struct segmenter *segmenter, struct vec3 *up, double *height_m)
{
    *up = segmenter->up;
    *height_m = segmenter->height_m;
    return segmenter->have_floor;
}

// A flying pixel lies between two surfaces. a, b: depth of the cells on both sides.
static bool is_flying(int a, int d, int b, int far)
{
    return a && b && ((a - d > far && d - b > far) || (d - a > far && b - d > far));
}

static void read_row(const struct segmenter *segmenter, const uint16_t *image, int y, uint16_t out[COLUMNS_MAX])
{
    if (y >= segmenter->height)
        return;
    const uint16_t *row = image + (size_t)y * (size_t)segmenter->step * (size_t)segmenter->lens.width;
    for (int x = 0; x < segmenter->width; x++)
        out[x] = row[x * segmenter->step] ? row[x * segmenter->step] : cell_depth(segmenter, image, x, y);
}

// Reads the cells and drops flying pixels.
static void read_cells(struct segmenter *segmenter, const uint16_t *image)
{
    uint16_t rows[3][COLUMNS_MAX];
    int w = segmenter->width;
    read_row(segmenter, image, 0, rows[0]);
    for (int y = 0; y < segmenter->height; y++) {
        read_row(segmenter, image, y + 1, rows[(y + 1) % 3]);
        bool inner = y > 0 && y < segmenter->height - 1;
        const uint16_t *here = rows[y % 3], *above = inner ? rows[(y + 2) % 3] : here,
                       *below = inner ? rows[(y + 1) % 3] : here;
        uint16_t *out = segmenter->depth + y * w;
        for (int x = 0; x < w; x++) {
            int d = here[x], left = x > 0 && x < w - 1 ? here[x - 1] : d, right = x > 0 && x < w - 1 ? here[x + 1] : d,
                up = above[x], down = below[x];
            // By this much the cells on both sides differ at least if the one in between is flying.
            int min = 2 * (d * segmenter->step_slope_16 >> 16);
            out[x] = (uint16_t)d;
            if (!d || (abs(left - right) <= min && abs(up - down) <= min))
                continue;
            int far = by_depth(segmenter->max_step_mm, d);
            if (is_flying(left, d, right, far) || is_flying(up, d, down, far))
                out[x] = 0;
        }
    }
}

// Bounds and weights of the person score. Chosen by hand for adults and children. Furniture that scores as a person is
// left to the static object rejection (docs/notes/skeleton.md counts both).
static const double AREA_MIN_M2 = 0.12, AREA_MAX_M2 = 2.2; // visible surface
static const double TALL_MIN_M = 0.12, TALL_MAX_M = 2.5;   // lying; arms up
static const double WIDE_MAX_M = 2.3, DEEP_MAX_M = 1.8;
static const double BOTTOM_MAX_M = 1.0;  // over the floor, of a person who is not cropped below
static const double LEGS_HIDDEN_M = 0.5; // a bottom higher than this scores half: legs hidden, or parted by a hem
static const double TOP_WIDTH_M = 0.45;  // head and shoulders; a wider top scores less
static const double FULL_HEIGHT_M = 1.3, FULL_AREA_M2 = 0.35;          // smaller ones score less, in proportion
static const double CENTRE_RATE = 0.15, RANGE_RATE = 0.1, RANGE_M = 2; // the one in the middle, not too far
static const double SIDE_CROPPED_RATE = 0.6;                           // factor where the image crops it at a side
static const double WIDE_RATE = 0.3, SLENDER_MIN = 0.7; // factor of what is less tall than this, by its width

// How much a component resembles a person, 0 = not at all. A wall runs from edge to edge, a cupboard is wide at the
// top.
static double person_score(const struct segmenter *segmenter, const struct component *component)
{
    double tall = component->top - component->bottom, wide = component->high[0] - component->low[0],
           deep = component->high[1] - component->low[1];
    if (component->area_m2 < AREA_MIN_M2 || component->area_m2 > AREA_MAX_M2 || tall < TALL_MIN_M ||
        tall > TALL_MAX_M || wide > WIDE_MAX_M || deep > DEEP_MAX_M)
        return 0;
    if (component->border_left && component->border_right)
        return 0;
    const bool cut = component->border_bottom > 0;
    if (segmenter->have_floor && !cut && component->bottom > BOTTOM_MAX_M)
        return 0;
    double score = segmenter->have_floor && !cut && component->bottom > LEGS_HIDDEN_M ? 0.5 : 1;
    score *= component->top_width < TOP_WIDTH_M ? 1 : fmax(0.05, 1 - 3 * (component->top_width - TOP_WIDTH_M));
    score *= fmin(1, tall / FULL_HEIGHT_M) * fmin(1, component->area_m2 / FULL_AREA_M2);
    double x = component->sum[0] / component->cells, z = component->sum[2] / component->cells;
    score *= 1 / (1 + CENTRE_RATE * fabs(x) + RANGE_RATE * fabs(z - RANGE_M));
    if (component->border_left || component->border_right)
        score *= SIDE_CROPPED_RATE;
    if (tall / fmax(wide, 0.1) < SLENDER_MIN)
        score *= WIDE_RATE;
    return score;
}

// Which components belong to the person. Chosen by hand.
enum {
    MAIN_CELLS_MIN = 20, // near the predicted body, or overlapping the last mask
    PART_CELLS_MIN = 4,
    ADJACENT_CELLS_MIN = 3,
    ADJACENT_REACH = 3, // cells: across the depth shadow that a near limb casts
    ADJACENT_MM = 800,  // an arm held forward lies at most this far in front of the trunk
    MERGE_ROUNDS = 3,   // a hand on an arm on the trunk
    FLOOR_TRIES_MAX = 30,
};
static const double MAIN_NEAR_SHARE = 0.15; // of its cells near the predicted body
static const double OVERLAP_AREA_MAX_M2 = 2.5;
static const double PART_NEAR_SHARE = 0.5;                                      // a part is mostly near the body,
static const double PART_ADJACENT_SHARE = 0.12, PART_ADJACENT_NEAR_SHARE = 0.1; // or adjacent and partly near it
static const double ADJACENT_SHARE = 0.1;
static const double STACKED_M = 0.3, STACKED_TALL_MAX_M = 2.4; // two halves of one person, parted by an arm in front
static const double OTHER_PERSON_AREA_SHARE = 0.6;
static const double PART_LATERAL_MAX_M = 1.1, PART_DEPTH_MAX_M = 0.9; // from the main component
static const double FLOOR_RIM_M = 0.15;                               // lower ones are feet only when adjacent

static int choose_main(const struct segmenter *segmenter, int sphere_count)
{
    int best = -1;
    double max = 0;
    for (int c = 0; c < segmenter->component_count; c++) {
        const struct component *component = &segmenter->components[c];
        double score;
        if (sphere_count)
            score = component->near_body > MAIN_CELLS_MIN && component->near_body > MAIN_NEAR_SHARE * component->cells
                        ? component->near_body
                        : 0;
        else if (segmenter->following)
            score = component->overlap > MAIN_CELLS_MIN && component->area_m2 < OVERLAP_AREA_MAX_M2 ? component->overlap
                                                                                                    : 0;
        else
            score = person_score(segmenter, component);
        if (score > max && !component->was_candidate) {
            max = score;
            best = c;
        }
    }
    return best;
}

// True where a cell of the person lies within ADJACENT_REACH cells and ADJACENT_MM of cell i, in its row or column.
static bool is_adjacent(const struct segmenter *segmenter, int i)
{
    int w = segmenter->width, x = i % w, y = i / w;
    for (int k = 1; k <= ADJACENT_REACH; k++) {
        int at[4] = {x >= k ? i - k : -1, x + k < w ? i + k : -1, y >= k ? i - k * w : -1,
                     y + k < segmenter->height ? i + k * w : -1};
        for (int q = 0; q < 4; q++)
            if (at[q] >= 0 && segmenter->label[at[q]] >= 0 &&
                segmenter->components[segmenter->label[at[q]]].is_person &&
                abs(segmenter->depth[at[q]] - segmenter->depth[i]) < ADJACENT_MM)
                return true;
    }
    return false;
}

// Counts, for every other component, the cells adjacent to the person's so far: an arm held forward is parted by the
// jump in depth, and so is a head behind that arm.
static void count_adjacent(struct segmenter *segmenter)
{
    for (int c = 0; c < segmenter->component_count; c++)
        segmenter->components[c].adjacent = 0;
    for (int n = 0; n < segmenter->candidate_count; n++) {
        int i = segmenter->candidate[n];
        struct component *c = &segmenter->components[segmenter->label[i]];
        if (!c->is_person)
            c->adjacent += is_adjacent(segmenter, i);
    }
}

static bool is_part_of_actor(const struct segmenter *segmenter, const struct component *component,
                             const struct component *main, int sphere_count)
{
    if (component->cells < PART_CELLS_MIN)
        return false;
    if (sphere_count)
        return component->near_body > PART_NEAR_SHARE * component->cells ||
               (component->adjacent > PART_ADJACENT_SHARE * component->cells &&
                component->near_body > PART_ADJACENT_NEAR_SHARE * component->cells);
    double away[3];
    for (int k = 0; k < 3; k++)
        away[k] = component->sum[k] / component->cells - main->sum[k] / main->cells;
    // Nearly as large as the main component: another person, unless both are in one place, parted by an arm in front.
    bool stacked = fabs(away[0]) < STACKED_M && fabs(away[2]) < STACKED_M &&
                   fmax(component->top, main->top) - fmin(component->bottom, main->bottom) < STACKED_TALL_MAX_M;
    if (component->area_m2 > OTHER_PERSON_AREA_SHARE * main->area_m2 && !stacked)
        return false;
    if (fabs(away[2]) > PART_DEPTH_MAX_M || fabs(away[0]) > PART_LATERAL_MAX_M)
        return false;
    if (segmenter->have_floor && component->top < FLOOR_RIM_M)
        return component->adjacent > 0;
    return component->adjacent > ADJACENT_CELLS_MIN || component->adjacent > ADJACENT_SHARE * component->cells;
}

static void try_floor(struct segmenter *segmenter)
{
    if (segmenter->have_floor || segmenter->floor_tries > FLOOR_TRIES_MAX)
        return;
    segmenter->floor_tries++;
    struct floor_plane plane;
    if (floor_plane_fit(segmenter->depth, segmenter->ray, segmenter->width, segmenter->height, &plane)) {
        segmenter->have_floor = true;
        segmenter->up = plane.up;
        segmenter->height_m = plane.height_m;
        compute_depth_limits(segmenter);
    }
}

// The person's cells: the main component's and those that belong to it.
static void collect_person_cells(struct segmenter *segmenter, int main, int sphere_count)
{
    segmenter->components[main].is_person = true;
    bool more = true;
    for (int round = 0; round < MERGE_ROUNDS && more; round++) {
        more = false;
        count_adjacent(segmenter);
        for (int c = 0; c < segmenter->component_count; c++)
            if (!segmenter->components[c].is_person &&
                is_part_of_actor(segmenter, &segmenter->components[c], &segmenter->components[main], sphere_count))
                segmenter->components[c].is_person = more = true;
    }
    for (int n = 0; n < segmenter->candidate_count; n++)
        segmenter->person[segmenter->candidate[n]] =
            segmenter->components[segmenter->label[segmenter->candidate[n]]].is_person;
}

// Makes the likeliest component, and what belongs to it, the person.
static enum status take_component(struct segmenter *segmenter, const uint16_t *image, int sphere_count, uint8_t *mask)
{
    const size_t cells = (size_t)segmenter->width * (size_t)segmenter->height;
    const int main = choose_main(segmenter, sphere_count);
    memset(segmenter->person, 0, cells);
    if (main < 0)
        return NOTHING;
    collect_person_cells(segmenter, main, sphere_count);
    segmenter_upsample_mask(segmenter, image, mask);
    memcpy(segmenter->previous, segmenter->person, cells);
    segmenter->following = true;
    return OK;
}

enum status segmenter_next(struct segmenter *s, const uint16_t *image, const struct bounding_sphere *spheres,
                           int sphere_count, uint8_t *mask)
{
    memset(mask, 0, (size_t)s->lens.width * (size_t)s->lens.height);
    read_cells(s, image);
    s->bounds = find_image_bounds(image, &s->lens);
    try_floor(s);
    enum status status = segmenter_label_components(s);
    if (status != OK)
        return status;
    if (sphere_count)
        segmenter_count_near_body(s, spheres, sphere_count);
    else
        segmenter_measure_components(s);
    return take_component(s, image, sphere_count, mask);
}

enum status segmenter_next_candidate(struct segmenter *s, const uint16_t *image, uint8_t *mask)
{
    memset(mask, 0, lens_pixels(&s->lens));
    s->following = false;
    for (int c = 0; c < s->component_count; c++) {
        s->components[c].was_candidate |= s->components[c].is_person;
        s->components[c].is_person = false;
    }
    return take_component(s, image, 0, mask);
}

#define PERSON_SCORE_MIN 0.4 // reached by a person a metre to the side and cropped by the image's edge
// Chosen by hand. What a person disoccludes of the background has their outline: in two rendered rooms with a Kinect's
// noise its share is 0.22 at least, that of people 1.2 to 5 m away 0.04 at most.
#define CONTINUED_SHARE_MAX 0.13

static bool resembles_person(const struct segmenter *segmenter, int component, double min)
{
    return !segmenter->components[component].overlap &&
           person_score(segmenter, &segmenter->components[component]) > min &&
           segmenter_continued_share(segmenter, component) < CONTINUED_SHARE_MAX;
}

enum status segmenter_second_person(struct segmenter *s, const uint16_t *image, uint8_t *mask)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    int best = -1;
    double max = PERSON_SCORE_MIN;
    memset(mask, 0, (size_t)s->lens.width * (size_t)s->lens.height);
    segmenter_measure_components(s);
    for (int c = 0; c < s->component_count; c++)
        if (resembles_person(s, c, max))
            max = person_score(s, &s->components[best = c]);
    if (best < 0)
        return NOTHING;
    memset(s->person, 0, n);
    collect_person_cells(s, best, 0);
    segmenter_upsample_mask(s, image, mask);
    memcpy(s->person, s->previous, n); // the followed person stays the same
    return OK;
}
