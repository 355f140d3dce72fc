#include "compare/repetitions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    THIN = 4,           // 30 Hz to 7.5 Hz
    MAX_SEARCHED = 900, // thinned frames in which a cycle is searched: two minutes
    MIN_CYCLE = 6,      // thinned frames: 0.8 s
    MAX_LAGS = 12,      // candidates for the length, and as many halves of them
    SHIFTS = 12,        // candidates for the start, in a cycle
    TREND = 2,          // cycles to both sides over which a mean is taken out
};
// As shares of the mean cost of two frames of the movement. By hand, on exercises 1 and 2 of KIMORE.
static const double IDLE = 0.5, STAY = 0.02, QUIET = 0.08;
// A cycle explains the rest of the movement below this price, else the movement does not repeat itself.
static const double MAX_PRICE = 0.45;
// A repetition's mean price, as a share of idling, is at most this above the median repetition's. Chosen on 39 files of
// KIMORE counted by eye: what is a repetition is at most 0.27 above it, what is none 0.355 and more.
static const double MAX_UNLIKE = 0.33;
// A part does not repeat itself with the others if more of its variance is left from cycle to cycle than this, and than
// so many times what is left of the best part's.
static const double LEFT_MIN = 0.5, LEFT_FACTOR = 2;
// The best part's, else the lag is none.
static const double MAX_LEFT = 1;
// A longer cycle must be cheaper than a shorter one by this factor and by this.
static const double LONGER_GAIN = 0.6, LONGER_MARGIN = 0.03;

void repetition_list_free(struct repetition_list *list)
{
    free(list->spans);
    *list = (struct repetition_list){0};
}

// ------------------------------------------------------------- one-pass search

struct model {
    const struct feature_frame *cycle;
    int32_t length;
    int64_t idle, stay; // prices
    bool alike;         // repetitions are about as like the cycle as each other
};

struct trace {
    int64_t *here, *before;             // [length + 1] prices; the last is idle
    int32_t *start_here, *start_before; // frame where the cycle that is being gone through began
    uint8_t *idle_from_end;             // [count] idle after a completed cycle
    int32_t *end_start;                 // [count] the start of the cycle that is completed at this frame
    int64_t *end_price, *idle_price;    // [count]
    uint8_t *started_from_end;          // [count] a cycle beginning here follows a completed one
};

static bool trace_open(struct trace *trace, int32_t length, int32_t count)
{
    const size_t n = (size_t)length + 1, m = (size_t)count;
    trace->here = malloc(n * sizeof *trace->here);
    trace->before = malloc(n * sizeof *trace->before);
    trace->start_here = malloc(n * sizeof *trace->start_here);
    trace->start_before = malloc(n * sizeof *trace->start_before);
    trace->idle_from_end = calloc(m, 1);
    trace->started_from_end = calloc(m, 1);
    trace->end_start = malloc(m * sizeof *trace->end_start);
    trace->end_price = malloc(m * sizeof *trace->end_price);
    trace->idle_price = malloc(m * sizeof *trace->idle_price);
    return trace->here && trace->before && trace->start_here && trace->start_before && trace->idle_from_end &&
           trace->started_from_end && trace->end_start && trace->end_price && trace->idle_price;
}

static void trace_close(struct trace *trace)
{
    free(trace->here);
    free(trace->before);
    free(trace->start_here);
    free(trace->start_before);
    free(trace->idle_from_end);
    free(trace->started_from_end);
    free(trace->end_start);
    free(trace->end_price);
    free(trace->idle_price);
}

static const int64_t NEVER = INT64_MAX / 4;

// The cheapest place to come from for place k at frame j.
static void advance_trace(const struct model *model, struct trace *trace, int32_t j, int32_t k, int64_t entry)
{
    int64_t best = j ? trace->before[k] + model->stay : NEVER;
    int32_t start = j ? trace->start_before[k] : 0;
    if (j && k > 0 && trace->before[k - 1] < best) {
        best = trace->before[k - 1];
        start = trace->start_before[k - 1];
    }
    if (j && k > 1 && trace->before[k - 2] + model->stay < best) {
        best = trace->before[k - 2] + model->stay;
        start = trace->start_before[k - 2];
    }
    // The first and the last fifth of a cycle may be missing, at the price of idling through them.
    if (5 * k <= model->length && entry + model->idle * k < best) {
        best = entry + model->idle * k;
        start = j;
    }
    trace->here[k] = best;
    trace->start_here[k] = start;
}

