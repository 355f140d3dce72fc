// Unwrapping against what a layout must be, by brute force: every triangle has texels of its own, charts keep their
// distance, and lengths are those of the surface seen from its chart's direction.
#include "tests/support/test.h"

#include "reenact/avatar/texture_atlas.h"

#include <stdio.h>

enum { SEED = 1569, MAX_POINTS = 20000, MOST_CORNERS = 60000, MAX_SIDE = 1280 };
#define TEXEL_M 0.01

struct mesh {
    struct vec3 point[MAX_POINTS];
    int32_t corner[MOST_CORNERS];
    struct surface_mesh surface;
};

static struct mesh mesh;

static void clear_mesh(void) { mesh.surface = (struct surface_mesh){.points = mesh.point, .corners = mesh.corner}; }

static int32_t add_point(double x, double y, double z)
{
    assert_true(mesh.surface.point_count < MAX_POINTS);
    mesh.point[mesh.surface.point_count] = v3(x, y, z);
    return mesh.surface.point_count++;
}

static void add_triangle(int32_t a, int32_t b, int32_t c)
{
    assert_true(mesh.surface.corner_count + 3 <= MOST_CORNERS);
    const int32_t corner[3] = {a, b, c};
    memcpy(mesh.corner + mesh.surface.corner_count, corner, sizeof corner);
    mesh.surface.corner_count += 3;
}

// A grid of so many squares between two edges from `at`.
static void add_grid(struct vec3 at, struct vec3 across, struct vec3 along, int squares)
{
    const int32_t first = mesh.surface.point_count;
    for (int y = 0; y <= squares; y++)
        for (int x = 0; x <= squares; x++) {
            const struct vec3 p =
                v3_add(at, v3_add(v3_scale(across, (double)x / squares), v3_scale(along, (double)y / squares)));
            add_point(p.x, p.y, p.z);
        }
    for (int y = 0; y < squares; y++)
        for (int x = 0; x < squares; x++) {
            const int32_t i = first + y * (squares + 1) + x;
            add_triangle(i, i + 1, i + squares + 1);
            add_triangle(i + 1, i + squares + 2, i + squares + 1);
        }
}

// A ball of rings between two poles, around `centre`.
static void add_ball(struct vec3 centre, double radius, int rings)
{
    const double pi = 3.14159265358979;
    const int sectors = 2 * rings;
    const int32_t top = add_point(centre.x, centre.y + radius, centre.z), first = mesh.surface.point_count;
    for (int r = 1; r < rings; r++)
        for (int s = 0; s < sectors; s++) {
            const double down = pi * r / rings, about = 2 * pi * s / sectors;
            add_point(centre.x + radius * sin(down) * cos(about), centre.y + radius * cos(down),
                      centre.z - radius * sin(down) * sin(about));
        }
    const int32_t bottom = add_point(centre.x, centre.y - radius, centre.z);
    for (int s = 0; s < sectors; s++) {
        const int next = (s + 1) % sectors;
        add_triangle(top, first + s, first + next);
        for (int r = 0; r + 2 < rings; r++) {
            const int32_t a = first + r * sectors + s, b = first + r * sectors + next;
            add_triangle(a, a + sectors, b + sectors);
            add_triangle(a, b + sectors, b);
        }
        add_triangle(bottom, first + (rings - 2) * sectors + next, first + (rings - 2) * sectors + s);
    }
}

static struct uv_mesh unwrap(double texel_m)
{
    struct uv_mesh out;
    EXPECT_STATUS(uv_unwrap(&out, &mesh.surface, mesh.corner, mesh.surface.corner_count, texel_m), OK);
    return out;
}

// ------------------------------------------------------------- what must hold

static const float *at(const struct uv_mesh *uv, int corner) { return uv->at[uv->corners[corner]]; }

