// The entropy coder against what it cannot have made itself: the numbers that were given, the entropy of the
// frequencies that are coded, and a search through all slots.
#include "tests/support/test.h"

#include "recording/rans_coder.h"

#include <stdio.h>

enum { SEED = 1948, CONTEXTS = 24, CAPACITY = 20000, WIDEST = 255, RANDOM_ROUNDS = 40 };

struct number {
    int context;
    uint32_t value;
};

// What two streams are to hold.
struct message {
    struct number numbers[RANS_STREAMS][CAPACITY];
    size_t count[RANS_STREAMS];
};

// A message's code, in memory of its exact size, so that a sanitizer sees any access beyond it.
struct code {
    uint8_t *frequencies, *words;
    size_t frequency_bytes, bytes[RANS_STREAMS];
};

static struct rans_coder *coder;
static struct message message; // 320 kB
static int contexts;

static int open_coder(void **state)
{
    (void)state;
    return rans_open(&coder, contexts = CONTEXTS) == OK ? 0 : -1;
}

static int open_widest_coder(void **state)
{
    (void)state;
    return rans_open(&coder, contexts = WIDEST) == OK ? 0 : -1;
}

static int close_coder(void **state)
{
    (void)state;
    rans_close(&coder);
    rans_close(&coder);
    assert_null(coder);
    return 0;
}

static struct code encode(void)
{
    const size_t capacity = message.count[0] > message.count[1] ? message.count[0] : message.count[1];
    EXPECT_STATUS(rans_begin(coder, capacity), OK);
    for (int s = 0; s < RANS_STREAMS; s++)
        for (size_t i = 0; i < message.count[s]; i++)
            rans_push(&coder->numbers[s], message.numbers[s][i].context, message.numbers[s][i].value);
    struct code code = {0};
    EXPECT_STATUS(rans_finish(coder, code.bytes), OK);
    uint8_t *frequencies = malloc(rans_frequencies_max(contexts));
    assert_non_null(frequencies);
    code.frequency_bytes = (size_t)(rans_put_frequencies(coder, frequencies) - frequencies);
    EXPECT_TRUE(code.frequency_bytes <= rans_frequencies_max(contexts));
    code.frequencies = realloc(frequencies, code.frequency_bytes);
    code.words = malloc(code.bytes[0] + code.bytes[1]);
    assert_true(code.frequencies && code.words);
    rans_copy(coder, code.words);
    return code;
}

static void free_code(struct code *code)
{
    free(code->frequencies);
    free(code->words);
}

// Decodes what was started as if it were the message; returns how many numbers differ.
static size_t decode(void)
{
    size_t wrong = 0;
    for (int s = 0; s < RANS_STREAMS; s++) {
        struct rans_reader reader = coder->reader[s];
        for (size_t i = 0; i < message.count[s] && rans_is_within(&reader); i++) {
            const struct number *number = &message.numbers[s][i];
            uint32_t value = (uint32_t)rans_pull_symbol(&coder->context[number->context], &reader);
            if (value >= RANS_PLAIN)
                value = rans_pull_large(&reader, value);
            wrong += value != number->value;
        }
        coder->reader[s] = reader;
    }
    return wrong;
}

static enum status start(const struct code *code)
{
    return rans_start(coder, code->words, code->bytes, RANS_NUMBER_BYTES);
}

// Encodes the message and decodes it again; gives the bytes of both streams.
static double expect_round_trip(void)
{
    struct code code = encode();
    EXPECT_TRUE(rans_get_frequencies(coder, contexts, code.frequencies, code.frequencies + code.frequency_bytes));
    EXPECT_STATUS(start(&code), OK);
    EXPECT_INT(decode(), 0);
    EXPECT_TRUE(rans_is_done(coder));
    free_code(&code);
    return (double)(code.bytes[0] + code.bytes[1]);
}

static void push(int stream, int context, uint32_t value)
{
    assert_true(message.count[stream] < CAPACITY);
    message.numbers[stream][message.count[stream]++] = (struct number){context, value};
}

static void clear_message(void) { message.count[0] = message.count[1] = 0; }

