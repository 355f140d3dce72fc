#include "surround/drive/operator_overlay.h"

#include "base/portable_math.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RANK = 10, ARC_STEPS = 24, GLYPH_WIDTH = 3, GLYPH_HEIGHT = 5 };
#define ARROW_S 2.0
#define PI      3.14159265358979323846

const uint8_t overlay_body_color[3] = {60, 160, 255};
static const uint8_t arrow_color[3] = {255, 210, 0}, path_color[3] = {90, 220, 120};

// By how far off the nearest thing is: a hand's breadth, in which a robot at full speed does not stop; an arm's length;
// farther, where it is no warning.
static const struct {
    double below_m;
    uint8_t color[3];
} warnings[] = {{0.2, {255, 40, 40}}, {0.6, {255, 170, 0}}, {INFINITY, {235, 240, 245}}};

enum overlay_warning overlay_warning_of(double distance_m)
{
    if (distance_m < warnings[WARNING_TOUCHING].below_m)
        return WARNING_TOUCHING;
    return distance_m < warnings[WARNING_NEAR].below_m ? WARNING_NEAR : WARNING_NONE;
}

const uint8_t *overlay_warning_color(enum overlay_warning warning) { return warnings[warning].color; }

static struct vec3 in_body(struct pose world_from_body, const double at[3])
{
    return pose_apply(pose_inverse(world_from_body), v3(at[0], at[1], at[2]));
}

static double excess_beyond(double x, double half)
{
    if (x > half)
        return x - half;
    return x < -half ? x + half : 0;
}

enum status nearest_in_view(const struct surround_view *view, struct pose world_from_body, const double size_m[3],
                            double low_m, struct nearest_thing *out)
{
    struct nearest_thing list[RANK];
    int count = 0;
    for (int y = 0; y < view->lens.height; y++)
        for (int x = 0; x < view->lens.width; x++) {
            const float inverse_z = view->inverse_z[(size_t)y * (size_t)view->lens.width + (size_t)x];
            struct nearest_thing one;
            if (inverse_z <= 0)
                continue;
            surround_view_point(view, x, y, inverse_z, one.at);
            const struct vec3 b = in_body(world_from_body, one.at);
            if (b.z < low_m || b.z > size_m[2])
                continue;
            const double dx = excess_beyond(b.x, size_m[0] / 2), dy = excess_beyond(b.y, size_m[1] / 2);
            one.distance_m = sqrt(dx * dx + dy * dy);
            if (count == RANK && list[RANK - 1].distance_m <= one.distance_m)
                continue;
            const struct vec3 from = pose_apply(world_from_body, v3(b.x - dx, b.y - dy, b.z));
            one.from[0] = from.x, one.from[1] = from.y, one.from[2] = from.z;
            int at = count < RANK ? count++ : RANK - 1;
            for (; at > 0 && list[at - 1].distance_m > one.distance_m; at--)
                list[at] = list[at - 1];
            list[at] = one;
        }
    if (count < RANK)
        return NOTHING;
    *out = list[RANK - 1];
    return OK;
}

// Pixel and 1 / z of a world point; false: behind the view.
static bool project_point(const struct surround_view *view, struct vec3 p, double *x, double *y, double *inverse_z)
{
    const struct vec3 d = v3_sub(p, view->world_from_view.translation);
    const double w[3] = {d.x, d.y, d.z};
    double c[3];
    for (int i = 0; i < 3; i++)
        c[i] = view->axes[0][i] * w[0] + view->axes[1][i] * w[1] + view->axes[2][i] * w[2];
    if (c[2] < 0.05)
        return false;
    *x = view->lens.fx * c[0] / c[2] + view->lens.cx;
    *y = view->lens.fy * c[1] / c[2] + view->lens.cy;
    *inverse_z = 1 / c[2];
    return true;
}

static void tint_pixel(struct surround_view *view, int x, int y, const uint8_t color[3], int percent)
{
    if (x < 0 || y < 0 || x >= view->lens.width || y >= view->lens.height)
        return;
    uint8_t *rgb = view->rgb + 3 * ((size_t)y * (size_t)view->lens.width + (size_t)x);
    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)((rgb[c] * (100 - percent) + color[c] * percent) / 100);
}

