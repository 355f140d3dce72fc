// Views of a small world against ray casting: what pictures with true depth show is drawn as it is from elsewhere, what
// none has seen is marked, and the hard cases: no capture yet, a black panorama, poses off by 5 cm, a viewpoint beyond
// a wall, a pole thinner than a pixel, glass that gives no points.
#include "tests/support/test.h"

#include "surround/depth/depth_seeds.h"
#include "surround/drive/simulated_rover.h"
#include "surround/view/view_merge.h"
#include "tests/support/box_room.h"

#include <stdio.h>

static const struct lens view_lens = {.width = 160, .height = 120, .fx = 100, .fy = 100, .cx = 79.5, .cy = 59.5};

static void test_from_elsewhere(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    box_room_draw(&s, room_camera(-0.6, 0.25, 1.5), ROOM_PICTURES);
    const struct room_measured m = box_room_measure(&s);
    EXPECT_AT_LEAST(m.psnr_db, 22);
    EXPECT_AT_LEAST(m.drawn, 0.97);
    EXPECT_AT_MOST(m.depth_off, 0.01);
    box_room_close(&s);
}

// Behind the box, which one picture sees from the front only.
static void test_the_unseen_is_marked(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    const struct pose eye = room_camera(0.8, 1.4, 1.3);
    box_room_draw(&s, eye, 1);
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
    box_room_close(&s);
}

// Eight pictures see the box from the front. A ninth, asked no more, has the room's walls and floor behind it: they are
// drawn where it measured them, not where it extrapolated them.
static void test_what_is_only_extrapolated_is_unseen(void **state)
{
    (void)state;
    enum { NEAR = 8 };
    static struct box_room s;
    struct surround_picture ninth;
    const struct surround_picture *list[NEAR + 1];
    struct view_options options = view_default_options();
    const struct pose eye = room_camera(0.8, 1.4, 1.3);
    options.geometry_pictures = NEAR + 1;
    int drawn[2] = {0, 0}, unseen_count = 0;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    struct box_world empty = s.world;
    empty.count = 1; // the room alone
    room_picture(&empty, s.pictures[0].world_from_camera, &ninth);
    for (int i = 0; i < NEAR; i++)
        list[i] = &s.pictures[0];
    list[NEAR] = &ninth;
    box_room_draw(&s, eye, 1);
    bool *unseen = malloc(160 * 120 * sizeof *unseen);
    for (int i = 0; i < 160 * 120; i++)
        unseen_count += unseen[i] = s.view.source[i] == SOURCE_UNSEEN;
    for (int extrapolated = 0; extrapolated < 2; extrapolated++) {
        for (int i = 0; i < ROOM_WIDTH * ROOM_HEIGHT; i++)
            ninth.joined[i] |= extrapolated ? DEPTH_EXTRAPOLATED : 0;
        assert_int_equal(surround_view_draw(&s.view, eye, list, NEAR + 1, &options), OK);
        for (int i = 0; i < 160 * 120; i++)
            drawn[extrapolated] += unseen[i] && s.view.source[i] != SOURCE_UNSEEN;
    }
    print_message("of %d unseen pixels %d drawn where it is measured, %d where it is extrapolated\n", unseen_count,
                  drawn[0], drawn[1]);
    EXPECT_AT_LEAST(unseen_count, 500);
    EXPECT_AT_LEAST(drawn[0], 0.8 * unseen_count);
    EXPECT_AT_MOST(drawn[1], 0.1 * unseen_count);
    free(unseen);
    surround_picture_free(&ninth);
    box_room_close(&s);
}

// One picture's plate in the air, which the two others look through: there is nothing to draw.
static void test_what_others_look_through_is_unseen(void **state)
{
    (void)state;
    static struct box_room s;
    const struct pose eye = room_camera(-0.6, 0.55, 1.15); // looks nearly as one of the two does
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    const struct room_plate plate = box_room_put_plate(&s, eye);
    box_room_draw(&s, eye, ROOM_PICTURES);
    int marked = 0, all = 0;
    for (int y = plate.top; y < plate.bottom; y++)
        for (int x = plate.left; x < plate.right; x++, all++)
            marked += s.view.source[y * 160 + x] == SOURCE_UNSEEN;
    print_message("of %d pixels %d marked\n", all, marked);
    EXPECT_AT_LEAST(all, 100);
    EXPECT_AT_LEAST(marked, 0.6 * all); // at its edge one of the two has the unknown behind it
    box_room_close(&s);
}