// Of the message, bits, with the best frequencies that each context can have; and the bits below the symbols.
static double entropy_bits(void)
{
    static uint32_t counts[WIDEST][RANS_SYMBOLS];
    double bits = 0;
    memset(counts, 0, sizeof counts);
    for (int s = 0; s < RANS_STREAMS; s++)
        for (size_t i = 0; i < message.count[s]; i++) {
            const struct number *n = &message.numbers[s][i];
            counts[n->context][rans_symbol(n->value)]++;
            for (uint32_t rest = n->value; n->value >= RANS_PLAIN && rest > 3; rest >>= 1)
                bits++; // of the number's bits the symbol holds the place of the highest, and the next one
        }
    for (int c = 0; c < WIDEST; c++) {
        double total = 0;
        for (int s = 0; s < RANS_SYMBOLS; s++)
            total += counts[c][s];
        for (int s = 0; s < RANS_SYMBOLS; s++)
            if (counts[c][s])
                bits -= counts[c][s] * log2(counts[c][s] / total);
    }
    return bits;
}

// ------------------------------------------------------------- round trips

static void test_empty_message(void **state)
{
    (void)state;
    clear_message();
    EXPECT_INT(expect_round_trip(), 2 * 4); // the two states
}

static void test_each_size_of_number_alone(void **state)
{
    (void)state;
    for (int bit = 0; bit < 29; bit++)
        for (int below = -1; below <= 1; below++) {
            const int64_t value = ((int64_t)1 << bit) + below;
            if (value < 0 || value >= 1 << 29)
                continue;
            clear_message();
            push(bit % 2, bit % CONTEXTS, (uint32_t)value);
            EXPECT_AT_MOST(expect_round_trip(), 8 + RANS_NUMBER_BYTES);
        }
    clear_message();
    push(0, 0, (1 << 29) - 1);
    expect_round_trip();
}

static void test_one_symbol_takes_no_room(void **state)
{
    (void)state;
    clear_message();
    for (int i = 0; i < CAPACITY; i++)
        push(i % 2, i % CONTEXTS, (uint32_t)(i % CONTEXTS % RANS_PLAIN));
    EXPECT_INT(expect_round_trip(), 2 * 4);
}

static void test_all_symbols_evenly(void **state)
{
    (void)state;
    struct rng rng = rng_of(SEED, 0);
    clear_message();
    for (int i = 0; i < CAPACITY; i++) {
        const int symbol = i % RANS_SYMBOLS_USED;
        uint32_t value = (uint32_t)symbol;
        if (symbol >= RANS_PLAIN) {
            const int size = 3 + (symbol - RANS_PLAIN) / 2; // of the highest bit
            value = UINT32_C(1) << size | (uint32_t)((symbol - RANS_PLAIN) % 2) << (size - 1);
            value |= (uint32_t)(rng_uniform(&rng) * (UINT32_C(1) << (size - 1)));
        }
        EXPECT_INT(rans_symbol(value), symbol);
        push(i % 2, 3, value);
    }
    const double bytes = expect_round_trip();
    EXPECT_AT_MOST(bytes, entropy_bits() / 8 * 1.001 + 16); // measured 1.00006 times
}

// The frequencies' rounding error goes to the common symbol; each rare one keeps a share.
static void test_rare_symbols_keep_a_share(void **state)
{
    (void)state;
    clear_message();
    for (int i = 0; i < CAPACITY - 1; i++)
        push(0, 0, 5);
    for (uint32_t value = 0; value < RANS_PLAIN; value++)
        push(1, 0, value);
    for (int bit = 3; bit < 29; bit++) {
        push(1, 0, UINT32_C(1) << bit);
        push(1, 0, UINT32_C(3) << (bit - 1));
    }
    struct code code = encode();
    int sum = 0;
    for (int s = 0; s < RANS_SYMBOLS_USED; s++) {
        EXPECT_TRUE(coder->context[0].shares[s].frequency > 0);
        EXPECT_INT(coder->context[0].shares[s].start, sum);
        sum += coder->context[0].shares[s].frequency;
    }
    EXPECT_INT(sum, RANS_SUM);
    free_code(&code);
    expect_round_trip();
}

static void test_streams_of_unequal_length(void **state)
{
    (void)state;
    for (int longer = 0; longer < RANS_STREAMS; longer++) {
        struct rng rng = rng_of(SEED, longer);
        clear_message();
        for (int i = 0; i < 1000; i++)
            push(longer, rng_pick(&rng, CONTEXTS), (uint32_t)rng_pick(&rng, 40));
        for (int i = 0; i < 3; i++)
            push(1 - longer, 0, 1 << 20);
        expect_round_trip();
    }
}

