#include "reenact/frame/frame_layer.h"

#include "reenact/avatar/deformation.h"
#include "reenact/observation/depth_frame.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- exposure, types

// Estimates a frame's exposure gain against the avatar's mean colours: lamps are nearer or farther, and the camera's
// automatic exposure varies. It is measured where the frame saw the actor; what it did not see is drawn from the
// avatar's colours multiplied by it. Method: a one-parameter weighted least-squares fit, iterated, with Geman-McClure
// weights against outliers and a prior at gain 1. Pure; deterministic.

struct exposure_input {
    const struct avatar *avatar;
    const struct depth_frame *depth_frame;
    const struct lens *color; // the frame's
    const uint8_t *rgb;       // the frame's colours, gamma-encoded
};

// ---------------------------------------------------------------- exposure

enum { PASSES = 4, EXPOSURE_INNER_PX = 3 };

static const float MIN_VISIBILITY = 0.5F; // of frame_layer_point. These constants are chosen by hand
static const double OUTLIER_SCALE = 0.2;  // of colours 0..1: a residual this large has weight a quarter
static const double PRIOR = 1;            // of the gain 1, in the unit of the sums: squared colours 0..1
static const double MAX_GAIN = 1.4;

// The frame's pixel at a window's texture coordinates; -1: outside.
static int pixel_of(const float at[2], const float window[4], int width, int height)
{
    const int x = (int)floorf(at[0] * window[2] + window[0]), y = (int)floorf(at[1] * window[3] + window[1]);
    return x < 0 || y < 0 || x >= width || y >= height ? -1 : y * width + x;
}

// The frame's colour of a point that it saw frontally, well within a surface; NULL: it did not.
static const uint8_t *sample_color(const struct exposure_input *in, const struct frame_layer *layer,
                                   const struct frame_layer_point *point)
{
    const struct depth_frame *frame = in->depth_frame;
    if (point->visibility < MIN_VISIBILITY)
        return NULL;
    const int depth = pixel_of(point->depth_uv, layer->windows[1], frame->width, frame->height);
    const int color = pixel_of(point->color_uv, layer->windows[0], in->color->width, in->color->height);
    if (depth < 0 || color < 0 || !depth_agrees(frame, depth, (double)point->depth_m, EXPOSURE_INNER_PX))
        return NULL;
    return in->rgb + 3 * (size_t)color;
}

// layer: its points' positions, visibility and irradiance, the last before any gain. Returns the gain of gamma-encoded
// colours (square roots of linear ones), in [1/1.4, 1.4]; near 1 where too little is seen.
static float exposure_estimate(const struct exposure_input *in, const struct frame_layer *layer)
{
    const struct vertex_colors *vertex_colors = &in->avatar->vertex_colors;
    const int32_t *points = in->avatar->atlas.mesh.points;
    double gain = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        double shown_known = PRIOR, known_known = PRIOR;
        for (int i = 0; i < layer->point_count; i++) {
            const uint8_t *rgb = vertex_colors->filled[points[i]] ? NULL : sample_color(in, layer, &layer->points[i]);
            double shown[3], known[3], residual2 = 0;
            for (int c = 0; c < 3 && rgb; c++) {
                shown[c] = rgb[c] / 255.0;
                known[c] = (double)(sqrtf(vertex_colors->color[points[i]][c]) * layer->points[i].irradiance);
                residual2 += (shown[c] - gain * known[c]) * (shown[c] - gain * known[c]);
            }
            const double weight = 1 / (1 + residual2 / (OUTLIER_SCALE * OUTLIER_SCALE));
            for (int c = 0; c < 3 && rgb; c++) {
                shown_known += weight * weight * shown[c] * known[c];
                known_known += weight * weight * known[c] * known[c];
            }
        }
        gain = fmin(fmax(shown_known / known_known, 1 / MAX_GAIN), MAX_GAIN);
    }
    return (float)gain;
}

