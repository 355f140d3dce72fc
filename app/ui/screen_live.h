// The live screens: doing the move beside the actor, and the summary afterwards. They draw what view_state.live says
// and pass touched controls back to it.
#pragma once
#include "app/ui/figure_draw.h"
#include "app/ui/screens.h"
#include "compare/comparison.h"

// What was found out for this drawing. Pointers are borrowed for the call.
struct live_page {
    const char *file, *take;
    const struct take_view_image *image; // the actor, from the viewpoint of this screen
    // The mirror: the sensor's picture of image->lens, and what of it hides the actor, premultiplied; NULL: not known
    const struct gpu_texture *picture, *front;
    const struct skeleton *person;       // in the world of `image`; NULL: not seen
    const enum verdict *verdicts;        // [PART_COUNT]; NULL: not judged at the moment
    const struct part_difference *parts; // the same in numbers
    const struct skeleton *ghost;        // the next pose where the person stands; NULL: none
    int64_t person_ns;                   // the instant of the take that the person shows; -1: not known
    // The summary
    const struct comparison *comparison; // NULL: none, or not yet
    const char *names[2];                // of two takes that were compared: reference and attempt; NULL: of an attempt
    bool mirrored;                       // it was judged by the mirrored actor
    const char *why_not;                 // why there is none; NULL
    const uint8_t (*strip)[PART_COUNT];  // [strip_cells]: over the attempt's time each part's enum verdict, more: none
    int strip_cells;
    const struct skeleton *attempt, *reference; // of what is reviewed, in one world; NULL: not known there
    const enum verdict *review_verdicts;        // [PART_COUNT] at that instant; NULL
    const char *keeping;                        // a sentence on the attempt that was kept; NULL
};
void screen_live(const struct brush *brush, struct screens *screens, struct view_state *state,
                 const struct live_page *page, int64_t now_ns);

// Of the summary: where the reviewed figures are drawn.
struct ui_box screen_summary_figures(double width, double height);
// The moment of the attempt at which the finding is seen best, its middle; of a missing piece, where it should begin.
int64_t finding_moment_ns(const struct comparison *comparison, const struct finding *finding);
void screen_summary(const struct brush *brush, struct screens *screens, struct view_state *state,
                    const struct live_page *page, int64_t now_ns);
