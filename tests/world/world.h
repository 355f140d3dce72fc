// A small synthetic world: a furnished room with tags, and in it a dressed, moving figure. All truth is known exactly:
// poses of cameras and tags, joints, the mask, the depth before the sensor's noise. Everything is generated from a
// seed: the same options give the same bytes.
//
// World axes: x right, y away from the sensor, z up, metres; the floor is z = 0
// and the room about 6.6 x 7.2 x 2.6 m. The sensor stands at y = -3.1 and looks
// along +y; a figure whose heading is 0 faces it. Time is in seconds from the
// motion's start. Camera axes as in base/lens.h.
//
//     struct world *w;
//     struct world_options o = world_default_options();
//     o.motion = "kata";
//     if (world_open(&w, &o)) ...                             // about 0.5 s
//     struct world_shot shot = {world_calibration(0.5).color, world_sensor_pose(w), 1.2, true};
//     uint16_t *depth = malloc(...);                          // 320 x 240
//     if (world_render(w, &shot, &(struct world_image){.depth = depth})) ...
//     world_depth_noise(&shot.lens, depth, 7, depth);         // as a Kinect sees it
//     struct skeleton s = world_joints_in_camera(w, 1.2, world_sensor_pose(w));
//
// An open world never changes: many threads may use it concurrently.
#pragma once
#include "recording/place.h"
#include "recording/skeleton.h"

struct world;
struct world_edit;

// ---------------------------------------------------------------- the figure

enum world_clothes {
    CLOTHES_TROUSERS, // shirt with short sleeves and trousers
    CLOTHES_SKIRT,    // shirt and a skirt to above the knee
    CLOTHES_COAT,     // long sleeves, a coat to the knee, trousers
};

struct world_figure {
    double height_m; // 1.2 .. 1.95, soles to crown
    double build;    // 0 thin .. 1 heavy
    bool woman;      // hips, shoulders and hair
    enum world_clothes clothes;
    int palette; // 0 .. 4: the colours it wears
    int number;  // 0 .. 99, on the chest; the back has a larger one, number + 10 (mod 100)
};

// "woman" (1.70 m), "man" (1.82), "child" (1.25), "heavy" (1.75), "skirt" (1.65),
// "coat" (1.78), "tall" (1.95). False: no such name, *out untouched.
bool world_figure_named(const char *name, struct world_figure *out);

// The names, separated by spaces.
const char *world_figure_names(void);

// ---------------------------------------------------------------- opening

enum { WORLD_BOXES = 6 };

struct world_options {
    struct world_figure figure; // default "woman"
    // "pirouette" (default): steps 1.5 m towards the sensor and turns all the way round, arms moving. "kata": punches,
    // a kick with each leg, arms crossed. "still", "bend" (bends down and lifts), "walk" (across, and back), "hide" (an
    // arm behind the back, and quickly out again), "visit" (comes in from the side, moves, and leaves on the other
    // side), "raise-hand" (one hand above the head, then the other), "kneel" (on both knees), "crouch" (from standing),
    // "sit" (on a seat that is not there). A posture of tests/world/posture.h, "push-up", with a seed "push-up:7". Or
    // the path of a BVH file, which must contain a
    // '/' or end in ".bvh"; of one that extends further than 2.6 m, the longest stretch that does not is taken.
    const char *motion;
    bool whole; // of a BVH file all of it, however far it extends: the same for figures of any size
    // NULL: the motion as it is. Else what is performed instead of it (tests/world/edit.h), within its length; times
    // of the world are then those of the performance.
    const struct world_edit *edit;
    uint64_t seed; // of posters, camera shake and the like; default 1
    int threads;   // for rendering, 1 .. 16; the bytes do not depend on it. Default 1
    bool table; // a table at arm's length to the right of the actor's path, as the sensor sees it: 1 m to 1.6 m, 0.75 m
                // high
    // Furniture to hide an actor behind: wooden boxes along the room's axes, metres; the first `boxes` of them.
    struct world_box {
        struct vec3 low, high;
    } box[WORLD_BOXES];
    int boxes;
    bool unshadowed; // lamps cast no shadow of the figure: small pictures in half the time
    bool plain;      // no textures on the room, a coarser figure: for tests of depth, opens in a quarter of the time
    bool bare;       // no posters on the walls and no rug: only the tags and the furniture can be recognised
    uint32_t tags;   // bit i: tag i is present; default all 15
    // Tags that were moved to the right and up on their wall, metres.
    struct world_moved {
        uint32_t tags; // bit i: tag i; default none
        double right, up;
    } moved;
    // The motion's origin on the floor, metres, and how far all of it is rotated to the left, radians.
    struct world_spot {
        double x, y, turned;
    } spot;
    // The sensor on its stand: its position, its target, its roll in radians.
    struct world_stand {
        struct vec3 eye, target;
        double roll;
    } stand;
    // The walking tablet: its distance from the actor, and the angle round the actor within the motion's length,
    // radians.
    struct world_walk {
        double distance_m, round;
    } walk;
};
struct world_options world_default_options(void);

