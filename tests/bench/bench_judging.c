// Stage "judging": what a comparison says of pairs of movements whose joints are exactly known, next to the truth: no
// film is made and nothing is tracked, so that each error is the judgement's own.
//
// Three trials. Edits: a stretch of a motion, and the same edited in a known way (tests/world/edit.h) by another
// figure. Others: different motions, holds among them. Repetitions: n times the same against m times, with rests.
#include "base/threads.h"
#include "compare/findings.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_attempts.h"
#include "tests/support/random.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double SIGMA_M = 0.005;                        // of the joints
static const double DEGREES = 180 / 3.14159265358979323846; // in a radian
enum { FRAMES_MOST = 60 * ATTEMPT_HZ, REPETITIONS_MOST = 6 };

struct joints {
    struct skeleton *at; // [count], at ATTEMPT_HZ, world axes
    int count;
};

struct judging_trial {
    const struct bench_dice *dice;
    struct dice_motions motions;
    bool silent;
};

// ---------------------------------------------------------------- movements

static enum status joints_open(struct joints *joints)
{
    *joints = (struct joints){calloc(FRAMES_MOST, sizeof *joints->at), 0};
    return joints->at ? OK : fail(ERR_MEMORY, "no memory for joints");
}

// The stretch that `edit` performs by a figure, appended.
static enum status append_performance(struct joints *joints, const struct attempt_plan *plan, int actor,
                                      const struct world_edit *edit)
{
    struct world_options options = attempt_world_options(plan, actor);
    options.edit = edit;
    const int wanted = (int)(world_edit_seconds(edit) * ATTEMPT_HZ);
    const int count = wanted < FRAMES_MOST - joints->count ? wanted : FRAMES_MOST - joints->count;
    const enum status status = world_preview_joints(&options, 0, ATTEMPT_HZ, count, joints->at + joints->count);
    joints->count += status == OK ? count : 0;
    return status;
}

// Stands as in the last frame.
static void append_rest(struct joints *joints, double seconds)
{
    for (int k = 0; k < seconds * ATTEMPT_HZ && joints->count && joints->count < FRAMES_MOST; k++) {
        joints->at[joints->count] = joints->at[joints->count - 1];
        joints->count++;
    }
}

static enum status movement_of_joints(const struct joints *joints, struct movement *out)
{
    struct joint_samples samples = {0};
    enum status status = OK;
    for (int k = 0; k < joints->count && status == OK; k++) {
        struct joint_sample sample = {.time_ns = k * 1000000000LL / ATTEMPT_HZ, .skeleton = joints->at[k]};
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 world = sample.skeleton.joint[j];
            sample.skeleton.joint[j] = v3(world.x, -world.z, world.y);
            sample.sigma_m[j] = (float)SIGMA_M;
        }
        status = joint_samples_add(&samples, &sample);
    }
    samples.sigma_given = true;
    if (status == OK)
        status = movement_from_samples(&samples, out);
    joint_samples_free(&samples);
    return status;
}

static enum status compare_joints(const struct joints *reference, const struct joints *attempt, struct comparison *out)
{
    struct movement a = {0}, b = {0};
    enum status status = movement_of_joints(reference, &a);
    if (status == OK)
        status = movement_of_joints(attempt, &b);
    if (status == OK)
        status = comparison_make(&a, &b, NULL, out);
    movement_free(&a);
    movement_free(&b);
    return status;
}

static const char *short_name(const char *motion)
{
    const char *slash = strrchr(motion, '/');
    return slash ? slash + 1 : motion;
}

// ---------------------------------------------------------------- edits

struct edit_result {
    struct attempt_plan plan;
    bool made, judged, first_right, kind_found, posture_free, mirrored_right;
    int sentences, invented; // of these: false
    double score;
};

// What is so, by the joints themselves and by the instants that the edit says: a figure of other limbs bends its knees
// otherwise in a step, and a sentence about that is true.
struct truth {
    const struct comparison *c;
    const struct world_edit *edit;
};

// The frame of the reference that the attempt's frame shows. NaN: none.
static double true_frame(const struct truth *truth, int32_t frame)
{
    const double at = world_edit_reference_s(truth->edit, frame / MOVEMENT_RATE_HZ) * MOVEMENT_RATE_HZ;
    return at <= truth->c->a.count - 1 ? at : NAN;
}

