#include "app/ui/view_compositor.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

// ---------------------------------------------------------------- screenshot

enum { QUALITY = 94 };

enum status screenshot_path(const char *folder, char *path, size_t capacity)
{
    char own[400], name[64];
    const char *home = getenv("HOME"), *pictures = getenv("XDG_PICTURES_DIR");
    if (!folder) {
        const char *base = pictures ? pictures : home;
        if (!base)
            base = ".";
        if (snprintf(own, sizeof own, "%s%s", base, pictures ? "" : "/Pictures") >= (int)sizeof own)
            return fail(ERR_INPUT, "the name of the folder for screenshots is too long");
        folder = own;
    }
    enum status status = folder_make(folder);
    if (status != OK)
        return status;
    time_t now = time(NULL);
    struct tm local;
    localtime_r(&now, &local);
    strftime(name, sizeof name, "reenact-%Y-%m-%d-%H%M%S", &local);
    for (int n = 1; n < 1000; n++) { // there may be several in a second
        char number[16] = "";
        if (n > 1)
            snprintf(number, sizeof number, "-%d", n);
        if (snprintf(path, capacity, "%s/%s%s.jpg", folder, name, number) >= (int)capacity)
            return fail(ERR_INPUT, "the name of the folder for screenshots is too long");
        if (!file_exists(path))
            return OK;
    }
    return fail(ERR_IO, "%s has too many screenshots of this second", folder);
}

static enum status write_jpeg(const uint8_t *rgba, int width, int height, const char *path)
{
    size_t pixels = (size_t)width * (size_t)height, count;
    uint8_t *rgb = malloc(3 * pixels), *bytes;
    if (!rgb)
        return fail(ERR_MEMORY, "no memory for a screenshot");
    for (size_t i = 0; i < pixels; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3);
    enum status status = jpeg_encode(rgb, width, height, QUALITY, &bytes, &count);
    free(rgb);
    if (status != OK)
        return status;
    status = file_write(path, bytes, count);
    free(bytes);
    return status;
}

enum status screenshot_take(const struct brush *b, struct gpu *gpu, const struct take_view_image *image,
                            const struct view_state *s, const char *path)
{
    const int width = image->lens.width, height = image->lens.height;
    struct gpu_target *target;
    uint8_t *rgba = malloc((size_t)width * (size_t)height * 4);
    if (!rgba)
        return fail(ERR_MEMORY, "no memory for a screenshot");
    enum status status = gpu_target_open(&target, gpu, width, height);
    const struct ui_input input = {.width_px = width, .height_px = height, .px_per_dp = ui_px_per_dp(b->ui)};
    if (status == OK)
        status = ui_begin(b->ui, &input);
    if (status == OK) {
        struct view_state without_ring = *s;
        without_ring.moving = false;
        compositor_draw(b, (struct ui_box){0, 0, ui_width(b->ui), ui_height(b->ui)}, image, &without_ring);
        ui_end(b->ui);
        status = ui_draw(b->ui, target, 0);
    }
    if (status == OK)
        status = gpu_target_read(target, rgba);
    if (status == OK)
        status = write_jpeg(rgba, width, height, path);
    gpu_target_close(&target);
    free(rgba);
    return status;
}

// ---------------------------------------------------------------- view compositor

static const double PI = 3.14159265358979323846, MIN_DEPTH_M = 0.1;
// Distances from the joints: how far hands, head and clothes extend, and how far the shadow is visible. Chosen by hand.
static const double BODY_M = 0.5, SHADOW_M = 0.7;
static const double SOFT_DP = 8;

struct cover cover_of(const struct lens *lens, struct ui_box box)
{
    double scale = fmax(box.w / lens->width, box.h / lens->height);
    return (struct cover){scale, box.x + (box.w - scale * lens->width) / 2, box.y + (box.h - scale * lens->height) / 2};
}

// False: the point is behind the camera.
static bool on_screen(const struct take_view_image *image, struct cover cover, struct vec3 world, struct ui_point *out)
{
    struct vec3 c = pose_apply(pose_inverse(image->world_from_camera), world);
    if (!(c.z > MIN_DEPTH_M))
        return false;
    struct pixel px = lens_project(&image->lens, c);
    *out = (struct ui_point){cover.x + (px.x + 0.5) * cover.scale, cover.y + (px.y + 0.5) * cover.scale};
    return isfinite(out->x) && isfinite(out->y) && fabs(out->x) < 1e5 && fabs(out->y) < 1e5;
}

