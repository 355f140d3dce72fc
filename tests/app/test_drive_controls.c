// A driven robot moves only while something is held: keys, fingers, mouse and pad as a window gives them, and the
// simulated robot's own way and speed. Every kind of letting go stops it.
#include "tests/support/test.h"

#include "app/drive/drive_controls.h"

#include <string.h>

static const int64_t TICK = 50000000;
static const double WIDTH = 1280, HEIGHT = 800;

struct stage {
    struct drive_session session;
    struct drive_controls controls;
    enum drive_part tapped;
    int64_t now_ns;
    double speed, turn_rate; // of the robot itself, over the last tick
};

static struct stage s;

static int open_stage(void **state)
{
    (void)state;
    const struct drive_options options = drive_default_options();
    s = (struct stage){.tapped = PART_NOTHING};
    EXPECT_STATUS(drive_session_open(&s.session, "sim:3", &options), OK);
    drive_controls_place(&s.controls, WIDTH, HEIGHT);
    return 0;
}

static int close_stage(void **state)
{
    (void)state;
    drive_session_close(&s.session);
    return 0;
}

static void give(struct window_event e)
{
    enum drive_part tapped;
    drive_controls_event(&s.controls, &e, s.now_ns, &tapped);
    if (tapped)
        s.tapped = tapped;
}

static void key(enum window_event_kind kind, int which) { give((struct window_event){.kind = kind, .key = which}); }

static void finger(enum window_event_kind kind, int64_t pointer, double x, double y)
{
    give((struct window_event){.kind = kind, .pointer = pointer, .x = x, .y = y});
}

static struct ui_point middle_of(enum drive_part part)
{
    const struct ui_box b = s.controls.box[part];
    return (struct ui_point){b.x + b.w / 2, b.y + b.h / 2};
}

// On the stick, pushed ahead.
static void push(enum window_event_kind kind, int64_t pointer)
{
    const struct ui_point m = middle_of(PART_STICK);
    finger(kind, pointer, m.x, m.y - 0.3 * s.controls.box[PART_STICK].h);
}

static void press(enum window_event_kind kind, int64_t pointer, enum drive_part part)
{
    const struct ui_point m = middle_of(part);
    finger(kind, pointer, m.x, m.y);
}

static void axis(enum pad_axis which, double amount)
{
    give((struct window_event){.kind = WINDOW_PAD_AXIS, .axis = which, .amount = amount});
}

// The program runs on for so many ticks, as the window's loop has it.
static void run(int ticks)
{
    for (int i = 0; i < ticks; i++) {
        const struct pose before = s.session.rover.world_from_body;
        s.now_ns += TICK;
        const struct drive_readings readings = drive_session_readings(&s.session);
        drive_controls_tick(&s.controls, &readings, s.now_ns);
        const struct drive_command c = drive_controls_command(&s.controls);
        EXPECT_STATUS(drive_session_step(&s.session, s.now_ns, &c), OK);
        const struct pose after = s.session.rover.world_from_body;
        s.speed = v3_distance(before.translation, after.translation) / 0.05;
        s.turn_rate = pose_angle(before, after) / 0.05;
    }
}

static void expect_moves(void)
{
    run(4);
    EXPECT_AT_LEAST(s.speed, 0.05);
}

// A command takes a tick to be carried out.
static void expect_stands(void)
{
    run(2);
    EXPECT_NEAR(s.speed, 0, 0);
    EXPECT_NEAR(s.turn_rate, 0, 0);
    run(20);
    EXPECT_NEAR(s.speed, 0, 0);
    EXPECT_NEAR(s.turn_rate, 0, 0);
}

static void test_a_key_drives_while_it_is_down(void **state)
{
    (void)state;
    run(2);
    EXPECT_NEAR(s.speed, 0, 0);
    key(WINDOW_KEY, WINDOW_KEY_UP);
    run(3);
    const double first = s.speed;
    EXPECT_AT_LEAST(first, 0.05);
    for (int i = 0; i < 30; i++) { // the key repeats
        give((struct window_event){.kind = WINDOW_KEY, .key = WINDOW_KEY_UP, .repeat = true});
        run(1);
    }
    EXPECT_NEAR(s.speed, first, 1e-9);
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_UP);
    expect_stands();
    give((struct window_event){.kind = WINDOW_KEY, .key = WINDOW_KEY_UP, .repeat = true}); // one more was under way
    expect_stands();
}

