// Looking back over frames that were tracked: what settle.c needs of the tracker beyond tracker.h.
#pragma once
#include "capture/tracker.h"
#include "capture/tracker_limbs.h"

// From here on frames come in falling order of time, the last one first, with their own times, and
// show a person of this shape, which is learned no more; what was learned of the room stays. May be
// called again where an earlier person comes. Until tracker_reset.
void tracker_turn_back(struct tracker *t, const struct body_shape *shape);

// Where the other way had the person in the frame that comes next: what is close to it there is
// the person, too, so that a limb which one way has lost is not cut off with what the other sees of it.
void tracker_also_there(struct tracker *t, const struct body_pose *pose);

// Of the last tracker_next that was OK; depth camera's axes.
const struct body_pose *tracker_pose(const struct tracker *t); // as told
const struct body_shape *tracker_shape(const struct tracker *t);
int tracker_found_count(const struct tracker *t); // so often somebody was found anew, so far

// By how much this picture is less likely with another pose than with the one that was fitted to
// it: energies as in body_fit.h, negative where it is likelier. 0 for limbs that are in the same place.
struct pose_odds {
    double limb[LIMB_COUNT]; // with this limb alone as the other pose has it
    double whole;            // with all of it
};
struct pose_odds tracker_weigh(struct tracker *t, const struct body_pose *other);