// Share of the pixels within 5 of a jump of the true depth that are off by more than 5 %.
static double silhouettes_off(const struct box_room *s)
{
    const int w = s->view.lens.width, h = s->view.lens.height;
    int near = 0, off = 0;
    for (int y = 5; y < h - 5; y++)
        for (int x = 5; x < w - 5; x++) {
            double least = 1e9, most = 0;
            for (int k = -5; k <= 5; k++) {
                least = fmin(least, fmin(s->depth[y * w + x + k], s->depth[(y + k) * w + x]));
                most = fmax(most, fmax(s->depth[y * w + x + k], s->depth[(y + k) * w + x]));
            }
            if (most < 1.3 * least)
                continue;
            near++;
            off += fabs((double)s->view.inverse_z[y * w + x] * s->depth[y * w + x] - 1) > 0.05;
        }
    print_message("of %d pixels at silhouettes %d off\n", near, off);
    assert_true(near > 1000);
    return (double)off / near;
}

// Of pictures whose pixels are five of the view's wide, each at another place, together.
static void test_silhouettes_finer_than_pixels(void **state)
{
    (void)state;
    static const struct lens fine = {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5};
    static struct box_room s;
    static struct surround_picture pictures[8];
    const struct surround_picture *list[8];
    const struct pose eye = room_camera(-0.1, 0, 1.2);
    double off[2];
    box_room_open(&s, &fine);
    for (int i = 0; i < 8; i++) {
        list[i] = &pictures[i];
        room_picture(&s.world, room_camera(0.07 * i - 0.6, 0.06 * (3 * i % 8) - 0.2, 1.15 + 0.02 * i), &pictures[i]);
    }
    box_room_make_truth(&s, eye);
    for (int test = 0; test < 2; test++) {
        struct view_options options = view_default_options();
        options.depth_test = test;
        assert_int_equal(surround_view_draw(&s.view, eye, list, 8, &options), OK);
        off[test] = silhouettes_off(&s);
    }
    EXPECT_AT_MOST(off[1], 0.7 * off[0]);
    for (int i = 0; i < 8; i++)
        surround_picture_free(&pictures[i]);
    box_room_close(&s);
}

static void test_no_capture_yet(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    box_room_draw(&s, room_camera(0, 0, 1), 0);
    for (int i = 0; i < 160 * 120; i++)
        assert_int_equal(s.view.source[i], SOURCE_UNSEEN);
    box_room_close(&s);
}

static void test_poses_off(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    for (int i = 0; i < ROOM_PICTURES; i++) {
        struct pose off = s.pictures[i].world_from_camera;
        off.translation.y += i == 1 ? 0.05 : -0.02 * i;
        surround_picture_place(&s.pictures[i], off);
    }
    box_room_draw(&s, room_camera(-0.6, 0.25, 1.5), ROOM_PICTURES);
    const struct room_measured m = box_room_measure(&s);
    EXPECT_AT_LEAST(m.drawn, 0.95);
    EXPECT_AT_MOST(m.depth_off, 0.05);
    box_room_close(&s);
}

// From beyond a wall its back is not drawn; nothing is drawn nearer than the wall is.
static void test_beyond_a_wall(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    box_room_draw(&s, room_camera(-2.5, 0, 1.2), ROOM_PICTURES);
    for (int i = 0; i < 160 * 120; i++)
        if (s.view.source[i] != SOURCE_UNSEEN)
            EXPECT_AT_LEAST(1 / (double)s.view.inverse_z[i], 0.5);
    box_room_close(&s);
}

