// Adding a second sweep to a place: the first one shows one half of a furnished room, the
// second one the other half and a little of the first.
#include "tests/support/test.h"

#include "capture/mapping/mapper.h"
#include "locate/locator.h"
#include "recording/recording.h"
#include "tests/support/align.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

// Of the images of one turn round the room: the range of each sweep.
enum { IMAGES = 24, FIRST_END = 13, SECOND_START = 9, SECOND_END = 21, MOST_TAGS = 32 };
enum { WIDTH = 640, HEIGHT = 480, PIXELS = WIDTH * HEIGHT };

static struct sweep_room {
    struct world *world;
    struct calibration calibration;
    struct mapper_tag tags[MOST_TAGS];
    int32_t tag_count;
    uint8_t color[IMAGES][PIXELS * 3];
    uint16_t depth[IMAGES][PIXELS];
    struct place first; // the map of the first sweep
} room;

static int64_t image_time_ns(int i) { return (int64_t)(1e9 * WORLD_SWEEP_S * i / IMAGES); }

static enum status film(struct mapper *m, int from, int to)
{
    enum status status = OK;
    for (int i = from; i < to && status == OK; i++) {
        struct frame frame = {.time_ns = image_time_ns(i), .color = room.color[i], .depth = room.depth[i]};
        status = mapper_add(m, &frame);
    }
    return status;
}

// Maps images from..to, all tags listed unless tag_count is 0.
static enum status map(const struct place *before, int32_t tag_count, int from, int to, struct place *out,
                       struct mapper_report *report)
{
    struct mapper *m;
    struct mapper_options o = mapper_default_options();
    o.prior = before;
    enum status status = mapper_open(&m, &room.calibration, room.tags, tag_count, &o);
    if (status == OK)
        status = film(m, from, to);
    if (status == OK)
        status = mapper_finish(m, out, report);
    mapper_close(&m);
    return status;
}

