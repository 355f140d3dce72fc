// What a robot's driver sees, drawn into memory: over the map of the surroundings the recorded place in which the robot
// drives, at the right pixels, once the robot is found there; until then a line that says so.
//
//     test_drive_screen          the tests
//     test_drive_screen FOLDER   an image of the screen
#include "tests/support/test.h"

#include "app/drive/drive_screen.h"
#include "base/clock.h"
#include "platform/files/png.h"
#include "recording/recorded_things.h"
#include "tests/support/film.h"
#include "tests/support/robot_film.h"
#include "tests/support/room_rehearsal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 1280, HEIGHT = 800, FRAMES = 3 };
enum { THING, GONE, THINGS };
static const double PX_PER_DP = 1, GONE_SIGMA_M = 0.05;

static struct world *world;
static struct place place;
static struct surround_picture pictures[ROBOT_CAPTURES];
static struct scratch scratch;
static char file[256];
static struct recorded_thing things[THINGS];
static double thing_side_m = 0.5; // large enough to be measured

static void write_take(struct recording_writer *w)
{
    const struct calibration c = world_calibration(0.5);
    EXPECT_STATUS(recording_begin_take(w, "dance", &c), OK);
    for (int i = 0; i < FRAMES; i++) {
        struct take_frame f = {
            .time_ns = i * 500000000LL, .world_from_camera = world_sensor_pose(world), .located = true};
        f.has_skeleton = i > 0; // the first frame has no skeleton
        f.skeleton = world_joints_in_camera(world, 0.5 * i, f.world_from_camera);
        EXPECT_STATUS(recording_add_frame(w, &f), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
}

// Upright, its front to the sensor: x right, y down, z away.
static struct recorded_thing thing(const char *name, struct vec3 at, double side_m, double sigma_m)
{
    const double half = sqrt(0.5), variance = sigma_m * sigma_m;
    struct recorded_thing t = {.world_from_thing = {{-half, 0, 0, half}, at},
                               .covariance = {variance, 0, 0, variance, 0, variance},
                               .width_m = side_m,
                               .height_m = side_m,
                               .sightings = 3};
    snprintf(t.name, sizeof t.name, "%s", name);
    return t;
}

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    struct recording_writer *writer;
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    scratch = scratch_make();
    place = film_true_place(world, 1);
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        pictures[i] = robot_panorama(world, i);
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "room.reenact"));
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_put_place(writer, &place), OK);
    write_take(writer);
    EXPECT_STATUS(recording_close(&writer), OK);
    things[THING] = thing("dumbbell", v3(1.6, -1.2, 0.9), thing_side_m, 0.03);
    things[GONE] = thing("chair", v3(-1.2, 0.6, 0.4), 0.6, GONE_SIGMA_M);
    things[GONE].gone = true;
    room_model(&things[THING].model.bytes, &things[THING].model.count);
    EXPECT_STATUS(recording_write_things(file, things, THINGS), OK);
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    for (int i = 0; i < ROBOT_CAPTURES; i++)
        surround_picture_free(&pictures[i]);
    free(things[THING].model.bytes);
    place_free(&place);
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

// ---------------------------------------------------------------- the stage

struct stage {
    struct drive_session session;
    struct gpu *gpu;
    struct gpu_target *target;
    struct drive_screen screen;
    uint8_t *rgba;
};

static void open_stage(struct stage *s, const char *folder, const char *recording, bool depth)
{
    struct drive_options options = drive_default_options();
    char uri[300];
    robot_film(&scratch, folder, pictures, depth ? world : NULL);
    snprintf(uri, sizeof uri, "folder:%s/%s", scratch.path, folder);
    EXPECT_STATUS(drive_session_open(&s->session, uri, &options), OK);
    EXPECT_STATUS(gpu_open(&s->gpu), OK);
    EXPECT_STATUS(gpu_target_open(&s->target, s->gpu, WIDTH, HEIGHT), OK);
    EXPECT_STATUS(drive_screen_open(&s->screen, s->gpu, &s->session, recording, &place), OK);
    s->screen.map = true;
    s->rgba = malloc((size_t)WIDTH * HEIGHT * 4);
}

static void close_stage(struct stage *s)
{
    drive_screen_close(&s->screen);
    drive_session_close(&s->session);
    gpu_target_close(&s->target);
    gpu_close(&s->gpu);
    free(s->rgba);
}