// Do the joints of the part differ by half of what is said, on average over the finding's time, and the same way?
static bool joint_is_off(const struct truth *truth, const struct finding *finding, const struct body_joint *joint)
{
    const struct comparison *c = truth->c;
    const int32_t first = (int32_t)(finding->from_s * MOVEMENT_RATE_HZ),
                  end = (int32_t)(finding->to_s * MOVEMENT_RATE_HZ);
    double sum = 0, angle = 0, frames = 0;
    for (int32_t f = first; f < end && f < c->judged.count; f++) {
        const double at = true_frame(truth, f);
        double d[3], sigma;
        frames++;
        if (isnan(at))
            continue;
        const struct movement_frame x = movement_at(&c->a, at), *y = &c->judged.frames[f];
        if (!joint_difference(&x, y, joint, d, &sigma))
            continue;
        sum += 2 * asin(fmin(1, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / 2)) * DEGREES;
        const double by = (double)body_angle_of(y, joint->angle) - body_angle_of(&x, joint->angle);
        angle += isnan(by) ? 0 : by;
    }
    const bool bent = strstr(finding->sentence, " bent") != NULL;
    return sum >= 0.5 * fabs(finding->amount) * frames && (!bent || angle * finding->amount > 0);
}

// Does the angle go through less, by half of what is said, in what belongs together?
static bool range_is_off(const struct truth *truth, const struct finding *finding, const struct body_joint *joint)
{
    const struct comparison *c = truth->c;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int32_t f = 0; f < c->judged.count; f++) {
        const double at = true_frame(truth, f);
        if (isnan(at))
            continue;
        const struct movement_frame x = movement_at(&c->a, at);
        const float angle[2] = {body_angle_of(&x, joint->angle), body_angle_of(&c->judged.frames[f], joint->angle)};
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], angle[k]);
            high[k] = fmax(high[k], angle[k]);
        }
    }
    const double less = (high[1] - low[1] - (high[0] - low[0])) * DEGREES;
    return less * finding->amount > 0 && fabs(less) >= 0.5 * fabs(finding->amount);
}

static bool posture_is_off(const struct truth *truth, const struct finding *finding)
{
    for (int k = 0; k < BODY_JOINTS; k++) {
        const struct body_joint *joint = &body_joints[k];
        if (!(finding->parts >> joint->part & 1))
            continue;
        if (finding->kind == FINDING_RANGE ? range_is_off(truth, finding, joint) : joint_is_off(truth, finding, joint))
            return true;
    }
    return false;
}

// Does most of the finding's time lie between these two?
static bool is_within(const struct finding *finding, double from_s, double to_s)
{
    return fmin(finding->to_s, to_s) - fmax(finding->from_s, from_s) >= 0.5 * (finding->to_s - finding->from_s);
}

static bool timing_is_off(const struct world_edit *edit, const struct finding *finding)
{
    if (strcmp(finding->part, "body"))
        return edit->kind == EDIT_LATE && strstr(finding->part, "right_") && strstr(finding->part, "arm");
    if (!finding->timed) // the pace
        return edit->kind == EDIT_TEMPO;
    if (edit->kind == EDIT_MISSING) // a pause that is too short
        return finding->amount < 0 && is_within(finding, edit->from_s - 0.5, edit->from_s + 0.5);
    return edit->kind == EDIT_TEMPO || // uneven
           ((edit->kind == EDIT_PAUSE || edit->kind == EDIT_EXTRA) &&
            is_within(finding, edit->from_s - 0.5, edit->from_s + edit->amount + 0.5));
}

static bool is_true(const struct truth *truth, const struct finding *finding)
{
    const struct world_edit *edit = truth->edit;
    switch (finding->kind) {
    case FINDING_POSTURE:
    case FINDING_RANGE: return posture_is_off(truth, finding);
    case FINDING_TIMING: return timing_is_off(edit, finding);
    case FINDING_MIRRORED: return edit->kind == EDIT_MIRRORED;
    case FINDING_MISSING:
        return edit->kind == EDIT_MISSING && (!finding->timed || is_within(finding, edit->from_s, edit->to_s));
    case FINDING_EXTRA:
        return edit->kind == EDIT_EXTRA &&
               (!finding->timed || is_within(finding, edit->from_s, edit->from_s + edit->amount));
    }
    return false;
}

// truth: NULL: not known.
static void print_findings(const struct comparison *c, const struct truth *truth)
{
    if (c->relation != RELATION_SAME)
        printf("        %s\n", c->relation_sentence);
    for (int32_t k = 0; k < c->finding_count; k++)
        printf("        %s%s\n", c->findings[k].sentence, truth && !is_true(truth, &c->findings[k]) ? " - false" : "");
}

