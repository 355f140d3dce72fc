#include "reenact/frame/frame_layer.h"

#include "reenact/frame/exposure.h"
#include "reenact/frame/triangle_visibility.h"
#include "reenact/avatar/deformation.h"

#include <stdlib.h>
#include <string.h>

enum { INNER_PX = 3, EDGE_PX = 4 }; // EDGE_PX: edges are searched no farther, since more than INNER_PX suffices

static const double NEAR_PLANE_M = 0.05;                   // points nearer or behind are outside
static const double MIN_COSINE = 0.15, FULL_COSINE = 0.45; // visibility rises between these cosines; chosen by hand

struct frame_layer_loader {
    struct take *take;
    const struct take_skeletons *skeletons;
    const struct avatar *avatar;
    struct depth_frame depth_frame;
    struct deformation *deformation;
    uint8_t *rgb; // the frame's cleaned colours
};

void frame_layer_free(struct frame_layer *f)
{
    free(f->color.pixels);
    free(f->depth.pixels);
    free(f->shift);
    free(f->points);
    free(f->triangle_visible);
    *f = (struct frame_layer){0};
}

static size_t texels(const struct frame_layer_image *p) { return (size_t)p->width * (size_t)p->height; }

size_t frame_layer_bytes(const struct frame_layer *f)
{
    const size_t bytes_per_point = sizeof *f->shift + sizeof *f->points;
    return 4 * (texels(&f->color) + texels(&f->depth)) + bytes_per_point * (size_t)f->point_count +
           sizeof *f->triangle_visible * (size_t)f->triangle_count;
}

enum status frame_layer_loader_open(struct frame_layer_loader **out, const struct frame_source *source,
                                    const struct avatar *avatar)
{
    struct frame_layer_loader *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    l->take = source->take;
    l->skeletons = source->skeletons;
    l->avatar = avatar;
    const struct calibration *c = take_calibration(l->take);
    l->rgb = malloc(3 * (size_t)c->color.width * (size_t)c->color.height);
    enum status status =
        l->rgb ? depth_frame_open(&l->depth_frame, l->take, source->rays) : fail(ERR_MEMORY, "out of memory");
    l->depth_frame.max_edge_distance = EDGE_PX;
    if (status == OK)
        status = deformation_open(&l->deformation, &avatar->bind_pose, &avatar->surface, c);
    if (status != OK)
        frame_layer_loader_close(out);
    return status;
}

void frame_layer_loader_close(struct frame_layer_loader **out)
{
    struct frame_layer_loader *l = *out;
    if (!l)
        return;
    deformation_close(&l->deformation);
    depth_frame_close(&l->depth_frame);
    free(l->rgb);
    free(l);
    *out = NULL;
}

// Allocates an image of that size, zeroed.
static enum status alloc_image(struct frame_layer_image *p, int width, int height, int bytes_per_pixel)
{
    p->width = width, p->height = height;
    p->pixels = calloc(texels(p), (size_t)bytes_per_pixel);
    return p->pixels ? OK : fail(ERR_MEMORY, "out of memory");
}

// The smallest side no smaller than that which is no power of two: Mesa's software renderer compiles a program again
// for a texture with a power-of-two side, and drawing such a frame would take ten times as long as others.
static int avoid_power_of_two(int side)
{
    while (!(side & (side - 1)))
        side++;
    return side;
}

static void set_window(float window[4], int left, int top, const struct frame_layer_image *p)
{
    window[0] = (float)left, window[1] = (float)top, window[2] = (float)p->width, window[3] = (float)p->height;
}

// Crops depth to the actor's bounds and at least one more pixel on every side, which stays 0.
static enum status crop_depth(const struct depth_frame *s, struct frame_layer *out)
{
    struct frame_layer_image *p = &out->depth;
    int left = s->left - 1, top = s->top - 1;
    enum status status =
        alloc_image(p, avoid_power_of_two(s->right - left + 2), avoid_power_of_two(s->bottom - top + 2), 4);
    set_window(out->windows[1], left, top, p);
    for (int y = s->top; y <= s->bottom && status == OK; y++)
        for (int x = s->left; x <= s->right; x++) {
            int at = y * s->width + x;
            uint8_t *texel = p->pixels + 4 * ((size_t)(y - top) * (size_t)p->width + (size_t)(x - left));
            int inner = s->part[at] < PART_COUNT ? s->edge_distance[at] : 0;
            inner = inner > INNER_PX ? INNER_PX : inner;
            const int depth_mm = inner ? depth_frame_median_mm(s, at) : s->depth[at];
            texel[0] = (uint8_t)(depth_mm >> 8);
            texel[1] = (uint8_t)(depth_mm & 255);
            texel[2] = (uint8_t)(255 * inner / INNER_PX);
        }
    return status;
}

