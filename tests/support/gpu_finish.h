// Waits for the GPU, where what it draws is timed and not read.
#pragma once
#include "platform/screen/gpu.h"

// Returns when all draws issued so far are complete. ERR_DEVICE: the context was lost, or an error was raised since the
// last check; ERR_MEMORY.
static inline enum status gpu_finish(struct gpu *gpu)
{
    struct gpu_fence *fence;
    const enum status status = gpu_fence_open(&fence, gpu);
    if (status != OK)
        return status;
    while (!gpu_fence_passed(fence, true))
        ; // a second more
    gpu_fence_close(&fence);
    return gpu_check(gpu);
}
