// The painter against references in double precision, on takes made here: where
// a cylinder falls, what it shows, who hides whom, and that it is repeatable.
#include "tests/test.h"

#include "platform/jpeg.h"
#include "reenact/painter.h"
#include "reenact/likeness.h"
#include "reenact/outline.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { W = 320, H = 240, PIXELS = W * H };
static const double PI = 3.14159265358979323846;
static const struct lens ideal = {W, H, 260, 260, 159.5, 119.5, 0, 0, 0, 0, 0};
static const struct lens bent = {W, H, 265, 262, 163, 117, -0.12, 0.03, 0.015, -0.012, 0.004};

// ---------------------------------------------------------------- a take made here

struct one_frame {
    struct skeleton skeleton;
    const uint8_t *rgb; // NULL: no picture
    const uint16_t *depth;
    const uint8_t *mask;
};

struct stage {
    char path[64];
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
};

static void stage_open(struct stage *s, const struct lens *color, const struct one_frame *frames, int count,
                       const struct body *body)
{
    snprintf(s->path, sizeof s->path, "/tmp/test_render_%d.reenact", (int)getpid());
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

static void stage_close(struct stage *s)
{
    gpu_close(&s->gpu);
    take_close(&s->take);
    recording_free(&s->recording);
    remove(s->path);
}

static struct painter *painter_on(struct stage *s, const struct lens *lens, enum detail detail)
{
    struct painter_options o = painter_default_options();
    o.detail = detail;
    struct painter *p;
    EXPECT_STATUS(painter_open(&p, s->gpu, s->take, lens, &o), OK);
    return p;
}

struct drawn {
    uint8_t rgb[PIXELS * 3], actor[PIXELS * 4];
    struct painter_result result;
};

static void draw(struct painter *p, struct pose world_from_camera, int64_t time_ns, const uint8_t *color,
                 struct drawn *out)
{
    struct painter_view view = {.world_from_camera = world_from_camera, .time_ns = time_ns, .color = color};
    EXPECT_STATUS(painter_draw(p, &view, &out->result), OK);
    EXPECT_STATUS(painter_read(p, out->rgb), OK);
    EXPECT_STATUS(painter_read_actor(p, out->actor), OK);
}

// ---------------------------------------------------------------- the double-precision reference

// How far along `ray` from the origin the open cylinder about a-b of `radius` is
// first met at z >= nearest; infinite: never. ray has z = 1, so that it is the depth.
static double tube_depth(struct vec3 ray, struct vec3 a, struct vec3 b, double radius, double nearest)
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

static double ball_depth(struct vec3 ray, struct vec3 c, double radius)
{
    double a = v3_dot(ray, ray), b = v3_dot(ray, c), root = b * b - a * (v3_dot(c, c) - radius * radius);
    double t = root >= 0 ? (b - sqrt(root)) / a : INFINITY;
    return t > 0 ? t : INFINITY;
}

static const struct body thigh_only = {.radius_rate = {[PART_LEFT_THIGH] = 0.25}};

static struct skeleton only_thigh(struct vec3 hip, struct vec3 knee)
{
    struct skeleton s = {0};
    s.joint[JOINT_LEFT_HIP] = hip;
    s.joint[JOINT_LEFT_KNEE] = knee;
    s.joint[JOINT_NECK] = v3_add(hip, v3(0, -0.6, 0));
    s.confidence[JOINT_LEFT_HIP] = s.confidence[JOINT_LEFT_KNEE] = s.confidence[JOINT_NECK] = 1;
    return s;
}

static void cylinders_fall_where_the_reference_says(void **state)
{
    (void)state;
    static uint8_t grey[PIXELS * 3];
    memset(grey, 120, sizeof grey);
    struct vec3 hip = v3(0.1, -0.2, 2), knee = v3(-0.1, 0.4, 2.2);
    struct one_frame frame = {.skeleton = only_thigh(hip, knee), .rgb = grey};
    struct stage s;
    stage_open(&s, &ideal, &frame, 1, &thigh_only);
    struct painter *p = painter_on(&s, &bent, DETAIL_PAPER);
    static struct drawn got;
    // Viewers: in front; from the side and close; looking almost along the bone; with the
    // cylinder reaching out of the picture; and through the cylinder's own near end.
    const struct pose viewers[] = {
        POSE_IDENTITY,
        {quat_from_rotation_vector(v3(0, -1.2, 0)), v3(1.7, 0, 1.6)},
        {quat_from_rotation_vector(v3(1.35, 0.1, 0.2)), v3(-0.4, 1.5, 2.1)},
        {quat_from_rotation_vector(v3(0.1, 0.2, 0.7)), v3(-0.25, 0.3, 1.35)},
        {quat_from_rotation_vector(v3(0.05, 0.3, 0)), v3(0.15, 0.05, 1.95)},
    };
    for (size_t v = 0; v < COUNT_OF(viewers); v++) {
        draw(p, viewers[v], 0, grey, &got);
        struct pose back = pose_inverse(viewers[v]);
        struct vec3 a = pose_apply(back, hip), b = pose_apply(back, knee);
        double radius = 0.25 * v3_distance(a, b);
        long both = 0, either = 0;
        for (int i = 0; i < PIXELS; i++) {
            struct vec3 ray = lens_ray(&bent, (struct pixel){i % W, i / W});
            bool wanted = isfinite(tube_depth(ray, a, b, radius, 0.05)), is = got.actor[4 * i + 3] >= 128;
            both += wanted && is;
            either += wanted || is;
        }
        EXPECT_AT_LEAST(either, 2000);
        double iou = (double)both / (double)either;
        print_message("viewer %zu: %ld pixels, iou %.4f\n", v, either, iou);
        EXPECT_AT_LEAST(iou, 0.995);
    }
    painter_close(&p);
    stage_close(&s);
}

// ---------------------------------------------------------------- a person of three balls' breadth

static struct skeleton whole_body(double arm)
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
    struct skeleton s;
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3(at[j][0], at[j][1], 2.5 + at[j][2]);
        s.confidence[j] = 1;
    }
    s.joint[JOINT_LEFT_HAND].z -= arm;
    return s;
}

