// The mapper against the synthetic room's truth: with tags, without depth, without tags, with few tags; tag lists and
// invalid input.
#include "tests/support/test.h"

#include "capture/mapping/mapper.h"
#include "locate/camera_tracker.h"
#include "platform/files/file.h"
#include "tests/support/align.h"
#include "tests/support/covariance_check.h"
#include "tests/support/tag_picture.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// ---------------------------------------------------------------- tags.json

static enum status read_text(const char *text, struct mapper_tag **tags, int32_t *count)
{
    char path[] = "/tmp/reenact_tags_XXXXXX";
    int file = mkstemp(path);
    EXPECT_TRUE(file >= 0);
    EXPECT_INT(write(file, text, strlen(text)), (long long)strlen(text));
    close(file);
    enum status status = mapper_read_tags(path, tags, count);
    unlink(path);
    return status;
}

static void test_tag_lists(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "",
        "[]",
        "{",
        "{\"family\": \"tag36h11\"}",
        "{\"side_m\": {\"0\": 0.2}}",
        "{\"family\": \"tag16h5\", \"side_m\": {\"0\": 0.2}}",
        "{\"family\": \"tag36h11\", \"side_m\": {}}",
        "{\"family\": \"tag36h11\", \"side_m\": [0.2]}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"x\": 0.2}}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"0\": \"0.2\"}}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"0\": -0.2}}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"0\": 200}}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"587\": 0.2}}",
        "{\"family\": \"tag36h11\", \"side_m\": {\"1\": 0.2, \"01\": 0.2}}",
        "{\"family\": 3, \"side_m\": {\"0\": 0.2}}",
    };
    struct mapper_tag *tags;
    int32_t count;
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        EXPECT_STATUS(read_text(bad[i], &tags, &count), ERR_INPUT);
        EXPECT_TRUE(tags == NULL && strlen(status_message()) > 20);
    }
    EXPECT_STATUS(mapper_read_tags("/nowhere/tags.json", &tags, &count), ERR_MISSING);
    EXPECT_STATUS(read_text("{\"family\": \"tag36h11\", \"side_m\": {\"12\": 0.24, \"3\": 0.2}}", &tags, &count), OK);
    EXPECT_INT(count, 2);
    EXPECT_INT(tags[0].id, 3);
    EXPECT_NEAR(tags[1].side_m, 0.24, 0);
    free(tags);
}

// ---------------------------------------------------------------- a room

enum { SWEEP = 36 }; // images of the sweep

struct mapped_room {
    struct world *world;
    struct calibration calibration;
    struct mapper_tag tags[32];
    int32_t tag_count;
    uint8_t *color[SWEEP];
    uint16_t *depth[SWEEP];
};

static struct mapped_room the_room; // filmed once, for all tests

static int64_t sweep_time_ns(int i) { return (int64_t)(1e9 * WORLD_SWEEP_S * i / SWEEP); }

static int film_room(void **state)
{
    (void)state;
    struct mapped_room *r = &the_room;
    struct world_options o = world_default_options();
    int32_t count;
    o.motion = "still";
    o.threads = 2;
    EXPECT_STATUS(world_open(&r->world, &o), OK);
    r->calibration = world_calibration(1);
    const struct place_tag *tags = world_tags(r->world, &count);
    for (int32_t i = 0; i < count; i++)
        r->tags[i] = (struct mapper_tag){tags[i].id, tags[i].side_m};
    r->tag_count = count;
    size_t pixels = (size_t)r->calibration.color.width * (size_t)r->calibration.color.height;
    for (int i = 0; i < SWEEP; i++) {
        r->color[i] = malloc(pixels * 3);
        r->depth[i] = malloc(pixels * sizeof *r->depth[i]);
        EXPECT_TRUE(r->color[i] && r->depth[i]);
        struct world_shot shot = {r->calibration.color, world_sweep_pose(r->world, (double)sweep_time_ns(i) * 1e-9), 0,
                                  false};
        struct world_image image = {.color = r->color[i], .depth = r->depth[i]};
        EXPECT_STATUS(world_render(r->world, &shot, &image), OK);
        world_color_noise(r->color[i], shot.lens.width, shot.lens.height, 1000 + (uint64_t)i);
        EXPECT_STATUS(world_depth_noise(&shot.lens, r->depth[i], 50 + (uint64_t)i, r->depth[i]), OK);
    }
    return 0;
}

