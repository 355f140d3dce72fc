// The free box of the page for watching is covered by none of its controls, on any screen, whatever is open; and an
// orbit shows the actor inside it.
#include "tests/support/test.h"

#include "app/ui/layout.h"
#include "app/ui/theme.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

#include <math.h>

enum { SHEETS = 5, STATES = SHEETS * 16 * 2 };

// Less where the CPU is emulated. SHARE: a screen's sides are those of a tablet divided by this.
#ifdef EMULATED
enum { SHARE = 4, WAYS_UP = 1, SHOWN = 2 };
#else
enum { SHARE = SANITIZED ? 4 : 2, WAYS_UP = SANITIZED ? 1 : 2, SHOWN = SANITIZED ? 2 : 4 };
#endif

// State number n: each sheet, with and without the inset, the sources, the frame graph, moving, and the map.
static struct view_state state_number(int n)
{
    struct view_state s = view_state_start(1, true, 0);
    s.sheet = (enum view_sheet)(n % SHEETS);
    s.inset = n / SHEETS & 1;
    s.sources = n / SHEETS & 2;
    s.frame_graph = n / SHEETS & 4;
    s.moving = n / SHEETS & 8;
    s.room.map = n / SHEETS & 16;
    s.sheet = s.moving ? SHEET_NONE : s.sheet;
    return s;
}

// The textures are dummies: the layout only asks whether they exist.
static const struct take_view_image shown = {.inset = (const struct gpu_texture *)&shown,
                                             .sources = (const struct gpu_texture *)&shown,
                                             .inset_aspect = 4.0 / 3};

static bool overlap(struct ui_box a, struct ui_box b)
{
    return a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
}

static bool within(struct ui_box a, double width, double height)
{
    return a.x >= 0 && a.y >= 0 && a.x + a.w <= width && a.y + a.h <= height;
}

static void check_layout(double width, double height, int state)
{
    const struct view_state s = state_number(state);
    const struct layout l = layout_of(width, height, &s, &shown);
    struct ui_box cards = l.cards;
    cards.h = (s.inset ? cards.w / shown.inset_aspect + GAP : 0) + (s.sources ? layout_sources_height() : 0);
    const bool sheet = s.sheet != SHEET_NONE;
    EXPECT_TRUE(within(l.panel, width, height) && within(l.frame_graph, width, height) &&
                within(l.free, width, height));
    EXPECT_TRUE(!overlap(l.free, l.panel));
    EXPECT_TRUE(!sheet || (within(l.sheet, width, height) && !overlap(l.free, l.sheet)));
    EXPECT_TRUE(sheet || s.moving || !overlap(l.free, l.shutter));
    EXPECT_TRUE(!s.frame_graph || !overlap(l.free, l.frame_graph));
    EXPECT_TRUE(!s.frame_graph || !sheet || !overlap(l.frame_graph, l.sheet));
    EXPECT_TRUE(!s.frame_graph || !overlap(l.frame_graph, l.panel));
    EXPECT_TRUE(!(s.inset || s.sources) || !overlap(l.free, cards));
    // Beside the map a picture has half the screen.
    EXPECT_AT_LEAST(fmin(l.free.w, l.free.h), (s.room.map ? 0.1 : 0.25) * fmin(width, height));
    EXPECT_TRUE(within(l.map, width, height) && !overlap(l.map, l.picture) && !overlap(l.free, l.map));
    EXPECT_NEAR(l.picture.w * l.picture.h + l.map.w * l.map.h, width * height, 1);
}

static void test_free_area_is_not_covered(void **state)
{
    (void)state;
    static const double sizes[][2] = {{1375, 859}, {859, 1375}, {1280, 800}, {1024, 768}, {768, 1024}, {1920, 1080}};
    for (size_t i = 0; i < COUNT_OF(sizes); i++)
        for (int n = 0; n < STATES; n++)
            check_layout(sizes[i][0], sizes[i][1], n);
}

static void test_actor_is_centred_without_panels(void **state)
{
    (void)state;
    const struct view_state s = state_number(0);
    const struct layout wide = layout_of(1375, 859, &s, &shown), upright = layout_of(859, 1375, &s, &shown);
    EXPECT_TRUE(wide.wide && !upright.wide);
    EXPECT_NEAR(wide.free.x + wide.free.w / 2, 1375 / 2.0, 1e-9);
    EXPECT_NEAR(upright.free.x + upright.free.w / 2, 859 / 2.0, 1e-9);
    EXPECT_AT_LEAST(wide.free.h, 0.75 * 859);
    EXPECT_AT_LEAST(upright.free.w, 0.95 * 859);
}

// The whole actor is in the free box, from all sides.
static void expect_actor_in_free_box(const struct glass *g)
{
    const struct take_view_image *p = g->image;
    const struct ui_box free = viewer_free_box(g->viewer);
    const double scale = glass_scale(g);
    const struct view_state *s = g->state;
    const struct layout l = layout_of(g->width / scale, g->height / scale, s, p);
    EXPECT_NEAR(free.x, l.free.x, 1e-9);
    EXPECT_NEAR(free.h, l.free.h, 1e-9);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct pixel px =
            lens_project(&p->lens, pose_apply(pose_inverse(p->world_from_camera), p->skeleton.joint[j]));
        const double x = (px.x + 0.5) / scale, y = (px.y + 0.5) / scale;
        if (p->skeleton.confidence[j] > 0)
            EXPECT_TRUE(x >= free.x && x <= free.x + free.w && y >= free.y && y <= free.y + free.h);
    }
}

static void test_orbit_places_actor_clear_of_controls(void **state)
{
    (void)state;
    struct rehearsal rehearsal = rehearsal_make();
    for (int upright = 0; upright < WAYS_UP; upright++) {
        struct glass g;
        const struct viewer_options options = {
            .file = rehearsal.file, .take = "turn", .fixed_resolution = true, .refresh_hz = 60};
        const int width = upright ? GLASS_SHORT : GLASS_LONG, height = upright ? GLASS_LONG : GLASS_SHORT;
        glass_open(&g, width / SHARE, height / SHARE, &options);
        struct view_state *s = g.state;
        glass_draw(&g);
        for (int n = 0; n < SHOWN; n++) {
            glass_seek(&g, n / 4.0);
            s->sheet = n == 1 ? SHEET_LAYERS : n == 2 ? SHEET_SPEED : SHEET_NONE;
            s->inset = s->frame_graph = n == 1;
            s->moving = n == 3;
            s->orbit.angle_rad += 0.7;
            glass_wait_idle(&g);
            expect_actor_in_free_box(&g);
        }
        glass_close(&g);
    }
    rehearsal_end(&rehearsal);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_free_area_is_not_covered),
        cmocka_unit_test(test_actor_is_centred_without_panels),
        cmocka_unit_test(test_orbit_places_actor_clear_of_controls),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
