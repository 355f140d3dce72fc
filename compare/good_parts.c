#include "compare/good_parts.h"

#include "compare/findings.h"

#include <stdio.h>
#include <string.h>

#define BIT(part) (1u << (part))

enum {
    TRUNK = BIT(PART_UPPER_TORSO) | BIT(PART_LOWER_TORSO),
    UPPER_ARMS = BIT(PART_LEFT_UPPER_ARM) | BIT(PART_RIGHT_UPPER_ARM),
    FOREARMS = BIT(PART_LEFT_FOREARM) | BIT(PART_RIGHT_FOREARM),
    THIGHS = BIT(PART_LEFT_THIGH) | BIT(PART_RIGHT_THIGH),
    SHINS = BIT(PART_LEFT_SHIN) | BIT(PART_RIGHT_SHIN),
    WHOLE = BIT(PART_COUNT) - 1
};

// What has a name together comes before its parts.
static const struct {
    uint16_t parts;
    const char *name;
} part_words[] = {
    {WHOLE, "the whole body"},
    {BIT(PART_HEAD), "the head"},
    {TRUNK, "the trunk"},
    {UPPER_ARMS | FOREARMS, "the arms"},
    {BIT(PART_LEFT_UPPER_ARM) | BIT(PART_LEFT_FOREARM), "the left arm"},
    {BIT(PART_RIGHT_UPPER_ARM) | BIT(PART_RIGHT_FOREARM), "the right arm"},
    {UPPER_ARMS, "the upper arms"},
    {FOREARMS, "the forearms"},
    {BIT(PART_LEFT_UPPER_ARM), "the left upper arm"},
    {BIT(PART_RIGHT_UPPER_ARM), "the right upper arm"},
    {BIT(PART_LEFT_FOREARM), "the left forearm"},
    {BIT(PART_RIGHT_FOREARM), "the right forearm"},
    {THIGHS | SHINS, "the legs"},
    {BIT(PART_LEFT_THIGH) | BIT(PART_LEFT_SHIN), "the left leg"},
    {BIT(PART_RIGHT_THIGH) | BIT(PART_RIGHT_SHIN), "the right leg"},
    {THIGHS, "the thighs"},
    {SHINS, "the shins"},
    {BIT(PART_LEFT_THIGH), "the left thigh"},
    {BIT(PART_RIGHT_THIGH), "the right thigh"},
    {BIT(PART_LEFT_SHIN), "the left shin"},
    {BIT(PART_RIGHT_SHIN), "the right shin"},
};

// What a finding speaks of, as judged. A pace, a pause or a piece is of no part's making.
static uint16_t parts_spoken_of(const struct comparison *comparison, const struct finding *finding)
{
    const int part = judged_part(comparison, part_by_name(finding->part));
    const bool held = finding->kind == FINDING_POSTURE || finding->kind == FINDING_RANGE;
    if (part < 0 && !finding->parts)
        return held ? WHOLE : 0;
    uint16_t parts = finding->parts | (part < 0 ? 0 : (uint16_t)BIT(part));
    for (int p = 0; p < PART_COUNT && finding->side == SIDE_BOTH; p++) // "both knees and hips", of one hip judged so
        parts |= finding->parts >> p & 1 ? (uint16_t)BIT(mirrored_part((enum part)p)) : 0;
    return parts;
}

uint16_t good_parts(const struct comparison *comparison)
{
    uint16_t good = 0, own = 0;
    if (comparison->relation != RELATION_SAME)
        return 0;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_deviation *d = &comparison->terms.part[p];
        bool within = d->weight > 0;
        for (int k = 0; k < DEVIATIONS; k++)
            within = within && d->z[k] <= 1;
        good |= within ? (uint16_t)BIT(p) : 0;
    }
    for (int32_t k = 0; k < comparison->finding_count; k++)
        good &= (uint16_t)~parts_spoken_of(comparison, &comparison->findings[k]);
    good &= (good & TRUNK) == TRUNK ? WHOLE : (uint16_t)~TRUNK;
    for (int p = 0; p < PART_COUNT; p++)
        if (good >> p & 1)
            own |= (uint16_t)BIT(comparison->mirrored ? mirrored_part((enum part)p) : (enum part)p);
    return own;
}

const char *good_text(const struct comparison *comparison, char out[GOOD_TEXT_BYTES])
{
    uint16_t left = good_parts(comparison); // that are not named yet
    size_t used = 0;
    *out = 0;
    for (size_t k = 0; k < COUNT_OF(part_words) && used < GOOD_TEXT_BYTES; k++) {
        if ((left & part_words[k].parts) != part_words[k].parts)
            continue;
        used += (size_t)snprintf(out + used, GOOD_TEXT_BYTES - used, "%s%s", used ? ", " : "", part_words[k].name);
        left &= (uint16_t)~part_words[k].parts;
    }
    return out;
}
