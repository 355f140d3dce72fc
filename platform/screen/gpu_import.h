// Textures over memory of another device (dma-buf imported as an EGLImage, without a copy), and fences, which tell when
// the GPU has finished reading it. Threads and errors as in gpu.h.
#pragma once
#include "platform/screen/gpu.h"

// Whether the driver offers the extensions and formats. A given buffer may still be refused by gpu_texture_import.
bool gpu_can_import(struct gpu *g);

struct gpu_dmabuf {
    int file;                // descriptor of the dma-buf; may be closed after gpu_texture_import
    uint32_t offset, stride; // bytes
};
// A texture over the memory, with nearest filtering, for formats of 1, 2 or 4 bytes a pixel. It must not be written.
// ERR_DEVICE: the driver cannot read the memory; the gpu remains usable. ERR_MEMORY.
MUST_CHECK enum status gpu_texture_import(struct gpu_texture **out, struct gpu *g, enum gpu_format format, int width,
                                          int height, const struct gpu_dmabuf *memory);

struct gpu_fence;
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status gpu_fence_open(struct gpu_fence **out, struct gpu *g);
// Whether all draws issued before the fence was opened are complete. wait: waits for that, at most a second. True for a
// lost context.
bool gpu_fence_passed(struct gpu_fence *f, bool wait);
void gpu_fence_close(struct gpu_fence **f); // NULL is fine
