#include "app/state/frame_skip.h"

#include <float.h>

// Chosen by hand: weight of a new time in the mean; ratio to the mean above which a time is an outlier.
static const double SMOOTH = 0.2, OUTLIER_RATIO = 3;

bool frame_skip_update(struct frame_skip *s, double took_ms, bool placed, bool newer)
{
    if (!(took_ms >= 0 && took_ms <= DBL_MAX)) // it would stay in the mean for ever
        return s->skipped_last = false;
    const bool unusual = s->typical_ms > 0 && took_ms > OUTLIER_RATIO * s->typical_ms;
    s->typical_ms += (s->typical_ms > 0 ? SMOOTH : 1) * (took_ms - s->typical_ms);
    return s->skipped_last = unusual && placed && newer && !s->skipped_last;
}
