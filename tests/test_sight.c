// What a frame's depth picture is sorted into: the strip beside the person that the sensor's lamp does not reach.
#include "tests/support/painted_person.h"
#include "tests/test.h"

#include "reenact/sight.h"

enum { NARROW_PX = 2, WIDE_PX = 40 };

// Takes the readings off `count` pixels to the right of whatever is the person's.
static void shade(struct painted *film, int count)
{
    for (int y = 0; y < H; y++)
        for (int x = W - 1; x > 0; x--)
            for (int k = 1; k <= count && film->mask[y * W + x] && x + k < W && !film->mask[y * W + x + k]; k++)
                film->depth[y * W + x + k] = 0;
}

// How many pixels beside the person have no reading, and how many of these are nearer than the wall.
static void count_beside(struct painted *film, int shade_px, int *empty, int *wrong)
{
    const struct skeleton joints = whole_body(0);
    struct one_frame frame = {joints, film->rgb, film->depth, film->mask};
    struct painted_take stage;
    struct source_rays *rays;
    struct sight sight;
    paint_person(film, &ideal, &joints, &whole_measures);
    const uint16_t wall = film->depth[0];
    shade(film, shade_px);
    painted_take_open(&stage, &ideal, &frame, 1, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(sight_open(&sight, stage.take, rays), OK);
    EXPECT_STATUS(sight_read(&sight, stage.take, 0), OK);
    *empty = *wrong = 0;
    for (int y = sight.top; y <= sight.bottom; y++)
        for (int x = sight.left; x < W; x++) {
            int i = y * W + x;
            *empty += !film->mask[i] && !sight.depth[i];
            *wrong += !film->mask[i] && sight.depth[i] && sight.depth[i] != wall;
        }
    sight_close(&sight);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

static void what_the_lamp_does_not_reach_is_room(void **state)
{
    (void)state;
    static struct painted film;
    int empty, wrong, left;
    count_beside(&film, NARROW_PX, &empty, &wrong);
    count_beside(&film, WIDE_PX, &left, &wrong);
    print_message("without a reading: of a narrow strip %d pixels, of a wide one %d\n", empty, left);
    EXPECT_AT_MOST(empty, 150); // between the legs there is no wall to be seen beyond the strip
    EXPECT_AT_LEAST(left, 1000); // no lamp throws such a shadow
    EXPECT_TRUE(wrong == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_the_lamp_does_not_reach_is_room)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
