// What the app shows of the room about the actor, drawn into memory: labels at the things, the card, the search, the
// map, and the filmed room behind an orbit.
//
//     test_room_screens          the tests
//     test_room_screens FOLDER   images of the screens
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "platform/files/png.h"
#include "tests/support/glass.h"
#include "tests/support/room_rehearsal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONG = GLASS_LONG, SHORT = GLASS_SHORT };

// Less where the CPU is emulated or watched.
#ifdef EMULATED
enum { SHARE = 4 };
#else
enum { SHARE = SANITIZED ? 4 : 2 };
#endif

static struct rehearsal rehearsal;

static void open_glass(struct glass *g, int width, int height, const char *camera)
{
    const struct viewer_options options = {.file = rehearsal.file,
                                           .take = "turn",
                                           .camera = camera,
                                           .photos = rehearsal.scratch.path,
                                           .fixed_resolution = true,
                                           .room_drawing = ROOM_DRAWN_BY_WORKER,
                                           .refresh_hz = 60};
    glass_open(g, width, height, &options);
}

static void pause_at(struct glass *g, double share)
{
    glass_draw(g);
    glass_seek(g, share);
    glass_draw(g);
    glass_body(g);
    glass_draw(g);
}

// Draws until the room behind the orbit is as good as it gets.
static void wait_filmed(struct glass *g)
{
    const struct room_picture *p = NULL;
    for (int64_t until = clock_now_ns() + 200000000000; clock_now_ns() < until && !(p && p->final);) {
        glass_draw(g);
        p = viewer_room_view(g->viewer).worker ? room_worker_latest(viewer_room_view(g->viewer).worker) : NULL;
        if (p && p->final &&
            (v3_distance(p->world_from_view.translation, g->image->world_from_camera.translation) > 1e-6))
            p = NULL;
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    EXPECT_TRUE(p && p->final);
    glass_draw(g);
}

static void wait_map(struct glass *g)
{
    for (int64_t until = clock_now_ns() + 60000000000;
         clock_now_ns() < until && !viewer_room_view(g->viewer).mesh_came;) {
        glass_draw(g);
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    EXPECT_TRUE(viewer_room_view(g->viewer).mesh_came);
    glass_draw(g);
}

// A letter comes as a key and, where text is typed, as text.
static void type(struct glass *g, const char *keys)
{
    for (; *keys; keys++) {
        const struct window_event key = {.kind = WINDOW_KEY, .key = *keys};
        const struct window_event text = {.kind = WINDOW_TEXT, .text = {*keys}};
        const bool types = view_state_types(g->state);
        glass_event(g, &key);
        if (types && *keys >= 32)
            glass_event(g, &text);
        glass_draw(g);
    }
}

// Where the picture shows the thing, dp.
static struct ui_point on_screen(const struct glass *g, int thing)
{
    const struct take_view_image *p = g->image;
    const double scale = glass_scale(g);
    struct view_state *s = g->state;
    const struct layout l = layout_of(g->width / scale, g->height / scale, s, p);
    const struct figure_view view = {p->lens, p->world_from_camera, cover_of(&p->lens, l.picture), false};
    struct ui_point at = {-1, -1};
    EXPECT_TRUE(
        figure_point(&view, viewer_room_view(g->viewer).things->known.things[thing].world_from_thing.translation, &at));
    return at;
}

// ---------------------------------------------------------------- tests

static void test_a_touch_opens_what_is_known(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / SHARE, SHORT / SHARE, NULL);
    struct view_state *s = g.state;
    pause_at(&g, 0.5);
    EXPECT_INT(s->room.thing_count, ROOM_THINGS);
    glass_wait_idle(&g);
    const int *side = viewer_screens(g.viewer)->room.sides[0];
    EXPECT_TRUE(side[0] != LABEL_NO_SIDE);
    const struct ui_point at = on_screen(&g, 0), label = middle(viewer_screens(g.viewer)->room.boxes[0][0]);
    print_message("the dumbbell is at %.0f, %.0f dp, its label at %.0f, %.0f\n", at.x, at.y, label.x, label.y);
    EXPECT_AT_MOST(hypot(at.x - label.x, at.y - label.y), 160);
    glass_tap(&g, label);
    EXPECT_INT(s->sheet, SHEET_CARD);
    EXPECT_INT(s->room.card, 0);
    const struct thing_card *card = viewer_room_view(g.viewer).page->card;
    EXPECT_TRUE(card && card->picture && card->body && card->is_model);
    assert_string_equal(card->name, "Dumbbell, 2.5 kg");
    assert_string_equal(card->weight, "2.5 kg");
    assert_string_equal(card->source, "Kept in the recording.");
    // The model turns.
    enum { PX = 320 };
    static uint8_t first[PX * PX * 4], second[PX * PX * 4];
    EXPECT_STATUS(gpu_target_read(viewer_room_view(g.viewer).turning, first), OK);
    clock_sleep_until_ns(clock_now_ns() + 400000000);
    glass_draw(&g);
    EXPECT_STATUS(gpu_target_read(viewer_room_view(g.viewer).turning, second), OK);
    int drawn = 0, moved = 0;
    for (int i = 0; i < PX * PX; i++) {
        drawn += first[4 * i + 3] > 200;
        moved += memcmp(first + 4 * i, second + 4 * i, 3) != 0;
    }
    print_message("%d pixels of the model, %d changed\n", drawn, moved);
    EXPECT_AT_LEAST(drawn, PX * PX / 20);
    EXPECT_AT_LEAST(moved, PX * PX / 50);
    view_state_do(s, DO_BACK, clock_now_ns());
    glass_draw(&g);
    EXPECT_INT(s->sheet, SHEET_NONE);
    glass_close(&g);
}

static void test_typing_finds_a_thing(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / SHARE, SHORT / SHARE, NULL);
    struct view_state *s = g.state;
    pause_at(&g, 0.5);
    type(&g, "w");
    EXPECT_INT(s->sheet, SHEET_THINGS);
    type(&g, "chxai\b\b\bai");
    assert_string_equal(s->room.filter, "chai");
    type(&g, "\r");
    EXPECT_INT(s->sheet, SHEET_NONE);
    EXPECT_INT(s->room.wanted, 4);
    glass_draw(&g);
    glass_read(&g);
    const int led = glass_count_color(&g, theme_of(true)->accent, 8);
    s->room.wanted = ROOM_NOTHING;
    glass_draw(&g);
    glass_read(&g);
    const int plain = glass_count_color(&g, theme_of(true)->accent, 8);
    print_message("accent: %d pixels with the arrow, %d without\n", led, plain);
    EXPECT_AT_LEAST(led - plain, 60);
    type(&g, "w");
    glass_tap(&g, (struct ui_point){1100, 260}); // the first row of the list
    EXPECT_TRUE(s->room.wanted >= 0 && s->room.wanted < ROOM_THINGS);
    glass_close(&g);
}