// It is drawn where it is, or not at all, and never smeared.
static void test_a_thin_pole(void **state)
{
    (void)state;
    static struct box_room s;
    box_room_open(&s, &view_lens);
    room_add_box(&s.world, v3(1.0, 0.9, 0), v3(1.01, 0.91, 2.5), false); // 0.4 pixels of a picture wide
    box_room_film(&s);
    box_room_draw(&s, room_camera(-0.3, 0.6, 1.2), ROOM_PICTURES);
    int near = 0;
    for (int i = 0; i < 160 * 120; i++) {
        double at[3];
        if (s.view.source[i] == SOURCE_UNSEEN)
            continue;
        surround_view_point(&s.view, i % 160, i / 160, s.view.inverse_z[i], at);
        near += fabs(at[0] - 1) < 0.1 && fabs(at[1] - 0.9) < 0.1 && at[2] > 0.1;
    }
    EXPECT_AT_MOST(near, 120 * 3);
    EXPECT_AT_MOST(box_room_measure(&s).depth_off, 0.03);
    box_room_close(&s);
}

// Points on a wall but for its window: the depth goes on through it, and a wall seen to 1 m goes on above.
static void test_glass_and_walls_above(void **state)
{
    (void)state;
    static struct box_room s;
    static float points[40000][3];
    int count = 0;
    box_room_open(&s, &view_lens);
    box_room_film(&s);
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
    struct depth_options options = depth_default_options();
    const struct world_points world = {.xyz = (const float(*)[3])points, .count = count};
    struct surround_picture *p = &s.pictures[1];
    assert_int_equal(dense_depth_make(p, &world, &options), OK);
    double worst = 0;
    for (int v = ROOM_HEIGHT / 2 - 30; v < ROOM_HEIGHT / 2 + 12; v++)
        for (int u = ROOM_WIDTH / 2 - 8; u < ROOM_WIDTH / 2 + 8; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            worst = fmax(worst, fabs((double)(4 * p->inverse[v * ROOM_WIDTH + u] / ray[2]) - 1));
        }
    EXPECT_AT_MOST(worst, 0.03);
    box_room_close(&s);
}

// A post of which the points reach to 0.7 m, before a wall that has points all over beside it: above, the post goes on.
static void test_a_post_taller_than_its_points(void **state)
{
    (void)state;
    static struct box_room s;
    static float points[60000][3];
    const double eye[3] = {0, 0, 1.15};
    int count = 0, post = 0, right = 0;
    box_room_open(&s, &view_lens);
    s.world.boxes[1] = (struct box){{1.5, -0.1, 0}, {1.6, 0.1, 2.4}, {30, 60, 200}, false};
    room_picture(&s.world, room_camera(0, 0, eye[2]), &s.pictures[0]);
    for (double a = -0.5; a < 0.5; a += 0.005)
        for (double b = -0.6; b < 0.3; b += 0.005) {
            const struct vec3 d = v3_unit(v3(1, a, b));
            const double away = box_world_cast(&s.world, eye, (double[3]){d.x, d.y, d.z}, NULL);
            const struct vec3 at = v3_add(v3(eye[0], eye[1], eye[2]), v3_scale(d, away));
            if (fabs(at.x - 1.5) < 0.01 && at.z > 0.7)
                continue;
            points[count][0] = (float)at.x, points[count][1] = (float)at.y, points[count++][2] = (float)at.z;
        }
    struct depth_options options = depth_default_options();
    const struct world_points world = {.xyz = (const float(*)[3])points, .count = count};
    struct surround_picture *p = &s.pictures[0];
    assert_int_equal(dense_depth_make(p, &world, &options), OK);
    for (int v = ROOM_HEIGHT / 2 - 20; v < ROOM_HEIGHT / 2 + 20; v++)
        for (int u = ROOM_WIDTH / 2 - 3; u <= ROOM_WIDTH / 2 + 2; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            post++;
            right += fabs(1.5 * (double)(p->inverse[v * ROOM_WIDTH + u] / ray[2]) - 1) < 0.05;
        }
    print_message("of %d pixels of the post %d have its depth\n", post, right);
    EXPECT_AT_LEAST(right, 0.9 * post);
    box_room_close(&s);
}

