// Occlusion and shadow of the actor in the small world: a table between viewer and actor
// hides the actor as far as sensors saw it, and nothing else does; the shadow lies under
// the feet. What is drawn at a depth of its own is hidden by table and actor where it is behind them.
#include "tests/support/test.h"

#include "platform/files/jpeg.h"
#include "reenact/render/actor_renderer.h"
#include "reenact/render/shaders.h"
#include "reenact/scene/occluder_mesh.h"
#include "tests/support/random.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

enum { VIEWS = 16, FRAMES = 3, MOST = 320 * 240, FINEST = 16 * MOST };
static const double SCALE = 0.5;

static const struct body measures = {.radius_rate = {0.42, 0.42, 0.6, 0.18, 0.16, 0.18, 0.16, 0.2, 0.15, 0.2, 0.15}};

struct occlusion_set {
    struct world *world, *without; // with and without a table
    struct scratch scratch;
    struct place place;
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
};
static struct occlusion_set set;

static struct pose look_at(struct vec3 from, struct vec3 at)
{
    struct vec3 z = v3_unit(v3_sub(at, from)), x = v3_unit(v3_cross(z, v3(0, 0, 1))), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), from};
}

static struct place film_place(const struct world *w)
{
    struct place place = {.calibration = world_calibration(SCALE), .view_count = VIEWS};
    const struct lens *lens = &place.calibration.depth;
    place.views = calloc(VIEWS, sizeof *place.views);
    for (int i = 0; i < VIEWS; i++) {
        struct place_view *v = &place.views[i];
        v->world_from_camera = world_sweep_pose(w, (double)i * WORLD_SWEEP_S / VIEWS);
        v->depth = malloc(sizeof *v->depth * (size_t)lens->width * (size_t)lens->height);
        struct world_shot shot = {*lens, v->world_from_camera, 0, false};
        EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = v->depth}), OK);
        EXPECT_STATUS(world_depth_noise(lens, v->depth, (uint64_t)i + 1, v->depth), OK);
    }
    return place;
}

static void film_take(const struct world *w, const char *path)
{
    static uint8_t rgb[3 * MOST], mask[MOST];
    static uint16_t depth[MOST];
    struct recording_writer *writer;
    const struct calibration c = world_calibration(SCALE);
    EXPECT_STATUS(recording_create(&writer, path), OK);
    EXPECT_STATUS(recording_begin_take(writer, "stands", &c), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct pose pose = world_sensor_pose(w);
        struct world_shot shot = {c.color, pose, 0.1 * i, true};
        struct take_frame f = {.time_ns = i * 100000000ll,
                               .world_from_camera = pose,
                               .located = true,
                               .depth = depth,
                               .mask = mask,
                               .has_skeleton = true};
        EXPECT_STATUS(world_render(w, &shot, &(struct world_image){rgb, depth, mask}), OK);
        EXPECT_STATUS(world_depth_noise(&c.depth, depth, (uint64_t)i + 100, depth), OK);
        f.skeleton = world_joints_in_camera(w, shot.time_s, pose);
        uint8_t *jpeg;
        EXPECT_STATUS(jpeg_encode(rgb, c.color.width, c.color.height, 92, &jpeg, &f.jpeg_bytes), OK);
        f.jpeg = jpeg;
        EXPECT_STATUS(recording_add_frame(writer, &f), OK);
        free(jpeg);
    }
    EXPECT_STATUS(recording_put_body(writer, &measures), OK);
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
}

// hidden: with the room's occlusion.
static void draw(struct renderer *p, struct pose viewer, bool hidden, uint8_t *rgb, uint8_t *rgba)
{
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(viewer));
    static uint8_t grey[3 * FINEST];
    memset(grey, 200, sizeof grey);
    struct renderer_view view = {.world_from_camera = viewer, .color = grey};
    view.viewer_from_room = hidden ? &viewer_from_room : NULL;
    struct renderer_result result;
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_INT(result.parts, PART_COUNT);
    EXPECT_STATUS(renderer_read(p, rgb), OK);
    EXPECT_STATUS(renderer_read_actor(p, rgba), OK);
}

enum occluder { NO_OCCLUDER, OCCLUDER, OCCLUDER_UNDIVIDED }; // undivided: one sphere, so that nothing is culled

