// What the recordings of a telephone with a depth sensor (Apple's ARKit) have in common, whichever program made them.
// For record3d.c and stray_scanner.c.
//
// Depth is smaller than colour and registered to it: one lens, at two sizes. Images are stored as the chip reads them,
// or turned by the program that made them, and a telephone may be held upright or on its side; the poses tell, and all
// images of a film are turned by the same quarter turns so that up in the room is up in the picture.
//
// A pose is where ARKit's odometry (camera and inertial sensors) has the camera, in axes with y up along gravity, as it
// is to about half a degree. It comes out in the house's axes: world z up, camera x right, y down, z forward.
//
// Each depth sample has a confidence of 0 (low), 1 or 2. Low is no reading: the sensor's light did not come back, and
// the number is guessed from the picture. Medium is kept: dark cloth and outlines are medium, and without them a person
// has holes. That rests on Apple's description; there was no telephone to measure it with.
#pragma once
#include "platform/sensors/source.h"

struct telephone {
    int turns;                // clockwise quarter turns from a stored image to a frame's, 0 to 3
    struct lens color;        // of the stored images
    int width, height;        // of the stored depth images
    uint8_t *rgb, *turned;    // a stored image, to be filled by the caller, and what telephone_color makes of it
    uint16_t *mm, *turned_mm; // likewise depth
};

// Which camera axes a pose is in.
enum telephone_axes {
    TELEPHONE_BACKWARD, // ARKit's: x right, y up, z backward
    TELEPHONE_FORWARD,  // x right, y down, z forward
};

// False: no pose, the numbers are not those of one. *world_from_camera is of a stored image.
bool telephone_pose(struct quat rotation, struct vec3 translation, enum telephone_axes axes,
                    struct pose *world_from_camera);

// The poses of a film, of its stored images.
struct telephone_poses {
    struct pose *at;
    bool *known;
    int64_t count;
};

// color: of the stored images. Fills *calibration. ERR_INPUT: depth is of another shape than colour, a lens that cannot
// be, images too large; `name` is for the sentence. ERR_MEMORY. telephone_close in any case.
MUST_CHECK enum status telephone_open(struct telephone *telephone, const char *name, const struct lens *color,
                                      const int depth_size[2], const struct telephone_poses *poses,
                                      struct calibration *calibration);
void telephone_close(struct telephone *telephone);

// The images as a frame has them; borrowed until the next call.
const uint8_t *telephone_color(struct telephone *telephone);
const uint16_t *telephone_depth(struct telephone *telephone);

// Depth below a confidence of 1 becomes 0; confidence NULL: there is none.
void telephone_drop_guesses(struct telephone *telephone, const uint8_t *confidence);

// Sets the frame's odometry from a stored image's pose.
void telephone_set_odometry(const struct telephone *telephone, const struct telephone_poses *poses, int64_t at,
                            struct frame *out);