// The range first..last of a side of `all` pixels, enlarged for avoid_power_of_two where there is space.
static void crop_side(int first, int last, int all, int *start, int *length)
{
    *length = avoid_power_of_two(last + 1 - first);
    *length = *length < all ? *length : all;
    *start = first + *length <= all ? first : all - *length;
}

static enum status crop_color(const struct frame_layer_loader *l, struct frame_layer *out)
{
    const struct calibration *c = take_calibration(l->take);
    const struct depth_frame *s = &l->depth_frame;
    struct frame_layer_image *p = &out->color;
    int left = 0, top = 0, width = c->color.width, height = c->color.height;
    if (c->registered && width == s->width && height == s->height) {
        crop_side(s->left, s->right, s->width, &left, &width);
        crop_side(s->top, s->bottom, s->height, &top, &height);
    }
    enum status status = alloc_image(p, width, height, 3);
    set_window(out->windows[0], left, top, p);
    for (int y = 0; y < height && status == OK; y++)
        memcpy(p->pixels + 3 * (size_t)y * (size_t)width,
               l->rgb + 3 * ((size_t)(top + y) * (size_t)c->color.width + (size_t)left), 3 * (size_t)width);
    return status;
}

static enum status make_empty_images(struct frame_layer *out)
{
    enum status status = alloc_image(&out->color, avoid_power_of_two(1), avoid_power_of_two(1), 3);
    if (status == OK)
        status = alloc_image(&out->depth, avoid_power_of_two(1), avoid_power_of_two(1), 4);
    set_window(out->windows[0], 0, 0, &out->color);
    set_window(out->windows[1], 0, 0, &out->depth);
    return status;
}

static void store_vec3(float out[3], struct vec3 v) { out[0] = (float)v.x, out[1] = (float)v.y, out[2] = (float)v.z; }

