#include "tests/world/training/training_figure.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_VERTICES = 1 << 20, MOST_TRIANGLES = 1 << 21 };

struct numbers {
    double height_m, woman, girth, joint[JOINT_COUNT][3], wrist[2][3], skull[3], arm[3], radius[JOINT_COUNT];
};

static struct vec3 point_of(const double at[3]) { return v3(at[0], at[1], at[2]); }

static bool read_array(FILE *from, void *to, size_t size, size_t count)
{
    return fread(to, size, count, from) == count;
}

static struct physique physique_from(const struct numbers *numbers)
{
    struct physique out = {.figure = {.height_m = numbers->height_m,
                                      .build = (numbers->girth - 0.84) / 0.42,
                                      .woman = numbers->woman > 0.5}};
    out.girth = numbers->girth;
    for (int j = 0; j < JOINT_COUNT; j++)
        out.bind_joint[j] = point_of(numbers->joint[j]);
    out.wrist[LEFT] = point_of(numbers->wrist[LEFT]);
    out.wrist[RIGHT] = point_of(numbers->wrist[RIGHT]);
    out.skull = point_of(numbers->skull);
    out.arm = point_of(numbers->arm);
    out.upper_arm_m = v3_distance(out.bind_joint[JOINT_LEFT_SHOULDER], out.bind_joint[JOINT_LEFT_ELBOW]);
    out.forearm_m = v3_distance(out.bind_joint[JOINT_LEFT_ELBOW], out.wrist[LEFT]);
    out.thigh_m = v3_distance(out.bind_joint[JOINT_LEFT_HIP], out.bind_joint[JOINT_LEFT_KNEE]);
    out.shin_m = v3_distance(out.bind_joint[JOINT_LEFT_KNEE], out.bind_joint[JOINT_LEFT_FOOT]);
    return out;
}

static bool numbers_are_possible(const struct numbers *numbers)
{
    const double *all = (const double *)numbers;
    for (size_t i = 0; i < sizeof *numbers / sizeof *all; i++)
        if (!isfinite(all[i]) || fabs(all[i]) > 3)
            return false;
    return numbers->height_m > 0.5 && v3_length(point_of(numbers->arm)) > 0.99;
}

static bool read_points(FILE *from, struct vec3f *points, size_t count)
{
    if (!read_array(from, points, sizeof *points, count))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!(fabsf(points[i].x) < 5 && fabsf(points[i].y) < 5 && fabsf(points[i].z) < 5))
            return false;
    return true;
}

static bool read_bindings(FILE *from, struct binding *bindings, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        bindings[i].open = 1;
        if (!read_array(from, bindings[i].weight, sizeof(float), BONES_A_VERTEX))
            return false;
        for (int k = 0; k < BONES_A_VERTEX; k++)
            if (!(bindings[i].weight[k] >= 0 && bindings[i].weight[k] <= 1.001f))
                return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (!read_array(from, bindings[i].bone, 1, BONES_A_VERTEX))
            return false;
        for (int k = 0; k < BONES_A_VERTEX; k++)
            if (bindings[i].bone[k] >= BONE_COUNT)
                return false;
    }
    return true;
}

static bool read_triangles(FILE *from, struct mesh *mesh)
{
    if (!read_array(from, mesh->triangles, sizeof *mesh->triangles, (size_t)mesh->triangle_count))
        return false;
    for (int i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            if (mesh->triangles[i][k] < 0 || mesh->triangles[i][k] >= mesh->vertex_count)
                return false;
    return true;
}

static enum status read_figure(FILE *from, const char *path, struct figure *out)
{
    char magic[4];
    int32_t counts[2];
    struct numbers numbers;
    if (!read_array(from, magic, 1, 4) || memcmp(magic, "RFG1", 4) || !read_array(from, counts, 4, 2) ||
        counts[0] < 1 || counts[0] > MOST_VERTICES || counts[1] < 1 || counts[1] > MOST_TRIANGLES ||
        !read_array(from, &numbers, sizeof numbers, 1) || !numbers_are_possible(&numbers))
        return fail(ERR_CORRUPT, "%s is no figure, or is damaged", path);
    const size_t vertices = (size_t)counts[0], triangles = (size_t)counts[1];
    out->physique = physique_from(&numbers);
    memcpy(out->joint_radius, numbers.radius, sizeof out->joint_radius);
    out->mesh = (struct mesh){.at = malloc(vertices * sizeof(struct vec3f)),
                              .normal = malloc(vertices * sizeof(struct vec3f)),
                              .vertex_count = counts[0],
                              .triangles = malloc(triangles * sizeof(int[3])),
                              .triangle_count = counts[1]};
    out->bindings = malloc(vertices * sizeof *out->bindings);
    if (!out->mesh.at || !out->mesh.normal || !out->mesh.triangles || !out->bindings)
        return fail(ERR_MEMORY, "no memory for the figure %s", path);
    if (!read_points(from, out->mesh.at, vertices) || !read_points(from, out->mesh.normal, vertices) ||
        !read_bindings(from, out->bindings, vertices) || !read_triangles(from, &out->mesh))
        return fail(ERR_CORRUPT, "%s is damaged", path);
    return OK;
}

enum status training_figure_read(struct figure *out, const char *path)
{
    *out = (struct figure){0};
    FILE *from = fopen(path, "rb");
    if (!from)
        return fail(errno == ENOENT ? ERR_MISSING : ERR_IO, "%s cannot be read", path);
    const enum status status = read_figure(from, path, out);
    fclose(from);
    if (status != OK)
        figure_free(out);
    return status;
}
