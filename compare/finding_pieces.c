// Findings about time as a whole: what is missing or added, pauses, pace, repetitions, the side.
#include "compare/findings_internal.h"

#include <stdio.h>
#include <stdlib.h>

// A second longer or shorter counts as 20 degrees do for a second: a pause that is hardly noticed comes last. By hand.
#define PAUSE_WEIGHT 20

enum { LEAST_REST = 18, SAME_REST = 15, LEAST_NET = 10 }; // frames; by hand

static double seconds(double frames) { return frames / MOVEMENT_RATE_HZ; }

// "second": of the whole turns of the movement, which one ends nearest to `frame`?
static int which_turn(const struct movement *m, int32_t frame)
{
    const double whole = 5.2; // 300 degrees: a turn that is not quite closed counts
    double from = m->frames[0].heading;
    int turns = 0;
    for (int32_t f = 0; f <= frame && f < m->count; f++)
        if (fabs((double)m->frames[f].heading - from) >= whole) {
            turns++;
            from = m->frames[f].heading;
        }
    return turns;
}

static const char *ordinal(int n)
{
    static const char *const names[] = {"", "first", "second", "third", "fourth", "fifth", "sixth"};
    return n >= 1 && n <= 6 ? names[n] : "last";
}

static enum status of_piece(struct comparison *c, const struct piece *p)
{
    struct finding f = {.part = "body", .unit = "s"};
    const double a_s = seconds(p->a_end - p->a_first), b_s = seconds(p->b_end - p->b_first);
    const bool turn = fabs(p->turned_rad) > 2.6; // 150 degrees
    f.from_s = seconds(p->b_first);
    f.to_s = seconds(p->b_end);
    switch (p->kind) {
    case PIECE_MISSING:
        f.kind = FINDING_MISSING;
        f.from_s = seconds(p->a_first);
        f.to_s = seconds(p->a_end);
        f.amount = a_s;
        f.weight = 60 + 20 * a_s;
        if (turn)
            snprintf(f.sentence, sizeof f.sentence, "The %s turn is missing", ordinal(which_turn(&c->a, p->a_end)));
        else
            snprintf(f.sentence, sizeof f.sentence, "%.1f s of the reference are missing", a_s);
        break;
    case PIECE_EXTRA:
        f.kind = FINDING_EXTRA;
        f.amount = b_s;
        f.weight = 40 + 15 * b_s;
        snprintf(f.sentence, sizeof f.sentence, turn ? "A turn too many" : "%.1f s that the reference does not have",
                 b_s);
        break;
    case PIECE_PAUSE:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.weight = PAUSE_WEIGHT * f.amount;
        snprintf(f.sentence, sizeof f.sentence, "You paused for %.1f s", f.amount);
        break;
    case PIECE_PAUSE_SKIPPED:
        f.kind = FINDING_TIMING;
        f.amount = b_s - a_s;
        f.weight = -PAUSE_WEIGHT * f.amount;
        snprintf(f.sentence, sizeof f.sentence, "The pause is %.1f s too short", -f.amount);
        break;
    }
    return finding_add(c, &f, true);
}

static enum status of_pace(struct comparison *c)
{
    const double percent = 100 * (c->pace.ratio - 1);
    if (!(c->pace.ratio > 0) || fabs(percent) < 12 || c->pace.b_end - c->pace.b_first < 30)
        return OK;
    struct finding f = {FINDING_TIMING, "body", seconds(c->pace.b_first), seconds(c->pace.b_end),
                        percent,        "%",    fabs(percent) / 4,        ""};
    snprintf(f.sentence, sizeof f.sentence, "You were %.0f %% %s", fabs(percent),
             percent > 0 ? "too fast" : "too slow");
    return finding_add(c, &f, false);
}

