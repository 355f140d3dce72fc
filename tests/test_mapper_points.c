#include "capture/mapper.h"
#include "locate/locate.h"
#include "tests/support/sweep.h"
#include "tests/test.h"

#include <stdio.h>
#include <stdlib.h>

// A place of natural points alone: no truth to compare its points with, but the tablet's
// way through it can be laid over the true one.
static void without_tags_points_and_depth_make_the_place(void **state)
{
    (void)state;
    enum { PICTURES = 8 };
    struct sweep r;
    struct mapper *m;
    struct place place;
    struct mapper_report report;
    struct vec3 ours[PICTURES], truth[PICTURES];
    int found = 0;
    sweep_open(&r);
    EXPECT_STATUS(mapper_open(&m, &r.calibration, NULL, 0, NULL), OK);
    EXPECT_STATUS(sweep_film(&r, m, 40, true), OK);
    EXPECT_STATUS(mapper_finish(m, &place, &report), OK);
    mapper_close(&m);
    EXPECT_INT(place.tag_count, 0);
    EXPECT_TRUE(report.floor_from_depth);
    EXPECT_INT(report.frames_placed, report.frames);
    EXPECT_NEAR(report.lost_to_s - report.lost_from_s, 0, 0);
    struct calibration viewer = world_viewer_calibration(1);
    uint8_t *color = malloc((size_t)viewer.color.width * (size_t)viewer.color.height * 3);
    struct locator *l;
    EXPECT_TRUE(color != NULL);
    EXPECT_STATUS(locator_open(&l, &place, &viewer.color, NULL), OK);
    for (int i = 0; i < PICTURES; i++) {
        double t = world_seconds(r.world) * i / PICTURES;
        struct world_shot shot = {viewer.color, world_viewer_pose(r.world, t), t, false};
        struct world_picture picture = {.color = color};
        struct location at;
        EXPECT_STATUS(world_render(r.world, &shot, &picture), OK);
        world_color_noise(color, shot.lens.width, shot.lens.height, 78);
        enum status status = locator_find(l, color, NULL, &at);
        EXPECT_TRUE(status >= 0);
        if (status != OK)
            continue;
        ours[found] = at.world_from_camera.translation;
        truth[found++] = shot.world_from_camera.translation;
    }
    EXPECT_AT_LEAST(found, PICTURES - 1);
    struct pose world_from_place = sweep_align(ours, truth, found);
    double worst_m = 0;
    for (int i = 0; i < found; i++)
        worst_m = fmax(worst_m, v3_distance(pose_apply(world_from_place, ours[i]), truth[i]));
    struct vec3 up = quat_rotate(world_from_place.rotation, v3(0, 0, 1));
    printf("without tags: %d of %d pictures placed, %d points; tablet: %d of %d found, worst %.1f mm; up is %.2f degrees "
           "off, the floor %.1f mm\n",
           (int)report.frames_placed, (int)report.frames, (int)place.point_count, found, (int)PICTURES, worst_m * 1e3,
           acos(fmin(1, up.z)) * 57.2958, world_from_place.translation.z * 1e3);
    EXPECT_AT_MOST(worst_m, 0.02);
    EXPECT_AT_MOST(acos(fmin(1, up.z)) * 57.2958, 0.5);
    EXPECT_NEAR(world_from_place.translation.z, 0, 0.02);
    locator_close(&l);
    free(color);
    place_free(&place);
    world_close(&r.world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_tags_points_and_depth_make_the_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
