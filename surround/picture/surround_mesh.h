// The surface that a picture's depth spans, as triangles: few where it is flat, as fine as the picture's pixels at its
// silhouettes. A right-triangulated irregular network (Evans, Kirkpatrick & Townsend 2001) over blocks of 16 x 16
// pixels, without cracks between neighbours of different sizes: a triangle is halved where the depth at the middle of
// its longest side differs from the mean of that side's ends by more than the tolerance. Between pixels that are not
// joined it is cut; there each pixel covers its own quarters, as in view_warp.
//
// Pure but for memory.
#pragma once
#include "surround/picture/surround_picture.h"

// A part of a mesh whose vertices 16-bit indices reach, at most about a radian wide and high.
enum { SURROUND_MESH_RAYS = 25 };
struct surround_mesh_piece {
    float (*vertices)[4]; // unit ray in camera axes; inverse depth along it, 1/m: the point is ray / inverse
    int vertex_count;
    uint16_t *indices; // three a triangle, counter-clockwise in the picture
    int index_count;
    // For culling: a grid of rays over the piece, and the range of its inverse depths.
    float rays[SURROUND_MESH_RAYS][3];
    float least, most;
};

struct surround_mesh {
    struct surround_mesh_piece *pieces; // none is empty
    int count;
};

// The share of a pixel's distance that the mesh may be off so that the point moves by at most the picture's own pixel
// when it is seen from as far aside as it is away.
float surround_mesh_tolerance(const struct surround_picture *picture);

// Of a picture with depth. tolerance: share of a pixel's distance. ERR_MEMORY: *m is empty.
MUST_CHECK enum status surround_mesh_make(struct surround_mesh *m, const struct surround_picture *p, float tolerance);
void surround_mesh_free(struct surround_mesh *mesh); // a zeroed one is fine

// The same, kept with the picture in place of the one that is there; on a thread that has time for it, so that drawing
// need not make it. ERR_MEMORY: it has none.
MUST_CHECK enum status surround_picture_make_mesh(struct surround_picture *p);
// To be called when the depth changes.
void surround_picture_free_mesh(struct surround_picture *picture);
