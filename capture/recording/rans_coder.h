// A range coder with fixed odds for each context (rANS), for the depth code.
// Numbers are pushed with the context they came in; when all are there the
// odds are counted and everything is coded, so coding runs backwards and
// decoding forwards. Decoding is safe on any bytes. One coder, one thread.
//
// A number 0..7 is a symbol of its own; above, a symbol holds its magnitude and
// leading fraction and the rest follows as plain bits. Numbers are < 2^29.
#pragma once
#include "base/status.h"

#include <string.h>

enum {
    RANGE_SYMBOLS = 64,
    RANGE_BITS = 12, // the odds of a context add up to 1 << RANGE_BITS
    RANGE_SUM = 1 << RANGE_BITS,
    RANGE_LOW = 1 << 15, // the state stays in [RANGE_LOW, RANGE_LOW << 16)
};

struct range_coder {
    int contexts;
    uint16_t (*odds)[RANGE_SYMBOLS];  // of each context; all 0: unused
    uint16_t (*start)[RANGE_SYMBOLS]; // the sum of the odds before
    // encoding
    uint32_t *numbers;
    uint8_t *number_contexts;
    size_t count, capacity;
    uint8_t *bits, *words, *words_begin; // words grow downwards from the buffer's end
    size_t bits_capacity, words_capacity, bits_count, words_count;
    // decoding
    uint8_t (*symbol_at)[RANGE_SUM];
    const uint8_t *word, *word_end, *bit, *bit_end;
    uint64_t held_bits;
    int held;
    uint32_t state;
};

MUST_CHECK enum status range_open(struct range_coder **out, int contexts); // at most 255. ERR_MEMORY
void range_close(struct range_coder **r);                                  // NULL is fine

// ---- encoding: at most 2 * pixels + 2 numbers. ERR_MEMORY.
MUST_CHECK enum status range_begin(struct range_coder *r, size_t pixels);
static inline void range_push(struct range_coder *r, int context, uint32_t number)
{
    r->number_contexts[r->count] = (uint8_t)context;
    r->numbers[r->count++] = number;
}
// Keeps the place for a number that is known only later.
static inline size_t range_reserve(struct range_coder *r) { return r->count++; }
static inline void range_fill(struct range_coder *r, size_t place, int context, uint32_t number)
{
    r->number_contexts[place] = (uint8_t)context;
    r->numbers[place] = number;
}
// Codes everything; says how many bytes of plain bits and of range code there are.
MUST_CHECK enum status range_finish(struct range_coder *r, size_t *bits, size_t *words);
void range_copy(const struct range_coder *r, uint8_t *bits, uint8_t *words);
size_t range_odds_most(const struct range_coder *r); // bytes that range_put_odds may need
uint8_t *range_put_odds(const struct range_coder *r, uint8_t *at);

// ---- decoding
// False: not odds that range_put_odds wrote. Must fill [at, end) exactly.
bool range_get_odds(struct range_coder *r, const uint8_t *at, const uint8_t *end);
bool range_start(struct range_coder *r, const uint8_t *bits, size_t bit_count, const uint8_t *words, size_t word_count);
bool range_is_done(const struct range_coder *r); // everything used up, in the state where encoding began

// False: the bytes are used up or were never of our making.
static inline bool range_pull(struct range_coder *r, int context, uint32_t *number)
{
    uint32_t slot = r->state & (RANGE_SUM - 1), symbol = r->symbol_at[context][slot];
    uint32_t odds = r->odds[context][symbol];
    if (!odds)
        return false; // a context without odds
    r->state = odds * (r->state >> RANGE_BITS) + slot - r->start[context][symbol];
    if (r->state < RANGE_LOW) {
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
