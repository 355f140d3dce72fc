#include "app/commands/start_window.h"

#include "app/commands/command.h"
#include "base/clamp.h"
#include "base/clock.h"

enum { IDLE_MS = 500, LOADING_MS = 1 };

static double px_per_dp(struct window *window, const struct start *start)
{
    int width, height;
    window_size(window, &width, &height);
    return viewer_px_per_dp_with_text(viewer_px_per_dp(window_dpi(window)), start->state.text_size, width, height);
}

static void handle_events(struct window *window, struct start *start, int wait_ms)
{
    for (;;) {
        const struct window_event event = window_wait(window, wait_ms);
        wait_ms = 0;
        if (event.kind == WINDOW_DROPPED)
            start_drop(start, window_dropped_file(window));
        if (event.kind == WINDOW_NO_EVENT || start_event(start, &event, px_per_dp(window, start), clock_now_ns()))
            return;
    }
}

static enum status draw(struct window *window, struct start *start)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(window),
                                     .px_per_dp = px_per_dp(window, start)};
    window_size(window, &surface.width, &surface.height);
    const enum status status = start_draw(start, &surface, clock_now_ns());
    if (status == OK)
        window_present(window);
    return status;
}

static enum status run_loop(struct window *window, struct start *start, int64_t until_ns, struct start_choice *out)
{
    enum status status = OK;
    bool more = false;
    out->wish = START_WISHES_NOTHING;
    while (status == OK && out->wish == START_WISHES_NOTHING) {
        if (start->state.changed)
            status = draw(window, start);
        if (status == OK) {
            handle_events(window, start, more || start->state.changed ? LOADING_MS : IDLE_MS);
            status = start_update(start, &more);
        }
        if (command_stopped() || (until_ns && clock_now_ns() >= until_ns))
            start_wish(&start->state, START_WISHES_LEAVE);
        start_take_choice(start, out);
    }
    return status;
}

enum status start_window_run(struct window *window, struct gpu *gpu, const struct start_options *options,
                             int64_t until_ns, struct start_choice *out)
{
    struct start start;
    *out = (struct start_choice){.wish = START_WISHES_LEAVE};
    enum status status = start_open(&start, gpu, options);
    if (status == OK)
        status = run_loop(window, &start, until_ns, out);
    start_close(&start);
    return status;
}
