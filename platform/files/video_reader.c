#include "platform/files/video_reader.h"

#ifdef REENACT_FFMPEG
#include "base/pixels.h"
#include "platform/files/ffmpeg_library.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct ffmpeg_library *_Atomic ffmpeg; // the same for all; set before the first reader is made

struct video_reader {
    char *path;
    AVFormatContext *format;
    AVCodecContext *codec;
    AVStream *stream;
    AVPacket *packet;
    AVFrame *frame;             // the image that it went on to
    struct SwsContext *convert; // of images that are not 8-bit 4:2:0; NULL: none was yet
    AVFrame *plain;             // what it makes of them
    uint8_t *chroma;            // Cb and Cr in turn
    int64_t index;              // of the next image
    bool ended;                 // all packets were handed to the decoder
};

// ---------------------------------------------------------------- opening

static enum status refuse_file(const struct video_reader *reader)
{
    const char *kind = file_kind(reader->path);
    return fail(ERR_INPUT, "%s is no film (MP4) that can be read%s%s; it may be cut short", reader->path,
                kind ? ": it is " : "", kind ? kind : "");
}

static enum status open_format(struct video_reader *reader)
{
    char url[FILE_PATH_BYTES + 8];
    if (!file_exists(reader->path))
        return fail(ERR_MISSING, "there is no file %s", reader->path);
    if (snprintf(url, sizeof url, "file:%s", reader->path) >= (int)sizeof url)
        return fail(ERR_INPUT, "the path %.60s… is too long", reader->path);
    const int error = ffmpeg->avformat_open_input(&reader->format, url, ffmpeg->av_find_input_format("mov"), NULL);
    if (error < 0)
        return error == AVERROR(ENOMEM) ? fail(ERR_MEMORY, "no memory to open %s", reader->path) : refuse_file(reader);
    for (unsigned i = 0; i < reader->format->nb_streams && !reader->stream; i++)
        if (reader->format->streams[i]->codecpar->codec_type == AVMEDIA_TYPE_VIDEO)
            reader->stream = reader->format->streams[i];
    return reader->stream ? OK : fail(ERR_INPUT, "%s holds no pictures", reader->path);
}

static enum status open_decoder(struct video_reader *reader)
{
    const AVCodecParameters *p = reader->stream->codecpar;
    if (!image_size_is_usable(p->width, p->height) || p->width % 2 || p->height % 2)
        return fail(ERR_INPUT, "%s: its images of %d x %d pixels cannot be used", reader->path, p->width, p->height);
    const AVCodec *codec = ffmpeg->avcodec_find_decoder(p->codec_id);
    if (!codec)
        return fail(ERR_INPUT, "%s: FFmpeg's libraries here cannot decode its images", reader->path);
    reader->codec = ffmpeg->avcodec_alloc_context3(codec);
    if (!reader->codec || ffmpeg->avcodec_parameters_to_context(reader->codec, p) < 0)
        return fail(ERR_MEMORY, "no memory to read %s", reader->path);
    reader->codec->thread_count = 0; // as many as there are processors
    if (ffmpeg->avcodec_open2(reader->codec, codec, NULL) < 0)
        return fail(ERR_INPUT, "%s: its images cannot be decoded", reader->path);
    reader->packet = ffmpeg->av_packet_alloc();
    reader->frame = ffmpeg->av_frame_alloc();
    reader->chroma = malloc((size_t)p->width * (size_t)p->height / 2);
    return reader->packet && reader->frame && reader->chroma ? OK : fail(ERR_MEMORY, "no memory to read a film");
}

enum status video_reader_open(struct video_reader **out, const char *path)
{
    *out = NULL;
    ffmpeg = ffmpeg_library();
    if (!ffmpeg)
        return fail(ERR_INPUT, "FFmpeg's libraries, without which %s cannot be read, are not installed", path);
    struct video_reader *reader = calloc(1, sizeof *reader);
    if (!reader || !(reader->path = strdup(path))) {
        free(reader);
        return fail(ERR_MEMORY, "no memory to open %s", path);
    }
    enum status status = open_format(reader);
    if (status == OK)
        status = open_decoder(reader);
    *out = reader;
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        video_reader_close(out);
        return failure_restore(&first);
    }
    return OK;
}

void video_reader_close(struct video_reader **out)
{
    struct video_reader *reader = *out;
    if (!reader)
        return;
    ffmpeg->sws_freeContext(reader->convert);
    ffmpeg->av_frame_free(&reader->plain);
    ffmpeg->av_frame_free(&reader->frame);
    ffmpeg->av_packet_free(&reader->packet);
    ffmpeg->avcodec_free_context(&reader->codec);
    ffmpeg->avformat_close_input(&reader->format);
    free(reader->chroma);
    free(reader->path);
    free(reader);
    *out = NULL;
}

void video_reader_size(const struct video_reader *reader, int *width, int *height)
{
    *width = reader->stream->codecpar->width;
    *height = reader->stream->codecpar->height;
}

// ---------------------------------------------------------------- images

static enum status fail_image(const struct video_reader *reader)
{
    return fail(ERR_INPUT, "%s, image %lld: it is damaged", reader->path, (long long)reader->index);
}

