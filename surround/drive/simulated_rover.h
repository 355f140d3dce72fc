// A simulated robot in a world of boxes, driven by command, which captures its surroundings as a real one does: four
// depth cameras with noise, a panorama, odometry that drifts, walls that can be hit. Nothing that draws for the
// operator sees the world itself. Deterministic.
#pragma once
#include "base/lens.h"
#include "surround/drive/operator_overlay.h"
#include "surround/surroundings.h"

// ---------------------------------------------------------------- world of boxes

// A small world of boxes that a simulated robot drives in, seen by ray casting: its panorama and depth pictures, and
// what its body touches. Colours are a fixed function of the place, so that the same view gives the same picture. Pure.

enum { BOX_WORLD_MAX = 32 };

struct box {
    double low[3], high[3]; // metres, world: x, y level, z up
    uint8_t color[3];
    bool inside; // seen from inside: a room's walls, floor and ceiling
};

struct box_world {
    struct box boxes[BOX_WORLD_MAX];
    int count;
};

// What a ray from `from` along unit `ray` meets first: its distance, and its colour where rgb is not NULL. 0: nothing.
double box_world_cast(const struct box_world *world, const double from[3], const double ray[3], uint8_t rgb[3]);

// Equirectangular, width x height, RGB.
void box_world_panorama(const struct box_world *world, struct pose world_from_camera, int width, int height,
                        uint8_t *rgb);

// Millimetres along the optical axis, 0 beyond `range_m`; noise of a structured-light sensor when `seed` is not 0.
void box_world_depth(const struct box_world *world, struct pose world_from_camera, const struct lens *lens,
                     double range_m, uint32_t seed, uint16_t *depth);

// Distance from a body's rectangle (centre at pose, length along x) to the nearest box that reaches into its height;
// negative or 0: they touch.
double box_world_clearance(const struct box_world *world, struct pose world_from_body, const double size_m[3]);

// ---------------------------------------------------------------- rover

struct rover_options {
    double size_m[3];              // length, width, height of the body
    double odometry_scale;         // ways are reported longer by this share, 0.01
    double odometry_turn;          // turns, too, 0.02
    int panorama_height;           // pixels; twice as wide
    int depth_width, depth_height; // pixels of each depth camera
    struct lens view;              // of the operator's pictures
    uint32_t seed;                 // of the depth noise; not 0
};
struct rover_options rover_default_options(void);

// Its cameras: body_from_camera of the panorama's and of a depth camera's (0 front, 1 left, 2 back, 3 right), and the
// depth cameras' lens and range.
struct pose rover_head(void);
struct pose rover_depth_camera(int camera);
struct lens rover_depth_lens(const struct rover_options *options);
#define ROVER_RANGE_M 4.0

struct simulated_rover {
    struct box_world world;
    struct rover_options options;
    struct pose start;           // true, world_from_body
    struct pose world_from_body; // true
    struct pose odometry;
    struct drive_command command;
    bool touched; // it ran into something, and stands
    int64_t time_ns, captured_ns;
    struct surroundings surroundings; // its world is the body at the start
};

// ERR_MEMORY.
MUST_CHECK enum status simulated_rover_open(struct simulated_rover *rover, const struct box_world *world,
                                            struct pose start, const struct rover_options *options);
void simulated_rover_close(struct simulated_rover *rover);

// Drives for `seconds`, captures when it is time (first at the start).
MUST_CHECK enum status simulated_rover_step(struct simulated_rover *rover, struct drive_command command,
                                            double seconds);

// What the operator's side believes: world_from_body in the surroundings' world, bridged by odometry.
struct pose simulated_rover_pose(const struct simulated_rover *rover);

// Worlds 1 to 3, the stages of Okura 2014, section 5: a straight narrow passage, a bent one with obstacles, a wall to
// approach.
void rover_stage_world(int stage, struct box_world *world, struct pose *start);
