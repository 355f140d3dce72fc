// The page's section on growth: time and memory of stages against their size, with fitted exponents.
#include "capture/segmentation/segment.h"
#include "compare/alignment.h"
#include "locate/relocalization.h"
#include "platform/files/jpeg.h"
#include "platform/vision/tag_detector.h"
#include "recording/depth_codec.h"
#include "reenact/retrieval/frame_selection.h"
#include "tests/bench/bench_growth_take.h"
#include "tests/bench/bench_page.h"
#include "tests/support/limbs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 5 };

static void add_point(struct bench_curve *c, double size, double value)
{
    if (c->count < BENCH_SIZES) {
        c->size[c->count] = size;
        c->value[c->count++] = value;
    }
}

// ------------------------------------------------------------- frames

static enum status grow_selection(struct bench_curve *query, struct bench_curve *add)
{
    static const int sizes[] = {100, 1000, 10000, 100000};
    struct rng rng = {2014};
    const struct limbs limbs = limbs_random(&rng);
    enum status status = OK;
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++) {
        struct frame_selector *s = NULL;
        double times[20], add_ms = 0;
        status = frame_selector_open(&s, sizes[k]);
        for (int i = 0; i < sizes[k] && status == OK; i++) {
            const struct skeleton at = limbs_at(&limbs, i / 30.0, 0.01, &rng);
            const double from_ms = bench_clock_ms();
            status = frame_selector_add(s, i, &at, NULL);
            add_ms += bench_clock_ms() - from_ms;
        }
        for (int i = 0; i < 20 && status == OK; i++) {
            const struct skeleton at = limbs_at(&limbs, rng_uniform(&rng) * sizes[k] / 30, 0.01, &rng),
                                  shown = limbs_rotated(&at, 2 * rng_uniform(&rng) - 1, 0.03, &rng);
            struct frame_selection found;
            const double from_ms = bench_clock_ms();
            status = frame_selector_find_body(s, &shown, &found);
            times[i] = bench_clock_ms() - from_ms;
        }
        frame_selector_close(&s);
        if (status == OK) {
            add_point(query, sizes[k], bench_percentile(times, 20, 0.5));
            add_point(add, sizes[k], add_ms);
        }
    }
    return status;
}

static enum status grow_alignment(struct bench_curve *c)
{
    static const int sizes[] = {100, 300, 1000, 3000, 10000};
    // Those of a comparison of eleven parts (compare/comparison.c).
    const int32_t skip = 11 * FEATURE_UNIT * FEATURE_UNIT / 10 * 3, step = 11 * FEATURE_UNIT * FEATURE_UNIT / 50;
    const struct alignment_prices prices = {skip, skip, step};
    enum status status = OK;
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++) {
        const int n = sizes[k];
        struct feature_frame *a = calloc((size_t)n, sizeof *a), *b = calloc((size_t)n, sizeof *b);
        struct alignment x = {0};
        if (!a || !b)
            status = fail(ERR_MEMORY, "no memory for movements");
        for (int i = 0; status == OK && i < n; i++)
            for (int j = 0; j < 33; j++) {
                a[i].number[j] = (int16_t)(1600 * sin(0.02 * (1 + j % 5) * i + j));
                b[i].number[j] = (int16_t)(1600 * sin(0.02 * (1 + j % 5) * (i + 5 * sin(0.01 * i)) + j));
            }
        const double from_ms = bench_clock_ms();
        if (status == OK)
            status = align(&(struct features){a, n}, &(struct features){b, n}, &prices, &x);
        if (status == OK)
            add_point(c, n, bench_clock_ms() - from_ms);
        alignment_free(&x);
        free(a);
        free(b);
    }
    return status;
}

// ------------------------------------------------------------- landmarks and tags

