// Stage "objects": eight things looked for in pairs of pictures of a made-up desk on which four of them stand: the
// error of the middle in the left picture, how many of the four are missed, how many are found wrongly (absent, or more
// than 15 pixels off), and the time for all eight in a pair. The plain methods look at both pictures, too, as
// stereo needs it; only what they find in the left one is judged.
#include "objects/thing_recognition.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_objects_peers.h"
#include "tests/support/desk.h"
#include "tests/support/random.h"
#include "tests/support/skeleton_drawing.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PAIRS = 3, WIDTH = 640, HEIGHT = 480, PIXELS = WIDTH * HEIGHT };
static const uint64_t SEED = 2009;
// Of an accepted match; chosen by hand.
static const double PLAIN_LEAST = 0.45, TEMPLATE_LEAST = 0.7, RIGHT_PX = 15;

enum method { OURS, PLAIN, PLAIN_FINE, ORB, TEMPLATE, METHODS };

struct objects {
    struct desk desk;
    struct recognizer *recognizer;
    struct pose world_from_left[PAIRS];
    uint8_t *rgb, *gray; // PAIRS x 2 of each
    struct gray_picture picture[DESK_THINGS];
};

struct contender {
    struct objects *all;
    enum method method;
    const char *name;
    struct pixel found[2 * DESK_THINGS]; // in the left picture of the pair looked at last
    int found_count, missed, wrong;
};

static enum status make(struct objects *o)
{
    struct rng rng = {SEED};
    printf("objects: seed %llu\n", (unsigned long long)SEED);
    o->rgb = malloc((size_t)PAIRS * 2 * PIXELS * 3);
    o->gray = malloc((size_t)PAIRS * 2 * PIXELS);
    if (!o->rgb || !o->gray || !desk_make(&o->desk, SEED))
        return fail(ERR_MEMORY, "no memory for a desk");
    for (int i = 0; i < PAIRS; i++) {
        const double yaw = rng_between(&rng, -0.1, 0.1), roll = rng_between(&rng, -0.3, 0.3),
                     away = rng_between(&rng, -0.5, 0);
        o->world_from_left[i] = (struct pose){
            quat_multiply(quat_from_rotation_vector(v3(0, yaw, 0)), quat_from_rotation_vector(v3(0, 0, roll))),
            v3(0.05, 0, away)};
        for (int side = 0; side < 2; side++) {
            const struct pose p =
                side ? pose_multiply(o->world_from_left[i], o->desk.rig.left_from_right) : o->world_from_left[i];
            desk_film(&o->desk, side ? &o->desk.rig.right : &o->desk.rig.left, &p, 2, SEED + (uint64_t)(2 * i + side),
                      o->rgb + (size_t)(2 * i + side) * PIXELS * 3);
        }
        image_gray(o->rgb + (size_t)(2 * i) * PIXELS * 3, 2 * PIXELS, o->gray + (size_t)(2 * i) * PIXELS);
    }
    for (int i = 0; i < DESK_THINGS; i++) {
        const struct image *p = &o->desk.storage[i].picture;
        uint8_t *gray = malloc((size_t)p->width * (size_t)p->height);
        if (!gray)
            return fail(ERR_MEMORY, "no memory for a picture");
        image_gray(p->rgb, (size_t)p->width * (size_t)p->height, gray);
        o->picture[i] = (struct gray_picture){gray, p->width, p->height};
    }
    return recognizer_open(&o->recognizer, &o->desk.things, NULL);
}

static struct pixel true_middle(const struct objects *o, int pair, int thing)
{
    const struct pose left_from_world = pose_inverse(o->world_from_left[pair]);
    return lens_project(&o->desk.rig.left, pose_apply(left_from_world, o->desk.world_from_thing[thing].translation));
}

static void judge(struct contender *c, int pair, int thing, struct pixel at, double *errors, int *count,
                  struct bench_measure *out)
{
    const struct pixel truth = true_middle(c->all, pair, thing);
    const double error = sqrt((at.x - truth.x) * (at.x - truth.x) + (at.y - truth.y) * (at.y - truth.y));
    c->found[c->found_count++] = at;
    if (thing >= DESK_THINGS / 2 || error > RIGHT_PX)
        out->extra[1] += 1;
    else
        errors[(*count)++] = error;
}

static enum status measure_ours(struct contender *c, int pair, double *errors, int *count, struct bench_measure *out)
{
    const struct objects *o = c->all;
    const struct lens *lenses[2] = {&o->desk.rig.left, &o->desk.rig.right};
    const struct pose from_left[2] = {POSE_IDENTITY, pose_inverse(o->desk.rig.left_from_right)};
    struct thing_view views[2] = {0};
    struct detection found[DESK_THINGS];
    int n = 0;
    enum status status = OK;
    for (int i = 0; i < 2 && status == OK; i++)
        status =
            thing_view_make(lenses[i], &from_left[i], o->rgb + (size_t)(2 * pair + i) * PIXELS * 3, true, &views[i]);
    if (status == OK)
        status = recognizer_find(o->recognizer, views, 2, found, &n);
    for (int i = 0; i < n && status == OK; i++) {
        struct sighting s;
        if (recognizer_refine(o->recognizer, &found[i], NULL, views, 2, &s) == OK)
            judge(c, pair, s.thing, lens_project(lenses[0], s.left_from_thing.translation), errors, count, out);
    }
    thing_view_free(&views[0]);
    thing_view_free(&views[1]);
    return status;
}

