// Entropy coder of the depth codec: rANS (Duda 2013) with static symbol frequencies for each context; division by
// reciprocal multiplication after Giesen's ryg_rans. Two streams of numbers, of a state each, are coded in turn (Giesen
// 2014, "Interleaved entropy coders"), so that one's arithmetic goes on while the other's waits. Numbers are pushed
// with their context; rans_finish counts the frequencies and encodes in reverse order, so that decoding runs forwards.
// Decoding is safe on any bytes, if rans_start is told how much is read between two calls of rans_is_within. One coder,
// one thread; deterministic. Memory: at most 16 bytes a number, and 2.3 kB a context.
//
// A number 0..7 is its own symbol; above, the symbol holds the position of the highest bit and the bit after it, and
// the remaining bits follow in the state, all equally likely.
#pragma once
#include "base/status.h"

#include <string.h>

enum {
    RANS_STREAMS = 2,
    RANS_SYMBOLS = 64,      // the step between contexts in tables
    RANS_SYMBOLS_USED = 60, // of numbers < 2^29
    RANS_BITS = 12,         // the frequencies of a context sum to 1 << RANS_BITS
    RANS_SUM = 1 << RANS_BITS,
    RANS_LOW = 1 << 15,        // the state stays in [RANS_LOW, RANS_LOW << 16)
    RANS_PLAIN = 8,            // numbers below are symbols
    RANS_RAW_BITS = 8,         // so many of a number's remaining bits at once
    RANS_NUMBER_BYTES = 5 * 2, // that a number takes at most
    RANS_COARSE = 4,           // bits of a slot that the table of groups leaves out: it then fits the nearest cache
};

// A symbol's share of the slots of its context.
struct rans_share {
    uint16_t start, frequency;
};

struct rans_numbers {
    uint16_t *codes; // of each number: its context, times RANS_SYMBOLS, and symbol
    uint32_t *large; // in order the numbers from RANS_PLAIN on
    size_t count, large_count;
};

struct rans_reader {
    uint32_t state;
    const uint8_t *word, *end;
};

// Decoding: the slots of a group below `split` belong to the symbol `first`, the others to the one after it. first:
// RANS_SYMBOLS: there are more symbols.
struct rans_group {
    uint8_t first, split;
};

struct rans_context {
    struct rans_group groups[RANS_SUM >> RANS_COARSE];
    // An unused context: encoding, all 0; decoding, symbol 0 alone.
    struct rans_share shares[RANS_SYMBOLS];
};

struct symbol_code; // rans_coder.c

struct rans_coder {
    int contexts;
    struct rans_context *context;
    // encoding
    struct rans_numbers numbers[RANS_STREAMS];
    size_t capacity;             // of a stream's numbers
    uint32_t *counts;            // two tables of how often each code occurs
    struct symbol_code *symbols; // of each code
    uint8_t *words, *words_begin[RANS_STREAMS], *words_end[RANS_STREAMS];
    size_t words_capacity;
    // decoding
    struct rans_reader reader[RANS_STREAMS];
    uint8_t *padded; // the words, and behind them what damaged ones may make to be read
    size_t padded_capacity;
};

MUST_CHECK enum status rans_open(struct rans_coder **out, int contexts); // at most 255. ERR_MEMORY: *out is then NULL
void rans_close(struct rans_coder **coder);                              // NULL is fine; sets *coder = NULL

