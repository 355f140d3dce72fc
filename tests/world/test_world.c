// The small world's consistency: the truth it reports is what it renders.
#include "tests/support/test.h"

#include "tests/world/world.h"

#include <string.h>

static const char *const motions[] = {"pirouette", "kata", "still", "bend", "walk", "hide"};

static struct world *open_world(const char *figure, const char *motion, bool plain)
{
    struct world_options o = world_default_options();
    EXPECT_TRUE(world_figure_named(figure, &o.figure));
    o.motion = motion;
    o.plain = plain;
    struct world *w;
    EXPECT_STATUS(world_open(&w, &o), OK);
    return w;
}

struct shot_pixels {
    int width, height;
    uint8_t *color, *mask;
    uint16_t *depth;
};

enum { WANT_COLOR = 1, WANT_DEPTH = 2 };

static struct shot_pixels shoot(const struct world *w, struct lens lens, struct pose pose, double t, bool actor,
                                int want)
{
    size_t n = (size_t)lens.width * (size_t)lens.height;
    struct shot_pixels p = {lens.width, lens.height, NULL, NULL, NULL};
    if (want & WANT_COLOR)
        p.color = calloc(n, 3);
    if (want & WANT_DEPTH) {
        p.mask = calloc(n, 1);
        p.depth = calloc(n, 2);
    }
    struct world_shot shot = {lens, pose, t, actor};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){p.color, p.depth, p.mask}), OK);
    return p;
}

static void drop(struct shot_pixels *p)
{
    free(p->color);
    free(p->mask);
    free(p->depth);
}

// Every joint is inside the body, so at its projection the figure is seen, and in front of it.
static void test_joints_lie_behind_the_skin(void **state)
{
    (void)state;
    static const char *const figures[] = {"woman", "child", "heavy", "coat", "tall", "man"};
    struct lens lens = world_calibration(1).color;
    int seen = 0;
    for (size_t m = 0; m < COUNT_OF(motions); m++) {
        struct world *w = open_world(figures[m], motions[m], true);
        for (int k = 0; k < 3; k++) {
            double t = world_seconds(w) * (0.13 + 0.27 * k);
            struct pose pose = k == 2 ? world_viewer_pose(w, t) : world_sensor_pose(w);
            struct shot_pixels p = shoot(w, lens, pose, t, true, WANT_DEPTH);
            struct skeleton s = world_joints_in_camera(w, t, pose);
            for (int j = 0; j < JOINT_COUNT; j++) {
                struct pixel px = lens_project(&lens, s.joint[j]);
                int x = (int)lround(px.x), y = (int)lround(px.y);
                if (s.joint[j].z < 0.1 || x < 0 || y < 0 || x >= lens.width || y >= lens.height)
                    continue;
                size_t at = (size_t)y * (size_t)lens.width + (size_t)x;
                if (!p.mask[at])
                    print_error("%s, %s, t %.2f: the %s is not on the figure\n", figures[m], motions[m], t,
                                joint_name((enum joint)j));
                EXPECT_TRUE(p.mask[at]);
                EXPECT_AT_LEAST(s.joint[j].z - p.depth[at] * 1e-3, 0.015);
                seen++;
            }
            drop(&p);
        }
        world_close(&w);
    }
    EXPECT_AT_LEAST(seen, 270);
}

