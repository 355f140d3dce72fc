#include "reenact/frame/frame_layer.h"

#include "reenact/frame/exposure.h"
#include "reenact/skeleton/joint_inpainting.h"
#include "reenact/frame/triangle_visibility.h"
#include "reenact/avatar/deformation.h"

#include <stdlib.h>
#include <string.h>

enum { INNER_PX = 3, EDGE_PX = 4 }; // EDGE_PX: for which more than INNER_PX is enough

static const double BESIDE_M = 0.05;               // nearer or behind, a camera sees nothing
static const double ASIDE = 0.15, SQUARELY = 0.45; // cosines between which what it sees begins to count

struct frame_loader {
    struct take *take;
    const struct likeness *likeness;
    struct sight sight;
    struct warp *warp;
    uint8_t *rgb; // the frame's colours, nobody else's among them
};

void loaded_frame_free(struct loaded_frame *f)
{
    free(f->color.pixels);
    free(f->depth.pixels);
    free(f->shift);
    free(f->points);
    free(f->own);
    *f = (struct loaded_frame){0};
}

static size_t texels(const struct loaded_picture *p) { return (size_t)p->width * (size_t)p->height; }

size_t loaded_frame_bytes(const struct loaded_frame *f)
{
    const size_t a_point = sizeof *f->shift + sizeof *f->points;
    return 4 * (texels(&f->color) + texels(&f->depth)) + a_point * (size_t)f->point_count +
           sizeof *f->own * (size_t)f->triangle_count;
}

enum status frame_loader_open(struct frame_loader **out, struct take *take, const struct source_rays *rays,
                              const struct likeness *likeness)
{
    struct frame_loader *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    l->take = take;
    l->likeness = likeness;
    const struct calibration *c = take_calibration(take);
    l->rgb = malloc(3 * (size_t)c->color.width * (size_t)c->color.height);
    enum status status = l->rgb ? sight_open(&l->sight, take, rays) : fail(ERR_MEMORY, "out of memory");
    l->sight.edge_most = EDGE_PX;
    if (status == OK)
        status = warp_open(&l->warp, &likeness->rest, &likeness->surface, c);
    if (status != OK)
        frame_loader_close(out);
    return status;
}

void frame_loader_close(struct frame_loader **out)
{
    struct frame_loader *l = *out;
    if (!l)
        return;
    warp_close(&l->warp);
    sight_close(&l->sight);
    free(l->rgb);
    free(l);
    *out = NULL;
}

// Room for a picture of that size, zeroed.
static enum status make_picture(struct loaded_picture *p, int width, int height, int bytes_a_pixel)
{
    p->width = width, p->height = height;
    p->pixels = calloc(texels(p), (size_t)bytes_a_pixel);
    return p->pixels ? OK : fail(ERR_MEMORY, "out of memory");
}

// A side no smaller than that and no power of two: where no graphics chip draws, Mesa compiles a program once more for
// a texture with such a side, and one frame of some would then take ten times as long to draw as the others.
static int uneven(int side)
{
    while (!(side & (side - 1)))
        side++;
    return side;
}

static void set_window(float window[4], int left, int top, const struct loaded_picture *p)
{
    window[0] = (float)left, window[1] = (float)top, window[2] = (float)p->width, window[3] = (float)p->height;
}

// The person's pixels and at least one more on every side, which is nobody's.
static enum status cut_depth(const struct sight *s, struct loaded_frame *out)
{
    struct loaded_picture *p = &out->depth;
    int left = s->left - 1, top = s->top - 1;
    enum status status = make_picture(p, uneven(s->right - left + 2), uneven(s->bottom - top + 2), 4);
    set_window(out->windows[1], left, top, p);
    for (int y = s->top; y <= s->bottom && status == OK; y++)
        for (int x = s->left; x <= s->right; x++) {
            int at = y * s->width + x;
            uint8_t *texel = p->pixels + 4 * ((size_t)(y - top) * (size_t)p->width + (size_t)(x - left));
            int inner = s->part[at] < PART_COUNT ? s->edge[at] : 0;
            inner = inner > INNER_PX ? INNER_PX : inner;
            const int far_mm = inner ? sight_middle_mm(s, at) : s->depth[at];
            texel[0] = (uint8_t)(far_mm >> 8);
            texel[1] = (uint8_t)(far_mm & 255);
            texel[2] = (uint8_t)(255 * inner / INNER_PX);
        }
    return status;
}

