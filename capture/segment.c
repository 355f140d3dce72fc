#include "capture/segment.h"

#include "capture/segment_floor.h"

#include <stdlib.h>
#include <string.h>

enum {
    COLUMNS_MAX = 320,
    JUMPS = 10001,         // depths whose jump is looked up, mm
    SETTLED_FRAMES = 3,    // a background value is believed after so many sightings
    REPLACED_FRAMES = 45,  // something nearer that stays this long becomes background
};

struct segmenter {
    struct lens lens;
    int step, width, height; // grid: pixels a cell, cells
    struct grid_ray *ray;    // per cell: the ray's x/z, y/z
    uint16_t jump_mm[JUMPS]; // by depth: how far two neighbouring readings of one surface may differ
    uint16_t *depth;         // per cell, mm, flying pixels removed
    int32_t *label;          // per cell: component, -1 none
    int32_t *parent;         // union-find
    uint16_t *background;    // per cell, learned; 0 unknown
    uint8_t *sightings, *nearer;
    uint16_t *given;         // per cell, given; 0 unknown
    uint8_t *person, *before; // per cell
    struct component *components;
    int component_count, component_room;
    bool have_floor, floor_given, follows;
    struct vec3 up;
    double height_m;
    int floor_tries;
    struct picture_bounds picture; // of this frame
};

struct component {
    int cells;
    double area_m2;
    double top, bottom;       // along up, metres (over the floor when known)
    double low[3], high[3];   // bounds: across, depth (horizontal), and picture depth
    double sum[3];            // of the points
    int border_left, border_right, border_bottom, border_top;
    int overlap;              // cells that were the person's before
    int close;                // cells close to the predicted body
    int touching;             // cells beside what is the person's already
    bool mine;                // it is the person, or a part of them
    double top_width;         // how wide it is within 0.2 m of its top
};

static int find_jump_mm(const struct segmenter *s, int depth_mm)
{
    // Two readings of one surface differ by noise (3 sigma of a difference) or by
    // slope (a surface up to 76 degrees off the picture plane).
    double z = depth_mm * 0.001, noise = 3 * 1.4142 * depth_sigma_m(z), slope = 4 * z * s->step / s->lens.fx;
    return (int)(1000 * (fmax(noise, slope) + 0.005));
}

static int jump_mm(const struct segmenter *s, int depth_mm)
{
    return s->jump_mm[depth_mm < JUMPS ? depth_mm : JUMPS - 1];
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
    s->background = calloc(n, sizeof *s->background);
    s->sightings = calloc(n, 1);
    s->nearer = calloc(n, 1);
    s->given = calloc(n, sizeof *s->given);
    s->person = calloc(n, 1);
    s->before = calloc(n, 1);
    if (!s->ray || !s->depth || !s->label || !s->parent || !s->background || !s->sightings || !s->nearer || !s->given ||
        !s->person || !s->before) {
        segmenter_close(&s);
        return fail(ERR_MEMORY, "not enough memory to segment depth pictures of %d x %d", lens->width, lens->height);
    }
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            double middle = (s->step - 1) / 2.0;
            struct vec3 r = lens_ray(lens, (struct pixel){x * s->step + middle, y * s->step + middle});
            s->ray[y * s->width + x] = (struct grid_ray){(float)r.x, (float)r.y};
        }
    for (int d = 0; d < JUMPS; d++)
        s->jump_mm[d] = (uint16_t)find_jump_mm(s, d);
    s->up = v3(0, -1, 0);
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
    free((*s)->background);
    free((*s)->sightings);
    free((*s)->nearer);
    free((*s)->given);
    free((*s)->person);
    free((*s)->before);
    free((*s)->components);
    free(*s);
    *s = NULL;
}

void segmenter_forget_person(struct segmenter *s)
{
    s->follows = false;
    memset(s->before, 0, (size_t)s->width * (size_t)s->height);
}

void segmenter_reset(struct segmenter *s)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    segmenter_forget_person(s);
    memset(s->background, 0, n * sizeof *s->background);
    memset(s->sightings, 0, n);
    memset(s->nearer, 0, n);
    if (!s->floor_given) {
        s->have_floor = false;
        s->up = v3(0, -1, 0);
        s->height_m = 0;
    }
    s->floor_tries = 0;
}