// A post as wide as some pixels, of which there are few points, before a wall of which there are many, also of what the
// post hides: measured from elsewhere. Most of the post stays the post.
static void test_a_thin_post_hides_the_wall(void **state)
{
    (void)state;
    static struct box_room s;
    static float points[60000][3];
    const double eye[3] = {0, 0, 1.15};
    int count = 0, post = 0, right = 0, beside = 0, far = 0;
    box_room_open(&s, &view_lens);
    s.world.boxes[1] = (struct box){{1.5, -0.05, 0}, {1.6, 0.05, 2.4}, {30, 60, 200}, false};
    room_picture(&s.world, room_camera(0, 0, eye[2]), &s.pictures[0]);
    for (double y = -2; y < 2; y += 0.03)
        for (double z = 0.2; z < 2.4; z += 0.03)
            points[count][0] = 4, points[count][1] = (float)y, points[count++][2] = (float)z;
    for (double y = -0.045; y < 0.05; y += 0.03)
        for (double z = 0.2; z < 2.4; z += 0.04)
            points[count][0] = 1.5, points[count][1] = (float)y, points[count++][2] = (float)z;
    assert_true(count <= (int)COUNT_OF(points));
    struct depth_options options = depth_default_options();
    const struct world_points world = {.xyz = (const float(*)[3])points, .count = count};
    struct surround_picture *p = &s.pictures[0];
    assert_int_equal(dense_depth_make(p, &world, &options), OK);
    for (int v = ROOM_HEIGHT / 2 - 16; v < ROOM_HEIGHT / 2 + 16; v++)
        for (int u = ROOM_WIDTH / 2 - 12; u <= ROOM_WIDTH / 2 + 12; u++) {
            float ray[3];
            surround_picture_ray(p, u, v, ray);
            const double away = box_world_cast(&s.world, eye, (double[3]){ray[2], -ray[0], -ray[1]}, NULL);
            const bool agrees = fabs(away * (double)p->inverse[v * ROOM_WIDTH + u] - 1) < 0.05;
            *(away * (double)ray[2] < 2 ? &post : &beside) += 1;
            *(away * (double)ray[2] < 2 ? &right : &far) += agrees;
        }
    print_message("of %d pixels of the post %d have its depth, of %d beside it %d the wall's\n", post, right, beside,
                  far);
    EXPECT_AT_LEAST(post, 150);
    EXPECT_AT_LEAST(right, 0.6 * post);
    EXPECT_AT_LEAST(far, 0.95 * beside);
    box_room_close(&s);
}

enum { ROW = 5 }; // pictures beside each other
struct glass {
    struct box_room scene;
    struct surround_picture row[ROW];
    float points[40000][3];
    struct world_points world;
    struct point_colors colors;
};

// A post of glass 2 m before a wall: points on wall and floor only, measured from elsewhere, also of what the post
// hides.
static void build_glass(struct glass *g)
{
    int count = 0;
    box_room_open(&g->scene, &view_lens);
    g->scene.world.boxes[1] = (struct box){{1.5, -0.15, 0}, {1.6, 0.15, 1}, {30, 60, 200}, false};
    for (int i = 0; i < ROW; i++)
        room_picture(&g->scene.world, room_camera(0, 0.4 * (i - ROW / 2), 1.15), &g->row[i]);
    for (double y = -2; y < 2; y += 0.02)
        for (double z = 0; z < 2.4; z += 0.025)
            g->points[count][0] = 4, g->points[count][1] = (float)y, g->points[count++][2] = (float)z;
    for (double x = -2; x < 4; x += 0.04)
        for (double y = -2; y < 2; y += 0.04)
            g->points[count][0] = (float)x, g->points[count][1] = (float)y, g->points[count++][2] = 0;
    assert_true(count <= (int)COUNT_OF(g->points));
    g->world = (struct world_points){.xyz = (const float(*)[3])g->points, .count = count};
    assert_int_equal(point_colors_make(&g->colors, &g->world, g->row, ROW), OK);
}

// Seeds of the middle picture's depth that lie behind the post, and that do not.
static void count_seeds(const struct glass *g, int *behind, int *visible)
{
    const struct surround_picture *p = &g->row[ROW / 2];
    const struct vec3 eye = p->world_from_camera.translation;
    const struct depth_options options = depth_default_options();
    struct depth_seeds seeds;
    *behind = *visible = 0;
    assert_int_equal(depth_seeds_make(&seeds, p, &g->world, &options), OK);
    for (int i = 0; i < seeds.count; i++) {
        const float *ray = seeds.list[i].ray;
        const struct vec3 d = v3_unit(quat_rotate(p->world_from_camera.rotation, v3(ray[0], ray[1], ray[2])));
        const double from[3] = {eye.x, eye.y, eye.z}, to[3] = {d.x, d.y, d.z};
        const double away = box_world_cast(&g->scene.world, from, to, NULL);
        *(away * (double)seeds.list[i].inverse < 0.95 ? behind : visible) += 1;
    }
    depth_seeds_free(&seeds);
    print_message("seeds behind the glass %d, others %d\n", *behind, *visible);
}

