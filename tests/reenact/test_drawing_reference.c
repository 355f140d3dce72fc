// The avatar as the GPU draws it against a software reference in double precision: vertices
// skinned, lit, projected with lens distortion; triangles rasterised. Viewed from behind,
// where all colours are fused.
#include "tests/support/test.h"

#include "reenact/avatar/deformation.h"
#include "reenact/render/avatar_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/support/observe.h"
#include "tests/support/rehearsed.h"

#include <stdlib.h>

enum { W = 240, H = 180 };
static const struct lens lens = {W, H, 210, 208, 121, 88, -0.1, 0.02, 0.004, -0.003, 0.001, 0, 0};
static const double HALF_SILHOUETTE_PX = 0.5; // half the silhouette ribbon's width
static const double PI = 3.14159265358979323846;

struct shaded_vertex {
    double x, y, z, light, at[2], opaque; // pixels; metres; sqrt(irradiance); texels; opacity
    struct vec3 p;                        // viewer camera's axes, metres
};

// z is infinite where nothing is drawn.
struct reference_canvas {
    double z[W * H], rgba[W * H][4]; // premultiplied
};

static double lit(const struct sh_irradiance *light, struct vec3 n)
{
    const double y[SH_TERMS] = {
        1, n.x, n.y, n.z, n.x * n.y, n.y * n.z, n.x * n.z, n.x * n.x - n.y * n.y, 3 * n.z * n.z - 1};
    double sum = 0;
    for (int i = 0; i < SH_TERMS; i++)
        sum += (double)light->term[i] * y[i];
    return fmin(fmax(sum, (double)IRRADIANCE_MIN), (double)IRRADIANCE_MAX);
}

// OpenGL rasterises vertices on a subpixel grid (256 per pixel in llvmpipe), which decides pixels whose centre lies on
// an edge.
static double on_grid(double px)
{
    const double subpixels = 256;
    return floor(px * subpixels + 0.5) / subpixels;
}

// The shown frame's geometry.
struct posed_avatar {
    const struct avatar *avatar;
    const struct deformation *deformation;
    struct bone_transforms viewer, world; // into the viewer camera's axes, into the world's
    struct quat viewer_from_world;
};

// out: 1 for the point's double at the silhouette ribbon's outer rim, else -1.
static struct shaded_vertex shade_vertex(const struct posed_avatar *posed, int i, double out)
{
    const struct avatar *l = posed->avatar;
    const struct uv_mesh *m = &l->atlas.mesh;
    const int point = m->points[i];
    struct vec3 p = v3(0, 0, 0), n = v3(0, 0, 0), bind_point = l->atlas.points[i];
    bind_point = v3_add(bind_point, deformation_at(posed->deformation, bind_point));
    for (int s = 0; s < SKIN_BONES; s++) {
        const double share = (double)l->skins[point].weight[s];
        const int bone = l->skins[point].bone[s];
        p = v3_add(p, v3_scale(pose_apply(posed->viewer.bone[bone], bind_point), share));
        n = v3_add(n, v3_scale(quat_rotate(posed->world.bone[bone].rotation, l->atlas.normals[i]), share));
    }
    struct vec3 outwards = v3_unit(quat_rotate(posed->viewer_from_world, n));
    double aside[2] = {outwards.x - p.x * outwards.z / p.z, outwards.y - p.y * outwards.z / p.z};
    double sine = hypot(aside[0], aside[1]), share = fmin(fmax((sine - 0.8) / 0.15, 0), 1);
    share *= share * (3 - 2 * share) * out * HALF_SILHOUETTE_PX / sine;
    struct pixel px = lens_project(&lens, p);
    return (struct shaded_vertex){on_grid(px.x + share * aside[0]),
                                  on_grid(px.y + share * aside[1]),
                                  p.z,
                                  sqrt(lit(&l->vertex_colors.irradiance, v3_unit(n))),
                                  {(double)m->at[i][0], (double)m->at[i][1]},
                                  out > 0 ? 0 : 1,
                                  p};
}

