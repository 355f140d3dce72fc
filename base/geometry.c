#include "base/geometry.h"

#include "base/portable_math.h"

struct vec3 v3_perpendicular(struct vec3 a)
{
    // Cross product with the axis along which `a` is smallest, so that it cannot vanish.
    double ax = fabs(a.x), ay = fabs(a.y), az = fabs(a.z);
    struct vec3 other = v3(0, 0, 1);
    if (ax <= ay && ax <= az)
        other = v3(1, 0, 0);
    else if (ay <= az)
        other = v3(0, 1, 0);
    struct vec3 p = v3_unit(v3_cross(a, other));
    return v3_dot(p, p) > 0 ? p : v3(1, 0, 0);
}

struct quat quat_unit(struct quat q)
{
    double n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    if (!(n > 1e-150 && n < 1e150)) { // the squares may have left the range of a double
        double largest = fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.z), fabs(q.w)));
        if (largest == 0 && !isnan(n))
            return (struct quat){0, 0, 0, 1};
        q = (struct quat){q.x / largest, q.y / largest, q.z / largest, q.w / largest};
        n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    }
    return (struct quat){q.x / n, q.y / n, q.z / n, q.w / n};
}

struct quat quat_multiply(struct quat a, struct quat b)
{
    return (struct quat){
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    };
}

struct quat quat_from_rotation_vector(struct vec3 r)
{
    double angle = v3_length(r);
    // sin(a/2)/a by series near zero, where the quotient loses all digits
    double s = angle < 1e-4 ? 0.5 - angle * angle / 48 : portable_sin(angle / 2) / angle;
    return quat_unit((struct quat){r.x * s, r.y * s, r.z * s, portable_cos(angle / 2)});
}

struct vec3 quat_to_rotation_vector(struct quat q)
{
    if (q.w < 0)
        q = (struct quat){-q.x, -q.y, -q.z, -q.w};
    struct vec3 u = v3(q.x, q.y, q.z);
    double s = v3_length(u);
    double scale = s < 1e-8 ? 2 / q.w : 2 * portable_atan2(s, q.w) / s;
    return v3_scale(u, scale);
}

bool matrix_is_rotation(double m[3][3], double tolerance)
{
    struct vec3 row[3];
    for (int i = 0; i < 3; i++) {
        row[i] = v3(m[i][0], m[i][1], m[i][2]);
        for (int j = 0; j <= i; j++)
            if (!(fabs(v3_dot(row[i], row[j]) - (i == j)) < tolerance)) // NaN, too
                return false;
    }
    return v3_dot(v3_cross(row[0], row[1]), row[2]) > 0;
}

struct quat quat_from_matrix(double m[3][3])
{
    // Branches on the largest of the four squared components (Shepperd 1978).
    double trace = m[0][0] + m[1][1] + m[2][2];
    struct quat q;
    if (trace >= m[0][0] && trace >= m[1][1] && trace >= m[2][2])
        q = (struct quat){m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], 1 + trace};
    else if (m[0][0] >= m[1][1] && m[0][0] >= m[2][2])
        q = (struct quat){1 + m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]};
    else if (m[1][1] >= m[2][2])
        q = (struct quat){m[0][1] + m[1][0], 1 + m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1], m[0][2] - m[2][0]};
    else
        q = (struct quat){m[0][2] + m[2][0], m[1][2] + m[2][1], 1 + m[2][2] - m[0][0] - m[1][1], m[1][0] - m[0][1]};
    return quat_unit(q);
}

void quat_to_matrix(struct quat q, double m[3][3])
{
    double x = q.x, y = q.y, z = q.z, w = q.w;
    m[0][0] = 1 - 2 * (y * y + z * z);
    m[0][1] = 2 * (x * y - z * w);
    m[0][2] = 2 * (x * z + y * w);
    m[1][0] = 2 * (x * y + z * w);
    m[1][1] = 1 - 2 * (x * x + z * z);
    m[1][2] = 2 * (y * z - x * w);
    m[2][0] = 2 * (x * z - y * w);
    m[2][1] = 2 * (y * z + x * w);
    m[2][2] = 1 - 2 * (x * x + y * y);
}

struct quat quat_between(struct vec3 a, struct vec3 b)
{
    struct vec3 ua = v3_unit(a), ub = v3_unit(b);
    double d = v3_dot(ua, ub);
    if (v3_dot(ua, ua) == 0 || v3_dot(ub, ub) == 0)
        return (struct quat){0, 0, 0, 1};
    struct vec3 c = v3_cross(ua, ub);
    double w = 1 + d;
    if (d < -0.9999) { // 1 + d is only rounding here: |ua + ub|^2 / 2 is the same, of a sum that is nearly exact
        struct vec3 sum = v3_add(ua, ub);
        w = v3_dot(sum, sum) / 2;
        c = v3_cross(ua, sum);
        if (w < 1e-30) { // opposite: any half turn about a perpendicular axis
            struct vec3 axis = v3_perpendicular(ua);
            return (struct quat){axis.x, axis.y, axis.z, 0};
        }
    }
    return quat_unit((struct quat){c.x, c.y, c.z, w});
}

struct quat quat_slerp(struct quat a, struct quat b, double t)
{
    struct quat b_from_a = quat_multiply(b, quat_conjugate(a));
    return quat_unit(quat_multiply(quat_from_rotation_vector(v3_scale(quat_to_rotation_vector(b_from_a), t)), a));
}

struct pose pose_multiply(struct pose a_from_b, struct pose b_from_c)
{
    return (struct pose){
        quat_unit(quat_multiply(a_from_b.rotation, b_from_c.rotation)),
        pose_apply(a_from_b, b_from_c.translation),
    };
}

struct pose pose_inverse(struct pose a_from_b)
{
    struct quat back = quat_conjugate(a_from_b.rotation);
    return (struct pose){back, v3_scale(quat_rotate(back, a_from_b.translation), -1)};
}

bool pose_finite(struct pose pose)
{
    return v3_finite(pose.translation) && isfinite(pose.rotation.x) && isfinite(pose.rotation.y) &&
           isfinite(pose.rotation.z) && isfinite(pose.rotation.w);
}

double pose_angle(struct pose a, struct pose b)
{
    return v3_length(quat_to_rotation_vector(quat_multiply(a.rotation, quat_conjugate(b.rotation))));
}
