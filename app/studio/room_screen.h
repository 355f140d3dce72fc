// The room being swept, and its finished map: the plan from above, what to do next, how good it is.
#pragma once
#include "app/studio/studio_screen.h"

enum { ROOM_PLAN_PX = 4 * SWEEP_CELLS }; // a side of the plan's picture

// The plan as a picture with y upwards, RGB: floor, what stands on it, and in the accent colour where a camera finds
// something to recognise. out: 3 * ROOM_PLAN_PX^2 bytes.
void room_plan_colors(const struct sweep_plan *plan, const struct theme *theme, uint8_t *out);

// The square of that picture that shows what was seen, shares of its width.
struct ui_box room_plan_part(const struct sweep_plan *plan);

// Pages ROOM, ROOM_FINISHING and ROOM_REVIEW.
void room_screen_draw(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                      struct ui_box in, int64_t now_ns);
