#include "formats/mcap.h"

#include "platform/files/compress.h"
#include "recording/little_endian.h"

#include <stdlib.h>
#include <string.h>

enum opcode {
    OP_HEADER = 1,
    OP_FOOTER,
    OP_SCHEMA,
    OP_CHANNEL,
    OP_MESSAGE,
    OP_CHUNK,
    OP_MESSAGE_INDEX,
    OP_CHUNK_INDEX,
    OP_STATISTICS = 11,
    OP_SUMMARY_OFFSET = 14,
    OP_DATA_END
};

static const uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
static const char compression[] = "zstd";

enum { CHUNK_BYTES = 1 << 20, LEVEL = 3, RECORD_HEAD = 9 };

// ---------------------------------------------------------------- bytes

struct byte_list {
    uint8_t *at;
    size_t count, capacity;
    bool failed; // no memory: nothing more is added
};

static uint8_t *extend(struct byte_list *list, size_t more)
{
    if (list->count + more > list->capacity) {
        const size_t capacity = 2 * (list->count + more) + 256;
        uint8_t *at = list->failed ? NULL : realloc(list->at, capacity);
        list->failed = !at;
        if (!at)
            return NULL;
        list->at = at;
        list->capacity = capacity;
    }
    list->count += more;
    return list->at + list->count - more;
}

static void add_bytes(struct byte_list *list, const void *bytes, size_t count)
{
    uint8_t *at = extend(list, count);
    if (at && count)
        memcpy(at, bytes, count);
}

static void add_u8(struct byte_list *list, int value) { add_bytes(list, &(uint8_t){(uint8_t)value}, 1); }

static void add_u16(struct byte_list *list, int value)
{
    uint8_t bytes[2];
    put_u16(bytes, (uint16_t)value);
    add_bytes(list, bytes, sizeof bytes);
}

static void add_u32(struct byte_list *list, size_t value)
{
    uint8_t bytes[4];
    put_u32(bytes, (uint32_t)value);
    add_bytes(list, bytes, sizeof bytes);
}

static void add_u64(struct byte_list *list, uint64_t value)
{
    uint8_t bytes[8];
    put_u64(bytes, value);
    add_bytes(list, bytes, sizeof bytes);
}

static void add_string(struct byte_list *list, const char *text)
{
    add_u32(list, strlen(text));
    add_bytes(list, text, strlen(text));
}

// A record's opcode and length, which end_record fills in. Returns where it begins.
static size_t begin_record(struct byte_list *list, enum opcode opcode)
{
    const size_t begin = list->count;
    add_u8(list, opcode);
    add_u64(list, 0);
    return begin;
}

static void end_record(struct byte_list *list, size_t begin)
{
    if (!list->failed)
        put_u64(list->at + begin + 1, list->count - begin - RECORD_HEAD);
}

// ---------------------------------------------------------------- the writer

struct channel_state {
    struct byte_list index; // of the open chunk: time and offset of each message
    uint64_t messages;      // in the file
    uint32_t sequence;
};

struct time_span {
    uint64_t first_ns, last_ns;
    bool any;
};

struct mcap_writer {
    FILE *out;
    struct compressor *compressor;
    uint64_t offset; // of what is written next
    uint32_t crc;    // of all that is written; of the summary from its beginning on
    int channel_count;
    struct mcap_channel channels[MCAP_CHANNELS_MAX];
    struct channel_state states[MCAP_CHANNELS_MAX];
    struct byte_list chunk, chunk_indexes, scratch;
    uint64_t chunks;
    struct time_span chunk_span, span;
};

static void span_add(struct time_span *span, uint64_t time_ns)
{
    span->first_ns = span->any && span->first_ns < time_ns ? span->first_ns : time_ns;
    span->last_ns = span->any && span->last_ns > time_ns ? span->last_ns : time_ns;
    span->any = true;
}

static void write_bytes(struct mcap_writer *writer, const void *bytes, size_t count)
{
    fwrite(bytes, 1, count, writer->out);
    writer->crc = crc32_of(writer->crc, bytes, count);
    writer->offset += count;
}

// Writes the scratch bytes and empties them.
static enum status write_scratch(struct mcap_writer *writer)
{
    if (writer->scratch.failed)
        return fail(ERR_MEMORY, "no memory for an MCAP file");
    write_bytes(writer, writer->scratch.at, writer->scratch.count);
    writer->scratch.count = 0;
    return OK;
}

static void add_schemas(struct mcap_writer *writer)
{
    for (int c = 0; c < writer->channel_count; c++) {
        const size_t begin = begin_record(&writer->scratch, OP_SCHEMA);
        add_u16(&writer->scratch, c + 1); // 0 is "no schema"
        add_string(&writer->scratch, writer->channels[c].schema_name);
        add_string(&writer->scratch, "jsonschema");
        add_string(&writer->scratch, writer->channels[c].schema);
        end_record(&writer->scratch, begin);
    }
}

