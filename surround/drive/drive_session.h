// Driving by pictures, whatever the robot: `sim:` (sim:1, sim:2, sim:3: the stages of simulated_rover.h), `folder:DIR`,
// a set that is played in real time, or `ros:`, `ros:http://HOST:PORT`, a robot on a ROS master. Times are given: the
// session reads no clock. One thread.
#pragma once
#include "surround/drive/ros_rover.h"
#include "surround/drive/simulated_rover.h"

struct drive_options {
    struct drive_link link;           // delay and loss; default: none
    double patience_s;                // without a command for this long the robot stops, 0.5
    int width, height;                // of the operator's pictures; 0: the set's
    bool threads;                     // captures are aligned and given depth on threads of their own
    int64_t (*processor_clock)(void); // for measuring the alignment; NULL: none
    const char *calibration;          // ros: the robot's calibration.json
    const char *const *remap;         // ros: "FROM:=TO" names of topics, the last NULL; may be NULL
};
struct drive_options drive_default_options(void);

enum { DRIVE_PENDING = 1280 }; // a minute, the longest delay that reenact drive takes, at 20 a second

// From where the operator looks.
struct drive_eye {
    enum viewpoint viewpoint;
    bool orbit; // a free viewpoint round the body
    double azimuth, elevation, distance_m;
    bool head;                 // a head tracker's viewpoint
    struct pose body_from_eye; // with head: the camera's axes in the body's
};

enum drive_kind { DRIVE_SIMULATED, DRIVE_PLAYED, DRIVE_ROS };

struct drive_session {
    enum drive_kind kind;
    struct drive_options options;
    struct simulated_rover rover; // simulated
    struct surroundings played;   // folder
    struct ros_rover ros;         // ros
    int64_t first_ns;             // folder: its time at session time 0
    int64_t now_ns;               // session time
    struct link_watch watch;
    struct drive_command command; // the last that arrived
    struct {
        struct drive_command command;
        int64_t arrives_ns;
    } pending[DRIVE_PENDING]; // under way to the robot, oldest first
    int pending_count;
    uint32_t sent;          // packets
    bool link_lost, ended;  // ended: the folder is played to its end
    struct drive_path path; // of the body, as the operator's side believes it to be
    struct drive_eye eye;   // the operator's; may be set at any time
    bool wordless;          // who draws shows the readings himself; may be set at any time
    bool near;              // the last picture that was drawn shows a thing near the body, so far away:
    double nearest_m;
};

// ERR_INPUT: no such URI, or the folder is no robot's; otherwise as surroundings_open.
MUST_CHECK enum status drive_session_open(struct drive_session *session, const char *uri,
                                          const struct drive_options *options);
void drive_session_close(struct drive_session *session); // a zeroed one is fine

// Moves on to `now_ns` (session time, rising). command: what the operator sends at this moment; NULL: nothing. What was
// sent before moves the simulated robot until then, for as long as its watchdog lets it (patience_s).
MUST_CHECK enum status drive_session_step(struct drive_session *session, int64_t now_ns,
                                          const struct drive_command *command);

// What the operator is to know beside the picture.
struct drive_readings {
    struct drive_command command; // that moves the robot
    double age_s;                 // of the newest capture
    bool link_lost;               // the robot stands
    bool interrupted;             // the robot stands since this program stood still, until a command of 0
    bool picture_old;             // the robot is elsewhere than the pictures were taken: nobody sees where it drives
    bool near;                    // something was seen near the body
    double nearest_m;             // with near: so far away
};
struct drive_readings drive_session_readings(const struct drive_session *session);

// Of the operator's pictures.
const struct lens *drive_session_lens(const struct drive_session *session);

// What the operator is to see at this moment, for drawing it elsewhere. The pictures are borrowed until the next call.
struct drive_scene {
    struct pose world_from_view;
    struct lens lens; // of the operator's pictures
    const struct surround_picture *const *pictures;
    int count;
    struct view_options options;
    struct operator_overlay overlay; // of size 0 where the eye is inside the body
    double size_m[3];                // of the body
};
MUST_CHECK enum status drive_session_prepare(struct drive_session *session, struct drive_scene *out);

// Of the body: length, width, height.
const double *drive_session_size(const struct drive_session *session);
// What the robot has captured so far.
const struct surroundings *drive_session_surroundings(const struct drive_session *session);

// Draws the operator's picture with the overlay; *view lives as long as the session.
MUST_CHECK enum status drive_session_draw(struct drive_session *session, const struct surround_view **view);

// The body as the operator's side believes it to be.
struct pose drive_session_pose(const struct drive_session *session);

// Where the chosen viewpoint's eye is in the body's axes (without orbit and head).
struct pose drive_session_viewpoint(const struct drive_session *session);
