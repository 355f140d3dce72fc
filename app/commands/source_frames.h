// A source's frames one by one, for commands that go through all of them. Main thread.
#pragma once
#include "app/commands/command.h"
#include "platform/sensors/source.h"

struct source_frames {
    struct source *source; // borrowed
    const char *program;   // says each damaged frame on stderr, having cleared the bar; NULL: they are only counted
    struct progress_bar *bar;
    int64_t count, damaged;
    char cut[200]; // why a live source failed before it was told to end: "the … was unplugged"; "": it did not
};

// OK: *out is the next frame; damaged ones are left out. NOTHING: the end, or Ctrl-C; or the source failed, but not
// before its first frame: what it gave until then counts, and `cut` is to be said with the result. Errors of
// source_next.
MUST_CHECK enum status source_frames_next(struct source_frames *s, struct frame *out);

// When the result is written. ERR_DEVICE with a sentence: it was cut short.
MUST_CHECK enum status source_frames_end(const struct source_frames *s);
