// The map of a place from a sweep of its empty room: where its tags hang, where
// its natural points are, and a well-spread handful of views.
//
//     mapper_open, mapper_add for each frame, mapper_finish, mapper_close
//
// A second sweep may add to a place that is there: mapper_options.prior.
// Scale comes from the tags' known sides, and depth that is too long or short by one share
// everywhere is corrected; without any tag from depth alone, and natural points make the place.
// Deterministic: the same frames give the same place. One handle, one thread; two of its own
// find tags and points in the pictures while the next ones come.
#pragma once
#include "capture/recording/place.h"
#include "platform/source.h"

struct mapper;

// A tag that somebody measured with a ruler: the outer edge of its black square.
struct mapper_tag {
    int32_t id; // of tag36h11
    double side_m;
};

enum { MAPPER_MAX_TAGS = 587 };

// tags.json: {"family": "tag36h11", "side_m": {"0": 0.2, "7": 0.24}}. *tags is
// malloc'ed, by number; the caller frees it.
// ERR_MISSING, ERR_IO, ERR_MEMORY, ERR_INPUT: malformed, another family, no tag, a senseless side.
MUST_CHECK enum status mapper_read_tags(const char *path, struct mapper_tag **tags, int32_t *count);

struct mapper_options {
    double quad_decimate; // the tag finder's, 1..8. Default 1
    int32_t most_points;  // natural points kept of this sweep. Default 4000; 0: none are looked for
    int32_t most_views;   // views of this sweep kept as background. Default 40
    // The place that the sweep adds to; must outlive the mapper. Default NULL: a new one. The world
    // stays as it is there, and so do points and tags, but for tags that were hung elsewhere since;
    // what is new is placed by those in sight.
    // Views are added only if the calibration is the same.
    const struct place *prior;
};
struct mapper_options mapper_default_options(void);

// tag_count 0: a place of natural points (or what `prior` has); the calibration must say `registered`
// unless `prior` has tags. Tags of `prior` need not be listed again.
// Copies what it needs. ERR_INPUT: a senseless lens or option, neither tags nor depth, a number
// twice, another side than in `prior`. ERR_MEMORY.
MUST_CHECK enum status mapper_open(struct mapper **out, const struct calibration *calibration,
                                   const struct mapper_tag *tags, int32_t tag_count,
                                   const struct mapper_options *options);

// Has tags and points looked for in a copy of the frame and waits only while several others are. A frame
// without colour is ignored. Depth helps where the calibration says `registered`.
// Of a long sweep every second, fourth … frame is kept, so that memory is bounded.
// ERR_MEMORY, ERR_SOLVER, which may be an earlier frame's.
MUST_CHECK enum status mapper_add(struct mapper *m, const struct frame *frame);

struct mapper_report {
    int32_t frames; // used, of frames_seen
    int32_t frames_seen;
    int32_t frames_placed;
    double lost_from_s, lost_to_s; // the longest part of the sweep that was not placed, from its start; equal: none
    int32_t tags_mapped;
    int32_t tags_unseen; // listed but in no frame; the first is first_unseen
    int32_t first_unseen;
    int32_t tags_disconnected; // seen, but never together with a tag of the map
    int32_t first_disconnected;
    int32_t tags_unlisted; // seen in at least two frames, not listed: ignored
    int32_t first_unlisted;
    int32_t tags_outlier; // seen in two places of the sweep, and left out; the first is first_outlier
    int32_t first_outlier;
    int32_t tags_moved; // of `prior`, that hang elsewhere now: placed anew, or left out if that is not possible
    int32_t first_moved;
    bool floor_from_depth; // else z = 0 is the lowest corner of a tag, or the lowest point. With `prior`: true
};

// The place, in world axes as place.h has them. The caller owns *out: place_free.
// ERR_INPUT: no listed tag was seen, or none could be placed; without tags: too little to
// recognise; with `prior`: nothing of it was seen. ERR_MEMORY, ERR_SOLVER.
// On error *out is zeroed. Call it once.
MUST_CHECK enum status mapper_finish(struct mapper *m, struct place *out, struct mapper_report *report);

void mapper_close(struct mapper **m); // NULL is fine; sets *m = NULL
