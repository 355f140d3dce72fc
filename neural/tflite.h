// Reads TensorFlow Lite files (FlatBuffers, schema version 3) of small convolutional networks: one subgraph, constants
// in float, half float or half float with block sparsity, which are expanded to float. Quantised networks are refused.
//
// The file is not trusted: every offset and count is checked against its size, every index against its table, and
// memory is bounded by TFLITE_MAX_VALUES, so that a damaged or hostile file gives ERR_FORMAT and nothing else. That
// shapes suit the operators is checked by neural/network.h. Pure; any thread.
#pragma once
#include "base/status.h"

enum {
    TFLITE_MAX_DIMENSIONS = 4,
    TFLITE_MAX_INPUTS = 8,        // of one operator
    TFLITE_MAX_VALUES = 64000000, // all constants together, and each tensor
    TFLITE_MAX_TABLE = 4096,      // tensors, operators, buffers
    TFLITE_MAX_OUTPUTS = 8,
};

// The operators that are read; the numbers are the file format's.
enum tflite_kind {
    TFLITE_ADD = 0,
    TFLITE_CONCATENATION = 2,
    TFLITE_CONV_2D = 3,
    TFLITE_DEPTHWISE_CONV_2D = 4,
    TFLITE_DEPTH_TO_SPACE = 5,
    TFLITE_DEQUANTIZE = 6, // folded away: half-float constants are expanded when they are read
    TFLITE_LOGISTIC = 14,
    TFLITE_MAX_POOL_2D = 17,
    TFLITE_RESHAPE = 22,
    TFLITE_RESIZE_BILINEAR = 23,
    TFLITE_PAD = 34,
    TFLITE_DENSIFY = 124, // folded away, likewise
};

enum tflite_activation { TFLITE_NO_ACTIVATION = 0, TFLITE_RELU = 1, TFLITE_RELU6 = 3 };

struct tflite_tensor {
    int dimensions, size[TFLITE_MAX_DIMENSIONS]; // outermost first: batch, row, column, channel
    size_t count;                                // the product of the sizes
    float *values;                               // of a constant; NULL otherwise
    int32_t *integers;                           // of an integer constant; NULL otherwise
    size_t integer_count;
};

struct tflite_operator {
    enum tflite_kind kind;
    int input_count, input[TFLITE_MAX_INPUTS], output; // tensors; -1: an input that is left out
    enum tflite_activation activation;
    bool valid_padding; // else "same"
    int stride_x, stride_y, filter_x, filter_y;
    int axis, block; // of concatenation; of depth to space
    bool half_pixel_centers;
};

struct tflite_model {
    struct tflite_tensor *tensors;
    int tensor_count;
    struct tflite_operator *operators; // in the order in which they run
    int operator_count;
    int input;
    int output_count, output[TFLITE_MAX_OUTPUTS];
};

// name: for the sentence. ERR_FORMAT: damaged, or a network of another kind; ERR_MEMORY. On any error *out is zeroed.
MUST_CHECK enum status tflite_read(struct tflite_model *out, const char *name, const uint8_t *bytes, size_t count);
void tflite_free(struct tflite_model *model); // leaves it zeroed
