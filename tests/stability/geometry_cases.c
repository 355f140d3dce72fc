// Points, rotations and rigid motions (base/geometry.h).
#include "base/geometry.h"
#include "tests/stability/stability.h"

#define PI 3.14159265358979323846

static struct answer vector(struct vec3 v)
{
    const double values[3] = {v.x, v.y, v.z};
    return v3_finite(v) ? answer_values(values, 3) : answer_of(ANSWER_UNKNOWN);
}

static struct answer quaternion(struct quat q)
{
    const double values[4] = {q.x, q.y, q.z, q.w};
    return isfinite(q.x + q.y + q.z + q.w) ? answer_values(values, 4) : answer_of(ANSWER_UNKNOWN);
}

static struct vec3 at(const double *in) { return v3(in[0], in[1], in[2]); }

static struct answer ask_exp_map(const double *in) { return quaternion(quat_from_rotation_vector(at(in))); }

static struct answer ask_log_map(const double *in)
{
    return vector(quat_to_rotation_vector(quat_from_rotation_vector(at(in))));
}

static struct answer ask_slerp(const double *in)
{
    const struct quat a = quat_from_rotation_vector(v3(0, 0, in[0])), b = quat_from_rotation_vector(v3(0, 0, in[1])),
                      signed_b = {in[2] * b.x, in[2] * b.y, in[2] * b.z, in[2] * b.w};
    return vector(quat_rotate(quat_slerp(a, signed_b, in[3]), v3(1, 0, 0)));
}

static struct answer ask_between(const double *in)
{
    return vector(quat_rotate(quat_between(at(in), at(in + 3)), v3_unit(at(in))));
}

static struct answer ask_from_matrix(const double *in)
{
    double m[3][3];
    quat_to_matrix(quat_from_rotation_vector(v3_scale(at(in), in[3])), m);
    return vector(quat_rotate(quat_from_matrix(m), v3(0.2, -1.3, 2.2)));
}

// No direction is the zero vector.
static struct answer ask_unit(const double *in)
{
    const struct vec3 u = v3_unit(at(in));
    return v3_dot(u, u) > 0 ? vector(u) : answer_of(ANSWER_UNKNOWN);
}

static struct answer ask_unit_quat(const double *in)
{
    return quaternion(quat_unit((struct quat){in[0], in[1], in[2], in[3]}));
}

static struct answer ask_turned_by(const double *in)
{
    const struct pose a = {quat_from_rotation_vector(at(in)), {0, 0, 0}};
    return answer_value(pose_angle(POSE_IDENTITY, a));
}

static struct answer turned_by_acos(const double *in)
{
    const struct quat q = quat_from_rotation_vector(at(in));
    return answer_value(2 * acos(fmin(1, q.w)));
}

static struct answer ask_perpendicular(const double *in)
{
    const struct vec3 v = at(in), p = v3_perpendicular(v);
    return answer_values((double[]){v3_dot(p, v), v3_length(p)}, 2);
}

static struct answer perpendicular_to_x_cross(const double *in)
{
    const struct vec3 v = at(in), p = v3_cross(v, v3(1, 0, 0));
    const double length = v3_length(p);
    return answer_values((double[]){v3_dot(p, v) / length, v3_length(v3_scale(p, 1 / length))}, 2);
}

static struct answer ask_there_and_back(const double *in)
{
    const struct pose world_from_camera = {quat_from_rotation_vector(v3(0, 0, in[2])), {in[1], in[1], in[1]}};
    const struct vec3 p = v3(0.3 * in[0], -0.2 * in[0], in[0]);
    return vector(pose_apply(pose_inverse(world_from_camera), pose_apply(world_from_camera, p)));
}

// A thousand small rotations, one after the other, against all in one.
static struct answer ask_thousand_turns(const double *in)
{
    struct pose a = POSE_IDENTITY;
    const struct pose step = {quat_from_rotation_vector(v3(0, 0, in[0])), {0, 0, 0}};
    for (int i = 0; i < 1000; i++)
        a = pose_multiply(a, step);
    return vector(pose_apply(a, v3(1, 0, 0)));
}

// Rotation matrices of single precision are multiplied, and never made orthogonal again.
static struct answer thousand_matrices(const double *in)
{
    const float c = (float)cos(in[0]), s = (float)sin(in[0]);
    float x = 1, y = 0;
    for (int i = 0; i < 1000; i++) {
        const float next = c * x - s * y;
        y = s * x + c * y;
        x = next;
    }
    return answer_values((double[]){x, y, 0}, 3);
}

