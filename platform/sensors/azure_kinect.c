// Recordings of an Azure Kinect (k4arecorder's .mkv) as a sensor, mkv:FILE, through FFmpeg's libraries; an optional
// part of the build.
//
// The file is Matroska (Azure Kinect Sensor SDK, "record file format"): the tracks COLOR (MJPEG, NV12, YUY2 or BGRA)
// and DEPTH (16 bits, big-endian, millimetres; FourCC b16g), found by their K4A_..._TRACK tags or names, the attachment
// calibration.json (azure_lens.h), and the tag K4A_DEPTH_DELAY_NS, by which depth was exposed after colour. Infrared,
// motion and what else is there are passed over.
//
// A frame is a depth image with the colour image nearest in time, delay allowed for, at most half a frame apart. Depth
// is not registered to colour: each has its lens, and color_from_depth lies between them. Colour that is JPEG is handed
// on as it is, where the lens allows. Images without a time, or not later than the one before, are counted as dropped.
#include "platform/sensors/source_internal.h"

#ifdef REENACT_FFMPEG
#include "base/pixels.h"
#include "platform/sensors/azure_lens.h"
#include "platform/files/ffmpeg_library.h"
#include "platform/files/file.h"
#include "platform/files/file_kind.h"
#include "platform/files/jpeg.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct ffmpeg_library *_Atomic ffmpeg; // the same for all; set before the first file is opened

enum { QUEUED_MOST = 64 }; // images of one track that may lie before their partners of the other

static const int64_t FRAME_NS = 33333333; // where the file does not say

struct waiting { // images of a track that were read and not yet shown, in order
    AVPacket *packet[QUEUED_MOST];
    int64_t time_ns[QUEUED_MOST];
    int count;
    int stream;      // -1: there is no such track
    int64_t last_ns; // of all that were ever read
};

enum color_kind { COLOR_JPEG, COLOR_NV12, COLOR_YUY2, COLOR_BGRA };

struct kinect {
    char *path;
    AVFormatContext *format;
    struct waiting color, depth;
    enum color_kind color_kind;
    bool big_endian; // depth
    struct azure_calibration calibration;
    int64_t delay_ns, half_ns; // of depth after colour; half a frame
    int64_t index;             // of the next frame
    bool ended, damaged, told; // damaged: the file ended by an error; told: at_end() has said so
    AVPacket *shown;           // whose bytes the last frame's jpeg are
    uint8_t *rgb, *rectified;
    uint16_t *mm, *rectified_mm;
    struct source_facts *facts;
};

// ------------------------------------------------------------- reading on

// The oldest image of a track, out of its queue; the caller frees it.
static AVPacket *take_first(struct waiting *w, int64_t *time_ns)
{
    AVPacket *first = w->packet[0];
    *time_ns = w->time_ns[0];
    w->count--;
    memmove(w->packet, w->packet + 1, (size_t)w->count * sizeof *w->packet);
    memmove(w->time_ns, w->time_ns + 1, (size_t)w->count * sizeof *w->time_ns);
    return first;
}

static void drop_first(struct waiting *w)
{
    int64_t time_ns;
    AVPacket *first = take_first(w, &time_ns);
    ffmpeg->av_packet_free(&first);
}

// Puts the image into its track's queue, which owns it from then on.
static void queue_packet(struct kinect *k, AVPacket *packet)
{
    struct waiting *w = NULL;
    if (packet->stream_index == k->depth.stream)
        w = &k->depth;
    else if (packet->stream_index == k->color.stream)
        w = &k->color;
    if (!w) {
        ffmpeg->av_packet_free(&packet);
        return;
    }
    const AVRational base = k->format->streams[w->stream]->time_base;
    const int64_t time_ns = packet->pts == AV_NOPTS_VALUE
                                ? INT64_MIN
                                : ffmpeg->av_rescale_q(packet->pts, base, (AVRational){1, 1000000000});
    if (time_ns <= w->last_ns || llabs(time_ns) > INT64_MAX / 4) { // the latter: of no clock
        k->facts->dropped += w == &k->depth;
        ffmpeg->av_packet_free(&packet);
        return;
    }
    if (w == &k->color)
        stream_times_add(&k->facts->color_times, time_ns);
    else
        stream_times_add(&k->facts->depth_times, time_ns);
    if (w->count == QUEUED_MOST)
        drop_first(w);
    w->packet[w->count] = packet;
    w->time_ns[w->count++] = w->last_ns = time_ns;
}

