// A folder of surroundings. Two layouts:
//
// A robot's: panorama.txt, depth_front.txt, depth_left.txt, depth_back.txt, depth_right.txt (time and file; a capture
// is a panorama and the depth pictures of the same time, any of which may be absent), odometry.txt (world_from_body by
// the wheels) and calibration.json with `panorama`, `depth` and `view`. The body's axes: x ahead, y left, z up, on the
// floor.
//
// A vehicle's: panorama.txt, panorama_poses.txt (world_from_camera), points.ply (world, z up) and calibration.json.
//
// A filmed room's: rgb.txt, depth.txt (registered), trajectory.txt (world_from_camera) and calibration.json with
// `color` and `depth`, as in the TUM RGB-D layout; its view is the colour camera's lens without distortion.
//
// `view` in calibration.json is the lens of the pictures to draw.
#pragma once
#include "base/geometry.h"
#include "surround/picture/surround_picture.h"

// ---------------------------------------------------------------- pose list

// Lists of times with files or poses, as the TUM RGB-D layout has them: "seconds file" and
// "seconds tx ty tz qx qy qz qw", # comments. Also "name number tx …" for views without a time.

struct timed_pose {
    int64_t time_ns; // 0 in a list of views without times
    char name[64];   // "0007" by its place in the list, or "NAME/NUMBER"
    struct pose pose;
};
struct timed_file {
    int64_t time_ns;
    char path[1024]; // with the folder
};

// *out is malloc'ed, the caller frees it; on failure untouched. ERR_INPUT: a line is no pose or file, not finite, times
// do not rise or are beyond 4e9 seconds, a file lies outside of the folder, or the list is empty. ERR_MISSING, ERR_IO,
// ERR_MEMORY.
MUST_CHECK enum status pose_list_read(const char *path, struct timed_pose **out, int *count);
MUST_CHECK enum status file_list_read(const char *folder, const char *name, struct timed_file **out, int *count);

// The pose at a time: between two by slerp, outside the first or last.
struct pose pose_list_at(const struct timed_pose *list, int count, int64_t time_ns);

// ---------------------------------------------------------------- surround set

enum { SURROUND_DEPTH_CAMERAS = 4 };

struct depth_camera {
    struct lens lens; // width 0: there is none
    bool placed;      // the file says where it is
    struct pose body_from_camera;
};

struct capture {
    int64_t time_ns;
    const char *panorama;                      // path
    const char *depth[SURROUND_DEPTH_CAMERAS]; // path; NULL: none at this time
    struct pose guess;                         // robot: world_from_body by odometry. Vehicle: world_from_camera
};

struct surround_set {
    bool robot, filmed;              // else a vehicle
    struct lens view, panorama_lens; // panorama_lens.width 0: equirectangular
    double body_size_m[3];           // robot: length, width, height
    bool panorama_placed;            // likewise
    struct pose body_from_panorama;
    struct depth_camera depth_cameras[SURROUND_DEPTH_CAMERAS];
    struct capture *captures;
    int capture_count;
    struct timed_pose *odometry; // robot
    int odometry_count;
    float (*points)[3]; // vehicle; world
    int point_count;
    struct timed_file *files[1 + SURROUND_DEPTH_CAMERAS]; // own the paths: panoramas, then each depth camera's
};

// ERR_MISSING, ERR_IO, ERR_INPUT, ERR_CORRUPT, ERR_MEMORY. On failure *out is as surround_set_free leaves it.
MUST_CHECK enum status surround_set_read(struct surround_set *out, const char *folder);
void surround_set_free(struct surround_set *set); // a zeroed one is fine

// A robot's calibration.json alone: lenses, places of the cameras, the body's size. Statuses as above. Without
// `body_from_camera` a camera is at the body's origin, looking up, and not `placed`.
MUST_CHECK enum status surround_rig_read(struct surround_set *out, const char *path);

// A capture's picture without pose or depth. A damaged file is ERR_CORRUPT or ERR_INPUT.
MUST_CHECK enum status surround_set_picture(const struct surround_set *set, int capture, struct surround_picture *out);
