#include "reenact/export/actor_export.h"

#include "base/text.h"
#include "formats/glb_builder.h"
#include "formats/ply.h"
#include "platform/files/png.h"
#include "reenact/export/viewer_page.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- actor motion, types

// The bones of the actor over a take, as nodes of a scene: each bone's node lies where the bone begins, below the node
// of the bone it hangs from. Of the avatar's own bones a node has the bind pose's axes; of an armature's, those of its
// T-pose. Internal to this folder. Pure.

enum { MOTION_BONES = ARMATURE_BONES };
_Static_assert((int)MOTION_BONES >= (int)BONE_COUNT, "room for both kinds of bones");

// Of each bone, of each known frame: its pose with respect to its parent's node; rotations go on from frame to frame
// without a change of sign.
struct actor_motion {
    int bones, root;
    const char *name[MOTION_BONES];
    int parent[MOTION_BONES];                // -1: the root
    struct vec3 origin[MOTION_BONES];        // where it begins in the mesh
    bool rests;                              // the mesh's pose is that of the nodes at rest
    int node_of[BONE_COUNT];                 // of the avatar's bones
    struct bone_transforms mesh_from_avatar; // from the avatar's bind pose into the mesh's
    int count;
    float *time_s;                         // [count]
    float (*translation[MOTION_BONES])[3]; // [count]
    float (*rotation[MOTION_BONES])[4];    // [count]; x, y, z, w
};

static void actor_motion_free(struct actor_motion *motion);

// ---------------------------------------------------------------- actor motion

static const char *const bone_names[BONE_COUNT] = {
    [PART_HEAD] = "head",
    [PART_UPPER_TORSO] = "upper_torso",
    [PART_LOWER_TORSO] = "lower_torso",
    [PART_LEFT_UPPER_ARM] = "left_upper_arm",
    [PART_LEFT_FOREARM] = "left_forearm",
    [PART_RIGHT_UPPER_ARM] = "right_upper_arm",
    [PART_RIGHT_FOREARM] = "right_forearm",
    [PART_LEFT_THIGH] = "left_thigh",
    [PART_LEFT_SHIN] = "left_shin",
    [PART_RIGHT_THIGH] = "right_thigh",
    [PART_RIGHT_SHIN] = "right_shin",
    [BONE_LEFT_FOOT] = "left_foot",
    [BONE_RIGHT_FOOT] = "right_foot",
    [BONE_LEFT_HAND] = "left_hand",
    [BONE_RIGHT_HAND] = "right_hand",
    [BONE_SKULL] = "skull",
};

// -1: the upper torso, which has none
static int bone_parent(int bone)
{
    for (int i = 0; i < BONE_LINKS; i++)
        if (bone_links[i].b == bone)
            return bone_links[i].a;
    return -1;
}

// Where each bone begins, bind-pose axes.
static void bone_origins(const struct bind_pose *bind, struct vec3 origin[BONE_COUNT])
{
    origin[PART_UPPER_TORSO] = bind->frame[PART_UPPER_TORSO].origin;
    for (int i = 0; i < BONE_LINKS; i++) { // from the trunk outwards
        const int bone = bone_links[i].b;
        origin[bone] = bind->known[bone] ? bind->frame[bone].origin : origin[bone_links[i].a];
    }
}

static double seconds_at(const struct take *take, int64_t frame)
{
    return (double)(take_entry(take, frame)->time_ns - take_entry(take, 0)->time_ns) * 1e-9;
}

// The bones at a frame, from the bind pose into the world. NOTHING: not known.
static enum status bones_at_frame(const struct actor_export *export, int64_t frame, struct bone_transforms *out)
{
    struct track_sample sample;
    const int64_t since_ns = take_entry(export->take, frame)->time_ns - take_entry(export->take, 0)->time_ns;
    enum status status = skeleton_track_at(export->track, since_ns, true, &sample);
    if (status == OK && sample.frame != frame)
        status = NOTHING; // without a skeleton of its own
    struct bone_transforms joints;
    if (status == OK)
        status = bone_transforms_of(&export->avatar->bind_pose, &sample.skeleton, &joints);
    if (status != OK)
        return status;
    const struct bone_corrections corrections = avatar_corrections(export->avatar, frame);
    *out = bone_corrections_apply(&joints, &corrections);
    return OK;
}