static int enter(void **state)
{
    (void)state;
    struct world_options o = world_default_options();
    struct mapper_report report;
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&room.world, &o), OK);
    room.calibration = world_calibration(1);
    EXPECT_INT(room.calibration.color.width * room.calibration.color.height, PIXELS);
    const struct place_tag *tags = world_tags(room.world, &room.tag_count);
    EXPECT_AT_MOST(room.tag_count, MOST_TAGS);
    for (int32_t i = 0; i < room.tag_count; i++)
        room.tags[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    for (int i = 0; i < IMAGES; i++) {
        struct world_shot shot = {room.calibration.color, world_sweep_pose(room.world, (double)image_time_ns(i) * 1e-9),
                                  0, false};
        struct world_image image = {.color = room.color[i], .depth = room.depth[i]};
        EXPECT_STATUS(world_render(room.world, &shot, &image), OK);
        world_color_noise(room.color[i], WIDTH, HEIGHT, 1000 + (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(&shot.lens, room.depth[i], 50 + (uint64_t)i, room.depth[i]), OK);
    }
    EXPECT_STATUS(map(NULL, room.tag_count, 0, FIRST_END, &room.first, &report), OK);
    return 0;
}

static int leave(void **state)
{
    (void)state;
    place_free(&room.first);
    world_close(&room.world);
    return 0;
}

static const struct place_tag *tag_of(const struct place_tag *tags, int32_t count, int32_t id)
{
    for (int32_t i = 0; i < count; i++)
        if (tags[i].id == id)
            return &tags[i];
    return NULL;
}

// The motion from the place's axes to the world's that fits its first tag_count tags best.
static struct pose world_from(const struct place *place, int32_t tag_count)
{
    struct vec3 ours[4 * MOST_TAGS], truth[4 * MOST_TAGS];
    int32_t count;
    const struct place_tag *tags = world_tags(room.world, &count);
    for (int32_t i = 0; i < tag_count; i++) {
        place_tag_corners(&place->tags[i], &ours[4 * i]);
        place_tag_corners(tag_of(tags, count, place->tags[i].id), &truth[4 * i]);
    }
    return align_points(ours, truth, 4 * tag_count);
}

// rms of the corners of tags from..to of the place against the truth.
static double corner_error(const struct place *place, int32_t from, int32_t to, struct pose world_from_place)
{
    double sum = 0;
    int32_t count;
    const struct place_tag *tags = world_tags(room.world, &count);
    for (int32_t i = from; i < to; i++) {
        struct vec3 ours[4], truth[4];
        place_tag_corners(&place->tags[i], ours);
        place_tag_corners(tag_of(tags, count, place->tags[i].id), truth);
        for (int k = 0; k < 4; k++) {
            double d = v3_distance(pose_apply(world_from_place, ours[k]), truth[k]);
            sum += d * d;
        }
    }
    return to > from ? sqrt(sum / (4 * (to - from))) : 0;
}

// In how many of the images from..to the sensor's own camera is localised; the worst error.
static int find_images(const struct place *place, int from, int to, struct pose world_from_place, double *worst_m)
{
    struct locator *l;
    int found = 0;
    *worst_m = 0;
    EXPECT_STATUS(locator_open(&l, place, &room.calibration.color, NULL), OK);
    for (int i = from; i < to; i++) {
        struct location at;
        if (locator_localize(l, room.color[i], NULL, &at) != OK)
            continue;
        struct pose truth = world_sweep_pose(room.world, (double)image_time_ns(i) * 1e-9);
        struct pose ours = pose_multiply(world_from_place, at.world_from_camera);
        *worst_m = fmax(*worst_m, v3_distance(ours.translation, truth.translation));
        found++;
    }
    locator_close(&l);
    return found;
}

static void expect_kept(const struct place *before, const struct place *after)
{
    EXPECT_AT_LEAST(after->tag_count, before->tag_count);
    for (int32_t i = 0; i < before->tag_count; i++) {
        EXPECT_INT(after->tags[i].id, before->tags[i].id);
        EXPECT_NEAR(after->tags[i].side_m, before->tags[i].side_m, 0);
        EXPECT_TRUE(!memcmp(&after->tags[i].world_from_tag, &before->tags[i].world_from_tag, sizeof(struct pose)));
        EXPECT_AT_LEAST(after->tags[i].observations, before->tags[i].observations);
    }
    EXPECT_AT_LEAST(after->point_count, before->point_count);
    EXPECT_TRUE(!memcmp(after->points, before->points, (size_t)before->point_count * sizeof *before->points));
    EXPECT_AT_LEAST(after->view_count, before->view_count);
    for (int32_t i = 0; i < before->view_count; i++)
        EXPECT_TRUE(
            !memcmp(&after->views[i].world_from_camera, &before->views[i].world_from_camera, sizeof(struct pose)));
}

static void test_other_half_is_added(void **state)
{
    (void)state;
    const struct place *first = &room.first;
    struct place both, whole;
    struct mapper_report report, of_whole;
    EXPECT_STATUS(map(first, room.tag_count, SECOND_START, SECOND_END, &both, &report), OK);
    EXPECT_STATUS(map(NULL, room.tag_count, 0, SECOND_END, &whole, &of_whole), OK);
    expect_kept(first, &both);
    struct pose world_from_place = world_from(&both, first->tag_count);
    double old_m = corner_error(&both, 0, first->tag_count, world_from_place);
    double new_m = corner_error(&both, first->tag_count, both.tag_count, world_from_place);
    double whole_m = corner_error(&whole, 0, whole.tag_count, world_from(&whole, whole.tag_count));
    printf("first sweep: %d tags within %.2f mm, %d points, %.3f px, %.1f mm\n", (int)first->tag_count, old_m * 1e3,
           (int)first->point_count, first->rms_px, first->rms_m * 1e3);
    printf("second: %d of %d images placed, %d new tags within %.2f mm, %d points in all, %d of %d views, %.3f px, "
           "%.1f mm\n",
           (int)report.frames_placed, (int)report.frames, (int)(both.tag_count - first->tag_count), new_m * 1e3,
           (int)both.point_count, (int)first->view_count, (int)both.view_count, both.rms_px, both.rms_m * 1e3);
    printf("one sweep of all: %d tags within %.2f mm, %d points, %.3f px, %.1f mm\n", (int)whole.tag_count,
           whole_m * 1e3, (int)whole.point_count, whole.rms_px, whole.rms_m * 1e3);
    EXPECT_AT_LEAST(report.frames_placed, SECOND_END - SECOND_START - 2);
    EXPECT_AT_LEAST(both.tag_count, first->tag_count + 2);
    EXPECT_INT(both.tag_count, whole.tag_count);
    EXPECT_INT(report.tags_moved, 0);
    EXPECT_AT_MOST(new_m, 0.003);
    EXPECT_AT_LEAST(both.point_count, first->point_count + 500);
    EXPECT_AT_LEAST(both.view_count, first->view_count + 5);
    EXPECT_AT_MOST(fabs(both.rms_px - whole.rms_px), 0.01);
    EXPECT_AT_MOST(fabs(both.rms_m - whole.rms_m), 0.002);
    double before_m, after_m;
    int before = find_images(first, FIRST_END, SECOND_END, world_from_place, &before_m);
    int after = find_images(&both, FIRST_END, SECOND_END, world_from_place, &after_m);
    printf("in the other half found in %d of %d images, then in %d, within %.1f mm\n", before, SECOND_END - FIRST_END,
           after, after_m * 1e3);
    EXPECT_AT_LEAST(after, before + 1);
    EXPECT_AT_LEAST(after, SECOND_END - FIRST_END - 1);
    EXPECT_AT_MOST(after_m, 0.006);
    place_free(&both);
    place_free(&whole);
}

// No list of tags: those of the place are known, unlisted ones are only landmarks.
static void test_known_tags_need_not_be_listed(void **state)
{
    (void)state;
    struct place both;
    struct mapper_report report;
    EXPECT_STATUS(map(&room.first, 0, SECOND_START, SECOND_END, &both, &report), OK);
    expect_kept(&room.first, &both);
    printf("no tag listed: %d of %d images placed, %d points more\n", (int)report.frames_placed, (int)report.frames,
           (int)(both.point_count - room.first.point_count));
    EXPECT_INT(both.tag_count, room.first.tag_count);
    EXPECT_AT_LEAST(both.point_count, room.first.point_count + 500);
    EXPECT_AT_LEAST(report.frames_placed, SECOND_END - SECOND_START - 2);
    place_free(&both);
}

static void test_place_without_tags_grows_by_landmarks(void **state)
{
    (void)state;
    struct place first, both;
    struct mapper_report report;
    EXPECT_STATUS(map(NULL, 0, 0, FIRST_END, &first, &report), OK);
    EXPECT_STATUS(map(&first, 0, SECOND_START, SECOND_END, &both, &report), OK);
    expect_kept(&first, &both);
    // The axes of such a place: origin below the first image, x to its right.
    struct pose first_pose = world_sweep_pose(room.world, 0);
    struct vec3 x = quat_rotate(first_pose.rotation, v3(1, 0, 0));
    struct pose world_from_place = {quat_from_rotation_vector(v3(0, 0, atan2(x.y, x.x))), first_pose.translation};
    world_from_place.translation.z = 0;
    double worst_m;
    int found = find_images(&both, FIRST_END, SECOND_END, world_from_place, &worst_m);
    printf("without tags: %d of %d images placed, found in %d of %d, within %.1f mm\n", (int)report.frames_placed,
           (int)report.frames, found, SECOND_END - FIRST_END, worst_m * 1e3);
    EXPECT_AT_LEAST(report.frames_placed, SECOND_END - SECOND_START - 2);
    EXPECT_AT_LEAST(found, SECOND_END - FIRST_END - 1);
    EXPECT_AT_MOST(worst_m, 0.02);
    place_free(&first);
    place_free(&both);
}

// A sweep that shows nothing of the place, and a tag list that contradicts it, are refused with a reason.
static void test_unrelated_sweep_is_refused(void **state)
{
    (void)state;
    struct place known = room.first, out;
    struct mapper_report report;
    struct place_tag unrelated_tag = {.id = 580, .side_m = 0.2, .world_from_tag = POSE_IDENTITY};
    known.tags = &unrelated_tag;
    known.tag_count = 1;
    known.point_count = 0;
    EXPECT_STATUS(map(&known, room.tag_count, 0, 6, &out, &report), ERR_INPUT);
    EXPECT_SAYS("nothing that is in the place");
    EXPECT_TRUE(!out.tags && !out.points && !out.views);
    struct mapper_tag other = {room.first.tags[0].id, room.first.tags[0].side_m + 0.01};
    struct mapper_options o = mapper_default_options();
    struct mapper *m;
    o.prior = &room.first;
    EXPECT_STATUS(mapper_open(&m, &room.calibration, &other, 1, &o), ERR_INPUT);
    EXPECT_TRUE(m == NULL);
    EXPECT_SAYS("list");
}

// As no sweep leaves it, but a file from outside may.
static void test_impossible_tags_are_refused(void **state)
{
    (void)state;
    struct place_tag twice[] = {
        {.id = 3, .side_m = 0.2, .world_from_tag = POSE_IDENTITY},
        {.id = 3, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {1, 0, 0}}},
        {.id = 5, .side_m = 0.2, .world_from_tag = {{0, 0, 0, 1}, {2, 0, 0}}},
    };
    struct place known = room.first;
    struct mapper_options o = mapper_default_options();
    struct mapper *m;
    known.tags = twice;
    known.tag_count = 3;
    o.prior = &known;
    EXPECT_STATUS(mapper_open(&m, &room.calibration, NULL, 0, &o), ERR_INPUT);
    EXPECT_SAYS("tag 3 twice");
    twice[1].id = 587;
    EXPECT_STATUS(mapper_open(&m, &room.calibration, NULL, 0, &o), ERR_INPUT);
    EXPECT_SAYS("tag36h11");
    EXPECT_TRUE(m == NULL);
}

