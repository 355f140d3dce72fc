// What the files of the mapper share: the frames of the sweep, the tags, the
// points, in a world that is the reference tag's (without tags the first frame's)
// until map_gravity turns it.
#pragma once
#include "capture/mapping/mapper.h"
#include "locate/landmark_matching.h"
#include "platform/bundle_adjustment.h"

enum {
    MAP_MAX_FRAMES = 240,      // more and every second one goes
    MAP_MAX_IMAGES = 96,       // frames that keep their picture and depth
    MAP_MAX_FEATURES = 600,    // of one frame
    MAP_MAX_CANDIDATES = 16000 // points while the map grows
};

struct map_feature {
    struct feature feature;
    double depth;              // metres; 0: none, or at the edge of something
    double triangulated_depth; // without depth, what two pictures make of it, to begin with; 0: nothing
    int32_t point;             // that it shows; -1: none
    struct pixel raw_pixel;    // `feature.at` and `depth` as they were before map_undo_rolling_shutter
    double raw_depth;
};

struct map_frame {
    int64_t time_ns;
    struct tag_observation *seen;     // of listed tags
    struct tag_depth *depths;         // one for each; count 0 without depth
    struct tag_observation *raw_seen; // before map_undo_rolling_shutter
    struct tag_depth *raw_depths;
    int32_t *tag_index; // index into map.tags
    int32_t seen_count;
    struct map_feature *features;
    int32_t feature_count;
    uint8_t *jpeg; // kept pictures: NULL where thinned out
    size_t jpeg_bytes;
    uint16_t *depth;
    bool placed;
    bool visited; // its points are in the map
    struct pose camera_from_world;
};

struct map_tag {
    int32_t id;
    double side_m;
    struct tag_pattern pattern;
    bool mapped;
    bool fixed;   // stays where it is, and the world with it
    bool outlier; // seen in two places of this sweep, and left out
    bool moved;   // hangs elsewhere than an earlier sweep had it
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
    struct place_point *points;
    int32_t *point_observations;
    int32_t point_count, point_capacity;
    int32_t held_points; // so many, the first ones, are an earlier sweep's and stay
    int32_t fixed_frame; // that holds the world still; -1: tags or points do
    bool has_prior;      // a place that is there: its tags and points are held
    bool has_depth;      // some frame does
    double depth_scale;  // the sensor's readings times this are true
    double rms_px, rms_m;
};

// ---- map_bootstrap.c: frames and tags from one another
// From single tags to a first pose of every tag and frame that hang together; without
// any tag listed, from one frame by points alone.
// use_points: of frames whose pose may be mirrored natural points say which one.
MUST_CHECK enum status map_bootstrap(struct map *m, bool use_points);
// Tags of frame f that are in the map, as fit wants them; out: PNP_MAX_TAGS. `used` is set.
int map_tag_correspondences(const struct map *m, const struct map_frame *f, struct pnp_tag *out);

// Which tag had best hold the world still: the one that most pictures show. mapped: of those in the map alone. -1:
// none.
int32_t map_most_observed_tag(const struct map *m, bool mapped);

// ---- map_outlier_tags.c
// Once the map has grown: tags that the sweep shows in two places are no longer mapped.
void map_remove_outlier_tags(struct map *m);

// ---- map_bundle_adjust.c
// All frames, tags and points at once; sightings that fit badly lose their weight.
// fix_frames: only the tags move, and points have no say. *cost: the robust cost left; or NULL.
MUST_CHECK enum status map_bundle_adjust(struct map *m, int rounds, bool fix_frames, double *cost);
// The same with points less sure by extra_sigma_px: for a start that is so far off.
MUST_CHECK enum status map_bundle_adjust_relaxed(struct map *m, int rounds, double extra_sigma_px);
// The same where tags say how large the place is: by how much all depth is too long or short is found out with the
// rest, and corrected.
MUST_CHECK enum status map_bundle_adjust_depth_scale(struct map *m, int rounds);
// The same with those points alone for which included[point]; the others go with the frames.
MUST_CHECK enum status map_bundle_adjust_subset(struct map *m, int rounds, const bool *included);
// The joint covariance of all tags, as bundle_adjustment.h has it, where they are. tags: 6 tag_count on a side.
MUST_CHECK enum status map_joint_tag_covariance(struct map *m, double *tags);
// rms_px, rms_m, and each tag's rms_px and observations.
void map_compute_residuals(struct map *m);

