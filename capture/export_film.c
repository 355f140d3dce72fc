// The sensor's film as MP4.
#include "capture/export.h"

#include "platform/files/video.h"

// One image of the take, if it has colour.
static enum status add_frame(struct video_writer *video, struct take *take, int64_t frame)
{
    struct take_images images;
    enum status status = take_read(take, frame, TAKE_COLOR, &images);
    return status == OK && images.color ? video_add(video, images.color, take_entry(take, frame)->time_ns) : status;
}

enum status export_film_mp4(struct take *take, FILE *out, bool seekable, const struct progress_watch *watch,
                            int64_t *damaged)
{
    const struct lens *l = &take_calibration(take)->color;
    const int64_t frames = take_frame_count(take);
    int64_t with_color = 0;
    for (int64_t i = 0; i < frames; i++)
        with_color += take_entry(take, i)->has_color;
    if (!with_color)
        return fail(ERR_INPUT, "the take has no colour images, so there is no film");
    struct video_writer *video;
    enum status status = video_open(&video, out, &(struct video_layout){l->width, l->height, seekable});
    *damaged = 0;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        status = progress_continue(watch, (double)i / (double)frames) ? add_frame(video, take, i) : NOTHING;
        if (status == ERR_CORRUPT && ++*damaged < with_color)
            status = OK;
    }
    return video_close(&video, status);
}