// ---- encoding: at most `numbers` a stream, and RANS_SLACK codes behind them may be overwritten. ERR_MEMORY:
// rans_begin must be called again before pushing.
enum { RANS_SLACK = 16 };
MUST_CHECK enum status rans_begin(struct rans_coder *coder, size_t numbers);
static inline uint32_t rans_symbol(uint32_t number)
{
    const int size = 31 - __builtin_clz(number | RANS_PLAIN);
    return number < RANS_PLAIN ? number : RANS_PLAIN + 2 * (uint32_t)(size - 3) + (number >> (size - 1) & 1);
}
static inline void rans_push(struct rans_numbers *numbers, int context, uint32_t number)
{
    numbers->codes[numbers->count++] = (uint16_t)((uint32_t)context * RANS_SYMBOLS + rans_symbol(number));
    numbers->large[numbers->large_count] = number;
    numbers->large_count += number >= RANS_PLAIN;
}
// Encodes everything; gives the number of bytes of each stream. ERR_MEMORY.
MUST_CHECK enum status rans_finish(struct rans_coder *coder, size_t bytes[RANS_STREAMS]);
void rans_copy(const struct rans_coder *coder, uint8_t *to); // all streams in order
size_t rans_frequencies_max(int contexts);                   // bytes that rans_put_frequencies may need
uint8_t *rans_put_frequencies(const struct rans_coder *coder, uint8_t *at);

// ---- decoding
// False: not frequencies of so many contexts as rans_put_frequencies writes them, or [at, end) is longer or shorter.
bool rans_get_frequencies(struct rans_coder *coder, int contexts, const uint8_t *at, const uint8_t *end);
// Copies the streams; at most `ahead` bytes are then pulled from a stream before rans_is_within is asked. NOTHING: they
// are damaged. ERR_MEMORY.
MUST_CHECK enum status rans_start(struct rans_coder *coder, const uint8_t *words, const size_t bytes[RANS_STREAMS],
                                  size_t ahead);
static inline bool rans_is_within(const struct rans_reader *reader) { return reader->word <= reader->end; }
bool rans_is_done(
    const struct rans_coder *coder); // all bytes are used up, and the states are the encoder's initial ones

// A word is taken without a branch, which would be badly predicted.
static inline void rans_refill(struct rans_reader *reader)
{
    const uint32_t low = -(uint32_t)(reader->state < RANS_LOW), word = reader->word[0] | (uint32_t)reader->word[1] << 8;
    reader->state = reader->state << (low & 16) | (word & low);
    reader->word += low & 2;
}

// A number from RANS_PLAIN on, behind its symbol.
static inline uint32_t rans_pull_large(struct rans_reader *reader, uint32_t symbol)
{
    const int remaining = (int)(symbol - RANS_PLAIN) / 2 + 2;
    uint32_t number = (2 + (symbol & 1)) << remaining;
    for (int at = 0; at < remaining; at += RANS_RAW_BITS) {
        const int count = remaining - at < RANS_RAW_BITS ? remaining - at : RANS_RAW_BITS;
        number |= (reader->state & ((UINT32_C(1) << count) - 1)) << at;
        reader->state >>= count;
        rans_refill(reader);
    }
    return number;
}

// The next symbol, which rans_take then takes: a number below RANS_PLAIN, or what rans_pull_large makes one of. From
// RANS_SYMBOLS on: rans_search finds it. reader: best a copy of one of reader->reader, which nothing else points to.
static inline __attribute__((always_inline)) size_t rans_look(const struct rans_context *context,
                                                              const struct rans_reader *reader)
{
    const struct rans_group group = context->groups[reader->state >> RANS_COARSE & ((RANS_SUM >> RANS_COARSE) - 1)];
    return group.first + (size_t)((reader->state & ((1 << RANS_COARSE) - 1)) >= group.split);
}

static inline size_t rans_search(const struct rans_context *context, const struct rans_reader *reader)
{
    size_t symbol = 0;
    while ((reader->state & (RANS_SUM - 1)) >= context->shares[symbol + 1].start)
        symbol++;
    return symbol;
}

static inline __attribute__((always_inline)) void rans_take(const struct rans_context *context,
                                                            struct rans_reader *reader, size_t symbol)
{
    const struct rans_share share = context->shares[symbol];
    reader->state = share.frequency * (reader->state >> RANS_BITS) + (reader->state & (RANS_SUM - 1)) - share.start;
    rans_refill(reader);
}

static inline size_t rans_pull_symbol(const struct rans_context *context, struct rans_reader *reader)
{
    size_t symbol = rans_look(context, reader);
    if (symbol >= RANS_SYMBOLS)
        symbol = rans_search(context, reader);
    rans_take(context, reader, symbol);
    return symbol;
}
