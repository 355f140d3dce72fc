#include "reenact/shown_frames.h"

#include "reenact/carried.h"
#include "reenact/warp.h"

#include <stdlib.h>
#include <string.h>

enum { INNER_PX = 3 };

struct kept {
    struct shown_frame shown;
    int64_t frame, used;
    size_t bytes;
};

struct shown_frames {
    struct gpu *gpu;
    struct take *take;
    struct sight sight;
    struct warp *warp;     // of the likeness; NULL before the first frame
    uint8_t *rgb, *pixels; // the frame's colours; what goes over
    struct kept *kept;
    int count, capacity;
    size_t bytes, max_bytes;
    int64_t now;
};

enum status shown_frames_open(struct shown_frames **out, struct gpu *gpu, struct take *take,
                              const struct source_rays *rays, size_t max_bytes)
{
    struct shown_frames *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    f->gpu = gpu;
    f->take = take;
    f->max_bytes = max_bytes;
    const struct calibration *c = take_calibration(take);
    size_t color = (size_t)c->color.width * (size_t)c->color.height,
           depth = (size_t)(c->depth.width + 2) * (size_t)(c->depth.height + 2);
    f->rgb = malloc(3 * color);
    f->pixels = malloc(4 * (depth > color ? depth : color));
    enum status status = sight_open(&f->sight, take, rays);
    if (status == OK && (!f->rgb || !f->pixels))
        status = fail(ERR_MEMORY, "out of memory");
    if (status != OK)
        shown_frames_close(out);
    return status;
}

static void drop(struct shown_frames *f, int i)
{
    f->bytes -= f->kept[i].bytes;
    gpu_texture_close(&f->kept[i].shown.color);
    gpu_texture_close(&f->kept[i].shown.depth);
    gpu_texture_close(&f->kept[i].shown.shifts);
    free(f->kept[i].shown.shift);
    f->kept[i] = f->kept[--f->count];
}

void shown_frames_forget(struct shown_frames *f)
{
    while (f->count)
        drop(f, f->count - 1);
    warp_close(&f->warp);
}

void shown_frames_close(struct shown_frames **out)
{
    struct shown_frames *f = *out;
    if (!f)
        return;
    shown_frames_forget(f);
    sight_close(&f->sight);
    free(f->rgb);
    free(f->pixels);
    free(f->kept);
    free(f);
    *out = NULL;
}

static enum status make_room(struct shown_frames *f, size_t bytes)
{
    while (f->count && f->bytes + bytes > f->max_bytes) {
        int oldest = 0;
        for (int i = 1; i < f->count; i++)
            if (f->kept[i].used < f->kept[oldest].used)
                oldest = i;
        drop(f, oldest);
    }
    if (f->count < f->capacity)
        return OK;
    int capacity = f->capacity ? 2 * f->capacity : 16;
    struct kept *kept = realloc(f->kept, sizeof *kept * (size_t)capacity);
    if (!kept)
        return fail(ERR_MEMORY, "out of memory");
    f->kept = kept;
    f->capacity = capacity;
    return OK;
}

static void set_window(float window[4], int left, int top, int width, int height)
{
    window[0] = (float)left, window[1] = (float)top, window[2] = (float)width, window[3] = (float)height;
}

// The person's pixels and one more on every side, which is nobody's.
static enum status open_depth(struct shown_frames *f, struct shown_frame *s)
{
    const struct sight *sight = &f->sight;
    int left = sight->left - 1, top = sight->top - 1;
    int width = sight->right - left + 2, height = sight->bottom - top + 2;
    for (int i = 0; i < width * height; i++) {
        int x = i % width, y = i / width, at = (top + y) * sight->width + left + x;
        uint8_t *out = f->pixels + 4 * (size_t)i;
        memset(out, 0, 4);
        if (x == 0 || y == 0 || x == width - 1 || y == height - 1)
            continue;
        int inner = sight->part[at] < PART_COUNT ? sight->edge[at] : 0;
        inner = inner > INNER_PX ? INNER_PX : inner;
        out[0] = (uint8_t)(sight->depth[at] >> 8);
        out[1] = (uint8_t)(sight->depth[at] & 255);
        out[2] = (uint8_t)(255 * inner / INNER_PX);
    }
    set_window(s->windows[1], left, top, width, height);
    return gpu_texture_open(&s->depth, f->gpu, GPU_RGBA8, width, height, GPU_NEAREST, f->pixels);
}

static enum status open_color(struct shown_frames *f, struct shown_frame *s)
{
    const struct calibration *c = take_calibration(f->take);
    const struct sight *sight = &f->sight;
    int left = 0, top = 0, width = c->color.width, height = c->color.height;
    if (c->registered && width == sight->width && height == sight->height) {
        left = sight->left, top = sight->top;
        width = sight->right + 1 - left, height = sight->bottom + 1 - top;
    }
    for (int y = 0; y < height; y++)
        memcpy(f->pixels + 3 * (size_t)y * (size_t)width,
               f->rgb + 3 * ((size_t)(top + y) * (size_t)c->color.width + (size_t)left), 3 * (size_t)width);
    set_window(s->windows[0], left, top, width, height);
    return gpu_texture_open(&s->color, f->gpu, GPU_RGB8, width, height, GPU_LINEAR, f->pixels);
}

