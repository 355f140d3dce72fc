// The studio's pages, drawn between ui_begin and ui_end; touched controls go to the state.
#pragma once
#include "app/studio/studio_session.h"
#include "app/studio/studio_state.h"
#include "app/ui/widgets.h"
#include "platform/sensors/source.h"

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