static struct renderer *renderer_with(const struct lens *lens, enum occluder occluder)
{
    struct renderer_options o = renderer_default_options();
    struct renderer *p;
    o.shadow = true;
    EXPECT_STATUS(renderer_open(&p, set.gpu, set.take, lens, &o), OK);
    if (occluder != NO_OCCLUDER) {
        struct occluder_mesh room;
        EXPECT_STATUS(occluder_mesh_make(&room, &set.place, set.take, NULL), OK);
        print_message("occluder mesh: %d points, %d triangles in %d spheres\n", room.point_count, room.corner_count / 3,
                      room.sphere_count);
        if (occluder == OCCLUDER_UNDIVIDED) {
            room.sphere_count = 1;
            room.spheres[0] = (struct occluder_sphere){v3(0, 0, 0), 100, 0, room.corner_count};
        }
        EXPECT_STATUS(renderer_set_room(p, &room), OK);
    }
    return p;
}

static int triangles_left(const struct occluder_mesh *room, struct pose viewer, const struct occlusion_frustum *hidden)
{
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(viewer));
    uint16_t *corners = malloc(sizeof *corners * (size_t)room->corner_count);
    EXPECT_TRUE(corners);
    const int count = occluder_mesh_cull(room, &viewer_from_room, hidden, corners);
    free(corners);
    return count / 3;
}

static void test_only_possible_occluders_are_drawn(void **state)
{
    (void)state;
    struct occluder_mesh room;
    EXPECT_STATUS(occluder_mesh_make(&room, &set.place, set.take, NULL), OK);
    int all = 0;
    for (int b = 0; b < room.sphere_count; b++) {
        EXPECT_INT(room.spheres[b].first, all);
        all += room.spheres[b].count;
    }
    EXPECT_INT(all, room.corner_count);
    const struct skeleton s = world_joints(set.world, 0);
    const struct pose sensor = world_sensor_pose(set.world), beyond = look_at(v3(2.7, 0.3, 1.25), v3(0, 0, 0.9));
    const struct skeleton at_sensor = skeleton_transform(pose_inverse(sensor), &s),
                          at_table = skeleton_transform(pose_inverse(beyond), &s);
    const struct occlusion_frustum from_sensor = occlusion_frustum_body(&at_sensor),
                                   over_table = occlusion_frustum_body(&at_table), nothing = {0};
    struct occlusion_frustum everything = {0};
    occlusion_frustum_add(&everything, v3(0, 0, 1), 100);
    const int few = triangles_left(&room, sensor, &from_sensor), many = triangles_left(&room, beyond, &over_table);
    print_message("of %d triangles %d from the sensor's side, %d over the table\n", all / 3, few, many);
    EXPECT_AT_MOST(few, 0.1 * all / 3);
    EXPECT_AT_LEAST(many, few + 1000);
    EXPECT_INT(triangles_left(&room, beyond, &nothing), 0);
    EXPECT_INT(triangles_left(&room, beyond, &everything), all / 3);
    occluder_mesh_free(&room);
}

static void test_mesh_is_the_same_for_any_thread_count(void **state)
{
    (void)state;
    struct occluder_mesh rooms[2];
    for (int i = 0; i < 2; i++) {
        struct occluder_options options = occluder_default_options();
        options.threads = 1 + 3 * i;
        EXPECT_STATUS(occluder_mesh_make(&rooms[i], &set.place, set.take, &options), OK);
    }
    EXPECT_INT(rooms[0].point_count, rooms[1].point_count);
    EXPECT_INT(rooms[0].corner_count, rooms[1].corner_count);
    EXPECT_TRUE(!memcmp(rooms[0].points, rooms[1].points, sizeof *rooms[0].points * (size_t)rooms[0].point_count));
    EXPECT_TRUE(!memcmp(rooms[0].corners, rooms[1].corners, sizeof *rooms[0].corners * (size_t)rooms[0].corner_count));
    occluder_mesh_free(&rooms[0]);
    occluder_mesh_free(&rooms[1]);
}

// Images are the same as without culling, the shadow's too.
static void test_no_occluder_is_omitted(void **state)
{
    (void)state;
    static uint8_t rgb[2][3 * MOST], rgba[2][4 * MOST];
    const struct lens lens = world_viewer_calibration(SCALE).color;
    struct renderer *p[2] = {renderer_with(&lens, OCCLUDER), renderer_with(&lens, OCCLUDER_UNDIVIDED)};
    for (int e = 0; e < 8; e++) {
        const double angle = e * 0.785;
        struct pose viewer = look_at(v3(2.5 * cos(angle), 2.5 * sin(angle), 1.3), v3(0, 0, 0.7));
        for (int i = 0; i < 2; i++)
            draw(p[i], viewer, true, rgb[i], rgba[i]);
        EXPECT_TRUE(!memcmp(rgb[0], rgb[1], 3 * (size_t)lens.width * (size_t)lens.height));
        EXPECT_TRUE(!memcmp(rgba[0], rgba[1], 4 * (size_t)lens.width * (size_t)lens.height));
    }
    renderer_close(&p[0]);
    renderer_close(&p[1]);
}

