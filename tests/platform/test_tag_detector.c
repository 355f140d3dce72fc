// The tag detector: numbers, corners and their order, duplicates, images without tags, invalid options.
#include "tests/support/test.h"

#include "tests/support/tag_picture.h"

#include <string.h>

enum { WIDTH = 320, HEIGHT = 240 };

static uint8_t rgb[WIDTH * HEIGHT * 3], gray[WIDTH * HEIGHT];

static int find(struct tag_picture *p, double decimate, struct tag_detection *out)
{
    struct tag_detector *f;
    int count;
    p->rgb = rgb;
    EXPECT_TRUE(tag_picture_draw(p));
    for (size_t i = 0; i < sizeof gray; i++)
        gray[i] = rgb[3 * i + 1];
    EXPECT_STATUS(tag_detector_open(&f, decimate), OK);
    EXPECT_STATUS(tag_detector_detect(f, &(struct gray_image){gray, WIDTH, HEIGHT}, out, 8, &count), OK);
    tag_detector_close(&f);
    EXPECT_TRUE(f == NULL);
    return count;
}

// Number, order of corners and the centre-of-pixel convention, upright and rotated by quarter turns.
static void test_corner_order(void **state)
{
    (void)state;
    for (int turn = 0; turn < 4; turn++) {
        struct place_tag tag = {.id = 17, .side_m = 0.2, .world_from_tag = POSE_IDENTITY};
        struct tag_picture p = {.lens = tag_picture_lens(WIDTH, HEIGHT, 262.5),
                                .tags = &tag,
                                .tag_count = 1,
                                .world_from_camera = tag_picture_view(1, 0.2, -0.1, turn * 1.5707963),
                                .noise = 1,
                                .seed = 1,
                                .linear = true};
        struct tag_detection seen[8];
        struct pixel truth[4], mean = {0, 0};
        EXPECT_INT(find(&p, 1, seen), 1);
        EXPECT_INT(seen[0].id, 17);
        tag_picture_corners(&p, 0, truth);
        for (int k = 0; k < 4; k++) {
            EXPECT_NEAR(seen[0].corner[k].x, truth[k].x, 0.6);
            EXPECT_NEAR(seen[0].corner[k].y, truth[k].y, 0.6);
            mean.x += (seen[0].corner[k].x - truth[k].x) / 4;
            mean.y += (seen[0].corner[k].y - truth[k].y) / 4;
        }
        EXPECT_NEAR(mean.x, 0, 0.12); // a shift of half a pixel would fail here
        EXPECT_NEAR(mean.y, 0, 0.12);
    }
}

static void test_duplicate_tags_are_both_reported(void **state)
{
    (void)state;
    struct place_tag tags[2] = {{.id = 4, .side_m = 0.15, .world_from_tag = {{0, 0, 0, 1}, {0.2, 0, 0}}},
                                {.id = 4, .side_m = 0.15, .world_from_tag = {{0, 0, 0, 1}, {-0.2, 0, 0}}}};
    struct tag_picture p = {.lens = tag_picture_lens(WIDTH, HEIGHT, 262.5),
                            .tags = tags,
                            .tag_count = 2,
                            .world_from_camera = tag_picture_view(1, 0, 0, 0)};
    struct tag_detection seen[8];
    EXPECT_INT(find(&p, 1, seen), 2);
    EXPECT_TRUE(seen[0].corner[0].x < seen[1].corner[0].x);
}

// Detectors share what they look numbers up in.
static void test_one_is_closed_another_goes_on(void **state)
{
    (void)state;
    struct place_tag tag = {.id = 17, .side_m = 0.2, .world_from_tag = POSE_IDENTITY};
    struct tag_picture p = {.lens = tag_picture_lens(WIDTH, HEIGHT, 262.5),
                            .tags = &tag,
                            .tag_count = 1,
                            .world_from_camera = tag_picture_view(1, 0, 0, 0)};
    struct tag_detector *first;
    struct tag_detection seen[8];
    int count;
    EXPECT_STATUS(tag_detector_open(&first, 1), OK);
    EXPECT_INT(find(&p, 1, seen), 1); // a second, opened and closed
    EXPECT_STATUS(tag_detector_detect(first, &(struct gray_image){gray, WIDTH, HEIGHT}, seen, 8, &count), OK);
    EXPECT_INT(count, 1);
    EXPECT_INT(seen[0].id, 17);
    tag_detector_close(&first);
}

static void test_blank_image(void **state)
{
    (void)state;
    struct tag_detector *f;
    struct tag_detection seen[8];
    int count = 7;
    memset(gray, 90, sizeof gray);
    EXPECT_STATUS(tag_detector_open(&f, 2), OK);
    EXPECT_STATUS(tag_detector_detect(f, &(struct gray_image){gray, WIDTH, HEIGHT}, seen, 8, &count), OK);
    EXPECT_INT(count, 0);
    EXPECT_STATUS(tag_detector_detect(f, &(struct gray_image){gray, 3, 2}, seen, 8, &count),
                  OK); // smaller than any tag
    EXPECT_INT(count, 0);
    tag_detector_close(&f);
    tag_detector_close(&f);
}

static void test_invalid_options(void **state)
{
    (void)state;
    static const double bad[] = {0, 0.5, 9, -1, NAN, INFINITY};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        struct tag_detector *f;
        EXPECT_STATUS(tag_detector_open(&f, bad[i]), ERR_INPUT);
        EXPECT_TRUE(f == NULL);
    }
    struct tag_pattern pattern;
    EXPECT_TRUE(!tag_pattern(-1, &pattern));
    EXPECT_TRUE(!tag_pattern(TAG_ID_COUNT, &pattern));
    EXPECT_TRUE(tag_pattern(TAG_ID_COUNT - 1, &pattern));
    for (int i = 0; i < TAG_CELLS; i++) { // the border is black
        EXPECT_INT(pattern.cell[0][i] + pattern.cell[i][0], 0);
        EXPECT_INT(pattern.cell[TAG_CELLS - 1][i] + pattern.cell[i][TAG_CELLS - 1], 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_corner_order),
        cmocka_unit_test(test_duplicate_tags_are_both_reported),
        cmocka_unit_test(test_one_is_closed_another_goes_on),
        cmocka_unit_test(test_blank_image),
        cmocka_unit_test(test_invalid_options),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
