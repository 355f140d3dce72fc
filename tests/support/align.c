#include "tests/support/align.h"

struct pose align_points(const struct vec3 *a, const struct vec3 *b, int n)
{
    struct vec3 ca = v3(0, 0, 0), cb = ca;
    for (int i = 0; i < n; i++) {
        ca = v3_add(ca, v3_scale(a[i], 1.0 / n));
        cb = v3_add(cb, v3_scale(b[i], 1.0 / n));
    }
    double s[3][3] = {{0}};
    for (int i = 0; i < n; i++) {
        struct vec3 p = v3_sub(a[i], ca), q = v3_sub(b[i], cb);
        const double x[3] = {p.x, p.y, p.z}, y[3] = {q.x, q.y, q.z};
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                s[r][c] += x[r] * y[c];
    }
    double m[4][4] = {{s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]},
                      {0, s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]},
                      {0, 0, -s[0][0] + s[1][1] - s[2][2], s[1][2] + s[2][1]},
                      {0, 0, 0, -s[0][0] - s[1][1] + s[2][2]}};
    double shift = 0, q[4] = {1, 0.3, 0.2, 0.1};
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) {
            m[r][c] = r <= c ? m[r][c] : m[c][r];
            shift += fabs(m[r][c]);
        }
    for (int round = 0; round < 20000; round++) {
        double next[4], length = 0;
        for (int r = 0; r < 4; r++) {
            next[r] = shift * q[r];
            for (int c = 0; c < 4; c++)
                next[r] += m[r][c] * q[c];
            length += next[r] * next[r];
        }
        for (int r = 0; r < 4; r++)
            q[r] = next[r] / sqrt(length);
    }
    struct pose pose = {{q[1], q[2], q[3], q[0]}, {0, 0, 0}};
    pose.translation = v3_sub(cb, quat_rotate(pose.rotation, ca));
    return pose;
}

double align_tags(const struct place *place, const struct place_tag *truth, int32_t truth_count,
                  struct pose *truth_from_place)
{
    struct vec3 ours[4 * 64] = {{0}}, theirs[4 * 64] = {{0}};
    int n = 0;
    for (int32_t i = 0; i < place->tag_count; i++)
        for (int32_t k = 0; k < truth_count && n < (int)COUNT_OF(ours); k++)
            if (truth[k].id == place->tags[i].id) {
                place_tag_corners(&place->tags[i], &ours[n]);
                place_tag_corners(&truth[k], &theirs[n]);
                n += 4;
            }
    *truth_from_place = POSE_IDENTITY;
    if (!n || n != 4 * place->tag_count)
        return INFINITY;
    *truth_from_place = align_points(ours, theirs, n);
    double sum = 0;
    for (int i = 0; i < n; i++) {
        double d = v3_distance(pose_apply(*truth_from_place, ours[i]), theirs[i]);
        sum += d * d;
    }
    return sqrt(sum / n);
}