static const struct body whole_measures = {
    .radius_rate = {0.42, 0.5, 0.6, 0.18, 0.16, 0.18, 0.16, 0.2, 0.15, 0.2, 0.15},
};

// What a camera at the origin sees of that person before a magenta wall.
struct painted {
    uint8_t rgb[PIXELS * 3], mask[PIXELS];
    uint16_t depth[PIXELS];
};

static void paint(struct painted *out, const struct lens *lens, const struct skeleton *s, const struct body *body)
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

// Seen from where it was filmed, the body shows the film's own pixels.
static void the_film_is_given_back(void **state)
{
    (void)state;
    static struct painted film;
    static struct drawn got;
    static uint8_t green[PIXELS * 3];
    for (int i = 0; i < PIXELS; i++)
        green[3 * i + 1] = 200;
    struct skeleton s = whole_body(0);
    paint(&film, &bent, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct stage stage;
    stage_open(&stage, &bent, &frame, 1, &whole_measures);
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct painter *p = painter_on(&stage, &bent, (enum detail)detail);
        draw(p, POSE_IDENTITY, 0, green, &got);
        EXPECT_INT(got.result.parts, PART_COUNT);
        double sum = 0;
        long count = 0, drawn = 0, person = 0, overlap = 0;
        for (int i = 0; i < PIXELS; i++) {
            bool solid = got.actor[4 * i + 3] == 255;
            drawn += solid;
            person += film.mask[i];
            overlap += solid && film.mask[i];
            // A person's pixel whose neighbours are the person's too: JPEG halves colour at edges.
            bool inside = film.mask[i] && i > 2 * W && i < PIXELS - 2 * W;
            for (int dy = -2; inside && dy <= 2; dy++)
                for (int dx = -2; dx <= 2; dx++)
                    inside = inside && film.mask[i + dy * W + dx];
            for (int c = 0; c < 3 && inside && solid; c++) {
                double d = (double)got.rgb[3 * i + c] - film.rgb[3 * i + c];
                sum += d * d;
                count++;
            }
        }
        double psnr = 10 * log10(255.0 * 255.0 / (sum / (double)count));
        print_message("%s: %ld pixels of %ld, psnr %.1f dB\n", detail == DETAIL_PAPER ? "paper" : "full", drawn, person,
                      psnr);
        EXPECT_AT_LEAST(count / 3.0, 0.5 * (double)person);
        EXPECT_AT_LEAST(psnr, 38);
        if (detail == DETAIL_FULL) // round ends and all
            EXPECT_AT_LEAST((double)overlap / (double)(drawn + person - overlap), 0.93);
        painter_close(&p);
    }
    stage_close(&stage);
}

