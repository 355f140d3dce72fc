// The verdict in words after a take: what was wrong, from when on, and what to do about it.
#include "capture/coaching/coach.h"

#include <stdio.h>

// All chosen by hand. A side of the trunk is called unseen below a quarter of it; a joint is guessed too often when
// more than a third of the frames infer it.
static const double UNSEEN = 0.25, GOOD_SHARE = 0.85, FAIR_SHARE = 0.7, GUESSED = 0.34;
// The outline (intersection over union) that the picture is expected to have all round, from the share of the body that
// was seen and the share of joints that were guessed: least squares over the twenty films of the tests' world in
// tests/system/test_verdict.c. With each film left out of its own fit the rank correlation with the outline is 0.82,
// the best of the seven forms that were compared by it, and so somewhat optimistic. A take that is good from all sides
// is expected above GOOD_GRADE.
static const double GRADE_NONE = 0.835, GRADE_SEEN = 0.105, GRADE_GUESSED = 0.136, GOOD_GRADE = 0.91;
static const double SHORT_S = 0.5; // a fault that lasted less is not worth a repeat

static const char *const past_texts[FAULT_COUNT] = {
    [FAULT_FROZEN] = "the sensor's picture stood still",
    [FAULT_NO_COLOR] = "the colour camera gave no pictures",
    [FAULT_NO_DEPTH] = "there was hardly any depth",
    [FAULT_DEPTH_WRONG] = "the sensor's depth contradicted the tags",
    [FAULT_SLOW] = "the sensor was slower than 20 pictures a second",
    [FAULT_DARK] = "it was too dark",
    [FAULT_BRIGHT] = "it was too bright",
    [FAULT_SENSOR_PUSHED] = "the sensor was pushed",
    [FAULT_SECOND_PERSON] = "another person was in the picture",
    [FAULT_NO_PERSON] = "no person was seen",
    [FAULT_FEET_OUTSIDE] = "feet missing",
    [FAULT_HEAD_OUTSIDE] = "head missing",
    [FAULT_SIDE_OUTSIDE] = "cut off at the picture's edge",
    [FAULT_TOO_NEAR] = "too near the sensor",
    [FAULT_TOO_FAR] = "too far from the sensor",
    [FAULT_BLUR] = "blurred by fast movement",
};

// Light and colour matter to those who look at the take.
static unsigned spoilt_uses(enum coach_fault fault)
{
    switch (fault) {
    case FAULT_BLUR: return 0;
    case FAULT_NO_COLOR:
    case FAULT_DARK:
    case FAULT_BRIGHT: return USE_WATCH;
    default: return USE_ANY;
    }
}

static void say_faults(const struct coach *coach, struct take_verdict *verdict)
{
    for (int f = 0; f < FAULT_COUNT; f++) {
        const struct coach_fault_record *r = &coach->fault[f];
        if (r->first_s < 0)
            continue;
        if (f == FAULT_SENSOR_PUSHED)
            verdict_say(verdict, USE_ANY, "%s at %.1f s: film again and leave it still", past_texts[f], r->first_s);
        else if (r->total_s >= SHORT_S)
            verdict_say(verdict, spoilt_uses((enum coach_fault)f), "%s from %.1f s to %.1f s", past_texts[f],
                        r->longest_from_s, r->longest_from_s + r->longest_s);
        if (f == FAULT_DEPTH_WRONG && verdict->count && r->total_s >= SHORT_S)
            verdict->line[verdict->count - 1].filming = true; // the frames do not say which tags were seen
    }
}

// The trunk's, the head's and the thighs' share of one side: limbs turn on their own.
static double side_share(const struct coverage *coverage, enum coverage_side side)
{
    static const int parts[] = {PART_HEAD, PART_UPPER_TORSO, PART_LOWER_TORSO, PART_LEFT_THIGH, PART_RIGHT_THIGH};
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(parts); i++)
        sum += coverage_part_share(coverage, parts[i], side);
    return sum / COUNT_OF(parts);
}

