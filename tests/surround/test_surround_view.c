// Views of a small world against ray casting: what pictures with true depth show is drawn as it is from elsewhere, what
// none has seen is marked, and the hard cases: no capture yet, a black panorama, poses off by 5 cm, a viewpoint beyond
// a wall, a pole thinner than a pixel, glass that gives no points.
#include "tests/support/test.h"

#include "reenact/surround/drive/simulated_rover.h"
#include "reenact/surround/view/exposure.h"

#include <stdio.h>

enum { HEIGHT = 256, WIDTH = 2 * HEIGHT, PICTURES = 3 };

static const struct lens view_lens = {.width = 160, .height = 120, .fx = 100, .fy = 100, .cx = 79.5, .cy = 59.5};

struct scene {
    struct box_world world;
    struct surround_picture pictures[PICTURES];
    struct surround_view view;
    uint8_t truth[160 * 120 * 3];
    double depth[160 * 120]; // along z
};

static struct pose camera_at(double x, double y, double z)
{
    double level[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}}; // looks along x
    return (struct pose){quat_from_matrix(level), v3(x, y, z)};
}

static void add_box(struct box_world *w, struct vec3 low, struct vec3 high, bool inside)
{
    w->boxes[w->count++] = (struct box){
        .low = {low.x, low.y, low.z}, .high = {high.x, high.y, high.z}, .color = {150, 120, 100}, .inside = inside};
}

static void picture_of(const struct box_world *w, struct pose pose, struct surround_picture *p)
{
    uint8_t *rgb = malloc(WIDTH * HEIGHT * 3);
    box_world_panorama(w, pose, WIDTH, HEIGHT, rgb);
    assert_int_equal(surround_picture_make(p, rgb, WIDTH, HEIGHT, NULL), OK);
    surround_picture_place(p, pose);
    p->inverse = malloc(WIDTH * HEIGHT * sizeof *p->inverse);
    p->joined = malloc(WIDTH * HEIGHT);
    for (int v = 0; v < HEIGHT; v++)
        for (int u = 0; u < WIDTH; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            const struct vec3 d = quat_rotate(pose.rotation, v3(ray[0], ray[1], ray[2]));
            const double from[3] = {pose.translation.x, pose.translation.y, pose.translation.z};
            p->inverse[v * WIDTH + u] = (float)(1 / box_world_cast(w, from, (double[3]){d.x, d.y, d.z}, NULL));
        }
    surround_picture_join(p);
}

static void make_truth(struct scene *s, struct pose eye)
{
    for (int i = 0; i < 160 * 120; i++) {
        const struct vec3 c = v3_unit(lens_ray(&view_lens, (struct pixel){i % 160, i / 160}));
        const struct vec3 d = quat_rotate(eye.rotation, c);
        const double from[3] = {eye.translation.x, eye.translation.y, eye.translation.z};
        s->depth[i] = c.z * box_world_cast(&s->world, from, (double[3]){d.x, d.y, d.z}, s->truth + 3 * i);
    }
}

static void open_scene(struct scene *s)
{
    *s = (struct scene){0};
    add_box(&s->world, v3(-2, -2, 0), v3(4, 2, 2.5), true);
    add_box(&s->world, v3(1.5, -0.3, 0), v3(1.8, 0.3, 1), false);
    assert_int_equal(surround_view_open(&s->view, &view_lens), OK);
}

static void film(struct scene *s)
{
    for (int i = 0; i < PICTURES; i++)
        picture_of(&s->world, camera_at(0.4 * i - 0.4, 0.3 * i - 0.3, 1.15), &s->pictures[i]);
}

static void close_scene(struct scene *s)
{
    for (int i = 0; i < PICTURES; i++)
        surround_picture_free(&s->pictures[i]);
    surround_view_close(&s->view);
}

static void draw(struct scene *s, struct pose eye, int count)
{
    const struct surround_picture *list[PICTURES];
    const struct view_options how = view_default_options();
    for (int i = 0; i < count; i++)
        list[i] = &s->pictures[i];
    assert_int_equal(surround_view_rank(eye, list, count), OK);
    assert_int_equal(surround_view_draw(&s->view, eye, list, count, &how), OK);
    make_truth(s, eye);
}

struct measured {
    double psnr_db, drawn, depth_off; // of drawn pixels; depth: share off by more than 3 %
};
static struct measured measure(const struct scene *s)
{
    double sum = 0, drawn = 0, off = 0;
    for (int i = 0; i < 160 * 120; i++) {
        if (s->view.source[i] == SOURCE_UNSEEN)
            continue;
        drawn++;
        off += fabs(1 / (double)s->view.inverse_z[i] - s->depth[i]) > 0.03 * s->depth[i];
        for (int c = 0; c < 3; c++)
            sum += pow(s->view.rgb[3 * i + c] - s->truth[3 * i + c], 2);
    }
    const struct measured m = {10 * log10(255 * 255 / (sum / (3 * drawn))), drawn / (160 * 120), off / drawn};
    print_message("%.1f dB, drawn %.3f, depth off %.4f\n", m.psnr_db, m.drawn, m.depth_off);
    return m;
}