static void test_as_small_as_the_entropy(void **state)
{
    (void)state;
    double most = 0;
    for (int round = 0; round < RANDOM_ROUNDS / (SANITIZED ? 4 : 1); round++) {
        struct rng rng = rng_of(SEED, 100 + round);
        const double mean = exp2(rng_between(&rng, -3, 16));
        const int used = 1 + rng_pick(&rng, contexts);
        clear_message();
        for (int i = 0; i < CAPACITY; i++) {
            const double value = -log(1 - rng_uniform(&rng)) * mean; // as prediction errors are spread
            push(i % 2, rng_pick(&rng, used), (uint32_t)fmin(value, (1 << 29) - 1));
        }
        const double bytes = expect_round_trip(), bound = entropy_bits() / 8;
        most = fmax(most, (bytes - 2 * 4 - 2 * 2) / bound); // without the states, and half a word each
    }
    print_message("%d contexts: at most %.4f times the entropy\n", contexts, most);
    EXPECT_AT_MOST(most, 1.001); // measured 0.9999: less than half a word was lost
}

// A coder is used for images of any sizes in turn.
static void test_capacity_grows_and_stays(void **state)
{
    (void)state;
    const size_t sizes[] = {1, 5000, 7, 0, 10000, 9999};
    for (size_t k = 0; k < COUNT_OF(sizes); k++) {
        struct rng rng = rng_of(SEED, (int)k);
        clear_message();
        for (size_t i = 0; i < sizes[k]; i++)
            push((int)(i % 2), rng_pick(&rng, CONTEXTS), UINT32_C(1) << rng_pick(&rng, 29)); // all are large
        expect_round_trip();
    }
}

// ------------------------------------------------------------- decoding's tables

// The table of groups finds what a search through the shares finds, in every slot.
static void test_groups_find_the_slot_owner(void **state)
{
    (void)state;
    for (int round = 0; round < RANDOM_ROUNDS; round++) {
        struct rng rng = rng_of(SEED, 200 + round);
        clear_message();
        for (int i = 0; i < 4000; i++)
            push(i % 2, 0, (uint32_t)exp2(rng_between(&rng, 0, rng_between(&rng, 0.1, 28))) - 1);
        struct code code = encode();
        EXPECT_TRUE(rans_get_frequencies(coder, contexts, code.frequencies, code.frequencies + code.frequency_bytes));
        const struct rans_context *context = &coder->context[0];
        int wrong = 0;
        for (uint32_t slot = 0, owner = 0; slot < RANS_SUM; slot++) {
            while (slot >= (uint32_t)context->shares[owner].start + context->shares[owner].frequency)
                owner++;
            uint8_t words[4] = {0};
            struct rans_reader reader = {.state = 77 << RANS_BITS | slot, .word = words, .end = words + sizeof words};
            wrong += rans_pull_symbol(context, &reader) != owner;
        }
        EXPECT_INT(wrong, 0);
        free_code(&code);
    }
}

// ------------------------------------------------------------- damage

static struct code encode_sample(void)
{
    struct rng rng = rng_of(SEED, 300);
    clear_message();
    for (int i = 0; i < 2000; i++)
        push(i % 2, rng_pick(&rng, CONTEXTS), (uint32_t)exp2(rng_between(&rng, 0, 20)) - 1);
    return encode();
}

static void test_frequencies_cut_or_continued(void **state)
{
    (void)state;
    struct code code = encode_sample();
    for (size_t count = 0; count < code.frequency_bytes; count++) {
        uint8_t *cut = malloc(count + 1);
        assert_non_null(cut);
        memcpy(cut, code.frequencies, count);
        EXPECT_TRUE(!rans_get_frequencies(coder, contexts, cut, cut + count));
        free(cut);
    }
    uint8_t *longer = malloc(code.frequency_bytes + 1);
    assert_non_null(longer);
    memcpy(longer, code.frequencies, code.frequency_bytes);
    longer[code.frequency_bytes] = 0;
    EXPECT_TRUE(!rans_get_frequencies(coder, contexts, longer, longer + code.frequency_bytes + 1));
    free(longer);
    free_code(&code);
}

