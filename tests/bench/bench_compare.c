// Stage "compare": time alignment of two movements, error against time: ours (exact, pruned), the plain full dynamic
// programme, and FastDTW (Salvador & Chan 2007) at several radii; movements of 300 frames of a person whose every bone
// swings on its own, the attempt at a changing pace, with noise; every third is hard: to and fro, with pauses and
// pieces left out. The error is the excess price over the optimum, in percent.
#include "compare/movement.h"
#include "tests/bench/bench.h"
#include "tests/support/limbs.h"
#include "tests/support/skeleton_drawing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ITEMS = 12, FRAMES = 300 };
static const uint64_t SEED = 2026;

struct pair {
    struct feature_frame *a, *b;
    struct features fa, fb;
    int64_t best;
};

static const struct alignment_prices prices = {11 * FEATURE_UNIT * FEATURE_UNIT / 10 * 3,
                                               11 * FEATURE_UNIT *FEATURE_UNIT / 10 * 3,
                                               11 * FEATURE_UNIT *FEATURE_UNIT / 50};

// Features of a person's movement at the given times.
static enum status features_at(const struct limbs *limbs, const double *time_s, int count, double noise_m,
                               struct rng *rng, struct feature_frame **out)
{
    struct joint_samples samples = {0};
    struct movement m = {0};
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        struct joint_sample s = {.time_ns = (int64_t)(i / MOVEMENT_RATE_HZ * 1e9 + 0.5),
                                 .skeleton = limbs_at(limbs, time_s[i], noise_m, rng)};
        for (int j = 0; j < JOINT_COUNT; j++)
            s.sigma_m[j] = default_sigma_m(1);
        status = joint_samples_add(&samples, &s);
    }
    if (status == OK)
        status = movement_from_samples(&samples, &m);
    if (status == OK)
        status = movement_features(&m, m.ever_known, NULL, out);
    joint_samples_free(&samples);
    movement_free(&m);
    return status;
}

static enum status make_pair(struct pair *p, bool hard, struct rng *rng)
{
    const struct limbs limbs = limbs_random(rng);
    double a_s[FRAMES], b_s[FRAMES], time_s = 0, pace = 1;
    int halted = 0;
    for (int i = 0; i < FRAMES; i++) {
        a_s[i] = i / MOVEMENT_RATE_HZ;
        b_s[i] = time_s;
        pace += 0.05 * rng_normal(rng) + 0.05 * (1 - pace);
        // A hard one also halts for half a second now and then, and leaves out as much.
        const double dice = hard ? rng_uniform(rng) : 1;
        halted = dice < 0.03 ? 15 : halted - 1;
        time_s += halted > 0 ? 0 : fmax(0, pace) / MOVEMENT_RATE_HZ + (dice > 0.97 && dice < 1 ? 0.5 : 0);
    }
    // And it goes to and fro, a little further each time: coarse frames do not say which time it is.
    for (int i = 0; i < FRAMES && hard; i++) {
        a_s[i] = (1 + 0.05 * a_s[i]) * sin(6.28 * a_s[i] / 1.1);
        b_s[i] = (1 + 0.05 * b_s[i]) * sin(6.28 * b_s[i] / 1.1);
    }
    enum status status = features_at(&limbs, a_s, FRAMES, 0.005, rng, &p->a);
    if (status == OK)
        status = features_at(&limbs, b_s, FRAMES, 0.02, rng, &p->b);
    p->fa = (struct features){p->a, FRAMES};
    p->fb = (struct features){p->b, FRAMES};
    struct alignment x = {0};
    if (status == OK)
        status = align_plain(&p->fa, &p->fb, &prices, &x);
    p->best = x.price;
    alignment_free(&x);
    return status;
}

struct contender {
    const struct pair *pairs;
    int radius; // 0: exact; -1: plain
};

static enum status measure(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    const struct pair *p = &c->pairs[item];
    struct alignment x = {0};
    const double started_ms = bench_clock_ms();
    enum status status;
    if (c->radius < 0)
        status = align_plain(&p->fa, &p->fb, &prices, &x);
    else if (!c->radius)
        status = align(&p->fa, &p->fb, &prices, &x);
    else
        status = align_corridor(&p->fa, &p->fb, &prices, c->radius, &x);
    out->time_ms = bench_clock_ms() - started_ms;
    out->error = 100 * ((double)x.price / (double)p->best - 1);
    out->extra[0] = (double)x.cells / (FRAMES * FRAMES);
    alignment_free(&x);
    return status;
}