static void add_line(struct overlay_shapes *out, const struct surround_view *view, struct vec3 a, struct vec3 b,
                     const uint8_t color[3])
{
    struct overlay_line *line = &out->lines[out->line_count];
    double z;
    if (out->line_count == OVERLAY_LINES || !project_point(view, a, &line->ax, &line->ay, &z) ||
        !project_point(view, b, &line->bx, &line->by, &z))
        return;
    memcpy(line->color, color, sizeof line->color);
    out->line_count++;
}

static void draw_line(struct surround_view *view, const struct overlay_line *line)
{
    const double length = fmax(fabs(line->bx - line->ax), fabs(line->by - line->ay));
    const int steps = length < 1 ? 1 : length > 4000 ? 4000 : (int)length;
    for (int i = 0; i <= steps; i++) {
        const double t = (double)i / steps;
        const int x = (int)floor(line->ax + t * (line->bx - line->ax) + 0.5),
                  y = (int)floor(line->ay + t * (line->by - line->ay) + 0.5);
        tint_pixel(view, x, y, line->color, OVERLAY_LINE_PERCENT);
        tint_pixel(view, x + 1, y, line->color, OVERLAY_LINE_PERCENT);
    }
}

// The body's box: where the ray through a pixel meets it before what is drawn there, the pixel is tinted.
static void draw_body(struct surround_view *view, const struct operator_overlay *overlay)
{
    const struct pose body_from_view = pose_multiply(pose_inverse(overlay->world_from_body), view->world_from_view);
    const double low[3] = {-overlay->size_m[0] / 2, -overlay->size_m[1] / 2, 0};
    const double high[3] = {overlay->size_m[0] / 2, overlay->size_m[1] / 2, overlay->size_m[2]};
    double m[3][3];
    quat_to_matrix(body_from_view.rotation, m);
    const double from[3] = {body_from_view.translation.x, body_from_view.translation.y, body_from_view.translation.z};
    for (int y = 0; y < view->lens.height; y++)
        for (int x = 0; x < view->lens.width; x++) {
            const double c[3] = {(x - view->lens.cx) / view->lens.fx, (y - view->lens.cy) / view->lens.fy, 1};
            double enter = 0.05, leave = 1e9; // z along the view
            for (int i = 0; i < 3; i++) {
                const double ray = m[i][0] * c[0] + m[i][1] * c[1] + m[i][2];
                const double a = (low[i] - from[i]) / ray, b = (high[i] - from[i]) / ray;
                enter = fmax(enter, fmin(a, b));
                leave = fmin(leave, fmax(a, b));
            }
            const float inverse_z = view->inverse_z[(size_t)y * (size_t)view->lens.width + (size_t)x];
            if (enter < leave && enter > 0.05 && !(inverse_z > 1 / enter))
                tint_pixel(view, x, y, overlay_body_color, OVERLAY_BODY_PERCENT);
        }
}

static void add_edges(struct overlay_shapes *out, const struct surround_view *view,
                      const struct operator_overlay *overlay)
{
    const double low[3] = {-overlay->size_m[0] / 2, -overlay->size_m[1] / 2, 0};
    const double high[3] = {overlay->size_m[0] / 2, overlay->size_m[1] / 2, overlay->size_m[2]};
    for (int k = 0; k < 12; k++) {
        const int axis = k / 4, b = (axis + 1) % 3, c = (axis + 2) % 3;
        double p[3], q[3];
        p[axis] = low[axis], q[axis] = high[axis];
        p[b] = q[b] = k & 1 ? high[b] : low[b];
        p[c] = q[c] = k & 2 ? high[c] : low[c];
        add_line(out, view, pose_apply(overlay->world_from_body, v3(p[0], p[1], p[2])),
                 pose_apply(overlay->world_from_body, v3(q[0], q[1], q[2])), overlay_body_color);
    }
}

