// Stage "search": frame selection, the recorded frame closest to a query pose by [D14] eq. 5: ours, exhaustive search,
// and nanoflann's k-d tree, over takes of 10 000 and 100 000 frames of a person whose every bone swings on its own (no
// pose recurs, so the nearest is not near). Queries are frames of the take seen from up to a radian aside, with noise
// of 3 cm in each coordinate. The error is the excess cost of the frame found over the best one. Insertion is timed per
// frame, for the index alone and for all that a selector computes.
#include "reenact/retrieval/frame_selection.h"
#include "reenact/retrieval/pose_index.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_search_nanoflann.h"
#include "tests/support/limbs.h"
#include "tests/support/skeleton_drawing.h"

#include <stdio.h>
#include <stdlib.h>

enum { QUERIES = 200, BATCH = 20, TAKES = 2 };
static const int take_frames[TAKES] = {10000, 100000};
static const uint64_t SEED = 2014;

struct take_of_limbs {
    int count;
    struct skeleton *frames;
    struct frame_selector *selector;
    float *numbers; // of the frames' joints, relative to the neck
    struct nanoflann_peer *peer;
    struct skeleton queries[QUERIES];
    struct frame_selection best[QUERIES];
};

// ------------------------------------------------------------- exhaustive search

static double equation_5(const struct skeleton *k, const struct skeleton *n)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += v3_distance(v3_sub(k->joint[j], k->joint[JOINT_NECK]), v3_sub(n->joint[j], n->joint[JOINT_NECK]));
    return sum;
}

static struct frame_selection exhaustive_search(const struct take_of_limbs *t, const struct skeleton *k)
{
    struct frame_selection best = {0, equation_5(k, &t->frames[0])};
    for (int n = 1; n < t->count; n++) {
        double cost = equation_5(k, &t->frames[n]);
        if (cost < best.cost_m)
            best = (struct frame_selection){n, cost};
    }
    return best;
}

// ------------------------------------------------------------- contenders

// One contender's answer to one query.
typedef enum status search(const struct take_of_limbs *t, const struct skeleton *k, int64_t *frame);

static enum status search_ours(const struct take_of_limbs *t, const struct skeleton *k, int64_t *frame)
{
    struct frame_selection found;
    enum status status = frame_selector_find_body(t->selector, k, &found);
    *frame = found.frame;
    return status;
}

// Its answers are checked by tests/reenact/test_frame_selection; here only the time matters.
static enum status search_parts(const struct take_of_limbs *t, const struct skeleton *k, int64_t *frame)
{
    struct frame_selection found[PART_COUNT];
    *frame = -1;
    return frame_selector_find_parts(t->selector, k, found);
}

static enum status search_exhaustively(const struct take_of_limbs *t, const struct skeleton *k, int64_t *frame)
{
    *frame = exhaustive_search(t, k).frame;
    return OK;
}

static void to_numbers(const struct skeleton *s, float *numbers)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = v3_sub(s->joint[j], s->joint[JOINT_NECK]);
        *numbers++ = (float)p.x;
        *numbers++ = (float)p.y;
        *numbers++ = (float)p.z;
    }
}

static enum status search_nanoflann(const struct take_of_limbs *t, const struct skeleton *k, int64_t *frame)
{
    float pose[POSE_NUMBERS];
    size_t number = 0;
    to_numbers(k, pose);
    enum status status = nanoflann_peer_find(t->peer, pose, &number);
    *frame = (int64_t)number;
    return status;
}

struct search_contender {
    const struct take_of_limbs *take;
    search *search;
};