// The sides that were never seen, in words: "from behind and from your left". Their number.
static int unseen_sides(const struct coverage *coverage, char *out, size_t capacity)
{
    static const struct {
        enum coverage_side side;
        const char *from;
    } sides[] = {{COVERAGE_BACK, "from behind"},
                 {COVERAGE_FRONT, "from the front"},
                 {COVERAGE_LEFT, "from your left"},
                 {COVERAGE_RIGHT, "from your right"}};
    const char *unseen[COUNT_OF(sides)];
    int count = 0, used = 0;
    for (size_t i = 0; i < COUNT_OF(sides); i++)
        if (side_share(coverage, sides[i].side) < UNSEEN)
            unseen[count++] = sides[i].from;
    *out = 0;
    for (int i = 0; i < count; i++) {
        const char *before = i < count - 1 ? ", " : " and ";
        used += snprintf(out + used, capacity - (size_t)used, "%s%s", i ? before : "", unseen[i]);
    }
    return count;
}

static void say_coverage(const struct coach *coach, struct take_verdict *verdict)
{
    const struct coverage *coverage = &coach->coverage;
    const double share = coverage_share(coverage);
    char sides[120];
    const int unseen = unseen_sides(coverage, sides, sizeof sides);
    if (unseen)
        verdict_say(verdict, USE_WATCH, "%s it is guessed: turn round once to be seen from all sides", sides);
    for (int part = 0; part < SURFACE_PARTS && !unseen; part++)
        if (coverage->lengths[part] && coverage_part_share(coverage, part, COVERAGE_ALL_SIDES) < 0.5)
            verdict_say(verdict, share < GOOD_SHARE ? USE_WATCH : 0, "your %s was seen from few sides",
                        surface_part_name(part));
    if (share < FAIR_SHARE || unseen)
        verdict_say(verdict, USE_WATCH, "%.0f %% of the body was seen", share * 100);
    else if (share < GOOD_SHARE)
        verdict->spoilt |= USE_WATCH;
}

// Of all joints in all frames, how many were guessed.
static double guessed_share(const struct coverage *coverage)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += coverage->guessed[j];
    return sum / ((double)coverage->frames * JOINT_COUNT);
}

double coach_grade(const struct coach *coach)
{
    const struct coverage *coverage = &coach->coverage;
    return coverage->frames
               ? GRADE_NONE + GRADE_SEEN * coverage_share(coverage) - GRADE_GUESSED * guessed_share(coverage)
               : 0;
}

static void say_guessed(const struct coach *coach, struct take_verdict *verdict)
{
    const struct coverage *coverage = &coach->coverage;
    int worst = -1;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (coverage->guessed[j] > GUESSED * coverage->frames &&
            (worst < 0 || coverage->guessed[j] > coverage->guessed[worst]))
            worst = j;
    if (worst < 0)
        return;
    char name[32];
    snprintf(name, sizeof name, "%s", joint_name((enum joint)worst));
    for (char *at = name; *at; at++)
        *at = *at == '_' ? ' ' : *at;
    verdict_say(verdict, USE_ANY, "your %s was guessed in %.0f %% of the frames: keep it in sight of the sensor", name,
                100.0 * coverage->guessed[worst] / coverage->frames);
}

void coach_verdict(const struct coach *coach, struct take_verdict *out)
{
    *out = (struct take_verdict){.purpose = coach->purpose, .seen = coach->coverage.frames > 0};
    if (!out->seen) {
        out->spoilt = USE_ANY;
        return;
    }
    say_faults(coach, out);
    say_guessed(coach, out);
    say_coverage(coach, out);
    if (verdict_is_good_for(out, USE_WATCH) && coach_grade(coach) < GOOD_GRADE)
        verdict_say(out, USE_WATCH,
                    "%.0f %% of the joints were guessed: move more slowly, come nearer, keep hands and feet in sight",
                    100 * guessed_share(&coach->coverage));
    if (!out->count)
        verdict_say(out, 0, "%.0f %% of the body was seen, nothing was in the way",
                    coverage_share(&coach->coverage) * 100);
}
