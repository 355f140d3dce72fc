// Depth agreement: whether a point of the avatar is what a depth frame shows where it projects. This is the visibility
// test of everything that compares colours with the avatar. Axes are the depth camera's, metres. No state; any thread.
#pragma once
#include "reenact/observation/depth_frame.h"
#include "reenact/skeleton/bind_pose.h"

#define DEPTH_AGREEMENT_M 0.05 // a depth sample this near along z confirms a point; chosen by hand

// The pixel that p projects to, row by row; -1: outside the image, or less than 5 cm before the camera.
int depth_pixel_at(const struct lens *lens, struct vec3 p);

// Whether a pixel shows the actor, at least margin_px away from an edge between surfaces, DEPTH_AGREEMENT_M or less
// from depth_m.
bool depth_agrees(const struct depth_frame *s, int pixel, double depth_m, int margin_px);

// Whether depth agrees where p, a point of `bone`, projects, on the bone's part or an adjacent one.
bool depth_agrees_with_bone(const struct depth_frame *s, const struct lens *lens, struct vec3 p, int bone,
                            int margin_px);
