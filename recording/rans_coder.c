#include "recording/rans_coder.h"

#include "recording/little_endian.h"

#include <stdlib.h>

__extension__ typedef unsigned __int128 uint128;

// A symbol's frequency, and its division by a multiplication with a reciprocal, 2^64 over it rounded up: exact for
// states of 32 bits (Giesen, ryg_rans, but with 32 bits more, which save the shift that each state would wait for).
struct symbol_code {
    uint64_t reciprocal;
    uint32_t most;
    uint16_t bias, complement;
};

enum status rans_open(struct rans_coder **out, int contexts)
{
    assert(contexts > 0 && contexts < 256);
    struct rans_coder *r = calloc(1, sizeof *r);
    *out = r;
    if (r) {
        r->contexts = contexts;
        r->context = calloc((size_t)contexts, sizeof *r->context);
        r->counts = calloc(2 * (size_t)contexts * RANS_SYMBOLS, sizeof *r->counts);
        r->symbols = calloc((size_t)contexts * RANS_SYMBOLS, sizeof *r->symbols);
        if (r->context && r->counts && r->symbols)
            return OK;
        rans_close(out);
    }
    return fail(ERR_MEMORY, "no memory for the depth coder");
}

void rans_close(struct rans_coder **coder)
{
    if (!*coder)
        return;
    for (int i = 0; i < RANS_STREAMS; i++) {
        free((*coder)->numbers[i].codes);
        free((*coder)->numbers[i].large);
    }
    free((*coder)->context);
    free((*coder)->counts);
    free((*coder)->symbols);
    free((*coder)->words);
    free((*coder)->padded);
    free(*coder);
    *coder = NULL;
}

// ------------------------------------------------------------- encoding

