// The map beside the picture: the place's surface with what is known over it.
#include "app/ui/room_page.h"

#include <math.h>

enum { ROUND_POINTS = 36 };
static const double PI = 3.14159265358979323846, HEADING_M = 0.55;

static void line(const struct brush *b, const struct figure_view *v, struct vec3 from, struct vec3 to, double thickness,
                 uint32_t color)
{
    struct ui_point p, q;
    if (figure_point(v, from, &p) && figure_point(v, to, &q))
        ui_line(b->ui, p, q, thickness, color);
}

// Where there is no surface yet, a floor of half metres tells how far things are apart.
static void draw_floor(const struct brush *b, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    const double step = 0.5;
    const int reach = 10;
    for (int i = -reach; i <= reach; i++)
        for (int k = -reach; k < reach; k++) {
            const double away = hypot(i, k) / reach, share = fmax(0, 1 - away * away);
            if (share <= 0)
                continue;
            line(b, v, v3(i * step, k * step, 0), v3(i * step, (k + 1) * step, 0), 1, faint(b->theme->grid, share));
            line(b, v, v3(k * step, i * step, 0), v3((k + 1) * step, i * step, 0), 1, faint(b->theme->grid, share));
        }
}

static void draw_tag(const struct brush *b, const struct figure_view *v, const struct place_tag *tag)
{
    struct vec3 world[4];
    struct ui_point at[4];
    place_tag_corners(tag, world);
    for (int i = 0; i < 4; i++)
        if (!figure_point(v, world[i], &at[i]))
            return;
    ui_stroke(b->ui, at, 4, true, 2.5, b->theme->ghost);
}

// The three great circles of the 95 % ellipsoid.
static void draw_ellipsoid(const struct brush *b, const struct figure_view *v, const struct room_thing *t)
{
    const uint32_t color = faint(t->gone ? b->theme->warn : b->theme->accent, 0.9);
    for (int axis = 0; axis < 3; axis++) {
        struct ui_point at[ROUND_POINTS];
        bool good = true;
        for (int i = 0; i < ROUND_POINTS && good; i++) {
            const double a = 2 * PI * i / ROUND_POINTS;
            const struct vec3 p =
                v3_add(v3_scale(t->ellipsoid[axis], cos(a)), v3_scale(t->ellipsoid[(axis + 1) % 3], sin(a)));
            good = figure_point(v, v3_add(t->world_from_thing.translation, p), &at[i]);
        }
        if (good)
            ui_stroke(b->ui, at, ROUND_POINTS, true, 1.5, color);
    }
}

// The outline of the thing's front, so that it is found where its body is small or hidden.
static void draw_front(const struct brush *b, const struct figure_view *v, const struct room_thing *t)
{
    static const double corner[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    struct ui_point at[4];
    for (int i = 0; i < 4; i++)
        if (!figure_point(v,
                          pose_apply(t->world_from_thing, v3(corner[i][0] * t->width_m, corner[i][1] * t->height_m, 0)),
                          &at[i]))
            return;
    ui_stroke(b->ui, at, 4, true, 2, t->gone ? b->theme->warn : b->theme->accent);
}

// The tablet's picture plane as a pyramid, and an arrow on the floor below it where it looks to.
static void draw_viewer(const struct brush *b, const struct room_page *page)
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
        line(b, v, eye, corner[i], 2, b->theme->warn);
        line(b, v, corner[i], corner[(i + 1) % 4], 2, b->theme->warn);
    }
    const struct vec3 ahead = quat_rotate(pose->rotation, v3(0, 0, 1)), level = v3_unit(v3(ahead.x, ahead.y, 0));
    const struct vec3 foot = v3(eye.x, eye.y, 0), tip = v3_add(foot, v3_scale(level, HEADING_M));
    const struct vec3 across = v3(-level.y, level.x, 0), back = v3_sub(tip, v3_scale(level, 0.16));
    line(b, v, eye, foot, 1, faint(b->theme->warn, 0.6));
    line(b, v, foot, tip, 3, b->theme->warn);
    line(b, v, tip, v3_add(back, v3_scale(across, 0.1)), 3, b->theme->warn);
    line(b, v, tip, v3_sub(back, v3_scale(across, 0.1)), 3, b->theme->warn);
}

static void draw_path(const struct brush *b, const struct room_page *page)
{
    for (int i = 1; i < page->path_count; i++) {
        const double share = 0.25 + 0.75 * i / page->path_count;
        line(b, &page->map_view, page->path[i - 1], page->path[i], 2.5, faint(b->theme->warn, share));
    }
}

// A robot's way over the floor, and where it stands: the edges of its body, and a chevron on it at its front.
static void draw_drive(const struct brush *b, const struct figure_view *v, const struct recorded_drive *d)
{
    const uint32_t color = b->theme->right;
    const struct pose *at = &d->world_from_body;
    const double half[3] = {d->size_m[0] / 2, d->size_m[1] / 2, d->size_m[2]};
    struct vec3 corner[8];
    for (int i = 1; i <= d->path_count; i++)
        line(b, v, d->path[i - 1], i < d->path_count ? d->path[i] : at->translation, 2.5, faint(color, 0.8));
    for (int i = 0; i < 8; i++)
        corner[i] = pose_apply(*at, v3(i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1], i & 4 ? half[2] : 0));
    for (int i = 0; i < 8; i++)
        for (int axis = 1; axis <= 4; axis *= 2)
            if (!(i & axis))
                line(b, v, corner[i], corner[i | axis], 2, color);
    for (int side = -1; side <= 1; side += 2)
        line(b, v, pose_apply(*at, v3(half[0], 0, half[2])), pose_apply(*at, v3(0, side * half[1], half[2])), 3, color);
}

void map_overlay_draw(const struct brush *b, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    for (int i = 0; i < page->tag_count; i++)
        draw_tag(b, v, &page->tags[i]);
    for (int i = 0; i < page->count; i++) {
        draw_front(b, v, &page->things[i]);
        draw_ellipsoid(b, v, &page->things[i]);
    }
    draw_path(b, page);
    if (page->drive)
        draw_drive(b, v, page->drive);
    if (page->actor)
        figure_draw(b, v, &(struct figure){FIGURE_BODY, page->actor, NULL, false, 0});
    if (page->viewer_known)
        draw_viewer(b, page);
}

void map_draw(const struct brush *b, const struct room_page *page, struct ui_box box)
{
    const struct theme *t = b->theme;
    ui_clip(b->ui, box);
    ui_fade(b->ui, box, t->sky, t->floor);
    draw_floor(b, page);
    if (page->map)
        ui_image(b->ui, page->map, figure_image_box(&page->map_view), (struct ui_uv_rect){0, 0, 1, 1}, 0, 0xffffffff);
    map_overlay_draw(b, page);
    if (page->map_is_coming)
        label_centred(b, FACE_SMALL, (struct ui_box){box.x, box.y + MARGIN + TARGET + GAP, box.w, 24}, t->quiet,
                      "The map is being made");
    ui_fill(b->ui, (struct ui_box){box.x, box.y, box.h > box.w ? 2 : box.w, box.h > box.w ? box.h : 2}, 0, t->ground);
    ui_unclip(b->ui);
}
