#include "reenact/avatar/deformation_internal.h"
#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

enum { POINTS = 3000, ITERATIONS = 3, TILE_PX = 16, SILHOUETTE_STRIDE_PX = 2 };

// Tuned by hand on the takes of docs/results.md. Residuals are metres.
static const float DEPTH_SIGMA_M = 0.01F;      // standard deviation of a depth sample against the surface
static const float SILHOUETTE_SIGMA_M = 0.01F; // of a silhouette point
static const double OUTLIER_M[ITERATIONS] = {0.04, 0.03, 0.025}; // scale of the robust kernel (Geman-McClure)
static const double COLOR_SIGMA_PX[ITERATIONS] = {0, 2, 1.2}; // 0: no colours; first the shape has to be roughly right
static const double SEARCH_PX = 12;                           // how far from a silhouette point a candidate may project
static const double CERTAIN_FRAMES = 1; // a surface seen in as many frames has half of its full weight
static const double LEAST_FACING = 0.1; // cosine: surfaces that a depth sample can show face the camera
static const double GRAZING = 0.3;      // cosine: surfaces at most this frontal may be at the silhouette

// ---------------------------------------------------------------- nodes

// Nodes are the corners of the cells that the surface passes through, and all grid points inside the body.
static void find_nodes(struct deformation *w, const struct surface_mesh *surface)
{
    const struct deformation_grid *g = &w->grid;
    const int count = deformation_grid_count(g);
    struct deformation_cell cell;
    memset(w->node, -1, sizeof *w->node * (size_t)count);
    for (int i = 0; i < surface->point_count; i++)
        if (deformation_grid_cell(g, surface->points[i], &cell))
            for (int c = 0; c < 8; c++)
                w->node[cell.at[c]] = 0;
    w->node_count = 0;
    for (int i = 0; i < count; i++)
        if (w->node[i] == 0 || bind_pose_distance(&w->bind_pose, deformation_grid_point(g, i)) < 0)
            w->node[i] = w->node_count++;
}

static void connect_nodes(struct deformation *w)
{
    const struct deformation_grid *g = &w->grid;
    const int step[3] = {1, g->size[0], g->size[0] * g->size[1]};
    for (int i = 0; i < deformation_grid_count(g); i++) {
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
    w->grid = deformation_grid_about(surface);
    size_t count = (size_t)deformation_grid_count(&w->grid);
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
    w->row_most = 3 * POINTS + 3 * DEFORMATION_COLOR_POINTS; // depth samples (2) and silhouette (1); colour channels
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
    connect_nodes(w);
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
    struct deformation_cell cell;
    if (!deformation_grid_cell(&w->grid, bind_point, &cell))
        return sum;
    for (int c = 0; c < 8; c++) {
        const uint8_t *t = w->quantized + 4 * cell.at[c];
        sum = v3_add(sum, v3_scale(v3(t[0] - 128, t[1] - 128, t[2] - 128), cell.weight[c]));
    }
    return v3_scale(sum, DEFORMATION_SHIFT_MOST_M / 127);
}

// For deformation_at: a component of DEFORMATION_SHIFT_MOST_M * t becomes 127 * t + 128, which is finer than shifts are
// known.
static void write_quantized(struct deformation *w)
{
    for (int i = 0; i < deformation_grid_count(&w->grid); i++) {
        uint8_t *t = w->quantized + 4 * i;
        memset(t, 128, 4);
        for (int a = 0; a < 3 && w->node[i] >= 0; a++) {
            double part = (double)w->shift[w->node[i]][a] / DEFORMATION_SHIFT_MOST_M;
            t[a] = (uint8_t)(128.5 + 127 * fmin(fmax(part, -1), 1));
        }
    }
}

void deformation_clear(struct deformation *w)
{
    memset(w->shift, 0, sizeof *w->shift * (size_t)w->node_count);
    write_quantized(w);
}

// ---------------------------------------------------------------- depth samples

// Maps a point of the colour camera's axes, seen on a part, into the bind pose, by blending the bones' inverse
// maps: near the inverse of the blended map where these are similar. *ray: its viewing direction there, unit.
static struct vec3 to_bind_pose(const struct deformation *w, const struct pose bind_from_color[BONE_COUNT], int part,
                                struct vec3 at, struct vec3 *ray)
{
    struct vec3 bind_point =
        pose_apply(bind_from_color[bind_pose_bone_at(&w->bind_pose, (enum part)part, at, bind_from_color)], at);
    struct skin_weights skin = bind_pose_skin_weights(&w->bind_pose, bind_point);
    struct vec3 mixed = v3(0, 0, 0), rotated = v3(0, 0, 0);
    for (int i = 0; i < SKIN_BONES; i++) {
        mixed = v3_add(mixed, v3_scale(pose_apply(bind_from_color[skin.bone[i]], at), (double)skin.weight[i]));
        rotated =
            v3_add(rotated, v3_scale(quat_rotate(bind_from_color[skin.bone[i]].rotation, at), (double)skin.weight[i]));
    }
    *ray = v3_unit(rotated);
    return mixed;
}

// The stride at which at most POINTS of the actor's pixels are used.
static int stride_px(const struct depth_frame *s)
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
    struct pose bind_from_color[BONE_COUNT];
    for (int p = 0; p < BONE_COUNT; p++)
        bind_from_color[p] = pose_inverse(transforms->bone[p]);
    int every = stride_px(s);
    w->sample_count = 0;
    for (int y = s->top; y <= s->bottom; y += every)
        for (int x = s->left; x <= s->right; x += every) {
            int i = y * s->width + x, part = s->part[i];
            if (part >= PART_COUNT || !w->bind_pose.known[part] || w->sample_count == 2 * POINTS)
                continue;
            struct deformation_sample *r = &w->depth_samples[w->sample_count++];
            r->bind_point = to_bind_pose(w, bind_from_color, part, source_rays_point(s->rays, i, s->depth[i]), &r->ray);
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
        const double weight =
            robust * robust * seen / (seen + CERTAIN_FRAMES) / (double)(DEPTH_SIGMA_M * DEPTH_SIGMA_M);
        deformation_add_row(w, &(struct deformation_constraint){bind_point, n, distance, weight});
    }
}

