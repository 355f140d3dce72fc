#include "reenact/likeness.h"

#include "platform/parallel.h"
#include "reenact/carried.h"
#include "reenact/outline.h"

#include <stdlib.h>
#include <string.h>

enum { SMOOTH_PASSES = 2, TURNS = 24 };
static const double CARRIED = 0.85; // of a frame's adjustment goes on to the next

// Which way the trunk is turned, as one of TURNS.
static int turn_of(const struct skeleton *s)
{
    struct vec3 across = v3_sub(s->joint[JOINT_LEFT_SHOULDER], s->joint[JOINT_RIGHT_SHOULDER]);
    int turn = (int)((atan2(across.z, across.x) / (2 * 3.14159265358979) + 0.5) * TURNS);
    return turn < TURNS ? turn : TURNS - 1;
}

// Half of the frames are spread evenly over the take's time, half over the ways the person is turned: who spins round
// once within a second shows the back in a few frames only.
static enum status choose_frames(struct likeness *f, const struct take *take, int max_frames)
{
    int64_t frames = take_frame_count(take), usable = 0, of_turn[TURNS] = {0};
    int turns = 0;
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        usable++;
        turns += !of_turn[turn_of(&e->skeleton)]++;
    }
    int64_t most = usable < max_frames ? usable : max_frames;
    if (!most)
        return NOTHING;
    f->frames = malloc(sizeof *f->frames * (size_t)most);
    f->adjustments = malloc(sizeof *f->adjustments * (size_t)most);
    if (!f->frames || !f->adjustments)
        return fail(ERR_MEMORY, "out of memory");
    double due = 0.5;
    for (int64_t i = 0; i < frames && f->frame_count < most; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        due += 0.5 * (double)most *
               (1.0 / (double)usable + 1.0 / ((double)turns * (double)of_turn[turn_of(&e->skeleton)]));
        if (due >= 1) {
            f->frames[f->frame_count++] = i;
            due = fmin(due - 1, 1); // a frame can be taken only once
        }
    }
    return OK;
}

enum pass { PASS_FIRST, PASS_SHAPE, PASS_OUTLINE, PASS_COLOR, PASSES };

// False: it is not wanted any more.
static bool went_on(const struct likeness_watch *watch, double share)
{
    return !watch || watch->went_on(watch->self, share);
}

// A frame, read ahead.
struct reading {
    struct sight sight;
    uint8_t *rgb; // of the colours' pass: the frame's own colours, nobody else's among them
    enum status status;
    char sentence[512]; // of an error, which is known on the thread that read it
};

// One pass over all frames: while one is worked on, the next one is read.
struct run {
    struct likeness *likeness;
    struct take *take;
    enum pass pass;
    struct volume *into;      // of the shape's passes
    struct outline_gaps gaps; // of the outlines' pass
    struct coat_maker *coat;  // of the colours' pass
    struct warp *warp;        // likewise
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
        r->reading[i].rgb = malloc(3 * (size_t)lens->width * (size_t)lens->height);
        if (status == OK && !r->reading[i].rgb)
            status = fail(ERR_MEMORY, "out of memory");
    }
    r->take = take;
    return status;
}

static void close_run(struct run *r)
{
    for (int i = 0; i < 2; i++) {
        sight_close(&r->reading[i].sight);
        free(r->reading[i].rgb);
    }
}