bool cover_floor(const struct take_view_image *image, struct cover cover, struct ui_point at, struct vec3 *floor)
{
    struct pixel px = {(at.x - cover.x) / cover.scale - 0.5, (at.y - cover.y) / cover.scale - 0.5};
    struct vec3 ray = quat_rotate(image->world_from_camera.rotation, lens_ray(&image->lens, px));
    struct vec3 from = image->world_from_camera.translation;
    double along = -from.z / ray.z;
    if (!(ray.z < -1e-6) || !(along > 0) || !(along * v3_length(ray) < 15))
        return false;
    *floor = v3_add(from, v3_scale(ray, along));
    return true;
}

// ---------------------------------------------------------------- studio

// The horizon's y, dp; the camera is never rolled.
static double horizon_y(const struct take_view_image *image, struct cover cover)
{
    struct vec3 ahead = quat_rotate(image->world_from_camera.rotation, v3(0, 0, 1));
    struct vec3 level = v3_unit(v3(ahead.x, ahead.y, 0));
    struct ui_point at;
    return on_screen(image, cover, v3_add(image->world_from_camera.translation, v3_scale(level, 1000)), &at) ? at.y
                                                                                                             : cover.y;
}

static void draw_grid_line(const struct brush *brush, const struct take_view_image *image, struct cover cover,
                           struct vec3 from, struct vec3 to)
{
    enum { PIECES = 20 };
    const double reach_m = 4;
    struct vec3 middle_of = image->floor_point;
    struct ui_point before = {0, 0};
    bool had = false;
    for (int i = 0; i <= PIECES; i++) {
        struct vec3 w = v3_mix(from, to, (double)i / PIECES);
        struct ui_point now;
        bool has = on_screen(image, cover, w, &now);
        double away = v3_distance(w, middle_of) / reach_m;
        if (had && has && away < 1)
            ui_line(brush->ui, before, now, 1, faint(brush->theme->grid, 1 - away * away));
        before = now;
        had = has;
    }
}

static void draw_studio(const struct brush *brush, const struct take_view_image *image, struct cover cover,
                        struct ui_box box)
{
    const struct theme *t = brush->theme;
    double y = fmin(fmax(horizon_y(image, cover), box.y), box.y + box.h);
    ui_fade(brush->ui, (struct ui_box){box.x, box.y, box.w, y - box.y}, t->sky, t->floor);
    // At the horizon the floor has the wall's colour; nearer it is lighter.
    ui_fade(brush->ui, (struct ui_box){box.x, y, box.w, box.y + box.h - y}, t->floor, t->sky);
    const double step = 0.5;
    double x0 = floor(image->floor_point.x / step) * step, y0 = floor(image->floor_point.y / step) * step;
    for (int i = -8; i <= 8; i++) {
        draw_grid_line(brush, image, cover, v3(x0 + i * step, y0 - 4, 0), v3(x0 + i * step, y0 + 4, 0));
        draw_grid_line(brush, image, cover, v3(x0 - 4, y0 + i * step, 0), v3(x0 + 4, y0 + i * step, 0));
    }
}

// The whole image's box on the screen.
static struct ui_box whole_of(const struct take_view_image *image, struct cover cover)
{
    return (struct ui_box){cover.x, cover.y, cover.scale * image->lens.width, cover.scale * image->lens.height};
}

// The room's corners on the screen; false: one is behind the viewpoint, which is inside the room or near it.
static bool room_corners(const struct take_view_image *image, struct cover cover, struct ui_point out[8])
{
    for (int k = 0; k < 8; k++) {
        const struct vec3 at =
            v3(k & 1 ? image->room_high.x : image->room_low.x, k & 2 ? image->room_high.y : image->room_low.y,
               k & 4 ? image->room_high.z : image->room_low.z);
        if (!on_screen(image, cover, at, &out[k]))
            return false;
    }
    return true;
}

