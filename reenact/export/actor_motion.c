#include "reenact/export/actor_motion.h"

#include <stdlib.h>
#include <string.h>

const char *const bone_names[BONE_COUNT] = {
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

int bone_parent(int bone)
{
    for (int i = 0; i < BONE_LINKS; i++)
        if (bone_links[i].b == bone)
            return bone_links[i].a;
    return -1;
}

void bone_origins(const struct bind_pose *bind, struct vec3 origin[BONE_COUNT])
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

enum status bones_at_frame(const struct actor_export *a, int64_t frame, struct bone_transforms *out)
{
    struct track_sample sample;
    const int64_t since_ns = take_entry(a->take, frame)->time_ns - take_entry(a->take, 0)->time_ns;
    enum status status = skeleton_track_at(a->track, since_ns, true, &sample);
    if (status == OK && sample.frame != frame)
        status = NOTHING; // without a skeleton of its own
    struct bone_transforms joints;
    if (status == OK)
        status = bone_transforms_of(&a->avatar->bind_pose, &sample.skeleton, &joints);
    if (status != OK)
        return status;
    const struct bone_corrections corrections = avatar_corrections(a->avatar, frame);
    *out = bone_corrections_apply(&joints, &corrections);
    return OK;
}

static void add_key(struct actor_motion *m, const struct vec3 origin[BONE_COUNT], const struct bone_transforms *at)
{
    const int key = m->count;
    for (int b = 0; b < BONE_COUNT; b++) {
        const int parent = bone_parent(b);
        const struct pose node = {at->bone[b].rotation, pose_apply(at->bone[b], origin[b])};
        struct pose local = node;
        if (parent >= 0) {
            const struct pose above = {at->bone[parent].rotation, pose_apply(at->bone[parent], origin[parent])};
            local = pose_multiply(pose_inverse(above), node);
        }
        const struct quat q = quat_unit(local.rotation);
        float *rotation = m->rotation[b][key], *translation = m->translation[b][key];
        float along = 1;
        if (key) {
            const float *before = m->rotation[b][key - 1];
            along = (float)q.x * before[0] + (float)q.y * before[1] + (float)q.z * before[2] + (float)q.w * before[3];
        }
        const float sign = along < 0 ? -1 : 1;
        for (int k = 0; k < 4; k++)
            rotation[k] = sign * (float)(&q.x)[k];
        for (int k = 0; k < 3; k++)
            translation[k] = (float)(&local.translation.x)[k];
    }
}

static enum status motion_open(struct actor_motion *m, size_t frames)
{
    *m = (struct actor_motion){.time_s = malloc(frames * sizeof *m->time_s)};
    bool whole = m->time_s;
    for (int b = 0; b < BONE_COUNT; b++) {
        m->translation[b] = malloc(frames * sizeof *m->translation[b]);
        m->rotation[b] = malloc(frames * sizeof *m->rotation[b]);
        whole = whole && m->translation[b] && m->rotation[b];
    }
    return whole ? OK : fail(ERR_MEMORY, "no memory for the actor's motion");
}

enum status actor_motion_make(struct actor_motion *out, const struct actor_export *a)
{
    const int64_t frames = take_frame_count(a->take);
    struct vec3 origin[BONE_COUNT];
    bone_origins(&a->avatar->bind_pose, origin);
    enum status status = motion_open(out, (size_t)frames);
    for (int64_t i = 0; i < frames && status >= 0; i++) {
        struct bone_transforms at;
        status = bones_at_frame(a, i, &at);
        if (status != OK)
            continue;
        add_key(out, origin, &at);
        out->time_s[out->count++] = (float)seconds_at(a->take, i);
    }
    if (status >= 0)
        status = out->count ? OK : fail(ERR_INPUT, "the take shows no trunk of a person, so there is no motion");
    if (status != OK)
        actor_motion_free(out);
    return status;
}

void actor_motion_free(struct actor_motion *m)
{
    free(m->time_s);
    for (int b = 0; b < BONE_COUNT; b++) {
        free(m->translation[b]);
        free(m->rotation[b]);
    }
    *m = (struct actor_motion){0};
}
