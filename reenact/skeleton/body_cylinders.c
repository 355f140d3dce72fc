// Affine maps and meshes of body cylinders.
#include "reenact/skeleton/body_cylinders.h"

#include "base/portable_math.h"

#include <stdlib.h>

// ---------------------------------------------------------------- bone chart

// Bilinear lookup, accumulation and smoothing of bone charts.

struct chart_sample chart_sample_at(const struct bone_frame *bone, struct vec3 point)
{
    const struct vec3 in = bone_frame_local_point(bone, point);
    const double margin = CHART_MARGIN, rows = CHART_HEIGHTS - 1;
    const double along = (in.z / bone->length + margin) / (1 + 2 * margin) * rows;
    const double height = along > 0 ? fmin(along, rows) : 0;
    const double angle = (portable_atan2(in.x, in.y) / 6.283185307179586 + 1) * CHART_ANGLES; // > 0
    const int row = height < rows ? (int)height : CHART_HEIGHTS - 2, column = (int)angle;
    struct chart_sample sample;
    for (int k = 0; k < 4; k++) {
        const double up = k >> 1 ? height - row : 1 - (height - row),
                     round = k & 1 ? angle - column : 1 - (angle - column);
        sample.index[k] = (row + (k >> 1)) * CHART_ANGLES + (column + (k & 1)) % CHART_ANGLES;
        sample.weight[k] = (float)(up * round);
    }
    return sample;
}

float bone_chart_at(const struct bone_chart *chart, const struct chart_sample *sample)
{
    float sum = 0;
    for (int k = 0; k < 4; k++)
        sum += sample->weight[k] * chart->at[sample->index[k]];
    return sum;
}

void bone_chart_add(struct bone_chart *chart, const struct chart_sample *sample, float value)
{
    for (int k = 0; k < 4; k++)
        chart->at[sample->index[k]] += sample->weight[k] * value;
}

double bone_chart_sum(const struct bone_chart *chart)
{
    double sum = 0;
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
        sum += (double)chart->at[i];
    return sum;
}

void bone_chart_smooth(struct bone_chart *chart)
{
    const struct bone_chart from = *chart;
    static const float weight[3] = {0.25F, 0.5F, 0.25F};
    for (int row = 0; row < CHART_HEIGHTS; row++)
        for (int column = 0; column < CHART_ANGLES; column++) {
            float sum = 0;
            for (int up = -1; up <= 1; up++)
                for (int round = -1; round <= 1 && row + up >= 0 && row + up < CHART_HEIGHTS; round++)
                    sum += weight[up + 1] * weight[round + 1] *
                           from.at[(row + up) * CHART_ANGLES + (column + round + CHART_ANGLES) % CHART_ANGLES];
            chart->at[row * CHART_ANGLES + column] = sum;
        }
}

// ---------------------------------------------------------------- body cylinders

static const double PI = 3.14159265358979323846;

struct affine_map cylinder_affine(const struct bone_frame *frame, double radius_m)
{
    struct vec3 x = v3_scale(frame->x, radius_m), y = v3_scale(frame->y, radius_m),
                z = v3_scale(frame->z, frame->length);
    return (struct affine_map){{
        {(float)x.x, (float)y.x, (float)z.x, (float)frame->origin.x},
        {(float)x.y, (float)y.y, (float)z.y, (float)frame->origin.y},
        {(float)x.z, (float)y.z, (float)z.z, (float)frame->origin.z},
    }};
}

struct affine_map affine_from_pose(struct pose a_from_b)
{
    double m[3][3];
    quat_to_matrix(a_from_b.rotation, m);
    const double t[3] = {a_from_b.translation.x, a_from_b.translation.y, a_from_b.translation.z};
    struct affine_map map;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            map.row[i][k] = (float)m[i][k];
        map.row[i][3] = (float)t[i];
    }
    return map;
}

struct affine_map affine_multiply(const struct affine_map *a, const struct affine_map *b)
{
    struct affine_map map;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++) {
            double sum = k == 3 ? a->row[i][3] : 0;
            for (int n = 0; n < 3; n++)
                sum += (double)a->row[i][n] * b->row[n][k];
            map.row[i][k] = (float)sum;
        }
    return map;
}

// Rings of a round end: its outline is as fine as the circle's.
static int cap_rings(enum cylinder_shape shape, int around) { return shape == CYLINDER_ROUNDED ? (around + 3) / 4 : 0; }

// Ring number i of `rings`, of which `caps` are of each end: its height and its radius.
static void ring_at(int caps, double cap, int i, int rings, double *z, double *radius)
{
    const int last = rings - 1;
    *radius = 1;
    if (i < caps) { // from the pole to the rim
        double a = PI / 2 * i / caps;
        *z = -cap * portable_cos(a);
        *radius = portable_sin(a);
    } else if (i > last - caps) {
        double a = PI / 2 * (last - i) / caps;
        *z = 1 + cap * portable_cos(a);
        *radius = portable_sin(a);
    } else {
        *z = (double)(i - caps) / (last - 2 * caps);
    }
}

// The triangles between `rings` rings of `around` vertices each: (rings - 1) * around * 6 indices.
static void fill_indices(uint16_t *index, int around, int rings)
{
    for (int i = 0; i + 1 < rings; i++)
        for (int k = 0; k < around; k++) {
            int a = i * around + k, b = i * around + (k + 1) % around;
            int corners[6] = {a, b, a + around, b, b + around, a + around};
            for (int c = 0; c < 6; c++)
                *index++ = (uint16_t)corners[c];
        }
}

enum status cylinder_mesh_make(enum cylinder_shape shape, double cap, int around, int along, struct cylinder_mesh *out)
{
    assert(around >= 3 && along >= 1 && cap >= 0);
    const int caps = cap_rings(shape, around), rings = along + 1 + 2 * caps;
    assert(rings * around <= 65536);
    *out = (struct cylinder_mesh){.vertex_count = rings * around, .index_count = (rings - 1) * around * 6};
    out->vertices = malloc(sizeof(float) * 3 * (size_t)out->vertex_count);
    out->indices = malloc(sizeof(uint16_t) * (size_t)out->index_count);
    if (!out->vertices || !out->indices) {
        cylinder_mesh_free(out);
        return fail(ERR_MEMORY, "no memory for the body's cylinders");
    }
    // Midway between the circle's inner and outer polygon.
    double grow = 2 / (1 + portable_cos(PI / around));
    float *v = out->vertices;
    for (int i = 0; i < rings; i++) {
        double z, radius;
        ring_at(caps, cap, i, rings, &z, &radius);
        for (int k = 0; k < around; k++) {
            *v++ = (float)(radius * grow * portable_cos(2 * PI * k / around));
            *v++ = (float)(radius * grow * portable_sin(2 * PI * k / around));
            *v++ = (float)z;
        }
    }
    fill_indices(out->indices, around, rings);
    return OK;
}

void cylinder_mesh_free(struct cylinder_mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->indices);
    *mesh = (struct cylinder_mesh){0};
}

int cylinder_sides(double radius_px, double error_px)
{
    // The polygon's edges lie within r (1 - cos(pi / n)) of the circle, halved by growing it.
    int sides = 8;
    while (sides < 64 && !(radius_px * (1 - portable_cos(PI / sides)) / 2 <= error_px))
        sides *= 2;
    return sides;
}
