// Surroundings as they become known: a set's captures are taken up to a time, aligned, and given dense depth; then
// views are drawn. World: a robot's is the body at its first capture (x ahead, y left, z up); a vehicle's is its
// poses'.
//
// Determinate; uses up to `threads` threads inside a call. One caller at a time.
#pragma once
#include "surround/alignment/depth_alignment.h"
#include "surround/depth/dense_depth.h"
#include "surround/depth/depth_seeds.h"
#include "surround/picture/surround_picture.h"
#include "surround/reading/surround_set.h"
#include "surround/view/surround_view.h"
#include "surround/view/view_merge.h"

// ---------------------------------------------------------------- surface points

// The means of an alignment's voxels as points, to make depth of. Pure but for memory.

struct surface_points {
    float (*xyz)[3];
    float *weights; // of each point; of 1 mm standard deviation: 1
    int count;
    size_t capacity;
};

// ---------------------------------------------------------------- photo refinement

// Direct photometric evidence of a robot's pose: the points of a capture's depth have in its own picture the colour
// that they have in earlier pictures (as in Engel et al. 2018, direct sparse odometry: brightness residuals of points
// of known depth, here of the depth cameras). A picture's pixel is finer than a depth camera's noise, so that poses
// drift less than by planes alone. Pure but for memory; one thread at a time.

enum { PHOTO_REFERENCES = 8 };

// A picture's brightness, smoothed by 3 x 3 pixels.
struct photo_reference {
    struct surround_picture shape; // without pixels of its own: size, lens, place
    uint16_t *gray;                // sixteenths
};

struct photo_point {
    float body[3]; // metres, the body's axes
    float gray;    // in the capture's own picture
};

struct photo_refinement {
    struct pose body_from_picture;                       // set by the caller
    struct photo_reference references[PHOTO_REFERENCES]; // of earlier captures, newest first
    struct photo_reference next;                         // of the capture in hand
    struct photo_point *points;
    int reference_count, point_count;
};

void photo_refinement_free(struct photo_refinement *refinement); // a zeroed one is fine

// depth_alignment_add, with the picture's evidence beside the planes'. The same statuses.
MUST_CHECK enum status photo_alignment_add(struct photo_refinement *refinement, struct depth_alignment *alignment,
                                           const struct surround_picture *picture, const struct depth_points *points,
                                           struct pose odometry, struct pose *world_from_body);

// ---------------------------------------------------------------- surroundings

struct surroundings_options {
    double surface_m; // side of the voxels in which the captures' points are averaged, 0.02
    struct depth_options depth;
    struct view_options view;
    bool photo;       // align a robot's captures by their pictures, too, not by depth alone
    double redo_m;    // a new capture renews the depth of pictures within this, 5
    int max_pictures; // the nearest so many make a view; depth is made for these only
    int threads;
};
// What suits a robot's, a vehicle's or a filmed room's set.
enum surroundings_kind { SURROUNDINGS_ROBOT, SURROUNDINGS_VEHICLE, SURROUNDINGS_FILMED };
struct surroundings_options surroundings_default_options(enum surroundings_kind kind);

struct surroundings {
    struct surround_set set; // of a folder; empty when live
    enum surroundings_kind kind;
    struct pose body_from_panorama;
    struct surroundings_options options;
    struct depth_alignment alignment;  // with threads: theirs alone
    struct photo_refinement photo;     // likewise
    struct surround_picture *pictures; // one for each capture taken
    struct pose *poses;                // world_from_body (robot) or world_from_camera (vehicle) of each
    bool *stale;                       // the depth is to be made
    bool *blank;                       // a picture without light (its lens was covered): not used
    int taken, capacity, unplaced;     // captures; allocated; those that did not fit and have the odometry's pose
    int next;                          // the set's next capture
    struct surface_points surface;     // robot: means of the alignment's voxels
    struct point_colors colors;        // vehicle: of the points
    struct exposure exposure;
    struct capture_thread *thread; // NULL: captures are aligned and given depth inside the calls
    // The capture aligned last, and the one taken last (which may be under way).
    struct pose aligned_odometry, aligned_pose, taken_odometry;
    bool any_aligned, any_taken;
    struct surround_view view;
    bool plain;                                          // draw the plain point cloud instead, to compare
    int64_t align_ns, worst_align_ns, depth_ns, draw_ns; // spent; by the clock that is given
    int depths_made, drawn;
    int64_t depth_number;                    // the last that a picture's depth was given
    const struct surround_picture **nearest; // room for all pictures; see surroundings_prepare
    int64_t (*clock)(void);                  // for the times above; NULL: none
    int64_t (*processor_clock)(void);        // for the alignment's; NULL: none
    // Whether a capture of the set arrives over the link; NULL: all do.
    bool (*delivers)(void *self, int capture);
    void *delivers_self;
};

// Of a folder. how NULL: the default. ERR_…: as surround_set_read.
MUST_CHECK enum status surroundings_open(struct surroundings *surroundings, const char *folder,
                                         const struct surroundings_options *options);
// Of a robot or a filmed room whose captures are given one by one. ERR_MEMORY.
MUST_CHECK enum status surroundings_open_live(struct surroundings *surroundings, enum surroundings_kind kind,
                                              const struct lens *view, struct pose body_from_panorama,
                                              const struct surroundings_options *options);
void surroundings_close(struct surroundings *surroundings); // a zeroed one is fine
// Where a robot's panoramas are taken from, where that was not known when it was opened; before the first capture.
void surroundings_place_panorama(struct surroundings *surroundings, struct pose body_from_panorama);

// From now on a robot's captures are aligned and given depth on threads of their own (surroundings.c):
// surroundings_take returns immediately, surroundings_draw uses what is ready. ERR_MEMORY.
MUST_CHECK enum status surroundings_start_threads(struct surroundings *surroundings);

// Whether it is time for a robot's next capture: 0.6 m, 20 degrees or 200 s after the one taken last.
bool surroundings_wants(const struct surroundings *surroundings, struct pose odometry, int64_t since_ns);
// The body's pose between captures, and while the newest is under way: the last aligned one, moved on by the odometry
// since.
struct pose surroundings_bridge(const struct surroundings *surroundings, struct pose odometry);

// Takes the set's captures up to a time.
MUST_CHECK enum status surroundings_advance(struct surroundings *surroundings, int64_t time_ns);

// A live robot's capture. Owns the picture from now on, also after a failure; *picture is then zeroed. A capture that
// does not fit the earlier ones keeps the odometry's pose and adds no points. With threads, one that comes while
// CAPTURE_MAX are under way is left out.
MUST_CHECK enum status surroundings_take(struct surroundings *surroundings, struct surround_picture *picture,
                                         const struct depth_points *points, struct pose odometry);
// A filmed room's picture with its pose and depth points (in the camera's axes). Ownership as above.
MUST_CHECK enum status surroundings_take_placed(struct surroundings *surroundings, struct surround_picture *picture,
                                                const struct depth_points *points, struct pose world_from_camera);
// The pictures for a viewpoint, nearest first, with depth, which is made where it is lacking or stale, and evened
// exposure; borrowed until the next call that changes *surroundings. None before the first capture.
MUST_CHECK enum status surroundings_prepare(struct surroundings *surroundings, struct pose world_from_view,
                                            const struct surround_picture *const **pictures, int *count);
// Prepares, and draws into surroundings->view. Before the first
// capture nothing is seen.
MUST_CHECK enum status surroundings_draw(struct surroundings *surroundings, struct pose world_from_view);