// ---------------------------------------------------------------- triangle visibility

// Which of the avatar's triangles may take colours of the shown frame: a conservative test of the shader's depth
// agreement over each triangle's footprint in the depth image. The others, which the frame did not see, saw at a
// grazing angle or saw occluded, are drawn without sampling the frame. Pure; deterministic.

static const double DEPTH_TOLERANCE_M = 0.09;        // from here on depth_agreement.glsl rejects the frame's colour
static const double SLACK_PX = 1e-3, SLACK_M = 1e-4; // for the shader's rounding

// A triangle projected into the depth image: corners in texels, depth as a plane over them.
struct depth_triangle {
    double at[3][2];
    double depth_m, slope[2]; // at its first corner, and the change for one texel
};

// False: it is seen edge-on, and nothing can be said of its inside.
static bool project_triangle(const struct frame_layer *layer, const int32_t *corners, struct depth_triangle *out)
{
    double edges[2][3]; // from its first corner to the others: x, y in texels, depth in metres
    for (int k = 0; k < 3; k++) {
        const struct frame_layer_point *p = &layer->points[corners[k]];
        out->at[k][0] = (double)p->depth_uv[0] * layer->depth.width;
        out->at[k][1] = (double)p->depth_uv[1] * layer->depth.height;
        if (k == 0) {
            out->depth_m = (double)p->depth_m;
            continue;
        }
        edges[k - 1][0] = out->at[k][0] - out->at[0][0];
        edges[k - 1][1] = out->at[k][1] - out->at[0][1];
        edges[k - 1][2] = (double)p->depth_m - out->depth_m;
    }
    const double area = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0];
    if (fabs(area) < 1e-6)
        return false;
    out->slope[0] = (edges[0][2] * edges[1][1] - edges[1][2] * edges[0][1]) / area;
    out->slope[1] = (edges[1][2] * edges[0][0] - edges[0][2] * edges[1][0]) / area;
    return true;
}

// Whether the triangle may overlap a texel's square, which lies outside none of its edges.
static bool texel_overlaps(const struct depth_triangle *triangle, int x, int y)
{
    bool all = true;
    for (int k = 0; k < 3; k++) {
        const double *a = triangle->at[k], *b = triangle->at[(k + 1) % 3], *c = triangle->at[(k + 2) % 3];
        const double across[2] = {a[1] - b[1], b[0] - a[0]};
        const double inwards = across[0] * (c[0] - a[0]) + across[1] * (c[1] - a[1]) > 0 ? 1 : -1;
        const double middle = inwards * (across[0] * (x + 0.5 - a[0]) + across[1] * (y + 0.5 - a[1]));
        all = all && middle + (0.5 + SLACK_PX) * (fabs(across[0]) + fabs(across[1])) >= 0;
    }
    return all;
}

// Whether a texel's depth may agree with some of the triangle.
static bool texel_agrees(const struct frame_layer_image *depth, const struct depth_triangle *triangle, int x, int y)
{
    const uint8_t *texel = depth->pixels + 4 * ((size_t)y * (size_t)depth->width + (size_t)x);
    const double seen_m = (texel[0] * 256 + texel[1]) * 1e-3;
    const double middle_m = triangle->depth_m + triangle->slope[0] * (x + 0.5 - triangle->at[0][0]) +
                            triangle->slope[1] * (y + 0.5 - triangle->at[0][1]);
    const double reach_m = (0.5 + SLACK_PX) * (fabs(triangle->slope[0]) + fabs(triangle->slope[1])) + SLACK_M;
    return texel[2] > 0 && fabs(middle_m - seen_m) - reach_m < DEPTH_TOLERANCE_M;
}

