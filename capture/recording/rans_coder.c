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
        r->shares = calloc((size_t)contexts, sizeof *r->shares);
        r->counts = calloc(2 * (size_t)contexts * RANS_SYMBOLS, sizeof *r->counts);
        r->first = calloc((size_t)contexts, sizeof *r->first);
        if (r->shares && r->counts && r->first)
            return OK;
        rans_close(out);
    }
    return fail(ERR_MEMORY, "no memory for the depth coder");
}

void rans_close(struct rans_coder **r)
{
    if (!*r)
        return;
    free((*r)->shares);
    free((*r)->counts);
    free((*r)->first);
    free((*r)->codes);
    free((*r)->large);
    free((*r)->bits);
    free((*r)->words);
    free(*r);
    *r = NULL;
}

// ------------------------------------------------------------- encoding

enum status rans_begin(struct rans_coder *r, size_t pixels)
{
    size_t wanted = 2 * pixels + 2 + 16; // whole blocks are written
    r->count = r->large_count = 0;
    if (wanted <= r->capacity)
        return OK;
    free(r->codes);
    free(r->large);
    r->codes = malloc(wanted * sizeof *r->codes);
    r->large = malloc((wanted + 1) * sizeof *r->large); // one more is written to, though not kept
    r->capacity = r->codes && r->large ? wanted : 0;
    return r->capacity ? OK : fail(ERR_MEMORY, "no memory to code an image of %zu pixels", pixels);
}

