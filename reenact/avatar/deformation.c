#include "reenact/avatar/deformation.h"

#include "base/portable_math.h"
#include "reenact/observation/depth_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- silhouette constraint

// All chosen by hand.
enum { EVERY_PX = 2 };
static const float PRIOR_WEIGHT = 50;      // contacts: of no change, against a bone's mean gap
static const float LOCAL_PRIOR_WEIGHT = 5; // contacts: of the bone's mean gap, against the local one

// The part of the viewing ray that is searched, relative to the depth seen beside the silhouette.
static const double SEARCH_BEFORE_M = 0.05, SEARCH_BEHIND_M = 0.12, STEP_M = 0.01;
static const double MIN_GRADIENT = 0.3; // without unit; where it is less the distance field has no clear normal

// ---------------------------------------------------------------- silhouette points

static int find_at_pixel(const struct depth_frame *frame, int x, int y, struct silhouette_point *points, int capacity)
{
    static const int8_t steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const float out = 0.5F - (float)DEPTH_FRAME_RIM_PX; // from the background pixel inwards
    int count = 0;
    for (int k = 0; k < 4 && count < capacity; k++) {
        const int inside =
            depth_frame_step_inside(frame, y * frame->width + x, steps[k][1] * frame->width + steps[k][0]);
        if (inside >= 0)
            points[count++] =
                (struct silhouette_point){(float)x + out * (float)steps[k][0], (float)y + out * (float)steps[k][1],
                                          inside, steps[k][0], steps[k][1]};
    }
    return count;
}

// Stops when SILHOUETTE_POINTS_MAX are found.
static int find_with_stride(const struct depth_frame *frame, int every,
                            struct silhouette_point points[SILHOUETTE_POINTS_MAX])
{
    enum { MARGIN = DEPTH_FRAME_INWARD_PX + 1 };
    const int left = frame->left - 1 > MARGIN ? frame->left - 1 : MARGIN,
              top = frame->top - 1 > MARGIN ? frame->top - 1 : MARGIN;
    int count = 0;
    for (int y = top; y <= frame->bottom + 1 && y < frame->height - MARGIN; y++)
        for (int x = left + y % every; x <= frame->right + 1 && x < frame->width - MARGIN; x += every)
            if (frame->part[y * frame->width + x] == DEPTH_FRAME_BACKGROUND)
                count += find_at_pixel(frame, x, y, points + count, SILHOUETTE_POINTS_MAX - count);
    return count;
}

int silhouette_find_points(const struct depth_frame *depth_frame, struct silhouette_point points[SILHOUETTE_POINTS_MAX])
{
    int every = EVERY_PX, count;
    while ((count = find_with_stride(depth_frame, every, points)) == SILHOUETTE_POINTS_MAX)
        every++;
    return count;
}

int silhouette_point_bone(const struct bind_pose *bind_pose, const struct depth_frame *depth_frame,
                          const struct silhouette_point *point, const struct pose bind_from_color[BONE_COUNT])
{
    const struct vec3 beside = source_rays_point(depth_frame->rays, point->inside, depth_frame->depth[point->inside]);
    return bind_pose_bone_at(bind_pose, (enum part)depth_frame->part[point->inside], beside, bind_from_color);
}

bool silhouette_find_contact(const struct tsdf *tsdf, const struct calibration *calibration,
                             const struct depth_frame *depth_frame, const struct silhouette_point *point,
                             struct pose bind_from_color, struct silhouette_contact *out)
{
    const struct pose color_from_depth = calibration->color_from_depth;
    const struct pose bind_from_depth = pose_multiply(bind_from_color, color_from_depth);
    const struct vec3 ray = lens_ray(&calibration->depth, (struct pixel){(double)point->x, (double)point->y});
    const struct vec3 along = quat_rotate(bind_from_depth.rotation, ray);
    const double z = depth_frame->depth[point->inside] * 1e-3;
    double min = NAN, min_z = 0;
    struct vec3 normal = {0, 0, 0};
    for (double at = z - SEARCH_BEFORE_M; at <= z + SEARCH_BEHIND_M; at += STEP_M) {
        double distance, seen;
        struct vec3 gradient;
        if (tsdf_sample(tsdf, v3_add(bind_from_depth.translation, v3_scale(along, at)), &distance, &gradient, &seen) &&
            !(distance >= min))
            min = distance, min_z = at, normal = gradient;
    }
    if (isnan(min) || v3_length(normal) < MIN_GRADIENT)
        return false;
    *out =
        (struct silhouette_contact){.gap = min,
                                    .at = pose_apply(color_from_depth, v3_scale(ray, min_z)),
                                    .normal = v3_unit(normal),
                                    .inward = quat_rotate(color_from_depth.rotation, v3(point->in_x, point->in_y, 0))};
    return true;
}

// ---------------------------------------------------------------- thickness

