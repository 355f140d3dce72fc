// A picture of the surroundings: an equirectangular panorama or a perspective picture, its pose, and the depth of each
// of its pixels.
//
// Camera axes x right, y down, z forward; metres. Equirectangular: column u is the angle (u + 0.5) / width 2 pi - pi
// about the vertical, 0 straight ahead, growing to the right; row v is (v + 0.5) / height pi below the zenith. Depth is
// kept as the inverse of the distance along the pixel's ray, because that is linear in the unit ray on every plane:
// 1 / distance = a . ray, with a = n / d of the plane n . p = d.
//
// Pure but for memory; a picture may be read by any number of threads.
#pragma once
#include "base/lens.h"

// inverse[] of a pixel: 1/m of its ray's length. 0: infinitely far (sky). Negative: not known.
#define DEPTH_UNKNOWN (-1.0f)

// joined[]: which neighbours lie on the same surface as a pixel, and where its depth comes from.
enum {
    JOINED_RIGHT = 1,
    JOINED_DOWN = 2,
    JOINED_DIAGONAL = 4,   // all of the four pixels right and down of this one
    DEPTH_EXTRAPOLATED = 8 // not measured: no point is near it in the picture, the surface beside it was extended
};

struct surround_picture {
    bool panorama;     // else perspective, by lens
    int width, height; // pixels
    struct lens lens;  // of a perspective picture; ideal (undistort first)
    struct pose world_from_camera;
    int64_t time_ns;
    uint8_t *rgb;               // width * height * 3, owned
    float *inverse;             // width * height, owned; NULL until the depth is made
    uint8_t *joined;            // width * height, owned; with inverse
    struct surround_mesh *mesh; // of this depth, owned; NULL: none was made
    int64_t depth_number; // of this depth among all of a set's, also earlier ones of this picture; 0: none was given
    float gain[3];        // what the colours are multiplied by so that all pictures have one exposure; 1 at first
    float *ray_table;     // sine and cosine of each column, then of each row (panoramas), owned
    double axes[3][3];    // the rotation of world_from_camera as a matrix, set by surround_picture_place
};

// A picture of `rgb`, which it owns from now on, also after a failure. lens NULL: a panorama. ERR_MEMORY.
MUST_CHECK enum status surround_picture_make(struct surround_picture *picture, uint8_t *rgb, int width, int height,
                                             const struct lens *lens);
// The image that an ideal lens of the same size and focal length would have taken: rgb as `lens` took it, in place of
// which the result is written; lens loses its distortion. ERR_MEMORY.
MUST_CHECK enum status surround_image_undistort(uint8_t *rgb, struct lens *lens);
void surround_picture_free(struct surround_picture *picture); // a zeroed one is fine

void surround_picture_place(struct surround_picture *picture, struct pose world_from_camera);

// Marks the pixels that lie on one surface: neighbours whose depth continues each other's slope within 3 %.
// Needs inverse; fills joined, without DEPTH_EXTRAPOLATED.
void surround_picture_join(struct surround_picture *picture);

// The column that u stands for: a panorama's last column borders on its first, so that u may be up to a width outside.
// Other pictures do not wrap.
static inline int surround_picture_column(const struct surround_picture *picture, int u)
{
    if (!picture->panorama)
        return u;
    if (u < 0)
        return u + picture->width;
    return u >= picture->width ? u - picture->width : u;
}

// Unit vector in camera axes through a pixel.
void surround_picture_ray(const struct surround_picture *picture, int u, int v, float ray[3]);

struct picture_point {
    float u, v;     // pixels
    float distance; // metres, along the ray
};

// Where a world point lies in the picture. False: behind a perspective picture or outside it. Panoramas wrap: u is in
// [-0.5, width - 0.5).
bool surround_picture_project(const struct surround_picture *picture, const double world[3], struct picture_point *out);

// The colour at (u, v), by Catmull-Rom interpolation, times the gain.
void surround_picture_sample(const struct surround_picture *picture, float u, float v, float rgb[3]);

// ---------------------------------------------------------------- surround mesh

// The surface that a picture's depth spans, as triangles: few where it is flat, as fine as the picture's pixels at its
// silhouettes. A right-triangulated irregular network (Evans, Kirkpatrick & Townsend 2001) over blocks of 16 x 16
// pixels, without cracks between neighbours of different sizes: a triangle is halved where the depth at the middle of
// its longest side differs from the mean of that side's ends by more than the tolerance. Between pixels that are not
// joined it is cut; there each pixel covers its own quarters, as in view_warp.
//
// Pure but for memory.

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
MUST_CHECK enum status surround_mesh_make(struct surround_mesh *m, const struct surround_picture *picture,
                                          float tolerance);
void surround_mesh_free(struct surround_mesh *mesh); // a zeroed one is fine

// The same, kept with the picture in place of the one that is there; on a thread that has time for it, so that drawing
// need not make it. ERR_MEMORY: it has none.
MUST_CHECK enum status surround_picture_make_mesh(struct surround_picture *picture);
// To be called when the depth changes.
void surround_picture_free_mesh(struct surround_picture *picture);
