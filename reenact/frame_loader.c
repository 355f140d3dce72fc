#include "reenact/frame_loader.h"

#include "reenact/carried.h"
#include "reenact/warp.h"

#include <stdlib.h>
#include <string.h>

enum { INNER_PX = 3, EDGE_PX = 4 }; // EDGE_PX: for which more than INNER_PX is enough

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
    free(f->shifts.pixels);
    free(f->shift);
    *f = (struct loaded_frame){0};
}

static size_t texels(const struct loaded_picture *p) { return (size_t)p->width * (size_t)p->height; }

size_t loaded_frame_bytes(const struct loaded_frame *f)
{
    return 4 * (texels(&f->color) + texels(&f->depth) + texels(&f->shifts));
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

static void set_window(float window[4], int left, int top, const struct loaded_picture *p)
{
    window[0] = (float)left, window[1] = (float)top, window[2] = (float)p->width, window[3] = (float)p->height;
}

// The person's pixels and one more on every side, which is nobody's.
static enum status cut_depth(const struct sight *s, struct loaded_frame *out)
{
    struct loaded_picture *p = &out->depth;
    int left = s->left - 1, top = s->top - 1;
    enum status status = make_picture(p, s->right - left + 2, s->bottom - top + 2, 4);
    set_window(out->windows[1], left, top, p);
    for (int y = 1; y < p->height - 1 && status == OK; y++)
        for (int x = 1; x < p->width - 1; x++) {
            int at = (top + y) * s->width + left + x;
            uint8_t *texel = p->pixels + 4 * ((size_t)y * (size_t)p->width + (size_t)x);
            int inner = s->part[at] < PART_COUNT ? s->edge[at] : 0;
            inner = inner > INNER_PX ? INNER_PX : inner;
            texel[0] = (uint8_t)(s->depth[at] >> 8);
            texel[1] = (uint8_t)(s->depth[at] & 255);
            texel[2] = (uint8_t)(255 * inner / INNER_PX);
        }
    return status;
}

static enum status cut_color(const struct frame_loader *l, struct loaded_frame *out)
{
    const struct calibration *c = take_calibration(l->take);
    const struct sight *s = &l->sight;
    struct loaded_picture *p = &out->color;
    int left = 0, top = 0, width = c->color.width, height = c->color.height;
    if (c->registered && width == s->width && height == s->height) {
        left = s->left, top = s->top;
        width = s->right + 1 - left, height = s->bottom + 1 - top;
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
    enum status status = make_picture(&out->color, 1, 1, 3);
    if (status == OK)
        status = make_picture(&out->depth, 1, 1, 4);
    set_window(out->windows[0], 0, 0, &out->color);
    set_window(out->windows[1], 0, 0, &out->depth);
    return status;
}

// What is kept is what the texture can hold, so that whoever asks here and the GPU shift alike.
static enum status code_shifts(const struct frame_loader *l, struct loaded_frame *out)
{
    const struct unfolded *m = &l->likeness->atlas.mesh;
    enum status status =
        make_picture(&out->shifts, 2 * SHIFTS_WIDE, (m->point_count + SHIFTS_WIDE - 1) / SHIFTS_WIDE, 4);
    out->shift = malloc(sizeof *out->shift * (size_t)m->point_count);
    if (status == OK && !out->shift)
        status = fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < m->point_count && status == OK; i++) {
        struct vec3 d = v3_scale(warp_at(l->warp, l->likeness->atlas.points[i]), 32767 / WARP_MOST_M);
        const double steps[3] = {d.x, d.y, d.z};
        uint8_t *code = out->shifts.pixels + 4 * (size_t)(i / SHIFTS_WIDE * 2 * SHIFTS_WIDE + i % SHIFTS_WIDE);
        for (int a = 0; a < 3; a++) {
            const int coded = (int)(32768.5 + steps[a]);
            code[a] = (uint8_t)(coded >> 8);
            code[4 * SHIFTS_WIDE + a] = (uint8_t)(coded & 255);
            out->shift[i][a] = (float)(coded - 32768) * (float)(WARP_MOST_M / 32767);
        }
    }
    return status;
}

// Lays the likeness on what the sight shows and bends it.
static void fit(struct frame_loader *l, const struct posture *joints, struct adjustment *adjustment)
{
    const struct likeness *k = l->likeness;
    *adjustment = align(k->volume, &k->rest, &l->sight, joints, adjustment);
    struct posture laid = posture_adjusted(joints, adjustment);
    const struct warp_model model = {k->volume, &k->surface, k->skins};
    warp_fit(l->warp, &model, &l->sight, &laid);
}

// Reads the frame and fits the likeness to it. NOTHING: it does not show the person.
static enum status read_frame(struct frame_loader *l, struct loaded_frame *out)
{
    struct posture joints;
    struct take_pictures pictures;
    out->adjustment = likeness_adjustment(l->likeness, out->frame);
    warp_clear(l->warp);
    enum status status = sight_read(&l->sight, l->take, out->frame);
    if (status == OK)
        status = carried_posture(&l->likeness->rest, l->take, out->frame, &joints);
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
    fit(l, &joints, &out->adjustment);
    return out->seen ? OK : NOTHING;
}

enum status frame_loader_load(struct frame_loader *l, int64_t frame, struct loaded_frame *out)
{
    *out = (struct loaded_frame){.frame = frame};
    enum status status = read_frame(l, out);
    if (status == OK) {
        status = cut_depth(&l->sight, out);
        if (status == OK)
            status = cut_color(l, out);
    } else if (status == NOTHING) {
        status = cut_nobody(out);
    }
    if (status == OK)
        status = code_shifts(l, out);
    if (status != OK)
        loaded_frame_free(out);
    return status;
}
