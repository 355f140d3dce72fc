// What the locator's files share: the place, the picture in hand, and what of it will
// be looked for in the next one.
#pragma once
#include "locate/pose_fusion.h"
#include "locate/focal_estimate.h"
#include "locate/locator.h"
#include "locate/klt_patch.h"
#include "locate/landmark_matching.h"

enum {
    LOCATOR_MAX_TRACKS = 220,
    LOCATOR_REGIONS_X = 4,
    LOCATOR_REGIONS_Y = 3,
    LOCATOR_REGIONS = LOCATOR_REGIONS_X * LOCATOR_REGIONS_Y
};

// Something of known place that the last picture showed: a natural point, or a tag's corner.
struct point_track {
    int32_t point; // index into the place's points; -1: a tag's corner
    struct vec3 world;
    double seen[3];  // covariance of where it was seen when it was recognised: xx, xy, yy, pixels^2
    struct pixel at; // in the last picture
    struct vec3 ray; // of that, on the plane z = 1
    double time_s;   // of that, when its row was read
    // Of point, map and feature each errs by some pixels, and the same in each picture that
    // follows. That is learnt, so that new points and old ones do not make the pose jump.
    double bias[2], bias_variance; // ideal pixels
    double noise[3];               // how exactly it is found again: covariance as it has been so far; xx, xy, yy
    bool fused;                    // the map's pose of the last picture knows of it
    struct klt_patch patch;        // what it looks like ...
    struct vec3 template_view;     // ... seen from here: the camera less the point, world axes
};

// The same of a tag's corners, one after the other.
struct tag_track {
    bool known; // in the last picture; else the rest is not
    double bias[8], bias_variance;
};

struct locator {
    struct lens lens;       // as it is known now
    struct lens given_lens; // as it was given
    int frames_since_focal; // pictures followed since one was asked for the focal length
    struct locator_options options;
    struct place_tag *tags;
    struct tag_pattern *patterns; // of each tag
    int32_t tag_count;
    struct tag_detector *detector;
    struct tag_detector *coarse_detector; // in pictures half as large; or NULL
    struct tag_refiner *refiner;
    struct place_point *points;
    int32_t point_count;
    uint8_t *gray;
    // of the picture in hand
    struct tag_observation observations[PNP_MAX_TAGS];
    struct tag_depth depths[PNP_MAX_TAGS];
    int32_t which[PNP_MAX_TAGS]; // index into tags
    int count;
    struct feature features[FEATURES_MAX];
    double feature_depths[FEATURES_MAX]; // where there is depth
    struct feature_index index;
    struct landmark_match matches[FEATURES_MAX], other_matches[FEATURES_MAX]; // of the pose found; of one beside it
    struct focal_estimate focal; // what all pictures in which the camera was found say
    // for the next picture
    struct klt_pyramid pyramid;
    struct point_track tracks[LOCATOR_MAX_TRACKS];
    int track_count;
    struct tag_track *tag_tracks; // of each tag
    int32_t *moved_votes; // of each tag: pictures that show it elsewhere than the place has it, less those where it is
    struct tag_observation corrected[PNP_MAX_TAGS]; // the tags in sight less what is known of their errors
    struct pose_fusion fusion;
    int32_t *region_of, *points_by_region,
        region_start[LOCATOR_REGIONS + 1];  // points by the part they should be seen in
    struct place_point *region_points;      // of one part
    int frames_unsearched[LOCATOR_REGIONS]; // for how many pictures no new points were looked for in each part
    uint8_t *missed_count; // how often each point was looked for in vain since it was last found, at most 255
    struct pose last;      // camera_from_world of the last picture that was placed
    struct shutter_motion last_motion;
    // of the picture in hand, with a rolling shutter
    struct shutter_motion frame_motion;
    struct shutter_motion *motion;  // &frame_motion; NULL: all rows are read at once
    struct shutter_motion expected; // of the next picture
};

