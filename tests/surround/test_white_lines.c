// A detector of white lines finds the same lines on drawn and on true pictures of a road (Okura 2013's use of
// free-viewpoint images: they stand in for real ones where vision algorithms are judged).
#include "tests/support/test.h"

#include "tests/support/road_scene.h"

#include <stdio.h>

enum { VIEWS = 4, SHRINK = 2 };

static double line_truth(struct pose view, int side)
{
    // 6 m ahead along the view's heading, to the left across it
    struct vec3 along = quat_rotate(view.rotation, v3(0, 0, 1));
    along = v3_unit(v3(along.x, along.y, 0));
    const double line = side ? -ROAD_LINE_Y : ROAD_LINE_Y;
    return (line - view.translation.y - 6 * along.y) / along.x;
}

static void test_lines_on_drawn_pictures(void **state)
{
    (void)state;
    struct road_scene scene;
    struct surround_view view;
    const struct lens lens = road_view_lens(SHRINK);
    const struct view_options options = view_default_options();
    const size_t pixels = (size_t)lens.width * (size_t)lens.height;
    uint8_t *truth = malloc(pixels * 3);
    float *depth = malloc(pixels * sizeof *depth);
    assert_int_equal(road_scene_make(&scene, 5), OK);
    assert_int_equal(surround_view_open(&view, &lens), OK);
    for (int i = 0; i < VIEWS; i++) {
        const struct surround_picture *order[ROAD_PANORAMAS];
        const struct pose at = road_view(i);
        double drawn[2], real[2];
        for (int k = 0; k < ROAD_PANORAMAS; k++)
            order[k] = &scene.pictures[k];
        assert_int_equal(surround_view_rank(at, order, ROAD_PANORAMAS), OK);
        assert_int_equal(surround_view_draw(&view, at, order, ROAD_PANORAMAS, &options), OK);
        road_view_truth(&scene, &lens, at, truth, depth);
        road_find_lines(truth, &lens, at, real);
        road_find_lines(view.rgb, &lens, at, drawn);
        for (int side = 0; side < 2; side++) {
            print_message("view %d, %s line: true picture %.3f, drawn %.3f m\n", i, side ? "right" : "left", real[side],
                          drawn[side]);
            EXPECT_NEAR(real[side], line_truth(at, side), 0.03);
            EXPECT_NEAR(drawn[side], real[side], 0.03);
        }
    }
    surround_view_close(&view);
    road_scene_free(&scene);
    free(truth);
    free(depth);
}

// No line, no answer.
static void test_a_plain_road_has_no_lines(void **state)
{
    (void)state;
    const struct lens lens = road_view_lens(SHRINK);
    const size_t bytes = (size_t)lens.width * (size_t)lens.height * 3;
    uint8_t *grey = malloc(bytes);
    double lines[2];
    memset(grey, 90, bytes);
    road_find_lines(grey, &lens, road_view(0), lines);
    EXPECT_TRUE(isnan(lines[0]));
    EXPECT_TRUE(isnan(lines[1]));
    free(grey);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_on_drawn_pictures),
        cmocka_unit_test(test_a_plain_road_has_no_lines),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
