// FFmpeg's libraries, loaded when the first film is opened. They bring more than a hundred others, which every start of
// every program would have to wait for if they were linked (a third of the time before main). Only where the build
// found their headers (REENACT_FFMPEG).
#pragma once
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>

// The functions that are used, each by its own name and type.
// clang-format off
#define FFMPEG_FUNCTIONS(X)                                                                                            \
    X(av_dict_free) X(av_dict_get) X(av_dict_set) X(av_find_input_format) X(av_frame_alloc) X(av_frame_free)           \
    X(av_frame_get_buffer) X(av_frame_make_writable) X(av_free) X(av_freep) X(av_interleaved_write_frame)              \
    X(av_log_set_level) X(av_malloc) X(av_opt_set) X(av_packet_alloc) X(av_packet_free) X(av_packet_rescale_ts)        \
    X(av_packet_unref) X(av_read_frame) X(av_rescale) X(av_rescale_q) X(av_strerror) X(av_write_trailer)               \
    X(avcodec_alloc_context3) X(avcodec_find_decoder) X(avcodec_find_encoder) X(avcodec_free_context)                  \
    X(avcodec_open2) X(avcodec_parameters_from_context) X(avcodec_parameters_to_context) X(avcodec_receive_frame)      \
    X(avcodec_receive_packet) X(avcodec_send_frame) X(avcodec_send_packet) X(avformat_alloc_output_context2)           \
    X(avformat_close_input) X(avformat_free_context) X(avformat_new_stream) X(avformat_open_input)                     \
    X(avformat_write_header) X(avio_alloc_context) X(avio_context_free) X(sws_freeContext) X(sws_getContext)           \
    X(sws_scale)
// clang-format on

struct ffmpeg_library {
#define MEMBER(name) __typeof__(&name) name;
    FFMPEG_FUNCTIONS(MEMBER)
#undef MEMBER
};

// Of the version that the program was built for; any thread. It stays loaded. NULL: it is not installed.
const struct ffmpeg_library *ffmpeg_library(void);
