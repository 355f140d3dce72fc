#include "reenact/avatar/avatar.h"

#include "base/pipeline.h"
#include "reenact/skeleton/joint_inpainting.h"
#include "reenact/avatar/silhouette_constraint.h"
#include "reenact/observation/depth_frame_cache.h"
#include "reenact/avatar/axial_rotation.h"

#include <stdlib.h>
#include <string.h>

enum { SMOOTH_PASSES = 2, TURNS = 24 };
static const double CARRIED = 0.85;                   // of a frame's adjustment goes on to the next
static const double FIRST_STEP_M = 2 * VOLUME_STEP_M; // joints are a few centimetres off: nothing finer comes of them

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

// A frame on its way through a pass.
struct reading {
    struct sight sight;
    struct posture posture;    // the person's, as far as it is known by then
    struct bone_errors unsure; // of the second shape's pass: how wrong that may be
    uint8_t *rgb;              // of passes that need them: the frame's own colours
    struct warp *warp;         // of the colours' pass: how the frame bends the figure
    struct outline_gaps gaps;  // of the outlines' pass
    enum status status;        // NOTHING: there is nothing to be learned from it
};

// One pass over all frames: each is read, worked on for itself, and what it says is gathered, in the frames' order.
enum stage { READ, LAY, GATHER, STAGES };
enum { IN_FLIGHT = 6, THREADS = 4 };

struct run {
    struct likeness *likeness;
    struct take *take;
    struct sights *sights;
    enum likeness_step pass;
    struct volume *into;                 // of the shape's passes
    struct outline_gaps gaps;            // of the outlines' pass
    struct bone_errors_sum joint_errors; // of the second shape's pass
    struct turns *turns;                 // of the turns' passes
    struct coat_maker *coat;             // of the colours' pass
    struct reading reading[IN_FLIGHT];
    const struct progress_watch *watch;
};

