#include "app/commands/studio_window.h"

#include "app/commands/command.h"
#include "base/clamp.h"
#include "base/clock.h"

struct studio_run {
    struct window *window;
    struct studio studio;
    int page_shown; // the studio's in its last frame
    bool played;    // the last frame was the player's
};

static void wake_window(void *self) { window_wake(((struct studio_run *)self)->window); }

// Whether the frame shows another page than the one before. What was pressed until now was not meant for this one.
static bool is_other_page(struct studio_run *run)
{
    struct input_map *input = &run->studio.input;
    bool other = run->studio.playing != run->played;
    run->played = run->studio.playing;
    if (run->studio.playing)
        return viewer_presented(run->studio.viewer, clock_now_ns()) || other;
    other |= input->shown_page != run->page_shown;
    if (other)
        input_map_forget(input);
    run->page_shown = input->shown_page;
    return other;
}

static enum status draw_page(struct studio_run *run, double px_per_dp, int64_t now_ns)
{
    struct viewer_surface surface = {.quarter_turns = window_quarter_turns(run->window), .px_per_dp = px_per_dp};
    window_size(run->window, &surface.width, &surface.height);
    enum status status = studio_draw(&run->studio, &surface, now_ns);
    if (status != OK)
        return status;
    window_present(run->window);
    if (is_other_page(run))
        window_drop_input(run->window);
    return OK;
}

static enum status run_event_loop(struct studio_run *run, int64_t until_ns)
{
    int64_t due_ns = 0;
    while (!studio_finished(&run->studio)) {
        int width, height;
        window_size(run->window, &width, &height);
        const double px_per_dp = viewer_px_per_dp_with_text(viewer_px_per_dp(window_dpi(run->window)),
                                                            run->studio.state.text_size, width, height);
        int64_t wait_ns = due_ns - clock_now_ns();
        for (;;) {
            const int wait_ms = (int)clamp_int64(wait_ns / 1000000, 0, 100);
            const struct window_event event = window_wait(run->window, wait_ms);
            wait_ns = 0;
            if (event.kind == WINDOW_NO_EVENT || studio_event(&run->studio, &event, px_per_dp, clock_now_ns()))
                break;
        }
        const int64_t now_ns = clock_now_ns();
        if ((until_ns && now_ns >= until_ns) || command_stopped())
            studio_do(&run->studio.state, STUDIO_QUIT, now_ns);
        due_ns = studio_update(&run->studio, now_ns);
        window_type(run->window, studio_types(&run->studio));
        if (!studio_changed(&run->studio))
            continue;
        enum status status = draw_page(run, px_per_dp, now_ns);
        if (status != OK)
            return status;
        if (run->studio.playing)
            due_ns = now_ns + 16000000;
    }
    return OK;
}

enum status studio_window_run(struct window *window, struct gpu *gpu, const struct studio_options *options,
                              int64_t until_ns)
{
    static struct studio_run run; // snapshots are too large for the stack
    struct studio_options how = *options;
    run = (struct studio_run){.window = window};
    how.refresh_hz = window_refresh_hz(window);
    how.wake = wake_window;
    how.wake_self = &run;
    enum status status = studio_open(&run.studio, gpu, &how);
    if (status == OK)
        status = run_event_loop(&run, until_ns);
    studio_close(&run.studio);
    return status;
}
