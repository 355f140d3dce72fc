#include "tests/support/test.h"

#include "tests/support/painted_person.h"

#include "platform/files/jpeg.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

const struct lens ideal = {W, H, 260, 260, 159.5, 119.5, 0, 0, 0, 0, 0, 0, 0};
const struct lens bent = {W, H, 265, 262, 163, 117, -0.12, 0.03, 0.015, -0.012, 0.004, 0, 0};

void painted_take_open(struct painted_take *s, const struct lens *color, const struct one_frame *frames, int count,
                       const struct body *body)
{
    snprintf(s->path, sizeof s->path, "/tmp/painted_person_%d.reenact", (int)getpid());
    remove(s->path);
    struct calibration c = {.color = *color, .depth = *color, .registered = true, .color_from_depth = POSE_IDENTITY};
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, s->path), OK);
    EXPECT_STATUS(recording_begin_take(w, "made", &c), OK);
    for (int i = 0; i < count; i++) {
        struct take_frame f = {.time_ns = 5000000000 + i * 40000000ll,
                               .world_from_camera = POSE_IDENTITY,
                               .located = true,
                               .depth = frames[i].depth,
                               .mask = frames[i].mask,
                               .has_skeleton = true,
                               .skeleton = frames[i].skeleton};
        uint8_t *jpeg = NULL;
        if (frames[i].rgb) {
            EXPECT_STATUS(jpeg_encode(frames[i].rgb, color->width, color->height, 98, &jpeg, &f.jpeg_bytes), OK);
            f.jpeg = jpeg;
        }
        EXPECT_STATUS(recording_add_frame(w, &f), OK);
        free(jpeg);
    }
    EXPECT_STATUS(recording_put_body(w, body), OK);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_STATUS(recording_open(&s->recording, s->path), OK);
    EXPECT_STATUS(take_open(&s->take, s->recording, "made"), OK);
    EXPECT_STATUS(gpu_open(&s->gpu), OK);
}

void painted_take_close(struct painted_take *s)
{
    gpu_close(&s->gpu);
    take_close(&s->take);
    recording_free(&s->recording);
    remove(s->path);
}

struct renderer *painted_take_renderer(struct painted_take *s, const struct lens *lens, enum detail detail)
{
    struct renderer_options o = renderer_default_options();
    o.detail = detail;
    struct renderer *p;
    EXPECT_STATUS(renderer_open(&p, s->gpu, s->take, lens, &o), OK);
    return p;
}

void draw_picture(struct renderer *p, struct pose world_from_camera, int64_t time_ns, const uint8_t *color,
                  struct drawn *out)
{
    struct renderer_view view = {.world_from_camera = world_from_camera, .time_ns = time_ns, .color = color};
    EXPECT_STATUS(renderer_draw(p, &view, &out->result), OK);
    EXPECT_STATUS(renderer_read(p, out->rgb), OK);
    EXPECT_STATUS(renderer_read_actor(p, out->actor), OK);
}

double tube_depth(struct vec3 ray, struct vec3 a, struct vec3 b, double radius, double nearest)
{
    struct vec3 axis = v3_unit(v3_sub(b, a));
    double length = v3_distance(a, b);
    struct vec3 d = v3_sub(ray, v3_scale(axis, v3_dot(ray, axis)));
    struct vec3 o = v3_sub(v3_scale(axis, v3_dot(a, axis)), a);
    double qa = v3_dot(d, d), qb = v3_dot(d, o), qc = v3_dot(o, o) - radius * radius;
    double root = qb * qb - qa * qc;
    if (!(root >= 0) || !(qa > 0))
        return INFINITY;
    for (int sign = -1; sign <= 1; sign += 2) {
        double t = (-qb + sign * sqrt(root)) / qa;
        double along = v3_dot(v3_sub(v3_scale(ray, t), a), axis);
        if (t >= nearest && along >= 0 && along <= length)
            return t;
    }
    return INFINITY;
}

double ball_depth(struct vec3 ray, struct vec3 c, double radius)
{
    double a = v3_dot(ray, ray), b = v3_dot(ray, c), root = b * b - a * (v3_dot(c, c) - radius * radius);
    double t = root >= 0 ? (b - sqrt(root)) / a : INFINITY;
    return t > 0 ? t : INFINITY;
}

struct skeleton whole_body(double arm)
{
    static const double at[JOINT_COUNT][3] = {
        [JOINT_HEAD] = {0, -0.68, 0},
        [JOINT_NECK] = {0, -0.45, 0},
        [JOINT_LEFT_SHOULDER] = {0.18, -0.42, 0},
        [JOINT_LEFT_ELBOW] = {0.32, -0.2, 0},
        [JOINT_LEFT_HAND] = {0.45, 0, 0},
        [JOINT_RIGHT_SHOULDER] = {-0.18, -0.42, 0},
        [JOINT_RIGHT_ELBOW] = {-0.32, -0.2, 0},
        [JOINT_RIGHT_HAND] = {-0.45, 0, 0},
        [JOINT_TORSO] = {0, -0.15, 0},
        [JOINT_WAIST] = {0, 0.08, 0},
        [JOINT_LEFT_HIP] = {0.1, 0.12, 0},
        [JOINT_LEFT_KNEE] = {0.14, 0.5, 0},
        [JOINT_LEFT_FOOT] = {0.16, 0.9, 0},
        [JOINT_RIGHT_HIP] = {-0.1, 0.12, 0},
        [JOINT_RIGHT_KNEE] = {-0.14, 0.5, 0},
        [JOINT_RIGHT_FOOT] = {-0.16, 0.9, 0},
    };
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3(at[j][0], at[j][1], 2.5 + at[j][2]);
        s.confidence[j] = 1;
    }
    s.joint[JOINT_LEFT_HAND].z -= arm;
    return s;
}

const struct body whole_measures = {
    .radius_rate = {0.42, 0.5, 0.6, 0.18, 0.16, 0.18, 0.16, 0.2, 0.15, 0.2, 0.15},
};

void paint_person(struct painted *out, const struct lens *lens, const struct skeleton *s, const struct body *body)
{
    for (int i = 0; i < PIXELS; i++) {
        int x = i % W, y = i / W;
        struct vec3 ray = lens_ray(lens, (struct pixel){x, y});
        double depth = INFINITY;
        for (int p = 0; p < PART_COUNT; p++) {
            struct vec3 a = s->joint[part_ends[p].from], b = s->joint[part_ends[p].to];
            double r = body->radius_rate[p] * v3_distance(a, b);
            depth = fmin(depth, tube_depth(ray, a, b, r, 0));
            depth = fmin(depth, fmin(ball_depth(ray, a, r), ball_depth(ray, b, r)));
        }
        out->mask[i] = isfinite(depth);
        out->depth[i] = (uint16_t)(out->mask[i] ? lround(depth * 1000) : 2620); // a wall close behind
        uint8_t *at = out->rgb + 3 * i;
        at[0] = out->mask[i] ? (uint8_t)(90 + 60 * sin(x * 0.11)) : 255;
        at[1] = out->mask[i] ? (uint8_t)(140 + 60 * sin(y * 0.13)) : 0;
        at[2] = out->mask[i] ? (uint8_t)(80 + 50 * cos((x + y) * 0.07)) : 255;
    }
}
