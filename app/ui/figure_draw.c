#include "app/ui/figure_draw.h"

#include <math.h>
#include <stdlib.h>

static const double MIN_DEPTH_M = 0.1, LIMB_DP = 9, DASH_DP = 9, DASHED_DP = 5, MARK_DP = 7;

bool figure_point(const struct figure_view *view, struct vec3 world, struct ui_point *out)
{
    const struct vec3 c = pose_apply(pose_inverse(view->world_from_camera), world);
    if (!(c.z > MIN_DEPTH_M))
        return false;
    const struct pixel px = lens_project(&view->lens, c);
    const double x = view->flipped ? view->lens.width - 1 - px.x : px.x;
    *out = (struct ui_point){view->cover.x + (x + 0.5) * view->cover.scale,
                             view->cover.y + (px.y + 0.5) * view->cover.scale};
    return isfinite(out->x) && isfinite(out->y) && fabs(out->x) < 1e5 && fabs(out->y) < 1e5;
}

struct ui_box figure_image_box(const struct figure_view *view)
{
    return (struct ui_box){view->cover.x, view->cover.y, view->cover.scale * view->lens.width,
                           view->cover.scale * view->lens.height};
}

uint32_t verdict_color(const struct theme *theme, enum verdict verdict)
{
    if (verdict == VERDICT_SAME)
        return theme->right;
    return verdict == VERDICT_DIFFERENT ? theme->wrong : theme->unseen;
}

static void dashed_line(const struct brush *brush, struct ui_point from, struct ui_point to, double width,
                        uint32_t color)
{
    const double length = hypot(to.x - from.x, to.y - from.y), step = 2 * DASH_DP;
    for (double at = 0; at < length; at += step) {
        const double t0 = at / length, t1 = fmin(at + DASH_DP, length) / length;
        ui_line(brush->ui, (struct ui_point){from.x + t0 * (to.x - from.x), from.y + t0 * (to.y - from.y)},
                (struct ui_point){from.x + t1 * (to.x - from.x), from.y + t1 * (to.y - from.y)}, width, color);
    }
}

void verdict_line(const struct brush *brush, struct ui_point from, struct ui_point to, double width,
                  enum verdict verdict)
{
    const uint32_t color = verdict_color(brush->theme, verdict);
    if (verdict == VERDICT_UNKNOWN)
        dashed_line(brush, from, to, fmin(width, DASHED_DP), color);
    else
        ui_line(brush->ui, from, to, width, color);
}

// ---------------------------------------------------------------- limbs

// Half thickness of a part's body, metres; of an average adult, by hand.
static const double thickness_m[PART_COUNT] = {
    [PART_HEAD] = 0.055,          [PART_UPPER_TORSO] = 0.13,   [PART_LOWER_TORSO] = 0.12,
    [PART_LEFT_UPPER_ARM] = 0.05, [PART_LEFT_FOREARM] = 0.042, [PART_RIGHT_UPPER_ARM] = 0.05,
    [PART_RIGHT_FOREARM] = 0.042, [PART_LEFT_THIGH] = 0.078,   [PART_LEFT_SHIN] = 0.056,
    [PART_RIGHT_THIGH] = 0.078,   [PART_RIGHT_SHIN] = 0.056,
};
static const double SKULL_M = 0.105;

static bool has_joint(const struct skeleton *skeleton, enum joint joint) { return skeleton->confidence[joint] > 0; }

static double depth_of(const struct figure_view *view, struct vec3 world)
{
    return pose_apply(pose_inverse(view->world_from_camera), world).z;
}

// dp on the screen of a metre at that depth.
static double dp_per_m(const struct figure_view *view, double depth_m)
{
    return view->cover.scale * view->lens.fx / fmax(depth_m, MIN_DEPTH_M);
}

struct drawn_part {
    enum part part;
    double depth_m; // of its middle
    struct ui_point from, to;
};

static int farther_first(const void *a, const void *b)
{
    const double x = ((const struct drawn_part *)a)->depth_m, y = ((const struct drawn_part *)b)->depth_m;
    return (x < y) - (x > y);
}

