// The triangles of a picture's depth, hit by rays between its pixels, by brute force: without holes, as far off as the
// ray caster says, never spanned between two surfaces, and few.
#include "tests/support/test.h"

#include "surround/picture/surround_picture.h"
#include "tests/support/box_room.h"

static const struct lens small = {.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 7.5, .cy = 7.5};

static float dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const float a[3], const float b[3], float out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

// The inverse distance at which a ray from the origin meets a triangle of points ray / inverse; negative: it does not.
// Corner weights w solve sum w_i ray_i = ray; then the inverse distance is sum w_i inverse_i.
static float meet(const struct surround_mesh_piece *p, const uint16_t *corner, const float ray[3])
{
    const float *v[3] = {p->vertices[corner[0]], p->vertices[corner[1]], p->vertices[corner[2]]};
    float n[3], sum = 0;
    cross(v[1], v[2], n);
    const float volume = dot(v[0], n);
    for (int i = 0; i < 3; i++) {
        cross(v[(i + 1) % 3], v[(i + 2) % 3], n);
        const float weight = dot(ray, n) / volume;
        if (!(weight > -1e-3f))
            return -1;
        sum += weight * v[i][3];
    }
    return sum;
}

struct hits {
    float nearest, farthest; // inverse distances
    int count;
};

static struct hits cast(const struct surround_mesh *m, const float ray[3])
{
    struct hits h = {0, 1e9f, 0};
    for (int i = 0; i < m->count; i++)
        for (int k = 0; k < m->pieces[i].index_count; k += 3) {
            const float inverse = meet(&m->pieces[i], m->pieces[i].indices + k, ray);
            if (inverse < 0)
                continue;
            h.count++;
            h.nearest = fmaxf(h.nearest, inverse);
            h.farthest = fminf(h.farthest, inverse);
        }
    return h;
}

static int triangle_count(const struct surround_mesh *m)
{
    int count = 0;
    for (int i = 0; i < m->count; i++)
        count += m->pieces[i].index_count / 3;
    return count;
}

// A ray between four pixels: their range of inverse distances, and its own.
static void between(const struct surround_picture *p, int u, int v, float ray[3], float range[2])
{
    range[0] = 1e9f, range[1] = -1;
    ray[0] = ray[1] = ray[2] = 0;
    for (int k = 0; k < 4; k++) {
        const int x = (u + (k & 1)) % p->width, y = v + (k >> 1);
        const float inverse = p->inverse[y * p->width + x];
        float one[3];
        surround_picture_ray(p, x, y, one);
        for (int i = 0; i < 3; i++)
            ray[i] += one[i] * (k == 0 ? 0.31f : k == 3 ? 0.19f : 0.25f); // on no triangle's side
        range[0] = fminf(range[0], inverse);
        range[1] = fmaxf(range[1], inverse);
    }
    const float length = sqrtf(dot(ray, ray));
    for (int i = 0; i < 3; i++)
        ray[i] /= length;
}

static void check(const struct surround_picture *p, const struct surround_mesh *m, float tolerance)
{
    const int columns = p->panorama ? p->width : p->width - 1;
    int holes = 0, off = 0, spanned = 0, cast_count = 0;
    for (int v = 0; v + 1 < p->height; v += 2)
        for (int u = v / 2 % 3; u < columns; u += 3) {
            float ray[3], range[2];
            between(p, u, v, ray, range);
            const struct hits h = cast(m, ray);
            const bool flat = p->joined[v * p->width + u] & JOINED_DIAGONAL;
            cast_count++;
            holes += h.count == 0;
            // A joined cell's own pixels differ by its slope; a mesh may be off by the tolerance beside that
            off += flat && h.count &&
                   !(h.nearest < range[1] * (1 + 2 * tolerance) && h.farthest > range[0] * (1 - 2 * tolerance));
            spanned += !flat && h.count && h.nearest < range[1] * 0.98f && h.nearest > range[0] * 1.02f;
        }
    print_message("%d triangles of %d cells; %d rays: %d holes, %d off, %d spanned\n", triangle_count(m),
                  columns * (p->height - 1), cast_count, holes, off, spanned);
    EXPECT_INT(holes, 0);
    EXPECT_INT(off, 0);
    EXPECT_AT_MOST(spanned, 0.002 * cast_count); // quarters at a silhouette overlap
}

