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

struct ui_box figure_image_box(const struct figure_view *v)
{
    return (struct ui_box){v->cover.x, v->cover.y, v->cover.scale * v->lens.width, v->cover.scale * v->lens.height};
}

uint32_t verdict_color(const struct theme *t, enum verdict v)
{
    if (v == VERDICT_SAME)
        return t->right;
    return v == VERDICT_DIFFERENT ? t->wrong : t->unseen;
}

static void dashed_line(const struct brush *b, struct ui_point from, struct ui_point to, double width, uint32_t color)
{
    const double length = hypot(to.x - from.x, to.y - from.y), step = 2 * DASH_DP;
    for (double at = 0; at < length; at += step) {
        const double t0 = at / length, t1 = fmin(at + DASH_DP, length) / length;
        ui_line(b->ui, (struct ui_point){from.x + t0 * (to.x - from.x), from.y + t0 * (to.y - from.y)},
                (struct ui_point){from.x + t1 * (to.x - from.x), from.y + t1 * (to.y - from.y)}, width, color);
    }
}

void verdict_line(const struct brush *b, struct ui_point from, struct ui_point to, double width, enum verdict v)
{
    const uint32_t color = verdict_color(b->theme, v);
    if (v == VERDICT_UNKNOWN)
        dashed_line(b, from, to, fmin(width, DASHED_DP), color);
    else
        ui_line(b->ui, from, to, width, color);
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

static bool has(const struct skeleton *s, enum joint j) { return s->confidence[j] > 0; }

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
static int visible_parts(const struct figure_view *view, const struct skeleton *s, struct drawn_part out[PART_COUNT])
{
    int count = 0;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_ends ends = part_ends[p];
        struct drawn_part d = {.part = (enum part)p};
        if (!has(s, ends.from) || !has(s, ends.to) || !figure_point(view, s->joint[ends.from], &d.from) ||
            !figure_point(view, s->joint[ends.to], &d.to))
            continue;
        d.depth_m = depth_of(view, v3_mix(s->joint[ends.from], s->joint[ends.to], 0.5));
        out[count++] = d;
    }
    qsort(out, (size_t)count, sizeof *out, farther_first);
    return count;
}

// ---------------------------------------------------------------- body

static uint32_t mix(uint32_t a, uint32_t b, double t)
{
    uint32_t out = 0;
    for (int shift = 0; shift < 32; shift += 8) {
        const double x = a >> shift & 255, y = b >> shift & 255;
        out |= (uint32_t)lround(x + t * (y - x)) << shift;
    }
    return out;
}

static void draw_trunk(const struct brush *b, const struct figure_view *view, const struct skeleton *s, uint32_t color)
{
    static const enum joint around[] = {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HIP, JOINT_LEFT_HIP};
    struct ui_point at[4];
    for (int i = 0; i < 4; i++)
        if (!has(s, around[i]) || !figure_point(view, s->joint[around[i]], &at[i]))
            return;
    const double r = dp_per_m(view, depth_of(view, s->joint[JOINT_LEFT_HIP]));
    double area = 0; // a polygon is drawn one way round
    for (int i = 0; i < 4; i++)
        area += at[i].x * at[(i + 1) % 4].y - at[(i + 1) % 4].x * at[i].y;
    const struct ui_point turned[4] = {at[0], at[3], at[2], at[1]};
    ui_polygon(b->ui, area < 0 ? turned : at, 4, color);
    ui_stroke(b->ui, at, 4, true, 2 * 0.075 * r, color);
}

// Round the part, before it is drawn over.
static void draw_mark(const struct brush *b, const struct figure_view *view, const struct drawn_part *d)
{
    const double dp = dp_per_m(view, d->depth_m), r = thickness_m[d->part] * dp + MARK_DP;
    const uint32_t color = b->theme->accent;
    ui_line(b->ui, d->from, d->to, 2 * r, color);
    ui_disc(b->ui, d->from, r, color);
    ui_disc(b->ui, d->to, d->part == PART_HEAD ? SKULL_M * dp + MARK_DP : r, color);
}

static void draw_body(const struct brush *b, const struct figure_view *view, const struct figure *f)
{
    const struct theme *t = b->theme;
    const struct skeleton *s = f->skeleton;
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, s, parts);
    const uint32_t skin = mix(t->quiet, t->sky, f->dimmed ? 0.55 : 0.25), edge = mix(skin, t->ground, 0.45);
    for (int i = 0; i < count; i++) {
        const struct drawn_part *d = &parts[i];
        const double r = thickness_m[d->part] * dp_per_m(view, d->depth_m);
        const bool trunk = d->part == PART_UPPER_TORSO || d->part == PART_LOWER_TORSO,
                   marked = f->marked == (int)d->part + 1;
        if (d->part == PART_UPPER_TORSO)
            draw_trunk(b, view, s, skin);
        if (marked)
            draw_mark(b, view, d);
        if (trunk && !marked)
            continue;
        ui_line(b->ui, d->from, d->to, 2 * r + 3, edge);
        ui_line(b->ui, d->from, d->to, 2 * r, skin);
        ui_disc(b->ui, d->from, r, skin);
        ui_disc(b->ui, d->to, r, skin);
        if (d->part == PART_HEAD)
            ui_disc(b->ui, d->to, SKULL_M * dp_per_m(view, d->depth_m), skin);
    }
}

