// How much of the file each part of a take's frames takes. A row's page is 64 KiB: of long takes some rows are asked.
#include "recording/recording_reader.h"

enum { ASKED_MOST = 300 };

enum status take_read_sizes(struct take *t, struct take_sizes *out)
{
    const int64_t frames = take_frame_count(t), asked = frames < ASKED_MOST ? frames : ASKED_MOST;
    double sums[3] = {0};
    struct statement *s;
    *out = (struct take_sizes){.exact = asked == frames};
    if (!frames)
        return OK;
    // SQLite knows a blob's length without reading it.
    enum status status =
        statement_open(&s, recording_database(take_recording(t)),
                       "SELECT length(color), length(depth), length(mask) FROM picture WHERE rowid = ?");
    for (int64_t i = 0; i < asked && status == OK; i++) {
        const struct take_entry *e = take_entry(t, i * frames / asked);
        statement_bind_number(s, 1, frame_key(take_id(t), e->row_number));
        status = statement_step(s);
        for (int k = 0; k < 3 && status == OK; k++)
            sums[k] += (double)statement_number(s, k);
        if (status == NOTHING) // a frame without images
            status = OK;
        statement_reset(s);
    }
    statement_close(&s);
    if (status != OK)
        return status;
    const double scale = asked ? (double)frames / (double)asked : 0;
    out->color = (int64_t)(sums[0] * scale);
    out->depth = (int64_t)(sums[1] * scale);
    out->mask = (int64_t)(sums[2] * scale);
    for (int64_t i = 0; i < frames; i++)
        out->joints += POSE_BYTES + (take_entry(t, i)->has_skeleton ? SKELETON_BYTES + JOINT_ERROR_BYTES : 0);
    return OK;
}
