// A camera's picture lent where it lies: in memory of the camera's driver that a
// graphics driver may be able to read too (dma-buf), so that nobody has to copy it.
// The camera does not write into it until it is given back, which any thread may do,
// also after the camera was closed.
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
    int file;                // dma-buf; the loan's
    uint32_t offset, stride; // bytes
};

struct dmabuf_image {
    enum dmabuf_layout layout;
    int width, height;            // pixels; even where colour is halved
    struct yuv_encoding encoding; // of YUYV, UYVY, NV12
    struct dmabuf_plane planes[2];
    void (*release)(struct dmabuf_image *l); // frees it
};

// NULL is fine; sets *l = NULL. Whoever let a GPU read it waits for that to end first.
static inline void dmabuf_image_release(struct dmabuf_image **l)
{
    if (*l)
        (*l)->release(*l);
    *l = NULL;
}

#ifdef __cplusplus
}
#endif
