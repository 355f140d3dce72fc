// The coach on films of the small world: good films raise nothing, each fault that is put in is named within a second,
// the gesture is found and found only where it is made, who does what the coach says is soon seen from all sides.
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/coaching/coach.h"
#include "capture/coaching/raised_hand.h"
#include "tests/world/world.h"

#include <stdio.h>

struct stage {
    struct world *world;
    struct calibration calibration;
    size_t pixels;
    uint16_t *depth;
    uint8_t *mask, *color;
    struct skeleton skeleton;
};

static void stage_open(struct stage *s, const char *figure, const char *motion, double turned)
{
    struct world_options o = world_default_options();
    o.motion = motion;
    o.plain = o.unshadowed = true;
    o.spot.turned = turned;
    EXPECT_TRUE(world_figure_named(figure, &o.figure));
    EXPECT_STATUS(world_open(&s->world, &o), OK);
    s->calibration = world_calibration(0.25);
    s->pixels = (size_t)s->calibration.depth.width * (size_t)s->calibration.depth.height;
    s->depth = malloc(s->pixels * sizeof *s->depth);
    s->mask = malloc(s->pixels);
    s->color = malloc(3 * s->pixels);
}

static void stage_close(struct stage *s)
{
    free(s->depth);
    free(s->mask);
    free(s->color);
    world_close(&s->world);
}

// color: NULL, or the stage's; it takes most of the time.
static void shoot_as(struct stage *s, const struct world_shot *shot, uint64_t seed, uint8_t *color)
{
    const struct lens *l = &s->calibration.depth;
    EXPECT_STATUS(
        world_render(s->world, shot, &(struct world_image){.depth = s->depth, .mask = s->mask, .color = color}), OK);
    EXPECT_STATUS(world_depth_noise(l, s->depth, seed, s->depth), OK);
    s->skeleton = world_joints_in_camera(s->world, shot->time_s, shot->world_from_camera);
}

static void shoot(struct stage *s, struct pose camera, double time_s, uint64_t seed, bool actor)
{
    const struct world_shot shot = {s->calibration.depth, camera, time_s, actor};
    shoot_as(s, &shot, seed, s->color);
}

static struct coach_frame frame_of(const struct stage *s, int i)
{
    return (struct coach_frame){.time_ns = (int64_t)i * 33333333 + 1,
                                .color = s->color,
                                .depth = s->depth,
                                .mask = s->mask,
                                .skeleton = &s->skeleton};
}

static void print_raised(const struct coach *c)
{
    for (int f = 0; f < FAULT_COUNT; f++)
        if (c->fault[f].first_s >= 0)
            printf("    %s: at %.2f s, %.2f s in all\n", coach_fault_text((enum coach_fault)f), c->fault[f].first_s,
                   c->fault[f].total_s);
}

static int faults_raised(const struct coach *c)
{
    int count = 0;
    for (int f = 0; f < FAULT_COUNT; f++)
        count += c->fault[f].first_s >= 0;
    return count;
}

static void test_good_films_raise_nothing(void **state)
{
    (void)state;
    static const char *const motions[] = {"still", "pirouette", "kata", "bend"};
    static const char *const figures[] = {"man", "woman", "child", "coat"};
    static struct coach coach;
    for (size_t m = SANITIZED; m < COUNT_OF(motions); m += SANITIZED ? 2 : 1) {
        struct stage s;
        double ms = 0;
        stage_open(&s, figures[m], motions[m], 0);
        const int frames = (int)(world_seconds(s.world) * 30);
        coach_start(&coach, &s.calibration, PURPOSE_BOTH);
        for (int i = 0; i < frames; i++) {
            shoot(&s, world_sensor_pose(s.world), i / 30.0, (uint64_t)i + 1, true);
            const struct coach_frame frame = frame_of(&s, i);
            const int64_t begun = clock_cpu_ns();
            coach_next(&coach, &frame);
            ms += (double)(clock_cpu_ns() - begun) * 1e-6;
        }
        struct take_verdict verdict;
        coach_verdict(&coach, &verdict);
        printf("%s %s: %d frames, %.2f ms each, dial %.0f %%, '%s', %s\n", figures[m], motions[m], frames, ms / frames,
               coach.share * 100, coach_text(&coach), verdict_headline(&verdict));
        print_raised(&coach);
        EXPECT_INT(faults_raised(&coach), 0);
        EXPECT_TRUE(verdict_is_good_for(&verdict, USE_WATCH) == (m == 1)); // the others never show their back
        EXPECT_TRUE(verdict_is_good_for(&verdict, USE_COMPARE));
        stage_close(&s);
    }
}