// Goes through all frames. The prices at the end are in idle_price and end_price.
static void trace_frames(const struct model *model, const struct features *features, struct trace *trace)
{
    for (int32_t j = 0; j < features->count; j++) {
        const int64_t idle_before = j ? trace->idle_price[j - 1] : 0, end_before = j ? trace->end_price[j - 1] : NEVER;
        const int64_t entry = idle_before < end_before ? idle_before : end_before;
        trace->started_from_end[j] = end_before < idle_before;
        trace->idle_from_end[j] = end_before < idle_before;
        trace->idle_price[j] = entry + model->idle;
        for (int32_t k = 0; k < model->length; k++) {
            advance_trace(model, trace, j, k, entry);
            if (trace->here[k] < NEVER)
                trace->here[k] += feature_cost(&model->cycle[k], &features->frames[j]);
        }
        trace->end_price[j] = NEVER;
        for (int32_t k = model->length - 1; 5 * (model->length - 1 - k) <= model->length; k--)
            if (trace->here[k] < NEVER &&
                trace->here[k] + model->idle * (model->length - 1 - k) < trace->end_price[j]) {
                trace->end_price[j] = trace->here[k] + model->idle * (model->length - 1 - k);
                trace->end_start[j] = trace->start_here[k];
            }
        int64_t *swap = trace->before;
        trace->before = trace->here;
        trace->here = swap;
        int32_t *swap_start = trace->start_before;
        trace->start_before = trace->start_here;
        trace->start_here = swap_start;
    }
}

// Follows the explanation back from the last frame. spans NULL: only counts.
static int32_t spans_of(const struct trace *trace, int32_t count, struct repetition_span *spans)
{
    int32_t found = 0;
    bool in_cycle = count && trace->end_price[count - 1] < trace->idle_price[count - 1];
    for (int32_t j = count - 1; j >= 0;) {
        if (in_cycle) {
            if (spans)
                spans[found] = (struct repetition_span){trace->end_start[j], j + 1};
            found++;
            const int32_t start = trace->end_start[j];
            in_cycle = trace->started_from_end[start];
            j = start - 1;
        } else {
            in_cycle = trace->idle_from_end[j];
            j--;
        }
    }
    for (int32_t k = 0; spans && k < found / 2; k++) {
        const struct repetition_span swap = spans[k];
        spans[k] = spans[found - 1 - k];
        spans[found - 1 - k] = swap;
    }
    return found;
}