static void judge_edit(const struct comparison *c, struct edit_result *out)
{
    const enum world_edit_kind kind = out->plan.edit.kind;
    const struct truth truth = {c, &out->plan.edit};
    out->judged = c->relation == RELATION_SAME;
    out->score = c->score;
    out->posture_free = true;
    for (int32_t k = 0; k < c->finding_count; k++) {
        const struct finding *f = &c->findings[k];
        out->invented += !is_true(&truth, f);
        out->sentences++;
        out->posture_free = out->posture_free && f->kind != FINDING_POSTURE && f->kind != FINDING_RANGE;
        out->kind_found = out->kind_found || (kind == EDIT_MISSING && f->kind == FINDING_MISSING) ||
                          (kind == EDIT_EXTRA && f->kind == FINDING_EXTRA) ||
                          (edit_is_timing(kind) && f->kind == FINDING_TIMING) ||
                          (kind == EDIT_RANGE && (f->kind == FINDING_RANGE || f->kind == FINDING_POSTURE));
    }
    out->mirrored_right = kind == EDIT_MIRRORED ? c->mirrored && out->judged : !c->mirrored;
    out->first_right = c->finding_count && edit_is_posture(kind) && edit_expects_part(kind, c->findings[0].part);
}

static enum status make_edit(const struct judging_trial *t, int index, struct edit_result *out)
{
    const struct attempt_wish wish = {t->dice->seed, t->dice->seconds, &t->motions};
    struct joints joints[2] = {{0}, {0}};
    struct comparison c = {0};
    enum status status = attempt_plan_draw(&out->plan, &wish, index);
    if (status == NOTHING)
        return OK;
    struct world_edit none = out->plan.edit;
    none.kind = EDIT_NONE;
    for (int k = 0; k < 2 && status == OK; k++) {
        status = joints_open(&joints[k]);
        if (status == OK)
            status = append_performance(&joints[k], &out->plan, k, k ? &out->plan.edit : &none);
    }
    if (status == OK)
        status = compare_joints(&joints[0], &joints[1], &c);
    if (status == OK) {
        out->made = true;
        judge_edit(&c, out);
        const struct world_edit *e = &out->plan.edit;
        if (!t->silent) {
            printf("%4d %-12.12s %-11s %5.2f  %4.1f to %4.1f s of %4.1f  %3.0f, like %.2f, invented %d%s\n", index,
                   short_name(out->plan.motion), world_edit_name(e->kind), e->amount, e->from_s, e->to_s, e->seconds,
                   c.score, c.similarity.correlation, out->invented,
                   edit_is_posture(e->kind) && !out->first_right ? ", first wrong" : "");
            print_findings(&c, &(struct truth){&c, e});
        }
    }
    comparison_free(&c);
    for (int k = 0; k < 2; k++)
        free(joints[k].at);
    return status;
}

// ---------------------------------------------------------------- other movements

struct pair_result {
    bool made, same, refused;
};

// A motion's performance, or, every fourth time, one of its instants held for as long.
static enum status draw_performance(struct rng *rng, const struct judging_trial *t, int motion, bool hold,
                                    struct joints *out)
{
    static const char *const figures[] = {"woman", "man", "child", "heavy"};
    struct attempt_plan plan = {.motion = t->motions.name[motion]};
    snprintf(plan.actor[0].figure, sizeof plan.actor[0].figure, "%s", figures[rng_pick(rng, COUNT_OF(figures))]);
    plan.actor[0].spot.turned = rng_between(rng, -1, 1);
    struct world_options options = attempt_world_options(&plan, 0);
    double seconds = 0;
    enum status status = joints_open(out);
    if (status == OK)
        status = world_preview_seconds(&options, &seconds);
    const double length = fmin(seconds, t->dice->seconds);
    const struct world_edit edit = {EDIT_NONE, 0.5 * (seconds - length), length, 0, 0, 0};
    if (status == OK)
        status = append_performance(out, &plan, 0, &edit);
    for (int k = 0; k < out->count && hold; k++)
        out->at[k] = out->at[out->count / 2];
    return status;
}

