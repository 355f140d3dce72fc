// Draws the occluder mesh's depth and the occlusion shadow.
#include "reenact/render/occlusion_shadow.h"

#include "base/portable_math.h"
#include "reenact/render/shaders.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- screen bounds

// Screen bounds by projecting points along the frustum's sides.

struct gpu_box screen_bounds(const struct lens *lens, const double low[2], const double high[2])
{
    enum { SIDE = 16, MARGIN_PX = 2 };
    const struct gpu_box all = {0, 0, 0, 0};
    const double largest = lens_max_radius2(lens);
    double first[2] = {INFINITY, INFINITY}, last[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 4 * (SIDE + 1); i++) { // along the sides, which distortion curves
        const int side = i % 4;                // left, right, top, bottom
        const double along = i / 4 / (double)SIDE;
        const double u = side < 2 ? side : along, v = side < 2 ? along : side - 2;
        const struct vec3 ray = {(1 - u) * low[0] + u * high[0], (1 - v) * low[1] + v * high[1], 1};
        if (!(ray.x * ray.x + ray.y * ray.y <= largest) && !lens_is_ideal(lens))
            return all; // out there the shaders hold the radial factor (lens.glsl)
        const struct pixel px = lens_project(lens, ray);
        if (!isfinite(px.x) || !isfinite(px.y)) // fmin and fmax would pass over NaN
            return all;
        const double at[2] = {px.x, px.y};
        for (int a = 0; a < 2; a++) {
            first[a] = fmin(first[a], at[a]);
            last[a] = fmax(last[a], at[a]);
        }
    }
    const double far[2] = {2.0 * lens->width, 2.0 * lens->height};
    if (!isfinite(first[0]) || !isfinite(first[1]) || !isfinite(last[0]) || !isfinite(last[1]))
        return all;
    for (int a = 0; a < 2; a++) {
        first[a] = fmin(fmax(floor(first[a]) - MARGIN_PX, -far[a]), far[a]);
        last[a] = fmin(fmax(ceil(last[a]) + MARGIN_PX, -far[a]), far[a]);
    }
    return (struct gpu_box){(int)first[0], (int)first[1], (int)(last[0] - first[0]) + 1, (int)(last[1] - first[1]) + 1};
}

// ---------------------------------------------------------------- occlusion shadow

// The floor patch: quads per side, so that lens distortion applies to the shadow, too.
enum { PATCH = 16, PATCH_POINTS = (PATCH + 1) * (PATCH + 1), PATCH_CORNERS = 6 * PATCH * PATCH };
enum { ROUND = 12 }; // points about the shadow's rim, for its bounds
static const double PI = 3.14159265358979323846, FLOOR_M = 0.02;

// All chosen by hand.
static const float ROOM_BACK_M = 0.06F;  // depth bias of the room: what the actor touches does not cut into the body
static const float FLOOR_BACK_M = 0.15F; // depth bias of the floor, for the feet
static const float DARKNESS = 0.6F;      // share of the light that comes from above; the rest is not blocked
static const double SHADOW_M = 0.8;      // reach of the shadow beyond the joints
static const double FOOT_M = 0.14, FOOT_RADIUS_M = 0.07; // a foot's length and radius
static const double ANKLE_M = 0.03;                      // height of the foot joint above the sole's bone

enum uniform { VIEWER_FROM_ROOM, VIEWER_FROM_FLOOR, WORLD_FROM_FLOOR, VIEW_LENS, VIEW_RANGE, BONES, SHADOW, UNIFORMS };
static const char *const uniform_names[UNIFORMS] = {
    [VIEWER_FROM_ROOM] = "viewer_from_room",
    [VIEWER_FROM_FLOOR] = "viewer_from_floor",
    [WORLD_FROM_FLOOR] = "world_from_floor",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [BONES] = "bones",
    [SHADOW] = "shadow",
};

