// A place: what a camera can recognise there. Made by capture/mapping/mapper, kept in a
// recording, used by locate. World axes: z up, z = 0 on the floor, metres; x
// and y as the lowest-numbered tag has them; without tags x points to the right of the
// sweep's first view, from below it.
#pragma once
#include "base/lens.h"

// A square tag. Its own axes: origin at its centre, x right, y up, z out of the
// wall towards the reader, so its corners are (-+side/2, -+side/2, 0).
struct place_tag {
    int32_t id;    // of family tag36h11
    double side_m; // outer edge of the black square
    struct pose world_from_tag;
    double rms_px; // reprojection error of a corner over its sightings in the map; 0: exact
    int32_t sightings;
    // How surely the map has it, against all its tags together: covariance of a small motion in the tag's own axes,
    // turn (radians), then shift (metres); its upper half row by row. All 0: not known.
    float covariance[21];
};

// Corner 0..3: bottom left, bottom right, top right, top left as the reader sees
// an upright tag. World axes.
void place_tag_corners(const struct place_tag *tag, struct vec3 world[4]);

// A natural point with its ORB descriptor, kept for locating without tags.
struct place_point {
    struct vec3 world;
    float covariance[6]; // of `world`, m^2: xx, xy, xz, yy, yz, zz; all 0: not known
    // The mean of the unit vectors from it to the cameras of the sweep that saw it, world axes; all 0: not known. From
    // another side it looks different, and something else may look like it.
    float seen_from[3];
    uint8_t descriptor[32];
};

// A view of the empty place, kept so that its depth can serve as background.
// Owned by the place: jpeg and depth are malloc'ed, either may be NULL.
struct place_view {
    struct pose world_from_camera;
    uint8_t *jpeg; // colour
    size_t jpeg_bytes;
    uint16_t *depth; // of calibration.depth, millimetres
};

struct place {
    struct calibration calibration; // of the sensor that filmed it
    struct place_tag *tags;
    int32_t tag_count;
    struct place_point *points;
    int32_t point_count;
    struct place_view *views;
    int32_t view_count;
    double rms_px; // of the joint adjustment, over all tag corners; without tags over all points
    double rms_m;  // of depth against the same; 0 without depth
};

void place_free(struct place *place); // what it owns; leaves it zeroed. Zeroed is fine.