// A cell's depth: the first reading of its pixels, its first pixel first.
static uint16_t cell_depth(const struct segmenter *s, const uint16_t *picture, int x, int y)
{
    for (int j = 0; j < s->step; j++)
        for (int i = 0; i < s->step; i++) {
            int px = x * s->step + i, py = y * s->step + j;
            if (px < s->lens.width && py < s->lens.height && picture[py * s->lens.width + px])
                return picture[py * s->lens.width + px];
        }
    return 0;
}

void segmenter_set_background(struct segmenter *s, const uint16_t *depth)
{
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++)
            s->given[y * s->width + x] = depth ? cell_depth(s, depth, x, y) : 0;
}

void segmenter_set_floor(struct segmenter *s, struct vec3 up, double height_m)
{
    s->up = v3_unit(up);
    s->height_m = height_m;
    s->have_floor = s->floor_given = true;
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

// Reads the cells and drops those that lie in the air between two surfaces.
static void read_cells(struct segmenter *s, const uint16_t *picture)
{
    int w = s->width;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++)
            s->depth[y * w + x] = cell_depth(s, picture, x, y);
    // label[] holds the verdict until the components are drawn.
    memset(s->label, 0, (size_t)w * (size_t)s->height * sizeof *s->label);
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x, d = s->depth[i];
            if (!d)
                continue;
            int far = jump_mm(s, d);
            for (int axis = 0; axis < 2; axis++) {
                int k = axis ? w : 1;
                if (axis ? (y == 0 || y == s->height - 1) : (x == 0 || x == w - 1))
                    continue;
                int a = s->depth[i - k], b = s->depth[i + k];
                if (a && b && ((a - d > far && d - b > far) || (d - a > far && b - d > far)))
                    s->label[i] = 1;
            }
        }
    for (int i = 0; i < w * s->height; i++)
        if (s->label[i])
            s->depth[i] = 0;
}

// In front of everything that is known not to be the person.
static bool may_be_person(const struct segmenter *s, int i, double z)
{
    double margin = 3 * depth_sigma_m(z) + 0.02;
    if (s->given[i] && z > s->given[i] * 0.001 - margin)
        return false;
    if (s->background[i] && s->sightings[i] >= SETTLED_FRAMES && z > s->background[i] * 0.001 - margin)
        return false;
    if (s->have_floor) {
        struct vec3 ray = v3((double)s->ray[i].x, (double)s->ray[i].y, 1);
        double slant = v3_dot(s->up, ray); // metres of height a metre of depth
        if (slant * z + s->height_m < 0.02 + 3 * depth_sigma_m(z) * fabs(slant))
            return false;
    }
    return true;
}

static int find_root(int32_t *parent, int i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void join(struct segmenter *s, int a, int b)
{
    int za = s->depth[a], zb = s->depth[b];
    if (!zb || s->label[b] < 0 || abs(za - zb) > jump_mm(s, za < zb ? za : zb))
        return;
    a = find_root(s->parent, a);
    b = find_root(s->parent, b);
    if (a != b)
        s->parent[a < b ? b : a] = a < b ? a : b;
}

// Labels the components of continuous depth among the cells that may be person.
static enum status draw_components(struct segmenter *s)
{
    int w = s->width, n = w * s->height;
    for (int i = 0; i < n; i++) {
        s->parent[i] = i;
        s->label[i] = s->depth[i] && may_be_person(s, i, s->depth[i] * 0.001) ? 0 : -1;
    }
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x;
            if (s->label[i] < 0)
                continue;
            if (x > 0)
                join(s, i, i - 1);
            if (x > 1 && !s->depth[i - 1]) // over a gap of one cell
                join(s, i, i - 2);
            if (y > 0)
                join(s, i, i - w);
            if (y > 1 && !s->depth[i - w])
                join(s, i, i - 2 * w);
        }
    s->component_count = 0;
    for (int i = 0; i < n; i++) // roots come first, so every label below i is final
        if (s->label[i] >= 0 && find_root(s->parent, i) == i) {
            if (s->component_count == s->component_room) {
                int room = s->component_room ? 2 * s->component_room : 256;
                struct component *more = realloc(s->components, (size_t)room * sizeof *more);
                if (!more)
                    return fail(ERR_MEMORY, "not enough memory for %d parts of a depth picture", room);
                s->components = more;
                s->component_room = room;
            }
            s->label[i] = s->component_count++;
        } else if (s->label[i] >= 0) {
            s->label[i] = s->label[find_root(s->parent, i)];
        }
    return OK;
}

