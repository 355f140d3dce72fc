#include "reenact/likeness.h"

#include "platform/parallel.h"

#include <stdlib.h>
#include <string.h>

enum { SMOOTH_PASSES = 2 };
static const double CARRIED = 0.85; // of a frame's adjustment goes on to the next

static enum status choose_frames(struct likeness *f, const struct take *take, int max_frames)
{
    int64_t frames = take_frame_count(take), usable = 0, seen = 0;
    for (int64_t i = 0; i < frames; i++)
        usable += take_entry(take, i)->has_skeleton && take_entry(take, i)->has_depth;
    int64_t most = usable < max_frames ? usable : max_frames;
    if (!most)
        return NOTHING;
    f->frames = malloc(sizeof *f->frames * (size_t)most);
    f->adjustments = malloc(sizeof *f->adjustments * (size_t)most);
    if (!f->frames || !f->adjustments)
        return fail(ERR_MEMORY, "out of memory");
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        if (seen * most / usable != (seen + 1) * most / usable)
            f->frames[f->frame_count++] = i;
        seen++;
    }
    return OK;
}

enum pass { PASS_FIRST, PASS_SHAPE, PASS_COLOR, PASSES };

// False: it is not wanted any more.
static bool went_on(const struct likeness_watch *watch, double share)
{
    return !watch || watch->went_on(watch->self, share);
}

// A frame, read ahead.
struct reading {
    struct sight sight;
    uint8_t *color; // of the colours' pass
    bool has_color;
    enum status status;
    char sentence[512]; // of an error, which is known on the thread that read it
};

// One pass over all frames: while one is worked on, the next one is read.
struct run {
    struct likeness *likeness;
    struct take *take;
    enum pass pass;
    struct volume *into;     // of the shape's passes
    struct coat_maker *coat; // of the colours' pass
    struct reading reading[2];
    int frame;          // number in the list of the one that is worked on
    enum status status; // how that went
    char sentence[512];
};

static enum status open_run(struct run *r, struct take *take, const struct source_rays *rays)
{
    const struct lens *lens = &take_calibration(take)->color;
    enum status status = OK;
    for (int i = 0; i < 2 && status == OK; i++) {
        status = sight_open(&r->reading[i].sight, take, rays);
        r->reading[i].color = malloc(3 * (size_t)lens->width * (size_t)lens->height);
        if (status == OK && !r->reading[i].color)
            status = fail(ERR_MEMORY, "out of memory");
    }
    r->take = take;
    return status;
}

static void close_run(struct run *r)
{
    for (int i = 0; i < 2; i++) {
        sight_close(&r->reading[i].sight);
        free(r->reading[i].color);
    }
}

static enum status read_frame(const struct run *r, struct reading *reading, int64_t frame)
{
    reading->has_color = false;
    enum status status = sight_read(&reading->sight, r->take, frame);
    if (status != OK || r->pass != PASS_COLOR)
        return status;
    struct take_pictures seen;
    const struct lens *lens = &take_calibration(r->take)->color;
    status = take_read(r->take, frame, TAKE_COLOR, &seen);
    reading->has_color = status == OK && seen.color;
    if (reading->has_color)
        memcpy(reading->color, seen.color, 3 * (size_t)lens->width * (size_t)lens->height);
    return status;
}

static void read_ahead(struct run *r, int i)
{
    struct reading *reading = &r->reading[i % 2];
    if (i >= r->likeness->frame_count)
        return;
    reading->status = read_frame(r, reading, r->likeness->frames[i]);
    if (reading->status < 0)
        strncpy(reading->sentence, status_sentence(), sizeof reading->sentence - 1);
}

static enum status add_colors(struct run *r, struct reading *reading, const struct take_entry *e,
                              const struct posture *posture)
{
    const struct calibration *c = take_calibration(r->take);
    if (!reading->has_color)
        return OK;
    uint8_t *clean = malloc(3 * (size_t)c->color.width * (size_t)c->color.height);
    enum status status =
        clean ? sight_colors(&reading->sight, c, reading->color, clean) : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        coat_add(r->coat, &reading->sight, clean, posture, e->world_from_camera,
                 (double)(e->time_ns - take_entry(r->take, 0)->time_ns) * 1e-9);
    free(clean);
    return status;
}

