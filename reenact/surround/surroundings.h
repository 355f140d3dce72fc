// Surroundings as they become known: a set's captures are taken up to a time, aligned, and given dense depth; then
// views are drawn. World: a robot's is the body at its first capture (x ahead, y left, z up); a vehicle's is its
// poses'.
//
// Determinate; uses up to `threads` threads inside a call. One caller at a time.
#pragma once
#include "reenact/surround/alignment/depth_alignment.h"
#include "reenact/surround/depth/dense_depth.h"
#include "reenact/surround/reading/surround_set.h"
#include "reenact/surround/view/surround_view.h"

struct surroundings_options {
    struct alignment_options alignment;
    struct depth_options depth;
    struct view_options view;
    double redo_m; // a new capture renews the depth of pictures within this, 5
    int threads;
};
// What suits a robot's or a vehicle's set.
struct surroundings_options surroundings_default_options(bool robot);

struct surroundings {
    struct surround_set set;
    struct surroundings_options how;
    struct depth_alignment alignment;
    struct surround_picture *pictures; // one for each capture taken
    struct pose *poses;                // world_from_body (robot) or world_from_camera (vehicle) of each
    bool *stale;                       // the depth is to be made
    int taken, unplaced;               // captures; those that did not fit and have the odometry's pose
    float (*points)[3];                // robot: means of the alignment's voxels
    float *weights;                    // of each point
    int point_count;
    struct surround_view view;
    int64_t align_ns, worst_align_ns, depth_ns, draw_ns; // spent; by the clock that is given
    int depths_made, drawn;
    int64_t (*clock)(void); // for the times above; NULL: none
};

// how NULL: the default. ERR_…: as surround_set_read.
MUST_CHECK enum status surroundings_open(struct surroundings *s, const char *folder,
                                         const struct surroundings_options *how);
void surroundings_close(struct surroundings *s); // what was zeroed, too

// Takes the captures up to a time.
MUST_CHECK enum status surroundings_advance(struct surroundings *s, int64_t time_ns);

// Draws into s->view. Before the first capture nothing is seen.
MUST_CHECK enum status surroundings_draw(struct surroundings *s, struct pose world_from_view);
