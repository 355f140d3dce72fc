// A natural feature lies where the picture has it, in whatever copy of the picture it was found: turned upside down,
// the picture has the same features at the same places.
#include "locate/landmark_matching.h"
#include "tests/support/random.h"
#include "tests/support/test.h"

#include <stdio.h>

enum { WIDTH = 637, HEIGHT = 478, LEVELS = 6, SQUARES = 400 }; // no multiple of any copy's scale

static uint8_t picture[WIDTH * HEIGHT], turned[WIDTH * HEIGHT];
static struct feature first[FEATURES_MAX], second[FEATURES_MAX];

// Squares of all sizes and shades upon each other, with corners in all copies.
static void draw(void)
{
    struct rng rng = {41};
    for (int i = 0; i < SQUARES; i++) {
        int side = (int)rng_between(&rng, 4, 60), left = (int)rng_between(&rng, 0, WIDTH - side),
            top = (int)rng_between(&rng, 0, HEIGHT - side), shade = (int)rng_between(&rng, 0, 255);
        for (int y = top; y < top + side; y++)
            for (int x = left; x < left + side; x++)
                picture[y * WIDTH + x] = (uint8_t)shade;
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        turned[i] = picture[WIDTH * HEIGHT - 1 - i];
}

static void test_features_survive_half_turn(void **state)
{
    (void)state;
    double sum_x[LEVELS] = {0}, sum_y[LEVELS] = {0}, sum_right[LEVELS] = {0};
    int count[LEVELS] = {0}, count_right[LEVELS] = {0}, found, again;
    draw();
    EXPECT_STATUS(features_detect(picture, WIDTH, HEIGHT, first, FEATURES_MAX, &found), OK);
    EXPECT_STATUS(features_detect(turned, WIDTH, HEIGHT, second, FEATURES_MAX, &again), OK);
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
            if (first[i].at.x > 0.75 * WIDTH) { // where a copy of another width would show most
                sum_right[level] += x;
                count_right[level]++;
            }
        }
    }
    for (int i = 0; i < LEVELS; i++) {
        printf("copy %d: %d of %d features again, aside by %.3f %.3f px, on the right by %.3f\n", i, count[i], found,
               sum_x[i] / count[i], sum_y[i] / count[i], sum_right[i] / count_right[i]);
        EXPECT_AT_LEAST(count_right[i], 5);
        EXPECT_NEAR(sum_x[i] / count[i], 0, 0.1);
        EXPECT_NEAR(sum_y[i] / count[i], 0, 0.1);
        EXPECT_NEAR(sum_right[i] / count_right[i], 0, 0.15);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_features_survive_half_turn)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
