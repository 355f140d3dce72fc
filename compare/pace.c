#include "compare/pace.h"

#include <math.h>
#include <stdlib.h>

// By hand. A piece shorter than this is a matter of pace.
enum { MIN_PIECE = 12, MIN_PAUSE = 10 };
// A piece has content if some part leaves the poses at its ends by more (chord of 25 degrees).
static const double MOVED_CHORD = 0.433;
// The same out and back to one pose (60 degrees): what leaves it by less may be a smaller range.
static const double BACK_CHORD = 1;
// While B goes through a piece that A lacks, or waits, A advances at most at this share of the pace.
static const double STANDSTILL = 0.25;
// A moves where some part's direction changes by more within half a second (10 degrees).
static const double MOVING_CHORD = 0.17;

void pace_free(struct pace *pace)
{
    free(pace->pieces);
    *pace = (struct pace){0};
}

bool *pace_left_out(const struct pace *pace, bool of_a, int32_t count)
{
    bool *out = calloc((size_t)count + 1, sizeof *out);
    for (int32_t k = 0; k < pace->piece_count && out; k++) {
        const struct piece *piece = &pace->pieces[k];
        const int32_t first = of_a ? piece->a_first : piece->b_first, end = of_a ? piece->a_end : piece->b_end;
        for (int32_t f = first > 0 ? first : 0; f < end && f < count; f++)
            out[f] = true;
    }
    return out;
}

