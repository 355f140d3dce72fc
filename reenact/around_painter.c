#include "reenact/around_painter.h"

#include "reenact/likeness_painter.h"
#include "reenact/shaders.h"

#include <stdlib.h>

enum { PATCH = 16 }; // quads a side, so that the lens bends the shadow, too
enum { ROUND = 12 };
static const double PI = 3.14159265358979323846, FLOOR_M = 0.02;

static const float NEAREST_M = 0.05F, FARTHEST_M = 60;
static const float ROOM_BACK_M = 0.06F;  // what the actor touches is not to cut into him
static const float FLOOR_BACK_M = 0.15F; // nor the floor into his feet
static const float DARK = 0.6F;          // of the light that comes from above, the rest comes from elsewhere
static const double SHADOW_M = 0.8;      // beyond the joints
static const double FOOT_M = 0.14, FOOT_RADIUS_M = 0.07, ANKLE_M = 0.03; // its length, and how far the ankle is above

enum uniform { VIEWER_FROM_POINT, WORLD_FROM_POINT, VIEW_LENS, VIEW_RANGE, BONES, SHADOW, UNIFORMS };
static const char *const uniform_names[UNIFORMS] = {
    [VIEWER_FROM_POINT] = "viewer_from_point",
    [WORLD_FROM_POINT] = "world_from_point",
    [VIEW_LENS] = "view_lens",
    [VIEW_RANGE] = "view_range",
    [BONES] = "bones",
    [SHADOW] = "shadow",
};

struct around_painter {
    struct gpu *gpu;
    struct gpu_program *program;
    struct gpu_mesh *patch; // of the floor, -1 to 1
    struct room room;
    struct gpu_mesh *walls; // NULL: there is none
    uint16_t *before;       // corners of what is drawn of it
};

static enum status open_patch(struct around_painter *a)
{
    float points[(PATCH + 1) * (PATCH + 1)][3];
    uint16_t corners[PATCH * PATCH * 6];
    int count = 0;
    for (int i = 0; i < (PATCH + 1) * (PATCH + 1); i++) {
        points[i][0] = 2.0F * (float)(i % (PATCH + 1)) / PATCH - 1;
        points[i][1] = 2.0F * (float)(i / (PATCH + 1)) / PATCH - 1;
        points[i][2] = 0;
    }
    for (int y = 0; y < PATCH; y++)
        for (int x = 0; x < PATCH; x++) {
            const int at = y * (PATCH + 1) + x, quad[6] = {0, 1, PATCH + 1, 1, PATCH + 2, PATCH + 1};
            for (int i = 0; i < 6; i++)
                corners[count++] = (uint16_t)(at + quad[i]);
        }
    return gpu_mesh_open(&a->patch, a->gpu, points[0], 3, (PATCH + 1) * (PATCH + 1), corners, count);
}

enum status around_painter_open(struct around_painter **out, struct gpu *gpu, const struct lens *view)
{
    struct around_painter *a = *out = calloc(1, sizeof *a);
    if (!a)
        return fail(ERR_MEMORY, "out of memory");
    a->gpu = gpu;
    const struct gpu_program_text text = {
        "around", shader_find("around.vert"), shader_find("around.frag"), uniform_names, UNIFORMS, NULL, 0};
    enum status status = gpu_program_open(&a->program, gpu, &text);
    if (status == OK)
        status = open_patch(a);
    if (status == OK)
        around_painter_set_lens(a, view);
    else
        around_painter_close(out);
    return status;
}

void around_painter_close(struct around_painter **a)
{
    if (!*a)
        return;
    room_free(&(*a)->room);
    gpu_mesh_close(&(*a)->walls);
    free((*a)->before);
    gpu_mesh_close(&(*a)->patch);
    gpu_program_close(&(*a)->program);
    free(*a);
    *a = NULL;
}

void around_painter_set_lens(struct around_painter *a, const struct lens *view)
{
    float lens[12];
    lens_uniform(view, lens);
    gpu_program_set(a->program, VIEW_LENS, lens, 3);
}

enum status around_painter_give(struct around_painter *a, struct room *room)
{
    gpu_mesh_close(&a->walls);
    free(a->before);
    a->before = NULL;
    room_free(&a->room);
    a->room = *room;
    *room = (struct room){0};
    if (!a->room.corner_count)
        return OK;
    a->before = malloc(sizeof *a->before * (size_t)a->room.corner_count);
    if (!a->before)
        return fail(ERR_MEMORY, "out of memory");
    return gpu_mesh_open(&a->walls, a->gpu, a->room.points[0], 3, a->room.point_count, NULL, a->room.corner_count);
}

