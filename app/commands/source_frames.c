#include "app/commands/source_frames.h"

#include <stdio.h>

enum status source_frames_next(struct source_frames *s, struct frame *out)
{
    enum status status = NOTHING;
    while (!command_stopped()) {
        status = source_next(s->source, out);
        if (status != ERR_INPUT) // one damaged frame; the next call continues after it
            break;
        s->damaged++;
        if (s->program) {
            progress_bar_end(s->bar);
            fprintf(stderr, "%s: %s; left out\n", s->program, status_message());
        }
        status = NOTHING;
    }
    if (status == OK)
        s->count++;
    if (status != ERR_DEVICE || !s->count)
        return status;
    snprintf(s->cut, sizeof s->cut, "%s", status_message());
    return NOTHING;
}

enum status source_frames_end(const struct source_frames *s)
{
    return *s->cut ? fail(ERR_DEVICE, "%s: the result is of what it gave until then", s->cut) : OK;
}