static void add_channels(struct mcap_writer *writer)
{
    for (int c = 0; c < writer->channel_count; c++) {
        const size_t begin = begin_record(&writer->scratch, OP_CHANNEL);
        add_u16(&writer->scratch, c);
        add_u16(&writer->scratch, c + 1);
        add_string(&writer->scratch, writer->channels[c].topic);
        add_string(&writer->scratch, "json");
        add_u32(&writer->scratch, 0); // no metadata
        end_record(&writer->scratch, begin);
    }
}

static enum status write_head(struct mcap_writer *writer)
{
    add_bytes(&writer->scratch, magic, sizeof magic);
    const size_t begin = begin_record(&writer->scratch, OP_HEADER);
    add_string(&writer->scratch, ""); // no profile
    add_string(&writer->scratch, "reenact");
    end_record(&writer->scratch, begin);
    add_schemas(writer);
    add_channels(writer);
    return write_scratch(writer);
}

enum status mcap_open(struct mcap_writer **w, FILE *out, const struct mcap_channel *channels, int count)
{
    assert(count >= 0 && count <= MCAP_CHANNELS_MAX);
    struct mcap_writer *writer = *w = calloc(1, sizeof *writer);
    if (!writer)
        return fail(ERR_MEMORY, "no memory for an MCAP file");
    writer->out = out;
    writer->channel_count = count;
    for (int c = 0; c < count; c++)
        writer->channels[c] = channels[c];
    enum status status = compressor_open(&writer->compressor);
    if (status == OK)
        status = write_head(writer);
    return status == OK ? OK : mcap_close(w, status);
}

// ---------------------------------------------------------------- chunks

// The chunk record itself; *packed_bytes: of its records.
static enum status write_chunk_record(struct mcap_writer *writer, size_t *packed_bytes)
{
    struct byte_list *s = &writer->scratch;
    const size_t begin = begin_record(s, OP_CHUNK);
    add_u64(s, writer->chunk_span.first_ns);
    add_u64(s, writer->chunk_span.last_ns);
    add_u64(s, writer->chunk.count);
    add_u32(s, crc32_of(0, writer->chunk.at, writer->chunk.count));
    add_string(s, compression);
    const size_t length_at = s->count;
    add_u64(s, 0);
    const size_t bound = compress_bound(writer->chunk.count);
    uint8_t *packed = extend(s, bound);
    enum status status = packed ? OK : fail(ERR_MEMORY, "no memory for an MCAP file");
    if (status == OK)
        status = compress_bytes(writer->compressor, LEVEL, writer->chunk.at, writer->chunk.count, packed, packed_bytes);
    if (status != OK)
        return status;
    s->count -= bound - *packed_bytes;
    put_u64(s->at + length_at, *packed_bytes);
    end_record(s, begin);
    return write_scratch(writer);
}

// The index of each channel that has messages in the chunk; where these are is added to `offsets`.
static enum status write_message_indexes(struct mcap_writer *writer, struct byte_list *offsets)
{
    enum status status = OK;
    for (int c = 0; c < writer->channel_count && status == OK; c++) {
        struct byte_list *index = &writer->states[c].index;
        if (index->failed)
            return fail(ERR_MEMORY, "no memory for an MCAP file");
        if (!index->count)
            continue;
        add_u16(offsets, c);
        add_u64(offsets, writer->offset);
        const size_t begin = begin_record(&writer->scratch, OP_MESSAGE_INDEX);
        add_u16(&writer->scratch, c);
        add_u32(&writer->scratch, index->count);
        add_bytes(&writer->scratch, index->at, index->count);
        end_record(&writer->scratch, begin);
        index->count = 0;
        status = write_scratch(writer);
    }
    return status;
}

static enum status write_chunk(struct mcap_writer *writer)
{
    if (writer->chunk.failed)
        return fail(ERR_MEMORY, "no memory for an MCAP file");
    if (!writer->chunk.count)
        return OK;
    struct byte_list offsets = {0}, *indexes = &writer->chunk_indexes;
    const uint64_t chunk_at = writer->offset;
    size_t packed_bytes = 0;
    enum status status = write_chunk_record(writer, &packed_bytes);
    const uint64_t indexes_at = writer->offset;
    if (status == OK)
        status = write_message_indexes(writer, &offsets);
    const size_t begin = begin_record(indexes, OP_CHUNK_INDEX);
    add_u64(indexes, writer->chunk_span.first_ns);
    add_u64(indexes, writer->chunk_span.last_ns);
    add_u64(indexes, chunk_at);
    add_u64(indexes, indexes_at - chunk_at);
    add_u32(indexes, offsets.count);
    add_bytes(indexes, offsets.at, offsets.count);
    add_u64(indexes, writer->offset - indexes_at);
    add_string(indexes, compression);
    add_u64(indexes, packed_bytes);
    add_u64(indexes, writer->chunk.count);
    end_record(indexes, begin);
    if (status == OK && (offsets.failed || indexes->failed))
        status = fail(ERR_MEMORY, "no memory for an MCAP file");
    free(offsets.at);
    writer->chunk.count = 0;
    writer->chunk_span = (struct time_span){0};
    writer->chunks++;
    return status;
}

