#include "locate/pose_kalman.h"

#include "base/linear_algebra.h"

#include <string.h>

// Process noise of a hand: white acceleration, rad/s^2 and m/s^2 times the root of a second. Chosen by hand.
static const double ANGULAR_ACCELERATION_NOISE = 2, ACCELERATION_NOISE = 1;
// Standard deviations of the velocity at the start, rad/s and m/s; chosen by hand.
static const double START_ANGULAR_SIGMA = 2, START_SIGMA = 1;

void pose_kalman_start(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36])
{
    memset(k, 0, sizeof *k);
    k->world_from_camera = world_from_camera;
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? START_ANGULAR_SIGMA : START_SIGMA;
        for (int j = 0; j < 6; j++)
            k->covariance[i][j] = covariance[i * 6 + j];
        k->covariance[6 + i][6 + i] = sigma * sigma;
    }
}

static struct pose small_motion(const double d[6], double by)
{
    struct pose p = {quat_from_rotation_vector(v3(d[0] * by, d[1] * by, d[2] * by)), {d[3] * by, d[4] * by, d[5] * by}};
    return p;
}

void pose_kalman_predict(struct pose_kalman *k, double seconds)
{
    double(*p)[POSE_KALMAN_STATE] = k->covariance, t = seconds;
    k->world_from_camera = pose_multiply(k->world_from_camera, small_motion(k->velocity, t));
    k->world_from_camera.rotation = quat_unit(k->world_from_camera.rotation);
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

double pose_kalman_update(struct pose_kalman *k, struct pose world_from_camera, const double covariance[36],
                          double most)
{
    struct pose off = pose_multiply(pose_inverse(k->world_from_camera), world_from_camera);
    struct vec3 rotation = quat_to_rotation_vector(off.rotation);
    const double d[6] = {rotation.x, rotation.y, rotation.z, off.translation.x, off.translation.y, off.translation.z};
    double s[36], inverse[36], weighted[6], distance = 0;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            s[i * 6 + j] = k->covariance[i][j] + covariance[i * 6 + j];
    if (!invert_symmetric(s, 6, inverse))
        return NAN;
    for (int i = 0; i < 6; i++) {
        weighted[i] = 0;
        for (int j = 0; j < 6; j++)
            weighted[i] += inverse[i * 6 + j] * d[j];
        distance += weighted[i] * d[i];
    }
    if (!(distance <= most))
        return distance;
    double gain[POSE_KALMAN_STATE][6], by[POSE_KALMAN_STATE], before[6][POSE_KALMAN_STATE];
    memcpy(before, k->covariance, sizeof before); // the first six rows
    for (int i = 0; i < POSE_KALMAN_STATE; i++) {
        by[i] = 0;
        for (int j = 0; j < 6; j++) {
            gain[i][j] = 0;
            for (int m = 0; m < 6; m++)
                gain[i][j] += k->covariance[i][m] * inverse[m * 6 + j];
            by[i] += k->covariance[i][j] * weighted[j];
        }
    }
    for (int i = 0; i < POSE_KALMAN_STATE; i++)
        for (int j = 0; j < POSE_KALMAN_STATE; j++)
            for (int m = 0; m < 6; m++)
                k->covariance[i][j] -= gain[i][m] * before[m][j];
    for (int i = 0; i < POSE_KALMAN_STATE; i++)
        for (int j = 0; j < i; j++)
            k->covariance[i][j] = k->covariance[j][i] = (k->covariance[i][j] + k->covariance[j][i]) / 2;
    k->world_from_camera = pose_multiply(k->world_from_camera, small_motion(by, 1));
    k->world_from_camera.rotation = quat_unit(k->world_from_camera.rotation);
    for (int i = 0; i < 6; i++)
        k->velocity[i] += by[6 + i];
    return distance;
}
