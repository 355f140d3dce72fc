#include "formats/bvh_reader.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { MAX_JOINTS = 512, MAX_DEPTH = 128, NAME_BYTES = 48 };

enum channel { X_POSITION, Y_POSITION, Z_POSITION, X_ROTATION, Y_ROTATION, Z_ROTATION };

struct bvh_joint {
    char name[NAME_BYTES];
    int parent; // -1: a root
    struct vec3 offset;
    int channel_count, first_channel;
    enum channel channel[6];
};

struct bvh {
    struct bvh_joint *joints;
    int joint_count, channel_count, frame_count;
    double frame_s;
    double *values; // frame_count x channel_count
};

// The remaining text, read word by word.
struct word_reader {
    const char *name, *at, *end;
    int line;
    char word[NAME_BYTES];
};

// False at the end of the text. Words longer than the buffer are cut; no known keyword or joint name is.
static bool next_word(struct word_reader *w)
{
    while (w->at < w->end && isspace((unsigned char)*w->at))
        w->line += *w->at++ == '\n';
    size_t n = 0;
    while (w->at < w->end && *w->at && !isspace((unsigned char)*w->at)) {
        if (n + 1 < sizeof w->word)
            w->word[n++] = *w->at;
        w->at++;
    }
    w->word[n] = 0;
    return n > 0;
}

static enum status cut(const struct word_reader *w)
{
    return fail(ERR_INPUT, "%s, line %d: the motion file ends in the middle; get a whole one", w->name, w->line);
}

static enum status need_word(struct word_reader *w, const char *wanted)
{
    if (!next_word(w))
        return cut(w);
    if (strcasecmp(w->word, wanted))
        return fail(ERR_INPUT, "%s, line %d: '%s' stands where a BVH file has '%s'", w->name, w->line, w->word, wanted);
    return OK;
}

static enum status need_number(struct word_reader *w, const char *what, double *out)
{
    if (!next_word(w))
        return cut(w);
    char *end;
    *out = strtod(w->word, &end);
    if (end == w->word || *end)
        return fail(ERR_INPUT, "%s, line %d: '%s' stands where %s belongs", w->name, w->line, w->word, what);
    if (!isfinite(*out) || fabs(*out) > 1e9)
        return fail(ERR_INPUT, "%s, line %d: %s is '%s', which is no usable number", w->name, w->line, what, w->word);
    return OK;
}

static enum status need_count(struct word_reader *w, const char *what, int most, int *out)
{
    double number;
    enum status status = need_number(w, what, &number);
    if (status)
        return status;
    if (number < 0 || number > most || number != floor(number))
        return fail(ERR_INPUT, "%s, line %d: %s is %s, not a whole number up to %d", w->name, w->line, what, w->word,
                    most);
    *out = (int)number;
    return OK;
}

static enum status read_offset(struct word_reader *w, struct vec3 *out)
{
    enum status status = need_number(w, "an offset", &out->x);
    if (!status)
        status = need_number(w, "an offset", &out->y);
    if (!status)
        status = need_number(w, "an offset", &out->z);
    return status;
}

static enum status read_channels(struct word_reader *w, struct bvh *b, struct bvh_joint *joint)
{
    static const char *const names[] = {"Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"};
    enum status status = need_count(w, "the number of channels", 6, &joint->channel_count);
    if (status)
        return status;
    joint->first_channel = b->channel_count;
    b->channel_count += joint->channel_count;
    for (int c = 0; c < joint->channel_count; c++) {
        if (!next_word(w))
            return cut(w);
        int known = -1;
        for (int n = 0; n < 6; n++)
            if (!strcasecmp(w->word, names[n]))
                known = n;
        if (known < 0)
            return fail(ERR_INPUT, "%s, line %d: '%s' is no channel of a BVH file", w->name, w->line, w->word);
        joint->channel[c] = (enum channel)known;
    }
    return OK;
}

// ROOT name { OFFSET … CHANNELS … JOINT … End Site { OFFSET … } }, without recursion:
// stack[depth] is the joint whose braces are open, -1 an end site.
static enum status read_hierarchy(struct word_reader *w, struct bvh *b)
{
    int stack[MAX_DEPTH], depth = 0;
    bool opens = false; // a joint was named, its brace must follow
    int named = -1;
    for (;;) {
        if (!next_word(w))
            return cut(w);
        int open = depth ? stack[depth - 1] : -1;
        if (opens != !strcmp(w->word, "{"))
            return fail(ERR_INPUT, "%s, line %d: a brace is missing or out of place", w->name, w->line);
        if (opens) {
            if (depth == MAX_DEPTH)
                return fail(ERR_INPUT, "%s, line %d: joints nest deeper than %d", w->name, w->line, MAX_DEPTH);
            stack[depth++] = named;
            opens = false;
        } else if (!strcasecmp(w->word, "ROOT") || !strcasecmp(w->word, "JOINT")) {
            if ((depth == 0) != !strcasecmp(w->word, "ROOT") || (depth && open < 0))
                return fail(ERR_INPUT, "%s, line %d: a %s cannot stand here", w->name, w->line, w->word);
            if (b->joint_count == MAX_JOINTS)
                return fail(ERR_INPUT, "%s, line %d: more than %d joints", w->name, w->line, MAX_JOINTS);
            if (!next_word(w))
                return cut(w);
            struct bvh_joint *joint = &b->joints[b->joint_count];
            memcpy(joint->name, w->word, sizeof joint->name);
            joint->parent = open;
            joint->first_channel = b->channel_count;
            named = b->joint_count++;
            opens = true;
        } else if (!strcasecmp(w->word, "End") && open >= 0) {
            enum status status = need_word(w, "Site");
            if (status)
                return status;
            named = -1;
            opens = true;
        } else if (!strcasecmp(w->word, "OFFSET") && depth) {
            struct vec3 ignored;
            enum status status = read_offset(w, open >= 0 ? &b->joints[open].offset : &ignored);
            if (status)
                return status;
        } else if (!strcasecmp(w->word, "CHANNELS") && open >= 0 && !b->joints[open].channel_count) {
            enum status status = read_channels(w, b, &b->joints[open]);
            if (status)
                return status;
        } else if (!strcmp(w->word, "}") && depth) {
            depth--;
        } else if (!strcasecmp(w->word, "MOTION") && !depth && b->joint_count) {
            return OK;
        } else {
            return fail(ERR_INPUT, "%s, line %d: '%s' cannot stand here", w->name, w->line, w->word);
        }
    }
}