// ---------------------------------------------------------------- silhouette

// Maps a bone's bind pose into the depth camera's axes.
struct bone_matrix {
    double rotation[3][3];
    struct vec3 at;
};

static void compose_matrices(const struct deformation *w, const struct bone_transforms *transforms,
                             struct bone_matrix out[BONE_COUNT])
{
    for (int p = 0; p < BONE_COUNT; p++) {
        struct pose pose = pose_multiply(w->depth_from_color, transforms->bone[p]);
        quat_to_matrix(pose.rotation, out[p].rotation);
        out[p].at = pose.translation;
    }
}

static struct vec3 rotated(const struct bone_matrix *by, struct vec3 v)
{
    const double(*m)[3] = by->rotation;
    return v3(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
              m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z);
}

// Projects a point of the surface; false: it cannot be at the silhouette, or is outside the image.
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

// Sorts the points that may be at the silhouette into tiles of the image. Points that are none in the first iteration
// are not tried again: shifts do not rotate normals.
static void find_candidates(struct deformation *w, const struct deformation_model *m,
                            const struct bone_transforms *transforms, bool first_iteration)
{
    const int tried = first_iteration ? m->surface->point_count : w->candidate_count;
    struct bone_matrix matrices[BONE_COUNT];
    compose_matrices(w, transforms, matrices);
    memset(w->tile, -1, sizeof *w->tile * (size_t)w->across * (size_t)w->down);
    w->candidate_count = 0;
    for (int i = 0; i < tried; i++) {
        struct silhouette_candidate b;
        if (!project_candidate(w, m, matrices, first_iteration ? i : w->candidates[i].point, &b))
            continue;
        int32_t *tile = &w->tile[(int)b.px.y / TILE_PX * w->across + (int)b.px.x / TILE_PX];
        b.next = *tile;
        *tile = w->candidate_count;
        w->candidates[w->candidate_count++] = b;
    }
}

// The candidate nearest to a silhouette point that faces the same way within 45 degrees and is of the same part or an
// adjacent one; NULL: none.
static const struct silhouette_candidate *
nearest_candidate(const struct deformation *w, const struct deformation_model *m, const struct contour_point *e)
{
    const struct pixel px = e->px;
    const struct silhouette_candidate *best = NULL;
    double least = SEARCH_PX * SEARCH_PX;
    const int left = (int)fmax(px.x - SEARCH_PX, 0) / TILE_PX, right = (int)(px.x + SEARCH_PX) / TILE_PX;
    const int top = (int)fmax(px.y - SEARCH_PX, 0) / TILE_PX, bottom = (int)(px.y + SEARCH_PX) / TILE_PX;
    for (int y = top; y <= bottom && y < w->down; y++)
        for (int x = left; x <= right && x < w->across; x++)
            for (int b = w->tile[y * w->across + x]; b >= 0; b = w->candidates[b].next) {
                const struct silhouette_candidate *k = &w->candidates[b];
                double dx = k->px.x - px.x, dy = k->px.y - px.y, far = dx * dx + dy * dy;
                if (far >= least || k->nx * e->nx + k->ny * e->ny < 0.7 ||
                    !bones_adjacent((int)bone_part(m->skins[k->point].bone[0]), e->part))
                    continue;
                least = far;
                best = k;
            }
    return best;
}

