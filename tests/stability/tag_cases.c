// Poses from square tags (locate/pose_solver.h): head-on, edge-on, far, and corners that are no square.
#include "base/portable_math.h"
#include "locate/pose_solver.h"
#include "tests/stability/stability.h"

#include <string.h>

#define SIDE_M 0.16
#define F_PX   525.0

// The tag's pose before the camera: distance, tilt about the camera's y, degrees off the axis to the right.
struct placed_tag {
    struct vec3 ray[4];
    double range_m;
};

static struct placed_tag place_at(double range_m, double tilt_deg, double aside_deg)
{
    const double rad = 3.14159265358979323846 / 180, aside = aside_deg * rad;
    const struct place_tag tag = {.side_m = SIDE_M, .world_from_tag = POSE_IDENTITY};
    // Seen from the front, a tag's z points to the camera: half a turn about x, then the tilt.
    const struct quat facing = {1, 0, 0, 0}, tilt = quat_from_rotation_vector(v3(0, tilt_deg * rad + aside, 0));
    const struct pose camera_from_tag = {quat_multiply(tilt, facing),
                                         v3_scale(v3(portable_sin(aside), 0, portable_cos(aside)), range_m)};
    struct placed_tag t = {.range_m = range_m};
    struct vec3 world[4];
    place_tag_corners(&tag, world);
    for (int i = 0; i < 4; i++) {
        const struct vec3 p = pose_apply(camera_from_tag, world[i]);
        t.ray[i] = v3(p.x / p.z, p.y / p.z, 1);
    }
    return t;
}

static struct pnp_tag for_solver(struct tag_observation *seen, const struct placed_tag *t, double sigma_px)
{
    *seen = (struct tag_observation){.id = 0, .correlation = 1};
    for (int i = 0; i < 4; i++) {
        seen->ray[i] = t->ray[i];
        seen->information[2 * i][2 * i] = seen->information[2 * i + 1][2 * i + 1] = 1 / (sigma_px * sigma_px);
    }
    return (struct pnp_tag){.seen = seen, .world_from_tag = POSE_IDENTITY, .side_m = SIDE_M};
}

// The distance by the pose solver; corners are known to 0.1 px.
static struct answer solve(const struct placed_tag *t)
{
    struct tag_observation seen;
    struct pnp_tag tag = for_solver(&seen, t, 0.1);
    struct pnp_solution found;
    const struct pose_problem problem = {.tags = &tag, .tag_count = 1, .fx = F_PX, .fy = F_PX};
    const enum status status = pnp_solve(&problem, 2.5, &found);
    return answer_status(status, status == OK ? v3_length(found.camera_from_world.translation) : NAN);
}

// in: range, tilt, aside.
static struct answer ask_range(const double *in)
{
    const struct placed_tag t = place_at(in[0], in[1], in[2]);
    return solve(&t);
}

// The same from single-precision corners and a homography, whichever of two poses it is.
static struct answer range_in_float(const double *in)
{
    const struct placed_tag t = place_at(in[0], in[1], in[2]);
    float flat[9], range;
    for (int i = 0; i < 4; i++) {
        flat[2 * i] = (float)t.ray[i].x;
        flat[2 * i + 1] = (float)t.ray[i].y;
    }
    flat[8] = (float)SIDE_M;
    plain_square_range.in_float(flat, &range);
    return answer_value((double)range);
}

// One pose, although two fit.
static struct answer first_pose(const double *in)
{
    const struct placed_tag t = place_at(in[0], in[1], in[2]);
    struct pose two[2];
    return planar_poses(SIDE_M, t.ray, two) ? answer_value(v3_length(two[0].translation)) : answer_of(ANSWER_UNKNOWN);
}

// in: corners x, y of four, side.
static struct answer ask_corners(const double *in)
{
    struct vec3 ray[4];
    struct pose two[2];
    for (int i = 0; i < 4; i++)
        ray[i] = v3(in[2 * i], in[2 * i + 1], 1);
    return planar_poses(in[8], ray, two) ? answer_value(v3_length(two[0].translation)) : answer_of(ANSWER_UNKNOWN);
}

