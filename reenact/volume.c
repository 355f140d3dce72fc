#include "reenact/volume.h"

#include "platform/parallel.h"

#include <stdlib.h>
#include <string.h>

static const double REACH_M = 0.12;       // about the parts' cylinders
static const double END_REACH_M = 0.27;   // about hands and feet, which lie beyond the last joint
static const float OUTSIDE_M = 0.045F;    // distances are kept up to here
static const float INSIDE_M = 0.04F;      // and so far behind what was seen
static const float THICK = 1.15F;         // parts, against their cylinders' radius
static const float CYLINDER_TRUST = 0.5F; // in frames
static const float EMPTY_TRUST = 0.5F;    // against a reading's 1
static const float VOTE_M = 0.02F;        // what is said to lie farther from the surface counts by no more than that
static const float NOWHERE_NEAR = 0.6F;   // of the largest distance
static const float ROOM_SLACK_M = 0.05F; // the room is not nearer than this behind the person where they are told apart

enum { NORMAL_PASSES = 6, MOST_POINTS = 64000000, THREADS = 2, STRETCH = 8192, AHEAD = 12 };

// x, y, z and a fourth that is nothing, for which processors have instructions.
typedef float four __attribute__((vector_size(16)));

struct cell {
    int32_t at;     // in the grid
    float place[3]; // in the rest pose
    struct skin skin;
};

// A pixel of a sight, side by side, for it is asked for together.
struct witness {
    uint16_t depth;
    uint8_t part, edge, half;
};

// What is known at a point of the grid, side by side, for it is asked for together.
struct point {
    float distance, trust; // trust 0: not kept
    float seen;            // the part of its trust that readings of a surface near it gave
};

struct volume {
    struct rest rest;
    struct calibration calibration;
    struct pose depth_from_color;
    struct vec3 corner;
    double step; // between neighbouring points of the grid, metres
    int size[3];
    struct cell *cells;
    int cell_count;
    struct cell *heeding; // copies of those that readings still go into, in their order; NULL: all
    int heeding_count;
    struct point *points;      // of the grid
    struct witness *witnesses; // of the frame that is added
};

static struct vec3 point_at(const struct volume *v, int at)
{
    const int x = at % v->size[0], y = at / v->size[0] % v->size[1], z = at / v->size[0] / v->size[1];
    return v3_add(v->corner, v3(x * v->step, y * v->step, z * v->step));
}

static void find_size(struct volume *v)
{
    struct vec3 low = v3(INFINITY, INFINITY, INFINITY), high = v3(-INFINITY, -INFINITY, -INFINITY);
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(v->rest.skeleton.confidence[j] > 0))
            continue;
        struct vec3 p = v->rest.skeleton.joint[j];
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    double margin = END_REACH_M;
    for (int p = 0; p < PART_COUNT; p++)
        margin = v->rest.known[p] ? fmax(margin, v->rest.radius[p] + REACH_M) : margin;
    v->corner = v3_sub(low, v3(margin, margin, margin));
    struct vec3 extent = v3_sub(v3_add(high, v3(margin, margin, margin)), v->corner);
    v->size[0] = (int)ceil(extent.x / v->step) + 1;
    v->size[1] = (int)ceil(extent.y / v->step) + 1;
    v->size[2] = (int)ceil(extent.z / v->step) + 1;
}

static int within(double g, int size) { return g < 0 ? 0 : g > size ? size : (int)g; }

// Lays the capsule from a to b into the grid: `distance` has the least there, and what
// lies nearer than `reach` is marked in `keep`.
static void lay(struct volume *v, struct vec3 a, struct vec3 b, double radius, double reach, uint8_t *keep)
{
    struct vec3 along = v3_sub(b, a), low = v3_sub(a, v->corner), high = v3_sub(b, v->corner);
    double length2 = v3_dot(along, along), wide = radius + fmax(reach, (double)OUTSIDE_M);
    const double lows[] = {fmin(low.x, high.x), fmin(low.y, high.y), fmin(low.z, high.z)};
    const double highs[] = {fmax(low.x, high.x), fmax(low.y, high.y), fmax(low.z, high.z)};
    int from[3], to[3];
    for (int i = 0; i < 3; i++) {
        from[i] = within(floor((lows[i] - wide) / v->step), v->size[i]);
        to[i] = within(ceil((highs[i] + wide) / v->step) + 1, v->size[i]);
    }
    for (int z = from[2]; z < to[2]; z++)
        for (int y = from[1]; y < to[1]; y++)
            for (int x = from[0]; x < to[0]; x++) {
                int at = (z * v->size[1] + y) * v->size[0] + x;
                struct vec3 p = v3_sub(point_at(v, at), a);
                double t = length2 > 0 ? v3_dot(p, along) / length2 : 0;
                t = t < 0 ? 0 : t > 1 ? 1 : t;
                double gap = v3_length(v3_sub(p, v3_scale(along, t))) - radius;
                v->points[at].distance = fminf(v->points[at].distance, (float)gap);
                keep[at] |= gap < reach;
            }
}