// Begins a picture: its grey copy, and what is expected of its motion.
void locator_begin_frame(struct locator *l, const uint8_t *color);
// Tags that the pose says must be there and that are not among the observations. most_pixels: of
// each that are read. How many were added. *missing: how many more must be there and are not; or NULL.
int locator_detect_predicted(struct locator *l, const uint8_t *color, const uint16_t *depth,
                             const struct pose *camera_from_world, int most_pixels, int *missing);
// The picture's natural features into the index; l->gray holds the picture.
MUST_CHECK enum status locator_extract_features(struct locator *l, const uint16_t *depth);
// The same of one part of it, 0 .. LOCATOR_REGIONS - 1, and a little beyond.
MUST_CHECK enum status locator_extract_region_features(struct locator *l, int part, const uint16_t *depth);
// The tags in sight, for a fit.
void locator_pnp_tags(const struct locator *l, struct pnp_tag *tags);
// Over the corners of the tags used.
double locator_rms(const struct locator *l, const struct pnp_tag *tags, const struct pose *camera_from_world);
// Fills *out. False: the pose is not sure enough to be given.
bool locator_fill_result(const struct locator *l, const struct pnp_solution *found, int point_count,
                         const double covariance[36], const double noise[36], struct location *out);

// A distortion polynomial means nothing far outside the picture. p: camera axes.
static inline bool locator_in_image(const struct lens *lens, struct vec3 p)
{
    return p.z > 0.1 && fabs(p.x) < lens->width / lens->fx * p.z && fabs(p.y) < lens->height / lens->fy * p.z;
}

// ---- rolling_shutter_detect.c
// Whether the tags of the picture in hand fit no pose (`found` is the best; NULL: there is none) unless the rows of a
// camera that is said to read them at once were read one after the other. Then it is taken for such a one from now on.
bool locator_detect_rolling_shutter(struct locator *l, const struct pnp_tag *tags, const struct pnp_solution *found);

// ---- moved_tags.c
// After a picture that was searched anew: which of the observations are not where the place has their tags. points: how
// many agree with the pose.
void locator_vote_moved_tags(struct locator *l, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world);

// ---- self_calibration.c
// Before a picture: a lens whose focal length was unsure becomes what the pictures so far say. Whatever was
// followed through the old one is forgotten when it does.
void locator_update_lens(struct locator *l);
// What a picture that was followed says of an unsure focal length: now and then one is asked.
void locator_observe_focal(struct locator *l, const struct pnp_tag *tags, const struct pnp_point *points,
                           int point_count, const struct pose *camera_from_world);
// What an unsure focal length leaves open of where the camera is, into the covariance of its pose.
void locator_add_focal_variance(const struct locator *l, const struct pnp_tag *tags, const struct pnp_point *points,
                                int point_count, const struct pose *camera_from_world, double covariance[36]);

// ---- landmark_activation.c
// Features that show points of the place become tracks, as far as there is room and none is near.
// found: of l->matches.
void locator_add_landmark_tracks(struct locator *l, int found, const struct pose *camera_from_world);
// New points, in a small part of the picture, where most are to be gained.
MUST_CHECK enum status locator_activate_landmarks(struct locator *l, const uint16_t *depth,
                                                  const struct pose *camera_from_world);

// ---- tracking.c
// Something of known place, seen at a pixel, will be followed. point: as in struct point_track.
// seen: how surely, covariance in pixels^2.
void locator_add_track(struct locator *l, int32_t point, struct vec3 world, const double seen[3], struct pixel at,
                       const struct pose *camera_from_world);
// After locator_localize: keeps what the picture showed for the next one. agree: of l->matches;
// covariance: of the pose.
void locator_start_tracks(struct locator *l, const struct pnp_tag *tags, int agree,
                          const struct pose *camera_from_world, const double covariance[36]);
// What the last picture showed is looked for in l->gray, near where the pose puts it. False: too
// little of it is there.
bool locator_track_patches(struct locator *l, const struct pose *camera_from_world);
// Then, the pose by it. As locator_track.
MUST_CHECK enum status locator_solve_tracks(struct locator *l, const uint8_t *color, const uint16_t *depth,
                                            struct pose camera_from_world, struct location *out);