// ---------------------------------------------------------------- lines

// width, dash: dp.
static struct overlay_stroke stroke_of(const struct figure_view *view, struct vec3 from, struct vec3 to, double width,
                                       uint32_t color)
{
    return (struct overlay_stroke){from, to, width / view->cover.scale, 0, color};
}

static int put_limb(const struct theme *t, const struct figure_view *view, const struct figure *f, enum part part,
                    bool outline, struct overlay_stroke *out)
{
    const enum verdict v = f->verdicts ? f->verdicts[part] : VERDICT_UNKNOWN;
    const struct vec3 from = f->skeleton->joint[part_ends[part].from], to = f->skeleton->joint[part_ends[part].to];
    const double width = v == VERDICT_DIFFERENT ? 1.5 * LIMB_DP : LIMB_DP;
    if (outline && v == VERDICT_UNKNOWN)
        return 0;
    if (outline)
        *out = stroke_of(view, from, to, width + 4, 0x00000090);
    else if (!f->verdicts)
        *out = stroke_of(view, from, to, LIMB_DP * 0.6, faint(0xffffffff, 0.8));
    else
        *out = stroke_of(view, from, to, v == VERDICT_UNKNOWN ? DASHED_DP : width, verdict_color(t, v));
    if (f->verdicts && v == VERDICT_UNKNOWN)
        out->dash_px = DASH_DP / view->cover.scale;
    return 1;
}

static int put_limbs(const struct theme *t, const struct figure_view *view, const struct figure *f,
                     struct overlay_stroke *out)
{
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, f->skeleton, parts);
    int put = 0;
    for (int pass = 0; pass < 2; pass++) // first a dark outline, for contrast on any background
        for (int i = 0; i < count; i++)
            put += put_limb(t, view, f, parts[i].part, !pass, &out[put]);
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct ui_point at;
        if (has(f->skeleton, (enum joint)j) && figure_point(view, f->skeleton->joint[j], &at))
            out[put++] = stroke_of(view, f->skeleton->joint[j], f->skeleton->joint[j], 2 * LIMB_DP * 0.45,
                                   f->verdicts ? 0xffffffff : faint(0xffffffff, 0.8));
    }
    return put;
}

static int put_ghost(const struct theme *t, const struct figure_view *view, const struct figure *f,
                     struct overlay_stroke *out)
{
    struct drawn_part parts[PART_COUNT];
    const int count = visible_parts(view, f->skeleton, parts);
    const uint32_t color = faint(t->ghost, 0.5);
    int put = 0;
    for (int i = 0; i < count; i++) {
        const struct part_ends ends = part_ends[parts[i].part];
        const struct vec3 from = f->skeleton->joint[ends.from], to = f->skeleton->joint[ends.to];
        const double dp = dp_per_m(view, parts[i].depth_m);
        out[put++] = stroke_of(view, from, to, 2 * 0.8 * thickness_m[parts[i].part] * dp, color);
        if (parts[i].part == PART_HEAD)
            out[put++] = stroke_of(view, to, to, 2 * 0.9 * SKULL_M * dp, color);
    }
    return put;
}

int figure_strokes(const struct theme *t, const struct figure_view *view, const struct figure *f,
                   struct overlay_stroke out[FIGURE_STROKES_MOST])
{
    return f->kind == FIGURE_GHOST ? put_ghost(t, view, f, out) : put_limbs(t, view, f, out);
}

static void draw_strokes(const struct brush *b, const struct figure_view *view, const struct figure *f)
{
    struct overlay_stroke strokes[FIGURE_STROKES_MOST];
    const int count = figure_strokes(b->theme, view, f, strokes);
    for (int i = 0; i < count; i++) {
        const struct overlay_stroke *s = &strokes[i];
        const double width = s->width_px * view->cover.scale;
        struct ui_point from, to;
        if (!figure_point(view, s->from, &from) || !figure_point(view, s->to, &to))
            continue;
        if (v3_distance(s->from, s->to) == 0)
            ui_disc(b->ui, from, width / 2, s->color);
        else if (s->dash_px > 0)
            dashed_line(b, from, to, width, s->color);
        else
            ui_line(b->ui, from, to, width, s->color);
    }
}

void figure_draw(const struct brush *b, const struct figure_view *view, const struct figure *f)
{
    if (f->kind == FIGURE_BODY)
        draw_body(b, view, f);
    if (f->kind != FIGURE_BODY || f->verdicts)
        draw_strokes(b, view, f);
}
