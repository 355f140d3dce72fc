// Files of networks: constants come out as they were put in, and no damaged file does harm.
#include "tests/support/test.h"

#include "tests/support/tflite_file.h"

enum { SEED = 31 };

// An image of 2 x 2 pixels and 3 channels plus a constant, in one operator.
static struct tflite_file sum_of_two(const struct tflite_file_tensor *constant)
{
    return (struct tflite_file){
        .tensor = {{.dimensions = 2, .size = {3, 4}}, *constant, {.dimensions = 2, .size = {3, 4}}},
        .tensor_count = 3,
        .op = {{.kind = TFLITE_ADD, .inputs = {0, 1}, .input_count = 2, .output = 2, .option = {{1, TFLITE_RELU6}}}},
        .op_count = 1,
        .input = 0,
        .output = 2,
    };
}

static const float numbers[12] = {1, -2, 0.5F, 0, 65504, -0.25F, 3, 4, 5, 6, 7, 8};

static void expect_constant(const struct tflite_file_tensor *constant, const float wanted[12])
{
    static uint8_t bytes[TFLITE_FILE_MOST];
    struct tflite_model m;
    const struct tflite_file file = sum_of_two(constant);
    EXPECT_STATUS(tflite_read(&m, "test", bytes, tflite_file_write(&file, bytes)), OK);
    EXPECT_INT(m.tensor_count, 3);
    EXPECT_INT(m.operator_count, 1);
    EXPECT_INT(m.operators[0].kind, TFLITE_ADD);
    EXPECT_INT(m.operators[0].activation, TFLITE_RELU6);
    EXPECT_INT(m.input, 0);
    EXPECT_INT(m.output[0], 2);
    for (int i = 0; i < 12; i++)
        EXPECT_NEAR((double)m.tensors[1].values[i], (double)wanted[i], 0);
    tflite_free(&m);
}

static void test_floats(void **state)
{
    (void)state;
    expect_constant(&(struct tflite_file_tensor){2, {3, 4}, FILE_FLOAT32, numbers, sizeof numbers, 0, 0, 0, 0},
                    numbers);
}

static void test_half_floats(void **state)
{
    (void)state;
    // The same numbers by IEEE 754's table of half floats; 2^-24 is the least there is.
    static const uint16_t halves[12] = {0x3c00, 0xc000, 0x3800, 0,      0x7bff, 0xb400,
                                        0x4200, 0x4400, 0x4500, 0x4600, 0x0001, 0x8400};
    float wanted[12];
    memcpy(wanted, numbers, sizeof wanted);
    wanted[10] = 0x1p-24F;
    wanted[11] = -0x1p-14F;
    expect_constant(&(struct tflite_file_tensor){2, {3, 4}, FILE_FLOAT16, halves, sizeof halves, 0, 0, 0, 0}, wanted);
}

static void test_sparse_rows(void **state)
{
    (void)state;
    static const float stored[4] = {9, 8, 7, 6};
    static const int32_t segments[4] = {0, 1, 1, 4}, indices[4] = {2, 0, 1, 3};
    static const float wanted[12] = {0, 0, 9, 0, 0, 0, 0, 0, 8, 7, 0, 6};
    expect_constant(
        &(struct tflite_file_tensor){2, {3, 4}, FILE_FLOAT32, stored, sizeof stored, segments, indices, 4, 4}, wanted);
}

static size_t sample(uint8_t *bytes)
{
    static const float stored[4] = {9, 8, 7, 6};
    static const int32_t segments[4] = {0, 1, 1, 4}, indices[4] = {2, 0, 1, 3};
    const struct tflite_file file = sum_of_two(
        &(struct tflite_file_tensor){2, {3, 4}, FILE_FLOAT32, stored, sizeof stored, segments, indices, 4, 4});
    return tflite_file_write(&file, bytes);
}

// From an exact copy, so that the address sanitizer sees each byte read beyond the end.
static enum status read_copy(const uint8_t *bytes, size_t count)
{
    uint8_t *copy = malloc(count ? count : 1);
    struct tflite_model m;
    assert_non_null(copy);
    memcpy(copy, bytes, count);
    enum status status = tflite_read(&m, "test", copy, count);
    tflite_free(&m);
    free(copy);
    return status;
}

static void test_cut_files(void **state)
{
    (void)state;
    static uint8_t bytes[TFLITE_FILE_MOST];
    const size_t count = sample(bytes);
    int refused = 0;
    for (size_t i = 0; i < count; i++)
        refused += read_copy(bytes, i) == ERR_FORMAT;
    EXPECT_AT_LEAST(refused, (double)count - 8); // the last bytes may be padding
    EXPECT_STATUS(read_copy(bytes, count), OK);
}

static void test_damaged_files(void **state)
{
    (void)state;
    static uint8_t bytes[TFLITE_FILE_MOST], damaged[TFLITE_FILE_MOST];
    static const uint8_t values[] = {0, 1, 0x7f, 0x80, 0xff};
    const size_t count = sample(bytes);
    int refused = 0, read = 0;
    for (size_t i = 0; i < count; i++)
        for (size_t v = 0; v < COUNT_OF(values); v++) {
            memcpy(damaged, bytes, count);
            damaged[i] = values[v];
            const enum status status = read_copy(damaged, count);
            EXPECT_TRUE(status == OK || status == ERR_FORMAT);
            *(status == OK ? &read : &refused) += 1;
        }
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    for (int trial = 0; trial < 20000; trial++) { // several at a time
        memcpy(damaged, bytes, count);
        for (int k = 0; k < 1 + trial % 8; k++) {
            const size_t at = (size_t)(rng_uniform(&rng) * (double)count);
            damaged[at] = (uint8_t)(rng_uniform(&rng) * 256);
        }
        const enum status status = read_copy(damaged, count);
        EXPECT_TRUE(status == OK || status == ERR_FORMAT);
    }
    print_message("%d refused, %d read\n", refused, read);
    EXPECT_AT_LEAST(refused, 500);
}

static void test_other_files(void **state)
{
    (void)state;
    EXPECT_STATUS(read_copy((const uint8_t *)"", 0), ERR_FORMAT);
    EXPECT_STATUS(read_copy((const uint8_t *)"not a network at all", 20), ERR_FORMAT);
    EXPECT_STATUS(read_copy((const uint8_t *)"\xff\xff\xff\xffTFL3", 8), ERR_FORMAT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_floats),    cmocka_unit_test(test_half_floats),   cmocka_unit_test(test_sparse_rows),
        cmocka_unit_test(test_cut_files), cmocka_unit_test(test_damaged_files), cmocka_unit_test(test_other_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
