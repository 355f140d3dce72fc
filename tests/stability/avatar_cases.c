// The avatar: bones that have no direction, a TSDF of one view, texture of triangles without area, inpainted gaps.
#include "reenact/avatar/texture_atlas.h"
#include "reenact/avatar/tsdf.h"
#include "reenact/avatar/vertex_color.h"
#include "reenact/skeleton/bind_pose.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/stability/stability.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 96, HEIGHT = 96, PIXELS = WIDTH * HEIGHT };
#define RADIUS_M 0.16

// The upper torso, from the origin 0.4 m down; the camera is 2 m ahead of it.
static struct bind_pose torso(double length_m)
{
    struct bind_pose bind = {0};
    const struct part_ends ends = part_ends[PART_UPPER_TORSO];
    bind.skeleton.joint[ends.to] = v3(0, length_m, 0);
    bind.skeleton.confidence[ends.from] = bind.skeleton.confidence[ends.to] = 1;
    bind.known[PART_UPPER_TORSO] = true;
    bind.radius[PART_UPPER_TORSO] = RADIUS_M;
    bind.own_length[PART_UPPER_TORSO] = length_m;
    bind.frame[PART_UPPER_TORSO] = (struct bone_frame){v3(0, 0, 0), v3(1, 0, 0), v3(0, 0, -1), v3(0, 1, 0), length_m};
    return bind;
}

static const struct calibration square = {
    .registered = true,
    .color_from_depth = {{0, 0, 0, 1}, {0, 0, 0}},
    .color = {.width = WIDTH, .height = HEIGHT, .fx = 120, .fy = 120, .cx = 47.5, .cy = 47.5},
    .depth = {.width = WIDTH, .height = HEIGHT, .fx = 120, .fy = 120, .cx = 47.5, .cy = 47.5}};

// One frame that shows a flat chest at `mm`.
static enum status fuse_one_view(struct tsdf *v, double mm)
{
    static uint16_t depth[PIXELS];
    static uint8_t part[PIXELS], edge[PIXELS], half[PIXELS];
    struct source_rays *rays = NULL;
    const struct body body = {.radius_rate = {[PART_UPPER_TORSO] = 0.4}};
    struct bone_transforms transforms;
    for (int i = 0; i < PIXELS; i++) {
        const bool on = abs(i % WIDTH - 48) < 10 && abs(i / WIDTH - 48) < 11;
        depth[i] = on ? (uint16_t)mm : mm > 0 ? 4000 : 0;
        part[i] = on && mm > 0 ? PART_UPPER_TORSO : DEPTH_FRAME_BACKGROUND;
        edge[i] = half[i] = 8;
    }
    for (int b = 0; b < BONE_COUNT; b++)
        transforms.bone[b] = (struct pose){{0, 0, 0, 1}, {0, -0.2, 2}};
    enum status status = source_rays_open(&rays, &square);
    const struct depth_frame frame = {.width = WIDTH,
                                      .height = HEIGHT,
                                      .fx = 120,
                                      .rays = rays,
                                      .body = &body,
                                      .depth = depth,
                                      .part = part,
                                      .edge_distance = edge,
                                      .half_width = half,
                                      .max_edge_distance = DEPTH_FRAME_MAX_EDGE_PX,
                                      .has_mask = true,
                                      .left = 39,
                                      .right = 57,
                                      .top = 38,
                                      .bottom = 58};
    if (status == OK)
        status = tsdf_integrate(v, &frame, &transforms);
    source_rays_close(&rays);
    return status;
}

// in: depth in mm, a point of the bind pose -> its signed distance from the surface, where a frame has seen that.
static struct answer ask_one_view(const double *in)
{
    struct tsdf *v = NULL;
    const struct bind_pose bind = torso(0.4);
    double distance = NAN, seen = 0;
    struct vec3 gradient;
    enum status status = tsdf_open(&v, &bind, &square, 0.012, 1);
    if (status == OK)
        status = fuse_one_view(v, in[0]);
    const bool near = status == OK && tsdf_sample(v, v3(in[1], in[2], in[3]), &distance, &gradient, &seen);
    tsdf_close(&v);
    return status != OK       ? answer_status(status, 0)
           : near && seen > 0 ? answer_value(distance)
                              : answer_of(ANSWER_UNKNOWN);
}

// The view's depth, taken for the whole body's.
static struct answer as_deep_as_seen(const double *in) { return answer_value(2 + in[3] - in[0] * 1e-3); }

// The prior's cylinder, whatever was seen.
static struct answer cylinder_alone(const double *in)
{
    return answer_value(sqrt(in[1] * in[1] + in[3] * in[3]) - RADIUS_M);
}

