// Export of a take, and of a place, for other programs: joints as CSV, motion as BVH (Biovision hierarchy), points as
// points at a constant rate as TRC and C3D, PLY (Stanford polygon format, binary, little-endian, metres), the sensor's
// film as MP4, everything as MCAP or as a TUM folder.
//
// What goes to one file is written to `out`, an open stream; the caller opens and closes it (platform/files/output.h)
// and finds what could not be written in ferror. ERR_IO, ERR_CORRUPT: the take cannot be read. ERR_MEMORY.
//
// *damaged: frames of which an image is damaged; it is left out, and the rest written. ERR_CORRUPT, where all are.
#pragma once
#include "base/progress.h"
#include "formats/markers.h"
#include "recording/recording.h"

#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- median

// The median of measured values. Pure.

static inline int median_compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Sorts the values. Of an even count the upper of the two middle ones; 0 of none.
static inline double median_of(double *values, size_t count)
{
    qsort(values, count, sizeof *values, median_compare);
    return count ? values[count / 2] : 0;
}

// ---------------------------------------------------------------- export

enum export_axes {
    EXPORT_SENSOR, // the colour camera's: x right, y down, z forward
    EXPORT_ROOM,   // the place's: z up from the floor
};

// joints-csv (recording/joints_csv.h), whose first line says the axes. Frames without a person are left out, in the
// room's axes also those whose sensor pose was not measured.
// ERR_INPUT: the room's axes, and no frame has a measured sensor pose.
MUST_CHECK enum status export_joints_csv(const struct take *take, enum export_axes axes, FILE *out);

// BVH, y up, centimetres. In the world's axes where the sensor was located; frames in which it was not are then left
// out; else in the camera's. Through a gap in the take, or without a person, the pose before it stays. Joints that keep
// their place in their parent's axes over the take (elbows, hands, knees, feet) have three channels, rotations; others
// six: a position that replaces the OFFSET, as Blender reads it, so that every known joint is where the CSV has it.
// ERR_INPUT: no person was tracked.
MUST_CHECK enum status export_bvh(const struct take *take, FILE *out);

// Joints at a constant rate, y up, in the world's axes where the sensor was located, else in the camera's: as they are
// (markers_free), as TRC in metres, C3D in millimetres (formats/markers.h). name: in TRC's first line. ERR_INPUT: no
// person was tracked.
MUST_CHECK enum status export_markers(const struct take *take, struct markers *out);
MUST_CHECK enum status export_trc(const struct take *take, const char *name, FILE *out);
MUST_CHECK enum status export_c3d(const struct take *take, FILE *out);

// A frame's depth samples as coloured points, in the world's axes where the sensor was located, else in the camera's.
// actor: only those of the actor's mask. NOTHING: the frame has no such samples.
MUST_CHECK enum status export_points_ply(struct take *take, int64_t frame, bool actor, FILE *out);

// A PLY for each frame: `dir`/000017.ply for frame 17, listed with its time in `dir`/ply.txt as in a TUM folder. write:
// prints the frame's; NOTHING: it has none. Frames without one, and *damaged ones, are left out. Written as `dir`.part,
// renamed when whole. ERR_EXISTS: dir exists. ERR_INPUT: no frame has one. NOTHING: the watch said to stop; nothing
// remains then, nor after an error.
struct ply_frames {
    enum status (*write)(void *self, int64_t frame, FILE *out);
    void *self;
};
MUST_CHECK enum status export_ply_folder(struct take *take, const struct ply_frames *frames, const char *dir,
                                         const struct progress_watch *watch, int64_t *damaged);

// A place in its world's axes: its views' depth samples (every fourth pixel of every fourth row) and landmarks as
// points, tags as squares. NOTHING: the place is empty.
MUST_CHECK enum status export_place_ply(const struct place *place, FILE *out);

// The colour images as H.264 in MP4, with the take's own times. out must be at its beginning; seekable: whether it can
// be rewound, else the film is fragmented. NOTHING: the watch said to stop. ERR_INPUT: the take has no colour, or this
// program was built without FFmpeg's libraries.
MUST_CHECK enum status export_film_mp4(struct take *take, FILE *out, bool seekable, const struct progress_watch *watch,
                                       int64_t *damaged);

// MCAP (formats/mcap.h) in Foxglove's schemas: /camera/color (JPEG) and /camera/depth (16 bits, millimetres) with their
// calibrations, /tf (world, color, depth), /actor/skeleton (drawn) and /actor/joints (to plot), at the take's times,
// which begin with 0 where they were negative. NOTHING: the watch said to stop.
MUST_CHECK enum status export_mcap(struct take *take, FILE *out, const struct progress_watch *watch, int64_t *damaged);

// A TUM RGB-D folder that platform/sensors/folder.c reads: rgb/, depth/ and mask/ with their lists, associations.txt
// (time and file of colour, time and file of depth), calibration.json, trajectory.txt (world_from_camera of frames
// whose sensor was located) and joints.csv. Colour images are the sensor's own, coded pixels byte for byte, without
// what a file holds beside them (platform/files/jpeg.h): an orientation would turn them beside their depth.
// Written as `dir`.part, renamed when whole. ERR_EXISTS: dir exists. NOTHING: the watch said to stop; nothing remains
// then, nor after an error.
MUST_CHECK enum status export_folder(struct take *take, const char *dir, const struct progress_watch *watch,
                                     int64_t *damaged);
