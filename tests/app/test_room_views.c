// The filmed room behind an orbit, drawn by the graphics card: as the worker draws it, and from a moved viewpoint at
// once as it is in the end.
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/room_rehearsal.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = GLASS_LONG / 2, HEIGHT = GLASS_SHORT / 2, PIXELS = WIDTH * HEIGHT };

static struct rehearsal rehearsal;

static void open_glass(struct glass *g, bool by_card)
{
    const struct viewer_options options = {.file = rehearsal.file,
                                           .take = "turn",
                                           .photos = rehearsal.scratch.path,
                                           .fixed_resolution = true,
                                           .room_drawing = by_card ? ROOM_DRAWN_BY_CARD : ROOM_DRAWN_BY_WORKER,
                                           .refresh_hz = 60};
    glass_open(g, WIDTH, HEIGHT, &options);
    glass_draw(g);
    glass_seek(g, 0.5);
    glass_draw(g);
}

static bool is_done(struct glass *g, bool by_card)
{
    int views;
    struct room_worker *worker = viewer_room_view(g->viewer).worker;
    if (!worker)
        return false;
    if (by_card)
        return g->image->filmed && room_worker_idle(worker, &views) &&
               !room_views_more(viewer_room_view(g->viewer).views);
    const struct room_picture *p = room_worker_latest(worker);
    return p && p->final && v3_distance(p->world_from_view.translation, g->image->world_from_camera.translation) < 1e-6;
}

// Draws until the room is as good as it gets; the worker is asked once more when the viewpoint has come to rest.
static void wait_filmed(struct glass *g, bool by_card)
{
    int done = 0;
    for (const int64_t until = clock_now_ns() + 200000000000; clock_now_ns() < until && done < 60;) {
        glass_draw(g);
        done = is_done(g, by_card) ? done + 1 : 0;
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    EXPECT_INT(done, 60);
    glass_draw(g);
    glass_read(g);
}

static void test_as_the_worker_draws_it(void **state)
{
    (void)state;
    struct glass g;
    uint8_t *drawn = malloc(4 * PIXELS), *moved = malloc(4 * PIXELS);
    open_glass(&g, false);
    wait_filmed(&g, false);
    EXPECT_TRUE(!viewer_room_view(g.viewer).views);
    memcpy(drawn, g.rgba, 4 * PIXELS);
    glass_close(&g);

    open_glass(&g, true);
    wait_filmed(&g, true);
    const double apart = glass_difference(&g, drawn);
    memcpy(moved, g.rgba, 4 * PIXELS);
    g.state->orbit.angle_rad += 0.05; // some centimetres aside
    glass_draw(&g);
    glass_read(&g);
    const double moved_by = glass_difference(&g, moved);
    memcpy(moved, g.rgba, 4 * PIXELS);
    wait_filmed(&g, true);
    const double late = glass_difference(&g, moved);
    print_message("from the worker's picture %.2f; moved by %.2f, of which %.2f came late\n", apart, moved_by, late);
    EXPECT_AT_MOST(apart, 4);
    EXPECT_AT_LEAST(moved_by, 5);
    EXPECT_AT_MOST(late, 0.2 * moved_by);
    glass_close(&g);
    free(drawn);
    free(moved);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_as_the_worker_draws_it)};
    rehearsal = room_rehearsal_make();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    rehearsal_end(&rehearsal);
    return failed;
}