// Scales the counts so that a context's frequencies sum to RANS_SUM and no symbol that occurs has 0.
static void scale_frequencies(uint16_t frequencies[RANS_SYMBOLS], const uint32_t counts[RANS_SYMBOLS])
{
    uint64_t total = 0;
    for (int s = 0; s < RANS_SYMBOLS; s++)
        total += counts[s];
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

static void set_shares(struct rans_share shares[RANS_SYMBOLS], const uint16_t frequencies[RANS_SYMBOLS])
{
    uint32_t sum = 0;
    for (int s = 0; s < RANS_SYMBOLS; sum += frequencies[s++])
        shares[s] = (struct rans_share){(uint16_t)sum, frequencies[s]};
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

// Writes the bits of large numbers that are not coded. Returns their end.
static uint8_t *write_bits(struct rans_coder *r)
{
    uint8_t *at = r->bits;
    uint64_t held_bits = 0;
    int held = 0;
    for (size_t i = 0; i < r->large_count; i++) {
        const uint32_t number = r->large[i];
        if (!number)
            continue;
        const int extra = 30 - __builtin_clz(number);
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

// Counts into two tables in turn: a code that follows itself would wait for its own count.
static void count_codes(struct rans_coder *r)
{
    const size_t codes = (size_t)r->contexts * RANS_SYMBOLS;
    uint32_t *even = r->counts, *odd = r->counts + codes;
    memset(r->counts, 0, 2 * codes * sizeof *r->counts);
    size_t i = 0;
    for (; i + 1 < r->count; i += 2) {
        even[r->codes[i]]++;
        odd[r->codes[i + 1]]++;
    }
    if (i < r->count)
        even[r->codes[i]]++;
    for (size_t c = 0; c < codes; c++)
        even[c] += odd[c];
}

// Encodes one symbol into a state. The word that may leave it is written in any case and kept by moving `at`: a branch
// would be badly predicted.
static inline uint32_t code_symbol(uint32_t state, const struct symbol_code *code, uint8_t **at)
{
    const uint32_t leaves = state >= code->most;
    put_u16(*at - 2, (uint16_t)state);
    *at -= 2 * leaves;
    state >>= 16 * leaves;
    const uint32_t quotient = (uint32_t)((uint64_t)state * code->reciprocal >> 32) >> code->shift;
    return state + code->bias + quotient * code->complement;
}

static void code_symbols(struct rans_coder *r, const struct symbol_code *codes)
{
    uint8_t *at = r->words + r->words_capacity;
    uint32_t state[2] = {RANS_LOW, RANS_LOW}; // of the numbers with an even and an odd index
    size_t i = r->count;
    if (i % 2) {
        i--;
        state[0] = code_symbol(state[0], &codes[r->codes[i]], &at);
    }
    for (; i > 0; i -= 2) {
        state[1] = code_symbol(state[1], &codes[r->codes[i - 1]], &at);
        state[0] = code_symbol(state[0], &codes[r->codes[i - 2]], &at);
    }
    put_u32(put_u32(at - 8, state[0]), state[1]);
    r->words_begin = at - 8;
}

static void make_codes(struct rans_coder *r, struct symbol_code *codes)
{
    for (int c = 0; c < r->contexts; c++) {
        uint16_t frequencies[RANS_SYMBOLS] = {0};
        scale_frequencies(frequencies, r->counts + (size_t)c * RANS_SYMBOLS);
        set_shares(r->shares[c], frequencies);
        for (int s = 0; s < RANS_SYMBOLS; s++)
            if (frequencies[s])
                codes[c * RANS_SYMBOLS + s] = make_symbol_code(frequencies[s], r->shares[c][s].start);
    }
}

enum status rans_finish(struct rans_coder *r, size_t *bits, size_t *words)
{
    // A number leaves at most 27 uncoded bits and one 16-bit word.
    size_t bits_wanted = 4 * r->count + 8, words_wanted = 2 * r->count + 16;
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
    struct symbol_code *codes = malloc((size_t)r->contexts * RANS_SYMBOLS * sizeof *codes);
    enum status status = OK;
    if (!r->bits || !r->words || !codes) {
        status = fail(ERR_MEMORY, "no memory to code an image");
    } else {
        r->bits_count = (size_t)(write_bits(r) - r->bits);
        count_codes(r);
        make_codes(r, codes);
        code_symbols(r, codes);
        r->words_count = (size_t)(r->words + r->words_capacity - r->words_begin);
        *bits = r->bits_count;
        *words = r->words_count;
    }
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
        while (used && !r->shares[c][used - 1].frequency)
            used--;
        at = put_u8(at, (uint8_t)used);
        for (int s = 0; s < used; s++)
            at = put_varint(at, r->shares[c][s].frequency);
    }
    return at;
}

// For each group of slots the symbol that its first slot belongs to.
static void find_first(uint8_t first[RANS_SUM >> RANS_COARSE], const struct rans_share shares[RANS_SYMBOLS])
{
    int symbol = 0;
    for (int group = 0; group < RANS_SUM >> RANS_COARSE; group++) {
        const int slot = group << RANS_COARSE;
        while (symbol < RANS_SYMBOLS - 1 && slot >= shares[symbol].start + shares[symbol].frequency)
            symbol++;
        first[group] = (uint8_t)symbol;
    }
}

bool rans_get_frequencies(struct rans_coder *r, const uint8_t *at, const uint8_t *end)
{
    for (int c = 0; c < r->contexts; c++) {
        uint16_t frequencies[RANS_SYMBOLS] = {0};
        if (at == end || *at > RANS_SYMBOLS)
            return false;
        uint32_t used = *at++, sum = 0;
        for (uint32_t s = 0, frequency; s < used; s++) {
            if (!get_varint(&at, end, &frequency) || frequency > RANS_SUM - sum)
                return false;
            frequencies[s] = (uint16_t)frequency;
            sum += frequency;
        }
        if (used && sum != RANS_SUM)
            return false;
        set_shares(r->shares[c], frequencies);
        find_first(r->first[c], r->shares[c]);
    }
    return at == end;
}

// ------------------------------------------------------------- decoding

static bool is_state(uint32_t state) { return state >= RANS_LOW && state < (uint32_t)RANS_LOW << 16; }

bool rans_start(struct rans_coder *r, const struct rans_code *code)
{
    if (code->word_count < 4 * (size_t)code->states || code->word_count % 2)
        return false;
    r->bit = code->bits;
    r->bit_end = code->bits + code->bit_count;
    r->held_bits = 0;
    r->held = 0;
    r->word = code->words;
    r->word_end = code->words + code->word_count;
    r->states = code->states;
    r->state[0] = get_u32(&r->word);
    r->state[1] = code->states > 1 ? get_u32(&r->word) : r->state[0];
    return is_state(r->state[0]) && is_state(r->state[1]);
}

bool rans_is_done(const struct rans_coder *r)
{
    return r->word == r->word_end && r->bit == r->bit_end && !r->held_bits && r->state[0] == RANS_LOW &&
           (r->states == 1 || r->state[1] == RANS_LOW);
}