static void lay_body(struct volume *v, uint8_t *keep)
{
    static const enum joint ends[] = {JOINT_LEFT_HAND, JOINT_RIGHT_HAND, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, JOINT_HEAD};
    const struct skeleton *s = &v->rest.skeleton;
    for (int p = 0; p < PART_COUNT; p++)
        if (v->rest.known[p])
            lay(v, s->joint[part_ends[p].from], s->joint[part_ends[p].to], v->rest.radius[p], REACH_M, keep);
    for (int p = 0; p < PART_COUNT; p++)
        for (size_t e = 0; e < COUNT_OF(ends); e++)
            if (v->rest.known[p] && part_ends[p].to == ends[e])
                lay(v, s->joint[ends[e]], s->joint[ends[e]], 0, END_REACH_M, keep);
}

static enum status open_cells(struct volume *v, int64_t count)
{
    uint8_t *keep = calloc((size_t)count, 1);
    if (!keep)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < count; i++)
        v->points[i].distance = OUTSIDE_M;
    lay_body(v, keep);
    for (int i = 0; i < count; i++)
        v->cell_count += keep[i];
    v->cells = malloc(sizeof *v->cells * (size_t)(v->cell_count ? v->cell_count : 1));
    int c = 0;
    for (int i = 0; i < count && v->cells; i++)
        if (keep[i]) {
            struct vec3 p = point_at(v, i);
            v->cells[c++] = (struct cell){i, {(float)p.x, (float)p.y, (float)p.z}, rest_skin(&v->rest, p)};
            v->points[i] = (struct point){fmaxf(-OUTSIDE_M, v->points[i].distance), CYLINDER_TRUST, 0};
        }
    free(keep);
    return v->cells ? OK : fail(ERR_MEMORY, "out of memory");
}

enum status volume_open(struct volume **out, const struct rest *rest, const struct calibration *calibration,
                        double step_m)
{
    *out = NULL;
    struct volume *v = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "out of memory");
    v->step = step_m;
    v->rest = *rest;
    v->calibration = *calibration;
    v->depth_from_color = calibration->registered ? POSE_IDENTITY : pose_inverse(calibration->color_from_depth);
    find_size(v);
    int64_t count = (int64_t)v->size[0] * v->size[1] * v->size[2];
    enum status status = OK;
    if (count > MOST_POINTS)
        status = fail(ERR_INPUT, "the take's joints lie too far apart to be one person's");
    if (status == OK) {
        const struct lens *lens = &calibration->depth;
        v->points = calloc((size_t)count, sizeof *v->points);
        v->witnesses = malloc(sizeof *v->witnesses * (size_t)lens->width * (size_t)lens->height);
        status = v->points && v->witnesses ? open_cells(v, count) : fail(ERR_MEMORY, "out of memory");
    }
    if (status != OK) {
        volume_close(&v);
        return status;
    }
    *out = v;
    return OK;
}

void volume_close(struct volume **v)
{
    if (!*v)
        return;
    free((*v)->cells);
    free((*v)->heeding);
    free((*v)->points);
    free((*v)->witnesses);
    free(*v);
    *v = NULL;
}

// ---------------------------------------------------------------- gathering

// What one frame says of the cells.
struct addition {
    struct volume *volume;
    const struct cell *cells;
    int cell_count;
    four maps[BONE_COUNT][4]; // columns: what x, y, z and 1 come to
    float thick[BONE_COUNT];
    uint16_t meeting[BONE_COUNT]; // bit p: meets part p
    bool ideal;                   // lens: without lens_project's way round, for speed
    const struct lens *lens;
    float fx, fy, cx, cy;         // likewise
    int left, top, width, height; // of the window that witnesses speak for
    const struct witness *witnesses;
};

