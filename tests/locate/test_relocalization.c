// Localisation in a furnished room under bad conditions: tags hidden, little light, motion blur, occlusion; and in
// rooms that are not as they were mapped.
#include "tests/support/test.h"

#include "locate/locator.h"
#include "locate/relocalization.h"
#include "tests/support/film.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>

enum { SWEEP = 20, VIEWS = 3, WIDTH = 640, HEIGHT = 480, BYTES = WIDTH * HEIGHT * 3 };

static struct relocation_room {
    struct world *world;
    struct place place;
    struct pose world_from_place;
    struct lens lens;         // of the tablet
    struct pose truth[VIEWS]; // of the tablet
    uint8_t view[VIEWS][BYTES];
} room;
static uint8_t rgb[BYTES];

static int enter(void **state)
{
    (void)state;
    room.place = film_mapped_place(&room.world, SWEEP, &room.world_from_place);
    room.lens = world_viewer_calibration(1).color;
    for (int i = 0; i < VIEWS; i++) {
        room.truth[i] = world_viewer_pose(room.world, world_seconds(room.world) * (i + 0.4) / VIEWS);
        struct world_shot shot = {room.lens, room.truth[i], 0, false};
        struct world_image image = {.color = room.view[i]};
        EXPECT_STATUS(world_render(room.world, &shot, &image), OK);
        world_color_noise(room.view[i], WIDTH, HEIGHT, 40 + (uint64_t)i);
    }
    return 0;
}

static int leave(void **state)
{
    (void)state;
    place_free(&room.place);
    world_close(&room.world);
    return 0;
}

// ---------------------------------------------------------------- image defects

static void paint_tags_over(int view)
{
    int32_t count;
    const struct place_tag *tags = world_tags(room.world, &count);
    struct pose camera_from_world = pose_inverse(room.truth[view]);
    for (int32_t i = 0; i < count; i++) {
        struct place_tag wide = tags[i];
        struct vec3 corner[4];
        double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
        bool before = true;
        wide.side_m *= 1.3; // with the white rim
        place_tag_corners(&wide, corner);
        for (int k = 0; k < 4; k++) {
            struct vec3 p = pose_apply(camera_from_world, corner[k]);
            before = before && p.z > 0.1 && fabs(p.x) < p.z && fabs(p.y) < p.z;
            struct pixel at = before ? lens_project(&room.lens, p) : (struct pixel){0, 0};
            x0 = fmin(x0, at.x), x1 = fmax(x1, at.x), y0 = fmin(y0, at.y), y1 = fmax(y1, at.y);
        }
        for (int y = (int)fmax(0, y0); before && y <= fmin(HEIGHT - 1, y1); y++)
            for (int x = (int)fmax(0, x0); x <= fmin(WIDTH - 1, x1); x++)
                memset(rgb + 3 * (y * WIDTH + x), 150, 3);
    }
}

static void dim(int view)
{
    (void)view;
    for (int i = 0; i < BYTES; i++)
        rgb[i] /= 2;
}

static void blur(int view) // five pixels of horizontal motion
{
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            for (int c = 0; c < 3; c++) {
                int sum = 0;
                for (int k = -2; k <= 2; k++) {
                    int from = x + k < 0 ? 0 : x + k >= WIDTH ? WIDTH - 1 : x + k;
                    sum += room.view[view][3 * (y * WIDTH + from) + c];
                }
                rgb[3 * (y * WIDTH + x) + c] = (uint8_t)(sum / 5);
            }
}

static void cover(int view) // the middle third
{
    (void)view;
    for (int y = 0; y < HEIGHT; y++)
        memset(rgb + 3 * (y * WIDTH + WIDTH / 3), 70, 3 * (WIDTH / 3));
}

static void mirror(int view)
{
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            memcpy(rgb + 3 * (y * WIDTH + x), room.view[view] + 3 * (y * WIDTH + WIDTH - 1 - x), 3);
}

