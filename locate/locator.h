// Where a camera is in a place, from one picture: finds the tags, refines their
// corners, and fits the pose to all corners of all known tags and to the natural
// points around. Where no tag is in sight, natural points alone say where it is.
// Deterministic; safe from any thread, one `struct locator` to a thread.
#pragma once
#include "capture/recording/place.h"

struct locator;

struct locator_options {
    // Error against time; docs/figures.md has both for several settings.
    // The tag finder's, where a picture half as large leaves something open; 1 = every pixel, slow and sure. Default 1
    double quad_decimate;
    int32_t features;  // natural ones of a picture in which the camera is found anew; 100 .. 1000. Default 1000
    int32_t points;    // of the place that are followed from picture to picture; 30 .. 200. Default 150
    double max_rms_px; // a worse fit is NOTHING. Default 2.5
    double max_position_sigma_m; // a pose less sure than this is NOTHING. Default 0.05
};
struct locator_options locator_default_options(void);

struct location {
    struct pose world_from_camera;
    double rms_px; // over the corners used
    int32_t tags_used, tags_rejected;
    int32_t points_used; // natural points that agree
    // Of a small motion of the camera in its own axes: turn (radians), then shift (metres).
    // The shift's part is that of the camera's position. It knows the noise of this picture
    // and the errors seen, not what the map as a whole is off by.
    double covariance[36]; // row-major
    // The part of it that is another in each picture. Where a camera is found anew, all.
    double noise[36];
    double position_sigma_m; // root of the trace of the shift's part
    // With AMBIGUOUS: the second best world_from_camera, and by how much worse it fits (chi squared).
    struct pose other;
    double other_excess_cost;
};

// Copies what it needs of `place` and `lens`. ERR_INPUT: neither tags nor enough
// points in the place, a senseless lens, two tags with the same number. ERR_MEMORY.
MUST_CHECK enum status locator_open(struct locator **out, const struct place *place, const struct lens *lens,
                                    const struct locator_options *options);
void locator_close(struct locator **l);

// With a rolling shutter (lens.readout_s): how the camera should be moving while the next picture is
// read, turn (rad/s) and shift (m/s) in its own axes, and how sure that is (6 x 6, row-major). Holds
// for the next look only; of a picture without it, as much is known as of any hand. Poses are those of
// the middle row, and by how much the speed that the picture itself shows leaves them open is in their
// covariance.
void locator_set_motion_prior(struct locator *l, const double speed[6], const double covariance[36]);

// color: RGB of the lens's size. depth: of the same pixels, or NULL.
// OK         *out filled
// NOTHING    nothing known in sight, nothing that fits, or too little to be sure
//            (max_position_sigma_m); *out untouched
// AMBIGUOUS  a mirrored pose fits nearly as well; *out holds the better one
MUST_CHECK enum status locator_localize(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                        struct location *out);

// The same for a picture that comes soon after one in which this locator found or followed
// the camera: what was seen there is looked for near where `guess`, world_from_camera, puts it
// (to about ten pixels), which takes a fifteenth of the time.
// OK; NOTHING: too little of it is there, *out untouched: find the camera anew.
MUST_CHECK enum status locator_track(struct locator *l, const uint8_t *color, const uint16_t *depth, struct pose guess,
                                     struct location *out);

// locator_localize for a picture that locator_track had no good guess for: what was seen in the last
// one is looked for where the camera is found, so that it is followed on without a jump.
MUST_CHECK enum status locator_relocalize(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                          struct location *out);

// The lens by which the last picture was looked at. That of a camera whose focal length is unsure (lens.focal_sigma)
// becomes what the pictures say of it; so long as they leave it open, the pose's covariance knows of it. A rolling
// shutter that nobody told and the pictures betray is in it too, with a likely readout_s that was not measured.
const struct lens *locator_lens(const struct locator *l);

// How many tags of the place hang elsewhere now, as far as the pictures in which the camera was found anew show them
// beside other tags or enough points. *first: the lowest number; -1: none. A pose is told without them.
int32_t locator_moved_tags(const struct locator *l, int32_t *first);

// True: the pictures in which locator_localize found the camera so far do not fit the lens's focal
// length. *scale: the one that fits them, over the lens's.
bool locator_focal_is_wrong(const struct locator *l, double *scale);
