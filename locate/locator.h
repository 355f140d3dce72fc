// Localises a camera in a place from one image (relocalisation), or from an image and a good guess (tracking).
//
// From scratch: AprilTags are detected, their corners refined (locate/tag_corners.h), and the pose is estimated from
// the corners of all known tags (planar poses by IPPE, Collins & Bartoli 2014, as starts of a robust PnP,
// locate/pose_solver.h) and from the landmarks around (ORB features, Rublee et al. 2011, locate/landmark_matching.h).
// Without a tag in view, landmarks alone give the pose (P3P with RANSAC, locate/relocalization.h). Tracking: tags and
// landmark patches of the last image are found near the guess (KLT, locate/klt_patch.h) and the pose is fused with the
// map's (locate/pose_fusion.h).
//
// Frames: world_from_camera; world axes of the place (z up), camera axes x right, y down, z forward. Order of the
// 6-vectors: rotation x, y, z (radians), translation x, y, z (metres), a small motion of the camera in its own axes;
// 6 x 6 covariances are row-major.
//
// Deterministic; one thread at a time, any thread. A locator holds the place's points twice, 10 bytes a pixel of the
// image and about 1.5 MiB, besides what the tag detector holds.
#pragma once
#include "recording/place.h"

struct locator;

struct locator_options {
    // Accuracy against time; docs/results.md has both for several settings.
    // Of the tag detector where a half-size image leaves something open; 1 = every pixel, slow and sure. Default 1
    double quad_decimate;
    int32_t features;            // of an image that is localised from scratch; 100 .. 1000. Default 1000
    int32_t points;              // landmarks that are tracked from image to image; 30 .. 200. Default 150
    double max_rms_px;           // a tag with larger reprojection error is an outlier. Default 2.5
    double max_position_sigma_m; // a less certain pose is NOTHING. Default 0.05
};
struct locator_options locator_default_options(void);

struct location {
    struct pose world_from_camera;
    double rms_px; // over the tag corners used
    int32_t tags_used, tags_rejected;
    int32_t points_used; // landmarks that agree
    // Of the pose's error, as far as it comes from this image's noise and the residuals seen; errors of the map as a
    // whole are not in it.
    double covariance[36];
    // That part of it that is independent from image to image. All of it for a pose from scratch.
    double noise[36];
    double position_sigma_m; // root of the trace of the translation's part
    // With AMBIGUOUS: the second best world_from_camera, and how much higher its cost is (chi squared).
    struct pose other;
    double other_excess_cost;
};

// Copies what it needs of `place` and `lens`. options NULL: the defaults. On failure *out is NULL. ERR_INPUT: neither
// tags nor enough landmarks in the place, an invalid lens or option, two tags with the same number. ERR_MEMORY.
MUST_CHECK enum status locator_open(struct locator **out, const struct place *place, const struct lens *lens,
                                    const struct locator_options *options);
void locator_close(struct locator **l); // NULL is fine; sets *l = NULL

// With a rolling shutter (lens.readout_s): the expected velocity while the next image is read, angular (rad/s) then
// linear (m/s) in camera axes, and its covariance (6 x 6, row-major). For the next image only; without it the prior is
// that of any hand-held camera. Poses are those of the middle row; their covariance includes what the velocity leaves
// undetermined.
void locator_set_motion_prior(struct locator *locator, const double velocity[6], const double covariance[36]);

// From scratch. color: RGB of the lens's size. depth: millimetres, of the same pixels, or NULL.
// OK         *out filled
// NOTHING    nothing known in view, nothing that fits, or too uncertain (max_position_sigma_m); *out untouched
// AMBIGUOUS  a mirrored pose fits nearly as well; *out holds the better one
// ERR_MEMORY, ERR_SOLVER: of the feature detector; *out untouched, the next image may be tried.
MUST_CHECK enum status locator_localize(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                                        struct location *out);

// Tracking: for an image soon after one that this locator localised or tracked. What was seen there is looked for near
// where `guess`, world_from_camera, puts it (to about ten pixels); takes a fifteenth of the time.
// OK; NOTHING: too little of it is found, *out untouched: localise from scratch. Errors as locator_localize.
MUST_CHECK enum status locator_track(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                                     struct pose guess, struct location *out);

// locator_localize for an image for which locator_track had no good guess: what the last image showed is looked for
// near the pose from scratch, so that tracking continues without a jump.
MUST_CHECK enum status locator_relocalize(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                                          struct location *out);

// The lens used for the last image. A focal length that is uncertain (lens.focal_sigma) is estimated from the images
// (self-calibration); as long as it is uncertain, the pose's covariance includes that. A rolling shutter that is not in
// the given lens but that the images show is in it, too, with a likely readout_s that was not measured.
const struct lens *locator_lens(const struct locator *locator);

// The numbers of the place's tags that the last image showed, each once, lowest first. Returns how many, at most
// `capacity`.
int locator_seen_tags(const struct locator *locator, int32_t *ids, int capacity);

// The measured depth of the last image's tags over the one that their size in the image says, weighted by that size;
// 0: no tag with depth. A sensor whose depth is right has 1 but for some parts in a thousand.
double locator_depth_scale(const struct locator *locator);

// How many tags of the place are elsewhere now, judged by the images localised from scratch that show them beside other
// tags or enough landmarks. *first: the lowest number; -1: none. Such tags are outliers of the pose.
int32_t locator_moved_tags(const struct locator *locator, int32_t *first);

// True: the images localised from scratch so far do not fit the lens's focal length. *scale: the one that fits, over
// the lens's.
bool locator_focal_is_wrong(const struct locator *locator, double *scale);