// Reads one image of any track. NOTHING: the end, also where the file is damaged.
static enum status read_on(struct kinect *k)
{
    if (k->ended)
        return NOTHING;
    AVPacket *packet = ffmpeg->av_packet_alloc();
    if (!packet)
        return fail(ERR_MEMORY, "no memory for the images of %s", k->path);
    const int error = ffmpeg->av_read_frame(k->format, packet);
    if (error >= 0) {
        queue_packet(k, packet);
        return OK;
    }
    ffmpeg->av_packet_free(&packet);
    if (error == AVERROR(ENOMEM))
        return fail(ERR_MEMORY, "no memory for the images of %s", k->path);
    k->ended = true;
    k->damaged = error != AVERROR_EOF;
    return NOTHING;
}

// Once, after all that was read of it: ERR_INPUT for a file that does not reach the end it states, else NOTHING.
static enum status at_end(struct kinect *k)
{
    enum { FRAMES = 5 }; // the other tracks may go on a little longer
    const int64_t last_ns = k->depth.last_ns > k->color.last_ns ? k->depth.last_ns : k->color.last_ns;
    // Of no clock, in a damaged file, is no statement. Microseconds.
    const int64_t stated_us = k->format->duration < INT64_MAX / 4000 ? k->format->duration : 0;
    const double missing_s = stated_us * 1e-6 - (last_ns == INT64_MIN ? 0 : (double)last_ns * 1e-9);
    if (k->told)
        return NOTHING;
    k->told = true;
    if (missing_s > 2 * FRAMES * 1e-9 * (double)k->half_ns)
        return fail(ERR_INPUT, "%s breaks off %.1f s before its end: it is damaged", k->path, missing_s);
    return k->damaged ? fail(ERR_INPUT, "%s is damaged after %" PRId64 " frames", k->path, k->index) : NOTHING;
}

// Reads until the next depth image is there, and colour at least as late. At the end as at_end().
static enum status read_pair(struct kinect *k)
{
    enum status status = OK;
    while (status == OK) {
        const bool has_depth = k->depth.count > 0;
        const bool waits = k->color.stream >= 0 && k->depth.count < QUEUED_MOST &&
                           (!has_depth || k->color.last_ns < k->depth.time_ns[0] - k->delay_ns);
        if (has_depth && !waits)
            return OK;
        status = read_on(k);
    }
    if (status != NOTHING)
        return status;
    return k->depth.count ? OK : at_end(k);
}

// The colour image that belongs to `time_ns`, out of the queue with all before it; NULL: none.
static AVPacket *take_color(struct kinect *k, int64_t time_ns)
{
    struct waiting *w = &k->color;
    int nearest = -1;
    for (int i = 0; i < w->count; i++)
        if (llabs(w->time_ns[i] - time_ns) <= k->half_ns &&
            (nearest < 0 || llabs(w->time_ns[i] - time_ns) < llabs(w->time_ns[nearest] - time_ns)))
            nearest = i;
    for (int i = 0; i < nearest; i++)
        drop_first(w);
    while (nearest < 0 && w->count && w->time_ns[0] < time_ns - k->half_ns)
        drop_first(w);
    int64_t unused;
    return nearest < 0 ? NULL : take_first(w, &unused);
}

// ------------------------------------------------------------- images

static enum status show_depth(struct kinect *k, const AVPacket *packet, struct frame *out)
{
    const AVCodecParameters *p = k->format->streams[k->depth.stream]->codecpar;
    const size_t area = (size_t)p->width * (size_t)p->height;
    if ((size_t)packet->size < 2 * area)
        return fail(ERR_INPUT, "%s, depth of frame %" PRId64 ": %d bytes instead of %zu", k->path, k->index - 1,
                    packet->size, 2 * area);
    const uint8_t *in = packet->data;
    for (size_t i = 0; i < area; i++, in += 2)
        k->mm[i] = (uint16_t)(k->big_endian ? in[0] << 8 | in[1] : in[1] << 8 | in[0]);
    if (k->calibration.depth.from)
        azure_remap_depth(&k->calibration.depth, k->mm, k->rectified_mm);
    out->depth = k->calibration.depth.from ? k->rectified_mm : k->mm;
    return OK;
}

