// A robot's captures aligned, and given depth, on two threads of their own, so that drawing for the operator waits for
// neither (Okura 2014, section 3.2: "the unification process is implemented as a thread separated from the ... image
// generation process"). The drawing thread puts jobs and takes what is done.
#pragma once
#include "surround/depth/dense_depth.h"
#include "surround/surroundings.h"

struct capture_job {
    int number; // the caller's own
    bool again; // no new capture: the depth of a placed picture made again, from all points by then
    struct surround_picture picture; // again: without depth; its colours and rays are borrowed
    struct depth_points points;      // of a new capture; freed by the thread
    struct pose odometry;
    // Filled when done:
    struct pose world_from_body;
    bool fits;        // else it has the odometry's pose
    int64_t align_ns; // processor time
    struct failure failure;
    // The threads' own:
    struct surface_points *surface;
};

// Every capture comes back twice: with its pose, then with depth in its picture. What is made again, once.
enum capture_stage { CAPTURE_NONE, CAPTURE_ALIGNED, CAPTURE_WITH_DEPTH };

struct capture_thread;

// alignment, photo: the thread's alone until it is closed. clock: processor time of the calling thread; NULL: none
// measured. ERR_MEMORY (also: no thread to be had); *out is then NULL.
MUST_CHECK enum status capture_thread_open(struct capture_thread **out, struct depth_alignment *alignment,
                                           struct photo_refinement *photo, const struct depth_options *depth,
                                           int64_t (*clock)(void));
// Waits for the jobs in hand; frees what was put and not taken. NULL is fine.
void capture_thread_close(struct capture_thread **t);

int capture_thread_count(const struct capture_thread *thread); // jobs not taken yet

// Takes over the picture (but what is borrowed) and the points. NOTHING: CAPTURE_MAX jobs are not done; ERR_MEMORY.
// Then they stay the caller's.
enum { CAPTURE_MAX = 8 };
MUST_CHECK enum status capture_thread_put(struct capture_thread *t, const struct capture_job *job);

// CAPTURE_NONE: nothing is done. With CAPTURE_WITH_DEPTH the picture in *out is the caller's again.
enum capture_stage capture_thread_take(struct capture_thread *t, struct capture_job *out);
