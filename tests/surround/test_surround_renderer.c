// The graphics card's picture of the surroundings against the processor's and against the truth, on the small world's
// room; and the hard cases: no capture yet, a black panorama, a viewpoint inside a wall, depth that one picture has
// wrong, pictures that come and go.
#include "tests/support/test.h"

#include "surround/gpu/surround_renderer.h"
#include "tests/support/box_room.h"
#include "tests/support/surround_readback.h"

static const struct lens view_lens = {.width = 320, .height = 240, .fx = 200, .fy = 200, .cx = 159.5, .cy = 119.5};
enum { PIXELS = 320 * 240 };

struct stage {
    struct box_room room;
    struct gpu *gpu;
    struct surround_renderer *renderer;
};

static void open_stage(struct stage *s, bool film)
{
    *s = (struct stage){0};
    box_room_open(&s->room, &view_lens);
    if (film)
        box_room_film(&s->room);
    assert_int_equal(gpu_open(&s->gpu), OK);
    assert_int_equal(surround_renderer_open(&s->renderer, s->gpu), OK);
}

static void close_stage(struct stage *s)
{
    surround_renderer_close(&s->renderer);
    gpu_close(&s->gpu);
    box_room_close(&s->room);
}

// Into room.view.
static void draw(struct stage *s, struct pose eye, int count, int max_uploads)
{
    const struct surround_picture *list[ROOM_PICTURES];
    const struct surround_image image = {view_lens, eye, view_default_options(), true, max_uploads};
    const struct gpu_texture *texture;
    for (int i = 0; i < count; i++)
        list[i] = &s->room.pictures[i];
    assert_int_equal(surround_view_rank(eye, list, count), OK);
    assert_int_equal(surround_renderer_draw(s->renderer, &image, list, count, &texture), OK);
    assert_non_null(texture);
    assert_int_equal(surround_readback(s->renderer, &s->room.view), OK);
}

static double psnr(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;
    for (int i = 0; i < 3 * PIXELS; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return 10 * log10(255 * 255 / (sum / (3 * PIXELS)));
}

static int unseen(const struct surround_view *v)
{
    int count = 0;
    for (int i = 0; i < PIXELS; i++)
        count += v->source[i] == SOURCE_UNSEEN;
    return count;
}

static void compare_from(struct stage *s, struct pose eye)
{
    static uint8_t rgb[PIXELS * 3], source[PIXELS];
    static float inverse_z[PIXELS];
    int other_source = 0, other_depth = 0;
    box_room_draw(&s->room, eye, ROOM_PICTURES);
    const struct room_measured processor = box_room_measure(&s->room);
    memcpy(rgb, s->room.view.rgb, sizeof rgb);
    memcpy(source, s->room.view.source, sizeof source);
    memcpy(inverse_z, s->room.view.inverse_z, sizeof inverse_z);
    draw(s, eye, ROOM_PICTURES, 0);
    const struct room_measured card = box_room_measure(&s->room);
    for (int i = 0; i < PIXELS; i++) {
        other_source += source[i] != s->room.view.source[i];
        other_depth +=
            source[i] && s->room.view.source[i] && fabsf(s->room.view.inverse_z[i] / inverse_z[i] - 1) > 0.02f;
    }
    const double same = psnr(rgb, s->room.view.rgb);
    print_message("against each other %.1f dB, another source %d, another depth %d\n", same, other_source, other_depth);
    EXPECT_AT_LEAST(same, 30);
    EXPECT_AT_LEAST(card.psnr_db, processor.psnr_db - 0.5);
    EXPECT_AT_LEAST(card.drawn, processor.drawn - 0.005);
    EXPECT_AT_MOST(card.depth_off, processor.depth_off + 0.005);
    EXPECT_AT_MOST(other_source, 0.005 * PIXELS);
    EXPECT_AT_MOST(other_depth, 0.01 * PIXELS);
}

static void test_as_the_processor_draws(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, true);
    compare_from(&s, room_camera(-0.6, 0.25, 1.5));
    compare_from(&s, room_camera(0.3, -0.8, 0.9));
    compare_from(&s, room_camera(-0.4, -0.3, 1.15)); // where a picture was taken
    struct pose turned = room_camera(0.1, 0.2, 1.2); // across the panoramas' seam, and at the floor
    turned.rotation = quat_multiply(quat_from_rotation_vector(v3(0, 0, 3)), turned.rotation);
    turned.rotation = quat_multiply(turned.rotation, quat_from_rotation_vector(v3(-0.7, 0, 0)));
    compare_from(&s, turned);
    close_stage(&s);
}

