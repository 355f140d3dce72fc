// What the commands say of a take: numbers, and its quality in words.
#pragma once
#include "capture/recording/recording.h"

struct take_summary {
    const char *name, *note, *alias; // as long as the take is open
    int64_t frames, dropped, lost, with_skeleton, with_color, with_depth, located, representative;
    double duration_s, fps;
    double longest_gap_s;    // between two frames
    double longest_unseen_s; // without a person
    const struct calibration *calibration;
    bool complete;
};
struct take_summary take_summarize(const struct take *take, const char *name);

// "good", or what is wrong with it, the worst first: "a person in 40 % of the frames; the sensor was not located".
// has_place: the recording holds a place.
enum { QUALITY_BYTES = 300 };
const char *take_quality(const struct take_summary *s, bool has_place, char out[QUALITY_BYTES]);

// The representative frame's colour, or the nearest there is, as a JPEG `height` pixels high. NOTHING: no frame has
// colour that can be read. ERR_MEMORY, ERR_IO. The caller frees *jpeg.
MUST_CHECK enum status take_thumbnail(struct take *take, int height, uint8_t **jpeg, size_t *bytes);