static int leave_room(void **state)
{
    (void)state;
    for (int i = 0; i < SWEEP; i++) {
        free(the_room.color[i]);
        free(the_room.depth[i]);
    }
    world_close(&the_room.world);
    return 0;
}

// Feeds every `step`th image of the sweep, with the true depth times depth_scale; 0: without depth.
static enum status film(const struct mapped_room *r, struct mapper *m, int step, double depth_scale)
{
    size_t pixels = (size_t)r->calibration.depth.width * (size_t)r->calibration.depth.height;
    uint16_t *depth = malloc(pixels * sizeof *depth);
    enum status status = depth ? OK : ERR_MEMORY;
    for (int i = 0; i < SWEEP && status == OK; i += step) {
        struct frame frame = {
            .time_ns = sweep_time_ns(i), .color = r->color[i], .depth = depth_scale > 0 ? depth : NULL};
        for (size_t k = 0; k < pixels; k++)
            depth[k] = (uint16_t)(depth_scale * r->depth[i][k] + 0.5);
        status = mapper_add(m, &frame);
    }
    free(depth);
    return status;
}

// rms of the mapped tags' corners against the truth after the best rigid motion.
static double tag_error(const struct mapped_room *r, const struct place *place, struct pose *world_from_place)
{
    int32_t count;
    const struct place_tag *tags = world_tags(r->world, &count);
    return align_tags(place, tags, count, world_from_place);
}

// The map of a sweep of the room.
struct mapping_result {
    struct place place;
    struct mapper_report report;
    struct pose world_from_place; // by its tags, if any
    double tags_off_m;            // rms of their corners
};

// Maps what `film` feeds. tag_count: how many of the room's tags are listed.
static struct mapping_result map_room(const struct mapped_room *r, int32_t tag_count, int step, double depth_scale)
{
    struct mapping_result m;
    struct mapper *mapper;
    EXPECT_STATUS(mapper_open(&mapper, &r->calibration, tag_count ? r->tags : NULL, tag_count, NULL), OK);
    EXPECT_STATUS(film(r, mapper, step, depth_scale), OK);
    EXPECT_STATUS(mapper_finish(mapper, &m.place, &m.report), OK);
    mapper_close(&mapper);
    m.world_from_place = POSE_IDENTITY;
    m.tags_off_m = tag_count ? tag_error(r, &m.place, &m.world_from_place) : 0;
    return m;
}

static void check_axes(const struct place *place, struct pose world_from_place)
{
    // z up and 0 on the floor, as in the world; x and the origin by the tag with the lowest id.
    struct vec3 up = quat_rotate(world_from_place.rotation, v3(0, 0, 1));
    EXPECT_AT_LEAST(up.z, cos(0.2 / 57.3));
    EXPECT_NEAR(world_from_place.translation.z, 0, 0.006);
    const struct place_tag *first = &place->tags[0];
    for (int32_t i = 1; i < place->tag_count; i++)
        if (place->tags[i].id < first->id)
            first = &place->tags[i];
    struct vec3 x = quat_rotate(first->world_from_tag.rotation, v3(1, 0, 0));
    EXPECT_NEAR(first->world_from_tag.translation.x, 0, 1e-9);
    EXPECT_NEAR(first->world_from_tag.translation.y, 0, 1e-9);
    EXPECT_NEAR(x.y, 0, 1e-9);
    EXPECT_TRUE(x.x > 0.9);
}

// Localises the tablet in the map and compares with the truth.
static void check_viewer(const struct mapped_room *r, const struct place *place, struct pose world_from_place,
                         double max_m, double most_deg)
{
    struct calibration viewer = world_viewer_calibration(1);
    uint8_t *color = malloc((size_t)viewer.color.width * (size_t)viewer.color.height * 3);
    struct locator *l;
    double worst_m = 0, worst_rad = 0;
    int found = 0, tried = 0;
    EXPECT_TRUE(color != NULL);
    EXPECT_STATUS(locator_open(&l, place, &viewer.color, NULL), OK);
    for (double t = 0; t < world_seconds(r->world); t += world_seconds(r->world) / 6, tried++) {
        struct world_shot shot = {viewer.color, world_viewer_pose(r->world, t), t, false};
        struct world_image image = {.color = color};
        struct location at;
        EXPECT_STATUS(world_render(r->world, &shot, &image), OK);
        world_color_noise(color, shot.lens.width, shot.lens.height, 77);
        enum status status = locator_localize(l, color, NULL, &at);
        EXPECT_TRUE(status >= 0);
        if (status != OK)
            continue;
        struct pose in_world = pose_multiply(world_from_place, at.world_from_camera);
        worst_m = fmax(worst_m, v3_distance(in_world.translation, shot.world_from_camera.translation));
        worst_rad = fmax(worst_rad, pose_angle(in_world, shot.world_from_camera));
        found++;
    }
    printf("tablet: %d of %d found, worst %.1f mm, %.3f degrees\n", found, tried, worst_m * 1e3, worst_rad * 57.2958);
    EXPECT_AT_LEAST(found, tried - 1);
    EXPECT_AT_MOST(worst_m, max_m);
    EXPECT_AT_MOST(worst_rad * 57.2958, most_deg);
    locator_close(&l);
    free(color);
}