// Standing still, facing the sensor, nothing occludes anything: the skin is a radius in front of the joint.
static void test_skin_is_a_radius_before_the_joint(void **state)
{
    (void)state;
    static const char *const figures[] = {"woman", "man", "child", "heavy"};
    struct lens lens = world_calibration(1).color;
    for (size_t f = 0; f < COUNT_OF(figures); f++) {
        struct world *w = open_world(figures[f], "still", true);
        struct pose pose = world_sensor_pose(w);
        struct shot_pixels p = shoot(w, lens, pose, 1, true, WANT_DEPTH);
        struct skeleton s = world_joints_in_camera(w, 1, pose);
        for (int j = 0; j < JOINT_COUNT; j++) {
            struct pixel px = lens_project(&lens, s.joint[j]);
            size_t at = (size_t)lround(px.y) * (size_t)lens.width + (size_t)lround(px.x);
            double before = s.joint[j].z - p.depth[at] * 1e-3, radius = world_joint_radius(w, (enum joint)j);
            EXPECT_TRUE(p.mask[at]);
            EXPECT_AT_LEAST(before, 0.025);
            bool spine = j == JOINT_HEAD || j == JOINT_TORSO || j == JOINT_WAIST; // these lie behind the middle
            if (j != JOINT_LEFT_FOOT && j != JOINT_RIGHT_FOOT)                    // seen from above, along the instep
                EXPECT_AT_MOST(before, 1.3 * radius + (spine ? 0.06 : 0.012));
            EXPECT_AT_LEAST(radius, 0.025);
            EXPECT_AT_MOST(radius, 0.20);
        }
        // Left is the person's own: on the right of the image of a person who faces the camera.
        EXPECT_AT_LEAST(s.joint[JOINT_LEFT_HAND].x - s.joint[JOINT_RIGHT_HAND].x, 0.38);
        drop(&p);
        world_close(&w);
    }
}

