#include "locate/pose_fusion.h"

#include "base/linear_algebra.h"

#include <string.h>

// ---------------------------------------------------------------- pose kalman

// Process noise of a hand: white acceleration, rad/s^2 and m/s^2 times the root of a second. Chosen by hand.
static const double ANGULAR_ACCELERATION_NOISE = 2, ACCELERATION_NOISE = 1;
// Standard deviations of the velocity at the start, rad/s and m/s; chosen by hand.
static const double START_ANGULAR_SIGMA = 2, START_SIGMA = 1;

void pose_kalman_start(struct pose_kalman *kalman, struct pose world_from_camera, const double covariance[36])
{
    memset(kalman, 0, sizeof *kalman);
    kalman->world_from_camera = world_from_camera;
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? START_ANGULAR_SIGMA : START_SIGMA;
        for (int j = 0; j < 6; j++)
            kalman->covariance[i][j] = covariance[i * 6 + j];
        kalman->covariance[6 + i][6 + i] = sigma * sigma;
    }
}

static struct pose small_motion(const double d[6], double by)
{
    struct pose p = {quat_from_rotation_vector(v3(d[0] * by, d[1] * by, d[2] * by)), {d[3] * by, d[4] * by, d[5] * by}};
    return p;
}

void pose_kalman_predict(struct pose_kalman *kalman, double seconds)
{
    double(*p)[POSE_KALMAN_STATE] = kalman->covariance, t = seconds;
    kalman->world_from_camera = pose_multiply(kalman->world_from_camera, small_motion(kalman->velocity, t));
    kalman->world_from_camera.rotation = quat_unit(kalman->world_from_camera.rotation);
    // F P F^T with F = [1 t; 0 1] in blocks of six
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < POSE_KALMAN_STATE; j++)
            p[i][j] += t * p[6 + i][j];
    for (int i = 0; i < POSE_KALMAN_STATE; i++)
        for (int j = 0; j < 6; j++)
            p[i][j] += t * p[i][6 + j];
    for (int i = 0; i < 6; i++) {
        double noise = i < 3 ? ANGULAR_ACCELERATION_NOISE : ACCELERATION_NOISE, q = noise * noise;
        p[i][i] += q * t * t * t / 3;
        p[i][6 + i] += q * t * t / 2;
        p[6 + i][i] += q * t * t / 2;
        p[6 + i][6 + i] += q * t;
    }
}

double pose_kalman_update(struct pose_kalman *kalman, struct pose world_from_camera, const double covariance[36],
                          double max)
{
    struct pose off = pose_multiply(pose_inverse(kalman->world_from_camera), world_from_camera);
    struct vec3 rotation = quat_to_rotation_vector(off.rotation);
    const double d[6] = {rotation.x, rotation.y, rotation.z, off.translation.x, off.translation.y, off.translation.z};
    double s[36], inverse[36], weighted[6], distance = 0;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            s[i * 6 + j] = kalman->covariance[i][j] + covariance[i * 6 + j];
    if (!invert_symmetric(s, 6, inverse))
        return NAN;
    for (int i = 0; i < 6; i++) {
        weighted[i] = 0;
        for (int j = 0; j < 6; j++)
            weighted[i] += inverse[i * 6 + j] * d[j];
        distance += weighted[i] * d[i];
    }
    if (!(distance <= max))
        return distance;
    double gain[POSE_KALMAN_STATE][6], by[POSE_KALMAN_STATE], before[6][POSE_KALMAN_STATE];
    memcpy(before, kalman->covariance, sizeof before); // the first six rows
    for (int i = 0; i < POSE_KALMAN_STATE; i++) {
        by[i] = 0;
        for (int j = 0; j < 6; j++) {
            gain[i][j] = 0;
            for (int m = 0; m < 6; m++)
                gain[i][j] += kalman->covariance[i][m] * inverse[m * 6 + j];
            by[i] += kalman->covariance[i][j] * weighted[j];
        }
    }
    for (int i = 0; i < POSE_KALMAN_STATE; i++)
        for (int j = 0; j < POSE_KALMAN_STATE; j++)
            for (int m = 0; m < 6; m++)
                kalman->covariance[i][j] -= gain[i][m] * before[m][j];
    for (int i = 0; i < POSE_KALMAN_STATE; i++)
        for (int j = 0; j < i; j++)
            kalman->covariance[i][j] = kalman->covariance[j][i] =
                (kalman->covariance[i][j] + kalman->covariance[j][i]) / 2;
    kalman->world_from_camera = pose_multiply(kalman->world_from_camera, small_motion(by, 1));
    kalman->world_from_camera.rotation = quat_unit(kalman->world_from_camera.rotation);
    for (int i = 0; i < 6; i++)
        kalman->velocity[i] += by[6 + i];
    return distance;
}

// ---------------------------------------------------------------- pose fusion

static const double CORRECTION_SHARE = 0.3; // share of a correction that is made with each image; chosen by hand

static void multiply_matrices(const double a[36], const double b[36], double out[36])
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            out[i * 6 + j] = 0;
            for (int k = 0; k < 6; k++)
                out[i * 6 + j] += a[i * 6 + k] * b[k * 6 + j];
        }
}

// out = f m f^T
static void propagate_covariance(const double f[36], const double m[36], double out[36])
{
    double half[36], transposed[36];
    multiply_matrices(f, m, half);
    for (int i = 0; i < 36; i++)
        transposed[i] = f[i % 6 * 6 + i / 6];
    multiply_matrices(half, transposed, out);
}

