// A room with a box in it, panoramas of it with true depth, and what a view truly sees, all by ray casting. World: x
// ahead, y left, z up.
#pragma once
#include "surround/drive/simulated_rover.h"
#include "surround/view/surround_view.h"

enum { ROOM_HEIGHT = 256, ROOM_WIDTH = 2 * ROOM_HEIGHT, ROOM_PICTURES = 3 };

struct box_room {
    struct box_world world; // -2..4, -2..2, 0..2.5 m, with a box 1.5 m ahead
    struct surround_picture pictures[ROOM_PICTURES];
    struct surround_view view;
    uint8_t *truth; // of the last eye
    double *depth;  // along z
};

struct pose room_camera(double x, double y, double z); // looks along x
// A panorama of the room with its true depth.
void room_picture(const struct box_world *w, struct pose pose, struct surround_picture *p);
void room_add_box(struct box_world *w, struct vec3 low, struct vec3 high, bool inside);

void box_room_open(struct box_room *s, const struct lens *view);
void box_room_film(struct box_room *s); // panoramas at 1.15 m, half a metre apart
void box_room_close(struct box_room *s);
void box_room_make_truth(struct box_room *s, struct pose eye);
// By the processor, of the first `count` pictures; makes the truth, too.
void box_room_draw(struct box_room *s, struct pose eye, int count);

// Gives the first picture the depth of a plate in the air, through which the others look, at walls; of what is behind
// it from `eye`, in s->view's lens, none knows anything any more.
struct room_plate {
    int left, top, right, bottom; // pixels of the view that are well inside of it; right and bottom are outside
};
struct room_plate box_room_put_plate(struct box_room *s, struct pose eye);

struct room_measured {
    double psnr_db, drawn, depth_off; // of drawn pixels; depth: share off by more than 3 %
};
struct room_measured box_room_measure(const struct box_room *s); // s->view against the truth; prints it
