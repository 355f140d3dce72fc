#include "compare/reference_spread.h"

#include "base/text.h"
#include "compare/comparison.h"

static const double PRIOR_WEIGHT = 2; // observations; chosen by hand

enum status reference_spread_add(struct reference_spread *spread, const struct movement *first,
                                 struct movement *further, const struct expectation *expected, const char *name)
{
    struct expectation asked = {.ignored = 0};
    struct movement copy = {0};
    struct comparison c = {0};
    char shown[TEXT_SHOWN_BYTES];
    if (expected) {
        asked.ignored = expected->ignored;
        asked.from_s = expected->from_s;
        asked.to_s = expected->to_s;
    }
    enum status status = movement_copy(first, 0, first->count, &copy);
    if (status == OK)
        status = comparison_make(&copy, further, &asked, &c);
    movement_free(further);
    if (status == OK && c.relation != RELATION_SAME)
        status = fail(ERR_INPUT, "%s does not do as the reference does, so it cannot be a further one: %s",
                      text_shown(name, shown), c.relation_sentence);
    for (int p = 0; p < PART_COUNT && status == OK; p++) {
        const struct part_deviation *part = &c.terms.part[p];
        if (!(part->weight > 0))
            continue;
        for (int k = 0; k < DEVIATIONS; k++)
            spread->square[p][k] += part->z[k] * part->z[k];
        spread->count[p]++;
    }
    spread->references += status == OK;
    comparison_free(&c);
    return status;
}

void reference_spread_put(const struct reference_spread *spread, struct expectation *expected)
{
    expected->spread_references = spread->references;
    for (int p = 0; p < PART_COUNT; p++)
        for (int k = 0; k < DEVIATIONS; k++)
            expected->spread[p][k] =
                spread->count[p] ? sqrt((PRIOR_WEIGHT + spread->square[p][k]) / (PRIOR_WEIGHT + spread->count[p])) : 0;
}
