// The live tracker: what it says of a person who comes, leaves and is joined by another; the judge's window.
#include "tests/support/test.h"

#include "app/live/live_picture.h"
#include "app/live/live_tracker.h"
#include "tests/support/exercise.h"
#include "tests/support/film.h"
#include "tests/world/world.h"

#include <stdlib.h>
#include <string.h>

static const double SCALE = 0.25; // of 640 x 480

static struct world *open_world(const char *motion, const char *figure, double x)
{
    struct world *world;
    struct world_options options = world_default_options();
    options.motion = motion;
    options.threads = 2;
    options.spot.x = x;
    EXPECT_TRUE(world_figure_named(figure, &options.figure));
    EXPECT_STATUS(world_open(&world, &options), OK);
    return world;
}

static void render(const struct world *w, double time_s, bool actor, uint16_t *depth)
{
    const struct calibration c = world_calibration(SCALE);
    const struct world_shot shot = {c.color, world_sensor_pose(w), time_s, actor};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = depth}), OK);
}

enum { EMPTY = 12, ALONE = 45, BOTH = 78, GONE = 88 };

static void test_person_second_person_and_none(void **state)
{
    (void)state;
    struct world *first = open_world("exercise", "woman", -0.5), *second = open_world("still", "man", 0.6);
    const struct calibration c = world_calibration(SCALE);
    const int pixels = c.depth.width * c.depth.height;
    uint16_t *depth = malloc(sizeof *depth * (size_t)pixels), *other = malloc(sizeof *other * (size_t)pixels);
    const struct live_tracker_options options = {.calibration = &c};
    struct live_tracker *t;
    EXPECT_STATUS(live_tracker_open(&t, &options), OK);
    int alone = 0, alone_second = 0, both = 0, both_second = 0, empty = 0;
    for (int i = 0; i < GONE; i++) {
        const bool there = i >= EMPTY && i < BOTH, joined = i >= ALONE && i < BOTH;
        struct live_look look;
        render(first, i / 100.0, there, depth); // slowly: the arms stay down, apart from the other
        if (joined)
            render(second, 1 + i / 30.0, true, other);
        for (int p = 0; joined && p < pixels; p++)
            if (other[p] && (!depth[p] || other[p] < depth[p]))
                depth[p] = other[p];
        EXPECT_STATUS(live_tracker_next(t, (int64_t)i * 33333333, NULL, depth, NULL, &look), OK);
        EXPECT_TRUE(!look.judged); // there is no reference
        alone += there && !joined && look.person;
        alone_second += look.second_person && !joined;
        both += joined && look.person;
        both_second += joined && look.second_person;
        empty += !there && look.person;
    }
    print_message("person in %d of %d alone, second in %d; both: %d, second in %d of %d; empty: %d\n", alone,
                  ALONE - EMPTY, alone_second, both, both_second, BOTH - ALONE, empty);
    EXPECT_AT_LEAST(alone, ALONE - EMPTY - 5);
    EXPECT_INT(alone_second, 0);
    EXPECT_AT_LEAST(both, BOTH - ALONE - 2);
    EXPECT_AT_LEAST(both_second, 8);
    EXPECT_AT_MOST(empty, 2);
    live_tracker_close(&t);
    free(depth);
    free(other);
    world_close(&first);
    world_close(&second);
}