static double smoothstep(double low, double high, double x)
{
    double t = fmin(fmax((x - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
}

static void project_to_window(const struct lens *lens, double largest_r2, struct vec3 p, const float window[4],
                              float out[2])
{
    const struct pixel px = lens_project_clamped(lens, largest_r2, p);
    out[0] = (float)((px.x + 0.5 - (double)window[0]) / (double)window[2]);
    out[1] = (float)((px.y + 0.5 - (double)window[1]) / (double)window[3]);
}

// transforms: the frame's pose with corrections, colour camera's axes.
static enum status fill_points(const struct frame_layer_loader *l, const struct bone_transforms *transforms,
                               struct frame_layer *out)
{
    const struct calibration *c = take_calibration(l->take);
    const struct texture_atlas *a = &l->avatar->atlas;
    const struct quat world_from_color = take_entry(l->take, out->frame)->world_from_camera.rotation;
    const struct pose depth_from_color = pose_inverse(c->color_from_depth);
    const double color_r2 = lens_max_radius2(&c->color), depth_r2 = lens_max_radius2(&c->depth);
    out->point_count = a->mesh.point_count;
    out->shift = malloc(sizeof *out->shift * (size_t)out->point_count);
    out->points = calloc((size_t)out->point_count, sizeof *out->points);
    if (!out->shift || !out->points)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < out->point_count; i++) {
        struct frame_layer_point *to = &out->points[i];
        const struct vec3 shift = deformation_at(l->deformation, a->points[i]);
        struct vec3 p, n;
        linear_blend_skin(&l->avatar->skins[a->mesh.points[i]], transforms, v3_add(a->points[i], shift), a->normals[i],
                          &p, &n);
        const struct vec3 w = quat_rotate(world_from_color, n), d = pose_apply(depth_from_color, p);
        store_vec3(out->shift[i], shift);
        store_vec3(to->normal, n);
        to->irradiance = sqrtf(sh_irradiance_at(&l->avatar->vertex_colors.irradiance,
                                                (const float[3]){(float)w.x, (float)w.y, (float)w.z}));
        if (!out->has_images || p.z < NEAR_PLANE_M || d.z < NEAR_PLANE_M)
            continue;
        project_to_window(&c->color, color_r2, p, out->windows[0], to->color_uv);
        project_to_window(&c->depth, depth_r2, d, out->windows[1], to->depth_uv);
        to->depth_m = (float)d.z;
        to->visibility = (float)smoothstep(MIN_COSINE, FULL_COSINE, -v3_dot(n, v3_unit(p)));
    }
    return OK;
}

static void fill_exposure(const struct frame_layer_loader *l, struct frame_layer *out)
{
    const struct exposure_input input = {l->avatar, &l->depth_frame, &take_calibration(l->take)->color, l->rgb};
    out->exposure_gain = out->has_images ? exposure_estimate(&input, out) : 1;
    for (int i = 0; i < out->point_count; i++)
        out->points[i].irradiance *= out->exposure_gain;
}

static enum status fill_triangle_visibility(const struct frame_layer_loader *l, struct frame_layer *out)
{
    const struct uv_mesh *m = &l->avatar->atlas.mesh;
    out->triangle_count = m->corner_count / 3;
    out->triangle_visible = malloc(sizeof *out->triangle_visible * (size_t)out->triangle_count);
    if (!out->triangle_visible)
        return fail(ERR_MEMORY, "out of memory");
    triangle_visibility_find(m, out, out->triangle_visible);
    return OK;
}

// Registers the avatar to the depth frame and deforms it.
static void fit_avatar(struct frame_layer_loader *l, const struct bone_transforms *joints, struct frame_layer *out)
{
    const struct avatar *k = l->avatar;
    const struct icp_input from = {*joints, k->joint_errors, out->corrections, true};
    out->corrections = articulated_icp(k->tsdf, &l->depth_frame, &from, NULL);
    struct bone_transforms fitted = bone_corrections_apply(joints, &out->corrections);
    const struct deformation_model model = {k->tsdf, &k->surface, k->skins};
    const struct deformation_colors colors = {.albedo = (const float(*)[3])k->vertex_colors.color,
                                              .filled = k->vertex_colors.filled,
                                              .irradiance = &k->vertex_colors.irradiance,
                                              .rgb = l->rgb,
                                              .calibration = take_calibration(l->take),
                                              .world_from_color =
                                                  take_entry(l->take, out->frame)->world_from_camera.rotation};
    deformation_fit(l->deformation, &model, &l->depth_frame, &fitted, out->has_images ? &colors : NULL);
}

// Reads the frame's row, once, and fits the avatar, which is in `joints`, to it. NOTHING: it does not show the actor.
static enum status read_frame(struct frame_layer_loader *l, const struct bone_transforms *joints,
                              struct frame_layer *out)
{
    const struct take_entry *e = take_entry(l->take, out->frame);
    struct take_images images;
    if (!e->has_depth || !e->has_skeleton)
        return NOTHING;
    enum status status = take_read(l->take, out->frame, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
    if (status != OK)
        return status == ERR_CORRUPT ? NOTHING : status; // a damaged frame costs itself alone
    depth_frame_label(&l->depth_frame, &images, take_skeletons_at(l->skeletons, out->frame));
    out->has_images = images.color && l->depth_frame.left <= l->depth_frame.right;
    if (out->has_images)
        status = depth_frame_clean_colors(&l->depth_frame, take_calibration(l->take), images.color, l->rgb);
    if (status != OK)
        return status;
    fit_avatar(l, joints, out);
    return out->has_images ? OK : NOTHING;
}

static enum status crop(const struct frame_layer_loader *l, struct frame_layer *out)
{
    if (!out->has_images)
        return make_empty_images(out);
    enum status status = crop_depth(&l->depth_frame, out);
    return status == OK ? crop_color(l, out) : status;
}

enum status frame_layer_loader_load(struct frame_layer_loader *l, int64_t frame, struct frame_layer *out)
{
    struct bone_transforms joints;
    *out =
        (struct frame_layer){.frame = frame, .exposure_gain = 1, .corrections = avatar_corrections(l->avatar, frame)};
    deformation_clear(l->deformation);
    enum status status = bone_transforms_of(&l->avatar->bind_pose, take_skeletons_at(l->skeletons, frame), &joints);
    const bool posed = status == OK;
    if (posed)
        status = read_frame(l, &joints, out);
    if (status >= 0)
        status = crop(l, out);
    if (status == OK && posed) {
        joints = bone_corrections_apply(&joints, &out->corrections);
        status = fill_points(l, &joints, out);
    }
    if (status == OK && posed) {
        fill_exposure(l, out);
        status = fill_triangle_visibility(l, out);
    }
    if (status != OK)
        frame_layer_free(out);
    return status;
}
