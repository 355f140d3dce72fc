// Pictures that lie in somebody else's memory (dma-buf), as textures without a copy
// (EGLImage), and fences, which tell when the GPU is done with them. Threads and
// errors as in gpu.h.
#pragma once
#include "platform/gpu.h"

// The driver says that it can. Whether it can read a given memory shows when it is tried.
bool gpu_can_import(struct gpu *g);

struct gpu_dmabuf {
    int file;                // dma-buf; not needed any more once it is a texture
    uint32_t offset, stride; // bytes
};
// A texture that is that memory, not filtered, for a format of 1, 2 or 4 bytes a pixel. Not to be written.
// ERR_DEVICE: the driver cannot read it; nothing else is the matter then.
MUST_CHECK enum status gpu_texture_import(struct gpu_texture **out, struct gpu *g, enum gpu_format format, int width,
                                          int height, const struct gpu_dmabuf *memory);

struct gpu_fence;
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status gpu_fence_open(struct gpu_fence **out, struct gpu *g);
// All that was drawn before the fence was opened is done; wait: for at most a second. A lost context is done, too.
bool gpu_fence_passed(struct gpu_fence *f, bool wait);
void gpu_fence_close(struct gpu_fence **f); // NULL is fine