// What is behind glass has another colour in the pictures that see it past the glass. The picture is a darker one.
static void test_points_behind_glass(void **state)
{
    (void)state;
    static struct glass g;
    int behind[2], visible[2];
    build_glass(&g);
    for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT * 3; k++)
        g.row[ROW / 2].rgb[k] = (uint8_t)(0.6 * g.row[ROW / 2].rgb[k]);
    count_seeds(&g, &behind[0], &visible[0]);
    g.world.rgb = (const uint8_t(*)[4])g.colors.rgb;
    count_seeds(&g, &behind[1], &visible[1]);
    EXPECT_AT_LEAST(behind[0], 300);
    EXPECT_AT_MOST(behind[1], 0.6 * behind[0]); // of some, nothing is known
    EXPECT_AT_LEAST(visible[1], 0.98 * visible[0]);
    for (int i = 0; i < ROW; i++)
        surround_picture_free(&g.row[i]);
    point_colors_free(&g.colors);
    box_room_close(&g.scene);
}

static void test_a_black_panorama(void **state)
{
    (void)state;
    struct box_world world;
    struct pose start;
    struct simulated_rover rover;
    struct rover_options options = rover_default_options();
    options.panorama_height = 128;
    options.view = view_lens;
    rover_stage_world(3, &world, &start);
    assert_int_equal(simulated_rover_open(&rover, &world, start, &options), OK);
    struct surroundings *r = &rover.surroundings;
    struct surround_picture black;
    struct depth_points none = {0};
    assert_int_equal(surround_picture_make(&black, calloc(128 * 256, 3), 256, 128, NULL), OK);
    assert_int_equal(surroundings_take(r, &black, &none, POSE_IDENTITY), OK);
    assert_int_equal(surroundings_draw(&rover.surroundings, room_camera(0, 0, 1.2)), OK);
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
    static const double exposures[ROOM_PICTURES][3] = {{0.7, 0.75, 0.8}, {1, 1, 1}, {1.3, 1.25, 1.1}};
    struct box_room s;
    struct exposure even = {0};
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    for (int i = 0; i < ROOM_PICTURES; i++)
        for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT * 3; k++) {
            const double value = s.pictures[i].rgb[k] * exposures[i][k % 3];
            s.pictures[i].rgb[k] = (uint8_t)(value < 255 ? value + 0.5 : 255);
        }
    for (int v = 0; v < ROOM_HEIGHT; v++) // a person, there in the second picture only
        for (int u = 0; u < ROOM_WIDTH / 5; u++)
            memset(s.pictures[1].rgb + 3 * (v * ROOM_WIDTH + u), 40, 3);
    const struct surround_picture *list[ROOM_PICTURES] = {&s.pictures[0], &s.pictures[1], &s.pictures[2]};
    assert_int_equal(exposure_even(&even, s.pictures, list, ROOM_PICTURES), OK);
    for (int c = 0; c < 3; c++) {
        const double one = s.pictures[1].gain[c] * exposures[1][c];
        for (int i = 0; i < ROOM_PICTURES; i++)
            EXPECT_NEAR(s.pictures[i].gain[c] * exposures[i][c] / one, 1, 0.02);
        EXPECT_NEAR(s.pictures[0].gain[c] * s.pictures[1].gain[c] * s.pictures[2].gain[c], 1, 0.02);
    }
    const int pairs = even.pair_count;
    assert_int_equal(exposure_even(&even, s.pictures, list, ROOM_PICTURES), OK); // nothing is measured twice
    EXPECT_INT(even.pair_count, pairs);
    exposure_free(&even);
    box_room_close(&s);
}

