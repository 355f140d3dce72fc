// The same network by OpenCV's own layers (cv::dnn), which share nothing with neural/network.c but the file's reader:
// a second opinion on the arithmetic. One thread at a time.
#pragma once
#include "neural/tflite.h"

#ifdef __cplusplus
extern "C" {
#endif

struct network_by_opencv;

// The model is only read, and only here. ERR_FORMAT: an operator that it has no layer for; ERR_SOLVER: OpenCV refused.
MUST_CHECK enum status network_by_opencv_open(struct network_by_opencv **out, const struct tflite_model *model);
void network_by_opencv_close(struct network_by_opencv **n); // NULL is fine; sets *n = NULL

// input: row-major, channels last, as network_input. ERR_SOLVER.
MUST_CHECK enum status network_by_opencv_run(struct network_by_opencv *n, const float *input);
// Output i, in the order of network_output. Valid until the next run.
const float *network_by_opencv_output(const struct network_by_opencv *n, int i, size_t *count);

#ifdef __cplusplus
}
#endif
