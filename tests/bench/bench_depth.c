// Stage "depth": lossless depth compression: ours next to PNG, plain zstd, and RVL (Wilson, "Fast lossless depth image
// compression", ISS 2017). The "error" is the size; every image must be restored exactly.
#include "platform/files/compress.h"
#include "platform/files/png.h"
#include "recording/depth_codec.h"
#include "tests/bench/bench.h"
#include "tests/support/random.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { IMAGES_MOST = 24, MADE = 8, MADE_WIDTH = 640, MADE_HEIGHT = 480 };

struct depth_images {
    uint16_t *depth[IMAGES_MOST];
    int count, width, height;
    // Buffers of the contenders.
    struct compressor *compressor;
    struct depth_coder *coder;
    uint16_t *image, *back; // the one to be coded, and what its code gives back
    uint8_t *coded, *packed;
    size_t capacity;
};

static size_t pixels_of(const struct depth_images *p) { return (size_t)p->width * (size_t)p->height; }

// ------------------------------------------------------------- the images

// Metres along the ray through (x, y), z = 1: a wall, a floor, and a figure of two ellipsoids that walks.
static double scene(double x, double y, int index)
{
    double z = 4.2 / (1 - 0.15 * x);
    if (y > 0)
        z = fmin(z, 1.1 / y);
    const double centres[2][3] = {{0.05 * index - 0.2, 0.1, 2.4}, {0.05 * index - 0.2, -0.62, 2.4}};
    const double radii[2][3] = {{0.25, 0.6, 0.16}, {0.1, 0.14, 0.12}};
    for (int k = 0; k < 2; k++) {
        double a = 0, b = 0, c = -1; // a z^2 - 2 b z + c = 0
        const double ray[3] = {x, y, 1};
        for (int i = 0; i < 3; i++) {
            a += ray[i] * ray[i] / (radii[k][i] * radii[k][i]);
            b += ray[i] * centres[k][i] / (radii[k][i] * radii[k][i]);
            c += centres[k][i] * centres[k][i] / (radii[k][i] * radii[k][i]);
        }
        if (b * b > a * c)
            z = fmin(z, (b - sqrt(b * b - a * c)) / a);
    }
    return z;
}

// Kinect-like noise: steps of 1/8 pixel of disparity, noise of a third of a step, and a shadow to the right of
// foreground objects.
static void make_image(uint16_t *depth, int index)
{
    const double focal = 575, base_m = 0.075;
    struct rng rng = {2017 + (uint64_t)index};
    for (int y = 0; y < MADE_HEIGHT; y++) {
        double shadow_until = -1;
        for (int x = 0; x < MADE_WIDTH; x++) {
            double z = scene((x - 319.5) / focal, (y - 239.5) / focal, index);
            double disparity = focal * base_m / z;
            double steps = round(8 * disparity + 0.35 * rng_normal(&rng));
            bool hidden = x + disparity < shadow_until || rng_uniform(&rng) < 0.002;
            shadow_until = fmax(shadow_until, x + disparity);
            depth[y * MADE_WIDTH + x] = hidden ? 0 : (uint16_t)(1000 * 8 * focal * base_m / steps);
        }
    }
}