// ---- map_rolling_shutter.c
// Of a rolling shutter: puts what placed frames show where the middle row's camera would have seen it, as far as the
// map and the frames beside each tell. Each map_bundle_adjust begins with it.
void map_undo_rolling_shutter(struct map *m);

// ---- map_landmarks.c: natural points
// What is needed for one frame at a time.
struct map_scratch {
    struct feature features[MAP_MAX_FEATURES];
    double depth[MAP_MAX_FEATURES];
    struct feature_index index;
    struct landmark_match matches[MAP_MAX_FEATURES];
};
void map_index_features(struct map_scratch *d, const struct map *m, const struct map_frame *f);
// All landmarks of the map against the features in *d, with the tags of the same frame, which may be none.
static inline struct match_query map_match_query(const struct map *m, const struct map_scratch *d, struct pnp_tag *tags,
                                                 int tag_count)
{
    return (struct match_query){.points = m->points,
                                .point_count = m->point_count,
                                .index = &d->index,
                                .depth = d->depth,
                                .lens = &m->calibration.color,
                                .tags = tags,
                                .tag_count = tag_count};
}
// Takes over the first `count` of d->matches as what the frame shows.
void map_assign_matches(struct map_frame *f, const struct map_scratch *d, int count);
// Features that show no point of the map yet become points, where their depth is known or can be guessed.
void map_create_landmarks(struct map *m, struct map_frame *f);
// Finds points from placed frame to placed frame and sharpens their poses by them.
MUST_CHECK enum status map_build_landmarks(struct map *m);
// Looks for all points in all frames again and adjusts everything, twice. The `most`
// best new points stay, with their most typical descriptors.
MUST_CHECK enum status map_refine_landmarks(struct map *m, int32_t most);

// ---- map_triangulation.c
// Guesses how deep the features of a placed frame lie, from the other placed frames.
void map_triangulate(const struct map *m, struct map_frame *f);
// New points that were seen from nearly one direction only are seen no more. ERR_MEMORY.
MUST_CHECK enum status map_cull_low_parallax(struct map *m);

// ---- map_joint_tag_covariance.c
// The covariance of each new point, and from where it was seen. Once the map is where it stays. ERR_MEMORY.
MUST_CHECK enum status map_landmark_covariances(struct map *m);
// The same of each new tag.
MUST_CHECK enum status map_tag_covariances(struct map *m);

// ---- map_registration.c: frames placed by points
// Places frames of two possible poses by the points they show. How many.
MUST_CHECK enum status map_resolve_ambiguous_poses(struct map *m, int *placed);
// Places frames that show no tag of the map: from a neighbour's pose, else by what they
// show of the whole map; each adds its points. How many.
MUST_CHECK enum status map_register_frames(struct map *m, int *placed);
// Without tags: the frame with most depth holds the world, its points are the map.
MUST_CHECK enum status map_init_from_depth(struct map *m);

// ---- map_merge.c: a place that is there already, held still while a sweep adds to it
// The tags listed and those of the place, which are held; its points. Fills tags, points and their counts.
MUST_CHECK enum status map_load_prior(struct map *m, const struct place *prior, const struct mapper_tag *tags,
                                      int32_t tag_count);
// Tags of the place that are not where its points and other tags say are placed anew, as if they
// were new. ERR_MEMORY.
MUST_CHECK enum status map_release_moved_tags(struct map *m);
// ERR_INPUT: the sweep shows nothing of the place.
MUST_CHECK enum status map_check_overlap(const struct map *m);
// After map_compute_residuals: counts the sightings of earlier sweeps in.
void map_merge_residuals(struct map *m, const struct place *prior);
// Copies of the earlier sweeps' views. ERR_MEMORY.
MUST_CHECK enum status map_copy_prior_views(const struct place *prior, struct place *out);

// ---- map_loop_closure.c
// Points that came into the map twice, because the way there led round, become one.
MUST_CHECK enum status map_close_loops(struct map *m);

// ---- map_gravity.c
// Turns and shifts everything so that z is up, z = 0 the floor, x as the lowest
// tag has it; without tags, x to the right of the first frame's view and the origin
// below it. *floor: the floor was seen in depth.
MUST_CHECK enum status map_align_gravity(struct map *m, bool *floor);