struct occlusion_shadow {
    struct gpu *gpu;
    struct gpu_program *program;
    struct lens view; // viewer camera's
    struct occluder_mesh room;
    // Vertices: the room's points, then the floor patch's. Indices: the patch's come last and are constant; the room's
    // that are drawn end where the patch's begin.
    struct gpu_mesh *mesh;
    uint16_t *occluding; // the room's corners that are drawn
    bool front_only;
};

_Static_assert(OCCLUDER_MAX_POINTS + PATCH_POINTS <= UINT16_MAX, "both go into one mesh");

static void put_patch(float (*points)[4])
{
    for (int i = 0; i < PATCH_POINTS; i++) {
        points[i][0] = 2.0F * (float)(i % (PATCH + 1)) / PATCH - 1;
        points[i][1] = 2.0F * (float)(i / (PATCH + 1)) / PATCH - 1;
        points[i][2] = 0;
        points[i][3] = 1;
    }
}

// first: the number of the patch's first point.
static void put_patch_corners(int first, uint16_t *corners)
{
    for (int y = 0; y < PATCH; y++)
        for (int x = 0; x < PATCH; x++) {
            const int at = first + y * (PATCH + 1) + x, quad[6] = {0, 1, PATCH + 1, 1, PATCH + 2, PATCH + 1};
            for (int i = 0; i < 6; i++)
                *corners++ = (uint16_t)(at + quad[i]);
        }
}

// Opens the GPU mesh for shadow->room.
static enum status open_mesh(struct occlusion_shadow *shadow)
{
    const int of_room = shadow->room.point_count, count = of_room + PATCH_POINTS;
    float(*points)[4] = malloc(sizeof *points * (size_t)count);
    uint16_t patch[PATCH_CORNERS];
    shadow->occluding = malloc(sizeof *shadow->occluding * (size_t)(shadow->room.corner_count + 1));
    if (!points || !shadow->occluding) {
        free(points);
        return fail(ERR_MEMORY, "no memory for the shadow");
    }
    for (int i = 0; i < of_room; i++) {
        memcpy(points[i], shadow->room.points[i], sizeof *shadow->room.points);
        points[i][3] = 0;
    }
    put_patch(points + of_room);
    put_patch_corners(of_room, patch);
    enum status status =
        gpu_mesh_open(&shadow->mesh, shadow->gpu,
                      &(struct gpu_mesh_data){points[0], 4, count, NULL, shadow->room.corner_count + PATCH_CORNERS});
    if (status == OK)
        gpu_mesh_write_indices(shadow->mesh, shadow->room.corner_count, patch, PATCH_CORNERS);
    free(points);
    return status;
}

static void close_mesh(struct occlusion_shadow *shadow)
{
    gpu_mesh_close(&shadow->mesh);
    free(shadow->occluding);
    shadow->occluding = NULL;
    occluder_mesh_free(&shadow->room);
}

enum status occlusion_shadow_open(struct occlusion_shadow **out, struct gpu *gpu, const struct lens *view)
{
    struct occlusion_shadow *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "no memory for the shadow");
    a->gpu = gpu;
    const struct gpu_program_source text = {.name = "occlusion_shadow",
                                            .vertex = shader_find("occlusion_shadow.vert"),
                                            .fragment = shader_find("occlusion_shadow.frag"),
                                            .uniforms = uniform_names,
                                            .uniform_count = UNIFORMS};
    enum status status = gpu_program_open(&a->program, gpu, &text);
    if (status == OK)
        status = open_mesh(a);
    if (status == OK)
        occlusion_shadow_set_lens(a, view);
    else
        occlusion_shadow_close(out);
    return status;
}

void occlusion_shadow_close(struct occlusion_shadow **shadow)
{
    if (!*shadow)
        return;
    close_mesh(*shadow);
    gpu_program_close(&(*shadow)->program);
    free(*shadow);
    *shadow = NULL;
}

