// The map beside the picture: the place's surface with what is known over it.
#include "app/ui/room_page.h"

#include <math.h>

enum { ROUND_POINTS = 36 };
static const double PI = 3.14159265358979323846, HEADING_M = 0.55;

static void draw_segment(const struct brush *brush, const struct figure_view *view, struct vec3 from, struct vec3 to,
                         double thickness, uint32_t color)
{
    struct ui_point p, q;
    if (figure_point(view, from, &p) && figure_point(view, to, &q))
        ui_line(brush->ui, p, q, thickness, color);
}

// Where there is no surface yet, a floor of half metres tells how far things are apart.
static void draw_floor(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    const double step = 0.5;
    const int reach = 10;
    for (int i = -reach; i <= reach; i++)
        for (int k = -reach; k < reach; k++) {
            const double away = hypot(i, k) / reach, share = fmax(0, 1 - away * away);
            if (share <= 0)
                continue;
            draw_segment(brush, v, v3(i * step, k * step, 0), v3(i * step, (k + 1) * step, 0), 1,
                         faint(brush->theme->grid, share));
            draw_segment(brush, v, v3(k * step, i * step, 0), v3((k + 1) * step, i * step, 0), 1,
                         faint(brush->theme->grid, share));
        }
}

static void draw_tag(const struct brush *brush, const struct figure_view *view, const struct place_tag *tag)
{
    struct vec3 world[4];
    struct ui_point at[4];
    place_tag_corners(tag, world);
    for (int i = 0; i < 4; i++)
        if (!figure_point(view, world[i], &at[i]))
            return;
    ui_stroke(brush->ui, at, 4, true, 2.5, brush->theme->ghost);
}

// The three great circles of the 95 % ellipsoid.
static void draw_ellipsoid(const struct brush *brush, const struct figure_view *view, const struct room_thing *thing)
{
    const uint32_t color = faint(thing->gone ? brush->theme->warn : brush->theme->accent, 0.9);
    for (int axis = 0; axis < 3; axis++) {
        struct ui_point at[ROUND_POINTS];
        bool good = true;
        for (int i = 0; i < ROUND_POINTS && good; i++) {
            const double a = 2 * PI * i / ROUND_POINTS;
            const struct vec3 p =
                v3_add(v3_scale(thing->ellipsoid[axis], cos(a)), v3_scale(thing->ellipsoid[(axis + 1) % 3], sin(a)));
            good = figure_point(view, v3_add(thing->world_from_thing.translation, p), &at[i]);
        }
        if (good)
            ui_stroke(brush->ui, at, ROUND_POINTS, true, 1.5, color);
    }
}