static double signed_area_px2(const struct uv_mesh *uv, int t)
{
    const float *a = at(uv, 3 * t), *b = at(uv, 3 * t + 1), *c = at(uv, 3 * t + 2);
    return 0.5 * (((double)b[0] - a[0]) * ((double)c[1] - a[1]) - ((double)b[1] - a[1]) * ((double)c[0] - a[0]));
}

static double area_m2(int t)
{
    const struct vec3 a = mesh.point[mesh.corner[3 * t]], b = mesh.point[mesh.corner[3 * t + 1]];
    const struct vec3 c = mesh.point[mesh.corner[3 * t + 2]];
    return 0.5 * v3_length(v3_cross(v3_sub(b, a), v3_sub(c, a)));
}

static void expect_same_points(const struct uv_mesh *uv)
{
    EXPECT_INT(uv->corner_count, mesh.surface.corner_count);
    EXPECT_TRUE(uv->point_count <= uv->corner_count);
    for (int i = 0; i < uv->corner_count; i++) {
        EXPECT_TRUE(uv->corners[i] >= 0 && uv->corners[i] < uv->point_count);
        EXPECT_INT(uv->points[uv->corners[i]], mesh.corner[i]);
    }
    EXPECT_TRUE(uv->width <= MAX_SIDE && uv->height <= MAX_SIDE);
    for (int i = 0; i < uv->point_count; i++)
        EXPECT_TRUE(uv->at[i][0] >= 0.5 && uv->at[i][0] <= uv->width - 0.5 && uv->at[i][1] >= 0.5 &&
                    uv->at[i][1] <= uv->height - 0.5);
}

// No texel's centre lies well within two triangles.
static void expect_no_overlap(const struct uv_mesh *uv)
{
    uint8_t *taken = calloc((size_t)uv->width * (size_t)uv->height, 1);
    assert_non_null(taken);
    int twice = 0;
    for (int t = 0; t < uv->corner_count / 3; t++) {
        const float *a = at(uv, 3 * t), *b = at(uv, 3 * t + 1), *c = at(uv, 3 * t + 2);
        const double area = 2 * signed_area_px2(uv, t);
        if (area == 0)
            continue;
        for (int y = (int)fminf(a[1], fminf(b[1], c[1])); y <= (int)fmaxf(a[1], fmaxf(b[1], c[1])); y++)
            for (int x = (int)fminf(a[0], fminf(b[0], c[0])); x <= (int)fmaxf(a[0], fmaxf(b[0], c[0])); x++) {
                const double px = x + 0.5, py = y + 0.5;
                const double u = ((b[0] - px) * (c[1] - py) - (b[1] - py) * (c[0] - px)) / area;
                const double v = ((c[0] - px) * (a[1] - py) - (c[1] - py) * (a[0] - px)) / area;
                if (u > 0.01 && v > 0.01 && u + v < 0.99)
                    twice += taken[y * uv->width + x]++ > 0;
            }
    }
    EXPECT_INT(twice, 0);
    free(taken);
}

struct chart_box {
    float low[2], high[2];
};