void silhouette_measure(const struct tsdf *tsdf, const struct calibration *calibration,
                        const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                        struct silhouette_gaps *gaps)
{
    struct silhouette_point points[SILHOUETTE_POINTS_MAX];
    struct pose bind_from_color[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        bind_from_color[b] = pose_inverse(transforms->bone[b]);
    const int count = silhouette_find_points(depth_frame, points);
    for (int i = 0; i < count; i++) {
        const int bone = silhouette_point_bone(tsdf_bind_pose(tsdf), depth_frame, &points[i], bind_from_color);
        struct silhouette_contact contact;
        if (!tsdf_bind_pose(tsdf)->known[bone] ||
            !silhouette_find_contact(tsdf, calibration, depth_frame, &points[i], bind_from_color[bone], &contact))
            continue;
        const struct vec3 in_bind_pose = pose_apply(bind_from_color[bone], contact.at);
        const struct chart_sample here = chart_sample_at(&tsdf_bind_pose(tsdf)->frame[bone], in_bind_pose);
        bone_chart_add(&gaps->sum[bone], &here, (float)contact.gap);
        bone_chart_add(&gaps->count[bone], &here, 1);
    }
}

void silhouette_gaps_add(struct silhouette_gaps *to, const struct silhouette_gaps *gaps)
{
    for (int b = 0; b < BONE_COUNT; b++)
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++) {
            to->sum[b].at[i] += gaps->sum[b].at[i];
            to->count[b].at[i] += gaps->count[b].at[i];
        }
}

void tsdf_match_silhouettes(struct tsdf *tsdf, const struct silhouette_gaps *gaps)
{
    struct bone_chart out_m[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++) {
        struct bone_chart sum = gaps->sum[b], count = gaps->count[b];
        const float whole = (float)bone_chart_sum(&sum) / ((float)bone_chart_sum(&count) + PRIOR_WEIGHT);
        bone_chart_smooth(&sum);
        bone_chart_smooth(&count);
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
            out_m[b].at[i] = (sum.at[i] + LOCAL_PRIOR_WEIGHT * whole) / (count.at[i] + LOCAL_PRIOR_WEIGHT);
    }
    tsdf_offset(tsdf, out_m);
}

// ---------------------------------------------------------------- deformation, types

// x, y, z and an unused fourth component, so that processors can use their vector instructions.
typedef float four __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));

// One equation: sum of share[c] * dot(n, shift of node[c]) = value, metres; weight in 1/m².
struct deformation_row {
    four n;
    int32_t node[8];
    float share[8], value, weight;
};

// A depth sample of the actor, mapped into the bind pose by the bone that shows there.
struct deformation_sample {
    struct vec3 bind_point, ray; // ray: the viewing direction, unit, bind-pose axes
};

// A point of the actor's silhouette in the depth image.
struct contour_point {
    struct pixel px;
    double nx, ny; // outwards, unit
    int part;      // that is seen inside it
};

// A point of the surface that may project onto the silhouette.
struct silhouette_candidate {
    struct pixel px; // depth image
    double nx, ny;   // outwards in the image, unit
    double z;        // depth camera's axes, metres
    int point;       // of the surface
    int next;        // in the same tile; -1: none
};

// A point of the surface whose colour can be compared with the frame's image. Colours are gamma-encoded (square roots
// of linear ones), 0 to 1.
enum { DEFORMATION_COLOR_POINTS = 4000 };
struct color_point {
    struct vec3 bind_point, at; // at: colour camera's axes
    int bone;
    float known[3];                    // the avatar's colour there, under the frame's irradiance
    float seen[3], across[3], down[3]; // the smoothed image's colour there, and its change per pixel
};

struct deformation {
    struct bind_pose bind_pose;
    struct lens depth_lens;
    struct pose depth_from_color;
    struct deformation_grid grid;
    int32_t *node;          // of each grid point: number of its node; -1: none
    int32_t (*neighbor)[3]; // of each node: the next nodes in x, y, z; -1: none
    int node_count;
    four *shift;                                           // of each node
    four *rhs, *residual, *direction, *product, *diagonal; // the solver's
    struct deformation_row *rows;
    int row_count, row_max;
    struct deformation_sample *depth_samples;
    int sample_count;
    struct contour_point *contour;
    int contour_count;
    struct silhouette_candidate *candidates;
    int candidate_count;
    int32_t *tile;    // of the depth image: the first of its candidates; -1: none
    int across, down; // tiles
    struct color_point *color_points;
    int color_point_count;
    uint8_t *quantized; // of each grid point: x, y, z, unused; what deformation_at reads
};

// bind_point should move by `gap` metres along `normal` beyond its current shift.
struct deformation_constraint {
    struct vec3 bind_point, normal; // normal: unit, bind-pose axes
    double gap, weight;             // weight: 1/m²
};

// ---------------------------------------------------------------- deformation grid