// The parts that are known and in view, the farthest first.
static int visible_parts(const struct figure_view *view, const struct skeleton *skeleton,
                         struct drawn_part out[PART_COUNT])
{
    int count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_ends ends = part_ends[p];
        struct drawn_part d = {.part = (enum part)p};
        if (!has_joint(skeleton, ends.from) || !has_joint(skeleton, ends.to) ||
            !figure_point(view, skeleton->joint[ends.from], &d.from) ||
            !figure_point(view, skeleton->joint[ends.to], &d.to))
            continue;
        d.depth_m = depth_of(view, v3_mix(skeleton->joint[ends.from], skeleton->joint[ends.to], 0.5));
        out[count++] = d;
    }
    qsort(out, (size_t)count, sizeof *out, farther_first);
    return count;
}

// ---------------------------------------------------------------- body

static uint32_t mix_colors(uint32_t a, uint32_t b, double t)
{
    uint32_t out = 0;
    for (int shift = 0; shift < 32; shift += 8) {
        const double x = a >> shift & 255, y = b >> shift & 255;
        out |= (uint32_t)lround(x + t * (y - x)) << shift;
    }
    return out;
}

static void draw_trunk(const struct brush *brush, const struct figure_view *view, const struct skeleton *skeleton,
                       uint32_t color)
{
    static const enum joint around[] = {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HIP, JOINT_LEFT_HIP};
    struct ui_point at[4];
    for (int i = 0; i < 4; i++)
        if (!has_joint(skeleton, around[i]) || !figure_point(view, skeleton->joint[around[i]], &at[i]))
            return;
    const double r = dp_per_m(view, depth_of(view, skeleton->joint[JOINT_LEFT_HIP]));
    double area = 0; // a polygon is drawn one way round
    for (int i = 0; i < 4; i++)
        area += at[i].x * at[(i + 1) % 4].y - at[(i + 1) % 4].x * at[i].y;
    const struct ui_point turned[4] = {at[0], at[3], at[2], at[1]};
    ui_polygon(brush->ui, area < 0 ? turned : at, 4, color);
    ui_stroke(brush->ui, at, 4, true, 2 * 0.075 * r, color);
}

// Round the part, before it is drawn over.
static void draw_mark(const struct brush *brush, const struct figure_view *view, const struct drawn_part *part)
{
    const double dp = dp_per_m(view, part->depth_m), r = thickness_m[part->part] * dp + MARK_DP;
    const uint32_t color = brush->theme->accent;
    ui_line(brush->ui, part->from, part->to, 2 * r, color);
    ui_disc(brush->ui, part->from, r, color);
    ui_disc(brush->ui, part->to, part->part == PART_HEAD ? SKULL_M * dp + MARK_DP : r, color);
}

static void draw_body(const struct brush *brush, const struct figure_view *view, const struct figure *figure)
{
    const struct theme *t = brush->theme;
    const struct skeleton *s = figure->skeleton;
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, s, parts);
    const uint32_t skin = mix_colors(t->quiet, t->sky, figure->dimmed ? 0.55 : 0.25),
                   edge = mix_colors(skin, t->ground, 0.45);
    for (int i = 0; i < count; i++) {
        const struct drawn_part *d = &parts[i];
        const double r = thickness_m[d->part] * dp_per_m(view, d->depth_m);
        const bool trunk = d->part == PART_UPPER_TORSO || d->part == PART_LOWER_TORSO,
                   marked = figure->marked == (int)d->part + 1;
        if (d->part == PART_UPPER_TORSO)
            draw_trunk(brush, view, s, skin);
        if (marked)
            draw_mark(brush, view, d);
        if (trunk && !marked)
            continue;
        ui_line(brush->ui, d->from, d->to, 2 * r + 3, edge);
        ui_line(brush->ui, d->from, d->to, 2 * r, skin);
        ui_disc(brush->ui, d->from, r, skin);
        ui_disc(brush->ui, d->to, r, skin);
        if (d->part == PART_HEAD)
            ui_disc(brush->ui, d->to, SKULL_M * dp_per_m(view, d->depth_m), skin);
    }
}

// ---------------------------------------------------------------- lines

// width, dash: dp.
static struct overlay_stroke stroke_of(const struct figure_view *view, struct vec3 from, struct vec3 to, double width,
                                       uint32_t color)
{
    return (struct overlay_stroke){from, to, width / view->cover.scale, 0, color};
}

