// Which body part a depth pixel belongs to: the one whose cylinder (with round
// ends) it lies nearest to. Pure.
#pragma once
#include "base/depth_noise.h"
#include "capture/recording/recording.h"

// The known parts of one skeleton. Metres, the skeleton's axes.
struct part_capsules {
    int count;
    enum part part[PART_COUNT];
    struct vec3 from[PART_COUNT], along[PART_COUNT];
    double along2[PART_COUNT], radius[PART_COUNT];
    struct vec3 middle[PART_COUNT];
    double bounding_radius[PART_COUNT]; // from the middle to the farthest of the part
};
struct part_capsules part_capsules_of(const struct skeleton *skeleton, const struct body *body);

enum { PART_LABEL_PERSON = 1 << 15 };

// Bit p: within shared_m of the nearest part, p is as near; and PART_LABEL_PERSON.
// 0: farther than outside_m outside every part.
uint16_t part_label(const struct part_capsules *bones, struct vec3 p, double shared_m, double outside_m);

// The nearest part alone, the lowest of several; -1: farther than outside_m from every part.
int part_nearest(const struct part_capsules *bones, struct vec3 p, double outside_m);

// How far outside all parts a pixel may lie and still be this person: the mask
// knows best, but where there is none, not far.
double part_max_distance_m(bool has_mask);

// True where the pixel is the person's (mask NULL: is there) and at least two of
// its four neighbours lie on one surface with it. At the edges of things depth
// pictures hold readings that hang between the person and what is behind.
bool part_pixel_on_surface(const uint16_t *depth, const uint8_t *mask, int width, int height, int i);

// Every depth pixel's direction, made once for a take.
struct source_rays;
MUST_CHECK enum status source_rays_open(struct source_rays **out, const struct calibration *calibration);
void source_rays_close(struct source_rays **r);
int source_rays_count(const struct source_rays *r);
// The point that depth pixel `i` saw at `depth_mm` > 0, in the COLOUR camera's axes, metres.
struct vec3 source_rays_point(const struct source_rays *r, int i, uint16_t depth_mm);