static void draw(struct stage *s)
{
    const struct viewer_surface surface = {s->target, WIDTH, HEIGHT, 0, PX_PER_DP};
    EXPECT_STATUS(drive_screen_draw(&s->screen, &surface, clock_now_ns()), OK);
    EXPECT_STATUS(gpu_target_read(s->target, s->rgba), OK);
}

// Drives to the last capture, and draws until the robot was looked for in both.
static void drive(struct stage *s)
{
    for (int i = 0; i < ROBOT_CAPTURES; i++) {
        EXPECT_STATUS(drive_session_step(&s->session, i * 1000000000LL, NULL), OK);
        draw(s);
        for (int64_t until = clock_now_ns() + 60000000000;
             s->screen.has_place && s->screen.place.answer.looked <= i && clock_now_ns() < until;) {
            drive_place_update(&s->screen.place, drive_session_surroundings(&s->session));
            clock_sleep_until_ns(clock_now_ns() + 5000000);
            if (s->screen.place.answer.state == ROBOT_PLACE_FOUND)
                break;
        }
    }
    for (int i = 0; i < 6; i++) // pictures come to the graphics card one in each image
        draw(s);
}

// ---------------------------------------------------------------- where the truth is on the screen

// The map is the right half of the screen; the operator's picture, as wide as that, in its middle.
static struct ui_point on_screen(const struct stage *s, struct vec3 in_place)
{
    const struct drive_eye *e = &s->screen.map_eye;
    const struct pose world_from_view =
        operator_orbit(robot_world_from_body[ROBOT_CAPTURES - 1], e->azimuth, e->elevation, e->distance_m);
    const struct vec3 world_point = pose_apply(pose_inverse(robot_truth), in_place);
    const struct vec3 c = pose_apply(pose_inverse(world_from_view), world_point);
    const double half = WIDTH / 2.0, scale = fmin(half / robot_view.width, (double)HEIGHT / robot_view.height);
    EXPECT_AT_LEAST(c.z, 0.2);
    return (struct ui_point){half + half / 2 + scale * robot_view.fx * c.x / c.z,
                             HEIGHT / 2.0 + scale * robot_view.fy * c.y / c.z};
}

static bool is_color(const struct stage *s, double x, double y, uint32_t color, int slack)
{
    if (x < WIDTH / 2.0 || y < 0 || x >= WIDTH || y >= HEIGHT)
        return false;
    const uint8_t *p = s->rgba + 4 * ((int)y * WIDTH + (int)x);
    return abs(p[0] - (int)(color >> 24)) <= slack && abs(p[1] - (int)(color >> 16 & 255)) <= slack &&
           abs(p[2] - (int)(color >> 8 & 255)) <= slack;
}

static bool is_near(const struct stage *s, struct ui_point at, uint32_t color)
{
    for (int y = -2; y <= 2; y++)
        for (int x = -2; x <= 2; x++)
            if (is_color(s, at.x + x, at.y + y, color, 24))
                return true;
    return false;
}

// The share of the outline of a flat thing, moved by so many pixels, that has that colour.
static double share_of_outline(const struct stage *s, struct pose world_from_thing, double side_m, uint32_t color,
                               double moved_px)
{
    enum { STEPS = 24 };
    int hit = 0;
    for (int i = 0; i < 4 * STEPS; i++) {
        const double along = ((i % STEPS) + 0.5) / STEPS - 0.5, edge = i / STEPS % 2 ? 0.5 : -0.5;
        const bool upright = i < 2 * STEPS;
        const struct vec3 at = v3(side_m * (upright ? edge : along), side_m * (upright ? along : edge), 0);
        struct ui_point p = on_screen(s, pose_apply(world_from_thing, at));
        p.x += moved_px;
        p.y += moved_px;
        hit += is_near(s, p, color);
    }
    return (double)hit / (4 * STEPS);
}

static int count_color(const struct stage *s, uint32_t color, int top, int bottom)
{
    int count = 0;
    for (int y = top; y < bottom; y++)
        for (int x = WIDTH / 2 + 90; x < WIDTH; x++)
            count += is_color(s, x, y, color, 40);
    return count;
}

// Of the line at the upper edge of the map's picture, beside the picture's age. The picture fills its half of the
// screen, or is of the session's format where the driver draws by the processor.
static int count_text(const struct stage *s)
{
    const struct lens *l = &s->screen.pane[DRIVE_MAP].lens;
    const double scale = fmin(WIDTH / 2.0 / l->width, (double)HEIGHT / l->height);
    const int top = (int)((HEIGHT - scale * l->height) / 2);
    return count_color(s, theme_of(true)->text, top + 16, top + 60);
}

