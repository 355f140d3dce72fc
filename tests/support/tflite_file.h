// Writes small TensorFlow Lite files for tests: FlatBuffers laid out forwards, parents before what they point to.
#pragma once
#include "neural/tflite.h"

enum tflite_file_type { FILE_FLOAT32 = 0, FILE_FLOAT16 = 1, FILE_INT32 = 2 };

struct tflite_file_tensor {
    int dimensions, size[4];
    enum tflite_file_type type;
    const void *data; // NULL: no constant
    size_t bytes;
    // Compressed sparse rows of a two-dimensional constant; NULL: dense.
    const int32_t *segments, *indices;
    int segment_count, index_count;
};

struct tflite_file_operator {
    int kind; // enum tflite_kind
    int inputs[4], input_count, output;
    // Fields of the operator's options, in the file format's order; width in bytes (1 or 4), 0: left out.
    struct {
        int width, value;
    } option[8];
};

struct tflite_file {
    struct tflite_file_tensor tensor[8];
    int tensor_count;
    struct tflite_file_operator op[2];
    int op_count;
    int input, output;
};

enum { TFLITE_FILE_MOST = 1 << 18 };

// Into `out`, TFLITE_FILE_MOST bytes; how many. Asserts that it fits.
size_t tflite_file_write(const struct tflite_file *f, uint8_t *out);
