// surround_view_draw by the graphics card: a picture of the surroundings from a free viewpoint, for every image that a
// display shows. Each picture's colours, depth and surface (surround_mesh.h) are uploaded once and stay there.
//
// Two passes. The first draws the surfaces of the nearest pictures into one image of 1 / z: what other pictures look
// through (the view-dependent depth test) lies behind all that they do not, and is left out where most look through it,
// as is what nothing supports: extrapolated in a picture after the eight nearest, and seen by none of these. Of
// surfaces that agree that of the nearest picture is taken, where surround_view_draw takes their mean. The second gives
// each pixel the colours of the two best pictures. What no picture has seen has alpha 0.
//
// Threads, errors and images as in platform/screen/gpu.h.
#pragma once
#include "platform/screen/gpu.h"
#include "surround/view/surround_view.h"

// At most so many pictures make an image; the first of the list are taken, of one camera (size and lens): the first's.
// A picture takes 7 bytes a pixel of the graphics card's memory, and about 16 for each vertex of its surface.
enum { SURROUND_RENDERER_MOST = 16 };

struct surround_renderer;
// ERR_DEVICE: this driver cannot; ERR_MEMORY.
MUST_CHECK enum status surround_renderer_open(struct surround_renderer **out, struct gpu *gpu);
void surround_renderer_close(struct surround_renderer **r); // NULL is fine

struct surround_image {
    struct lens lens; // ideal
    struct pose world_from_view;
    struct view_options how; // texture_pictures is 2
    bool hatched;            // what was not seen is hatched, opaque over black; else black
    int most_uploads;        // new pictures in one call, so that none takes long; 0: all
};

// The pictures have depth with a depth_number each, and are sorted by surround_view_rank. The texture is the
// renderer's, valid until the next call. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_renderer_draw(struct surround_renderer *r, const struct surround_image *image,
                                              const struct surround_picture *const *pictures, int count,
                                              const struct gpu_texture **out);

// How many of the last image's pictures were left out because of most_uploads.
int surround_renderer_missing(const struct surround_renderer *r);

// A transparent box over the last image, hidden where something stands in front of it. Not drawn where the eye is
// inside. low, high: opposite corners in the box's axes.
struct surround_box {
    struct pose world_from_box;
    double low[3], high[3];
    uint8_t color[3];
    double opacity; // 0..1
};
void surround_renderer_tint(struct surround_renderer *r, const struct surround_box *box);

// Depth of every step-th pixel of the last image: *view gets its lens, its pose, inverse_z, and source; it is opened
// where its size is another. Waits for that image alone if it is called before the next one is drawn. NOTHING: none
// was drawn yet. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_renderer_read_depth(struct surround_renderer *r, int step, struct surround_view *view);