// Two level axes: across and away.
static void level_axes(const struct segmenter *s, struct vec3 *across, struct vec3 *away)
{
    *across = v3_unit(v3_cross(v3(0, 0, 1), v3_scale(s->up, -1)));
    *across = v3_scale(*across, across->x < 0 ? -1 : 1);
    *away = v3_unit(v3_cross(*across, v3_scale(s->up, -1)));
}

static void measure_components(struct segmenter *s, const struct ball *balls, int ball_count)
{
    struct vec3 across, away;
    level_axes(s, &across, &away);
    for (int c = 0; c < s->component_count; c++)
        s->components[c] = (struct component){.top = -1e9, .bottom = 1e9, .low = {1e9, 1e9, 1e9}, .high = {-1e9, -1e9, -1e9}};
    int w = s->width;
    double cell = s->step / s->lens.fx;
    // The balls' common sphere spares most cells the search.
    struct vec3 middle = v3(0, 0, 0);
    double reach = 0;
    for (int b = 0; b < ball_count; b++)
        middle = v3_add(middle, v3_scale(balls[b].centre, 1.0 / ball_count));
    for (int b = 0; b < ball_count; b++)
        reach = fmax(reach, v3_distance(middle, balls[b].centre) + balls[b].radius + 0.2);
    for (int i = 0; i < w * s->height; i++) {
        if (s->label[i] < 0)
            continue;
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
        c->overlap += s->before[i];
        int x = i % w, y = i / w;
        c->border_left += x < s->picture.left / s->step + 2;
        c->border_right += x >= s->picture.right / s->step - 1;
        c->border_top += y < s->picture.top / s->step + 2;
        c->border_bottom += y >= s->picture.bottom / s->step - 1;
        if (ball_count && v3_distance(p, middle) < reach)
            for (int b = 0; b < ball_count; b++) {
                double r = balls[b].radius + 0.10 + 2 * depth_sigma_m(z);
                struct vec3 d = v3_sub(p, balls[b].centre);
                if (v3_dot(d, d) < r * r) {
                    c->close++;
                    break;
                }
            }
    }
    double *edge = malloc((size_t)(s->component_count + 1) * 2 * sizeof *edge);
    if (!edge)
        return; // without widths every component counts as narrow
    for (int c = 0; c < s->component_count; c++)
        edge[2 * c] = 1e9, edge[2 * c + 1] = -1e9;
    for (int i = 0; i < w * s->height; i++) {
        if (s->label[i] < 0)
            continue;
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
static double likeness(const struct segmenter *s, const struct component *c)
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

static int choose_main(const struct segmenter *s, int ball_count)
{
    int best = -1;
    double most = 0;
    for (int c = 0; c < s->component_count; c++) {
        const struct component *k = &s->components[c];
        double score;
        if (ball_count)
            score = k->close > 20 && k->close > 0.15 * k->cells ? k->close : 0;
        else if (s->follows)
            score = k->overlap > 20 && k->area_m2 < 2.5 ? k->overlap : 0;
        else
            score = likeness(s, k);
        if (score > most) {
            most = score;
            best = c;
        }
    }
    return best;
}

// Counts, for every other component, the cells beside the person's so far: an
// arm held forward is cut off by the jump in depth, and a head behind that arm.
static void count_touching(struct segmenter *s)
{
    int w = s->width;
    for (int c = 0; c < s->component_count; c++)
        s->components[c].touching = 0;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++) {
            int i = y * w + x, c = s->label[i];
            if (c < 0 || s->components[c].mine)
                continue;
            int reach = 3; // over the shadow that a near limb throws
            bool found = false;
            for (int k = 1; k <= reach && !found; k++) {
                int at[4] = {x >= k ? i - k : -1, x + k < w ? i + k : -1, y >= k ? i - k * w : -1,
                             y + k < s->height ? i + k * w : -1};
                for (int q = 0; q < 4 && !found; q++)
                    found = at[q] >= 0 && s->label[at[q]] >= 0 && s->components[s->label[at[q]]].mine &&
                            abs(s->depth[at[q]] - s->depth[i]) < 800;
            }
            s->components[c].touching += found;
        }
}

static bool belongs(const struct segmenter *s, const struct component *c, const struct component *main, int ball_count)
{
    if (c->cells < 4)
        return false;
    if (ball_count)
        return c->close > 0.5 * c->cells || (c->touching > 0.12 * c->cells && c->close > 0.1 * c->cells);
    double away[3];
    for (int k = 0; k < 3; k++)
        away[k] = c->sum[k] / c->cells - main->sum[k] / main->cells;
    // As large as the main part: somebody else, unless both are in one place, parted by an arm before them.
    bool stacked = fabs(away[0]) < 0.3 && fabs(away[2]) < 0.3 && fmax(c->top, main->top) - fmin(c->bottom, main->bottom) < 2.4;
    if (c->area_m2 > 0.6 * main->area_m2 && !stacked)
        return false;
    if (fabs(away[2]) > 0.9 || fabs(away[0]) > 1.1)
        return false;
    if (s->have_floor && c->top < 0.15)
        return c->touching > 0;
    return c->touching > 3 || c->touching > 0.1 * c->cells;
}

// Every pixel of a cell that agrees with the person's cells around it.
static void refine_mask(const struct segmenter *s, const uint16_t *picture, uint8_t *mask)
{
    int w = s->width, left = w, right = -1, top = s->height, bottom = -1;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < w; x++)
            if (s->person[y * w + x]) {
                left = x < left ? x : left, right = x > right ? x : right;
                top = y < top ? y : top, bottom = y;
            }
    for (int y = top > 0 ? top - 1 : 0; y <= bottom + 1 && y < s->height; y++)
        for (int x = left > 0 ? left - 1 : 0; x <= right + 1 && x < w; x++) {
            int near[9], count = 0, centre = y * w + x;
            for (int j = -1; j <= 1; j++)
                for (int i = -1; i <= 1; i++)
                    if (x + i >= 0 && x + i < w && y + j >= 0 && y + j < s->height && s->person[centre + j * w + i])
                        near[count++] = s->depth[centre + j * w + i];
            if (!count || (!s->person[centre] && s->step == 1))
                continue;
            for (int j = 0; j < s->step; j++)
                for (int i = 0; i < s->step; i++) {
                    int px = x * s->step + i, py = y * s->step + j;
                    if (px >= s->lens.width || py >= s->lens.height)
                        continue;
                    int d = picture[py * s->lens.width + px];
                    if (!d || (!s->person[centre] && !may_be_person(s, centre, d * 0.001)))
                        continue;
                    int limit = jump_mm(s, d);
                    for (int k = 0; k < count; k++)
                        if (abs(near[k] - d) <= limit) {
                            mask[py * s->lens.width + px] = 255;
                            break;
                        }
                }
        }
}

