#include "reenact/likeness.h"

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

// One frame of one pass; the list loses those that turn out unusable.
static enum status one_frame(struct likeness *f, struct take *take, enum pass pass, struct volume *into, int i,
                             struct sight *sight, struct coat_maker *coat)
{
    int64_t frame = f->frames[i];
    const struct take_entry *e = take_entry(take, frame);
    struct posture joints;
    enum status status = sight_read(sight, take, frame);
    if (status == OK)
        status = posture_of(&f->rest, &e->skeleton, &joints);
    if (status != OK)
        return status;
    if (pass != PASS_COLOR) {
        struct adjustment none = adjustment_none(), start = none;
        if (pass == PASS_SHAPE)
            start = f->adjustments[i];
        else if (i > 0)
            start = adjustment_mix(&none, &f->adjustments[i - 1], CARRIED);
        f->adjustments[i] = pass == PASS_FIRST && i == 0 ? none : align(f->volume, &f->rest, sight, &joints, &start);
    }
    struct posture posture = posture_adjusted(&joints, &f->adjustments[i]);
    struct skeleton better = posture_skeleton(&f->rest, &posture);
    sight_label(sight, &better);
    if (pass != PASS_COLOR) {
        volume_add(into, sight, &posture);
        return OK;
    }
    struct take_pictures seen;
    status = take_read(take, frame, TAKE_COLOR, &seen);
    if (status != OK || !seen.color)
        return status;
    const struct lens *lens = &take_calibration(take)->color;
    uint8_t *clean = malloc(3 * (size_t)lens->width * (size_t)lens->height);
    status = clean ? sight_colors(sight, take_calibration(take), seen.color, clean) : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        coat_add(coat, sight, clean, &posture, e->world_from_camera,
                 (double)(e->time_ns - take_entry(take, 0)->time_ns) * 1e-9);
    free(clean);
    return status;
}

static enum status all_frames(struct likeness *f, struct take *take, enum pass pass, struct volume *into,
                              struct sight *sight, struct coat_maker *coat, const struct likeness_watch *watch)
{
    enum status status = OK;
    for (int i = 0; i < f->frame_count && status == OK; i++) {
        if (!went_on(watch, (pass + (double)i / f->frame_count) / PASSES))
            return NOTHING;
        status = one_frame(f, take, pass, into, i, sight, coat);
        if (status == NOTHING) {
            f->adjustments[i] = i > 0 ? f->adjustments[i - 1] : adjustment_none();
            status = OK;
        }
    }
    return status;
}

static enum status make_shape(struct likeness *f, struct take *take, struct sight *sight,
                              const struct likeness_watch *watch)
{
    const struct calibration *c = take_calibration(take);
    enum status status = volume_open(&f->volume, &f->rest, c);
    if (status == OK)
        status = all_frames(f, take, PASS_FIRST, f->volume, sight, NULL, watch);
    struct volume *second = NULL;
    if (status == OK)
        status = volume_open(&second, &f->rest, c);
    if (status == OK)
        status = all_frames(f, take, PASS_SHAPE, second, sight, NULL, watch);
    if (status == OK) {
        volume_close(&f->volume);
        f->volume = second;
        status = volume_smooth(f->volume, SMOOTH_PASSES);
        return status == OK ? volume_surface(f->volume, &f->surface) : status;
    }
    volume_close(&second);
    return status;
}

static enum status make_coat(struct likeness *f, struct take *take, struct sight *sight,
                             const struct likeness_watch *watch)
{
    f->skins = malloc(sizeof *f->skins * (size_t)f->surface.point_count);
    if (!f->skins)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->surface.point_count; i++)
        f->skins[i] = rest_skin(&f->rest, f->surface.points[i]);
    struct coat_maker *coat = NULL;
    enum status status = coat_open(&coat, &f->surface, f->skins, take_calibration(take));
    if (status == OK)
        status = all_frames(f, take, PASS_COLOR, NULL, sight, coat, watch);
    if (status == OK)
        status = coat_make(coat, &f->coat);
    coat_close(&coat);
    return status;
}

enum status likeness_make(struct likeness *out, struct take *take, const struct source_rays *rays, int max_frames,
                          const struct likeness_watch *watch)
{
    *out = (struct likeness){0};
    struct sight sight = {0};
    enum status status = rest_make(&out->rest, take);
    if (status == OK)
        status = choose_frames(out, take, max_frames);
    if (status == OK)
        status = sight_open(&sight, take, rays);
    if (status == OK)
        status = make_shape(out, take, &sight, watch);
    if (status == OK)
        status = make_coat(out, take, &sight, watch);
    sight_close(&sight);
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
