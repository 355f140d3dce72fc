// Runs a small convolutional network that neural/tflite.h has read: float, one image at a time, one thread.
//
// Each sum is taken in the same order whatever the width of the processor's vectors, and exp is base/portable_math.h's,
// so the same image gives the same bits on SSE2, AVX2 and NEON. Convolutions are matrix products of gathered patches
// (im2col, Chellapilla et al. 2006) in blocks of 4 pixels by 16 channels.
#pragma once
#include "neural/tflite.h"

struct network;

// Takes the model over and leaves it zeroed, on failure too. outputs: bit i: output i is wanted; what only the others
// need is not computed. ERR_FORMAT: shapes do not suit the operators; ERR_MEMORY. One thread at a time for each
// network.
MUST_CHECK enum status network_open(struct network **out, const char *name, struct tflite_model *model,
                                    unsigned outputs);
void network_close(struct network **n); // NULL is fine

// Row-major, channels last; to be filled before network_run, which leaves it as it is.
float *network_input(struct network *network, size_t *count);
void network_run(struct network *network);
// Output i, which was wanted. Valid until the next run.
const float *network_output(const struct network *network, int i, size_t *count);