// The list loses frames that turn out unusable (NOTHING).
static enum status one_frame(struct run *r, int i)
{
    struct likeness *f = r->likeness;
    struct reading *reading = &r->reading[i % 2];
    const struct take_entry *e = take_entry(r->take, f->frames[i]);
    struct posture joints;
    if (reading->status != OK)
        return reading->status < 0 ? fail(reading->status, "%s", reading->sentence) : reading->status;
    enum status status = posture_of(&f->rest, &e->skeleton, &joints);
    if (status != OK)
        return status;
    if (r->pass != PASS_COLOR) {
        struct adjustment none = adjustment_none(), start = none;
        if (r->pass == PASS_SHAPE)
            start = f->adjustments[i];
        else if (i > 0)
            start = adjustment_mix(&none, &f->adjustments[i - 1], CARRIED);
        f->adjustments[i] =
            r->pass == PASS_FIRST && i == 0 ? none : align(f->volume, &f->rest, &reading->sight, &joints, &start);
    }
    struct posture posture = posture_adjusted(&joints, &f->adjustments[i]);
    struct skeleton better = posture_skeleton(&f->rest, &posture);
    sight_label(&reading->sight, &better);
    if (r->pass == PASS_COLOR)
        return add_colors(r, reading, e, &posture);
    volume_add(r->into, &reading->sight, &posture);
    return OK;
}

// The two halves of a step, side by side: they share nothing that either changes.
static void half_step(void *context, int half)
{
    struct run *r = context;
    if (half == 1) {
        read_ahead(r, r->frame + 1);
        return;
    }
    r->status = one_frame(r, r->frame);
    if (r->status < 0)
        strncpy(r->sentence, status_sentence(), sizeof r->sentence - 1);
}

static enum status all_frames(struct likeness *f, struct run *r, enum pass pass, const struct likeness_watch *watch)
{
    r->likeness = f;
    r->pass = pass;
    read_ahead(r, 0);
    for (int i = 0; i < f->frame_count; i++) {
        if (!went_on(watch, (pass + (double)i / f->frame_count) / PASSES))
            return NOTHING;
        if (pass == PASS_FIRST && i == f->frame_count / 2)
            volume_leave_empty(f->volume, f->volume);
        r->frame = i;
        parallel(2, 2, half_step, r);
        if (r->status < 0)
            return fail(r->status, "%s", r->sentence);
        if (r->status == NOTHING)
            f->adjustments[i] = i > 0 ? f->adjustments[i - 1] : adjustment_none();
    }
    return OK;
}

static enum status make_shape(struct likeness *f, struct run *r, const struct likeness_watch *watch)
{
    const struct calibration *c = take_calibration(r->take);
    enum status status = volume_open(&f->volume, &f->rest, c);
    r->into = f->volume;
    if (status == OK)
        status = all_frames(f, r, PASS_FIRST, watch);
    struct volume *second = NULL;
    if (status == OK)
        status = volume_open(&second, &f->rest, c);
    if (status == OK)
        volume_leave_empty(second, f->volume);
    r->into = second;
    if (status == OK)
        status = all_frames(f, r, PASS_SHAPE, watch);
    if (status == OK) {
        volume_close(&f->volume);
        f->volume = second;
        status = volume_smooth(f->volume, SMOOTH_PASSES);
        return status == OK ? volume_surface(f->volume, &f->surface) : status;
    }
    volume_close(&second);
    return status;
}

static enum status make_coat(struct likeness *f, struct run *r, const struct likeness_watch *watch)
{
    f->skins = malloc(sizeof *f->skins * (size_t)f->surface.point_count);
    if (!f->skins)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->surface.point_count; i++)
        f->skins[i] = rest_skin(&f->rest, f->surface.points[i]);
    enum status status = coat_open(&r->coat, &f->surface, f->skins, take_calibration(r->take));
    if (status == OK)
        status = all_frames(f, r, PASS_COLOR, watch);
    if (status == OK)
        status = coat_make(r->coat, &f->coat);
    coat_close(&r->coat);
    return status;
}

enum status likeness_make(struct likeness *out, struct take *take, const struct source_rays *rays, int max_frames,
                          const struct likeness_watch *watch)
{
    *out = (struct likeness){0};
    struct run run = {0};
    enum status status = rest_make(&out->rest, take);
    if (status == OK)
        status = choose_frames(out, take, max_frames);
    if (status == OK)
        status = open_run(&run, take, rays);
    if (status == OK)
        status = make_shape(out, &run, watch);
    if (status == OK)
        status = make_coat(out, &run, watch);
    close_run(&run);
    if (status != OK)
        likeness_free(out);
    return status;
}

void likeness_free(struct likeness *f)
{
    volume_close(&f->volume);
    surface_free(&f->surface);
    coat_free(&f->coat);
    free(f->skins);
    free(f->frames);
    free(f->adjustments);
    *f = (struct likeness){0};
}

struct adjustment likeness_adjustment(const struct likeness *f, int64_t frame)
{
    int after = 0;
    while (after < f->frame_count && f->frames[after] < frame)
        after++;
    if (after == f->frame_count)
        return f->adjustments[after - 1];
    if (after == 0 || f->frames[after] == frame)
        return f->adjustments[after];
    double t = (double)(frame - f->frames[after - 1]) / (double)(f->frames[after] - f->frames[after - 1]);
    return adjustment_mix(&f->adjustments[after - 1], &f->adjustments[after], t);
}
