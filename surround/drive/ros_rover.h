// A real robot on a ROS master (platform/network/ros_robot.h), driven by free-viewpoint pictures: its images are
// matched with each other and with its odometry by their times, and captured when it has moved far enough. Where the
// odometry falls silent the link is lost: the robot is sent a stop, and stays stopped until both its odometry and the
// operator's hand are back (a command of 0). A camera without a place in calibration.json is where tf has it, a head
// that turns as it was turned when the image was taken; the panorama's has to be rigid. Times of the session are given;
// those of messages are the robot's own clock. One thread.
#pragma once
#include "platform/network/ros_robot.h"
#include "surround/drive/robot_motion.h"
#include "surround/surroundings.h"

enum { ROS_ROVER_ODOMETRY = 256 };

struct ros_rover {
    struct ros_robot *link;
    struct surround_set rig; // of calibration.json: lenses, places of the cameras, the body's size; no captures
    struct surroundings surroundings;
    struct timed_pose odometry[ROS_ROVER_ODOMETRY]; // oldest first, the robot's clock
    int odometry_count;
    struct {
        int64_t time_ns;
        void *pixels;                 // RGB or uint16_t depth; NULL: none came yet
        struct pose body_from_camera; // by calibration.json, else by tf
    } newest[ROS_IMAGE_TOPICS];
    int panorama_width, panorama_height;
    struct failure failure; // of an image: it has not the calibration's size, or nothing says where it was taken
    int64_t unplaced_ns;    // session time of the first image of which nothing said that; 0: none
    int64_t now_ns;         // session time
    int64_t captured_ns;    // the robot's clock; 0: nothing yet
    int64_t behind_ns;      // least of session time less the robot's clock: its clock's offset and the least delay
    int64_t heard_ns, patience_ns; // session time of the last odometry
    int64_t seen_ns;               // session time of the last panorama
    bool heard, lost;
    bool stopped, interrupted;    // since the link was lost, since this program stood still, no command of 0 has come
    struct drive_command command; // the last that was sent
};

// calibration: a file as in a robot's folder (reading/surround_set.h). master, remap: as ros_robot_open; its errors and
// surround_rig_read's.
MUST_CHECK enum status ros_rover_open(struct ros_rover *rover, const char *master, const char *const *remap,
                                      const char *calibration, double patience_s);
void ros_rover_close(struct ros_rover *rover); // a zeroed one is fine. The robot is sent a stop

// Takes what has arrived and sends a command; NULL: none, after which a robot with a watchdog stops. ERR_INPUT: an
// image is not of the calibration's size, or for ten seconds nothing has said where a camera is. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status ros_rover_step(struct ros_rover *rover, int64_t now_ns, const struct drive_command *command);

struct pose ros_rover_pose(const struct ros_rover *rover); // as the operator's side believes; the identity before any
// How old the newest capture is, but for the least delay of the link; 0 before the first.
double ros_rover_age_s(const struct ros_rover *rover);
double ros_rover_silent_s(const struct ros_rover *rover); // since the last panorama came, or the start
