#include "app/commands/coaching_line.h"

#include <stdio.h>

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