static void test_of_two_keys_one_is_let_go(void **state)
{
    (void)state;
    key(WINDOW_KEY, WINDOW_KEY_UP);
    key(WINDOW_KEY, WINDOW_KEY_LEFT);
    run(4);
    EXPECT_AT_LEAST(s.speed, 0.05);
    EXPECT_AT_LEAST(s.turn_rate, 0.1);
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_LEFT);
    run(2);
    EXPECT_AT_LEAST(s.speed, 0.05);
    EXPECT_NEAR(s.turn_rate, 0, 1e-9);
    key(WINDOW_KEY, WINDOW_KEY_DOWN); // against each other
    expect_stands();
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_DOWN);
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_UP);
    expect_stands();
}

// What ends it while the key stays down; the key has to be pressed again.
static void test_what_stops_a_held_key(void **state)
{
    (void)state;
    const struct window_event ends[] = {
        {.kind = WINDOW_UNFOCUSED},
        {.kind = WINDOW_HIDDEN},
        {.kind = WINDOW_PAD_GONE},
        {.kind = WINDOW_KEY, .key = WINDOW_KEY_SPACE},
        {.kind = WINDOW_KEY, .key = WINDOW_KEY_ESCAPE},
        {.kind = WINDOW_KEY, .key = WINDOW_KEY_BACK},
        {.kind = WINDOW_PAD_BUTTON, .button = PAD_A},
        {.kind = WINDOW_PAD_BUTTON, .button = PAD_B},
        {.kind = WINDOW_POINTER_DOWN, .pointer = 3, .x = middle_of(PART_STOP).x, .y = middle_of(PART_STOP).y},
        {.kind = WINDOW_POINTER_DOWN, .pointer = -1, .x = middle_of(PART_STOP).x, .y = middle_of(PART_STOP).y},
    };
    for (size_t i = 0; i < COUNT_OF(ends); i++) {
        print_message("end %d\n", (int)i);
        key(WINDOW_KEY, i % 2 ? WINDOW_KEY_DOWN : WINDOW_KEY_UP); // to and fro, so that no wall is reached
        expect_moves();
        give(ends[i]);
        expect_stands();
        give((struct window_event){.kind = WINDOW_KEY, .key = i % 2 ? WINDOW_KEY_DOWN : WINDOW_KEY_UP, .repeat = true});
        expect_stands();
        give((struct window_event){.kind = WINDOW_POINTER_UP, .pointer = ends[i].pointer});
        expect_stands(); // nothing starts because STOP is let go
        key(WINDOW_KEY_RELEASED, i % 2 ? WINDOW_KEY_DOWN : WINDOW_KEY_UP);
        EXPECT_INT(s.tapped, PART_NOTHING); // Escape and Back stopped, and did not leave
    }
    key(WINDOW_KEY, WINDOW_KEY_ESCAPE); // nothing is driven: it leaves
    EXPECT_INT(s.tapped, PART_LEAVE);
}

// A key that is down when the keyboard comes back is told as pressed.
static void test_the_keyboard_comes_back_with_a_key_down(void **state)
{
    (void)state;
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
    give((struct window_event){.kind = WINDOW_UNFOCUSED});
    expect_stands();
    give((struct window_event){.kind = WINDOW_FOCUSED});
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_stands();
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_UP);
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
}

static void test_the_stick_drives_while_a_finger_is_on_it(void **state)
{
    (void)state;
    const struct ui_point m = middle_of(PART_STICK);
    finger(WINDOW_POINTER_DOWN, 1, m.x, m.y); // in its middle
    expect_stands();
    push(WINDOW_POINTER_MOVE, 1);
    expect_moves();
    const double half = s.speed;
    finger(WINDOW_POINTER_MOVE, 1, m.x, m.y - 900); // beyond its edge, and the screen's
    run(2);
    EXPECT_AT_LEAST(s.speed, half);
    EXPECT_AT_MOST(s.speed, DRIVE_FASTEST_M_S + 1e-9);
    finger(WINDOW_POINTER_MOVE, 1, m.x + 60, m.y);
    run(3);
    EXPECT_NEAR(s.speed, 0, 1e-9);
    EXPECT_AT_LEAST(s.turn_rate, 0.1);
    finger(WINDOW_POINTER_UP, 1, 640, 300); // let go anywhere
    expect_stands();
    finger(WINDOW_POINTER_MOVE, 1, m.x, m.y - 60); // a mouse goes on without a button
    expect_stands();
}

