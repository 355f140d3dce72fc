// Which pixels of a depth picture are the person: by depth alone, frame after
// frame, from a sensor that stands still.
//
// The floor is found (or given), what stands on it falls apart into components
// of continuous depth, and the one most like a person is followed from then
// on. What stays where it is becomes the background and is never taken for the
// person again. Works on a grid of at most 320 columns; the mask is refined to
// every pixel.
//
// Frames: depth camera's axes (x right, y down, z forward), metres. Depth is
// millimetres, 0 = no reading. Deterministic and strictly causal. One handle,
// one thread.
#pragma once
#include "base/lens.h"

struct segmenter;

// The sensor's depth noise, metres, at depth z metres: 1.5e-3 z^2, measured for
// structured light (Khoshelham and Elberink, Sensors 2012).
static inline double depth_sigma_m(double z) { return 1.5e-3 * z * z; }

// Where a picture has readings at all, pixels, inclusive: registered depth has a
// rim without any, and a person who is cut off there is cut off as by the
// picture's own edge. The whole picture where most of it has no reading.
struct image_bounds {
    int left, top, right, bottom;
};
struct image_bounds find_image_bounds(const uint16_t *depth, const struct lens *lens);

// Where the body is believed to be; what is close to it is taken for the person.
struct bounding_sphere {
    struct vec3 centre;
    double radius;
};

// Copies the lens. ERR_INPUT: a senseless lens. ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status segmenter_open(struct segmenter **out, const struct lens *depth_lens);
void segmenter_close(struct segmenter **s); // NULL is fine; sets *s = NULL

// Forgets the person; the floor and the background stay.
void segmenter_drop_person(struct segmenter *s);
// Forgets everything but what was given with the two functions below.
void segmenter_reset(struct segmenter *s);

// The empty room as this sensor sees it from where it stands, one value a depth
// pixel, 0 = unknown; copied. NULL takes the knowledge back.
void segmenter_set_background(struct segmenter *s, const uint16_t *depth);

// The floor, when it is known: `up` (unit, against gravity) and how far the
// sensor is above it. A point is up.p + height_m over the floor.
void segmenter_set_floor(struct segmenter *s, struct vec3 up, double height_m);
// False while no floor was given or found; *up is then straight up in the picture.
bool segmenter_floor(const struct segmenter *s, struct vec3 *up, double *height_m);

// Fills mask[width * height] with 255 at the person's pixels and 0 elsewhere.
// spheres: the body as predicted for this frame, or none (count 0) when nobody is
// followed yet. OK, or NOTHING: no person in sight; the mask is then all 0.
MUST_CHECK enum status segmenter_next(struct segmenter *s, const uint16_t *depth, const struct bounding_sphere *spheres,
                                      int sphere_count, uint8_t *mask);

// After segmenter_next: somebody else in the same picture who is like a person, nearer than the learned room and no
// part of the one who is followed, as a mask like theirs. NOTHING: nobody.
MUST_CHECK enum status segmenter_second_person(struct segmenter *s, const uint16_t *depth, uint8_t *mask);

// For how many calls of segmenter_update_background in a row nothing of the person has moved by more than the sensor's
// noise.
int segmenter_static_frames(const struct segmenter *s);

// The last frame's person was furniture: room from now on.
void segmenter_absorb_static(struct segmenter *s);

// Learns the room from the last frame's pixels outside its mask; call it after
// a segmenter_next whose mask is believed, or that found nobody, every second one or so.
void segmenter_update_background(struct segmenter *s);