// The outline of the thing's front, so that it is found where its body is small or hidden.
static void draw_front(const struct brush *brush, const struct figure_view *view, const struct room_thing *thing)
{
    static const double corner[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    struct ui_point at[4];
    for (int i = 0; i < 4; i++)
        if (!figure_point(view,
                          pose_apply(thing->world_from_thing,
                                     v3(corner[i][0] * thing->width_m, corner[i][1] * thing->height_m, 0)),
                          &at[i]))
            return;
    ui_stroke(brush->ui, at, 4, true, 2, thing->gone ? brush->theme->warn : brush->theme->accent);
}

// The tablet's picture plane as a pyramid, and an arrow on the floor below it where it looks to.
static void draw_viewer(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    const struct lens *l = &page->viewer_lens;
    const struct pose *pose = &page->world_from_viewer;
    const struct vec3 eye = pose->translation;
    struct vec3 corner[4];
    for (int i = 0; i < 4; i++) {
        const struct pixel px = {i == 1 || i == 2 ? l->width - 1 : 0, i >= 2 ? l->height - 1 : 0};
        corner[i] = pose_apply(*pose, v3_scale(lens_ray(l, px), 0.35));
    }
    for (int i = 0; i < 4; i++) {
        draw_segment(brush, v, eye, corner[i], 2, brush->theme->warn);
        draw_segment(brush, v, corner[i], corner[(i + 1) % 4], 2, brush->theme->warn);
    }
    const struct vec3 ahead = quat_rotate(pose->rotation, v3(0, 0, 1)), level = v3_unit(v3(ahead.x, ahead.y, 0));
    const struct vec3 foot = v3(eye.x, eye.y, 0), tip = v3_add(foot, v3_scale(level, HEADING_M));
    const struct vec3 across = v3(-level.y, level.x, 0), back = v3_sub(tip, v3_scale(level, 0.16));
    draw_segment(brush, v, eye, foot, 1, faint(brush->theme->warn, 0.6));
    draw_segment(brush, v, foot, tip, 3, brush->theme->warn);
    draw_segment(brush, v, tip, v3_add(back, v3_scale(across, 0.1)), 3, brush->theme->warn);
    draw_segment(brush, v, tip, v3_sub(back, v3_scale(across, 0.1)), 3, brush->theme->warn);
}

static void draw_path(const struct brush *brush, const struct room_page *page)
{
    for (int i = 1; i < page->path_count; i++) {
        const double share = 0.25 + 0.75 * i / page->path_count;
        draw_segment(brush, &page->map_view, page->path[i - 1], page->path[i], 2.5, faint(brush->theme->warn, share));
    }
}

// A robot's way over the floor, and where it stands: the edges of its body, and a chevron on it at its front.
static void draw_drive(const struct brush *brush, const struct figure_view *view, const struct recorded_drive *drive)
{
    const uint32_t color = brush->theme->right;
    const struct pose *at = &drive->world_from_body;
    const double half[3] = {drive->size_m[0] / 2, drive->size_m[1] / 2, drive->size_m[2]};
    struct vec3 corner[8];
    for (int i = 1; i <= drive->path_count; i++)
        draw_segment(brush, view, drive->path[i - 1], i < drive->path_count ? drive->path[i] : at->translation, 2.5,
                     faint(color, 0.8));
    for (int i = 0; i < 8; i++)
        corner[i] = pose_apply(*at, v3(i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1], i & 4 ? half[2] : 0));
    for (int i = 0; i < 8; i++)
        for (int axis = 1; axis <= 4; axis *= 2)
            if (!(i & axis))
                draw_segment(brush, view, corner[i], corner[i | axis], 2, color);
    for (int side = -1; side <= 1; side += 2)
        draw_segment(brush, view, pose_apply(*at, v3(half[0], 0, half[2])),
                     pose_apply(*at, v3(0, side * half[1], half[2])), 3, color);
}

void map_overlay_draw(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    for (int i = 0; i < page->tag_count; i++)
        draw_tag(brush, v, &page->tags[i]);
    for (int i = 0; i < page->count; i++) {
        draw_front(brush, v, &page->things[i]);
        draw_ellipsoid(brush, v, &page->things[i]);
    }
    draw_path(brush, page);
    if (page->drive)
        draw_drive(brush, v, page->drive);
    if (page->actor)
        figure_draw(brush, v, &(struct figure){FIGURE_BODY, page->actor, NULL, false, 0});
    if (page->viewer_known)
        draw_viewer(brush, page);
}

void map_draw(const struct brush *brush, const struct room_page *page, struct ui_box box)
{
    const struct theme *t = brush->theme;
    ui_clip(brush->ui, box);
    ui_fade(brush->ui, box, t->sky, t->floor);
    draw_floor(brush, page);
    if (page->map)
        ui_image(brush->ui, page->map, figure_image_box(&page->map_view), (struct ui_uv_rect){0, 0, 1, 1}, 0,
                 0xffffffff);
    map_overlay_draw(brush, page);
    if (page->map_is_coming)
        label_centred(brush, FACE_SMALL, (struct ui_box){box.x, box.y + MARGIN + TARGET + GAP, box.w, 24}, t->quiet,
                      "The map is being made");
    ui_fill(brush->ui, (struct ui_box){box.x, box.y, box.h > box.w ? 2 : box.w, box.h > box.w ? box.h : 2}, 0,
            t->ground);
    ui_unclip(brush->ui);
}
