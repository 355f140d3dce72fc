// A camera image in the camera driver's own memory (dma-buf), which a graphics driver may be able to read without a
// copy. The camera does not write into it until it is released. Any thread may release it, also after the camera was
// closed.
#pragma once
#include "base/pixels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum dmabuf_layout {
    DMABUF_YUYV, // two pixels in four bytes: Y0 Cb Y1 Cr
    DMABUF_UYVY, // Cb Y0 Cr Y1
    DMABUF_NV12, // a plane of Y and a half-size plane of Cb Cr pairs
    DMABUF_RGBX, // four bytes a pixel
    DMABUF_BGRX,
    DMABUF_LAYOUTS
};

struct dmabuf_plane {
    int file;                // descriptor of the dma-buf; owned by the dmabuf_image
    uint32_t offset, stride; // bytes
};

struct dmabuf_image {
    enum dmabuf_layout layout;
    int width, height;                       // pixels; even where chroma is subsampled
    struct yuv_encoding encoding;            // of YUYV, UYVY, NV12
    struct dmabuf_plane planes[2];           // the second for NV12 only
    void (*release)(struct dmabuf_image *l); // frees it; call dmabuf_image_release()
};

// NULL is fine; sets *image = NULL. Where a GPU reads it, wait for that to end first (gpu.h).
static inline void dmabuf_image_release(struct dmabuf_image **image)
{
    if (*image)
        (*image)->release(*image);
    *image = NULL;
}

#ifdef __cplusplus
}
#endif