// A batch of queries in a row: the first finds the caches as the other contenders left them.
static enum status measure(void *self, int item, struct bench_measure *out)
{
    const struct search_contender *c = self;
    int64_t found[BATCH];
    enum status status = OK;
    double started_ms = bench_clock_ms();
    for (int i = 0; i < BATCH && status == OK; i++) {
        status = c->search(c->take, &c->take->queries[item * BATCH + i], &found[i]);
        if (i == 0)
            out->extra[1] = bench_clock_ms() - started_ms;
    }
    out->time_ms = (bench_clock_ms() - started_ms) / BATCH;
    for (int i = 0; i < BATCH && status == OK; i++) {
        const struct skeleton *query = &c->take->queries[item * BATCH + i];
        const struct frame_selection *best = &c->take->best[item * BATCH + i];
        if (found[i] >= 0)
            out->error += (equation_5(query, &c->take->frames[found[i]]) - best->cost_m) / BATCH;
        out->extra[0] += (found[i] < 0 || found[i] == best->frame) / (double)BATCH;
    }
    return status;
}

// ------------------------------------------------------------- the takes

static enum status fill(struct take_of_limbs *t, bool quiet)
{
    static const struct body body = {.radius_rate = {0.4, 0.4, 0.5, 0.15, 0.12, 0.15, 0.12, 0.17, 0.12, 0.17, 0.12}};
    struct pose_index *index;
    enum status status = pose_index_open(&index, JOINT_COUNT, 1.0 / 2048, t->count);
    double started_ms = bench_clock_ms();
    for (int n = 0; n < t->count && status == OK; n++) {
        struct pose_index_point point = {.known = (1u << JOINT_COUNT) - 1};
        for (int j = 0; j < JOINT_COUNT; j++)
            point.position[j] = v3_sub(t->frames[n].joint[j], t->frames[n].joint[JOINT_NECK]);
        pose_index_add(index, &point);
    }
    double index_ms = bench_clock_ms() - started_ms;
    pose_index_close(&index);
    if (status == OK)
        status = frame_selector_open(&t->selector, t->count);
    started_ms = bench_clock_ms();
    for (int n = 0; n < t->count && status == OK; n++)
        status = frame_selector_add(t->selector, n, &t->frames[n], &body);
    if (status == OK && !quiet)
        printf("search: %d frames, adding one: %.2f us to the index of whole bodies, %.1f us with the indices of "
               "body parts\n",
               t->count, 1e3 * index_ms / t->count, 1e3 * (bench_clock_ms() - started_ms) / t->count);
    return status;
}

static enum status make(struct take_of_limbs *t, int count, bool quiet)
{
    struct rng rng = {SEED};
    struct limbs limbs = limbs_random(&rng);
    *t = (struct take_of_limbs){.count = count,
                                .frames = calloc((size_t)count, sizeof *t->frames),
                                .numbers = calloc((size_t)count, POSE_NUMBERS * sizeof *t->numbers)};
    if (!t->frames || !t->numbers)
        return fail(ERR_MEMORY, "no memory for a take");
    for (int n = 0; n < count; n++) {
        t->frames[n] = limbs_at(&limbs, n / 30.0, 0.01, &rng);
        to_numbers(&t->frames[n], t->numbers + (size_t)n * POSE_NUMBERS);
    }
    for (int i = 0; i < QUERIES; i++) {
        const struct skeleton *shown = &t->frames[(int)(rng_uniform(&rng) * count)];
        t->queries[i] = limbs_rotated(shown, 2 * rng_uniform(&rng) - 1, 0.03, &rng);
        t->best[i] = exhaustive_search(t, &t->queries[i]);
    }
    enum status status = fill(t, quiet);
    return status == OK ? nanoflann_peer_open(&t->peer, t->numbers, (size_t)count) : status;
}