static void test_from_elsewhere(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    film(&s);
    draw(&s, camera_at(-0.6, 0.25, 1.5), PICTURES);
    const struct measured m = measure(&s);
    EXPECT_AT_LEAST(m.psnr_db, 22);
    EXPECT_AT_LEAST(m.drawn, 0.97);
    EXPECT_AT_MOST(m.depth_off, 0.01);
    close_scene(&s);
}

// Behind the box, which one picture sees from the front only.
static void test_the_unseen_is_marked(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    film(&s);
    const struct pose eye = camera_at(0.8, 1.4, 1.3);
    draw(&s, eye, 1);
    const struct vec3 camera = s.pictures[0].world_from_camera.translation;
    int marked = 0, unseen = 0, wrong = 0;
    for (int i = 0; i < 160 * 120; i++) {
        double at[3];
        surround_view_point(&s.view, i % 160, i / 160, (float)(1 / s.depth[i]), at);
        const struct vec3 to = v3_sub(v3(at[0], at[1], at[2]), camera), d = v3_unit(to);
        const double from[3] = {camera.x, camera.y, camera.z};
        const bool seen = box_world_cast(&s.world, from, (double[3]){d.x, d.y, d.z}, NULL) > 0.97 * v3_length(to);
        const bool drawn = s.view.source[i] != SOURCE_UNSEEN;
        unseen += !seen;
        marked += !seen && !drawn;
        wrong += seen && !drawn;
    }
    print_message("unseen %d, of them marked %d; marked though seen %d\n", unseen, marked, wrong);
    EXPECT_AT_LEAST(unseen, 500);
    EXPECT_AT_LEAST(marked, 0.9 * unseen);
    EXPECT_AT_MOST(wrong, 0.02 * 160 * 120);
    close_scene(&s);
}

static void test_no_capture_yet(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    draw(&s, camera_at(0, 0, 1), 0);
    for (int i = 0; i < 160 * 120; i++)
        assert_int_equal(s.view.source[i], SOURCE_UNSEEN);
    close_scene(&s);
}

static void test_poses_off(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    film(&s);
    for (int i = 0; i < PICTURES; i++) {
        struct pose off = s.pictures[i].world_from_camera;
        off.translation.y += i == 1 ? 0.05 : -0.02 * i;
        surround_picture_place(&s.pictures[i], off);
    }
    draw(&s, camera_at(-0.6, 0.25, 1.5), PICTURES);
    const struct measured m = measure(&s);
    EXPECT_AT_LEAST(m.drawn, 0.95);
    EXPECT_AT_MOST(m.depth_off, 0.05);
    close_scene(&s);
}

// From beyond a wall its back is not drawn; nothing is drawn nearer than the wall is.
static void test_beyond_a_wall(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    film(&s);
    draw(&s, camera_at(-2.5, 0, 1.2), PICTURES);
    for (int i = 0; i < 160 * 120; i++)
        if (s.view.source[i] != SOURCE_UNSEEN)
            EXPECT_AT_LEAST(1 / (double)s.view.inverse_z[i], 0.5);
    close_scene(&s);
}

// It is drawn where it is, or not at all, and never smeared.
static void test_a_thin_pole(void **state)
{
    (void)state;
    static struct scene s;
    open_scene(&s);
    add_box(&s.world, v3(1.0, 0.9, 0), v3(1.01, 0.91, 2.5), false); // 0.4 pixels of a picture wide
    film(&s);
    draw(&s, camera_at(-0.3, 0.6, 1.2), PICTURES);
    int near = 0;
    for (int i = 0; i < 160 * 120; i++) {
        double at[3];
        if (s.view.source[i] == SOURCE_UNSEEN)
            continue;
        surround_view_point(&s.view, i % 160, i / 160, s.view.inverse_z[i], at);
        near += fabs(at[0] - 1) < 0.1 && fabs(at[1] - 0.9) < 0.1 && at[2] > 0.1;
    }
    EXPECT_AT_MOST(near, 120 * 3);
    EXPECT_AT_MOST(measure(&s).depth_off, 0.03);
    close_scene(&s);
}

// Points on a wall but for its window: the depth goes on through it, and a wall seen to 1 m goes on above.
static void test_glass_and_walls_above(void **state)
{
    (void)state;
    static struct scene s;
    static float points[40000][3];
    int count = 0;
    open_scene(&s);
    film(&s);
    s.world.count = 1;
    for (double y = -2; y < 2; y += 0.03)
        for (double z = 0; z < 1.1; z += 0.03)
            if (!(fabs(y) < 0.4 && fabs(z - 0.7) < 0.2)) {
                points[count][0] = 4, points[count][1] = (float)y, points[count++][2] = (float)z;
            }
    for (double x = -2; x < 4; x += 0.05)
        for (double y = -2; y < 2; y += 0.05) {
            points[count][0] = (float)x, points[count][1] = (float)y, points[count++][2] = 0;
        }
    struct depth_options how = depth_default_options();
    const struct world_points world = {(const float(*)[3])points, NULL, count};
    struct surround_picture *p = &s.pictures[1];
    assert_int_equal(dense_depth_make(p, &world, &how), OK);
    double worst = 0;
    for (int v = HEIGHT / 2 - 30; v < HEIGHT / 2 + 12; v++)
        for (int u = WIDTH / 2 - 8; u < WIDTH / 2 + 8; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            worst = fmax(worst, fabs((double)(4 * p->inverse[v * WIDTH + u] / ray[2]) - 1));
        }
    EXPECT_AT_MOST(worst, 0.03);
    close_scene(&s);
}

