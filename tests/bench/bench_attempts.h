// Films of a reference and of an attempt at it that differs in a known way (tests/world/edit.h), each performed by
// another figure at another place and tracked; and what a comparison of the two says, next to the truth.
#pragma once
#include "tests/support/dice_plan.h"
#include "tests/world/edit.h"

enum { ATTEMPT_HZ = 30 };

struct attempt_plan {
    uint64_t seed;
    int index;
    const char *motion;
    struct attempt_actor {
        char figure[16];
        struct world_spot spot;
    } actor[2];             // of the reference, of the attempt
    struct world_edit edit; // the attempt; the reference performs the same stretch unedited
};

struct attempt_wish {
    uint64_t seed;
    double seconds;                     // of the stretch, or as long as the motion where that is shorter
    const struct dice_motions *motions; // one of them is drawn for each film
};

// Film `index` of a seed: its edit is the (index % EDIT_KINDS)th; drawn are figures, motion, stretch, place, facing
// (within 30 degrees of the sensor, the attempt 15 to 30 degrees otherwise than the reference), where and how strongly
// it is edited: knees by 36 degrees, others by 20 to 30. Only what shows counts: the figure stays in the image, what is
// edited moves or differs. NOTHING: no such film was found. Errors: as world_open.
MUST_CHECK enum status attempt_plan_draw(struct attempt_plan *out, const struct attempt_wish *wish, int index);

struct world_options attempt_world_options(const struct attempt_plan *plan, int actor);
// Does the edit change a posture between from_s and to_s, or only when things happen?
bool edit_is_posture(enum world_edit_kind kind);
bool edit_is_timing(enum world_edit_kind kind);                      // tempo, pause, late arm
bool edit_expects_part(enum world_edit_kind kind, const char *part); // is it a part that was changed?

// NaN where nothing counts.
struct attempt_score {
    double time_median_s, time_p95_s; // error of reference_s where the reference moves faster than 0.3 m/s
    double angle_median, angle_p95;   // error of the parts' angles, degrees
    double caught, false_alarms;      // said to be different: of parts truly >= 15 degrees apart; < 5 degrees
    double unknown;                   // parts of which nothing is said
    double first_right;               // 0 or 1, of posture edits
    double no_posture;                // 0 or 1, of timing edits: no posture finding above 10 degrees
    double mirrored_right;            // 0 or 1: named as mirrored where it is, not where it is not
    double kind_found;                // 0 or 1, of missing and extra pieces and pauses: a finding of that kind
    double score;                     // 0..100; NaN: none
    double score_sigma;               // what it is said to be off by
    char first[200];                  // the first finding's part and sentence
};

// Films, tracks, compares. dump: a folder in which the joints of both are written as joints-csv; NULL: none. Errors:
// as world_open, comparison_make; ERR_IO.
MUST_CHECK enum status attempt_film(const struct attempt_plan *plan, const char *dump, struct attempt_score *out);