static enum status find_plainly(const struct objects *o, enum method method, int image_number, int thing,
                                struct pixel *at)
{
    const struct gray_picture image = {o->gray + (size_t)image_number * PIXELS, WIDTH, HEIGHT};
    struct plain_options options = plain_default_options();
    struct plain_match m;
    double score = 0;
    enum status status;
    if (method == ORB)
        return orb_peer_find(&o->picture[thing], &image, 10, at);
    if (method == TEMPLATE) {
        status = template_peer_find(&o->picture[thing], &image, &options, at, &score);
        return status == OK && score < TEMPLATE_LEAST ? NOTHING : status;
    }
    options.coarse_to_fine = method == PLAIN_FINE;
    status = plain_match_find(&o->picture[thing], &image, &options, &m);
    if (status == OK)
        *at = m.middle;
    return status == OK && m.score < PLAIN_LEAST ? NOTHING : status;
}

static enum status measure(void *self, int pair, struct bench_measure *out)
{
    struct contender *c = self;
    double errors[2 * DESK_THINGS];
    int count = 0;
    enum status status = OK;
    const double started_ms = bench_clock_ms();
    out->extra[1] = 0;
    c->found_count = 0;
    if (c->method == OURS)
        status = measure_ours(c, pair, errors, &count, out);
    for (int i = 0; i < DESK_THINGS && status == OK && c->method != OURS; i++) {
        struct pixel at, in_right;
        const enum status found = find_plainly(c->all, c->method, 2 * pair, i, &at);
        (void)find_plainly(c->all, c->method, 2 * pair + 1, i, &in_right);
        if (found == OK)
            judge(c, pair, i, at, errors, &count, out);
        status = found < OK ? found : OK;
    }
    out->time_ms = bench_clock_ms() - started_ms;
    out->extra[0] = DESK_THINGS / 2 - count;
    c->missed = (int)out->extra[0];
    c->wrong = (int)out->extra[1];
    out->error = count ? bench_percentile(errors, count, 0.5) : 0;
    return status == OK && !count ? NOTHING : status;
}

// The left picture of the pair looked at last: rings where the things are, dots where the method found one.
static void draw_found(struct bench *b, const struct contender *c, int pair)
{
    static const uint8_t white[3] = {255, 255, 255}, red[3] = {230, 40, 40};
    const struct drawing d = {malloc((size_t)PIXELS * 3), WIDTH, HEIGHT, WIDTH};
    char caption[100];
    if (!d.rgb)
        return;
    memcpy(d.rgb, c->all->rgb + (size_t)(2 * pair) * PIXELS * 3, (size_t)PIXELS * 3);
    for (int thing = 0; thing < DESK_THINGS / 2; thing++) {
        const struct pixel at = true_middle(c->all, pair, thing);
        struct pixel last = {at.x + RIGHT_PX, at.y};
        for (int k = 1; k <= 24; k++) {
            const double angle = k * 6.283185307179586 / 24;
            const struct pixel next = {at.x + RIGHT_PX * cos(angle), at.y + RIGHT_PX * sin(angle)};
            drawing_put_line(&d, last, next, 1, white);
            last = next;
        }
    }
    for (int i = 0; i < c->found_count; i++)
        drawing_put_line(&d, c->found[i], c->found[i], 5, red);
    snprintf(caption, sizeof caption, "%s: %d of %d missed, %d wrong; rings: the truth", c->name, c->missed,
             DESK_THINGS / 2, c->wrong);
    bench_picture(b, caption, d.rgb, WIDTH, HEIGHT);
    free(d.rgb);
}

static enum status run(struct bench *b)
{
    struct objects *o = calloc(1, sizeof *o);
    enum status status = o ? make(o) : fail(ERR_MEMORY, "no memory");
    if (status == OK) {
        static const char *const names[METHODS] = {[OURS] = "ours",
                                                   [PLAIN] = "paper's plain, all placements",
                                                   [PLAIN_FINE] = "paper's plain, coarse to fine",
                                                   [ORB] = "OpenCV ORB, homography",
                                                   [TEMPLATE] = "OpenCV matchTemplate"};
        struct contender c[METHODS];
        struct bench_contender contenders[METHODS];
        for (int i = 0; i < METHODS; i++) {
            c[i] = (struct contender){.all = o, .method = (enum method)i, .name = names[i]};
            contenders[i] = (struct bench_contender){names[i], measure, &c[i], i == ORB};
        }
        // All placements of all things are two thirds of a minute a pair: one of them is enough for the page.
        const int pairs = bench_inputs(b)->brief ? 1 : PAIRS;
        status = bench_run(b, contenders, METHODS, pairs);
        const enum method shown[] = {OURS, PLAIN_FINE, ORB};
        for (size_t i = 0; i < COUNT_OF(shown) && status == OK; i++)
            draw_found(b, &c[shown[i]], pairs - 1);
    }
    if (o) {
        recognizer_close(&o->recognizer);
        for (int i = 0; i < DESK_THINGS; i++)
            free((void *)(uintptr_t)o->picture[i].gray);
        desk_free(&o->desk);
        free(o->rgb);
        free(o->gray);
    }
    free(o);
    return status;
}

const struct bench_stage bench_stage_objects = {
    "objects",           "eight things looked for in a pair of pictures, four of them there",
    "middle_error_px",   "time_ms",
    {"missed", "false"}, run};