// ---------------------------------------------------------------- tests

static void expect_label(const struct stage *s, int i)
{
    const struct room_ui *ui = &s->screen.place.ui;
    const struct ui_point at = on_screen(s, things[i].world_from_thing.translation), label = middle(ui->boxes[1][i]);
    print_message("%s is at %.0f, %.0f, its label at %.0f, %.0f\n", things[i].name, at.x, at.y, label.x, label.y);
    EXPECT_TRUE(ui->sides[1][i] != LABEL_NO_SIDE);
    EXPECT_AT_MOST(hypot(at.x - label.x, at.y - label.y), 160);
}

static void expect_outline(const struct stage *s, const char *name, struct pose pose, double side_m, uint32_t color)
{
    const double there = share_of_outline(s, pose, side_m, color, 0),
                 beside = share_of_outline(s, pose, side_m, color, 14);
    print_message("%s: %.0f %% of the outline, %.0f %% beside it\n", name, 100 * there, 100 * beside);
    EXPECT_AT_LEAST(there, 0.9);
    EXPECT_AT_MOST(beside, 0.6 * there);
}

// The level great circle of its ellipsoid; the chi squared distribution's 95 % of three degrees of freedom are 7.815.
static void expect_ellipsoid(const struct stage *s, struct vec3 middle, double sigma_m, uint32_t color)
{
    enum { STEPS = 48 };
    int hit = 0;
    for (int i = 0; i < STEPS; i++) {
        const double a = 2 * 3.14159265358979 * i / STEPS, r = sqrt(7.815) * sigma_m;
        hit += is_near(s, on_screen(s, v3_add(middle, v3(r * cos(a), r * sin(a), 0))), color);
    }
    print_message("%d of %d points of the ellipsoid\n", hit, STEPS);
    EXPECT_AT_LEAST(hit, 0.9 * STEPS);
}

// The model's two discs (room_rehearsal.c), which is as high as the thing.
static void expect_model(const struct stage *s, const struct recorded_thing *t)
{
    const double scale = t->height_m / 0.12;
    for (int side = -1; side <= 1; side += 2) {
        const struct ui_point p =
            on_screen(s, pose_apply(t->world_from_thing, v3(side * 0.125 * scale, 0, 0.06 * scale)));
        const uint8_t *c = s->rgba + 4 * ((int)p.y * WIDTH + (int)p.x);
        print_message("the model's disc: %d, %d, %d\n", c[0], c[1], c[2]);
        EXPECT_AT_LEAST(c[0], 2.0 * c[1]);
        EXPECT_AT_LEAST(c[0], 2.0 * c[2]);
    }
}

struct bounds {
    double left, top, right, bottom;
};

static void widen(struct bounds *b, double x, double y)
{
    b->left = fmin(b->left, x), b->right = fmax(b->right, x);
    b->top = fmin(b->top, y), b->bottom = fmax(b->bottom, y);
}

// The actor as in the take's first frame with a skeleton: what the picture has more with it than without it lies about
// its joints.
static void expect_actor(struct stage *s)
{
    const struct skeleton actor = world_joints(world, 0.5);
    struct bounds joints = {1e9, 1e9, -1e9, -1e9}, drawn = joints;
    uint8_t *with = malloc((size_t)WIDTH * HEIGHT * 4);
    memcpy(with, s->rgba, (size_t)WIDTH * HEIGHT * 4);
    s->screen.place.has_actor = false;
    draw(s);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct ui_point p = on_screen(s, actor.joint[j]);
        widen(&joints, p.x, p.y);
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        if (abs(with[4 * i + 1] - s->rgba[4 * i + 1]) > 12)
            widen(&drawn, i % WIDTH, i / WIDTH);
    print_message("the actor: joints %.0f to %.0f, %.0f to %.0f; drawn %.0f to %.0f, %.0f to %.0f\n", joints.left,
                  joints.right, joints.top, joints.bottom, drawn.left, drawn.right, drawn.top, drawn.bottom);
    const double body = 0.2 * (joints.bottom - joints.top); // of a body's thickness
    EXPECT_NEAR(drawn.left, joints.left - body / 2, body / 2 + 2);
    EXPECT_NEAR(drawn.right, joints.right + body / 2, body / 2 + 2);
    EXPECT_NEAR(drawn.top, joints.top - body / 2, body / 2 + 2);
    EXPECT_NEAR(drawn.bottom, joints.bottom + body / 2, body / 2 + 2);
    free(with);
}

