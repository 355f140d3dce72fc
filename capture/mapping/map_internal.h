// What the files of the mapper share: the frames of the sweep, the tags and the landmarks ("points").
//
// World axes: those of the reference tag, without tags those of the first frame, until map_align_gravity puts z up.
// Everything here runs on the thread of the mapper's caller; only map_frontend has threads of its own. After ERR_MEMORY
// or ERR_SOLVER the map may be half changed: only mapper_close is allowed then.
//
// Call order, without cycles: mapper -> map_bootstrap, map_merge, map_outlier_tags -> map_registration,
// map_loop_closure -> map_landmarks -> map_triangulation, map_bundle_adjust -> map_rolling_shutter; map_tags is
// called by all and calls none.
#pragma once
#include "capture/mapping/mapper.h"
#include "locate/landmark_matching.h"
#include "platform/vision/bundle_adjustment.h"

// All chosen by hand, for the memory and time of a sweep of some minutes.
enum {
    MAP_MAX_FRAMES = 240,      // when reached, every second frame is dropped
    MAP_MAX_IMAGES = 96,       // frames that keep their image and depth
    MAP_MAX_FEATURES = 600,    // of one frame
    MAP_MAX_CANDIDATES = 16000 // new landmarks while the map grows
};

struct map_feature {
    struct feature feature;
    double depth;              // metres; 0: none, or at a depth edge
    double triangulated_depth; // metres, initial value where there is no depth; 0: none
    int32_t point;             // the landmark that it shows; -1: none
    struct pixel raw_pixel;    // `feature.at` and `depth` before map_undo_rolling_shutter
    double raw_depth;
};

struct map_frame {
    int64_t time_ns;
    struct tag_observation *seen;     // of listed tags
    struct tag_depth *depths;         // one for each; count 0 without depth
    struct tag_observation *raw_seen; // before map_undo_rolling_shutter
    struct tag_depth *raw_depths;
    int32_t *tag_index; // of each of `seen`: index into map.tags
    int32_t seen_count;
    struct map_feature *features;
    int32_t feature_count;
    uint8_t *jpeg; // NULL where the image was dropped
    size_t jpeg_bytes;
    uint16_t *depth; // millimetres; NULL: none, or dropped
    bool placed;     // camera_from_world is known
    bool visited;    // its landmarks are in the map
    struct pose camera_from_world;
    bool has_odometry;
    struct pose odometry_from_camera; // as in struct frame
};

struct map_tag {
    int32_t id;
    double side_m;
    struct tag_pattern pattern;
    bool mapped;            // world_from_tag is known
    bool fixed;             // a constant of the adjustment: fixes the gauge
    bool outlier;           // seen in two positions in this sweep, and left out
    bool moved;             // was at another position in an earlier sweep
    bool wrong;             // the depth shows another side than the list names, and it is left out
    double measured_side_m; // by the depth; 0: not enough of it
    struct pose world_from_tag;
    double rms_px;
    int32_t observations;
    float covariance[21]; // as in struct place_tag
};

struct map {
    struct calibration calibration;
    struct map_frame *frames;
    int32_t frame_count, frame_capacity;
    struct map_tag *tags;
    int32_t tag_count;
    struct place_landmark *points;
    int32_t *point_observations;
    int32_t point_count, point_capacity;
    int32_t held_points; // the first so many are an earlier sweep's and constant
    int32_t fixed_frame; // the frame that fixes the gauge; -1: tags or held landmarks do
    bool has_prior;      // the sweep adds to a place, whose tags and landmarks are constant
    bool has_depth;      // at least one frame has
    bool list_is_wrong;  // most tags' sides are, by the depth
    double side_ratio;   // the sides that the depth shows over the listed ones, their median; 0: not known
    double depth_scale;  // true depth = the sensor's depth times this
    double rms_px, rms_m;
    void (*on_step)(void *self); // as in mapper_options
    void *self;
    double expected_m;  // rms_m, if depth were as exact as depth_absolute_sigma_m says
    bool found_readout; // the lens's readout_s was not given
};

// Reprojection error of a feature, pixels; p: its landmark in camera axes.
static inline double map_reprojection_px(const struct lens *lens, struct vec3 p, const struct feature *feature)
{
    struct vec3 ray = lens_ray(lens, feature->at);
    return hypot(lens->fx * (p.x / p.z - ray.x), lens->fy * (p.y / p.z - ray.y));
}

