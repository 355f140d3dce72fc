// Reads the files in which motion is exchanged: BVH's joints, by forward kinematics (bvh_reader.h), and the markers of
// TRC (OpenSim's track row column) and C3D (c3d.org's user guide; binary of Intel or DEC machines, integers or
// floating-point numbers). Pure but for the file.
#pragma once
#include "formats/motion_points.h"

// By its first bytes, whatever its name; and what is named .bvh, .trc or .c3d and is no recording.
bool is_motion_points_file(const char *path);

// ERR_INPUT: not such a file, damaged, empty, or without a rate; the sentence names the file and, of text, the line.
// ERR_MISSING, ERR_IO, ERR_MEMORY. On failure *out is zeroed.
MUST_CHECK enum status motion_points_read(const char *path, struct motion_points *out);

// The readers of one format each, from memory; `name` is for sentences. For motion_points_read and the fuzzers; *out is
// zeroed before, and to be freed in any case.
MUST_CHECK enum status bvh_points_read(const char *name, const uint8_t *bytes, size_t count, struct motion_points *out);
// `text` ends with a 0 after its `count` bytes and is changed.
MUST_CHECK enum status trc_points_read(const char *name, char *text, size_t count, struct motion_points *out);
MUST_CHECK enum status c3d_points_read(const char *name, const uint8_t *bytes, size_t count, struct motion_points *out);