void around_painter_room(struct around_painter *a, struct gpu_target *target, const struct part_map *viewer_from_room,
                         const struct room_hidden *hidden)
{
    const float range[4] = {NEAREST_M, FARTHEST_M, ROOM_BACK_M, 0}, none[4] = {0};
    const int count = a->walls ? room_before(&a->room, viewer_from_room, hidden, a->before) : 0;
    if (!count)
        return;
    gpu_mesh_write_indices(a->walls, 0, a->before, count);
    gpu_program_set(a->program, VIEWER_FROM_POINT, viewer_from_room->row[0], 3);
    gpu_program_set(a->program, VIEW_RANGE, range, 1);
    gpu_program_set(a->program, SHADOW, none, 1);
    gpu_draw(&(struct gpu_job){
        .target = target, .program = a->program, .mesh = a->walls, .depth_test = true, .count = count});
}

static void put_bone(float (*bone)[4], struct vec3 from, struct vec3 to, double radius)
{
    const struct vec3 ends[2] = {from, to};
    for (int e = 0; e < 2; e++) {
        bone[e][0] = (float)ends[e].x, bone[e][1] = (float)ends[e].y, bone[e][2] = (float)ends[e].z;
        bone[e][3] = e ? 0 : (float)radius;
    }
}

// Feet, which joints do not tell of, point to where the hips face.
static void put_feet(float (*bones)[4], const struct skeleton *s)
{
    static const enum joint feet[2] = {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT};
    struct vec3 across = v3_sub(s->joint[JOINT_LEFT_HIP], s->joint[JOINT_RIGHT_HIP]), front = v3(0, 0, 0);
    if (s->confidence[JOINT_LEFT_HIP] > 0 && s->confidence[JOINT_RIGHT_HIP] > 0)
        front = v3_unit(v3_cross(v3(across.x, across.y, 0), v3(0, 0, 1)));
    for (int f = 0; f < 2; f++) {
        struct vec3 heel = v3_sub(s->joint[feet[f]], v3(0, 0, ANKLE_M));
        if (s->confidence[feet[f]] > 0)
            put_bone(&bones[2 * f], heel, v3_add(heel, v3_scale(front, FOOT_M)), FOOT_RADIUS_M);
    }
}

void around_painter_shadow(struct around_painter *a, struct gpu_target *target, const struct around_view *view)
{
    const struct skeleton *skeleton = view->skeleton;
    float bones[2 * PART_COUNT + 4][4] = {{0}};
    struct vec3 low = v3(INFINITY, INFINITY, 0), high = v3(-INFINITY, -INFINITY, 0);
    for (int p = 0; p < PART_COUNT; p++) {
        struct vec3 ends[2] = {skeleton->joint[part_ends[p].from], skeleton->joint[part_ends[p].to]};
        if (!part_is_known(view->body, skeleton, (enum part)p))
            continue;
        put_bone(&bones[2 * p], ends[0], ends[1], view->body->radius_rate[p] * v3_distance(ends[0], ends[1]));
        for (int e = 0; e < 2; e++) {
            low = v3(fmin(low.x, ends[e].x), fmin(low.y, ends[e].y), 0);
            high = v3(fmax(high.x, ends[e].x), fmax(high.y, ends[e].y), 0);
        }
    }
    if (!(low.x <= high.x))
        return;
    put_feet(&bones[(size_t)2 * PART_COUNT], skeleton);
    double reach = fmax(high.x - low.x, high.y - low.y) / 2 + SHADOW_M;
    struct vec3 middle = v3_mix(low, high, 0.5);
    const struct pose viewer_from_world = pose_inverse(view->world_from_viewer);
    struct room_hidden hidden = {0};
    for (int i = 0; i < ROUND; i++) { // it fades out within a circle
        const double turn = 2 * PI * i / ROUND, r = reach / cos(PI / ROUND);
        const struct vec3 rim = v3(middle.x + r * cos(turn), middle.y + r * sin(turn), 0);
        room_hidden_add(&hidden, pose_apply(viewer_from_world, rim), FLOOR_M);
    }
    if (view->viewer_from_room)
        around_painter_room(a, target, view->viewer_from_room, &hidden);
    struct part_map world = {{{(float)reach, 0, 0, (float)middle.x}, {0, (float)reach, 0, (float)middle.y}, {0, 0, 1, 0}}};
    struct part_map map = part_map_of(viewer_from_world), viewer = part_map_multiply(&map, &world);
    const float range[4] = {NEAREST_M, FARTHEST_M, FLOOR_BACK_M, 0};
    const float shadow[4] = {(float)middle.x, (float)middle.y, (float)reach, DARK};
    gpu_program_set(a->program, VIEWER_FROM_POINT, viewer.row[0], 3);
    gpu_program_set(a->program, WORLD_FROM_POINT, world.row[0], 3);
    gpu_program_set(a->program, VIEW_RANGE, range, 1);
    gpu_program_set(a->program, BONES, bones[0], 2 * PART_COUNT + 4);
    gpu_program_set(a->program, SHADOW, shadow, 1);
    gpu_draw(&(struct gpu_job){.target = target, .program = a->program, .mesh = a->patch, .depth_test = true});
}