// NOTHING: it shows nobody, or has no colours where they are wanted.
static enum status read_frame(const struct run *r, struct reading *reading, int64_t frame)
{
    enum status status = sight_read(&reading->sight, r->take, frame);
    if (status != OK || r->pass != PASS_COLOR)
        return status;
    struct take_pictures seen;
    status = take_read(r->take, frame, TAKE_COLOR, &seen);
    if (status == OK && !seen.color)
        return NOTHING;
    return status == OK ? sight_colors(&reading->sight, take_calibration(r->take), seen.color, reading->rgb) : status;
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

// Lays a frame on what is known so far.
static void lay(struct run *r, int i, const struct posture *joints)
{
    struct likeness *f = r->likeness;
    struct reading *reading = &r->reading[i % 2];
    struct adjustment *a = &f->adjustments[i], none = adjustment_none(), start = none;
    if (r->pass == PASS_FIRST) { // joints are wrong, but not all the same way
        *a = none;
    } else if (r->pass == PASS_SHAPE) {
        if (i > 0)
            start = adjustment_mix(&none, &f->adjustments[i - 1], CARRIED);
        *a = align(f->volume, &f->rest, &reading->sight, joints, &start);
    }
}

// NOTHING: the frame is of no use to this pass.
static enum status one_frame(struct run *r, int i)
{
    struct likeness *f = r->likeness;
    struct reading *reading = &r->reading[i % 2];
    const struct take_entry *e = take_entry(r->take, f->frames[i]);
    struct posture joints;
    if (reading->status != OK)
        return reading->status < 0 ? fail(reading->status, "%s", reading->sentence) : reading->status;
    enum status status = carried_posture(&f->rest, r->take, f->frames[i], &joints);
    if (status != OK)
        return status;
    lay(r, i, &joints);
    struct posture posture = posture_adjusted(&joints, &f->adjustments[i]);
    if (r->pass == PASS_OUTLINE) {
        outline_measure(f->volume, take_calibration(r->take), &reading->sight, &posture, &r->gaps);
        return OK;
    }
    struct skeleton better = posture_skeleton(&f->rest, &posture);
    sight_label(&reading->sight, &better);
    if (r->pass == PASS_COLOR) {
        const struct warp_model model = {f->volume, &f->surface, f->skins};
        warp_fit(r->warp, &model, &reading->sight, &posture);
        coat_add(r->coat, &reading->sight, reading->rgb, &posture, r->warp, e->world_from_camera,
                 (double)(e->time_ns - take_entry(r->take, 0)->time_ns) * 1e-9);
    } else {
        volume_add(r->into, &reading->sight, &posture);
    }
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

// NOTHING: it is not wanted any more.
static enum status all_frames(struct likeness *f, struct run *r, enum pass pass, const struct likeness_watch *watch)
{
    r->likeness = f;
    r->pass = pass;
    read_ahead(r, 0);
    for (int i = 0; i < f->frame_count; i++) {
        if (!went_on(watch, (pass + (double)i / f->frame_count) / PASSES))
            return NOTHING;
        if (pass == PASS_FIRST && i == f->frame_count / 2)
            volume_leave_empty(r->into, r->into);
        r->frame = i;
        parallel(2, 2, half_step, r);
        if (r->status < 0)
            return fail(r->status, "%s", r->sentence);
        if (r->status == NOTHING && pass == PASS_SHAPE)
            f->adjustments[i] = i > 0 ? f->adjustments[i - 1] : adjustment_none();
    }
    return OK;
}

// The first round has the joints alone; the second lays the frames on the shape that they made; at last
// the shape becomes as wide as the frames' outlines have it.
static enum status make_shape(struct likeness *f, struct run *r, const struct likeness_watch *watch)
{
    static const enum pass rounds[] = {PASS_FIRST, PASS_SHAPE};
    enum status status = OK;
    for (size_t round = 0; round < COUNT_OF(rounds) && status == OK; round++) {
        r->into = NULL;
        status = volume_open(&r->into, &f->rest, take_calibration(r->take));
        if (status == OK && f->volume)
            volume_leave_empty(r->into, f->volume);
        if (status == OK)
            status = all_frames(f, r, rounds[round], watch);
        if (status == OK) {
            volume_close(&f->volume);
            f->volume = r->into;
        } else {
            volume_close(&r->into);
        }
    }
    if (status == OK)
        status = volume_smooth(f->volume, SMOOTH_PASSES);
    if (status == OK)
        status = all_frames(f, r, PASS_OUTLINE, watch);
    if (status != OK)
        return status;
    outline_meet(f->volume, &r->gaps);
    return volume_surface(f->volume, &f->surface);
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
        status = warp_open(&r->warp, &f->rest, &f->surface, take_calibration(r->take));
    if (status == OK)
        status = all_frames(f, r, PASS_COLOR, watch);
    if (status == OK)
        status = coat_make(r->coat, &f->coat);
    coat_close(&r->coat);
    warp_close(&r->warp);
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
    if (status == OK)
        status = atlas_make(&out->atlas, &out->surface, &out->coat);
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
    atlas_free(&f->atlas);
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
