// What the commands say of a take in numbers.
#pragma once
#include "recording/recorded_verdict.h"

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
void verdict_add_json(struct json *object, const struct take_verdict *v);

// The representative frame's colour, or the nearest there is, as a JPEG `height` pixels high. NOTHING: no frame has
// colour that can be read. ERR_MEMORY, ERR_IO. The caller frees *jpeg.
MUST_CHECK enum status take_thumbnail(struct take *take, int height, uint8_t **jpeg, size_t *bytes);