static int unseen_in(const struct surround_view *v, const struct room_plate *plate)
{
    int count = 0;
    for (int y = plate->top; y < plate->bottom; y++)
        for (int x = plate->left; x < plate->right; x++)
            count += v->source[y * view_lens.width + x] == SOURCE_UNSEEN;
    return count;
}

// As the processor marks it.
static void test_what_others_look_through_is_unseen(void **state)
{
    (void)state;
    struct stage s;
    const struct pose eye = room_camera(-0.6, 0.55, 1.15); // looks nearly as one of the others does
    open_stage(&s, true);
    const struct room_plate plate = box_room_put_plate(&s.room, eye);
    const int all = (plate.right - plate.left) * (plate.bottom - plate.top);
    box_room_draw(&s.room, eye, ROOM_PICTURES);
    const int by_processor = unseen_in(&s.room.view, &plate);
    draw(&s, eye, ROOM_PICTURES, 0);
    const int by_card = unseen_in(&s.room.view, &plate);
    print_message("of %d pixels %d marked by the processor, %d by the graphics card\n", all, by_processor, by_card);
    EXPECT_AT_LEAST(by_processor, 0.6 * all);
    EXPECT_AT_LEAST(by_card, 0.6 * all);
    close_stage(&s);
}

// Eight pictures see the box from the front. A ninth, asked no more, has the room's walls and floor behind it: measured
// everywhere, nowhere, or on one side of a line down the wall.
static void test_what_is_only_extrapolated_is_unseen(void **state)
{
    (void)state;
    enum { NEAR = 8 };
    static uint8_t source[PIXELS];
    static const int from_column[] = {ROOM_WIDTH, 0, 240}; // what is extrapolated
    struct stage s;
    struct surround_picture ninth;
    const struct surround_picture *list[NEAR + 1];
    const struct gpu_texture *texture;
    struct surround_image image = {view_lens, room_camera(0.8, 1.4, 1.3), view_default_options(), true, 0};
    image.options.geometry_pictures = NEAR + 1;
    open_stage(&s, true);
    struct box_world empty = s.room.world;
    empty.count = 1; // the room alone
    room_picture(&empty, s.room.pictures[0].world_from_camera, &ninth);
    for (int i = 0; i < NEAR; i++)
        list[i] = &s.room.pictures[0];
    list[NEAR] = &ninth;
    for (int k = 0; k < 3; k++) {
        int by_processor = 0, by_card = 0, other = 0;
        for (int i = 0; i < ROOM_WIDTH * ROOM_HEIGHT; i++)
            ninth.joined[i] =
                (uint8_t)((ninth.joined[i] & 7) | (i % ROOM_WIDTH >= from_column[k] ? DEPTH_EXTRAPOLATED : 0));
        ninth.depth_number = 10 + k;
        assert_int_equal(surround_view_draw(&s.room.view, image.world_from_view, list, NEAR + 1, &image.options), OK);
        memcpy(source, s.room.view.source, sizeof source);
        assert_int_equal(surround_renderer_draw(s.renderer, &image, list, NEAR + 1, &texture), OK);
        assert_int_equal(surround_readback(s.renderer, &s.room.view), OK);
        for (int i = 0; i < PIXELS; i++) {
            by_processor += source[i] == SOURCE_UNSEEN;
            by_card += s.room.view.source[i] == SOURCE_UNSEEN;
            other += source[i] != s.room.view.source[i];
        }
        print_message(
            "extrapolated from column %d on: %d unseen by the processor, %d by the graphics card, %d differ\n",
            from_column[k], by_processor, by_card, other);
        if (k > 0)
            EXPECT_AT_LEAST(by_processor, 1000);
        EXPECT_AT_MOST(other, 0.01 * PIXELS);
    }
    surround_picture_free(&ninth);
    close_stage(&s);
}

static void test_no_capture_yet(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, false);
    draw(&s, room_camera(0, 0, 1), 0, 0);
    EXPECT_INT(unseen(&s.room.view), PIXELS);
    for (int i = 0; i < PIXELS; i++) // hatched, not black
        EXPECT_AT_LEAST(s.room.view.rgb[3 * i], 90);
    close_stage(&s);
}