// How far the corners' outline reaches on the line x + y = c, as its x: a line between two corners crosses it there.
static bool room_on_diagonal(const struct ui_point corner[8], double c, double *from, double *to)
{
    *from = INFINITY;
    *to = -INFINITY;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < i; k++) {
            const double a = corner[i].x + corner[i].y - c, e = corner[k].x + corner[k].y - c;
            if ((a < 0) == (e < 0))
                continue;
            const double x = corner[i].x + (corner[k].x - corner[i].x) * a / (a - e);
            *from = fmin(*from, x);
            *to = fmax(*to, x);
        }
    return *from < *to;
}

// Faint diagonal lines: what is there in the room was not seen. Nothing beyond the room.
static void draw_hatching(const struct brush *brush, const struct take_view_image *image, struct cover cover,
                          struct ui_box box)
{
    const double step = 18;
    struct ui_point corner[8];
    const bool bounded = image->surface && room_corners(image, cover, corner);
    for (double x = box.x; x < box.x + box.w + box.h; x += step) { // from the lower left to the upper right
        const double c = x + box.y;
        double from = x - box.h, to = x, low, high;
        if (bounded && !room_on_diagonal(corner, c, &low, &high))
            continue;
        from = bounded ? fmax(from, low) : from;
        to = bounded ? fmin(to, high) : to;
        if (from < to)
            ui_line(brush->ui, (struct ui_point){from, c - from}, (struct ui_point){to, c - to}, 1.5,
                    faint(brush->theme->quiet, 0.14));
    }
}

// The recorded views, behind them the map's surface, and where neither shows anything the hatching.
static void draw_room(const struct brush *brush, const struct take_view_image *image, struct cover cover,
                      struct ui_box box)
{
    const struct ui_uv_rect all = {0, 0, 1, 1};
    if (!image->filmed && !image->surface)
        return;
    draw_hatching(brush, image, cover, box);
    if (image->surface)
        ui_image(brush->ui, image->surface, whole_of(image, cover), all, 0, 0xffffffff);
    if (image->filmed)
        ui_image(brush->ui, image->filmed, whole_of(image, cover), all, 0, 0xffffffff);
}

// ---------------------------------------------------------------- actor

enum { ROUND_POINTS = 40 };

static bool floor_circle(const struct take_view_image *image, struct cover cover, double radius_m, struct ui_point *out)
{
    for (int i = 0; i < ROUND_POINTS; i++) {
        double a = 2 * PI * i / ROUND_POINTS;
        struct vec3 at = v3_add(image->floor_point, v3(radius_m * cos(a), radius_m * sin(a), 0));
        if (!on_screen(image, cover, at, &out[i]))
            return false;
    }
    return true;
}

static void draw_ring(const struct brush *brush, const struct take_view_image *image, struct cover cover)
{
    struct ui_point points[ROUND_POINTS];
    if (!floor_circle(image, cover, 0.55, points))
        return;
    ui_polygon(brush->ui, points, ROUND_POINTS, faint(brush->theme->accent, 0.16));
    ui_stroke(brush->ui, points, ROUND_POINTS, true, 3, brush->theme->accent);
}

static void draw_skeleton(const struct brush *brush, const struct take_view_image *image, struct cover cover,
                          double presence)
{
    struct ui_point at[JOINT_COUNT];
    bool seen[JOINT_COUNT];
    for (int j = 0; j < JOINT_COUNT; j++)
        seen[j] = image->skeleton.confidence[j] > 0 && on_screen(image, cover, image->skeleton.joint[j], &at[j]);
    static const struct part_ends across[] = {{JOINT_LEFT_SHOULDER, JOINT_NECK},
                                              {JOINT_RIGHT_SHOULDER, JOINT_NECK},
                                              {JOINT_LEFT_HIP, JOINT_WAIST},
                                              {JOINT_RIGHT_HIP, JOINT_WAIST}};
    for (int pass = 0; pass < 2; pass++) { // first a dark outline, for contrast on any background
        uint32_t color = pass ? faint(brush->theme->accent, presence) : faint(0x000000a0, presence);
        double thickness = pass ? 3.5 : 6.5;
        for (int i = 0; i < PART_COUNT + (int)COUNT_OF(across); i++) {
            struct part_ends bone = i < PART_COUNT ? part_ends[i] : across[i - PART_COUNT];
            if (seen[bone.from] && seen[bone.to])
                ui_line(brush->ui, at[bone.from], at[bone.to], thickness, color);
        }
        for (int j = 0; j < JOINT_COUNT; j++) {
            const uint32_t inner_color = image->skeleton.confidence[j] < 1 ? brush->theme->warn : 0xffffffff;
            if (seen[j])
                ui_disc(brush->ui, at[j], pass ? 5 : 6.8, pass ? faint(inner_color, presence) : color);
        }
    }
}