static bool is_actor(const struct depth_frame *s, int i) { return s->part[i] != DEPTH_FRAME_BACKGROUND; }

// Whether the background pixel i is beside the actor's silhouette, and the silhouette's point and normal there.
static bool find_contour_point(const struct depth_frame *s, int i, struct contour_point *out)
{
    static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    if (!is_actor(s, i + 1) && !is_actor(s, i - 1) && !is_actor(s, i + s->width) && !is_actor(s, i - s->width))
        return false;
    double nx = 0, ny = 0; // outwards: where fewer of the pixels around are the actor's
    for (int v = -2; v <= 2; v++)
        for (int u = -2; u <= 2; u++)
            if (is_actor(s, i + v * s->width + u))
                nx -= u, ny -= v;
    double length = portable_hypot(nx, ny);
    if (!(length > 4))
        return false;
    nx /= length, ny /= length;
    for (int k = 0; k < 4; k++) {
        const int inside = depth_frame_step_inside(s, i, steps[k][1] * s->width + steps[k][0]);
        if (inside < 0 || -(steps[k][0] * nx + steps[k][1] * ny) < 0.7)
            continue;
        double in = 0.5 - DEPTH_FRAME_RIM_PX; // from the background pixel inwards
        struct pixel px = {i % s->width + in * steps[k][0], i / s->width + in * steps[k][1]};
        *out = (struct contour_point){px, nx, ny, s->part[inside]};
        return true;
    }
    return false;
}

// The actor's silhouette in the image; the same in every iteration.
static void find_contour(struct deformation *w, const struct depth_frame *s)
{
    enum { MARGIN = DEPTH_FRAME_INWARD_PX + 1 };
    w->contour_count = 0;
    int top = s->top - 1 > MARGIN ? s->top - 1 : MARGIN, left = s->left - 1 > MARGIN ? s->left - 1 : MARGIN;
    for (int y = top; y <= s->bottom + 1 && y < s->height - MARGIN; y++)
        for (int x = left + (y - top) % SILHOUETTE_STRIDE_PX; x <= s->right + 1 && x < s->width - MARGIN;
             x += SILHOUETTE_STRIDE_PX) {
            int i = y * s->width + x;
            if (!is_actor(s, i) && w->contour_count < POINTS && find_contour_point(s, i, &w->contour[w->contour_count]))
                w->contour_count++;
        }
}

static void add_silhouette(struct deformation *w, const struct deformation_model *m)
{
    for (int i = 0; i < w->contour_count; i++) {
        const struct contour_point *e = &w->contour[i];
        const struct silhouette_candidate *b = nearest_candidate(w, m, e);
        if (!b)
            continue;
        double gap = ((e->px.x - b->px.x) * b->nx + (e->px.y - b->px.y) * b->ny) * b->z / w->depth_lens.fx;
        double outlier = SEARCH_PX / 2 * b->z / w->depth_lens.fx;
        double robust = outlier * outlier / (outlier * outlier + gap * gap);
        const double weight = robust * robust / (double)(SILHOUETTE_SIGMA_M * SILHOUETTE_SIGMA_M);
        deformation_add_row(w, &(struct deformation_constraint){m->surface->points[b->point],
                                                                m->surface->normals[b->point], gap, weight});
    }
}

// ---------------------------------------------------------------- iterations

void deformation_fit(struct deformation *w, const struct deformation_model *model,
                     const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                     const struct deformation_colors *colors)
{
    memset(w->shift, 0, sizeof *w->shift * (size_t)w->node_count);
    find_depth_samples(w, depth_frame, transforms);
    find_contour(w, depth_frame);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        w->row_count = 0;
        add_depth_samples(w, model->tsdf, OUTLIER_M[iteration]);
        find_candidates(w, model, transforms, iteration == 0);
        add_silhouette(w, model);
        if (colors && COLOR_SIGMA_PX[iteration] > 0)
            deformation_add_colors(w, model, depth_frame, transforms, colors, COLOR_SIGMA_PX[iteration]);
        deformation_solve(w);
    }
    write_quantized(w);
}
