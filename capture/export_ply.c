// Points of a frame and of a place, as PLY.
#include "capture/export.h"

#include "platform/files/jpeg.h"
#include "formats/ply.h"

#include <stdlib.h>

static const uint8_t NO_COLOR[3] = {160, 160, 160};

// A depth image with the colours that belong to it.
struct colored_depth {
    const struct calibration *calibration;
    const uint16_t *depth; // millimetres
    const uint8_t *rgb;    // NULL: none
    const uint8_t *mask;   // only these pixels; NULL: all
    struct pose world_from_color;
    int step; // every so many pixels and rows
};

static const uint8_t *color_at(const struct colored_depth *d, struct vec3 in_color)
{
    const struct lens *l = &d->calibration->color;
    if (!d->rgb || !(in_color.z > 0))
        return NO_COLOR;
    const struct pixel px = lens_project_clamped(l, lens_max_radius2(l), in_color);
    const long x = lround(px.x), y = lround(px.y);
    if (x < 0 || y < 0 || x >= l->width || y >= l->height)
        return NO_COLOR;
    return d->rgb + 3 * ((size_t)y * (size_t)l->width + (size_t)x);
}

static enum status add_depth(struct ply *ply, const struct colored_depth *d)
{
    const struct lens *l = &d->calibration->depth;
    const struct pose color_from_depth = d->calibration->color_from_depth;
    for (int y = 0; y < l->height; y += d->step)
        for (int x = 0; x < l->width; x += d->step) {
            const size_t i = (size_t)y * (size_t)l->width + (size_t)x;
            if (!d->depth[i] || (d->mask && !d->mask[i]))
                continue;
            const struct vec3 ray = lens_ray(l, (struct pixel){x, y});
            const struct vec3 p = pose_apply(color_from_depth, v3_scale(ray, 0.001 * d->depth[i]));
            enum status status = ply_add_point(ply, pose_apply(d->world_from_color, p), color_at(d, p));
            if (status != OK)
                return status;
        }
    return OK;
}

enum status export_points_ply(struct take *take, int64_t frame, bool actor, FILE *out)
{
    const struct take_entry *e = take_entry(take, frame);
    struct take_images images;
    struct ply ply = {0};
    enum status status = take_read(take, frame, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
    if (status == OK && (!images.depth || (actor && !images.mask)))
        return NOTHING;
    if (status == OK) {
        const struct colored_depth d = {.calibration = take_calibration(take),
                                        .depth = images.depth,
                                        .rgb = images.color,
                                        .mask = actor ? images.mask : NULL,
                                        .world_from_color = e->located ? e->world_from_camera : POSE_IDENTITY,
                                        .step = 1};
        status = add_depth(&ply, &d);
    }
    if (status == OK && !ply.point_count)
        status = NOTHING;
    if (status == OK)
        ply_print(&ply, e->located ? "world axes, z up" : "camera axes, x right, y down, z forward", out);
    ply_free(&ply);
    return status;
}

static enum status add_view(struct ply *ply, const struct place *place, const struct place_view *view)
{
    const struct lens *l = &place->calibration.color;
    uint8_t *rgb = NULL;
    if (!view->depth)
        return OK;
    if (view->jpeg && l->width) {
        rgb = malloc(3 * (size_t)l->width * (size_t)l->height);
        if (!rgb)
            return fail(ERR_MEMORY, "no memory for an image of the place");
        enum status status = jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, l->width, l->height);
        if (status != OK) {
            free(rgb);
            rgb = NULL; // damaged: its points have no colour
        }
        if (status == ERR_MEMORY)
            return status;
    }
    const struct colored_depth d = {.calibration = &place->calibration,
                                    .depth = view->depth,
                                    .rgb = rgb,
                                    .world_from_color = view->world_from_camera,
                                    .step = 4};
    enum status status = add_depth(ply, &d);
    free(rgb);
    return status;
}

static enum status add_tag(struct ply *ply, const struct place_tag *tag)
{
    static const uint8_t red[3] = {220, 40, 40};
    struct vec3 corners[4];
    const int32_t first = ply->point_count;
    enum status status = OK;
    place_tag_corners(tag, corners);
    for (int i = 0; i < 4 && status == OK; i++)
        status = ply_add_point(ply, corners[i], red);
    if (status == OK)
        status = ply_add_triangle(ply, first, first + 1, first + 2);
    return status == OK ? ply_add_triangle(ply, first, first + 2, first + 3) : status;
}

enum status export_place_ply(const struct place *place, FILE *out)
{
    static const uint8_t green[3] = {40, 180, 90};
    struct ply ply = {0};
    enum status status = OK;
    for (int32_t i = 0; i < place->tag_count && status == OK; i++)
        status = add_tag(&ply, &place->tags[i]);
    for (int32_t i = 0; i < place->point_count && status == OK; i++)
        status = ply_add_point(&ply, place->points[i].world, green);
    for (int32_t i = 0; i < place->view_count && status == OK; i++)
        status = add_view(&ply, place, &place->views[i]);
    if (status == OK && !ply.point_count)
        status = NOTHING;
    if (status == OK)
        ply_print(&ply, "world axes, z up; tags red, landmarks green", out);
    ply_free(&ply);
    return status;
}