void occlusion_shadow_set_lens(struct occlusion_shadow *shadow, const struct lens *view)
{
    const float range[4] = {(float)VIEW_NEAREST_M, VIEW_FARTHEST_M, ROOM_BACK_M, FLOOR_BACK_M};
    float lens[12];
    shadow->view = *view;
    lens_uniform(view, lens);
    gpu_program_set(shadow->program, VIEW_LENS, lens, 3);
    gpu_program_set(shadow->program, VIEW_RANGE, range, 1);
}

void occlusion_shadow_set_front_only(struct occlusion_shadow *shadow, bool front_only)
{
    shadow->front_only = front_only;
}

enum status occlusion_shadow_set_room(struct occlusion_shadow *shadow, struct occluder_mesh *room)
{
    struct occlusion_shadow next = *shadow;
    next.room = *room;
    next.mesh = NULL;
    next.occluding = NULL;
    *room = (struct occluder_mesh){0};
    enum status status = open_mesh(&next);
    close_mesh(status == OK ? shadow : &next);
    if (status == OK)
        *shadow = next;
    return status;
}

// Writes the indices of the triangles that may occlude `hidden`; returns the number of corners.
static int put_room(struct occlusion_shadow *shadow, const struct affine_map *viewer_from_room,
                    const struct occlusion_frustum *hidden)
{
    const int count = occluder_mesh_cull(&shadow->room, viewer_from_room, hidden, shadow->occluding);
    gpu_program_set(shadow->program, VIEWER_FROM_ROOM, viewer_from_room->row[0], 3);
    if (count)
        gpu_mesh_write_indices(shadow->mesh, shadow->room.corner_count - count, shadow->occluding, count);
    return count;
}

// The screen bounds of `hidden` in a target of another resolution than the image's.
static struct gpu_box box_in(const struct occlusion_shadow *shadow, const struct gpu_target *target,
                             const struct occlusion_frustum *hidden)
{
    const double scale = (double)gpu_target_width(target) / shadow->view.width;
    const struct gpu_box box = screen_bounds(&shadow->view, hidden->low, hidden->high);
    const int left = (int)floor(scale * box.left), right = (int)ceil(scale * (box.left + box.width));
    const int top = (int)floor(scale * box.top), bottom = (int)ceil(scale * (box.top + box.height));
    return (struct gpu_box){left, top, right - left, bottom - top};
}

// Draws the last `of_room` of the room's corners and the first `of_patch` of the patch's.
static void draw_corners(struct occlusion_shadow *shadow, struct gpu_target *target, int of_room, int of_patch,
                         const struct occlusion_frustum *hidden)
{
    gpu_draw(&(struct gpu_job){.target = target,
                               .program = shadow->program,
                               .mesh = shadow->mesh,
                               .closed = shadow->front_only && !of_patch,
                               .depth_test = true,
                               .first = shadow->room.corner_count - of_room,
                               .count = of_room + of_patch,
                               .within = box_in(shadow, target, hidden)});
}

bool occlusion_shadow_draw_room(struct occlusion_shadow *shadow, struct gpu_target *target,
                                const struct affine_map *viewer_from_room, const struct occlusion_frustum *hidden)
{
    const int count = put_room(shadow, viewer_from_room, hidden);
    if (count)
        draw_corners(shadow, target, count, 0, hidden);
    return count > 0;
}

void occlusion_shadow_warm_up(struct occlusion_shadow *shadow, struct gpu_target *target)
{
    gpu_draw(&(struct gpu_job){.target = target,
                               .program = shadow->program,
                               .mesh = shadow->mesh,
                               .depth_test = true,
                               .first = shadow->room.corner_count, // of the patch
                               .count = 3,
                               .within = {-1, -1, 1, 1}});
}

static void put_bone(float (*bone)[4], struct vec3 from, struct vec3 to, double radius)
{
    const struct vec3 ends[2] = {from, to};
    for (int e = 0; e < 2; e++) {
        bone[e][0] = (float)ends[e].x, bone[e][1] = (float)ends[e].y, bone[e][2] = (float)ends[e].z;
        bone[e][3] = e ? 0 : (float)radius;
    }
}