struct deformation_grid deformation_grid_about(const struct surface_mesh *mesh)
{
    struct vec3 low = mesh->points[0], high = low;
    for (int i = 1; i < mesh->point_count; i++) {
        struct vec3 p = mesh->points[i];
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

bool deformation_grid_is_small(const struct surface_mesh *mesh)
{
    const struct deformation_grid g = deformation_grid_about(mesh);
    return (int64_t)g.size[0] * g.size[1] * g.size[2] <= DEFORMATION_POINTS_MAX;
}

// of its points
static int deformation_grid_count(const struct deformation_grid *grid)
{
    return grid->size[0] * grid->size[1] * grid->size[2];
}

static struct vec3 deformation_grid_point(const struct deformation_grid *grid, int at)
{
    return v3_add(grid->corner, v3_scale(v3(at % grid->size[0], at / grid->size[0] % grid->size[1],
                                            at / grid->size[0] / grid->size[1]),
                                         DEFORMATION_STEP_M));
}

// False: p lies outside the grid.
static bool deformation_grid_cell(const struct deformation_grid *grid, struct vec3 p, struct deformation_cell *out)
{
    const double q[3] = {(p.x - grid->corner.x) / DEFORMATION_STEP_M, (p.y - grid->corner.y) / DEFORMATION_STEP_M,
                         (p.z - grid->corner.z) / DEFORMATION_STEP_M};
    int cell[3];
    double in[3];
    for (int i = 0; i < 3; i++) {
        if (!(q[i] >= 0 && q[i] < grid->size[i] - 1))
            return false;
        cell[i] = (int)q[i];
        in[i] = q[i] - cell[i];
    }
    const int at = (cell[2] * grid->size[1] + cell[1]) * grid->size[0] + cell[0];
    for (int c = 0; c < 8; c++) {
        out->at[c] = at + (c & 1) + ((c >> 1 & 1) + (c >> 2) * grid->size[1]) * grid->size[0];
        out->weight[c] = 1;
        for (int i = 0; i < 3; i++)
            out->weight[c] *= c >> i & 1 ? in[i] : 1 - in[i];
    }
    return true;
}

// ---------------------------------------------------------------- deformation equations

// Linear least squares for the shifts of a deformation's nodes: rows of
// depth, silhouette and colours, smoothness and size priors, preconditioned conjugate gradients.

enum { STEPS = 20 }; // of conjugate gradients

// Standard deviations, metres; with the sigmas of the evidence they set its weight. Tuned by hand on the takes of
// docs/notes/avatar.md, where softer and stiffer ones were no better.
static const float SMOOTHNESS_M = 0.024F; // of the difference between neighbouring nodes' shifts
static const float SHIFT_PRIOR_M = 0.04F; // of each shift

// The shift of a point of the bind pose in the current iteration, not quantised.
static struct vec3 deformation_current_shift(const struct deformation *deformation, struct vec3 bind_point)
{
    struct vec3 sum = v3(0, 0, 0);
    struct deformation_cell cell;
    if (!deformation_grid_cell(&deformation->grid, bind_point, &cell))
        return sum;
    for (int c = 0; c < 8; c++) {
        int node = deformation->node[cell.at[c]];
        if (node < 0)
            continue;
        const four s = deformation->shift[node];
        sum = v3_add(sum, v3_scale(v3((double)s[0], (double)s[1], (double)s[2]), cell.weight[c]));
    }
    return sum;
}

// Drops a constraint outside the nodes, or where the rows are full.
static void deformation_add_row(struct deformation *deformation, const struct deformation_constraint *constraint)
{
    struct deformation_cell cell;
    if (deformation->row_count == deformation->row_max ||
        !deformation_grid_cell(&deformation->grid, constraint->bind_point, &cell))
        return;
    struct deformation_row *r = &deformation->rows[deformation->row_count];
    for (int c = 0; c < 8; c++) {
        r->node[c] = deformation->node[cell.at[c]];
        r->share[c] = (float)cell.weight[c];
        if (r->node[c] < 0)
            return;
    }
    r->n = (four){(float)constraint->normal.x, (float)constraint->normal.y, (float)constraint->normal.z, 0};
    r->value = (float)(v3_dot(constraint->normal, deformation_current_shift(deformation, constraint->bind_point)) +
                       constraint->gap);
    r->weight = (float)constraint->weight;
    deformation->row_count++;
}

// out = A x; A: the normal equations of the rows, of the smoothness between neighbours and of the shifts' prior.
static void multiply_normal_matrix(const struct deformation *deformation, const four *x, four *out)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    for (int i = 0; i < deformation->node_count; i++)
        out[i] = shift_weight * x[i];
    for (int i = 0; i < deformation->node_count; i++)
        for (int k = 0; k < 3; k++) {
            int j = deformation->neighbor[i][k];
            if (j < 0)
                continue;
            four apart = bend * (x[i] - x[j]);
            out[i] += apart;
            out[j] -= apart;
        }
    for (int r = 0; r < deformation->row_count; r++) {
        const struct deformation_row *row = &deformation->rows[r];
        four shift = {0};
        for (int c = 0; c < 8; c++)
            shift += row->share[c] * x[row->node[c]];
        shift *= row->n;
        four back = row->weight * (shift[0] + shift[1] + shift[2]) * row->n;
        for (int c = 0; c < 8; c++)
            out[row->node[c]] += row->share[c] * back;
    }
}

// The right-hand side, and the diagonal of A as preconditioner (6: of a node with all neighbours).
static void prepare_system(struct deformation *deformation)
{
    const float shift_weight = 1 / (SHIFT_PRIOR_M * SHIFT_PRIOR_M), bend = 1 / (SMOOTHNESS_M * SMOOTHNESS_M);
    memset(deformation->rhs, 0, sizeof *deformation->rhs * (size_t)deformation->node_count);
    for (int i = 0; i < deformation->node_count; i++)
        deformation->diagonal[i] = (four){0} + (shift_weight + 6 * bend);
    for (int r = 0; r < deformation->row_count; r++) {
        const struct deformation_row *row = &deformation->rows[r];
        for (int c = 0; c < 8; c++) {
            four j = row->share[c] * row->n;
            deformation->rhs[row->node[c]] += row->weight * row->value * j;
            deformation->diagonal[row->node[c]] += row->weight * j * j;
        }
    }
}

static double sum_lanes(const four_doubles *s) { return (*s)[0] + (*s)[1] + (*s)[2] + (*s)[3]; }

// Conjugate gradients with the diagonal as preconditioner. Dot products are summed in double, in a fixed order.
// Solves the rows for the shifts, starting from the current ones.
static void deformation_solve(struct deformation *deformation)
{
    const int count = deformation->node_count;
    four *x = deformation->shift, *r = deformation->residual, *d = deformation->direction, *q = deformation->product,
         *scale = deformation->diagonal;
    prepare_system(deformation);
    multiply_normal_matrix(deformation, x, q);
    four_doubles sizes = {0};
    for (int i = 0; i < count; i++) {
        r[i] = deformation->rhs[i] - q[i];
        d[i] = r[i] / scale[i];
        sizes += __builtin_convertvector(r[i] * d[i], four_doubles);
    }
    double size = sum_lanes(&sizes);
    for (int step = 0; step < STEPS && size > 0; step++) {
        multiply_normal_matrix(deformation, d, q);
        four_doubles curvature = {0}, nexts = {0};
        for (int i = 0; i < count; i++)
            curvature += __builtin_convertvector(d[i] * q[i], four_doubles);
        float alpha = (float)(size / sum_lanes(&curvature));
        for (int i = 0; i < count; i++) {
            x[i] += alpha * d[i];
            r[i] -= alpha * q[i];
            nexts += __builtin_convertvector(r[i] * r[i] / scale[i], four_doubles);
        }
        double next = sum_lanes(&nexts);
        float beta = (float)(next / size);
        for (int i = 0; i < count; i++)
            d[i] = r[i] / scale[i] + beta * d[i];
        size = next;
    }
}

// ---------------------------------------------------------------- deformation photometric

// The photometric term of the deformation: image gradients at the surface's points, as in direct image alignment.

enum { KERNEL_RADIUS_MAX = 8, EDGE_MARGIN_PX = 2 };

// Colours are gamma-encoded, 0 to 1. Tuned by hand on the takes of docs/results.md.
static const double COLOR_SIGMA = 0.08;      // standard deviation of a channel between frame and avatar
static const double COLOR_OUTLIER = 0.1;     // at this difference a channel's weight is a quarter
static const double MIN_COLOR_FACING = 0.35; // cosine: where the surface is more oblique, a pixel covers too much of it
static const double GRADIENT_MIN = 3;        // per metre: a weaker gradient does not locate the point

// ---------------------------------------------------------------- image samples

// A Gaussian along one axis: the weights of the pixels from `first` on, and their change as its centre moves by a
// pixel.
struct gaussian_kernel {
    int first, count;
    float weight[2 * KERNEL_RADIUS_MAX + 1], change[2 * KERNEL_RADIUS_MAX + 1], sum, change_sum;
};

static struct gaussian_kernel gaussian_at(double center, double sigma)
{
    const int reach = (int)ceil(2 * sigma);
    struct gaussian_kernel b = {.first = (int)floor(center + 0.5) - reach, .count = 2 * reach + 1};
    assert(reach <= KERNEL_RADIUS_MAX);
    for (int i = 0; i < b.count; i++) {
        const double off = (b.first + i - center) / sigma;
        b.weight[i] = (float)portable_exp(-0.5 * off * off);
        b.change[i] = b.weight[i] * (float)(off / sigma);
        b.sum += b.weight[i];
        b.change_sum += b.change[i];
    }
    return b;
}

// The smoothed image's colour and gradient at px. False: too near the image's edge.
static bool sample_image(const struct lens *lens, const uint8_t *rgb, struct pixel px, double sigma,
                         struct color_point *out)
{
    const struct gaussian_kernel x = gaussian_at(px.x, sigma), y = gaussian_at(px.y, sigma);
    if (x.first < 0 || y.first < 0 || x.first + x.count > lens->width || y.first + y.count > lens->height)
        return false;
    float sum[3] = {0}, across[3] = {0}, down[3] = {0};
    for (int j = 0; j < y.count; j++) {
        const uint8_t *row = rgb + 3 * ((size_t)(y.first + j) * (size_t)lens->width + (size_t)x.first);
        for (int c = 0; c < 3; c++) {
            float line = 0, line_change = 0;
            for (int i = 0; i < x.count; i++) {
                line += x.weight[i] * (float)row[3 * i + c];
                line_change += x.change[i] * (float)row[3 * i + c];
            }
            sum[c] += y.weight[j] * line;
            across[c] += y.weight[j] * line_change;
            down[c] += y.change[j] * line;
        }
    }
    const float all = 1 / (255 * x.sum * y.sum);
    for (int c = 0; c < 3; c++) {
        out->seen[c] = sum[c] * all;
        out->across[c] = across[c] * all - out->seen[c] * x.change_sum / x.sum;
        out->down[c] = down[c] * all - out->seen[c] * y.change_sum / y.sum;
    }
    return true;
}

// ---------------------------------------------------------------- points

// What colours are compared with, for one iteration.
struct photometric {
    struct deformation *w;
    const struct deformation_model *model;
    const struct depth_frame *depth_frame;
    const struct bone_transforms *transforms;
    const struct deformation_colors *colors;
    double sigma_px;
};

// False: the frame does not show the point, or only obliquely, or too near the image's edge.
static bool make_color_point(const struct photometric *photometric, int point, struct color_point *out)
{
    const struct deformation *deformation = photometric->w;
    const struct deformation_colors *colors = photometric->colors;
    const struct surface_mesh *surface = photometric->model->surface;
    const struct skin_weights *skin = &photometric->model->skins[point];
    struct vec3 n;
    out->bind_point = surface->points[point];
    out->bone = skin->bone[0];
    linear_blend_skin(skin, photometric->transforms,
                      v3_add(out->bind_point, deformation_current_shift(deformation, out->bind_point)),
                      surface->normals[point], &out->at, &n);
    if (!(out->at.z > 0.05) || -v3_dot(n, v3_unit(out->at)) < MIN_COLOR_FACING ||
        !depth_agrees_with_bone(photometric->depth_frame, &deformation->depth_lens,
                                pose_apply(deformation->depth_from_color, out->at), out->bone, EDGE_MARGIN_PX))
        return false;
    const struct lens *lens = &colors->calibration->color;
    const struct vec3 world = quat_rotate(colors->world_from_color, n);
    const float irradiance =
        sh_irradiance_at(colors->irradiance, (const float[3]){(float)world.x, (float)world.y, (float)world.z});
    for (int c = 0; c < 3; c++)
        out->known[c] = sqrtf(colors->albedo[point][c] * irradiance);
    return sample_image(lens, colors->rgb, lens_project(lens, out->at), photometric->sigma_px, out);
}

static void find_color_points(const struct photometric *photometric)
{
    struct deformation *deformation = photometric->w;
    const int points = photometric->model->surface->point_count, every = points / DEFORMATION_COLOR_POINTS + 1;
    deformation->color_point_count = 0;
    for (int i = 0; i < points; i += every)
        if (!photometric->colors->filled[i] &&
            make_color_point(photometric, i, &deformation->color_points[deformation->color_point_count]))
            deformation->color_point_count++;
}

// ---------------------------------------------------------------- rows

// The frame's brightness against the avatar's, least squares: exposure changes.
static float exposure_gain(const struct deformation *deformation)
{
    float both = 0, own = 0;
    for (int i = 0; i < deformation->color_point_count; i++)
        for (int c = 0; c < 3; c++) {
            const struct color_point *p = &deformation->color_points[i];
            both += p->seen[c] * p->known[c];
            own += p->known[c] * p->known[c];
        }
    return own > 0 ? both / own : 1;
}

// A row along the image gradient of channel c: how far the point should move for the image to show its known colour.
static void add_channel(const struct photometric *photometric, const struct color_point *point, int c, float gain)
{
    const struct lens *lens = &photometric->colors->calibration->color;
    const double x = (double)point->across[c] * lens->fx / point->at.z,
                 y = (double)point->down[c] * lens->fy / point->at.z;
    const struct vec3 change = {x, y,
                                -(x * point->at.x + y * point->at.y) / point->at.z}; // per metre, since px = f p / z
    const double size = v3_length(change), off = (double)(gain * point->known[c] - point->seen[c]);
    if (!(size > GRADIENT_MIN))
        return;
    const struct quat bind_from_color = quat_conjugate(photometric->transforms->bone[point->bone].rotation);
    const double robust = COLOR_OUTLIER * COLOR_OUTLIER / (COLOR_OUTLIER * COLOR_OUTLIER + off * off),
                 each = robust * size / COLOR_SIGMA;
    const struct vec3 normal = quat_rotate(bind_from_color, v3_scale(change, 1 / size));
    deformation_add_row(photometric->w,
                        &(struct deformation_constraint){point->bind_point, normal, off / size, each * each});
}

// Adds a row for each point and channel where the image, smoothed by sigma_px, has a gradient: move the surface so that
// the image shows the avatar's colours where they are.
static void deformation_add_colors(struct deformation *deformation, const struct deformation_model *model,
                                   const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                                   const struct deformation_colors *colors, double sigma_px)
{
    const struct photometric a = {deformation, model, depth_frame, transforms, colors, sigma_px};
    find_color_points(&a);
    const float gain = exposure_gain(deformation);
    for (int i = 0; i < deformation->color_point_count; i++)
        for (int c = 0; c < 3; c++)
            add_channel(&a, &deformation->color_points[i], c, gain);
}

// ---------------------------------------------------------------- deformation

enum { POINTS = 3000, ITERATIONS = 3, TILE_PX = 16, SILHOUETTE_STRIDE_PX = 2 };

// Tuned by hand on the takes of docs/results.md. Residuals are metres.
static const float DEPTH_SIGMA_M = 0.01F;      // standard deviation of a depth sample against the surface
static const float SILHOUETTE_SIGMA_M = 0.01F; // of a silhouette point
static const double OUTLIER_M[ITERATIONS] = {0.04, 0.03, 0.025}; // scale of the robust kernel (Geman-McClure)
static const double COLOR_SIGMA_PX[ITERATIONS] = {0, 2, 1.2}; // 0: no colours; first the shape has to be roughly right
static const double SEARCH_PX = 12;                           // how far from a silhouette point a candidate may project
static const double CERTAIN_FRAMES = 1; // a surface seen in as many frames has half of its full weight
static const double MIN_FACING = 0.1;   // cosine: surfaces that a depth sample can show face the camera
static const double GRAZING = 0.3;      // cosine: surfaces at most this frontal may be at the silhouette

// ---------------------------------------------------------------- nodes

// Nodes are the corners of the cells that the surface passes through, and all grid points inside the body.
static void find_nodes(struct deformation *deformation, const struct surface_mesh *surface)
{
    const struct deformation_grid *g = &deformation->grid;
    const int count = deformation_grid_count(g);
    struct deformation_cell cell;
    memset(deformation->node, -1, sizeof *deformation->node * (size_t)count);
    for (int i = 0; i < surface->point_count; i++)
        if (deformation_grid_cell(g, surface->points[i], &cell))
            for (int c = 0; c < 8; c++)
                deformation->node[cell.at[c]] = 0;
    deformation->node_count = 0;
    for (int i = 0; i < count; i++)
        if (deformation->node[i] == 0 || bind_pose_distance(&deformation->bind_pose, deformation_grid_point(g, i)) < 0)
            deformation->node[i] = deformation->node_count++;
}

static void connect_nodes(struct deformation *deformation)
{
    const struct deformation_grid *g = &deformation->grid;
    const int step[3] = {1, g->size[0], g->size[0] * g->size[1]};
    for (int i = 0; i < deformation_grid_count(g); i++) {
        const int at[3] = {i % g->size[0], i / g->size[0] % g->size[1], i / g->size[0] / g->size[1]};
        for (int a = 0; a < 3 && deformation->node[i] >= 0; a++)
            deformation->neighbor[deformation->node[i]][a] =
                at[a] + 1 < g->size[a] ? deformation->node[i + step[a]] : -1;
    }
}

enum status deformation_open(struct deformation **out, const struct bind_pose *bind_pose,
                             const struct surface_mesh *surface, const struct calibration *calibration)
{
    struct deformation *w = *out = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "no memory for the deformation");
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
    w->row_max = 3 * POINTS + 3 * DEFORMATION_COLOR_POINTS; // depth samples (2) and silhouette (1); colour channels
    w->rows = malloc(sizeof *w->rows * (size_t)w->row_max);
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
        return fail(ERR_MEMORY, "no memory for the deformation");
    }
    connect_nodes(w);
    deformation_clear(w);
    return OK;
}