static void test_several_fingers(void **state)
{
    (void)state;
    push(WINDOW_POINTER_DOWN, 1);
    finger(WINDOW_POINTER_DOWN, 2, 640, 300);
    finger(WINDOW_POINTER_MOVE, 2, 700, 300);
    expect_moves();
    finger(WINDOW_POINTER_UP, 2, 700, 300); // another one is let go: the first still drives
    expect_moves();
    push(WINDOW_POINTER_DOWN, 4); // a second one on the stick does not take it over
    finger(WINDOW_POINTER_UP, 1, 0, 0);
    expect_stands();
    push(WINDOW_POINTER_MOVE, 4);
    expect_stands();
    finger(WINDOW_POINTER_UP, 4, 0, 0);
    press(WINDOW_POINTER_DOWN, 5, PART_STOP); // while STOP is held nothing drives
    push(WINDOW_POINTER_DOWN, 6);
    key(WINDOW_KEY, WINDOW_KEY_UP);
    axis(PAD_LEFT_Y, -1);
    expect_stands();
    press(WINDOW_POINTER_UP, 5, PART_STOP); // nor does it begin when STOP is let go
    expect_stands();
    push(WINDOW_POINTER_MOVE, 6);
    axis(PAD_LEFT_Y, -0.9);
    expect_stands();
}

static void test_a_finger_that_began_elsewhere_never_drives(void **state)
{
    (void)state;
    const struct ui_point from[] = {middle_of(PART_STOP), middle_of(PART_MAP), {640, 400}};
    for (int64_t i = 0; i < (int64_t)COUNT_OF(from); i++) {
        finger(WINDOW_POINTER_DOWN, i, from[i].x, from[i].y);
        push(WINDOW_POINTER_MOVE, i);
        expect_stands();
        push(WINDOW_POINTER_UP, i);
        expect_stands();
    }
    EXPECT_INT(s.tapped, PART_NOTHING);
    push(WINDOW_POINTER_DOWN, 9); // from the stick on to STOP: it stops, and does not go on from there
    expect_moves();
    press(WINDOW_POINTER_MOVE, 9, PART_STOP);
    expect_stands();
    push(WINDOW_POINTER_MOVE, 9);
    expect_stands();
}

// Nobody tells that the finger went up.
static void test_a_finger_that_is_lost_stops(void **state)
{
    (void)state;
    const enum window_event_kind ends[] = {WINDOW_HIDDEN, WINDOW_UNFOCUSED};
    for (size_t i = 0; i < COUNT_OF(ends); i++) {
        push(WINDOW_POINTER_DOWN, 1);
        expect_moves();
        give((struct window_event){.kind = ends[i]});
        expect_stands();
        push(WINDOW_POINTER_MOVE, 1);
        expect_stands();
    }
    push(WINDOW_POINTER_DOWN, 1); // the same number goes down again, elsewhere
    expect_moves();
    finger(WINDOW_POINTER_DOWN, 1, 640, 300);
    expect_stands();
    push(WINDOW_POINTER_DOWN, 2);
    expect_moves();
    drive_controls_place(&s.controls, HEIGHT, WIDTH); // the screen is turned
    expect_stands();
    for (int64_t i = 0; i < 3 * DRIVE_FINGERS; i++) // more than are counted: STOP stops
        finger(WINDOW_POINTER_DOWN, 100 + i, 400, 300);
    key(WINDOW_KEY, WINDOW_KEY_DOWN);
    expect_moves();
    press(WINDOW_POINTER_DOWN, 777, PART_STOP);
    expect_stands();
}

static void test_a_pad_drives_until_it_stands_in_the_middle(void **state)
{
    (void)state;
    axis(PAD_LEFT_Y, -0.5);
    expect_moves();
    axis(PAD_LEFT_Y, 0);
    expect_stands();
    axis(PAD_LEFT_Y, -0.5);
    expect_moves();
    key(WINDOW_KEY, WINDOW_KEY_SPACE);
    expect_stands();
    axis(PAD_LEFT_Y, -0.4); // still pushed
    expect_stands();
    axis(PAD_LEFT_Y, 0);
    axis(PAD_LEFT_Y, -0.4);
    expect_moves();
    give((struct window_event){.kind = WINDOW_PAD_GONE});
    expect_stands();
}