static void test_table_occludes_actor(void **state)
{
    (void)state;
    static uint8_t visible[MOST], whole[MOST], rgb[3 * MOST], with[4 * MOST], without[4 * MOST];
    const struct lens lens = world_viewer_calibration(SCALE).color;
    struct renderer *p = renderer_with(&lens, OCCLUDER);
    const struct vec3 viewpoints[] = {{2.7, 0.3, 1.25}, {2.4, -0.9, 1.0}, {2.6, 0, 0.9}};
    for (size_t e = 0; e < COUNT_OF(viewpoints); e++) {
        struct pose viewer = look_at(viewpoints[e], v3(0, 0, 0.9));
        struct world_shot shot = {lens, viewer, 0, true};
        EXPECT_STATUS(world_render(set.world, &shot, &(struct world_image){.mask = visible}), OK);
        EXPECT_STATUS(world_render(set.without, &shot, &(struct world_image){.mask = whole}), OK);
        draw(p, viewer, true, rgb, with);
        draw(p, viewer, false, rgb, without);
        long behind = 0, gone = 0, before = 0, left = 0;
        for (int i = 0; i < lens.width * lens.height; i++) {
            bool drawn = without[4 * i + 3] >= 128, still = with[4 * i + 3] >= 128;
            behind += drawn && whole[i] && !visible[i];
            gone += drawn && whole[i] && !visible[i] && !still;
            before += drawn && visible[i];
            left += drawn && visible[i] && still;
        }
        print_message("viewpoint %zu: of %ld pixels behind the table %ld are hidden, of %ld others %ld are not\n", e,
                      behind, gone, before, left);
        EXPECT_AT_LEAST((double)behind, 600);
        EXPECT_AT_LEAST((double)gone, 0.89 * (double)behind);
        EXPECT_AT_LEAST((double)left, 0.999 * (double)before);
    }
    // From the sensor's side nothing is between.
    draw(p, world_sensor_pose(set.world), true, rgb, with);
    draw(p, world_sensor_pose(set.world), false, rgb, without);
    EXPECT_TRUE(!memcmp(with, without, 4 * (size_t)lens.width * (size_t)lens.height));
    renderer_close(&p);
}

// The mean alpha of the 4 x 4 pixels of the fine image in each pixel of the coarse one.
static void average(const uint8_t *fine, const struct lens *coarse, double *out)
{
    for (int i = 0; i < coarse->width * coarse->height; i++) {
        const int x = 4 * (i % coarse->width), y = 4 * (i / coarse->width);
        out[i] = 0;
        for (int k = 0; k < 16; k++)
            out[i] += fine[4 * ((y + k / 4) * 4 * coarse->width + x + k % 4) + 3] / 16.0;
    }
}

// Along the table's edge over the actor, alpha is near that of an image of four times the resolution, and nearer than
// with a hard edge.
static void test_table_edge_is_smooth(void **state)
{
    (void)state;
    static uint8_t rgb[3 * FINEST], fine[4 * FINEST], with[4 * MOST], without[4 * MOST];
    static double share[MOST];
    struct lens lens = world_viewer_calibration(SCALE).color, finer = world_viewer_calibration(4 * SCALE).color;
    struct renderer *p = renderer_with(&lens, OCCLUDER), *p4 = renderer_with(&finer, OCCLUDER);
    const struct vec3 viewpoints[] = {{2.7, 0.3, 1.25}, {2.4, -0.9, 1.0}};
    EXPECT_INT(finer.width, 4 * lens.width);
    for (size_t e = 0; e < COUNT_OF(viewpoints); e++) {
        const struct pose viewer = look_at(viewpoints[e], v3(0, 0, 0.9));
        draw(p4, viewer, true, rgb, fine);
        draw(p, viewer, true, rgb, with);
        draw(p, viewer, false, rgb, without);
        average(fine, &lens, share);
        double ours = 0, hard = 0;
        int at_edge = 0;
        for (int i = 0; i < lens.width * lens.height; i++) {
            if (without[4 * i + 3] < 255 || share[i] < 1 || share[i] > 254) // not the silhouette, not off the edge
                continue;
            at_edge++;
            ours += pow(with[4 * i + 3] - share[i], 2);
            hard += pow((share[i] >= 127.5 ? 255 : 0) - share[i], 2);
        }
        ours = sqrt(ours / at_edge), hard = sqrt(hard / at_edge);
        print_message("viewpoint %zu: %d pixels at the table's edge, rms error %.1f of 255, of a hard edge %.1f\n", e,
                      at_edge, ours, hard);
        EXPECT_AT_LEAST(at_edge, 30);
        EXPECT_AT_MOST(ours, 0.52 * hard);
    }
    renderer_close(&p);
    renderer_close(&p4);
}

