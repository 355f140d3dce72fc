// The surface of an occluder grid: where it lies, and that a surface with too many vertices is said to be one.
#include "tests/support/test.h"

#include "reenact/scene/occluder_mesh.h"

#include <stdlib.h>

static struct occluder_grid grid_open(int size)
{
    const size_t count = (size_t)size * (size_t)size * (size_t)size;
    struct occluder_grid g = {.corner = {1, 2, 3}, .step = 0.1, .truncation = 0.25, .size = {size, size, size}};
    g.sum = malloc(sizeof *g.sum * count);
    g.weight = malloc(sizeof *g.weight * count);
    assert_true(g.sum && g.weight);
    for (size_t i = 0; i < count; i++)
        g.sum[i] = g.weight[i] = 1;
    return g;
}

static void grid_close(struct occluder_grid *g)
{
    free(g->sum);
    free(g->weight);
}

static void test_plane_is_extracted_at_its_height(void **state)
{
    (void)state;
    enum { SIZE = 12 };
    struct occluder_grid g = grid_open(SIZE);
    struct occluder_mesh mesh;
    bool too_large = true;
    for (int z = 0; z < SIZE; z++)
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++)
                g.sum[occluder_grid_index(&g, x, y, z)] = (float)(z * g.step - 0.53);
    EXPECT_STATUS(occluder_surface_nets(&g, &mesh, &too_large), OK);
    EXPECT_TRUE(!too_large);
    EXPECT_INT(mesh.point_count, (SIZE - 1) * (SIZE - 1));
    EXPECT_INT(mesh.corner_count, 6 * (SIZE - 2) * (SIZE - 2));
    for (int i = 0; i < mesh.point_count; i++)
        EXPECT_NEAR((double)mesh.points[i][2], 3.53, 1e-5);
    occluder_mesh_free(&mesh);
    grid_close(&g);
}

static void test_empty_grid_has_no_surface(void **state)
{
    (void)state;
    struct occluder_grid g = grid_open(5);
    struct occluder_mesh mesh;
    bool too_large = true;
    EXPECT_STATUS(occluder_surface_nets(&g, &mesh, &too_large), NOTHING);
    EXPECT_TRUE(!too_large && !mesh.points && !mesh.corners);
    grid_close(&g);
}

// A checkerboard of single voxels has a vertex in every cube.
static void test_too_many_vertices_are_reported(void **state)
{
    (void)state;
    enum { SIZE = 45 };
    struct occluder_grid g = grid_open(SIZE);
    struct occluder_mesh mesh;
    bool too_large = false;
    EXPECT_AT_LEAST((SIZE - 1) * (SIZE - 1) * (SIZE - 1), OCCLUDER_MAX_POINTS + 1);
    for (int z = 0; z < SIZE; z++)
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++)
                if ((x + y + z) % 2)
                    g.sum[occluder_grid_index(&g, x, y, z)] = -1;
    EXPECT_STATUS(occluder_surface_nets(&g, &mesh, &too_large), OK);
    EXPECT_TRUE(too_large);
    EXPECT_TRUE(!mesh.points && !mesh.corners && !mesh.point_count);
    grid_close(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plane_is_extracted_at_its_height),
        cmocka_unit_test(test_empty_grid_has_no_surface),
        cmocka_unit_test(test_too_many_vertices_are_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