// Each picture's own exposure where it was taken; the pictures' ratios stay; and between, also where the picture that
// counts no more is exchanged, no jump.
static void test_a_view_has_the_exposure_of_its_place(void **state)
{
    (void)state;
    static const double exposures[ROOM_PICTURES] = {0.7, 1, 1.4};
    enum { STEPS = 100 };
    struct box_room s;
    struct exposure even = {0};
    const struct surround_picture *list[ROOM_PICTURES];
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    for (int i = 0; i < ROOM_PICTURES; i++) {
        list[i] = &s.pictures[i];
        for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT * 3; k++)
            s.pictures[i].rgb[k] = (uint8_t)fmin(255, s.pictures[i].rgb[k] * exposures[i] + 0.5);
    }
    assert_int_equal(exposure_even(&even, s.pictures, list, ROOM_PICTURES), OK);
    for (int near = 2; near <= ROOM_PICTURES; near++) {
        double before = 0;
        for (int step = 0; step <= STEPS; step++) {
            const struct vec3 from = s.pictures[0].world_from_camera.translation;
            const struct vec3 way = v3_sub(s.pictures[2].world_from_camera.translation, from);
            const struct vec3 at = v3_add(from, v3_scale(way, (double)step / STEPS));
            const struct pose eye = room_camera(at.x, at.y, at.z);
            assert_int_equal(surround_view_rank(eye, list, ROOM_PICTURES), OK);
            exposure_suit_view(&even, s.pictures, list, ROOM_PICTURES, near, eye);
            const double exposure = (double)s.pictures[1].gain[1]; // of the view, the second picture's being 1
            EXPECT_NEAR(s.pictures[0].gain[1] * exposures[0] / exposure, 1, 0.02);
            EXPECT_NEAR(s.pictures[2].gain[1] * exposures[2] / exposure, 1, 0.02);
            for (int i = 0; i < ROOM_PICTURES; i++)
                if (step == i * STEPS / 2)
                    EXPECT_NEAR(exposure, exposures[i], 0.06);
            if (step)
                EXPECT_NEAR(exposure / before, 1, 0.08); // of 1.4 or 0.7 in 50 steps
            before = exposure;
        }
    }
    exposure_free(&even);
    box_room_close(&s);
}

// One picture, or pictures that have nothing in common, keep their colours.
static void test_exposure_without_overlap(void **state)
{
    (void)state;
    struct box_room s;
    struct exposure even = {0};
    box_room_open(&s, &view_lens);
    box_room_film(&s);
    const struct surround_picture *list[2] = {&s.pictures[0], &s.pictures[1]};
    assert_int_equal(exposure_even(&even, s.pictures, list, 1), OK);
    EXPECT_NEAR(s.pictures[0].gain[0], 1, 0);
    for (int k = 0; k < ROOM_WIDTH * ROOM_HEIGHT; k++)
        s.pictures[1].inverse[k] = DEPTH_UNKNOWN;
    assert_int_equal(exposure_even(&even, s.pictures, list, 2), OK);
    EXPECT_NEAR(s.pictures[0].gain[0], 1, 0);
    EXPECT_NEAR(s.pictures[1].gain[0], 1, 0);
    exposure_free(&even);
    box_room_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_from_elsewhere),
        cmocka_unit_test(test_the_unseen_is_marked),
        cmocka_unit_test(test_what_is_only_extrapolated_is_unseen),
        cmocka_unit_test(test_what_others_look_through_is_unseen),
        cmocka_unit_test(test_silhouettes_finer_than_pixels),
        cmocka_unit_test(test_a_post_taller_than_its_points),
        cmocka_unit_test(test_a_thin_post_hides_the_wall),
        cmocka_unit_test(test_no_capture_yet),
        cmocka_unit_test(test_poses_off),
        cmocka_unit_test(test_beyond_a_wall),
        cmocka_unit_test(test_a_thin_pole),
        cmocka_unit_test(test_glass_and_walls_above),
        cmocka_unit_test(test_a_black_panorama),
        cmocka_unit_test(test_points_behind_glass),
        cmocka_unit_test(test_exposure_is_evened),
        cmocka_unit_test(test_a_view_has_the_exposure_of_its_place),
        cmocka_unit_test(test_exposure_without_overlap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