static enum status add_piece(struct pace *pace, struct piece piece)
{
    struct piece *more = realloc(pace->pieces, (size_t)(pace->piece_count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    pace->pieces = more;
    pace->pieces[pace->piece_count++] = piece;
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
static bool has_content(const struct movement *movement, int32_t first, int32_t end, struct pose_pair poses,
                        uint16_t parts, double chord)
{
    for (int32_t f = first; f < end; f++)
        if (farthest_part(&movement->frames[f], poses.before, parts) > chord &&
            farthest_part(&movement->frames[f], poses.after, parts) > chord)
            return true;
    return false;
}

static double heading_change(const struct movement *movement, int32_t first, int32_t end)
{
    return end > first ? (double)movement->frames[end - 1].heading - movement->frames[first].heading : 0;
}

struct walk {
    const struct movement *a, *b;
    uint16_t parts;
    struct timeline *t;
    struct pace *pace;
    float *reference; // the timeline before extra pieces are taken out
};

// A jumps ahead between two frames of B.
static enum status look_for_jump(struct walk *walk, int32_t j, int32_t next)
{
    const double from = walk->reference[j], to = walk->reference[next];
    if (to - from < MIN_PIECE + (next - j))
        return OK;
    struct piece piece = {.a_first = (int32_t)from + 1, .a_end = (int32_t)to, .b_first = j, .b_end = next};
    const struct movement_frame before = movement_at(walk->a, from), after = movement_at(walk->a, to);
    // Out and back to the same pose: less of it may be the same movement with a smaller range.
    const bool back = farthest_part(&before, &after, walk->parts) < MOVED_CHORD;
    const bool content = has_content(walk->a, piece.a_first, piece.a_end, (struct pose_pair){&before, &after},
                                     walk->parts, back ? BACK_CHORD : MOVED_CHORD);
    if (!content && back &&
        has_content(walk->a, piece.a_first, piece.a_end, (struct pose_pair){&before, &after}, walk->parts, MOVED_CHORD))
        return OK;
    piece.kind = content ? PIECE_MISSING : PIECE_PAUSE_SKIPPED;
    piece.turned_rad = heading_change(walk->a, piece.a_first, piece.a_end);
    if (content)
        walk->pace->missing += piece.a_end - piece.a_first;
    return add_piece(walk->pace, piece);
}

// How the body's parts move from one pose to another: their directions' differences, of those known in both.
struct course {
    double part[PART_COUNT][3];
};

static struct course course_of(const struct movement_frame *from, const struct movement_frame *to, uint16_t parts)
{
    struct course out = {{{0}}};
    for (int p = 0; p < PART_COUNT; p++)
        for (int k = 0; k < 3 && (parts & from->known & to->known & 1u << p); k++)
            out.part[p][k] = (double)to->direction[p][k] - from->direction[p][k];
    return out;
}

// Takes out of each part's way what lies along its own way there.
static void course_remove(struct course *course, const struct course *along)
{
    for (int p = 0; p < PART_COUNT; p++) {
        double *d = course->part[p];
        const double *x = along->part[p], length2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2],
                     share = length2 > 0 ? (d[0] * x[0] + d[1] * x[1] + d[2] * x[2]) / length2 : 0;
        for (int k = 0; k < 3; k++)
            d[k] -= share * x[k];
    }
}

// Of the part that goes farthest.
static double course_length(const struct course *course)
{
    double most2 = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        const double *d = course->part[p];
        most2 = fmax(most2, d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
    return sqrt(most2);
}

// What A does while it stands still, and how it comes there and goes on.
struct standstill {
    int32_t a_first, a_end;
    struct course in, out; // at right angles to each other
};

static struct standstill standstill_of(const struct walk *walk, int32_t a_first, int32_t a_end)
{
    enum { HALF = 15 }; // half a second
    const struct movement_frame before = movement_at(walk->a, a_first - HALF), first = movement_at(walk->a, a_first),
                                last = movement_at(walk->a, a_end - 1), after = movement_at(walk->a, a_end - 1 + HALF);
    struct standstill out = {a_first, a_end, course_of(&before, &first, walk->parts),
                             course_of(&last, &after, walk->parts)};
    course_remove(&out.out, &out.in);
    return out;
}

static bool is_elsewhere(const struct walk *walk, const struct standstill *still, const struct movement_frame *from,
                         const struct movement_frame *to)
{
    struct course gone = course_of(from, to, walk->parts);
    course_remove(&gone, &still->in);
    course_remove(&gone, &still->out);
    return course_length(&gone) > MOVED_CHORD;
}

// Does B leave A's poses and its own first and last one over first..end - 1 of its frames? Further along A's way is no
// other place: the same movement done too far.
static bool goes_elsewhere(const struct walk *walk, const struct standstill *still, int32_t first, int32_t end)
{
    enum { LEAST = 9 }; // frames: less is a tracker's mistake
    const struct movement_frame *b = walk->b->frames;
    const int32_t stride = 1 + (still->a_end - still->a_first) / 32; // so long a standstill is one in every frame
    int count = 0;
    for (int32_t f = first; f < end && count < LEAST; f++) {
        bool elsewhere = is_elsewhere(walk, still, &b[first], &b[f]) && is_elsewhere(walk, still, &b[end - 1], &b[f]);
        for (int32_t i = still->a_first; i < still->a_end && elsewhere; i += stride)
            elsewhere = is_elsewhere(walk, still, &walk->a->frames[i], &b[f]);
        count += elsewhere;
    }
    return count == LEAST;
}

// A waits from the first frame of B on, and goes on before `end`: since it was farthest behind STANDSTILL of the pace.
static int32_t pause_end(const struct walk *walk, int32_t first, int32_t end)
{
    double least = 0;
    int32_t out = first + 1;
    for (int32_t j = first + 1; j < end; j++) {
        const double ahead = walk->reference[j] - walk->reference[first] - STANDSTILL * (j - first);
        if (ahead <= least) {
            least = ahead;
            out = j + 1;
        }
    }
    return out;
}

// A stands still over first..end - 1 of B.
static enum status look_for_halt(struct walk *walk, int32_t first, int32_t end)
{
    if (end - first < MIN_PAUSE)
        return OK;
    const int32_t a_first = (int32_t)walk->reference[first], a_end = (int32_t)walk->reference[end - 1] + 1;
    struct piece piece = {.a_first = a_first, .a_end = a_end, .b_first = first, .b_end = end};
    const struct standstill still = standstill_of(walk, a_first, a_end);
    const bool content = end - first >= MIN_PIECE && goes_elsewhere(walk, &still, first, end);
    piece.kind = content ? PIECE_EXTRA : PIECE_PAUSE;
    if (!content) {
        piece.b_end = pause_end(walk, first, end);
        piece.a_end = (int32_t)walk->reference[piece.b_end - 1] + 1;
    }
    piece.turned_rad = heading_change(walk->b, first, piece.b_end);
    if (content)
        walk->pace->extra += end - first;
    for (int32_t f = first; f < end && content; f++)
        walk->t->reference[f] = NAN; // it shows nothing of A
    return add_piece(walk->pace, piece);
}

static enum status look_inside(struct walk *walk)
{
    enum { STEP = 6 };
    const struct pace *p = walk->pace;
    enum status status = OK;
    // Jumps are looked for over a few frames, because the alignment blends over a cut.
    for (int32_t j = p->b_first; j < p->b_end && status == OK;) {
        int32_t next = j + STEP < p->b_end ? j + STEP : p->b_end - 1;
        if (next <= j)
            break;
        const bool jump = walk->reference[next] - walk->reference[j] >= MIN_PIECE + (next - j);
        status = look_for_jump(walk, j, next);
        j = jump ? next : j + 1;
    }
    int32_t first = p->b_first;
    for (int32_t j = p->b_first + 1; j <= p->b_end && status == OK; j++) {
        const bool still = j < p->b_end && walk->reference[j] - walk->reference[first] <= STANDSTILL * (j - first) + 1;
        if (still)
            continue;
        if (j - first >= MIN_PAUSE) {
            status = look_for_halt(walk, first, j);
            first = j;
        } else {
            first++;
            j = first;
        }
    }
    return status;
}

// Frames of A before or after what is aligned whose pose does not occur in what is.
static enum status look_at_end(struct walk *walk, int32_t first, int32_t end, int32_t at_b)
{
    int32_t strange_first = end, strange_end = first, count = 0;
    for (int32_t i = first; i < end; i++) {
        bool occurs = false;
        for (int32_t k = walk->pace->a_first; k < walk->pace->a_end && !occurs; k += 3)
            occurs = farthest_part(&walk->a->frames[i], &walk->a->frames[k], walk->parts) < MOVED_CHORD;
        if (occurs)
            continue;
        strange_first = i < strange_first ? i : strange_first;
        strange_end = i + 1;
        count++;
    }
    if (count < MIN_PIECE)
        return OK;
    walk->pace->missing += strange_end - strange_first;
    return add_piece(walk->pace, (struct piece){PIECE_MISSING, strange_first, strange_end, at_b, at_b,
                                                heading_change(walk->a, strange_first, strange_end)});
}

static int compare_float(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Of the even pace: the median over those half seconds in which A moves of how many frames of A one of B goes on by.
// What is missing or stopped early, and pauses, do not change it. 0: A moves nowhere.
static enum status measure_ratio(const struct walk *walk)
{
    enum { SPAN = 15 };
    struct pace *p = walk->pace;
    float *slopes = malloc((size_t)(p->b_end - p->b_first + 1) * sizeof *slopes);
    size_t count = 0;
    if (!slopes)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    for (int32_t j = p->b_first; j + SPAN < p->b_end; j++) {
        const double from = walk->reference[j], to = walk->reference[j + SPAN];
        if (isnan(from) || isnan(to) || to <= from)
            continue;
        const struct movement_frame x = movement_at(walk->a, from), y = movement_at(walk->a, to);
        if (farthest_part(&x, &y, walk->parts) > MOVING_CHORD)
            slopes[count++] = (float)((to - from) / SPAN);
    }
    qsort(slopes, count, sizeof *slopes, compare_float);
    p->ratio = count ? slopes[count / 2] : 0;
    free(slopes);
    return OK;
}

static int compare_pieces(const void *a, const void *b)
{
    const struct piece *x = a, *y = b;
    if (x->b_first != y->b_first)
        return x->b_first < y->b_first ? -1 : 1;
    return (x->a_first > y->a_first) - (x->a_first < y->a_first);
}

// Getting into position and out of it: frames of B at an end that all show A's first or last aligned frame. They are
// left out where what remains still covers half of A.
static void leave_out_ends(struct timeline *timeline, int32_t a_count)
{
    enum { LEAST = 12 };
    int32_t first = 0, end = timeline->count;
    while (first < end && isnan(timeline->reference[first]))
        first++;
    while (end > first && isnan(timeline->reference[end - 1]))
        end--;
    int32_t head = first, tail = end;
    while (head < end && timeline->reference[head] <= timeline->reference[first] + 1)
        head++;
    while (tail > first && timeline->reference[tail - 1] >= timeline->reference[end - 1] - 1)
        tail--;
    if (head >= tail || 2 * (timeline->reference[tail - 1] - timeline->reference[head]) < a_count)
        return;
    for (int32_t j = first; j < head && head - first >= LEAST; j++)
        timeline->reference[j] = NAN;
    for (int32_t j = tail; j < end && end - tail >= LEAST; j++)
        timeline->reference[j] = NAN;
}

// What is missing in two places a third of a second apart or less is one piece: the alignment may rest on the way.
static void join_missing(struct pace *pace)
{
    enum { NEAR = 10 }; // frames
    int32_t kept = 0;
    for (int32_t k = 0; k < pace->piece_count; k++) {
        const struct piece *next = &pace->pieces[k];
        struct piece *last = kept ? &pace->pieces[kept - 1] : NULL;
        if (last && last->kind == PIECE_MISSING && next->kind == PIECE_MISSING && next->a_first - last->a_end <= NEAR &&
            next->b_first - last->b_end <= NEAR) {
            pace->missing += next->a_first - last->a_end;
            last->a_end = next->a_end;
            last->b_end = next->b_end;
            last->turned_rad += next->turned_rad;
        } else {
            pace->pieces[kept++] = *next;
        }
    }
    pace->piece_count = kept;
}

static enum status find_pieces(struct walk *walk)
{
    struct pace *pace = walk->pace;
    enum status status = look_at_end(walk, 0, pace->a_first, pace->b_first);
    if (status == OK)
        status = look_inside(walk);
    if (status == OK)
        status = look_at_end(walk, pace->a_end, walk->a->count, pace->b_end);
    if (pace->piece_count)
        qsort(pace->pieces, (size_t)pace->piece_count, sizeof *pace->pieces, compare_pieces);
    join_missing(pace);
    return status;
}

enum status pace_measure(const struct movement *a, const struct movement *b, uint16_t parts, struct timeline *t,
                         bool repeated, struct pace *out)
{
    *out = (struct pace){.b_first = -1, .a_first = a->count};
    struct walk w = {a, b, parts, t, out, malloc((size_t)t->count * sizeof *w.reference)};
    if (!w.reference)
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    if (!repeated)
        leave_out_ends(t, a->count);
    for (int32_t j = 0; j < t->count; j++) {
        w.reference[j] = t->reference[j];
        if (isnan(t->reference[j]))
            continue;
        const int32_t at = (int32_t)t->reference[j];
        out->b_first = out->b_first < 0 ? j : out->b_first;
        out->b_end = j + 1;
        out->a_first = at < out->a_first ? at : out->a_first;
        out->a_end = at + 1 > out->a_end ? at + 1 : out->a_end;
    }
    enum status status = OK;
    if (out->b_first < 0)
        out->a_first = out->b_first = 0;
    else
        status = measure_ratio(&w);
    if (status == OK && out->b_end > 0 && !repeated)
        status = find_pieces(&w);
    free(w.reference);
    if (status != OK)
        pace_free(out);
    return status;
}