// A chevron on its top, at its front.
static void add_heading(struct overlay_shapes *out, const struct surround_view *view,
                        const struct operator_overlay *overlay)
{
    const struct vec3 front = pose_apply(overlay->world_from_body, v3(overlay->size_m[0] / 2, 0, overlay->size_m[2]));
    for (int side = -1; side <= 1; side += 2)
        add_line(out, view, front,
                 pose_apply(overlay->world_from_body, v3(0, side * overlay->size_m[1] / 2, overlay->size_m[2])),
                 overlay_body_color);
}

static void add_path(struct overlay_shapes *out, const struct surround_view *view,
                     const struct operator_overlay *overlay)
{
    const struct drive_path *p = overlay->path;
    const struct vec3 above_floor = v3(0, 0, 0.02);
    for (int i = 0; p && i < p->count; i++)
        add_line(out, view, v3_add(p->at[i], above_floor),
                 v3_add(i + 1 < p->count ? p->at[i + 1] : overlay->world_from_body.translation, above_floor),
                 path_color);
}

static void add_arrow(struct overlay_shapes *out, const struct surround_view *view,
                      const struct operator_overlay *overlay)
{
    if (fabs(overlay->command.speed) < 1e-3 && fabs(overlay->command.turn_rate) < 1e-3)
        return;
    const double front = overlay->command.speed < 0 ? -overlay->size_m[0] / 2 : overlay->size_m[0] / 2;
    struct vec3 last = pose_apply(overlay->world_from_body, v3(front, 0, 0.03));
    struct pose end = overlay->world_from_body;
    for (int i = 1; i <= ARC_STEPS; i++) {
        end = robot_motion_after(overlay->world_from_body, overlay->command, ARROW_S * i / ARC_STEPS);
        const struct vec3 next = pose_apply(end, v3(front, 0, 0.03));
        add_line(out, view, last, next, arrow_color);
        last = next;
    }
    const double back = overlay->command.speed < 0 ? 0.12 : -0.12;
    add_line(out, view, last, pose_apply(end, v3(front + back, 0.08, 0.03)), arrow_color);
    add_line(out, view, last, pose_apply(end, v3(front + back, -0.08, 0.03)), arrow_color);
}

// Digits, '.', 'm', 's', 'c' and the letters of the warning, 3 x 5, rows from the top, the left pixel the highest bit.
static uint16_t glyph_rows(char c)
{
    static const struct {
        char c;
        uint16_t rows; // five times three bits
    } glyphs[] = {{'0', 075557}, {'1', 026227}, {'2', 071747}, {'3', 071717}, {'4', 055711}, {'5', 074717},
                  {'6', 074757}, {'7', 071111}, {'8', 075757}, {'9', 075717}, {'.', 000002}, {'m', 005755},
                  {'c', 007447}, {'s', 003616}, {'-', 000700}, {'L', 044447}, {'I', 072227}, {'N', 065555},
                  {'K', 055655}, {'O', 075557}, {'S', 074717}, {'T', 072222}, {'E', 074647}, {'D', 065556}};
    for (size_t i = 0; i < COUNT_OF(glyphs); i++)
        if (glyphs[i].c == c)
            return glyphs[i].rows;
    return 0;
}

static void add_rect(struct overlay_shapes *out, const struct overlay_rect *rect)
{
    if (out->rect_count < OVERLAY_RECTS)
        out->rects[out->rect_count++] = *rect;
}

// White on a darkened box.
static void add_text(struct overlay_shapes *out, int x, int y, int scale, const char *text)
{
    const int step = (GLYPH_WIDTH + 1) * scale, length = (int)strlen(text);
    add_rect(out,
             &(struct overlay_rect){x - scale, y - scale, length * step + scale, (GLYPH_HEIGHT + 2) * scale, 0, 35});
    for (; *text; text++, x += step)
        for (int k = 0; k < GLYPH_WIDTH * GLYPH_HEIGHT; k++)
            if (glyph_rows(*text) >> (GLYPH_WIDTH * GLYPH_HEIGHT - 1 - k) & 1)
                add_rect(out, &(struct overlay_rect){x + k % GLYPH_WIDTH * scale, y + k / GLYPH_WIDTH * scale, scale,
                                                     scale, 255, 100});
}

