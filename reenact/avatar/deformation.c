#include "reenact/avatar/deformation_internal.h"

#include <stdlib.h>
#include <string.h>

enum { POINTS = 3000, ITERATIONS = 3, STEPS = 20, TILE_PX = 16, SILHOUETTE_STRIDE_PX = 2 };

// Least squares in units of metres: a reading is good to this much,
static const float DEPTH_SIGMA_M = 0.01F;
static const float SILHOUETTE_SIGMA_M = 0.01F; // a place of the outline to that,
static const float SMOOTHNESS_M = 0.024F;      // neighbouring nodes shift alike within this,
static const float SHIFT_PRIOR_M = 0.04F;      // and all of them little.
static const double OUTLIER_M[ITERATIONS] = {0.04, 0.03, 0.025};
static const double COLOR_SIGMA_PX[ITERATIONS] = {0, 2, 1.2}; // first the shape has to lie about right
static const double SEARCH_PX = 12;     // an outline is looked for so far from where the surface has it
static const double CERTAIN_FRAMES = 1; // frames
static const double LEAST_FACING = 0.1; // cosine: what a reading shows faces the camera
static const double GRAZING = 0.3;      // cosine: what may be at the outline

// ---------------------------------------------------------------- the grid

static int grid_count(const struct deformation_grid *g) { return g->size[0] * g->size[1] * g->size[2]; }