// What a person disoccludes of the background has their outline and was never seen before.
static void test_disoccluded_background_is_no_person(void **state)
{
    (void)state;
    enum { FRAMES = 90 };
    struct world *w = open_world("pirouette", "woman", 0);
    const struct calibration c = world_calibration(0.5);
    uint16_t *depth = malloc(sizeof *depth * lens_pixels(&c.depth));
    const struct live_tracker_options options = {.calibration = &c};
    for (int step = SANITIZED ? 3 : 1; step <= 3; step += 2) { // as a slow computer leaves frames out
        struct live_tracker *t;
        int person = 0, second = 0, count = 0;
        EXPECT_STATUS(live_tracker_open(&t, &options), OK);
        for (int i = 0; i < FRAMES; i += step, count++) {
            struct live_look look;
            const struct world_shot shot = {c.color, world_sensor_pose(w), i / 30.0, true};
            EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = depth}), OK);
            EXPECT_STATUS(world_depth_noise(&c.depth, depth, (uint64_t)i + 1, depth), OK);
            EXPECT_STATUS(live_tracker_next(t, (int64_t)i * 33333333, NULL, depth, NULL, &look), OK);
            person += look.person;
            second += look.second_person;
        }
        print_message("every frame of %d: a person in %d of %d, a second one in %d\n", step, person, count, second);
        EXPECT_INT(person, count);
        EXPECT_INT(second, 0);
        live_tracker_close(&t);
    }
    world_close(&w);
    free(depth);
}

// Sensors lose a colour image now and then: the person stays where they are in the place.
static void test_a_lost_color_image_moves_no_person(void **state)
{
    (void)state;
    const double scale = 0.75; // the smallest at which the sensor is located by the world's tags
    struct world *w = open_world("exercise", "woman", 0);
    struct place place = film_true_place(w, scale);
    const struct calibration c = world_calibration(scale);
    const size_t pixels = lens_pixels(&c.color);
    uint16_t *depth = malloc(sizeof *depth * pixels);
    uint8_t *color = malloc(3 * pixels);
    const struct live_tracker_options options = {.calibration = &c, .place = &place};
    struct live_tracker *t;
    struct vec3 before = {0};
    double jump_m = 0;
    int located = 0;
    const struct world_shot shot = {c.color, world_sensor_pose(w), 0, true};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = depth, .color = color}), OK);
    EXPECT_STATUS(live_tracker_open(&t, &options), OK);
    for (int i = 0; i < 12; i++) {
        struct live_look look;
        const bool lost = i == 5 || i >= 8;
        live_tracker_hold_world(t, i >= 7); // an attempt, too
        EXPECT_STATUS(live_tracker_next(t, (int64_t)i * 33333333, lost ? NULL : color, depth, NULL, &look), OK);
        EXPECT_TRUE(look.person);
        located += look.in_place;
        if (i)
            jump_m = fmax(jump_m, v3_distance(before, look.in_world.joint[JOINT_WAIST]));
        before = look.in_world.joint[JOINT_WAIST];
    }
    print_message("located in %d of 12 frames, the waist moved by at most %.3f m from one to the next\n", located,
                  jump_m);
    EXPECT_INT(located, 12);
    EXPECT_AT_MOST(jump_m, 0.08);
    live_tracker_close(&t);
    place_free(&place);
    world_close(&w);
    free(depth);
    free(color);
}

// A sensor that is located only while an attempt is made: the person neither turns nor moves before its end; what is
// kept of the attempt has the sensor's pose.
static void test_an_attempt_stays_in_its_world(void **state)
{
    (void)state;
    enum { BEGINS = 4, SEEN = 8, ENDS = 12 };
    const double scale = 0.75;
    struct world *w = open_world("exercise", "woman", 0);
    struct place place = film_true_place(w, scale);
    const struct calibration c = world_calibration(scale);
    uint16_t *depth = malloc(sizeof *depth * lens_pixels(&c.depth));
    uint8_t *color = malloc(3 * lens_pixels(&c.color));
    const struct live_tracker_options options = {.calibration = &c, .place = &place};
    struct live_tracker *t;
    struct vec3 before = {0};
    const struct world_shot shot = {c.color, world_sensor_pose(w), 0, true};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.depth = depth, .color = color}), OK);
    EXPECT_STATUS(live_tracker_open(&t, &options), OK);
    for (int i = 0; i < ENDS + 2; i++) {
        struct live_look look;
        live_tracker_hold_world(t, i >= BEGINS && i < ENDS);
        EXPECT_STATUS(live_tracker_next(t, (int64_t)i * 33333333, i < SEEN ? NULL : color, depth, NULL, &look), OK);
        EXPECT_TRUE(look.in_place == (i >= ENDS) && look.located == (i >= SEEN));
        if (i > BEGINS && i < ENDS)
            EXPECT_AT_MOST(v3_distance(before, look.in_world.joint[JOINT_WAIST]), 0.08);
        if (look.located)
            EXPECT_AT_MOST(v3_distance(look.place_from_camera.translation, world_sensor_pose(w).translation), 0.02);
        before = look.in_world.joint[JOINT_WAIST];
    }
    live_tracker_close(&t);
    place_free(&place);
    world_close(&w);
    free(depth);
    free(color);
}

