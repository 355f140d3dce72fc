// One recorded frame's depth image, labelled: which body part each pixel shows, how far it is from the nearest depth
// edge, and how wide the surface about it is. Pixels are labelled by the nearest part's capsule; edges
// and widths come from two-pass distance transforms. Method: our own. Pure and deterministic; the take is only read.
// One depth_frame, one thread.
//
// Memory: 5 bytes a depth pixel, allocated by depth_frame_open.
#pragma once
#include "base/depth_noise.h"
#include "recording/recording.h"
#include "reenact/skeleton/bind_pose.h"
#include "reenact/skeleton/skeleton_track.h"

// ---------------------------------------------------------------- part label

// Labels depth pixels with body parts: a point belongs to the part whose capsule (the part's cylinder of [D14] 4.1 with
// hemispherical ends) it is nearest to. Also the rays of a take's depth pixels. Pure; deterministic.

// Capsules of one skeleton's known parts. Metres, the skeleton's axes.
struct part_capsules {
    int count;
    enum part part[PART_COUNT];
    struct vec3 from[PART_COUNT], along[PART_COUNT];
    double along2[PART_COUNT], radius[PART_COUNT];
    struct vec3 middle[PART_COUNT];
    double bounding_radius[PART_COUNT]; // of the ball about `middle` that holds the capsule
};
struct part_capsules part_capsules_of(const struct skeleton *skeleton, const struct body *body);

enum { PART_LABEL_PERSON = 1 << 15 };

// Bit p: part p is at most shared_m farther than the nearest part; and PART_LABEL_PERSON. 0: p is more than outside_m
// outside every part.
uint16_t part_label(const struct part_capsules *bones, struct vec3 p, double shared_m, double outside_m);

// How far outside all parts a pixel may lie and still be the actor's: farther with a mask, which excludes other things,
// than without. Chosen by hand.
double part_max_distance_m(bool has_mask);

// True: the pixel is in the mask (NULL: any with a depth sample), not on the image's border, and at least two of its
// four neighbours lie on one surface with it. At depth edges, samples can lie between the actor and the background.
bool part_pixel_on_surface(const uint16_t *depth, const uint8_t *mask, int width, int height, int i);

// The ray of every depth pixel, made once for a take: 8 bytes a pixel. Immutable, so any number of threads may read it.
struct source_rays;
MUST_CHECK enum status source_rays_open(struct source_rays **out,
                                        const struct calibration *calibration); // ERR_MEMORY: *out is NULL
void source_rays_close(struct source_rays **rays);                              // NULL is fine; sets *rays = NULL
int source_rays_count(const struct source_rays *rays);
// The point of depth pixel `i` at `depth_mm` > 0, in the COLOUR camera's axes, metres.
struct vec3 source_rays_point(const struct source_rays *rays, int i, uint16_t depth_mm);

// ---------------------------------------------------------------- depth frame

enum {
    DEPTH_FRAME_BACKGROUND = PART_COUNT, // not the actor, or no depth sample
    DEPTH_FRAME_MIXED, // the actor's, but at an edge: between two surfaces, or farther from every part
};

enum { DEPTH_FRAME_MAX_EDGE_PX = 100 };
enum { DEPTH_FRAME_INWARD_PX = 3 }; // how far depth_frame_step_inside searches
#define DEPTH_FRAME_RIM_PX 0.6      // the silhouette lies so far beyond the outermost labelled pixels

// What the frames of one take are read with. All borrowed.
struct frame_source {
    struct take *take;
    const struct take_skeletons *skeletons;
    const struct source_rays *rays;
};

struct depth_frame {
    int width, height;
    double fx; // of the depth lens, pixels
    const struct source_rays *rays;
    const struct body *body;
    uint16_t *depth;        // millimetres; the background's where the actor blocks the projector
    uint8_t *part;          // of each pixel: a part, or one of the above
    uint8_t *edge_distance; // of each pixel: to the nearest edge between two surfaces, pixels (city block), at most
                            // max_edge_distance
    uint8_t *half_width;    // of each of the actor's pixels: half the width of the surface about it, pixels, along the
                            // narrower of the image's two axes
    int max_edge_distance;  // of the search for edges; DEPTH_FRAME_MAX_EDGE_PX unless the caller sets less
    bool has_mask;
    int left, top, right, bottom; // bounds of the actor's pixels, inclusive; right < left: there are none
};