// What is put into a film from its second 1 on, and the fault that must be named by second 2.
struct injected {
    const char *what;
    enum coach_fault fault;
};

static void inject(struct stage *s, const struct injected *in, int i)
{
    const struct lens *l = &s->calibration.depth;
    struct pose camera = world_sensor_pose(s->world);
    const bool now = i >= 30;
    if (now && in->fault == FAULT_SENSOR_PUSHED) // two degrees down and to the side
        camera.rotation = quat_multiply(camera.rotation, quat_from_rotation_vector(v3(0.04, 0.04, 0)));
    if (now && in->fault == FAULT_FEET_OUTSIDE)
        camera.rotation = quat_multiply(camera.rotation, quat_from_rotation_vector(v3(0.3, 0, 0)));
    if (now && in->fault == FAULT_TOO_NEAR)
        camera = pose_multiply(camera, (struct pose){{0, 0, 0, 1}, v3(0, 0, 2.3)});
    const bool frozen = now && in->fault == FAULT_FROZEN;
    shoot(s, camera, frozen ? 1 : i / 30.0, frozen ? 1 : (uint64_t)i + 1, !(now && in->fault == FAULT_NO_PERSON));
    if (now && in->fault == FAULT_DARK)
        for (size_t k = 0; k < 3 * s->pixels; k++)
            s->color[k] /= 6;
    if (now && in->fault == FAULT_NO_DEPTH)
        memset(s->depth, 0, s->pixels * sizeof *s->depth);
    if (now && in->fault == FAULT_SECOND_PERSON) { // half a metre wide, from the head down, 1.8 m away
        const int left = l->width / 12, right = left + (int)(0.5 * l->fx / 1.8);
        for (int y = l->height / 4; y < l->height; y++)
            for (int x = left; x < right; x++)
                s->depth[y * l->width + x] = s->mask[y * l->width + x] ? s->depth[y * l->width + x] : 1800;
    }
}

static bool says(const struct take_verdict *v, const char *words)
{
    bool any = false;
    for (int i = 0; i < v->count; i++)
        any |= !strncmp(v->line[i].text, words, strlen(words));
    return any;
}

