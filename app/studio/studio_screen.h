// The studio's pages, drawn between ui_begin and ui_end; touched controls go to the state.
#pragma once
#include "app/studio/studio_session.h"
#include "app/studio/studio_state.h"
#include "app/ui/widgets.h"
#include "base/lens.h"
#include "platform/sensors/source.h"

enum { ROOM_PLAN_PX = 4 * SWEEP_CELLS }; // a side of the plan's picture

// The plan as a picture with y upwards, RGB: floor, what stands on it, and in the accent colour where a camera finds
// something to recognise. out: 3 * ROOM_PLAN_PX^2 bytes.
void room_plan_colors(const struct sweep_plan *plan, const struct theme *theme, uint8_t *out);

// The square of that picture that shows what was seen, shares of its width.
struct ui_box room_plan_part(const struct sweep_plan *plan);

// Colours for a depth image, RGB: near warm, far cold; no reading hatched. out: 3 * width * height bytes.
void studio_depth_colors(const uint16_t *depth, int width, int height, uint8_t *out);

struct studio_view {
    const char *file;
    const struct source_device *devices;
    int device_count;
    const struct studio_snapshot *shown;
    const struct gpu_texture *color, *depth, *plan; // of the snapshot; NULL: none yet
    struct ui_box plan_part;                        // room_plan_part
    struct scroll *scroll;                          // of the page's list
};

void studio_screen_draw(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                        int64_t now_ns);
