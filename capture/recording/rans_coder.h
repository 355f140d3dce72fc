// Entropy coder of the depth codec: rANS (Duda 2013) with static symbol frequencies for each context; division by
// reciprocal multiplication after Giesen's ryg_rans. Numbers are pushed with their context; rans_finish counts the
// frequencies and encodes in reverse order, so that decoding runs forwards. Decoding is safe on any bytes. One coder,
// one thread; deterministic. Memory: 10 bytes a pixel, 6 a number and 4.3 kB a context.
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
};

struct rans_coder {
    int contexts;
    uint16_t (*frequencies)[RANS_SYMBOLS]; // of each context; all 0: unused
    uint16_t (*start)[RANS_SYMBOLS];       // cumulative frequencies
    // encoding
    uint32_t *numbers;
    uint8_t *number_contexts;
    size_t count, capacity;
    uint8_t *bits, *words, *words_begin; // words grow down from the buffer's end
    size_t bits_capacity, words_capacity, bits_count, words_count;
    // decoding
    uint8_t (*symbol_at)[RANS_SUM];
    const uint8_t *word, *word_end, *bit, *bit_end;
    uint64_t held_bits;
    int held;
    uint32_t state;
};

MUST_CHECK enum status rans_open(struct rans_coder **out, int contexts); // at most 255. ERR_MEMORY: *out is then NULL
void rans_close(struct rans_coder **r);                                  // NULL is fine; sets *r = NULL

// ---- encoding: at most 2 * pixels + 2 numbers. ERR_MEMORY: rans_begin must be called again before pushing.
MUST_CHECK enum status rans_begin(struct rans_coder *r, size_t pixels);
static inline void rans_push(struct rans_coder *r, int context, uint32_t number)
{
    r->number_contexts[r->count] = (uint8_t)context;
    r->numbers[r->count++] = number;
}
// Reserves the position of a number that is known only later; rans_fill sets it.
static inline size_t rans_reserve(struct rans_coder *r) { return r->count++; }
static inline void rans_fill(struct rans_coder *r, size_t position, int context, uint32_t number)
{
    r->number_contexts[position] = (uint8_t)context;
    r->numbers[position] = number;
}
// Encodes everything; gives the number of bytes of uncoded bits and of rANS words. ERR_MEMORY.
MUST_CHECK enum status rans_finish(struct rans_coder *r, size_t *bits, size_t *words);
void rans_copy(const struct rans_coder *r, uint8_t *bits, uint8_t *words);
size_t rans_frequencies_max(const struct rans_coder *r); // bytes that rans_put_frequencies may need
uint8_t *rans_put_frequencies(const struct rans_coder *r, uint8_t *at);

// ---- decoding
// False: not frequencies as rans_put_frequencies writes them, or [at, end) is longer or shorter than they are.
bool rans_get_frequencies(struct rans_coder *r, const uint8_t *at, const uint8_t *end);
bool rans_start(struct rans_coder *r, const uint8_t *bits, size_t bit_count, const uint8_t *words, size_t word_count);
bool rans_is_done(const struct rans_coder *r); // all bytes are used up, and the state is the encoder's initial one

// False: the bytes are used up or invalid.
static inline bool rans_pull(struct rans_coder *r, int context, uint32_t *number)
{
    uint32_t slot = r->state & (RANS_SUM - 1), symbol = r->symbol_at[context][slot];
    uint32_t frequency = r->frequencies[context][symbol];
    if (!frequency)
        return false; // the context has no frequencies
    r->state = frequency * (r->state >> RANS_BITS) + slot - r->start[context][symbol];
    if (r->state < RANS_LOW) {
        if (r->word == r->word_end)
            return false;
        r->state = r->state << 16 | r->word[0] | (uint32_t)r->word[1] << 8;
        r->word += 2;
    }
    if (symbol < 8) {
        *number = symbol;
        return true;
    }
    int extra = (int)(symbol - 8) / 2 + 2;
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