// Bilinear interpolation.
static double texel(const struct texture_atlas *a, const double at[2], int channel)
{
    const double x = at[0] - 0.5, y = at[1] - 0.5, u = x - floor(x), v = y - floor(y);
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        const int column = (int)floor(x) + i % 2, row = (int)floor(y) + i / 2;
        sum += (i % 2 ? u : 1 - u) * (i / 2 ? v : 1 - v) * a->color[3 * (row * a->mesh.width + column) + channel];
    }
    return sum;
}

// Rasterises a triangle; over: blended, without depth write.
static void fill(struct reference_canvas *canvas, const struct texture_atlas *atlas, const struct shaded_vertex *a,
                 const struct shaded_vertex *b, const struct shaded_vertex *c, bool over)
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
            double nearer = u / a->z + v / b->z + w / c->z, at[2], *out = canvas->rgba[y * W + x];
            if (u < 0 || v < 0 || w < 0 || !(1 / nearer < canvas->z[y * W + x]))
                continue;
            if (!over)
                canvas->z[y * W + x] = 1 / nearer;
            double light = (u * a->light / a->z + v * b->light / b->z + w * c->light / c->z) / nearer;
            double opaque = (u * a->opaque / a->z + v * b->opaque / b->z + w * c->opaque / c->z) / nearer;
            for (int k = 0; k < 2; k++)
                at[k] = (u * a->at[k] / a->z + v * b->at[k] / b->z + w * c->at[k] / c->z) / nearer;
            for (int k = 0; k < 4; k++) {
                double value = opaque * (k < 3 ? fmin(light * texel(atlas, at, k), 255) : 255);
                out[k] = value + (over ? (1 - opaque) * out[k] : 0);
            }
        }
}

// By positions before the silhouette shift and the lens distortion.
static bool is_front(const struct shaded_vertex *seen, const int32_t *c)
{
    return v3_dot(seen[c[0]].p, v3_cross(seen[c[1]].p, seen[c[2]].p)) < 0;
}

// Whether a back-facing triangle is behind its front-facing neighbour's plane; else the edge lies in a fold.
static bool bends_back(const struct shaded_vertex *seen, const int32_t *front, const int32_t *away)
{
    struct vec3 a = seen[front[0]].p, n = v3_cross(v3_sub(seen[front[1]].p, a), v3_sub(seen[front[2]].p, a));
    double out = 0; // the two corners on the edge add 0
    for (int k = 0; k < 3; k++)
        out += v3_dot(n, v3_sub(seen[away[k]].p, a));
    return out < 0;
}

struct set {
    struct rehearsed rehearsed;
    struct track_sample moment;
    struct pose viewer;
};

static void set_open(struct set *s)
{
    struct skeleton_track *motion;
    EXPECT_STATUS(rehearsed_open(&s->rehearsed, 4), OK);
    EXPECT_STATUS(skeleton_track_open(&motion, s->rehearsed.take, s->rehearsed.skeletons), OK);
    EXPECT_STATUS(skeleton_track_at(motion, 0, true, &s->moment), OK);
    skeleton_track_close(&motion);
    // Half an orbit from the sensor, and nearer.
    s->viewer = rehearsed_orbit_pose(&s->rehearsed, s->moment.frame, PI);
    s->viewer.translation = v3_mix(s->viewer.translation, s->moment.skeleton.joint[JOINT_WAIST], 0.3);
}

