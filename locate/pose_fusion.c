#include "locate/pose_fusion.h"

#include "base/linear_algebra.h"

#include <string.h>

static const double CORRECTION_SHARE = 0.3; // share of a correction that is made with each image; chosen by hand

static void multiply(const double a[36], const double b[36], double out[36])
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            out[i * 6 + j] = 0;
            for (int k = 0; k < 6; k++)
                out[i * 6 + j] += a[i * 6 + k] * b[k * 6 + j];
        }
}

// out = f m f^T
static void propagate(const double f[36], const double m[36], double out[36])
{
    double half[36], transposed[36];
    multiply(f, m, half);
    for (int i = 0; i < 36; i++)
        transposed[i] = f[i % 6 * 6 + i / 6];
    multiply(half, transposed, out);
}

void pose_fusion_start(struct pose_fusion *a, const double map_covariance[36], const double noise[36])
{
    memset(a, 0, sizeof *a);
    memcpy(a->map_covariance, map_covariance, sizeof a->map_covariance);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double map = map_covariance[i * 6 + j];
            a->covariance[i][j] = map + noise[i * 6 + j];
            a->covariance[i][6 + j] = a->covariance[6 + i][j] = -map; // offset = c + m = 0 at the start
            a->covariance[6 + i][6 + j] = map;
        }
}

// The map error's transition A (`keep`) and process noise (`fresh`). all: A = 0, the whole error is new.
static void map_error_transition(const struct pose_fusion *a, const struct pose_measurement *measurement, bool all,
                                 double keep[36], double fresh[36])
{
    double kept[36], lower[36];
    multiply(measurement->map_covariance, measurement->map_information, keep);
    propagate(keep, a->map_covariance, kept);
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

static void predict(struct pose_fusion *a, const struct pose_measurement *measurement, bool reset_map_error)
{
    double keep[36], fresh[36], own[36], propagated[36], error[6];
    map_error_transition(a, measurement, reset_map_error, keep, fresh);
    for (int i = 0; i < 36; i++)
        own[i] = a->covariance[6 + i / 6][6 + i % 6];
    propagate(keep, own, propagated);
    for (int i = 0; i < 6; i++) {
        error[i] = 0;
        for (int j = 0; j < 6; j++) {
            own[i * 6 + j] = 0;
            for (int k = 0; k < 6; k++)
                own[i * 6 + j] += a->covariance[i][6 + k] * keep[j * 6 + k];
            error[i] += keep[i * 6 + j] * a->map_error[j];
        }
    }
    memcpy(a->map_error, error, sizeof error);
    memcpy(a->map_covariance, measurement->map_covariance, sizeof a->map_covariance);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            a->covariance[i][j] += measurement->drift[i * 6 + j];
            a->covariance[i][6 + j] = a->covariance[6 + j][i] = own[i * 6 + j];
            a->covariance[6 + i][6 + j] = propagated[i * 6 + j] + fresh[i * 6 + j];
        }
}

// both: cross-covariance of the state and the innovation; inverse: of the innovation's covariance. False: singular.
static bool innovation_covariance(const struct pose_fusion *a, const struct pose_measurement *measurement,
                                  double both[12][6], double inverse[36])
{
    double s[36];
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < 6; j++)
            both[i][j] = a->covariance[i][j] + a->covariance[i][6 + j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            s[i * 6 + j] = both[i][j] + both[6 + i][j] + measurement->noise[i * 6 + j];
    return invert_symmetric(s, 6, inverse);
}

bool pose_fusion_update(struct pose_fusion *out, const struct pose_measurement *measurement, double by[6])
{
    struct pose_fusion next = *out, *a = &next;
    double both[12][6], inverse[36], gain[12][6], innovation[6];
    predict(a, measurement, false);
    if (!innovation_covariance(a, measurement, both, inverse)) {
        // The noise is far smaller than the map's error, and the mismatch of two linearisations exceeds it.
        next = *out;
        predict(a, measurement, true);
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

void pose_fusion_covariance(const struct pose_fusion *a, double covariance[36])
{
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            covariance[i * 6 + j] = a->covariance[i][j] + a->camera_error[i] * a->camera_error[j];
}
