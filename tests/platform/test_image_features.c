// Feature positions are unbiased at every pyramid level: an image rotated by 180 degrees has the same features at the
// same places.
#include "tests/support/test.h"

#include "locate/landmark_matching.h"
#include "tests/support/random.h"

#include <stdio.h>

enum { WIDTH = 637, HEIGHT = 478, LEVELS = 6, SQUARES = 400 }; // not a multiple of any level's scale

static uint8_t image[WIDTH * HEIGHT], rotated[WIDTH * HEIGHT];
static struct feature first[FEATURES_MAX], second[FEATURES_MAX];

// Overlapping squares of many sizes and shades, with corners at all levels.
static void draw(void)
{
    struct rng rng = {41};
    for (int i = 0; i < SQUARES; i++) {
        int side = (int)rng_between(&rng, 4, 60), left = (int)rng_between(&rng, 0, WIDTH - side),
            top = (int)rng_between(&rng, 0, HEIGHT - side), shade = (int)rng_between(&rng, 0, 255);
        for (int y = top; y < top + side; y++)
            for (int x = left; x < left + side; x++)
                image[y * WIDTH + x] = (uint8_t)shade;
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        rotated[i] = image[WIDTH * HEIGHT - 1 - i];
}

static void test_features_survive_half_rotation(void **state)
{
    (void)state;
    double sum_x[LEVELS] = {0}, sum_y[LEVELS] = {0}, sum_right[LEVELS] = {0};
    int count[LEVELS] = {0}, count_right[LEVELS] = {0}, found, again;
    draw();
    EXPECT_STATUS(features_detect(image, WIDTH, HEIGHT, first, FEATURES_MAX, &found), OK);
    EXPECT_STATUS(features_detect(rotated, WIDTH, HEIGHT, second, FEATURES_MAX, &again), OK);
    for (int i = 0; i < found; i++) {
        const int level = (int)(log(first[i].scale) / log(1.2) + 0.5);
        const double reach = 0.8 * first[i].scale + 0.7 * (first[i].scale - 1);
        for (int k = 0; k < again; k++) {
            double x = WIDTH - 1 - second[k].at.x - first[i].at.x, y = HEIGHT - 1 - second[k].at.y - first[i].at.y;
            if (second[k].scale != first[i].scale || fabs(x) > reach || fabs(y) > reach)
                continue;
            EXPECT_TRUE(level >= 0 && level < LEVELS);
            sum_x[level] += x;
            sum_y[level] += y;
            count[level]++;
            if (first[i].at.x > 0.75 * WIDTH) { // where a wrong width of the level would show most
                sum_right[level] += x;
                count_right[level]++;
            }
        }
    }
    for (int i = 0; i < LEVELS; i++) {
        printf("level %d: %d of %d features found again, mean offset %.3f %.3f px, on the right %.3f px\n", i, count[i],
               found, sum_x[i] / count[i], sum_y[i] / count[i], sum_right[i] / count_right[i]);
        EXPECT_AT_LEAST(count_right[i], 5);
        EXPECT_NEAR(sum_x[i] / count[i], 0, 0.01);
        EXPECT_NEAR(sum_y[i] / count[i], 0, 0.01);
        EXPECT_NEAR(sum_right[i] / count_right[i], 0, 0.01);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_features_survive_half_rotation)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