// Feet, which have no joints of their own, point to where the hips face.
static void put_feet(float (*bones)[4], const struct skeleton *skeleton)
{
    static const enum joint feet[2] = {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT};
    struct vec3 across = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]), front = v3(0, 0, 0);
    if (skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0)
        front = v3_unit(v3_cross(v3(across.x, across.y, 0), v3(0, 0, 1)));
    for (int f = 0; f < 2; f++) {
        struct vec3 heel = v3_sub(skeleton->joint[feet[f]], v3(0, 0, ANKLE_M));
        if (skeleton->confidence[feet[f]] > 0)
            put_bone(&bones[2 * f], heel, v3_add(heel, v3_scale(front, FOOT_M)), FOOT_RADIUS_M);
    }
}

// The known parts' bones, and their bounds on the floor, of which low > high if there is none.
static void put_parts(float (*bones)[4], const struct occlusion_shadow_view *view, struct vec3 *low, struct vec3 *high)
{
    const struct skeleton *skeleton = view->skeleton;
    *low = v3(INFINITY, INFINITY, 0), *high = v3(-INFINITY, -INFINITY, 0);
    for (int p = 0; p < PART_COUNT; p++) {
        struct vec3 ends[2] = {skeleton->joint[part_ends[p].from], skeleton->joint[part_ends[p].to]};
        if (!part_is_known(view->body, skeleton, (enum part)p))
            continue;
        put_bone(&bones[2 * p], ends[0], ends[1], view->body->radius_rate[p] * v3_distance(ends[0], ends[1]));
        for (int e = 0; e < 2; e++) {
            *low = v3(fmin(low->x, ends[e].x), fmin(low->y, ends[e].y), 0);
            *high = v3(fmax(high->x, ends[e].x), fmax(high->y, ends[e].y), 0);
        }
    }
}

void occlusion_shadow_draw(struct occlusion_shadow *occlusion_shadow, struct gpu_target *target,
                           const struct occlusion_shadow_view *view)
{
    const struct skeleton *skeleton = view->skeleton;
    float bones[2 * PART_COUNT + 4][4] = {{0}};
    struct vec3 low, high;
    put_parts(bones, view, &low, &high);
    if (!(low.x <= high.x))
        return;
    put_feet(&bones[(size_t)2 * PART_COUNT], skeleton);
    double reach = fmax(high.x - low.x, high.y - low.y) / 2 + SHADOW_M;
    struct vec3 middle = v3_mix(low, high, 0.5);
    const struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    struct occlusion_frustum hidden = {0};
    for (int i = 0; i < ROUND; i++) { // a polygon about the circle at which the shadow ends
        const double angle = 2 * PI * i / ROUND, r = reach / portable_cos(PI / ROUND);
        const struct vec3 rim = v3(middle.x + r * portable_cos(angle), middle.y + r * portable_sin(angle), 0);
        occlusion_frustum_add(&hidden, pose_apply(viewer_from_world, rim), FLOOR_M);
    }
    const int count = view->viewer_from_room ? put_room(occlusion_shadow, view->viewer_from_room, &hidden) : 0;
    struct affine_map world = {
        {{(float)reach, 0, 0, (float)middle.x}, {0, (float)reach, 0, (float)middle.y}, {0, 0, 1, 0}}};
    struct affine_map map = affine_from_pose(viewer_from_world), viewer = affine_multiply(&map, &world);
    const float shadow[4] = {(float)middle.x, (float)middle.y, (float)reach, DARKNESS};
    gpu_program_set(occlusion_shadow->program, VIEWER_FROM_FLOOR, viewer.row[0], 3);
    gpu_program_set(occlusion_shadow->program, WORLD_FROM_FLOOR, world.row[0], 3);
    gpu_program_set(occlusion_shadow->program, BONES, bones[0], 2 * PART_COUNT + 4);
    gpu_program_set(occlusion_shadow->program, SHADOW, shadow, 1);
    draw_corners(occlusion_shadow, target, count, PATCH_CORNERS, &hidden);
}