// The witness for a place, in the depth camera's axes; NULL: none.
static inline const struct witness *find_witness(const struct addition *a, four p)
{
    const struct lens *lens = a->lens;
    if (!(p[2] > 0.05F))
        return NULL;
    float px, py;
    if (a->ideal) {
        float scale = 1 / p[2];
        px = p[0] * scale * a->fx + a->cx;
        py = p[1] * scale * a->fy + a->cy;
    } else {
        struct pixel at = lens_project(lens, v3((double)p[0], (double)p[1], (double)p[2]));
        px = (float)at.x, py = (float)at.y;
    }
    px += 0.5F, py += 0.5F;
    if (!(px >= 0 && py >= 0 && px < (float)lens->width && py < (float)lens->height))
        return NULL;
    int x = (int)px - a->left, y = (int)py - a->top; // rounded down, for it is not negative
    return x < 0 || y < 0 || x >= a->width || y >= a->height ? NULL : &a->witnesses[y * a->width + x];
}

static inline float least(float a, float b) { return a < b ? a : b; }

// Where a cell is in the depth camera's axes.
static inline four place_cell(const struct addition *a, const struct cell *cell)
{
    const struct skin *skin = &cell->skin;
    const four *m = a->maps[skin->bone[0]];
    four blend[4];
    if (skin->weight[0] < 1) {
        for (int k = 0; k < 4; k++)
            blend[k] = skin->weight[0] * m[k];
        for (int i = 1; i < SKIN_BONES; i++)
            for (int k = 0; k < 4 && skin->weight[i] > 0; k++)
                blend[k] += skin->weight[i] * a->maps[skin->bone[i]][k];
        m = blend;
    }
    return m[0] * cell->place[0] + m[1] * cell->place[1] + m[2] * cell->place[2] + m[3];
}

// How far a place of `bone` at depth z is before (+) what a pixel shows (*reading: that very
// surface); false: it says nothing of this place.
static inline bool ask(const struct addition *a, const struct witness *w, float z, int bone, float *distance,
                       float *trust, bool *reading)
{
    const float fx = a->fx, thick = a->thick[bone];
    *reading = false;
    float d = (float)w->depth * 1e-3F;
    if (!w->depth || w->part == SIGHT_RIM)
        return false;
    float before = d - z;
    // Where the sensor looked past, the surface is no farther off than the edge that it looked past.
    float beyond = w->part == SIGHT_ROOM ? 0.5F - (float)SIGHT_RIM_PX
                                         : 0.5F + (float)SIGHT_RIM_PX; // half of the rim is still the person
    float aside = least(((float)w->edge + beyond) * z / fx, OUTSIDE_M);
    const float sure = 0.1F + 0.3F * (float)w->edge; // which surface a pixel at an edge shows is a matter of chance
    *trust = least(EMPTY_TRUST, sure);
    if (w->part == SIGHT_ROOM) {
        *distance = aside;
        return before > ROOM_SLACK_M;
    }
    if (before < -INSIDE_M) { // the body goes on behind what is seen of it, no farther than it is thick
        *distance = -least(aside, INSIDE_M);
        return before > -THICK * least(thick, (float)w->half * z / fx) && w->part == bone_part(bone);
    }
    *reading = before < OUTSIDE_M;
    *distance = *reading ? before : aside;
    if (*reading)
        *trust = least(1, sure);
    return !*reading || a->meeting[bone] >> w->part & 1;
}

static void add_stretch(void *context, int stretch)
{
    const struct addition held = *(const struct addition *)context, *a = &held; // a copy that no store changes
    struct volume *v = a->volume;
    int from = stretch * STRETCH, to = from + STRETCH < a->cell_count ? from + STRETCH : a->cell_count;
    for (int c = from; c < to; c++) {
        const struct cell *cell = &a->cells[c];
        const int bone = cell->skin.bone[0];
        __builtin_prefetch(&v->points[a->cells[c + AHEAD < a->cell_count ? c + AHEAD : c].at], 1);
        const four p = place_cell(a, cell);
        float distance, trust;
        bool reading;
        const struct witness *w = find_witness(a, p);
        if (!w || !ask(a, w, p[2], bone, &distance, &trust, &reading))
            continue;
        // What is far from the surface says on which side it is, not how far: limbs are now here, now there.
        trust *= least(1, VOTE_M / fmaxf(fabsf(distance), 1e-6F));
        struct point *known = &v->points[cell->at];
        known->distance = (known->distance * known->trust + distance * trust) / (known->trust + trust);
        known->trust += trust;
        known->seen += reading ? trust : 0;
    }
}

