#include "app/commands/take_summary.h"

#include "base/image_shrink.h"
#include "platform/jpeg.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Converted first: the difference of times in a malformed file may overflow an int64.
static double seconds_between(const struct take *t, int64_t a, int64_t b)
{
    return ((double)take_entry(t, b)->time_ns - (double)take_entry(t, a)->time_ns) * 1e-9;
}

struct take_summary take_summarize(const struct take *t, const char *name)
{
    struct take_summary s = {
        .name = name,
        .note = take_note(t),
        .alias = take_alias(t),
        .frames = take_frame_count(t),
        .dropped = take_dropped(t),
        .lost = take_lost(t),
        .representative = take_body(t)->representative_frame,
        .calibration = take_calibration(t),
        .complete = take_is_complete(t),
    };
    int64_t seen = -1; // the last frame with a person
    for (int64_t i = 0; i < s.frames; i++) {
        const struct take_entry *e = take_entry(t, i);
        s.with_skeleton += e->has_skeleton;
        s.with_color += e->has_color && !take_is_drawn_from_depth(t);
        s.with_depth += e->has_depth;
        s.located += e->located;
        if (i)
            s.longest_gap_s = fmax(s.longest_gap_s, seconds_between(t, i - 1, i));
        if (!e->has_skeleton)
            s.longest_unseen_s = fmax(s.longest_unseen_s, seconds_between(t, seen < 0 ? 0 : seen, i));
        else
            seen = i;
    }
    if (s.frames > 1) {
        s.duration_s = seconds_between(t, 0, s.frames - 1);
        s.fps = (double)(s.frames - 1) / s.duration_s;
    }
    return s;
}

static void add(char out[QUALITY_BYTES], const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(char out[QUALITY_BYTES], const char *format, ...)
{
    const size_t used = strlen(out);
    va_list arguments;
    va_start(arguments, format);
    if (used)
        snprintf(out + used, QUALITY_BYTES - used, "; ");
    vsnprintf(out + strlen(out), QUALITY_BYTES - strlen(out), format, arguments);
    va_end(arguments);
}

// Thresholds chosen by hand: what is seen when the take is watched.
const char *take_quality(const struct take_summary *s, bool has_place, char out[QUALITY_BYTES])
{
    const double frames = s->frames ? (double)s->frames : 1;
    *out = 0;
    if (!s->frames)
        add(out, "empty");
    if (s->lost)
        add(out, "%lld frames lost to damage", (long long)s->lost);
    if (!s->complete)
        add(out, "interrupted");
    if (s->frames && !s->with_skeleton)
        add(out, "no person");
    else if ((double)s->with_skeleton < 0.9 * frames)
        add(out, "a person in %.0f %% of the frames", 100 * (double)s->with_skeleton / frames);
    else if (s->longest_unseen_s > 1)
        add(out, "the person out of sight for %.1f s", s->longest_unseen_s);
    if (s->frames && !s->with_color)
        add(out, "no colour");
    else if ((double)s->with_color < 0.9 * frames)
        add(out, "colour in %.0f %% of the frames", 100 * (double)s->with_color / frames);
    if (s->frames && !s->with_depth)
        add(out, "no depth");
    if ((double)s->dropped > 0.02 * frames)
        add(out, "%.0f %% of the frames dropped", 100 * (double)s->dropped / (frames + (double)s->dropped));
    if (s->longest_gap_s > 0.5 && s->fps > 5)
        add(out, "a gap of %.1f s", s->longest_gap_s);
    if (has_place && s->frames && !s->located)
        add(out, "where the actor stood is not known");
    if (s->duration_s < 1 && s->frames)
        add(out, "shorter than a second");
    if (!*out)
        add(out, "good");
    return out;
}

enum status take_thumbnail(struct take *take, int height, uint8_t **jpeg, size_t *bytes)
{
    const struct lens *lens = &take_calibration(take)->color;
    const int64_t count = take_frame_count(take), shown = take_body(take)->representative_frame;
    struct take_images images = {0};
    int64_t first = shown >= 0 ? shown : count / 2;
    for (int64_t away = 0; away < count && !images.color; away++)
        for (int side = 0; side < (away ? 2 : 1) && !images.color; side++) {
            const int64_t i = side ? first - away : first + away;
            if (i < 0 || i >= count || !take_entry(take, i)->has_color)
                continue;
            enum status status = take_read(take, i, TAKE_COLOR, &images);
            if (status != OK && status != ERR_CORRUPT)
                return status;
        }
    if (!images.color)
        return NOTHING;
    const int h = height < lens->height ? height : lens->height;
    int w = (int)((int64_t)lens->width * h / lens->height);
    w = w < 1 ? 1 : w;
    uint8_t *small = malloc((size_t)w * (size_t)h * 3);
    if (!small)
        return fail(ERR_MEMORY, "no memory for a thumbnail");
    image_shrink(images.color, lens->width, lens->height, small, w, h);
    enum status status = jpeg_encode(small, w, h, 80, jpeg, bytes);
    free(small);
    return status;
}