static void test_faults_are_named_within_a_second(void **state)
{
    (void)state;
    static const struct injected cases[] = {
        {"pushed", FAULT_SENSOR_PUSHED}, {"feet", FAULT_FEET_OUTSIDE},   {"dark", FAULT_DARK},
        {"no colour", FAULT_NO_COLOR},   {"no depth", FAULT_NO_DEPTH},   {"second", FAULT_SECOND_PERSON},
        {"frozen", FAULT_FROZEN},        {"no person", FAULT_NO_PERSON}, {"slow", FAULT_SLOW},
        {"near", FAULT_TOO_NEAR},
    };
    static struct coach coach, seldom; // which sees the images of a third of the frames, colour of a ninth
    for (size_t k = 0; k < COUNT_OF(cases); k++) {
        struct stage s;
        stage_open(&s, "man", "still", 0);
        coach_start(&coach, &s.calibration, PURPOSE_BOTH);
        coach_start(&seldom, &s.calibration, PURPOSE_BOTH);
        for (int i = 0; i < 60; i++) {
            inject(&s, &cases[k], i);
            struct coach_frame frame = frame_of(&s, i);
            if (i >= 30 && cases[k].fault == FAULT_NO_PERSON)
                frame.skeleton = NULL, frame.mask = NULL;
            if (i >= 30 && cases[k].fault == FAULT_NO_COLOR)
                frame.color = NULL;
            if (i >= 30 && cases[k].fault == FAULT_SLOW)
                frame.time_ns += (int64_t)(i - 30) * 33333333; // half as fast
            coach_next(&coach, &frame);
            frame.unread = i % 3 ? UNREAD_ALL : i % 9 ? UNREAD_COLOR : UNREAD_NONE;
            if (i % 3)
                frame.depth = NULL, frame.mask = NULL;
            if (i % 9)
                frame.color = NULL;
            coach_next(&seldom, &frame);
            if (i == 29 && faults_raised(&coach) + faults_raised(&seldom)) {
                print_raised(&coach);
                print_raised(&seldom);
                fail_test();
            }
        }
        printf("%s: raised at %.2f s, with few images at %.2f s, '%s'\n", cases[k].what,
               coach.fault[cases[k].fault].first_s, seldom.fault[cases[k].fault].first_s, coach_text(&coach));
        EXPECT_AT_LEAST(seldom.fault[cases[k].fault].first_s, 0.9);
        EXPECT_NEAR(seldom.fault[cases[k].fault].first_s, coach.fault[cases[k].fault].first_s, 0.31); // s: nine frames
        EXPECT_INT(seldom.coverage.frames, coach.coverage.frames);
        EXPECT_NEAR(coach_grade(&seldom), coach_grade(&coach), 0.01);
        struct take_verdict verdict;
        coach_verdict(&coach, &verdict);
        EXPECT_TRUE(!verdict_is_good_for(&verdict, USE_WATCH));
        if (cases[k].fault == FAULT_FEET_OUTSIDE)
            EXPECT_TRUE(says(&verdict, "feet missing from 1.0 s"));
        if (cases[k].fault == FAULT_SENSOR_PUSHED)
            EXPECT_TRUE(says(&verdict, "the sensor was pushed at 1."));
        EXPECT_AT_LEAST(coach.fault[cases[k].fault].first_s, 0.9);
        EXPECT_AT_MOST(coach.fault[cases[k].fault].first_s, 2);
        stage_close(&s);
    }
}

// Share of the surface that a turn would still show: it is not seen, faces sideways, and the camera has not been on
// that side (within 45 degrees) three times.
static double turn_share(const struct coverage *coverage)
{
    double all = 0, turn = 0;
    for (int p = 0; p < SURFACE_PARTS; p++)
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int k = 0; k < SURFACE_ANGLES; k++) {
                const double area = coverage_cell_area(coverage, p, h, k);
                const struct vec3 rest = surface_rest_direction(p, h, k);
                const int sector = (int)lround(atan2(rest.x, rest.y) / (2 * 3.14159265358979) * SURFACE_ANGLES);
                uint32_t faced = 0;
                for (int near = -2; near <= 2; near++)
                    faced += coverage->facing[(sector + near + 2 * SURFACE_ANGLES) % SURFACE_ANGLES];
                all += area;
                if (area > 0 && !coverage_cell_seen(coverage, p, h, k) && hypot(rest.x, rest.y) > 0.7 && faced < 3)
                    turn += area;
            }
    return all > 0 ? turn / all : 0;
}

// A person who does what is said: turning on the spot at a quarter of a turn a second, which is the camera turned about
// the person in the world's place.
static void test_the_obedient_are_seen(void **state)
{
    (void)state;
    static struct coach coach;
    double slowest_s = 0;
    for (int start = 0; start < 10; start += SANITIZED ? 10 : 1) {
        struct stage s;
        stage_open(&s, start % 2 ? "man" : "woman", "still", 0);
        coach_start(&coach, &s.calibration, PURPOSE_BOTH);
        const struct skeleton in_world = world_joints(s.world, 0);
        const struct vec3 about = v3(in_world.joint[JOINT_WAIST].x, in_world.joint[JOINT_WAIST].y, 0);
        double turned = start * 0.628, done_s = -1;
        int asked_in_vain = 0;
        for (int i = 0; i < 30 * 16 && done_s < 0; i += 3) { // at 10 Hz, to save time
            const struct quat turn = quat_from_rotation_vector(v3(0, 0, -turned));
            const struct pose orbit = {turn, v3_sub(about, quat_rotate(turn, about))};
            const struct world_shot shot = {s.calibration.depth, pose_multiply(orbit, world_sensor_pose(s.world)), 0,
                                            true};
            shoot_as(&s, &shot, (uint64_t)i + 1, NULL);
            struct coach_frame frame = frame_of(&s, i);
            frame.color = NULL;
            // The room turns with the camera: only the actor is shown, as before a far wall.
            for (size_t k = 0; k < s.pixels; k++)
                s.depth[k] = s.mask[k] ? s.depth[k] : (uint16_t)(6000 + (k * 7 + (size_t)i) % 13);
            coach_next(&coach, &frame);
            const bool left = coach.advice == ADVICE_TURN_LEFT, right = coach.advice == ADVICE_TURN_RIGHT;
            turned += left ? 0.157 : right ? -0.157 : 0;
            if (!left && !right)
                done_s = i / 30.0;
            asked_in_vain += coach.coverage.frames % 3 == 1 && (left || right) && turn_share(&coach.coverage) < 0.02;
        }
        printf("start %d: dial %.0f %% after %.1f s, then '%s'\n", start, coverage_share(&coach.coverage) * 100, done_s,
               coach_text(&coach));
        EXPECT_TRUE(done_s >= 0);
        EXPECT_INT(asked_in_vain, 0);
        EXPECT_AT_LEAST(coverage_share(&coach.coverage), 0.9);
        slowest_s = fmax(slowest_s, done_s);
        stage_close(&s);
    }
    EXPECT_AT_MOST(slowest_s, 12);
}

