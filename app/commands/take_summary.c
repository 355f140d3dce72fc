#include "app/commands/take_summary.h"

#include "base/pixels.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- coaching line

void coaching_line_start(struct coaching_line *l, const struct calibration *calibration, enum verdict_purpose purpose)
{
    pthread_mutex_init(&l->lock, NULL);
    coach_start(&l->coach, calibration, purpose);
    l->text[0] = 0;
}

void coaching_line_end(struct coaching_line *l) { pthread_mutex_destroy(&l->lock); }

void coaching_line_see(struct coaching_line *l, const struct recorder_seen *seen)
{
    const struct coach_frame frame = {.time_ns = seen->time_ns,
                                      .color = seen->color,
                                      .depth = seen->depth,
                                      .mask = seen->mask,
                                      .skeleton = seen->skeleton,
                                      .sensor_moves = seen->sensor_moves,
                                      .depth_scale = seen->sight.depth_scale};
    coach_next(&l->coach, &frame);
    pthread_mutex_lock(&l->lock);
    snprintf(l->text, sizeof l->text, "%.0f %% seen · %.80s", l->coach.share * 100, coach_text(&l->coach));
    pthread_mutex_unlock(&l->lock);
}

void coaching_line_text(struct coaching_line *l, char *out, size_t capacity)
{
    pthread_mutex_lock(&l->lock);
    snprintf(out, capacity, "%s", l->text);
    pthread_mutex_unlock(&l->lock);
}

// ---------------------------------------------------------------- take summary

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
    for (int64_t i = 0; i < s.frames; i++) {
        const struct take_entry *e = take_entry(t, i);
        s.with_skeleton += e->has_skeleton;
        s.with_color += e->has_color && !take_is_drawn_from_depth(t);
        s.with_depth += e->has_depth;
        s.located += e->located;
    }
    if (s.frames > 1) {
        s.duration_s = seconds_between(t, 0, s.frames - 1);
        s.fps = (double)(s.frames - 1) / s.duration_s;
    }
    return s;
}

void verdict_add_json(struct json *object, const struct take_verdict *v)
{
    struct json *verdict = json_add_object(object, "verdict");
    json_add_bool(verdict, "good", verdict_is_good(v));
    json_add_string(verdict, "headline", verdict_headline(v));
    json_add_string(verdict, "for", verdict_purpose_name(v->purpose));
    struct json *good_for = json_add_object(verdict, "good_for");
    json_add_bool(good_for, "compare", verdict_is_good_for(v, USE_COMPARE));
    json_add_bool(good_for, "watch", verdict_is_good_for(v, USE_WATCH));
    struct json *lines = json_add_array(verdict, "lines");
    for (int i = 0; i < v->count; i++)
        if (verdict_shows_line(v, i))
            json_push_string(lines, v->line[i].text);
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
