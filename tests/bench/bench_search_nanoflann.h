// The usual alternative for the nearest pose: nanoflann's k-d tree, in single precision and with its squared Euclidean
// distance.
#pragma once
#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { POSE_NUMBERS = 48 };

struct nanoflann_peer;
// poses: count times POSE_NUMBERS, borrowed.
MUST_CHECK enum status nanoflann_peer_open(struct nanoflann_peer **out, const float *poses, size_t count);
void nanoflann_peer_close(struct nanoflann_peer **p);
MUST_CHECK enum status nanoflann_peer_find(const struct nanoflann_peer *p, const float *pose, size_t *number);

#ifdef __cplusplus
}
#endif