enum status mcap_add(struct mcap_writer *writer, int channel, int64_t time_ns, const char *json, size_t count)
{
    assert(channel >= 0 && channel < writer->channel_count && time_ns >= 0);
    struct channel_state *state = &writer->states[channel];
    add_u64(&state->index, (uint64_t)time_ns);
    add_u64(&state->index, writer->chunk.count);
    const size_t begin = begin_record(&writer->chunk, OP_MESSAGE);
    add_u16(&writer->chunk, channel);
    add_u32(&writer->chunk, state->sequence++);
    add_u64(&writer->chunk, (uint64_t)time_ns); // when it was recorded, and when it was made
    add_u64(&writer->chunk, (uint64_t)time_ns);
    add_bytes(&writer->chunk, json, count);
    end_record(&writer->chunk, begin);
    state->messages++;
    span_add(&writer->chunk_span, (uint64_t)time_ns);
    span_add(&writer->span, (uint64_t)time_ns);
    return writer->chunk.count >= CHUNK_BYTES || writer->chunk.failed ? write_chunk(writer) : OK;
}

// ---------------------------------------------------------------- the summary

static enum status write_data_end(struct mcap_writer *writer)
{
    const size_t begin = begin_record(&writer->scratch, OP_DATA_END);
    add_u32(&writer->scratch, writer->crc);
    end_record(&writer->scratch, begin);
    return write_scratch(writer);
}

static void add_statistics(struct mcap_writer *writer)
{
    struct byte_list *s = &writer->scratch;
    const size_t begin = begin_record(s, OP_STATISTICS);
    uint64_t messages = 0;
    for (int c = 0; c < writer->channel_count; c++)
        messages += writer->states[c].messages;
    add_u64(s, messages);
    add_u16(s, writer->channel_count);
    add_u32(s, (size_t)writer->channel_count);
    add_u32(s, 0); // attachments
    add_u32(s, 0); // metadata
    add_u32(s, (size_t)writer->chunks);
    add_u64(s, writer->span.first_ns);
    add_u64(s, writer->span.last_ns);
    add_u32(s, (size_t)writer->channel_count * 10);
    for (int c = 0; c < writer->channel_count; c++) {
        add_u16(s, c);
        add_u64(s, writer->states[c].messages);
    }
    end_record(s, begin);
}

// A group of the summary, and the record in `offsets` that says where it is.
static enum status write_group(struct mcap_writer *writer, enum opcode opcode, struct byte_list *offsets)
{
    const uint64_t from = writer->offset;
    const enum status status = write_scratch(writer);
    if (writer->offset == from)
        return status;
    const size_t begin = begin_record(offsets, OP_SUMMARY_OFFSET);
    add_u8(offsets, opcode);
    add_u64(offsets, from);
    add_u64(offsets, writer->offset - from);
    end_record(offsets, begin);
    return status;
}

static enum status write_footer(struct mcap_writer *writer, uint64_t summary_at, uint64_t offsets_at)
{
    struct byte_list *s = &writer->scratch;
    const size_t begin = begin_record(s, OP_FOOTER);
    add_u64(s, summary_at);
    add_u64(s, offsets_at);
    if (!s->failed) {
        put_u64(s->at + begin + 1, 20); // the checksum covers the record's head, too
        writer->crc = crc32_of(writer->crc, s->at, s->count);
    }
    add_u32(s, writer->crc);
    add_bytes(s, magic, sizeof magic);
    return write_scratch(writer);
}

static enum status write_summary(struct mcap_writer *writer)
{
    struct byte_list offsets = {0};
    enum status status = write_data_end(writer);
    const uint64_t summary_at = writer->offset;
    writer->crc = 0;
    add_schemas(writer);
    if (status == OK)
        status = write_group(writer, OP_SCHEMA, &offsets);
    add_channels(writer);
    if (status == OK)
        status = write_group(writer, OP_CHANNEL, &offsets);
    add_statistics(writer);
    if (status == OK)
        status = write_group(writer, OP_STATISTICS, &offsets);
    add_bytes(&writer->scratch, writer->chunk_indexes.at, writer->chunk_indexes.count);
    if (status == OK)
        status = write_group(writer, OP_CHUNK_INDEX, &offsets);
    const uint64_t offsets_at = writer->offset;
    if (status == OK && offsets.failed)
        status = fail(ERR_MEMORY, "no memory for an MCAP file");
    if (status == OK)
        write_bytes(writer, offsets.at, offsets.count);
    free(offsets.at);
    return status == OK ? write_footer(writer, summary_at, offsets_at) : status;
}

enum status mcap_close(struct mcap_writer **w, enum status status)
{
    struct mcap_writer *writer = *w;
    if (!writer)
        return status;
    if (status == OK)
        status = write_chunk(writer);
    if (status == OK)
        status = write_summary(writer);
    for (int c = 0; c < writer->channel_count; c++)
        free(writer->states[c].index.at);
    free(writer->chunk.at);
    free(writer->chunk_indexes.at);
    free(writer->scratch.at);
    compressor_close(&writer->compressor);
    free(writer);
    *w = NULL;
    return status;
}