void deformation_close(struct deformation **out)
{
    struct deformation *deformation = *out;
    if (!deformation)
        return;
    void *const all[] = {deformation->node,          deformation->neighbor, deformation->shift,
                         deformation->rhs,           deformation->residual, deformation->direction,
                         deformation->product,       deformation->diagonal, deformation->rows,
                         deformation->depth_samples, deformation->contour,  deformation->candidates,
                         deformation->color_points,  deformation->tile,     deformation->quantized};
    for (size_t i = 0; i < COUNT_OF(all); i++)
        free(all[i]);
    free(deformation);
    *out = NULL;
}

struct vec3 deformation_at(const struct deformation *deformation, struct vec3 bind_point)
{
    struct vec3 sum = v3(0, 0, 0);
    struct deformation_cell cell;
    if (!deformation_grid_cell(&deformation->grid, bind_point, &cell))
        return sum;
    for (int c = 0; c < 8; c++) {
        const uint8_t *t = deformation->quantized + 4 * cell.at[c];
        sum = v3_add(sum, v3_scale(v3(t[0] - 128, t[1] - 128, t[2] - 128), cell.weight[c]));
    }
    return v3_scale(sum, DEFORMATION_SHIFT_MAX_M / 127);
}

// For deformation_at: a component of DEFORMATION_SHIFT_MAX_M * t becomes 127 * t + 128, which is finer than shifts are
// known.
static void write_quantized(struct deformation *deformation)
{
    for (int i = 0; i < deformation_grid_count(&deformation->grid); i++) {
        uint8_t *t = deformation->quantized + 4 * i;
        memset(t, 128, 4);
        for (int a = 0; a < 3 && deformation->node[i] >= 0; a++) {
            double part = (double)deformation->shift[deformation->node[i]][a] / DEFORMATION_SHIFT_MAX_M;
            t[a] = (uint8_t)(128.5 + 127 * fmin(fmax(part, -1), 1));
        }
    }
}