// in: where the torso ends.
static struct answer ask_extent(const double *in)
{
    struct tsdf *v = NULL;
    struct bind_pose bind = torso(0.4);
    bind.skeleton.joint[part_ends[PART_UPPER_TORSO].to] = v3(in[0], in[1], in[2]);
    const enum status status = tsdf_open(&v, &bind, &square, TSDF_VOXEL_M, 1);
    tsdf_close(&v);
    return answer_status(status, 0);
}

static struct answer points_in_an_int(const double *in)
{
    const double points = (in[0] + 1) * (in[1] + 1) * (in[2] + 1) / (TSDF_VOXEL_M * TSDF_VOXEL_M * TSDF_VOXEL_M);
    return answer_value((double)(float)points);
}

// A person whose torso hangs from the neck, with one limb of the given length and bend. in: length of the forearm,
// angle of the elbow in radians, whether the upper arm points up along the neutral's opposite.
static struct skeleton person(double forearm_m, double bend_rad)
{
    struct skeleton s = {0};
    static const struct {
        enum joint joint;
        double x, y;
    } at[] = {{JOINT_NECK, 0, -0.5},
              {JOINT_TORSO, 0, -0.25},
              {JOINT_WAIST, 0, 0},
              {JOINT_LEFT_SHOULDER, 0.2, -0.5},
              {JOINT_RIGHT_SHOULDER, -0.2, -0.5},
              {JOINT_LEFT_HIP, 0.1, 0},
              {JOINT_RIGHT_HIP, -0.1, 0},
              {JOINT_LEFT_ELBOW, 0.2, -0.2}};
    for (size_t i = 0; i < COUNT_OF(at); i++) {
        s.joint[at[i].joint] = v3(at[i].x, at[i].y, 2.5);
        s.confidence[at[i].joint] = 1;
    }
    s.joint[JOINT_LEFT_HAND] =
        v3_add(s.joint[JOINT_LEFT_ELBOW], v3(forearm_m * sin(bend_rad), forearm_m * cos(bend_rad), 0));
    s.confidence[JOINT_LEFT_HAND] = 1;
    return s;
}

// Whether the forearm's axes are a right-handed orthonormal frame: 1.
static struct answer frame_quality(bool known, const struct bone_frame *f)
{
    if (!known)
        return answer_of(ANSWER_UNKNOWN);
    return answer_value(fmax(fabs(v3_dot(f->x, f->y)), fabs(v3_dot(f->x, v3_cross(f->y, f->z)) - 1)));
}

static struct answer ask_forearm(const double *in)
{
    const struct skeleton s = person(in[0], in[1]);
    struct bone_frame f = {0};
    return frame_quality(bone_frame_body_aligned(&s, PART_LEFT_FOREARM, &f), &f);
}

static struct answer ask_towards_eye(const double *in)
{
    const struct skeleton s = person(in[0], in[1]);
    struct bone_frame f = {0};
    const struct vec3 eye =
        v3_add(s.joint[JOINT_LEFT_ELBOW], v3_scale(v3_sub(s.joint[JOINT_LEFT_HAND], s.joint[JOINT_LEFT_ELBOW]), in[2]));
    return frame_quality(bone_frame_viewer_aligned(&s, PART_LEFT_FOREARM, eye, &f), &f);
}

// The hinge's axis by cross products alone.
static struct answer hinge_by_cross(const double *in)
{
    const struct skeleton s = person(in[0], in[1]);
    const struct vec3 upper = v3_sub(s.joint[JOINT_LEFT_ELBOW], s.joint[JOINT_LEFT_SHOULDER]),
                      lower = v3_sub(s.joint[JOINT_LEFT_HAND], s.joint[JOINT_LEFT_ELBOW]);
    const struct vec3 z = v3_scale(lower, 1 / v3_length(lower)), across = v3_cross(upper, lower),
                      x = v3_scale(across, 1 / v3_length(across)), y = v3_cross(z, x);
    return answer_value(fmax(fabs(v3_dot(x, y)), fabs(v3_dot(x, v3_cross(y, z)) - 1)));
}

// in: a point -> the sum of its skin weights, and whether one is below 0.
static struct answer ask_skin(const double *in)
{
    const struct bind_pose bind = torso(0.4);
    const struct skin_weights w = bind_pose_skin_weights(&bind, v3(in[0], in[1], in[2]));
    float sum = 0, least = 1;
    for (int i = 0; i < SKIN_BONES; i++) {
        sum += w.weight[i];
        least = fminf(least, w.weight[i]);
    }
    return answer_values((double[]){(double)sum, least >= 0}, 2);
}