static int64_t entry_price(const struct trace *trace, int32_t j)
{
    if (!j)
        return 0;
    return trace->end_price[j - 1] < trace->idle_price[j - 1] ? trace->end_price[j - 1] : trace->idle_price[j - 1];
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// What resembles the cycle far less than the other repetitions do is none: getting ready, walking off.
static enum status drop_outliers(const struct model *model, const struct trace *trace, struct repetition_list *list)
{
    double *price = malloc(2 * (size_t)(list->count ? list->count : 1) * sizeof *price);
    if (!price)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    double *sorted = price + list->count;
    for (int32_t k = 0; k < list->count; k++) {
        const struct repetition_span s = list->spans[k];
        price[k] = sorted[k] = (double)(trace->end_price[s.end - 1] - entry_price(trace, s.first)) /
                               (double)model->idle / (s.end - s.first);
    }
    qsort(sorted, (size_t)list->count, sizeof *sorted, by_size);
    int32_t kept = 0;
    for (int32_t k = 0; k < list->count; k++)
        if (price[k] <= sorted[list->count / 2] + MAX_UNLIKE)
            list->spans[kept++] = list->spans[k];
    list->count = kept;
    free(price);
    return OK;
}

static enum status search_repetitions(const struct model *model, const struct features *features,
                                      struct repetition_list *out, int64_t *price)
{
    struct trace t = {0};
    enum status status =
        trace_open(&t, model->length, features->count) ? OK : fail(ERR_MEMORY, "no memory to find repetitions");
    if (status == OK) {
        trace_frames(model, features, &t);
        *price = entry_price(&t, features->count);
        out->count = spans_of(&t, features->count, NULL);
        out->spans = malloc((size_t)(out->count ? out->count : 1) * sizeof *out->spans);
        if (out->spans)
            spans_of(&t, features->count, out->spans);
        else
            status = fail(ERR_MEMORY, "no memory to find repetitions");
        if (status == OK && model->alike)
            status = drop_outliers(model, &t, out);
    }
    trace_close(&t);
    return status;
}

// ------------------------------------------------------------- the cycle

struct thinned {
    struct feature_frame *frames;
    struct features all;
};

static enum status thin_features(const struct features *features, struct thinned *out)
{
    const int32_t count = (features->count + THIN - 1) / THIN;
    out->frames = malloc((size_t)count * sizeof *out->frames);
    if (!out->frames)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    for (int32_t i = 0; i < count; i++)
        out->frames[i] = features->frames[i * THIN];
    out->all = (struct features){out->frames, count};
    return OK;
}

// The part of the movement, of at most MAX_SEARCHED frames, in which successive frames differ most in sum.
static struct features liveliest_part(const struct features *features)
{
    if (features->count <= MAX_SEARCHED)
        return *features;
    int64_t sum = 0, best = -1;
    int32_t at = 0;
    for (int32_t i = 1; i < features->count; i++) {
        sum += feature_cost(&features->frames[i], &features->frames[i - 1]);
        if (i > MAX_SEARCHED)
            sum -= feature_cost(&features->frames[i - MAX_SEARCHED], &features->frames[i - MAX_SEARCHED - 1]);
        if (i >= MAX_SEARCHED && sum > best) {
            best = sum;
            at = i - MAX_SEARCHED + 1;
        }
    }
    return (struct features){features->frames + at, MAX_SEARCHED};
}

// Mean cost of two frames `lag` apart; [count / 2 + 1] numbers. Returns the mean over all lags.
static double self_costs(const struct features *features, double *cost)
{
    double sum = 0;
    const int32_t max = features->count / 2;
    for (int32_t lag = 1; lag <= max; lag++) {
        double of_lag = 0;
        for (int32_t i = 0; i + lag < features->count; i++)
            of_lag += feature_cost(&features->frames[i], &features->frames[i + lag]);
        cost[lag] = of_lag / (features->count - lag);
        sum += cost[lag];
    }
    return max ? sum / max : 0;
}

// The lags with the lowest local minima, at most MAX_LAGS, shortest first.
static int choose_lags(const double *cost, int32_t max, double mean, int32_t lag[MAX_LAGS])
{
    int count = 0;
    for (int32_t k = MIN_CYCLE; k <= max; k++) {
        const bool lowest = cost[k] < cost[k - 1] && (k == max || cost[k] <= cost[k + 1]);
        if (!lowest || cost[k] > 0.9 * mean)
            continue;
        if (count < MAX_LAGS) {
            lag[count++] = k;
            continue;
        }
        int worst = 0;
        for (int n = 1; n < count; n++)
            worst = cost[lag[n]] > cost[lag[worst]] ? n : worst;
        if (cost[k] < cost[lag[worst]]) {
            memmove(&lag[worst], &lag[worst + 1], (size_t)(count - worst - 1) * sizeof *lag);
            lag[count - 1] = k;
        }
    }
    return count;
}

static int compare_int32(const void *a, const void *b)
{
    const int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

// Adds the halves that are not there: where the pace changes, two cycles may be found and one alone not.
static int add_halves(int32_t lag[2 * MAX_LAGS], int lags)
{
    int count = lags;
    for (int k = 0; k < lags; k++) {
        const int32_t half = lag[k] / 2;
        bool there = half < MIN_CYCLE;
        for (int n = 0; n < count; n++)
            there = there || 8 * abs(lag[n] - half) <= half;
        if (!there)
            lag[count++] = half;
    }
    qsort(lag, (size_t)count, sizeof *lag, compare_int32);
    return count;
}

// Does a cycle from `first` go somewhere, compared with what the movement's frames differ by?
static bool goes_somewhere(const struct features *features, int32_t first, int32_t length, double mean)
{
    int32_t max = 0;
    for (int32_t k = 1; k < length; k++) {
        const int32_t c = feature_cost(&features->frames[first], &features->frames[first + k]);
        max = c > max ? c : max;
    }
    return max >= mean;
}

struct best_cycle {
    struct repetition_span span;
    double price; // mean, outside the cycle itself, as a share of the mean cost
    double mean;  // cost of two frames, trend taken out
    uint16_t restless;
};

// Mean cost of two frames of the movement.
static double mean_cost(const struct features *features)
{
    double sum = 0;
    int64_t count = 0;
    for (int32_t i = 0; i < features->count; i++)
        for (int32_t k = i % 7; k < features->count; k += 7, count++)
            sum += feature_cost(&features->frames[i], &features->frames[k]);
    return count ? sum / (double)count : 0;
}

static enum status try_starts(const struct features *features, int32_t lag, struct best_cycle *of_lag)
{
    const int32_t shift = lag / SHIFTS > 0 ? lag / SHIFTS : 1;
    const double mean = of_lag->mean;
    enum status status = OK;
    for (int32_t first = 0; first + lag <= features->count && status == OK; first += shift) {
        if (!goes_somewhere(features, first, lag, mean))
            continue;
        const struct model m = {features->frames + first, lag, (int64_t)(IDLE * mean), (int64_t)(STAY * mean), false};
        struct repetition_list found = {0};
        int64_t price = 0;
        status = search_repetitions(&m, features, &found, &price);
        const double share = (double)price / mean / (features->count - lag);
        if (status == OK && found.count >= 2 && share < of_lag->price) {
            of_lag->span = (struct repetition_span){first, first + lag};
            of_lag->price = share;
        }
        repetition_list_free(&found);
    }
    return status;
}

// Takes out the mean over `half` frames to both sides: people shift their stance from one repetition to the next.
static enum status detrend_features(const struct features *features, int32_t half, struct feature_frame **out)
{
    struct feature_frame *to = *out = malloc((size_t)features->count * sizeof **out);
    if (!to)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    for (int n = 0; n < FEATURE_NUMBERS; n++) {
        int64_t sum = 0;
        int32_t first = 0, end = 0;
        for (int32_t i = 0; i < features->count; i++) {
            for (; end < features->count && end <= i + half; end++)
                sum += features->frames[end].number[n];
            for (; first < i - half; first++)
                sum -= features->frames[first].number[n];
            to[i].number[n] = (int16_t)(features->frames[i].number[n] - sum / (end - first));
        }
    }
    return OK;
}

// A part's numbers, three after another.
enum { PART_NUMBERS = 3, PARTS = FEATURE_NUMBERS / PART_NUMBERS };

// How much of a part's variance is left between frames `lag` apart: 0 where it repeats itself, 1 where it does not.
static double part_dissimilarity(const struct features *features, int32_t lag, int part, double *variance)
{
    double sum = 0, square = 0;
    for (int n = part * PART_NUMBERS; n < (part + 1) * PART_NUMBERS; n++) {
        for (int32_t i = 0; i < features->count; i++)
            square += (double)features->frames[i].number[n] * features->frames[i].number[n];
        for (int32_t i = 0; i + lag < features->count; i++) {
            const double d = (double)features->frames[i].number[n] - features->frames[i + lag].number[n];
            sum += d * d;
        }
    }
    *variance = square / features->count;
    return *variance > 0 ? sum / (features->count - lag) / (2 * *variance) : 1;
}

// Parts (bits) that do not repeat themselves with the others, such as legs that a tracker loses. features: without
// trend.
static uint16_t restless_parts(const struct features *features, int32_t lag, double *best_left)
{
    double left[PARTS], variance[PARTS], max = 0, min = 2;
    uint16_t restless = 0;
    for (int p = 0; p < PARTS; p++) {
        left[p] = part_dissimilarity(features, lag, p, &variance[p]);
        max = fmax(max, variance[p]);
    }
    for (int p = 0; p < PARTS; p++)
        if (variance[p] > 0.3 * max)
            min = fmin(min, left[p]);
    *best_left = min;
    for (int p = 0; p < PARTS; p++)
        restless |= (uint16_t)((min < LEFT_MIN && left[p] > fmax(LEFT_MIN, LEFT_FACTOR * min)) << p);
    return restless;
}

static void zero_parts(struct feature_frame *frames, int32_t count, uint16_t parts)
{
    for (int32_t i = 0; i < count; i++)
        for (int n = 0; n < PARTS * PART_NUMBERS; n++)
            frames[i].number[n] = parts >> n / PART_NUMBERS & 1 ? 0 : frames[i].number[n];
}

static enum status try_lag(const struct features *features, int32_t lag, struct best_cycle *best)
{
    struct best_cycle of_lag = {.price = 1e9};
    double left = 1;
    struct feature_frame *level = NULL;
    enum status status = detrend_features(features, TREND * lag, &level);
    if (status == OK) {
        const struct features flat = {level, features->count};
        of_lag.restless = restless_parts(&flat, lag, &left);
        zero_parts(level, features->count, of_lag.restless);
        of_lag.mean = mean_cost(&flat);
        if (of_lag.mean > 0 && left < MAX_LEFT)
            status = try_starts(&flat, lag, &of_lag);
    }
    free(level);
    if (of_lag.price < LONGER_GAIN * best->price - LONGER_MARGIN)
        *best = of_lag;
    return status;
}

static void expand_spans(struct repetition_list *list, int32_t count)
{
    for (int32_t k = 0; k < list->count; k++) {
        list->spans[k].first *= THIN;
        list->spans[k].end = list->spans[k].end * THIN < count ? list->spans[k].end * THIN : count;
    }
}

// Numbers that vary little beside the one that varies most hold noise: they become 0.
static void zero_quiet_numbers(struct feature_frame *frame, int32_t count)
{
    double variance[FEATURE_NUMBERS], max = 0;
    for (int n = 0; n < FEATURE_NUMBERS; n++) {
        double sum = 0, square = 0;
        for (int32_t i = 0; i < count; i++) {
            sum += frame[i].number[n];
            square += (double)frame[i].number[n] * frame[i].number[n];
        }
        variance[n] = square / count - sum / count * (sum / count);
        max = fmax(max, variance[n]);
    }
    for (int n = 0; n < FEATURE_NUMBERS; n++)
        for (int32_t i = 0; i < count && variance[n] < QUIET * max; i++)
            frame[i].number[n] = 0;
}

static enum status find_repetitions(const struct features *features, int32_t count, struct repetition_list *out)
{
    const struct features searched = liveliest_part(features);
    const int32_t max = searched.count / 2;
    double *cost = malloc(((size_t)max + 2) * sizeof *cost);
    if (!cost)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    int32_t lag[2 * MAX_LAGS];
    cost[0] = 0;
    const double mean = self_costs(&searched, cost);
    const int lags = mean > 0 ? add_halves(lag, choose_lags(cost, max, mean, lag)) : 0;
    struct best_cycle best = {.price = 1e9};
    enum status status = OK;
    free(cost);
    for (int k = 0; k < lags && status == OK; k++)
        status = try_lag(&searched, lag[k], &best);
    if (status != OK || best.price > MAX_PRICE)
        return status;
    const int32_t length = best.span.end - best.span.first, at = (int32_t)(searched.frames - features->frames);
    struct feature_frame *level = NULL;
    int64_t price;
    status = detrend_features(features, TREND * length, &level);
    if (status == OK) {
        zero_parts(level, features->count, best.restless);
        const struct model m = {level + at + best.span.first, length, (int64_t)(IDLE * best.mean),
                                (int64_t)(STAY * best.mean), true};
        const struct features all = {level, features->count};
        status = search_repetitions(&m, &all, out, &price);
    }
    free(level);
    out->cycle = (struct repetition_span){(at + best.span.first) * THIN, (at + best.span.end) * THIN};
    if (status == OK && out->count >= 2)
        expand_spans(out, count);
    else
        repetition_list_free(out);
    return status;
}

enum status repetitions_find(const struct features *f, struct repetition_list *out)
{
    struct thinned t = {0};
    *out = (struct repetition_list){0};
    if (f->count < 2 * MIN_CYCLE * THIN)
        return OK;
    enum status status = thin_features(f, &t);
    if (status == OK) {
        zero_quiet_numbers(t.frames, t.all.count);
        status = find_repetitions(&t.all, f->count, out);
    }
    free(t.frames);
    if (status != OK)
        repetition_list_free(out);
    return status;
}

// Where `cycle` occurs in f, once or several times.
static enum status repetitions_of(const struct features *cycle, const struct features *features,
                                  struct repetition_list *out)
{
    struct thinned c = {0}, t = {0};
    *out = (struct repetition_list){0};
    enum status status = thin_features(cycle, &c);
    if (status == OK)
        status = thin_features(features, &t);
    if (status == OK) {
        double mean = 0;
        for (int32_t i = 0; i < c.all.count; i++)
            for (int32_t k = 0; k < c.all.count; k += 3)
                mean += feature_cost(&c.frames[i], &c.frames[k]);
        mean /= (double)c.all.count * ((c.all.count + 2) / 3);
        // Another person's cycle is never as near as one's own: idle costs what a wrong pose of the cycle does.
        const struct model m = {c.frames, c.all.count, (int64_t)mean, (int64_t)(STAY * mean), false};
        int64_t price;
        status = search_repetitions(&m, &t.all, out, &price);
    }
    if (status == OK)
        expand_spans(out, features->count);
    else
        repetition_list_free(out);
    free(c.frames);
    free(t.frames);
    return status;
}

// ---------------------------------------------------------------- performances

enum { MAX_REFERENCES = 12 };
// Of what a movement moves at least this share lies in its repetitions, else it is more than they are. By hand.
static const double MIN_COVERED = 0.75;

void performances_free(struct performances *performances)
{
    free(performances->at);
    *performances = (struct performances){0};
}

struct side {
    const struct movement *movement;
    const struct feature_frame *frames, *plain; // for alignments; for finding repetitions
    struct repetition_list list;
    double moved[PART_COUNT]; // what its repetitions have in common
};

// The standard deviation of a part's directions over a cycle, after the mean over all repetitions; what a mean of so
// many would have by chance is taken off.
static void measure_moved(struct side *side)
{
    enum { BINS = 16 };
    for (int p = 0; p < PART_COUNT; p++) {
        double bin[BINS][4] = {{0}}, square = 0, all[4] = {0}, of_means = 0, bins = 0;
        for (int32_t k = 0; k < side->list.count; k++) {
            const struct repetition_span span = side->list.spans[k];
            for (int32_t f = span.first; f < span.end; f++) {
                const struct movement_frame *frame = &side->movement->frames[f];
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
        side->moved[p] = sqrt(fmax(0, between - within / side->list.count));
    }
}

static struct movement movement_piece(const struct movement *movement, struct repetition_span span)
{
    struct movement out = *movement;
    out.frames = movement->frames + span.first;
    out.count = span.end - span.first;
    return out;
}

// The share of what a movement moves (the sum of its frames' differences) that lies in the spans.
static double covered_share(const struct side *side)
{
    double covered = 0, all = 1e-9;
    int32_t next = 0;
    for (int32_t f = 1; f < side->movement->count; f++) {
        const double step = sqrt(feature_cost(&side->plain[f], &side->plain[f - 1]));
        while (next < side->list.count && side->list.spans[next].end <= f)
            next++;
        all += step;
        covered += next < side->list.count && side->list.spans[next].first <= f ? step : 0;
    }
    return covered / all;
}

static void forget_uncovered(struct side *side)
{
    if (side->list.count && covered_share(side) < MIN_COVERED)
        repetition_list_free(&side->list);
}

// The alignment of two performances, and what they have in common.
static enum status judge_pair(const struct side *a, const struct side *b, const struct performance_terms *judging,
                              struct performance *out, struct alignment *x)
{
    const struct movement ma = movement_piece(a->movement, out->reference),
                          mb = movement_piece(b->movement, out->attempt);
    const struct features fa = {a->frames + out->reference.first, ma.count},
                          fb = {b->frames + out->attempt.first, mb.count};
    const enum status status = align(&fa, &fb, judging->prices, x);
    if (status != OK)
        return status;
    struct pair_sums sums = {.ignored = judging->by->ignored};
    pair_sums_add(&sums, &ma, &mb, x);
    noise_sums_add(sums.noise[0], &ma, 0, ma.count);
    noise_sums_add(sums.noise[1], &mb, 0, mb.count);
    const struct score_terms terms = score_posture(&sums, a->list.count >= 2 ? a->moved : NULL, judging->by);
    out->score = score_from_terms(&terms);
    return OK;
}

static enum status put_timeline(const struct side *a, const struct side *b, const struct performance *performance,
                                const struct alignment *x, struct timeline *timeline)
{
    const struct repetition_span ra = performance->reference, rb = performance->attempt;
    const struct features fa = {a->frames + ra.first, ra.end - ra.first},
                          fb = {b->frames + rb.first, rb.end - rb.first};
    struct timeline piece = {0};
    const enum status status = timeline_from_alignment(x, &fa, &fb, &piece);
    for (int32_t f = 0; f < piece.count; f++)
        timeline->reference[rb.first + f] = piece.reference[f] + (float)ra.first;
    timeline_free(&piece);
    return status;
}

static struct repetition_span common_span(struct repetition_span a, struct repetition_span b)
{
    const int32_t first = a.first > b.first ? a.first : b.first, end = a.end < b.end ? a.end : b.end;
    return (struct repetition_span){first, end > first ? end : first};
}

// Cuts it to what counts and realigns it into *x. NOTHING: this repetition shows none of it.
static enum status cut_performance(const struct side *a, const struct side *b, const struct performance_terms *judging,
                                   struct performance *performance, struct alignment *x)
{
    enum { FEWEST = 5 }; // frames that are a stretch
    const struct repetition_span wanted = common_span(performance->reference, *judging->within);
    struct performance cut = {.reference = wanted, .attempt = {-1, 0}};
    for (int32_t k = 0; k < x->count; k++) {
        const int32_t at = performance->reference.first + x->pairs[k].a,
                      shown = performance->attempt.first + x->pairs[k].b;
        if (at < wanted.first || at >= wanted.end)
            continue;
        cut.attempt.first = cut.attempt.first < 0 ? shown : cut.attempt.first;
        cut.attempt.end = shown + 1;
    }
    if (cut.attempt.end - cut.attempt.first < FEWEST || wanted.end - wanted.first < FEWEST)
        return NOTHING;
    alignment_free(x);
    *performance = cut;
    return judge_pair(a, b, judging, performance, x);
}

static enum status judge_repetition(const struct side *a, const struct side *b, const struct performance_terms *judging,
                                    struct performance *best, struct timeline *timeline, struct pair_sums *sums)
{
    const int32_t references = a->list.count < MAX_REFERENCES ? a->list.count : MAX_REFERENCES;
    struct alignment of_best = {0};
    enum status status = OK;
    for (int32_t n = 0; n < references && status == OK; n++) {
        struct performance tried = {.attempt = best->attempt, .reference = a->list.spans[n]};
        struct alignment x = {0};
        status = judge_pair(a, b, judging, &tried, &x);
        if (status == OK && (!n || tried.score > best->score)) {
            const struct alignment swap = of_best;
            of_best = x;
            x = swap;
            *best = tried;
        }
        alignment_free(&x);
    }
    if (status == OK && judging->within)
        status = cut_performance(a, b, judging, best, &of_best);
    if (status == OK) {
        const struct movement ma = movement_piece(a->movement, best->reference),
                              mb = movement_piece(b->movement, best->attempt);
        pair_sums_add(sums, &ma, &mb, &of_best);
        status = put_timeline(a, b, best, &of_best, timeline);
    }
    alignment_free(&of_best);
    return status;
}

static enum status judge_all(const struct side *a, const struct side *b, const struct performance_terms *judging,
                             struct timeline *timeline, struct performances *out)
{
    enum status status = OK;
    out->sums.ignored = judging->by->ignored;
    out->at = calloc((size_t)b->list.count, sizeof *out->at);
    timeline->count = b->movement->count;
    timeline->reference = malloc((size_t)timeline->count * sizeof *timeline->reference);
    if (!out->at || !timeline->reference)
        return fail(ERR_MEMORY, "no memory to judge repetitions");
    for (int32_t f = 0; f < timeline->count; f++)
        timeline->reference[f] = NAN;
    for (int32_t k = 0; k < b->list.count && status == OK; k++) {
        struct performance *next = &out->at[out->count];
        *next = (struct performance){.attempt = b->list.spans[k]};
        status = judge_repetition(a, b, judging, next, timeline, &out->sums);
        out->count += status == OK;
        status = status == NOTHING ? OK : status;
    }
    out->reference_count = a->list.count;
    noise_sums_add(out->sums.noise[0], a->movement, 0, a->movement->count);
    noise_sums_add(out->sums.noise[1], b->movement, 0, b->movement->count);
    return status;
}

// Where a side's own repetitions were not found: as often as the other's cycle occurs in it.
static enum status find_by(const struct side *other, struct repetition_span cycle, struct side *side)
{
    const struct features of_cycle = {other->plain + cycle.first, cycle.end - cycle.first},
                          all = {side->plain, side->movement->count};
    const enum status status = repetitions_of(&of_cycle, &all, &side->list);
    if (status == OK)
        forget_uncovered(side);
    return status;
}

static enum status one_span(struct side *side, struct repetition_span span)
{
    side->list.spans = malloc(sizeof *side->list.spans);
    if (!side->list.spans)
        return fail(ERR_MEMORY, "no memory to find repetitions");
    side->list.spans[0] = span;
    side->list.count = 1;
    return OK;
}

// The frames from the first to the last that differ from their neighbours: without standing still before and after.
static struct repetition_span moving_span(const struct side *side)
{
    enum { STILL = FEATURE_UNIT * FEATURE_UNIT / 20000 }; // squared; some half a degree of one part in a frame
    struct repetition_span span = {0, side->movement->count};
    while (span.first + 1 < span.end && feature_cost(&side->plain[span.first], &side->plain[span.first + 1]) < STILL)
        span.first++;
    while (span.end - 1 > span.first && feature_cost(&side->plain[span.end - 1], &side->plain[span.end - 2]) < STILL)
        span.end--;
    return span.end - span.first >= MIN_CYCLE * THIN ? span : (struct repetition_span){0, side->movement->count};
}

static struct repetition_span middle_span(const struct repetition_list *list) { return list->spans[list->count / 2]; }

static int32_t middle_length(const struct repetition_list *list)
{
    const struct repetition_span middle = middle_span(list);
    return middle.end - middle.first;
}

// Repetitions of `whole`, one performance, in the other movement.
static enum status find_of_whole(struct side *whole, struct side *other)
{
    const struct repetition_span span = moving_span(whole);
    repetition_list_free(&whole->list);
    repetition_list_free(&other->list);
    const enum status status = find_by(whole, span, other);
    return status == OK && other->list.count >= 2 ? one_span(whole, span) : status;
}

// Cycles of very different lengths are not the same thing: the longer one is looked for in the other movement.
static enum status level_cycles(struct side *a, struct side *b)
{
    const double most = 1.6; // by hand
    struct side *longer = middle_length(&a->list) >= middle_length(&b->list) ? a : b, *shorter = longer == a ? b : a;
    if (middle_length(&longer->list) <= most * middle_length(&shorter->list))
        return OK;
    const struct repetition_list kept = shorter->list;
    shorter->list = (struct repetition_list){0};
    const enum status status = find_by(longer, middle_span(&longer->list), shorter);
    if (shorter->list.count) {
        struct repetition_list old = kept;
        repetition_list_free(&old);
    } else {
        shorter->list = kept;
    }
    return status;
}

// Both lists, or neither: of a movement that is one performance the one span that it is.
static enum status find_both(struct side *a, struct side *b)
{
    const struct features fa = {a->plain, a->movement->count}, fb = {b->plain, b->movement->count};
    enum status status = repetitions_find(&fa, &a->list);
    if (status == OK)
        status = repetitions_find(&fb, &b->list);
    forget_uncovered(a);
    forget_uncovered(b);
    if (status == OK && a->list.count && b->list.count)
        status = level_cycles(a, b);
    else if (status == OK && a->list.count)
        status = find_by(a, middle_span(&a->list), b);
    else if (status == OK) {
        status = find_of_whole(a, b);
        if (status == OK && !a->list.count)
            status = find_of_whole(b, a);
    }
    if (!a->list.count || !b->list.count || (a->list.count < 2 && b->list.count < 2)) {
        repetition_list_free(&a->list);
        repetition_list_free(&b->list);
    }
    return status;
}

// References are only those repetitions that mostly count.
static void forget_uncounted(struct side *a, struct repetition_span within)
{
    int32_t kept = 0;
    for (int32_t k = 0; k < a->list.count; k++) {
        const struct repetition_span span = a->list.spans[k], in = common_span(span, within);
        const int32_t shorter =
            span.end - span.first < within.end - within.first ? span.end - span.first : within.end - within.first;
        if (2 * (in.end - in.first) > shorter)
            a->list.spans[kept++] = span;
    }
    a->list.count = kept;
}

enum status performances_judge(const struct performed of[2], const struct performance_terms *terms,
                               struct timeline *timeline, struct performances *out)
{
    struct side a = {.movement = of[0].movement, .frames = of[0].features.frames, .plain = of[0].plain},
                b = {.movement = of[1].movement, .frames = of[1].features.frames, .plain = of[1].plain};
    *out = (struct performances){.reference_count = 1};
    *timeline = (struct timeline){0};
    enum status status = find_both(&a, &b);
    out->all_references = a.list.count ? a.list.count : 1;
    if (terms->within)
        forget_uncounted(&a, *terms->within);
    if (status == OK && a.list.count >= 2)
        measure_moved(&a);
    memcpy(out->moved, a.moved, sizeof out->moved);
    if (status == OK && a.list.count && b.list.count)
        status = judge_all(&a, &b, terms, timeline, out);
    repetition_list_free(&a.list);
    repetition_list_free(&b.list);
    if (status != OK) {
        performances_free(out);
        timeline_free(timeline);
    }
    return status;
}