// ERR_INPUT: a figure out of range, no such motion, not a BVH file (the message says where). ERR_MISSING, ERR_IO: that
// file. ERR_MEMORY. On error *out is NULL.
MUST_CHECK enum status world_open(struct world **out, const struct world_options *options);
void world_close(struct world **w); // NULL is fine; sets *w = NULL

// The names of the world's own motions, separated by spaces.
const char *world_motion_names(void);

// Without opening a world, which takes a hundred times as long: how long the motion lasts; and its joints in world
// axes, `count` of them from `start_s` on at `rate_hz`. Errors: as world_open.
MUST_CHECK enum status world_preview_seconds(const struct world_options *options, double *seconds);
MUST_CHECK enum status world_preview_joints(const struct world_options *options, double start_s, double rate_hz,
                                            int count, struct skeleton *out);

// ---------------------------------------------------------------- truth

// How long the motion lasts, seconds. Before 0 and after it the figure stands still.
double world_seconds(const struct world *w);

// The joints at `time_s`, in world axes, all with confidence 1: inside the body, as motion capture defines them. head:
// half-way up it, over the spine; neck: its base; shoulders, elbows, hips, knees: joint centres; hand: the root of the
// palm; torso: half-way up the spine; waist: the spine at the pelvis' upper end; foot: the ankle.
struct skeleton world_joints(const struct world *w, double time_s);
struct skeleton world_joints_in_camera(const struct world *w, double time_s, struct pose world_from_camera);

// The radius of the figure, clothes included, about joint `j`: roughly the distance from the joint to the skin in front
// of it. Metres.
double world_joint_radius(const struct world *w, enum joint j);

// The tags present: squares of tag36h11 on walls and floor, those on the floor larger. rms_px and the number of
// observations are 0. *count entries, valid until world_close.
const struct place_tag *world_tags(const struct world *w, int32_t *count);

// ---------------------------------------------------------------- cameras

// A Kinect-like sensor: at scale 1 640x480 with f = 525, no distortion, depth registered to colour. Other scales give
// round(640 * scale) pixels and so on, with the same field of view.
struct calibration world_calibration(double scale);

// A tablet's camera with a distorting lens: at scale 1 640x480, f = 545. depth.width is 0.
struct calibration world_viewer_calibration(double scale);

// The sensor's pose on its stand: world_from_camera.
struct pose world_sensor_pose(const struct world *w);
struct pose world_stand_pose(const struct world_stand *stand);

// The hand-held sensor on a sweep of the empty room; sees every tag several times.
enum { WORLD_SWEEP_S = 12 };
struct pose world_sweep_pose(const struct world *w, double time_s); // 0 <= time_s <= WORLD_SWEEP_S

// A hand-held tablet carried round the actor within the motion's length, facing the actor, starting at the sensor and
// moving to the left.
struct pose world_viewer_pose(const struct world *w, double time_s);

// ---------------------------------------------------------------- images

struct world_shot {
    struct lens lens;
    struct pose world_from_camera;
    double time_s; // of the figure
    bool actor;    // false: the empty room
};

// Output buffers; NULL for what is not wanted. lens.width * lens.height each.
struct world_image {
    uint8_t *color;  // RGB, sRGB
    uint16_t *depth; // millimetres along z at the pixel's centre, exact to the rounding; 0 behind 65 m
    uint8_t *mask;   // 1 where the pixel's centre sees the figure, else 0
};

// ERR_INPUT: an invalid lens. ERR_MEMORY. Deterministic.
MUST_CHECK enum status world_render(const struct world *w, const struct world_shot *shot, struct world_image *out);

// A camera's pose world_from_camera at a time in seconds.
typedef struct pose world_path(const void *context, double time_s);

// The same by a camera with a rolling shutter: each row at the pose the path has when that row is read, within
// shot->lens.readout_s, the middle one at `time_s` of the path. shot->world_from_camera is not used; the figure does
// not move meanwhile.
MUST_CHECK enum status world_render_rolling(const struct world *w, const struct world_shot *shot, world_path *path,
                                            const void *context, double time_s, struct world_image *out);

// ---------------------------------------------------------------- sensor noise

// Depth as a Kinect v1 would measure it, from exact depth of the same lens. Zero where the projector, 75 mm to the
// camera's right, does not reach (so to the left of near edges), nearer than 0.4 m or beyond 8 m, and at random at
// edges; at edges also flying pixels between front and back; elsewhere noise of 1.5e-3 z^2 metres and steps of 1/8
// pixel of disparity (at 640 pixels' width). ideal and out may be the same. Deterministic in seed: use another for each
// frame. ERR_MEMORY.
MUST_CHECK enum status world_depth_noise(const struct lens *lens, const uint16_t *ideal, uint64_t seed, uint16_t *out);

// Adds a camera's noise, sigma about 1.3 grey levels, to RGB in place. Deterministic in seed.
void world_color_noise(uint8_t *color, int width, int height, uint64_t seed);