static enum status open_run(struct run *r, struct take *take, const struct source_rays *rays)
{
    const struct likeness *f = r->likeness;
    const struct lens *lens = &take_calibration(take)->color;
    enum status status = sights_open(&r->sights, take, f->frames, f->frame_count, LIKENESS_SIGHT_BYTES);
    for (int i = 0; i < IN_FLIGHT && status == OK; i++) {
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
    sights_close(&r->sights);
    coat_close(&r->coat);
    turns_close(&r->turns);
    for (int i = 0; i < IN_FLIGHT; i++) {
        sight_close(&r->reading[i].sight);
        warp_close(&r->reading[i].warp);
        free(r->reading[i].rgb);
    }
}

static bool needs_colors(enum likeness_step pass)
{
    return pass == LIKENESS_LOOK || pass == LIKENESS_FOLLOW || pass == LIKENESS_TURNS || pass == LIKENESS_COLORS;
}

// NOTHING: it shows nobody, or nothing is wanted but the colours that it lacks.
static enum status read_frame(struct run *r, struct reading *reading, int i)
{
    enum status status = sights_read(r->sights, i, &reading->sight);
    if (status != OK || !needs_colors(r->pass))
        return status;
    struct take_pictures seen;
    status = take_read(r->take, r->likeness->frames[i], TAKE_COLOR, &seen);
    if (status == OK && !seen.color)
        return NOTHING;
    const struct lens *lens = &take_calibration(r->take)->color;
    if (status == OK)
        memcpy(reading->rgb, seen.color, 3 * (size_t)lens->width * (size_t)lens->height);
    return status;
}

static bool measures_outlines(enum likeness_step pass)
{
    return pass == LIKENESS_FIRST_OUTLINES || pass == LIKENESS_LAID_OUTLINES || pass == LIKENESS_OUTLINES;
}

static double time_of(const struct run *r, int i)
{
    return (double)(take_entry(r->take, r->likeness->frames[i])->time_ns - take_entry(r->take, 0)->time_ns) * 1e-9;
}

static struct turns_frame turns_frame_of(const struct run *r, const struct reading *reading, int i)
{
    return (struct turns_frame){&reading->sight, reading->rgb, &reading->posture, time_of(r, i)};
}

// Where to begin: at first with the joints, which are wrong, but not all the same way; then with the frame before;
// then, when it is known how each is turned, with that.
static struct adjustment start_of(const struct run *r, int i)
{
    const struct adjustment none = adjustment_none(), *all = r->likeness->adjustments;
    if (r->pass == LIKENESS_FIRST || (r->pass == LIKENESS_LAID && i == 0))
        return none;
    return r->pass == LIKENESS_LAID ? adjustment_mix(&none, &all[i - 1], CARRIED) : all[i];
}

// Lays a frame on what is known so far, and sorts it by that.
static enum status lay(struct run *r, struct reading *reading, int i)
{
    struct likeness *f = r->likeness;
    struct align_from from = {
        .joint_errors = f->joint_errors, .start = start_of(r, i), .turned = r->pass == LIKENESS_SHAPE};
    struct adjustment *a = &f->adjustments[i];
    *a = r->pass == LIKENESS_LAID && i > 0 ? f->adjustments[i - 1] : from.start;
    enum status status = reading->status;
    if (status == OK)
        status = carried_posture(&f->rest, r->take, f->frames[i], &from.joints);
    if (status != OK)
        return status;
    if (r->pass == LIKENESS_LAID || r->pass == LIKENESS_SHAPE)
        *a = align(f->volume, &reading->sight, &from, r->pass == LIKENESS_LAID ? &reading->unsure : NULL);
    reading->posture = posture_adjusted(&from.joints, a);
    if (measures_outlines(r->pass)) {
        reading->gaps = (struct outline_gaps){0};
        outline_measure(f->volume, take_calibration(r->take), &reading->sight, &reading->posture, &reading->gaps);
        return OK;
    }
    if (r->pass == LIKENESS_COLORS) // nobody else's among them
        status = sight_colors(&reading->sight, take_calibration(r->take), reading->rgb, reading->rgb);
    struct skeleton better = posture_skeleton(&f->rest, &reading->posture);
    sight_label(&reading->sight, &better);
    const struct turns_frame frame = turns_frame_of(r, reading, i);
    if (r->pass == LIKENESS_LOOK)
        turns_look(r->turns, i, &frame);
    if (r->pass == LIKENESS_TURNS)
        turns_measure(r->turns, i, &frame);
    if (r->pass == LIKENESS_COLORS) {
        const struct warp_model model = {f->volume, &f->surface, f->skins};
        warp_fit(reading->warp, &model, &reading->sight, &reading->posture, NULL);
    }
    return status;
}

static enum status gather(struct run *r, const struct reading *reading, int i)
{
    const struct turns_frame frame = turns_frame_of(r, reading, i);
    if (r->pass == LIKENESS_LAID)
        joint_errors_add(&r->joint_errors, &r->likeness->rest, r->likeness->adjustments[i].bone, &reading->unsure);
    if (measures_outlines(r->pass))
        outline_add(&r->gaps, &reading->gaps);
    else if (r->pass == LIKENESS_FOLLOW)
        turns_follow(r->turns, &frame);
    else if (r->pass == LIKENESS_COLORS)
        coat_add(r->coat, &reading->sight, reading->rgb, &reading->posture, reading->warp,
                 take_entry(r->take, r->likeness->frames[i])->world_from_camera, time_of(r, i));
    else if (r->into)
        return volume_add(r->into, &reading->sight, &reading->posture);
    return OK;
}

// What goes on side by side shares nothing that any of it changes.
static enum status do_stage(void *context, int stage, int item)
{
    struct run *r = context;
    struct reading *reading = &r->reading[item % IN_FLIGHT];
    const int i = r->pass == LIKENESS_FOLLOW ? turns_order(r->turns, item) : item;
    if (stage == READ)
        reading->status = read_frame(r, reading, i);
    else if (stage == LAY)
        reading->status = lay(r, reading, i);
    else if (reading->status == OK)
        reading->status = gather(r, reading, i);
    return reading->status;
}

static bool pass_went_on(void *context, double share)
{
    const struct run *r = context;
    return progress_continue(r->watch, (r->pass + share) / (LIKENESS_COLORS + 1));
}

// NOTHING: it is not wanted any more. At first a frame is laid starting from the one before.
static enum status all_frames(struct likeness *f, struct run *r, enum likeness_step pass,
                              const struct progress_watch *watch)
{
    const struct pipeline pipeline = {.items = f->frame_count,
                                      .stages = STAGES,
                                      .in_flight = IN_FLIGHT,
                                      .in_order = {[READ] = true, [LAY] = pass == LIKENESS_LAID, [GATHER] = true},
                                      .work = do_stage,
                                      .went_on = pass_went_on,
                                      .context = r};
    r->pass = pass;
    r->watch = watch;
    progress_begin_step(watch, pass);
    return pipeline_run(&pipeline, THREADS);
}

// One pass over the frames makes a shape, the next measures it against their outlines.
static const struct round {
    enum likeness_step shape, outlines;
    double step_m;
} rounds[] = {
    {LIKENESS_FIRST, LIKENESS_FIRST_OUTLINES, FIRST_STEP_M},
    {LIKENESS_LAID, LIKENESS_LAID_OUTLINES, VOLUME_STEP_M},
    {LIKENESS_SHAPE, LIKENESS_OUTLINES, VOLUME_STEP_M},
};

static enum status make_round(struct likeness *f, struct run *r, const struct round *round,
                              const struct progress_watch *watch)
{
    enum status status = volume_open(&r->into, &f->rest, take_calibration(r->take), round->step_m);
    if (status == OK && f->volume)
        status = volume_leave_empty(r->into, f->volume);
    if (status == OK)
        status = all_frames(f, r, round->shape, watch);
    if (status != OK) {
        volume_close(&r->into);
        return status;
    }
    volume_close(&f->volume);
    f->volume = r->into;
    r->into = NULL;
    if (round->shape == LIKENESS_SHAPE)
        volume_flatten_unseen(f->volume);
    if (round != &rounds[0])
        status = volume_smooth(f->volume, SMOOTH_PASSES);
    r->gaps = (struct outline_gaps){0};
    if (status == OK)
        status = all_frames(f, r, round->outlines, watch);
    if (status == OK)
        outline_meet(f->volume, &r->gaps);
    return status;
}

// How each frame's round parts are turned, by their colours.
static enum status find_turns(struct likeness *f, struct run *r, const struct progress_watch *watch)
{
    struct surface surface = {0};
    double *time_s = malloc(sizeof *time_s * (size_t)f->frame_count);
    enum status status = time_s ? volume_surface(f->volume, &surface) : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = turns_open(&r->turns, &f->rest, &surface, take_calibration(r->take), f->frame_count);
    if (status == OK)
        status = all_frames(f, r, LIKENESS_LOOK, watch);
    if (status == OK)
        status = all_frames(f, r, LIKENESS_FOLLOW, watch);
    if (status == OK)
        status = all_frames(f, r, LIKENESS_TURNS, watch);
    for (int i = 0; i < f->frame_count && status == OK; i++)
        time_s[i] = time_of(r, i);
    if (status == OK)
        status = turns_apply(r->turns, time_s, f->adjustments);
    surface_free(&surface);
    free(time_s);
    return status;
}

// The first round has the joints alone. Where a tracker takes the person for thicker or thinner than they are, joints
// lie too far behind what the sensor sees, or not far enough, whichever way the person is turned, and front and back
// come to lie too far from each other or too near. Outlines, which the same person shows from the side, know better:
// each round ends with the shape made as wide as they have it, and the second lays the frames on that. The third lays
// them once more, with head and legs turned as colours say, and with as much trust in joints as these have earned.
static enum status make_shape(struct likeness *f, struct run *r, const struct progress_watch *watch)
{
    enum status status = OK;
    f->joint_errors = joint_errors_at_first();
    for (size_t i = 0; i < COUNT_OF(rounds) && status == OK; i++) {
        status = make_round(f, r, &rounds[i], watch);
        if (status != OK || rounds[i].shape != LIKENESS_LAID)
            continue;
        f->joint_errors = joint_errors_of(&r->joint_errors);
        status = find_turns(f, r, watch);
    }
    if (status != OK)
        return status;
    progress_begin_step(watch, LIKENESS_SURFACE);
    return volume_surface(f->volume, &f->surface);
}

static enum status make_coat(struct likeness *f, struct run *r, const struct progress_watch *watch)
{
    f->skins = malloc(sizeof *f->skins * (size_t)f->surface.point_count);
    if (!f->skins)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->surface.point_count; i++)
        f->skins[i] = rest_skin(&f->rest, f->surface.points[i]);
    enum status status = coat_open(&r->coat, &f->rest, &f->surface, f->skins, take_calibration(r->take));
    for (int i = 0; i < IN_FLIGHT && status == OK; i++)
        status = warp_open(&r->reading[i].warp, &f->rest, &f->surface, take_calibration(r->take));
    if (status == OK)
        status = all_frames(f, r, LIKENESS_COLORS, watch);
    progress_begin_step(watch, LIKENESS_COAT);
    return status == OK ? coat_make(r->coat, &f->coat) : status;
}

enum status likeness_make(struct likeness *out, struct take *take, const struct source_rays *rays, int max_frames,
                          const struct progress_watch *watch)
{
    *out = (struct likeness){0};
    struct run run = {.likeness = out};
    enum status status = rest_make(&out->rest, take);
    if (status == OK)
        status = choose_frames(out, take, max_frames);
    if (status == OK)
        status = open_run(&run, take, rays);
    if (status == OK)
        status = make_shape(out, &run, watch);
    if (status == OK)
        status = make_coat(out, &run, watch);
    progress_begin_step(watch, LIKENESS_ATLAS);
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
