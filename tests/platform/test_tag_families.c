// Tags of each of AprilTag's other families are told by name; in pictures of a furnished room with tags 36h11 there are
// none.
#include "tests/support/test.h"

#include "locate/tag_corners.h"
#include "platform/vision/tag_detector.h"
#include "tests/support/other_tags.h"
#include "tests/world/world.h"

#include <string.h>

enum { WIDTH = 320, HEIGHT = 240, MOST = 16 };

static struct tag_families *families;

static void test_each_family_is_told(void **state)
{
    (void)state;
    static uint8_t gray[WIDTH * HEIGHT];
    for (int family = 0; family < TAG_FAMILIES; family++) {
        struct tag_of_family seen[MOST];
        int count;
        memset(gray, 170, sizeof gray);
        other_tag_draw(family, 3, gray, WIDTH, HEIGHT, 20, 30, 9);
        other_tag_draw(family, 7, gray, WIDTH, HEIGHT, 180, 90, 9);
        EXPECT_STATUS(tag_families_look(families, &(struct gray_image){gray, WIDTH, HEIGHT}, seen, MOST, &count), OK);
        if (count != 2)
            print_error("%s: %d tags\n", tag_family_name(family), count);
        EXPECT_INT(count, 2);
        EXPECT_INT(seen[0].family, family);
        EXPECT_INT(seen[1].family, family);
        EXPECT_INT(seen[0].id + seen[1].id, 3 + 7);
    }
}

static void test_a_room_shows_none(void **state)
{
    (void)state;
    enum { PICTURES = 12 };
    struct world *world;
    struct world_options options = world_default_options();
    options.motion = "still";
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    const struct lens lens = world_calibration(1).color;
    uint8_t *rgb = malloc(4 * lens_pixels(&lens)), *gray = rgb + 3 * lens_pixels(&lens);
    assert_non_null(rgb);
    for (int i = 0; i < PICTURES; i++) {
        struct tag_of_family seen[MOST];
        int count;
        const struct world_shot shot = {lens, world_sweep_pose(world, WORLD_SWEEP_S * i / PICTURES), 0, false};
        EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = rgb}), OK);
        world_color_noise(rgb, lens.width, lens.height, 40 + (uint64_t)i);
        gray_from_rgb(rgb, lens_pixels(&lens), gray);
        EXPECT_STATUS(
            tag_families_look(families, &(struct gray_image){gray, lens.width, lens.height}, seen, MOST, &count), OK);
        for (int k = 0; k < count; k++)
            print_error("picture %d: %s %d\n", i, tag_family_name(seen[k].family), (int)seen[k].id);
        EXPECT_INT(count, 0);
    }
    free(rgb);
    world_close(&world);
}

static int open_families(void **state)
{
    (void)state;
    return tag_families_open(&families) != OK;
}

static int close_families(void **state)
{
    (void)state;
    tag_families_close(&families);
    return families != NULL;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_family_is_told),
        cmocka_unit_test(test_a_room_shows_none),
    };
    return cmocka_run_group_tests(tests, open_families, close_families);
}
