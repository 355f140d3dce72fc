// Copies a take within its recording with its frames changed.
#pragma once
#include "recording/recording.h"

struct retaken {
    int64_t number, time_ns;
    uint8_t *rgb;
    uint16_t *depth;
    uint8_t *mask;     // 1: the person
    int width, height; // of all three
};

// The take must have colour, depth of the same size and a mask. Errors abort.
void retake(const char *file, const char *take, const char *name, void (*change)(void *self, struct retaken *frame),
            void *self);
