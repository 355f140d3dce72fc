#include "capture/recording/rans_coder.h"

#include "capture/recording/little_endian.h"

#include <stdlib.h>

enum status range_open(struct range_coder **out, int contexts)
{
    assert(contexts > 0 && contexts < 256);
    struct range_coder *r = calloc(1, sizeof *r);
    *out = r;
    if (r) {
        r->contexts = contexts;
        r->odds = calloc((size_t)contexts, sizeof *r->odds);
        r->start = calloc((size_t)contexts, sizeof *r->start);
        r->symbol_at = calloc((size_t)contexts, sizeof *r->symbol_at);
        if (r->odds && r->start && r->symbol_at)
            return OK;
        range_close(out);
    }
    return fail(ERR_MEMORY, "no memory for the depth coder");
}

void range_close(struct range_coder **r)
{
    if (!*r)
        return;
    free((*r)->odds);
    free((*r)->start);
    free((*r)->symbol_at);
    free((*r)->numbers);
    free((*r)->number_contexts);
    free((*r)->bits);
    free((*r)->words);
    free(*r);
    *r = NULL;
}

// ------------------------------------------------------------- encoding

enum status range_begin(struct range_coder *r, size_t pixels)
{
    size_t wanted = 2 * pixels + 2;
    r->count = 0;
    if (wanted <= r->capacity)
        return OK;
    free(r->numbers);
    free(r->number_contexts);
    r->numbers = malloc(wanted * sizeof *r->numbers);
    r->number_contexts = malloc(wanted);
    r->capacity = r->numbers && r->number_contexts ? wanted : 0;
    return r->capacity ? OK : fail(ERR_MEMORY, "no memory to code a picture of %zu pixels", pixels);
}

static inline uint32_t symbol_of(uint32_t number, int *extra)
{
    if (number < 8) {
        *extra = 0;
        return number;
    }
    int size = 31 - __builtin_clz(number);
    *extra = size - 1;
    return 8 + 2 * (uint32_t)(size - 3) + (number >> (size - 1) & 1);
}

// How often each symbol comes, scaled so that a context's odds add up to
// RANGE_SUM and none that occurs has 0.
static void scale_odds(uint16_t odds[RANGE_SYMBOLS], const uint32_t counts[RANGE_SYMBOLS])
{
    uint64_t total = 0;
    for (int s = 0; s < RANGE_SYMBOLS; s++)
        total += counts[s];
    memset(odds, 0, sizeof(uint16_t) * RANGE_SYMBOLS);
    if (!total)
        return;
    int sum = 0;
    for (int s = 0; s < RANGE_SYMBOLS; s++)
        if (counts[s]) {
            uint64_t share = (counts[s] * (uint64_t)RANGE_SUM + total / 2) / total;
            odds[s] = (uint16_t)(share ? share : 1);
            sum += odds[s];
        }
    // Rounding errors go to the largest, where they cost least.
    while (sum != RANGE_SUM) {
        int largest = 0;
        for (int s = 1; s < RANGE_SYMBOLS; s++)
            if (odds[s] > odds[largest])
                largest = s;
        int step = RANGE_SUM - sum;
        if (step < 0 && -step > odds[largest] / 2)
            step = -(odds[largest] / 2);
        odds[largest] = (uint16_t)(odds[largest] + step);
        sum += step;
    }
}

static void sum_odds(struct range_coder *r)
{
    for (int c = 0; c < r->contexts; c++)
        for (int s = 0, sum = 0; s < RANGE_SYMBOLS; sum += r->odds[c][s++])
            r->start[c][s] = (uint16_t)sum;
}

// One symbol's share of the range and how to divide by it with a
// multiplication, exact for states below 2^31 (Giesen, ryg_rans).
struct share {
    uint32_t reciprocal, most;
    uint16_t bias, rest, shift;
};

static struct share share_of(uint32_t odds, uint32_t start)
{
    struct share share = {.most = odds << (31 - RANGE_BITS), .rest = (uint16_t)(RANGE_SUM - odds)};
    if (odds < 2) {
        share.reciprocal = UINT32_MAX;
        share.bias = (uint16_t)(start + RANGE_SUM - 1);
        return share;
    }
    int shift = 0;
    while (odds > UINT32_C(1) << shift)
        shift++;
    share.reciprocal = (uint32_t)(((UINT64_C(1) << (shift + 31)) + odds - 1) / odds);
    share.shift = (uint16_t)(shift - 1);
    share.bias = (uint16_t)start;
    return share;
}

// Counts the symbols into `counts`, replaces each number by its symbol and
// writes what no symbol holds as plain bits.
static uint8_t *split_numbers(struct range_coder *r, uint32_t (*counts)[RANGE_SYMBOLS])
{
    uint8_t *at = r->bits;
    uint64_t held_bits = 0;
    int held = 0;
    for (size_t i = 0; i < r->count; i++) {
        int extra;
        uint32_t number = r->numbers[i], symbol = symbol_of(number, &extra);
        counts[r->number_contexts[i]][symbol]++;
        r->numbers[i] = symbol;
        if (!extra)
            continue;
        held_bits |= (uint64_t)(number & ((UINT32_C(1) << extra) - 1)) << held;
        for (held += extra; held >= 8; held -= 8) {
            *at++ = (uint8_t)held_bits;
            held_bits >>= 8;
        }
    }
    if (held)
        *at++ = (uint8_t)held_bits;
    return at;
}

