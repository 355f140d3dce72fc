#include "compare/pieces.h"

#include <stdlib.h>

// By hand. A piece shorter than this is a matter of pace.
enum { LEAST_PIECE = 12, LEAST_PAUSE = 10 };
// A piece has content if some part leaves the poses at its ends by more (chord of 25 degrees).
static const double MOVED_CHORD = 0.433;
// The same for what is added (60 degrees): less may be the same movement done too far.
static const double ADDED_CHORD = 1;
// While B goes through a piece that A lacks, or waits, A advances at most at this share of the pace.
static const double STANDSTILL = 0.25;

void pace_free(struct pace *p)
{
    free(p->pieces);
    *p = (struct pace){0};
}

static enum status add(struct pace *p, struct piece piece)
{
    struct piece *more = realloc(p->pieces, (size_t)(p->piece_count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    p->pieces = more;
    p->pieces[p->piece_count++] = piece;
    return OK;
}

// The second largest distance of a part's directions: one part alone may be a tracker's fault.
static double farthest_part(const struct movement_frame *x, const struct movement_frame *y, uint16_t parts)
{
    double most2 = 0, second2 = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        if (!(parts & x->known & y->known & 1u << p))
            continue;
        double sum = 0;
        for (int k = 0; k < 3; k++)
            sum +=
                ((double)x->direction[p][k] - y->direction[p][k]) * ((double)x->direction[p][k] - y->direction[p][k]);
        second2 = fmax(second2, fmin(most2, sum));
        most2 = fmax(most2, sum);
    }
    return sqrt(second2);
}

struct pose_pair {
    const struct movement_frame *before, *after;
};

// Does the movement leave both poses within first..end - 1?
static bool has_content(const struct movement *m, int32_t first, int32_t end, struct pose_pair poses, uint16_t parts,
                        double chord)
{
    for (int32_t f = first; f < end; f++)
        if (farthest_part(&m->frames[f], poses.before, parts) > chord &&
            farthest_part(&m->frames[f], poses.after, parts) > chord)
            return true;
    return false;
}

static double turned(const struct movement *m, int32_t first, int32_t end)
{
    return end > first ? (double)m->frames[end - 1].heading - m->frames[first].heading : 0;
}

struct walk {
    const struct movement *a, *b;
    uint16_t parts;
    struct timeline *t;
    struct pace *pace;
    float *reference; // the timeline before extra pieces are taken out
};

// A jumps ahead between two frames of B.
static enum status look_for_jump(struct walk *w, int32_t j, int32_t next)
{
    const double from = w->reference[j], to = w->reference[next];
    if (to - from < LEAST_PIECE + (next - j))
        return OK;
    struct piece piece = {.a_first = (int32_t)from + 1, .a_end = (int32_t)to, .b_first = j, .b_end = next};
    const struct movement_frame before = movement_at(w->a, from), after = movement_at(w->a, to);
    // Out and back to the same pose: less of it may be the same movement with a smaller range.
    const bool back = farthest_part(&before, &after, w->parts) < MOVED_CHORD;
    const bool content = has_content(w->a, piece.a_first, piece.a_end, (struct pose_pair){&before, &after}, w->parts,
                                     back ? ADDED_CHORD : MOVED_CHORD);
    if (!content && back &&
        has_content(w->a, piece.a_first, piece.a_end, (struct pose_pair){&before, &after}, w->parts, MOVED_CHORD))
        return OK;
    piece.kind = content ? PIECE_MISSING : PIECE_PAUSE_SKIPPED;
    piece.turned_rad = turned(w->a, piece.a_first, piece.a_end);
    if (content)
        w->pace->missing += piece.a_end - piece.a_first;
    return add(w->pace, piece);
}

// A stands still over first..end - 1 of B.
static enum status look_for_halt(struct walk *w, int32_t first, int32_t end)
{
    if (end - first < LEAST_PAUSE)
        return OK;
    const int32_t a_first = (int32_t)w->reference[first], a_end = (int32_t)w->reference[end - 1] + 1;
    struct piece piece = {.a_first = a_first, .a_end = a_end, .b_first = first, .b_end = end};
    const struct movement_frame before = movement_at(w->a, a_first), after = movement_at(w->a, a_end - 1);
    const bool content = end - first >= LEAST_PIECE &&
                         has_content(w->b, first, end, (struct pose_pair){&before, &after}, w->parts, ADDED_CHORD) &&
                         has_content(w->b, first, end, (struct pose_pair){&w->b->frames[first], &w->b->frames[end - 1]},
                                     w->parts, ADDED_CHORD);
    piece.kind = content ? PIECE_EXTRA : PIECE_PAUSE;
    piece.turned_rad = turned(w->b, first, end);
    if (content)
        w->pace->extra += end - first;
    return add(w->pace, piece);
}

static enum status look_inside(struct walk *w)
{
    enum { STEP = 6 };
    const struct pace *p = w->pace;
    enum status status = OK;
    // Jumps are looked for over a few frames, because the alignment blends over a cut.
    for (int32_t j = p->b_first; j < p->b_end && status == OK;) {
        int32_t next = j + STEP < p->b_end ? j + STEP : p->b_end - 1;
        if (next <= j)
            break;
        const bool jump = w->reference[next] - w->reference[j] >= LEAST_PIECE + (next - j);
        status = look_for_jump(w, j, next);
        j = jump ? next : j + 1;
    }
    int32_t first = p->b_first;
    for (int32_t j = p->b_first + 1; j <= p->b_end && status == OK; j++) {
        const bool still = j < p->b_end && w->reference[j] - w->reference[first] <= STANDSTILL * (j - first) + 1;
        if (still)
            continue;
        if (j - first >= LEAST_PAUSE) {
            status = look_for_halt(w, first, j);
            first = j;
        } else {
            first++;
            j = first;
        }
    }
    return status;
}

// Frames of A before or after what is aligned whose pose does not occur in what is.
static enum status look_at_end(struct walk *w, int32_t first, int32_t end, int32_t at_b)
{
    int32_t strange_first = end, strange_end = first, count = 0;
    for (int32_t i = first; i < end; i++) {
        bool occurs = false;
        for (int32_t k = w->pace->a_first; k < w->pace->a_end && !occurs; k += 3)
            occurs = farthest_part(&w->a->frames[i], &w->a->frames[k], w->parts) < MOVED_CHORD;
        if (occurs)
            continue;
        strange_first = i < strange_first ? i : strange_first;
        strange_end = i + 1;
        count++;
    }
    if (count < LEAST_PIECE)
        return OK;
    w->pace->missing += strange_end - strange_first;
    return add(w->pace, (struct piece){PIECE_MISSING, strange_first, strange_end, at_b, at_b,
                                       turned(w->a, strange_first, strange_end)});
}

// A straight line through the timeline, by least squares, and what deviates from it.
static void measure_ratio(const struct walk *w)
{
    struct pace *p = w->pace;
    double n = 0, sb = 0, sa = 0, sbb = 0, sab = 0, rest = 0;
    for (int32_t j = p->b_first; j < p->b_end; j++) {
        const double b = j - p->b_first, a = w->reference[j] - p->a_first;
        n++;
        sb += b;
        sa += a;
        sbb += b * b;
        sab += a * b;
    }
    const double spread = sbb - sb * sb / n;
    p->ratio = spread > 0 ? (sab - sa * sb / n) / spread : 0;
    for (int32_t j = p->b_first; j < p->b_end; j++) {
        const double off = (w->reference[j] - p->a_first - sa / n) - p->ratio * (j - p->b_first - sb / n);
        rest += off * off;
    }
    p->uneven_s = sqrt(rest / n) / MOVEMENT_RATE_HZ;
}

// Getting into position and out of it: frames of B at an end that all show A's first or last aligned frame. They are
// left out where what remains still covers half of A.
static void leave_out_ends(struct timeline *t, int32_t a_count)
{
    enum { LEAST = 12 };
    int32_t first = 0, end = t->count;
    while (first < end && isnan(t->reference[first]))
        first++;
    while (end > first && isnan(t->reference[end - 1]))
        end--;
    int32_t head = first, tail = end;
    while (head < end && t->reference[head] <= t->reference[first] + 1)
        head++;
    while (tail > first && t->reference[tail - 1] >= t->reference[end - 1] - 1)
        tail--;
    if (head >= tail || 2 * (t->reference[tail - 1] - t->reference[head]) < a_count)
        return;
    for (int32_t j = first; j < head && head - first >= LEAST; j++)
        t->reference[j] = NAN;
    for (int32_t j = tail; j < end && end - tail >= LEAST; j++)
        t->reference[j] = NAN;
}

enum status pace_measure(const struct movement *a, const struct movement *b, uint16_t parts, struct timeline *t,
                         struct pace *out)
{
    *out = (struct pace){.b_first = -1};
    struct walk w = {a, b, parts, t, out, malloc((size_t)t->count * sizeof *w.reference)};
    if (!w.reference)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    leave_out_ends(t, a->count);
    for (int32_t j = 0; j < t->count; j++) {
        w.reference[j] = t->reference[j];
        if (isnan(t->reference[j]))
            continue;
        out->b_first = out->b_first < 0 ? j : out->b_first;
        out->b_end = j + 1;
    }
    enum status status = OK;
    if (out->b_first >= 0) {
        out->a_first = (int32_t)w.reference[out->b_first];
        out->a_end = (int32_t)w.reference[out->b_end - 1] + 1;
        measure_ratio(&w);
        status = look_at_end(&w, 0, out->a_first, out->b_first);
        if (status == OK)
            status = look_inside(&w);
        if (status == OK)
            status = look_at_end(&w, out->a_end, a->count, out->b_end);
    }
    free(w.reference);
    if (status != OK)
        pace_free(out);
    return status;
}
