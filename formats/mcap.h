// Writes MCAP, the log format of robotics (specification at mcap.dev, version 0): channels of messages with their
// times, in zstd chunks of about a megabyte with an index after each, then a summary with statistics and chunk indexes;
// all checksums are there. A stream is written once from beginning to end. One handle, one thread.
#pragma once
#include "base/status.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct mcap_writer;

// Of JSON messages. The texts are borrowed and must outlive the writer.
struct mcap_channel {
    const char *topic;
    const char *schema_name; // a name that readers know, such as foxglove.CompressedImage
    const char *schema;      // JSON Schema
};

// `out` must outlive the writer; it need not be seekable. Channels are numbered as they are given. ERR_MEMORY; *w is
// then NULL.
enum { MCAP_CHANNELS_MAX = 16 };
MUST_CHECK enum status mcap_open(struct mcap_writer **w, FILE *out, const struct mcap_channel *channels, int count);

// One message. time_ns >= 0, in any order, though a reader is quicker where it rises. ERR_MEMORY.
MUST_CHECK enum status mcap_add(struct mcap_writer *writer, int channel, int64_t time_ns, const char *json,
                                size_t count);

// Writes what is left and the summary, unless `status` is an error, and frees. Returns the first error; of writing, in
// ferror(out). NULL is fine; sets *w = NULL.
enum status mcap_close(struct mcap_writer **w, enum status status);