static bool may_be_visible(const struct frame_layer *layer, const int32_t *corners)
{
    struct depth_triangle l;
    int low[2], high[2];
    float max = 0;
    for (int k = 0; k < 3; k++)
        max = fmaxf(max, layer->points[corners[k]].visibility);
    if (!layer->has_images || !(max > 0))
        return false;
    if (!project_triangle(layer, corners, &l))
        return true;
    for (int a = 0; a < 2; a++) {
        // Outside the image the texture is clamped to its border, which agrees with nothing.
        const double last = (a ? layer->depth.height : layer->depth.width) - 1;
        low[a] = (int)floor(fmax(fmin(l.at[0][a], fmin(l.at[1][a], l.at[2][a])) - SLACK_PX, 0));
        high[a] = (int)floor(fmin(fmax(l.at[0][a], fmax(l.at[1][a], l.at[2][a])) + SLACK_PX, last));
    }
    for (int y = low[1]; y <= high[1]; y++)
        for (int x = low[0]; x <= high[0]; x++)
            if (texel_overlaps(&l, x, y) && texel_agrees(&layer->depth, &l, x, y))
                return true;
    return false;
}

// out: one flag for each of the mesh's triangles. layer: its depth image and points are used. Conservative: never false
// for a triangle of which avatar.frag would take the frame's colour for some pixel.
static void triangle_visibility_find(const struct uv_mesh *mesh, const struct frame_layer *layer, bool *out)
{
    for (int t = 0; t < mesh->corner_count / 3; t++)
        out[t] = may_be_visible(layer, mesh->corners + 3 * (size_t)t);
}

// ---------------------------------------------------------------- frame layer

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

void frame_layer_free(struct frame_layer *layer)
{
    free(layer->color.pixels);
    free(layer->depth.pixels);
    free(layer->shift);
    free(layer->points);
    free(layer->triangle_visible);
    *layer = (struct frame_layer){0};
}

static size_t texel_count(const struct frame_layer_image *image)
{
    return (size_t)image->width * (size_t)image->height;
}

size_t frame_layer_bytes(const struct frame_layer *layer)
{
    const size_t bytes_per_point = sizeof *layer->shift + sizeof *layer->points;
    return 4 * (texel_count(&layer->color) + texel_count(&layer->depth)) +
           bytes_per_point * (size_t)layer->point_count +
           sizeof *layer->triangle_visible * (size_t)layer->triangle_count;
}

enum status frame_layer_loader_open(struct frame_layer_loader **out, const struct frame_source *source,
                                    const struct avatar *avatar)
{
    struct frame_layer_loader *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "no memory for a frame layer");
    l->take = source->take;
    l->skeletons = source->skeletons;
    l->avatar = avatar;
    const struct calibration *c = take_calibration(l->take);
    l->rgb = malloc(3 * (size_t)c->color.width * (size_t)c->color.height);
    enum status status = l->rgb ? depth_frame_open(&l->depth_frame, l->take, source->rays)
                                : fail(ERR_MEMORY, "no memory for a frame layer");
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
static enum status alloc_image(struct frame_layer_image *image, int width, int height, int bytes_per_pixel)
{
    image->width = width, image->height = height;
    image->pixels = calloc(texel_count(image), (size_t)bytes_per_pixel);
    return image->pixels ? OK : fail(ERR_MEMORY, "no memory for a frame layer");
}

// The smallest side no smaller than that which is no power of two: Mesa's software renderer compiles a program again
// for a texture with a power-of-two side, and drawing such a frame would take ten times as long as others.
static int avoid_power_of_two(int side)
{
    while (!(side & (side - 1)))
        side++;
    return side;
}

static void set_window(float window[4], int left, int top, const struct frame_layer_image *image)
{
    window[0] = (float)left, window[1] = (float)top, window[2] = (float)image->width, window[3] = (float)image->height;
}