static struct answer inverse_distance(const double *in)
{
    const double d = sqrt(in[0] * in[0] + in[2] * in[2]), w = 1 / d;
    return answer_values((double[]){w / w, w >= 0}, 2);
}

// A square of two triangles, in[0] high and in[1] wide, and one triangle of no area between them -> texels are finite
// and each corner lies in the image: 1.
static struct answer ask_unwrap(const double *in)
{
    struct vec3 points[5] = {{0, 0, 0}, {in[1], 0, 0}, {in[1], in[0], 0}, {0, in[0], 0}, {in[1] / 2, in[0] / 2, 0}},
                normals[5];
    int32_t corners[9] = {0, 1, 2, 0, 4, 2, 0, 2, 3};
    for (int i = 0; i < 5; i++)
        normals[i] = v3(0, 0, 1);
    const struct surface_mesh surface = {points, normals, corners, 5, 9};
    struct uv_mesh u = {0};
    const enum status status = uv_unwrap(&u, &surface, corners, 9, 0.004);
    bool good = true;
    for (int i = 0; status == OK && i < u.point_count; i++)
        good =
            good && u.at[i][0] >= 0 && u.at[i][1] >= 0 && u.at[i][0] <= (float)u.width && u.at[i][1] <= (float)u.height;
    uv_mesh_free(&u);
    return answer_status(status, good);
}

// Texels by the triangle's own axes.
static struct answer unwrap_by_axes(const double *in)
{
    const struct vec3 a = v3(in[1] / 2, in[0] / 2, 0), b = v3(in[1], in[0], 0), n = v3_cross(a, b);
    const struct vec3 up = v3_scale(n, 1 / v3_length(n));
    const double texels = v3_length(v3_cross(up, a)) / 0.004;
    return answer_value(texels >= 0 && texels < 1e6);
}

// in: all terms, the normal -> irradiance; clamped where it is an extrapolation.
static struct answer ask_irradiance(const double *in)
{
    struct sh_irradiance s = {{1}};
    s.term[3] = (float)in[0];
    const float n[3] = {0, 0, (float)in[1]};
    return answer_value((double)sh_irradiance_at(&s, n));
}

static struct answer series_alone(const double *in) { return answer_value(1 + in[0] * in[1]); }

static struct answer ask_noise(const double *in)
{
    struct joint_noise_sum sum = {.frames = (int)in[0]};
    sum.m2[0] = in[1];
    sum.rad2[0] = in[1];
    return answer_value(joint_noise_estimate(&sum).m[0]);
}

static struct answer root_of_mean(const double *in) { return answer_value(sqrt(in[1] / in[0])); }