static void fill(const struct box_world *w, struct surround_picture *p)
{
    const struct vec3 at = p->world_from_camera.translation;
    p->inverse = malloc((size_t)p->width * (size_t)p->height * sizeof *p->inverse);
    p->joined = malloc((size_t)p->width * (size_t)p->height);
    for (int v = 0; v < p->height; v++)
        for (int u = 0; u < p->width; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            const struct vec3 d = quat_rotate(p->world_from_camera.rotation, v3(ray[0], ray[1], ray[2]));
            const double from[3] = {at.x, at.y, at.z}, way[3] = {d.x, d.y, d.z};
            p->inverse[v * p->width + u] = (float)(1 / box_world_cast(w, from, way, NULL));
        }
    surround_picture_join(p);
}

static void check_picture(int width, int height, const struct lens *lens)
{
    struct box_room s;
    struct surround_picture p;
    struct surround_mesh mesh;
    box_room_open(&s, &small);
    assert_int_equal(surround_picture_make(&p, calloc((size_t)width * (size_t)height, 3), width, height, lens), OK);
    surround_picture_place(&p, room_camera(0.2, 0.4, 1.3));
    fill(&s.world, &p);
    const float tolerance = surround_mesh_tolerance(&p);
    assert_int_equal(surround_mesh_make(&mesh, &p, tolerance), OK);
    check(&p, &mesh, tolerance);
    EXPECT_AT_MOST(triangle_count(&mesh), 0.5 * width * height); // against 2
    surround_mesh_free(&mesh);
    surround_picture_free(&p);
    box_room_close(&s);
}

static void test_a_panorama(void **state)
{
    (void)state;
    check_picture(256, 128, NULL);
}

// Whose size is no multiple of the blocks'.
static void test_a_perspective_picture(void **state)
{
    (void)state;
    const struct lens lens = {.width = 150, .height = 101, .fx = 110, .fy = 110, .cx = 74.5, .cy = 50};
    check_picture(lens.width, lens.height, &lens);
}

// Depth that is noise has a piece for each pixel, nothing at all none; both are made.
static void test_noise_and_nothing(void **state)
{
    (void)state;
    const struct lens lens = {.width = 200, .height = 190, .fx = 400, .fy = 400, .cx = 99.5, .cy = 94.5};
    struct surround_picture p;
    struct surround_mesh mesh;
    assert_int_equal(surround_picture_make(&p, calloc(200 * 190, 3), 200, 190, &lens), OK);
    p.inverse = malloc(200 * 190 * sizeof *p.inverse);
    p.joined = malloc(200 * 190);
    for (int i = 0; i < 200 * 190; i++)
        p.inverse[i] = (float)(1 + i * 2654435761u % 1000) * 0.01f;
    surround_picture_join(&p);
    assert_int_equal(surround_mesh_make(&mesh, &p, 0.01f), OK);
    EXPECT_AT_LEAST(triangle_count(&mesh), 2 * 198 * 188);
    EXPECT_AT_LEAST(mesh.count, 2);
    surround_mesh_free(&mesh);
    for (int i = 0; i < 200 * 190; i++)
        p.inverse[i] = DEPTH_UNKNOWN;
    surround_picture_join(&p);
    assert_int_equal(surround_mesh_make(&mesh, &p, 0.01f), OK);
    EXPECT_INT(mesh.count, 0);
    surround_mesh_free(&mesh);
    surround_picture_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_panorama),
        cmocka_unit_test(test_a_perspective_picture),
        cmocka_unit_test(test_noise_and_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