static int put_limb(const struct theme *theme, const struct figure_view *view, const struct figure *figure,
                    enum part part, bool outline, struct overlay_stroke *out)
{
    const enum verdict v = figure->verdicts ? figure->verdicts[part] : VERDICT_UNKNOWN;
    const struct vec3 from = figure->skeleton->joint[part_ends[part].from],
                      to = figure->skeleton->joint[part_ends[part].to];
    const double width = v == VERDICT_DIFFERENT ? 1.5 * LIMB_DP : LIMB_DP;
    if (outline && v == VERDICT_UNKNOWN)
        return 0;
    if (outline)
        *out = stroke_of(view, from, to, width + 4, 0x00000090);
    else if (!figure->verdicts)
        *out = stroke_of(view, from, to, LIMB_DP * 0.6, faint(0xffffffff, 0.8));
    else
        *out = stroke_of(view, from, to, v == VERDICT_UNKNOWN ? DASHED_DP : width, verdict_color(theme, v));
    if (figure->verdicts && v == VERDICT_UNKNOWN)
        out->dash_px = DASH_DP / view->cover.scale;
    return 1;
}

static int put_limbs(const struct theme *theme, const struct figure_view *view, const struct figure *figure,
                     struct overlay_stroke *out)
{
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, figure->skeleton, parts);
    int put = 0;
    for (int pass = 0; pass < 2; pass++) // first a dark outline, for contrast on any background
        for (int i = 0; i < count; i++)
            put += put_limb(theme, view, figure, parts[i].part, !pass, &out[put]);
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct ui_point at;
        if (has_joint(figure->skeleton, (enum joint)j) && figure_point(view, figure->skeleton->joint[j], &at))
            out[put++] = stroke_of(view, figure->skeleton->joint[j], figure->skeleton->joint[j], 2 * LIMB_DP * 0.45,
                                   figure->verdicts ? 0xffffffff : faint(0xffffffff, 0.8));
    }
    return put;
}

static int put_ghost(const struct theme *theme, const struct figure_view *view, const struct figure *figure,
                     struct overlay_stroke *out)
{
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, figure->skeleton, parts);
    const uint32_t color = faint(theme->ghost, 0.5);
    int put = 0;
    for (int i = 0; i < count; i++) {
        const struct part_ends ends = part_ends[parts[i].part];
        const struct vec3 from = figure->skeleton->joint[ends.from], to = figure->skeleton->joint[ends.to];
        const double dp = dp_per_m(view, parts[i].depth_m);
        out[put++] = stroke_of(view, from, to, 2 * 0.8 * thickness_m[parts[i].part] * dp, color);
        if (parts[i].part == PART_HEAD)
            out[put++] = stroke_of(view, to, to, 2 * 0.9 * SKULL_M * dp, color);
    }
    return put;
}

int figure_strokes(const struct theme *theme, const struct figure_view *view, const struct figure *figure,
                   struct overlay_stroke out[FIGURE_STROKES_MAX])
{
    return figure->kind == FIGURE_GHOST ? put_ghost(theme, view, figure, out) : put_limbs(theme, view, figure, out);
}

static void draw_strokes(const struct brush *brush, const struct figure_view *view, const struct figure *figure)
{
    struct overlay_stroke strokes[FIGURE_STROKES_MAX];
    const int count = figure_strokes(brush->theme, view, figure, strokes);
    for (int i = 0; i < count; i++) {
        const struct overlay_stroke *s = &strokes[i];
        const double width = s->width_px * view->cover.scale;
        struct ui_point from, to;
        if (!figure_point(view, s->from, &from) || !figure_point(view, s->to, &to))
            continue;
        if (v3_distance(s->from, s->to) == 0)
            ui_disc(brush->ui, from, width / 2, s->color);
        else if (s->dash_px > 0)
            dashed_line(brush, from, to, width, s->color);
        else
            ui_line(brush->ui, from, to, width, s->color);
    }
}

void figure_draw(const struct brush *brush, const struct figure_view *view, const struct figure *figure)
{
    if (figure->kind == FIGURE_BODY)
        draw_body(brush, view, figure);
    if (figure->kind != FIGURE_BODY || figure->verdicts)
        draw_strokes(brush, view, figure);
}