static void test_things_tags_and_actor_are_where_they_are(void **state)
{
    (void)state;
    static struct stage s;
    const struct theme *t = theme_of(true);
    open_stage(&s, "robot", file, false);
    s.screen.map_eye = (struct drive_eye){.orbit = true, .azimuth = 0.7, .elevation = 0.9, .distance_m = 6};
    drive(&s);
    EXPECT_INT(s.screen.place.answer.state, ROBOT_PLACE_FOUND);
    for (int i = 0; i < THINGS; i++)
        expect_label(&s, i);
    s.screen.place.state.names = false;
    draw(&s);
    expect_outline(&s, "the thing", things[THING].world_from_thing, things[THING].width_m, t->accent);
    expect_outline(&s, "what is gone", things[GONE].world_from_thing, things[GONE].width_m, t->warn);
    expect_ellipsoid(&s, things[GONE].world_from_thing.translation, GONE_SIGMA_M, t->warn);
    expect_model(&s, &things[THING]);
    int tags = 0;
    for (int i = 0; i < place.tag_count; i++)
        tags += share_of_outline(&s, place.tags[i].world_from_tag, place.tags[i].side_m, t->ghost, 0) > 0.6;
    print_message("%d of %d tags\n", tags, (int)place.tag_count);
    EXPECT_AT_LEAST(tags, place.tag_count / 3); // others are behind the eye, beside the map, or under things
    expect_actor(&s);
    s.screen.by_card = false; // the same over the processor's picture
    draw(&s);
    expect_outline(&s, "the thing", things[THING].world_from_thing, things[THING].width_m, t->accent);
    close_stage(&s);
}

static void test_until_it_is_found_a_line_says_so(void **state)
{
    (void)state;
    static struct stage s;
    const struct theme *t = theme_of(true);
    uint8_t *kept[ROBOT_CAPTURES];
    const size_t bytes = (size_t)ROBOT_PANORAMA * 2 * ROBOT_PANORAMA * 3;
    for (int i = 0; i < ROBOT_CAPTURES; i++) { // of a wall without a tag
        kept[i] = pictures[i].rgb;
        pictures[i].rgb = malloc(bytes);
        memset(pictures[i].rgb, 150, bytes);
    }
    open_stage(&s, "lost", file, false);
    draw(&s);
    const int waiting = count_text(&s);
    EXPECT_INT(s.screen.place.answer.state, ROBOT_PLACE_WAITING);
    drive(&s);
    const int too_little = count_text(&s);
    EXPECT_INT(s.screen.place.answer.state, ROBOT_PLACE_TOO_LITTLE);
    print_message("pixels of the line: %d before a capture, %d then\n", waiting, too_little);
    EXPECT_AT_LEAST(waiting, 200);
    EXPECT_AT_LEAST(too_little, 200);
    EXPECT_INT(count_color(&s, t->accent, 0, HEIGHT), 0);
    close_stage(&s);
    open_stage(&s, "without", NULL, false); // no recording: the surroundings alone
    drive(&s);
    const int without = count_text(&s);
    print_message("%d without a recording\n", without);
    EXPECT_INT(without, 0);
    EXPECT_INT(count_color(&s, t->accent, 0, HEIGHT), 0);
    close_stage(&s);
    for (int i = 0; i < ROBOT_CAPTURES; i++) {
        free(pictures[i].rgb);
        pictures[i].rgb = kept[i];
    }
}

static void save_image(const char *folder)
{
    static struct stage s;
    char path[600];
    open_stage(&s, "robot", file, true);
    s.screen.map_eye.azimuth = -0.25;
    drive(&s);
    snprintf(path, sizeof path, "%s/drive.png", folder);
    EXPECT_STATUS(png_write(path, PNG_RGBA8, s.rgba, WIDTH, HEIGHT), OK);
    close_stage(&s);
}

int main(int argc, char **argv)
{
    if (argc == 2) {
        thing_side_m = 0.14;
        make(NULL);
        save_image(argv[1]);
        tidy(NULL);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_things_tags_and_actor_are_where_they_are),
        cmocka_unit_test(test_until_it_is_found_a_line_says_so),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
