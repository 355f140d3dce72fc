// Boards to print for calibration: dark circles in a lattice, chequers, and discs to cut out.
#pragma once
#include "capture/calibration/printed_tags.h"
#include "capture/calibration/stereo_calibration.h"

// A page with the board of circles: as many of 20 mm pitch as the paper holds, and how many these are.
struct stereo_board printed_board(enum paper paper);
void printed_board_draw(enum paper paper, struct page *page);

// The same of chequers: their inner corners.
struct stereo_board printed_chequers(enum paper paper);
void printed_chequers_draw(enum paper paper, struct page *page);

// Pages of black discs of that radius, `count` of them, to be cut out.
void printed_discs_draw(enum paper paper, int count, double radius_m, struct page *page);