enum status rans_begin(struct rans_coder *coder, size_t numbers)
{
    const bool fits = coder->capacity && numbers <= coder->capacity;
    if (!fits)
        coder->capacity = 0;
    for (int i = 0; i < RANS_STREAMS; i++) {
        struct rans_numbers *n = &coder->numbers[i];
        n->count = n->large_count = 0;
        if (fits)
            continue;
        free(n->codes);
        free(n->large);
        n->codes = malloc((numbers + RANS_SLACK) * sizeof *n->codes);
        n->large = malloc((numbers + 1) * sizeof *n->large); // one more is written to, though not kept
    }
    for (int i = 0; i < RANS_STREAMS; i++)
        if (!coder->numbers[i].codes || !coder->numbers[i].large)
            return fail(ERR_MEMORY, "no memory to code an image");
    coder->capacity = fits ? coder->capacity : numbers;
    return OK;
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

static struct symbol_code make_symbol_code(uint32_t frequency, uint32_t start)
{
    struct symbol_code code = {.most = frequency << (31 - RANS_BITS), .complement = (uint16_t)(RANS_SUM - frequency)};
    if (frequency < 2) {
        code.reciprocal = UINT64_MAX;
        code.bias = (uint16_t)(start + RANS_SUM - 1);
        return code;
    }
    code.reciprocal = UINT64_MAX / frequency + 1;
    code.bias = (uint16_t)start;
    return code;
}

// Counts into two tables in turn: a code that follows itself would wait for its own count.
static void count_codes(struct rans_coder *coder)
{
    const size_t codes = (size_t)coder->contexts * RANS_SYMBOLS;
    uint32_t *even = coder->counts, *odd = coder->counts + codes;
    memset(coder->counts, 0, 2 * codes * sizeof *coder->counts);
    for (int s = 0; s < RANS_STREAMS; s++) {
        const struct rans_numbers *n = &coder->numbers[s];
        size_t i = 0;
        for (; i + 1 < n->count; i += 2) {
            even[n->codes[i]]++;
            odd[n->codes[i + 1]]++;
        }
        if (i < n->count)
            even[n->codes[i]]++;
    }
    for (size_t c = 0; c < codes; c++)
        even[c] += odd[c];
}

// The state's lower half leaves it, if `leaves`. It is written in any case and kept by moving `at`: a branch would be
// badly predicted.
static inline uint32_t put_word(uint32_t state, bool leaves, uint8_t **at)
{
    put_u16(*at - 2, (uint16_t)state);
    *at -= 2 * leaves;
    return state >> 16 * leaves;
}

// What is being encoded of a stream, from its end on.
struct stream_encoder {
    const uint16_t *code;
    const uint32_t *large;
    uint8_t *at;
    uint32_t state;
};

// The bits of a number from RANS_PLAIN on that its symbol does not hold.
static inline void code_large(struct stream_encoder *encoder)
{
    const uint32_t number = *--encoder->large;
    const int remaining = 30 - __builtin_clz(number);
    for (int at = (remaining - 1) / RANS_RAW_BITS * RANS_RAW_BITS; at >= 0; at -= RANS_RAW_BITS) {
        const int count = remaining - at < RANS_RAW_BITS ? remaining - at : RANS_RAW_BITS;
        const uint32_t bits = number >> at & ((UINT32_C(1) << count) - 1);
        encoder->state = put_word(encoder->state, encoder->state >> (31 - count) != 0, &encoder->at) << count | bits;
    }
}

static inline void code_number(struct stream_encoder *encoder, const struct symbol_code *symbols)
{
    const uint32_t code = *--encoder->code;
    if (code % RANS_SYMBOLS >= RANS_PLAIN)
        code_large(encoder);
    const struct symbol_code *symbol = &symbols[code];
    const uint32_t state = put_word(encoder->state, encoder->state >= symbol->most, &encoder->at);
    const uint32_t quotient = (uint32_t)((uint128)state * symbol->reciprocal >> 64);
    encoder->state = state + symbol->bias + quotient * symbol->complement;
}

static struct stream_encoder stream_begin(const struct rans_coder *coder, int i)
{
    const struct rans_numbers *n = &coder->numbers[i];
    return (struct stream_encoder){n->codes + n->count, n->large + n->large_count, coder->words_end[i], RANS_LOW};
}

// What one stream has more than the other, then both in turn.
static void code_streams(struct rans_coder *coder)
{
    const struct symbol_code *symbols = coder->symbols;
    struct stream_encoder a = stream_begin(coder, 0), b = stream_begin(coder, 1);
    size_t left = coder->numbers[0].count, other = coder->numbers[1].count;
    for (; left > other; left--)
        code_number(&a, symbols);
    for (; other > left; other--)
        code_number(&b, symbols);
    for (; left > 0; left--) {
        code_number(&a, symbols);
        code_number(&b, symbols);
    }
    put_u32(coder->words_begin[0] = a.at - 4, a.state);
    put_u32(coder->words_begin[1] = b.at - 4, b.state);
}

static void make_symbol_codes(struct rans_coder *coder)
{
    for (int c = 0; c < coder->contexts; c++) {
        uint16_t frequencies[RANS_SYMBOLS] = {0};
        scale_frequencies(frequencies, coder->counts + (size_t)c * RANS_SYMBOLS);
        set_shares(coder->context[c].shares, frequencies);
        for (int s = 0; s < RANS_SYMBOLS; s++)
            if (frequencies[s])
                coder->symbols[c * RANS_SYMBOLS + s] =
                    make_symbol_code(frequencies[s], coder->context[c].shares[s].start);
    }
}

enum status rans_finish(struct rans_coder *coder, size_t bytes[RANS_STREAMS])
{
    size_t wanted = 0, most[RANS_STREAMS];
    for (int i = 0; i < RANS_STREAMS; i++)
        wanted += most[i] = 2 * coder->numbers[i].count + (RANS_NUMBER_BYTES - 2) * coder->numbers[i].large_count + 8;
    if (wanted > coder->words_capacity) {
        free(coder->words);
        coder->words = malloc(wanted);
        coder->words_capacity = coder->words ? wanted : 0;
    }
    if (!coder->words)
        return fail(ERR_MEMORY, "no memory to code an image");
    coder->words_end[0] = coder->words + most[0]; // words grow down from there
    coder->words_end[1] = coder->words_end[0] + most[1];
    count_codes(coder);
    make_symbol_codes(coder);
    code_streams(coder);
    for (int i = 0; i < RANS_STREAMS; i++)
        bytes[i] = (size_t)(coder->words_end[i] - coder->words_begin[i]);
    return OK;
}

void rans_copy(const struct rans_coder *coder, uint8_t *to)
{
    for (int i = 0; i < RANS_STREAMS; i++) {
        const size_t bytes = (size_t)(coder->words_end[i] - coder->words_begin[i]);
        memcpy(to, coder->words_begin[i], bytes);
        to += bytes;
    }
}

// ------------------------------------------------------------- the frequencies

size_t rans_frequencies_max(int contexts) { return (size_t)contexts * (1 + 2 * RANS_SYMBOLS); }

uint8_t *rans_put_frequencies(const struct rans_coder *coder, uint8_t *at)
{
    for (int c = 0; c < coder->contexts; c++) {
        int used = RANS_SYMBOLS;
        while (used && !coder->context[c].shares[used - 1].frequency)
            used--;
        at = put_u8(at, (uint8_t)used);
        for (int s = 0; s < used; s++)
            at = put_varint(at, coder->context[c].shares[s].frequency);
    }
    return at;
}

// The symbols of each group of slots: first those that lie within one symbol's share, then those where shares meet.
static void find_groups(struct rans_group groups[RANS_SUM >> RANS_COARSE], const struct rans_share shares[RANS_SYMBOLS])
{
    const int slots = 1 << RANS_COARSE;
    for (int symbol = 0, end = 0; end < RANS_SUM; symbol++) {
        const int start = end;
        end += shares[symbol].frequency;
        for (int group = (start + slots - 1) / slots; group < end / slots; group++)
            groups[group] = (struct rans_group){(uint8_t)symbol, (uint8_t)slots};
        if (end == start || end % slots == 0)
            continue;
        const bool first = start <= end / slots * slots; // of its group
        const bool two =
            shares[symbol + 1].frequency && end + shares[symbol + 1].frequency >= (end / slots + 1) * slots;
        groups[end / slots] = first && two ? (struct rans_group){(uint8_t)symbol, (uint8_t)(end % slots)}
                                           : (struct rans_group){RANS_SYMBOLS, 0};
    }
}

bool rans_get_frequencies(struct rans_coder *coder, int contexts, const uint8_t *at, const uint8_t *end)
{
    assert(contexts <= coder->contexts);
    for (int c = 0; c < contexts; c++) {
        uint16_t frequencies[RANS_SYMBOLS] = {0};
        if (at == end || *at > RANS_SYMBOLS_USED)
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
        if (!used)
            frequencies[0] = RANS_SUM;
        set_shares(coder->context[c].shares, frequencies);
        find_groups(coder->context[c].groups, coder->context[c].shares);
    }
    return at == end;
}

// ------------------------------------------------------------- decoding

static bool is_state(uint32_t state) { return state >= RANS_LOW && state < (uint32_t)RANS_LOW << 16; }

enum status rans_start(struct rans_coder *coder, const uint8_t *words, const size_t bytes[RANS_STREAMS], size_t ahead)
{
    const size_t all = bytes[0] + bytes[1], wanted = all + ahead;
    if (wanted > coder->padded_capacity) {
        free(coder->padded);
        coder->padded = malloc(wanted);
        coder->padded_capacity = coder->padded ? wanted : 0;
    }
    if (!coder->padded)
        return fail(ERR_MEMORY, "no memory to decode an image");
    memcpy(coder->padded, words, all);
    memset(coder->padded + all, 0, ahead);
    const uint8_t *at = coder->padded;
    for (int i = 0; i < RANS_STREAMS; i++) {
        struct rans_reader *s = &coder->reader[i];
        if (bytes[i] < 4 || bytes[i] % 2)
            return NOTHING;
        s->word = at;
        s->end = at += bytes[i];
        s->state = get_u32(&s->word);
        if (!is_state(s->state))
            return NOTHING;
    }
    return OK;
}

bool rans_is_done(const struct rans_coder *coder)
{
    for (int i = 0; i < RANS_STREAMS; i++)
        if (coder->reader[i].word != coder->reader[i].end || coder->reader[i].state != RANS_LOW)
            return false;
    return true;
}
