// The map of a place from a sweep of the empty room: poses of its tags, positions of its natural landmarks ("points"),
// and a well-spread set of keyframe views.
//
//     mapper_open, mapper_add for each frame, mapper_finish, mapper_close
//
// Method: incremental structure from motion. Planar poses of tags (IPPE, Collins & Bartoli 2014) start the pose graph;
// ORB landmarks (Rublee et al. 2011) register the other frames; loop closure; bundle adjustment (Triggs et al. 2000)
// over tag corners, landmarks and depth; covariances from its information matrix; gravity from the floor's depth.
//
// A second sweep may add to an existing place: mapper_options.prior.
// Scale comes from the tags' known sides, and a common scale error of the depth is corrected; without any tag it comes
// from depth alone, and landmarks make up the place.
// Deterministic: the same frames give the same place. One handle, one thread; two threads of its own find tags and
// features in the images while the next ones come. Memory is bounded: at most 240 frames' features, 96 images.
#pragma once
#include "capture/mapping/sweep_plan.h"
#include "locate/picture_check.h"
#include "platform/sensors/source.h"

struct mapper;

// A printed tag of known size: the outer edge of its black square.
struct mapper_tag {
    int32_t id; // of tag36h11
    double side_m;
};

enum { MAPPER_MAX_TAGS = 587 };

// tags.json: {"family": "tag36h11", "side_m": {"0": 0.2, "7": 0.24}}. *tags is
// malloc'ed, sorted by id; the caller frees it.
// ERR_MISSING, ERR_IO, ERR_MEMORY, ERR_INPUT: malformed, another family, no tag, a side that cannot be.
MUST_CHECK enum status mapper_read_tags(const char *path, struct mapper_tag **tags, int32_t *count);

struct mapper_options {
    double quad_decimate; // of the tag detector, 1..8. Default 1
    int32_t max_points;   // landmarks kept of this sweep. Default 4000; 0: none are looked for
    int32_t max_views;    // keyframe views kept of this sweep. Default 40
    // The place that the sweep adds to; must outlive the mapper. Default NULL: a new one. Its world axes, landmarks and
    // tags stay constant, except tags that were hung elsewhere since; what is new is registered to them.
    // Views are added only if the calibration is the same.
    const struct place *prior;
    // Also follows the sensor while it sweeps, for mapper_plan. Costs some milliseconds an image; the map is the same.
    bool plan;
    // Called now and then while mapper_finish works, which may take a minute. Default NULL.
    void (*on_step)(void *self);
    void *self;
};
struct mapper_options mapper_default_options(void);

// tag_count 0: a place of landmarks (or what `prior` has); the calibration must say `registered`
// unless `prior` has tags. Tags of `prior` need not be listed again.
// Copies what it needs. ERR_INPUT: a lens or option out of range, neither tags nor depth, an id
// listed twice, another side than in `prior`. ERR_MEMORY. On failure *out = NULL.
MUST_CHECK enum status mapper_open(struct mapper **out, const struct calibration *calibration,
                                   const struct mapper_tag *tags, int32_t tag_count,
                                   const struct mapper_options *options);

// Has tags and features detected in a copy of the frame; waits only while several frames are in work. A frame
// without colour is ignored. Depth is used where the calibration says `registered`; of another size than colour it is
// interpolated at colour's pixels (base/registered_depth.h), and so it lies in the place's views. Odometry, where the
// frame has it, tells where to look for a frame from its neighbour, and which way is up.
// Of a long sweep every second, fourth ... frame is kept, so that memory is bounded; and of a sensor that stands still
// only some.
// ERR_MEMORY, ERR_SOLVER, which may be an earlier frame's: it and this frame are left out, the mapper stays usable.
MUST_CHECK enum status mapper_add(struct mapper *mapper, const struct frame *frame);

// What a sweep has shown so far, for the person who carries the sensor. Of the images that were examined already.
struct mapper_progress {
    int32_t listed, seen;     // tags
    int32_t first_unseen;     // the lowest id of those still missing; -1: none
    int32_t apart_a, apart_b; // two tags that no chain of common images connects yet; -1: none
};
void mapper_get_progress(const struct mapper *mapper, struct mapper_progress *out);

// With options.plan: the room from above, of the images that were examined already, and what to do next. NULL without.
// Valid until the next call.
const struct sweep_plan *mapper_plan(struct mapper *mapper);

struct mapper_report {
    int32_t frames; // used, of frames_seen
    int32_t frames_seen;
    int32_t frames_placed;
    double lost_from_s, lost_to_s; // the longest part of the sweep without a pose, from its start; equal: none
    int32_t tags_mapped;
    int32_t tags_unseen; // listed but in no frame; the lowest id is first_unseen, and so on below
    int32_t first_unseen;
    int32_t tags_disconnected; // seen, but never together with a tag of the map
    int32_t first_disconnected;
    int32_t tags_unlisted; // seen in at least two frames, not listed: ignored
    int32_t first_unlisted;
    int32_t tags_outlier; // seen in two positions in the sweep, and left out
    int32_t first_outlier;
    int32_t tags_moved; // of `prior`, now at another position: estimated again, or left out if that is not possible
    int32_t first_moved;
    // Of wrong side: the depth shows another side than the list names. They are left out, unless most are wrong.
    int32_t tags_wrong_side;
    int32_t first_wrong;              // the lowest id of them
    double listed_side_m, measured_m; // of that one
    bool all_wrong_side; // most are, often by one factor, as when the printer scaled them: nothing of the list is left
                         // out
    struct lens_verdict lens; // the given one against the pictures
    double readout_s;         // of the rolling shutter, as the landmarks show it where none was given; 0: none
    // Distances by the depth over those by the tags' listed sides and the lens, its fault taken out; 0: not known. Near
    // 1 if the depth's unit and the list are right.
    double depth_ratio;
    bool floor_from_depth; // else z = 0 is the lowest corner of a tag, or the lowest landmark. With `prior`: true
};

// The place, in world axes as place.h has them. The caller owns *out: place_free.
// ERR_INPUT: no listed tag was seen, or none could be placed; without tags: too little to
// recognise; with `prior`: nothing of it was seen; tags, depth and lens contradict each other so much that the map
// would be of no use (the message names the likeliest cause). ERR_MEMORY, ERR_SOLVER. On error *out is zeroed. Call it
// once.
MUST_CHECK enum status mapper_finish(struct mapper *mapper, struct place *out, struct mapper_report *report);

// After mapper_finish: where the camera was at a frame of the sweep, in the place's world. False: that frame was not
// used, or it could not be placed.
bool mapper_pose(const struct mapper *mapper, int64_t time_ns, struct pose *world_from_camera);

void mapper_close(struct mapper **m); // NULL is fine; sets *m = NULL
