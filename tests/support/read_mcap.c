#include "tests/support/test.h"

#include "tests/support/read_mcap.h"

#include "platform/files/compress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// A part of the file, read from its beginning on.
struct reader {
    const uint8_t *at, *end;
};

static uint64_t take(struct reader *reader, int bytes)
{
    uint64_t value = 0;
    EXPECT_TRUE(reader->end - reader->at >= bytes);
    for (int k = 0; k < bytes; k++)
        value |= (uint64_t)*reader->at++ << 8 * k;
    return value;
}

static struct reader take_part(struct reader *reader, uint64_t count)
{
    EXPECT_TRUE((uint64_t)(reader->end - reader->at) >= count);
    const struct reader part = {reader->at, reader->at + count};
    reader->at += count;
    return part;
}

static void take_string(struct reader *reader, char *out, size_t bytes)
{
    const struct reader part = take_part(reader, take(reader, 4));
    snprintf(out, bytes, "%.*s", (int)(part.end - part.at), (const char *)part.at);
}

// Bit by bit, as the polynomial says it.
static uint32_t checksum(const uint8_t *at, size_t count)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < count; i++) {
        crc ^= at[i];
        for (int k = 0; k < 8; k++)
            crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
    }
    return ~crc;
}

// The next record's opcode, and its content.
static int take_record(struct reader *reader, struct reader *content)
{
    const int opcode = (int)take(reader, 1);
    *content = take_part(reader, take(reader, 8));
    return opcode;
}

static void read_schema(struct reader *content, struct read_mcap *out)
{
    const int id = (int)take(content, 2) - 1;
    char encoding[32], name[64];
    EXPECT_TRUE(id >= 0 && id < READ_MCAP_CHANNELS);
    take_string(content, name, sizeof name);
    take_string(content, encoding, sizeof encoding);
    assert_string_equal(encoding, "jsonschema");
    const struct reader text = take_part(content, take(content, 4));
    if (out->schema[id]) { // the summary says the same again
        assert_string_equal(name, out->schema_name[id]);
        assert_memory_equal(out->schema[id], text.at, (size_t)(text.end - text.at));
        return;
    }
    strcpy(out->schema_name[id], name);
    out->schema[id] = strndup((const char *)text.at, (size_t)(text.end - text.at));
}

static void read_channel(struct reader *content, struct read_mcap *out)
{
    const int id = (int)take(content, 2);
    char encoding[32];
    EXPECT_TRUE(id >= 0 && id < READ_MCAP_CHANNELS);
    EXPECT_INT(take(content, 2), id + 1);
    take_string(content, out->topic[id], sizeof out->topic[id]);
    take_string(content, encoding, sizeof encoding);
    assert_string_equal(encoding, "json");
    EXPECT_INT(take(content, 4), 0);
    out->channels = id + 1 > out->channels ? id + 1 : out->channels;
}

// A chunk and the message indexes that must follow it.
static void read_chunk(struct reader *content, struct reader *rest, struct read_mcap *out)
{
    const uint64_t first_ns = take(content, 8), last_ns = take(content, 8), bytes = take(content, 8);
    const uint32_t crc = (uint32_t)take(content, 4);
    char compression[8];
    take_string(content, compression, sizeof compression);
    assert_string_equal(compression, "zstd");
    const struct reader packed = take_part(content, take(content, 8));
    struct compressor *compressor;
    uint8_t *unpacked = malloc(bytes);
    EXPECT_STATUS(compressor_open(&compressor), OK);
    EXPECT_STATUS(decompress_bytes(compressor, packed.at, (size_t)(packed.end - packed.at), unpacked, bytes), OK);
    compressor_close(&compressor);
    EXPECT_INT(checksum(unpacked, bytes), crc);
    out->unpacked = realloc(out->unpacked, sizeof *out->unpacked * (size_t)(out->chunks + 1));
    out->unpacked[out->chunks++] = unpacked;
    const int before = out->count;
    for (struct reader inner = {unpacked, unpacked + bytes}; inner.at < inner.end;) {
        struct reader message;
        EXPECT_INT(take_record(&inner, &message), 5);
        out->messages = realloc(out->messages, sizeof *out->messages * (size_t)(out->count + 1));
        struct read_message *m = &out->messages[out->count++];
        m->channel = (int)take(&message, 2);
        take(&message, 4);
        m->time_ns = take(&message, 8);
        EXPECT_INT(take(&message, 8), m->time_ns);
        m->data = (const char *)message.at;
        m->count = (size_t)(message.end - message.at);
        EXPECT_TRUE(m->channel < out->channels && m->time_ns >= first_ns && m->time_ns <= last_ns);
    }
    int indexed = 0;
    while (*rest->at == 7) {
        struct reader index;
        take_record(rest, &index);
        const int channel = (int)take(&index, 2);
        EXPECT_INT(take(&index, 4), index.end - index.at);
        for (; index.at < index.end; indexed++) {
            const uint64_t time_ns = take(&index, 8), offset = take(&index, 8);
            struct reader at = {unpacked + offset, unpacked + bytes}, message;
            EXPECT_INT(take_record(&at, &message), 5);
            EXPECT_INT(take(&message, 2), channel);
            take(&message, 4);
            EXPECT_INT(take(&message, 8), time_ns);
        }
    }
    EXPECT_INT(indexed, out->count - before);
}