static void add_pose(struct actor_motion *motion, int bone, struct pose local)
{
    const int key = motion->count;
    const struct quat q = quat_unit(local.rotation);
    float *rotation = motion->rotation[bone][key], *translation = motion->translation[bone][key];
    float along = 1;
    if (key) {
        const float *before = motion->rotation[bone][key - 1];
        along = (float)q.x * before[0] + (float)q.y * before[1] + (float)q.z * before[2] + (float)q.w * before[3];
    }
    const float sign = along < 0 ? -1 : 1;
    for (int k = 0; k < 4; k++)
        rotation[k] = sign * (float)(&q.x)[k];
    for (int k = 0; k < 3; k++)
        translation[k] = (float)(&local.translation.x)[k];
}

static void add_key(struct actor_motion *motion, const struct bone_transforms *at)
{
    for (int b = 0; b < BONE_COUNT; b++) {
        const int parent = motion->parent[b];
        const struct pose node = {at->bone[b].rotation, pose_apply(at->bone[b], motion->origin[b])};
        struct pose local = node;
        if (parent >= 0) {
            const struct pose above = {at->bone[parent].rotation, pose_apply(at->bone[parent], motion->origin[parent])};
            local = pose_multiply(pose_inverse(above), node);
        }
        add_pose(motion, b, local);
    }
}

static enum status motion_open(struct actor_motion *motion, size_t frames)
{
    bool whole = (motion->time_s = malloc(frames * sizeof *motion->time_s)) != NULL;
    for (int b = 0; b < motion->bones; b++) {
        motion->translation[b] = malloc(frames * sizeof *motion->translation[b]);
        motion->rotation[b] = malloc(frames * sizeof *motion->rotation[b]);
        whole = whole && motion->translation[b] && motion->rotation[b];
    }
    return whole ? OK : fail(ERR_MEMORY, "no memory for the actor's motion");
}

static void set_own_bones(struct actor_motion *out, const struct bind_pose *bind)
{
    out->bones = BONE_COUNT;
    out->root = PART_UPPER_TORSO;
    bone_origins(bind, out->origin);
    for (int b = 0; b < BONE_COUNT; b++) {
        out->name[b] = bone_names[b];
        out->parent[b] = bone_parent(b);
        out->node_of[b] = b;
        out->mesh_from_avatar.bone[b] = POSE_IDENTITY;
    }
}

// ERR_INPUT, ERR_MEMORY
static enum status own_motion_make(struct actor_motion *out, const struct actor_export *export)
{
    const int64_t frames = take_frame_count(export->take);
    set_own_bones(out, &export->avatar->bind_pose);
    enum status status = motion_open(out, (size_t)frames);
    for (int64_t i = 0; i < frames && status >= 0; i++) {
        struct bone_transforms at;
        status = bones_at_frame(export, i, &at);
        if (status != OK)
            continue;
        add_key(out, &at);
        out->time_s[out->count++] = (float)seconds_at(export->take, i);
    }
    return status;
}

// ---------------------------------------------------------------- the motion of an armature

static const struct quat Y_UP_FROM_WORLD = {-0.70710678118654752, 0, 0, 0.70710678118654752};

static const int armature_bone_of[BONE_COUNT] = {
    [PART_HEAD] = ARMATURE_NECK,
    [PART_UPPER_TORSO] = ARMATURE_CHEST,
    [PART_LOWER_TORSO] = ARMATURE_HIPS,
    [PART_LEFT_UPPER_ARM] = ARMATURE_LEFT_UPPER_ARM,
    [PART_LEFT_FOREARM] = ARMATURE_LEFT_FOREARM,
    [PART_RIGHT_UPPER_ARM] = ARMATURE_RIGHT_UPPER_ARM,
    [PART_RIGHT_FOREARM] = ARMATURE_RIGHT_FOREARM,
    [PART_LEFT_THIGH] = ARMATURE_LEFT_THIGH,
    [PART_LEFT_SHIN] = ARMATURE_LEFT_SHIN,
    [PART_RIGHT_THIGH] = ARMATURE_RIGHT_THIGH,
    [PART_RIGHT_SHIN] = ARMATURE_RIGHT_SHIN,
    [BONE_LEFT_FOOT] = ARMATURE_LEFT_FOOT,
    [BONE_RIGHT_FOOT] = ARMATURE_RIGHT_FOOT,
    [BONE_LEFT_HAND] = ARMATURE_LEFT_HAND,
    [BONE_RIGHT_HAND] = ARMATURE_RIGHT_HAND,
    [BONE_SKULL] = ARMATURE_HEAD,
};