void volume_grow(struct volume *v, const double out_m[BONE_COUNT])
{
    for (int c = 0; c < v->cell_count; c++) {
        const struct skin *skin = &v->cells[c].skin;
        for (int i = 0; i < SKIN_BONES; i++)
            v->points[v->cells[c].at].distance -= skin->weight[i] * (float)out_m[skin->bone[i]];
    }
}

// Who speaks: all pixels as far about the person as edges are told.
static void call_witnesses(struct addition *a, const struct sight *s)
{
    int right = s->right + SIGHT_EDGE_MOST, bottom = s->bottom + SIGHT_EDGE_MOST;
    a->left = s->left > SIGHT_EDGE_MOST ? s->left - SIGHT_EDGE_MOST : 0;
    a->top = s->top > SIGHT_EDGE_MOST ? s->top - SIGHT_EDGE_MOST : 0;
    a->width = (right < s->width ? right + 1 : s->width) - a->left;
    a->height = (bottom < s->height ? bottom + 1 : s->height) - a->top;
    struct witness *w = a->volume->witnesses;
    a->witnesses = w;
    for (int y = a->top; y < a->top + a->height; y++)
        for (int i = y * s->width + a->left; i < y * s->width + a->left + a->width; i++)
            *w++ = (struct witness){s->depth[i], s->part[i], s->edge[i], s->half[i]};
}

void volume_add(struct volume *v, const struct sight *sight, const struct posture *posture)
{
    struct addition a = {.volume = v, .cells = v->heeding ? v->heeding : v->cells};
    if (sight->right < sight->left)
        return;
    a.cell_count = v->heeding ? v->heeding_count : v->cell_count;
    a.lens = &v->calibration.depth;
    a.ideal = lens_is_ideal(a.lens);
    a.fx = (float)a.lens->fx, a.fy = (float)a.lens->fy, a.cx = (float)a.lens->cx, a.cy = (float)a.lens->cy;
    for (int p = 0; p < BONE_COUNT; p++) {
        struct part_map map = part_map_of(pose_multiply(v->depth_from_color, posture->bone[p]));
        for (int k = 0; k < 4; k++)
            a.maps[p][k] = (four){map.row[0][k], map.row[1][k], map.row[2][k], 0};
        a.thick[p] = (float)v->rest.radius[p];
        for (int q = 0; q < PART_COUNT; q++)
            a.meeting[p] |= (uint16_t)(bones_meet((int)bone_part(p), q) << q);
    }
    call_witnesses(&a, sight);
    // Each cell is one thread's, so it does not matter how many there are.
    parallel(THREADS, (a.cell_count + STRETCH - 1) / STRETCH, add_stretch, &a);
}

// Both grids begin at the same corner.
static const struct point *nearest_known(const struct volume *v, const struct volume *known, const struct cell *cell)
{
    const int at[3] = {cell->at % v->size[0], cell->at / v->size[0] % v->size[1], cell->at / v->size[0] / v->size[1]};
    int near[3];
    for (int i = 0; i < 3; i++) {
        near[i] = (int)(at[i] * v->step / known->step + 0.5);
        near[i] = near[i] < known->size[i] ? near[i] : known->size[i] - 1;
    }
    return &known->points[(near[2] * known->size[1] + near[1]) * known->size[0] + near[0]];
}

