#include "capture/take_smoothing.h"

#include <stdlib.h>

// The backward pass over the take's depth. NOTHING: stopped.
static enum status smooth_backward(struct smoother *smoother, struct tracker *tracker, struct take *take,
                                   const struct recorder_options *options)
{
    int64_t count = take_frame_count(take);
    enum status status = OK;
    if (options->on_smoothing_begin)
        options->on_smoothing_begin(options->context, count);
    for (int64_t i = count - 1; i >= 0 && status == OK; i--) {
        struct take_images images;
        if (options->should_stop && options->should_stop())
            return NOTHING;
        if (take_entry(take, i)->has_depth) {
            status = take_read(take, i, TAKE_DEPTH, &images);
            if (status == OK)
                status = smoother_backward(smoother, tracker, i, images.depth);
            else if (status == ERR_CORRUPT) // a damaged frame costs itself alone
                status = OK;
        }
        if (options->on_smoothed)
            options->on_smoothed(options->context);
    }
    return status == OK ? smoother_solve(smoother) : status;
}

static enum status put_smoothed(struct smoother *smoother, struct recording_writer *writer, int64_t count)
{
    const struct skeleton **skeleton = calloc((size_t)count, sizeof *skeleton);
    if (!skeleton)
        return fail(ERR_MEMORY, "no memory to smooth a take");
    static const struct skeleton absent; // an online detection may turn out to be furniture
    for (int64_t i = 0; i < count; i++) {
        skeleton[i] = smoother_skeleton(smoother, i);
        skeleton[i] = skeleton[i] ? skeleton[i] : &absent;
    }
    enum status status = recording_put_skeletons(writer, skeleton, count);
    free(skeleton);
    return status;
}

enum status take_smooth(struct smoother *smoother, struct tracker *tracker, struct recording_writer *writer,
                        const char *name, const struct recorder_options *options)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    enum status status = recording_open(&recording, recording_writer_path(writer));
    if (status == OK)
        status = take_open(&take, recording, name);
    const int64_t count = status == OK ? take_frame_count(take) : 0;
    if (status == OK && take_lost(take)) // the smoother's frames would not be the take's
        status = NOTHING;
    if (status == OK)
        status = smooth_backward(smoother, tracker, take, options);
    take_close(&take);
    recording_free(&recording);
    return status == OK ? put_smoothed(smoother, writer, count) : status;
}
