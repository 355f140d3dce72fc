// Coverage against the truth of the small world: the share of the figure's skin that some frame of a film shows, by the
// exact depth and the skin's normals.
#include "tests/support/test.h"

#include "capture/coaching/coverage.h"
#include "tests/support/tracked_film.h"
#include "tests/world/world_internal.h"

#include <stdio.h>
#include <time.h>

// The film of a figure: frames of a motion, evenly over its length.
struct film_case {
    const char *figure, *motion;
    double share; // of the motion that is filmed
};

static const struct film_case films[] = {
    {"woman", "still", 1},     {"man", "still", 1},         {"child", "still", 1},     {"heavy", "still", 1},
    {"woman", "pirouette", 1}, {"man", "pirouette", 1},     {"child", "pirouette", 1}, {"heavy", "pirouette", 1},
    {"skirt", "pirouette", 1}, {"coat", "pirouette", 1},    {"tall", "pirouette", 1},  {"woman", "pirouette", 0.5},
    {"man", "pirouette", 0.6}, {"heavy", "pirouette", 0.7}, {"woman", "kata", 1},      {"man", "kata", 1},
    {"tall", "kata", 0.5},     {"child", "walk", 1},        {"man", "walk", 1},        {"woman", "bend", 1},
};

struct truth {
    struct world *world;
    int vertices;
    bool *seen;
    struct vec3 *at;
    struct vec3f *normal;
};

// Processor time of this thread.
static double cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

// Marks what the exact depth image shows of the skin.
static void mark_seen(struct truth *t, const struct lens *lens, struct pose world_from_camera, double time_s,
                      const uint16_t *exact)
{
    const struct stance stance = world_stance(t->world, time_s);
    const struct pose camera_from_world = pose_inverse(world_from_camera);
    struct posed posed;
    physique_pose(&t->world->physique, &stance, &posed);
    figure_pose(&t->world->figure, &posed, 0, t->vertices, t->at, t->normal);
    for (int i = 0; i < t->vertices; i++) {
        const struct vec3 p = pose_apply(camera_from_world, t->at[i]);
        const struct vec3 n =
            quat_rotate(camera_from_world.rotation, v3(t->normal[i].x, t->normal[i].y, t->normal[i].z));
        if (p.z < 0.4 || -v3_dot(n, v3_unit(p)) < COVERAGE_COSINE)
            continue;
        const struct pixel px = lens_project(lens, p);
        const int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
        if (x < 0 || y < 0 || x >= lens->width || y >= lens->height)
            continue;
        t->seen[i] |= fabs(exact[y * lens->width + x] * 1e-3 - p.z) < 0.03;
    }
}

static double truth_share(const struct truth *t)
{
    const struct mesh *mesh = &t->world->figure.mesh;
    double seen = 0, all = 0;
    for (int i = 0; i < mesh->triangle_count; i++) {
        struct vec3 c[3];
        int n = 0;
        for (int k = 0; k < 3; k++) {
            const struct vec3f v = mesh->at[mesh->triangles[i][k]];
            c[k] = v3(v.x, v.y, v.z);
            n += t->seen[mesh->triangles[i][k]];
        }
        const double area = v3_length(v3_cross(v3_sub(c[1], c[0]), v3_sub(c[2], c[0])));
        all += area;
        seen += area * n / 3;
    }
    return seen / all;
}

static void film_case_run(const struct film_case *film, struct coverage *coverage, double *truth, double *slowest_ms)
{
    enum { FRAMES = 24 };
    struct world_options o = world_default_options();
    struct truth t = {0};
    o.motion = film->motion;
    o.plain = true;
    EXPECT_TRUE(world_figure_named(film->figure, &o.figure));
    EXPECT_STATUS(world_open(&t.world, &o), OK);
    const struct calibration k = world_calibration(0.5);
    const size_t pixels = (size_t)k.depth.width * (size_t)k.depth.height;
    uint16_t *exact = malloc(2 * pixels * sizeof *exact), *noisy = exact + pixels;
    uint8_t *mask = malloc(pixels);
    t.vertices = t.world->figure.mesh.vertex_count;
    t.seen = calloc((size_t)t.vertices, sizeof *t.seen);
    t.at = malloc((size_t)t.vertices * sizeof *t.at);
    t.normal = malloc((size_t)t.vertices * sizeof *t.normal);
    const struct pose camera = world_sensor_pose(t.world);
    coverage_reset(coverage);
    for (int i = 0; i < FRAMES; i++) {
        const double time_s = film->share * world_seconds(t.world) * i / FRAMES;
        const struct world_shot shot = {k.depth, camera, time_s, true};
        EXPECT_STATUS(world_render(t.world, &shot, &(struct world_image){.depth = exact, .mask = mask}), OK);
        EXPECT_STATUS(world_depth_noise(&k.depth, exact, (uint64_t)i + 1, noisy), OK);
        mark_seen(&t, &k.depth, camera, time_s, exact);
        const struct skeleton s = world_joints_in_camera(t.world, time_s, camera);
        const double begun = cpu_ms();
        EXPECT_TRUE(coverage_add(coverage, &(struct coverage_view){&k, noisy, mask, &s, 0}));
        *slowest_ms = fmax(*slowest_ms, cpu_ms() - begun);
    }
    *truth = truth_share(&t);
    free(exact);
    free(mask);
    free(t.seen);
    free(t.at);
    free(t.normal);
    world_close(&t.world);
}