// The frame found, in colours, over the query, in white, both about the neck and seen from the front.
static enum status draw_found(struct bench *b, const struct search_contender *c, const char *name, int query)
{
    static const struct lens lens = {.width = 240, .height = 320, .fx = 300, .fy = 300, .cx = 119.5, .cy = 99.5};
    static const struct drawn_window all = {0, 0, 1};
    const struct skeleton *wanted = &c->take->queries[query];
    const struct drawing d = {calloc((size_t)lens.width * (size_t)lens.height, 3), lens.width, lens.height, lens.width};
    int64_t found;
    char caption[100];
    enum status status = d.rgb ? c->search(c->take, wanted, &found) : fail(ERR_MEMORY, "no memory for a picture");
    for (int k = 0; k < 2 && status == OK; k++) {
        struct skeleton shown = k ? *wanted : c->take->frames[found];
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = v3_sub(shown.joint[j], (k ? wanted : &c->take->frames[found])->joint[JOINT_NECK]);
            shown.joint[j] = v3(p.x, p.y, p.z + 2);
            shown.confidence[j] = 1;
        }
        drawing_put_skeleton(&d, &lens, &shown, &all, k);
    }
    if (status == OK) {
        snprintf(caption, sizeof caption, "%s: %.2f m above the best frame's cost; white: the pose asked for", name,
                 equation_5(wanted, &c->take->frames[found]) - c->take->best[query].cost_m);
        bench_picture(b, caption, d.rgb, lens.width, lens.height);
    }
    free(d.rgb);
    return status;
}

// The query at which the peer is farthest from the best frame.
static enum status draw_pictures(struct bench *b, const struct search_contender *ours,
                                 const struct search_contender *peer)
{
    const struct take_of_limbs *t = ours->take;
    double worst_m = -1;
    int query = 0;
    enum status status = OK;
    for (int i = 0; i < QUERIES && status == OK; i++) {
        int64_t found;
        status = peer->search(t, &t->queries[i], &found);
        const double above_m = status == OK ? equation_5(&t->queries[i], &t->frames[found]) - t->best[i].cost_m : 0;
        if (above_m > worst_m) {
            worst_m = above_m;
            query = i;
        }
    }
    if (status == OK)
        status = draw_found(b, ours, "ours", query);
    return status == OK ? draw_found(b, peer, "nanoflann", query) : status;
}

static enum status run(struct bench *b)
{
    static struct take_of_limbs takes[TAKES];
    enum status status = OK;
    const bool brief = bench_inputs(b)->brief, quiet = brief || bench_inputs(b)->json;
    if (!quiet)
        printf("search: seed %llu\n", (unsigned long long)SEED);
    for (int i = 0; i < (brief ? 1 : TAKES) && status == OK; i++)
        status = make(&takes[i], take_frames[i], quiet);
    if (status == OK) {
        struct search_contender small[] = {{&takes[0], search_ours},
                                           {&takes[0], search_parts},
                                           {&takes[0], search_exhaustively},
                                           {&takes[0], search_nanoflann}};
        struct search_contender large[] = {{&takes[1], search_ours},
                                           {&takes[1], search_parts},
                                           {&takes[1], search_exhaustively},
                                           {&takes[1], search_nanoflann}};
        const struct bench_contender contenders[] = {
            {"ours, 10 000 frames", measure, &small[0], false},  {"ours, eleven parts", measure, &small[1], false},
            {"exhaustive", measure, &small[2], false},           {"nanoflann", measure, &small[3], true},
            {"ours, 100 000 frames", measure, &large[0], false}, {"ours, eleven parts", measure, &large[1], false},
            {"exhaustive", measure, &large[2], false},           {"nanoflann", measure, &large[3], false},
        };
        status = bench_run(b, contenders, brief ? COUNT_OF(small) : COUNT_OF(contenders), QUERIES / BATCH);
        if (status == OK && brief)
            status = draw_pictures(b, &small[0], &small[3]);
    }
    for (int i = 0; i < TAKES; i++) {
        nanoflann_peer_close(&takes[i].peer);
        frame_selector_close(&takes[i].selector);
        free(takes[i].numbers);
        free(takes[i].frames);
    }
    return status;
}

const struct bench_stage bench_stage_search = {
    .name = "search",
    .about = "frame selection: the recorded frame closest to a pose",
    .error_name = "excess_cost_m",
    .time_name = "time_ms",
    .extra_names = {"same_frame", "first_ms"},
    .run = run,
};