static enum status open_nobody(struct shown_frames *f, struct shown_frame *s)
{
    static const uint8_t nobody[4] = {0};
    for (int i = 0; i < 2; i++)
        set_window(s->windows[i], 0, 0, 1, 1);
    enum status status = gpu_texture_open(&s->color, f->gpu, GPU_RGB8, 1, 1, GPU_LINEAR, nobody);
    return status == OK ? gpu_texture_open(&s->depth, f->gpu, GPU_RGBA8, 1, 1, GPU_NEAREST, nobody) : status;
}

// What is kept is what the texture can hold, so that whoever asks here and the GPU shift alike.
static enum status open_shifts(struct shown_frames *f, const struct likeness *likeness, struct shown_frame *s)
{
    const struct unfolded *m = &likeness->atlas.mesh;
    int height = (m->point_count + SHIFTS_WIDE - 1) / SHIFTS_WIDE;
    uint8_t (*codes)[4] = calloc((size_t)height * 2 * SHIFTS_WIDE, sizeof *codes);
    s->shift = malloc(sizeof *s->shift * (size_t)m->point_count);
    enum status status = codes && s->shift ? OK : fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < m->point_count && status == OK; i++) {
        struct vec3 d = v3_scale(warp_at(f->warp, likeness->surface.points[m->points[i]]), 32767 / WARP_MOST_M);
        const double steps[3] = {d.x, d.y, d.z};
        uint8_t (*code)[4] = codes + i / SHIFTS_WIDE * 2 * SHIFTS_WIDE + i % SHIFTS_WIDE;
        for (int a = 0; a < 3; a++) {
            const int coded = (int)(32768.5 + steps[a]);
            code[0][a] = (uint8_t)(coded >> 8);
            code[SHIFTS_WIDE][a] = (uint8_t)(coded & 255);
            s->shift[i][a] = (float)(coded - 32768) * (float)(WARP_MOST_M / 32767);
        }
    }
    if (status == OK)
        status = gpu_texture_open(&s->shifts, f->gpu, GPU_RGBA8, 2 * SHIFTS_WIDE, height, GPU_NEAREST, codes[0]);
    free(codes);
    return status;
}

// Reads the frame; NOTHING: it does not show the person.
static enum status read_frame(struct shown_frames *f, const struct likeness *likeness, int64_t frame,
                              struct shown_frame *s)
{
    struct posture joints;
    s->adjustment = likeness_adjustment(likeness, frame);
    enum status status = sight_read(&f->sight, f->take, frame);
    if (status == OK)
        status = carried_posture(&likeness->rest, f->take, frame, &joints);
    if (status != OK)
        return status;
    struct take_pictures seen;
    status = take_read(f->take, frame, TAKE_COLOR, &seen);
    if (status < 0)
        return status;
    s->seen = status == OK && seen.color && f->sight.left <= f->sight.right;
    if (s->seen)
        status = sight_colors(&f->sight, take_calibration(f->take), seen.color, f->rgb);
    if (status < 0)
        return status;
    s->adjustment = align(likeness->volume, &likeness->rest, &f->sight, &joints, &s->adjustment);
    joints = posture_adjusted(&joints, &s->adjustment);
    const struct warp_model model = {likeness->volume, &likeness->surface, likeness->skins};
    warp_fit(f->warp, &model, &f->sight, &joints);
    return s->seen ? OK : NOTHING;
}

static enum status load(struct shown_frames *f, const struct likeness *likeness, int64_t frame)
{
    struct shown_frame s = {0};
    const struct calibration *c = take_calibration(f->take);
    enum status status = f->warp ? OK : warp_open(&f->warp, &likeness->rest, &likeness->surface, c);
    if (status != OK)
        return status;
    warp_clear(f->warp);
    status = read_frame(f, likeness, frame, &s);
    if (status < 0)
        return status;
    const struct sight *sight = &f->sight;
    size_t bytes = 8 * (size_t)(1 + likeness->atlas.mesh.point_count + SHIFTS_WIDE);
    if (s.seen) {
        size_t depth = (size_t)(sight->right - sight->left + 3) * (size_t)(sight->bottom - sight->top + 3);
        size_t color = c->registered ? depth : (size_t)c->color.width * (size_t)c->color.height;
        bytes += 4 * (depth + color);
    }
    status = make_room(f, bytes);
    if (status != OK)
        return status;
    status = s.seen ? open_depth(f, &s) : open_nobody(f, &s);
    if (status == OK && s.seen)
        status = open_color(f, &s);
    if (status == OK)
        status = open_shifts(f, likeness, &s);
    f->kept[f->count++] = (struct kept){.shown = s, .frame = frame, .bytes = bytes};
    f->bytes += bytes;
    if (status != OK)
        drop(f, f->count - 1);
    return status;
}

enum status shown_frames_of(struct shown_frames *f, const struct likeness *likeness, int64_t frame,
                            const struct shown_frame **out)
{
    int i = 0;
    while (i < f->count && f->kept[i].frame != frame)
        i++;
    if (i == f->count) {
        enum status status = load(f, likeness, frame);
        if (status != OK)
            return status;
        i = f->count - 1;
    }
    f->kept[i].used = ++f->now;
    *out = &f->kept[i].shown;
    return OK;
}