// How different each pair of frames is, bright: alike; green: the best alignment, red: the contender's.
static enum status draw_alignment(struct bench *b, const struct pair *p, const char *name, int32_t radius)
{
    struct alignment best = {0}, x = {0};
    char caption[100];
    uint8_t *rgb = malloc((size_t)3 * FRAMES * FRAMES);
    enum status status = rgb ? align(&p->fa, &p->fb, &prices, &best) : fail(ERR_MEMORY, "no memory for a picture");
    if (status == OK)
        status = radius ? align_corridor(&p->fa, &p->fb, &prices, radius, &x) : align(&p->fa, &p->fb, &prices, &x);
    for (int i = 0; i < FRAMES && status == OK; i++)
        for (int j = 0; j < FRAMES; j++) {
            const double c = feature_cost(&p->a[i], &p->b[j]) / (double)(FEATURE_UNIT * FEATURE_UNIT);
            memset(rgb + 3 * (i * FRAMES + j), (int)(220 / (1 + c)), 3);
        }
    const struct alignment *drawn[] = {&best, &x};
    static const uint8_t color[][3] = {{60, 200, 60}, {240, 60, 40}};
    const struct drawing d = {rgb, FRAMES, FRAMES, FRAMES};
    for (size_t k = 0; k < COUNT_OF(drawn) && status == OK; k++)
        for (int32_t i = 0; i < drawn[k]->count; i++) {
            const struct pixel at = {drawn[k]->pairs[i].b, drawn[k]->pairs[i].a};
            drawing_put_line(&d, at, at, k ? 0.4 : 1.4, color[k]);
        }
    if (status == OK) {
        snprintf(caption, sizeof caption, "%s: %.1f %% above the best price; bright: alike; green: the best", name,
                 100 * ((double)x.price / (double)p->best - 1));
        bench_picture(b, caption, rgb, FRAMES, FRAMES);
    }
    alignment_free(&best);
    alignment_free(&x);
    free(rgb);
    return status;
}

static double scalar_cost(const struct feature_frame *a, const struct feature_frame *b)
{
    double sum = 0;
    for (int k = 0; k < 3 * PART_COUNT; k++) {
        const double d = (double)a->number[k] - b->number[k];
        sum += d * d;
    }
    return sum;
}

// What a user writes: all cells, in doubles, the whole table kept.
static enum status measure_textbook(void *self, int item, struct bench_measure *out)
{
    static double price[FRAMES][FRAMES];
    const struct pair *p = &((const struct contender *)self)->pairs[item];
    const double started_ms = bench_clock_ms();
    double best = INFINITY;
    for (int i = 0; i < FRAMES; i++)
        for (int j = 0; j < FRAMES; j++) {
            const double c = scalar_cost(&p->a[i], &p->b[j]);
            double least = (double)prices.skip_a * i + (double)prices.skip_b * j + 2 * c;
            if (i && j)
                least = fmin(least, price[i - 1][j - 1] + 2 * c);
            if (i)
                least = fmin(least, price[i - 1][j] + c + prices.step);
            if (j)
                least = fmin(least, price[i][j - 1] + c + prices.step);
            price[i][j] = least;
            best =
                fmin(best, least + (double)prices.skip_a * (FRAMES - 1 - i) + (double)prices.skip_b * (FRAMES - 1 - j));
        }
    out->time_ms = bench_clock_ms() - started_ms;
    out->error = 100 * (best / (double)p->best - 1);
    out->extra[0] = 1;
    return OK;
}

static enum status run(struct bench *b)
{
    static struct pair pairs[ITEMS];
    struct rng rng = {SEED};
    enum status status = OK;
    printf("compare: seed %llu\n", (unsigned long long)SEED);
    for (int i = 0; i < ITEMS && status == OK; i++)
        status = make_pair(&pairs[i], i % 3 == 2, &rng);
    struct contender exact = {pairs, 0}, plain = {pairs, -1}, r1 = {pairs, 1}, r3 = {pairs, 3}, r10 = {pairs, 10},
                     r30 = {pairs, 30};
    const struct bench_contender contenders[] = {
        {"ours, exact", measure, &exact, false},      {"plain, textbook", measure_textbook, &plain, true},
        {"plain, our costs", measure, &plain, false}, {"FastDTW, radius 1", measure, &r1, false},
        {"FastDTW, radius 3", measure, &r3, false},   {"FastDTW, radius 10", measure, &r10, false},
        {"FastDTW, radius 30", measure, &r30, false},
    };
    if (status == OK)
        status = bench_run(b, contenders, COUNT_OF(contenders), ITEMS);
    // A hard pair.
    if (status == OK)
        status = draw_alignment(b, &pairs[2], "exact", 0);
    if (status == OK)
        status = draw_alignment(b, &pairs[2], "FastDTW, radius 10", 10);
    if (status == OK)
        status = draw_alignment(b, &pairs[2], "FastDTW, radius 1", 1);
    for (int i = 0; i < ITEMS; i++) {
        free(pairs[i].a);
        free(pairs[i].b);
    }
    return status;
}

const struct bench_stage bench_stage_compare = {
    .name = "compare",
    .about = "time alignment of two movements, next to the plain way and FastDTW",
    .error_name = "excess_percent",
    .time_name = "time_ms",
    .extra_names = {"cells"},
    .run = run,
};
