// A painted person, balls and tubes before a magenta wall, filmed into a take of a few frames; and what a renderer
// makes of it. An error fails the test.
#pragma once
#include "reenact/render/actor_renderer.h"

enum { W = 320, H = 240, PIXELS = W * H };
extern const struct lens ideal, bent; // W x H, without and with distortion

// ---- a take of given frames, 40 ms apart, in a file that exists while it is open
struct one_frame {
    struct skeleton skeleton;
    const uint8_t *rgb; // NULL: no image
    const uint16_t *depth;
    const uint8_t *mask;
};

struct painted_take {
    char path[64];
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
};

void painted_take_open(struct painted_take *s, const struct lens *color, const struct one_frame *frames, int count,
                       const struct body *body);
void painted_take_close(struct painted_take *s);
struct renderer *painted_take_renderer(struct painted_take *s, const struct lens *lens, enum detail detail);

struct drawn {
    uint8_t rgb[PIXELS * 3], actor[PIXELS * 4];
    struct renderer_result result;
};
// color: the viewer's image, W x H, RGB.
void draw_picture(struct renderer *p, struct pose world_from_camera, int64_t time_ns, const uint8_t *color,
                  struct drawn *out);

// ---- the double-precision reference
// The depth at which `ray` from the origin first meets the open cylinder about a-b of `radius` at z >= nearest;
// infinite: never. ray has z = 1.
double tube_depth(struct vec3 ray, struct vec3 a, struct vec3 b, double radius, double nearest);
double ball_depth(struct vec3 ray, struct vec3 c, double radius); // likewise the ball about c

// ---- the person
struct skeleton whole_body(double arm); // 2.5 m away; the left hand `arm` metres nearer
extern const struct body whole_measures;

// What a camera at the origin sees of that person before a magenta wall.
struct painted {
    uint8_t rgb[PIXELS * 3], mask[PIXELS];
    uint16_t depth[PIXELS];
};
void paint_person(struct painted *out, const struct lens *lens, const struct skeleton *s, const struct body *body);
