#include "platform/files/video.h"

#ifdef REENACT_FFMPEG
#include "platform/files/ffmpeg_library.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static const struct ffmpeg_library *_Atomic ffmpeg; // the same for all; set before the first writer is made

enum { TICKS = 90000, IO_BYTES = 1 << 16, FRAGMENT_FRAMES = 30 }; // TICKS: a second's, as MPEG's clock has them

// Visually lossless, and a hundredth of the raw size; chosen by hand.
static const char *const QUALITY = "18", *const SPEED = "veryfast";

struct video_writer {
    FILE *out;
    struct video_layout layout; // even sizes
    int row_bytes;              // of an image that is given
    AVFormatContext *format;
    AVIOContext *io;
    AVCodecContext *codec;
    AVStream *stream;
    AVFrame *frame;
    AVPacket *packet;
    struct SwsContext *convert;
    int64_t first_ns, last_ticks; // last_ticks: -1 before the first image
    int64_t step_ticks;           // the shortest between two images; 0: there are no two
    bool begun;                   // the header is written
    int write_errno;              // why the file could not be written; 0: it could
};

static enum status fail_encoding(const struct video_writer *writer, const char *what, int error)
{
    char text[AV_ERROR_MAX_STRING_SIZE] = "";
    const int cause = writer->write_errno;
    if (cause == ENOSPC || cause == EDQUOT)
        return fail(ERR_IO, "the film could not be written: the disk is full");
    if (cause == EFBIG)
        return fail(ERR_IO, "the film could not be written: its file system, or a limit of this shell, takes no larger "
                            "file");
    if (cause)
        return fail(ERR_IO, "the film could not be written: %s", strerror(cause));
    if (error == AVERROR(ENOMEM))
        return fail(ERR_MEMORY, "no memory for a film");
    ffmpeg->av_strerror(error, text, sizeof text);
    return fail(ERR_IO, "the film's %s cannot be made of these pictures (FFmpeg: %s)", what, text);
}

static int write_bytes(void *self, uint8_t *bytes, int count)
{
    struct video_writer *w = self;
    // Flushed each time, so that the disk's answer is known: the blocks are large.
    if (fwrite(bytes, 1, (size_t)count, w->out) == (size_t)count && !fflush(w->out))
        return count;
    w->write_errno = errno ? errno : EIO;
    return AVERROR(EIO);
}

static int64_t seek_to(void *self, int64_t offset, int whence)
{
    const struct video_writer *w = self;
    if (whence & AVSEEK_SIZE)
        return AVERROR(ENOSYS);
    return fseeko(w->out, offset, whence & ~AVSEEK_FORCE) ? AVERROR(EIO) : ftello(w->out);
}

static enum status open_codec(struct video_writer *writer)
{
    const AVCodec *codec = ffmpeg->avcodec_find_encoder(AV_CODEC_ID_H264);
    if (!codec)
        codec = ffmpeg->avcodec_find_encoder(AV_CODEC_ID_MPEG4);
    if (!codec)
        return fail(ERR_INPUT, "FFmpeg's libraries have no encoder for H.264 or MPEG-4 here");
    AVCodecContext *c = writer->codec = ffmpeg->avcodec_alloc_context3(codec);
    if (!c)
        return fail(ERR_MEMORY, "no memory for a film");
    c->width = writer->layout.width;
    c->height = writer->layout.height;
    c->pix_fmt = AV_PIX_FMT_YUV420P;
    // MPEG-4 part 2 takes no finer time base.
    c->time_base = (AVRational){1, codec->id == AV_CODEC_ID_H264 ? TICKS : 60000};
    c->gop_size = FRAGMENT_FRAMES;
    c->color_range = AVCOL_RANGE_MPEG;
    c->colorspace = AVCOL_SPC_SMPTE170M; // as sws_scale converts by default
    if (codec->id != AV_CODEC_ID_H264) {
        c->flags |= AV_CODEC_FLAG_QSCALE;
        c->global_quality = 3 * FF_QP2LAMBDA;
    }
    if (writer->format->oformat->flags & AVFMT_GLOBALHEADER)
        c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    // An encoder other than x264 has other options; these are then not taken.
    ffmpeg->av_opt_set(c->priv_data, "crf", QUALITY, 0);
    ffmpeg->av_opt_set(c->priv_data, "preset", SPEED, 0);
    const int error = ffmpeg->avcodec_open2(c, codec, NULL);
    return error < 0 ? fail_encoding(writer, "encoder", error) : OK;
}