// The joints that the bones have at each known frame, y up; frame: [count] which one it is.
static enum status read_joints(const struct actor_export *export, struct markers *out, int64_t *frame)
{
    const int64_t frames = take_frame_count(export->take);
    enum status status = OK;
    for (int64_t i = 0; i < frames && status >= 0; i++) {
        struct bone_transforms at;
        status = bones_at_frame(export, i, &at);
        if (status != OK)
            continue;
        const struct skeleton s = bone_transforms_skeleton(&export->avatar->bind_pose, &at);
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = quat_rotate(Y_UP_FROM_WORLD, s.joint[j]);
            for (int k = 0; k < 3; k++)
                out->at[out->count][j][k] = s.confidence[j] > 0 ? (float)(&p.x)[k] : NAN;
        }
        frame[out->count++] = i;
    }
    return status < 0 ? status : OK;
}

// From the armature's axes at rest into the bind pose's, of a part.
static struct quat bind_from_rest(const struct bind_pose *bind, const struct armature *armature, int part)
{
    return quat_multiply(bone_frame_rotation(&bind->frame[part]), quat_conjugate(armature->part_rest[part]));
}

// Every bone at rest: about its part's first joint, which lies where the armature has it.
static void set_rest(struct actor_motion *out, const struct bind_pose *bind, const struct armature *armature)
{
    struct vec3 at[JOINT_COUNT];
    for (int b = 0; b < ARMATURE_BONES; b++)
        if (armature_joint((enum armature_bone)b) < JOINT_COUNT)
            at[armature_joint((enum armature_bone)b)] = armature->rest[b];
    for (int b = 0; b < BONE_COUNT; b++) {
        const int part = (int)bone_part(b);
        const struct quat rotation = quat_conjugate(bind_from_rest(bind, armature, part));
        const struct vec3 moved = quat_rotate(rotation, bind->frame[part].origin);
        out->mesh_from_avatar.bone[b] = (struct pose){rotation, v3_sub(at[part_ends[part].from], moved)};
    }
    for (int i = 0; i < BONE_LINKS; i++) // from the trunk outwards
        if (!bind->known[bone_part(bone_links[i].b)])
            out->mesh_from_avatar.bone[bone_links[i].b] = out->mesh_from_avatar.bone[bone_links[i].a];
}

static void set_armature_bones(struct actor_motion *out, const struct armature *armature, enum armature_naming naming)
{
    out->bones = ARMATURE_BONES;
    out->root = ARMATURE_HIPS;
    out->rests = true;
    for (int b = 0; b < ARMATURE_BONES; b++) {
        out->name[b] = armature_bone_name(naming, (enum armature_bone)b);
        out->parent[b] = armature_parent((enum armature_bone)b);
        out->origin[b] = armature->rest[b];
    }
    memcpy(out->node_of, armature_bone_of, sizeof out->node_of);
}

static enum status add_armature_keys(struct actor_motion *out, const struct actor_export *export,
                                     const struct armature *armature, const struct markers *joints,
                                     const int64_t *frame)
{
    const struct bind_pose *bind = &export->avatar->bind_pose;
    struct armature_pose pose = {.known = false};
    for (int64_t i = 0; i < joints->count; i++) {
        struct bone_transforms at;
        struct armature_parts parts;
        const enum status status = bones_at_frame(export, frame[i], &at);
        if (status != OK)
            return status;
        for (int p = 0; p < PART_COUNT; p++) {
            parts.known[p] = bind->known[p];
            parts.rotation[p] =
                quat_multiply(quat_multiply(Y_UP_FROM_WORLD, at.bone[p].rotation), bind_from_rest(bind, armature, p));
        }
        armature_pose_move(&pose, armature, &parts, joints->at[i][0]);
        for (int b = 0; b < ARMATURE_BONES; b++)
            add_pose(out, b, (struct pose){pose.rotation[b], b == ARMATURE_HIPS ? pose.root : armature->offset[b]});
        out->time_s[out->count++] = (float)seconds_at(export->take, frame[i]);
    }
    return OK;
}