static enum status read_frames(struct word_reader *w, struct bvh *b)
{
    enum status status = need_word(w, "Frames:");
    if (!status)
        status = need_count(w, "the number of frames", 1000000, &b->frame_count);
    if (!status)
        status = need_word(w, "Frame");
    if (!status)
        status = need_word(w, "Time:");
    if (!status)
        status = need_number(w, "the frame time", &b->frame_s);
    if (status)
        return status;
    if (!(b->frame_s > 1e-5))
        return fail(ERR_INPUT, "%s, line %d: its frame time is %g s, so its frames have no times; write seconds there",
                    w->name, w->line, b->frame_s);
    if (b->frame_count < 1 || b->frame_s > 10 || b->channel_count < 3)
        return fail(ERR_INPUT, "%s, line %d: %d frames of %d channels, %g s apart, are no motion", w->name, w->line,
                    b->frame_count, b->channel_count, b->frame_s);
    // Every number takes at least two bytes: a header that promises more is invalid and must not cause an allocation.
    size_t numbers = (size_t)b->frame_count * (size_t)b->channel_count;
    if (numbers > (size_t)(w->end - w->at))
        return cut(w);
    b->values = malloc(numbers * sizeof *b->values);
    if (!b->values)
        return fail(ERR_MEMORY, "out of memory for the motion of %s", w->name);
    for (size_t i = 0; i < numbers; i++)
        if ((status = need_number(w, "a channel's value", &b->values[i])))
            return status;
    return OK;
}

enum status bvh_parse(struct bvh **out, const char *name, const uint8_t *bytes, size_t count)
{
    *out = NULL;
    struct bvh *b = calloc(1, sizeof *b);
    if (b)
        b->joints = calloc(MAX_JOINTS, sizeof *b->joints);
    if (!b || !b->joints) {
        bvh_free(&b);
        return fail(ERR_MEMORY, "out of memory for the motion of %s", name);
    }
    struct word_reader w = {name, (const char *)bytes, (const char *)bytes + count, 1, ""};
    enum status status = need_word(&w, "HIERARCHY");
    if (!status)
        status = read_hierarchy(&w, b);
    if (!status)
        status = read_frames(&w, b);
    if (status) {
        bvh_free(&b);
        return status;
    }
    *out = b;
    return OK;
}

void bvh_free(struct bvh **b)
{
    if (*b) {
        free((*b)->joints);
        free((*b)->values);
        free(*b);
        *b = NULL;
    }
}

int bvh_joint_count(const struct bvh *b) { return b->joint_count; }
const char *bvh_joint_name(const struct bvh *b, int joint) { return b->joints[joint].name; }
int bvh_frame_count(const struct bvh *b) { return b->frame_count; }
double bvh_frame_s(const struct bvh *b) { return b->frame_s; }

int bvh_find(const struct bvh *b, const char *name)
{
    for (int j = 0; j < b->joint_count; j++)
        if (!strcasecmp(b->joints[j].name, name))
            return j;
    return -1;
}

void bvh_positions(const struct bvh *b, int frame, struct vec3 *positions)
{
    assert(frame >= 0 && frame < b->frame_count);
    const double *values = b->values + (size_t)frame * (size_t)b->channel_count;
    struct pose world_from[MAX_JOINTS];        // 28 KiB
    for (int j = 0; j < b->joint_count; j++) { // parents come before their children
        const struct bvh_joint *joint = &b->joints[j];
        struct pose local = {{0, 0, 0, 1}, joint->offset};
        for (int c = 0; c < joint->channel_count; c++) {
            double v = values[joint->first_channel + c], angle = v * 3.14159265358979323846 / 180;
            const bool root = joint->parent < 0; // moves from its offset; other joints' positions replace theirs
            switch (joint->channel[c]) {         // rotations apply from the last one named to the first
            case X_POSITION: local.translation.x = v + (root ? joint->offset.x : 0); break;
            case Y_POSITION: local.translation.y = v + (root ? joint->offset.y : 0); break;
            case Z_POSITION: local.translation.z = v + (root ? joint->offset.z : 0); break;
            case X_ROTATION:
                local.rotation = quat_multiply(local.rotation, quat_from_rotation_vector(v3(angle, 0, 0)));
                break;
            case Y_ROTATION:
                local.rotation = quat_multiply(local.rotation, quat_from_rotation_vector(v3(0, angle, 0)));
                break;
            case Z_ROTATION:
                local.rotation = quat_multiply(local.rotation, quat_from_rotation_vector(v3(0, 0, angle)));
                break;
            }
        }
        world_from[j] = joint->parent >= 0 ? pose_multiply(world_from[joint->parent], local) : local;
        positions[j] = world_from[j].translation;
    }
}