static enum status open_stream(struct video_writer *writer)
{
    writer->stream = ffmpeg->avformat_new_stream(writer->format, NULL);
    if (!writer->stream)
        return fail(ERR_MEMORY, "no memory for a film");
    writer->stream->time_base = writer->codec->time_base;
    int error = ffmpeg->avcodec_parameters_from_context(writer->stream->codecpar, writer->codec);
    AVDictionary *options = NULL;
    if (error >= 0 && !writer->layout.seekable)
        error = ffmpeg->av_dict_set(&options, "movflags", "frag_keyframe+empty_moov+default_base_moof", 0);
    if (error >= 0)
        error = ffmpeg->avformat_write_header(writer->format, &options);
    ffmpeg->av_dict_free(&options);
    writer->begun = error >= 0;
    return error < 0 ? fail_encoding(writer, "header", error) : OK;
}

static enum status open_images(struct video_writer *writer)
{
    writer->packet = ffmpeg->av_packet_alloc();
    writer->frame = ffmpeg->av_frame_alloc();
    if (writer->frame) {
        writer->frame->format = AV_PIX_FMT_YUV420P;
        writer->frame->width = writer->layout.width;
        writer->frame->height = writer->layout.height;
    }
    writer->convert = ffmpeg->sws_getContext(writer->layout.width, writer->layout.height, AV_PIX_FMT_RGB24,
                                             writer->layout.width, writer->layout.height, AV_PIX_FMT_YUV420P,
                                             SWS_BILINEAR | SWS_ACCURATE_RND, NULL, NULL, NULL);
    if (!writer->packet || !writer->frame || !writer->convert || ffmpeg->av_frame_get_buffer(writer->frame, 0) < 0)
        return fail(ERR_MEMORY, "no memory for a film");
    return OK;
}

static enum status open_container(struct video_writer *writer)
{
    uint8_t *buffer = ffmpeg->av_malloc(IO_BYTES);
    if (buffer)
        writer->io = ffmpeg->avio_alloc_context(buffer, IO_BYTES, 1, writer, NULL, write_bytes,
                                                writer->layout.seekable ? seek_to : NULL);
    if (!writer->io) {
        ffmpeg->av_free(buffer);
        return fail(ERR_MEMORY, "no memory for a film");
    }
    if (ffmpeg->avformat_alloc_output_context2(&writer->format, NULL, "mp4", NULL) < 0)
        return fail(ERR_MEMORY, "no memory for a film");
    writer->format->pb = writer->io;
    writer->format->flags |= AVFMT_FLAG_BITEXACT; // no date, no version: the same take gives the same bytes
    return OK;
}

enum status video_open(struct video_writer **out, FILE *file, const struct video_layout *layout)
{
    *out = NULL;
    if (layout->width < 2 || layout->height < 2)
        return fail(ERR_INPUT, "a film of %d x %d pixels cannot be made", layout->width, layout->height);
    ffmpeg = ffmpeg_library();
    if (!ffmpeg)
        return fail(ERR_INPUT, "FFmpeg's libraries, without which no films are written, are not installed");
    struct video_writer *w = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "no memory for a film");
    w->out = file;
    w->layout = *layout;
    w->row_bytes = 3 * layout->width;
    w->layout.width &= ~1;
    w->layout.height &= ~1;
    w->last_ticks = -1;
    enum status status = open_container(w);
    if (status == OK)
        status = open_codec(w);
    if (status == OK)
        status = open_stream(w);
    if (status == OK)
        status = open_images(w);
    if (status != OK)
        return video_close(&w, status);
    *out = w;
    return OK;
}

