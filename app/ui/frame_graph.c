// The frame graph: a bar per frame, coloured by stage, against the time budget.
#include "app/ui/screens.h"

#include <math.h>
#include <stdio.h>

static const uint32_t colors[FRAME_STAGES] = {0xa78bfaff, 0x64748bff, 0x2dd4bfff, 0x60a5faff, 0xf472b6ff};

static void draw_bars(const struct brush *b, const struct frame_times *times, double budget_ms, struct ui_box box)
{
    const double full_ms = fmax(2 * budget_ms, 1.5 * frame_times_median(times)), width = box.w / FRAMES_KEPT;
    for (int back = 0; back < FRAMES_KEPT; back++) {
        const float *ms = frame_times_at(times, back);
        if (!ms)
            break;
        double x = box.x + box.w - (back + 1) * width, y = box.y + box.h;
        for (int stage = 0; stage < FRAME_STAGES && y > box.y; stage++) {
            double h = fmin((double)ms[stage] / full_ms * box.h, y - box.y);
            ui_fill(b->ui, (struct ui_box){x, y - h, width * 0.8, h}, 0, colors[stage]);
            y -= h;
        }
    }
    double line = box.y + box.h * (1 - budget_ms / full_ms);
    ui_line(b->ui, (struct ui_point){box.x, line}, (struct ui_point){box.x + box.w, line}, 1, b->theme->quiet);
}

void frame_graph_draw(const struct brush *b, const struct frame_times *times, double budget_ms, struct ui_box box)
{
    const struct theme *t = b->theme;
    char text[64];
    panel(b, box, true);
    struct ui_box in = inner(box, 12), top = cut_top(&in, 20), names = cut_bottom(&in, 18);
    snprintf(text, sizeof text, "%.0f ms per frame; the display shows one every %.0f", frame_times_median(times),
             budget_ms);
    label(b, FACE_SMALL, top, t->text, text);
    draw_bars(b, times, budget_ms, in);
    for (int i = 0; i < FRAME_STAGES; i++) {
        ui_disc(b->ui, (struct ui_point){names.x + 4, names.y + 9}, 4, colors[i]);
        names.x += 14;
        double width = ui_text_width(b->ui, FACE_SMALL, frame_stage_names[i]);
        label(b, FACE_SMALL, (struct ui_box){names.x, names.y, width + 1, names.h}, t->quiet, frame_stage_names[i]);
        names.x += width + 10;
    }
}