// A tablet that is carried once round the room in nine seconds, with two images a second: each pose is far from the
// prediction by the ones before.
static void check_slow_viewer(const struct mapped_room *r, const struct place *place, struct pose world_from_place,
                              double max_m)
{
    enum { IMAGES_ROUND = 18 };
    struct calibration viewer = world_viewer_calibration(1);
    uint8_t *color = malloc((size_t)viewer.color.width * (size_t)viewer.color.height * 3);
    struct camera_tracker *track;
    double worst_m = 0;
    int found = 0;
    EXPECT_TRUE(color != NULL);
    EXPECT_STATUS(camera_tracker_open(&track, place, &viewer.color, NULL), OK);
    for (int i = 0; i < IMAGES_ROUND; i++) {
        double t = world_seconds(r->world) * i / IMAGES_ROUND;
        struct world_shot shot = {viewer.color, world_viewer_pose(r->world, t), t, false};
        struct location at;
        struct camera_motion motion;
        EXPECT_STATUS(world_render(r->world, &shot, &(struct world_image){.color = color}), OK);
        world_color_noise(color, shot.lens.width, shot.lens.height, 200 + (uint64_t)i);
        if (camera_tracker_process(track, color, NULL, i * 500000000LL, &at, &motion) != OK)
            continue;
        struct pose in_world = pose_multiply(world_from_place, at.world_from_camera);
        worst_m = fmax(worst_m, v3_distance(in_world.translation, shot.world_from_camera.translation));
        found++;
    }
    printf("tablet with two images a second: %d of %d found, worst %.1f mm\n", found, IMAGES_ROUND, worst_m * 1e3);
    EXPECT_AT_LEAST(found, IMAGES_ROUND - 1);
    EXPECT_AT_MOST(worst_m, max_m);
    camera_tracker_close(&track);
    free(color);
}

static void test_room_is_mapped(void **state)
{
    (void)state;
    struct mapped_room r = the_room;
    int32_t count;
    // a listed tag that is not in the room, and one in the room that is not listed
    int32_t unlisted = r.tags[4].id;
    r.tags[4] = (struct mapper_tag){500, 0.2};
    struct mapping_result m = map_room(&r, r.tag_count, 1, 1);
    const struct place *place = &m.place;
    const struct mapper_report *report = &m.report;
    double error = m.tags_off_m, off = tags_mahalanobis_squared(place, world_tags(r.world, &count), m.world_from_place);
    printf("squared Mahalanobis distance of the tags: %.1f, expected 6\n", off);
    EXPECT_AT_LEAST(off, 3); // measured 3.8
    EXPECT_AT_MOST(off, 9);
    printf("%d of %d images placed, %d tags within %.2f mm rms, %d points, rms %.3f px, %.1f mm\n",
           (int)report->frames_placed, (int)report->frames, (int)place->tag_count, error * 1e3, (int)place->point_count,
           place->rms_px, place->rms_m * 1e3);
    EXPECT_AT_LEAST(report->frames_placed, 35); // measured 36
    EXPECT_AT_LEAST(report->tags_mapped, r.tag_count - 1);
    EXPECT_INT(place->tag_count, report->tags_mapped);
    EXPECT_INT(report->tags_unseen, 1);
    EXPECT_INT(report->first_unseen, 500);
    EXPECT_AT_LEAST(report->tags_unlisted, 1);
    EXPECT_INT(report->first_unlisted, unlisted);
    EXPECT_TRUE(report->floor_from_depth);
    EXPECT_INT(report->tags_wrong_side, 0);
    EXPECT_AT_MOST(error, 0.002);          // measured 1.03 mm
    EXPECT_AT_LEAST(place->rms_px, 0.001); // measured 0.013 px
    EXPECT_AT_MOST(place->rms_px, 0.03);
    EXPECT_AT_LEAST(place->point_count, 3000); // measured 3866
    EXPECT_AT_MOST(place->point_count, 4000);
    EXPECT_AT_LEAST(place->view_count, 15);
    EXPECT_AT_MOST(place->view_count, 40);
    for (int32_t i = 0; i < place->view_count; i++)
        EXPECT_TRUE(place->views[i].jpeg && place->views[i].depth);
    check_axes(place, m.world_from_place);
    check_viewer(&r, place, m.world_from_place, 0.008, 0.08);
    place_free(&m.place);
}