static double mean_gap_mm(const struct outline_gaps *g)
{
    double sum = 0, count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        sum += g->sum[p];
        count += g->count[p];
    }
    return 1000 * sum / count;
}

// The figure lies where the body was painted, is closed, finds its way back when the joints are wrong, and is made as
// wide as it is seen.
static void the_figure_lies_on_what_was_seen(void **state)
{
    (void)state;
    static struct painted film;
    struct skeleton s = whole_body(0);
    paint(&film, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct stage stage;
    stage_open(&stage, &ideal, &frame, 1, &whole_measures);
    struct source_rays *rays;
    struct likeness figure;
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(likeness_make(&figure, stage.take, rays, 10, NULL), OK);
    long close = 0;
    for (int i = 0; i < figure.surface.point_count; i++)
        close += fabs(rest_distance(&figure.rest, figure.surface.points[i])) < 0.015;
    print_message("%d points, %ld within 15 mm\n", figure.surface.point_count, close);
    EXPECT_AT_LEAST((double)close, 0.9 * figure.surface.point_count);
    uint64_t edges = 0; // every edge is there once in either direction
    for (int c = 0; c < figure.surface.corner_count; c++) {
        uint64_t from = (uint64_t)figure.surface.corners[c],
                 to = (uint64_t)figure.surface.corners[c % 3 == 2 ? c - 2 : c + 1];
        uint64_t edge = (from < to ? from << 32 | to : to << 32 | from) * 0x9e3779b97f4a7c15u;
        edges += from < to ? edge : -edge;
    }
    EXPECT_TRUE(edges == 0);

    struct sight sight;
    EXPECT_STATUS(sight_open(&sight, stage.take, rays), OK);
    EXPECT_STATUS(sight_read(&sight, stage.take, 0), OK);
    struct skeleton wrong = s;
    for (int j = 0; j < JOINT_COUNT; j++)
        wrong.joint[j] = v3_add(s.joint[j], v3(0.02, 0, 0.03));
    struct posture joints;
    struct adjustment none = adjustment_none();
    EXPECT_STATUS(posture_of(&figure.rest, &wrong, &joints), OK);
    struct adjustment found = align(figure.volume, &figure.rest, &sight, &joints, &none);
    joints = posture_adjusted(&joints, &found);
    struct skeleton back = posture_skeleton(&figure.rest, &joints);
    double before = 0, after = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        before += v3_distance(wrong.joint[j], s.joint[j]) / JOINT_COUNT;
        after += v3_distance(back.joint[j], s.joint[j]) / JOINT_COUNT;
    }
    print_message("joints %.1f mm off, then %.1f mm\n", before * 1000, after * 1000);
    EXPECT_AT_MOST(after, before / 2);

    double thinner[PART_COUNT]; // the frame's outline says by how much
    for (int p = 0; p < PART_COUNT; p++)
        thinner[p] = -0.010;
    struct outline_gaps as_made = {0}, thinned = {0}, met = {0};
    outline_measure(figure.volume, take_calibration(stage.take), &sight, &joints, &as_made);
    volume_grow(figure.volume, thinner);
    for (int i = 0; i < 20; i++) // as many frames as a part needs to be sure of
        outline_measure(figure.volume, take_calibration(stage.take), &sight, &joints, &thinned);
    outline_meet(figure.volume, &thinned);
    outline_measure(figure.volume, take_calibration(stage.take), &sight, &joints, &met);
    print_message("outline off by %.1f mm, thinned %.1f mm, met %.1f mm\n", mean_gap_mm(&as_made),
                  mean_gap_mm(&thinned), mean_gap_mm(&met));
    EXPECT_NEAR(mean_gap_mm(&thinned) - mean_gap_mm(&as_made), 10, 2);
    EXPECT_NEAR(mean_gap_mm(&met), 0, 2);
    sight_close(&sight);
    likeness_free(&figure);
    source_rays_close(&rays);
    stage_close(&stage);
}

