// A place: the map of a room, in which a camera is localised. Made by capture/mapping/mapper, stored in a recording,
// used by locate. World axes: z up, z = 0 on the floor, metres; x and y are the lowest-numbered tag's; without tags x
// points to the right of the sweep's first view, and the origin is below it.
#pragma once
#include "base/lens.h"
#include "base/status.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- pose score

// How well a pose shows the body: what the representative frame of a take is chosen by.
// Method: Dayrit et al. 2014 [D14], section 4.1, equations 2 and 3.

// Equation 3, E: larger is better, at least 0. Arms that are not known add nothing; corrected for the side that faces
// the camera. Pure.
double pose_score(const struct skeleton *skeleton);

// ---------------------------------------------------------------- place

// A square tag. Its axes: origin at its centre, x right, y up, z out of the wall towards the viewer, so its corners
// are (-+side/2, -+side/2, 0).
struct place_tag {
    int32_t id;    // of family tag36h11
    double side_m; // outer edge of the black square
    struct pose world_from_tag;
    double rms_px;        // reprojection error of a corner over its observations in the map; 0: exact
    int32_t observations; // in how many images it was seen
    // Covariance of its pose error relative to all tags together: a small motion in the tag's own axes, order rotation
    // x y z (radians), translation x y z (metres); upper triangle row by row. All 0: unknown.
    float covariance[21];
};

// Corners 0..3: bottom left, bottom right, top right, top left of an upright tag as a viewer sees it. World axes.
void place_tag_corners(const struct place_tag *tag, struct vec3 world[4]);

// A landmark with its ORB descriptor (Rublee et al. 2011), for localising without tags.
struct place_landmark {
    struct vec3 world;
    float covariance[6]; // of `world`, m^2: xx, xy, xz, yy, yz, zz; all 0: unknown
    // Mean of the unit vectors from it to the sweep's cameras that observed it, world axes; all 0: unknown. From other
    // directions its descriptor need not match.
    float seen_from[3];
    uint8_t descriptor[32];
};

// A keyframe view of the empty place, stored so that its depth can serve as background model.
// Owned by the place: jpeg and depth are malloc'ed, either may be NULL.
struct place_view {
    struct pose world_from_camera;
    uint8_t *jpeg; // colour
    size_t jpeg_bytes;
    uint16_t *depth; // of calibration.depth, millimetres, 0 = no reading
};

struct place {
    struct calibration calibration; // of the sensor that recorded it
    struct place_tag *tags;
    int32_t tag_count;
    struct place_landmark *points;
    int32_t point_count;
    struct place_view *views;
    int32_t view_count;
    int32_t views_lost; // that were in the file and could not be read
    bool errors_lost;   // covariances or viewing directions in the file could not be read; they count as unknown
    double rms_px; // reprojection error of the bundle adjustment over all tag corners; without tags over all landmarks
    double rms_m;  // of depth samples at the same points; 0 without depth
};

// Frees the views whose colour image cannot be decoded, so that the others are left in their order. *lost: how many.
// ERR_MEMORY.
MUST_CHECK enum status place_drop_undecodable_views(struct place *place, int32_t *lost);

void place_free(struct place *place); // frees what it owns and leaves it zeroed. Zeroed is fine.