enum status volume_leave_empty(struct volume *v, const struct volume *known)
{
    const struct cell *cells = v->heeding ? v->heeding : v->cells;
    int count = v->heeding ? v->heeding_count : v->cell_count, left = 0;
    struct cell *still = malloc(sizeof *still * (size_t)(count ? count : 1));
    if (!still)
        return fail(ERR_MEMORY, "out of memory");
    for (int c = 0; c < count; c++) {
        const struct point *point = nearest_known(v, known, &cells[c]);
        if (point->trust > CYLINDER_TRUST && point->distance >= NOWHERE_NEAR * OUTSIDE_M) {
            v->points[cells[c].at].distance = point->distance;
            v->points[cells[c].at].trust = point->trust;
        } else {
            still[left++] = cells[c];
        }
    }
    free(v->heeding);
    v->heeding = still;
    v->heeding_count = left;
    return OK;
}

// ---------------------------------------------------------------- looking up

const struct rest *volume_rest(const struct volume *v) { return &v->rest; }

bool volume_at(const struct volume *v, struct vec3 rest, double *distance, struct vec3 *gradient, double *seen)
{
    struct vec3 g = v3_scale(v3_sub(rest, v->corner), 1 / v->step);
    int x = (int)floor(g.x), y = (int)floor(g.y), z = (int)floor(g.z);
    if (x < 0 || y < 0 || z < 0 || x + 1 >= v->size[0] || y + 1 >= v->size[1] || z + 1 >= v->size[2])
        return false;
    double f[2][2][2], u = g.x - x, w = g.y - y, t = g.z - z;
    float least_seen = INFINITY;
    for (int i = 0; i < 8; i++) {
        int at = ((z + (i >> 2)) * v->size[1] + y + (i >> 1 & 1)) * v->size[0] + x + (i & 1);
        const struct point *p = &v->points[at];
        if (!(p->trust > 0))
            return false;
        f[i >> 2][i >> 1 & 1][i & 1] = (double)p->distance;
        least_seen = least(least_seen, p->seen);
    }
    *seen = (double)least_seen;
    double c[2][2], cx[2][2];
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 2; j++) {
            c[k][j] = f[k][j][0] * (1 - u) + f[k][j][1] * u;
            cx[k][j] = f[k][j][1] - f[k][j][0];
        }
    double low = c[0][0] * (1 - w) + c[0][1] * w, high = c[1][0] * (1 - w) + c[1][1] * w;
    *distance = low * (1 - t) + high * t;
    gradient->x = (cx[0][0] * (1 - w) + cx[0][1] * w) * (1 - t) + (cx[1][0] * (1 - w) + cx[1][1] * w) * t;
    gradient->y = (c[0][1] - c[0][0]) * (1 - t) + (c[1][1] - c[1][0]) * t;
    gradient->z = high - low;
    *gradient = v3_scale(*gradient, 1 / v->step);
    return fabs(*distance) < (double)OUTSIDE_M * 0.98;
}

enum status volume_smooth(struct volume *v, int passes)
{
    size_t count = (size_t)(v->size[0] * v->size[1] * v->size[2]);
    float *from = malloc(sizeof *from * count);
    if (!from)
        return fail(ERR_MEMORY, "out of memory");
    const int step[3] = {1, v->size[0], v->size[0] * v->size[1]};
    for (int pass = 0; pass < passes; pass++)
        for (int axis = 0; axis < 3; axis++) {
            for (size_t i = 0; i < count; i++)
                from[i] = v->points[i].distance;
            for (int c = 0; c < v->cell_count; c++) {
                int at = v->cells[c].at, a = at - step[axis], b = at + step[axis];
                if (v->points[a].trust > 0 && v->points[b].trust > 0) // (a cell is never at the grid's border)
                    v->points[at].distance = (from[a] + 2 * from[at] + from[b]) / 4;
            }
        }
    free(from);
    return OK;
}

// ---------------------------------------------------------------- surface (naive surface nets)

void surface_free(struct surface *s)
{
    free(s->points);
    free(s->normals);
    free(s->corners);
    *s = (struct surface){0};
}