static void leave_unchanged(int view) { (void)view; }

// ---------------------------------------------------------------- tests

static double error_m(int view, const struct location *at)
{
    struct pose in_world = pose_multiply(room.world_from_place, at->world_from_camera);
    return v3_distance(in_world.translation, room.truth[view].translation);
}

// How many of the views are localised; *worst: the largest error of those, metres.
static int localize_all(const struct place *place, const struct lens *lens, void (*spoil)(int), double *worst)
{
    struct locator *l;
    int found = 0;
    *worst = 0;
    EXPECT_STATUS(locator_open(&l, place, lens, NULL), OK);
    for (int i = 0; i < VIEWS; i++) {
        struct location at;
        memcpy(rgb, room.view[i], BYTES);
        spoil(i);
        enum status status = locator_localize(l, rgb, NULL, &at);
        EXPECT_TRUE(status >= 0);
        found += status == OK;
        *worst = status == OK ? fmax(*worst, error_m(i, &at)) : *worst;
    }
    locator_close(&l);
    return found;
}

static void test_bad_images(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        void (*spoil)(int);
        double within_m;
    } cases[] = {{"unchanged", leave_unchanged, 0.006},
                 {"tags painted over", paint_tags_over, 0.006},
                 {"half the light", dim, 0.007},
                 {"blurred by motion", blur, 0.02},
                 {"a third covered", cover, 0.008}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        double worst;
        int found = localize_all(&room.place, &room.lens, cases[i].spoil, &worst);
        printf("%-18s %d of %d localised, worst %.1f mm\n", cases[i].what, found, VIEWS, worst * 1e3);
        EXPECT_INT(found, VIEWS);
        EXPECT_AT_MOST(worst, cases[i].within_m);
    }
}

static void test_mirrored_room_is_rejected(void **state)
{
    (void)state;
    double worst;
    int found = localize_all(&room.place, &room.lens, mirror, &worst);
    printf("mirrored room: %d of %d localised\n", found, VIEWS);
    EXPECT_INT(found, 0);
}

static void test_far_from_origin(void **state)
{
    (void)state;
    struct place moved = room.place;
    struct vec3 far = v3(1e4, -1e4, 20);
    double worst = 0;
    struct locator *close_locator, *far_l;
    moved.tags = malloc((size_t)moved.tag_count * sizeof *moved.tags);
    moved.points = malloc((size_t)moved.point_count * sizeof *moved.points);
    EXPECT_TRUE(moved.tags && moved.points);
    for (int32_t i = 0; i < moved.tag_count; i++) {
        moved.tags[i] = room.place.tags[i];
        moved.tags[i].world_from_tag.translation = v3_add(moved.tags[i].world_from_tag.translation, far);
    }
    for (int32_t i = 0; i < moved.point_count; i++) {
        moved.points[i] = room.place.points[i];
        moved.points[i].world = v3_add(moved.points[i].world, far);
    }
    EXPECT_STATUS(locator_open(&close_locator, &room.place, &room.lens, NULL), OK);
    EXPECT_STATUS(locator_open(&far_l, &moved, &room.lens, NULL), OK);
    for (int i = 0; i < VIEWS; i++) {
        struct location a, b;
        EXPECT_STATUS(locator_localize(close_locator, room.view[i], NULL, &a), OK);
        EXPECT_STATUS(locator_localize(far_l, room.view[i], NULL, &b), OK);
        worst = fmax(worst, v3_distance(v3_sub(b.world_from_camera.translation, far), a.world_from_camera.translation));
    }
    printf("14 km from the origin: %.4f mm elsewhere\n", worst * 1e3);
    EXPECT_AT_MOST(worst, 1e-3);
    locator_close(&close_locator);
    locator_close(&far_l);
    free(moved.tags);
    free(moved.points);
}