// Decodes into k->rgb.
static enum status decode_color(struct kinect *k, const AVPacket *packet)
{
    const AVCodecParameters *p = k->format->streams[k->color.stream]->codecpar;
    const size_t width = (size_t)p->width, area = width * (size_t)p->height;
    const struct yuv_layout layout = {{YUV_BT601, false}, p->width, p->height};
    static const size_t half_bytes[] = {[COLOR_NV12] = 3, [COLOR_YUY2] = 4, [COLOR_BGRA] = 8}; // of a pixel
    if (k->color_kind == COLOR_JPEG) {
        enum status status = jpeg_decode(packet->data, (size_t)packet->size, k->rgb, p->width, p->height);
        if (status == ERR_CORRUPT)
            status = fail(ERR_INPUT, "%s, colour of frame %" PRId64 ": %s", k->path, k->index - 1, status_message());
        return status;
    }
    if ((size_t)packet->size < area * half_bytes[k->color_kind] / 2)
        return fail(ERR_INPUT, "%s, colour of frame %" PRId64 ": %d bytes are too few", k->path, k->index - 1,
                    packet->size);
    if (k->color_kind == COLOR_NV12)
        pixels_from_nv12(packet->data, width, packet->data + area, width, &layout, k->rgb);
    else if (k->color_kind == COLOR_YUY2)
        pixels_from_yuv422(packet->data, 2 * width, true, &layout, k->rgb);
    else
        pixels_from_packed(packet->data, 4 * width, PACKED_BGRX, p->width, p->height, k->rgb);
    return OK;
}

// Takes over the packet, whose JPEG the frame may point into.
static enum status show_color(struct kinect *k, AVPacket *packet, struct frame *out)
{
    k->shown = packet;
    enum status status = decode_color(k, packet);
    if (status != OK)
        return status;
    const struct azure_remap *remap = &k->calibration.color;
    out->color = remap->from ? k->rectified : k->rgb;
    if (remap->from) {
        azure_remap_color(remap, k->rgb, k->rectified);
    } else if (k->color_kind == COLOR_JPEG) {
        out->jpeg = packet->data;
        out->jpeg_bytes = (size_t)packet->size;
    }
    return OK;
}

static enum status kinect_next(void *self, struct frame *out)
{
    struct kinect *k = self;
    ffmpeg->av_packet_free(&k->shown);
    enum status status = read_pair(k);
    if (status != OK)
        return status;
    AVPacket *depth = take_first(&k->depth, &out->time_ns);
    snprintf(out->name, sizeof out->name, "%04" PRId64, k->index++);
    status = show_depth(k, depth, out);
    ffmpeg->av_packet_free(&depth);
    AVPacket *color = take_color(k, out->time_ns - k->delay_ns);
    k->facts->pairs += color != NULL;
    if (status != OK)
        ffmpeg->av_packet_free(&color);
    return color ? show_color(k, color, out) : status;
}

// ------------------------------------------------------------- opening

static const char *tag(const AVDictionary *tags, const char *name)
{
    const AVDictionaryEntry *entry = ffmpeg->av_dict_get(tags, name, NULL, 0);
    return entry ? entry->value : NULL;
}

// The track of that name; -1: none.
static int find_track(const struct kinect *k, const char *name)
{
    char key[32];
    snprintf(key, sizeof key, "K4A_%s_TRACK", name);
    for (unsigned i = 0; i < k->format->nb_streams; i++) {
        const AVStream *s = k->format->streams[i];
        const char *title = tag(s->metadata, "title");
        if (s->codecpar->codec_type == AVMEDIA_TYPE_VIDEO && (tag(s->metadata, key) || (title && !strcmp(title, name))))
            return (int)i;
    }
    return -1;
}