static void test_bones_keep_their_length_and_feet_the_floor(void **state)
{
    (void)state;
    static const enum joint bones[][2] = {
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW}, {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
        {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},     {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
        {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},    {JOINT_WAIST, JOINT_TORSO},
        {JOINT_LEFT_HIP, JOINT_RIGHT_HIP},
    };
    for (size_t m = 0; m < COUNT_OF(motions); m++) {
        struct world *w = open_world("man", motions[m], true);
        struct skeleton first = world_joints(w, 0), before = first;
        double stand = first.joint[JOINT_LEFT_FOOT].z;
        for (double t = 0.02; t < world_seconds(w); t += 0.02) {
            struct skeleton s = world_joints(w, t);
            for (size_t b = 0; b < COUNT_OF(bones); b++)
                EXPECT_NEAR(v3_distance(s.joint[bones[b][0]], s.joint[bones[b][1]]),
                            v3_distance(first.joint[bones[b][0]], first.joint[bones[b][1]]), 1e-9);
            double low = fmin(s.joint[JOINT_LEFT_FOOT].z, s.joint[JOINT_RIGHT_FOOT].z);
            EXPECT_NEAR(low, stand, 0.03);
            for (int j = 0; j < JOINT_COUNT; j++) {
                EXPECT_AT_LEAST(s.joint[j].z, 0.09);
                EXPECT_AT_MOST(v3_distance(s.joint[j], before.joint[j]) / 0.02, 8); // m/s: a kick, not a discontinuity
            }
            before = s;
        }
        world_close(&w);
    }
}

static void test_pirouette_is_full_rotation(void **state)
{
    (void)state;
    struct world *w = open_world("woman", "pirouette", true);
    double turned = 0, last = 0;
    struct vec3 start = world_joints(w, 0).joint[JOINT_WAIST],
                end = world_joints(w, world_seconds(w)).joint[JOINT_WAIST];
    for (double t = 0; t <= world_seconds(w); t += 0.05) {
        struct skeleton s = world_joints(w, t);
        struct vec3 d = v3_sub(s.joint[JOINT_LEFT_HIP], s.joint[JOINT_RIGHT_HIP]);
        double a = atan2(d.y, d.x), step = remainder(a - last, 6.283185307179586);
        turned += t > 0 ? step : 0;
        last = a;
    }
    EXPECT_NEAR(fabs(turned), 6.283185307179586, 1e-9);
    EXPECT_AT_LEAST(start.y - end.y, 1.4); // towards the sensor
    world_close(&w);
}

static void test_front_and_back_differ(void **state)
{
    (void)state;
    struct world *w = open_world("woman", "still", false);
    struct lens lens = world_calibration(0.5).color;
    struct skeleton s = world_joints(w, 1);
    double mean[2][3] = {{0}};
    for (int back = 0; back < 2; back++) {
        // Looking level at the head, from 1.5 m in front (-y) and behind.
        struct vec3 eye = v3_add(s.joint[JOINT_HEAD], v3(0, back ? 1.5 : -1.5, 0)), x = v3(back ? -1 : 1, 0, 0),
                    z = v3(0, back ? -1 : 1, 0);
        double m[3][3] = {{x.x, 0, z.x}, {0, 0, z.y}, {0, -1, 0}};
        struct pose pose = {quat_from_matrix(m), eye};
        struct shot_pixels p = shoot(w, lens, pose, 1, true, WANT_COLOR | WANT_DEPTH);
        for (int v = -4; v <= 4; v++)
            for (int u = -4; u <= 4; u++) {
                size_t at = (size_t)((lens.height / 2 + v) * lens.width + lens.width / 2 + u);
                EXPECT_TRUE(p.mask[at]);
                for (int c = 0; c < 3; c++)
                    mean[back][c] += p.color[at * 3 + (size_t)c] / 81.0;
            }
        drop(&p);
    }
    EXPECT_AT_LEAST(mean[0][0] - mean[1][0], 110); // a face against dark hair
    world_close(&w);
}

static void test_same_seed_same_bytes_at_any_thread_count(void **state)
{
    (void)state;
    struct lens lens = world_viewer_calibration(0.25).color;
    size_t n = (size_t)lens.width * (size_t)lens.height;
    struct shot_pixels p[3];
    for (int i = 0; i < 3; i++) {
        struct world_options o = world_default_options();
        o.motion = "kata";
        o.threads = i == 1 ? 3 : 1;
        o.seed = i == 2 ? 8 : 7;
        struct world *w;
        EXPECT_STATUS(world_open(&w, &o), OK);
        struct pose pose = {{-0.707, 0, 0, 0.707}, {0.1, -3, 1.2}};
        pose.rotation = quat_unit(pose.rotation);
        p[i] = shoot(w, lens, pose, 3.4, true, WANT_COLOR | WANT_DEPTH);
        EXPECT_STATUS(world_depth_noise(&lens, p[i].depth, o.seed, p[i].depth), OK);
        world_color_noise(p[i].color, lens.width, lens.height, o.seed);
        world_close(&w);
    }
    EXPECT_TRUE(!memcmp(p[0].color, p[1].color, n * 3));
    EXPECT_TRUE(!memcmp(p[0].depth, p[1].depth, n * 2));
    EXPECT_TRUE(!memcmp(p[0].mask, p[1].mask, n));
    EXPECT_TRUE(memcmp(p[0].color, p[2].color, n * 3)); // other posters, other noise
    EXPECT_TRUE(memcmp(p[0].depth, p[2].depth, n * 2));
    for (int i = 0; i < 3; i++)
        drop(&p[i]);
}

// ---------------------------------------------------------------- tags

static double gray(const struct shot_pixels *p, double x, double y)
{
    int i = (int)floor(x), j = (int)floor(y);
    double a = x - i, b = y - j, sum = 0;
    for (int k = 0; k < 4; k++) {
        const uint8_t *c = p->color + ((size_t)(j + (k >> 1)) * (size_t)p->width + (size_t)(i + (k & 1))) * 3;
        sum += ((k & 1) ? a : 1 - a) * ((k >> 1) ? b : 1 - b) * (c[0] + c[1] + c[2]) / 3.0;
    }
    return sum;
}

// How far outside `edge` (pixels) the image changes from black to white along `out`.
static double crossing(const struct shot_pixels *p, struct pixel edge, double ox, double oy)
{
    double dark = gray(p, edge.x - 3 * ox, edge.y - 3 * oy), bright = gray(p, edge.x + 3 * ox, edge.y + 3 * oy);
    EXPECT_AT_LEAST(bright - dark, 120);
    double middle = (dark + bright) / 2, before = dark;
    for (double s = -3 + 0.05; s < 3; s += 0.05) {
        double here = gray(p, edge.x + s * ox, edge.y + s * oy);
        if (before < middle && here >= middle)
            return s - 0.05 * (here - middle) / fmax(here - before, 1e-9);
        before = here;
    }
    return 100;
}

static void test_tags_are_drawn_at_their_poses(void **state)
{
    (void)state;
    struct world *w = open_world("woman", "still", true);
    int32_t count;
    const struct place_tag *tags = world_tags(w, &count);
    struct lens lens = world_viewer_calibration(1).color; // distorts
    EXPECT_INT(count, 15);
    double sum = 0, square = 0;
    int n = 0;
    for (int i = 0; i < count; i++) {
        // From a metre away, aside and rolled.
        struct pose t = tags[i].world_from_tag;
        struct vec3 eye = pose_apply(t, v3(0.35 - 0.07 * i, -0.2 + 0.05 * i, 0.95)),
                    z = v3_unit(v3_sub(t.translation, eye));
        struct vec3 x = v3_unit(v3_cross(quat_rotate(t.rotation, v3(0.2 * i, -1, 0)), z)), y = v3_cross(z, x);
        double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
        struct pose pose = {quat_from_matrix(m), eye};
        struct shot_pixels p = shoot(w, lens, pose, 0, false, WANT_COLOR);
        struct pose camera_from_world = pose_inverse(pose);
        for (int side = 0; side < 4; side++)
            for (int k = 2; k <= 8; k++) { // along the edge, away from its corners
                double h = tags[i].side_m / 2, along = (k / 5.0 - 1) * h;
                double nx = side == 0 ? 1 : side == 1 ? -1 : 0, ny = side == 2 ? 1 : side == 3 ? -1 : 0;
                struct vec3 on = v3(nx ? nx * h : along, ny ? ny * h : along, 0),
                            off = v3(on.x + 0.002 * nx, on.y + 0.002 * ny, 0);
                struct pixel a = lens_project(&lens, pose_apply(camera_from_world, pose_apply(t, on)));
                struct pixel b = lens_project(&lens, pose_apply(camera_from_world, pose_apply(t, off)));
                double l = hypot(b.x - a.x, b.y - a.y), e = crossing(&p, a, (b.x - a.x) / l, (b.y - a.y) / l);
                EXPECT_AT_MOST(fabs(e), 0.35);
                sum += e;
                square += e * e;
                n++;
            }
        drop(&p);
    }
    // In linear light the half-way point lies elsewhere than in grey levels, so edges seem to bulge a little.
    EXPECT_NEAR(sum / n, 0, 0.2);
    EXPECT_AT_MOST(sqrt(square / n), 0.25);
    world_close(&w);
}

static void test_the_sweep_sees_every_tag(void **state)
{
    (void)state;
    struct world *w = open_world("woman", "still", true);
    int32_t count;
    const struct place_tag *tags = world_tags(w, &count);
    struct lens lens = world_calibration(1).color;
    for (int i = 0; i < count; i++) {
        int seen = 0;
        for (int f = 0; f <= WORLD_SWEEP_S * 10; f++) {
            struct pose c = world_sweep_pose(w, f * 0.1), camera_from_world = pose_inverse(c);
            struct vec3 eye = pose_apply(pose_inverse(tags[i].world_from_tag), c.translation), corner[4];
            place_tag_corners(&tags[i], corner);
            bool all = eye.z / v3_length(eye) > 0.4; // not too much from the side
            for (int k = 0; k < 4; k++) {
                struct vec3 q = pose_apply(camera_from_world, corner[k]);
                struct pixel px = q.z > 0.1 ? lens_project(&lens, q) : (struct pixel){-1, -1};
                all = all && px.x > 4 && px.y > 4 && px.x < 635 && px.y < 475;
            }
            seen += all;
        }
        if (seen < 10)
            print_error("tag %d\n", tags[i].id);
        EXPECT_AT_LEAST(seen, 10);
    }
    world_close(&w);
}

static void test_viewer_keeps_actor_in_view(void **state)
{
    (void)state;
    struct world *w = open_world("woman", "walk", true);
    struct lens lens = world_viewer_calibration(0.25).color;
    for (double t = 0; t < world_seconds(w); t += 0.7) {
        struct shot_pixels p = shoot(w, lens, world_viewer_pose(w, t), t, true, WANT_DEPTH);
        int seen = 0;
        for (int i = 0; i < lens.width * lens.height; i++)
            seen += p.mask[i];
        EXPECT_AT_LEAST(seen, 0.042 * lens.width * lens.height);
        drop(&p);
    }
    world_close(&w);
}

// ---------------------------------------------------------------- noise

static void test_depth_noise_grows_as_the_sensor_s_does(void **state)
{
    (void)state;
    struct lens lens = world_calibration(1).color;
    size_t n = (size_t)lens.width * (size_t)lens.height;
    uint16_t *ideal = malloc(n * 2), *out = malloc(n * 2);
    for (int mm = 700; mm <= 6000; mm = mm * 3 / 2) {
        for (size_t i = 0; i < n; i++) // a slope over several steps, so that no position between two is preferred
            ideal[i] = (uint16_t)(mm + mm * (i % 640) / 6400);
        EXPECT_STATUS(world_depth_noise(&lens, ideal, (uint64_t)mm, out), OK);
        double sum = 0, square = 0, off_step = 0, count = 0;
        for (size_t i = 0; i < n; i++) {
            if (!out[i])
                continue;
            double z = ideal[i] * 1e-3, step = z * z / (525 * 0.075 * 8), read = out[i] * 1e-3;
            double wanted = sqrt(2.25e-6 * z * z * z * z + step * step / 12 + 1e-6 / 12),
                   eighths = 525 * 0.075 * 8 / read;
            sum += (read - z) / wanted;
            square += (read - z) * (read - z) / (wanted * wanted);
            // half a millimetre of rounding is this many eighths of a pixel
            off_step = fmax(off_step, fabs(eighths - floor(eighths + 0.5)) - 0.00051 * eighths / read);
            count++;
        }
        EXPECT_AT_LEAST(count, 0.99 * (double)n);
        EXPECT_NEAR(sqrt(square / count), 1, 0.03);
        EXPECT_NEAR(sum / count, 0, 0.03);
        EXPECT_AT_MOST(off_step, 1e-9);
    }
    for (int mm = 300; mm <= 9000; mm += 8700) { // out of range, near and far
        for (size_t i = 0; i < n; i++)
            ideal[i] = (uint16_t)mm;
        EXPECT_STATUS(world_depth_noise(&lens, ideal, 1, out), OK);
        for (size_t i = 0; i < n; i++)
            EXPECT_INT(out[i], 0);
    }
    free(ideal);
    free(out);
}

static void test_shadow_and_flying_pixels_lie_at_edges(void **state)
{
    (void)state;
    struct lens lens = world_calibration(1).color;
    size_t n = (size_t)lens.width * (size_t)lens.height;
    uint16_t *ideal = malloc(n * 2), *out = malloc(n * 2);
    const int left = 280, right = 360, front = 1500, back = 3000;
    for (int y = 0; y < lens.height; y++)
        for (int x = 0; x < lens.width; x++)
            ideal[y * lens.width + x] = (uint16_t)(x >= left && x < right ? front : back);
    EXPECT_STATUS(world_depth_noise(&lens, ideal, 5, out), OK);
    double shadow_px = 525 * 0.075 * (1 / 1.5 - 1 / 3.0), zeros_left = 0, zeros_right = 0, flyers = 0, strays = 0;
    for (int y = 0; y < lens.height; y++)
        for (int x = 0; x < lens.width; x++) {
            int z = out[y * lens.width + x];
            bool edge = abs(x - left) <= 2 || abs(x - right) <= 2;
            bool between = z > front + 150 && z < back - 150;
            zeros_left += !z && x < left - 2 && x > left - 40;
            zeros_right += !z && x > right + 2 && x < right + 40;
            flyers += between && edge;
            strays += between && !edge;
        }
    EXPECT_NEAR(zeros_left / lens.height, shadow_px - 2, 1.2); // two of its columns count as edge
    EXPECT_INT(zeros_right, 0);
    EXPECT_INT(strays, 0);
    EXPECT_AT_LEAST(flyers / lens.height, 0.3);
    EXPECT_AT_MOST(flyers / lens.height, 0.6);
    free(ideal);
    free(out);
}

// A box before the legs hides them, and only them.
static void test_a_box_hides_what_is_behind(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    struct world *w;
    o.motion = "still";
    o.plain = true;
    o.box[o.boxes++] = (struct world_box){{-1, -0.9, 0}, {1, -0.7, 0.8}};
    EXPECT_STATUS(world_open(&w, &o), OK);
    struct lens lens = world_calibration(0.5).color;
    struct shot_pixels p = shoot(w, lens, world_sensor_pose(w), 1, true, WANT_DEPTH);
    const struct skeleton s = world_joints_in_camera(w, 1, world_sensor_pose(w));
    static const enum joint seen[] = {JOINT_HEAD, JOINT_NECK, JOINT_TORSO},
                            hidden[] = {JOINT_LEFT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(seen); i++) {
        const struct pixel px = lens_project(&lens, s.joint[seen[i]]);
        EXPECT_INT(p.mask[(int)lround(px.y) * p.width + (int)lround(px.x)], 1);
    }
    for (size_t i = 0; i < COUNT_OF(hidden); i++) {
        const struct pixel px = lens_project(&lens, s.joint[hidden[i]]);
        const int at = (int)lround(px.y) * p.width + (int)lround(px.x);
        EXPECT_INT(p.mask[at], 0);
        EXPECT_NEAR(p.depth[at] * 1e-3, 2.3, 0.2); // of the box, 2.2 m before the sensor
    }
    drop(&p);
    world_close(&w);
    o.box[0].high.z = 0;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
}

static void test_preview_gives_the_world_s_joints(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    struct world *w;
    struct skeleton preview[3];
    double seconds;
    o.motion = "kata";
    o.plain = true;
    o.spot = (struct world_spot){0.3, 0.2, 1};
    EXPECT_STATUS(world_open(&w, &o), OK);
    EXPECT_STATUS(world_preview_seconds(&o, &seconds), OK);
    EXPECT_NEAR(seconds, world_seconds(w), 0);
    EXPECT_STATUS(world_preview_joints(&o, 1.5, 10, 3, preview), OK);
    for (int k = 0; k < 3; k++) {
        const struct skeleton s = world_joints(w, 1.5 + k / 10.0);
        for (int j = 0; j < JOINT_COUNT; j++)
            EXPECT_NEAR(v3_distance(preview[k].joint[j], s.joint[j]), 0, 0);
    }
    world_close(&w);
    o.motion = "no such";
    EXPECT_STATUS(world_preview_joints(&o, 0, 10, 3, preview), ERR_INPUT);
}

static void test_open_refuses_invalid(void **state)
{
    (void)state;
    struct world *w = NULL;
    struct world_options o = world_default_options();
    o.figure.height_m = 2.5;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    o = world_default_options();
    o.figure.build = NAN;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    o = world_default_options();
    o.figure.palette = 9;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    o = world_default_options();
    o.motion = "fly";
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    EXPECT_SAYS("kata");
    o.motion = NULL;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    o = world_default_options();
    o.threads = 0;
    EXPECT_STATUS(world_open(&w, &o), ERR_INPUT);
    EXPECT_TRUE(w == NULL);
    world_close(&w);
    EXPECT_TRUE(!world_figure_named("no such figure", &o.figure));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_joints_lie_behind_the_skin),
        cmocka_unit_test(test_skin_is_a_radius_before_the_joint),
        cmocka_unit_test(test_bones_keep_their_length_and_feet_the_floor),
        cmocka_unit_test(test_pirouette_is_full_rotation),
        cmocka_unit_test(test_front_and_back_differ),
        cmocka_unit_test(test_same_seed_same_bytes_at_any_thread_count),
        cmocka_unit_test(test_tags_are_drawn_at_their_poses),
        cmocka_unit_test(test_the_sweep_sees_every_tag),
        cmocka_unit_test(test_viewer_keeps_actor_in_view),
        cmocka_unit_test(test_depth_noise_grows_as_the_sensor_s_does),
        cmocka_unit_test(test_shadow_and_flying_pixels_lie_at_edges),
        cmocka_unit_test(test_a_box_hides_what_is_behind),
        cmocka_unit_test(test_preview_gives_the_world_s_joints),
        cmocka_unit_test(test_open_refuses_invalid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
