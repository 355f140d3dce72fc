// State and steps that the source files of the tracker share: tracker_state.c opens and closes it, tracker.c predicts,
// observes and commits, tracker_decide.c decides what a frame shows, tracker_joints.c and tracker_points.c what the
// network and colour have to say about it, tracker_backward.c serves the smoother.
#pragma once
#include "capture/body/hem_detector.h"
#include "capture/body/point_evidence.h"
#include "capture/body/pose_filter.h"
#include "capture/segmentation/segment.h"
#include "capture/tracking/joint_covariance.h"
#include "capture/tracking/joint_error.h"
#include "capture/tracking/limb_pose.h"
#include "capture/tracking/tracker.h"

enum { LEARN_EVERY = 2 }; // frames between updates of the background model

struct tracker {
    struct tracker_options options;
    struct calibration calibration;
    struct segmenter *segmenter;
    struct depth_evidence *evidence;
    struct fit_scratch *scratch; // `best` holds this frame's fit
    uint8_t *mask, *second_mask;
    bool following, backward;             // backward: frames come in falling order of time; times are negated in here
    int detection_count;                  // how often a person was detected from scratch
    struct body_pose pose, previous_pose; // of the last two frames
    struct pose_filter filter;            // filtered pose: the output
    int64_t time_ns, previous_ns;         // times of pose and previous_pose
    bool has_velocity;                    // previous_pose and pose are one motion
    struct body_pose prior_pose;          // of the next frame: the body as estimated in the other direction
    bool has_prior;
    struct shape_prior shape;
    double learned_s;
    struct hem_estimate hem;
    struct body_pose shape_pose; // the last pose from which much of the shape was learned
    int64_t lost_since_ns;       // 0: visible
    int poor_frames, frames, empty_frames;
    int static_object_frames;        // number of frames right before this one that turned out to show a static object
    unsigned cropped;                // the image's edges that cropped the person at the last detection
    double flip_log_odds;            // that the person faces the other way
    bool limb_relocated[LIMB_COUNT]; // this frame found it elsewhere
    double since_relocated_s[LIMB_COUNT], since_turned_s;
    double density_mean;
    double energy_mean; // of FEATURE_ENERGY (joint_error.h)
    bool flipped;       // this frame turned the body round
    int refused_wait;   // frames until a component that was no person is looked at again
    struct body_network *network;
    struct joint_evidence untold; // what it found in this frame without a hint,
    struct joint_evidence joints; // and told where the followed person's left is, if that is not where it finds it
    bool has_joints;              // they are not somebody else's
    struct body_square square;    // in which it looked
    double person_log_odds, person_mean; // that it is a person, in this frame and of late
    double turned_cosine; // between the followed person's left and what it finds untold, negative: the other way
    struct body_points next_points; // of the next frame's colour image
    bool has_next_points;
    struct point_evidence points;                // of this frame, and of the smoother's questions about it
    bool has_points;                             // this frame's image was looked at
    bool confirmed, elsewhere;                   // by the last image: a person is where depth has one; only elsewhere
    int unconfirmed_images;                      // in a row
    int frames_since_image, frames_since_points; // bounded; points: of the followed person
    int pointed_frames;
    bool seen_ever[JOINT_COUNT];
    float out_of_image_s[JOINT_COUNT];
    struct joint_sight sight[JOINT_COUNT];
    int visible_probes[JOINT_COUNT];                   // of EVIDENCE_PROBES
    struct covariance3 posterior[JOINT_COUNT];         // of the last fit, depth camera's axes
    struct joint_uncertainty_terms terms[JOINT_COUNT]; // of the last skeleton
    struct joint_features features[JOINT_COUNT];
    struct joint_error error[JOINT_COUNT];
    bool second_wanted, second_seen; // tracker_look_for_second_person
    struct tracker_times times;
    int64_t mark_ns; // processor time up to which `times` accounts
};

// One frame on its way through the steps.
struct tracked_frame {
    int64_t time_ns; // negated when backward
    const uint16_t *depth;
    double dt_s; // since the last frame, at most 1 s
    struct fit_task task;
    bool has_evidence; // a person is segmented and has enough points
    bool detected;     // the person was detected from scratch in this frame
};

// Adds the processor time since the last call to `step`.
void tracker_add_elapsed(struct tracker *tracker, int64_t *step);

// Forgets the person, not the learned background.
void tracker_drop_person(struct tracker *tracker);

// ---- joints that the network finds in the depth image (tracker_joints.c)
// After the evidence was read: they become evidence. A followed person's sides are where `task->expected` has them.
void tracker_find_joints(struct tracker *tracker, struct fit_task *task);
// What the network finds in the same image, told that the person's left is where it has it and where it has their
// right.
void tracker_find_both_sides(struct tracker *tracker, struct joint_evidence told[2]);
// Tries the whole body and limbs where the network has them, and limbs where the colour image's points have them: true
// where that is likelier; scratch->best is then that, with the wide kernel.
bool tracker_try_joints(struct tracker *tracker, const struct fit_task *task);

// ---- points of the colour image (tracker_points.c)
// First in a frame: takes what was set for it.
void tracker_begin_points(struct tracker *tracker);
// Segments a person who is not followed yet: the component that the points are on, else the likeliest. As
// segmenter_next.
enum status tracker_segment_new_person(struct tracker *t, const uint16_t *depth);
// After the evidence was read: the points become evidence if they are on this person.
void tracker_take_points(struct tracker *tracker, struct fit_task *task);
// Frames with points come in now: alternatives on which depth says little are left to those.
bool tracker_points_decide(const struct tracker *tracker);
// Once a frame that shows something.
void tracker_count_unconfirmed(struct tracker *tracker);
// A new person is not to be detected: colour shows none here, or will soon tell.
bool tracker_is_person_refused(const struct tracker *tracker);
// Colour has shown no person here for so long that what is static is furniture. fits_well: the body fits it.
bool tracker_points_deny_person(const struct tracker *tracker, bool fits_well);

// Fits the body to the frame, or detects a person. True: scratch->best is the person's fit, and tracker->following
// holds.
bool tracker_decide(struct tracker *tracker, struct tracked_frame *frame);
