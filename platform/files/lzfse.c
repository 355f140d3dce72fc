#include "platform/files/lzfse.h"

#include <stdlib.h>
#include <string.h>

// Numbers of the format.
enum { L_SYMBOLS = 20, M_SYMBOLS = 20, D_SYMBOLS = 64, LITERAL_SYMBOLS = 256 };
enum { ALL_SYMBOLS = L_SYMBOLS + M_SYMBOLS + D_SYMBOLS + LITERAL_SYMBOLS };
enum { L_STATES = 64, M_STATES = 64, D_STATES = 256, LITERAL_STATES = 1024 };
enum { MATCHES_MAX = 10000, LITERALS_MAX = 4 * MATCHES_MAX, LITERAL_STREAMS = 4 };
enum { MARK_BYTES = 4, BLOCK_BYTES = 8, LZVN_HEADER_BYTES = 12, V2_HEADER_BYTES = 32, LZVN_END_BYTES = 8 };

// A number is the base of its symbol, and so many bits are added to it.
struct symbol_value {
    uint8_t bits;
    int32_t base;
};

static const struct symbol_value l_values[L_SYMBOLS] = {{0, 0},  {0, 1},  {0, 2},  {0, 3},  {0, 4},  {0, 5},  {0, 6},
                                                        {0, 7},  {0, 8},  {0, 9},  {0, 10}, {0, 11}, {0, 12}, {0, 13},
                                                        {0, 14}, {0, 15}, {2, 16}, {3, 20}, {5, 28}, {8, 60}};
static const struct symbol_value m_values[M_SYMBOLS] = {{0, 0},  {0, 1},  {0, 2},  {0, 3},  {0, 4},  {0, 5},   {0, 6},
                                                        {0, 7},  {0, 8},  {0, 9},  {0, 10}, {0, 11}, {0, 12},  {0, 13},
                                                        {0, 14}, {0, 15}, {3, 16}, {5, 24}, {8, 56}, {11, 312}};

// A state of a decoder: the symbol, as what it stands for; how many bits are read, and what is added to them for the
// next state.
struct state_entry {
    uint8_t bits;
    struct symbol_value value;
    int16_t next;
};

// A block's decoder, and its literals.
struct block {
    uint32_t raw, literals, literal_bytes, matches, match_bytes;
    int literal_spare, match_spare; // unused bits at the streams' ends, 0 to 7
    uint32_t literal_state[LITERAL_STREAMS], l_state, m_state, d_state;
    struct state_entry l[L_STATES], m[M_STATES], d[D_STATES], literal[LITERAL_STATES];
    uint8_t text[LITERALS_MAX + LITERAL_STREAMS];
};

struct output {
    uint8_t *begin, *at, *end;
};

static enum status damaged(void) { return fail(ERR_CORRUPT, "its LZFSE data is damaged"); }

