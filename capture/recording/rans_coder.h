// Entropy coder of the depth codec: rANS (Duda 2013) with static symbol frequencies for each context; division by
// reciprocal multiplication after Giesen's ryg_rans. Numbers are pushed with their context; rans_finish counts the
// frequencies and encodes in reverse order, so that decoding runs forwards. Two states take turns with the numbers
// (Giesen 2014, "Interleaved entropy coders"), so that one's arithmetic goes on while the other waits; older images
// have one, which can still be decoded. Decoding is safe on any bytes. One coder, one thread; deterministic. Memory: 12
// bytes a pixel, 6 a number and 2.3 kB a context.
//
// A number 0..7 is its own symbol; above, the symbol holds the position of the highest bit and the bit after it, and
// the remaining bits follow uncoded. Numbers are < 2^29.
#pragma once
#include "base/status.h"

#include <string.h>

enum {
    RANS_SYMBOLS = 64,
    RANS_BITS = 12, // the frequencies of a context sum to 1 << RANS_BITS
    RANS_SUM = 1 << RANS_BITS,
    RANS_LOW = 1 << 15, // the state stays in [RANS_LOW, RANS_LOW << 16)
    RANS_PLAIN = 8,     // numbers below are symbols
    RANS_COARSE = 4,    // bits of a slot that the table of first symbols leaves out: it then fits the nearest cache
};

// A symbol's share of the slots of its context.
struct rans_share {
    uint16_t start, frequency;
};

struct rans_coder {
    int contexts;
    struct rans_share (*shares)[RANS_SYMBOLS]; // of each context; all 0: unused
    // encoding
    uint16_t *codes; // of each number: its context, times RANS_SYMBOLS, and symbol
    uint32_t *large; // in the numbers' order those that leave uncoded bits; 0: a reserved number that leaves none
    size_t count, large_count, capacity;
    uint32_t *counts;                    // two tables of how often each code occurs
    uint8_t *bits, *words, *words_begin; // words grow down from the buffer's end
    size_t bits_capacity, words_capacity, bits_count, words_count;
    // decoding
    uint8_t (*first)[RANS_SUM >> RANS_COARSE]; // the first symbol of a group of slots
    const uint8_t *word, *word_end, *bit, *bit_end;
    uint64_t held_bits;
    int held, states;  // states: 1 or 2
    uint32_t state[2]; // [0]: of the next number
};

MUST_CHECK enum status rans_open(struct rans_coder **out, int contexts); // at most 255. ERR_MEMORY: *out is then NULL
void rans_close(struct rans_coder **r);                                  // NULL is fine; sets *r = NULL

// ---- encoding: at most 2 * pixels + 2 numbers. ERR_MEMORY: rans_begin must be called again before pushing.
MUST_CHECK enum status rans_begin(struct rans_coder *r, size_t pixels);
static inline uint32_t rans_symbol(uint32_t number)
{
    const int size = 31 - __builtin_clz(number | RANS_PLAIN);
    return number < RANS_PLAIN ? number : RANS_PLAIN + 2 * (uint32_t)(size - 3) + (number >> (size - 1) & 1);
}
static inline void rans_push(struct rans_coder *r, int context, uint32_t number)
{
    r->codes[r->count++] = (uint16_t)((uint32_t)context * RANS_SYMBOLS + rans_symbol(number));
    r->large[r->large_count] = number;
    r->large_count += number >= RANS_PLAIN;
}
// Reserves the position of a number that is known only later; rans_fill sets it.
struct rans_position {
    size_t code, large;
};
static inline struct rans_position rans_reserve(struct rans_coder *r)
{
    return (struct rans_position){r->count++, r->large_count++};
}
static inline void rans_fill(struct rans_coder *r, struct rans_position at, int context, uint32_t number)
{
    r->codes[at.code] = (uint16_t)((uint32_t)context * RANS_SYMBOLS + rans_symbol(number));
    r->large[at.large] = number < RANS_PLAIN ? 0 : number;
}
// Encodes everything; gives the number of bytes of uncoded bits and of rANS words. ERR_MEMORY.
MUST_CHECK enum status rans_finish(struct rans_coder *r, size_t *bits, size_t *words);
void rans_copy(const struct rans_coder *r, uint8_t *bits, uint8_t *words);
size_t rans_frequencies_max(const struct rans_coder *r); // bytes that rans_put_frequencies may need
uint8_t *rans_put_frequencies(const struct rans_coder *r, uint8_t *at);

// ---- decoding
// False: not frequencies as rans_put_frequencies writes them, or [at, end) is longer or shorter than they are.
bool rans_get_frequencies(struct rans_coder *r, const uint8_t *at, const uint8_t *end);
struct rans_code {
    const uint8_t *bits, *words;
    size_t bit_count, word_count;
    int states; // 1 or 2
};
bool rans_start(struct rans_coder *r, const struct rans_code *code);
bool rans_is_done(const struct rans_coder *r); // all bytes are used up, and the states are the encoder's initial ones

// Of a number from RANS_PLAIN on: its uncoded bits. False: they are used up.
static inline bool rans_pull_bits(struct rans_coder *r, uint32_t symbol, uint32_t *number)
{
    const int extra = (int)(symbol - RANS_PLAIN) / 2 + 2;
    while (r->held < extra) {
        if (r->bit == r->bit_end)
            return false;
        r->held_bits |= (uint64_t)*r->bit++ << r->held;
        r->held += 8;
    }
    *number = (2 + (symbol & 1)) << extra | (uint32_t)(r->held_bits & ((UINT64_C(1) << extra) - 1));
    r->held_bits >>= extra;
    r->held -= extra;
    return true;
}

// states: r->states, as a constant where the caller can. False: the bytes are used up or invalid.
static inline __attribute__((always_inline)) bool rans_pull(struct rans_coder *r, int states, int context,
                                                            uint32_t *number)
{
    uint32_t state = r->state[0];
    const uint32_t slot = state & (RANS_SUM - 1);
    uint32_t symbol = r->first[context][slot >> RANS_COARSE];
    struct rans_share share = r->shares[context][symbol];
    while (slot - share.start >= share.frequency && symbol < RANS_SYMBOLS - 1)
        share = r->shares[context][++symbol];
    state = share.frequency * (state >> RANS_BITS) + slot - share.start;
    // A word is taken without a branch, which would be badly predicted.
    const bool low = state < RANS_LOW;
    if (r->word < r->word_end) {
        const uint32_t next = state << 16 | r->word[0] | (uint32_t)r->word[1] << 8;
        state = low ? next : state;
        r->word += 2 * low;
    } else if (low) {
        return false;
    }
    r->state[0] = states > 1 ? r->state[1] : state;
    r->state[1] = state;
    *number = symbol;
    return share.frequency && (symbol < RANS_PLAIN || rans_pull_bits(r, symbol, number));
}