// From `first` to `last`, or one more where there is one of `all`, for the side's sake.
static void cut_side(int first, int last, int all, int *start, int *length)
{
    *length = uneven(last + 1 - first);
    *length = *length < all ? *length : all;
    *start = first + *length <= all ? first : all - *length;
}

static enum status cut_color(const struct frame_loader *l, struct loaded_frame *out)
{
    const struct calibration *c = take_calibration(l->take);
    const struct sight *s = &l->sight;
    struct loaded_picture *p = &out->color;
    int left = 0, top = 0, width = c->color.width, height = c->color.height;
    if (c->registered && width == s->width && height == s->height) {
        cut_side(s->left, s->right, s->width, &left, &width);
        cut_side(s->top, s->bottom, s->height, &top, &height);
    }
    enum status status = make_picture(p, width, height, 3);
    set_window(out->windows[0], left, top, p);
    for (int y = 0; y < height && status == OK; y++)
        memcpy(p->pixels + 3 * (size_t)y * (size_t)width,
               l->rgb + 3 * ((size_t)(top + y) * (size_t)c->color.width + (size_t)left), 3 * (size_t)width);
    return status;
}

static enum status cut_nobody(struct loaded_frame *out)
{
    enum status status = make_picture(&out->color, uneven(1), uneven(1), 3);
    if (status == OK)
        status = make_picture(&out->depth, uneven(1), uneven(1), 4);
    set_window(out->windows[0], 0, 0, &out->color);
    set_window(out->windows[1], 0, 0, &out->depth);
    return status;
}

static void put(float out[3], struct vec3 v) { out[0] = (float)v.x, out[1] = (float)v.y, out[2] = (float)v.z; }

