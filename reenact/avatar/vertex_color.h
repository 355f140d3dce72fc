// The colours of the likeness's surface, gathered over the take: what every frame
// that saw a place of the body says about it, and the room's light, so that a
// place has one colour, however it was turned when it was seen. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"
#include "reenact/observation/depth_frame.h"
#include "reenact/avatar/deformation.h"

// Light that falls on a surface by where it faces (world axes): spherical
// harmonics up to the second order; the sum is held within LEAST and MOST, for it
// means nothing where no surface ever faced. 1 is the mean.
enum { LIGHT_TERMS = 9 };
#define LIGHT_LEAST 0.4F
#define LIGHT_MOST  1.6F
struct light {
    float term[LIGHT_TERMS];
};
float light_on(const struct light *light, const float n[3]); // n: unit

struct coat {
    float (*color)[3]; // of each point of the surface, linear, in the mean light
    float *time_s;     // when it was seen best, since the take's first frame
    uint8_t *filled;   // 1: nobody saw it; its colour is made up (color_inpainting.h)
    struct light light;
};

struct coat_maker;
// rest, surface (in it) and skins (of its points) must outlive it. ERR_MEMORY.
MUST_CHECK enum status coat_open(struct coat_maker **out, const struct rest *rest, const struct surface *surface,
                                 const struct skin *skins, const struct calibration *calibration);
void coat_close(struct coat_maker **m);

// What one frame saw, the person being in `posture` (colour camera's axes), bent by `warp`.
void coat_add(struct coat_maker *m, const struct sight *sight, const uint8_t *rgb, const struct posture *posture,
              const struct warp *warp, struct pose world_from_camera, double time_s);

// ERR_MEMORY. coat_free.
MUST_CHECK enum status coat_make(struct coat_maker *m, struct coat *out);
void coat_free(struct coat *c);
