#include "compare/not_judged.h"

#include "compare/findings.h"

#include <stdio.h>
#include <string.h>

// Joints as people say them; of those that are there twice the left one is listed.
static const struct {
    enum joint joint;
    const char *one, *two; // two NULL: there is one only
} names[] = {
    {JOINT_HEAD, "head", NULL},
    {JOINT_NECK, "neck", NULL},
    {JOINT_LEFT_SHOULDER, "shoulder", "shoulders"},
    {JOINT_LEFT_ELBOW, "elbow", "elbows"},
    {JOINT_LEFT_HAND, "hand", "hands"},
    {JOINT_TORSO, "torso", NULL},
    {JOINT_WAIST, "waist", NULL},
    {JOINT_LEFT_HIP, "hip", "hips"},
    {JOINT_LEFT_KNEE, "knee", "knees"},
    {JOINT_LEFT_FOOT, "foot", "feet"},
};
// From a left joint to its right one.
static const int TO_RIGHT = JOINT_RIGHT_SHOULDER - JOINT_LEFT_SHOULDER;

static void append(char *out, const char *text)
{
    const size_t used = strlen(out);
    snprintf(out + used, NOT_JUDGED_BYTES - used, "%s", text);
}

// The joints of a set, "the knees, the left hand". Returns how many things are named, two of a kind as two.
static int name_joints(uint16_t joints, char out[NOT_JUDGED_BYTES])
{
    int count = 0;
    *out = 0;
    for (size_t k = 0; k < COUNT_OF(names); k++) {
        const bool left = joints >> names[k].joint & 1,
                   right = names[k].two && joints >> (names[k].joint + TO_RIGHT) & 1;
        if (!left && !right)
            continue;
        append(out, count ? ", the " : "the ");
        if (names[k].two && !(left && right))
            append(out, left ? "left " : "right ");
        append(out, left && right ? names[k].two : names[k].one);
        count += left + right;
    }
    return count;
}

static void say(uint16_t joints, const char *how, const char *where, char out[NOT_JUDGED_BYTES])
{
    char text[NOT_JUDGED_BYTES];
    const int count = name_joints(joints, text);
    if (!count)
        return;
    append(out, *out ? "; " : "could not be judged: ");
    append(out, text);
    append(out, count > 1 ? " are " : " is ");
    append(out, how);
    append(out, where);
}

// Parts that are known too seldom although their joints are known at times.
static void say_parts(const struct comparison *c, char out[NOT_JUDGED_BYTES])
{
    for (int p = 0; p < PART_COUNT; p++) {
        char text[64];
        if (c->parts >> p & 1)
            continue;
        snprintf(text, sizeof text, "%sthe %s", *out ? ", " : "could not be judged: ", part_name((enum part)p));
        for (char *at = text; (at = strchr(at, '_'));)
            *at = ' ';
        append(out, text);
    }
    append(out, ": hardly ever seen whole");
}

const char *not_judged_text(const struct comparison *c, char out[NOT_JUDGED_BYTES])
{
    const uint16_t none_a = (uint16_t)~c->a.joints_ever, none_b = (uint16_t)~c->b.joints_ever,
                   few_a = c->a.joints_ever & (uint16_t)~c->a.joints_often,
                   few_b = c->b.joints_ever & (uint16_t)~c->b.joints_often;
    *out = 0;
    if (!(~c->parts & ((1u << PART_COUNT) - 1)))
        return out;
    say(none_a & none_b, "in neither movement", "", out);
    say(none_b & (uint16_t)~none_a, "not in ", "the attempt", out);
    say(none_a & (uint16_t)~none_b, "not in ", "the reference", out);
    say(few_b, "hardly ever in ", "the attempt", out);
    say(few_a, "hardly ever in ", "the reference", out);
    if (!*out)
        say_parts(c, out);
    return out;
}
