// The verdict in words after a take: what was wrong, from when on, and what to do about it.
#include "capture/coaching/coach.h"

#include <stdarg.h>
#include <stdio.h>

// All chosen by hand. A side of the trunk is called unseen below a quarter of it; a joint is guessed too often when
// more than a third of the frames infer it.
static const double UNSEEN = 0.25, GOOD_SHARE = 0.85, FAIR_SHARE = 0.7, GUESSED = 0.34;
// The outline (intersection over union) that the picture is expected to have all round, from the share of the body that
// was seen and the share of joints that were guessed: least squares over the twenty films of the tests' world in
// tests/system/test_verdict.c. With each film left out of its own fit the rank correlation with the outline is 0.82,
// the best of the seven forms that were compared by it, and so somewhat optimistic. A good take is expected above
// GOOD_GRADE.
static const double GRADE_NONE = 0.835, GRADE_SEEN = 0.105, GRADE_GUESSED = 0.136, GOOD_GRADE = 0.91;
static const double SHORT_S = 0.5; // a fault that lasted less is not worth a repeat

static void say(struct coach_verdict *v, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(struct coach_verdict *v, const char *format, ...)
{
    va_list list;
    if (v->count >= VERDICT_LINES)
        return;
    va_start(list, format);
    vsnprintf(v->line[v->count++], sizeof v->line[0], format, list);
    va_end(list);
}

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

static void say_faults(const struct coach *c, struct coach_verdict *v)
{
    for (int f = 0; f < FAULT_COUNT; f++) {
        const struct coach_fault_record *r = &c->fault[f];
        if (r->first_s < 0)
            continue;
        if (f == FAULT_SENSOR_PUSHED) {
            say(v, "%s at %.1f s: film again and leave it still", past_texts[f], r->first_s);
            v->good = false;
        } else if (r->total_s >= SHORT_S) {
            say(v, "%s from %.1f s to %.1f s", past_texts[f], r->longest_from_s, r->longest_from_s + r->longest_s);
            v->good = v->good && f == FAULT_BLUR;
        }
    }
}

// The trunk's, the head's and the thighs' share of one side: limbs turn on their own.
static double side_share(const struct coverage *c, enum coverage_side side)
{
    static const int parts[] = {PART_HEAD, PART_UPPER_TORSO, PART_LOWER_TORSO, PART_LEFT_THIGH, PART_RIGHT_THIGH};
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(parts); i++)
        sum += coverage_part_share(c, parts[i], side);
    return sum / COUNT_OF(parts);
}

static void say_coverage(const struct coach *c, struct coach_verdict *v)
{
    static const char *const sides[] = {"front", "left side", "back", "right side"};
    const struct coverage *k = &c->coverage;
    const double share = coverage_share(k);
    bool any = false;
    for (int side = 0; side < 4; side++)
        if (side_share(k, (enum coverage_side)side) < UNSEEN) {
            say(v, "your %s was never seen: turn all the way round", sides[side]);
            any = true;
        }
    for (int part = 0; part < SURFACE_PARTS && !any; part++)
        if (k->lengths[part] && coverage_part_share(k, part, COVERAGE_ALL_SIDES) < 0.5)
            say(v, "your %s was seen from few sides", surface_part_name(part));
    v->good = v->good && share >= GOOD_SHARE && !any;
    if (share < FAIR_SHARE || any)
        say(v, "%.0f %% of the body was seen", share * 100);
}

// Of all joints in all frames, how many were guessed.
static double guessed_share(const struct coverage *k)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += k->guessed[j];
    return sum / ((double)k->frames * JOINT_COUNT);
}

static double grade_of(const struct coverage *k)
{
    return GRADE_NONE + GRADE_SEEN * coverage_share(k) - GRADE_GUESSED * guessed_share(k);
}

static void say_guessed(const struct coach *c, struct coach_verdict *v)
{
    const struct coverage *k = &c->coverage;
    int worst = -1;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (k->guessed[j] > GUESSED * k->frames && (worst < 0 || k->guessed[j] > k->guessed[worst]))
            worst = j;
    if (worst < 0)
        return;
    char name[32];
    snprintf(name, sizeof name, "%s", joint_name((enum joint)worst));
    for (char *at = name; *at; at++)
        *at = *at == '_' ? ' ' : *at;
    say(v, "your %s was guessed in %.0f %% of the frames: keep it in sight of the sensor", name,
        100.0 * k->guessed[worst] / k->frames);
    v->good = false;
}

void coach_verdict(const struct coach *c, struct coach_verdict *out)
{
    *out = (struct coach_verdict){.good = true};
    if (!c->coverage.frames) {
        out->good = false;
        say(out, "no person was seen: there is nothing to watch");
        return;
    }
    out->grade = grade_of(&c->coverage);
    say_faults(c, out);
    say_coverage(c, out);
    say_guessed(c, out);
    if (out->good && out->grade < GOOD_GRADE) {
        out->good = false;
        if (!out->count)
            say(out, "%.0f %% of the joints were guessed: move more slowly, come nearer, keep hands and feet in sight",
                100 * guessed_share(&c->coverage));
    }
    if (out->good && !out->count)
        say(out, "good: %.0f %% of the body was seen, nothing was in the way", coverage_share(&c->coverage) * 100);
}