// ERR_INPUT, ERR_MEMORY
static enum status armature_motion_make(struct actor_motion *out, const struct actor_export *export)
{
    const size_t frames = (size_t)take_frame_count(export->take);
    struct markers joints = {.at = malloc(frames * sizeof *joints.at)};
    int64_t *frame = malloc(frames * sizeof *frame);
    struct armature armature;
    enum status status = joints.at && frame ? OK : fail(ERR_MEMORY, "no memory for the actor's motion");
    if (status == OK)
        status = read_joints(export, &joints, frame);
    if (status == OK && joints.count)
        status = armature_make(&armature, &joints);
    if (status == OK && joints.count) {
        set_armature_bones(out, &armature, *export->armature);
        set_rest(out, &export->avatar->bind_pose, &armature);
        status = motion_open(out, frames);
    }
    if (status == OK && joints.count)
        status = add_armature_keys(out, export, &armature, &joints, frame);
    free(frame);
    markers_free(&joints);
    return status;
}

// ERR_INPUT, ERR_MEMORY
static enum status actor_motion_make(struct actor_motion *out, const struct actor_export *export)
{
    *out = (struct actor_motion){.count = 0};
    enum status status = export->armature ? armature_motion_make(out, export) : own_motion_make(out, export);
    if (status >= 0)
        status = out->count ? OK : fail(ERR_INPUT, "the take shows no trunk of a person, so there is no motion");
    if (status != OK)
        actor_motion_free(out);
    return status;
}

static void actor_motion_free(struct actor_motion *motion)
{
    free(motion->time_s);
    for (int b = 0; b < MOTION_BONES; b++) {
        free(motion->translation[b]);
        free(motion->rotation[b]);
    }
    *motion = (struct actor_motion){0};
}

// ---------------------------------------------------------------- actor mesh

// The avatar's surface at one instant, as PLY.

// A linear colour (vertex_color.h) as a byte.
static uint8_t byte_of(float linear)
{
    const float encoded = sqrtf(fmaxf(0, linear));
    return (uint8_t)(fminf(1, encoded) * 255 + 0.5F);
}

enum status actor_export_mesh_ply(const struct actor_export *export, int64_t frame, FILE *out)
{
    const struct surface_mesh *s = &export->avatar->surface;
    struct bone_transforms at;
    struct ply ply = {0};
    enum status status = bones_at_frame(export, frame, &at);
    for (int i = 0; i < s->point_count && status == OK; i++) {
        const float *color = export->avatar->vertex_colors.color[i];
        const uint8_t rgb[3] = {byte_of(color[0]), byte_of(color[1]), byte_of(color[2])};
        struct vec3 p, n;
        linear_blend_skin(&export->avatar->skins[i], &at, s->points[i], s->normals[i], &p, &n);
        status = ply_add_point(&ply, p, rgb);
    }
    for (int i = 0; i < s->corner_count && status == OK; i += 3)
        status = ply_add_triangle(&ply, s->corners[i], s->corners[i + 1], s->corners[i + 2]);
    if (status == OK)
        ply_print(&ply, "world axes, z up", out);
    ply_free(&ply);
    return status;
}

// ---------------------------------------------------------------- actor gltf

// The actor as glTF 2.0.

// Nodes: the bones have their own numbers; then come the actor, who holds them, and the mesh.
static int actor_node(const struct actor_motion *motion) { return motion->bones; }
static int mesh_node(const struct actor_motion *motion) { return motion->bones + 1; }

enum { WEIGHTS = 4 };
_Static_assert((int)SKIN_BONES <= (int)WEIGHTS, "glTF has four weights a vertex");

struct vertex_arrays {
    float (*position)[3], (*normal)[3], (*uv)[2], (*weights)[WEIGHTS];
    uint8_t (*joints)[WEIGHTS];
};

