#include "app/studio/coverage_figure.h"

#include <math.h>
#include <stdio.h>

static const double PI = 3.14159265358979323846;

// A standing figure as seen from its front, in a box of 1 x 2: where each part begins and ends and how thick it is. Its
// own left is to the right.
static const struct {
    double x0, y0, x1, y1, thick;
} limbs[SURFACE_PARTS] = {
    [PART_HEAD] = {0.5, 0.17, 0.5, 0.24, 0.21},
    [PART_UPPER_TORSO] = {0.5, 0.48, 0.5, 0.66, 0.3},
    [PART_LOWER_TORSO] = {0.5, 0.78, 0.5, 0.92, 0.27},
    [PART_LEFT_UPPER_ARM] = {0.73, 0.46, 0.83, 0.72, 0.1},
    [PART_LEFT_FOREARM] = {0.85, 0.79, 0.92, 1.06, 0.085},
    [PART_RIGHT_UPPER_ARM] = {0.27, 0.46, 0.17, 0.72, 0.1},
    [PART_RIGHT_FOREARM] = {0.15, 0.79, 0.08, 1.06, 0.085},
    [PART_LEFT_THIGH] = {0.6, 1.08, 0.64, 1.36, 0.15},
    [PART_LEFT_SHIN] = {0.645, 1.47, 0.66, 1.76, 0.11},
    [PART_RIGHT_THIGH] = {0.4, 1.08, 0.36, 1.36, 0.15},
    [PART_RIGHT_SHIN] = {0.355, 1.47, 0.34, 1.76, 0.11},
    [SURFACE_LEFT_FOOT] = {0.67, 1.88, 0.72, 1.9, 0.08},
    [SURFACE_RIGHT_FOOT] = {0.33, 1.88, 0.28, 1.9, 0.08},
};

static uint32_t mixed(uint32_t a, uint32_t b, double share)
{
    uint32_t out = 0;
    for (int shift = 0; shift < 32; shift += 8) {
        const double from = a >> shift & 255, to = b >> shift & 255;
        out |= (uint32_t)lround(from + (to - from) * share) << shift;
    }
    return out;
}

static void draw_one(const struct brush *brush, const struct coverage *coverage, enum coverage_side side,
                     struct ui_box box)
{
    const struct theme *t = brush->theme;
    const double unit = fmin(box.w, box.h / 2);
    const struct ui_point at = {box.x + (box.w - unit) / 2, box.y + (box.h - 2 * unit) / 2};
    // From the back left and right change places; from a side the limbs stand one before the other.
    const double narrow = side == COVERAGE_LEFT || side == COVERAGE_RIGHT ? 0.35 : 1,
                 mirror = side == COVERAGE_BACK ? -1 : 1;
    for (int p = 0; p < SURFACE_PARTS; p++) {
        const double share = coverage_part_share(coverage, p, side);
        const struct ui_point ends[2] = {
            {at.x + unit * (0.5 + mirror * narrow * (limbs[p].x0 - 0.5)), at.y + unit * limbs[p].y0},
            {at.x + unit * (0.5 + mirror * narrow * (limbs[p].x1 - 0.5)), at.y + unit * limbs[p].y1}};
        ui_stroke(brush->ui, ends, 2, false, unit * limbs[p].thick,
                  mixed(mixed(t->raised, t->text, 0.18), t->accent, share));
    }
}

void coverage_figure_draw(const struct brush *brush, const struct coverage *coverage, struct ui_box box)
{
    static const char *const names[] = {"front", "left", "back", "right"};
    const double w = box.w / 4;
    for (int side = 0; side < 4; side++) {
        const struct ui_box one = {box.x + side * w, box.y, w, box.h - 24};
        draw_one(brush, coverage, (enum coverage_side)side, inner(one, 2));
        const double foot = one.y + one.h / 2 + fmin(one.w - 4, (one.h - 4) / 2); // of the figure, in the box's middle
        label_centred(brush, FACE_SMALL, (struct ui_box){one.x, fmin(foot, one.y + one.h), w, 24}, brush->theme->quiet,
                      names[side]);
    }
}

static void draw_arc(const struct brush *brush, struct ui_point centre, double radius, double share, uint32_t color)
{
    enum { POINTS = 64 };
    struct ui_point points[POINTS + 1];
    const int count = (int)ceil(fmax(share, 0.01) * POINTS);
    for (int i = 0; i <= count; i++) {
        const double a = 2 * PI * share * i / count - PI / 2;
        points[i] = (struct ui_point){centre.x + radius * cos(a), centre.y + radius * sin(a)};
    }
    ui_stroke(brush->ui, points, count + 1, false, 10, color);
}

// A turn as the person sees it in the mirror of the screen: to the own left is to the left.
static void draw_turn(const struct brush *brush, struct ui_point centre, double radius, bool left)
{
    const double way = left ? -1 : 1;
    struct ui_point points[13];
    for (int i = 0; i < 13; i++) {
        const double a = -PI / 2 - way * 0.9 + way * 1.8 * i / 12;
        points[i] = (struct ui_point){centre.x + radius * cos(a), centre.y + radius * sin(a)};
    }
    const struct ui_point tip = points[12];
    ui_stroke(brush->ui, points, 13, false, 5, brush->theme->accent);
    const struct ui_point head[3] = {
        {tip.x - way * 2, tip.y - 16}, {tip.x + way * 4, tip.y + 4}, {tip.x - way * 17, tip.y + 1}};
    ui_stroke(brush->ui, head, 3, false, 5, brush->theme->accent);
}

void coverage_dial_draw(const struct brush *brush, double share, enum pose_advice advice, struct ui_box box)
{
    char text[16];
    const double radius = fmin(box.w, box.h) / 2 - 22;
    const struct ui_point centre = middle(box);
    ui_ring(brush->ui, centre, radius, 10, faint(brush->theme->text, 0.14));
    if (share > 0)
        draw_arc(brush, centre, radius, fmin(share, 1), brush->theme->accent);
    snprintf(text, sizeof text, "%.0f %%", share * 100);
    label_centred(brush, FACE_HEAD, (struct ui_box){centre.x - radius, centre.y - 16, 2 * radius, 32},
                  brush->theme->text, text);
    if (advice == ADVICE_TURN_LEFT || advice == ADVICE_TURN_RIGHT)
        draw_turn(brush, centre, radius + 17, advice == ADVICE_TURN_LEFT);
}