// Soles are asked for where they were turned to the side and not seen, and not of one who stands.
static void test_soles_are_asked_for_where_they_show(void **state)
{
    (void)state;
    static struct coverage c;
    struct stage s;
    stage_open(&s, "man", "still", 0);
    shoot(&s, world_sensor_pose(s.world), 0, 1, true);
    coverage_reset(&c);
    const struct coverage_view view = {&s.calibration, s.depth, s.mask, &s.skeleton, 0};
    EXPECT_TRUE(coverage_add(&c, &view));
    for (int p = 0; p < SURFACE_PARTS; p++)
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int k = 0; k < SURFACE_ANGLES; k++)
                c.cell[p][h][k].quality = p >= SURFACE_LEFT_FOOT && cos(surface_angle(k)) < -0.5 ? 0 : 1;
    struct skeleton kneeling = s.skeleton;
    for (int left = 0; left < 2; left++) { // the shins lie behind the knees
        const enum joint knee = left ? JOINT_LEFT_KNEE : JOINT_RIGHT_KNEE,
                         foot = left ? JOINT_LEFT_FOOT : JOINT_RIGHT_FOOT;
        kneeling.joint[foot] = v3_add(kneeling.joint[knee], v3(0, 0.05, 0.4));
    }
    struct advisor standing = {.last = ADVICE_ENOUGH}, kneels = standing;
    enum pose_advice stood = ADVICE_ENOUGH, knelt = ADVICE_ENOUGH;
    for (int i = 0; i < 15; i++) {
        stood = advisor_next(&standing, &c, &s.skeleton, (int64_t)i * 100000000);
        knelt = advisor_next(&kneels, &c, &kneeling, (int64_t)i * 100000000);
    }
    EXPECT_INT(stood, ADVICE_ENOUGH);
    EXPECT_INT(knelt, ADVICE_SHOW_SOLES);
    for (int i = 15; i < 110; i++) // not taken: not asked for for ever
        knelt = advisor_next(&kneels, &c, &kneeling, (int64_t)i * 100000000);
    EXPECT_INT(knelt, ADVICE_ENOUGH);
    kneels.soles_refused = false;
    for (int k = 0; k < SURFACE_ANGLES; k++)
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            c.cell[SURFACE_LEFT_FOOT][h][k].quality = c.cell[SURFACE_RIGHT_FOOT][h][k].quality = 1;
    EXPECT_INT(advisor_next(&kneels, &c, &kneeling, 0), ADVICE_ENOUGH);
    stage_close(&s);
}

// ---------------------------------------------------------------- the raised hand

