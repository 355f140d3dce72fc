#include "capture/sensor_tilt.h"

#include "base/portable_math.h"
#include "capture/gravity_align.h"

static const double DEGREES = 180 / 3.14159265358979323846;
// What compare/joint_samples.c takes for standing, and up to which tilt.
static const double STANDS_S = 1, STANDS_DEGREES = 35;
static const double LEVEL_DEGREES = 8; // a tilt that changes no finding: a part is different from 10 degrees on

static bool stands(const struct take *take)
{
    struct vec3 sum = {0, 0, 0}, axis;
    double seconds = 0;
    for (int64_t i = 0; i + 1 < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        const double step_s = ((double)take_entry(take, i + 1)->time_ns - (double)e->time_ns) * 1e-9;
        if (!e->has_skeleton || step_s > 0.2 || !skeleton_standing_axis(&e->skeleton, &axis))
            continue;
        sum = v3_add(sum, v3_scale(axis, step_s));
        seconds += step_s;
    }
    return seconds >= STANDS_S && v3_dot(v3_unit(sum), v3(0, -1, 0)) > portable_cos(STANDS_DEGREES / DEGREES);
}

static bool shows_person(const struct take *take)
{
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (take_entry(take, i)->has_skeleton)
            return true;
    return false;
}

enum status sensor_tilt_find(struct take *take, struct sensor_tilt *out)
{
    enum { LOOKS = 5 };
    const struct calibration *c = take_calibration(take);
    const int64_t count = take_frame_count(take);
    struct vec3 sum = {0, 0, 0};
    enum status status = OK;
    int seen = 0;
    *out = (struct sensor_tilt){.matters = !take_is_located(take) && shows_person(take) && !stands(take)};
    for (int k = 0; k < LOOKS && out->matters && c->depth.width > 0 && status == OK; k++) {
        struct take_images images;
        struct floor_plane floor;
        status = take_read(take, count * (2 * k + 1) / (2 * LOOKS), TAKE_DEPTH, &images);
        if (status == OK && images.depth && gravity_align_floor(&c->depth, images.depth, &floor)) {
            sum = v3_add(sum, floor.up);
            seen++;
        }
        status = status == ERR_CORRUPT ? OK : status;
    }
    out->known = seen > LOOKS / 2;
    const struct vec3 up = quat_rotate(c->color_from_depth.rotation, v3_unit(sum));
    out->degrees = out->known ? portable_acos(fmin(1, fmax(-1, -up.y))) * DEGREES : 0;
    return status;
}

void sensor_tilt_say(const struct sensor_tilt *t, struct take_verdict *out)
{
    if (!t->matters)
        return;
    if (!t->known)
        verdict_say(
            out, 0,
            "how the sensor is tilted is not known: stand upright for a second, have the floor in the picture, or "
            "map the room, to be compared rightly");
    else if (t->degrees > LEVEL_DEGREES)
        verdict_say(
            out, USE_COMPARE,
            "the sensor is tilted by %.0f degrees: put it level, stand upright for a second, or map the room, to "
            "be compared rightly",
            t->degrees);
}