// What cannot work is an error with a sentence, not a crash.
static void test_a_sensor_without_depth_is_refused(void **state)
{
    (void)state;
    struct calibration c = world_calibration(SCALE);
    struct live_tracker *t;
    c.depth.width = 0;
    const struct live_tracker_options options = {.calibration = &c};
    EXPECT_STATUS(live_tracker_open(&t, &options), ERR_INPUT);
    EXPECT_TRUE(!t);
}

// ---------------------------------------------------------------- the ghost

static struct skeleton world_skeleton(const struct exercise *e, double time_s, struct rng *rng)
{
    struct skeleton s = exercise_at(e, time_s, rng);
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3(s.joint[j].x, s.joint[j].z, -s.joint[j].y);
    return s;
}

static struct movement_frame frame_of(const struct exercise *e, double time_s, struct rng *rng)
{
    const struct skeleton s = exercise_at(e, time_s, rng);
    float sigma_m[JOINT_COUNT];
    bool known[JOINT_COUNT];
    struct movement_frame f;
    for (int j = 0; j < JOINT_COUNT; j++)
        sigma_m[j] = 0.01f, known[j] = true;
    movement_frame_from_joints(s.joint, sigma_m, known, &f);
    return f;
}

// A person's own pose on the person's own bones is the person; another's pose has the directions of that pose.
static void test_ghost_has_the_pose_on_the_persons_bones(void **state)
{
    (void)state;
    struct rng rng = {7};
    struct exercise e = exercise_default();
    struct skeleton ghost;
    const struct skeleton person = world_skeleton(&e, 0.4, &rng);
    const struct movement_frame own = frame_of(&e, 0.4, &rng), next = frame_of(&e, 1.4, &rng);
    EXPECT_TRUE(pose_figure_make(&person, &own, &own, &ghost));
    double worst_m = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        worst_m = fmax(worst_m, v3_distance(ghost.joint[j], person.joint[j]));
    EXPECT_AT_MOST(worst_m, 0.06); // the shoulders' middle is put on the trunk's line
    EXPECT_TRUE(pose_figure_make(&person, &own, &next, &ghost));
    const struct skeleton then = world_skeleton(&e, 1.4, &rng);
    for (int p = 0; p < PART_COUNT; p++) {
        const struct vec3 a = v3_unit(v3_sub(ghost.joint[part_ends[p].to], ghost.joint[part_ends[p].from])),
                          b = v3_unit(v3_sub(then.joint[part_ends[p].to], then.joint[part_ends[p].from]));
        EXPECT_AT_MOST(v3_distance(a, b), 0.02);
    }
    struct skeleton unknown = person;
    unknown.confidence[JOINT_LEFT_HIP] = 0;
    EXPECT_TRUE(!pose_figure_make(&unknown, &own, &next, &ghost));
}

// ---------------------------------------------------------------- what hides the actor