// The point of the cube whose lowest grid point is `at`: the mean of where its edges cross the surface.
static bool cube_point(const struct volume *v, int at, struct vec3 *out)
{
    const int dx = 1, dy = v->size[0], dz = v->size[0] * v->size[1];
    float d[8];
    int inside = 0;
    for (int i = 0; i < 8; i++) {
        int corner = at + (i & 1) * dx + (i >> 1 & 1) * dy + (i >> 2) * dz;
        if (!(v->points[corner].trust > 0))
            return false;
        d[i] = v->points[corner].distance;
        inside += d[i] < 0;
    }
    if (inside == 0 || inside == 8)
        return false;
    struct vec3 sum = v3(0, 0, 0);
    int crossings = 0;
    for (int i = 0; i < 8; i++)
        for (int axis = 1; axis < 8; axis <<= 1) {
            int j = i | axis;
            if (j == i || (d[i] < 0) == (d[j] < 0))
                continue;
            double t = (double)(d[i] / (d[i] - d[j]));
            sum = v3_add(sum, v3((i & 1) + (axis == 1 ? t : 0), (i >> 1 & 1) + (axis == 2 ? t : 0),
                                 (i >> 2) + (axis == 4 ? t : 0)));
            crossings++;
        }
    *out = v3_add(point_at(v, at), v3_scale(sum, v->step / crossings));
    return true;
}

static void add_quad(struct surface *s, const int32_t q[4], bool turned)
{
    static const int order[2][6] = {{0, 1, 2, 0, 2, 3}, {0, 2, 1, 0, 3, 2}};
    for (int i = 0; i < 4; i++)
        if (q[i] < 0)
            return;
    for (int i = 0; i < 6; i++)
        s->corners[s->corner_count++] = q[order[turned][i]];
}

// Normals noisy as the readings would make the light flicker over the skin: each takes the mean of its neighbours'.
static enum status even_normals(struct surface *s)
{
    struct vec3 *sum = malloc(sizeof *sum * (size_t)(s->point_count + 1));
    if (!sum)
        return fail(ERR_MEMORY, "out of memory");
    for (int pass = 0; pass < NORMAL_PASSES; pass++) {
        for (int i = 0; i < s->point_count; i++)
            sum[i] = s->normals[i];
        for (int c = 0; c < s->corner_count; c++) {
            int next = c % 3 == 2 ? c - 2 : c + 1;
            sum[s->corners[c]] = v3_add(sum[s->corners[c]], s->normals[s->corners[next]]);
        }
        for (int i = 0; i < s->point_count; i++)
            s->normals[i] = v3_unit(sum[i]);
    }
    free(sum);
    return OK;
}

enum status volume_surface(const struct volume *v, struct surface *out)
{
    *out = (struct surface){0};
    const int step[3] = {1, v->size[0], v->size[0] * v->size[1]};
    int count = v->size[0] * v->size[1] * v->size[2], most = 0;
    int32_t *number = malloc(sizeof *number * (size_t)count);
    for (int i = 0; number && i < count; i++)
        number[i] = -1;
    struct vec3 p;
    for (int c = 0; number && c < v->cell_count; c++)
        if (cube_point(v, v->cells[c].at, &p))
            number[v->cells[c].at] = most++;
    out->points = malloc(sizeof *out->points * (size_t)(most + 1));
    out->normals = malloc(sizeof *out->normals * (size_t)(most + 1));
    out->corners = malloc(sizeof *out->corners * 18 * (size_t)(most + 1));
    if (!number || !out->points || !out->normals || !out->corners) {
        free(number);
        surface_free(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int c = 0; c < v->cell_count; c++) {
        int at = v->cells[c].at;
        if (number[at] < 0 || !cube_point(v, at, &p))
            continue;
        double distance, seen;
        struct vec3 *normal = &out->normals[out->point_count];
        *normal = v3(0, 0, 0);
        volume_at(v, p, &distance, normal, &seen);
        *normal = v3_unit(*normal);
        out->points[out->point_count++] = p;
    }
    for (int c = 0; c < v->cell_count; c++)
        for (int axis = 0; axis < 3; axis++) { // each edge that crosses joins the four cubes about it
            int at = v->cells[c].at, to = at + step[axis], b = step[(axis + 1) % 3], d = step[(axis + 2) % 3];
            if (to >= count || at < b + d || !(v->points[to].trust > 0) ||
                (v->points[at].distance < 0) == (v->points[to].distance < 0))
                continue;
            const int32_t quad[4] = {number[at], number[at - b], number[at - b - d], number[at - d]};
            add_quad(out, quad, v->points[at].distance >= 0);
        }
    free(number);
    if (!out->corner_count) {
        surface_free(out);
        return NOTHING;
    }
    enum status status = even_normals(out);
    if (status != OK)
        surface_free(out);
    return status;
}