static enum status grow_landmarks(struct bench_curve *c)
{
    static const int sizes[] = {100, 1000, 10000, 100000};
    enum { SEEN = 1000 };
    static struct feature features[SEEN];
    static struct feature_index index;
    static struct landmark_match matches[SEEN];
    const struct lens lens = {.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
    struct rng rng = {7};
    for (int i = 0; i < SEEN; i++) {
        features[i] =
            (struct feature){.at = {640 * rng_uniform(&rng), 480 * rng_uniform(&rng)}, .scale = 1, .slope = {1, 0, 1}};
        for (int k = 0; k < 32; k++)
            features[i].descriptor[k] = (uint8_t)(256 * rng_uniform(&rng));
    }
    feature_index_build(&index, features, SEEN, &lens);
    for (size_t k = 0; k < COUNT_OF(sizes); k++) {
        struct place_landmark *points = calloc((size_t)sizes[k], sizeof *points);
        if (!points)
            return fail(ERR_MEMORY, "no memory for landmarks");
        for (int i = 0; i < sizes[k]; i++)
            for (int b = 0; b < 32; b++)
                points[i].descriptor[b] = (uint8_t)(256 * rng_uniform(&rng));
        const struct match_query query = {.points = points, .point_count = sizes[k], .index = &index, .lens = &lens};
        const double from_ms = bench_clock_ms();
        (void)relocalize_match(&query, matches, SEEN);
        add_point(c, sizes[k], bench_clock_ms() - from_ms);
        free(points);
    }
    return OK;
}

// A wall of `count` tags in an image of 1280 x 960, cells of 4 px.
static void draw_tags(uint8_t *gray, int width, int height, int count)
{
    enum { CELL = 4, PITCH = (TAG_CELLS + 4) * CELL };
    const int across = width / PITCH;
    memset(gray, 180, (size_t)width * (size_t)height);
    for (int i = 0; i < count && i / across < height / PITCH; i++) {
        struct tag_pattern p;
        const int left = i % across * PITCH + 2 * CELL, top = i / across * PITCH + 2 * CELL;
        if (!tag_pattern(i, &p))
            continue;
        for (int y = 0; y < TAG_CELLS * CELL; y++)
            for (int x = 0; x < TAG_CELLS * CELL; x++)
                gray[(top + y) * width + left + x] = p.cell[y / CELL][x / CELL] ? 220 : 20;
    }
}

static enum status grow_tags(struct bench_curve *c)
{
    static const int sizes[] = {1, 4, 16, 64, 200};
    enum { WIDTH = 1280, HEIGHT = 960, MOST = 256 };
    uint8_t *gray = malloc((size_t)WIDTH * HEIGHT);
    struct tag_detector *finder = NULL;
    enum status status = gray ? tag_detector_open(&finder, 1) : fail(ERR_MEMORY, "no memory for an image");
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++) {
        struct tag_detection seen[MOST];
        double times[REPEATS];
        int count = 0;
        draw_tags(gray, WIDTH, HEIGHT, sizes[k]);
        for (int r = 0; r < REPEATS && status == OK; r++) {
            const double from_ms = bench_clock_ms();
            status = tag_detector_detect(finder, &(struct gray_image){gray, WIDTH, HEIGHT}, seen, MOST, &count);
            times[r] = bench_clock_ms() - from_ms;
        }
        if (status == OK)
            add_point(c, sizes[k], bench_percentile(times, REPEATS, 0.5));
    }
    tag_detector_close(&finder);
    free(gray);
    return status;
}

// ------------------------------------------------------------- pixels

struct pixel_work {
    int width, height;
    uint16_t *depth;
    uint8_t *rgb, *gray, *mask;
    struct depth_coder *coder;
    struct segmenter *segmenter;
};

static enum status code_depth(struct pixel_work *w)
{
    const uint8_t *bytes;
    size_t count;
    return depth_encode(w->coder, w->depth, w->width, w->height, &bytes, &count);
}

static enum status code_color(struct pixel_work *w)
{
    uint8_t *bytes;
    size_t count;
    const enum status status = jpeg_encode(w->rgb, w->width, w->height, 90, &bytes, &count);
    if (status == OK)
        free(bytes);
    return status;
}

static enum status find_features(struct pixel_work *w)
{
    static struct feature features[FEATURES_MAX];
    int count;
    return features_detect(w->gray, w->width, w->height, features, FEATURES_MAX, &count);
}

static enum status segment(struct pixel_work *w)
{
    const enum status status = segmenter_next(w->segmenter, w->depth, NULL, 0, w->mask);
    return status == NOTHING ? OK : status;
}

static enum status make_pixels(struct pixel_work *w, int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height;
    const struct lens lens = {.width = width,
                              .height = height,
                              .fx = 0.82 * width,
                              .fy = 0.82 * width,
                              .cx = (width - 1) / 2.0,
                              .cy = (height - 1) / 2.0};
    struct rng rng = {11};
    *w = (struct pixel_work){width, height, malloc(2 * pixels), malloc(3 * pixels), malloc(pixels), malloc(pixels),
                             NULL,  NULL};
    if (!w->depth || !w->rgb || !w->gray || !w->mask)
        return fail(ERR_MEMORY, "no memory for an image");
    for (size_t i = 0; i < pixels; i++) {
        const double x = (double)(i % (size_t)width) / width, y = (double)(i / (size_t)width) / height;
        const bool person = fabs(x - 0.5) < 0.08 && y > 0.2 && y < 0.9;
        w->depth[i] = (uint16_t)(person ? 2500 + 4 * rng_normal(&rng) : 4000 + 300 * x + 10 * rng_normal(&rng));
        w->gray[i] = (uint8_t)(128 + 60 * sin(90 * x) * cos(70 * y) + 4 * rng_normal(&rng));
        for (int c = 0; c < 3; c++)
            w->rgb[3 * i + (size_t)c] = (uint8_t)(w->gray[i] / (c + 1));
    }
    const enum status status = depth_coder_open(&w->coder);
    return status == OK ? segmenter_open(&w->segmenter, &lens) : status;
}