static void check_statistics(struct reader *content, const struct read_mcap *file)
{
    uint64_t first_ns = file->count ? file->messages[0].time_ns : 0, last_ns = first_ns;
    for (int i = 0; i < file->count; i++) {
        first_ns = file->messages[i].time_ns < first_ns ? file->messages[i].time_ns : first_ns;
        last_ns = file->messages[i].time_ns > last_ns ? file->messages[i].time_ns : last_ns;
    }
    EXPECT_INT(take(content, 8), file->count);
    EXPECT_INT(take(content, 2), file->channels);
    EXPECT_INT(take(content, 4), file->channels);
    EXPECT_INT(take(content, 8), 0); // attachments, metadata
    EXPECT_INT(take(content, 4), file->chunks);
    EXPECT_INT(take(content, 8), first_ns);
    EXPECT_INT(take(content, 8), last_ns);
    EXPECT_INT(take(content, 4), 10 * file->channels);
    for (int c = 0; c < file->channels; c++) {
        int count = 0;
        for (int i = 0; i < file->count; i++)
            count += file->messages[i].channel == c;
        EXPECT_INT(take(content, 2), c);
        EXPECT_INT(take(content, 8), count);
    }
}

// A chunk index: where the chunk is, and each of its message indexes.
static void check_chunk_index(struct reader *content, const uint8_t *file, size_t count)
{
    take_part(content, 16);
    const uint64_t at = take(content, 8), length = take(content, 8);
    struct reader record = {file + at, file + count}, inner;
    EXPECT_INT(take_record(&record, &inner), 6);
    EXPECT_INT(record.at - (file + at), length);
    struct reader offsets = take_part(content, take(content, 4));
    uint64_t indexes = 0;
    while (offsets.at < offsets.end) {
        const uint64_t channel = take(&offsets, 2), index_at = take(&offsets, 8);
        struct reader index = {file + index_at, file + count}, found;
        EXPECT_INT(take_record(&index, &found), 7);
        EXPECT_INT(take(&found, 2), channel);
        indexes += (uint64_t)(index.at - (file + index_at));
    }
    EXPECT_INT(take(content, 8), indexes);
}

// The records from summary_at on, each group where the summary offsets say.
static void check_summary(const uint8_t *bytes, size_t count, uint64_t summary_at, uint64_t offsets_at,
                          struct read_mcap *out)
{
    struct reader summary = {bytes + summary_at, bytes + offsets_at}, offsets = {bytes + offsets_at, bytes + count};
    int statistics = 0, chunk_indexes = 0;
    while (summary.at < summary.end) {
        struct reader content;
        switch (take_record(&summary, &content)) {
        case 3: read_schema(&content, out); break;
        case 4: read_channel(&content, out); break;
        case 8:
            check_chunk_index(&content, bytes, count);
            chunk_indexes++;
            break;
        case 11:
            check_statistics(&content, out);
            statistics++;
            break;
        default: EXPECT_TRUE(!"a record of the summary");
        }
    }
    EXPECT_INT(statistics, 1);
    EXPECT_INT(chunk_indexes, out->chunks);
    uint64_t next = summary_at;
    while (*offsets.at == 14) {
        struct reader content, group;
        take_record(&offsets, &content);
        const uint64_t opcode = take(&content, 1), from = take(&content, 8), length = take(&content, 8);
        EXPECT_INT(from, next);
        for (group = (struct reader){bytes + from, bytes + from + length}; group.at < group.end;)
            EXPECT_INT(take_record(&group, &content), opcode);
        next += length;
    }
    EXPECT_INT(next, offsets_at);
}

void read_mcap(const uint8_t *bytes, size_t count, struct read_mcap *out)
{
    static const uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};
    enum { FOOTER = 9 + 20 };
    *out = (struct read_mcap){.channels = 0};
    EXPECT_TRUE(count > 2 * sizeof magic + FOOTER);
    assert_memory_equal(bytes, magic, sizeof magic);
    assert_memory_equal(bytes + count - sizeof magic, magic, sizeof magic);
    struct reader rest = {bytes + sizeof magic, bytes + count - sizeof magic}, content;
    EXPECT_INT(take_record(&rest, &content), 1);
    const uint8_t *record = rest.at;
    for (int opcode; (opcode = take_record(&rest, &content)) != 15; record = rest.at)
        switch (opcode) {
        case 3: read_schema(&content, out); break;
        case 4: read_channel(&content, out); break;
        case 6: read_chunk(&content, &rest, out); break;
        default: EXPECT_TRUE(!"a record of the data");
        }
    EXPECT_INT(take(&content, 4), checksum(bytes, (size_t)(record - bytes)));
    const uint8_t *summary = rest.at, *footer = bytes + count - sizeof magic - FOOTER;
    struct reader last = {footer, bytes + count - sizeof magic};
    EXPECT_INT(take_record(&last, &content), 2);
    EXPECT_INT(take(&content, 8), summary - bytes);
    const uint64_t offsets_at = take(&content, 8);
    EXPECT_INT(take(&content, 4), checksum(summary, (size_t)(footer + 9 + 16 - summary)));
    check_summary(bytes, count, (uint64_t)(summary - bytes), offsets_at, out);
}

void read_mcap_free(struct read_mcap *file)
{
    for (int c = 0; c < READ_MCAP_CHANNELS; c++)
        free(file->schema[c]);
    for (int i = 0; i < file->chunks; i++)
        free(file->unpacked[i]);
    free(file->unpacked);
    free(file->messages);
    *file = (struct read_mcap){.channels = 0};
}
