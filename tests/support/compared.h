// Two movements of a person made of exact joints, compared; for the tests of what is said about them. Errors abort.
#pragma once
#include "tests/support/test.h"

#include "compare/comparison.h"
#include "compare/findings.h"
#include "tests/support/exercise.h"

static struct rng rng = {7};

static inline void movement_of(struct joint_samples *s, struct movement *out)
{
    joint_samples_mend_sides(s);
    EXPECT_STATUS(movement_from_samples(s, out), OK);
    joint_samples_free(s);
}

static inline struct movement make(const struct exercise *e)
{
    struct joint_samples s;
    struct movement m;
    exercise_samples(e, &rng, &s);
    movement_of(&s, &m);
    return m;
}

static inline struct comparison compare(const struct exercise *a, const struct exercise *b)
{
    struct movement ma = make(a), mb = make(b);
    struct comparison c;
    EXPECT_STATUS(comparison_make(&ma, &mb, NULL, &c), OK);
    return c;
}

// A single repetition, so that findings are about it and not about repetitions.
static inline struct exercise once(void)
{
    struct exercise e = exercise_default();
    e.seconds = 3;
    return e;
}

static inline void print_findings(const struct comparison *c)
{
    print_message("score %.2f\n", c->score);
    for (int k = 0; k < c->finding_count; k++)
        print_message("  %s %s: %s\n", finding_kind_name(c->findings[k].kind), c->findings[k].part,
                      c->findings[k].sentence);
}

static inline const struct finding *find(const struct comparison *c, enum finding_kind kind)
{
    for (int k = 0; k < c->finding_count; k++)
        if (c->findings[k].kind == kind)
            return &c->findings[k];
    return NULL;
}
