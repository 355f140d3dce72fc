// The likeness as the GPU draws it, against a reference in double precision that shares
// no shader with it: every vertex skinned, lit and bent by the lens, every triangle
// filled, pixel for pixel. Seen from behind, where no pixel is the shown frame's own.
#include "tests/test.h"

#include "reenact/likeness_painter.h"
#include "reenact/motion.h"
#include "reenact/warp.h"
#include "tests/support/rehearsal.h"

#include <stdlib.h>

enum { W = 240, H = 180 };
static const struct lens lens = {W, H, 210, 208, 121, 88, -0.1, 0.02, 0.004, -0.003, 0.001};
static const double PI = 3.14159265358979323846;

struct seen {
    double x, y, z, rgb[3]; // pixels, metres, linear
};

static double lit(const struct light *light, struct vec3 n)
{
    const double y[LIGHT_TERMS] = {
        1, n.x, n.y, n.z, n.x * n.y, n.y * n.z, n.x * n.z, n.x * n.x - n.y * n.y, 3 * n.z * n.z - 1};
    double sum = 0;
    for (int i = 0; i < LIGHT_TERMS; i++)
        sum += (double)light->term[i] * y[i];
    return fmin(fmax(sum, (double)LIGHT_LEAST), (double)LIGHT_MOST);
}

static struct seen see(const struct likeness *l, int i, const struct warp *warp, const struct posture *viewer,
                       const struct posture *world)
{
    struct vec3 p = v3(0, 0, 0), n = v3(0, 0, 0), rest = l->surface.points[i];
    rest = v3_add(rest, warp_at(warp, rest));
    for (int s = 0; s < SKIN_PARTS; s++) {
        const double share = (double)l->skins[i].weight[s];
        const int part = l->skins[i].part[s];
        p = v3_add(p, v3_scale(pose_apply(viewer->part[part], rest), share));
        n = v3_add(n, v3_scale(quat_rotate(world->part[part].rotation, l->surface.normals[i]), share));
    }
    struct pixel px = lens_project(&lens, p);
    struct seen out = {px.x, px.y, p.z, {0}};
    for (int c = 0; c < 3; c++)
        out.rgb[c] = (double)l->coat.color[i][c] * lit(&l->coat.light, v3_unit(n));
    return out;
}