static double smoothstep(double low, double high, double x)
{
    double t = fmin(fmax((x - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
}

static void place_in(const struct lens *lens, double largest_r2, struct vec3 p, const float window[4], float out[2])
{
    const struct pixel px = lens_project_held(lens, largest_r2, p);
    out[0] = (float)((px.x + 0.5 - (double)window[0]) / (double)window[2]);
    out[1] = (float)((px.y + 0.5 - (double)window[1]) / (double)window[3]);
}

// posture: the frame's own, colour camera's axes.
static enum status know_points(const struct frame_loader *l, const struct posture *posture, struct loaded_frame *out)
{
    const struct calibration *c = take_calibration(l->take);
    const struct atlas *a = &l->likeness->atlas;
    const struct quat world_from_color = take_entry(l->take, out->frame)->world_from_camera.rotation;
    const struct pose depth_from_color = c->registered ? POSE_IDENTITY : pose_inverse(c->color_from_depth);
    const double color_r2 = lens_largest_r2(&c->color), depth_r2 = lens_largest_r2(&c->depth);
    out->point_count = a->mesh.point_count;
    out->shift = malloc(sizeof *out->shift * (size_t)out->point_count);
    out->points = calloc((size_t)out->point_count, sizeof *out->points);
    if (!out->shift || !out->points)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < out->point_count; i++) {
        struct loaded_point *to = &out->points[i];
        const struct vec3 shift = warp_at(l->warp, a->points[i]);
        struct vec3 p, n;
        skin_place(&l->likeness->skins[a->mesh.points[i]], posture, v3_add(a->points[i], shift), a->normals[i], &p, &n);
        const struct vec3 w = quat_rotate(world_from_color, n), d = pose_apply(depth_from_color, p);
        put(out->shift[i], shift);
        put(to->facing, n);
        to->light = sqrtf(light_on(&l->likeness->coat.light, (const float[3]){(float)w.x, (float)w.y, (float)w.z}));
        if (!out->seen || p.z < BESIDE_M || d.z < BESIDE_M)
            continue;
        place_in(&c->color, color_r2, p, out->windows[0], to->in_color);
        place_in(&c->depth, depth_r2, d, out->windows[1], to->in_depth);
        to->away_m = (float)d.z;
        to->seen = (float)smoothstep(ASIDE, SQUARELY, -v3_dot(n, v3_unit(p)));
    }
    return OK;
}

static void know_brightness(const struct frame_loader *l, struct loaded_frame *out)
{
    const struct brightness_look look = {l->likeness, &l->sight, &take_calibration(l->take)->color, l->rgb};
    out->brighter = out->seen ? brightness_of(&look, out) : 1;
    for (int i = 0; i < out->point_count; i++)
        out->points[i].light *= out->brighter;
}

static enum status know_triangles(const struct frame_loader *l, struct loaded_frame *out)
{
    const struct unfolded *m = &l->likeness->atlas.mesh;
    out->triangle_count = m->corner_count / 3;
    out->own = malloc(sizeof *out->own * (size_t)out->triangle_count);
    if (!out->own)
        return fail(ERR_MEMORY, "out of memory");
    own_triangles_find(m, out, out->own);
    return OK;
}

// Lays the likeness on what the sight shows and bends it.
static void fit(struct frame_loader *l, const struct posture *joints, struct loaded_frame *out)
{
    const struct likeness *k = l->likeness;
    const struct align_from from = {*joints, k->joint_errors, out->adjustment, true};
    out->adjustment = align(k->volume, &l->sight, &from, NULL);
    struct posture laid = posture_adjusted(joints, &out->adjustment);
    const struct warp_model model = {k->volume, &k->surface, k->skins};
    const struct warp_colors colors = {&k->coat, l->rgb, take_calibration(l->take),
                                       take_entry(l->take, out->frame)->world_from_camera.rotation};
    warp_fit(l->warp, &model, &l->sight, &laid, out->seen ? &colors : NULL);
}

// Reads the frame and fits the likeness, which is in `joints`, to it. NOTHING: it does not show the person.
static enum status read_frame(struct frame_loader *l, const struct posture *joints, struct loaded_frame *out)
{
    struct take_pictures pictures;
    enum status status = sight_read(&l->sight, l->take, out->frame);
    if (status != OK)
        return status;
    status = take_read(l->take, out->frame, TAKE_COLOR, &pictures);
    if (status < 0)
        return status;
    out->seen = status == OK && pictures.color && l->sight.left <= l->sight.right;
    if (out->seen)
        status = sight_colors(&l->sight, take_calibration(l->take), pictures.color, l->rgb);
    if (status < 0)
        return status;
    fit(l, joints, out);
    return out->seen ? OK : NOTHING;
}

static enum status cut(const struct frame_loader *l, struct loaded_frame *out)
{
    if (!out->seen)
        return cut_nobody(out);
    enum status status = cut_depth(&l->sight, out);
    return status == OK ? cut_color(l, out) : status;
}

enum status frame_loader_load(struct frame_loader *l, int64_t frame, struct loaded_frame *out)
{
    struct posture joints;
    *out = (struct loaded_frame){.frame = frame, .brighter = 1, .adjustment = likeness_adjustment(l->likeness, frame)};
    warp_clear(l->warp);
    enum status status = carried_posture(&l->likeness->rest, l->take, frame, &joints);
    const bool posed = status == OK;
    if (posed)
        status = read_frame(l, &joints, out);
    if (status >= 0)
        status = cut(l, out);
    if (status == OK && posed) {
        joints = posture_adjusted(&joints, &out->adjustment);
        status = know_points(l, &joints, out);
    }
    if (status == OK && posed) {
        know_brightness(l, out);
        status = know_triangles(l, out);
    }
    if (status != OK)
        loaded_frame_free(out);
    return status;
}