static void draw(struct set *s, uint8_t *rgba)
{
    struct gpu *gpu;
    struct gpu_target *target;
    struct avatar given;
    struct avatar_renderer *renderer;
    struct gpu_box within;
    int parts;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(gpu_target_open(&target, gpu, W, H), OK);
    EXPECT_STATUS(avatar_make(&given, s->rehearsed.take, s->rehearsed.rays,
                              &(struct avatar_options){.max_frames = 4, .threads = 4}),
                  OK); // the same again
    EXPECT_STATUS(avatar_renderer_open(&renderer, gpu, &s->rehearsed.source, &lens, 0), OK);
    EXPECT_STATUS(avatar_renderer_set_avatar(renderer, &given), OK);
    EXPECT_TRUE(avatar_renderer_upload_step(renderer, SIZE_MAX));
    const struct avatar_view view = {
        .frame = s->moment.frame, .skeleton = s->moment.skeleton, .world_from_viewer = s->viewer, .actor = target};
    EXPECT_STATUS(avatar_renderer_draw(renderer, &view, &parts, &within), OK);
    EXPECT_INT(parts, PART_COUNT);
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    avatar_renderer_close(&renderer);
    gpu_target_close(&target);
    gpu_close(&gpu);
}

// The shown frame's exposure gain.
static float exposure_gain(struct set *s)
{
    struct frame_layer_loader *loader;
    struct frame_layer loaded;
    EXPECT_STATUS(frame_layer_loader_open(&loader, &s->rehearsed.source, &s->rehearsed.avatar), OK);
    EXPECT_STATUS(frame_layer_loader_load(loader, s->moment.frame, &loaded), OK);
    const float ratio = loaded.exposure_gain;
    frame_layer_free(&loaded);
    frame_layer_loader_close(&loader);
    return ratio;
}

// Fits the deformation of the avatar, posed by `joints`, to the shown frame.
static void fit_deformation(struct set *s, const struct depth_frame *depth_frame, const struct bone_transforms *joints,
                            struct deformation *deformation)
{
    const struct avatar *l = &s->rehearsed.avatar;
    struct take *take = s->rehearsed.take;
    const struct calibration *calibration = take_calibration(take);
    struct take_images seen;
    EXPECT_STATUS(take_read(take, s->moment.frame, TAKE_COLOR, &seen), OK);
    uint8_t *rgb = malloc(3 * (size_t)calibration->color.width * (size_t)calibration->color.height);
    EXPECT_STATUS(depth_frame_clean_colors(depth_frame, calibration, seen.color, rgb), OK);
    const struct deformation_model model = {l->tsdf, &l->surface, l->skins};
    const struct deformation_colors colors = {.albedo = (const float(*)[3])l->vertex_colors.color,
                                              .filled = l->vertex_colors.filled,
                                              .irradiance = &l->vertex_colors.irradiance,
                                              .rgb = rgb,
                                              .calibration = calibration,
                                              .world_from_color =
                                                  take_entry(take, s->moment.frame)->world_from_camera.rotation};
    deformation_fit(deformation, &model, depth_frame, joints, &colors);
    free(rgb);
}

