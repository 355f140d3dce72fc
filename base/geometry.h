// Points, rotations and rigid motions in double precision. Metres, radians.
//
// `struct pose a_from_b` maps points of frame b into frame a:
//     p_a = rotate(a_from_b.rotation, p_b) + a_from_b.translation
// Rotations are unit quaternions (w last, as TUM files write them); no Euler
// angles anywhere. All functions are pure and total: no allocation, no state;
// a zero-length vector normalises to zero, never to NaN. NaN in gives NaN out.
#pragma once
#include "base/status.h"

#include <math.h>

struct vec3 {
    double x, y, z;
};

struct quat {
    double x, y, z, w;
};

struct pose {
    struct quat rotation; // unit length
    struct vec3 translation;
};

#define POSE_IDENTITY ((struct pose){{0, 0, 0, 1}, {0, 0, 0}})

// (No compound literals here: C++ files include this header.)
static inline struct vec3 v3(double x, double y, double z)
{
    struct vec3 v = {x, y, z};
    return v;
}
static inline struct vec3 v3_add(struct vec3 a, struct vec3 b) { return v3(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline struct vec3 v3_sub(struct vec3 a, struct vec3 b) { return v3(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline struct vec3 v3_scale(struct vec3 a, double s) { return v3(a.x * s, a.y * s, a.z * s); }
static inline double v3_dot(struct vec3 a, struct vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline double v3_length(struct vec3 a) { return sqrt(v3_dot(a, a)); }
static inline double v3_distance(struct vec3 a, struct vec3 b) { return v3_length(v3_sub(a, b)); }
static inline bool v3_finite(struct vec3 a) { return isfinite(a.x) && isfinite(a.y) && isfinite(a.z); }
static inline struct vec3 v3_mix(struct vec3 a, struct vec3 b, double t)
{
    return v3_add(a, v3_scale(v3_sub(b, a), t));
}
static inline struct vec3 v3_cross(struct vec3 a, struct vec3 b)
{
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
// Zero in, zero out.
static inline struct vec3 v3_unit(struct vec3 a)
{
    double length = v3_length(a);
    return length > 1e-12 ? v3_scale(a, 1 / length) : v3(0, 0, 0);
}
// Some unit vector perpendicular to `a`; for the zero vector, the x axis.
struct vec3 v3_perpendicular(struct vec3 a);

struct quat quat_unit(struct quat q);                    // zero becomes the identity; NaN stays NaN
struct quat quat_multiply(struct quat a, struct quat b); // first b, then a
static inline struct vec3 quat_rotate(struct quat q, struct vec3 v)
{
    // v + 2 w (u x v) + 2 u x (u x v), u the vector part
    struct vec3 u = v3(q.x, q.y, q.z), t = v3_scale(v3_cross(u, v), 2);
    return v3_add(v, v3_add(v3_scale(t, q.w), v3_cross(u, t)));
}
struct quat quat_from_rotation_vector(struct vec3 r); // axis times angle; series near 0
struct vec3 quat_to_rotation_vector(struct quat q);   // angle in [0, pi]
struct quat quat_from_matrix(double m[3][3]);         // a rotation matrix, row-major
// Whether its rows are of unit length and orthogonal, products off by less than `tolerance`, and right-handed: no
// mirror image.
bool matrix_is_rotation(double m[3][3], double tolerance);
void quat_to_matrix(struct quat q, double m[3][3]);
struct quat quat_between(struct vec3 a, struct vec3 b); // shortest rotation taking a's direction to b's
struct quat quat_slerp(struct quat a, struct quat b, double t);
static inline struct quat quat_conjugate(struct quat q)
{
    struct quat back = {-q.x, -q.y, -q.z, q.w};
    return back;
}

static inline struct vec3 pose_apply(struct pose a_from_b, struct vec3 p_b)
{
    return v3_add(quat_rotate(a_from_b.rotation, p_b), a_from_b.translation);
}
struct pose pose_multiply(struct pose a_from_b, struct pose b_from_c); // a_from_c
struct pose pose_inverse(struct pose a_from_b);                        // b_from_a
bool pose_finite(struct pose a_from_b);
double pose_angle(struct pose a, struct pose b); // of the rotation between them, [0, pi]