void deformation_clear(struct deformation *deformation)
{
    memset(deformation->shift, 0, sizeof *deformation->shift * (size_t)deformation->node_count);
    write_quantized(deformation);
}

// ---------------------------------------------------------------- depth samples

// Maps a point of the colour camera's axes, seen on a part, into the bind pose, by blending the bones' inverse
// maps: near the inverse of the blended map where these are similar. *ray: its viewing direction there, unit.
static struct vec3 to_bind_pose(const struct deformation *deformation, const struct pose bind_from_color[BONE_COUNT],
                                int part, struct vec3 at, struct vec3 *ray)
{
    struct vec3 bind_point = pose_apply(
        bind_from_color[bind_pose_bone_at(&deformation->bind_pose, (enum part)part, at, bind_from_color)], at);
    struct skin_weights skin = bind_pose_skin_weights(&deformation->bind_pose, bind_point);
    struct vec3 mixed = v3(0, 0, 0), rotate_vector = v3(0, 0, 0);
    for (int i = 0; i < SKIN_BONES; i++) {
        mixed = v3_add(mixed, v3_scale(pose_apply(bind_from_color[skin.bone[i]], at), (double)skin.weight[i]));
        rotate_vector = v3_add(
            rotate_vector, v3_scale(quat_rotate(bind_from_color[skin.bone[i]].rotation, at), (double)skin.weight[i]));
    }
    *ray = v3_unit(rotate_vector);
    return mixed;
}