static void test_a_black_panorama(void **state)
{
    (void)state;
    struct box_world world;
    struct pose start;
    struct simulated_rover rover;
    struct rover_options how = rover_default_options();
    how.panorama_height = 128;
    how.view = view_lens;
    rover_trial_world(3, &world, &start);
    assert_int_equal(simulated_rover_open(&rover, &world, start, &how), OK);
    struct surroundings *r = &rover.surroundings;
    struct surround_picture black;
    struct depth_points none = {0};
    assert_int_equal(surround_picture_make(&black, calloc(128 * 256, 3), 256, 128, NULL), OK);
    assert_int_equal(surroundings_take(r, &black, &none, POSE_IDENTITY), OK);
    assert_int_equal(simulated_rover_draw(&rover, camera_at(0, 0, 1.2)), OK);
    int dark = 0, drawn = 0;
    for (int i = 0; i < 160 * 120; i++) {
        drawn += r->view.source[i] != SOURCE_UNSEEN;
        dark += r->view.source[i] != SOURCE_UNSEEN && r->view.rgb[3 * i] + r->view.rgb[3 * i + 1] < 30;
    }
    EXPECT_AT_LEAST(drawn, 0.8 * 160 * 120);
    EXPECT_AT_MOST(dark, 0.01 * drawn);
    simulated_rover_close(&rover);
}

// Pictures taken with different exposures and white balances, one of them with a person of another colour in every
// fifth pixel and saturated highlights: the gains agree with the exposures, and the drawn picture with one that was
// evenly exposed, but for its mean brightness.
static void test_exposure_is_evened(void **state)
{
    (void)state;
    static const double exposures[PICTURES][3] = {{0.7, 0.75, 0.8}, {1, 1, 1}, {1.3, 1.25, 1.1}};
    struct scene s;
    struct exposure even = {0};
    open_scene(&s);
    film(&s);
    for (int i = 0; i < PICTURES; i++)
        for (int k = 0; k < WIDTH * HEIGHT * 3; k++) {
            const double value = s.pictures[i].rgb[k] * exposures[i][k % 3];
            s.pictures[i].rgb[k] = (uint8_t)(value < 255 ? value + 0.5 : 255);
        }
    for (int v = 0; v < HEIGHT; v++) // a person, there in the second picture only
        for (int u = 0; u < WIDTH / 5; u++)
            memset(s.pictures[1].rgb + 3 * (v * WIDTH + u), 40, 3);
    const struct surround_picture *list[PICTURES] = {&s.pictures[0], &s.pictures[1], &s.pictures[2]};
    assert_int_equal(exposure_even(&even, s.pictures, list, PICTURES), OK);
    for (int c = 0; c < 3; c++) {
        const double one = s.pictures[1].gain[c] * exposures[1][c];
        for (int i = 0; i < PICTURES; i++)
            EXPECT_NEAR(s.pictures[i].gain[c] * exposures[i][c] / one, 1, 0.02);
        EXPECT_NEAR(s.pictures[0].gain[c] * s.pictures[1].gain[c] * s.pictures[2].gain[c], 1, 0.02);
    }
    const int pairs = even.pair_count;
    assert_int_equal(exposure_even(&even, s.pictures, list, PICTURES), OK); // nothing is measured twice
    EXPECT_INT(even.pair_count, pairs);
    exposure_free(&even);
    close_scene(&s);
}

// One picture, or pictures that have nothing in common, keep their colours.
static void test_exposure_without_overlap(void **state)
{
    (void)state;
    struct scene s;
    struct exposure even = {0};
    open_scene(&s);
    film(&s);
    const struct surround_picture *list[2] = {&s.pictures[0], &s.pictures[1]};
    assert_int_equal(exposure_even(&even, s.pictures, list, 1), OK);
    EXPECT_NEAR(s.pictures[0].gain[0], 1, 0);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        s.pictures[1].inverse[k] = DEPTH_UNKNOWN;
    assert_int_equal(exposure_even(&even, s.pictures, list, 2), OK);
    EXPECT_NEAR(s.pictures[0].gain[0], 1, 0);
    EXPECT_NEAR(s.pictures[1].gain[0], 1, 0);
    exposure_free(&even);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_from_elsewhere),        cmocka_unit_test(test_the_unseen_is_marked),
        cmocka_unit_test(test_no_capture_yet),        cmocka_unit_test(test_poses_off),
        cmocka_unit_test(test_beyond_a_wall),         cmocka_unit_test(test_a_thin_pole),
        cmocka_unit_test(test_glass_and_walls_above), cmocka_unit_test(test_a_black_panorama),
        cmocka_unit_test(test_exposure_is_evened),    cmocka_unit_test(test_exposure_without_overlap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