// Bounding box of the joints, from the floor up.
static void extent_of(const struct take_view_image *image, struct vec3 *low, struct vec3 *high)
{
    *low = v3(INFINITY, INFINITY, 0), *high = v3(-INFINITY, -INFINITY, 0);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 at = image->skeleton.joint[j];
        if (!(image->skeleton.confidence[j] > 0))
            continue;
        *low = v3(fmin(low->x, at.x), fmin(low->y, at.y), fmin(low->z, at.z));
        *high = v3(fmax(high->x, at.x), fmax(high->y, at.y), fmax(high->z, at.z));
    }
}

// Bounds of the points on the screen, within the box; the whole box if one of them is behind the camera.
static struct ui_box box_around(const struct take_view_image *image, struct cover cover, struct ui_box box,
                                const struct vec3 *points, int count)
{
    double left = INFINITY, top = INFINITY, right = -INFINITY, bottom = -INFINITY;
    for (int i = 0; i < count; i++) {
        struct ui_point at;
        if (!on_screen(image, cover, points[i], &at))
            return box;
        left = fmin(left, at.x), right = fmax(right, at.x);
        top = fmin(top, at.y), bottom = fmax(bottom, at.y);
    }
    left = fmax(left - SOFT_DP, box.x), right = fmin(right + SOFT_DP, box.x + box.w);
    top = fmax(top - SOFT_DP, box.y), bottom = fmin(bottom + SOFT_DP, box.y + box.h);
    return (struct ui_box){left, top, fmax(0, right - left), fmax(0, bottom - top)};
}

// Bounds of a square block on the floor around all joints, wider and higher by BODY_M.
static struct ui_box block_box(const struct take_view_image *image, struct cover cover, struct ui_box box)
{
    struct vec3 low, high, points[27];
    extent_of(image, &low, &high);
    high.z += BODY_M;
    const double half = fmax(high.x - low.x, high.y - low.y) / 2 + BODY_M;
    const struct vec3 middle = v3_mix(low, high, 0.5);
    for (int i = 0; i < 27; i++) // edges' midpoints too, for a lens may bend edges outwards
        points[i] = v3(middle.x + (i % 3 - 1) * half, middle.y + (i / 3 % 3 - 1) * half,
                       low.z + i / 9 * 0.5 * (high.z - low.z));
    return box_around(image, cover, box, points, 27);
}

static struct ui_box common_box(struct ui_box a, struct ui_box b)
{
    const double left = fmax(a.x, b.x), right = fmin(a.x + a.w, b.x + b.w);
    const double top = fmax(a.y, b.y), bottom = fmin(a.y + a.h, b.y + b.h);
    return (struct ui_box){left, top, fmax(0, right - left), fmax(0, bottom - top)};
}

struct ui_box compositor_actor_box(const struct take_view_image *image, struct cover cover, struct ui_box box)
{
    const struct ui_box block = block_box(image, cover, box);
    const double w = cover.scale * image->lens.width, h = cover.scale * image->lens.height;
    const struct ui_uv_rect *of = &image->actor_part;
    const struct ui_box part = {cover.x + of->u0 * w - SOFT_DP, cover.y + of->v0 * h - SOFT_DP,
                                (of->u1 - of->u0) * w + 2 * SOFT_DP, (of->v1 - of->v0) * h + 2 * SOFT_DP};
    return common_box(block, part);
}

struct ui_box compositor_shadow_box(const struct take_view_image *image, struct cover cover, struct ui_box box)
{
    struct vec3 low, high, points[ROUND_POINTS];
    extent_of(image, &low, &high);
    // The corners of a polygon around a circle.
    const double reach = (fmax(high.x - low.x, high.y - low.y) / 2 + SHADOW_M) / cos(PI / ROUND_POINTS);
    for (int i = 0; i < ROUND_POINTS; i++) {
        const double a = 2 * PI * i / ROUND_POINTS;
        points[i] = v3((low.x + high.x) / 2 + reach * cos(a), (low.y + high.y) / 2 + reach * sin(a), 0);
    }
    return box_around(image, cover, box, points, ROUND_POINTS);
}