static void code_symbols(struct range_coder *r, struct share (*shares)[RANGE_SYMBOLS])
{
    uint8_t *at = r->words + r->words_capacity;
    uint32_t state = RANGE_LOW;
    for (size_t i = r->count; i-- > 0;) {
        const struct share *share = &shares[r->number_contexts[i]][r->numbers[i]];
        if (state >= share->most) {
            at -= 2;
            put_u16(at, (uint16_t)state);
            state >>= 16;
        }
        uint32_t quotient = (uint32_t)((uint64_t)state * share->reciprocal >> 32) >> share->shift;
        state += share->bias + quotient * share->rest;
    }
    at -= 4;
    put_u32(at, state);
    r->words_begin = at;
}

enum status range_finish(struct range_coder *r, size_t *bits, size_t *words)
{
    // A number leaves at most 27 bits and one 16-bit word.
    size_t bits_wanted = 4 * r->count + 8, words_wanted = 2 * r->count + 8;
    if (bits_wanted > r->bits_capacity) {
        free(r->bits);
        r->bits = malloc(bits_wanted);
        r->bits_capacity = r->bits ? bits_wanted : 0;
    }
    if (words_wanted > r->words_capacity) {
        free(r->words);
        r->words = malloc(words_wanted);
        r->words_capacity = r->words ? words_wanted : 0;
    }
    uint32_t(*counts)[RANGE_SYMBOLS] = calloc((size_t)r->contexts, sizeof *counts);
    struct share(*shares)[RANGE_SYMBOLS] = malloc((size_t)r->contexts * sizeof *shares);
    enum status status = OK;
    if (!r->bits || !r->words || !counts || !shares) {
        status = fail(ERR_MEMORY, "no memory to code a picture");
    } else {
        r->bits_count = (size_t)(split_numbers(r, counts) - r->bits);
        for (int c = 0; c < r->contexts; c++)
            scale_odds(r->odds[c], counts[c]);
        sum_odds(r);
        for (int c = 0; c < r->contexts; c++)
            for (int s = 0; s < RANGE_SYMBOLS; s++)
                if (r->odds[c][s])
                    shares[c][s] = share_of(r->odds[c][s], r->start[c][s]);
        code_symbols(r, shares);
        r->words_count = (size_t)(r->words + r->words_capacity - r->words_begin);
        *bits = r->bits_count;
        *words = r->words_count;
    }
    free(counts);
    free(shares);
    return status;
}

void range_copy(const struct range_coder *r, uint8_t *bits, uint8_t *words)
{
    memcpy(bits, r->bits, r->bits_count);
    memcpy(words, r->words_begin, r->words_count);
}

// ------------------------------------------------------------- the odds

size_t range_odds_most(const struct range_coder *r) { return (size_t)r->contexts * (1 + 2 * RANGE_SYMBOLS); }

uint8_t *range_put_odds(const struct range_coder *r, uint8_t *at)
{
    for (int c = 0; c < r->contexts; c++) {
        int used = RANGE_SYMBOLS;
        while (used && !r->odds[c][used - 1])
            used--;
        at = put_u8(at, (uint8_t)used);
        for (int s = 0; s < used; s++)
            at = put_varint(at, r->odds[c][s]);
    }
    return at;
}

bool range_get_odds(struct range_coder *r, const uint8_t *at, const uint8_t *end)
{
    for (int c = 0; c < r->contexts; c++) {
        memset(r->odds[c], 0, sizeof r->odds[c]);
        if (at == end || *at > RANGE_SYMBOLS)
            return false;
        uint32_t used = *at++, sum = 0;
        for (uint32_t s = 0, odds; s < used; s++) {
            if (!get_varint(&at, end, &odds) || odds > RANGE_SUM - sum)
                return false;
            memset(r->symbol_at[c] + sum, (int)s, odds);
            r->odds[c][s] = (uint16_t)odds;
            sum += odds;
        }
        if (used && sum != RANGE_SUM)
            return false;
        if (!used)
            memset(r->symbol_at[c], 0, sizeof r->symbol_at[c]);
    }
    sum_odds(r);
    return at == end;
}

// ------------------------------------------------------------- decoding

bool range_start(struct range_coder *r, const uint8_t *bits, size_t bit_count, const uint8_t *words, size_t word_count)
{
    if (word_count < 4 || word_count % 2)
        return false;
    r->bit = bits;
    r->bit_end = bits + bit_count;
    r->held_bits = 0;
    r->held = 0;
    r->word = words;
    r->word_end = words + word_count;
    r->state = get_u32(&r->word);
    return r->state >= RANGE_LOW && r->state < (uint32_t)RANGE_LOW << 16;
}

bool range_is_done(const struct range_coder *r)
{
    return r->word == r->word_end && r->bit == r->bit_end && !r->held_bits && r->state == RANGE_LOW;
}
