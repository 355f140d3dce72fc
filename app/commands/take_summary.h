// What the commands say of a take in numbers.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/recorder.h"
#include "recording/recorded_verdict.h"

#include <pthread.h>

// ---------------------------------------------------------------- coaching line

// The coach beside a recorder: fed on the recorder's processing thread, read on the caller's.

struct coaching_line {
    pthread_mutex_t lock;
    struct coach coach; // of the processing thread until recorder_run returns
    char text[96];      // guarded by lock
};

void coaching_line_start(struct coaching_line *line, const struct calibration *calibration,
                         enum verdict_purpose purpose);
void coaching_line_end(struct coaching_line *line);

// For recorder_options.on_seen; context: the line.
void coaching_line_see(struct coaching_line *line, const struct recorder_seen *seen);

// "41 % of the body seen · turn left", for a status line.
void coaching_line_text(struct coaching_line *line, char *out, size_t capacity);

// ---------------------------------------------------------------- take summary

struct json;

struct take_summary {
    const char *name, *note, *alias; // as long as the take is open
    int64_t frames, dropped, lost, with_skeleton, with_color, with_depth, located, representative;
    double duration_s, fps;
    const struct calibration *calibration;
    bool complete;
};
struct take_summary take_summarize(const struct take *take, const char *name);

// Adds "verdict": {"good", "headline", "for", "good_for": {"compare", "watch"}, "lines"} to an object.
void verdict_add_json(struct json *object, const struct take_verdict *take_verdict);

// The representative frame's colour, or the nearest there is, as a JPEG `height` pixels high. NOTHING: no frame has
// colour that can be read. ERR_MEMORY, ERR_IO. The caller frees *jpeg.
MUST_CHECK enum status take_thumbnail(struct take *take, int height, uint8_t **jpeg, size_t *bytes);
