// Segmentation: which pixels of a depth image show the person, from depth alone, for a sensor that stands still.
//
// Method: cells in front of the floor plane and of the background model are grouped into components of continuous depth
// (union-find). The component with the highest person score is followed from frame to frame, first by overlap, then by
// the predicted body. What stays static becomes background and is never taken for the person again. The grid has at
// most 320 columns; its mask is upsampled to every pixel. The person score is a heuristic of its own (size, height over
// the floor, width at the top, place in the image); see person_score in segment.c.
//
// Frames: depth camera's axes (x right, y down, z forward), metres. Depth is millimetres, 0 = no depth. Deterministic
// and causal. One handle, one thread.
#pragma once
#include "base/lens.h"

struct segmenter;

// Where a part of the body is predicted; cells close to it are taken for the person.
struct bounding_sphere {
    struct vec3 centre;
    double radius;
};

// Copies the lens. ERR_INPUT: an invalid lens. ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status segmenter_open(struct segmenter **out, const struct lens *depth_lens);
void segmenter_close(struct segmenter **segmenter); // NULL is fine; sets *segmenter = NULL

// Forgets the person; the floor and the background stay.
void segmenter_drop_person(struct segmenter *segmenter);
// Forgets everything but what was set with the two functions below.
void segmenter_reset(struct segmenter *segmenter);

// The empty room's depth from where this sensor stands, one value a depth pixel, 0 = unknown; copied. NULL: unknown
// everywhere again.
void segmenter_set_background(struct segmenter *segmenter, const uint16_t *depth);

// The floor, where it is known: `up` (unit, against gravity) and the sensor's height over it. A point is
// up.p + height_m over the floor.
void segmenter_set_floor(struct segmenter *segmenter, struct vec3 up, double height_m);
// False while no floor was set or found; *up is then straight up in the image.
bool segmenter_floor(const struct segmenter *segmenter, struct vec3 *up, double *height_m);

// Fills mask[width * height] with 255 at the person's pixels and 0 elsewhere. spheres: the body as predicted for this
// frame, or none (count 0) while no person is followed. OK, or NOTHING: no person is visible; the mask is then all 0.
// ERR_MEMORY: the mask is all 0, the next frame may be tried as usual.
MUST_CHECK enum status segmenter_next(struct segmenter *s, const uint16_t *depth, const struct bounding_sphere *spheres,
                                      int sphere_count, uint8_t *mask);

// After a segmenter_next or segmenter_next_candidate without spheres of a person who is not followed yet: the same for
// the component that resembles a person next most. NOTHING: there is no other; the mask is then all 0.
MUST_CHECK enum status segmenter_next_candidate(struct segmenter *s, const uint16_t *depth, uint8_t *mask);

// After segmenter_next: the mask of another person in the same frame, in front of the background model and no part of
// the person who is followed. NOTHING: there is none; the mask is then all 0.
MUST_CHECK enum status segmenter_second_person(struct segmenter *s, const uint16_t *depth, uint8_t *mask);

// The number of calls of segmenter_update_background in a row in which no part of the person moved by more than the
// sensor's noise.
int segmenter_static_frames(const struct segmenter *segmenter);

// Adds the last frame's person to the background model: it was a static object.
void segmenter_absorb_static(struct segmenter *segmenter);

// Updates the background model from the last frame's pixels outside its mask. To be called after a segmenter_next whose
// mask is accepted, or that found no person; about every second one is enough.
void segmenter_update_background(struct segmenter *segmenter);
