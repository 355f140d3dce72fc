// Joints over time as they come from a recording, a joints-csv or a motion file, before anything is computed from them.
//
// Axes: y down along gravity, x and z level, metres; only where they point is left open. A take that was located in a
// place is rotated so from the place's z, another take from the floor that its depth shows; where it shows none, the
// camera counts as held level unless the person says otherwise: joint_samples_level() below. A joints-csv file says its
// axes, or they are found out (joint_rows.h).
#pragma once
#include "recording/recording.h"

struct joint_sample {
    int64_t time_ns;
    struct skeleton skeleton;
    float sigma_m[JOINT_COUNT]; // standard deviation of a joint's error, per axis
};

// What was found out of a file that does not say it, as sentences without the file's name.
enum { JOINT_NOTES_MAX = 6, JOINT_NOTE_BYTES = 256 };
struct joint_notes {
    int count;
    char line[JOINT_NOTES_MAX][JOINT_NOTE_BYTES];
};
void joint_note(struct joint_notes *notes, const char *format, ...) __attribute__((format(printf, 2, 3)));

struct joint_samples {
    struct joint_sample *at; // malloc'ed; times rise strictly, the first is 0
    int64_t count, capacity;
    int64_t dropped; // rows or frames left out: a number was not finite, or its time was not later than the last one's
    int64_t jumps;   // of the clock, closed up
    int64_t offset_ns;  // added to the clock so far, because of them
    int64_t began_ns;   // of the source's clock at time 0; a date where it counts from 1970 (date_text, base/text.h)
    bool sigma_given;   // false: sigma_m is default_sigma_m()
    double tilt_rad;    // by how much they were turned to be level
    bool tilt_by_floor; // as the floor says that is seen; else the person's standing
    struct joint_notes notes;
};
void joint_samples_free(struct joint_samples *samples); // zeroed is fine; leaves it zeroed

// Of a joint of this confidence where the source gives none: 45 mm where observed, 18 cm where inferred. By hand, as
// wide as a take's covariances: what movement.h makes of it is a Kinect's noise.
float default_sigma_m(float confidence);
// Of a tracked joint: from its covariance, where there is none as default_sigma_m.
float sample_sigma_m(const struct skeleton *skeleton, enum joint joint);

// Appends one; time_ns in any clock. A sample that is up to a second earlier than the last one is dropped. A clock that
// goes back further, or ahead by more than a minute, has jumped: the sample follows the last one after 33 ms.
MUST_CHECK enum status joint_samples_add(struct joint_samples *s, const struct joint_sample *sample);
void joint_samples_start_at_zero(struct joint_samples *samples); // times count from the first sample

// Reads a joints-csv file (formats/joints_csv.h), any line ends. Rows of one time are one sample; rows that
// hold no finite number or an unknown joint's name are left out; a joint that is missing, empty or at 0, 0, 0 is
// unknown, and an empty sigma_m is default_sigma_m(). Axes are the file's word or, without it, found out by the body
// (joint_rows.h); units that are none of the format's, and rows in another order, are found out, too
// (joint_rows.h). What was found out is in the notes. ERR_INPUT: not such a file, no usable row, or what cannot
// be found out; the sentence names the file, the line where it is one's, and the likely cause. ERR_MISSING, ERR_IO,
// ERR_MEMORY. On failure *out is zeroed.
MUST_CHECK enum status joint_samples_read_csv(const char *path, struct joint_samples *out);
bool is_joints_csv(const char *path); // by its first line; and what is named .csv and is no recording

// Reads a motion file: BVH, TRC or C3D (formats/motion_file.h), whose points are found by the usual names of joints,
// bones and markers (motion_file_reader.c). Units are the file's or found out by the body, axes by the body or, where
// that cannot be told, the format's. What was found out, or is missing, is in the notes. ERR_INPUT: no point has a
// joint's name, or two have the same one; else as joint_samples_read_csv.
MUST_CHECK enum status joint_samples_read_motion(const char *path, struct joint_samples *out);

// Whether it is a file of joints alone, joints-csv or a motion file, which holds no takes; by its first bytes.
bool is_joints_file(const char *path);
// Reads one as what it is.
MUST_CHECK enum status joint_samples_read_file(const char *path, struct joint_samples *out);

// Whether a take's frame is a sample: a person was tracked in it and, of a take whose sensor was located at all, the
// sensor had been by then.
bool take_frame_is_sample(const struct take *take, int64_t frame);
int64_t take_first_sample(const struct take *take); // the frame at time 0; -1: none

// Reads a take's skeletons. `name` NULL: the file's only take. ERR_INPUT: it has several, or the take has no skeleton.
// Else as recording_open and take_open. On failure *out is zeroed.
MUST_CHECK enum status joint_samples_read_take(const char *path, const char *name, struct joint_samples *out);

// Exchanges left and right of arms, legs or all where a tracker confused them for some frames: wherever the way of the
// joints to the next frame is much shorter under exchanged names, the names changed there; those that more frames had
// stay. Where neither is in the clear majority nothing is changed. Returns how many frames were changed.
int64_t joint_samples_mend_sides(struct joint_samples *samples);

// The mean direction from the feet to the neck over the samples in which legs and trunk are straight, unit length.
// False: there is less than a second of them.
bool joint_samples_standing(const struct joint_samples *samples, struct vec3 *mean);

// Rotates all samples about the level axes so that the person stands upright, on average over the frames in which legs
// and trunk are straight; only where there is a second of them and the tilt is between 3 and 35 degrees.
void joint_samples_level(struct joint_samples *samples);
