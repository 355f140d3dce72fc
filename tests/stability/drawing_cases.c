// What drawing decides before it draws: levels of detail, bounds of frusta, meshes, resolution, the orbit, gestures.
#include "app/state/frame_times.h"
#include "app/state/orbit.h"
#include "reenact/render/actor_renderer.h"
#include "reenact/render/occlusion_shadow.h"
#include "reenact/scene/occluder_mesh.h"
#include "reenact/skeleton/body_cylinders.h"
#include "tests/stability/stability.h"

static const struct lens view = {.width = 1280, .height = 800, .fx = 1000, .fy = 1000, .cx = 639.5, .cy = 399.5};

// in: depth of the only known joint -> pixels per metre.
static struct answer ask_pixels_per_metre(const double *in)
{
    struct skeleton s = {0};
    s.joint[JOINT_NECK] = v3(0, 0, in[0]);
    s.confidence[JOINT_NECK] = (float)in[1];
    const double p = lod_pixels_per_metre(&view, &s);
    return p > 0 ? answer_value(p) : answer_of(ANSWER_UNKNOWN);
}

static struct answer by_its_depth(const double *in) { return answer_value(1000 / in[0]); }

// in: centre x, z, radius -> whether the frustum holds the ball's points (1), by directions all round it that lie
// before the camera; an empty one says unknown.
static struct answer ask_frustum(const double *in)
{
    struct occlusion_frustum f = {0};
    const struct vec3 c = v3(in[0], 0, in[1]);
    bool all = true;
    occlusion_frustum_add(&f, c, in[2]);
    if (!(f.farthest_m > 0))
        return answer_of(ANSWER_UNKNOWN);
    for (int i = 0; i < 720; i++) {
        const struct vec3 p = v3(c.x + in[2] * cos(i * 0.00872664626), 0, c.z + in[2] * sin(i * 0.00872664626));
        if (p.z > 1e-6)
            all = all && p.x / p.z >= f.low[0] - 1e-9 && p.x / p.z <= f.high[0] + 1e-9 && p.z <= f.farthest_m + 1e-9;
    }
    return answer_value(all);
}

static struct answer frustum_by_asin(const double *in)
{
    const double radius[2] = {in[2], sqrt(in[0] * in[0] + in[1] * in[1])};
    double half;
    plain_asin_half_width.in_double(radius, &half);
    const double to = atan2(in[0], in[1]), low = tan(to - half), high = tan(to + half);
    bool all = true;
    for (int i = 0; i < 720; i++) {
        const double x = in[0] + in[2] * cos(i * 0.00872664626), z = in[1] + in[2] * sin(i * 0.00872664626);
        if (z > 1e-6)
            all = all && x / z >= low - 1e-9 && x / z <= high + 1e-9;
    }
    return answer_value(all);
}

// in: low and high of x / z -> the box's width; 0: the whole image.
static struct answer ask_bounds(const double *in)
{
    const double low[2] = {in[0], -0.1}, high[2] = {in[1], 0.1};
    const struct gpu_box box = screen_bounds(&view, low, high);
    return answer_value(box.width);
}

static struct answer bounds_by_projection(const double *in)
{
    const double width = 1000 * (in[1] - in[0]);
    return answer_value(width < 1e9 && width > -1e9 ? floor(width) : width);
}

// in: distance of the room and the viewer from the origin -> how far a point 2 m ahead is drawn beside where it is.
static struct answer ask_far_room(const double *in)
{
    const struct pose world_from_viewer = {quat_from_rotation_vector(v3(0.1, 0.7, -0.2)), {in[0], -in[0], 1.5}};
    const struct vec3 ahead = v3(0.2, -0.1, 2), world = pose_apply(world_from_viewer, ahead);
    const struct affine_map m = affine_from_pose(pose_inverse(world_from_viewer));
    const float p[3] = {(float)world.x, (float)world.y, (float)world.z};
    double off = 0;
    const double wanted[3] = {ahead.x, ahead.y, ahead.z};
    for (int i = 0; i < 3; i++) // as a vertex shader does
        off = fmax(off, fabs((double)(m.row[i][0] * p[0] + m.row[i][1] * p[1] + m.row[i][2] * p[2] + m.row[i][3]) -
                             wanted[i]));
    return answer_value(off);
}

static struct answer far_as_stated(const double *in)
{
    return answer_value(in[0] * 0x1p-9); // half floats, as small vertices are stored
}

// in: radius and error in pixels -> sides of a cylinder.
static struct answer ask_sides(const double *in) { return answer_value(cylinder_sides(in[0], in[1])); }

static struct answer sides_by_formula(const double *in)
{
    return answer_value(3.14159265358979323846 / acos(1 - in[1] / in[0]));
}