static void try_floor(struct segmenter *s)
{
    if (s->have_floor || s->floor_tries > 30)
        return;
    s->floor_tries++;
    struct floor_plane plane;
    if (floor_find(s->depth, s->ray, s->width, s->height, &plane)) {
        s->have_floor = true;
        s->up = plane.up;
        s->height_m = plane.height_m;
    }
}

enum status segmenter_next(struct segmenter *s, const uint16_t *picture, const struct ball *balls, int ball_count,
                           uint8_t *mask)
{
    memset(mask, 0, (size_t)s->lens.width * (size_t)s->lens.height);
    read_cells(s, picture);
    s->picture = picture_bounds(picture, &s->lens);
    try_floor(s);
    enum status status = draw_components(s);
    if (status != OK)
        return status;
    measure_components(s, balls, ball_count);
    int main = choose_main(s, ball_count);
    memset(s->person, 0, (size_t)s->width * (size_t)s->height);
    if (main < 0)
        return NOTHING;
    s->components[main].mine = true;
    bool more = true;
    for (int round = 0; round < 3 && more; round++) { // a hand on an arm on the body
        more = false;
        count_touching(s);
        for (int c = 0; c < s->component_count; c++)
            if (!s->components[c].mine && belongs(s, &s->components[c], &s->components[main], ball_count))
                s->components[c].mine = more = true;
    }
    for (int i = 0; i < s->width * s->height; i++)
        s->person[i] = s->label[i] >= 0 && s->components[s->label[i]].mine;
    refine_mask(s, picture, mask);
    memcpy(s->before, s->person, (size_t)s->width * (size_t)s->height);
    s->follows = true;
    return OK;
}