static const struct stability_case cases[] = {
    {"rotation by 0", "series near 0", ANSWER_VALUE, ask_exp_map, &plain_exp_map, .in = {0}, .exact = {0, 0, 0, 1},
     .exact_count = 4},
    {"rotation by 1e-200 rad", "series near 0", ANSWER_VALUE, ask_exp_map, &plain_exp_map, .in = {1e-200, 0, 0},
     .tolerance = 1e-215},
    {"rotation by a denormal angle", "series near 0", ANSWER_VALUE, ask_exp_map, &plain_exp_map, .in = {0, 5e-322, 0},
     .exact = {0, 2.5e-322, 0, 1}, .exact_count = 4, .tolerance = 5e-324},
    {"rotation by NaN", "NaN stays NaN", ANSWER_UNKNOWN, ask_exp_map, &plain_exp_map, .in = {NAN, 0, 0}},
    {"rotation by an infinite angle", "NaN stays NaN", ANSWER_UNKNOWN, ask_exp_map, &plain_exp_map,
     .in = {INFINITY, 0, 0}},
    {"rotation vector of 1e-9 rad and back", "atan2 of both parts", ANSWER_VALUE, ask_log_map, &plain_log_map,
     .in = {6e-10, 0, -8e-10}, .tolerance = 1e-24, .unit = "rad"},
    {"rotation vector of 1e-7 rad and back", "atan2 of both parts", ANSWER_VALUE, ask_log_map, &plain_log_map,
     .in = {6e-8, 0, -8e-8}, .tolerance = 1e-23, .unit = "rad"},
    {"rotation vector of 1e-4 rad and back", "atan2 of both parts", ANSWER_VALUE, ask_log_map, &plain_log_map,
     .in = {6e-5, 0, -8e-5}, .tolerance = 1e-19, .unit = "rad"},
    {"rotation vector of 0 and back", "series near 0", ANSWER_VALUE, ask_log_map, &plain_log_map, .in = {0},
     .exact = {0, 0, 0}, .exact_count = 3, .unit = "rad"},
    {"rotation vector of 3.5 rad: the short way", "sign of w", ANSWER_VALUE, ask_log_map, &plain_log_map,
     .in = {3.5, 0, 0}, .exact = {-2.7831853071795862, 0, 0}, .exact_count = 3, .tolerance = 1e-15, .unit = "rad"},
    {"angle of a turn by 1e-9 rad", "atan2 of both parts", ANSWER_VALUE, ask_turned_by, NULL, turned_by_acos,
     .in = {0, 1e-9, 0}, .exact = {1e-9}, .exact_count = 1, .tolerance = 1e-24, .unit = "rad"},
    {"half-way between equal rotations", "by the rotation vector", ANSWER_VALUE, ask_slerp, &plain_slerp,
     .in = {0.7, 0.7, 1, 0.5}, .exact = {0.7648421872844885, 0.644217687237691, 0}, .exact_count = 3,
     .tolerance = 2e-16},
    {"half-way over 1e-9 rad", "by the rotation vector", ANSWER_VALUE, ask_slerp, &plain_slerp, .in = {0, 1e-9, 1, 0.5},
     .tolerance = 1e-16},
    {"a quarter of the way to -q", "sign of w", ANSWER_VALUE, ask_slerp, &plain_slerp, .in = {0.3, 0.5, -1, 0.25},
     .exact = {0.9393727128473789, 0.3428978074554514, 0}, .exact_count = 3, .tolerance = 2e-16},
    {"turn between equal directions", "1 + cosine, no division by the sine", ANSWER_VALUE, ask_between,
     &plain_turn_between, .in = {0, 0, 2, 0, 0, 3}, .exact = {0, 0, 1}, .exact_count = 3},
    {"turn between directions 1e-9 rad apart", "1 + cosine, no division by the sine", ANSWER_VALUE, ask_between,
     &plain_turn_between, .in = {1, 0, 0, 1, 1e-9, 0}, .tolerance = 2e-16},
    {"turn between opposite directions", "any perpendicular axis", ANSWER_VALUE, ask_between, &plain_turn_between,
     .in = {0, 0, 2, 0, 0, -3}, .exact = {0, 0, -1}, .exact_count = 3},
    {"turn between directions 1e-5 rad from opposite", "no cosine near -1", ANSWER_VALUE, ask_between,
     &plain_turn_between, .in = {1, 0, 0, -1, 1e-5, 0}, .tolerance = 1e-15},
    {"turn between directions 1e-7 rad from opposite", "no cosine near -1", ANSWER_VALUE, ask_between,
     &plain_turn_between, .in = {1, 0, 0, -1, 1e-7, 0}, .tolerance = 1e-12},
    {"turn to no direction", "zero in: no turn", ANSWER_VALUE, ask_between, &plain_turn_between,
     .in = {0, 1, 0, 0, 0, 0}, .exact = {0, 1, 0}, .exact_count = 3},
    {"matrix of half a turn about x", "largest component first", ANSWER_VALUE, ask_from_matrix, &plain_from_matrix,
     .in = {1, 0, 0, PI}, .exact = {0.2, 1.3, -2.2}, .exact_count = 3, .tolerance = 1e-15},
    {"matrix of half a turn about y", "largest component first", ANSWER_VALUE, ask_from_matrix, &plain_from_matrix,
     .in = {0, 1, 0, PI}, .exact = {-0.2, -1.3, -2.2}, .exact_count = 3, .tolerance = 1e-15},
    {"matrix of half a turn about z", "largest component first", ANSWER_VALUE, ask_from_matrix, &plain_from_matrix,
     .in = {0, 0, 1, PI}, .exact = {-0.2, 1.3, 2.2}, .exact_count = 3, .tolerance = 1e-15},
    {"matrix of a turn 1e-6 rad short of half", "largest component first", ANSWER_VALUE, ask_from_matrix,
     &plain_from_matrix, .in = {0.6, -0.8, 0, PI - 1e-6},
     .exact = {1.1919982399997515, -0.55600132000018635, -2.2000006199989002}, .exact_count = 3, .tolerance = 3e-15},
    {"direction of a denormal vector", "shorter than 1e-12: none", ANSWER_UNKNOWN, ask_unit, &plain_unit,
     .in = {5e-324, 0, 0}},
    {"direction of the zero vector", "zero says none", ANSWER_UNKNOWN, ask_unit, &plain_unit, .in = {0}},
    {"direction of an infinite vector", "NaN says unknown", ANSWER_UNKNOWN, ask_unit, &plain_unit,
     .in = {INFINITY, 1, 0}},
    {"direction of a vector 1e200 long", "zero says none", ANSWER_UNKNOWN, ask_unit, &plain_unit, .in = {1e200, 0, 0}},
    {"unit quaternion of one 1e-200 long", "scaled first", ANSWER_VALUE, ask_unit_quat, &plain_unit_quat,
     .in = {3e-200, 0, 0, 4e-200}, .tolerance = 2e-16},
    {"unit quaternion of one 1e200 long", "scaled first", ANSWER_VALUE, ask_unit_quat, &plain_unit_quat,
     .in = {3e200, 0, 0, 4e200}, .tolerance = 2e-16},
    {"unit quaternion of zero", "the identity", ANSWER_VALUE, ask_unit_quat, &plain_unit_quat, .in = {0},
     .exact = {0, 0, 0, 1}, .exact_count = 4},
    {"unit quaternion of NaN", "NaN stays NaN", ANSWER_UNKNOWN, ask_unit_quat, &plain_unit_quat, .in = {0, NAN, 0, 1}},
    {"perpendicular to the x axis", "by the smallest component", ANSWER_VALUE, ask_perpendicular, NULL,
     perpendicular_to_x_cross, .in = {3, 0, 0}, .exact = {0, 1}, .exact_count = 2, .tolerance = 1e-15},
    {"a point 4 m away, 10^4 m from the origin", "geometry in double", ANSWER_VALUE, ask_there_and_back,
     &plain_there_and_back, .in = {4, 1e4, 0.7}, .exact = {1.2, -0.8, 4}, .exact_count = 3, .tolerance = 1e-11,
     .unit = "m", .guard_is_double = true},
    {"a thousand turns by 0.01 rad", "unit again after each", ANSWER_VALUE, ask_thousand_turns, NULL, thousand_matrices,
     .in = {0.01}, .exact = {-0.8390715290764524, -0.5440211108893698, 0}, .exact_count = 3, .tolerance = 1e-13},
};
const struct stability_stage stability_geometry = {"rotations and points", cases, COUNT_OF(cases)};
