// The sections of the page that show a stage, in order. A line each; a stage without one is not on the page.
#pragma once
#include "tests/bench/bench_page.h"
#include "tests/bench/bench_stages.h"

static const struct bench_section bench_sections[] = {
    {&bench_stage_tags, "Tags and pose", "ours, every pixel", "error of the range, mm",
     "time of an image of 640 × 480, ms"},
    {&bench_stage_map, "Tracking and relocalisation", "ours, tracked", "error of the position, mm",
     "time of an image, ms"},
    {&bench_stage_mapping, "Mapping", "ours, 40 images", "error of the tags' corners, mm",
     "time of a sweep, all threads, ms"},
    {&bench_stage_segment, "Segmentation", "ours, room known", "wrong pixels of the mask, %",
     "time of an image of 320 × 240, ms"},
    {&bench_stage_skeleton, "Skeleton, online", "600 points, 5 rounds", "mean error of 16 joints, mm",
     "time of a frame, segmentation included, ms"},
    {&bench_stage_smoothing, "Skeleton, smoothed", "smoothed", "mean error of 16 joints, mm",
     "time of a frame of 320 × 240, tracking included, ms"},
    {&bench_stage_compare, "Comparison", "ours, exact", "price above the best alignment's, %",
     "time of two movements of 10 s, ms"},
    {&bench_stage_search, "Frame retrieval", "ours, 10 000 frames", "cost above the best frame's, m",
     "time of a query, ms"},
    {&bench_stage_avatar, "Avatar", "120 frames", "wrong pixels of the outline, %",
     "time to the first picture, all threads, ms"},
    {&bench_stage_views, "The picture", "full", "wrong pixels of the outline, %", "time of an image, read back, ms"},
    {&bench_stage_draw, "Drawing", "ours, changing frames", "draw calls of an image", "time of an image, ms"},
    {&bench_stage_depth, "Depth coding", "ours", "bits a pixel, lossless", "time to encode 640 × 480, ms"},
    {&bench_stage_color, "Colour coding", "JPEG, quality 92", "bits a pixel", "time to encode an image, ms"},
    {&bench_stage_record, "Writing", "one file", "kilobytes a frame", "time of a frame, all threads, ms"},
    {&bench_stage_open, "Opening", "cylinders first", "wrong pixels of the outline, %",
     "time to the first picture, all threads, ms"},
    {&bench_stage_objects, "Known things", "ours", "error of a thing's middle, px", "time of a pair of pictures, ms"},
    {&bench_stage_live, "Doing the move beside the actor", NULL, NULL, NULL},
    {&bench_stage_surround, "Surroundings", "ours", "error of the colours, levels",
     "time of an image of 640 × 512, ms"},
    {&bench_stage_lod, "Level of detail", NULL, NULL, NULL}, // its own section, by distance
};
