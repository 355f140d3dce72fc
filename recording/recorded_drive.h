// Where a robot was driven in a recording's place, for the app's map; docs/format.md, table `drive`.
#pragma once
#include "recording/recording.h"

enum { RECORDED_DRIVE_POINTS = 256 };

struct recorded_drive {
    double size_m[3]; // of the robot's body: length, width, height
    struct pose
        world_from_body; // where it stood at the end: x ahead, y left, z up, origin on the floor; the place's world
    struct vec3 path[RECORDED_DRIVE_POINTS]; // of that origin, from the beginning
    int path_count;
};

// NOTHING: no robot was driven there; *out is then untouched. ERR_CORRUPT, ERR_IO.
MUST_CHECK enum status recording_read_drive(struct recording *r, struct recorded_drive *out);

// In place of an earlier one. ERR_INPUT: a number is not finite; otherwise as recording_change.
MUST_CHECK enum status recording_write_drive(const char *path, const struct recorded_drive *drive);