static void test_tags_give_scale_without_depth(void **state)
{
    (void)state;
    struct mapped_room r = the_room;
    struct mapping_result m = map_room(&r, r.tag_count, 2, 0);
    const struct place *place = &m.place;
    printf("without depth: %d of %d images placed, %d tags within %.2f mm rms, %d points\n",
           (int)m.report.frames_placed, (int)m.report.frames, (int)place->tag_count, m.tags_off_m * 1e3,
           (int)place->point_count);
    EXPECT_AT_MOST(m.tags_off_m, 0.003);      // measured 1.46 mm
    EXPECT_AT_LEAST(place->point_count, 200); // measured 307
    check_viewer(&r, place, m.world_from_place, 0.012, 0.12);
    EXPECT_TRUE(!m.report.floor_from_depth);
    EXPECT_NEAR(place->rms_m, 0, 0);
    struct vec3 up = quat_rotate(m.world_from_place.rotation, v3(0, 0, 1));
    EXPECT_AT_LEAST(up.z, cos(2 / 57.3));
    place_free(&m.place);
}

// Depth that is 2 % too long does not scale the room: the tags' sides are known.
static void test_tags_correct_depth(void **state)
{
    (void)state;
    if (SANITIZED) // other numbers, the same code
        return;
    struct mapped_room r = the_room;
    struct mapping_result m = map_room(&r, r.tag_count, 2, 1.02);
    printf("depth 2 %% long: %d tags within %.2f mm rms\n", (int)m.place.tag_count, m.tags_off_m * 1e3);
    EXPECT_AT_LEAST(m.place.tag_count, r.tag_count - 1);
    EXPECT_AT_MOST(m.tags_off_m, 0.003);
    check_viewer(&r, &m.place, m.world_from_place, 0.012, 0.12);
    place_free(&m.place);
}

// A wrong number in the list: named with its likely value, and the others make the map.
static void test_wrong_sides_are_named(void **state)
{
    (void)state;
    struct mapped_room r = the_room;
    const int32_t wrong = 3, id = r.tags[wrong].id;
    const double side_m = r.tags[wrong].side_m;
    const double shares[] = {0.5, 0.85, 1.15};
    const int step = SANITIZED ? 2 : 1;
    for (size_t i = 0; i < COUNT_OF(shares); i += SANITIZED ? COUNT_OF(shares) : 1) {
        r.tags[wrong].side_m = shares[i] * side_m;
        struct mapping_result m = map_room(&r, r.tag_count, step, 1.01);
        printf("tag %d listed as %.3f m: %d wrong, it looks %.4f m wide, in truth %.3f m; %d tags within %.2f mm\n",
               (int)id, r.tags[wrong].side_m, (int)m.report.tags_wrong_side, m.report.measured_m, side_m,
               (int)m.place.tag_count, m.tags_off_m * 1e3);
        EXPECT_INT(m.report.tags_wrong_side, 1);
        EXPECT_INT(m.report.first_wrong, id);
        EXPECT_TRUE(!m.report.all_wrong_side);
        EXPECT_NEAR(m.report.measured_m, side_m, 0.03 * side_m);
        EXPECT_INT(m.report.tags_disconnected, 0);
        EXPECT_AT_LEAST(m.place.tag_count, r.tag_count - 2);
        EXPECT_AT_MOST(m.tags_off_m, 0.003);
        place_free(&m.place);
    }
    r.tags[wrong].side_m = side_m;
    for (int32_t i = 0; i < r.tag_count; i++) // a printer that fitted the page
        r.tags[i].side_m *= 0.9;
    struct mapping_result m = map_room(&r, r.tag_count, step, 1);
    printf("all listed too small: %d wrong, %d tags mapped, looks %.4f m, listed %.4f m\n",
           (int)m.report.tags_wrong_side, (int)m.place.tag_count, m.report.measured_m, m.report.listed_side_m);
    EXPECT_TRUE(m.report.all_wrong_side);
    EXPECT_NEAR(m.report.measured_m / m.report.listed_side_m, 1 / 0.9, 0.03);
    place_free(&m.place);
}

