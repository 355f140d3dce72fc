// Reading from OpenNI2: throttling a file's player, pairing depth and colour,
// mirroring images. openni.c describes the frames.
#include "base/clock.h"
#include "platform/sensors/openni_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Header of the memory that the gate allocates, before the pixels.
struct gate_block {
    struct image_stream *stream;
    bool taken;
};
enum { BLOCK_BYTES = 64 }; // keeps the pixels aligned

// ------------------------------------------------------------- the gate

void *gate_alloc(int size, void *cookie)
{
    struct image_stream *stream = cookie;
    struct gate *gate = stream->gate;
    pthread_mutex_lock(&gate->lock);
    while (stream->untaken && !gate->open)
        pthread_cond_wait(&gate->changed, &gate->lock);
    stream->untaken = true;
    pthread_mutex_unlock(&gate->lock);
    size_t rounded = (BLOCK_BYTES + (size_t)size + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
    uint8_t *memory = aligned_alloc(BLOCK_BYTES, rounded);
    if (!memory)
        return NULL;
    *(struct gate_block *)memory = (struct gate_block){stream, false};
    return memory + BLOCK_BYTES;
}

static void gate_taken(struct image_stream *stream, struct gate_block *block)
{
    struct gate *gate = stream->gate;
    pthread_mutex_lock(&gate->lock);
    if (!block->taken) {
        block->taken = true;
        stream->untaken = false;
        pthread_cond_broadcast(&gate->changed);
    }
    pthread_mutex_unlock(&gate->lock);
}

void gate_free(void *data, void *cookie)
{
    (void)cookie;
    if (!data)
        return;
    struct gate_block *block = (struct gate_block *)((uint8_t *)data - BLOCK_BYTES);
    gate_taken(block->stream, block); // discarded unread: the next may come
    free(block);
}

void gate_open(struct gate *gate)
{
    pthread_mutex_lock(&gate->lock);
    gate->open = true;
    pthread_cond_broadcast(&gate->changed);
    pthread_mutex_unlock(&gate->lock);
}

// ------------------------------------------------------------- frames

void image_stream_release_frames(struct image_stream *stream)
{
    for (int i = 0; i < stream->count; i++)
        oniFrameRelease(stream->queue[i]);
    stream->count = 0;
}

// Times of no clock, in a damaged file, are all the same, so that those after the first do not rise.
static int64_t time_of(const OniFrame *frame)
{
    const uint64_t most_us = INT64_MAX / 4000;
    return (int64_t)(frame->timestamp < most_us ? frame->timestamp : most_us) * 1000;
}

static void drop_oldest(struct image_stream *stream, int how_many)
{
    for (int i = 0; i < how_many; i++)
        oniFrameRelease(stream->queue[i]);
    stream->count -= how_many;
    memmove(stream->queue, stream->queue + how_many, (size_t)stream->count * sizeof *stream->queue);
}

enum status openni_read_frame(struct openni_sensor *s, int wait_ms)
{
    struct image_stream *both[2] = {&s->depth, &s->color};
    OniStreamHandle streams[2] = {s->depth.handle, s->color.handle};
    int index = 0;
    OniFrame *frame = NULL;
    if (oniWaitForAnyStream(streams, s->color.handle ? 2 : 1, &index, wait_ms) != ONI_STATUS_OK ||
        oniStreamReadFrame(streams[index], &frame) != ONI_STATUS_OK || !frame)
        return NOTHING;
    struct image_stream *stream = both[index];
    if (s->file)
        gate_taken(stream, (struct gate_block *)((uint8_t *)frame->data - BLOCK_BYTES));
    if (stream->count == STREAM_QUEUE)
        drop_oldest(stream, 1);
    stream->queue[stream->count++] = frame;
    struct stream_times *color = &s->facts->color_times;
    if (stream == &s->color && (!color->count || time_of(frame) > color->last_ns))
        stream_times_add(color, time_of(frame));
    s->got_frame = true;
    return OK;
}

// Whether it is decided which colour image, if any, belongs to the oldest depth image. For a file this depends only on
// the order of the images, not on timing.
static bool pairing_decided(const struct openni_sensor *s, bool over)
{
    if (!s->depth.count)
        return false;
    if (over || !s->color.handle)
        return true;
    if (s->color.count && time_of(s->color.queue[s->color.count - 1]) >= time_of(s->depth.queue[0]))
        return true; // later images are further away
    return s->depth.count >= (s->file ? STREAM_QUEUE : 2);
}

static enum status check_frame(const struct openni_sensor *s, const struct image_stream *stream, const OniFrame *frame,
                               int pixel_bytes, const char *what)
{
    int w = stream->mode.resolutionX, h = stream->mode.resolutionY;
    if (frame->width != w || frame->height != h)
        return fail(ERR_INPUT, "%s: %s picture %d has %d x %d pixels where %d x %d were announced", s->name, what,
                    frame->frameIndex, frame->width, frame->height, w, h);
    if (frame->stride < w * pixel_bytes || frame->dataSize < frame->stride * (h - 1) + w * pixel_bytes)
        return fail(ERR_INPUT, "%s: %s picture %d is damaged", s->name, what, frame->frameIndex);
    return OK;
}

static enum status copy_depth(struct openni_sensor *s, const OniFrame *frame)
{
    int w = s->depth.mode.resolutionX, h = s->depth.mode.resolutionY;
    enum status status = check_frame(s, &s->depth, frame, 2, "depth");
    if (status != OK)
        return status;
    bool tenths = s->depth.mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
    for (int y = 0; y < h; y++) {
        const uint16_t *in =
            (const uint16_t *)(const void *)((const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride);
        uint16_t *out = s->mm + (size_t)y * (size_t)w;
        for (int x = 0; x < w; x++) {
            int value = in[s->depth.mirrored ? w - 1 - x : x];
            out[x] = (uint16_t)(tenths ? (value + 5) / 10 : value);
        }
    }
    return OK;
}

static enum status copy_color(struct openni_sensor *s, const OniFrame *frame)
{
    int w = s->color.mode.resolutionX, h = s->color.mode.resolutionY;
    enum status status = check_frame(s, &s->color, frame, 3, "colour");
    if (status != OK)
        return status;
    for (int y = 0; y < h; y++) {
        const uint8_t *in = (const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride;
        uint8_t *out = s->rgb + (size_t)y * (size_t)w * 3;
        if (!s->color.mirrored)
            memcpy(out, in, (size_t)w * 3);
        else
            for (int x = 0; x < w; x++)
                memcpy(out + 3 * x, in + 3 * (w - 1 - x), 3);
    }
    return OK;
}

// Counts the depth images missing between the last one returned and the oldest in the queue. A sensor has dropped them;
// in a file they are damaged, which is reported once, before the next image.
static enum status count_gap(struct openni_sensor *s)
{
    const int index = s->depth.queue[0]->frameIndex;
    const int64_t gap = s->last_index < 0 ? 0 : index - s->last_index - 1;
    if (gap <= 0)
        return OK;
    s->facts->dropped += gap;
    s->last_index = index - 1;
    if (!s->file)
        return OK;
    s->facts->remaining = s->facts->remaining > gap ? s->facts->remaining - gap : s->facts->remaining;
    return fail(ERR_INPUT, "%s: the %lld pictures before number %d are damaged and left out", s->name, (long long)gap,
                index);
}

// The colour image nearest in time, at most half a frame away; -1: none.
static int color_for(const struct openni_sensor *s, int64_t time_ns)
{
    int best = -1;
    int64_t best_ns = s->half_frame_ns + 1;
    for (int i = 0; i < s->color.count; i++) {
        int64_t away_ns = llabs(time_of(s->color.queue[i]) - time_ns);
        if (away_ns < best_ns) {
            best = i;
            best_ns = away_ns;
        }
    }
    return best;
}

// Makes a frame of the oldest depth image and its colour. NOTHING: it was dropped because its time does not rise.
static enum status make_frame(struct openni_sensor *s, struct frame *out)
{
    enum status status = count_gap(s);
    if (status != OK)
        return status;
    const OniFrame *depth = s->depth.queue[0];
    int64_t time_ns = time_of(depth);
    s->last_index = depth->frameIndex;
    if (s->facts->remaining > 0)
        s->facts->remaining--;
    if (time_ns <= s->last_time_ns) {
        s->facts->dropped++;
        drop_oldest(&s->depth, 1);
        return NOTHING;
    }
    s->last_time_ns = time_ns;
    stream_times_add(&s->facts->depth_times, time_ns);
    out->time_ns = time_ns;
    snprintf(out->name, sizeof out->name, "%04lld", (long long)s->handed_out++);
    int color = color_for(s, time_ns);
    s->facts->pairs += color >= 0;
    status = copy_depth(s, depth);
    if (status == OK && color >= 0)
        status = copy_color(s, s->color.queue[color]);
    out->depth = s->mm;
    out->color = color >= 0 ? s->rgb : NULL;
    drop_oldest(&s->depth, 1);
    int used = color + 1; // and those before it; colour older than half a frame fits no later depth image
    while (used < s->color.count && time_of(s->color.queue[used]) < time_ns - s->half_frame_ns)
        used++;
    drop_oldest(&s->color, used);
    return status;
}

// Reports, once, a file that ends before the number of images it announced.
static enum status at_end(struct openni_sensor *s)
{
    int64_t lost = s->facts->remaining;
    s->facts->remaining = 0;
    if (lost > 0)
        return fail(ERR_INPUT, "%s breaks off %lld pictures before its end: it is damaged", s->name, (long long)lost);
    return NOTHING;
}

enum status openni_next(void *self, struct frame *out)
{
    struct openni_sensor *s = self;
    int64_t since_ns = clock_now_ns();
    for (;;) {
        while (s->depth.count < STREAM_QUEUE && !(s->file && pairing_decided(s, false)) &&
               openni_read_frame(s, 0) == OK)
            since_ns = clock_now_ns();
        // Read before the queues are filled for the last time, so that they then hold all that came before the end.
        bool gone = atomic_load(&s->gone), over = gone || atomic_load(&s->ended);
        if (over)
            while (s->depth.count < STREAM_QUEUE && openni_read_frame(s, 0) == OK)
                ;
        if (!s->file && s->depth.count > 2)
            drop_oldest(&s->depth, s->depth.count - 2); // late: keep the newest; count_gap() counts the rest
        if (pairing_decided(s, over)) {
            enum status status = make_frame(s, out);
            if (status != NOTHING)
                return status;
            continue;
        }
        if (gone)
            return fail(ERR_DEVICE, "%s was unplugged", s->name);
        if (over)
            return at_end(s);
        if (openni_read_frame(s, SLICE_MS) == OK)
            since_ns = clock_now_ns();
        else if (s->file && clock_now_ns() - since_ns > FILE_SILENCE_MS * INT64_C(1000000))
            atomic_store(&s->ended, true);
        else if (!s->file && clock_now_ns() - since_ns > LIVE_SILENCE_MS * INT64_C(1000000))
            return fail(ERR_DEVICE, "%s has sent no picture for %d seconds; is it still plugged in?", s->name,
                        LIVE_SILENCE_MS / 1000);
    }
}
