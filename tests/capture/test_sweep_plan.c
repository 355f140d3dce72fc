// The plan of a room while it is swept: against the synthetic room's truth; its hints; that the map is the same with
// it.
//
//     test_sweep_plan      the tests
//     test_sweep_plan N    with the whole sweep in N images
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/mapping/map_advice.h"
#include "capture/mapping/mapper.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

static int sweep_frames = 40;
static double sweep_s = 5, walk_s = 3;

struct sweep {
    struct world *world;
    struct calibration calibration;
    struct mapper_tag tags[32];
    int32_t tag_count;
    const struct place_tag *truth;
    uint8_t *color;
    uint16_t *depth;
};

static void sweep_open(struct sweep *s)
{
    struct world_options o = world_default_options();
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&s->world, &o), OK);
    s->calibration = world_calibration(1);
    s->truth = world_tags(s->world, &s->tag_count);
    for (int32_t i = 0; i < s->tag_count; i++)
        s->tags[i] = (struct mapper_tag){s->truth[i].id, s->truth[i].side_m};
    const size_t pixels = (size_t)s->calibration.color.width * (size_t)s->calibration.color.height;
    s->color = malloc(3 * pixels);
    s->depth = malloc(pixels * sizeof *s->depth);
}

static void sweep_close(struct sweep *s)
{
    free(s->color);
    free(s->depth);
    world_close(&s->world);
}

static void shoot(struct sweep *s, double time_s, uint64_t seed)
{
    const struct world_shot shot = {s->calibration.color, world_sweep_pose(s->world, time_s), 0, false};
    EXPECT_STATUS(world_render(s->world, &shot, &(struct world_image){.color = s->color, .depth = s->depth}), OK);
    EXPECT_STATUS(world_depth_noise(&s->calibration.color, s->depth, seed, s->depth), OK);
}

static void add(struct sweep *s, struct mapper *m, double time_s)
{
    const struct frame frame = {.time_ns = (int64_t)(time_s * 1e9) + 1, .color = s->color, .depth = s->depth};
    EXPECT_STATUS(mapper_add(m, &frame), OK);
}

// The greatest error of the placed tags on the floor, after the best rigid motion in the plane.
static double plan_error(const struct sweep_plan *p, const struct sweep *s, int *placed)
{
    double ax = 0, ay = 0, bx = 0, by = 0, cosine = 0, sine = 0, worst = 0;
    *placed = 0;
    for (int pass = 0; pass < 3; pass++)
        for (int i = 0; i < p->tag_count; i++) {
            const struct sweep_tag *t = &p->tag[i];
            const struct place_tag *same = s->truth;
            while (same->id != t->id)
                same++;
            const struct vec3 at = same->world_from_tag.translation;
            if (!t->placed)
                continue;
            if (pass == 0) {
                ++*placed;
                ax += t->x;
                ay += t->y;
                bx += at.x;
                by += at.y;
                continue;
            }
            const double n = *placed, u = t->x - ax / n, v = t->y - ay / n, x = at.x - bx / n, y = at.y - by / n;
            if (pass == 1) {
                cosine += u * x + v * y;
                sine += u * y - v * x;
            } else {
                const double r = hypot(cosine, sine), c = cosine / r, d = sine / r;
                worst = fmax(worst, hypot(c * u - d * v - x, d * u + c * v - y));
            }
        }
    return worst;
}

// The largest distance between a tag of one place and the same of the other; infinite: not the same tags.
static double place_difference(const struct place *a, const struct place *b)
{
    double most = a->tag_count == b->tag_count ? 0 : INFINITY;
    for (int32_t i = 0; i < a->tag_count && i < b->tag_count; i++)
        most =
            a->tags[i].id == b->tags[i].id
                ? fmax(most, v3_distance(a->tags[i].world_from_tag.translation, b->tags[i].world_from_tag.translation))
                : INFINITY;
    return most;
}