// Charts: what hangs together by shared points of the layout. Their boxes are at least the margin apart.
static int expect_charts_apart(const struct uv_mesh *uv)
{
    int32_t *chart = malloc(sizeof *chart * (size_t)uv->point_count);
    struct chart_box *box = malloc(sizeof *box * (size_t)uv->point_count);
    assert_true(chart && box);
    for (int i = 0; i < uv->point_count; i++)
        chart[i] = i;
    for (bool changed = true; changed;) {
        changed = false;
        for (int i = 0; i < uv->corner_count; i++) {
            int32_t *a = &chart[uv->corners[i]], *b = &chart[uv->corners[i % 3 == 2 ? i - 2 : i + 1]];
            const int32_t least = *a < *b ? *a : *b;
            changed |= *a != *b;
            *a = *b = least;
        }
    }
    int charts = 0;
    for (int i = 0; i < uv->point_count; i++) {
        struct chart_box *mine = &box[chart[i]];
        if (chart[i] == i) {
            memcpy(mine->low, uv->at[i], sizeof mine->low);
            memcpy(mine->high, uv->at[i], sizeof mine->high);
            charts++;
        }
        for (int k = 0; k < 2; k++) {
            mine->low[k] = fminf(mine->low[k], uv->at[i][k]);
            mine->high[k] = fmaxf(mine->high[k], uv->at[i][k]);
        }
    }
    for (int i = 0; i < uv->point_count; i++)
        for (int j = 0; j < i && chart[i] == i; j++)
            if (chart[j] == j) {
                const double x = fmax(box[i].low[0] - box[j].high[0], box[j].low[0] - box[i].high[0]);
                const double y = fmax(box[i].low[1] - box[j].high[1], box[j].low[1] - box[i].high[1]);
                EXPECT_AT_LEAST(fmax(x, y), UV_CHART_MARGIN - 1e-3);
            }
    free(chart);
    free(box);
    return charts;
}

// All triangles turn the same way, and none is smaller in the layout than one that faces 60 degrees away.
static void expect_areas(const struct uv_mesh *uv, double texel_m)
{
    double least = INFINITY, most = 0;
    for (int t = 0; t < uv->corner_count / 3; t++) {
        const double wanted = area_m2(t) / (texel_m * texel_m);
        if (wanted < 1e-9)
            continue;
        least = fmin(least, signed_area_px2(uv, t) / wanted);
        most = fmax(most, signed_area_px2(uv, t) / wanted);
    }
    EXPECT_AT_LEAST(least, 0.5 - 1e-3);
    EXPECT_AT_MOST(most, 1 + 1e-3);
}

static bool has_edge(int t, int32_t from, int32_t to)
{
    for (int k = 0; k < 3; k++)
        if (mesh.corner[3 * t + k] == from && mesh.corner[3 * t + (k + 1) % 3] == to)
            return true;
    return false;
}

// Of a closed or open surface on which each edge has at most two triangles.
static void expect_neighbours(const struct uv_mesh *uv)
{
    const int triangles = uv->corner_count / 3;
    for (int t = 0; t < triangles; t++)
        for (int k = 0; k < 3; k++) {
            int found = -1;
            for (int other = 0; other < triangles && found < 0; other++)
                if (has_edge(other, mesh.corner[3 * t + (k + 1) % 3], mesh.corner[3 * t + k]))
                    found = other;
            EXPECT_INT(uv->neighbor[t][k], found);
        }
}

static int expect_layout(const struct uv_mesh *uv, double texel_m)
{
    expect_same_points(uv);
    expect_no_overlap(uv);
    expect_areas(uv, texel_m);
    return expect_charts_apart(uv);
}

// ------------------------------------------------------------- surfaces

static void test_empty_surface(void **state)
{
    (void)state;
    clear_mesh();
    struct uv_mesh uv = unwrap(TEXEL_M);
    EXPECT_INT(uv.point_count, 0);
    EXPECT_INT(uv.corner_count, 0);
    uv_mesh_free(&uv);
    EXPECT_TRUE(!uv.points && !uv.at && !uv.corners && !uv.neighbor);
    uv_mesh_free(&uv);
}

static void test_one_triangle(void **state)
{
    (void)state;
    clear_mesh();
    add_triangle(add_point(0, 0, 1), add_point(0.3, 0, 1), add_point(0, 0.4, 1));
    struct uv_mesh uv = unwrap(TEXEL_M);
    EXPECT_INT(expect_layout(&uv, TEXEL_M), 1);
    for (int k = 0; k < 3; k++)
        EXPECT_INT(uv.neighbor[0][k], -1);
    const double wanted[] = {30, 50, 40}; // texels: it lies flat on its chart
    for (int k = 0; k < 3; k++) {
        const float *a = at(&uv, k), *b = at(&uv, (k + 1) % 3);
        EXPECT_NEAR(hypot(a[0] - b[0], a[1] - b[1]), wanted[k], 1e-4);
    }
    uv_mesh_free(&uv);
}