static void test_share_of_the_surface(void **state)
{
    (void)state;
    static struct coverage coverage;
    double worst = 0, sum = 0, slowest_ms = 0;
    int count = 0;
    for (size_t i = 0; i < COUNT_OF(films); i += SANITIZED ? 4 : 1, count++) {
        double truth;
        film_case_run(&films[i], &coverage, &truth, &slowest_ms);
        const double share = coverage_share(&coverage);
        printf("%-6s %-9s %3.0f %%: truth %5.1f %%, dial %5.1f %%, off %+5.1f\n", films[i].figure, films[i].motion,
               films[i].share * 100, truth * 100, share * 100, (share - truth) * 100);
        worst = fmax(worst, fabs(share - truth));
        sum += fabs(share - truth);
    }
    printf("worst %.1f points, mean %.1f; slowest frame %.2f ms\n", worst * 100, sum / count * 100, slowest_ms);
    EXPECT_AT_MOST(worst, 0.05);
}

// With the skeleton and mask of the tracker, from depth alone, at 30 Hz.
static void test_share_as_tracked(void **state)
{
    (void)state;
    static const struct film_case tracked[] = {{"man", "still", 1}, {"woman", "pirouette", 1}, {"man", "kata", 0.5}};
    static struct coverage coverage;
    for (size_t i = 0; i < COUNT_OF(tracked); i += SANITIZED ? COUNT_OF(tracked) : 1) {
        struct tracked_film f;
        struct truth t = {0};
        tracked_film_open(&f, tracked[i].figure, tracked[i].motion);
        const struct lens *lens = &f.calibration.depth;
        uint16_t *exact = malloc(f.pixels * sizeof *exact);
        const struct pose camera = world_sensor_pose(f.world);
        t.world = f.world;
        t.vertices = f.world->figure.mesh.vertex_count;
        t.seen = calloc((size_t)t.vertices, sizeof *t.seen);
        t.at = malloc((size_t)t.vertices * sizeof *t.at);
        t.normal = malloc((size_t)t.vertices * sizeof *t.normal);
        coverage_reset(&coverage);
        for (int k = 0; k / 30.0 < tracked[i].share * world_seconds(f.world); k++) {
            struct skeleton s;
            tracked_film_shoot(&f, camera, k / 30.0, (uint64_t)k + 1);
            enum status status = tracker_next(f.tracker, nanoseconds(k / 30.0), f.depth, &s, f.mask);
            EXPECT_TRUE(status >= 0);
            if (status == OK)
                coverage_add(&coverage, &(struct coverage_view){&f.calibration, f.depth, f.mask, &s, 0});
            if (k % 6)
                continue;
            const struct world_shot shot = {*lens, camera, k / 30.0, true};
            EXPECT_STATUS(world_render(f.world, &shot, &(struct world_image){.depth = exact}), OK);
            mark_seen(&t, lens, camera, k / 30.0, exact);
        }
        const double share = coverage_share(&coverage), truth = truth_share(&t);
        printf("tracked %-6s %-9s: truth %5.1f %%, dial %5.1f %%, off %+5.1f\n", tracked[i].figure, tracked[i].motion,
               truth * 100, share * 100, (share - truth) * 100);
        EXPECT_NEAR(share, truth, 0.1);
        free(exact);
        free(t.seen);
        free(t.at);
        free(t.normal);
        tracked_film_close(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_share_of_the_surface),
                                       cmocka_unit_test(test_share_as_tracked)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
