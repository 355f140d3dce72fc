// What the locator's files share: the place, the current image, and what is tracked into the next one.
// Calls go downwards only: from localize.c to locator.c.
#pragma once
#include "locate/focal_estimate.h"
#include "locate/klt_patch.h"
#include "locate/landmark_matching.h"
#include "locate/locator.h"
#include "locate/pose_fusion.h"

enum {
    LOCATOR_MIN_WITHOUT_TAGS = 20, // landmarks that must agree where no tag is in view; chosen by hand
    LOCATOR_MAX_TRACKS = 220,
    LOCATOR_REGIONS_X = 4,
    LOCATOR_REGIONS_Y = 3,
    LOCATOR_REGIONS = LOCATOR_REGIONS_X * LOCATOR_REGIONS_Y
};

// Standard deviations at the start of a track, pixels: of a tag's corner by brightness alone, and of the tracking
// error. Chosen by hand.
#define LOCATOR_CORNER_PX   1.0
#define LOCATOR_TRACKING_PX 0.25

// A landmark or a tag's corner, followed from image to image.
struct point_track {
    int32_t point; // index into the place's points; -1: a tag's corner
    struct vec3 world;
    double seen[3];  // covariance of its position when it was recognised: xx, xy, yy, pixels^2
    struct pixel at; // in the last image
    struct vec3 ray; // of that, on the plane z = 1
    double time_s;   // of that, when its row was read
    // The reprojection error that point, map and feature have in common in all following images; estimated so that a
    // change of tracks does not make the pose jump.
    double bias[2], bias_variance; // ideal pixels
    double noise[3];               // covariance of the tracking error, a running mean; xx, xy, yy
    bool fused;                    // took part in the map's pose of the last image
    struct klt_patch patch;
    struct vec3 template_view; // from where the patch was cut: the camera less the point, world axes
};

// The biases of a tag's corners, one after the other, as in struct point_track.
struct tag_track {
    bool known; // in view in the last image; else the rest is not set
    double bias[8], bias_variance;
};

struct locator {
    struct lens lens;       // as estimated so far
    struct lens given_lens; // as given
    int frames_since_focal; // tracked images since the focal length was last observed
    struct locator_options options;
    struct place_tag *tags;
    struct tag_pattern *patterns; // of each tag
    int32_t tag_count;
    struct tag_detector *detector;
    struct tag_detector *coarse_detector; // of half-size images; or NULL
    struct tag_refiner *refiner;
    struct place_landmark *points;
    int32_t point_count;
    uint8_t *gray;
    // Of the current image:
    struct tag_observation observations[PNP_MAX_TAGS];
    struct tag_depth depths[PNP_MAX_TAGS];
    int32_t observed_tag[PNP_MAX_TAGS]; // of each observation, index into tags
    int observed_count;
    struct feature features[FEATURES_MAX];
    double feature_depths[FEATURES_MAX]; // where there is a depth image
    struct feature_index index;
    struct landmark_match matches[FEATURES_MAX], other_matches[FEATURES_MAX]; // of the best pose; of an alternative
    struct focal_estimate focal;                                              // from all images that were localised
    // For the next image:
    struct klt_pyramid pyramid;
    struct point_track tracks[LOCATOR_MAX_TRACKS];
    int track_count;
    struct tag_track *tag_tracks; // of each tag
    int32_t *moved_votes;         // of each tag: images that show it moved, less those that show it in place
    struct tag_observation corrected[PNP_MAX_TAGS]; // observations less their biases
    struct pose_fusion fusion;
    int32_t *region_of, *points_by_region,
        region_start[LOCATOR_REGIONS + 1];  // landmarks by the region of the image that they should be seen in
    struct place_landmark *region_points;   // of one region
    int frames_unsearched[LOCATOR_REGIONS]; // images since landmarks were last searched for in each region
    uint8_t *missed_count;                  // of each landmark: searches in vain since it was last found, at most 255
    struct pose last;                       // camera_from_world of the last image that was localised
    struct shutter_motion last_motion;
    // With a rolling shutter:
    struct shutter_motion frame_motion; // of the current image
    struct shutter_motion *motion;      // &frame_motion; NULL: no rolling shutter
    struct shutter_motion expected;     // of the next image
};

// Begins an image: its grey copy, the lens, and the velocity's prior.
void locator_begin_frame(struct locator *locator, const uint8_t *color);
// Adds an observation of tag `which` of the place.
void locator_add_observation(struct locator *locator, const struct tag_observation *seen, int32_t which,
                             const uint16_t *depth);
// Observes tags that must be in view by the pose and are not among the observations. max_pixels: samples of each.
// Returns how many were added. *missing: how many more must be in view but were not found; or NULL.
int locator_detect_predicted(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                             const struct pose *camera_from_world, int max_pixels, int *missing);
// The image's features into the index; locator->gray holds the image.
MUST_CHECK enum status locator_extract_features(struct locator *locator, const uint16_t *depth);
// The same in one region, 0 .. LOCATOR_REGIONS - 1, and a little beyond.
MUST_CHECK enum status locator_extract_region_features(struct locator *locator, int region, const uint16_t *depth);
// The observed tags as input of the pose solver.
void locator_pnp_tags(const struct locator *locator, struct pnp_tag *tags);
// The pose problem of the observed tags and of points, either of which may be empty.
struct pose_problem locator_problem(const struct locator *locator, struct pnp_tag *tags, const struct pnp_point *points,
                                    int point_count);
// Which of the observed tags agree with the pose: sets used and rms_px. Returns how many.
int locator_select_inlier_tags(const struct locator *locator, struct pnp_tag *tags, const struct shutter_motion *motion,
                               const struct pose *camera_from_world);
// Root mean square reprojection error over the corners of the tags used.
double locator_rms(const struct locator *locator, const struct pnp_tag *tags, const struct pose *camera_from_world);
// Fills *out. False: the pose is too uncertain.
bool locator_fill_result(const struct locator *locator, const struct pnp_solution *found, int point_count,
                         const double covariance[36], const double noise[36], struct location *out);

// Whether a point (camera axes) is inside or near the image; far outside, the distortion polynomial is not valid.
static inline bool locator_in_image(const struct lens *lens, struct vec3 p)
{
    return p.z > 0.1 && fabs(p.x) < lens->width / lens->fx * p.z && fabs(p.y) < lens->height / lens->fy * p.z;
}

// Whether the tags of the current image fit no pose (`found` is the best; NULL: there is none) unless the rows of a
// camera without a rolling shutter in its lens were read one after the other. If so, it has one from now on.
bool locator_detect_rolling_shutter(struct locator *locator, const struct pnp_tag *tags,
                                    const struct pnp_solution *found);

// After an image localised from scratch: which of the observations are not where the place has their tags. points: how
// many landmarks agree with the pose.
void locator_vote_moved_tags(struct locator *locator, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world);

// Before an image: updates an uncertain focal length by the images so far. When it changes, all tracks are dropped.
void locator_update_lens(struct locator *locator);
// After a tracked image: now and then its problem is added to the estimate of an uncertain focal length.
void locator_observe_focal(struct locator *locator, const struct pose_problem *problem,
                           const struct pose *camera_from_world);
// Adds the position's uncertainty due to an uncertain focal length to the pose's covariance.
void locator_add_focal_variance(const struct locator *locator, const struct pose_problem *problem,
                                const struct pose *camera_from_world, double covariance[36]);
