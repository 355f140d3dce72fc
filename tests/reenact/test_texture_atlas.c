// The texture atlas of two rings: its mesh is still closed and has the same volume, and its texels have the colours of
// the surface.
#include "tests/support/test.h"

#include "reenact/avatar/texture_atlas.h"

#include <stdlib.h>
#include <string.h>

enum { AROUND = 96, ALONG = 64, POINTS = AROUND * ALONG };
static const double PI = 3.14159265358979323846;

// Two tori, 5 mm apart at their nearest: 9 mm triangles, closed. One is red, the other green; from the middle of the
// left half on they were never seen, and the time differs.
struct rings {
    struct surface_mesh surface;
    struct vertex_colors vertex_colors;
};

static bool is_unseen(struct vec3 p) { return p.x > 0.1; }

static int point_of(int ring, int i, int j) { return ring * POINTS + i % AROUND * ALONG + j % ALONG; }

static struct rings rings_make(void)
{
    struct rings r = {0};
    r.surface.points = calloc(2 * POINTS, sizeof *r.surface.points);
    r.surface.normals = calloc(2 * POINTS, sizeof *r.surface.normals);
    r.surface.corners = calloc(12 * POINTS, sizeof *r.surface.corners);
    r.vertex_colors.color = calloc(2 * POINTS, sizeof *r.vertex_colors.color);
    r.vertex_colors.time_s = calloc(2 * POINTS, sizeof *r.vertex_colors.time_s);
    r.vertex_colors.filled = calloc(2 * POINTS, 1);
    r.surface.point_count = 2 * POINTS;
    for (int ring = 0; ring < 2; ring++)
        for (int i = 0; i < AROUND; i++)
            for (int j = 0; j < ALONG; j++) {
                double a = 2 * PI * i / AROUND, b = 2 * PI * j / ALONG, out = 0.14 + 0.09 * cos(b);
                int at = point_of(ring, i, j);
                r.surface.points[at] = v3(out * cos(a), out * sin(a), 0.09 * sin(b) + 0.185 * ring);
                r.surface.normals[at] = v3(cos(b) * cos(a), cos(b) * sin(a), sin(b));
                r.vertex_colors.color[at][ring] = 0.5F;
                r.vertex_colors.filled[at] = is_unseen(r.surface.points[at]);
                r.vertex_colors.time_s[at] = r.vertex_colors.filled[at] ? 600 : 1.5F;
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
    surface_mesh_free(&r->surface);
    vertex_colors_free(&r->vertex_colors);
}

static double signed_volume(const struct vec3 *points, const int32_t *corners, int corner_count)
{
    double sum = 0;
    for (int i = 0; i < corner_count; i += 3)
        sum += v3_dot(points[corners[i]], v3_cross(points[corners[i + 1]], points[corners[i + 2]])) / 6;
    return sum;
}

static void test_simplified_mesh_keeps_shape(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct texture_atlas a;
    EXPECT_STATUS(texture_atlas_make(&a, &r.surface, &r.vertex_colors, 2), OK);
    double fine_l = 1e3 * signed_volume(r.surface.points, r.surface.corners, r.surface.corner_count);
    double few_l = 1e3 * signed_volume(a.points, a.mesh.corners, a.mesh.corner_count);
    print_message("%d triangles of %d, %.3f litres of %.3f; %d points, %d x %d texels\n", a.mesh.corner_count / 3,
                  r.surface.corner_count / 3, few_l, fine_l, a.mesh.point_count, a.mesh.width, a.mesh.height);
    EXPECT_AT_MOST(a.mesh.corner_count, 0.11 * r.surface.corner_count);
    EXPECT_AT_MOST(fabs(few_l - fine_l), 0.004 * fine_l);
    texture_atlas_free(&a);
    rings_free(&r);
}

static int by_number(const void *a, const void *b)
{
    int64_t p = *(const int64_t *)a, q = *(const int64_t *)b;
    return (p > q) - (p < q);
}

// Each edge occurs equally often in either direction, across cuts too.
static void test_mesh_stays_closed(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct texture_atlas a;
    EXPECT_STATUS(texture_atlas_make(&a, &r.surface, &r.vertex_colors, 2), OK);
    const struct uv_mesh *m = &a.mesh;
    int64_t *ways[2], open = 0;
    for (int back = 0; back < 2; back++) {
        ways[back] = malloc(sizeof **ways * (size_t)m->corner_count);
        for (int i = 0; i < m->corner_count; i++) {
            int64_t p = m->points[m->corners[i]], q = m->points[m->corners[i % 3 == 2 ? i - 2 : i + 1]];
            ways[back][i] = back ? q * 2 * POINTS + p : p * 2 * POINTS + q;
        }
        qsort(ways[back], (size_t)m->corner_count, sizeof **ways, by_number);
    }
    for (int i = 0; i < m->corner_count; i++)
        open += ways[0][i] != ways[1][i];
    EXPECT_INT(open, 0);
    free(ways[0]);
    free(ways[1]);
    texture_atlas_free(&a);
    rings_free(&r);
}

// Bilinear, as a GPU does.
static double texel(const struct texture_atlas *a, const double at[2], int channel)
{
    double x = at[0] - 0.5, y = at[1] - 0.5, u = x - floor(x), v = y - floor(y), sum = 0;
    for (int i = 0; i < 4; i++)
        sum += (i % 2 ? u : 1 - u) * (i / 2 ? v : 1 - v) *
               a->color[3 * (((int)floor(y) + i / 2) * a->mesh.width + (int)floor(x) + i % 2) + channel];
    return sum;
}

// All over every triangle, its corners included, the texture has its own ring's colour and time.
static void test_every_texel_keeps_its_color(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct texture_atlas a;
    EXPECT_STATUS(texture_atlas_make(&a, &r.surface, &r.vertex_colors, 2), OK);
    const struct uv_mesh *m = &a.mesh;
    enum { STEPS = 5 };
    double wanted = 255 * sqrt(0.5), most_off = 0;
    long wrong_time = 0, samples = 0;
    for (int t = 0; t < m->corner_count; t += 3)
        for (int i = 0; i <= STEPS; i++)
            for (int j = 0; i + j <= STEPS; j++) {
                const double share[3] = {(double)i / STEPS, (double)j / STEPS, 1 - (double)(i + j) / STEPS};
                double at[2] = {0, 0};
                struct vec3 p = v3(0, 0, 0);
                int ring = m->points[m->corners[t]] / POINTS;
                for (int c = 0; c < 3; c++) {
                    int32_t corner = m->corners[t + c];
                    at[0] += share[c] * (double)m->at[corner][0];
                    at[1] += share[c] * (double)m->at[corner][1];
                    p = v3_add(p, v3_scale(a.points[corner], share[c]));
                }
                for (int c = 0; c < 3; c++)
                    most_off = fmax(most_off, fabs(texel(&a, at, c) - (c == ring ? wanted : 0)));
                const uint8_t *when = a.seen_time + 4 * ((int)at[1] * m->width + (int)at[0]);
                if (fabs(p.x - 0.1) < 0.02)
                    continue; // at the border either time is right
                samples++;
                wrong_time +=
                    when[0] * 256 + when[1] != (is_unseen(p) ? 60000 : 150) || when[2] != (is_unseen(p) ? 255 : 0);
            }
    print_message("%ld samples, colours off by %.2f at most, %ld of another time\n", samples, most_off, wrong_time);
    EXPECT_AT_MOST(most_off, 0.5);
    EXPECT_INT(wrong_time, 0);
    texture_atlas_free(&a);
    rings_free(&r);
}

// No texel belongs to two triangles.
static void test_charts_do_not_overlap(void **state)
{
    (void)state;
    struct rings r = rings_make();
    struct texture_atlas a;
    EXPECT_STATUS(texture_atlas_make(&a, &r.surface, &r.vertex_colors, 2), OK);
    const struct uv_mesh *m = &a.mesh;
    uint8_t *taken = calloc((size_t)m->width * (size_t)m->height, 1);
    long twice = 0, texels = 0;
    for (int t = 0; t < m->corner_count; t += 3) {
        const float *p = m->at[m->corners[t]], *q = m->at[m->corners[t + 1]], *s = m->at[m->corners[t + 2]];
        float area = (q[0] - p[0]) * (s[1] - p[1]) - (q[1] - p[1]) * (s[0] - p[0]);
        EXPECT_TRUE(area > 0);
        for (int y = (int)fminf(p[1], fminf(q[1], s[1])); y <= (int)fmaxf(p[1], fmaxf(q[1], s[1])); y++)
            for (int x = (int)fminf(p[0], fminf(q[0], s[0])); x <= (int)fmaxf(p[0], fmaxf(q[0], s[0])); x++) {
                float cx = (float)x + 0.5F, cy = (float)y + 0.5F;
                float u = ((q[0] - cx) * (s[1] - cy) - (q[1] - cy) * (s[0] - cx)) / area;
                float v = ((s[0] - cx) * (p[1] - cy) - (s[1] - cy) * (p[0] - cx)) / area;
                if (u < 0.01F || v < 0.01F || u + v > 0.99F)
                    continue;
                texels++;
                twice += taken[y * m->width + x]++ > 0;
            }
    }
    print_message("%ld texels, %ld of them twice\n", texels, twice);
    EXPECT_AT_LEAST((double)texels, 40000);
    EXPECT_INT(twice, 0);
    free(taken);
    texture_atlas_free(&a);
    rings_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_simplified_mesh_keeps_shape),
        cmocka_unit_test(test_mesh_stays_closed),
        cmocka_unit_test(test_every_texel_keeps_its_color),
        cmocka_unit_test(test_charts_do_not_overlap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