// The stride at which at most POINTS of the actor's pixels are used.
static int stride_px(const struct depth_frame *frame)
{
    long pixels = 0;
    for (int y = frame->top; y <= frame->bottom; y++)
        for (int x = frame->left; x <= frame->right; x++)
            pixels += frame->part[y * frame->width + x] < PART_COUNT;
    int every = 1;
    while (pixels / every / every > POINTS)
        every++;
    return every;
}

static void find_depth_samples(struct deformation *deformation, const struct depth_frame *frame,
                               const struct bone_transforms *transforms)
{
    struct pose bind_from_color[BONE_COUNT];
    for (int p = 0; p < BONE_COUNT; p++)
        bind_from_color[p] = pose_inverse(transforms->bone[p]);
    int every = stride_px(frame);
    deformation->sample_count = 0;
    for (int y = frame->top; y <= frame->bottom; y += every)
        for (int x = frame->left; x <= frame->right; x += every) {
            int i = y * frame->width + x, part = frame->part[i];
            if (part >= PART_COUNT || !deformation->bind_pose.known[part] || deformation->sample_count == 2 * POINTS)
                continue;
            struct deformation_sample *sample = &deformation->depth_samples[deformation->sample_count++];
            sample->bind_point = to_bind_pose(deformation, bind_from_color, part,
                                              source_rays_point(frame->rays, i, frame->depth[i]), &sample->ray);
        }
}