// In any direction a plane is one chart and keeps its lengths, if it faces a main direction.
static void test_plane(void **state)
{
    (void)state;
    const struct vec3 edges[6][2] = {{v3(1, 0, 0), v3(0, 1, 0)}, {v3(0, 1, 0), v3(1, 0, 0)},
                                     {v3(0, 1, 0), v3(0, 0, 1)}, {v3(0, 0, 1), v3(0, 1, 0)},
                                     {v3(0, 0, 1), v3(1, 0, 0)}, {v3(1, 0, 0), v3(0, 0, 1)}};
    for (int i = 0; i < 6; i++) {
        clear_mesh();
        add_grid(v3(-3, 2, 1), edges[i][0], edges[i][1], 12);
        struct uv_mesh uv = unwrap(TEXEL_M);
        EXPECT_INT(expect_layout(&uv, TEXEL_M), 1);
        EXPECT_INT(uv.point_count, 13 * 13);
        for (int t = 0; t < uv.corner_count / 3; t++)
            EXPECT_NEAR(signed_area_px2(&uv, t), area_m2(t) / (TEXEL_M * TEXEL_M), 0.01);
        expect_neighbours(&uv);
        uv_mesh_free(&uv);
    }
}

// Each side is a chart; what they share is there twice or three times.
static void test_box(void **state)
{
    (void)state;
    const int32_t sides[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    clear_mesh();
    for (int i = 0; i < 8; i++)
        add_point(i & 1 ? 0.3 : 0, i & 2 ? 0.2 : 0, i & 4 ? 0.5 : 0);
    for (int i = 0; i < 6; i++) {
        add_triangle(sides[i][0], sides[i][1], sides[i][2]);
        add_triangle(sides[i][0], sides[i][2], sides[i][3]);
    }
    struct uv_mesh uv = unwrap(TEXEL_M);
    EXPECT_INT(expect_layout(&uv, TEXEL_M), 6);
    EXPECT_INT(uv.point_count, 6 * 4);
    expect_neighbours(&uv);
    uv_mesh_free(&uv);
}

static void test_ball(void **state)
{
    (void)state;
    clear_mesh();
    add_ball(v3(1, -2, 0.5), 0.5, 20);
    struct uv_mesh uv = unwrap(TEXEL_M);
    const int charts = expect_layout(&uv, TEXEL_M);
    print_message("a ball has %d charts, %d points of %d, %d x %d texels\n", charts, uv.point_count,
                  mesh.surface.point_count, uv.width, uv.height);
    EXPECT_INT(charts, 6);
    expect_neighbours(&uv);
    uv_mesh_free(&uv);
}

// Two sheets of one surface that lie one before the other, joined by a fold at one end, cannot share a chart.
static void test_fold(void **state)
{
    (void)state;
    clear_mesh();
    const int32_t first = mesh.surface.point_count;
    const double bend[][2] = {{0, 0}, {0.5, 0.1}, {0.9, 0.45}, {0.45, 0.5}, {-0.2, 0.45}, {-0.3, 0.8}, {0.6, 0.85}};
    for (size_t i = 0; i < COUNT_OF(bend); i++)
        for (int k = 0; k < 2; k++)
            add_point(bend[i][0], 0.4 * k, bend[i][1]);
    for (int32_t i = 0; i + 1 < (int32_t)COUNT_OF(bend); i++) {
        const int32_t a = first + 2 * i;
        add_triangle(a, a + 1, a + 2);
        add_triangle(a + 1, a + 3, a + 2);
    }
    struct uv_mesh uv = unwrap(TEXEL_M);
    EXPECT_AT_LEAST(expect_layout(&uv, TEXEL_M), 2);
    expect_neighbours(&uv);
    uv_mesh_free(&uv);
}

// Any soup of triangles is laid out, those without area too.
static void test_soup_with_slivers(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    clear_mesh();
    for (int i = 0; i < 150; i++) {
        const struct vec3 p = rng_within(&rng, v3(0.5, 0.5, 0.5)), e = rng_within(&rng, v3(0.1, 0.1, 0.1));
        const struct vec3 f = i % 3 ? rng_within(&rng, v3(0.1, 0.1, 0.1)) : i % 2 ? v3_scale(e, 2) : v3(0, 0, 0);
        add_triangle(add_point(p.x, p.y, p.z), add_point(p.x + e.x, p.y + e.y, p.z + e.z),
                     add_point(p.x + f.x, p.y + f.y, p.z + f.z));
    }
    struct uv_mesh uv = unwrap(TEXEL_M);
    EXPECT_AT_MOST(expect_layout(&uv, TEXEL_M), 150);
    uv_mesh_free(&uv);
}

// Three triangles at an edge, as no surface has them.
static void test_edge_of_three(void **state)
{
    (void)state;
    clear_mesh();
    const int32_t a = add_point(0, 0, 0), b = add_point(0, 0.3, 0);
    add_triangle(a, b, add_point(0.3, 0, 0));
    add_triangle(a, b, add_point(-0.3, 0, 0));
    add_triangle(a, b, add_point(0, 0, 0.3));
    struct uv_mesh uv = unwrap(TEXEL_M);
    expect_layout(&uv, TEXEL_M);
    uv_mesh_free(&uv);
}

// ------------------------------------------------------------- too large

// A surface longer than any chart is cut, a triangle is not.
static void test_longer_than_a_chart(void **state)
{
    (void)state;
    clear_mesh();
    add_grid(v3(0, 0, 0), v3(1, 0, 0), v3(0, 0.1, 0), 10);
    struct uv_mesh uv = unwrap(1 / 1020.0);
    EXPECT_INT(expect_layout(&uv, 1 / 1020.0), 1);
    uv_mesh_free(&uv);
    uv = unwrap(1 / 1100.0);
    EXPECT_INT(expect_layout(&uv, 1 / 1100.0), 2);
    uv_mesh_free(&uv);
    clear_mesh();
    add_triangle(add_point(0, 0, 0), add_point(1, 0, 0), add_point(0, 0.1, 0));
    EXPECT_STATUS(uv_unwrap(&uv, &mesh.surface, mesh.corner, mesh.surface.corner_count, 1 / 1100.0), ERR_INPUT);
    EXPECT_TRUE(!uv.points && !uv.at && !uv.corners && !uv.neighbor && !uv.point_count && !uv.width);
}

static void test_too_many_charts(void **state)
{
    (void)state;
    clear_mesh();
    for (int i = 0; i < 5; i++) // each alone is small enough
        add_grid(v3(0, 0, i), v3(1, 0, 0), v3(0, 1, 0), 4);
    struct uv_mesh uv;
    EXPECT_STATUS(uv_unwrap(&uv, &mesh.surface, mesh.corner, mesh.surface.corner_count, 1 / 900.0), ERR_INPUT);
    EXPECT_TRUE(!uv.points && !uv.at && !uv.corners && !uv.neighbor);
    uv = unwrap(1 / 400.0);
    EXPECT_INT(expect_layout(&uv, 1 / 400.0), 5);
    uv_mesh_free(&uv);
}

int main(void)
{
    print_message("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_empty_surface),
        cmocka_unit_test(test_one_triangle),
        cmocka_unit_test(test_plane),
        cmocka_unit_test(test_box),
        cmocka_unit_test(test_ball),
        cmocka_unit_test(test_fold),
        cmocka_unit_test(test_soup_with_slivers),
        cmocka_unit_test(test_edge_of_three),
        cmocka_unit_test(test_longer_than_a_chart),
        cmocka_unit_test(test_too_many_charts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