static struct deformation_grid grid_about(const struct surface_mesh *s)
{
    struct vec3 low = s->points[0], high = low;
    for (int i = 1; i < s->point_count; i++) {
        struct vec3 p = s->points[i];
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    const struct vec3 margin = {DEFORMATION_STEP_M, DEFORMATION_STEP_M, DEFORMATION_STEP_M};
    struct deformation_grid g = {.corner = v3_sub(low, margin)};
    struct vec3 extent = v3_sub(v3_add(high, margin), g.corner);
    g.size[0] = (int)ceil(extent.x / DEFORMATION_STEP_M) + 1;
    g.size[1] = (int)ceil(extent.y / DEFORMATION_STEP_M) + 1;
    g.size[2] = (int)ceil(extent.z / DEFORMATION_STEP_M) + 1;
    return g;
}

// The cube of the grid that holds a point, and where in it; false: outside.
static bool cube_of(const struct deformation_grid *g, struct vec3 p, int *at, double in[3])
{
    const double q[3] = {(p.x - g->corner.x) / DEFORMATION_STEP_M, (p.y - g->corner.y) / DEFORMATION_STEP_M,
                         (p.z - g->corner.z) / DEFORMATION_STEP_M};
    int cell[3];
    for (int i = 0; i < 3; i++) {
        if (!(q[i] >= 0 && q[i] < g->size[i] - 1))
            return false;
        cell[i] = (int)q[i];
        in[i] = q[i] - cell[i];
    }
    *at = (cell[2] * g->size[1] + cell[1]) * g->size[0] + cell[0];
    return true;
}

static int corner_at(const struct deformation_grid *g, int at, int corner)
{
    return at + (corner & 1) + ((corner >> 1 & 1) + (corner >> 2) * g->size[1]) * g->size[0];
}

static double corner_share(const double in[3], int corner)
{
    double share = 1;
    for (int i = 0; i < 3; i++)
        share *= corner >> i & 1 ? in[i] : 1 - in[i];
    return share;
}

// Nodes are the corners of the cubes that the surface passes through, and all that lies inside it.
static void find_nodes(struct deformation *w, const struct surface_mesh *surface)
{
    const struct deformation_grid *g = &w->grid;
    int count = grid_count(g), at;
    double in[3];
    memset(w->node, -1, sizeof *w->node * (size_t)count);
    for (int i = 0; i < surface->point_count; i++)
        if (cube_of(g, surface->points[i], &at, in))
            for (int c = 0; c < 8; c++)
                w->node[corner_at(g, at, c)] = 0;
    w->node_count = 0;
    for (int i = 0; i < count; i++) {
        struct vec3 p =
            v3_add(g->corner, v3_scale(v3(i % g->size[0], i / g->size[0] % g->size[1], i / g->size[0] / g->size[1]),
                                       DEFORMATION_STEP_M));
        if (w->node[i] == 0 || bind_pose_distance(&w->bind_pose, p) < 0)
            w->node[i] = w->node_count++;
    }
}

static void join_nodes(struct deformation *w)
{
    const struct deformation_grid *g = &w->grid;
    const int step[3] = {1, g->size[0], g->size[0] * g->size[1]};
    for (int i = 0; i < grid_count(g); i++) {
        const int at[3] = {i % g->size[0], i / g->size[0] % g->size[1], i / g->size[0] / g->size[1]};
        for (int a = 0; a < 3 && w->node[i] >= 0; a++)
            w->neighbor[w->node[i]][a] = at[a] + 1 < g->size[a] ? w->node[i + step[a]] : -1;
    }
}

enum status deformation_open(struct deformation **out, const struct bind_pose *bind_pose,
                             const struct surface_mesh *surface, const struct calibration *calibration)
{
    struct deformation *w = *out = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "out of memory");
    w->bind_pose = *bind_pose;
    w->depth_lens = calibration->depth;
    w->depth_from_color = pose_inverse(calibration->color_from_depth);
    w->grid = grid_about(surface);
    size_t count = (size_t)grid_count(&w->grid);
    w->node = malloc(sizeof *w->node * count);
    w->quantized = malloc(4 * count);
    if (w->node)
        find_nodes(w, surface);
    size_t nodes = (size_t)w->node_count;
    w->neighbor = malloc(sizeof *w->neighbor * nodes);
    w->shift = malloc(sizeof *w->shift * nodes);
    w->rhs = malloc(sizeof *w->rhs * nodes);
    w->residual = malloc(sizeof *w->residual * nodes);
    w->direction = malloc(sizeof *w->direction * nodes);
    w->product = malloc(sizeof *w->product * nodes);
    w->diagonal = malloc(sizeof *w->diagonal * nodes);
    w->row_most = 3 * POINTS + 3 * DEFORMATION_COLOR_POINTS; // depth_samples and outline; colours
    w->rows = malloc(sizeof *w->rows * (size_t)w->row_most);
    w->depth_samples = malloc(sizeof *w->depth_samples * 2 * POINTS);
    w->contour = malloc(sizeof *w->contour * POINTS);
    w->candidates = malloc(sizeof *w->candidates * (size_t)surface->point_count);
    w->color_points = malloc(sizeof *w->color_points * DEFORMATION_COLOR_POINTS);
    w->across = (calibration->depth.width + TILE_PX - 1) / TILE_PX;
    w->down = (calibration->depth.height + TILE_PX - 1) / TILE_PX;
    w->tile = malloc(sizeof *w->tile * (size_t)w->across * (size_t)w->down);
    if (!w->node || !w->quantized || !w->neighbor || !w->shift || !w->rhs || !w->residual || !w->direction ||
        !w->product || !w->diagonal || !w->rows || !w->depth_samples || !w->contour || !w->candidates ||
        !w->color_points || !w->tile) {
        deformation_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    join_nodes(w);
    deformation_clear(w);
    return OK;
}

void deformation_close(struct deformation **out)
{
    struct deformation *w = *out;
    if (!w)
        return;
    void *const all[] = {w->node,      w->neighbor,   w->shift,        w->rhs,  w->residual,
                         w->direction, w->product,    w->diagonal,     w->rows, w->depth_samples,
                         w->contour,   w->candidates, w->color_points, w->tile, w->quantized};
    for (size_t i = 0; i < COUNT_OF(all); i++)
        free(all[i]);
    free(w);
    *out = NULL;
}

struct vec3 deformation_at(const struct deformation *w, struct vec3 bind_point)
{
    struct vec3 sum = v3(0, 0, 0);
    double in[3];
    int at;
    if (!cube_of(&w->grid, bind_point, &at, in))
        return sum;
    for (int c = 0; c < 8; c++) {
        const uint8_t *t = w->quantized + 4 * corner_at(&w->grid, at, c);
        sum = v3_add(sum, v3_scale(v3(t[0] - 128, t[1] - 128, t[2] - 128), corner_share(in, c)));
    }
    return v3_scale(sum, DEFORMATION_SHIFT_MOST_M / 127);
}

// What everybody reads: a shift's component of DEFORMATION_SHIFT_MOST_M * t is 127 * t + 128, no finer than it is
// known.
static void write_quantized(struct deformation *w)
{
    for (int i = 0; i < grid_count(&w->grid); i++) {
        uint8_t *t = w->quantized + 4 * i;
        memset(t, 128, 4);
        for (int a = 0; a < 3 && w->node[i] >= 0; a++) {
            double part = (double)w->shift[w->node[i]][a] / DEFORMATION_SHIFT_MOST_M;
            t[a] = (uint8_t)(128.5 + 127 * (part < -1 ? -1 : part > 1 ? 1 : part));
        }
    }
}

void deformation_clear(struct deformation *w)
{
    memset(w->shift, 0, sizeof *w->shift * (size_t)w->node_count);
    write_quantized(w);
}

// ---------------------------------------------------------------- the evidence

struct vec3 deformation_current_shift(const struct deformation *w, struct vec3 bind_point)
{
    struct vec3 sum = v3(0, 0, 0);
    double in[3];
    int at;
    if (!cube_of(&w->grid, bind_point, &at, in))
        return sum;
    for (int c = 0; c < 8; c++) {
        int node = w->node[corner_at(&w->grid, at, c)];
        if (node < 0)
            continue;
        const four s = w->shift[node];
        sum = v3_add(sum, v3_scale(v3((double)s[0], (double)s[1], (double)s[2]), corner_share(in, c)));
    }
    return sum;
}

void deformation_add_row(struct deformation *w, struct vec3 bind_point, struct vec3 n, double more, double weight)
{
    double in[3];
    int at;
    if (w->row_count == w->row_most || !cube_of(&w->grid, bind_point, &at, in))
        return;
    struct deformation_row *r = &w->rows[w->row_count];
    for (int c = 0; c < 8; c++) {
        r->node[c] = w->node[corner_at(&w->grid, at, c)];
        r->share[c] = (float)corner_share(in, c);
        if (r->node[c] < 0)
            return;
    }
    r->n = (four){(float)n.x, (float)n.y, (float)n.z, 0};
    r->value = (float)(v3_dot(n, deformation_current_shift(w, bind_point)) + more);
    r->weight = (float)weight;
    w->row_count++;
}

// Where a point in the camera's axes is in the bind pose, if it is of a part or of one that meets it, and the
// direction from the camera to it.
static struct vec3 to_bind_pose(const struct deformation *w, const struct pose back[BONE_COUNT], int part,
                                struct vec3 at, struct vec3 *ray)
{
    struct vec3 bind_point = pose_apply(back[bind_pose_bone_at(&w->bind_pose, (enum part)part, at, back)], at);
    struct skin_weights skin = bind_pose_skin_weights(&w->bind_pose, bind_point);
    struct vec3 mixed = v3(0, 0, 0), rotated = v3(0, 0, 0);
    for (int i = 0; i < SKIN_BONES; i++) { // near enough to undoing the mix of maps where they differ little
        mixed = v3_add(mixed, v3_scale(pose_apply(back[skin.bone[i]], at), (double)skin.weight[i]));
        rotated = v3_add(rotated, v3_scale(quat_rotate(back[skin.bone[i]].rotation, at), (double)skin.weight[i]));
    }
    *ray = v3_unit(rotated);
    return mixed;
}

static int every_px(const struct depth_frame *s)
{
    long pixels = 0;
    for (int y = s->top; y <= s->bottom; y++)
        for (int x = s->left; x <= s->right; x++)
            pixels += s->part[y * s->width + x] < PART_COUNT;
    int every = 1;
    while (pixels / every / every > POINTS)
        every++;
    return every;
}

static void find_depth_samples(struct deformation *w, const struct depth_frame *s,
                               const struct bone_transforms *transforms)
{
    struct pose back[BONE_COUNT];
    for (int p = 0; p < BONE_COUNT; p++)
        back[p] = pose_inverse(transforms->bone[p]);
    int every = every_px(s);
    w->sample_count = 0;
    for (int y = s->top; y <= s->bottom; y += every)
        for (int x = s->left; x <= s->right; x += every) {
            int i = y * s->width + x, part = s->part[i];
            if (part >= PART_COUNT || !w->bind_pose.known[part] || w->sample_count == 2 * POINTS)
                continue;
            struct deformation_sample *r = &w->depth_samples[w->sample_count++];
            r->bind_point = to_bind_pose(w, back, part, source_rays_point(s->rays, i, s->depth[i]), &r->ray);
        }
}

static void add_depth_samples(struct deformation *w, const struct tsdf *tsdf, double outlier)
{
    for (int i = 0; i < w->sample_count; i++) {
        const struct deformation_sample *r = &w->depth_samples[i];
        struct vec3 gradient, bind_point = v3_sub(r->bind_point, deformation_current_shift(w, r->bind_point));
        double distance, seen;
        if (!tsdf_sample(tsdf, bind_point, &distance, &gradient, &seen) || v3_length(gradient) < 0.3)
            continue;
        struct vec3 n = v3_unit(gradient);
        if (-v3_dot(n, r->ray) < LEAST_FACING)
            continue;
        double robust = outlier * outlier / (outlier * outlier + distance * distance);
        deformation_add_row(w, bind_point, n, distance,
                            robust * robust * seen / (seen + CERTAIN_FRAMES) / (double)(DEPTH_SIGMA_M * DEPTH_SIGMA_M));
    }
}

// ---- the outline

// Where a part is, in the depth camera's axes.
struct bone_matrix {
    double turn[3][3];
    struct vec3 at;
};

static void compose_matrices(const struct deformation *w, const struct bone_transforms *transforms,
                             struct bone_matrix out[BONE_COUNT])
{
    for (int p = 0; p < BONE_COUNT; p++) {
        struct pose pose = pose_multiply(w->depth_from_color, transforms->bone[p]);
        quat_to_matrix(pose.rotation, out[p].turn);
        out[p].at = pose.translation;
    }
}

static struct vec3 rotated(const struct bone_matrix *by, struct vec3 v)
{
    const double(*m)[3] = by->turn;
    return v3(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
              m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z);
}

// Where a place of the surface is now; false: it is not at the outline, or not in the picture.
static bool project_candidate(const struct deformation *w, const struct deformation_model *m,
                              const struct bone_matrix matrices[BONE_COUNT], int point,
                              struct silhouette_candidate *out)
{
    const struct skin_weights *skin = &m->skins[point];
    struct vec3 p = v3(0, 0, 0), n = p, bind_point = m->surface->points[point];
    bind_point = v3_add(bind_point, deformation_current_shift(w, bind_point));
    for (int i = 0; i < SKIN_BONES; i++) {
        const struct bone_matrix *by = &matrices[skin->bone[i]];
        const double weight = (double)skin->weight[i];
        if (!(weight > 0))
            continue;
        p = v3_add(p, v3_scale(v3_add(rotated(by, bind_point), by->at), weight));
        n = v3_add(n, v3_scale(rotated(by, m->surface->normals[point]), weight));
    }
    const double along = v3_dot(n, p), n2 = v3_dot(n, n), flat = sqrt(n.x * n.x + n.y * n.y);
    if (!(p.z > 0.05) || along * along > GRAZING * GRAZING * n2 * v3_dot(p, p) || !(flat > 0.1 * sqrt(n2)))
        return false;
    *out = (struct silhouette_candidate){lens_project(&w->depth_lens, p), n.x / flat, n.y / flat, p.z, point, -1};
    return out->px.x >= 0 && out->px.y >= 0 && out->px.x < w->depth_lens.width && out->px.y < w->depth_lens.height;
}

// Sorts what may be at the outline into tiles of the picture. Who is not there in the first round is not asked again:
// shifts turn nothing.
static void find_candidates(struct deformation *w, const struct deformation_model *m,
                            const struct bone_transforms *transforms, bool first_iteration)
{
    const int asked = first_iteration ? m->surface->point_count : w->candidate_count;
    struct bone_matrix matrices[BONE_COUNT];
    compose_matrices(w, transforms, matrices);
    memset(w->tile, -1, sizeof *w->tile * (size_t)w->across * (size_t)w->down);
    w->candidate_count = 0;
    for (int i = 0; i < asked; i++) {
        struct silhouette_candidate b;
        if (!project_candidate(w, m, matrices, first_iteration ? i : w->candidates[i].point, &b))
            continue;
        int32_t *tile = &w->tile[(int)b.px.y / TILE_PX * w->across + (int)b.px.x / TILE_PX];
        b.next = *tile;
        *tile = w->candidate_count;
        w->candidates[w->candidate_count++] = b;
    }
}

// The brink nearest to the outline at px, which faces (nx, ny) there; NULL: none.
static const struct silhouette_candidate *nearest_candidate(const struct deformation *w,
                                                            const struct deformation_model *m, struct pixel px,
                                                            double nx, double ny, int part)
{
    const struct silhouette_candidate *best = NULL;
    double least = SEARCH_PX * SEARCH_PX;
    const int left = (int)fmax(px.x - SEARCH_PX, 0) / TILE_PX, right = (int)(px.x + SEARCH_PX) / TILE_PX;
    const int top = (int)fmax(px.y - SEARCH_PX, 0) / TILE_PX, bottom = (int)(px.y + SEARCH_PX) / TILE_PX;
    for (int y = top; y <= bottom && y < w->down; y++)
        for (int x = left; x <= right && x < w->across; x++)
            for (int b = w->tile[y * w->across + x]; b >= 0; b = w->candidates[b].next) {
                const struct silhouette_candidate *k = &w->candidates[b];
                double dx = k->px.x - px.x, dy = k->px.y - px.y, far = dx * dx + dy * dy;
                if (far >= least || k->nx * nx + k->ny * ny < 0.7 ||
                    !bones_adjacent((int)bone_part(m->skins[k->point].bone[0]), part))
                    continue;
                least = far;
                best = k;
            }
    return best;
}

static bool of_person(const struct depth_frame *s, int i) { return s->part[i] != DEPTH_FRAME_BACKGROUND; }

// Whether the room's pixel i is at the person's outline, and which way that faces there.
static bool find_contour_point(const struct depth_frame *s, int i, struct contour_point *out)
{
    static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    if (!of_person(s, i + 1) && !of_person(s, i - 1) && !of_person(s, i + s->width) && !of_person(s, i - s->width))
        return false;
    double nx = 0, ny = 0; // out of the person: where fewer pixels about are theirs
    for (int v = -2; v <= 2; v++)
        for (int u = -2; u <= 2; u++)
            if (of_person(s, i + v * s->width + u))
                nx -= u, ny -= v;
    double length = hypot(nx, ny);
    if (!(length > 4))
        return false;
    nx /= length, ny /= length;
    for (int k = 0; k < 4; k++) {
        const int inside = depth_frame_step_inside(s, i, steps[k][1] * s->width + steps[k][0]);
        if (inside < 0 || -(steps[k][0] * nx + steps[k][1] * ny) < 0.7)
            continue;
        double in = 0.5 - DEPTH_FRAME_RIM_PX; // from the room's pixel inwards
        struct pixel px = {i % s->width + in * steps[k][0], i / s->width + in * steps[k][1]};
        *out = (struct contour_point){px, nx, ny, s->part[inside]};
        return true;
    }
    return false;
}

// The person's outline in the picture; it does not change from round to round.
static void find_contour(struct deformation *w, const struct depth_frame *s)
{
    enum { MARGIN = DEPTH_FRAME_INWARD_PX + 1 };
    w->contour_count = 0;
    int top = s->top - 1 > MARGIN ? s->top - 1 : MARGIN, left = s->left - 1 > MARGIN ? s->left - 1 : MARGIN;
    for (int y = top; y <= s->bottom + 1 && y < s->height - MARGIN; y++)
        for (int x = left + (y - top) % SILHOUETTE_STRIDE_PX; x <= s->right + 1 && x < s->width - MARGIN;
             x += SILHOUETTE_STRIDE_PX) {
            int i = y * s->width + x;
            if (!of_person(s, i) && w->contour_count < POINTS &&
                find_contour_point(s, i, &w->contour[w->contour_count]))
                w->contour_count++;
        }
}

static void add_silhouette(struct deformation *w, const struct deformation_model *m)
{
    for (int i = 0; i < w->contour_count; i++) {
        const struct contour_point *e = &w->contour[i];
        const struct silhouette_candidate *b = nearest_candidate(w, m, e->px, e->nx, e->ny, e->part);
        if (!b)
            continue;
        double gap = ((e->px.x - b->px.x) * b->nx + (e->px.y - b->px.y) * b->ny) * b->z / w->depth_lens.fx;
        double outlier = SEARCH_PX / 2 * b->z / w->depth_lens.fx;
        double robust = outlier * outlier / (outlier * outlier + gap * gap);
        deformation_add_row(w, m->surface->points[b->point], m->surface->normals[b->point], gap,
                            robust * robust / (double)(SILHOUETTE_SIGMA_M * SILHOUETTE_SIGMA_M));
    }
}

// ---------------------------------------------------------------- least squares

// out = A x, A from the rows, the bends and the shifts' own smallness.
static void multiply(const struct deformation *w, const four *x, four *out)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    for (int i = 0; i < w->node_count; i++)
        out[i] = shift_weight * x[i];
    for (int i = 0; i < w->node_count; i++)
        for (int k = 0; k < 3; k++) {
            int j = w->neighbor[i][k];
            if (j < 0)
                continue;
            four apart = bend * (x[i] - x[j]);
            out[i] += apart;
            out[j] -= apart;
        }
    for (int r = 0; r < w->row_count; r++) {
        const struct deformation_row *row = &w->rows[r];
        four shift = {0};
        for (int c = 0; c < 8; c++)
            shift += row->share[c] * x[row->node[c]];
        shift *= row->n;
        four back = row->weight * (shift[0] + shift[1] + shift[2]) * row->n;
        for (int c = 0; c < 8; c++)
            out[row->node[c]] += row->share[c] * back;
    }
}

