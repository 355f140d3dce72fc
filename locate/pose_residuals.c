#include "locate/pose_residuals.h"

#include "base/linear_algebra.h"

#include <string.h>

// Robust costs of what lies behind the camera; chosen by hand, above what any visible outlier costs.
static const double BEHIND_TAG_COST = 1e6, BEHIND_POINT_COST = 100;

// Adds a whitened residual e with derivative `by`; weight: the slope of the kernel.
static void add_residual(struct pnp_equations *n, double e, const double by[POSE_VELOCITY_DOF], double weight)
{
    for (int i = 0; i < n->size; i++) {
        n->g[i] -= weight * by[i] * e;
        for (int j = 0; j <= i; j++)
            n->a[i * n->size + j] += weight * by[i] * by[j];
    }
}

// The derivative by the velocity: what was seen at time_s was seen from where the camera was then.
static void fill_velocity_jacobian(double by[POSE_VELOCITY_DOF], double time_s)
{
    for (int i = 0; i < POSE_DOF; i++)
        by[POSE_DOF + i] = -time_s * by[i];
}

// Corner errors in ideal pixels and their derivative by a small motion of the camera. False: a corner is not in
// front of the camera.
static bool corner_errors(const struct pnp_tag *tag, const struct pnp_projection *projection,
                          const struct pose *camera_from_tag, double e[8], double by[8][POSE_VELOCITY_DOF])
{
    const double fx = projection->fx, fy = projection->fy;
    double half = tag->side_m / 2;
    const double own[4][2] = {{-half, -half}, {half, -half}, {half, half}, {-half, half}};
    for (int k = 0; k < 4; k++) {
        double time_s = tag->seen->time_s[k];
        struct vec3 p =
            shutter_apply_motion(projection->motion, time_s, pose_apply(*camera_from_tag, v3(own[k][0], own[k][1], 0)));
        if (!(p.z > 1e-3))
            return false;
        double x = p.x / p.z, y = p.y / p.z, ux = fx / p.z, uy = fy / p.z;
        e[2 * k] = fx * (x - tag->seen->ray[k].x);
        e[2 * k + 1] = fy * (y - tag->seen->ray[k].y);
        const double row0[6] = {ux * -x * p.y, ux * (p.z + x * p.x), ux * -p.y, ux, 0, -ux * x};
        const double row1[6] = {uy * (-p.z - y * p.y), uy * y * p.x, uy * p.x, 0, uy, -uy * y};
        memcpy(by[2 * k], row0, sizeof row0);
        memcpy(by[2 * k + 1], row1, sizeof row1);
        fill_velocity_jacobian(by[2 * k], time_s);
        fill_velocity_jacobian(by[2 * k + 1], time_s);
    }
    return true;
}

// Depth samples inside one tag against the tag's plane. The row timing of the depth sensor, another camera, is not
// known, so its derivative by the velocity is 0.
static double add_depth(struct pnp_equations *n, const struct pnp_tag *tag, const struct pose *camera_from_tag)
{
    double cost = 0;
    struct vec3 normal = quat_rotate(camera_from_tag->rotation, v3(0, 0, 1));
    double offset = v3_dot(normal, camera_from_tag->translation);
    for (int i = 0; i < tag->depth->count; i++) {
        const struct depth_sample *s = &tag->depth->sample[i];
        struct vec3 ray = v3(s->x, s->y, 1);
        double slant = v3_dot(normal, ray), sigma = depth_absolute_sigma_m(s->z);
        if (!(fabs(slant) > 1e-3))
            continue;
        double z = offset / slant, e = (z - s->z) / sigma;
        struct vec3 rotation = v3_scale(v3_cross(normal, ray), -z / slant), translation = v3_scale(normal, 1 / slant);
        double by[POSE_VELOCITY_DOF] = {rotation.x / sigma,    rotation.y / sigma,    rotation.z / sigma,
                                        translation.x / sigma, translation.y / sigma, translation.z / sigma};
        double ratio = 1 + e * e / (CAUCHY_SCALE * CAUCHY_SCALE);
        add_residual(n, e, by, tag->depth->share / ratio);
        cost += tag->depth->share * CAUCHY_SCALE * CAUCHY_SCALE * log(ratio);
    }
    return cost;
}