// A cube of 0.2 m whose points were all seen in[0] seconds into the take -> that time, as the atlas has it.
static struct answer ask_seen_time(const double *in)
{
    struct vec3 points[8], normals[8];
    float color[8][3], time_s[8];
    uint8_t filled[8] = {0};
    int32_t corners[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    for (int i = 0; i < 8; i++) {
        points[i] = v3(0.2 * (i & 1), 0.2 * (i >> 1 & 1), 0.2 * (i >> 2));
        normals[i] = v3_unit(v3_sub(points[i], v3(0.1, 0.1, 0.1)));
        color[i][0] = color[i][1] = color[i][2] = 0.5F;
        time_s[i] = (float)in[0];
    }
    const struct surface_mesh surface = {points, normals, corners, 8, 36};
    const struct vertex_colors colors = {.color = color, .time_s = time_s, .filled = filled};
    struct texture_atlas a = {0};
    const enum status status = texture_atlas_make(&a, &surface, &colors, 1);
    double seen = NAN;
    if (status == OK && a.mesh.point_count > 0) {
        const uint8_t *t = a.seen_time + 4 * ((int)a.mesh.at[0][1] * a.mesh.width + (int)a.mesh.at[0][0]);
        seen = 0.01 * (65536 * t[3] + 256 * t[0] + t[1]);
    }
    texture_atlas_free(&a);
    return answer_status(status, seen);
}

static struct answer hundredths_in_two_bytes(const double *in) { return answer_value(fmin(in[0] * 100, 65535) / 100); }

static const struct stability_case cases[] = {
    {"chest in a TSDF of one view", "fused depth, not the prior", ANSWER_VALUE, ask_one_view, NULL, cylinder_alone,
     .in = {1900, 0, 0.2, -0.1}, .exact = {0}, .exact_count = 1, .tolerance = 0.02, .unit = "m"},
    {"back in a TSDF of one view", "a count of what was seen", ANSWER_UNKNOWN, ask_one_view, NULL, as_deep_as_seen,
     .in = {1900, 0, 0.2, 0.16}, .unit = "m"},
    {"chest in a TSDF of one image without depth", "a count of what was seen", ANSWER_UNKNOWN, ask_one_view, NULL,
     cylinder_alone, .in = {0, 0, 0.2, -0.1}, .unit = "m"},
    {"avatar of a person 100 m tall", "a bound on grid points", ANSWER_ERROR, ask_extent, NULL, points_in_an_int,
     .in = {100, 100, 100}},
    {"avatar of joints 1e300 m apart", "a bound on grid points", ANSWER_ERROR, ask_extent, NULL, points_in_an_int,
     .in = {1e300, 1e300, -1e300}},
    {"avatar of a joint that is NaN", "a bound on grid points", ANSWER_ERROR, ask_extent, NULL, points_in_an_int,
     .in = {0, NAN, 0}},
    {"axes of a forearm without length", "a bone is 1 mm long", ANSWER_UNKNOWN, ask_forearm, NULL, hinge_by_cross,
     .in = {0, 0}},
    {"axes of a forearm of NaN", "a bone is 1 mm long", ANSWER_UNKNOWN, ask_forearm, NULL, hinge_by_cross,
     .in = {NAN, 0}},
    {"axes of a straight arm's forearm", "from the trunk where the hinge is straight", ANSWER_VALUE, ask_forearm, NULL,
     hinge_by_cross, .in = {0.25, 0}, .exact = {0}, .exact_count = 1, .tolerance = 1e-15},
    {"axes of a folded arm's forearm", "from the trunk where the hinge is folded", ANSWER_VALUE, ask_forearm, NULL,
     hinge_by_cross, .in = {-0.25, 0}, .exact = {0}, .exact_count = 1, .tolerance = 1e-15},
    {"axes of a forearm bent by 1e-9 rad", "blended with the trunk's", ANSWER_VALUE, ask_forearm, NULL, hinge_by_cross,
     .in = {0.25, 1e-17}, .exact = {0}, .exact_count = 1, .tolerance = 1e-15},
    {"axes of a forearm seen along itself", "a perpendicular of the bone", ANSWER_VALUE, ask_towards_eye, NULL,
     hinge_by_cross, .in = {0.25, 0, 9}, .exact = {0}, .exact_count = 1, .tolerance = 1e-15},
    {"axes of a forearm seen from inside it", "a perpendicular of the bone", ANSWER_VALUE, ask_towards_eye, NULL,
     hinge_by_cross, .in = {0.25, 0, 0.5}, .exact = {0}, .exact_count = 1, .tolerance = 1e-15},
    {"skin weights of a point on the bone", "the nearest bone first", ANSWER_VALUE, ask_skin, NULL, inverse_distance,
     .in = {0, 0.2, 0}, .exact = {1, 1}, .exact_count = 2, .tolerance = 1e-6},
    {"texture of a triangle without area", "orthographic charts", ANSWER_VALUE, ask_unwrap, NULL, unwrap_by_axes,
     .in = {0.2, 0.2}, .exact = {1}, .exact_count = 1},
    {"texture of a square seen edge-on, without height", "orthographic charts", ANSWER_VALUE, ask_unwrap, NULL,
     unwrap_by_axes, .in = {0, 0.2}, .exact = {1}, .exact_count = 1},
    {"texture of triangles in one point", "orthographic charts", ANSWER_VALUE, ask_unwrap, NULL, unwrap_by_axes,
     .in = {0, 0}, .exact = {1}, .exact_count = 1},
    {"texture of a square 10 m wide", "a largest image", ANSWER_ERROR, ask_unwrap, NULL, unwrap_by_axes,
     .in = {10, 10}},
    {"when a point was seen, an hour into a take", "three bytes of hundredths", ANSWER_VALUE, ask_seen_time, NULL,
     hundredths_in_two_bytes, .in = {3600}, .exact = {3600}, .exact_count = 1, .tolerance = 0.011, .unit = "s"},
    {"light on a side that no light was seen on", "a range of irradiance", ANSWER_VALUE, ask_irradiance, NULL,
     series_alone, .in = {5, -1}, .exact = {0.4}, .exact_count = 1, .tolerance = 1e-7},
    {"joints' error from no frame", "the prior's", ANSWER_VALUE, ask_noise, NULL, root_of_mean, .in = {0, 0},
     .exact = {0.06}, .exact_count = 1, .unit = "m"},
    {"joints' error from frames that agree exactly", "3 mm at least", ANSWER_VALUE, ask_noise, NULL, root_of_mean,
     .in = {9, 0}, .exact = {0.003}, .exact_count = 1, .unit = "m"},
};
const struct stability_stage stability_avatar = {"avatar", cases, COUNT_OF(cases)};