// A tag that was moved after the first sweep is reported and estimated again; nothing else changes.
static void test_moved_tag_is_detected(void **state)
{
    (void)state;
    struct place known = room.first, both;
    struct place_tag tags[MOST_TAGS];
    struct mapper_report report;
    memcpy(tags, known.tags, (size_t)known.tag_count * sizeof *tags);
    known.tags = tags;
    int32_t moved = -1;
    for (int32_t i = 0; i < known.tag_count; i++) // one that the second sweep sees, too
        if (tags[i].observations && (moved < 0 || tags[i].observations > tags[moved].observations))
            moved = i;
    tags[moved].world_from_tag.translation.z += 0.3;
    EXPECT_STATUS(map(&known, room.tag_count, 0, FIRST_END, &both, &report), OK);
    double error_m = corner_error(&both, moved, moved + 1, world_from(&room.first, room.first.tag_count));
    printf("tag %d moved by 300 mm: %d reported, the first %d; now within %.1f mm\n", (int)tags[moved].id,
           (int)report.tags_moved, (int)report.first_moved, error_m * 1e3);
    EXPECT_INT(report.tags_moved, 1);
    EXPECT_INT(report.first_moved, tags[moved].id);
    EXPECT_INT(both.tags[moved].id, tags[moved].id);
    EXPECT_AT_MOST(error_m, 0.003);
    tags[moved] = both.tags[moved]; // all others are as they were
    expect_kept(&known, &both);
    place_free(&both);
}