// Adds J C Jᵀ: the map's covariance C of the tag's pose, by which its corners err together.
static void add_map_error(const struct pnp_tag *tag, const struct pose *camera_from_world,
                          const struct pnp_projection *projection, double covariance[64])
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double half = tag->side_m / 2, rotation[3][3], by[8][6], times[8][6];
    quat_to_matrix(camera_from_tag.rotation, rotation);
    for (int k = 0; k < 4; k++) {
        const struct vec3 own = {k == 1 || k == 2 ? half : -half, k >= 2 ? half : -half, 0};
        struct vec3 p = pose_apply(camera_from_tag, own);
        if (!(p.z > 1e-3))
            return;
        for (int row = 0; row < 2; row++) {
            double f = row ? projection->fy : projection->fx, off = (row ? p.y : p.x) / p.z, *d = by[2 * k + row];
            for (int i = 0; i < 3; i++)
                d[3 + i] = f / p.z * (rotation[row][i] - off * rotation[2][i]);
            d[0] = own.y * d[5];
            d[1] = -own.x * d[5];
            d[2] = own.x * d[4] - own.y * d[3];
        }
    }
    memset(times, 0, sizeof times);
    for (int a = 0, i = 0; a < 6; a++)
        for (int b = a; b < 6; b++, i++)
            for (int r = 0; r < 8; r++) {
                times[r][a] += (double)tag->covariance[i] * by[r][b];
                if (a != b)
                    times[r][b] += (double)tag->covariance[i] * by[r][a];
            }
    for (int r = 0; r < 8; r++)
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 6; i++)
                covariance[r * 8 + c] += times[r][i] * by[c][i];
}

void pnp_corner_information(const struct pnp_tag *tag, double extra_px, const struct pose *camera_from_world,
                            const struct pnp_projection *projection, struct corner_information *information)
{
    double *out = information->a;
    memset(out, 0, sizeof information->a);
    double covariance[64], variance = extra_px * extra_px;
    if (extra_px < 1 && invert_symmetric(&tag->seen->information[0][0], 8, covariance)) {
        for (int i = 0; i < 8; i++)
            covariance[i * 8 + i] += variance + tag->map_px * tag->map_px;
        if (tag->covariance)
            add_map_error(tag, camera_from_world, projection, covariance);
        if (invert_symmetric(covariance, 8, out))
            return;
    }
    for (int i = 0; i < 8; i++)
        out[i * 8 + i] = 1 / (variance + 0.25);
}

double pnp_add_tag(struct pnp_equations *n, const struct pnp_tag *tag, const struct corner_information *information,
                   const struct pnp_projection *projection, const struct pose *camera_from_world, bool with_depth)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    double e[8], by[8][POSE_VELOCITY_DOF], weighted[8], chi2 = 0;
    if (!corner_errors(tag, projection, &camera_from_tag, e, by))
        return BEHIND_TAG_COST;
    for (int i = 0; i < 8; i++) {
        weighted[i] = 0;
        for (int j = 0; j < 8; j++)
            weighted[i] += information->a[i * 8 + j] * e[j];
        chi2 += weighted[i] * e[i];
    }
    double bound = 8 * CAUCHY_SCALE * CAUCHY_SCALE, slope = 1 / (1 + chi2 / bound);
    for (int a = 0; a < n->size; a++) {
        double half[8]; // information * column a
        for (int i = 0; i < 8; i++) {
            half[i] = 0;
            for (int j = 0; j < 8; j++)
                half[i] += information->a[i * 8 + j] * by[j][a];
            n->g[a] -= slope * half[i] * e[i];
        }
        for (int b = 0; b <= a; b++)
            for (int i = 0; i < 8; i++)
                n->a[a * n->size + b] += slope * half[i] * by[i][b];
    }
    double cost = bound * log(1 + chi2 / bound);
    return tag->depth && with_depth ? cost + add_depth(n, tag, &camera_from_tag) : cost;
}

