// A place of two views, one of which holds a cut image: it costs itself alone.
#include "tests/support/test.h"

#include "capture/export.h"
#include "platform/files/jpeg.h"
#include "surround/filmed/filmed_room.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 64, HEIGHT = 48, PIXELS = WIDTH * HEIGHT, DEPTH_MM = 1500 };

static struct place_view view_at(double x_m, bool cut)
{
    uint8_t rgb[3 * PIXELS];
    size_t count;
    struct place_view view = {.world_from_camera = {{0, 0, 0, 1}, {x_m, 0, 1}}};
    for (int i = 0; i < PIXELS; i++) {
        rgb[3 * i] = (uint8_t)(40 + i % WIDTH);
        rgb[3 * i + 1] = (uint8_t)(200 - i / WIDTH);
        rgb[3 * i + 2] = 90;
    }
    EXPECT_STATUS(jpeg_encode(rgb, WIDTH, HEIGHT, 90, &view.jpeg, &count), OK);
    view.jpeg_bytes = cut ? count / 3 : count;
    view.depth = malloc(PIXELS * sizeof *view.depth);
    assert_non_null(view.depth);
    for (int i = 0; i < PIXELS; i++)
        view.depth[i] = DEPTH_MM;
    return view;
}

static struct place two_views(bool cut)
{
    const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 55, .fy = 55, .cx = 31.5, .cy = 23.5};
    struct place place = {.view_count = 2, .views = calloc(2, sizeof *place.views)};
    assert_non_null(place.views);
    place.calibration =
        (struct calibration){.color = lens, .depth = lens, .registered = true, .color_from_depth = POSE_IDENTITY};
    for (int i = 0; i < 2; i++)
        place.views[i] = view_at(0.3 * i, cut && i == 0);
    return place;
}

static int pictures_of(struct place *place)
{
    struct surroundings room;
    EXPECT_STATUS(filmed_room_open(&room, place, &place->calibration.color, NULL), OK);
    const int taken = room.taken;
    surroundings_close(&room);
    return taken;
}

// Its points, and how many of them have no colour.
static int points_of(const struct place *place, int *gray)
{
    char *text;
    size_t count;
    FILE *out = open_memstream(&text, &count);
    EXPECT_STATUS(export_place_ply(place, out), OK);
    assert_int_equal(fclose(out), 0);
    const char *at = strstr(text, "end_header\n") + strlen("end_header\n");
    const int points = atoi(strstr(text, "element vertex ") + strlen("element vertex "));
    *gray = 0;
    for (int i = 0; i < points; i++)
        *gray += !memcmp(at + 15 * i + 12, "\xa0\xa0\xa0", 3);
    free(text);
    return points;
}

static void test_damaged_view_costs_itself_alone(void **state)
{
    (void)state;
    struct place whole = two_views(false), cut = two_views(true);
    int gray;
    EXPECT_INT(pictures_of(&whole), 2);
    EXPECT_INT(pictures_of(&cut), 1);
    const int points = points_of(&whole, &gray);
    EXPECT_INT(gray, 0);
    EXPECT_INT(points_of(&cut, &gray), points);
    EXPECT_INT(gray, points / 2);
    place_free(&whole);
    place_free(&cut);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_damaged_view_costs_itself_alone)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
