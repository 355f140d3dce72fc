// Labels depth pixels with body parts: a point belongs to the part whose capsule (the part's cylinder of [D14] 4.1 with
// hemispherical ends) it is nearest to. Also the rays of a take's depth pixels. Pure; deterministic.
#pragma once
#include "base/depth_noise.h"
#include "recording/recording.h"

// Capsules of one skeleton's known parts. Metres, the skeleton's axes.
struct part_capsules {
    int count;
    enum part part[PART_COUNT];
    struct vec3 from[PART_COUNT], along[PART_COUNT];
    double along2[PART_COUNT], radius[PART_COUNT];
    struct vec3 middle[PART_COUNT];
    double bounding_radius[PART_COUNT]; // of the ball about `middle` that holds the capsule
};
struct part_capsules part_capsules_of(const struct skeleton *skeleton, const struct body *body);

enum { PART_LABEL_PERSON = 1 << 15 };

// Bit p: part p is at most shared_m farther than the nearest part; and PART_LABEL_PERSON. 0: p is more than outside_m
// outside every part.
uint16_t part_label(const struct part_capsules *bones, struct vec3 p, double shared_m, double outside_m);

// The nearest part, the lowest on a tie; -1: p is more than outside_m outside every part.
int part_nearest(const struct part_capsules *bones, struct vec3 p, double outside_m);

// How far outside all parts a pixel may lie and still be the actor's: farther with a mask, which excludes other things,
// than without. Chosen by hand.
double part_max_distance_m(bool has_mask);

// True: the pixel is in the mask (NULL: any with a depth sample), not on the image's border, and at least two of its
// four neighbours lie on one surface with it. At depth edges, samples can lie between the actor and the background.
bool part_pixel_on_surface(const uint16_t *depth, const uint8_t *mask, int width, int height, int i);

// The ray of every depth pixel, made once for a take: 8 bytes a pixel. Immutable, so any number of threads may read it.
struct source_rays;
MUST_CHECK enum status source_rays_open(struct source_rays **out,
                                        const struct calibration *calibration); // ERR_MEMORY: *out is NULL
void source_rays_close(struct source_rays **r);                                 // NULL is fine; sets *r = NULL
int source_rays_count(const struct source_rays *r);
// The point of depth pixel `i` at `depth_mm` > 0, in the COLOUR camera's axes, metres.
struct vec3 source_rays_point(const struct source_rays *r, int i, uint16_t depth_mm);
