// Tags of tag36h11 on pages to print: at their exact size, with the white margin they need, cutting marks, and a ruler
// that shows whether the printer kept the scale. A tag that is larger than the page is spread over several, to be glued
// edge to edge.
#pragma once
#include "capture/calibration/stereo_calibration.h"
#include "platform/files/page.h"

enum paper { PAPER_A4, PAPER_LETTER };
extern const char *const paper_names[2];
struct paper_size {
    double width_mm, height_mm;
};
struct paper_size paper_size(enum paper paper);

struct printed_tags {
    const int32_t *ids; // of tag36h11
    int count;
    double side_m; // outer edge of the black square
    enum paper paper;
};

// Smaller ones are not detected across a room, larger ones are refused by tags.json. Metres.
#define PRINTED_SIDE_MIN_M 0.02
#define PRINTED_SIDE_MAX_M 2.0

// Pages that printed_tags_draw fills. wanted: valid.
int printed_tags_pages(const struct printed_tags *wanted);

// Draws all pages. ERR_INPUT: a number that tag36h11 does not have, a number twice, a side out of range.
MUST_CHECK enum status printed_tags_draw(const struct printed_tags *wanted, struct page *page);

// The list that `map --tags` reads, malloc'ed text. ERR_MEMORY.
MUST_CHECK enum status printed_tags_list(const struct printed_tags *wanted, char **json);

#define PRINT_MARGIN_MM 8.0  // that no printer reaches
#define PRINT_FOOT_MM   14.0 // the ruler's strip above the lower margin

// ---------------------------------------------------------------- printed board

// Boards to print for calibration: dark circles in a lattice, chequers, and discs to cut out.

// A page with the board of circles: as many of 20 mm pitch as the paper holds, and how many these are.
struct stereo_board printed_board(enum paper paper);
void printed_board_draw(enum paper paper, struct page *page);

// The same of chequers: their inner corners.
struct stereo_board printed_chequers(enum paper paper);
void printed_chequers_draw(enum paper paper, struct page *page);

// Pages of black discs of that radius, `count` of them, to be cut out.
void printed_discs_draw(enum paper paper, int count, double radius_m, struct page *page);