// Shadow, actor and sources, one over the other.
static void draw_actor(const struct brush *brush, struct ui_box box, const struct take_view_image *image,
                       const struct view_state *state)
{
    const struct cover cover = cover_of(&image->lens, box);
    const struct ui_box all = whole_of(image, cover);
    const struct ui_uv_rect upright = {0, 0, 1, 1}, over = {1, 0, 0, 1}, part = image->flip_x ? over : upright;
    const uint32_t tint = faint(0xffffffff, state->presence);
    if (image->shadow) {
        ui_clip(brush->ui, compositor_shadow_box(image, cover, box));
        ui_image(brush->ui, image->shadow, all, part, 0, tint);
        ui_unclip(brush->ui);
    }
    ui_clip(brush->ui, compositor_actor_box(image, cover, box));
    if (image->actor)
        ui_image(brush->ui, image->actor, all, part, 0, tint);
    if (image->sources)
        ui_image(brush->ui, image->sources, all, part, 0, tint);
    ui_unclip(brush->ui);
}

// ---------------------------------------------------------------- until the body is whole

static bool lacks_body(const struct take_view_image *image) { return image->making || image->bodiless; }

// What the sensor saw: in an orbit all that is shown, in a camera's image as a card. Fades as the body comes, if it
// does.
static void draw_sensor(const struct brush *brush, struct ui_box box, const struct take_view_image *image,
                        const struct view_state *state)
{
    const double share = image->camera ? 0.5 : 1,
                 opacity = lacks_body(image) ? 1 : 1 - state->crossfade; // chosen by hand
    if (!image->camera)
        ui_fill(brush->ui, box, 0, faint(brush->theme->ground, opacity));
    if (image->sensor) {
        const double w = share * fmin(box.w, box.h * image->sensor_aspect), h = w / image->sensor_aspect;
        const struct ui_box at = {box.x + (box.w - w) / 2, box.y + (box.h - h) / 2, w, h};
        const struct ui_uv_rect part = {image->flip_x, 0, !image->flip_x, 1};
        ui_image(brush->ui, image->sensor, at, part, image->camera ? ROUND : 0, faint(0xffffffff, opacity));
    }
    if (!lacks_body(image))
        return;
    char text[64] = "No body can be made of this take";
    if (image->making)
        snprintf(text, sizeof text, "The body is being made, %.0f %%", 100 * state->avatar_progress);
    const double w = fmin(ui_text_width(brush->ui, FACE_STRONG, text) + 2 * MARGIN, box.w);
    const struct ui_box word = {box.x + (box.w - w) / 2, box.y + box.h * 0.5 * (1 - share) + TARGET + 2 * MARGIN, w,
                                40};
    ui_fill(brush->ui, word, 20, brush->theme->glass);
    label_centred(brush, FACE_STRONG, word, brush->theme->text, text);
}

void compositor_draw(const struct brush *brush, struct ui_box box, const struct take_view_image *image,
                     const struct view_state *state)
{
    struct cover cover = cover_of(&image->lens, box);
    ui_clip(brush->ui, box);
    if (image->camera)
        ui_image(brush->ui, image->camera, whole_of(image, cover), (struct ui_uv_rect){0, 0, 1, 1}, 0, 0xffffffff);
    else
        draw_studio(brush, image, cover, box);
    if (!image->camera)
        draw_room(brush, image, cover, box);
    const bool waits = lacks_body(image) && !image->camera; // the sensor's image is of another viewpoint than these
    if (state->presence > 0 && image->has_skeleton && !waits) {
        if (state->moving)
            draw_ring(brush, image, cover);
        draw_actor(brush, box, image, state);
        if (state->skeleton)
            draw_skeleton(brush, image, cover, state->presence);
    }
    if (state->presence > 0 && image->overlay && !waits)
        ui_image(brush->ui, image->overlay, whole_of(image, cover),
                 image->flip_x ? (struct ui_uv_rect){1, 0, 0, 1} : (struct ui_uv_rect){0, 0, 1, 1}, 0,
                 faint(0xffffffff, state->presence));
    if (lacks_body(image) || (image->sensor && state->crossfade < 1))
        draw_sensor(brush, box, image, state);
    ui_unclip(brush->ui);
}
