// The room: flat rectangles and boxes with textures, posters and tags on them, lamps in the ceiling, and the light on
// it all without the figure. Internal to tests/world. Built once, then only read: safe from any thread.
#pragma once
#include "tests/world/texture.h"
#include "tests/world/world.h"

// x and y run from -half to half, z from 0 to height.
#define ROOM_HALF_X 3.3
#define ROOM_HALF_Y 3.6
#define ROOM_HEIGHT 2.6

enum { TAG_COUNT = 15, MAX_DECALS = 64, MAX_BOXES = 32, LAMP_COUNT = 2, MAX_SURFACES = 6 + 6 * MAX_BOXES };

enum material { MATERIAL_FLOOR, MATERIAL_WALL, MATERIAL_CEILING, MATERIAL_WOOD, MATERIAL_CARDBOARD, MATERIAL_PAINT };

// The first six surfaces.
enum { SIDE_FLOOR, SIDE_CEILING, SIDE_REAR, SIDE_BACK, SIDE_LEFT, SIDE_RIGHT };

// A rectangle: corner + u * [0, width] + v * [0, height]; u, v, normal of unit length, normal = u x v towards the
// viewer, u to the viewer's right.
struct room_surface {
    struct vec3 corner, u, v, normal;
    double width, height;
    enum material material;
    float tint[3]; // linear albedo, which the texture varies
    int light_width, light_height;
    float (*light)[3]; // irradiance / pi without the figure, on a grid that includes the edges
    uint64_t decals;   // a bit for each that is on it
};

// A poster or tag on a surface: in the surface's metres.
struct decal {
    int surface;
    double u, v, width, height; // its centre and its size
    double cosine, sine;        // rotation, anticlockwise
    struct texture texture;
    bool tag;   // rendered with the highest sampling
    float glow; // 0: paper; else emission, this many times its albedo
};

struct room_box {
    struct vec3 low, high;
    int first_surface; // its six faces: -x +x -y +y -z +z
};

struct lamp { // a bright rectangle in the ceiling, facing down
    struct vec3 low, high;
    float radiance[3];
};
extern const struct lamp scene_lamps[LAMP_COUNT];

struct world_scene {
    struct room_surface surfaces[MAX_SURFACES];
    int surface_count;
    struct room_box boxes[MAX_BOXES];
    int box_count;
    struct decal decals[MAX_DECALS];
    int decal_count;
    struct place_tag tags[TAG_COUNT];
    int tag_count;
    struct texture grain, plaster; // tiles: see paint.h
    bool plain;
};

struct hit {
    double distance; // along the ray, in lengths of its direction
    int surface;
    double u, v; // metres on the surface
};

// The room described by the options. ERR_MEMORY.
MUST_CHECK enum status scene_build(struct world_scene *s, const struct world_options *options);
void scene_free(struct world_scene *s); // zeroed is fine

// scene_light.c: fills surface.light of all surfaces. ERR_MEMORY.
MUST_CHECK enum status scene_bake(struct world_scene *s);

// The first hit of a ray from inside the room, against the room itself and the boxes whose bit is set in `boxes`. There
// is always one.
struct hit scene_hit(const struct world_scene *s, struct vec3 from, struct vec3 direction, uint32_t boxes);

// Whether furniture stands between two points.
bool scene_blocked(const struct world_scene *s, struct vec3 from, struct vec3 to);

// The decal at a point of a surface, the last one put there; -1 for none.
int scene_decal(const struct world_scene *s, int surface, double u, double v);

// Extent of a sample on the surface, metres: along the image's x and its y.
struct footprint {
    float dudx, dvdx, dudy, dvdy;
};

struct surface_point {
    int surface, decal; // decal: as scene_decal
    double u, v;        // metres on the surface
};

// The albedo at a point, linear, filtered over the footprint. Returns the emission: 0 or as decal.glow.
float scene_albedo(const struct world_scene *s, struct surface_point at, struct footprint foot, float albedo[3]);

// Irradiance / pi there without the figure.
void scene_light(const struct room_surface *surface, double u, double v, float light[3]);

// The k-th of n points spread over a lamp.
struct vec3 lamp_point(const struct lamp *lamp, int k, int n);
double lamp_area(const struct lamp *lamp);
