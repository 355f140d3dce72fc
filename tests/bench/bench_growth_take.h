// Growth with the length of a take: writing, opening, memory; and memory while a take is watched.
#pragma once
#include "tests/bench/bench_page.h"

enum { BENCH_TAKE_CURVES = 3 }; // writing, opening to the index, skeletons for watching

// index_bytes: over the frames of a take. watching_bytes: of the process, over the frames drawn.
MUST_CHECK enum status bench_grow_takes(struct bench_curve time[BENCH_TAKE_CURVES], struct bench_curve *index_bytes,
                                        struct bench_curve *watching_bytes);