static uint32_t number_at(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static uint64_t long_at(const uint8_t *at) { return number_at(at) | (uint64_t)number_at(at + 4) << 32; }

static uint32_t field_of(uint64_t from, int at, int bits) { return (uint32_t)(from >> at & ((1ull << bits) - 1)); }

// ---------------------------------------------------------------- output

static bool put_bytes(struct output *output, const uint8_t *bytes, size_t count)
{
    if (count > (size_t)(output->end - output->at))
        return false;
    memcpy(output->at, bytes, count);
    output->at += count;
    return true;
}

// The copy may overlap itself: then what was just written is repeated.
static bool put_match(struct output *output, size_t distance, size_t count)
{
    if (!count)
        return true;
    if (!distance || distance > (size_t)(output->at - output->begin) || count > (size_t)(output->end - output->at))
        return false;
    const uint8_t *from = output->at - distance;
    for (size_t i = 0; i < count; i++)
        output->at[i] = from[i];
    output->at += count;
    return true;
}

// ---------------------------------------------------------------- bits

// A stream of bits that is read from its end.
struct bit_stream {
    const uint8_t *bytes;
    size_t count;
    size_t left; // bits
    bool broken; // more were read than there are
};

static struct bit_stream open_bits(const uint8_t *bytes, size_t count, int spare)
{
    const size_t bits = 8 * count;
    return (struct bit_stream){bytes, count, bits >= (size_t)spare ? bits - (size_t)spare : 0, bits < (size_t)spare};
}

static uint32_t pull_bits(struct bit_stream *stream, unsigned bits) // at most 25
{
    if (bits > stream->left) {
        stream->broken = true;
        return 0;
    }
    stream->left -= bits;
    const size_t first = stream->left / 8;
    uint32_t word = 0;
    if (first + 4 <= stream->count)
        word = number_at(stream->bytes + first);
    else
        for (size_t i = first; i < stream->count; i++)
            word |= (uint32_t)stream->bytes[i] << 8 * (i - first);
    return word >> stream->left % 8 & ((1u << bits) - 1);
}

// ---------------------------------------------------------------- finite state entropy

static int highest_bit(uint32_t number) // > 0
{
    int bit = 0;
    while (number >>= 1)
        bit++;
    return bit;
}

// The table of `count` symbols whose frequencies add up to at most `states`, a power of two. values NULL: each symbol
// stands for itself. False: they add up to more.
static bool fill_states(const uint16_t *frequency, int count, uint32_t states, const struct symbol_value *values,
                        struct state_entry *out)
{
    uint32_t filled = 0;
    for (int symbol = 0; symbol < count; symbol++) {
        const uint32_t own = frequency[symbol];
        if (!own)
            continue;
        if (own > states - filled)
            return false;
        const int bits = highest_bit(states) - highest_bit(own); // states <= own << bits < 2 states
        const uint32_t longer = (2 * states >> bits) - own;      // so many states read `bits`, the others one less
        const struct symbol_value value = values ? values[symbol] : (struct symbol_value){0, symbol};
        for (uint32_t i = 0; i < own; i++)
            out[filled++] =
                i < longer ? (struct state_entry){(uint8_t)bits, value, (int16_t)(((own + i) << bits) - states)}
                           : (struct state_entry){(uint8_t)(bits - 1), value, (int16_t)((i - longer) << (bits - 1))};
    }
    while (filled < states)
        out[filled++] = (struct state_entry){.bits = 0};
    return true;
}

// The number of the present state; goes on to the next state. The bits of both are read at once.
static int32_t pull_number(const struct state_entry *table, uint32_t *state, struct bit_stream *stream)
{
    const struct state_entry *entry = &table[*state];
    const uint32_t word = pull_bits(stream, (unsigned)entry->bits + entry->value.bits);
    *state = (uint32_t)(entry->next + (int32_t)(word >> entry->value.bits));
    return entry->value.base + (int32_t)(word & ((1u << entry->value.bits) - 1));
}

// ---------------------------------------------------------------- bvx2

// One frequency by the lowest bits of a word; *used: how many of them.
static uint16_t frequency_of(uint32_t word, int *used)
{
    static const struct {
        uint8_t bits, value;
    } codes[32] = {{2, 0}, {3, 2}, {2, 1}, {5, 4}, {2, 0},  {3, 3}, {2, 1}, {8, 0}, {2, 0}, {3, 2}, {2, 1},
                   {5, 5}, {2, 0}, {3, 3}, {2, 1}, {14, 0}, {2, 0}, {3, 2}, {2, 1}, {5, 6}, {2, 0}, {3, 3},
                   {2, 1}, {8, 0}, {2, 0}, {3, 2}, {2, 1},  {5, 7}, {2, 0}, {3, 3}, {2, 1}, {14, 0}};
    *used = codes[word & 31].bits;
    if (*used == 8)
        return (uint16_t)(8 + field_of(word, 4, 4));
    if (*used == 14)
        return (uint16_t)(24 + field_of(word, 4, 10));
    return codes[word & 31].value;
}

static bool read_frequencies(const uint8_t *at, const uint8_t *end, uint16_t out[ALL_SYMBOLS])
{
    uint32_t word = 0;
    int held = 0, used;
    memset(out, 0, ALL_SYMBOLS * sizeof *out);
    if (at == end)
        return true;
    for (int i = 0; i < ALL_SYMBOLS; i++) {
        for (; at < end && held <= 24; held += 8)
            word |= (uint32_t)*at++ << held;
        out[i] = frequency_of(word, &used);
        if (used > held)
            return false;
        word >>= used;
        held -= used;
    }
    return held < 8 && at == end;
}

// The header of `*size` bytes.
static bool read_header(const uint8_t *at, size_t left, struct block *block, size_t *size)
{
    uint16_t frequency[ALL_SYMBOLS];
    if (left < V2_HEADER_BYTES)
        return false;
    const uint64_t first = long_at(at + 8), second = long_at(at + 16), third = long_at(at + 24);
    block->raw = number_at(at + 4);
    block->literals = field_of(first, 0, 20);
    block->literal_bytes = field_of(first, 20, 20);
    block->matches = field_of(first, 40, 20);
    block->literal_spare = 7 - (int)field_of(first, 60, 3);
    for (int i = 0; i < LITERAL_STREAMS; i++)
        block->literal_state[i] = field_of(second, 10 * i, 10);
    block->match_bytes = field_of(second, 40, 20);
    block->match_spare = 7 - (int)field_of(second, 60, 3);
    *size = (uint32_t)third;
    block->l_state = field_of(third, 32, 10);
    block->m_state = field_of(third, 42, 10);
    block->d_state = field_of(third, 52, 10);
    if (*size < V2_HEADER_BYTES || *size > left || block->literals > LITERALS_MAX || block->matches > MATCHES_MAX ||
        block->l_state >= L_STATES || block->m_state >= M_STATES || block->d_state >= D_STATES ||
        !read_frequencies(at + V2_HEADER_BYTES, at + *size, frequency))
        return false;
    struct symbol_value d_values[D_SYMBOLS];
    for (int i = 0; i < D_SYMBOLS; i++) // each four take one bit more than the four before
        d_values[i] = (struct symbol_value){(uint8_t)(i / 4), (1 << i / 4) * (4 + i % 4) - 4};
    return fill_states(frequency, L_SYMBOLS, L_STATES, l_values, block->l) &&
           fill_states(frequency + L_SYMBOLS, M_SYMBOLS, M_STATES, m_values, block->m) &&
           fill_states(frequency + L_SYMBOLS + M_SYMBOLS, D_SYMBOLS, D_STATES, d_values, block->d) &&
           fill_states(frequency + L_SYMBOLS + M_SYMBOLS + D_SYMBOLS, LITERAL_SYMBOLS, LITERAL_STATES, NULL,
                       block->literal);
}

static bool read_literals(struct block *block, const uint8_t *bytes)
{
    struct bit_stream stream = open_bits(bytes, block->literal_bytes, block->literal_spare);
    for (uint32_t i = 0; i < block->literals; i += LITERAL_STREAMS)
        for (int k = 0; k < LITERAL_STREAMS; k++)
            block->text[i + (uint32_t)k] = (uint8_t)pull_number(block->literal, &block->literal_state[k], &stream);
    return !stream.broken;
}

static bool read_matches(struct block *block, const uint8_t *bytes, struct output *output)
{
    struct bit_stream stream = open_bits(bytes, block->match_bytes, block->match_spare);
    size_t used = 0, distance = 0;
    for (uint32_t i = 0; i < block->matches; i++) {
        const size_t literals = (size_t)pull_number(block->l, &block->l_state, &stream);
        const size_t length = (size_t)pull_number(block->m, &block->m_state, &stream);
        const size_t other = (size_t)pull_number(block->d, &block->d_state, &stream);
        distance = other ? other : distance;
        if (stream.broken || literals > block->literals - used || !put_bytes(output, block->text + used, literals) ||
            !put_match(output, distance, length))
            return false;
        used += literals;
    }
    return true;
}

// *at: behind the block.
static bool read_entropy_block(const uint8_t **at, const uint8_t *end, struct block *block, struct output *output)
{
    size_t header;
    if (!read_header(*at, (size_t)(end - *at), block, &header))
        return false;
    const uint8_t *literals = *at + header, *const before = output->at;
    if (block->literal_bytes + (size_t)block->match_bytes > (size_t)(end - literals))
        return false;
    *at = literals + block->literal_bytes + block->match_bytes;
    return read_literals(block, literals) && read_matches(block, literals + block->literal_bytes, output) &&
           (size_t)(output->at - before) == block->raw;
}

// ---------------------------------------------------------------- bvxn

// What one operation does: literals that follow its `size` bytes, then a match.
struct lzvn_operation {
    size_t size, literals, length, distance;
};

// Decodes the operation at `at`, of which `left` bytes (at least one) are there. False: none that is defined.
static bool lzvn_operation_at(const uint8_t *at, size_t left, size_t distance, struct lzvn_operation *out)
{
    const unsigned code = at[0], low = code & 7;
    const bool small = code < 0x70 || (code >= 0x80 && code < 0xa0) || (code >= 0xc0 && code < 0xd0);
    const size_t second = left > 1 ? at[1] : 0, third = left > 2 ? at[2] : 0;
    *out = (struct lzvn_operation){.size = 1, .distance = distance};
    if (code >= 0xf0) { // a match at the distance of the one before
        out->length = code & 15 ? code & 15 : second + 16;
        out->size = code & 15 ? 1 : 2;
    } else if (code >= 0xe0) { // literals
        out->literals = code & 15 ? code & 15 : second + 16;
        out->size = code & 15 ? 1 : 2;
    } else if (code >= 0xa0 && code < 0xc0) { // 101LLMMM DDDDDDMM DDDDDDDD
        *out = (struct lzvn_operation){3, code >> 3 & 3, (low << 2 | (second & 3)) + 3, second >> 2 | third << 6};
    } else if (small && low == 7) { // LLMMM111 and 16 bits of distance
        *out = (struct lzvn_operation){3, code >> 6, (code >> 3 & 7) + 3, second | third << 8};
    } else if (small && low < 6) { // LLMMMDDD DDDDDDDD
        *out = (struct lzvn_operation){2, code >> 6, (code >> 3 & 7) + 3, (size_t)low << 8 | second};
    } else if (small && code >= 0x40) { // LLMMM110: the distance before
        *out = (struct lzvn_operation){1, code >> 6, (code >> 3 & 7) + 3, distance};
    } else if (code != 0x0e && code != 0x16) { // those two do nothing
        return false;
    }
    return true;
}

static bool read_lzvn_block(const uint8_t **at, const uint8_t *end, struct output *output)
{
    if (end - *at < LZVN_HEADER_BYTES)
        return false;
    const size_t raw = number_at(*at + 4), count = number_at(*at + 8);
    const uint8_t *from = *at + LZVN_HEADER_BYTES, *const before = output->at;
    if (count > (size_t)(end - from))
        return false;
    const uint8_t *const last = *at = from + count;
    size_t distance = 0;
    while (from < last && *from != 0x06) {
        struct lzvn_operation operation;
        if (!lzvn_operation_at(from, (size_t)(last - from), distance, &operation) ||
            operation.size + operation.literals > (size_t)(last - from) ||
            !put_bytes(output, from + operation.size, operation.literals) ||
            !put_match(output, operation.distance, operation.length))
            return false;
        from += operation.size + operation.literals;
        distance = operation.distance;
    }
    return last - from >= LZVN_END_BYTES && (size_t)(output->at - before) == raw;
}

// ---------------------------------------------------------------- stream

static bool read_plain_block(const uint8_t **at, const uint8_t *end, struct output *output)
{
    if (end - *at < BLOCK_BYTES)
        return false;
    const size_t raw = number_at(*at + MARK_BYTES);
    const uint8_t *from = *at + BLOCK_BYTES;
    if (raw > (size_t)(end - from))
        return false;
    *at = from + raw;
    return put_bytes(output, from, raw);
}

static bool is_mark(const uint8_t *at, const char *mark) { return !memcmp(at, mark, MARK_BYTES); }

enum status lzfse_decode(const uint8_t *bytes, size_t count, uint8_t *out, size_t out_count)
{
    const uint8_t *at = bytes, *const end = bytes + count;
    struct output output = {out, out, out + out_count};
    struct block *block = malloc(sizeof *block);
    if (!block)
        return fail(ERR_MEMORY, "no memory to unpack LZFSE data");
    bool sound = true;
    while (sound && (sound = end - at >= MARK_BYTES) && !is_mark(at, "bvx$")) {
        if (is_mark(at, "bvx2"))
            sound = read_entropy_block(&at, end, block, &output);
        else if (is_mark(at, "bvxn"))
            sound = read_lzvn_block(&at, end, &output);
        else
            sound = is_mark(at, "bvx-") && read_plain_block(&at, end, &output);
    }
    free(block);
    if (sound && output.at != output.end)
        return fail(ERR_CORRUPT, "its LZFSE data holds %zu bytes instead of %zu", (size_t)(output.at - out), out_count);
    return sound ? OK : damaged();
}

size_t lzfse_first_size(const uint8_t *bytes, size_t count)
{
    if (count < BLOCK_BYTES || (!is_mark(bytes, "bvx2") && !is_mark(bytes, "bvxn") && !is_mark(bytes, "bvx-")))
        return 0;
    return number_at(bytes + MARK_BYTES);
}