// ---- map_tags.c: lookup of observed tags
// Standard deviation of a tag's corners in a map that still grows, pixels. Chosen by hand.
static const double MAP_TAG_PX = 0.1;
// Tags of frame f that are in the map, as pnp_solve takes them; out: PNP_MAX_TAGS. `used` is set. Returns the count.
int map_tag_correspondences(const struct map *map, const struct map_frame *frame, struct pnp_tag *out);
// The tag that most frames show: the best one to fix the gauge. mapped: only among those in the map. -1: none.
int32_t map_most_observed_tag(const struct map *map, bool mapped);

// ---- map_registration.c: incremental growth of the pose graph of frames and tags
// From single tags to an initial pose of every tag and frame that are connected; without any tag listed, from one frame
// by landmarks alone.
// use_points: landmarks decide between the two planar poses of a frame.
MUST_CHECK enum status map_bootstrap(struct map *map, bool use_points);

// Before map_bootstrap: measures the side of every new tag by its depth, and leaves out those whose listed side is
// wrong, unless most are. ERR_MEMORY.
MUST_CHECK enum status map_check_tag_sides(struct map *map);

// No listed tag is in any picture: ERR_INPUT with the likeliest cause. pictures_with_tag: of each number, listed or
// not. ERR_MEMORY.
enum status map_explain_no_tags(const struct map *map, const int32_t *pictures_with_tag);

// Before anything of the map. ERR_INPUT: depth is mirrored or upside down against the colour, by the tags that both
// show, or else by the edges (locate/stream_turn.h). ERR_MEMORY.
MUST_CHECK enum status map_check_depth_turn(const struct map *map);
// Once the map no longer moves: the lens, and depth against the list of tags. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status map_judge(struct map *map, struct mapper_report *report);
// ERR_INPUT, with the likeliest cause: the map is of no use.
MUST_CHECK enum status map_check_use(const struct map *map, const struct mapper_report *report);

// After map_bootstrap: tags that the sweep shows in two positions are no longer mapped.
void map_remove_outlier_tags(struct map *map);

// ---- map_bundle_adjust.c: bundle adjustment (Triggs et al. 2000) with robust kernels
// Frames, tags and landmarks together.
// fix_frames: only the tags move, and landmarks are left out. *cost: the final robust cost, the sum of whitened squared
// residuals; or NULL.
MUST_CHECK enum status map_bundle_adjust(struct map *map, int rounds, bool fix_frames, double *cost);
// With the standard deviation of landmark observations larger by extra_sigma_px: for initial poses that are so far off.
MUST_CHECK enum status map_bundle_adjust_relaxed(struct map *map, int rounds, double extra_sigma_px);
// Where tags give the scale: the common scale error of all depth is estimated as well, and corrected.
MUST_CHECK enum status map_bundle_adjust_depth_scale(struct map *map, int rounds);
// Only with the landmarks for which included[point]; the others move rigidly with the first frame that shows them.
MUST_CHECK enum status map_bundle_adjust_subset(struct map *map, int rounds, const bool *included);
// The lens that fits best, with everything else free; the map stays as it is.
MUST_CHECK enum status map_fit_lens(struct map *map, int rounds, struct ba_lens *lens);
// Corrects all depth by a factor.
void map_scale_depth(struct map *map, double times);
// The joint covariance of all tags at their present poses. tags: 6 tag_count on a side, row-major; each tag's six
// numbers are in its own axes, rotation (rad), then translation (m), as bundle_adjustment.h has them.
MUST_CHECK enum status map_joint_tag_covariance(struct map *map, double *tags);
// Sets rms_px, rms_m, and each tag's rms_px and observations.
void map_compute_residuals(struct map *map);

// ---- map_rolling_shutter.c
// Moves the observations of placed frames to where the camera at the middle row's time would have seen
// them, as far as the map and the neighbouring frames tell. Each map_bundle_adjust begins with it.
void map_undo_rolling_shutter(struct map *map);
// Of an adjusted map: whether its landmarks show that the camera takes longer to read an image than its lens says.
bool map_shows_longer_readout(const struct map *map);

