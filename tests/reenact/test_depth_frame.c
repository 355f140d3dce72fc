// Labelling of a depth frame: the projector's shadow beside the actor, edges between surfaces against quantisation and
// noise; and cached frames are identical.
#include "tests/support/test.h"

#include "reenact/observation/depth_frame.h"
#include "tests/support/observe.h"
#include "tests/support/painted_person.h"
#include "tests/support/random.h"

#include <string.h>

enum { NARROW_PX = 2, WIDE_PX = 40, WALL_MM = 8000 };

// One frame of a painted actor, labelled.
struct labelled_case {
    struct painted_take stage;
    struct source_rays *rays;
    struct depth_frame observed;
};

static void see(struct labelled_case *s, const struct one_frame *frame)
{
    painted_take_open(&s->stage, &ideal, frame, 1, &whole_measures);
    EXPECT_STATUS(source_rays_open(&s->rays, take_calibration(s->stage.take)), OK);
    EXPECT_STATUS(depth_frame_open(&s->observed, s->stage.take, s->rays), OK);
    EXPECT_STATUS(observe_frame(&s->observed, s->stage.take, 0), OK);
}

static void see_no_more(struct labelled_case *s)
{
    depth_frame_close(&s->observed);
    source_rays_close(&s->rays);
    painted_take_close(&s->stage);
}

// Moved to another depth and scaled, so that it covers the same pixels.
static struct skeleton scaled_to_depth(const struct skeleton *joints, double depth_mm)
{
    struct skeleton s = *joints;
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3_scale(s.joint[j], depth_mm * 1e-3 / s.joint[j].z);
    return s;
}

// Removes the depth samples of `count` pixels to the right of the actor.
static void shade(struct painted *film, int count)
{
    for (int y = 0; y < H; y++)
        for (int x = W - 1; x > 0; x--)
            for (int k = 1; k <= count && film->mask[y * W + x] && x + k < W && !film->mask[y * W + x + k]; k++)
                film->depth[y * W + x + k] = 0;
}

// Counts pixels beside the actor that have no depth sample (empty), or are nearer than the wall (wrong).
static void count_beside(struct painted *film, int shade_px, int *empty, int *wrong)
{
    const struct skeleton joints = whole_body(0);
    struct one_frame frame = {joints, film->rgb, film->depth, film->mask};
    struct labelled_case seen;
    paint_person(film, &ideal, &joints, &whole_measures);
    const uint16_t wall = film->depth[0];
    shade(film, shade_px);
    see(&seen, &frame);
    const struct depth_frame *observed = &seen.observed;
    *empty = *wrong = 0;
    for (int y = observed->top; y <= observed->bottom; y++)
        for (int x = observed->left; x < W; x++) {
            int i = y * W + x;
            *empty += !film->mask[i] && !observed->depth[i];
            *wrong += !film->mask[i] && observed->depth[i] && observed->depth[i] != wall;
        }
    see_no_more(&seen);
}

static void test_projector_shadow_is_background(void **state)
{
    (void)state;
    static struct painted film;
    int empty, wrong, left;
    count_beside(&film, NARROW_PX, &empty, &wrong);
    count_beside(&film, WIDE_PX, &left, &wrong);
    print_message("without a depth sample: of a narrow strip %d pixels, of a wide one %d\n", empty, left);
    EXPECT_AT_MOST(empty, 30);   // between the legs no wall is visible beyond the strip
    EXPECT_AT_LEAST(left, 9000); // too wide for a projector's shadow
    EXPECT_TRUE(wrong == 0);
}

// Number of pixels that differ, as far from the actor as edges are measured.
static int differing(const struct depth_frame *a, const struct depth_frame *b)
{
    int count = 0;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            int i = y * W + x;
            bool within_edges = x >= a->left - DEPTH_FRAME_MAX_EDGE_PX && x <= a->right + DEPTH_FRAME_MAX_EDGE_PX &&
                                y >= a->top - DEPTH_FRAME_MAX_EDGE_PX && y <= a->bottom + DEPTH_FRAME_MAX_EDGE_PX;
            count +=
                within_edges && (a->depth[i] != b->depth[i] || a->part[i] != b->part[i] ||
                                 a->edge_distance[i] != b->edge_distance[i] || a->half_width[i] != b->half_width[i]);
        }
    return count;
}