static void prepare(struct deformation *w)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    memset(w->rhs, 0, sizeof *w->rhs * (size_t)w->node_count);
    for (int i = 0; i < w->node_count; i++)
        w->diagonal[i] = (four){0} + (shift_weight + 6 * bend);
    for (int r = 0; r < w->row_count; r++) {
        const struct deformation_row *row = &w->rows[r];
        for (int c = 0; c < 8; c++) {
            four j = row->share[c] * row->n;
            w->rhs[row->node[c]] += row->weight * row->value * j;
            w->diagonal[row->node[c]] += row->weight * j * j;
        }
    }
}

static double total(const four_doubles *s) { return (*s)[0] + (*s)[1] + (*s)[2] + (*s)[3]; }

// Conjugate gradients, scaled by the diagonal, from the shifts as they are.
static void solve(struct deformation *w)
{
    const int count = w->node_count;
    four *x = w->shift, *r = w->residual, *d = w->direction, *q = w->product, *scale = w->diagonal;
    prepare(w);
    multiply(w, x, q);
    four_doubles sizes = {0};
    for (int i = 0; i < count; i++) {
        r[i] = w->rhs[i] - q[i];
        d[i] = r[i] / scale[i];
        sizes += __builtin_convertvector(r[i] * d[i], four_doubles);
    }
    double size = total(&sizes);
    for (int step = 0; step < STEPS && size > 0; step++) {
        multiply(w, d, q);
        four_doubles curves = {0}, nexts = {0};
        for (int i = 0; i < count; i++)
            curves += __builtin_convertvector(d[i] * q[i], four_doubles);
        float go = (float)(size / total(&curves));
        for (int i = 0; i < count; i++) {
            x[i] += go * d[i];
            r[i] -= go * q[i];
            nexts += __builtin_convertvector(r[i] * r[i] / scale[i], four_doubles);
        }
        double next = total(&nexts);
        float back = (float)(next / size);
        for (int i = 0; i < count; i++)
            d[i] = r[i] / scale[i] + back * d[i];
        size = next;
    }
}

void deformation_fit(struct deformation *w, const struct deformation_model *model,
                     const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                     const struct deformation_colors *colors)
{
    memset(w->shift, 0, sizeof *w->shift * (size_t)w->node_count);
    find_depth_samples(w, depth_frame, transforms);
    find_contour(w, depth_frame);
    for (int round = 0; round < ITERATIONS; round++) {
        w->row_count = 0;
        add_depth_samples(w, model->tsdf, OUTLIER_M[round]);
        find_candidates(w, model, transforms, round == 0);
        add_silhouette(w, model);
        if (colors && COLOR_SIGMA_PX[round] > 0)
            deformation_add_colors(w, model, depth_frame, transforms, colors, COLOR_SIGMA_PX[round]);
        solve(w);
    }
    write_quantized(w);
}
