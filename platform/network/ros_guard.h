// Stops a ROS robot where the program that drives it cannot any more: it is killed, stopped (SIGSTOP) or crashes. A
// command (cmd_vel) has no lifetime, so a robot without a time-out of its own would drive on with the last one for
// ever.
//
// The guard is a process of its own with its own connection to cmd_vel: this program once more, started through
// /proc/self/exe; a constructor sees by the name it was given that it is to guard, and never gets to main. A byte over
// a socket, again and again, says that the program lives. When none comes for ROS_GUARD_SILENT_MS, or the socket
// closes without a farewell, the guard publishes a zero velocity every ROS_GUARD_REPEAT_MS for ROS_GUARD_STOP_MS, and
// tells the program in case that goes on. Else it publishes nothing. It ends with its program, and ignores the signals
// that end a terminal's or a session's programs, so that it outlives them.
#pragma once
#include "base/status.h"

enum {
    ROS_GUARD_BEAT_MS = 50,
    // Less than the half second after which a robot with a time-out stops; six times a beat, so that a busy machine is
    // not taken for a dead program. Chosen by hand.
    ROS_GUARD_SILENT_MS = 300,
    ROS_GUARD_REPEAT_MS = 100,
    ROS_GUARD_STOP_MS = 2000, // longer than what a poor link still holds of the program's last commands; by hand
};

struct ros_guard;

enum ros_guard_word {
    GUARD_SILENT,  // nothing since the last question
    GUARD_STOPPED, // it has stopped the robot
    GUARD_GONE     // it has ended: nobody guards
};

// Starts it; does not wait. master, remap: as ros_robot_open. ERR_IO, ERR_MEMORY: *out is NULL.
MUST_CHECK enum status ros_guard_start(struct ros_guard **out, const char *master, const char *const *remap);
// Waits until it can publish. ERR_IO: it cannot.
MUST_CHECK enum status ros_guard_wait(struct ros_guard *guard);
void ros_guard_end(struct ros_guard **guard); // with a farewell: nothing is published. NULL is fine

// Every ROS_GUARD_BEAT_MS from the first one on, by any one thread at a time; returns what the guard said meanwhile.
enum ros_guard_word ros_guard_beat(struct ros_guard *guard);

// ---------------------------------------------------------------- between both processes

enum { GUARD_CHANNEL = 3 }; // the guard's descriptor: packets of one byte
enum { GUARD_BYTE_BEAT = 'b', GUARD_BYTE_FAREWELL = 'f', GUARD_BYTE_READY = 'r', GUARD_BYTE_STOPPED = 's' };

extern const char ros_guard_name[]; // argv[0] of the guard; then the master and what renames topics

// In ros_guard_process.cpp: joins this process to the master under a name that begins so. ERR_INPUT, ERR_IO.
MUST_CHECK enum status ros_node_start(const char *name, const char *master, const char *const *remap);