struct patience {
    int told, most;
    double share;
};

static bool be_patient(void *self, double share)
{
    struct patience *p = self;
    EXPECT_AT_LEAST(share, p->share);
    EXPECT_AT_MOST(share, 1);
    p->share = share;
    return ++p->told < p->most;
}

// A likeness that comes later is drawn as paper until it is there, and then as if it
// had been there from the beginning; and whoever does not want it any more is heard.
static void the_likeness_may_come_later(void **state)
{
    (void)state;
    static struct painted film;
    static struct drawn at_once, before, after;
    static uint8_t green[PIXELS * 3];
    struct skeleton s = whole_body(0);
    paint(&film, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct stage stage;
    stage_open(&stage, &ideal, &frame, 1, &whole_measures);
    struct painter *p = painter_on(&stage, &ideal, DETAIL_FULL);
    draw(p, POSE_IDENTITY, 0, green, &at_once);
    painter_close(&p);

    struct source_rays *rays;
    struct likeness likeness;
    struct patience calm = {.most = INT32_MAX}, impatient = {.most = 2};
    const struct likeness_watch watch = {be_patient, &calm}, hasty = {be_patient, &impatient};
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(likeness_make(&likeness, stage.take, rays, LIKENESS_FRAMES, &hasty), NOTHING);
    EXPECT_INT(impatient.told, 2);
    EXPECT_STATUS(likeness_make(&likeness, stage.take, rays, LIKENESS_FRAMES, &watch), OK);
    EXPECT_AT_LEAST(calm.told, 3);

    struct painter_options o = painter_default_options();
    o.likeness_later = true;
    EXPECT_STATUS(painter_open(&p, stage.gpu, stage.take, &ideal, &o), OK);
    draw(p, POSE_IDENTITY, 0, green, &before);
    EXPECT_INT(before.result.level, DETAIL_PAPER);
    EXPECT_INT(before.result.parts, PART_COUNT);
    EXPECT_STATUS(painter_give_likeness(p, &likeness), OK);
    int pictures = 0;
    do
        draw(p, POSE_IDENTITY, 0, green, &after);
    while (!painter_settled(p) && ++pictures < 100);
    print_message("%d pictures until it was all there\n", pictures);
    EXPECT_AT_LEAST(pictures, 1); // not all at once
    EXPECT_INT(after.result.level, DETAIL_FULL);
    EXPECT_TRUE(!memcmp(after.actor, at_once.actor, sizeof after.actor));
    painter_close(&p);
    source_rays_close(&rays);
    stage_close(&stage);
}

static bool magenta(const uint8_t *c) { return c[0] > c[1] + 100 && c[2] > c[1] + 100; }

// From all round, at full detail, not a pixel of the wall behind is on the actor;
// and what is not the actor is the camera's picture to the bit.
static void the_wall_behind_never_comes_along(void **state)
{
    (void)state;
    static struct painted film[2];
    static struct drawn got;
    static uint8_t green[PIXELS * 3];
    for (int i = 0; i < PIXELS; i++)
        green[3 * i + 1] = (uint8_t)(150 + i % 97);
    struct one_frame frames[2];
    for (int i = 0; i < 2; i++) {
        struct skeleton s = whole_body(i * 0.2);
        paint(&film[i], &ideal, &s, &whole_measures);
        frames[i] = (struct one_frame){s, film[i].rgb, film[i].depth, film[i].mask};
    }
    struct stage stage;
    stage_open(&stage, &ideal, frames, 2, &whole_measures);
    struct painter *p = painter_on(&stage, &bent, DETAIL_FULL);
    long leaked = 0, solid = 0, touched = 0;
    for (int v = 0; v < 12; v++) {
        double a = v * PI / 6;
        struct pose viewer = {quat_from_rotation_vector(v3(0, a, 0)), v3(-2.4 * sin(a), 0, 2.5 - 2.4 * cos(a))};
        draw(p, viewer, v * 3000000, green, &got);
        for (int i = 0; i < PIXELS; i++) {
            solid += got.actor[4 * i + 3] == 255;
            leaked += got.actor[4 * i + 3] > 0 && magenta(got.actor + 4 * i);
            touched += got.actor[4 * i + 3] == 0 && memcmp(got.rgb + 3 * i, green + 3 * i, 3);
        }
    }
    EXPECT_AT_LEAST(solid, 12 * 3000);
    EXPECT_INT(leaked, 0);
    EXPECT_INT(touched, 0);
    painter_close(&p);
    stage_close(&stage);
}

// Two limbs that crossed: filmed apart, red and blue, shown crossed; the nearer one
// is in front from either side.
static void the_nearer_part_hides_the_farther(void **state)
{
    (void)state;
    static uint8_t halves[PIXELS * 3], grey[PIXELS * 3];
    memset(grey, 128, sizeof grey);
    for (int i = 0; i < PIXELS; i++) {
        halves[3 * i] = i % W < W / 2 ? 220 : 20;
        halves[3 * i + 1] = 20;
        halves[3 * i + 2] = i % W < W / 2 ? 20 : 220;
    }
    const struct body body = {.radius_rate = {[PART_LEFT_THIGH] = 0.1, [PART_RIGHT_THIGH] = 0.1}};
    struct skeleton apart = {0}, crossed = {0};
    const enum joint used[] = {JOINT_NECK, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE};
    for (size_t i = 0; i < COUNT_OF(used); i++)
        apart.confidence[used[i]] = crossed.confidence[used[i]] = 1;
    apart.joint[JOINT_NECK] = crossed.joint[JOINT_NECK] = v3(0, -0.8, 2);
    apart.joint[JOINT_LEFT_HIP] = v3(0.4, -0.3, 2);
    apart.joint[JOINT_LEFT_KNEE] = v3(0.4, 0.3, 2);
    apart.joint[JOINT_RIGHT_HIP] = v3(-0.4, -0.3, 2);
    apart.joint[JOINT_RIGHT_KNEE] = v3(-0.4, 0.3, 2);
    crossed.joint[JOINT_LEFT_HIP] = v3(-0.2, -0.2, 1.85); // blue, nearer to the first viewer
    crossed.joint[JOINT_LEFT_KNEE] = v3(0.2, 0.2, 1.85);
    crossed.joint[JOINT_RIGHT_HIP] = v3(0.2, -0.2, 2.15);
    crossed.joint[JOINT_RIGHT_KNEE] = v3(-0.2, 0.2, 2.15);
    const struct one_frame frames[] = {{.skeleton = apart, .rgb = halves}, {.skeleton = crossed}};
    struct stage stage;
    stage_open(&stage, &ideal, frames, 2, &body);
    static struct drawn got;
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct painter *p = painter_on(&stage, &ideal, (enum detail)detail);
        const uint8_t *middle = got.rgb + 3 * (H / 2 * W + W / 2);
        draw(p, POSE_IDENTITY, 40000000, grey, &got);
        EXPECT_INT(got.result.parts, 2);
        EXPECT_INT(got.result.shown, 1);
        EXPECT_AT_LEAST(middle[2] - middle[0], 150);
        draw(p, (struct pose){quat_from_rotation_vector(v3(0, PI, 0)), v3(0, 0, 4)}, 40000000, grey, &got);
        EXPECT_AT_LEAST(middle[0] - middle[2], 150);
        painter_close(&p);
    }
    stage_close(&stage);
}