static double share_of_color(const struct glass *g, struct ui_box dp)
{
    const double scale = glass_scale(g);
    int colored = 0, all = 0;
    for (int y = (int)(dp.y * scale); y < (int)((dp.y + dp.h) * scale); y++)
        for (int x = (int)(dp.x * scale); x < (int)((dp.x + dp.w) * scale); x++, all++) {
            const uint8_t *p = g->rgba + 4 * (y * g->width + x);
            const int low = p[0] < p[1] ? p[0] < p[2] ? p[0] : p[2] : p[1] < p[2] ? p[1] : p[2];
            const int high = p[0] > p[1] ? p[0] > p[2] ? p[0] : p[2] : p[1] > p[2] ? p[1] : p[2];
            colored += high - low > 24;
        }
    return (double)colored / all;
}

static void test_the_map_is_beside_the_picture(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / SHARE, SHORT / SHARE, rehearsal.camera);
    struct view_state *s = g.state;
    glass_wait_located(&g, true);
    glass_seek(&g, 0.5);
    view_state_do(s, DO_MAP, clock_now_ns());
    wait_map(&g);
    glass_read(&g);
    const double w = g.width / glass_scale(&g), h = g.height / glass_scale(&g);
    const double colored = share_of_color(&g, (struct ui_box){0.55 * w, 0.15 * h, 0.4 * w, 0.6 * h});
    print_message("%.2f of the map's middle is coloured\n", colored);
    EXPECT_AT_LEAST(colored, 0.1);
    EXPECT_TRUE(viewer_room_view(g.viewer).page->viewer_known && viewer_room_view(g.viewer).page->path_count >= 1);
    // A robot that was driven there, and its way.
    EXPECT_TRUE(*viewer_room_view(g.viewer).driven && viewer_room_view(g.viewer).page->drive);
    const int with = glass_count_color(&g, theme_of(true)->right, 8);
    *viewer_room_view(g.viewer).driven = false;
    glass_draw(&g);
    glass_read(&g);
    const int without = glass_count_color(&g, theme_of(true)->right, 8);
    print_message("the robot's colour: %d pixels with it, %d without\n", with, without);
    EXPECT_AT_LEAST(with - without, 20); // lines, mostly blended
    // A finger and the wheel move the map's viewpoint and not the actor's.
    const struct orbit map = s->room.map_orbit, orbit = s->orbit;
    struct window_event e = {.kind = WINDOW_POINTER_DOWN, .pointer = 1, .x = 0.75 * w, .y = 0.4 * h};
    glass_event(&g, &e);
    glass_draw(&g);
    e.kind = WINDOW_POINTER_MOVE;
    e.x -= 60 / glass_scale(&g);
    glass_event(&g, &e);
    glass_draw(&g);
    e = (struct window_event){.kind = WINDOW_WHEEL, .amount = 2};
    glass_event(&g, &e);
    glass_draw(&g);
    EXPECT_AT_LEAST(s->room.map_orbit.angle_rad - map.angle_rad, 0.2);
    EXPECT_AT_LEAST(map.distance_m - s->room.map_orbit.distance_m, 0.2);
    EXPECT_NEAR(s->orbit.angle_rad, orbit.angle_rad, 0);
    e = (struct window_event){.kind = WINDOW_PAD_AXIS, .axis = PAD_RIGHT_X, .amount = 1};
    const double before = s->room.map_orbit.angle_rad;
    glass_event(&g, &e);
    glass_draw(&g);
    clock_sleep_until_ns(clock_now_ns() + 50000000);
    glass_draw(&g);
    EXPECT_TRUE(s->room.map_orbit.angle_rad != before);
    glass_close(&g);
}