// Two tags 1 m apart on a wall, the second of which is where the place has it, or not.
static struct answer ask_two_tags(const double *in)
{
    struct tag_observation seen[2];
    struct pnp_tag tag[2];
    const struct placed_tag a = place_at(2, 30, 0), b = place_at(2, 30, 20);
    const struct quat facing = {1, 0, 0, 0};
    struct pnp_solution found;
    tag[0] = for_solver(&seen[0], &a, 0.1);
    tag[1] = for_solver(&seen[1], &b, 0.1);
    seen[1].id = 1;
    const double rad = 3.14159265358979323846 / 180;
    const struct pose camera_from_a = {quat_multiply(quat_from_rotation_vector(v3(0, 30 * rad, 0)), facing), {0, 0, 2}},
                      camera_from_b = {quat_multiply(quat_from_rotation_vector(v3(0, 50 * rad, 0)), facing),
                                       {2 * portable_sin(20 * rad), 0, 2 * portable_cos(20 * rad)}};
    tag[1].world_from_tag = pose_multiply(pose_inverse(camera_from_a), camera_from_b);
    tag[1].world_from_tag.translation.x += in[0];
    const struct pose_problem problem = {.tags = tag, .tag_count = 2, .fx = F_PX, .fy = F_PX};
    const enum status status = pnp_solve(&problem, 2.5, &found);
    // one of both is left out
    return status < 0 ? answer_of(ANSWER_ERROR) : answer_value(status == NOTHING ? 0 : (double)found.used);
}

static struct answer both_used(const double *in)
{
    (void)in;
    return answer_value(2);
}

static const struct stability_case cases[] = {
    {"tag head-on at 1.43 m", "geometry in double", ANSWER_VALUE, ask_range, NULL, range_in_float, .in = {1.43, 0, 0},
     .exact = {1.43}, .exact_count = 1, .tolerance = 1e-8, .unit = "m"},
    {"tag at 45 degrees, 1.37 m", "geometry in double", ANSWER_VALUE, ask_range, NULL, range_in_float,
     .in = {1.37, 45, 0}, .exact = {1.37}, .exact_count = 1, .tolerance = 1e-8, .unit = "m"},
    {"tag at 80 degrees, 1 m", "geometry in double", ANSWER_VALUE, ask_range, NULL, range_in_float, .in = {1, 80, 0},
     .exact = {1}, .exact_count = 1, .tolerance = 1e-8, .unit = "m"},
    {"tag at 80 degrees, 30 degrees aside, 1 m", "geometry in double", ANSWER_VALUE, ask_range, NULL, range_in_float,
     .in = {1, 80, 30}, .exact = {1}, .exact_count = 1, .tolerance = 1e-8, .unit = "m"},
    {"tag head-on at 3.9 m: tilt unknown, distance not", "geometry in double", ANSWER_VALUE, ask_range, NULL,
     range_in_float, .in = {3.9, 0, 0}, .exact = {3.9}, .exact_count = 1, .tolerance = 1e-7, .unit = "m"},
    {"tag at 5 degrees, 12 m: mirrored or not", "second pose within noise", ANSWER_AMBIGUOUS, ask_range, NULL,
     first_pose, .in = {12, 5, 0}},
    {"tag at 25 degrees, 15 m: mirrored or not", "second pose within noise", ANSWER_AMBIGUOUS, ask_range, NULL,
     first_pose, .in = {15, 25, 0}},
    {"tag at 40 degrees, 30 m: mirrored or not", "second pose within noise", ANSWER_AMBIGUOUS, ask_range, NULL,
     first_pose, .in = {30, 40, 0}},
    {"corners in one place", "areas of corner triangles", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.16}, .unit = "m"},
    {"corners in a line", "areas of corner triangles", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {0, 0, 0.1, 0.001, 0.2, 0.002, 0.3, 0.003, 0.16}, .unit = "m"},
    {"three corners in a line", "areas of corner triangles", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {0, 0.1, 0.1, 0.1, 0.2, 0.1, 0.1, 0, 0.16}, .unit = "m"},
    {"corners of a tag seen from behind", "order of the corners", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {-0.1, -0.1, 0.1, -0.1, 0.1, 0.1, -0.1, 0.1, 0.16}, .unit = "m"},
    {"corners whose sides cross", "order of the corners", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {-0.1, 0.1, 0.1, -0.1, 0.1, 0.1, -0.1, -0.1, 0.16}, .unit = "m"},
    {"a corner that is NaN", "finite corners only", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {-0.1, 0.1, 0.1, 0.1, NAN, -0.1, -0.1, -0.1, 0.16}, .unit = "m"},
    {"a tag with a side of 0", "sides above 0", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {-0.1, 0.1, 0.1, 0.1, 0.1, -0.1, -0.1, -0.1, 0}, .unit = "m"},
    {"a tag with a side of NaN", "sides above 0", ANSWER_UNKNOWN, ask_corners, &plain_square_range,
     .in = {-0.1, 0.1, 0.1, 0.1, 0.1, -0.1, -0.1, -0.1, NAN}, .unit = "m"},
    {"two tags, one hung elsewhere since", "outliers left out", ANSWER_VALUE, ask_two_tags, NULL, both_used,
     .in = {0.3}, .exact = {1}, .exact_count = 1},
};
const struct stability_stage stability_tags = {"tags and pose", cases, COUNT_OF(cases)};