static void add_depth_samples(struct deformation *deformation, const struct tsdf *tsdf, double outlier)
{
    for (int i = 0; i < deformation->sample_count; i++) {
        const struct deformation_sample *sample = &deformation->depth_samples[i];
        struct vec3 gradient,
            bind_point = v3_sub(sample->bind_point, deformation_current_shift(deformation, sample->bind_point));
        double distance, seen;
        if (!tsdf_sample(tsdf, bind_point, &distance, &gradient, &seen) || v3_length(gradient) < 0.3)
            continue;
        struct vec3 n = v3_unit(gradient);
        if (-v3_dot(n, sample->ray) < MIN_FACING)
            continue;
        double robust = outlier * outlier / (outlier * outlier + distance * distance);
        const double weight =
            robust * robust * seen / (seen + CERTAIN_FRAMES) / (double)(DEPTH_SIGMA_M * DEPTH_SIGMA_M);
        deformation_add_row(deformation, &(struct deformation_constraint){bind_point, n, distance, weight});
    }
}

// ---------------------------------------------------------------- silhouette

// Maps a bone's bind pose into the depth camera's axes.
struct bone_matrix {
    double rotation[3][3];
    struct vec3 at;
};

static void compose_matrices(const struct deformation *deformation, const struct bone_transforms *transforms,
                             struct bone_matrix out[BONE_COUNT])
{
    for (int p = 0; p < BONE_COUNT; p++) {
        struct pose pose = pose_multiply(deformation->depth_from_color, transforms->bone[p]);
        quat_to_matrix(pose.rotation, out[p].rotation);
        out[p].at = pose.translation;
    }
}

static struct vec3 rotate_vector(const struct bone_matrix *by, struct vec3 v)
{
    const double(*m)[3] = by->rotation;
    return v3(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
              m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z);
}

// Projects a point of the surface; false: it cannot be at the silhouette, or is outside the image.
static bool project_candidate(const struct deformation *deformation, const struct deformation_model *model,
                              const struct bone_matrix matrices[BONE_COUNT], int point,
                              struct silhouette_candidate *out)
{
    const struct skin_weights *skin = &model->skins[point];
    struct vec3 p = v3(0, 0, 0), n = p, bind_point = model->surface->points[point];
    bind_point = v3_add(bind_point, deformation_current_shift(deformation, bind_point));
    for (int i = 0; i < SKIN_BONES; i++) {
        const struct bone_matrix *by = &matrices[skin->bone[i]];
        const double weight = (double)skin->weight[i];
        if (!(weight > 0))
            continue;
        p = v3_add(p, v3_scale(v3_add(rotate_vector(by, bind_point), by->at), weight));
        n = v3_add(n, v3_scale(rotate_vector(by, model->surface->normals[point]), weight));
    }
    const double along = v3_dot(n, p), n2 = v3_dot(n, n), flat = sqrt(n.x * n.x + n.y * n.y);
    if (!(p.z > 0.05) || along * along > GRAZING * GRAZING * n2 * v3_dot(p, p) || !(flat > 0.1 * sqrt(n2)))
        return false;
    *out = (struct silhouette_candidate){
        lens_project(&deformation->depth_lens, p), n.x / flat, n.y / flat, p.z, point, -1};
    return out->px.x >= 0 && out->px.y >= 0 && out->px.x < deformation->depth_lens.width &&
           out->px.y < deformation->depth_lens.height;
}

// Sorts the points that may be at the silhouette into tiles of the image. Points that are none in the first iteration
// are not tried again: shifts do not rotate normals.
static void find_candidates(struct deformation *deformation, const struct deformation_model *model,
                            const struct bone_transforms *transforms, bool first_iteration)
{
    const int tried = first_iteration ? model->surface->point_count : deformation->candidate_count;
    struct bone_matrix matrices[BONE_COUNT];
    compose_matrices(deformation, transforms, matrices);
    memset(deformation->tile, -1, sizeof *deformation->tile * (size_t)deformation->across * (size_t)deformation->down);
    deformation->candidate_count = 0;
    for (int i = 0; i < tried; i++) {
        struct silhouette_candidate b;
        if (!project_candidate(deformation, model, matrices, first_iteration ? i : deformation->candidates[i].point,
                               &b))
            continue;
        int32_t *tile = &deformation->tile[(int)b.px.y / TILE_PX * deformation->across + (int)b.px.x / TILE_PX];
        b.next = *tile;
        *tile = deformation->candidate_count;
        deformation->candidates[deformation->candidate_count++] = b;
    }
}

