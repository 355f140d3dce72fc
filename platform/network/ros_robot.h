// A robot's topics on a ROS master (Debian's libroscpp, libtf2): its colour and depth images, its odometry and where
// its cameras are in, its commands out. An optional part of the build: without the libraries ros_robot_open says so.
//
//   in   panorama, panorama/compressed                     sensor_msgs/Image, CompressedImage (JPEG)
//        depth_front, depth_left, depth_back, depth_right  sensor_msgs/Image, 16UC1 (mm) or 32FC1 (m)
//        odom                                              nav_msgs/Odometry; its child_frame_id is the body
//        /tf, /tf_static                                   tf2_msgs/TFMessage: from the body to the images' frame_id
//   out  cmd_vel                                           geometry_msgs/Twist: linear.x m/s, angular.z rad/s
//
// Of images that wait only the newest of a topic is kept. One in a process at a time, and after ros_robot_close none
// can be opened again: libroscpp is not made for it. Threads: libroscpp's own read the sockets, one watches the
// commands and tells the guard that the program lives (ros_guard.h); one thread calls, and the receivers are called by
// it inside ros_robot_poll.
#pragma once
#include "base/geometry.h"

enum ros_topic { ROS_PANORAMA, ROS_DEPTH_FRONT, ROS_DEPTH_LEFT, ROS_DEPTH_BACK, ROS_DEPTH_RIGHT, ROS_IMAGE_TOPICS };

struct ros_image {
    enum ros_topic topic;
    int64_t time_ns; // of the exposure, by the robot's clock
    int width, height;
    // By tf at that time, or the newest where it knows of that time nothing yet: optical frames (x right, y down, z
    // ahead; the panorama's column in the middle looks along z), as REP 103 has them.
    bool placed;
    struct pose body_from_camera;
    // Rows without padding, for the time of the call only. One of them is NULL.
    const uint8_t *rgb;
    const uint16_t *depth; // millimetres, 0 = no reading
};

struct ros_receiver {
    void *self;
    void (*image)(void *self, const struct ros_image *image);
    // By the robot's clock; world_from_body by the wheels.
    void (*odometry)(void *self, int64_t time_ns, const struct pose *world_from_body);
};

struct ros_robot;

// False: this program was built without libroscpp.
bool ros_robot_available(void);

// master: "http://HOST:PORT"; "": $ROS_MASTER_URI, else this machine's port 11311. remap: NULL, or "FROM:=TO" strings,
// the last NULL, that rename topics as on any ROS node's command line. ERR_INPUT: built without libroscpp, no address,
// or no such renaming. ERR_IO: no master answers there, or the guard does not start. ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status ros_robot_open(struct ros_robot **out, const char *master, const char *const *remap);
void ros_robot_close(struct ros_robot **r); // NULL is fine. Commands that were given reach the socket first

// Hands over what has arrived; does not wait. Messages that are damaged or of another encoding are counted and left
// out. ERR_IO: the node was shut down from outside, or the guard has ended. ERR_MEMORY.
MUST_CHECK enum status ros_robot_poll(struct ros_robot *r, const struct ros_receiver *to);

// speed: m/s ahead; turn_rate: rad/s to the left. Whether it arrives is not known. Valid for 0.4 s: when none
// follows, a thread sends a stop, also where this program hangs, and one that ends by exit() sends a stop. Where the
// program is killed or stopped, the guard does (ros_guard.h). Where the machine or the network fails nobody does.
void ros_robot_command(struct ros_robot *r, double speed, double turn_rate);

// True: since the last call the guard has stopped the robot, for this program had stood still. Until the call nothing
// that moves is sent.
bool ros_robot_interrupted(struct ros_robot *r);

int64_t ros_robot_refused(const struct ros_robot *r); // messages left out
