// What the points of the colour image suggest that depth alone would not try: places of limbs, and which person in the
// image they are on. Candidates only: depth, limb lengths and the points judge them together by their energy. Pure;
// depth camera's axes, metres.
#pragma once
#include "capture/body/body_fit.h"
#include "capture/segmentation/segment.h"

// A limb's end, and the direction from its root in which its middle joint lies: input of two_bone_ik.h.
struct limb_target {
    struct vec3 end, pole;
};

// The places of limb k in which its middle joint and its end lie on their rays, as far as the limb's lengths allow: a
// ray meets a sphere twice, so that there are up to four. Returns their number.
enum { LIMB_TARGETS_MAX = 4 };
int point_limb_targets(const struct point_evidence *points, const struct body_build *build, int k,
                       struct limb_target out[LIMB_TARGETS_MAX]);

// The points of limb k are far from where the body has them.
bool point_limb_is_disputed(const struct point_evidence *points, const struct body_build *build, int k);

// The middle joint's point of limb k (0), or its end's (1).
enum body_point_name point_of_limb(int k, int which);

// The distance along a point's ray of the surface that depth shows there, within the mask where there is one (may be
// NULL); 0: none, or no ray.
double point_surface_m(const struct point_evidence *points, enum body_point_name name, const struct lens *lens,
                       const uint16_t *depth, const uint8_t *mask);

// Spheres about the surface that depth shows behind the points; returns their number, 0 where the points are not on one
// body. depth: of this lens, millimetres.
enum { POINT_SPHERES_MAX = 2 * BODY_POINT_COUNT };
int point_spheres(const struct point_evidence *points, const struct lens *lens, const uint16_t *depth,
                  struct bounding_sphere out[POINT_SPHERES_MAX]);

// Whether the points are on the person whom the evidence shows, distance_m away.
bool points_are_on_person(const struct point_evidence *points, const struct depth_evidence *evidence,
                          double distance_m);