// in: cap, around, along -> whether all vertices are finite.
static struct answer ask_mesh(const double *in)
{
    struct cylinder_mesh mesh;
    bool finite = true;
    const enum status status = cylinder_mesh_make(CYLINDER_ROUNDED, in[0], (int)in[1], (int)in[2], &mesh);
    for (int i = 0; status == OK && i < 3 * mesh.vertex_count; i++)
        finite = finite && isfinite(mesh.vertices[i]);
    if (status == OK)
        cylinder_mesh_free(&mesh);
    return answer_status(status, finite);
}

static struct answer slope_of_cap(const double *in) { return answer_value(isfinite(1 / in[0])); }

// A frame that took in[0] ms among frames of 10 ms, with 16 ms to spend -> whether the resolution falls when
// frames then take 60 ms.
static struct answer ask_governor(const double *in)
{
    struct resolution_governor g = governor_start(16);
    for (int i = 0; i < 10; i++)
        (void)governor_update(&g, 10);
    (void)governor_update(&g, in[0]);
    bool fell = false;
    for (int i = 0; i < 20; i++)
        fell = governor_update(&g, 60) || fell;
    return answer_value(fell);
}

static struct answer mean_with_it(const double *in)
{
    double mean = 10;
    mean += 0.2 * (in[0] - mean);
    for (int i = 0; i < 300; i++)
        mean += 0.2 * (60 - mean);
    return answer_value(mean > 16);
}

static struct answer ask_skip(const double *in)
{
    struct frame_skip s = {0};
    for (int i = 0; i < 10; i++)
        (void)frame_skip_update(&s, 10, true, false);
    (void)frame_skip_update(&s, in[0], true, false);
    return answer_value(frame_skip_update(&s, 100, true, true));
}

static struct answer skip_by_mean(const double *in)
{
    const double mean = 10 + 0.2 * (in[0] - 10);
    return answer_value(100 > 3 * mean);
}

// in: drag, notches -> the viewpoint's distance from the centre.
static struct answer ask_orbit(const double *in)
{
    struct orbit o = {.centre = {0, 0, 1}, .distance_m = 3};
    orbit_move(&o, in[0], 0, in[1]);
    const struct pose p = orbit_world_from_camera(&o);
    return pose_finite(p) ? answer_value(v3_distance(p.translation, o.centre)) : answer_of(ANSWER_UNKNOWN);
}

static struct answer orbit_as_dragged(const double *in) { return answer_value(3 * pow(0.9, in[1]) + 0 * in[0]); }

// Two fingers in one place, one of which moves by in[0] -> spread and twist.
static struct answer ask_pinch(const double *in)
{
    struct gesture g = {0};
    gesture_down(&g, 1, 0.5, 0.5, 0);
    gesture_down(&g, 2, 0.5, 0.5, 0);
    gesture_move(&g, 2, 0.5 + in[0], 0.5);
    const struct gesture t = gesture_take(&g);
    return answer_values((double[]){t.spread, t.twist}, 2);
}

static struct answer pinch_by_quotient(const double *in)
{
    const double before = 0 * in[0];
    return answer_values((double[]){in[0] / before, 0}, 2);
}

// Whether triangles of a room are culled that may hide what is `in[0]` metres away, in a room at NaN or infinity.
static struct answer ask_cull(const double *in)
{
    float points[3][3] = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    uint16_t corners[3] = {0, 1, 2}, kept[3];
    struct occluder_sphere ball = {.middle = {0.3, 0.3, in[0]}, .radius_m = in[1], .first = 0, .count = 3};
    const struct occluder_mesh mesh = {points, corners, 3, 3, &ball, 1};
    const struct affine_map same = affine_from_pose(POSE_IDENTITY);
    struct occlusion_frustum hidden = {0};
    occlusion_frustum_add(&hidden, v3(0, 0, 2), 0.4);
    return answer_value(occluder_mesh_cull(&mesh, &same, &hidden, kept));
}

static struct answer cull_by_centre(const double *in) { return answer_value(in[0] > 0 && in[0] < 2 ? 3 : 0); }

