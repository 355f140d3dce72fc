#include "app/state/frame_skip.h"

static const double SMOOTH = 0.2, UNUSUAL = 3; // of a new time in the typical one; times the typical one

bool frame_skip_update(struct frame_skip *p, double took_ms, bool placed, bool newer)
{
    const bool unusual = p->typical_ms > 0 && took_ms > UNUSUAL * p->typical_ms;
    p->typical_ms += (p->typical_ms > 0 ? SMOOTH : 1) * (took_ms - p->typical_ms);
    return p->skipped_last = unusual && placed && newer && !p->skipped_last;
}