static void test_shadow_lies_under_feet(void **state)
{
    (void)state;
    static uint8_t rgb[3 * MOST], rgba[4 * MOST];
    const struct lens lens = world_viewer_calibration(SCALE).color;
    struct renderer *p = renderer_with(&lens, NO_OCCLUDER);
    struct skeleton s = world_joints(set.world, 0);
    struct vec3 foot = v3_mix(s.joint[JOINT_LEFT_FOOT], s.joint[JOINT_RIGHT_FOOT], 0.5);
    struct pose viewer = look_at(v3(foot.x, foot.y - 2, 2.3), v3(foot.x, foot.y, 0.3));
    draw(p, viewer, false, rgb, rgba);
    const double aside[] = {0, 0.3, 0.6, 1.6};
    int grey[4];
    for (int i = 0; i < 4; i++) {
        // Before the feet, where they do not hide the floor, at growing distances.
        struct vec3 floor = v3(foot.x - aside[i], foot.y - 0.25 - aside[i] / 2, 0);
        struct pixel px = lens_project(&lens, pose_apply(pose_inverse(viewer), floor));
        int at = (int)lround(px.y) * lens.width + (int)lround(px.x);
        EXPECT_INT(rgba[4 * at + 3], 0); // not on the actor
        grey[i] = rgb[3 * at];
    }
    print_message("floor, 200 without a shadow: %d, %d, %d, %d\n", grey[0], grey[1], grey[2], grey[3]);
    EXPECT_AT_MOST(grey[0], 173);
    EXPECT_AT_LEAST(grey[1], grey[0]);
    EXPECT_AT_LEAST(grey[2], grey[1]);
    EXPECT_INT(grey[3], 200);
    renderer_close(&p);
}

// ---------------------------------------------------------------- at a depth of its own

enum { ASKED = 60, ROUNDS = 16 };
static const double APART_M = 0.15; // from the true surface, beyond which it is clear what hides what

enum truth { IN_SIGHT, BEHIND, UNCLEAR };

// By the rendered world's depth in the pixels about the point.
static enum truth truth_of(const uint16_t *depth, const struct lens *lens, struct vec3 in_viewer)
{
    enum { ABOUT = 3 };
    const struct pixel px = lens_project(lens, in_viewer);
    int before = 0, behind = 0;
    for (int dy = -ABOUT; dy <= ABOUT; dy++)
        for (int dx = -ABOUT; dx <= ABOUT; dx++) {
            const int x = (int)lround(px.x) + dx, y = (int)lround(px.y) + dy;
            if (x < 0 || y < 0 || x >= lens->width || y >= lens->height)
                return UNCLEAR;
            const double z = depth[y * lens->width + x] * 1e-3;
            before += z == 0 || z > in_viewer.z + APART_M;
            behind += z > 0 && z < in_viewer.z - APART_M;
        }
    const int all = (2 * ABOUT + 1) * (2 * ABOUT + 1);
    return before == all ? IN_SIGHT : behind == all ? BEHIND : UNCLEAR;
}

struct answers {
    int in_sight, shown, behind_table, hidden_by_table, behind_actor, hidden_by_actor;
};