// The program is stopped for five seconds while the key is held: the robot's watchdog stops it half a second later, and
// when the program goes on the key has to be pressed again.
static void test_a_program_that_stands_still_stops_the_robot(void **state)
{
    (void)state;
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
    const struct vec3 was = s.session.rover.world_from_body.translation;
    const double fast = s.speed, patience_s = drive_default_options().patience_s;
    s.now_ns += 5000000000 - TICK;
    run(1);
    const double way_m = v3_distance(was, s.session.rover.world_from_body.translation);
    print_message("%.3f m at %.2f m/s\n", way_m, fast);
    EXPECT_AT_MOST(way_m, fast * (patience_s + 0.06));
    EXPECT_AT_LEAST(way_m, fast * (patience_s - 0.06));
    EXPECT_INT(s.controls.halt, HALT_GAP);
    expect_stands();
    key(WINDOW_KEY_RELEASED, WINDOW_KEY_UP);
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
}

static void test_a_lost_link_and_an_old_picture_stop(void **state)
{
    (void)state;
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
    s.session.options.link.loss = 1;
    run(12);
    EXPECT_NEAR(s.speed, 0, 0);
    EXPECT_INT(s.controls.halt, HALT_LINK);
    s.session.options.link.loss = 0;
    expect_stands(); // the link is back, the key is still down
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
    s.session.rover.surroundings.poses[s.session.rover.surroundings.taken - 1].translation.x -= 2; // of the last one
    expect_stands();
    EXPECT_INT(s.controls.halt, HALT_PICTURE);
}

// The robot's guard (platform/network/ros_guard.h) has stopped it, after less than what the clock here calls a gap.
static void test_an_interrupted_program_waits_for_a_new_press(void **state)
{
    (void)state;
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
    struct drive_readings readings = drive_session_readings(&s.session);
    EXPECT_TRUE(!readings.interrupted);
    readings.interrupted = true;
    drive_controls_tick(&s.controls, &readings, s.now_ns);
    EXPECT_INT(s.controls.halt, HALT_INTERRUPTED);
    expect_stands();
    key(WINDOW_KEY, WINDOW_KEY_UP);
    expect_moves();
}

// STOP, stick and buttons are on the screen, apart from each other, and large enough for a finger.
static void test_all_is_on_every_screen(void **state)
{
    (void)state;
    const double sizes[][2] = {{1506, 941}, {1205, 706}, {964, 565}, {941, 565}, {565, 941}, {350, 580}, {320, 320}};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        struct drive_controls c = {0};
        drive_controls_place(&c, sizes[i][0], sizes[i][1]);
        for (int p = PART_STOP; p < PART_SPENT; p++) {
            const struct ui_box a = c.box[p];
            EXPECT_AT_LEAST(fmin(a.w, a.h), 57); // 9 mm
            EXPECT_AT_LEAST(fmin(a.x, a.y), 0);
            EXPECT_AT_MOST(a.x + a.w, sizes[i][0]);
            EXPECT_AT_MOST(a.y + a.h, sizes[i][1]);
            for (int q = PART_STOP; q < p; q++) {
                const struct ui_box b = c.box[q];
                EXPECT_TRUE(a.x >= b.x + b.w || b.x >= a.x + a.w || a.y >= b.y + b.h || b.y >= a.y + a.h);
            }
        }
        EXPECT_AT_LEAST(c.box[PART_STOP].w, 85); // half an inch
    }
}

int main(void)
{
#define ON_STAGE(test) cmocka_unit_test_setup_teardown(test, open_stage, close_stage)
    const struct CMUnitTest tests[] = {
        ON_STAGE(test_a_key_drives_while_it_is_down),
        ON_STAGE(test_of_two_keys_one_is_let_go),
        ON_STAGE(test_what_stops_a_held_key),
        ON_STAGE(test_the_keyboard_comes_back_with_a_key_down),
        ON_STAGE(test_the_stick_drives_while_a_finger_is_on_it),
        ON_STAGE(test_several_fingers),
        ON_STAGE(test_a_finger_that_began_elsewhere_never_drives),
        ON_STAGE(test_a_finger_that_is_lost_stops),
        ON_STAGE(test_a_pad_drives_until_it_stands_in_the_middle),
        ON_STAGE(test_a_program_that_stands_still_stops_the_robot),
        ON_STAGE(test_an_interrupted_program_waits_for_a_new_press),
        ON_STAGE(test_a_lost_link_and_an_old_picture_stop),
        cmocka_unit_test(test_all_is_on_every_screen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