static enum status check_track(struct kinect *k, int stream, const char *what)
{
    const AVCodecParameters *p = k->format->streams[stream]->codecpar;
    if (!image_size_is_usable(p->width, p->height))
        return fail(ERR_INPUT, "%s: its %s images of %d x %d pixels cannot be used", k->path, what, p->width,
                    p->height);
    return OK;
}

static enum status find_tracks(struct kinect *k)
{
    k->depth.stream = find_track(k, "DEPTH");
    k->color.stream = find_track(k, "COLOR");
    if (k->depth.stream < 0)
        return fail(ERR_INPUT, "%s is no recording of an Azure Kinect with depth: it has no track DEPTH", k->path);
    enum status status = check_track(k, k->depth.stream, "depth");
    if (status == OK && k->color.stream >= 0)
        status = check_track(k, k->color.stream, "colour");
    if (status != OK)
        return status;
    const AVCodecParameters *d = k->format->streams[k->depth.stream]->codecpar;
    k->big_endian = d->codec_tag == MKTAG('b', '1', '6', 'g');
    if (d->codec_id != AV_CODEC_ID_RAWVIDEO || (!k->big_endian && d->codec_tag != MKTAG('Y', '1', '6', ' ')))
        return fail(ERR_INPUT, "%s: its depth is not of 16 uncompressed bits (b16g)", k->path);
    if (k->color.stream < 0)
        return OK;
    const AVCodecParameters *c = k->format->streams[k->color.stream]->codecpar;
    const bool raw = c->codec_id == AV_CODEC_ID_RAWVIDEO;
    if (c->codec_id == AV_CODEC_ID_MJPEG)
        k->color_kind = COLOR_JPEG;
    else if (raw && c->codec_tag == MKTAG('N', 'V', '1', '2') && !(c->height % 2))
        k->color_kind = COLOR_NV12; // and the mode's width is a multiple of 4
    else if (raw && c->codec_tag == MKTAG('Y', 'U', 'Y', '2'))
        k->color_kind = COLOR_YUY2;
    else if (raw && c->codec_tag == MKTAG('B', 'G', 'R', 'A'))
        k->color_kind = COLOR_BGRA;
    else
        return fail(ERR_INPUT, "%s: its colour is neither MJPEG, NV12, YUY2 nor BGRA", k->path);
    return OK;
}

static enum status read_calibration(struct kinect *k)
{
    const char *file = tag(k->format->metadata, "K4A_CALIBRATION_FILE");
    const AVStream *found = NULL;
    for (unsigned i = 0; i < k->format->nb_streams && !found; i++) {
        const AVStream *s = k->format->streams[i];
        const char *name = tag(s->metadata, "filename");
        if (s->codecpar->codec_type == AVMEDIA_TYPE_ATTACHMENT && s->codecpar->extradata_size > 0 && name &&
            !strcmp(name, file ? file : "calibration.json"))
            found = s;
    }
    if (!found)
        return fail(ERR_INPUT, "%s holds no calibration.json, without which its depth means nothing", k->path);
    int size[2][2] = {{0}};
    const int streams[2] = {k->color.stream, k->depth.stream};
    for (int i = 0; i < 2; i++)
        if (streams[i] >= 0) {
            size[i][0] = k->format->streams[streams[i]]->codecpar->width;
            size[i][1] = k->format->streams[streams[i]]->codecpar->height;
        }
    char name[300];
    snprintf(name, sizeof name, "calibration.json in %.250s", k->path);
    enum status status =
        azure_calibration_parse((const char *)found->codecpar->extradata, (size_t)found->codecpar->extradata_size, name,
                                size[0], size[1], &k->calibration);
    if (status == OK)
        k->facts->calibration = k->calibration.lenses;
    return status;
}

