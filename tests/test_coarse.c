// The likeness's surface with fewer triangles: still closed, near where it was, and of its colours.
#include "tests/test.h"

#include "reenact/coarse.h"

#include <stdlib.h>
#include <string.h>

enum { AROUND = 96, ALONG = 64, POINTS = AROUND * ALONG };
static const double PI = 3.14159265358979323846;

// Two rings (a tube each), 5 mm apart at their nearest: 9 mm triangles, closed.
struct rings {
    struct surface surface;
    struct coat coat;
};

static int point_of(int ring, int i, int j) { return ring * POINTS + i % AROUND * ALONG + j % ALONG; }

static struct rings rings_make(void)
{
    struct rings r = {0};
    r.surface.points = calloc(2 * POINTS, sizeof *r.surface.points);
    r.surface.corners = calloc(12 * POINTS, sizeof *r.surface.corners);
    r.coat.color = calloc(2 * POINTS, sizeof *r.coat.color);
    r.coat.filled = calloc(2 * POINTS, 1);
    r.surface.point_count = 2 * POINTS;
    for (int ring = 0; ring < 2; ring++)
        for (int i = 0; i < AROUND; i++)
            for (int j = 0; j < ALONG; j++) {
                double a = 2 * PI * i / AROUND, b = 2 * PI * j / ALONG, out = 0.14 + 0.09 * cos(b);
                int at = point_of(ring, i, j);
                r.surface.points[at] = v3(out * cos(a), out * sin(a), 0.09 * sin(b) + 0.185 * ring);
                r.coat.color[at][ring] = 0.5F;
                const int32_t q[4] = {at, point_of(ring, i + 1, j), point_of(ring, i + 1, j + 1),
                                      point_of(ring, i, j + 1)};
                const int32_t corners[6] = {q[0], q[1], q[2], q[0], q[2], q[3]};
                memcpy(r.surface.corners + r.surface.corner_count, corners, sizeof corners);
                r.surface.corner_count += 6;
            }
    return r;
}

static void rings_free(struct rings *r)
{
    surface_free(&r->surface);
    coat_free(&r->coat);
}

static double volume_of(const struct surface *s, const struct coarse *c)
{
    double sum = 0;
    int count = c ? c->corner_count : s->corner_count;
    for (int i = 0; i < count; i += 3) {
        struct vec3 p[3];
        for (int k = 0; k < 3; k++)
            p[k] = s->points[c ? c->points[c->corners[i + k]] : s->corners[i + k]];
        sum += v3_dot(p[0], v3_cross(p[1], p[2])) / 6;
    }
    return sum;
}

static void fewer_and_the_same_shape(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct coarse c;
    EXPECT_STATUS(coarse_make(&c, &r.surface, &r.coat), OK);
    double fine_l = 1e3 * volume_of(&r.surface, NULL), coarse_l = 1e3 * volume_of(&r.surface, &c);
    print_message("%d triangles of %d, %.3f litres of %.3f\n", c.corner_count / 3, r.surface.corner_count / 3, coarse_l,
                  fine_l);
    EXPECT_AT_MOST(c.corner_count, 0.45 * r.surface.corner_count);
    EXPECT_AT_MOST(fabs(coarse_l - fine_l), 0.02 * fine_l);
    coarse_free(&c);
    rings_free(&r);
}

// As often as a side is walked one way, it is walked the other way.
static void stays_closed(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct coarse c;
    EXPECT_STATUS(coarse_make(&c, &r.surface, &r.coat), OK);
    int8_t *walked = calloc((size_t)c.point_count * (size_t)c.point_count, 1);
    for (int i = 0; i < c.corner_count; i++) {
        int a = c.corners[i], b = c.corners[i % 3 == 2 ? i - 2 : i + 1];
        walked[(size_t)a * (size_t)c.point_count + (size_t)b]++;
    }
    int open = 0;
    for (int a = 0; a < c.point_count; a++)
        for (int b = 0; b < a; b++)
            open += walked[(size_t)a * (size_t)c.point_count + (size_t)b] !=
                    walked[(size_t)b * (size_t)c.point_count + (size_t)a];
    EXPECT_INT(open, 0);
    free(walked);
    coarse_free(&c);
    rings_free(&r);
}

static void what_lies_near_but_apart_is_not_joined(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct coarse c;
    EXPECT_STATUS(coarse_make(&c, &r.surface, &r.coat), OK);
    for (int i = 0; i < c.corner_count; i += 3)
        for (int k = 1; k < 3; k++)
            EXPECT_INT(c.points[c.corners[i + k]] / POINTS, c.points[c.corners[i]] / POINTS);
    for (int i = 0; i < c.point_count; i++) {
        EXPECT_NEAR(c.color[i][c.points[i] / POINTS], 0.5, 1e-6);
        EXPECT_NEAR(c.color[i][1 - c.points[i] / POINTS], 0, 0);
    }
    coarse_free(&c);
    rings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fewer_and_the_same_shape),
        cmocka_unit_test(stays_closed),
        cmocka_unit_test(what_lies_near_but_apart_is_not_joined),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