// Crops depth to the actor's bounds and at least one more pixel on every side, which stays 0.
static enum status crop_depth(const struct depth_frame *frame, struct frame_layer *out)
{
    struct frame_layer_image *image = &out->depth;
    int left = frame->left - 1, top = frame->top - 1;
    enum status status =
        alloc_image(image, avoid_power_of_two(frame->right - left + 2), avoid_power_of_two(frame->bottom - top + 2), 4);
    set_window(out->windows[1], left, top, image);
    for (int y = frame->top; y <= frame->bottom && status == OK; y++)
        for (int x = frame->left; x <= frame->right; x++) {
            int at = y * frame->width + x;
            uint8_t *texel = image->pixels + 4 * ((size_t)(y - top) * (size_t)image->width + (size_t)(x - left));
            int inner = frame->part[at] < PART_COUNT ? frame->edge_distance[at] : 0;
            inner = inner > INNER_PX ? INNER_PX : inner;
            const int depth_mm = inner ? depth_frame_median_mm(frame, at) : frame->depth[at];
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

static enum status crop_color(const struct frame_layer_loader *loader, struct frame_layer *out)
{
    const struct calibration *c = take_calibration(loader->take);
    const struct depth_frame *frame = &loader->depth_frame;
    struct frame_layer_image *image = &out->color;
    int left = 0, top = 0, width = c->color.width, height = c->color.height;
    if (c->registered && width == frame->width && height == frame->height) {
        crop_side(frame->left, frame->right, frame->width, &left, &width);
        crop_side(frame->top, frame->bottom, frame->height, &top, &height);
    }
    enum status status = alloc_image(image, width, height, 3);
    set_window(out->windows[0], left, top, image);
    for (int y = 0; y < height && status == OK; y++)
        memcpy(image->pixels + 3 * (size_t)y * (size_t)width,
               loader->rgb + 3 * ((size_t)(top + y) * (size_t)c->color.width + (size_t)left), 3 * (size_t)width);
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
static enum status fill_points(const struct frame_layer_loader *loader, const struct bone_transforms *transforms,
                               struct frame_layer *out)
{
    const struct calibration *c = take_calibration(loader->take);
    const struct texture_atlas *a = &loader->avatar->atlas;
    const struct quat world_from_color = take_entry(loader->take, out->frame)->world_from_camera.rotation;
    const struct pose depth_from_color = pose_inverse(c->color_from_depth);
    const double color_r2 = lens_max_radius2(&c->color), depth_r2 = lens_max_radius2(&c->depth);
    out->point_count = a->mesh.point_count;
    out->shift = malloc(sizeof *out->shift * (size_t)out->point_count);
    out->points = calloc((size_t)out->point_count, sizeof *out->points);
    if (!out->shift || !out->points)
        return fail(ERR_MEMORY, "no memory for a frame layer");
    for (int i = 0; i < out->point_count; i++) {
        struct frame_layer_point *to = &out->points[i];
        const struct vec3 shift = deformation_at(loader->deformation, a->points[i]);
        struct vec3 p, n;
        linear_blend_skin(&loader->avatar->skins[a->mesh.points[i]], transforms, v3_add(a->points[i], shift),
                          a->normals[i], &p, &n);
        const struct vec3 w = quat_rotate(world_from_color, n), d = pose_apply(depth_from_color, p);
        store_vec3(out->shift[i], shift);
        store_vec3(to->normal, n);
        to->irradiance = sqrtf(sh_irradiance_at(&loader->avatar->vertex_colors.irradiance,
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

static void fill_exposure(const struct frame_layer_loader *loader, struct frame_layer *out)
{
    const struct exposure_input input = {loader->avatar, &loader->depth_frame, &take_calibration(loader->take)->color,
                                         loader->rgb};
    out->exposure_gain = out->has_images ? exposure_estimate(&input, out) : 1;
    for (int i = 0; i < out->point_count; i++)
        out->points[i].irradiance *= out->exposure_gain;
}

static enum status fill_triangle_visibility(const struct frame_layer_loader *loader, struct frame_layer *out)
{
    const struct uv_mesh *m = &loader->avatar->atlas.mesh;
    out->triangle_count = m->corner_count / 3;
    out->triangle_visible = malloc(sizeof *out->triangle_visible * (size_t)out->triangle_count);
    if (!out->triangle_visible)
        return fail(ERR_MEMORY, "no memory for a frame layer");
    triangle_visibility_find(m, out, out->triangle_visible);
    return OK;
}

// Registers the avatar to the depth frame and deforms it.
static void fit_avatar(struct frame_layer_loader *loader, const struct bone_transforms *joints, struct frame_layer *out)
{
    const struct avatar *avatar = loader->avatar;
    const struct icp_input from = {*joints, avatar->joint_errors, out->corrections, true};
    out->corrections = articulated_icp(avatar->tsdf, &loader->depth_frame, &from, NULL);
    struct bone_transforms fitted = bone_corrections_apply(joints, &out->corrections);
    const struct deformation_model model = {avatar->tsdf, &avatar->surface, avatar->skins};
    const struct deformation_colors colors = {.albedo = (const float(*)[3])avatar->vertex_colors.color,
                                              .filled = avatar->vertex_colors.filled,
                                              .irradiance = &avatar->vertex_colors.irradiance,
                                              .rgb = loader->rgb,
                                              .calibration = take_calibration(loader->take),
                                              .world_from_color =
                                                  take_entry(loader->take, out->frame)->world_from_camera.rotation};
    deformation_fit(loader->deformation, &model, &loader->depth_frame, &fitted, out->has_images ? &colors : NULL);
}

// Reads the frame's row, once, and fits the avatar, which is in `joints`, to it. NOTHING: it does not show the actor.
static enum status read_frame(struct frame_layer_loader *loader, const struct bone_transforms *joints,
                              struct frame_layer *out)
{
    const struct take_entry *e = take_entry(loader->take, out->frame);
    struct take_images images;
    if (!e->has_depth || !e->has_skeleton)
        return NOTHING;
    enum status status = take_read(loader->take, out->frame, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
    if (status != OK)
        return status == ERR_CORRUPT ? NOTHING : status; // a damaged frame costs itself alone
    depth_frame_label(&loader->depth_frame, &images, take_skeletons_at(loader->skeletons, out->frame));
    out->has_images = images.color && loader->depth_frame.left <= loader->depth_frame.right;
    if (out->has_images)
        status =
            depth_frame_clean_colors(&loader->depth_frame, take_calibration(loader->take), images.color, loader->rgb);
    if (status != OK)
        return status;
    fit_avatar(loader, joints, out);
    return out->has_images ? OK : NOTHING;
}

static enum status crop_images(const struct frame_layer_loader *loader, struct frame_layer *out)
{
    if (!out->has_images)
        return make_empty_images(out);
    enum status status = crop_depth(&loader->depth_frame, out);
    return status == OK ? crop_color(loader, out) : status;
}

enum status frame_layer_loader_load(struct frame_layer_loader *loader, int64_t frame, struct frame_layer *out)
{
    struct bone_transforms joints;
    *out = (struct frame_layer){
        .frame = frame, .exposure_gain = 1, .corrections = avatar_corrections(loader->avatar, frame)};
    deformation_clear(loader->deformation);
    enum status status =
        bone_transforms_of(&loader->avatar->bind_pose, take_skeletons_at(loader->skeletons, frame), &joints);
    const bool posed = status == OK;
    if (posed)
        status = read_frame(loader, &joints, out);
    if (status >= 0)
        status = crop_images(loader, out);
    if (status == OK && posed) {
        joints = bone_corrections_apply(&joints, &out->corrections);
        status = fill_points(loader, &joints, out);
    }
    if (status == OK && posed) {
        fill_exposure(loader, out);
        status = fill_triangle_visibility(loader, out);
    }
    if (status != OK)
        frame_layer_free(out);
    return status;
}