static void test_takes_are_kept(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    const char *path = scratch_file(&scratch, "place.reenact");
    struct recording_writer *w;
    struct recording *r;
    struct take *take;
    struct place read, both;
    struct mapper_report report;
    struct recording_report verified;
    struct take_frame frame = {
        .time_ns = 5, .world_from_camera = world_sweep_pose(room.world, 3), .located = true, .depth = room.depth[0]};
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_put_place(w, &room.first), OK);
    EXPECT_STATUS(recording_begin_take(w, "one", &room.calibration), OK);
    EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);

    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_place(r, &read), OK);
    recording_free(&r);
    expect_kept(&room.first, &read);
    EXPECT_STATUS(map(&read, room.tag_count, SECOND_START, SECOND_START + 6, &both, &report), OK);
    EXPECT_AT_LEAST(both.view_count, read.view_count + 1); // the calibration is the same after a file, too
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_put_place(w, &both), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    place_free(&read);

    EXPECT_STATUS(recording_verify(path, &verified), OK);
    EXPECT_INT(verified.takes, 1);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(recording_read_place(r, &read), OK);
    expect_kept(&room.first, &read);
    EXPECT_INT(read.view_count, both.view_count);
    EXPECT_STATUS(take_open(&take, r, "one"), OK);
    EXPECT_TRUE(!memcmp(&take_entry(take, 0)->world_from_camera, &frame.world_from_camera, sizeof(struct pose)));
    take_close(&take);
    recording_free(&r);
    place_free(&read);
    place_free(&both);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_other_half_is_added),
        cmocka_unit_test(test_known_tags_need_not_be_listed),
        cmocka_unit_test(test_place_without_tags_grows_by_landmarks),
        cmocka_unit_test(test_unrelated_sweep_is_refused),
        cmocka_unit_test(test_impossible_tags_are_refused),
        cmocka_unit_test(test_moved_tag_is_detected),
        cmocka_unit_test(test_takes_are_kept),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