void pose_fusion_start(struct pose_fusion *fusion, const double map_covariance[36], const double noise[36])
{
    memset(fusion, 0, sizeof *fusion);
    memcpy(fusion->map_covariance, map_covariance, sizeof fusion->map_covariance);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double map = map_covariance[i * 6 + j];
            fusion->covariance[i][j] = map + noise[i * 6 + j];
            fusion->covariance[i][6 + j] = fusion->covariance[6 + i][j] = -map; // offset = c + m = 0 at the start
            fusion->covariance[6 + i][6 + j] = map;
        }
}

// The map error's transition A (`keep`) and process noise (`fresh`). all: A = 0, the whole error is new.
static void map_error_transition(const struct pose_fusion *fusion, const struct pose_measurement *measurement, bool all,
                                 double keep[36], double fresh[36])
{
    double kept[36], lower[36];
    multiply_matrices(measurement->map_covariance, measurement->map_information, keep);
    propagate_covariance(keep, fusion->map_covariance, kept);
    for (int i = 0; i < 36; i++)
        lower[i] = fresh[i] = measurement->map_covariance[i] - kept[i];
    for (int i = 0; i < 6; i++)
        lower[i * 7] += 1e-3 * measurement->map_covariance[i * 7];
    if (!all && cholesky_factor(lower, 6))
        return;
    // `fresh` is not positive definite: the two information matrices were linearised at different poses and do not
    // quite match.
    memset(keep, 0, 36 * sizeof *keep);
    memcpy(fresh, measurement->map_covariance, 36 * sizeof *fresh);
}

static void predict_state(struct pose_fusion *fusion, const struct pose_measurement *measurement, bool reset_map_error)
{
    double keep[36], fresh[36], own[36], propagated[36], error[6];
    map_error_transition(fusion, measurement, reset_map_error, keep, fresh);
    for (int i = 0; i < 36; i++)
        own[i] = fusion->covariance[6 + i / 6][6 + i % 6];
    propagate_covariance(keep, own, propagated);
    for (int i = 0; i < 6; i++) {
        error[i] = 0;
        for (int j = 0; j < 6; j++) {
            own[i * 6 + j] = 0;
            for (int k = 0; k < 6; k++)
                own[i * 6 + j] += fusion->covariance[i][6 + k] * keep[j * 6 + k];
            error[i] += keep[i * 6 + j] * fusion->map_error[j];
        }
    }
    memcpy(fusion->map_error, error, sizeof error);
    memcpy(fusion->map_covariance, measurement->map_covariance, sizeof fusion->map_covariance);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            fusion->covariance[i][j] += measurement->drift[i * 6 + j];
            fusion->covariance[i][6 + j] = fusion->covariance[6 + j][i] = own[i * 6 + j];
            fusion->covariance[6 + i][6 + j] = propagated[i * 6 + j] + fresh[i * 6 + j];
        }
}

// both: cross-covariance of the state and the innovation; inverse: of the innovation's covariance. False: singular.
static bool innovation_covariance(const struct pose_fusion *fusion, const struct pose_measurement *measurement,
                                  double both[12][6], double inverse[36])
{
    double s[36];
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < 6; j++)
            both[i][j] = fusion->covariance[i][j] + fusion->covariance[i][6 + j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            s[i * 6 + j] = both[i][j] + both[6 + i][j] + measurement->noise[i * 6 + j];
    return invert_symmetric(s, 6, inverse);
}

bool pose_fusion_update(struct pose_fusion *out, const struct pose_measurement *measurement, double by[6])
{
    struct pose_fusion next = *out, *a = &next;
    double both[12][6], inverse[36], gain[12][6], innovation[6];
    predict_state(a, measurement, false);
    if (!innovation_covariance(a, measurement, both, inverse)) {
        // The noise is far smaller than the map's error, and the mismatch of two linearisations exceeds it.
        next = *out;
        predict_state(a, measurement, true);
        if (!innovation_covariance(a, measurement, both, inverse))
            return false;
    }
    for (int i = 0; i < 6; i++)
        innovation[i] = measurement->offset[i] - a->camera_error[i] - a->map_error[i];
    for (int i = 0; i < 12; i++) {
        double moved = 0;
        for (int j = 0; j < 6; j++) {
            gain[i][j] = 0;
            for (int k = 0; k < 6; k++)
                gain[i][j] += both[i][k] * inverse[k * 6 + j];
            moved += gain[i][j] * innovation[j];
        }
        if (i < 6)
            a->camera_error[i] += moved;
        else
            a->map_error[i - 6] += moved;
    }
    for (int i = 0; i < 6; i++) {
        by[i] = CORRECTION_SHARE * a->camera_error[i];
        a->camera_error[i] -= by[i];
    }
    for (int i = 0; i < 12; i++)
        for (int j = 0; j <= i; j++) {
            for (int k = 0; k < 6; k++)
                a->covariance[i][j] -= gain[i][k] * both[j][k];
            a->covariance[j][i] = a->covariance[i][j];
        }
    *out = next;
    return true;
}

void pose_fusion_covariance(const struct pose_fusion *fusion, double covariance[36])
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            covariance[i * 6 + j] = fusion->covariance[i][j] + fusion->camera_error[i] * fusion->camera_error[j];
}
