#include "tests/support/test.h"

#include "tests/support/retake.h"

#include "platform/files/jpeg.h"

#include <stdlib.h>
#include <string.h>

enum { JPEG_QUALITY = 98 };

static void *copy(const void *from, size_t bytes)
{
    void *to = malloc(bytes);
    assert_true(from && to);
    return memcpy(to, from, bytes);
}

static void add_frame(struct recording_writer *writer, struct take *take, int64_t i,
                      void (*change)(void *self, struct retaken *frame), void *self)
{
    const struct lens *lens = &take_calibration(take)->color;
    const struct take_entry *e = take_entry(take, i);
    const size_t pixels = (size_t)lens->width * (size_t)lens->height;
    struct take_images seen;
    uint8_t *jpeg;
    size_t bytes;
    EXPECT_STATUS(take_read(take, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &seen), OK);
    struct retaken r = {.number = i,
                        .time_ns = e->time_ns,
                        .rgb = copy(seen.color, 3 * pixels),
                        .depth = copy(seen.depth, sizeof *r.depth * pixels),
                        .mask = copy(seen.mask, pixels),
                        .width = lens->width,
                        .height = lens->height};
    change(self, &r);
    EXPECT_STATUS(jpeg_encode(r.rgb, r.width, r.height, JPEG_QUALITY, &jpeg, &bytes), OK);
    const struct take_frame frame = {r.time_ns, e->world_from_camera, e->located, jpeg, bytes, r.depth,
                                     r.mask,    e->has_skeleton,      e->skeleton};
    EXPECT_STATUS(recording_add_frame(writer, &frame), OK);
    free(jpeg);
    free(r.rgb);
    free(r.depth);
    free(r.mask);
}

void retake(const char *file, const char *take, const char *name, void (*change)(void *self, struct retaken *frame),
            void *self)
{
    struct recording *recording;
    struct recording_writer *writer;
    struct take *from;
    EXPECT_STATUS(recording_open(&recording, file), OK);
    EXPECT_STATUS(take_open(&from, recording, take), OK);
    EXPECT_STATUS(recording_append(&writer, file), OK);
    EXPECT_STATUS(recording_begin_take(writer, name, take_calibration(from)), OK);
    for (int64_t i = 0; i < take_frame_count(from); i++)
        add_frame(writer, from, i, change, self);
    EXPECT_STATUS(recording_put_body(writer, take_body(from)), OK);
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    take_close(&from);
    recording_free(&recording);
}