// A tag that was moved after mapping is an outlier.
static void test_moved_tag_is_excluded(void **state)
{
    (void)state;
    struct place changed = room.place;
    struct locator *l;
    int rejected = 0;
    double worst = 0;
    changed.tags = malloc((size_t)changed.tag_count * sizeof *changed.tags);
    EXPECT_TRUE(changed.tags != NULL);
    for (int moved = 0; moved < changed.tag_count; moved++) {
        memcpy(changed.tags, room.place.tags, (size_t)changed.tag_count * sizeof *changed.tags);
        changed.tags[moved].world_from_tag.translation.z += 0.15;
        EXPECT_STATUS(locator_open(&l, &changed, &room.lens, NULL), OK);
        struct location at;
        enum status status = locator_localize(l, room.view[moved % VIEWS], NULL, &at);
        EXPECT_TRUE(status >= 0);
        if (status == OK) {
            rejected += at.tags_rejected;
            worst = fmax(worst, error_m(moved % VIEWS, &at));
        }
        locator_close(&l);
    }
    printf("one tag moved, each once: rejected %d times, worst %.1f mm\n", rejected, worst * 1e3);
    EXPECT_AT_LEAST(rejected, 1);
    EXPECT_AT_MOST(worst, 0.007);
    free(changed.tags);
}

// Every point on one plane, a third of the matches wrong, and some of points behind the camera.
static void test_single_wall(void **state)
{
    (void)state;
    enum { POINTS = 120, WRONG = 40, BEHIND = 20 };
    static struct place_landmark points[POINTS];
    static struct feature features[POINTS];
    static struct feature_index index;
    struct landmark_match matches[POINTS];
    struct rng rng = {17};
    double worst_m = 0, worst_rad = 0;
    for (int trial = 0; trial < 20; trial++) {
        struct vec3 rotation_vector = v3_add(v3(0, 0, 0.5), rng_within(&rng, v3(0.3, 0.3, 0.5)));
        struct pose truth = {quat_from_rotation_vector(rotation_vector), {0.3, -0.2, 2.5}}; // camera_from_world
        truth.translation.z += rng_uniform(&rng);
        for (int i = 0; i < POINTS; i++) {
            points[i].world = rng_within(&rng, v3(1.5, 1, 0));
            if (i >= POINTS - BEHIND)
                points[i].world.z = -6;
            struct vec3 p = pose_apply(truth, points[i].world);
            struct pixel at = lens_project(&room.lens, v3_scale(p, p.z > 0 ? 1 : -1));
            struct vec3 anywhere = rng_within(&rng, v3(WIDTH / 2.0, HEIGHT / 2.0, 0));
            if (i < WRONG)
                at = (struct pixel){(WIDTH - 1) / 2.0 + anywhere.x, (HEIGHT - 1) / 2.0 + anywhere.y};
            struct vec3 noise = rng_normal3(&rng, 0.5);
            features[i] = (struct feature){.at = {at.x + noise.x, at.y + noise.y}, .scale = 1};
            matches[i] = (struct landmark_match){i, i};
        }
        feature_index_build(&index, features, POINTS, &room.lens);
        const struct match_query query = {.points = points, .point_count = POINTS, .index = &index, .lens = &room.lens};
        struct pose found;
        int agree;
        EXPECT_TRUE(relocalize(&query, matches, POINTS, NULL, &found, &agree));
        worst_m = fmax(worst_m, v3_distance(pose_inverse(found).translation, pose_inverse(truth).translation));
        worst_rad = fmax(worst_rad, pose_angle(found, truth));
    }
    printf("all points on one wall, half of the matches wrong: worst %.1f mm, %.2f degrees\n", worst_m * 1e3,
           worst_rad * 57.2958);
    EXPECT_AT_MOST(worst_m, 0.03);
    EXPECT_AT_MOST(worst_rad * 57.2958, 0.5);
}