// The same pose, registered to the shown frame.
static void draw_reference(struct set *s, struct reference_canvas *canvas)
{
    const struct avatar *l = &s->rehearsed.avatar;
    const struct take_entry *e = take_entry(s->rehearsed.take, s->moment.frame);
    struct depth_frame depth_frame;
    struct posed_avatar posed = {.avatar = l, .viewer_from_world = pose_inverse(s->viewer).rotation};
    struct bone_transforms joints, shown;
    EXPECT_STATUS(depth_frame_open(&depth_frame, s->rehearsed.take, s->rehearsed.rays), OK);
    EXPECT_STATUS(observe_frame(&depth_frame, s->rehearsed.take, s->moment.frame), OK);
    EXPECT_STATUS(bone_transforms_of(&l->bind_pose, &e->skeleton, &joints), OK);
    const struct icp_input from = {joints, l->joint_errors, avatar_corrections(l, s->moment.frame), true};
    struct bone_corrections a = articulated_icp(l->tsdf, &depth_frame, &from, NULL);
    EXPECT_STATUS(bone_transforms_of(&l->bind_pose, &s->moment.skeleton, &shown), OK);
    shown = bone_corrections_apply(&shown, &a);
    joints = bone_corrections_apply(&joints, &a);
    struct deformation *deformation;
    EXPECT_STATUS(deformation_open(&deformation, &l->bind_pose, &l->surface, take_calibration(s->rehearsed.take)), OK);
    fit_deformation(s, &depth_frame, &joints, deformation);
    posed.deformation = deformation;
    for (int p = 0; p < BONE_COUNT; p++) {
        posed.viewer.bone[p] = pose_multiply(pose_inverse(s->viewer), shown.bone[p]);
        posed.world.bone[p] = pose_multiply(e->world_from_camera, joints.bone[p]);
    }
    const struct uv_mesh *m = &l->atlas.mesh;
    const int points = m->point_count;
    struct shaded_vertex *seen = malloc(sizeof *seen * 2 * (size_t)points);
    const double gain = (double)exposure_gain(s);
    for (int i = 0; i < 2 * points; i++) {
        seen[i] = shade_vertex(&posed, i % points, i < points ? -1 : 1);
        seen[i].light *= gain;
    }
    for (int i = 0; i < W * H; i++)
        canvas->z[i] = INFINITY;
    for (int t = 0; t < m->corner_count; t += 3) {
        const int32_t *c = m->corners + t;
        if (is_front(seen, c))
            fill(canvas, &l->atlas, &seen[c[0]], &seen[c[1]], &seen[c[2]], false);
    }
    for (int i = 0; i < m->corner_count; i++) { // the silhouette ribbon
        const int32_t other = m->neighbor[i / 3][i % 3], p = m->corners[i], q = m->corners[i % 3 == 2 ? i - 2 : i + 1];
        const int32_t *front = m->corners + i / 3 * 3, *away = m->corners + 3 * (other < 0 ? 0 : other);
        if (!is_front(seen, front) || (other >= 0 && (is_front(seen, away) || !bends_back(seen, front, away))))
            continue;
        fill(canvas, &l->atlas, &seen[p], &seen[q], &seen[points + q], true);
        fill(canvas, &l->atlas, &seen[p], &seen[points + q], &seen[points + p], true);
    }
    free(seen);
    deformation_close(&deformation);
    depth_frame_close(&depth_frame);
}

static void test_pixels_match_reference(void **state)
{
    (void)state;
    static struct reference_canvas canvas;
    static uint8_t rgba[4 * W * H];
    static struct set set;
    set_open(&set);
    draw(&set, rgba);
    draw_reference(&set, &canvas);
    double sum = 0;
    long count = 0, smooth = 0, one = 0, ties = 0;
    for (int i = 0; i < W * H; i++) {
        bool wanted = canvas.rgba[i][3] > 0, is = rgba[4 * i + 3] > 0;
        one += (canvas.rgba[i][3] > 12) != (rgba[4 * i + 3] > 12);
        smooth += rgba[4 * i + 3] > 12 && rgba[4 * i + 3] < 243;
        count += wanted || is;
        double off = 0;
        for (int c = 0; c < 4; c++)
            off += pow(canvas.rgba[i][c] - rgba[4 * i + c], 2);
        // Where two triangles' edges meet at a sample, either may be drawn over the other.
        const bool tie = off > 4 * 8 * 8;
        ties += tie;
        sum += tie ? 0 : off;
    }
    double psnr = 10 * log10(255.0 * 255.0 / (sum / (4.0 * (double)count)));
    print_message("%ld pixels, %ld of them antialiased, %.1f dB; %ld in one of the two only, %ld ties\n", count, smooth,
                  psnr, one, ties);
    EXPECT_AT_MOST((double)ties, 0.001 * (double)count);
    EXPECT_AT_LEAST((double)count, 2800);
    EXPECT_AT_LEAST((double)smooth, 400);
    EXPECT_AT_LEAST(psnr, 57); // 58 to 60 measured with llvmpipe
    EXPECT_AT_MOST((double)one, 0.002 * (double)count);
    rehearsed_close(&set.rehearsed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pixels_match_reference)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
