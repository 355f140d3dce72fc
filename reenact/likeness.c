#include "reenact/likeness.h"

#include "reenact/outline.h"

#include <stdlib.h>
#include <string.h>

enum { COAT_ROUNDS = 2, SMOOTH_PASSES = 2, TURNS = 24 };
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

struct tint likeness_tint(const struct likeness *f, const struct calibration *calibration, const struct sight *sight,
                          const uint8_t *rgb, struct pose world_from_camera)
{
    return (struct tint){&f->surface, f->skins, &f->coat, calibration, sight, rgb, world_from_camera};
}

enum pass { PASS_FIRST, PASS_SHAPE, PASS_COLOR, PASS_TINT };

// The frame's own colours, nobody else's among them, of the colour picture's size. NOTHING: it has none.
static enum status read_colors(struct take *take, int64_t frame, const struct sight *sight, uint8_t *out)
{
    struct take_pictures seen;
    enum status status = take_read(take, frame, TAKE_COLOR, &seen);
    if (status == OK && !seen.color)
        return NOTHING;
    return status == OK ? sight_colors(sight, take_calibration(take), seen.color, out) : status;
}

// One frame of one pass; the list loses those that turn out unusable. rgb: room for a colour picture.
static enum status one_frame(struct likeness *f, struct take *take, enum pass pass, struct volume *into, int i,
                             struct sight *sight, struct coat_maker *coat, uint8_t *rgb)
{
    int64_t frame = f->frames[i];
    const struct take_entry *e = take_entry(take, frame);
    struct posture joints;
    enum status status = sight_read(sight, take, frame);
    if (status == OK)
        status = posture_of(&f->rest, &e->skeleton, &joints);
    if (status == OK && (pass == PASS_COLOR || pass == PASS_TINT))
        status = read_colors(take, frame, sight, rgb);
    if (status != OK)
        return status;
    struct adjustment *a = &f->adjustments[i], none = adjustment_none(), start = none;
    if (pass == PASS_SHAPE) {
        if (i > 0)
            start = adjustment_mix(&none, &f->adjustments[i - 1], CARRIED);
        *a = align(f->volume, &f->rest, sight, &joints, &start, NULL);
    } else if (pass == PASS_TINT) {
        start = *a;
        struct tint tint = likeness_tint(f, take_calibration(take), sight, rgb, e->world_from_camera);
        *a = align(f->volume, &f->rest, sight, &joints, &start, &tint);
    } else if (pass == PASS_FIRST) {
        *a = none; // joints are wrong, but not all the same way
    }
    struct posture posture = posture_adjusted(&joints, a);
    struct skeleton better = posture_skeleton(&f->rest, &posture);
    sight_label(sight, &better);
    if (pass == PASS_COLOR || pass == PASS_TINT)
        coat_add(coat, sight, rgb, &posture, e->world_from_camera,
                 (double)(e->time_ns - take_entry(take, 0)->time_ns) * 1e-9);
    else
        volume_add(into, sight, &posture);
    return OK;
}

static enum status all_frames(struct likeness *f, struct take *take, enum pass pass, struct volume *into,
                              struct sight *sight, struct coat_maker *coat)
{
    const struct lens *lens = &take_calibration(take)->color;
    uint8_t *rgb = malloc(3 * (size_t)lens->width * (size_t)lens->height);
    enum status status = rgb ? OK : fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->frame_count && status == OK; i++) {
        status = one_frame(f, take, pass, into, i, sight, coat, rgb);
        if (status == NOTHING && pass == PASS_SHAPE) {
            f->adjustments[i] = i > 0 ? f->adjustments[i - 1] : adjustment_none();
        }
        status = status == NOTHING ? OK : status;
    }
    free(rgb);
    return status;
}

// Makes the shape as wide as the frames' outlines have it.
static enum status meet_outlines(struct likeness *f, struct take *take, struct sight *sight)
{
    struct outline_gaps gaps = {0};
    for (int i = 0; i < f->frame_count; i++) {
        struct posture joints;
        enum status status = sight_read(sight, take, f->frames[i]);
        if (status == OK)
            status = posture_of(&f->rest, &take_entry(take, f->frames[i])->skeleton, &joints);
        if (status < 0)
            return status;
        if (status == NOTHING)
            continue;
        struct posture posture = posture_adjusted(&joints, &f->adjustments[i]);
        outline_measure(f->volume, take_calibration(take), sight, &posture, &gaps);
    }
    outline_meet(f->volume, &gaps);
    return OK;
}

// The first round has the joints alone; the second lays the frames on the shape that they made.
static enum status make_shape(struct likeness *f, struct take *take, struct sight *sight)
{
    static const enum pass rounds[] = {PASS_FIRST, PASS_SHAPE};
    enum status status = OK;
    for (size_t round = 0; round < COUNT_OF(rounds) && status == OK; round++) {
        struct volume *next = NULL;
        status = volume_open(&next, &f->rest, take_calibration(take));
        if (status == OK)
            status = all_frames(f, take, rounds[round], next, sight, NULL);
        if (status == OK) {
            volume_close(&f->volume);
            f->volume = next;
        } else {
            volume_close(&next);
        }
    }
    if (status == OK)
        status = volume_smooth(f->volume, SMOOTH_PASSES);
    if (status == OK)
        status = meet_outlines(f, take, sight);
    return status == OK ? volume_surface(f->volume, &f->surface) : status;
}

static enum status make_coat(struct likeness *f, struct take *take, struct sight *sight)
{
    f->skins = malloc(sizeof *f->skins * (size_t)f->surface.point_count);
    if (!f->skins)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->surface.point_count; i++)
        f->skins[i] = rest_skin(&f->rest, f->surface.points[i]);
    enum status status = OK;
    for (int round = 0; round < COAT_ROUNDS && status == OK; round++) { // laid on the colours of the round before
        struct coat_maker *maker = NULL;
        struct coat next = {0};
        status = coat_open(&maker, &f->surface, f->skins, take_calibration(take));
        if (status == OK)
            status = all_frames(f, take, round == 0 ? PASS_COLOR : PASS_TINT, NULL, sight, maker);
        if (status == OK)
            status = coat_make(maker, &next);
        coat_close(&maker);
        if (status == OK) {
            coat_free(&f->coat);
            f->coat = next;
        }
    }
    return status;
}

enum status likeness_make(struct likeness *out, struct take *take, const struct source_rays *rays, int max_frames)
{
    *out = (struct likeness){0};
    struct sight sight = {0};
    enum status status = rest_make(&out->rest, take);
    if (status == OK)
        status = choose_frames(out, take, max_frames);
    if (status == OK)
        status = sight_open(&sight, take, rays);
    if (status == OK)
        status = make_shape(out, take, &sight);
    if (status == OK)
        status = make_coat(out, take, &sight);
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