// Hands the next packet of the images to the decoder.
static enum status feed_decoder(struct video_reader *reader)
{
    while (!reader->ended) {
        int error = ffmpeg->av_read_frame(reader->format, reader->packet);
        reader->ended = error < 0; // a film that was cut short ends where it was cut
        const bool wanted = error >= 0 && reader->packet->stream_index == reader->stream->index;
        if (wanted || reader->ended)
            error = ffmpeg->avcodec_send_packet(reader->codec, reader->ended ? NULL : reader->packet);
        ffmpeg->av_packet_unref(reader->packet);
        if (wanted)
            return error < 0 ? fail_image(reader) : OK;
    }
    return OK;
}

enum status video_reader_next(struct video_reader *reader, int64_t *time_ns)
{
    for (;;) {
        const int error = ffmpeg->avcodec_receive_frame(reader->codec, reader->frame);
        if (error == AVERROR_EOF || (error == AVERROR(EAGAIN) && reader->ended))
            return NOTHING;
        if (error == AVERROR(EAGAIN)) {
            const enum status status = feed_decoder(reader);
            if (status != OK)
                return status;
            continue;
        }
        const AVCodecParameters *p = reader->stream->codecpar;
        const int64_t first = reader->stream->start_time == AV_NOPTS_VALUE ? 0 : reader->stream->start_time;
        const int64_t at = reader->frame->best_effort_timestamp;
        if (error < 0 || reader->frame->width != p->width || reader->frame->height != p->height || at == AV_NOPTS_VALUE)
            return fail_image(reader);
        reader->index++;
        *time_ns = ffmpeg->av_rescale_q(at - first, reader->stream->time_base, (AVRational){1, 1000000000});
        return OK;
    }
}

// The image as 8-bit 4:2:0; NULL: no memory.
static const AVFrame *plain_image(struct video_reader *reader)
{
    const AVFrame *frame = reader->frame;
    if (frame->format == AV_PIX_FMT_YUV420P || frame->format == AV_PIX_FMT_YUVJ420P)
        return frame;
    if (!reader->plain) {
        reader->convert =
            ffmpeg->sws_getContext(frame->width, frame->height, frame->format, frame->width, frame->height,
                                   AV_PIX_FMT_YUV420P, SWS_BILINEAR | SWS_ACCURATE_RND, NULL, NULL, NULL);
        reader->plain = ffmpeg->av_frame_alloc();
        if (!reader->convert || !reader->plain)
            return NULL;
        reader->plain->format = AV_PIX_FMT_YUV420P;
        reader->plain->width = frame->width;
        reader->plain->height = frame->height;
        if (ffmpeg->av_frame_get_buffer(reader->plain, 0) < 0)
            return NULL;
    }
    ffmpeg->sws_scale(reader->convert, (const uint8_t *const *)frame->data, frame->linesize, 0, frame->height,
                      reader->plain->data, reader->plain->linesize);
    return reader->plain;
}

enum status video_reader_image(struct video_reader *reader, uint8_t *rgb)
{
    const AVFrame *frame = plain_image(reader);
    if (!frame)
        return fail(ERR_MEMORY, "no memory to read %s", reader->path);
    const int width = frame->width, height = frame->height;
    for (int y = 0; y < height / 2; y++)
        for (int x = 0; x < width / 2; x++) {
            reader->chroma[(size_t)y * (size_t)width + 2 * (size_t)x] = frame->data[1][y * frame->linesize[1] + x];
            reader->chroma[(size_t)y * (size_t)width + 2 * (size_t)x + 1] = frame->data[2][y * frame->linesize[2] + x];
        }
    const bool full = reader->frame->color_range == AVCOL_RANGE_JPEG || frame->format == AV_PIX_FMT_YUVJ420P;
    const bool hd = reader->frame->colorspace == AVCOL_SPC_BT709 ||
                    (reader->frame->colorspace == AVCOL_SPC_UNSPECIFIED && height >= 720);
    const struct yuv_layout layout = {{hd ? YUV_BT709 : YUV_BT601, full}, width, height};
    pixels_from_nv12(frame->data[0], (size_t)frame->linesize[0], reader->chroma, (size_t)width, &layout, rgb);
    return OK;
}

#else
enum status video_reader_open(struct video_reader **out, const char *path)
{
    *out = NULL;
    return fail(ERR_INPUT, "this program was built without FFmpeg's libraries, so it cannot read %s", path);
}

void video_reader_close(struct video_reader **reader) { *reader = NULL; }

void video_reader_size(const struct video_reader *reader, int *width, int *height)
{
    (void)reader;
    *width = *height = 0;
}

enum status video_reader_next(struct video_reader *reader, int64_t *time_ns)
{
    (void)reader;
    (void)time_ns;
    assert(!"video_reader_open gave no reader");
    return ERR_INPUT;
}

enum status video_reader_image(struct video_reader *reader, uint8_t *rgb)
{
    (void)reader;
    (void)rgb;
    assert(!"video_reader_open gave no reader");
    return ERR_INPUT;
}
#endif
