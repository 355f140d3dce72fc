// Where in the attempt a finding is seen best, and on which part.
#include "compare/findings.h"

#include <string.h>

int part_by_name(const char *name)
{
    for (int p = 0; p < PART_COUNT; p++)
        if (!strcmp(name, part_name((enum part)p)))
            return p;
    return -1;
}

int judged_part(const struct comparison *c, int part)
{
    return part >= 0 && c->mirrored ? (int)mirrored_part((enum part)part) : part;
}

double finding_worst_s(const struct comparison *c, const struct finding *f)
{
    const int32_t first = (int32_t)(f->from_s * MOVEMENT_RATE_HZ + 0.5), end = (int32_t)(f->to_s * MOVEMENT_RATE_HZ);
    const int judged = judged_part(c, part_by_name(f->part));
    double worst_s = 0.5 * (f->from_s + f->to_s);
    float most = 0;
    for (int32_t k = first; k < end && k < c->judged.count && judged >= 0; k++) {
        struct part_difference parts[PART_COUNT];
        part_differences(&c->a, &c->judged, &c->timeline, k, parts);
        if (parts[judged].verdict == VERDICT_DIFFERENT && parts[judged].angle_rad > most) {
            most = parts[judged].angle_rad;
            worst_s = k / MOVEMENT_RATE_HZ;
        }
    }
    return worst_s;
}
