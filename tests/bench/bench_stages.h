// All stages, in the order in which they run. One line each, in both lists.
#pragma once
#include "tests/bench/bench.h"

extern const struct bench_stage bench_stage_depth;
extern const struct bench_stage bench_stage_skeleton;
extern const struct bench_stage bench_stage_search;
extern const struct bench_stage bench_stage_tags;
extern const struct bench_stage bench_stage_tag_distance;
extern const struct bench_stage bench_stage_objects;
extern const struct bench_stage bench_stage_mapping;
extern const struct bench_stage bench_stage_smoothing;
extern const struct bench_stage bench_stage_avatar;
extern const struct bench_stage bench_stage_map;
extern const struct bench_stage bench_stage_still;
extern const struct bench_stage bench_stage_tum;
extern const struct bench_stage bench_stage_views;
extern const struct bench_stage bench_stage_held_out;
extern const struct bench_stage bench_stage_prepare;
extern const struct bench_stage bench_stage_draw;
extern const struct bench_stage bench_stage_lod;
extern const struct bench_stage bench_stage_compare;
extern const struct bench_stage bench_stage_attempts;
extern const struct bench_stage bench_stage_judging;
extern const struct bench_stage bench_stage_live;
extern const struct bench_stage bench_stage_repetitions;
extern const struct bench_stage bench_stage_segment;
extern const struct bench_stage bench_stage_color;
extern const struct bench_stage bench_stage_record;
extern const struct bench_stage bench_stage_open;
extern const struct bench_stage bench_stage_surround;
extern const struct bench_stage bench_stage_filmed;
extern const struct bench_stage bench_stage_stability;

static const struct bench_stage *const bench_stages[] = {
    &bench_stage_depth,        &bench_stage_skeleton, &bench_stage_search,  &bench_stage_tags,
    &bench_stage_tag_distance, &bench_stage_objects,  &bench_stage_mapping, &bench_stage_smoothing,
    &bench_stage_avatar,       &bench_stage_map,      &bench_stage_still,   &bench_stage_views,
    &bench_stage_held_out,     &bench_stage_prepare,  &bench_stage_draw,    &bench_stage_lod,
    &bench_stage_compare,      &bench_stage_attempts, &bench_stage_judging, &bench_stage_repetitions,
    &bench_stage_live,         &bench_stage_segment,  &bench_stage_color,   &bench_stage_record,
    &bench_stage_open,         &bench_stage_surround, &bench_stage_filmed,  &bench_stage_tum,
    &bench_stage_stability,
};