static void test_the_plan_of_a_sweep(void **state)
{
    (void)state;
    struct sweep s;
    struct mapper *m, *plain;
    struct place place, same;
    struct mapper_report report;
    struct mapper_options options = mapper_default_options();
    double with_ms = 0, without_ms = 0;
    int placed;
    sweep_open(&s);
    EXPECT_STATUS(mapper_open(&plain, &s.calibration, s.tags, s.tag_count, &options), OK);
    options.plan = true;
    EXPECT_STATUS(mapper_open(&m, &s.calibration, s.tags, s.tag_count, &options), OK);
    EXPECT_TRUE(mapper_plan(plain) == NULL);
    for (int i = 0; i < sweep_frames; i++) {
        const double time_s = sweep_s * i / sweep_frames;
        shoot(&s, time_s, (uint64_t)i + 1);
        int64_t begun = clock_cpu_ns();
        add(&s, m, time_s);
        with_ms += (double)(clock_cpu_ns() - begun) * 1e-6;
        begun = clock_cpu_ns();
        add(&s, plain, time_s);
        without_ms += (double)(clock_cpu_ns() - begun) * 1e-6;
        if (i % 10 == 9)
            printf("%2d: %s\n", i, mapper_plan(m)->text);
    }
    const struct sweep_plan *p = mapper_plan(m);
    const double error_m = plan_error(p, &s, &placed);
    printf("%d of %d images located, %d of %d tags placed, at most %.0f mm off; %.1f ms an image\n", p->frames_located,
           p->frames, placed, (int)s.tag_count, error_m * 1e3, (with_ms - without_ms) / sweep_frames);
    EXPECT_AT_LEAST(p->frames_located, 0.8 * p->frames);
    EXPECT_AT_LEAST(placed, 0.8 * p->tags_seen);
    EXPECT_AT_MOST(error_m, 0.25);
    EXPECT_AT_LEAST(sweep_plan_recognisable(p), 0.5);
    EXPECT_STATUS(mapper_finish(m, &place, &report), OK);
    EXPECT_STATUS(mapper_finish(plain, &same, &report), OK);
    printf("with and without the plan tags lie %.2g mm apart, %d and %d landmarks\n",
           1e3 * place_difference(&place, &same), (int)place.point_count, (int)same.point_count);
    EXPECT_AT_MOST(place_difference(&place, &same), 1e-4);
    static struct sweep_plan final;
    struct map_advice advice;
    sweep_plan_of_place(&place, &final);
    map_advise(&place, &report, &(struct sweep_trouble){0}, &advice);
    const double final_m = plan_error(&final, &s, &placed);
    printf("the map: %s; tags at most %.1f mm off, %.0f %% recognisable, %d bare\n", advice.summary, final_m * 1e3,
           100 * sweep_plan_recognisable(&final), final.bare_count);
    EXPECT_AT_MOST(final_m, 0.02);
    place_free(&place);
    place_free(&same);
    mapper_close(&m);
    mapper_close(&plain);
    sweep_close(&s);
}

// Cells of which something was seen.
static int filled(const struct sweep_plan *p)
{
    int count = 0;
    for (int row = 0; row < SWEEP_CELLS; row++)
        for (int column = 0; column < SWEEP_CELLS; column++)
            count += p->cell[row][column].floor + p->cell[row][column].solid > 0;
    return count;
}

// A walk at a sensor's rate, and the whole of it at what a slow machine comes to. There the sensor is lost before the
// bare wall, and finds its way again over a rug that looks the same from both ends.
static void test_the_plan_at_two_rates(void **state)
{
    (void)state;
    static const double rates_hz[] = {15, 6};
    int cells[2] = {0, 0};
    if (SANITIZED) // a minute there, and nothing that the sweep before does not run, too
        return;
    for (size_t r = 0; r < COUNT_OF(rates_hz); r++) {
        struct sweep s;
        struct mapper *m;
        struct mapper_options options = mapper_default_options();
        int placed, slower = 0, lost = 0;
        options.plan = true;
        sweep_open(&s);
        EXPECT_STATUS(mapper_open(&m, &s.calibration, s.tags, s.tag_count, &options), OK);
        for (int i = 0; i < (r ? WORLD_SWEEP_S : walk_s) * rates_hz[r]; i++) {
            shoot(&s, i / rates_hz[r], (uint64_t)i + 1);
            add(&s, m, i / rates_hz[r]);
            slower += mapper_plan(m)->hint == SWEEP_SLOWER;
            lost += mapper_plan(m)->hint == SWEEP_LOST;
        }
        const struct sweep_plan *p = mapper_plan(m);
        const double error_m = plan_error(p, &s, &placed);
        cells[r] = filled(p);
        printf("%2.0f Hz: %d of %d images located, %d of %d tags seen are placed, at most %.0f mm off; %d cells seen; "
               "'slower' at %d, 'lost' at %d\n",
               rates_hz[r], p->frames_located, p->frames, placed, p->tags_seen, error_m * 1e3, cells[r], slower, lost);
        EXPECT_AT_LEAST(p->frames_located, 0.8 * p->frames);
        EXPECT_AT_LEAST(p->tags_seen, 5);
        EXPECT_AT_LEAST(placed, 0.8 * p->tags_seen);
        EXPECT_AT_MOST(error_m, 0.25);
        mapper_close(&m);
        sweep_close(&s);
    }
    EXPECT_AT_LEAST(cells[1], 1.5 * cells[0]); // twelve seconds and three
}