static void the_same_again_is_the_same(void **state)
{
    (void)state;
    static struct painted film;
    static struct drawn first, second, other;
    struct skeleton s = whole_body(0.1);
    paint(&film, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct stage stage;
    stage_open(&stage, &ideal, &frame, 1, &whole_measures);
    const struct pose viewer = {quat_from_rotation_vector(v3(0, 0.6, 0)), v3(-1.3, 0, 0.5)};
    for (int detail = DETAIL_PAPER; detail <= DETAIL_AUTO; detail++) {
        struct painter *p = painter_on(&stage, &bent, (enum detail)detail);
        draw(p, viewer, 0, film.rgb, &first);
        painter_close(&p);
        gpu_close(&stage.gpu); // another context, and another picture drawn before
        EXPECT_STATUS(gpu_open(&stage.gpu), OK);
        p = painter_on(&stage, &bent, (enum detail)detail);
        draw(p, POSE_IDENTITY, 0, film.rgb, &other);
        draw(p, viewer, 0, film.rgb, &second);
        painter_close(&p);
        EXPECT_INT(memcmp(first.rgb, second.rgb, sizeof first.rgb), 0);
        EXPECT_INT(memcmp(first.actor, second.actor, sizeof first.actor), 0);
        EXPECT_TRUE(memcmp(first.rgb, other.rgb, sizeof first.rgb) != 0);
    }
    stage_close(&stage);
}

static long actor_pixels(const struct drawn *d)
{
    long n = 0;
    for (int i = 0; i < PIXELS; i++)
        n += d->actor[4 * i + 3] > 0;
    return n;
}

// Nobody there: unknown joints, parts never measured, long after the end, behind
// the camera, no length, no placed image. The picture is then the camera's own.
static void nobody_leaves_the_picture_alone(void **state)
{
    (void)state;
    static struct painted film;
    static struct drawn got;
    struct skeleton s = whole_body(0), half = s;
    paint(&film, &ideal, &s, &whole_measures);
    half.confidence[JOINT_LEFT_KNEE] = 0; // takes thigh and shin with it
    half.joint[JOINT_LEFT_KNEE] = v3(NAN, NAN, NAN);
    half.joint[JOINT_RIGHT_HAND] = half.joint[JOINT_RIGHT_ELBOW];
    struct body body = whole_measures;
    body.radius_rate[PART_HEAD] = 0;
    const struct one_frame frames[] = {{s, film.rgb, film.depth, film.mask}, {.skeleton = half}};
    struct stage stage;
    stage_open(&stage, &ideal, frames, 2, &body);
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        struct painter *p = painter_on(&stage, &ideal, (enum detail)detail);
        draw(p, POSE_IDENTITY, 0, film.rgb, &got);
        EXPECT_INT(got.result.parts, PART_COUNT - 1);
        draw(p, POSE_IDENTITY, 40000000, film.rgb, &got);
        EXPECT_INT(got.result.parts, PART_COUNT - 4);
        EXPECT_AT_LEAST(actor_pixels(&got), 1000);
        draw(p, POSE_IDENTITY, 5000000000, film.rgb, &got);
        EXPECT_INT(got.result.shown, -1);
        EXPECT_INT(actor_pixels(&got), 0);
        EXPECT_INT(memcmp(got.rgb, film.rgb, sizeof got.rgb), 0);
        draw(p, (struct pose){{0, 0, 0, 1}, {0, 0, 6}}, 0, film.rgb, &got);
        EXPECT_INT(got.result.parts, 0);
        EXPECT_INT(memcmp(got.rgb, film.rgb, sizeof got.rgb), 0);
        draw(p, POSE_IDENTITY, 0, film.rgb, &got);
        EXPECT_STATUS(painter_draw_nobody(p, film.rgb), OK);
        EXPECT_STATUS(painter_read(p, got.rgb), OK);
        EXPECT_STATUS(painter_read_actor(p, got.actor), OK);
        EXPECT_INT(actor_pixels(&got), 0);
        EXPECT_INT(memcmp(got.rgb, film.rgb, sizeof got.rgb), 0);
        struct painter_view nowhere = {.world_from_camera = {{0, 0, 0, 1}, {NAN, 0, 0}}, .color = film.rgb};
        EXPECT_STATUS(painter_draw(p, &nowhere, &got.result), ERR_INPUT);
        painter_close(&p);
    }
    stage_close(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cylinders_fall_where_the_reference_says), cmocka_unit_test(the_film_is_given_back),
        cmocka_unit_test(the_likeness_may_come_later),
        cmocka_unit_test(the_figure_lies_on_what_was_seen),        cmocka_unit_test(the_wall_behind_never_comes_along),
        cmocka_unit_test(the_nearer_part_hides_the_farther),       cmocka_unit_test(the_same_again_is_the_same),
        cmocka_unit_test(nobody_leaves_the_picture_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