// ---------------------------------------------------------------- the filmed room

// The mean difference between what an orbit shows and what a camera there would have seen, over what was filmed; and
// the share of it.
static double difference_to_truth(const struct glass *g, const struct world *w, double *filmed)
{
    const struct room_picture *p = room_worker_latest(viewer_room_view(g->viewer).worker);
    const size_t pixels = (size_t)p->lens.width * (size_t)p->lens.height;
    uint8_t *truth = malloc(3 * pixels);
    const struct world_shot shot = {p->lens, p->world_from_view, 0, false};
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.color = truth}), OK);
    double sum = 0, count = 0;
    for (size_t i = 0; i < pixels; i++)
        if (p->rgba[4 * i + 3])
            for (size_t c = 0; c < 3; c++, count++)
                sum += abs(p->rgba[4 * i + c] - truth[3 * i + c]);
    free(truth);
    *filmed = count / 3 / (double)pixels;
    return sum / count;
}

// What the orbit shows where no recorded view reaches: how much of the picture that was, and how much of it the map's
// surface leaves open, which is hatched; and how far the surface is off from what a camera would have seen there.
struct filling {
    double unfilmed, open, off;
};

static struct filling filling_of(const struct glass *g, const struct world *w)
{
    const struct room_picture *p = room_worker_latest(viewer_room_view(g->viewer).worker);
    const struct lens of_surface = viewer_room_view(g->viewer).surface_lens, *lens = &of_surface;
    uint8_t *truth = malloc(3 * lens_pixels(&p->lens)), *surface = malloc(4 * lens_pixels(lens));
    const struct world_shot shot = {p->lens, p->world_from_view, 0, false};
    struct filling out = {0, 0, 0};
    double count = 0;
    EXPECT_STATUS(world_render(w, &shot, &(struct world_image){.color = truth}), OK);
    EXPECT_STATUS(gpu_target_read(viewer_room_view(g->viewer).surface, surface), OK);
    for (int y = 0; y < p->lens.height; y++)
        for (int x = 0; x < p->lens.width; x++) {
            const int i = y * p->lens.width + x;
            const struct pixel there = lens_project(lens, lens_ray(&p->lens, (struct pixel){x, y}));
            const int sx = (int)lround(there.x), sy = (int)lround(there.y);
            if (p->rgba[4 * i + 3] || sx < 0 || sy < 0 || sx >= lens->width || sy >= lens->height)
                continue;
            const uint8_t *filled = surface + 4 * (sy * lens->width + sx);
            out.unfilmed++;
            out.open += filled[3] < 128;
            for (int c = 0; c < 3 && filled[3] >= 128; c++, count++)
                out.off += abs(filled[c] - truth[3 * i + c]);
        }
    out.off /= fmax(count, 1);
    out.unfilmed /= (double)lens_pixels(&p->lens);
    out.open /= (double)lens_pixels(&p->lens);
    free(truth);
    free(surface);
    return out;
}

