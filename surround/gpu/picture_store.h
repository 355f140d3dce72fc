// The pictures that are on the graphics card: colours and depth in layers of texture arrays, surfaces as meshes. What
// was not drawn for longest makes room. Threads, errors as in platform/screen/gpu.h.
#pragma once
#include "platform/screen/gpu.h"
#include "surround/picture/surround_mesh.h"

struct stored_piece {
    struct gpu_mesh *mesh;
    float rays[SURROUND_MESH_RAYS][3]; // as in surround_mesh_piece
    float least, most;
};

struct stored_picture {
    int64_t depth_number; // 0: the layer is free
    int64_t used;         // when it was drawn last
    struct stored_piece *pieces;
    int count;
};

struct picture_store {
    struct gpu *gpu;
    struct stored_picture *pictures; // one a layer
    int layers, width, height;       // of the arrays; 0: none yet
    // RGB; inverse distances, 1/m; least and most of those about each 2 x 2 pixels, half as wide and high, the least
    // negated where none of the four is measured.
    struct gpu_texture *colors, *depths, *ranges;
    int64_t now;
};

void picture_store_close(struct picture_store *s); // what was zeroed, too

// Makes the arrays fit these pictures, which are of one size, all at a time; what is there is lost if they did not.
// To be called before each image. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status picture_store_fit(struct picture_store *s, const struct surround_picture *const *pictures,
                                         int count);
// The layer of a picture for the present image; -1: it is not there.
int picture_store_find(struct picture_store *s, int64_t depth_number);
// Puts a picture in, in place of one that the present image has not asked for. It has rgb, inverse and joined, and its
// mesh or what one is made of; nothing of it is kept. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status picture_store_add(struct picture_store *s, const struct surround_picture *p, int *layer);