// Hands a frame to the encoder, NULL: the end, and writes what it gives.
static enum status encode_frame(struct video_writer *writer, const AVFrame *frame)
{
    int error = ffmpeg->avcodec_send_frame(writer->codec, frame);
    while (error >= 0) {
        error = ffmpeg->avcodec_receive_packet(writer->codec, writer->packet);
        if (error == AVERROR(EAGAIN) || error == AVERROR_EOF)
            return OK;
        if (error < 0)
            break;
        // For the last image, which no other one ends.
        writer->packet->duration = writer->step_ticks ? writer->step_ticks : writer->codec->time_base.den / 30;
        ffmpeg->av_packet_rescale_ts(writer->packet, writer->codec->time_base, writer->stream->time_base);
        writer->packet->stream_index = writer->stream->index;
        error = ffmpeg->av_interleaved_write_frame(writer->format, writer->packet);
    }
    return fail_encoding(writer, "images", error);
}

enum status video_add(struct video_writer *writer, const uint8_t *rgb, int64_t time_ns)
{
    const uint8_t *const rows[1] = {rgb};
    const int stride[1] = {writer->row_bytes};
    if (writer->last_ticks < 0)
        writer->first_ns = time_ns;
    const int64_t ticks = ffmpeg->av_rescale(time_ns - writer->first_ns, writer->codec->time_base.den, 1000000000);
    if (ticks <= writer->last_ticks)
        return fail(ERR_ORDER, "two images of a film have the same time");
    if (writer->last_ticks >= 0 && ticks - writer->last_ticks > INT32_MAX)
        return fail(
            ERR_INPUT,
            "two pictures that follow each other are %.1f hours apart, more than a film can say: the take's times "
            "are wrong",
            (double)(ticks - writer->last_ticks) / writer->codec->time_base.den / 3600);
    if (ffmpeg->av_frame_make_writable(writer->frame) < 0)
        return fail(ERR_MEMORY, "no memory for a film");
    ffmpeg->sws_scale(writer->convert, rows, stride, 0, writer->layout.height, writer->frame->data,
                      writer->frame->linesize);
    if (writer->last_ticks >= 0 && (!writer->step_ticks || ticks - writer->last_ticks < writer->step_ticks))
        writer->step_ticks = ticks - writer->last_ticks;
    writer->frame->pts = writer->last_ticks = ticks;
    return encode_frame(writer, writer->frame);
}

enum status video_close(struct video_writer **out, enum status status)
{
    struct video_writer *w = *out;
    if (!w)
        return status;
    *out = NULL;
    if (status == OK)
        status = encode_frame(w, NULL);
    if (w->begun) {
        const int error = ffmpeg->av_write_trailer(w->format); // also after an error: it frees what the muxer holds
        if (error < 0 && status == OK)
            status = fail_encoding(w, "end", error);
    }
    struct failure first;
    failure_keep(&first, status);
    ffmpeg->sws_freeContext(w->convert);
    ffmpeg->av_frame_free(&w->frame);
    ffmpeg->av_packet_free(&w->packet);
    ffmpeg->avcodec_free_context(&w->codec);
    ffmpeg->avformat_free_context(w->format);
    if (w->io)
        ffmpeg->av_freep(&w->io->buffer);
    ffmpeg->avio_context_free(&w->io);
    free(w);
    return failure_restore(&first);
}

#else
enum status video_open(struct video_writer **w, FILE *out, const struct video_layout *layout)
{
    (void)out;
    (void)layout;
    *w = NULL;
    return fail(ERR_INPUT, "this program was built without FFmpeg's libraries, so it writes no films");
}

enum status video_add(struct video_writer *w, const uint8_t *rgb, int64_t time_ns)
{
    (void)w;
    (void)rgb;
    (void)time_ns;
    assert(!"video_open gave no writer");
    return ERR_INPUT;
}

enum status video_close(struct video_writer **w, enum status status)
{
    (void)w;
    return status;
}
#endif