// Bones without weight are 0, as the specification wants it, and the weights add up to 1 in single precision.
static void put_weights(const struct skin_weights *skin, const int node_of[BONE_COUNT], uint8_t joints[WEIGHTS],
                        float weights[WEIGHTS])
{
    float rest = 1;
    memset(joints, 0, WEIGHTS * sizeof *joints);
    memset(weights, 0, WEIGHTS * sizeof *weights);
    for (int k = SKIN_BONES - 1; k > 0; k--)
        if (skin->weight[k] > 0) {
            joints[k] = (uint8_t)node_of[skin->bone[k]];
            weights[k] = skin->weight[k];
            rest -= weights[k];
        }
    joints[0] = (uint8_t)node_of[skin->bone[0]];
    weights[0] = rest;
    for (int k = 1; k < SKIN_BONES; k++)
        if (weights[k] > 0 && joints[k] == joints[0]) {
            weights[0] += weights[k];
            weights[k] = 0;
            joints[k] = 0;
        }
}

static void fill_vertices(const struct vertex_arrays *arrays, const struct avatar *avatar,
                          const struct actor_motion *motion)
{
    const struct texture_atlas *atlas = &avatar->atlas;
    for (int i = 0; i < atlas->mesh.point_count; i++) {
        const struct skin_weights *skin = &avatar->skins[atlas->mesh.points[i]];
        struct vec3 at = atlas->points[i], n = v3_unit(atlas->normals[i]);
        if (motion->rests)
            linear_blend_skin(skin, &motion->mesh_from_avatar, atlas->points[i], n, &at, &n);
        if (!(v3_length(n) > 0))
            n = v3(0, 0, 1);
        for (int k = 0; k < 3; k++) {
            arrays->position[i][k] = (float)(&at.x)[k];
            arrays->normal[i][k] = (float)(&n.x)[k];
        }
        arrays->uv[i][0] = atlas->mesh.at[i][0] / (float)atlas->mesh.width;
        arrays->uv[i][1] = atlas->mesh.at[i][1] / (float)atlas->mesh.height;
        put_weights(skin, motion->node_of, arrays->joints[i], arrays->weights[i]);
    }
}

static void add_vertices(struct glb *glb, struct json *attributes, const struct vertex_arrays *arrays, int n)
{
    const struct glb_layout position = {GLB_FLOAT, 3, n, GLB_VERTICES, true},
                            normal = {GLB_FLOAT, 3, n, GLB_VERTICES, false},
                            uv = {GLB_FLOAT, 2, n, GLB_VERTICES, false}, joints = {GLB_U8, 4, n, GLB_VERTICES, false},
                            weights = {GLB_FLOAT, 4, n, GLB_VERTICES, false};
    json_add_number(attributes, "POSITION", glb_add_accessor(glb, arrays->position, &position));
    json_add_number(attributes, "NORMAL", glb_add_accessor(glb, arrays->normal, &normal));
    json_add_number(attributes, "TEXCOORD_0", glb_add_accessor(glb, arrays->uv, &uv));
    json_add_number(attributes, "JOINTS_0", glb_add_accessor(glb, arrays->joints, &joints));
    json_add_number(attributes, "WEIGHTS_0", glb_add_accessor(glb, arrays->weights, &weights));
}

static enum status add_mesh(struct glb *glb, const struct avatar *avatar, const struct actor_motion *motion)
{
    const struct uv_mesh *m = &avatar->atlas.mesh;
    const size_t n = (size_t)m->point_count;
    struct vertex_arrays v = {malloc(n * sizeof *v.position), malloc(n * sizeof *v.normal), malloc(n * sizeof *v.uv),
                              malloc(n * sizeof *v.weights), malloc(n * sizeof *v.joints)};
    enum status status = OK;
    if (v.position && v.normal && v.uv && v.weights && v.joints) {
        struct json *mesh = json_add_object(json_add_array(glb->root, "meshes"), NULL);
        struct json *primitive = json_add_object(json_add_array(mesh, "primitives"), NULL);
        fill_vertices(&v, avatar, motion);
        add_vertices(glb, json_add_object(primitive, "attributes"), &v, m->point_count);
        const struct glb_layout corners = {GLB_U32, 1, m->corner_count, GLB_INDICES, false};
        json_add_number(primitive, "indices", glb_add_accessor(glb, m->corners, &corners));
        json_add_number(primitive, "material", 0);
        json_add_string(mesh, "name", "actor");
    } else {
        status = fail(ERR_MEMORY, "no memory for a glTF file");
    }
    free(v.position);
    free(v.normal);
    free(v.uv);
    free(v.weights);
    free(v.joints);
    return status;
}

