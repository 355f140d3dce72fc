// Builds a binary glTF 2.0 file (Khronos, "glTF 2.0 Specification", 2021, section 4): a JSON tree and one buffer. The
// caller describes scene, nodes, meshes and so on in `root`; these functions keep the buffer, its views and its
// accessors. Pure. Memory that ran out shows in glb_print.
#pragma once
#include "platform/files/json.h"

#include <stdio.h>

struct glb {
    struct json *root;
    struct json *views, *accessors; // in root
    int view_count, accessor_count;
    uint8_t *bytes;
    size_t count, capacity;
    bool failed;
};

enum glb_component { GLB_U8 = 5121, GLB_U16 = 5123, GLB_U32 = 5125, GLB_FLOAT = 5126 };
enum glb_target { GLB_NO_TARGET = 0, GLB_VERTICES = 34962, GLB_INDICES = 34963 };

// What an accessor holds: `count` elements of `width` components: 1, 2, 3, 4, or 16 for a matrix.
struct glb_layout {
    enum glb_component component;
    int width, count;
    enum glb_target target;
    bool bounds; // writes min and max, which positions and times need; floats only
};

void glb_open(struct glb *glb);
void glb_close(struct glb *glb); // zeroed is fine; leaves it zeroed

// Copies the bytes into a view of their own; returns its number.
int glb_add_view(struct glb *glb, const void *bytes, size_t count, enum glb_target target);
// A view and its accessor; returns the accessor's number. Numbers in the machine's order, which must be little-endian.
int glb_add_accessor(struct glb *glb, const void *numbers, const struct glb_layout *layout);

// The whole file; the caller frees *bytes. ERR_MEMORY.
MUST_CHECK enum status glb_print(const struct glb *glb, uint8_t **bytes, size_t *count);
