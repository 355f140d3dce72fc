#include "tests/support/test.h"

#include "tests/support/studio_stage.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "recording/recording.h"

#include <stdio.h>
#include <string.h>

void stage_size(struct stage *g, int width, int height)
{
    gpu_target_close(&g->target);
    free(g->rgba);
    g->width = width;
    g->height = height;
    g->rgba = malloc((size_t)width * (size_t)height * 4);
    EXPECT_STATUS(gpu_target_open(&g->target, g->gpu, width, height), OK);
}

void stage_draw(struct stage *g)
{
    const int64_t now_ns = clock_now_ns() + g->skipped_ns;
    const struct viewer_surface surface = {g->target, g->width, g->height, 0, viewer_px_per_dp(149)};
    studio_update(&g->studio, now_ns);
    EXPECT_STATUS(studio_draw(&g->studio, &surface, now_ns), OK);
    if (g->studio.playing)
        viewer_presented(g->studio.viewer, now_ns);
}

void stage_wait_for(struct stage *g, enum studio_page page, int64_t frames)
{
    const int64_t until = clock_now_ns() + 200 * SECOND;
    do {
        stage_draw(g);
        clock_sleep_until_ns(clock_now_ns() + 20000000);
    } while (clock_now_ns() < until &&
             (g->studio.state.page != page || g->studio.shown.number < frames || !g->studio.shown.has_skeleton));
    EXPECT_INT(g->studio.state.page, page);
    stage_draw(g);
}

// How many colours the screen has: tells a picture from a plain page.
int stage_colors(struct stage *g)
{
    static bool seen[4096];
    int count = 0;
    EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK);
    memset(seen, 0, sizeof seen);
    for (int i = 0; i < g->width * g->height; i++) {
        const uint8_t *p = g->rgba + 4 * i;
        const int which = p[0] >> 4 << 8 | p[1] >> 4 << 4 | p[2] >> 4;
        count += !seen[which];
        seen[which] = true;
    }
    return count;
}

void stage_save(struct stage *g, const char *name)
{
    char path[600];
    if (!g->folder)
        return;
    EXPECT_STATUS(gpu_target_read(g->target, g->rgba), OK);
    uint8_t *rgb = malloc(3 * (size_t)g->width * (size_t)g->height);
    for (int i = 0; i < g->width * g->height; i++)
        memcpy(rgb + 3 * i, g->rgba + 4 * i, 3);
    snprintf(path, sizeof path, "%s/studio-%s.png", g->folder, name);
    EXPECT_STATUS(png_write(path, PNG_RGB8, rgb, g->width, g->height), OK);
    free(rgb);
}

static void set_dark(struct stage *stage, bool dark)
{
    stage->studio.state.dark = dark;
    if (stage->studio.viewer)
        viewer_state(stage->studio.viewer)->dark = dark;
}

// The page wide and upright, dark and light.
void stage_save_all(struct stage *g, const char *page)
{
    static const char *const themes[] = {"dark", "light"};
    for (int light = 0; light < 2 && g->folder; light++)
        for (int upright = 0; upright < 2; upright++) {
            char name[64];
            stage_size(g, upright ? 800 : 1280, upright ? 1280 : 800);
            set_dark(g, !light);
            stage_draw(g);
            snprintf(name, sizeof name, "%s-%s-%s", page, upright ? "upright" : "wide", themes[light]);
            stage_save(g, name);
        }
    set_dark(g, true);
    stage_size(g, 1280, 800);
}

void stage_press(struct stage *g, int key)
{
    const struct window_event event = {.kind = WINDOW_KEY, .key = key};
    studio_event(&g->studio, &event, 1, clock_now_ns() + g->skipped_ns);
    stage_draw(g);
}

void stage_type(struct stage *g, const char *text)
{
    struct window_event event = {.kind = WINDOW_TEXT};
    snprintf(event.text, sizeof event.text, "%s", text);
    studio_event(&g->studio, &event, 1, clock_now_ns() + g->skipped_ns);
    stage_draw(g);
}

int stage_takes_in(const char *file)
{
    struct recording *recording;
    if (!file_exists(file) || recording_open(&recording, file) != OK)
        return 0;
    int count = recording_take_count(recording);
    recording_free(&recording);
    return count;
}

void stage_close(struct stage *g)
{
    gpu_target_close(&g->target);
    gpu_close(&g->gpu);
    free(g->rgba);
    scratch_remove(&g->scratch);
}

void stage_tap(struct stage *g, double x, double y)
{
    const double px_per_dp = viewer_px_per_dp(149);
    for (int up = 0; up < 2; up++) {
        const struct window_event event = {
            .kind = up ? WINDOW_POINTER_UP : WINDOW_POINTER_DOWN, .pointer = 1, .x = x * px_per_dp, .y = y * px_per_dp};
        studio_event(&g->studio, &event, px_per_dp, clock_now_ns() + g->skipped_ns);
        stage_draw(g);
    }
}