static enum status add_material(struct glb *glb, const struct texture_atlas *atlas)
{
    enum { REPEAT_NOT = 33071, LINEAR = 9729 };
    uint8_t *png;
    size_t count;
    enum status status = png_encode(&(struct png_layout){PNG_RGB8, atlas->mesh.width, atlas->mesh.height}, atlas->color,
                                    6, &png, &count);
    if (status != OK)
        return status;
    struct json *image = json_add_object(json_add_array(glb->root, "images"), NULL);
    json_add_number(image, "bufferView", glb_add_view(glb, png, count, GLB_NO_TARGET));
    json_add_string(image, "mimeType", "image/png");
    free(png);
    struct json *sampler = json_add_object(json_add_array(glb->root, "samplers"), NULL);
    json_add_number(sampler, "magFilter", LINEAR);
    json_add_number(sampler, "minFilter", LINEAR); // charts lie two texels apart: coarser levels would mix them
    json_add_number(sampler, "wrapS", REPEAT_NOT);
    json_add_number(sampler, "wrapT", REPEAT_NOT);
    struct json *texture = json_add_object(json_add_array(glb->root, "textures"), NULL);
    json_add_number(texture, "source", 0);
    json_add_number(texture, "sampler", 0);
    struct json *material = json_add_object(json_add_array(glb->root, "materials"), NULL);
    struct json *surface = json_add_object(material, "pbrMetallicRoughness");
    json_add_number(json_add_object(surface, "baseColorTexture"), "index", 0);
    json_add_number(surface, "metallicFactor", 0);
    json_add_number(surface, "roughnessFactor", 1);
    json_add_object(json_add_object(material, "extensions"), "KHR_materials_unlit");
    json_add_string(json_add_array(glb->root, "extensionsUsed"), NULL, "KHR_materials_unlit");
    return OK;
}

static void push_floats(struct json *array, const float *values, int count)
{
    for (int i = 0; i < count; i++)
        json_push_number(array, (double)values[i]);
}

static void add_bone(struct json *nodes, int bone, const struct actor_motion *motion)
{
    struct json *node = json_add_object(nodes, NULL), *children = NULL;
    const struct vec3 from = motion->parent[bone] < 0 ? v3(0, 0, 0) : motion->origin[motion->parent[bone]];
    const struct vec3 offset = v3_sub(motion->origin[bone], from);
    const float at[3] = {(float)offset.x, (float)offset.y, (float)offset.z};
    json_add_string(node, "name", motion->name[bone]);
    push_floats(json_add_array(node, "translation"), motion->rests ? at : motion->translation[bone][0], 3);
    if (!motion->rests)
        push_floats(json_add_array(node, "rotation"), motion->rotation[bone][0], 4);
    for (int b = 0; b < motion->bones; b++)
        if (motion->parent[b] == bone) {
            if (!children)
                children = json_add_array(node, "children");
            json_push_number(children, b);
        }
}

static void add_scene(struct glb *glb, const struct actor_export *export, const struct actor_motion *motion)
{
    static const float y_up_from_z_up[4] = {-0.70710678F, 0, 0, 0.70710678F};
    struct json *nodes = json_add_array(glb->root, "nodes");
    for (int b = 0; b < motion->bones; b++)
        add_bone(nodes, b, motion);
    struct json *actor = json_add_object(nodes, NULL), *mesh = json_add_object(nodes, NULL);
    json_add_string(actor, "name", export->name);
    if (!motion->rests)
        push_floats(json_add_array(actor, "rotation"), y_up_from_z_up, 4);
    json_push_number(json_add_array(actor, "children"), motion->root);
    json_add_string(mesh, "name", "surface");
    json_add_number(mesh, "mesh", 0);
    json_add_number(mesh, "skin", 0);
    json_add_number(glb->root, "scene", 0);
    struct json *roots = json_add_array(json_add_object(json_add_array(glb->root, "scenes"), NULL), "nodes");
    json_push_number(roots, actor_node(motion));
    json_push_number(roots, mesh_node(motion));
}

