// Reads the triangles of a binary glTF 2.0 file (Khronos, "glTF 2.0 Specification", 2021) as a knowledge base sends it:
// with suspicion, for it comes from a stranger. Meshes of the scene's nodes with positions, normals, texture
// coordinates, base colour and its texture (PNG or JPEG inside the file). Skins, morphs, animation, sparse accessors
// and compressed geometry are not read. Pure but for memory.
//
// By hand, because tinygltf 2.7 (Debian 12) has no limits of its own: it takes an accessor of 2 * 10^9 numbers over a
// view of 36 bytes and nodes that are their own children (two of tests/fuzz/corpus/glb), so every check here would
// stay, behind a second reader of JSON.
#pragma once
#include "platform/files/image_file.h"

enum { GLB_MAX_TRIANGLES = 100000, GLB_MAX_PARTS = 64, GLB_MAX_TEXTURE = 4096 };
// Looking something up in the description takes time in proportion to its length, so that is bounded, too.
enum { GLB_MAX_VISITS = 4096, GLB_MAX_TEXT_BYTES = 1 << 20 }; // visits: nodes and primitives

struct glb_corner {
    float at[3];     // metres, y up, as in the file's scene
    float normal[3]; // unit length
    float uv[2];
};

struct glb_part {
    int first, count; // of the corners, three to a triangle, counter-clockwise from outside
    float color[4];   // base colour factor, linear
    bool two_sided;
    struct image picture; // of the base colour; width 0: none
};

struct glb_model {
    struct glb_corner *corners;
    int corner_count;
    struct glb_part parts[GLB_MAX_PARTS];
    int part_count;
    float low[3], high[3]; // bounds
};

// ERR_INPUT with a sentence: no binary glTF 2.0, nothing to draw, beyond the limits above, or broken. ERR_MEMORY. On
// error *out is zeroed.
MUST_CHECK enum status glb_read(const uint8_t *bytes, size_t count, struct glb_model *out);
void glb_model_free(struct glb_model *model); // zeroed is fine