// Pair `index`: motions i and j of all pairs, by figures that are drawn.
static enum status make_pair(const struct judging_trial *t, int index, struct pair_result *out)
{
    struct rng rng = rng_of(t->dice->seed + 1, index);
    const int count = t->motions.count, i = index / count % count, j = index % count;
    struct joints joints[2] = {{0}, {0}};
    struct comparison c = {0};
    const bool hold[2] = {i % 4 == 3, j % 4 == 3};
    enum status status = draw_performance(&rng, t, i, hold[0], &joints[0]);
    if (status == OK)
        status = draw_performance(&rng, t, j, hold[1], &joints[1]);
    if (status == OK)
        status = compare_joints(&joints[0], &joints[1], &c);
    if (status == OK) {
        *out = (struct pair_result){.made = true, .same = i == j, .refused = c.relation != RELATION_SAME};
        if (!t->silent && out->refused == out->same)
            printf("     %s%s and %s%s: like %.2f, %s, score %.0f\n", hold[0] ? "a hold of " : "",
                   short_name(t->motions.name[i]), hold[1] ? "a hold of " : "", short_name(t->motions.name[j]),
                   c.similarity.correlation, out->refused ? "refused" : "taken for the same", c.score);
    }
    comparison_free(&c);
    for (int k = 0; k < 2; k++)
        free(joints[k].at);
    return status;
}

// ---------------------------------------------------------------- repetitions

struct repetitions_result {
    bool made, count_right;
    int invented;
    double score;
};

// Some joint goes 0.3 m or more from where it begins, beside the waist.
static bool moves_enough(const struct joints *joints, int count)
{
    double most = 0;
    for (int k = 0; k < count; k++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct skeleton *s = &joints->at[k], *first = &joints->at[0];
            most = fmax(most, v3_distance(v3_sub(s->joint[j], s->joint[JOINT_WAIST]),
                                          v3_sub(first->joint[j], first->joint[JOINT_WAIST])));
        }
    return most >= 0.3;
}

// Film `index`: one motion's stretch that begins and ends in the same pose (there and back), n times against m times.
static enum status make_repetitions(const struct judging_trial *t, int index, struct repetitions_result *out)
{
    struct rng rng = rng_of(t->dice->seed + 2, index);
    const int times[2] = {1 + index % REPETITIONS_MOST, 1 + index / REPETITIONS_MOST % REPETITIONS_MOST};
    const int motion = rng_pick(&rng, t->motions.count);
    struct joints cycle = {0}, joints[2] = {{0}, {0}};
    struct comparison c = {0};
    enum status status = draw_performance(&rng, t, motion, false, &cycle);
    // There and back: 1.5 to 4 s.
    const int half = (int)fmin(cycle.count, rng_between(&rng, 0.75, 2) * ATTEMPT_HZ);
    for (int k = 0; k < 2 && status == OK; k++) {
        const double rest_s = rng_between(&rng, 0, 2);
        status = joints_open(&joints[k]);
        for (int n = 0; n < times[k] && status == OK; n++) {
            for (int f = 0; f < 2 * half && joints[k].count < FRAMES_MOST; f++)
                joints[k].at[joints[k].count++] = cycle.at[f < half ? f : 2 * half - 1 - f];
            append_rest(&joints[k], rest_s);
        }
    }
    if (status == OK && !moves_enough(&cycle, half))
        goto done; // nothing to repeat
    if (status == OK)
        status = compare_joints(&joints[0], &joints[1], &c);
    if (status == OK) {
        *out = (struct repetitions_result){.made = true, .score = c.score};
        for (int32_t k = 0; k < c.finding_count; k++)
            out->invented += c.findings[k].kind != FINDING_EXTRA && c.findings[k].kind != FINDING_MISSING;
        const int found[2] = {c.repetitions.reference_count, c.repetitions.count > 0 ? c.repetitions.count : 1};
        out->count_right = found[0] == times[0] && found[1] == times[1];
        if (!t->silent && (!out->count_right || out->invented || out->score < 97)) {
            printf("     %s, %.1f s, %d against %d times: %d and %d found, score %.0f, like %.2f\n",
                   short_name(t->motions.name[motion]), 2.0 * half / ATTEMPT_HZ, times[0], times[1], found[0], found[1],
                   c.score, c.similarity.correlation);
            print_findings(&c, NULL);
        }
    }
done:
    comparison_free(&c);
    free(cycle.at);
    for (int k = 0; k < 2; k++)
        free(joints[k].at);
    return status;
}

// ---------------------------------------------------------------- the table

static const char *const columns[] = {"pairs",        "first_right_%", "kind_found_%", "mirrored_right_%",
                                      "no_posture_%", "invented",      "refused_%",    "score",
                                      "score_97_%",   "count_right_%", "sentences",    "true_%"};

