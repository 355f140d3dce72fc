#include "app/studio/studio_rate.h"

#include "recording/depth_codec.h"
#include "platform/files/jpeg.h"

#include <stdlib.h>

static const int64_t EVERY_NS = 2000000000;
enum { QUALITY = 92 }; // as the recorder's

void studio_rate_see(struct studio_rate *r, const struct frame *frame, const struct calibration *calibration,
                     int64_t now_ns)
{
    const struct lens *color = &calibration->color, *depth = &calibration->depth;
    if ((r->frame_bytes > 0 && now_ns - r->measured_ns < EVERY_NS) || (!r->coder && depth_coder_open(&r->coder) != OK))
        return;
    uint8_t *jpeg = NULL;
    const uint8_t *coded;
    size_t jpeg_bytes = 0, depth_bytes = 0;
    r->measured_ns = now_ns;
    if (frame->jpeg)
        jpeg_bytes = frame->jpeg_bytes;
    else if (frame->color && jpeg_encode(frame->color, color->width, color->height, QUALITY, &jpeg, &jpeg_bytes) != OK)
        return;
    free(jpeg);
    if (frame->depth && depth_encode(r->coder, frame->depth, depth->width, depth->height, &coded, &depth_bytes) != OK)
        return;
    r->frame_bytes = (double)(jpeg_bytes + depth_bytes);
}

void studio_rate_close(struct studio_rate *r)
{
    depth_coder_close(&r->coder);
    *r = (struct studio_rate){0};
}