// The axes of a place without tags: z up, the origin below the first image, x to its right.
static struct pose axes_of_first_image(const struct mapped_room *r)
{
    struct pose first = world_sweep_pose(r->world, 0);
    struct vec3 x = quat_rotate(first.rotation, v3(1, 0, 0));
    struct pose world_from_place = {quat_from_rotation_vector(v3(0, 0, atan2(x.y, x.x))), first.translation};
    world_from_place.translation.z = 0;
    return world_from_place;
}

static void test_depth_gives_scale_without_tags(void **state)
{
    (void)state;
    struct mapped_room r = the_room;
    struct mapping_result m = map_room(&r, 0, 1, 1);
    printf("without tags: %d of %d images placed, %d points\n", (int)m.report.frames_placed, (int)m.report.frames,
           (int)m.place.point_count);
    EXPECT_INT(m.report.frames_placed, m.report.frames);
    EXPECT_INT(m.place.tag_count, 0);
    EXPECT_TRUE(m.report.floor_from_depth);
    EXPECT_NEAR(m.report.lost_to_s - m.report.lost_from_s, 0, 0);
    check_viewer(&r, &m.place, axes_of_first_image(&r), 0.02, 0.25);
    place_free(&m.place);
}

// No image shows two tags; landmarks register the images between them.
static void test_few_tags(void **state)
{
    (void)state;
    struct mapped_room r = the_room;
    static const int few[] = {1, 6}; // on opposite walls
    for (size_t i = 0; i < COUNT_OF(few); i++)
        r.tags[i] = (struct mapper_tag){few[i], world_tags(r.world, &(int32_t){0})[few[i]].side_m};
    struct mapping_result m = map_room(&r, COUNT_OF(few), 1, 1);
    printf("of two tags: %d of %d images placed, %d tags within %.2f mm rms, %d points\n", (int)m.report.frames_placed,
           (int)m.report.frames, (int)m.place.tag_count, m.tags_off_m * 1e3, (int)m.place.point_count);
    EXPECT_INT(m.report.frames_placed, m.report.frames);
    EXPECT_INT(m.place.tag_count, COUNT_OF(few));
    EXPECT_AT_LEAST(m.place.point_count, 3000);
    EXPECT_AT_MOST(m.tags_off_m, 0.005);
    check_viewer(&r, &m.place, m.world_from_place, 0.02, 0.25);
    if (!SANITIZED) // as above, eighteen times
        check_slow_viewer(&r, &m.place, m.world_from_place, 0.02);
    place_free(&m.place);
}

// ---------------------------------------------------------------- sweeps that cannot be mapped

static struct calibration small_camera(void)
{
    struct calibration c = {.color = tag_picture_lens(160, 120, 131), .color_from_depth = POSE_IDENTITY};
    return c;
}

static void test_missing_tags_are_reported(void **state)
{
    (void)state;
    static uint8_t gray[160 * 120 * 3];
    struct calibration c = small_camera();
    struct mapper_tag tag = {5, 0.2};
    struct mapper *m;
    struct place place;
    struct mapper_report report;
    EXPECT_STATUS(mapper_open(&m, &c, &tag, 1, NULL), OK);
    EXPECT_STATUS(mapper_finish(m, &place, &report), ERR_INPUT); // no image
    mapper_close(&m);
    EXPECT_STATUS(mapper_open(&m, &c, &tag, 1, NULL), OK);
    memset(gray, 128, sizeof gray);
    EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = 1}), OK); // without colour
    EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = 2, .color = gray}), OK);
    EXPECT_STATUS(mapper_finish(m, &place, &report), ERR_INPUT);
    EXPECT_SAYS("tag");
    EXPECT_TRUE(place.tags == NULL && place.tag_count == 0);
    EXPECT_INT(report.tags_unseen, 1);
    mapper_close(&m);
    mapper_close(&m);
}