static int by_name(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

static enum status read_images(struct depth_images *p, const char *folder)
{
    char path[4200], **names = NULL;
    size_t count = 0;
    snprintf(path, sizeof path, "%s/depth", folder);
    DIR *dir = opendir(path);
    if (!dir)
        return fail(ERR_MISSING, "%s: there is no such folder", path);
    for (struct dirent *entry; (entry = readdir(dir));) {
        const char *ending = strrchr(entry->d_name, '.');
        if (!ending || strcmp(ending, ".png"))
            continue;
        char **grown = realloc(names, (count + 1) * sizeof *names), *name = strdup(entry->d_name);
        if (grown)
            names = grown;
        if (!grown || !name) {
            free(name);
            break;
        }
        names[count++] = name;
    }
    closedir(dir);
    if (count)
        qsort(names, count, sizeof *names, by_name);
    enum status status = count ? OK : fail(ERR_INPUT, "%s holds no .png", path);
    p->count = count < IMAGES_MOST ? (int)count : IMAGES_MOST;
    for (int i = 0; status == OK && i < p->count; i++) { // spread over the whole sequence
        int width, height;
        snprintf(path, sizeof path, "%s/depth/%s", folder, names[(size_t)i * count / (size_t)p->count]);
        status = png_read(path, PNG_GRAY16, (void **)&p->depth[i], &width, &height);
        if (status == OK && i && (width != p->width || height != p->height))
            status = fail(ERR_INPUT, "%s differs in size from the images before", path);
        p->width = width;
        p->height = height;
    }
    while (count)
        free(names[--count]);
    free(names);
    return status;
}

static enum status make_images(struct depth_images *p)
{
    p->count = MADE;
    p->width = MADE_WIDTH;
    p->height = MADE_HEIGHT;
    for (int i = 0; i < MADE; i++) {
        if (!(p->depth[i] = malloc(pixels_of(p) * sizeof(uint16_t))))
            return fail(ERR_MEMORY, "no memory for images");
        make_image(p->depth[i], i);
    }
    return OK;
}

// ------------------------------------------------------------- RVL

// Alternating run lengths of zeros and non-zeros; the latter as differences; numbers in groups of 3 bits, each with a
// bit that says whether another follows.
struct nibbles {
    uint32_t *word;
    uint32_t held;
    int count;
};

static void rvl_put(struct nibbles *n, uint32_t value)
{
    do {
        uint32_t nibble = value & 7;
        value >>= 3;
        n->held = n->held << 4 | nibble | (value ? 8 : 0);
        if (++n->count == 8) {
            *n->word++ = n->held;
            n->held = 0;
            n->count = 0;
        }
    } while (value);
}

static uint32_t rvl_get(struct nibbles *n)
{
    uint32_t value = 0, nibble;
    int shift = 0;
    do {
        if (!n->count) {
            n->held = *n->word++;
            n->count = 8;
        }
        nibble = n->held >> 28;
        n->held <<= 4;
        n->count--;
        value |= (nibble & 7) << shift;
        shift += 3;
    } while (nibble & 8);
    return value;
}

static size_t rvl_encode(const uint16_t *depth, size_t n, uint8_t *out)
{
    struct nibbles nibbles = {.word = (uint32_t *)(void *)out};
    const uint16_t *at = depth, *end = depth + n;
    int previous = 0;
    while (at < end) {
        const uint16_t *from = at;
        while (at < end && !*at)
            at++;
        rvl_put(&nibbles, (uint32_t)(at - from));
        for (from = at; at < end && *at; at++)
            ;
        rvl_put(&nibbles, (uint32_t)(at - from));
        for (; from < at; from++) {
            int step = *from - previous;
            rvl_put(&nibbles, (uint32_t)step << 1 ^ -(uint32_t)(step < 0));
            previous = *from;
        }
    }
    if (nibbles.count)
        *nibbles.word++ = nibbles.held << 4 * (8 - nibbles.count);
    return (size_t)((uint8_t *)nibbles.word - out);
}

static void rvl_decode(uint8_t *bytes, uint16_t *depth, size_t n)
{
    struct nibbles nibbles = {.word = (uint32_t *)(void *)bytes};
    uint16_t *at = depth, *end = depth + n;
    int previous = 0;
    while (at < end) {
        for (uint32_t zeros = rvl_get(&nibbles); zeros && at < end; zeros--)
            *at++ = 0;
        for (uint32_t others = rvl_get(&nibbles); others && at < end; others--) {
            uint32_t folded = rvl_get(&nibbles);
            previous += (int)(folded >> 1 ^ -(folded & 1));
            *at++ = (uint16_t)previous;
        }
    }
}

// ------------------------------------------------------------- the contenders

struct depth_contender {
    struct depth_images *images;
    enum { OURS, PNG, ZSTD, RVL } code;
    int level; // of PNG and zstd; for RVL: 0 for RVL alone
};

static enum status encode(const struct depth_contender *c, const uint16_t *depth, uint8_t **bytes, size_t *count)
{
    struct depth_images *p = c->images;
    size_t n = pixels_of(p);
    const uint8_t *lent;
    enum status status;
    switch (c->code) {
    case OURS:
        status = depth_encode(p->coder, depth, p->width, p->height, &lent, count);
        if (status == OK)
            memcpy(p->coded, lent, *count);
        *bytes = p->coded;
        return status;
    case PNG: {
        const struct png_layout layout = {PNG_GRAY16, p->width, p->height};
        return png_encode(&layout, depth, c->level, bytes, count);
    }
    case ZSTD: *bytes = p->coded; return compress_bytes(p->compressor, c->level, depth, 2 * n, p->coded, count);
    default:
        *count = rvl_encode(depth, n, p->coded);
        *bytes = p->coded;
        if (!c->level)
            return OK;
        *bytes = p->packed + 8; // the uncompressed size before it
        memcpy(p->packed, count, sizeof *count);
        return compress_bytes(p->compressor, c->level, p->coded, *count, p->packed + 8, count);
    }
}

static enum status decode(const struct depth_contender *c, uint8_t *bytes, size_t count, uint16_t **back)
{
    struct depth_images *p = c->images;
    size_t n = pixels_of(p), plain;
    struct png_layout layout = {.kind = PNG_GRAY16};
    enum status status = OK;
    *back = p->back;
    switch (c->code) {
    case OURS: return depth_decode(p->coder, bytes, count, p->back, p->width, p->height);
    case PNG: return png_decode(bytes, count, "an image", &layout, (void **)back);
    case ZSTD: return decompress_bytes(p->compressor, bytes, count, p->back, 2 * n);
    default:
        if (c->level) {
            memcpy(&plain, bytes - 8, sizeof plain);
            status = decompress_bytes(p->compressor, bytes, count, p->coded, plain);
        }
        if (status == OK)
            rvl_decode(p->coded, p->back, n);
        return status;
    }
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    struct depth_contender *c = self;
    struct depth_images *p = c->images;
    uint8_t *bytes = NULL;
    uint16_t *back = NULL;
    size_t count, n = pixels_of(p);
    memset(p->back, 0xa5, n * sizeof *p->back);
    memcpy(p->image, p->depth[item], n * sizeof *p->image); // else the first contender alone would fetch it from memory
    double start = bench_clock_ms();
    enum status status = encode(c, p->image, &bytes, &count);
    double coded = bench_clock_ms();
    if (status == OK)
        status = decode(c, bytes, count, &back);
    double decoded = bench_clock_ms();
    if (status == OK && memcmp(back, p->depth[item], n * sizeof *back))
        status = fail(ERR_CORRUPT, "image %d is not restored exactly", item);
    if (c->code == PNG) {
        free(bytes);
        free(back);
    }
    *out = (struct bench_measure){
        .error = 8 * (double)count / (double)n,
        .time_ms = coded - start,
        .extra = {decoded - coded, 2 * (double)n / (double)count},
    };
    return status;
}

static enum status run(struct bench *b)
{
    struct depth_images p = {0};
    enum status status = bench_inputs(b)->data ? read_images(&p, bench_inputs(b)->data) : make_images(&p);
    if (status == OK) {
        // RVL needs at most 6 nibbles a pixel and as many for the runs.
        p.capacity = compress_bound(8 * pixels_of(&p)) + 64;
        p.coded = malloc(p.capacity);
        p.packed = malloc(p.capacity);
        p.image = malloc(pixels_of(&p) * sizeof *p.image);
        p.back = malloc(pixels_of(&p) * sizeof *p.back);
        if (!p.coded || !p.packed || !p.image || !p.back)
            status = fail(ERR_MEMORY, "no memory for the bench");
    }
    if (status == OK)
        status = compressor_open(&p.compressor);
    if (status == OK)
        status = depth_coder_open(&p.coder);
    if (status == OK) {
        struct depth_contender all[] = {
            {&p, OURS, 0}, {&p, PNG, 6}, {&p, PNG, 1}, {&p, ZSTD, 1}, {&p, RVL, 0}, {&p, RVL, 1},
        };
        const struct bench_contender contenders[] = {
            {"ours", measure, &all[0], false},         {"PNG, level 6", measure, &all[1], true},
            {"PNG, level 1", measure, &all[2], false}, {"zstd -1", measure, &all[3], false},
            {"RVL", measure, &all[4], false},          {"RVL and zstd -1", measure, &all[5], false},
        };
        status = bench_run(b, contenders, COUNT_OF(contenders), p.count);
    }
    for (int i = 0; i < IMAGES_MOST; i++)
        free(p.depth[i]);
    free(p.coded);
    free(p.packed);
    free(p.image);
    free(p.back);
    compressor_close(&p.compressor);
    depth_coder_close(&p.coder);
    return status;
}

const struct bench_stage bench_stage_depth = {
    .name = "depth",
    .about = "lossless compression of depth images",
    .error_name = "bits_per_pixel",
    .time_name = "encode_ms",
    .extra_names = {"decode_ms", "times_smaller"},
    .run = run,
};