static void test_only_what_is_nearer_hides_the_actor(void **state)
{
    (void)state;
    struct rng rng = {7};
    struct exercise e = exercise_default();
    struct calibration c = world_calibration(SCALE);
    c.registered = true;
    c.depth = c.color;
    c.color_from_depth = POSE_IDENTITY;
    const int width = c.color.width, pixels = width * c.color.height;
    uint8_t *rgb = malloc(3 * (size_t)pixels), *rgba = malloc(4 * (size_t)pixels);
    uint16_t *depth = malloc(sizeof *depth * (size_t)pixels);
    float *scratch = malloc(2 * sizeof *scratch * (size_t)pixels);
    struct body body = {0};
    const struct skeleton actor = exercise_at(&e, 0, &rng); // 3 m away
    const struct live_occlusion how = {&c, rgb, depth, &actor, &body, scratch};
    memset(rgb, 200, 3 * (size_t)pixels);
    for (int p = 0; p < PART_COUNT; p++)
        body.radius_rate[p] = 0.2;
    for (int p = 0; p < pixels; p++)
        depth[p] = 4000; // the wall behind
    EXPECT_INT(live_occlusion_make(&how, rgba), 0);
    for (int p = 0; p < pixels; p++)
        depth[p] = p % width < width / 2 ? 1500 : 0; // something before the left half
    const int hidden = live_occlusion_make(&how, rgba);
    const struct pixel chest = lens_project(&c.color, actor.joint[JOINT_TORSO]);
    EXPECT_AT_LEAST(hidden, 200);
    const uint8_t *left = rgba + 4 * ((int)chest.y * width + width / 2 - 2), *right = left + 4 * 4;
    EXPECT_INT(left[3], 255);
    EXPECT_INT(left[0], 200);
    EXPECT_INT(right[3], 0);
    EXPECT_INT(rgba[3], 0); // beside the actor nothing is drawn
    free(rgb), free(rgba), free(depth), free(scratch);
}

// ---------------------------------------------------------------- the judge's window

static void test_window_keeps_the_judge_near(void **state)
{
    (void)state;
    struct rng rng = {11};
    struct exercise e = exercise_default(); // a cycle of 3 s, twice
    struct joint_samples samples = {0};
    struct movement m = {0};
    struct live_judge *judge;
    struct part_difference parts[PART_COUNT];
    int32_t at;
    exercise_samples(&e, &rng, &samples);
    EXPECT_STATUS(movement_from_samples(&samples, &m), OK);
    EXPECT_STATUS(live_judge_open(&judge, &m), OK);
    for (int32_t f = 90; f < 170; f++) { // the second cycle; without a window the first is as good
        live_judge_set_window(judge, f - 20, f + 10);
        live_judge_frame(judge, &m.frames[f], &at, parts);
        EXPECT_TRUE(at >= f - 20 && at < f + 10);
        if (f > 100)
            EXPECT_NEAR(at, f, 4);
    }
    EXPECT_NEAR(live_judge_away(judge, &m.frames[120], 120), 0, 1e-3);
    EXPECT_AT_LEAST(live_judge_away(judge, &m.frames[120], 140), 0.1);
    live_judge_set_window(judge, 5, 25); // elsewhere altogether
    live_judge_frame(judge, &m.frames[12], &at, parts);
    EXPECT_TRUE(at >= 5 && at < 25);
    live_judge_set_window(judge, 1000, 2000); // beyond the end: the last frame remains
    live_judge_frame(judge, &m.frames[12], &at, parts);
    EXPECT_INT(at, m.count - 1);
    live_judge_close(&judge);
    movement_free(&m);
    joint_samples_free(&samples);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_person_second_person_and_none),
        cmocka_unit_test(test_disoccluded_background_is_no_person),
        cmocka_unit_test(test_a_lost_color_image_moves_no_person),
        cmocka_unit_test(test_an_attempt_stays_in_its_world),
        cmocka_unit_test(test_a_sensor_without_depth_is_refused),
        cmocka_unit_test(test_ghost_has_the_pose_on_the_persons_bones),
        cmocka_unit_test(test_only_what_is_nearer_hides_the_actor),
        cmocka_unit_test(test_window_keeps_the_judge_near),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
