// A small made-up road: a lane between two white lines, kerbs, houses, poles and a parked van, under a black sky;
// panoramas from a vehicle, the points of its line scanners, virtual cameras with their true pictures and depth, and a
// plain detector of white lines. World: x along the road, y left, z up; the lane's middle is y = 0.
#pragma once
#include "surround/depth/depth_seeds.h"
#include "surround/drive/simulated_rover.h"
#include "surround/view/surround_view.h"

enum { ROAD_PANORAMAS = 6, ROAD_HEIGHT = 384 /* of a panorama */ };
#define ROAD_LINE_Y 1.75 // the lines' middles are at +- this

struct road_scene {
    struct box_world world;
    struct surround_picture pictures[ROAD_PANORAMAS]; // with dense depth, every 2 m, 2.1 m above the road
    float (*points)[3];
    int point_count;
};

// seed: of the scanners' noise (1 cm). Makes the pictures' dense depth. ERR_MEMORY.
MUST_CHECK enum status road_scene_make(struct road_scene *s, uint32_t seed);
void road_scene_free(struct road_scene *s); // a zeroed one is fine

// Virtual cameras beside and below the panoramas' way, as in paper 003, table 2: 640 x 512 pixels, 67 degrees, divided
// by `shrink`; number from 0.
struct lens road_view_lens(int shrink);
struct pose road_view(int number);

// What such a camera truly sees. depth: along the axis, 0 = sky.
void road_view_truth(const struct road_scene *s, const struct lens *lens, struct pose world_from_view, uint8_t *rgb,
                     float *depth);

// Where the lane's lines are 6 m ahead of a camera: metres to its left; left[0], right[1]. NAN: not found. From the
// picture and the camera's pose above the plane z = 0 alone.
void road_find_lines(const uint8_t *rgb, const struct lens *lens, struct pose world_from_view, double lines[2]);
