// What the study's questions ([D14] section 5) ask about, measured while the stage "views" has its take open.
#pragma once
#include "tests/bench/bench_views_data.h"

struct bench_study {
    bool known;
    // Q1, Q2: the actor's joints in the room as displayed, against the truth: medians over joints and images.
    double room_mm, room_p95_mm, tablet_px, tablet_p95_px;
    // Q3, Q4: error of a joint's depth, mm, as seen from one, two and many sides of the display, for an eye that places
    // a joint within EYE_PX in the picture: from one side the depth is not seen, and the spread of depths remains.
    double one_side_mm, two_sides_mm, many_sides_mm;
    // Q6, Q7: difference of the parts' directions from the truth's, and the score of the same movement, tracked.
    double angle_deg, angle_p95_deg, score;
};
extern struct bench_study bench_study; // of the last run

MUST_CHECK enum status bench_study_measure(const struct views_data *data);