static const struct stability_case cases[] = {
    {"pixels per metre of a person behind the camera", "joints from 5 cm on", ANSWER_UNKNOWN, ask_pixels_per_metre,
     NULL, by_its_depth, .in = {-2, 1}, .unit = "px/m"},
    {"pixels per metre of a person at the near plane", "joints from 5 cm on", ANSWER_UNKNOWN, ask_pixels_per_metre,
     NULL, by_its_depth, .in = {0.01, 1}, .unit = "px/m"},
    {"pixels per metre of a joint that is NaN", "joints from 5 cm on", ANSWER_UNKNOWN, ask_pixels_per_metre, NULL,
     by_its_depth, .in = {NAN, 1}, .unit = "px/m"},
    {"camera inside a body part", "unbounded sides", ANSWER_VALUE, ask_frustum, NULL, frustum_by_asin,
     .in = {0.1, 0.1, 0.35}, .exact = {1}, .exact_count = 1},
    {"camera at a body part's very middle", "unbounded sides", ANSWER_VALUE, ask_frustum, NULL, frustum_by_asin,
     .in = {0, 0, 0.35}, .exact = {1}, .exact_count = 1},
    {"body part beside the camera, half behind it", "unbounded sides", ANSWER_VALUE, ask_frustum, NULL, frustum_by_asin,
     .in = {0.5, 0, 0.35}, .exact = {1}, .exact_count = 1},
    {"body part behind the camera", "nothing behind hides", ANSWER_UNKNOWN, ask_frustum, NULL, frustum_by_asin,
     .in = {0, -1, 0.35}},
    {"screen bounds of an unbounded frustum", "the whole image", ANSWER_VALUE, ask_bounds, NULL, bounds_by_projection,
     .in = {-INFINITY, 0.3}, .exact = {0}, .exact_count = 1, .unit = "px"},
    {"screen bounds of a frustum of NaN", "the whole image", ANSWER_VALUE, ask_bounds, NULL, bounds_by_projection,
     .in = {NAN, NAN}, .exact = {0}, .exact_count = 1, .unit = "px"},
    {"screen bounds of a frustum 1e300 wide", "the whole image", ANSWER_VALUE, ask_bounds, NULL, bounds_by_projection,
     .in = {-1e300, 1e300}, .exact = {0}, .exact_count = 1, .unit = "px"},
    {"room drawn 100 m from the origin", "single precision suffices", ANSWER_VALUE, ask_far_room, NULL, far_as_stated,
     .in = {100}, .exact = {0}, .exact_count = 1, .tolerance = 1e-4, .unit = "m"},
    {"sides of a cylinder of no radius", "8 to 64 sides", ANSWER_VALUE, ask_sides, NULL, sides_by_formula, .in = {0, 1},
     .exact = {8}, .exact_count = 1},
    {"sides of a cylinder as wide as 1e30 pixels", "8 to 64 sides", ANSWER_VALUE, ask_sides, NULL, sides_by_formula,
     .in = {1e30, 1}, .exact = {64}, .exact_count = 1},
    {"sides of a cylinder of NaN pixels", "8 to 64 sides", ANSWER_VALUE, ask_sides, NULL, sides_by_formula,
     .in = {NAN, 1}, .exact = {64}, .exact_count = 1},
    {"mesh of a cylinder with flat caps", "angles, not slopes", ANSWER_VALUE, ask_mesh, NULL, slope_of_cap,
     .in = {0, 8, 1}, .exact = {1}, .exact_count = 1},
    {"resolution after a frame that took NaN", "finite times only", ANSWER_VALUE, ask_governor, NULL, mean_with_it,
     .in = {NAN}, .exact = {1}, .exact_count = 1},
    {"resolution after a frame that took -infinity", "finite times only", ANSWER_VALUE, ask_governor, NULL,
     mean_with_it, .in = {-INFINITY}, .exact = {1}, .exact_count = 1},
    {"skipping a late image after one that took NaN", "finite times only", ANSWER_VALUE, ask_skip, NULL, skip_by_mean,
     .in = {NAN}, .exact = {1}, .exact_count = 1},
    {"orbit dragged by NaN", "finite drags only", ANSWER_VALUE, ask_orbit, NULL, orbit_as_dragged, .in = {NAN, 0},
     .exact = {3}, .exact_count = 1, .tolerance = 1e-12, .unit = "m"},
    {"orbit after 1000 notches", "0.8 m to 12 m", ANSWER_VALUE, ask_orbit, NULL, orbit_as_dragged, .in = {0, 1000},
     .exact = {0.8}, .exact_count = 1, .tolerance = 1e-12, .unit = "m"},
    {"two fingers in one place", "no quotient of distances", ANSWER_VALUE, ask_pinch, NULL, pinch_by_quotient,
     .in = {0.1}, .exact = {1, 0}, .exact_count = 2},
    {"room's triangles about the camera", "bounds, not middles", ANSWER_VALUE, ask_cull, NULL, cull_by_centre,
     .in = {-0.2, 0.8}, .exact = {3}, .exact_count = 1, .unit = "corners"},
};
const struct stability_stage stability_drawing = {"drawing", cases, COUNT_OF(cases)};