static void add_skin(struct glb *glb, const struct actor_motion *motion)
{
    float inverse[MOTION_BONES][16]; // column by column
    struct json *skin = json_add_object(json_add_array(glb->root, "skins"), NULL);
    struct json *joints = json_add_array(skin, "joints");
    for (int b = 0; b < motion->bones; b++) {
        const struct vec3 o = motion->origin[b];
        memcpy(inverse[b],
               (const float[16]){1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -(float)o.x, -(float)o.y, -(float)o.z, 1},
               sizeof inverse[b]);
        json_push_number(joints, b);
    }
    json_add_number(skin, "skeleton", actor_node(motion));
    const struct glb_layout layout = {GLB_FLOAT, 16, motion->bones, GLB_NO_TARGET, false};
    json_add_number(skin, "inverseBindMatrices", glb_add_accessor(glb, inverse, &layout));
}

static void add_channel(struct json *channels, int sampler, int bone, const char *path)
{
    struct json *channel = json_add_object(channels, NULL);
    json_add_number(channel, "sampler", sampler);
    struct json *target = json_add_object(channel, "target");
    json_add_number(target, "node", bone);
    json_add_string(target, "path", path);
}

static void add_sampler(struct json *samplers, int times, int values)
{
    struct json *sampler = json_add_object(samplers, NULL);
    json_add_number(sampler, "input", times);
    json_add_number(sampler, "output", values);
    json_add_string(sampler, "interpolation", "LINEAR");
}

static void add_animation(struct glb *glb, const struct actor_export *export, const struct actor_motion *motion)
{
    struct json *animation = json_add_object(json_add_array(glb->root, "animations"), NULL);
    json_add_string(animation, "name", export->name);
    struct json *samplers = json_add_array(animation, "samplers"), *channels = json_add_array(animation, "channels");
    const struct glb_layout times = {GLB_FLOAT, 1, motion->count, GLB_NO_TARGET, true},
                            translations = {GLB_FLOAT, 3, motion->count, GLB_NO_TARGET, false},
                            rotations = {GLB_FLOAT, 4, motion->count, GLB_NO_TARGET, false};
    const int at = glb_add_accessor(glb, motion->time_s, &times);
    for (int b = 0; b < motion->bones; b++) {
        if (!motion->rests || b == motion->root) {
            add_channel(channels, json_count(samplers), b, "translation");
            add_sampler(samplers, at, glb_add_accessor(glb, motion->translation[b], &translations));
        }
        add_channel(channels, json_count(samplers), b, "rotation");
        add_sampler(samplers, at, glb_add_accessor(glb, motion->rotation[b], &rotations));
    }
}

enum status actor_export_glb(const struct actor_export *export, uint8_t **bytes, size_t *count)
{
    struct actor_motion motion;
    struct glb g = {0};
    enum status status = actor_motion_make(&motion, export);
    if (status != OK)
        return status;
    glb_open(&g);
    status = add_mesh(&g, export->avatar, &motion);
    if (status == OK)
        status = add_material(&g, &export->avatar->atlas);
    if (status == OK) {
        add_scene(&g, export, &motion);
        add_skin(&g, &motion);
        add_animation(&g, export, &motion);
        status = glb_print(&g, bytes, count);
    }
    glb_close(&g);
    actor_motion_free(&motion);
    return status;
}

// ---------------------------------------------------------------- viewer page

// The viewer page: viewer.html, embedded at build time, with the title and the model put in.

void actor_export_page(const char *name, const uint8_t *glb, size_t count, FILE *out)
{
    static const char title[] = "@TITLE@", model[] = "@MODEL@";
    for (const char *at = viewer_page; *at;) {
        if (!strncmp(at, title, sizeof title - 1)) {
            html_put_text(out, name);
            at += sizeof title - 1;
        } else if (!strncmp(at, model, sizeof model - 1)) {
            html_put_base64(out, glb, count);
            at += sizeof model - 1;
        } else {
            fputc(*at++, out);
        }
    }
}
