#include "capture/take_frames.h"

#include <stdio.h>

static enum status read_frame(struct source *source, const struct recorder_options *options, struct frame *frame,
                              struct recorder_result *result)
{
    for (;;) {
        if (options->should_stop && options->should_stop())
            return NOTHING;
        enum status status = source_next(source, frame);
        if (status != ERR_INPUT && status != ERR_CORRUPT && status != ERR_MISSING)
            return status;
        if (!result->damaged++)
            snprintf(result->first_damage, sizeof result->first_damage, "%.255s", status_message());
    }
}

enum status take_frames_next(struct take_clock *c, struct source *source, const struct recorder_options *options,
                             struct frame *frame, struct recorder_result *result)
{
    bool paused = false;
    for (;;) {
        enum status status = read_frame(source, options, frame, result);
        if (status != OK)
            return status;
        if (!options->paused || !options->paused(options->context))
            break;
        result->pauses += !paused;
        paused = true;
        if (options->on_paused)
            options->on_paused(options->context, frame);
    }
    c->after_pause = paused && c->frames;
    if (c->after_pause)
        c->closed_ns = frame->time_ns - c->last_ns - RECORDER_PAUSE_NS;
    frame->time_ns -= c->closed_ns;
    c->last_ns = frame->time_ns;
    c->first_ns = c->frames++ ? c->first_ns : c->last_ns;
    return OK;
}
