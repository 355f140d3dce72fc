// A picture of the surroundings from a free viewpoint, drawn from pictures with dense depth: view-dependent geometry
// (Okura 2014, section 3.4; paper 003, section III-C, b-1), the view-dependent depth test (003, b-2, equation 1), and
// view-dependent texture (b-3; blended as Buehler et al. 2001 do). What no picture has seen is marked, never filled.
//
// Deterministic, CPU only; memory apart, pure.
#pragma once
#include "surround/picture/surround_picture.h"

struct view_options {
    int geometry_pictures; // how many of the nearest pictures give depth, 1..SURROUND_MAX_LAYERS
    int texture_pictures;  // how many are blended in a pixel, 1..4
    bool depth_test;       // equation 1
    double apart;          // depths farther apart than this share are two surfaces, 0.04
};
static const double VIEW_RESOLUTION_COST = 0.3; // radians of angle that half the wanted resolution is worth
enum { SURROUND_MAX_LAYERS = 48 };
struct view_options view_default_options(void);

// What a pixel of source[] holds.
enum { SOURCE_UNSEEN = 0, SOURCE_SEEN = 255 };

struct surround_view {
    struct lens lens;
    struct pose world_from_view;
    double axes[3][3];
    float *inverse_z; // width * height: 1 / z in m; 0 sky; negative: no picture has seen what is there
    int16_t *first;   // width * height: the picture whose geometry was taken
    uint8_t *rgb;     // width * height * 3
    uint8_t *source;  // width * height: SOURCE_…
};

// ERR_MEMORY.
MUST_CHECK enum status surround_view_open(struct surround_view *view, const struct lens *lens);
void surround_view_close(struct surround_view *view); // a zeroed one is fine

// How near a picture is to the view or to what it looks at, a few metres ahead, in metres; one that looks elsewhere is
// as far as a metre for each right angle.
double surround_view_distance(struct pose world_from_view, const struct surround_picture *picture);
// Sorts pictures by that. ERR_MEMORY.
MUST_CHECK enum status surround_view_rank(struct pose world_from_view, const struct surround_picture **pictures,
                                          int count);

// Fills all of *view. The pictures have depth and are sorted by surround_view_rank. ERR_MEMORY.
MUST_CHECK enum status surround_view_draw(struct surround_view *view, struct pose world_from_view,
                                          const struct surround_picture *const *pictures, int count,
                                          const struct view_options *options);

// What a user would take instead, to compare with: every known pixel of every picture as a coloured point, drawn 2 x 2
// pixels large, the nearest winning.
void surround_view_splat(struct surround_view *view, struct pose world_from_view,
                         const struct surround_picture *const *pictures, int count);

// The world point of a pixel with depth; of the sky, one 10 km away.
void surround_view_point(const struct surround_view *view, int x, int y, float inverse_z, double world[3]);
