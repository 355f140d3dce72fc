#include "app/commands/take_summary.h"

#include "base/pixels.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- coaching line

void coaching_line_start(struct coaching_line *line, const struct calibration *calibration,
                         enum verdict_purpose purpose)
{
    pthread_mutex_init(&line->lock, NULL);
    coach_start(&line->coach, calibration, purpose);
    line->text[0] = 0;
}

void coaching_line_end(struct coaching_line *line) { pthread_mutex_destroy(&line->lock); }

void coaching_line_see(struct coaching_line *line, const struct recorder_seen *seen)
{
    const struct coach_frame frame = {.time_ns = seen->time_ns,
                                      .color = seen->color,
                                      .depth = seen->depth,
                                      .mask = seen->mask,
                                      .skeleton = seen->skeleton,
                                      .sensor_moves = seen->sensor_moves,
                                      .depth_scale = seen->sight.depth_scale};
    coach_next(&line->coach, &frame);
    pthread_mutex_lock(&line->lock);
    snprintf(line->text, sizeof line->text, "%.0f %% seen · %.80s", line->coach.share * 100, coach_text(&line->coach));
    pthread_mutex_unlock(&line->lock);
}

void coaching_line_text(struct coaching_line *line, char *out, size_t capacity)
{
    pthread_mutex_lock(&line->lock);
    snprintf(out, capacity, "%s", line->text);
    pthread_mutex_unlock(&line->lock);
}

// ---------------------------------------------------------------- take summary

// Converted first: the difference of times in a malformed file may overflow an int64.
static double seconds_between(const struct take *take, int64_t a, int64_t b)
{
    return ((double)take_entry(take, b)->time_ns - (double)take_entry(take, a)->time_ns) * 1e-9;
}

struct take_summary take_summarize(const struct take *take, const char *name)
{
    struct take_summary s = {
        .name = name,
        .note = take_note(take),
        .alias = take_alias(take),
        .frames = take_frame_count(take),
        .dropped = take_dropped(take),
        .lost = take_lost(take),
        .representative = take_body(take)->representative_frame,
        .calibration = take_calibration(take),
        .complete = take_is_complete(take),
    };
    for (int64_t i = 0; i < s.frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        s.with_skeleton += e->has_skeleton;
        s.with_color += e->has_color && !take_is_drawn_from_depth(take);
        s.with_depth += e->has_depth;
        s.located += e->located;
    }
    if (s.frames > 1) {
        s.duration_s = seconds_between(take, 0, s.frames - 1);
        s.fps = (double)(s.frames - 1) / s.duration_s;
    }
    return s;
}

void verdict_add_json(struct json *object, const struct take_verdict *take_verdict)
{
    struct json *verdict = json_add_object(object, "verdict");
    json_add_bool(verdict, "good", verdict_is_good(take_verdict));
    json_add_string(verdict, "headline", verdict_headline(take_verdict));
    json_add_string(verdict, "for", verdict_purpose_name(take_verdict->purpose));
    struct json *good_for = json_add_object(verdict, "good_for");
    json_add_bool(good_for, "compare", verdict_is_good_for(take_verdict, USE_COMPARE));
    json_add_bool(good_for, "watch", verdict_is_good_for(take_verdict, USE_WATCH));
    struct json *lines = json_add_array(verdict, "lines");
    for (int i = 0; i < take_verdict->count; i++)
        if (verdict_shows_line(take_verdict, i))
            json_push_string(lines, take_verdict->line[i].text);
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
