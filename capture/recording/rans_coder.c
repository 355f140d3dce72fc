#include "capture/recording/rans_coder.h"

#include "capture/recording/little_endian.h"

#include <stdlib.h>

enum status rans_open(struct rans_coder **out, int contexts)
{
    assert(contexts > 0 && contexts < 256);
    struct rans_coder *r = calloc(1, sizeof *r);
    *out = r;
    if (r) {
        r->contexts = contexts;
        r->frequencies = calloc((size_t)contexts, sizeof *r->frequencies);
        r->start = calloc((size_t)contexts, sizeof *r->start);
        r->symbol_at = calloc((size_t)contexts, sizeof *r->symbol_at);
        if (r->frequencies && r->start && r->symbol_at)
            return OK;
        rans_close(out);
    }
    return fail(ERR_MEMORY, "no memory for the depth coder");
}

void rans_close(struct rans_coder **r)
{
    if (!*r)
        return;
    free((*r)->frequencies);
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

enum status rans_begin(struct rans_coder *r, size_t pixels)
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
    return r->capacity ? OK : fail(ERR_MEMORY, "no memory to code an image of %zu pixels", pixels);
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

// Scales the counts so that a context's frequencies sum to RANS_SUM and no symbol that occurs has 0.
static void scale_frequencies(uint16_t frequencies[RANS_SYMBOLS], const uint32_t counts[RANS_SYMBOLS])
{
    uint64_t total = 0;
    for (int s = 0; s < RANS_SYMBOLS; s++)
        total += counts[s];
    memset(frequencies, 0, sizeof(uint16_t) * RANS_SYMBOLS);
    if (!total)
        return;
    int sum = 0;
    for (int s = 0; s < RANS_SYMBOLS; s++)
        if (counts[s]) {
            uint64_t share = (counts[s] * (uint64_t)RANS_SUM + total / 2) / total;
            frequencies[s] = (uint16_t)(share ? share : 1);
            sum += frequencies[s];
        }
    // The rounding error goes to the largest frequency, where it costs least.
    while (sum != RANS_SUM) {
        int largest = 0;
        for (int s = 1; s < RANS_SYMBOLS; s++)
            if (frequencies[s] > frequencies[largest])
                largest = s;
        int step = RANS_SUM - sum;
        if (step < 0 && -step > frequencies[largest] / 2)
            step = -(frequencies[largest] / 2);
        frequencies[largest] = (uint16_t)(frequencies[largest] + step);
        sum += step;
    }
}

static void sum_frequencies(struct rans_coder *r)
{
    for (int c = 0; c < r->contexts; c++)
        for (int s = 0, sum = 0; s < RANS_SYMBOLS; sum += r->frequencies[c][s++])
            r->start[c][s] = (uint16_t)sum;
}

// A symbol's frequency, and its division by a reciprocal multiplication, exact for states below 2^31 (Giesen,
// ryg_rans).
struct symbol_code {
    uint32_t reciprocal, most;
    uint16_t bias, complement, shift;
};

static struct symbol_code make_symbol_code(uint32_t frequency, uint32_t start)
{
    struct symbol_code code = {.most = frequency << (31 - RANS_BITS), .complement = (uint16_t)(RANS_SUM - frequency)};
    if (frequency < 2) {
        code.reciprocal = UINT32_MAX;
        code.bias = (uint16_t)(start + RANS_SUM - 1);
        return code;
    }
    int shift = 0;
    while (frequency > UINT32_C(1) << shift)
        shift++;
    code.reciprocal = (uint32_t)(((UINT64_C(1) << (shift + 31)) + frequency - 1) / frequency);
    code.shift = (uint16_t)(shift - 1);
    code.bias = (uint16_t)start;
    return code;
}

// Counts the symbols into `counts`, replaces each number by its symbol and writes its remaining bits uncoded. Returns
// the end of the bits.
static uint8_t *split_numbers(struct rans_coder *r, uint32_t (*counts)[RANS_SYMBOLS])
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

static void code_symbols(struct rans_coder *r, struct symbol_code (*codes)[RANS_SYMBOLS])
{
    uint8_t *at = r->words + r->words_capacity;
    uint32_t state = RANS_LOW;
    for (size_t i = r->count; i-- > 0;) {
        const struct symbol_code *code = &codes[r->number_contexts[i]][r->numbers[i]];
        if (state >= code->most) {
            at -= 2;
            put_u16(at, (uint16_t)state);
            state >>= 16;
        }
        uint32_t quotient = (uint32_t)((uint64_t)state * code->reciprocal >> 32) >> code->shift;
        state += code->bias + quotient * code->complement;
    }
    at -= 4;
    put_u32(at, state);
    r->words_begin = at;
}

enum status rans_finish(struct rans_coder *r, size_t *bits, size_t *words)
{
    // A number leaves at most 27 uncoded bits and one 16-bit word.
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
    uint32_t(*counts)[RANS_SYMBOLS] = calloc((size_t)r->contexts, sizeof *counts);
    struct symbol_code(*codes)[RANS_SYMBOLS] = malloc((size_t)r->contexts * sizeof *codes);
    enum status status = OK;
    if (!r->bits || !r->words || !counts || !codes) {
        status = fail(ERR_MEMORY, "no memory to code an image");
    } else {
        r->bits_count = (size_t)(split_numbers(r, counts) - r->bits);
        for (int c = 0; c < r->contexts; c++)
            scale_frequencies(r->frequencies[c], counts[c]);
        sum_frequencies(r);
        for (int c = 0; c < r->contexts; c++)
            for (int s = 0; s < RANS_SYMBOLS; s++)
                if (r->frequencies[c][s])
                    codes[c][s] = make_symbol_code(r->frequencies[c][s], r->start[c][s]);
        code_symbols(r, codes);
        r->words_count = (size_t)(r->words + r->words_capacity - r->words_begin);
        *bits = r->bits_count;
        *words = r->words_count;
    }
    free(counts);
    free(codes);
    return status;
}

void rans_copy(const struct rans_coder *r, uint8_t *bits, uint8_t *words)
{
    memcpy(bits, r->bits, r->bits_count);
    memcpy(words, r->words_begin, r->words_count);
}

// ------------------------------------------------------------- the frequencies

size_t rans_frequencies_max(const struct rans_coder *r) { return (size_t)r->contexts * (1 + 2 * RANS_SYMBOLS); }

uint8_t *rans_put_frequencies(const struct rans_coder *r, uint8_t *at)
{
    for (int c = 0; c < r->contexts; c++) {
        int used = RANS_SYMBOLS;
        while (used && !r->frequencies[c][used - 1])
            used--;
        at = put_u8(at, (uint8_t)used);
        for (int s = 0; s < used; s++)
            at = put_varint(at, r->frequencies[c][s]);
    }
    return at;
}

bool rans_get_frequencies(struct rans_coder *r, const uint8_t *at, const uint8_t *end)
{
    for (int c = 0; c < r->contexts; c++) {
        memset(r->frequencies[c], 0, sizeof r->frequencies[c]);
        if (at == end || *at > RANS_SYMBOLS)
            return false;
        uint32_t used = *at++, sum = 0;
        for (uint32_t s = 0, frequency; s < used; s++) {
            if (!get_varint(&at, end, &frequency) || frequency > RANS_SUM - sum)
                return false;
            memset(r->symbol_at[c] + sum, (int)s, frequency);
            r->frequencies[c][s] = (uint16_t)frequency;
            sum += frequency;
        }
        if (used && sum != RANS_SUM)
            return false;
        if (!used)
            memset(r->symbol_at[c], 0, sizeof r->symbol_at[c]);
    }
    sum_frequencies(r);
    return at == end;
}

// ------------------------------------------------------------- decoding

bool rans_start(struct rans_coder *r, const uint8_t *bits, size_t bit_count, const uint8_t *words, size_t word_count)
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
    return r->state >= RANS_LOW && r->state < (uint32_t)RANS_LOW << 16;
}

bool rans_is_done(const struct rans_coder *r)
{
    return r->word == r->word_end && r->bit == r->bit_end && !r->held_bits && r->state == RANS_LOW;
}
