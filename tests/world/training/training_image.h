// The depth image of a training scene, as its sensor sees it, with the truth: which part of the person each pixel
// shows, and where the joints are. Internal to tests/world.
#pragma once
#include "recording/skeleton.h"
#include "tests/world/training/training_scene.h"

enum { TRAINING_PIXELS = 320 * 240, TRAINING_NOTHING = 0, TRAINING_OTHER = 255 };

struct training_image {
    int width, height;
    uint16_t depth[TRAINING_PIXELS]; // mm; 0: no reading
    uint8_t part[TRAINING_PIXELS];   // 1 + enum bone of the person's; TRAINING_OTHER: another person's
    // Camera axes. confidence: 1 on what is seen of the person, 0.5 hidden in the picture, 0 outside of it.
    struct skeleton joints;
    bool person;        // is in the picture: a twentieth of the body's pixels and 60 at least are seen
    double cut, hidden; // shares of the body's pixels: outside of the picture, behind something
    double facing_rad;  // of the pelvis: 0 towards the camera, positive to the person's left
};

// Scratch for images of these people.
struct training_renderer;
MUST_CHECK enum status training_renderer_open(struct training_renderer **out, const struct training_people *people);
void training_renderer_close(struct training_renderer **renderer); // NULL is fine

MUST_CHECK enum status training_image_render(struct training_renderer *renderer, const struct training_scene *scene,
                                             struct training_image *out);