static void expect_filled(const char *when, struct filling f, double least)
{
    print_message("%s: %.3f of the picture not filmed, %.3f known by nothing; surface off by %.1f\n", when, f.unfilmed,
                  f.open, f.off);
    EXPECT_AT_LEAST(f.unfilmed, least);
    EXPECT_AT_MOST(f.open, 0.12); // of it the ceiling, which is not seen anywhere
    EXPECT_AT_MOST(f.off, 40);
}

// The first picture, of two recorded views, and then all of them, from round about.
static void test_the_map_fills_what_was_not_filmed(void **state)
{
    (void)state;
    struct glass g;
    struct world *world;
    struct world_options options = world_default_options();
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    open_glass(&g, LONG / 4, SHORT / 4, NULL);
    pause_at(&g, 0.5);
    const double angle = g.state->orbit.angle_rad;
    while (!room_worker_latest(viewer_room_view(g.viewer).worker) || !viewer_room_view(g.viewer).surface) {
        glass_draw(&g);
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    const struct filling first = filling_of(&g, world);
    expect_filled("first picture", first, 0.1);
    EXPECT_AT_MOST(first.open, 0.5 * first.unfilmed);
    for (int i = 0; i < (SANITIZED ? 2 : 4); i++) { // any side runs the same code
        g.state->orbit.angle_rad = angle + i * 1.5707963267948966;
        glass_wait_idle(&g);
        wait_filmed(&g);
        expect_filled("another side", filling_of(&g, world), 0);
    }
    glass_close(&g);
    world_close(&world);
}

// While the viewpoint moves, each frame shows the room from its own viewpoint, whatever the worker does meanwhile.
static void expect_room_moves(struct glass *g)
{
    struct view_state *s = g->state;
    const int64_t number = room_worker_latest(viewer_room_view(g->viewer).worker)->number;
    const size_t pixels = (size_t)g->width * (size_t)g->height;
    uint8_t *moved = malloc(4 * pixels), *made = malloc(4 * pixels);
    s->orbit.angle_rad += 0.05; // some centimetres aside
    glass_draw(g);
    EXPECT_TRUE(g->image->filmed);
    const bool bent = room_worker_latest(viewer_room_view(g->viewer).worker)->number == number;
    glass_read(g);
    memcpy(moved, g->rgba, 4 * pixels);
    wait_filmed(g);
    glass_read(g);
    memcpy(made, g->rgba, 4 * pixels);
    const double off = glass_difference(g, moved);
    print_message("bent to the new viewpoint: %d; off by %.2f from the picture made for it\n", bent, off);
    EXPECT_AT_MOST(off, 9); // measured 1.64
    free(moved);
    free(made);
}

static void test_an_orbit_shows_and_moves_the_filmed_room(void **state)
{
    (void)state;
    struct glass g;
    struct world *world;
    struct world_options options = world_default_options();
    options.threads = 2;
    EXPECT_STATUS(world_open(&world, &options), OK);
    open_glass(&g, LONG / SHARE, SHORT / SHARE, NULL);
    struct view_state *s = g.state;
    pause_at(&g, 0.5);
    wait_filmed(&g);
    double filmed;
    const double off = difference_to_truth(&g, world, &filmed);
    print_message("%.2f of the picture was filmed, off by %.1f grey levels from what a camera would see\n", filmed,
                  off);
    EXPECT_AT_LEAST(filmed, 0.5); // measured 0.95
    EXPECT_AT_MOST(off, 14);      // measured 4.4
    EXPECT_TRUE(g.image->filmed && viewer_request(g.viewer)->in_room);
    expect_room_moves(&g);
    // Where nothing was filmed the ground and its hatching are seen: the layer is transparent there.
    glass_read(&g);
    uint8_t *with = malloc((size_t)g.width * (size_t)g.height * 4);
    memcpy(with, g.rgba, (size_t)g.width * (size_t)g.height * 4);
    view_state_do(s, DO_FILMED, clock_now_ns());
    glass_draw(&g);
    glass_draw(&g);
    EXPECT_TRUE(!g.image->filmed && !viewer_request(g.viewer)->in_room);
    glass_read(&g);
    EXPECT_AT_LEAST(glass_difference(&g, with), 8);
    free(with);
    glass_close(&g);
    world_close(&world);
}

// ---------------------------------------------------------------- what hides things

enum { BEHIND_ACTOR, BEFORE_ACTOR, PLACED };

// On the line of sight to the actor's trunk, so far beyond it.
static void put_thing(struct glass *g, int thing, double beyond_m)
{
    const struct take_view_image *p = g->image;
    const struct vec3 eye = p->world_from_camera.translation, trunk = p->skeleton.joint[JOINT_TORSO];
    const struct vec3 along = v3_unit(v3_sub(trunk, eye));
    struct room_thing *t = &viewer_room_view(g->viewer).things->shown[thing];
    t->world_from_thing = (struct pose){p->world_from_camera.rotation, v3_add(trunk, v3_scale(along, beyond_m))};
    t->width_m = t->height_m = 0.1;
    t->sigma_m = 0.005;
}

static void open_with_hidden_things(struct glass *g, int share)
{
    open_glass(g, LONG / share, SHORT / share, NULL);
    pause_at(g, 0.5);
    glass_prepare(g);
    put_thing(g, BEHIND_ACTOR, 0.6);
    put_thing(g, BEFORE_ACTOR, -0.6);
    for (int i = 0; i < 3; i++) {
        viewer_redraw(g->viewer); // the same request, of other things
        glass_draw(g);
    }
}

// How much of the picture a label's middle covers, pixels.
static int covered(const struct glass *g, const uint8_t *without, struct ui_box label)
{
    const double scale = glass_scale(g);
    const struct ui_point m = middle(label);
    int count = 0;
    for (int x = (int)((m.x - 20) * scale); x < (int)((m.x + 20) * scale); x++)
        for (int y = (int)((m.y - 14) * scale); y < (int)((m.y + 14) * scale); y++)
            count += memcmp(g->rgba + 4 * (y * g->width + x), without + 4 * (y * g->width + x), 3) != 0;
    return count;
}

// Of two things on one line of sight the one before the actor is in sight; the other one's name is an outline.
static void test_what_the_actor_hides_is_an_outline(void **state)
{
    (void)state;
    struct glass g;
    open_with_hidden_things(&g, SHARE);
    const struct room_ui *ui = &viewer_screens(g.viewer)->room;
    EXPECT_TRUE(viewer_room_view(g.viewer).things->shown[BEHIND_ACTOR].hidden);
    EXPECT_TRUE(!viewer_room_view(g.viewer).things->shown[BEFORE_ACTOR].hidden);
    EXPECT_TRUE(ui->sides[0][BEHIND_ACTOR] != LABEL_NO_SIDE && ui->sides[0][BEFORE_ACTOR] != LABEL_NO_SIDE);
    const size_t bytes = (size_t)g.width * (size_t)g.height * 4;
    uint8_t *without = malloc(bytes), *with = malloc(bytes);
    EXPECT_TRUE(without && with);
    glass_read(&g);
    memcpy(with, g.rgba, bytes);
    g.state->room.names = false;
    glass_draw(&g);
    glass_read(&g);
    memcpy(without, g.rgba, bytes);
    memcpy(g.rgba, with, bytes);
    const int hidden = covered(&g, without, ui->boxes[0][BEHIND_ACTOR]),
              in_sight = covered(&g, without, ui->boxes[0][BEFORE_ACTOR]);
    print_message("pixels that the label covers: %d hidden, %d in sight\n", hidden, in_sight);
    EXPECT_AT_LEAST(hidden, 10);
    EXPECT_AT_MOST(hidden, 0.8 * in_sight);
    free(without);
    free(with);
    glass_close(&g);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = room_rehearsal_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

// ---------------------------------------------------------------- images

enum { IMAGES = 6 };
static const char *const names[IMAGES] = {"labels", "card", "find", "map", "orbit-room", "arrow"};

static void show(struct glass *g, int n)
{
    struct view_state *s = g->state;
    s->sheet = SHEET_NONE;
    s->room.map = n == 3;
    s->orbit_requested = n == 4;
    s->room.wanted = n == 5 ? 4 : n == 3 ? 1 : ROOM_NOTHING;
    s->room.card = n == 1 ? 0 : ROOM_NOTHING;
    s->sheet = n == 1 ? SHEET_CARD : n == 2 ? SHEET_THINGS : SHEET_NONE;
    glass_draw(g);
    glass_draw(g);
    if (n == 3)
        wait_map(g);
    if (n == 4) {
        s->orbit.angle_rad = take_view_orbit(viewer_take_view(g->viewer)).angle_rad + 0.35;
        s->orbit.rise_rad = 0.2;
        glass_wait_idle(g);
        wait_filmed(g);
    }
    glass_draw(g);
}

static void save_hidden(const char *folder)
{
    struct glass g;
    char path[600];
    open_with_hidden_things(&g, 1);
    glass_read(&g);
    snprintf(path, sizeof path, "%s/hidden-wide-dark.png", folder);
    EXPECT_STATUS(png_write(path, PNG_RGBA8, g.rgba, g.width, g.height), OK);
    glass_close(&g);
}

static void save_images(const char *folder)
{
    save_hidden(folder);
    for (int upright = 0; upright < 2; upright++) {
        struct glass g;
        char path[600];
        open_glass(&g, upright ? SHORT : LONG, upright ? LONG : SHORT, rehearsal.camera);
        glass_wait_located(&g, true);
        glass_prepare(&g);
        glass_seek(&g, 0.4);
        for (int n = 0; n < IMAGES; n++)
            for (int dark = 1; dark >= 0; dark--) {
                g.state->dark = dark;
                show(&g, n);
                glass_read(&g);
                snprintf(path, sizeof path, "%s/%s-%s-%s.png", folder, names[n], upright ? "upright" : "wide",
                         dark ? "dark" : "light");
                EXPECT_STATUS(png_write(path, PNG_RGBA8, g.rgba, g.width, g.height), OK);
            }
        glass_close(&g);
    }
}

int main(int argc, char **argv)
{
    if (argc == 2) {
        rehearsal = room_rehearsal_make();
        save_images(argv[1]);
        rehearsal_end(&rehearsal);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_touch_opens_what_is_known),
        cmocka_unit_test(test_typing_finds_a_thing),
        cmocka_unit_test(test_the_map_is_beside_the_picture),
        cmocka_unit_test(test_an_orbit_shows_and_moves_the_filmed_room),
        cmocka_unit_test(test_the_map_fills_what_was_not_filmed),
        cmocka_unit_test(test_what_the_actor_hides_is_an_outline),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
