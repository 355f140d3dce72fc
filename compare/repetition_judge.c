#include "compare/repetition_judge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_REFERENCES = 12 };

void judged_repetitions_free(struct judged_repetitions *r)
{
    free(r->at);
    *r = (struct judged_repetitions){0};
}

struct side {
    const struct movement *movement;
    struct feature_frame *frames;
    struct repetition_list list;
    double moved[PART_COUNT]; // what its repetitions have in common
};

// The standard deviation of a part's directions over a cycle, after the mean over all repetitions; what a mean of so
// many would have by chance is taken off.
static void measure_moved(struct side *s)
{
    enum { BINS = 16 };
    for (int p = 0; p < PART_COUNT; p++) {
        double bin[BINS][4] = {{0}}, square = 0, all[4] = {0}, of_means = 0, bins = 0;
        for (int32_t k = 0; k < s->list.count; k++) {
            const struct repetition_span span = s->list.spans[k];
            for (int32_t f = span.first; f < span.end; f++) {
                const struct movement_frame *frame = &s->movement->frames[f];
                if (!(frame->known >> p & 1))
                    continue;
                double *of = bin[(int64_t)(f - span.first) * BINS / (span.end - span.first)];
                for (int n = 0; n < 3; n++)
                    of[n] += frame->direction[p][n];
                of[3]++;
            }
        }
        for (int i = 0; i < BINS; i++) {
            for (int n = 0; n < 4; n++)
                all[n] += bin[i][n];
            if (bin[i][3] > 0) {
                const double mean2 =
                    (bin[i][0] * bin[i][0] + bin[i][1] * bin[i][1] + bin[i][2] * bin[i][2]) / (bin[i][3] * bin[i][3]);
                of_means += mean2;
                square += 1 - mean2; // directions are unit vectors
                bins++;
            }
        }
        const double mean2 = all[3] > 0 ? (all[0] * all[0] + all[1] * all[1] + all[2] * all[2]) / (all[3] * all[3]) : 0;
        const double within = bins > 0 ? square / bins : 0, between = bins > 0 ? of_means / bins - mean2 : 0;
        s->moved[p] = sqrt(fmax(0, between - within / s->list.count));
    }
}

static struct movement piece(const struct movement *m, struct repetition_span s)
{
    struct movement out = *m;
    out.frames = m->frames + s.first;
    out.count = s.end - s.first;
    return out;
}

static enum status judge_pair(const struct side *a, struct repetition_span sa, const struct side *b,
                              struct repetition_span sb, const struct alignment_prices *prices,
                              struct judged_repetition *out)
{
    const struct movement ma = piece(a->movement, sa), mb = piece(b->movement, sb);
    const struct score_scope scope = {0, mb.count, a->list.count >= 2 ? a->moved : NULL};
    const struct features fa = {a->frames + sa.first, ma.count}, fb = {b->frames + sb.first, mb.count};
    struct alignment x = {0};
    enum status status = align(&fa, &fb, prices, &x);
    if (status == OK)
        status = score_posture(&ma, &mb, &x, &scope, &out->terms);
    alignment_free(&x);
    out->attempt = sb;
    out->reference = sa;
    out->score = score_from_terms(&out->terms);
    return status;
}

static enum status judge_all(const struct side *a, const struct side *b, const struct alignment_prices *prices,
                             struct judged_repetitions *out)
{
    enum status status = OK;
    out->at = calloc((size_t)b->list.count, sizeof *out->at);
    if (!out->at)
        return fail(ERR_MEMORY, "no memory to judge repetitions");
    const int32_t references = a->list.count < MOST_REFERENCES ? a->list.count : MOST_REFERENCES;
    for (int32_t k = 0; k < b->list.count && status == OK; k++) {
        for (int32_t n = 0; n < references && status == OK; n++) {
            struct judged_repetition judged = {0};
            status = judge_pair(a, a->list.spans[n], b, b->list.spans[k], prices, &judged);
            if (status == OK && (!n || judged.score > out->at[k].score))
                out->at[k] = judged;
        }
        out->count++;
    }
    out->reference_count = a->list.count;
    return status;
}

// The reference is one performance: B's repetitions are where it occurs.
static enum status one_performance(struct side *a, struct side *b)
{
    a->list.spans = malloc(sizeof *a->list.spans);
    if (!a->list.spans)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    a->list.spans[0] = (struct repetition_span){0, a->movement->count};
    a->list.count = 1;
    if (2 * b->movement->count < 3 * a->movement->count)
        return OK;
    const struct features fa = {a->frames, a->movement->count}, fb = {b->frames, b->movement->count};
    return repetitions_of(&fa, &fb, &b->list);
}

static enum status find_both(struct side *a, struct side *b, uint16_t parts)
{
    enum status status = movement_features(a->movement, parts, NULL, &a->frames);
    if (status == OK)
        status = movement_features(b->movement, parts, NULL, &b->frames);
    const struct features fa = {a->frames, a->movement->count}, fb = {b->frames, b->movement->count};
    if (status == OK)
        status = repetitions_find(&fa, &a->list);
    if (status == OK && a->list.count < 2)
        return one_performance(a, b);
    return status == OK ? repetitions_find(&fb, &b->list) : status;
}

enum status judge_repetitions(const struct movement *a, const struct movement *b, uint16_t parts,
                              const struct alignment_prices *prices, struct judged_repetitions *out)
{
    struct side sa = {.movement = a}, sb = {.movement = b};
    *out = (struct judged_repetitions){0};
    enum status status = find_both(&sa, &sb, parts);
    if (status == OK && sa.list.count >= 2)
        measure_moved(&sa);
    memcpy(out->moved, sa.moved, sizeof out->moved);
    // One repetition alone is the movement itself.
    if (status == OK && sb.list.count >= 2)
        status = judge_all(&sa, &sb, prices, out);
    else if (status == OK)
        out->reference_count = sa.list.count;
    free(sa.frames);
    free(sb.frames);
    repetition_list_free(&sa.list);
    repetition_list_free(&sb.list);
    if (status != OK)
        judged_repetitions_free(out);
    return status;
}