static enum status run_edits(struct bench *b, const struct judging_trial *t, int count)
{
    double sum[COUNT_OF(columns)] = {0}, of[COUNT_OF(columns)] = {0};
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        struct edit_result r = {.made = false};
        status = make_edit(t, t->dice->only >= 0 ? t->dice->only : i, &r);
        if (status != OK || !r.made)
            continue;
        const enum world_edit_kind kind = r.plan.edit.kind;
        const bool timing = edit_is_timing(kind), named = timing || kind == EDIT_MISSING || kind == EDIT_EXTRA;
        const double value[] = {1,
                                edit_is_posture(kind) ? 100 * r.first_right : NAN,
                                named || kind == EDIT_RANGE ? 100 * r.kind_found : NAN,
                                100 * r.mirrored_right,
                                timing ? 100 * r.posture_free : NAN,
                                r.invented,
                                100 * !r.judged,
                                r.score,
                                kind == EDIT_NONE ? 100 * (r.score >= 97) : NAN,
                                NAN,
                                r.sentences,
                                NAN};
        for (size_t k = 0; k < COUNT_OF(columns); k++)
            if (!isnan(value[k])) {
                sum[k] += value[k];
                of[k]++;
            }
    }
    const double said = sum[10], invented = sum[5];
    for (size_t k = 1; k < COUNT_OF(columns); k++)
        sum[k] = of[k] > 0 ? sum[k] / of[k] : NAN;
    sum[11] = said > 0 ? 100 * (1 - invented / said) : NAN;
    return status == OK ? bench_add_row(b, "edits", sum) : status;
}

static enum status run_pairs(struct bench *b, const struct judging_trial *t, bool same)
{
    double row[COUNT_OF(columns)] = {0};
    int pairs = 0, refused = 0;
    enum status status = OK;
    for (int i = 0; i < t->motions.count * t->motions.count && status == OK; i++) {
        struct pair_result r = {.made = false};
        if ((i / t->motions.count == i % t->motions.count) != same)
            continue;
        status = make_pair(t, i, &r);
        pairs += r.made;
        refused += r.refused;
    }
    for (size_t k = 0; k < COUNT_OF(columns); k++)
        row[k] = NAN;
    row[0] = pairs;
    row[6] = 100.0 * refused / fmax(1, pairs);
    return status == OK ? bench_add_row(b, same ? "the same, other figures" : "others", row) : status;
}

static enum status run_repetitions(struct bench *b, const struct judging_trial *t, int count)
{
    double row[COUNT_OF(columns)];
    int made = 0, right = 0, high = 0, invented = 0;
    double score = 0;
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        struct repetitions_result r = {.made = false};
        status = make_repetitions(t, i, &r);
        made += r.made;
        right += r.count_right;
        high += r.score >= 97;
        invented += r.invented;
        score += r.score;
    }
    for (size_t k = 0; k < COUNT_OF(columns); k++)
        row[k] = NAN;
    row[0] = made;
    row[5] = invented / fmax(1, made);
    row[7] = score / fmax(1, made);
    row[8] = 100.0 * high / fmax(1, made);
    row[9] = 100.0 * right / fmax(1, made);
    return status == OK ? bench_add_row(b, "repetitions", row) : status;
}

static enum status run(struct bench *b)
{
    const struct bench_inputs *in = bench_inputs(b);
    struct judging_trial t = {.dice = &in->dice, .silent = in->json || in->brief};
    enum status status = dice_motions_open(&t.motions, in->motions);
    const int count = in->dice.films ? in->dice.films : bench_count(b, 4 * EDIT_KINDS, 0.5);
    if (!t.silent)
        printf("judging: seed %llu\n", (unsigned long long)in->dice.seed);
    bench_columns(b, columns, COUNT_OF(columns));
    if (status == OK)
        status = run_edits(b, &t, in->dice.only >= 0 ? 1 : count);
    if (status == OK && in->dice.only < 0)
        status = run_pairs(b, &t, false);
    if (status == OK && in->dice.only < 0)
        status = run_pairs(b, &t, true);
    if (status == OK && in->dice.only < 0)
        status = run_repetitions(b, &t, count);
    dice_motions_close(&t.motions);
    return status;
}

const struct bench_stage bench_stage_judging = {
    .name = "judging",
    .about = "comparing movements whose joints are exactly known: edits, other movements, repetitions",
    .run = run,
};