// What is said when the sweep goes wrong.
static void test_hints(void **state)
{
    (void)state;
    struct sweep s;
    struct mapper *m;
    struct mapper_options options = mapper_default_options();
    bool slower = false, lost = false, missing = false;
    options.plan = true;
    sweep_open(&s);
    EXPECT_STATUS(mapper_open(&m, &s.calibration, s.tags, s.tag_count, &options), OK);
    EXPECT_INT(mapper_plan(m)->hint, SWEEP_LOOKING);
    for (int i = 0; i < 44; i++) { // slowly, then three times as fast, then something black before it
        const double at_s = i < 10 ? i * 0.2 : 2 + (i - 10) * 0.2;
        shoot(&s, fmin(at_s, 7), (uint64_t)i + 1);
        if (i >= 28) {
            memset(s.color, 0, 3 * 640 * 480);
            memset(s.depth, 0, 2 * 640 * 480);
        }
        add(&s, m, i < 10 ? i * 0.2 : 2 + (i - 10) * 0.06);
        const struct sweep_plan *p = mapper_plan(m);
        missing |= p->hint == SWEEP_MISSING || p->hint == SWEEP_TOGETHER;
        slower |= p->hint == SWEEP_SLOWER && i >= 10;
        lost |= p->hint == SWEEP_LOST && i >= 28;
        if (i % 4 == 3)
            printf("%2d: %s\n", i, p->text);
    }
    EXPECT_TRUE(missing);
    EXPECT_TRUE(slower);
    EXPECT_TRUE(lost);
    mapper_close(&m);
    sweep_close(&s);
}

// A wall two metres wide, half of it with landmarks.
static void test_bare_places(void **state)
{
    (void)state;
    static struct sweep_plan p;
    sweep_plan_start(&p, 1, 1);
    for (int i = 0; i < 400; i++) {
        struct sweep_cell *cell = sweep_plan_cell(&p, -2 + 0.01 * i, 3 + (i % 3) * 0.12);
        cell->solid = 20;
        if (i < 180 && i % 10 == 0)
            sweep_plan_add_landmark(&p, v3(-2 + 0.01 * i, 3, 1));
    }
    sweep_plan_find_bare(&p);
    printf("%d bare places, the first at %.2f, %.2f; %.0f %% recognisable\n", p.bare_count, p.bare[0].x, p.bare[0].y,
           100 * sweep_plan_recognisable(&p));
    EXPECT_TRUE(p.bare_count >= 1 && p.bare_count <= 2);
    EXPECT_AT_LEAST(p.bare[0].x, 0.3);
    EXPECT_NEAR(sweep_plan_recognisable(&p), 0.57, 0.1);
    // A tag there, and nothing is bare.
    sweep_plan_set_tag(&p, 3, true, &(struct vec3){0.7, 3, 1}, 0);
    sweep_plan_set_tag(&p, 4, true, &(struct vec3){1.7, 3, 1}, 0);
    sweep_plan_find_bare(&p);
    EXPECT_INT(p.bare_count, 0);
    EXPECT_TRUE(sweep_plan_cell(&p, 8, 0) == NULL && sweep_plan_cell(&p, NAN, 0) == NULL);
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        sweep_frames = atoi(argv[1]);
        sweep_s = walk_s = WORLD_SWEEP_S;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bare_places), cmocka_unit_test(test_hints),
                                       cmocka_unit_test(test_the_plan_of_a_sweep),
                                       cmocka_unit_test(test_the_plan_at_two_rates)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