static void test_invalid_input(void **state)
{
    (void)state;
    struct calibration c = small_camera(), bad = c;
    struct mapper_tag tags[2] = {{5, 0.2}, {5, 0.2}};
    struct mapper *m;
    EXPECT_STATUS(mapper_open(&m, &c, tags, 2, NULL), ERR_INPUT);
    EXPECT_TRUE(m == NULL);
    EXPECT_STATUS(mapper_open(&m, &c, tags, 0, NULL), ERR_INPUT); // no depth either
    tags[0].side_m = NAN;
    EXPECT_STATUS(mapper_open(&m, &c, tags, 1, NULL), ERR_INPUT);
    tags[0] = (struct mapper_tag){900, 0.2};
    EXPECT_STATUS(mapper_open(&m, &c, tags, 1, NULL), ERR_INPUT);
    bad.color.fx = 0;
    EXPECT_STATUS(mapper_open(&m, &bad, &tags[1], 1, NULL), ERR_INPUT);
    bad = c;
    bad.color = (struct lens){0};
    EXPECT_STATUS(mapper_open(&m, &bad, &tags[1], 1, NULL), ERR_INPUT);
    EXPECT_SAYS("depth only");
    bad = c;
    bad.color.focal_sigma = 0.15; // a guess
    EXPECT_STATUS(mapper_open(&m, &bad, &tags[1], 1, NULL), ERR_INPUT);
    struct mapper_options o = mapper_default_options();
    o.quad_decimate = 0;
    EXPECT_STATUS(mapper_open(&m, &c, &tags[1], 1, &o), ERR_INPUT);
    EXPECT_TRUE(m == NULL);
}

// The memory of a long sweep is bounded; tags never seen together are not connected.
static void test_long_sweeps_are_subsampled(void **state)
{
    (void)state;
    static uint8_t rgb[160 * 120 * 3];
    struct calibration c = small_camera();
    struct mapper_tag list[2] = {{5, 0.2}, {6, 0.2}};
    struct place_tag tags[2] = {{.id = 5, .side_m = 0.2, .world_from_tag = POSE_IDENTITY},
                                {.id = 6, .side_m = 0.2, .world_from_tag = POSE_IDENTITY}};
    struct mapper_options o = mapper_default_options();
    struct mapper *m;
    struct place place;
    struct mapper_report report;
    o.max_points = 0;
    EXPECT_STATUS(mapper_open(&m, &c, list, 2, &o), OK);
    for (int view = 0; view < 10; view++) {
        bool other = view == 9; // the second tag, alone
        struct tag_picture p = {.lens = c.color,
                                .tags = &tags[other],
                                .tag_count = 1,
                                .rgb = rgb,
                                .noise = 1,
                                .seed = 3,
                                .world_from_camera = tag_picture_view(0.6, 0.15 * view - 0.7, 0.3 - 0.08 * view, 0)};
        EXPECT_TRUE(tag_picture_draw(&p));
        for (int i = 0; i < 60; i++)
            EXPECT_STATUS(mapper_add(m, &(struct frame){.time_ns = view * 60 + i, .color = rgb}), OK);
    }
    EXPECT_STATUS(mapper_finish(m, &place, &report), OK);
    EXPECT_INT(report.frames_seen, 600);
    EXPECT_AT_MOST(report.frames, 240);
    EXPECT_AT_LEAST(report.frames, 120);
    EXPECT_INT(report.tags_disconnected, 1);
    EXPECT_INT(report.first_disconnected, 6);
    EXPECT_INT(place.tag_count, 1);
    EXPECT_AT_MOST(place.view_count, 40);
    EXPECT_AT_LEAST(place.view_count, 5);
    place_free(&place);
    mapper_close(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tag_lists),
        cmocka_unit_test(test_room_is_mapped),
        cmocka_unit_test(test_tags_give_scale_without_depth),
        cmocka_unit_test(test_tags_correct_depth),
        cmocka_unit_test(test_wrong_sides_are_named),
        cmocka_unit_test(test_depth_gives_scale_without_tags),
        cmocka_unit_test(test_few_tags),
        cmocka_unit_test(test_missing_tags_are_reported),
        cmocka_unit_test(test_invalid_input),
        cmocka_unit_test(test_long_sweeps_are_subsampled),
    };
    return cmocka_run_group_tests(tests, film_room, leave_room);
}
