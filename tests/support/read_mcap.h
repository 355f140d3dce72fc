// Reads an MCAP file as its specification describes it (mcap.dev), and checks all that can be: magic, lengths,
// checksums, that every index points at what it says, statistics. It shares nothing with the writer but zstd's library.
#pragma once
#include <stddef.h>
#include <stdint.h>

enum { READ_MCAP_CHANNELS = 16 };

struct read_message {
    int channel;
    uint64_t time_ns;
    const char *data; // not ended by a zero
    size_t count;
};

struct read_mcap {
    int channels, chunks;
    char topic[READ_MCAP_CHANNELS][64], schema_name[READ_MCAP_CHANNELS][64];
    char *schema[READ_MCAP_CHANNELS]; // zero-ended
    struct read_message *messages;
    int count;
    uint8_t **unpacked; // [chunks]
};

void read_mcap(const uint8_t *bytes, size_t count, struct read_mcap *out);
void read_mcap_free(struct read_mcap *file);
