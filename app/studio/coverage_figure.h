// The figure of the person, coloured by what has been seen, and the dial that fills.
#pragma once
#include "app/ui/widgets.h"
#include "capture/coaching/coach.h"
#include "capture/coaching/coverage.h"

// Four figures side by side: front, left, back, right. Grey: unseen; the accent colour: seen.
void coverage_figure_draw(const struct brush *brush, const struct coverage *coverage, struct ui_box box);

// A ring with the share in its middle; `advice` adds an arrow for the person's turn.
void coverage_dial_draw(const struct brush *brush, double share, enum pose_advice advice, struct ui_box box);