// A focal length given 5 % too long must be reported.
static void test_wrong_focal_length_is_detected(void **state)
{
    (void)state;
    struct lens wrong = room.lens;
    struct locator *right_l, *wrong_l;
    double right_scale, wrong_scale;
    wrong.fx *= 1.05;
    wrong.fy *= 1.05;
    EXPECT_STATUS(locator_open(&right_l, &room.place, &room.lens, NULL), OK);
    EXPECT_STATUS(locator_open(&wrong_l, &room.place, &wrong, NULL), OK);
    for (int i = 0; i < VIEWS; i++) {
        struct location at;
        EXPECT_STATUS(locator_localize(right_l, room.view[i], NULL, &at), OK);
        EXPECT_TRUE(locator_localize(wrong_l, room.view[i], NULL, &at) >= 0);
    }
    bool right_is_wrong = locator_focal_is_wrong(right_l, &right_scale),
         wrong_is_wrong = locator_focal_is_wrong(wrong_l, &wrong_scale);
    printf("focal length 5 %% too long: %s, %.2f %% of it fits; the right one: %s, %.2f %%\n",
           wrong_is_wrong ? "wrong" : "accepted", wrong_scale * 100, right_is_wrong ? "wrong" : "accepted",
           right_scale * 100);
    EXPECT_TRUE(wrong_is_wrong && !right_is_wrong);
    EXPECT_AT_MOST(wrong_scale, 0.98);
    EXPECT_NEAR(right_scale, 1, 0.003);
    locator_close(&right_l);
    locator_close(&wrong_l);
}

// Self-calibration from a guessed focal length, a fifth too short or a quarter too long, with and without tags in view:
// it converges, and until then no pose's covariance is too small.
static void test_guessed_focal_length_is_estimated(void **state)
{
    (void)state;
    enum { ROUNDS = 3 };
    const double guessed[] = {0.8, 1.25};
    for (int i = 0; i < 4; i += SANITIZED ? 3 : 1) {
        struct lens lens = room.lens;
        struct place place = room.place;
        struct locator *l;
        lens.fx *= guessed[i / 2];
        lens.fy *= guessed[i / 2];
        lens.focal_sigma = 0.15;
        place.tag_count = i % 2 ? 0 : place.tag_count;
        EXPECT_STATUS(locator_open(&l, &place, &lens, NULL), OK);
        int placed = 0;
        double worst = 0, last_distance_m = INFINITY;
        for (int k = 0; k < ROUNDS * VIEWS; k++) {
            struct location at;
            if (locator_localize(l, room.view[k % VIEWS], NULL, &at) != OK)
                continue;
            placed++;
            const struct vec3 is = pose_apply(room.world_from_place, at.world_from_camera.translation);
            last_distance_m = v3_distance(is, room.truth[k % VIEWS].translation);
            worst = fmax(worst, last_distance_m / at.position_sigma_m);
        }
        const double off = locator_lens(l)->fx / room.lens.fx - 1;
        printf("focal length guessed %+.0f %%, %s: %+.2f %% in the end, sigma %.2f; %d of %d images localised, "
               "the last %.1f mm off, the worst %.1f sigma\n",
               (guessed[i / 2] - 1) * 100, i % 2 ? "points" : "tags and points", off * 100,
               locator_lens(l)->focal_sigma * 100, placed, ROUNDS * VIEWS, last_distance_m * 1e3, worst);
        EXPECT_AT_MOST(fabs(off), 0.005);
        EXPECT_AT_LEAST(placed, VIEWS);
        EXPECT_AT_MOST(worst, 4);
        locator_close(&l);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bad_images),
        cmocka_unit_test(test_mirrored_room_is_rejected),
        cmocka_unit_test(test_far_from_origin),
        cmocka_unit_test(test_moved_tag_is_excluded),
        cmocka_unit_test(test_single_wall),
        cmocka_unit_test(test_wrong_focal_length_is_detected),
        cmocka_unit_test(test_guessed_focal_length_is_estimated),
    };
    return cmocka_run_group_tests(tests, enter, leave);
}
