// The list of findings, and its words.
#include "compare/findings_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *finding_kind_name(enum finding_kind k)
{
    static const char *const names[] = {"posture", "range", "timing", "missing", "extra", "mirrored"};
    return names[k];
}

const char *part_name(enum part p)
{
    static const char *const names[PART_COUNT] = {
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
    };
    return names[p];
}

enum status finding_add(struct comparison *c, const struct finding *f, bool timed)
{
    struct finding *more = realloc(c->findings, (size_t)(c->finding_count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the findings");
    c->findings = more;
    more += c->finding_count++;
    *more = *f;
    if (timed) {
        const size_t used = strlen(more->sentence);
        snprintf(more->sentence + used, sizeof more->sentence - used, ", from %.1f s to %.1f s", f->from_s, f->to_s);
    }
    return OK;
}