static void read_clock(struct kinect *k)
{
    const AVRational rate = k->format->streams[k->depth.stream]->avg_frame_rate;
    const char *delay = tag(k->format->metadata, "K4A_DEPTH_DELAY_NS");
    int64_t frame_ns = FRAME_NS;
    if (rate.num > 0 && rate.den > 0)
        frame_ns = ffmpeg->av_rescale(1000000000, rate.den, rate.num);
    if (frame_ns < 1000000 || frame_ns > 1000000000)
        frame_ns = FRAME_NS;
    k->half_ns = frame_ns / 2;
    k->delay_ns = delay ? strtoll(delay, NULL, 10) : 0;
    if (k->delay_ns < -frame_ns || k->delay_ns > frame_ns) // the sensor allows less
        k->delay_ns = 0;
    k->color.last_ns = k->depth.last_ns = INT64_MIN;
}

static enum status alloc_images(struct kinect *k)
{
    const struct calibration *c = &k->calibration.lenses;
    const size_t color = (size_t)c->color.width * (size_t)c->color.height;
    const size_t depth = (size_t)c->depth.width * (size_t)c->depth.height;
    k->rgb = malloc(3 * color + 1);
    k->mm = malloc(2 * depth + 1);
    if (k->calibration.color.from)
        k->rectified = malloc(3 * color + 1);
    if (k->calibration.depth.from)
        k->rectified_mm = malloc(2 * depth + 1);
    if (!k->rgb || !k->mm || (k->calibration.color.from && !k->rectified) ||
        (k->calibration.depth.from && !k->rectified_mm))
        return fail(ERR_MEMORY, "no memory for the images of %s", k->path);
    return OK;
}

static enum status not_matroska(const char *path)
{
    const char *kind = file_kind(path);
    if (kind && strstr(kind, "Matroska"))
        return fail(ERR_INPUT, "%s is cut short or damaged where it begins", path);
    return fail(ERR_INPUT, "%s is no film of an Azure Kinect (Matroska, .mkv)%s%s", path, kind ? ": it is " : "",
                kind ? kind : "");
}

static enum status open_file(struct kinect *k)
{
    if (!file_exists(k->path))
        return fail(ERR_MISSING, "there is no file %s", k->path);
    char url[FILE_PATH_BYTES + 8];
    if (snprintf(url, sizeof url, "file:%s", k->path) >= (int)sizeof url)
        return fail(ERR_INPUT, "the path %.60s… is too long", k->path);
    const int error = ffmpeg->avformat_open_input(&k->format, url, ffmpeg->av_find_input_format("matroska"), NULL);
    if (error == AVERROR(ENOMEM))
        return fail(ERR_MEMORY, "no memory to open %s", k->path);
    if (error < 0)
        return not_matroska(k->path);
    return OK;
}

static void kinect_close(void *self)
{
    struct kinect *k = self;
    if (!k)
        return;
    while (k->color.count)
        drop_first(&k->color);
    while (k->depth.count)
        drop_first(&k->depth);
    ffmpeg->av_packet_free(&k->shown);
    ffmpeg->avformat_close_input(&k->format);
    azure_calibration_free(&k->calibration);
    free(k->rgb);
    free(k->rectified);
    free(k->mm);
    free(k->rectified_mm);
    free(k->path);
    free(k);
}

enum status mkv_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted; // a sensor
    *self = NULL;
    ffmpeg = ffmpeg_library();
    if (!ffmpeg)
        return fail(ERR_INPUT, "FFmpeg's libraries, without which %s cannot be read, are not installed", where);
    struct kinect *k = calloc(1, sizeof *k);
    if (!k || !(k->path = strdup(where))) {
        free(k);
        return fail(ERR_MEMORY, "no memory to open %s", where);
    }
    k->facts = facts;
    enum status status = open_file(k);
    if (status == OK)
        status = find_tracks(k);
    if (status == OK)
        status = read_calibration(k);
    if (status == OK)
        status = alloc_images(k);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        kinect_close(k);
        return failure_restore(&first);
    }
    read_clock(k);
    facts->live = false;
    *self = k;
    return OK;
}

const struct source_kind mkv_kind = {kinect_next, kinect_close};

#else
enum status mkv_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    (void)facts;
    *self = NULL;
    return fail(ERR_INPUT, "this program was built without FFmpeg's libraries, so it cannot read %s", where);
}

const struct source_kind mkv_kind = {0};
#endif