// Ten minutes of kata and other movements from two sides: never. The joints are the world's own, at 30 Hz.
static void test_no_gesture_by_accident(void **state)
{
    (void)state;
    static const char *const motions[] = {"kata", "pirouette", "bend", "walk", "hide", "visit"};
    double seconds = 0;
    for (size_t m = 0; m < COUNT_OF(motions); m++)
        for (int turn = 0; turn < 3; turn += SANITIZED ? 3 : 1) {
            struct stage s;
            stage_open(&s, "woman", motions[m], turn * 0.5 - 0.5);
            for (int round = 0; round < 5; round++) { // slower and faster
                struct raised_hand hand = {0};
                const double speed = 0.6 + 0.3 * round, length = world_seconds(s.world);
                for (int i = 0; i / 30.0 * speed < length; i++) {
                    const struct skeleton joints =
                        world_joints_in_camera(s.world, i / 30.0 * speed, world_sensor_pose(s.world));
                    EXPECT_TRUE(!raised_hand_next(&hand, (int64_t)i * 33333333 + 1, &joints));
                    seconds += 1 / 30.0;
                }
            }
            stage_close(&s);
        }
    printf("%.1f minutes of movement without a gesture\n", seconds / 60);
    EXPECT_AT_LEAST(seconds, SANITIZED ? 200 : 600);
}

static void test_the_gesture_is_found(void **state)
{
    (void)state;
    struct stage s;
    stage_open(&s, "man", "still", 0);
    const struct skeleton rest = world_joints_in_camera(s.world, 0, world_sensor_pose(s.world));
    for (int side = 0; side < 2; side++) {
        const enum joint shoulder = side ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER,
                         elbow = side ? JOINT_LEFT_ELBOW : JOINT_RIGHT_ELBOW,
                         hand = side ? JOINT_LEFT_HAND : JOINT_RIGHT_HAND;
        struct raised_hand gesture = {0};
        int found = 0;
        double found_s = -1;
        for (int i = 0; i < 90; i++) {
            struct skeleton now = rest;
            const double up = fmin(i / 15.0, 1); // raised within half a second, then held not quite still
            const double angle = (1 - up) * -1.4 + up * 1.35, shake = 0.006 * sin(i * 1.7), out = side ? 1 : -1;
            const struct vec3 along = v3(out * cos(angle), -sin(angle), -0.1);
            now.joint[elbow] = v3_add(rest.joint[shoulder], v3_scale(along, 0.28));
            now.joint[hand] = v3_add(now.joint[elbow], v3(out * 0.03 + shake, up > 0.9 ? -0.26 : 0.2, -0.02));
            if (raised_hand_next(&gesture, (int64_t)i * 33333333 + 1, &now)) {
                found++;
                found_s = i / 30.0;
            }
        }
        printf("hand up at 0.50 s, found at %.2f s\n", found_s);
        EXPECT_INT(found, 1);
        EXPECT_AT_LEAST(found_s, 0.5);
        EXPECT_AT_MOST(found_s, 1.0);
    }
    stage_close(&s);
}

// At the size of a sensor's own pictures.
static void test_cost(void **state)
{
    (void)state;
    static struct coach coach;
    struct stage s;
    stage_open(&s, "man", "still", 0);
    stage_close(&s);
    s.calibration = world_calibration(1);
    s.pixels = (size_t)s.calibration.depth.width * (size_t)s.calibration.depth.height;
    s.depth = malloc(s.pixels * sizeof *s.depth);
    s.mask = malloc(s.pixels);
    s.color = malloc(3 * s.pixels);
    struct world_options o = world_default_options();
    o.motion = "still";
    o.plain = true;
    EXPECT_STATUS(world_open(&s.world, &o), OK);
    shoot(&s, world_sensor_pose(s.world), 0, 1, true);
    coach_start(&coach, &s.calibration, PURPOSE_BOTH);
    const int64_t begun = clock_cpu_ns();
    for (int i = 0; i < 90; i++) {
        const struct coach_frame frame = frame_of(&s, i);
        coach_next(&coach, &frame);
    }
    printf("640 x 480: %.2f ms a frame\n", (double)(clock_cpu_ns() - begun) * 1e-6 / 90);
    stage_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_soles_are_asked_for_where_they_show),
        cmocka_unit_test(test_good_films_raise_nothing),
        cmocka_unit_test(test_faults_are_named_within_a_second),
        cmocka_unit_test(test_the_obedient_are_seen),
        cmocka_unit_test(test_no_gesture_by_accident),
        cmocka_unit_test(test_the_gesture_is_found),
        cmocka_unit_test(test_cost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