static void free_pixels(struct pixel_work *w)
{
    depth_coder_close(&w->coder);
    segmenter_close(&w->segmenter);
    free(w->depth);
    free(w->rgb);
    free(w->gray);
    free(w->mask);
}

enum { PIXEL_CURVES = 4 };

static enum status grow_pixels(struct bench_curve curve[PIXEL_CURVES])
{
    static const int sizes[][2] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};
    static enum status (*const work[PIXEL_CURVES])(struct pixel_work *) = {code_depth, code_color, find_features,
                                                                           segment};
    enum status status = OK;
    for (size_t k = 0; k < COUNT_OF(sizes) && status == OK; k++) {
        struct pixel_work w;
        status = make_pixels(&w, sizes[k][0], sizes[k][1]);
        for (int c = 0; c < PIXEL_CURVES && status == OK; c++) {
            double times[REPEATS];
            for (int r = 0; r < REPEATS && status == OK; r++) {
                const double from_ms = bench_clock_ms();
                status = work[c](&w);
                times[r] = bench_clock_ms() - from_ms;
            }
            add_point(&curve[c], (double)sizes[k][0] * sizes[k][1], bench_percentile(times, REPEATS, 0.5));
        }
        free_pixels(&w);
    }
    return status;
}

// ------------------------------------------------------------- the section

static void put_curves(const struct bench_page *page, struct json *list, struct bench_curves *c)
{
    for (int k = 0; k < c->count; k++)
        bench_fit_curve(&c->curve[k]);
    if (page->html) {
        fprintf(page->html, "<h3>%s</h3>\n", c->title);
        bench_put_curves(page->html, c);
    }
    for (int k = 0; k < c->count && list; k++) {
        struct json *o = json_add_object(list, NULL);
        json_add_string(o, "title", c->title);
        json_add_string(o, "name", c->curve[k].name);
        json_add_string(o, "size", c->size_text);
        json_add_string(o, "value", c->value_text);
        json_add_number(o, "exponent", c->curve[k].exponent);
        struct json *sizes = json_add_array(o, "sizes"), *values = json_add_array(o, "values");
        for (int i = 0; i < c->curve[k].count; i++) {
            json_push_number(sizes, c->curve[k].size[i]);
            json_push_number(values, c->curve[k].value[i]);
        }
    }
}

// n log n over these sizes has a fitted exponent of 1.15.
static void put_fastest(FILE *html, const struct bench_curves *all, size_t count)
{
    const double most = 1.2;
    int found = 0;
    fputs("<p>Faster than n log n grows: ", html);
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < all[i].count; k++)
            if (all[i].curve[k].exponent > most)
                fprintf(html, "%s%s (n<sup>%.2f</sup>)", found++ ? ", " : "", all[i].curve[k].name,
                        all[i].curve[k].exponent);
    fputs(found ? ".</p>\n" : "nothing.</p>\n", html);
}

enum status bench_put_growth(const struct bench_page *page, const struct bench_whole *w)
{
    struct bench_curve frames[] = {
        {.name = "choosing a frame"}, {.name = "adding all of them"}, {.name = "aligning two movements"}};
    struct bench_curve pixels[PIXEL_CURVES] = {
        {.name = "depth coding"}, {.name = "JPEG"}, {.name = "features"}, {.name = "segmentation"}};
    struct bench_curve places[] = {{.name = "matching landmarks"}, {.name = "detecting tags"}};
    struct bench_curve takes[] = {
        {.name = "writing"}, {.name = "opening to the index"}, {.name = "skeletons for watching"}};
    struct bench_curve memory[] = {{.name = "index of a take"}, {.name = "process while watching"}};
    (void)w;
    enum status status = grow_selection(&frames[0], &frames[1]);
    if (status == OK)
        status = grow_alignment(&frames[2]);
    if (status == OK)
        status = grow_landmarks(&places[0]);
    if (status == OK)
        status = grow_tags(&places[1]);
    if (status == OK)
        status = grow_pixels(pixels);
    if (status == OK)
        status = bench_grow_takes(takes, &memory[0], &memory[1]);
    if (status != OK)
        return status;
    struct json *o = page->stages ? json_add_object(page->stages, NULL) : NULL;
    if (o)
        json_add_string(o, "name", "growth");
    struct json *list = o ? json_add_array(o, "curves") : NULL;
    struct bench_curves all[] = {
        {"Frames", "frames", "time, ms", frames, COUNT_OF(frames)},
        {"Length of a take", "frames, at 30 a second", "time, ms", takes, COUNT_OF(takes)},
        {"Landmarks and tags", "landmarks of the place; tags in the image", "time, ms", places, COUNT_OF(places)},
        {"Pixels", "pixels of an image", "time, ms", pixels, PIXEL_CURVES},
        {"Memory", "frames of the take; frames watched", "bytes", memory, COUNT_OF(memory)},
    };
    for (size_t i = 0; i < COUNT_OF(all); i++)
        put_curves(page, list, &all[i]);
    if (page->html)
        put_fastest(page->html, all, COUNT_OF(all));
    return OK;
}