// The strokes' alpha: of white ones, over black, the red.
static void read_strokes(const struct gpu_texture *texture, const struct lens *lens, uint8_t *rgba)
{
    static const uint8_t black[3 * MOST], none[4];
    static const char *const samplers[] = {"camera_image", "actor_image", "shadow_image"};
    const struct gpu_program_source source = {.name = "compose",
                                              .vertex = shader_find("fullscreen.vert"),
                                              .fragment = shader_find("compose.frag"),
                                              .samplers = samplers,
                                              .sampler_count = 3};
    const struct gpu_texture_layout whole = {GPU_RGB8, lens->width, lens->height, GPU_NEAREST},
                                    pixel = {GPU_RGBA8, 1, 1, GPU_NEAREST};
    struct gpu_program *program;
    struct gpu_mesh *mesh;
    struct gpu_target *target;
    struct gpu_texture *ground, *shadow;
    EXPECT_STATUS(gpu_program_open(&program, set.gpu, &source), OK);
    EXPECT_STATUS(fullscreen_mesh_open(&mesh, set.gpu), OK);
    EXPECT_STATUS(gpu_target_open_color(&target, set.gpu, lens->width, lens->height), OK);
    EXPECT_STATUS(gpu_texture_open(&ground, set.gpu, &whole, black), OK);
    EXPECT_STATUS(gpu_texture_open(&shadow, set.gpu, &pixel, none), OK);
    gpu_draw(
        &(struct gpu_job){.target = target, .program = program, .mesh = mesh, .textures = {ground, texture, shadow}});
    EXPECT_STATUS(gpu_target_read(target, rgba), OK);
    gpu_texture_close(&shadow);
    gpu_texture_close(&ground);
    gpu_target_close(&target);
    gpu_mesh_close(&mesh);
    gpu_program_close(&program);
}

// No other disc covers it.
static bool is_apart(const struct lens *lens, const struct overlay_stroke *stroke, int disc)
{
    const struct pixel at = lens_project(lens, stroke[disc].from);
    for (int i = 0; i < ASKED; i++) {
        const struct pixel other = lens_project(lens, stroke[i].from);
        if (i != disc && hypot(other.x - at.x, other.y - at.y) < 8)
            return false;
    }
    return true;
}

// Nobody can be inside the table, of which sensors know its surface alone.
static bool is_in_table(struct vec3 p) { return p.x > 0.95 && p.x < 1.65 && fabs(p.y) < 0.75 && p.z < 0.8; }

// About actor and table, half of them on the lines of sight to the actor's joints.
static struct vec3 draw_point(struct pose viewer, struct rng *rng)
{
    const struct skeleton s = world_joints(set.world, 0);
    for (;;) {
        const struct vec3 joint = s.joint[(int)rng_between(rng, 0, JOINT_COUNT - 0.001)];
        const double beyond = rng_between(rng, -1.2, 1.2);
        struct vec3 at = v3_add(joint, v3_scale(v3_unit(v3_sub(joint, viewer.translation)), beyond));
        if (rng_uniform(rng) < 0.4)
            at = v3_add(v3(0.4, 0, 0.75), rng_within(rng, v3(1.2, 0.6, 0.5)));
        if (!is_in_table(at) && at.z > 0.2)
            return at;
    }
}

// A round of points about actor and table, in the viewer's axes: each as a disc, and asked for.
static void ask_round(struct renderer *p, const struct lens *lens, struct pose viewer, struct rng *rng,
                      struct answers *discs, struct answers *shares)
{
    static uint16_t with[MOST], without[MOST];
    static uint8_t strokes[4 * MOST];
    struct overlay_stroke stroke[ASKED];
    struct overlay_group group[ASKED];
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(viewer));
    const struct world_shot shot = {*lens, viewer, 0, true};
    EXPECT_STATUS(world_render(set.world, &shot, &(struct world_image){.depth = with}), OK);
    EXPECT_STATUS(world_render(set.without, &shot, &(struct world_image){.depth = without}), OK);
    for (int i = 0; i < ASKED; i++) {
        const struct vec3 at = draw_point(viewer, rng);
        const struct vec3 seen = pose_apply(pose_inverse(viewer), at);
        stroke[i] = (struct overlay_stroke){seen, seen, 5, 0, 0xffffffff};
        for (int k = 0; k < OVERLAY_POINTS; k++)
            group[i].point[k] = v3_add(seen, v3(0.01 * (k % 3 - 1), 0.01 * (k / 3 - 1), 0));
    }
    const struct overlay overlay = {stroke, ASKED, group, ASKED};
    const struct renderer_view view = {
        .world_from_camera = viewer, .viewer_from_room = &viewer_from_room, .overlay = &overlay};
    struct renderer_result result;
    float share[OVERLAY_GROUPS_MAX];
    int count;
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_TRUE(renderer_overlay_texture(p));
    read_strokes(renderer_overlay_texture(p), lens, strokes);
    EXPECT_STATUS(renderer_read_seen(p, share, &count), OK);
    EXPECT_INT(count, ASKED);
    for (int i = 0; i < ASKED; i++) {
        const struct pixel px = lens_project(lens, stroke[i].from);
        const enum truth truth = truth_of(with, lens, stroke[i].from);
        const bool by_actor = truth_of(without, lens, stroke[i].from) == BEHIND;
        if (truth == UNCLEAR || !is_apart(lens, stroke, i))
            continue;
        const int alpha = strokes[4 * ((int)lround(px.y) * lens->width + (int)lround(px.x))];
        discs->in_sight += truth == IN_SIGHT;
        discs->shown += truth == IN_SIGHT && alpha > 200;
        shares->shown += truth == IN_SIGHT && share[i] > 0.8F;
        *(by_actor ? &discs->behind_actor : &discs->behind_table) += truth == BEHIND;
        *(by_actor ? &discs->hidden_by_actor : &discs->hidden_by_table) += truth == BEHIND && alpha < 50;
        *(by_actor ? &shares->hidden_by_actor : &shares->hidden_by_table) += truth == BEHIND && share[i] < 0.2F;
    }
}