double pnp_add_point(struct pnp_equations *n, const struct pnp_point *point, double extra_px,
                     const struct pnp_projection *projection, const struct pose *camera_from_world)
{
    const double fx = projection->fx, fy = projection->fy;
    struct vec3 p =
        shutter_apply_motion(projection->motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return BEHIND_POINT_COST;
    // [a 0; b c] whitens an error in pixels: the inverse of its covariance's Cholesky factor.
    double variance = point->sigma_px * point->sigma_px + extra_px * extra_px, xx = variance + point->covariance[0];
    double a = 1 / sqrt(xx),
           c = 1 / sqrt(variance + point->covariance[2] - point->covariance[1] * point->covariance[1] / xx);
    double b = -c * point->covariance[1] / xx;
    double x = p.x / p.z, y = p.y / p.z, ux = fx / p.z, uy = fy / p.z;
    double off_x = fx * (x - point->x), off_y = fy * (y - point->y), ex = a * off_x, ey = b * off_x + c * off_y;
    const double by_x[6] = {ux * -x * p.y, ux * (p.z + x * p.x), ux * -p.y, ux, 0, -ux * x};
    const double by_y[6] = {uy * (-p.z - y * p.y), uy * y * p.x, uy * p.x, 0, uy, -uy * y};
    double row0[POSE_VELOCITY_DOF], row1[POSE_VELOCITY_DOF];
    for (int i = 0; i < POSE_DOF; i++) {
        row0[i] = a * by_x[i];
        row1[i] = b * by_x[i] + c * by_y[i];
    }
    fill_velocity_jacobian(row0, point->time_s);
    fill_velocity_jacobian(row1, point->time_s);
    double bound = CAUCHY_SCALE * CAUCHY_SCALE, chi2 = ex * ex + ey * ey, ez = 0, depth = 0;
    if (point->z > 0) {
        depth = 1 / (sqrt(pow(depth_absolute_sigma_m(point->z), 2) + point->z_variance) + extra_px * p.z / fx);
        ez = (p.z - point->z) * depth;
        chi2 += ez * ez;
    }
    double slope = 1 / (1 + chi2 / bound);
    add_residual(n, ex, row0, slope);
    add_residual(n, ey, row1, slope);
    if (point->z > 0) {
        const double row2[POSE_VELOCITY_DOF] = {p.y * depth, -p.x * depth, 0, 0, 0, depth};
        add_residual(n, ez, row2, slope);
    }
    return bound * log(1 + chi2 / bound);
}

double pnp_tag_cost(const struct pnp_tag *tag, const struct pose *camera_from_world, double extra_px, double fx,
                    double fy)
{
    struct pnp_equations n = {.size = POSE_DOF};
    const struct pnp_projection projection = {.fx = fx, .fy = fy};
    struct corner_information information;
    pnp_corner_information(tag, extra_px, camera_from_world, &projection, &information);
    return pnp_add_tag(&n, tag, &information, &projection, camera_from_world, true);
}

double pnp_point_error(const struct pnp_point *point, const struct shutter_motion *motion,
                       const struct pose *camera_from_world, double fx, double fy)
{
    struct vec3 p = shutter_apply_motion(motion, point->time_s, pose_apply(*camera_from_world, point->world));
    if (!(p.z > 1e-2))
        return PNP_NOT_VISIBLE;
    double x = fx * (p.x / p.z - point->x), y = fy * (p.y / p.z - point->y);
    double variance = point->sigma_px * point->sigma_px;
    double xx = variance + point->covariance[0], xy = point->covariance[1], yy = variance + point->covariance[2];
    return sqrt((yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy));
}

double pnp_tag_rms(const struct pnp_tag *tag, const struct shutter_motion *motion, const struct pose *camera_from_world,
                   double fx, double fy)
{
    struct pose camera_from_tag = pose_multiply(*camera_from_world, tag->world_from_tag);
    const struct pnp_projection projection = {fx, fy, motion};
    double e[8], by[8][POSE_VELOCITY_DOF], sum = 0;
    if (!corner_errors(tag, &projection, &camera_from_tag, e, by))
        return PNP_NOT_VISIBLE;
    for (int i = 0; i < 8; i++)
        sum += e[i] * e[i];
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    return v3_dot(normal, camera_from_tag.translation) < 0 ? sqrt(sum / 4) : PNP_NOT_VISIBLE; // its face
}
