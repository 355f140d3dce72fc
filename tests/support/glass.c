#include "tests/support/test.h"

#include "tests/support/glass.h"

#include "base/clock.h"

#include <stdlib.h>

static const double DPI = 149; // of a 10-inch tablet

void glass_open(struct glass *g, int width, int height, const struct viewer_options *options)
{
    *g = (struct glass){.width = width, .height = height, .rgba = malloc((size_t)width * (size_t)height * 4)};
    EXPECT_STATUS(gpu_open(&g->gpu), OK);
    EXPECT_STATUS(gpu_target_open(&g->target, g->gpu, width, height), OK);
    EXPECT_STATUS(viewer_open(&g->viewer, g->gpu, options), OK);
    g->state = viewer_state(g->viewer);
    g->image = viewer_image(g->viewer);
}

void glass_close(struct glass *g)
{
    viewer_close(&g->viewer);
    gpu_target_close(&g->target);
    gpu_close(&g->gpu);
    free(g->rgba);
}

double glass_scale(const struct glass *g)
{
    return viewer_px_per_dp(DPI) * (g->width > g->height ? g->width : g->height) / GLASS_LONG;
}

int64_t glass_now_ns(const struct glass *g) { return clock_now_ns() - g->behind_ns; }

void glass_draw(struct glass *g)
{
    const struct viewer_surface glass = {g->target, g->width, g->height, 0, glass_scale(g)};
    const int64_t now = glass_now_ns(g);
    viewer_update(g->viewer, now);
    EXPECT_STATUS(viewer_draw(g->viewer, &glass, now), OK);
    viewer_presented(g->viewer, clock_now_ns());
}

bool glass_event(struct glass *g, const struct window_event *event)
{
    const double scale = glass_scale(g);
    struct window_event e = *event;
    e.x *= scale;
    e.y *= scale;
    return viewer_event(g->viewer, &e, scale, glass_now_ns(g));
}

void glass_press(struct glass *g, int key)
{
    glass_event(g, &(struct window_event){.kind = WINDOW_KEY, .key = key});
    glass_draw(g);
}

void glass_turn_wheel(struct glass *g, double notches)
{
    glass_event(g, &(struct window_event){.kind = WINDOW_WHEEL, .amount = notches});
    glass_draw(g);
}

void glass_tap(struct glass *g, struct ui_point at)
{
    struct window_event finger = {.kind = WINDOW_POINTER_DOWN, .pointer = 3, .x = at.x, .y = at.y};
    EXPECT_TRUE(glass_event(g, &finger));
    glass_draw(g);
    finger.kind = WINDOW_POINTER_UP;
    EXPECT_TRUE(glass_event(g, &finger));
    glass_draw(g);
    glass_draw(g);
}

void glass_draw_and_wait(struct glass *g)
{
    glass_draw(g);
    const struct take_view *view = viewer_take_view(g->viewer);
    if (view && take_view_progress(view) < 1)
        clock_sleep_until_ns(clock_now_ns() + 50000000);
}

void glass_body(struct glass *g)
{
    for (int64_t until = clock_now_ns() + 200000000000; g->image->making && clock_now_ns() < until;)
        glass_draw_and_wait(g);
    EXPECT_TRUE(!g->image->making);
}

void glass_prepare(struct glass *g)
{
    for (int64_t until = clock_now_ns() + 200000000000;
         (g->state->crossfade < 1 || !g->image->full) && clock_now_ns() < until;)
        glass_draw_and_wait(g);
    EXPECT_NEAR(g->state->crossfade, 1, 0);
}

void glass_wait_idle(struct glass *g)
{
    int drawn = 0;
    do
        glass_draw(g);
    while ((g->state->changed || drawn < 2) && drawn++ < 100);
}

void glass_read(struct glass *g) { EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK); }

void glass_wait_located(struct glass *g, bool placed)
{
    struct view_state *s = g->state;
    int64_t until = clock_now_ns() + 60000000000;
    do {
        glass_draw(g);
        clock_sleep_until_ns(clock_now_ns() + 2000000);
    } while (clock_now_ns() < until &&
             (!s->camera.frame || s->camera.placed != placed || s->presence != (placed ? 1 : 0)));
    EXPECT_INT(s->camera.placed, placed);
    EXPECT_NEAR(s->presence, placed ? 1 : 0, 0);
}

void glass_seek(struct glass *g, double share)
{
    struct view_state *s = g->state;
    playback_play(&s->playback, glass_now_ns(g), false);
    playback_seek(&s->playback, glass_now_ns(g), (int64_t)(share * (double)s->playback.length_ns));
}

int glass_count_color(const struct glass *g, uint32_t color, int slack)
{
    int count = 0;
    for (long i = 0; i < (long)g->width * g->height; i++) {
        const uint8_t *p = g->rgba + 4 * i;
        count += abs(p[0] - (int)(color >> 24)) <= slack && abs(p[1] - (int)(color >> 16 & 255)) <= slack &&
                 abs(p[2] - (int)(color >> 8 & 255)) <= slack;
    }
    return count;
}

double glass_difference(const struct glass *g, const uint8_t *other)
{
    double sum = 0;
    long count = (long)g->width * g->height * 4;
    for (long i = 0; i < count; i++)
        sum += abs(g->rgba[i] - other[i]);
    return sum / (double)count;
}