static void test_what_stands_behind_is_hidden(void **state)
{
    (void)state;
    const struct lens lens = world_viewer_calibration(SCALE).color;
    struct renderer *p = renderer_with(&lens, OCCLUDER);
    struct answers discs = {0}, shares = {0};
    struct rng rng = {5};
    print_message("seed 5\n");
    for (int i = 0; i < ROUNDS; i++) {
        const double angle = 0.12 * i - 0.9;
        ask_round(p, &lens, look_at(v3(2.7 * cos(angle), 2.7 * sin(angle), 1.3), v3(0.2, 0, 0.8)), &rng, &discs,
                  &shares);
    }
    print_message("discs: of %d in sight %d are shown, of %d behind the table %d hidden, behind the actor of %d %d\n",
                  discs.in_sight, discs.shown, discs.behind_table, discs.hidden_by_table, discs.behind_actor,
                  discs.hidden_by_actor);
    print_message("asked: %d, %d, %d\n", shares.shown, shares.hidden_by_table, shares.hidden_by_actor);
    EXPECT_AT_LEAST(discs.in_sight, 60); // else it says little
    EXPECT_AT_LEAST(discs.behind_table, 15);
    EXPECT_AT_LEAST(discs.behind_actor, 15);
    EXPECT_AT_LEAST(discs.shown, 0.97 * discs.in_sight);
    EXPECT_AT_LEAST(shares.shown, 0.97 * discs.in_sight);
    EXPECT_AT_LEAST(discs.hidden_by_table, 0.9 * discs.behind_table);
    EXPECT_AT_LEAST(shares.hidden_by_table, 0.9 * discs.behind_table);
    EXPECT_AT_LEAST(discs.hidden_by_actor, 0.95 * discs.behind_actor);
    EXPECT_AT_LEAST(shares.hidden_by_actor, 0.95 * discs.behind_actor);
    renderer_close(&p);
}

static int make(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    o.motion = "still";
    o.threads = 2;
    o.plain = true;
    EXPECT_STATUS(world_open(&set.without, &o), OK);
    o.table = true;
    EXPECT_STATUS(world_open(&set.world, &o), OK);
    set.scratch = scratch_make();
    set.place = film_place(set.world);
    const char *path = scratch_file(&set.scratch, "stands.reenact");
    film_take(set.world, path);
    EXPECT_STATUS(recording_open(&set.recording, path), OK);
    EXPECT_STATUS(take_open(&set.take, set.recording, "stands"), OK);
    EXPECT_STATUS(gpu_open(&set.gpu), OK);
    return 0;
}

static int end(void **state)
{
    (void)state;
    gpu_close(&set.gpu);
    take_close(&set.take);
    recording_free(&set.recording);
    place_free(&set.place);
    world_close(&set.world);
    world_close(&set.without);
    scratch_remove(&set.scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_only_possible_occluders_are_drawn),
        cmocka_unit_test(test_mesh_is_the_same_for_any_thread_count),
        cmocka_unit_test(test_no_occluder_is_omitted),
        cmocka_unit_test(test_table_occludes_actor),
        cmocka_unit_test(test_table_edge_is_smooth),
        cmocka_unit_test(test_shadow_lies_under_feet),
        cmocka_unit_test(test_what_stands_behind_is_hidden),
    };
    return cmocka_run_group_tests(tests, make, end);
}