// rays and take must outlive it. ERR_MEMORY: *out is then zeroed.
MUST_CHECK enum status depth_frame_open(struct depth_frame *out, const struct take *take,
                                        const struct source_rays *rays);
void depth_frame_close(struct depth_frame *frame); // zeroed is fine; leaves it zeroed

// Labels a frame. images: its depth (not NULL) and mask (NULL: none), from take_read. joints: its skeleton, inpainted
// (take_skeletons_at), colour camera's axes.
void depth_frame_label(struct depth_frame *frame, const struct take_images *images, const struct skeleton *joints);

// From background pixel i to the actor's pixel next to it in direction `step` (an index offset), across mixed pixels:
// the first that shows a part, at most DEPTH_FRAME_INWARD_PX from i. -1: there is none, or the background is not
// clearly behind it.
int depth_frame_step_inside(const struct depth_frame *frame, int i, int step);

// Median of the actor's depth samples in the 3 x 3 window about pixel i, which is one of the actor's; millimetres.
int depth_frame_median_mm(const struct depth_frame *frame, int i);

// Assigns the actor's pixels to parts again, by better joints (colour camera's axes).
void depth_frame_relabel(struct depth_frame *frame, const struct skeleton *skeleton);

// Replaces colours that may be mixed with another surface's: a pixel of the actor's bounds (and one more on each side)
// that is at an edge or not the actor's takes the colour of the nearest pixel well within a surface. rgb and out are
// whole colour images and may be the same. Where depth is not registered to colour, a copy. ERR_MEMORY: *out is then a
// copy.
MUST_CHECK enum status depth_frame_clean_colors(const struct depth_frame *frame, const struct calibration *calibration,
                                                const uint8_t *rgb, uint8_t *out);

// ---------------------------------------------------------------- depth agreement

// Depth agreement: whether a point of the avatar is what a depth frame shows where it projects. This is the visibility
// test of everything that compares colours with the avatar. Axes are the depth camera's, metres. No state; any thread.

#define DEPTH_AGREEMENT_M 0.05 // a depth sample this near along z confirms a point; chosen by hand

// The pixel that p projects to, row by row; -1: outside the image, or less than 5 cm before the camera.
int depth_pixel_at(const struct lens *lens, struct vec3 p);

// Whether a pixel shows the actor, at least margin_px away from an edge between surfaces, DEPTH_AGREEMENT_M or less
// from depth_m.
bool depth_agrees(const struct depth_frame *frame, int pixel, double depth_m, int margin_px);

// Whether depth agrees where p, a point of `bone`, projects, on the bone's part or an adjacent one.
bool depth_agrees_with_bone(const struct depth_frame *frame, const struct lens *lens, struct vec3 p, int bone,
                            int margin_px);

// ---------------------------------------------------------------- depth frame cache

// Keeps the labelled depth frames of a take for a caller that reads them several times: each is read and labelled
// once, and a window about the actor is kept in memory, up to a bound. Deterministic; the take is only read. One
// cache, one thread at a time.

struct depth_frame_cache;

// source: copied; what it points to must outlive the cache. frames: `count` frame numbers of the take, copied.
// max_bytes: bound on what is kept (5 bytes a pixel of each window); frames beyond it are read from the take each
// time. ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status depth_frame_cache_open(struct depth_frame_cache **out, const struct frame_source *source,
                                              const int64_t *frames, int count, size_t max_bytes);
void depth_frame_cache_close(struct depth_frame_cache **s); // NULL is fine; sets *s = NULL

// Gives frames[i] as depth_frame_label labels it; more than DEPTH_FRAME_MAX_EDGE_PX pixels from the actor it may have
// no depth samples. `into` was opened for the same take and is overwritten. rgb: receives the frame's colour image, RGB
// of calibration.color; NULL: not wanted. The frame's row is read at most once. NOTHING: the frame lacks depth or
// skeleton, or colour where it is wanted. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status depth_frame_cache_read(struct depth_frame_cache *cache, int i, struct depth_frame *into,
                                              uint8_t *rgb);
