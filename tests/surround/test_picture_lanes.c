// Four points at a time have the results of one at a time, bit for bit, in panoramas and in perspective pictures, and a
// colour is what Catmull and Rom's weights make of the pixels around, also at edges.
#include "tests/support/test.h"

#include "surround/picture/picture_lanes.h"

#include <stdlib.h>

enum { WIDTH = 64, HEIGHT = 32, TRIALS = 20000 };
static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 40.3, .fy = 41.1, .cx = 31.2, .cy = 15.9};

static struct rng rng = {20131107};

static double random_in(double low, double high) { return rng_between(&rng, low, high); }

static void make(struct surround_picture *p, const struct lens *of)
{
    uint8_t *rgb = malloc(WIDTH * HEIGHT * 3);
    assert_non_null(rgb);
    print_message("seed %llu\n", (unsigned long long)rng.state);
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        rgb[i] = (uint8_t)random_in(0, 256);
    assert_int_equal(surround_picture_make(p, rgb, WIDTH, HEIGHT, of), OK);
    const struct quat turn = quat_unit((struct quat){0.3, -0.2, 0.5, 0.7});
    surround_picture_place(p, (struct pose){turn, v3(0.3, -0.8, 1.1)});
}

static uint32_t bits(float a)
{
    uint32_t out;
    memcpy(&out, &a, sizeof out);
    return out;
}

static void check_points(const struct surround_picture *p)
{
    int inside = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        // Far, near, and now and then on an axis of the camera
        const double size = trial % 3 ? 4 : 0.01;
        four_doubles world[3];
        for (int l = 0; l < 4; l++) {
            const double x = random_in(-size, size), y = random_in(-size, size), z = random_in(-size, size);
            struct vec3 at = v3(x, y, z);
            if (trial % 7 == 0)
                at = pose_apply(p->world_from_camera, v3(l == 0 ? x : 0, l == 1 ? y : 0, l == 2 ? z : 0));
            world[0][l] = at.x, world[1][l] = at.y, world[2][l] = at.z;
        }
        struct four_points four_found;
        four camera[3];
        surround_picture_distances(p, world, camera, &four_found);
        surround_picture_find_four(p, camera, &four_found);
        for (int l = 0; l < 4; l++) {
            struct picture_point one;
            const bool found = surround_picture_project(p, (double[3]){world[0][l], world[1][l], world[2][l]}, &one);
            EXPECT_INT(four_found.inside[l] != 0, found);
            EXPECT_INT(bits(four_found.distance[l]), bits(one.distance));
            if (!found)
                continue;
            inside++;
            EXPECT_INT(bits(four_found.u[l]), bits(one.u));
            EXPECT_INT(bits(four_found.v[l]), bits(one.v));
        }
    }
    EXPECT_AT_LEAST(inside, TRIALS / 10);
    for (int v = 0; v < HEIGHT; v++)
        for (int u = 0; u + 4 <= WIDTH; u++) {
            four rays[3];
            surround_picture_rays(p, u, v, rays);
            for (int l = 0; l < 4; l++) {
                float ray[3];
                surround_picture_ray(p, u + l, v, ray);
                for (int i = 0; i < 3; i++)
                    EXPECT_INT(bits(rays[i][l]), bits(ray[i]));
            }
        }
}

static void test_panorama(void **state)
{
    (void)state;
    struct surround_picture p;
    make(&p, NULL);
    check_points(&p);
    surround_picture_free(&p);
}

static void test_perspective(void **state)
{
    (void)state;
    struct surround_picture p;
    make(&p, &lens);
    check_points(&p);
    surround_picture_free(&p);
}

// The cubic of Catmull and Rom 1974 through four values, a quarter of the way and so on from the second to the third.
static double cubic(const double a[4], double t)
{
    return a[1] +
           0.5 * t *
               (a[2] - a[0] + t * (2 * a[0] - 5 * a[1] + 4 * a[2] - a[3] + t * (3 * (a[1] - a[2]) + a[3] - a[0])));
}

static double pixel(const struct surround_picture *p, int u, int v, int c)
{
    u = p->panorama ? (u + WIDTH) % WIDTH : u < 0 ? 0 : u >= WIDTH ? WIDTH - 1 : u;
    v = v < 0 ? 0 : v >= HEIGHT ? HEIGHT - 1 : v;
    return p->rgb[3 * (v * WIDTH + u) + c];
}

static void test_colors(void **state)
{
    (void)state;
    for (int panorama = 0; panorama < 2; panorama++) {
        struct surround_picture p;
        make(&p, panorama ? NULL : &lens);
        p.gain[1] = 1.2f;
        for (int trial = 0; trial < TRIALS; trial++) {
            const double u = random_in(-0.5, WIDTH - 0.5), v = random_in(-0.5, HEIGHT - 0.5);
            const int x = (int)floor(u), y = (int)floor(v);
            float rgb[3];
            surround_picture_sample(&p, (float)u, (float)v, rgb);
            for (int c = 0; c < 3; c++) {
                double rows[4];
                for (int j = 0; j < 4; j++) {
                    double row[4];
                    for (int i = 0; i < 4; i++)
                        row[i] = pixel(&p, x + i - 1, y + j - 1, c);
                    rows[j] = cubic(row, u - x);
                }
                const double want = cubic(rows, v - y) * (c == 1 ? 1.2 : 1);
                EXPECT_NEAR(rgb[c], fmax(0, fmin(255, want)), 0.02);
            }
        }
        surround_picture_free(&p);
    }
}

static void test_whole_numbers_below(void **state)
{
    (void)state;
    static const float some[] = {0, -0.0f, 0.5f, -0.5f, 1, -1, -1.5f, 2047.999f, -3.0001f, 1e6f};
    for (size_t i = 0; i < COUNT_OF(some); i++)
        EXPECT_INT(floor_of(some[i]), (int)floor((double)some[i]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_panorama),
        cmocka_unit_test(test_perspective),
        cmocka_unit_test(test_colors),
        cmocka_unit_test(test_whole_numbers_below),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