// z of every pixel, infinite where there is nothing.
static void fill(const struct seen *a, const struct seen *b, const struct seen *c, double *z, double (*rgb)[3])
{
    double area = (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
    if (area == 0)
        return;
    int x0 = (int)ceil(fmin(a->x, fmin(b->x, c->x))), x1 = (int)floor(fmax(a->x, fmax(b->x, c->x)));
    int y0 = (int)ceil(fmin(a->y, fmin(b->y, c->y))), y1 = (int)floor(fmax(a->y, fmax(b->y, c->y)));
    for (int y = y0 < 0 ? 0 : y0; y <= y1 && y < H; y++)
        for (int x = x0 < 0 ? 0 : x0; x <= x1 && x < W; x++) {
            double u = ((b->x - x) * (c->y - y) - (b->y - y) * (c->x - x)) / area;
            double v = ((c->x - x) * (a->y - y) - (c->y - y) * (a->x - x)) / area, w = 1 - u - v;
            if (u < 0 || v < 0 || w < 0)
                continue;
            double nearer = u / a->z + v / b->z + w / c->z;
            if (!(1 / nearer < z[y * W + x]))
                continue;
            z[y * W + x] = 1 / nearer;
            for (int k = 0; k < 3; k++)
                rgb[y * W + x][k] = (u * a->rgb[k] / a->z + v * b->rgb[k] / b->z + w * c->rgb[k] / c->z) / nearer;
        }
}

struct set {
    struct rehearsal rehearsal;
    struct recording *recording;
    struct take *take;
    struct source_rays *rays;
    struct likeness likeness;
    struct moment moment;
    struct pose viewer;
};

static void set_open(struct set *s)
{
    struct motion *motion;
    s->rehearsal = rehearsal_make();
    EXPECT_STATUS(recording_open(&s->recording, s->rehearsal.file), OK);
    EXPECT_STATUS(take_open(&s->take, s->recording, "turn"), OK);
    EXPECT_STATUS(source_rays_open(&s->rays, take_calibration(s->take)), OK);
    EXPECT_STATUS(likeness_make(&s->likeness, s->take, s->rays, 4, NULL), OK);
    EXPECT_STATUS(motion_open(&motion, s->take), OK);
    EXPECT_STATUS(motion_at(motion, 0, true, &s->moment), OK);
    motion_close(&motion);
    // Half way round him from where the sensor stood, and nearer.
    struct vec3 him = s->moment.skeleton.joint[JOINT_WAIST];
    struct pose turn = {quat_from_rotation_vector(v3(0, 0, PI)), v3(0, 0, 0)};
    turn.translation = v3_sub(him, quat_rotate(turn.rotation, him));
    s->viewer = pose_multiply(turn, take_entry(s->take, s->moment.frame)->world_from_camera);
    s->viewer.translation = v3_mix(s->viewer.translation, him, 0.3);
}

static void set_close(struct set *s)
{
    likeness_free(&s->likeness);
    source_rays_close(&s->rays);
    take_close(&s->take);
    recording_free(&s->recording);
    rehearsal_end(&s->rehearsal);
}

static void draw(struct set *s, uint8_t *rgba)
{
    struct gpu *gpu;
    struct gpu_target *target;
    struct likeness given;
    struct likeness_painter *painter;
    int parts;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(gpu_target_open(&target, gpu, W, H, 1), OK);
    EXPECT_STATUS(likeness_make(&given, s->take, s->rays, 4, NULL), OK); // the same again
    EXPECT_STATUS(likeness_painter_open(&painter, gpu, s->take, s->rays, &lens), OK);
    EXPECT_STATUS(likeness_painter_give(painter, &given), OK);
    EXPECT_TRUE(likeness_painter_bring(painter, SIZE_MAX));
    struct likeness_view view = {s->moment.frame, s->moment.skeleton, s->viewer, 1000, target, NULL};
    EXPECT_STATUS(likeness_painter_draw(painter, &view, &parts), OK);
    EXPECT_INT(parts, PART_COUNT);
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    likeness_painter_close(&painter);
    gpu_target_close(&target);
    gpu_close(&gpu);
}

// The same posture, laid on the shown frame.
static void draw_reference(struct set *s, double *z, double (*rgb)[3])
{
    const struct likeness *l = &s->likeness;
    const struct take_entry *e = take_entry(s->take, s->moment.frame);
    struct sight sight;
    struct posture joints, shown, into_viewer, into_world;
    EXPECT_STATUS(sight_open(&sight, s->take, s->rays), OK);
    EXPECT_STATUS(sight_read(&sight, s->take, s->moment.frame), OK);
    EXPECT_STATUS(posture_of(&l->rest, &e->skeleton, &joints), OK);
    struct adjustment start = likeness_adjustment(l, s->moment.frame);
    struct adjustment a = align(l->volume, &l->rest, &sight, &joints, &start);
    EXPECT_STATUS(posture_of(&l->rest, &s->moment.skeleton, &shown), OK);
    shown = posture_adjusted(&shown, &a);
    joints = posture_adjusted(&joints, &a);
    struct warp *warp;
    const struct warp_model model = {l->volume, &l->surface, l->skins};
    EXPECT_STATUS(warp_open(&warp, &l->rest, &l->surface, take_calibration(s->take)), OK);
    warp_fit(warp, &model, &sight, &joints);
    for (int p = 0; p < PART_COUNT; p++) {
        into_viewer.part[p] = pose_multiply(pose_inverse(s->viewer), shown.part[p]);
        into_world.part[p] = pose_multiply(e->world_from_camera, joints.part[p]);
    }
    struct seen *seen = malloc(sizeof *seen * (size_t)l->surface.point_count);
    for (int i = 0; i < l->surface.point_count; i++)
        seen[i] = see(l, i, warp, &into_viewer, &into_world);
    for (int i = 0; i < W * H; i++)
        z[i] = INFINITY;
    for (int t = 0; t < l->surface.corner_count; t += 3) {
        const int32_t *c = l->surface.corners + t;
        fill(&seen[c[0]], &seen[c[1]], &seen[c[2]], z, rgb);
    }
    free(seen);
    warp_close(&warp);
    sight_close(&sight);
}

static void pixels_are_the_reference_s(void **state)
{
    (void)state;
    static double z[W * H], rgb[W * H][3];
    static uint8_t rgba[4 * W * H];
    static struct set set;
    set_open(&set);
    draw(&set, rgba);
    draw_reference(&set, z, rgb);
    double sum = 0;
    long both = 0, one = 0;
    for (int i = 0; i < W * H; i++) {
        bool wanted = isfinite(z[i]), is = rgba[4 * i + 3] > 0;
        one += wanted != is;
        both += wanted && is;
        for (int c = 0; c < 3 && wanted && is; c++) {
            double d = 255 * sqrt(fmin(fmax(rgb[i][c], 0), 1)) - rgba[4 * i + c];
            sum += d * d;
        }
    }
    double psnr = 10 * log10(255.0 * 255.0 / (sum / (3.0 * (double)both)));
    print_message("%ld pixels, %.1f dB; %ld in one of the two only\n", both, psnr, one);
    EXPECT_AT_LEAST((double)both, 2000);
    EXPECT_AT_LEAST(psnr, 50);
    EXPECT_AT_MOST((double)one, 0.005 * (double)both);
    set_close(&set);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pixels_are_the_reference_s)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