// ---- map_landmarks.c: landmarks from ORB features (Rublee et al. 2011)
// Buffers for one frame at a time.
struct map_scratch {
    struct feature features[MAP_MAX_FEATURES];
    double depth[MAP_MAX_FEATURES];
    struct feature_index index;
    struct landmark_match matches[MAP_MAX_FEATURES];
};
void map_index_features(struct map_scratch *scratch, const struct map *map, const struct map_frame *frame);
// All landmarks of the map against the features in *scratch, with the tags of the same frame, which may be none.
static inline struct match_query map_match_query(const struct map *map, const struct map_scratch *scratch,
                                                 struct pnp_tag *tags, int tag_count)
{
    return (struct match_query){.points = map->points,
                                .point_count = map->point_count,
                                .index = &scratch->index,
                                .depth = scratch->depth,
                                .lens = &map->calibration.color,
                                .tags = tags,
                                .tag_count = tag_count};
}
// The first `count` of scratch->matches become what the frame shows.
void map_assign_matches(struct map_frame *frame, const struct map_scratch *scratch, int count);
// Features without a landmark become landmarks, where their depth is measured or can be triangulated.
void map_create_landmarks(struct map *map, struct map_frame *frame);
// Matches landmarks from placed frame to placed frame and refines the frames' poses.
MUST_CHECK enum status map_build_landmarks(struct map *map);
// Matches all landmarks in all frames again and adjusts everything, twice. The `max` best new landmarks are kept, each
// with its medoid descriptor.
MUST_CHECK enum status map_refine_landmarks(struct map *map, int32_t max);

// Sets triangulated_depth of the features of a placed frame, from the other placed frames.
void map_triangulate(const struct map *map, struct map_frame *frame);
// Removes the observations of new landmarks that were seen from nearly one direction only. ERR_MEMORY.
MUST_CHECK enum status map_cull_low_parallax(struct map *map);

// ---- map_bundle_adjust.c: once the map no longer moves
// The covariance and mean viewing direction of each new landmark. ERR_MEMORY.
MUST_CHECK enum status map_landmark_covariances(struct map *map);
// The covariance of each new tag.
MUST_CHECK enum status map_tag_covariances(struct map *map);

// ---- map_registration.c: frames registered by landmarks
// Decides between the two planar poses of frames by their landmarks. *placed: how many frames.
MUST_CHECK enum status map_resolve_ambiguous_poses(struct map *map, int *placed);
// Registers frames that show no tag of the map: tracking from a neighbour's pose, else relocalisation in the whole map;
// each adds its landmarks. *placed: how many frames.
MUST_CHECK enum status map_register_frames(struct map *map, int *placed);
// Without tags: the frame with most depth fixes the gauge, its features become the map.
MUST_CHECK enum status map_init_from_depth(struct map *map);

// ---- map_registration.c: an existing place, held constant while a sweep adds to it
// The tags listed, and the tags and landmarks of the place, which are constant. Fills tags, points and their counts.
MUST_CHECK enum status map_load_prior(struct map *map, const struct place *prior, const struct mapper_tag *tags,
                                      int32_t tag_count);
// Tags of the place that contradict its landmarks and other tags are estimated from scratch, as if they were new.
// ERR_MEMORY.
MUST_CHECK enum status map_release_moved_tags(struct map *map);
// ERR_INPUT: the sweep shows nothing of the place.
MUST_CHECK enum status map_check_overlap(const struct map *map);
// After map_compute_residuals: adds the observations of earlier sweeps.
void map_merge_residuals(struct map *map, const struct place *prior);
// Copies of the earlier sweeps' views. ERR_MEMORY.
MUST_CHECK enum status map_copy_prior_views(const struct place *prior, struct place *out);

// Landmarks that are in the map twice, because the sweep came back to them, become one; then everything is adjusted.
MUST_CHECK enum status map_close_loops(struct map *map);

// Rotates and shifts the world so that z is up (by odometry where the sensor has it, else by tags or surfaces; then by
// the floor, where it was seen), z = 0 the floor, x along the x axis of the tag with the lowest number;
// without tags, x to the right of the first placed frame's view and the origin below it. *floor: the floor was fitted
// to depth.
MUST_CHECK enum status map_align_gravity(struct map *map, bool *floor);
