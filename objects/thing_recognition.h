// Recognising known things in a pair of images, or in one: from reference pictures alone.
//
// Method: SIFT features of the red and the blue channel (Lowe 2004); every match gives by itself a place, a size, a
// turn and so, with the thing's true size, a pose (no vote is needed: a far can has one or two right matches). Each
// hypothesis is checked by the picture itself (correlation of the thing's texture with the image); the best are aligned
// in all views together (thing_align.h), coarse to fine, flat and as a solid of revolution. What does not look right in
// every view is not found.
#pragma once
#include "objects/thing_align.h"

struct recognizer; // the models of all things; only read once it is made: any number of threads may use it

struct recognition_options {
    double nearest_m, farthest_m; // 0.15, 4
    int kept;                     // hypotheses of each thing that are aligned; 6
};
struct recognition_options recognition_default_options(void);

// options NULL: the default. ERR_MEMORY, ERR_SOLVER, ERR_INPUT: a picture shows nothing. On error *out is NULL. The
// list must outlive it.
MUST_CHECK enum status recognizer_open(struct recognizer **out, const struct thing_list *things,
                                       const struct recognition_options *options);
void recognizer_close(struct recognizer **recognizer);

// One thing seen, with both shapes tried.
struct detection {
    int thing;
    struct alignment by[THING_SHAPES];
    bool found[THING_SHAPES];
};

// At most one detection a thing; out: as many as there are things. views with features. ERR_MEMORY.
MUST_CHECK enum status recognizer_find(const struct recognizer *recognizer, const struct thing_view *views,
                                       int view_count, struct detection *out, int *count);

// What many sightings have shown of a thing. All 0: nothing yet.
struct thing_traits {
    double turned_evidence; // sum of log probability ratios, turned against flat
    struct {
        double information, sum; // of log_scale, without the prior of what the picture tells
    } size[THING_SHAPES];
};
void thing_traits_add(struct thing_traits *traits, const struct recognizer *recognizer,
                      const struct detection *detection);

// The detection as a sighting with the thing's shape and size as `traits` have them (NULL: as it is by itself), aligned
// once more in the views. NOTHING: it does not look right after all.
MUST_CHECK enum status recognizer_refine(const struct recognizer *recognizer, const struct detection *detection,
                                         const struct thing_traits *traits, const struct thing_view *views,
                                         int view_count, struct sighting *out);

// Adds to the covariance what the error of the rig's calibration does at the sighting (stereo_calibration.h).
void sighting_add_rig_error(struct sighting *sighting, const struct covariance3 *error_at_1m);
