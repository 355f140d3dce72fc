// A camera's picture lent where it lies: in memory of the camera's driver that a
// graphics driver may be able to read too (dma-buf), so that nobody has to copy it.
// The camera does not write into it until it is given back, which any thread may do,
// also after the camera was closed.
#pragma once
#include "base/pixels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum loan_layout {
    LOAN_YUYV, // two pixels in four bytes: Y0 Cb Y1 Cr
    LOAN_UYVY, // Cb Y0 Cr Y1
    LOAN_NV12, // a plane of Y and a half-size plane of Cb Cr pairs
    LOAN_RGBX, // four bytes a pixel
    LOAN_BGRX,
    LOAN_LAYOUTS
};

struct loan_plane {
    int file;                // dma-buf; the loan's
    uint32_t offset, stride; // bytes
};

struct loan {
    enum loan_layout layout;
    int width, height;          // pixels; even where colour is halved
    struct yuv_meaning meaning; // of YUYV, UYVY, NV12
    struct loan_plane planes[2];
    void (*give_back)(struct loan *l); // frees it
};

// NULL is fine; sets *l = NULL. Whoever let a GPU read it waits for that to end first.
static inline void loan_return(struct loan **l)
{
    if (*l)
        (*l)->give_back(*l);
    *l = NULL;
}

#ifdef __cplusplus
}
#endif