// label[] becomes 1 within four cells of the person, else 0: hair, flying pixels
// and shadows at the rim are no background.
static void mark_near_person(struct segmenter *s)
{
    enum { REACH = 4 };
    int w = s->width, h = s->height;
    for (int y = 0; y < h; y++) { // along the rows: how far from the last and to the next
        int far = REACH + 1;
        for (int x = 0; x < w; x++) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] = far <= REACH;
        }
        far = REACH + 1;
        for (int x = w - 1; x >= 0; x--) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] |= far <= REACH;
        }
    }
    // Down the columns, row by row; parent[] has how far each is from the last marked one.
    for (int x = 0; x < w; x++)
        s->parent[x] = REACH + 1;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= REACH);
        }
    for (int x = 0; x < w; x++)
        s->parent[x] = REACH + 1;
    for (int y = h - 1; y >= 0; y--)
        for (int x = 0; x < w; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= REACH);
        }
}

void segmenter_learn(struct segmenter *s)
{
    int disagree = 0, known = 0;
    // Inside the person's bounds nothing is learned that is not clearly behind
    // them: it may be a part of them that the mask lost.
    int left = s->width, right = -1, top = s->height, bottom = -1, far = 0;
    for (int i = 0; i < s->width * s->height; i++)
        if (s->person[i]) {
            int x = i % s->width, y = i / s->width;
            left = x < left ? x : left, right = x > right ? x : right;
            top = y < top ? y : top, bottom = y > bottom ? y : bottom;
            far = s->depth[i] > far ? s->depth[i] : far;
        }
    mark_near_person(s);
    for (int i = 0; i < s->width * s->height; i++) {
        int x = i % s->width, y = i / s->width, d = s->depth[i];
        if (!d || s->label[i])
            continue;
        if (x > left - 8 && x < right + 8 && y > top - 8 && y < bottom + 4 && d < far + 400)
            continue;
        double z = d * 0.001;
        int b = s->background[i], same = (int)(1000 * (3 * 1.4142 * depth_sigma_m(z) + 0.01));
        if (!b || d > b + same) { // the room begins further back than believed
            disagree += b != 0;
            known += b != 0;
            s->background[i] = (uint16_t)d;
            s->sightings[i] = 1;
            s->nearer[i] = 0;
        } else if (d >= b - same) {
            known++;
            int n = s->sightings[i] < 30 ? s->sightings[i] : 30;
            s->background[i] = (uint16_t)((b * n + d + (n + 1) / 2) / (n + 1));
            s->sightings[i] += s->sightings[i] < 255;
            s->nearer[i] = 0;
        } else {
            known++;
            disagree++;
            if (++s->nearer[i] >= REPLACED_FRAMES) {
                s->background[i] = (uint16_t)d;
                s->sightings[i] = 1;
                s->nearer[i] = 0;
            }
        }
    }
    if (known > 500 && disagree > 0.4 * known) { // the sensor was moved: begin again
        size_t n = (size_t)s->width * (size_t)s->height;
        memset(s->background, 0, n * sizeof *s->background);
        memset(s->sightings, 0, n);
    }
}