// Nothing is made up of it, and the other pictures' depth is none the worse.
static void test_a_black_panorama(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, true);
    memset(s.room.pictures[1].rgb, 0, (size_t)ROOM_WIDTH * ROOM_HEIGHT * 3);
    for (int i = 0; i < ROOM_WIDTH * ROOM_HEIGHT; i++)
        s.room.pictures[1].inverse[i] = DEPTH_UNKNOWN;
    surround_picture_join(&s.room.pictures[1]);
    const struct pose eye = room_camera(-0.1, 0.05, 1.2);
    draw(&s, eye, ROOM_PICTURES, 0);
    box_room_make_truth(&s.room, eye);
    const struct room_measured m = box_room_measure(&s.room);
    EXPECT_AT_LEAST(m.psnr_db, 22);
    EXPECT_AT_LEAST(m.drawn, 0.95);
    close_stage(&s);
}

// From inside the wall and from beyond it its back is not drawn, nor anything nearer than it is.
static void test_inside_and_beyond_a_wall(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, true);
    draw(&s, room_camera(-2.5, 0, 1.2), ROOM_PICTURES, 0);
    for (int i = 0; i < PIXELS; i++)
        if (s.room.view.source[i] != SOURCE_UNSEEN)
            EXPECT_AT_LEAST(1 / (double)s.room.view.inverse_z[i], 0.5);
    const struct pose inside = room_camera(1.65, 0, 0.5); // of the box: its sides are seen from their back
    draw(&s, inside, ROOM_PICTURES, 0);
    int near = 0;
    for (int i = 0; i < PIXELS; i++)
        near += s.room.view.source[i] != SOURCE_UNSEEN && s.room.view.inverse_z[i] > 1 / 0.14f;
    EXPECT_AT_MOST(near, 0.001 * PIXELS);
    close_stage(&s);
}

// One picture has a board a metre before it that is not there: the others, nearer to the eye, look through it.
static void test_what_others_look_through(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, true);
    const struct pose eye = room_camera(0.1, 0.2, 1.2);
    for (int v = 100; v < 156; v++)
        for (int u = 226; u < 286; u++)
            s.room.pictures[0].inverse[v * ROOM_WIDTH + u] = 1;
    surround_picture_join(&s.room.pictures[0]);
    draw(&s, eye, 1, 0);
    int alone = 0, left = 0;
    box_room_make_truth(&s.room, eye);
    for (int i = 0; i < PIXELS; i++)
        alone += s.room.view.source[i] && s.room.depth[i] * (double)s.room.view.inverse_z[i] > 1.2;
    draw(&s, eye, ROOM_PICTURES, 0);
    for (int i = 0; i < PIXELS; i++)
        left += s.room.view.source[i] && s.room.depth[i] * (double)s.room.view.inverse_z[i] > 1.2;
    print_message("too near: %d pixels of that picture alone, %d of all\n", alone, left);
    EXPECT_AT_LEAST(alone, 1000);
    EXPECT_AT_MOST(left, 0.1 * alone);
    close_stage(&s);
}

// A picture is uploaded once, again when its depth is another, and only so many at a time.
static void test_uploads(void **state)
{
    (void)state;
    struct stage s;
    open_stage(&s, true);
    const struct pose eye = room_camera(0, 0, 1.2);
    draw(&s, eye, ROOM_PICTURES, 1);
    const int64_t one = gpu_get_counts(s.gpu).uploads;
    draw(&s, eye, ROOM_PICTURES, 1);
    draw(&s, eye, ROOM_PICTURES, 1);
    const struct gpu_counts all = gpu_get_counts(s.gpu);
    EXPECT_AT_LEAST(all.uploads, one + 6);
    draw(&s, eye, ROOM_PICTURES, 0);
    EXPECT_INT(gpu_get_counts(s.gpu).uploads, all.uploads);
    EXPECT_INT(gpu_get_counts(s.gpu).bytes_held, all.bytes_held);
    for (int i = 0; i < ROOM_WIDTH * ROOM_HEIGHT; i++)
        s.room.pictures[0].inverse[i] = DEPTH_UNKNOWN;
    surround_picture_join(&s.room.pictures[0]);
    s.room.pictures[0].depth_number = 17;
    draw(&s, eye, 1, 0);
    EXPECT_INT(unseen(&s.room.view), PIXELS);
    EXPECT_AT_LEAST(gpu_get_counts(s.gpu).uploads, all.uploads + 3);
    close_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_the_processor_draws),
        cmocka_unit_test(test_no_capture_yet),
        cmocka_unit_test(test_a_black_panorama),
        cmocka_unit_test(test_inside_and_beyond_a_wall),
        cmocka_unit_test(test_what_others_look_through),
        cmocka_unit_test(test_what_others_look_through_is_unseen),
        cmocka_unit_test(test_what_is_only_extrapolated_is_unseen),
        cmocka_unit_test(test_uploads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
