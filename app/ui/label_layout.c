#include "app/ui/label_layout.h"

#include <math.h>

// Sides about the point: above, right, left, below and the diagonals, then the same farther away. GAP_DP: from the
// point to the label's edge; chosen by hand.
enum { DIRECTIONS = 8, RINGS = 4, SIDES = DIRECTIONS * RINGS };
static const double GAP_DP = 16, RING_DP = 34, ARROW_DP = 26;

static bool overlap(struct ui_box a, struct ui_box b)
{
    return a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
}

static bool inside(struct ui_box a, struct ui_box b)
{
    return a.x >= b.x && a.y >= b.y && a.x + a.w <= b.x + b.w && a.y + a.h <= b.y + b.h;
}

static struct ui_box box_of(const struct placed_label *l, int side)
{
    static const double direction[DIRECTIONS][2] = {{0, -1}, {1, 0},   {-1, 0}, {0, 1},
                                                    {1, -1}, {-1, -1}, {1, 1},  {-1, 1}};
    const double *d = direction[side % DIRECTIONS], away = GAP_DP + RING_DP * (side / DIRECTIONS);
    const double x = l->at.x + d[0] * (away + l->w / 2), y = l->at.y + d[1] * (away + l->h / 2);
    return (struct ui_box){x - l->w / 2, y - l->h / 2, l->w, l->h};
}

static bool is_free(struct ui_box box, const struct placed_label *labels, int before, const struct ui_box *taken,
                    int taken_count)
{
    for (int i = 0; i < taken_count; i++)
        if (overlap(box, taken[i]))
            return false;
    for (int i = 0; i < before; i++)
        if (labels[i].side != LABEL_NO_SIDE && overlap(box, labels[i].box))
            return false;
    return true;
}

void label_layout(struct placed_label *labels, int count, struct ui_box bounds, const struct ui_box *taken,
                  int taken_count)
{
    for (int i = 0; i < count; i++) {
        struct placed_label *l = &labels[i];
        const int last = l->side;
        const struct ui_box point = {l->at.x, l->at.y, 0, 0};
        l->side = LABEL_NO_SIDE;
        if (!inside(point, bounds))
            continue;
        for (int k = -1; k < SIDES && l->side == LABEL_NO_SIDE; k++) {
            const int side = k < 0 ? last : k;
            if (side < 0 || side >= SIDES)
                continue;
            const struct ui_box box = box_of(l, side);
            if (inside(box, bounds) && is_free(box, labels, i, taken, taken_count)) {
                l->side = side;
                l->box = box;
            }
        }
    }
}

struct edge_arrow edge_arrow_of(struct ui_point axis, double x, double y, bool ahead, struct ui_box bounds)
{
    const struct ui_point at = {axis.x + x, axis.y + y};
    struct edge_arrow out = {.dx = 0, .dy = 1};
    out.inside = ahead && inside((struct ui_box){at.x, at.y, 0, 0}, bounds);
    if (out.inside) {
        out.at = (struct ui_point){at.x, at.y - ARROW_DP};
        return out;
    }
    // Along the ray from the bounds' middle to the point; what is behind lies on the other side of the screen's plane.
    const struct ui_point middle = {bounds.x + bounds.w / 2, bounds.y + bounds.h / 2};
    double dx = ahead ? at.x - middle.x : -x, dy = ahead ? at.y - middle.y : -y;
    const double length = sqrt(dx * dx + dy * dy);
    out.dx = length > 1e-9 ? dx / length : 1;
    out.dy = length > 1e-9 ? dy / length : 0;
    const double along = fmin(bounds.w / 2 / fmax(fabs(out.dx), 1e-9), bounds.h / 2 / fmax(fabs(out.dy), 1e-9));
    out.at = (struct ui_point){middle.x + along * out.dx, middle.y + along * out.dy};
    return out;
}
