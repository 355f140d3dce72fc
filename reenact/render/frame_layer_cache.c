#include "reenact/render/frame_layer_cache.h"

#include <stdlib.h>
#include <string.h>

// Of those shown last none goes, for one may step back to them.
enum { LAST_SHOWN = 16 };

struct kept {
    struct shown_frame shown;
    int64_t frame, used;
    size_t bytes;
};

struct shown_frames {
    struct gpu *gpu;
    struct take *take;
    const struct source_rays *rays;
    struct frame_loader *loader; // of the likeness; NULL before the first frame
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
    f->rays = rays;
    f->max_bytes = max_bytes;
    return OK;
}

static void drop(struct shown_frames *f, int i)
{
    f->bytes -= f->kept[i].bytes;
    gpu_texture_close(&f->kept[i].shown.color);
    gpu_texture_close(&f->kept[i].shown.depth);
    free(f->kept[i].shown.shift);
    free(f->kept[i].shown.points);
    free(f->kept[i].shown.own);
    f->kept[i] = f->kept[--f->count];
}

void shown_frames_forget(struct shown_frames *f)
{
    while (f->count)
        drop(f, f->count - 1);
    frame_loader_close(&f->loader);
}

void shown_frames_close(struct shown_frames **out)
{
    struct shown_frames *f = *out;
    if (!f)
        return;
    shown_frames_forget(f);
    free(f->kept);
    free(f);
    *out = NULL;
}

// From the kept frame before it to the one after it, round the take.
static int64_t gap_at(const struct shown_frames *f, int i)
{
    const int64_t frames = take_frame_count(f->take);
    int64_t before = frames, after = frames;
    for (int k = 0; k < f->count; k++) {
        const int64_t on = (f->kept[k].frame - f->kept[i].frame + frames) % frames;
        if (k == i)
            continue;
        after = on < after ? on : after;
        before = frames - on < before ? frames - on : before;
    }
    return before + after;
}

// The one to let go: of those not shown or given lately, the one that others are nearest to, so that those kept lie
// all along the take; else the oldest.
static int least_wanted(const struct shown_frames *f)
{
    const int64_t longest = 2 * take_frame_count(f->take);
    int least = 0;
    int64_t least_worth = INT64_MAX;
    for (int i = 0; i < f->count; i++) {
        const bool lately = f->kept[i].used > f->now - LAST_SHOWN;
        const int64_t worth = lately ? longest + f->kept[i].used : gap_at(f, i);
        if (worth < least_worth)
            least_worth = worth, least = i;
    }
    return least;
}

static enum status make_room(struct shown_frames *f, size_t bytes)
{
    while (f->count && f->bytes + bytes > f->max_bytes)
        drop(f, least_wanted(f));
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

static enum status bring(struct gpu_texture **out, struct gpu *gpu, enum gpu_format format, enum gpu_filter filter,
                         const struct loaded_picture *p)
{
    return gpu_texture_open(out, gpu, format, p->width, p->height, filter, p->pixels);
}

static enum status keep(struct shown_frames *f, struct loaded_frame *loaded)
{
    const size_t bytes = loaded_frame_bytes(loaded);
    enum status status = make_room(f, bytes);
    if (status != OK)
        return status;
    struct kept *k = &f->kept[f->count++];
    *k = (struct kept){.frame = loaded->frame, .used = ++f->now, .bytes = bytes};
    f->bytes += bytes;
    struct shown_frame *s = &k->shown;
    s->adjustment = loaded->adjustment;
    s->shift = loaded->shift;
    s->points = loaded->points;
    s->own = loaded->own;
    loaded->shift = NULL;
    loaded->points = NULL;
    loaded->own = NULL;
    status = bring(&s->depth, f->gpu, GPU_RGBA8, GPU_NEAREST, &loaded->depth);
    if (status == OK)
        status = bring(&s->color, f->gpu, GPU_RGB8, GPU_LINEAR, &loaded->color);
    if (status != OK)
        drop(f, f->count - 1);
    return status;
}

static int find(const struct shown_frames *f, int64_t frame)
{
    int i = 0;
    while (i < f->count && f->kept[i].frame != frame)
        i++;
    return i;
}

bool shown_frames_keeps(const struct shown_frames *f, int64_t frame) { return find(f, frame) < f->count; }

int64_t shown_frames_near(const struct shown_frames *f, int64_t frame, int64_t within_ns)
{
    const int64_t at_ns = take_entry(f->take, frame)->time_ns;
    int64_t best = -1, best_ns = within_ns;
    for (int i = 0; i < f->count; i++) {
        const int64_t away_ns = llabs(take_entry(f->take, f->kept[i].frame)->time_ns - at_ns);
        const bool nearer = best < 0 || away_ns < best_ns || (away_ns == best_ns && f->kept[i].frame < best);
        if (away_ns <= within_ns && nearer)
            best = f->kept[i].frame, best_ns = away_ns;
    }
    return best;
}

enum status shown_frames_give(struct shown_frames *f, struct loaded_frame *loaded)
{
    enum status status = shown_frames_keeps(f, loaded->frame) ? OK : keep(f, loaded);
    loaded_frame_free(loaded);
    return status;
}

static enum status load(struct shown_frames *f, const struct likeness *likeness, int64_t frame)
{
    struct loaded_frame loaded;
    enum status status = f->loader ? OK : frame_loader_open(&f->loader, f->take, f->rays, likeness);
    if (status == OK)
        status = frame_loader_load(f->loader, frame, &loaded);
    return status == OK ? shown_frames_give(f, &loaded) : status;
}

enum status shown_frames_of(struct shown_frames *f, const struct likeness *likeness, int64_t frame,
                            const struct shown_frame **out)
{
    if (!shown_frames_keeps(f, frame)) {
        enum status status = load(f, likeness, frame);
        if (status != OK)
            return status;
    }
    struct kept *k = &f->kept[find(f, frame)];
    if (k->used != f->now)
        k->used = ++f->now;
    *out = &k->shown;
    return OK;
}
