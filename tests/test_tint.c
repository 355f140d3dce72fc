#include "tests/test.h"

#include "reenact/tint.h"

#include <stdlib.h>
#include <string.h>

enum { ROWS = 300, ACROSS = 20, SIZE = 100 };

// A flat board 2 m before the camera, grey rising to the right and blue downwards, is laid 6 mm too far to the right
// and 4 mm too low: each row must say by how much its grey is to change, and that going back does it.
static void rows_say_how_far_the_colours_are_off(void **state)
{
    (void)state;
    static struct vec3 points[ACROSS * ACROSS], normals[ACROSS * ACROSS];
    static struct skin skins[ACROSS * ACROSS];
    static float colors[ACROSS * ACROSS][3];
    static uint8_t filled[ACROSS * ACROSS], rgb[3 * SIZE * SIZE], part[SIZE * SIZE], edge[SIZE * SIZE];
    static uint16_t depth[SIZE * SIZE];
    const double z = 2, f = 400, off_x = 0.006, off_y = 0.004;
    struct calibration calibration = {.color = {.width = SIZE, .height = SIZE, .fx = f, .fy = f, .cx = 50, .cy = 50},
                                      .registered = true};
    calibration.depth = calibration.color;
    for (int i = 0; i < SIZE * SIZE; i++) {
        rgb[3 * i] = rgb[3 * i + 1] = (uint8_t)(2 * (i % SIZE) + 20);
        rgb[3 * i + 2] = (uint8_t)(2 * (i / SIZE) + 20);
        depth[i] = (uint16_t)(1000 * z);
        part[i] = PART_UPPER_TORSO;
        edge[i] = 10;
    }
    for (int i = 0; i < ACROSS * ACROSS; i++) {
        points[i] = v3((i % ACROSS - 10) * 0.01, (i / ACROSS - 10) * 0.01, z);
        normals[i] = v3(0, 0, -1);
        skins[i] = (struct skin){{PART_UPPER_TORSO, 0, 0}, {1, 0, 0}};
        double across = (2 * (50 + f * (points[i].x - off_x) / z) + 20) / 255,
               down = (2 * (50 + f * (points[i].y - off_y) / z) + 20) / 255;
        colors[i][0] = colors[i][1] = (float)(across * across);
        colors[i][2] = (float)(down * down);
    }
    const struct coat coat = {.color = colors, .filled = filled, .light = {{1}}};
    const struct surface surface = {points, normals, NULL, ACROSS * ACROSS, 0};
    const struct sight sight = {.width = SIZE, .height = SIZE, .depth = depth, .part = part, .edge = edge};
    const struct tint tint = {&surface, skins, &coat, &calibration, &sight, rgb, POSE_IDENTITY};
    struct posture posture;
    for (int p = 0; p < PART_COUNT; p++)
        posture.part[p] = POSE_IDENTITY;
    static struct tint_row rows[ROWS];
    int count = tint_rows(&tint, &posture, 1, rows, ROWS);
    EXPECT_AT_LEAST((double)count, ROWS / 2);
    for (int i = 0; i < count; i++) {
        assert_int_equal(rows[i].part, PART_UPPER_TORSO);
        EXPECT_NEAR(v3_dot(rows[i].along, v3(-off_x, -off_y, 0)), rows[i].value, 1e-3);
        EXPECT_AT_LEAST(fabs(rows[i].value), 5e-3);
    }

    memset(edge, 1, sizeof edge); // at edges colours are mixed, and a reading farther off is another surface's
    assert_int_equal(tint_rows(&tint, &posture, 1, rows, ROWS), 0);
    memset(edge, 10, sizeof edge);
    for (int i = 0; i < SIZE * SIZE; i++)
        depth[i] += 50;
    assert_int_equal(tint_rows(&tint, &posture, 1, rows, ROWS), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows_say_how_far_the_colours_are_off)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