static void test_frequencies_that_do_not_add_up(void **state)
{
    (void)state;
    const uint8_t too_small[] = {2, 1, 1}, too_large[] = {1, 0x81, 0x20}; // varints of 7 bits: 4097
    const uint8_t too_many[] = {RANS_SYMBOLS_USED + 1}, all[] = {1, 0x80, 0x20}, unused[] = {0};
    EXPECT_TRUE(!rans_get_frequencies(coder, 1, too_small, too_small + sizeof too_small));
    EXPECT_TRUE(!rans_get_frequencies(coder, 1, too_large, too_large + sizeof too_large));
    EXPECT_TRUE(!rans_get_frequencies(coder, 1, too_many, too_many + sizeof too_many));
    EXPECT_TRUE(rans_get_frequencies(coder, 1, all, all + sizeof all));
    EXPECT_INT(coder->context[0].shares[0].frequency, RANS_SUM);
    EXPECT_TRUE(rans_get_frequencies(coder, 1, unused, unused + sizeof unused)); // symbol 0 alone
    EXPECT_INT(coder->context[0].shares[0].frequency, RANS_SUM);
}

static void test_words_that_cannot_begin(void **state)
{
    (void)state;
    struct code code = encode_sample();
    const size_t sizes[] = {0, 2, 3, 5};
    for (size_t i = 0; i < COUNT_OF(sizes); i++)
        for (int stream = 0; stream < RANS_STREAMS; stream++) {
            struct code damaged = code;
            damaged.bytes[stream] = sizes[i];
            EXPECT_STATUS(start(&damaged), NOTHING);
        }
    code.words[0] = code.words[1] = 0; // the lower half, in its second place, alone is below RANS_LOW, or too large
    code.words[2] = code.words[3] = 0;
    EXPECT_STATUS(start(&code), NOTHING);
    memset(code.words, 0xff, 4);
    EXPECT_STATUS(start(&code), NOTHING);
    free_code(&code);
}

// Any bytes are decoded without leaving the memory. The coder is no checksum, damaged bits may only make another
// number; but no other bytes are the code of the same message.
static void test_damaged_words_are_another_message(void **state)
{
    (void)state;
    struct code code = encode_sample();
    struct rng rng = rng_of(SEED, 400);
    EXPECT_TRUE(rans_get_frequencies(coder, contexts, code.frequencies, code.frequencies + code.frequency_bytes));
    for (int round = 0; round < 400; round++) {
        const size_t at = (size_t)rng_pick(&rng, (int)(code.bytes[0] + code.bytes[1]));
        const uint8_t before = code.words[at];
        code.words[at] ^= (uint8_t)(1 + rng_pick(&rng, 255));
        if (start(&code) == OK) {
            const size_t wrong = decode();
            EXPECT_TRUE(wrong || !rans_is_done(coder));
            for (int s = 0; s < RANS_STREAMS; s++)
                EXPECT_TRUE(coder->reader[s].word <= coder->reader[s].end + RANS_NUMBER_BYTES);
        }
        code.words[at] = before;
    }
    free_code(&code);
}

static void test_words_cut_short(void **state)
{
    (void)state;
    struct code code = encode_sample();
    EXPECT_TRUE(rans_get_frequencies(coder, contexts, code.frequencies, code.frequencies + code.frequency_bytes));
    for (size_t count = 4; count < code.bytes[1]; count += 2) {
        struct code cut = code;
        cut.bytes[1] = count;
        EXPECT_STATUS(start(&cut), OK);
        decode();
        EXPECT_TRUE(!rans_is_done(coder));
    }
    free_code(&code);
}

int main(void)
{
    print_message("seed %d\n", SEED);
#define WITH_CODER(test) cmocka_unit_test_setup_teardown(test, open_coder, close_coder)
    const struct CMUnitTest tests[] = {
        WITH_CODER(test_empty_message),
        WITH_CODER(test_each_size_of_number_alone),
        WITH_CODER(test_one_symbol_takes_no_room),
        WITH_CODER(test_all_symbols_evenly),
        WITH_CODER(test_rare_symbols_keep_a_share),
        WITH_CODER(test_streams_of_unequal_length),
        WITH_CODER(test_as_small_as_the_entropy),
        cmocka_unit_test_setup_teardown(test_as_small_as_the_entropy, open_widest_coder, close_coder),
        WITH_CODER(test_capacity_grows_and_stays),
        WITH_CODER(test_groups_find_the_slot_owner),
        WITH_CODER(test_frequencies_cut_or_continued),
        WITH_CODER(test_frequencies_that_do_not_add_up),
        WITH_CODER(test_words_that_cannot_begin),
        WITH_CODER(test_damaged_words_are_another_message),
        WITH_CODER(test_words_cut_short),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