static void draw_rect(struct surround_view *view, const struct overlay_rect *rect)
{
    const uint8_t color[3] = {rect->grey, rect->grey, rect->grey};
    for (int y = rect->y; y < rect->y + rect->height; y++)
        for (int x = rect->x; x < rect->x + rect->width; x++)
            tint_pixel(view, x, y, color, rect->percent);
}

void operator_overlay_shapes(struct overlay_shapes *out, const struct surround_view *view,
                             const struct operator_overlay *overlay, const struct nearest_thing *thing)
{
    const int scale = view->lens.width < 400 ? 1 : view->lens.width / 200;
    char text[32];
    out->line_count = out->rect_count = 0;
    add_path(out, view, overlay);
    add_edges(out, view, overlay);
    add_heading(out, view, overlay);
    add_arrow(out, view, overlay);
    if (thing) {
        double x, y, z;
        const struct vec3 at = v3(thing->at[0], thing->at[1], thing->at[2]);
        add_line(out, view, v3(thing->from[0], thing->from[1], thing->from[2]), at,
                 overlay_warning_color(overlay_warning_of(thing->distance_m)));
        snprintf(text, sizeof text, "%.2f m", thing->distance_m);
        if (!overlay->wordless && project_point(view, at, &x, &y, &z) && fabs(x) < 1e5 && fabs(y) < 1e5)
            add_text(out, (int)x + 2 * scale, (int)y, scale, text);
    }
    if (overlay->wordless)
        return;
    snprintf(text, sizeof text, "%.1f s", overlay->age_s < 9999 ? overlay->age_s : 9999);
    add_text(out, 2 * scale, 2 * scale, scale, text);
    if (overlay->link_lost)
        add_text(out, view->lens.width / 2 - 18 * scale, view->lens.height / 2, scale, "LINK LOST");
}

void operator_overlay_draw(struct surround_view *view, const struct operator_overlay *overlay,
                           const struct nearest_thing *thing)
{
    struct overlay_shapes shapes;
    operator_overlay_shapes(&shapes, view, overlay, thing);
    draw_body(view, overlay);
    for (int i = 0; i < shapes.line_count; i++)
        draw_line(view, &shapes.lines[i]);
    for (int i = 0; i < shapes.rect_count; i++)
        draw_rect(view, &shapes.rects[i]);
}

// A view at `eye` that looks at `target`; its y axis is as far down as can be.
static struct pose look_at_pose(struct vec3 eye, struct vec3 target, struct vec3 up)
{
    const struct vec3 z = v3_unit(v3_sub(target, eye)), x = v3_unit(v3_cross(z, up)), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), eye};
}

struct pose operator_viewpoint(enum viewpoint kind, struct pose world_from_body, const double size_m[3])
{
    const struct vec3 up = v3(0, 0, 1), ahead = quat_rotate(world_from_body.rotation, v3(1, 0, 0));
    const double height = size_m[2];
    switch (kind) {
    case VIEWPOINT_FIRST:
        return look_at_pose(pose_apply(world_from_body, v3(0, 0, height)),
                            pose_apply(world_from_body, v3(2, 0, height - 0.5)), up);
    case VIEWPOINT_ABOVE:
        return look_at_pose(pose_apply(world_from_body, v3(0, 0, height + 1)), pose_apply(world_from_body, v3(0, 0, 0)),
                            ahead);
    default: return operator_orbit(world_from_body, 0, PI / 4, 2);
    }
}

struct pose operator_orbit(struct pose world_from_body, double azimuth, double elevation, double distance_m)
{
    const double c = portable_cos(elevation), height = portable_sin(elevation) * distance_m;
    const struct vec3 eye =
        v3(-portable_cos(azimuth) * c * distance_m, -portable_sin(azimuth) * c * distance_m, height);
    return look_at_pose(pose_apply(world_from_body, eye), pose_apply(world_from_body, v3(0, 0, 0.3)), v3(0, 0, 1));
}