static void test_cached_frame_is_identical(void **state)
{
    (void)state;
    static struct painted film;
    static const size_t most_bytes[] = {0, 1 << 20};
    const struct skeleton joints = whole_body(0);
    struct one_frame frame = {joints, film.rgb, film.depth, film.mask};
    struct painted_take stage;
    struct source_rays *rays;
    struct take_skeletons *skeletons;
    struct take_images seen;
    struct depth_frame fresh, cached;
    const int64_t first = 0;
    paint_person(&film, &ideal, &joints, &whole_measures);
    painted_take_open(&stage, &ideal, &frame, 1, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(take_skeletons_open(&skeletons, stage.take), OK);
    const struct frame_source source = {stage.take, skeletons, rays};
    EXPECT_STATUS(take_read(stage.take, 0, TAKE_COLOR, &seen), OK);
    static uint8_t wanted[3 * PIXELS], rgb[3 * PIXELS];
    memcpy(wanted, seen.color, sizeof wanted);
    EXPECT_STATUS(depth_frame_open(&fresh, stage.take, rays), OK);
    EXPECT_STATUS(depth_frame_open(&cached, stage.take, rays), OK);
    EXPECT_STATUS(observe_frame(&fresh, stage.take, 0), OK);
    for (size_t k = 0; k < COUNT_OF(most_bytes); k++) {
        struct depth_frame_cache *cache;
        EXPECT_STATUS(depth_frame_cache_open(&cache, &source, &first, 1, most_bytes[k]), OK);
        for (int time = 0; time < 3; time++) {
            memset(cached.depth, 1, sizeof *cached.depth * PIXELS);
            memset(cached.part, 1, PIXELS); // contents left from other work
            memset(cached.edge_distance, 1, PIXELS);
            memset(cached.half_width, 1, PIXELS);
            memset(rgb, 1, sizeof rgb);
            cached.left = cached.top = cached.right = cached.bottom = 7;
            EXPECT_STATUS(depth_frame_cache_read(cache, 0, &cached, time % 2 ? rgb : NULL), OK);
            EXPECT_TRUE(time % 2 == 0 || !memcmp(rgb, wanted, sizeof rgb));
            EXPECT_INT(differing(&fresh, &cached), 0);
            EXPECT_INT(cached.left, fresh.left);
            EXPECT_INT(cached.top, fresh.top);
            EXPECT_INT(cached.right, fresh.right);
            EXPECT_INT(cached.bottom, fresh.bottom);
            EXPECT_INT(cached.has_mask, fresh.has_mask);
        }
        depth_frame_cache_close(&cache);
    }
    depth_frame_close(&fresh);
    depth_frame_close(&cached);
    take_skeletons_close(&skeletons);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

// Number of pixels at an edge whose neighbours all belong to the actor.
static int edges_within(const struct depth_frame *s, const uint8_t *mask)
{
    int count = 0;
    for (int y = 1; y < H - 1; y++)
        for (int x = 1; x < W - 1; x++) {
            const int i = y * W + x;
            bool within = true;
            for (int k = 0; k < 9; k++)
                within = within && mask[i + (k / 3 - 1) * W + k % 3 - 1];
            count += within && !s->edge_distance[i];
        }
    return count;
}

// A flat actor with every other depth sample one quantisation step nearer; and with one half nearer than the other.
static void test_far_quantisation_steps_are_no_edges(void **state)
{
    (void)state;
    static struct painted film;
    static const struct {
        int depth_mm, step_mm, half_mm;
        bool edges;
    } cases[] = {{2000, 11, 0, false}, {5000, 72, 0, false}, {5000, 0, 300, true}, {2000, 0, 72, true}};
    const struct skeleton joints = whole_body(0);
    paint_person(&film, &ideal, &joints, &whole_measures);
    for (size_t c = 0; c < COUNT_OF(cases); c++) {
        struct one_frame frame = {joints, film.rgb, film.depth, film.mask};
        struct labelled_case seen;
        frame.skeleton = scaled_to_depth(&joints, cases[c].depth_mm);
        for (int i = 0; i < PIXELS; i++)
            film.depth[i] = (uint16_t)(film.mask[i] ? cases[c].depth_mm - (i % W % 2) * cases[c].step_mm -
                                                          (i % W < W / 2) * cases[c].half_mm
                                                    : WALL_MM);
        see(&seen, &frame);
        const int edges = edges_within(&seen.observed, film.mask);
        print_message("at %d mm, steps of %d, one half %d nearer: %d pixels at an edge\n", cases[c].depth_mm,
                      cases[c].step_mm, cases[c].half_mm, edges);
        if (cases[c].edges)
            EXPECT_AT_LEAST(edges, 200);
        else
            EXPECT_INT(edges, 0);
        see_no_more(&seen);
    }
}

static uint16_t noisy(int depth_mm, double noise_mm, struct rng *rng)
{
    return (uint16_t)(depth_mm + (int)lrint(noise_mm * rng_normal(rng)));
}

// A flat actor with the sensor's noise at that distance, and with one half nearer than the other: an edge continues
// from row to row, noise does not.
static void test_noise_is_no_edge(void **state)
{
    (void)state;
    enum { FAR_MM = 4000, NOISE_MM = 28, NEARER_MM = 200, SEED = 4 };
    static struct painted film;
    const struct skeleton joints = whole_body(0);
    struct rng rng = {.state = SEED};
    print_message("seed %d\n", SEED);
    paint_person(&film, &ideal, &joints, &whole_measures);
    for (int half_mm = 0; half_mm <= NEARER_MM; half_mm += NEARER_MM) {
        struct one_frame frame = {joints, film.rgb, film.depth, film.mask};
        struct labelled_case seen;
        int inside = 0, rows = 0, cut = 0;
        frame.skeleton = scaled_to_depth(&joints, FAR_MM);
        for (int i = 0; i < PIXELS; i++)
            film.depth[i] = film.mask[i] ? noisy(FAR_MM - (i % W < W / 2) * half_mm, NOISE_MM, &rng) : WALL_MM;
        see(&seen, &frame);
        const int edges = edges_within(&seen.observed, film.mask);
        for (int y = 1; y < H - 1; y++)
            for (int x = 1; x < W - 1; x++) {
                const bool is_inside = film.mask[y * W + x - 1] && film.mask[y * W + x] && film.mask[y * W + x + 1];
                inside += is_inside;
                rows += is_inside && x == W / 2;
                cut += is_inside && x == W / 2 && !seen.observed.edge_distance[y * W + x];
            }
        print_message("one half %d nearer: %d of %d pixels at an edge; cut in %d of %d rows\n", half_mm, edges, inside,
                      cut, rows);
        if (half_mm)
            EXPECT_AT_LEAST(cut, 0.98 * rows);
        else
            EXPECT_AT_MOST(edges, 0.001 * inside);
        see_no_more(&seen);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_projector_shadow_is_background), cmocka_unit_test(test_cached_frame_is_identical),
        cmocka_unit_test(test_far_quantisation_steps_are_no_edges), cmocka_unit_test(test_noise_is_no_edge)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