// Frames of one movement that the alignment could not use: pieces, pauses and what is before and after.
static int32_t unused(const struct comparison *c, bool of_a)
{
    const struct pace *p = &c->pace;
    int32_t sum = of_a ? p->a_first + c->a.count - p->a_end : p->b_first + c->judged.count - p->b_end;
    for (int32_t k = 0; k < p->piece_count; k++) {
        const struct piece *x = &p->pieces[k];
        if (of_a ? x->kind == PIECE_MISSING || x->kind == PIECE_PAUSE_SKIPPED
                 : x->kind == PIECE_EXTRA || x->kind == PIECE_PAUSE)
            sum += of_a ? x->a_end - x->a_first : x->b_end - x->b_first;
    }
    return sum;
}

// Repetitions are too few or too many only where the alignment, too, has half a repetition to spare.
static enum status of_repetitions(struct comparison *c, bool *said)
{
    const int32_t wanted = c->repetitions.reference_count, got = c->repetitions.count;
    *said = false;
    if (wanted < 2 || got < 2 || wanted == got)
        return OK;
    const int32_t off = abs(wanted - got);
    const int32_t length = (got < wanted ? c->a.count : c->judged.count) / (got < wanted ? wanted : got);
    if (2 * unused(c, got < wanted) < length)
        return OK;
    struct finding f = {.kind = got < wanted ? FINDING_MISSING : FINDING_EXTRA,
                        .part = "body",
                        .to_s = seconds(c->judged.count),
                        .amount = off,
                        .unit = "times",
                        .weight = 50};
    const char *missing = off > 1 ? "are missing" : "is missing";
    snprintf(f.sentence, sizeof f.sentence, "%d repetition%s %s: %d instead of %d", (int)off, off > 1 ? "s" : "",
             got < wanted ? missing : "too many", (int)got, (int)wanted);
    *said = true;
    return finding_add(c, &f, false);
}

static bool is_pause(const struct piece *p) { return p->kind == PIECE_PAUSE || p->kind == PIECE_PAUSE_SKIPPED; }

static int32_t frames_longer(const struct piece *p) { return p->b_end - p->b_first - (p->a_end - p->a_first); }

// While both stand still it is open which instants belong together: the alignment may wait in one movement and then in
// the other. Of such pauses by turns only what remains is one. Joins piece k with those that follow it so; returns how
// many they are.
static int32_t join_pauses(const struct pace *p, int32_t k, struct piece *joined)
{
    int32_t count = 1;
    *joined = p->pieces[k];
    for (; is_pause(joined) && k + count < p->piece_count; count++) {
        const struct piece *last = &p->pieces[k + count - 1], *next = &p->pieces[k + count];
        if (!is_pause(next) || next->kind == last->kind || next->b_first - last->b_end > SAME_REST ||
            next->a_first - last->a_end > SAME_REST)
            break;
        joined->a_end = next->a_end;
        joined->b_end = next->b_end;
    }
    if (count > 1)
        joined->kind = frames_longer(joined) > 0 ? PIECE_PAUSE : PIECE_PAUSE_SKIPPED;
    return count;
}

enum status find_pieces(struct comparison *c)
{
    enum status status = OK;
    if (c->mirrored) {
        const struct finding f = {
            FINDING_MIRRORED, "body", seconds(c->pace.b_first),           seconds(c->pace.b_end), 1,
            "times",          1000,   "Mirrored: you used the other side"};
        status = finding_add(c, &f, false);
    }
    bool said = false;
    if (status == OK)
        status = of_repetitions(c, &said);
    // What one performance of the reference lacks or adds when it is done several times is no finding.
    const bool several = c->repetitions.count >= 2 && c->repetitions.reference_count < 2;
    // Between repetitions people rest a little longer or shorter.
    const int32_t least = c->repetitions.count >= 2 && c->repetitions.reference_count >= 2 ? LEAST_REST : 0;
    for (int32_t k = 0, count; k < c->pace.piece_count && status == OK && !several; k += count) {
        struct piece p;
        count = join_pauses(&c->pace, k, &p);
        if (is_pause(&p) && abs(frames_longer(&p)) < (count > 1 && least < LEAST_NET ? LEAST_NET : least))
            continue;
        if (!said || (p.kind != PIECE_MISSING && p.kind != PIECE_EXTRA))
            status = of_piece(c, &p);
    }
    return status == OK && !several && !said ? of_pace(c) : status;
}
