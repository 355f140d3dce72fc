// A rehearsal's recording, opened, for tests of what is drawn from it.
#pragma once
#include "reenact/avatar/avatar.h"
#include "tests/support/rehearsal.h"

struct rehearsed {
    struct rehearsal rehearsal;
    struct recording *recording;
    struct take *take; // "turn"
    struct take_skeletons *skeletons;
    struct source_rays *rays;   // of its sensor
    struct frame_source source; // the three of them
    struct avatar avatar;       // of its actor; zeroed where none was asked for
};

// frames: how many the avatar is made of; 0: no avatar. The rehearsal's errors abort; else as avatar_make. Call
// rehearsed_close after a failure too.
MUST_CHECK enum status rehearsed_open(struct rehearsed *out, int frames);
void rehearsed_close(struct rehearsed *r);

// The sensor's pose at that frame, moved round the person by that angle, anticlockwise from above; in the take's world.
struct pose rehearsed_orbit_pose(const struct rehearsed *r, int64_t frame, double angle_rad);