// The candidate nearest to a silhouette point that faces the same way within 45 degrees and is of the same part or an
// adjacent one; NULL: none.
static const struct silhouette_candidate *nearest_candidate(const struct deformation *deformation,
                                                            const struct deformation_model *model,
                                                            const struct contour_point *point)
{
    const struct pixel px = point->px;
    const struct silhouette_candidate *best = NULL;
    double min = SEARCH_PX * SEARCH_PX;
    const int left = (int)fmax(px.x - SEARCH_PX, 0) / TILE_PX, right = (int)(px.x + SEARCH_PX) / TILE_PX;
    const int top = (int)fmax(px.y - SEARCH_PX, 0) / TILE_PX, bottom = (int)(px.y + SEARCH_PX) / TILE_PX;
    for (int y = top; y <= bottom && y < deformation->down; y++)
        for (int x = left; x <= right && x < deformation->across; x++)
            for (int b = deformation->tile[y * deformation->across + x]; b >= 0; b = deformation->candidates[b].next) {
                const struct silhouette_candidate *candidate = &deformation->candidates[b];
                double dx = candidate->px.x - px.x, dy = candidate->px.y - px.y, far = dx * dx + dy * dy;
                if (far >= min || candidate->nx * point->nx + candidate->ny * point->ny < 0.7 ||
                    !bones_adjacent((int)bone_part(model->skins[candidate->point].bone[0]), point->part))
                    continue;
                min = far;
                best = candidate;
            }
    return best;
}

static bool is_actor(const struct depth_frame *frame, int i) { return frame->part[i] != DEPTH_FRAME_BACKGROUND; }

// Whether the background pixel i is beside the actor's silhouette, and the silhouette's point and normal there.
static bool find_contour_point(const struct depth_frame *frame, int i, struct contour_point *out)
{
    static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    if (!is_actor(frame, i + 1) && !is_actor(frame, i - 1) && !is_actor(frame, i + frame->width) &&
        !is_actor(frame, i - frame->width))
        return false;
    double nx = 0, ny = 0; // outwards: where fewer of the pixels around are the actor's
    for (int v = -2; v <= 2; v++)
        for (int u = -2; u <= 2; u++)
            if (is_actor(frame, i + v * frame->width + u))
                nx -= u, ny -= v;
    double length = portable_hypot(nx, ny);
    if (!(length > 4))
        return false;
    nx /= length, ny /= length;
    for (int k = 0; k < 4; k++) {
        const int inside = depth_frame_step_inside(frame, i, steps[k][1] * frame->width + steps[k][0]);
        if (inside < 0 || -(steps[k][0] * nx + steps[k][1] * ny) < 0.7)
            continue;
        double in = 0.5 - DEPTH_FRAME_RIM_PX; // from the background pixel inwards
        struct pixel px = {i % frame->width + in * steps[k][0], i / frame->width + in * steps[k][1]};
        *out = (struct contour_point){px, nx, ny, frame->part[inside]};
        return true;
    }
    return false;
}

// The actor's silhouette in the image; the same in every iteration.
static void find_contour(struct deformation *deformation, const struct depth_frame *frame)
{
    enum { MARGIN = DEPTH_FRAME_INWARD_PX + 1 };
    deformation->contour_count = 0;
    int top = frame->top - 1 > MARGIN ? frame->top - 1 : MARGIN,
        left = frame->left - 1 > MARGIN ? frame->left - 1 : MARGIN;
    for (int y = top; y <= frame->bottom + 1 && y < frame->height - MARGIN; y++)
        for (int x = left + (y - top) % SILHOUETTE_STRIDE_PX; x <= frame->right + 1 && x < frame->width - MARGIN;
             x += SILHOUETTE_STRIDE_PX) {
            int i = y * frame->width + x;
            if (!is_actor(frame, i) && deformation->contour_count < POINTS &&
                find_contour_point(frame, i, &deformation->contour[deformation->contour_count]))
                deformation->contour_count++;
        }
}

static void add_silhouette(struct deformation *deformation, const struct deformation_model *model)
{
    for (int i = 0; i < deformation->contour_count; i++) {
        const struct contour_point *point = &deformation->contour[i];
        const struct silhouette_candidate *candidate = nearest_candidate(deformation, model, point);
        if (!candidate)
            continue;
        double gap =
            ((point->px.x - candidate->px.x) * candidate->nx + (point->px.y - candidate->px.y) * candidate->ny) *
            candidate->z / deformation->depth_lens.fx;
        double outlier = SEARCH_PX / 2 * candidate->z / deformation->depth_lens.fx;
        double robust = outlier * outlier / (outlier * outlier + gap * gap);
        const double weight = robust * robust / (double)(SILHOUETTE_SIGMA_M * SILHOUETTE_SIGMA_M);
        deformation_add_row(deformation,
                            &(struct deformation_constraint){model->surface->points[candidate->point],
                                                             model->surface->normals[candidate->point], gap, weight});
    }
}

// ---------------------------------------------------------------- iterations

void deformation_fit(struct deformation *deformation, const struct deformation_model *model,
                     const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                     const struct deformation_colors *colors)
{
    memset(deformation->shift, 0, sizeof *deformation->shift * (size_t)deformation->node_count);
    find_depth_samples(deformation, depth_frame, transforms);
    find_contour(deformation, depth_frame);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        deformation->row_count = 0;
        add_depth_samples(deformation, model->tsdf, OUTLIER_M[iteration]);
        find_candidates(deformation, model, transforms, iteration == 0);
        add_silhouette(deformation, model);
        if (colors && COLOR_SIGMA_PX[iteration] > 0)
            deformation_add_colors(deformation, model, depth_frame, transforms, colors, COLOR_SIGMA_PX[iteration]);
        deformation_solve(deformation);
    }
    write_quantized(deformation);
}
