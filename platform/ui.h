// Ink and fingers: what a screen is drawn with and touched through (Dear ImGui).
// This is the bare immediate mode: shapes, text, and areas that feel a pointer.
// What a button looks like is its users' business.
//
// Lengths are in dp, 1/160 inch at arm's length, x to the right and y down from the
// top left corner. Colours are 0xRRGGBBAA, alpha not multiplied in. Text is UTF-8.
//
// Between ui_begin and ui_end everything is gathered; ui_draw puts it on a target
// or a window. One ui in a process at a time, on one thread.
#pragma once
#include "platform/gpu_draw2d.h"

#ifdef __cplusplus
extern "C" {
#endif

struct ui;

struct ui_box {
    double x, y, w, h;
};

struct ui_point {
    double x, y;
};

// A font at one size. The bytes (OpenType) are borrowed until ui_close.
struct ui_face {
    const uint8_t *bytes;
    size_t count;
    double size; // dp, of a line
};

// Faces are spoken of by their place in the list. ERR_INPUT: not a font. ERR_MEMORY.
MUST_CHECK enum status ui_open(struct ui **out, struct gpu *gpu, const struct gpu_draw2d_shaders *shaders,
                               const struct ui_face *faces, int face_count);
void ui_close(struct ui **ui); // NULL is fine

struct ui_input {
    int width_px, height_px; // of what is drawn on, as the eye has it up
    double px_per_dp;        // when it changes, the letters are cut anew. ERR_DEVICE then, where they do not fit
    int64_t now_ns;
    double pointer_x, pointer_y; // dp; what the first finger or the mouse touches
    bool pointer_down;
    bool pointer_there; // false: no finger and no mouse; nothing is hovered
};
MUST_CHECK enum status ui_begin(struct ui *ui, const struct ui_input *input);
void ui_end(struct ui *ui);

// What was gathered last. quarter_turns: as gpu_draw2d_view has them. target NULL: the window. ERR_DEVICE.
MUST_CHECK enum status ui_draw(struct ui *ui, struct gpu_target *target, int quarter_turns);

double ui_width(const struct ui *ui);
double ui_height(const struct ui *ui);
double ui_px_per_dp(const struct ui *ui); // of the last ui_begin

// ---- ink
enum { UI_LAYERS = 3 };
void ui_layer(struct ui *ui, int layer); // what is drawn from here on lies above all lower layers; 0 at first
void ui_fill(struct ui *ui, struct ui_box box, double radius, uint32_t color);
void ui_border(struct ui *ui, struct ui_box box, double radius, double thickness, uint32_t color);
void ui_fade(struct ui *ui, struct ui_box box, uint32_t top, uint32_t bottom); // a gradient
void ui_shadow(struct ui *ui, struct ui_box box, double radius, double spread, uint32_t color);
void ui_disc(struct ui *ui, struct ui_point centre, double radius, uint32_t color);
void ui_ring(struct ui *ui, struct ui_point centre, double radius, double thickness, uint32_t color);
void ui_line(struct ui *ui, struct ui_point a, struct ui_point b, double thickness, uint32_t color);
// Round joints.
void ui_stroke(struct ui *ui, const struct ui_point *points, int count, bool closed, double thickness, uint32_t color);
void ui_polygon(struct ui *ui, const struct ui_point *points, int count, uint32_t color); // convex

// A picture, its part from (u0, v0) to (u1, v1), 0..1; u0 > u1 turns it over.
// premultiplied alpha in the texture; tint's alpha lets what lies behind through.
struct ui_uv_rect {
    double u0, v0, u1, v1;
};
void ui_image(struct ui *ui, const struct gpu_texture *texture, struct ui_box box, struct ui_uv_rect part,
              double radius, uint32_t tint);

// ---- text
double ui_text_width(struct ui *ui, int face, const char *text);
double ui_text_height(struct ui *ui, int face, const char *text, double width); // broken into lines of that width
void ui_text(struct ui *ui, int face, struct ui_point top_left, uint32_t color, const char *text);
void ui_text_lines(struct ui *ui, int face, struct ui_point top_left, double width, uint32_t color, const char *text);

// Nothing outside of box is drawn or touched until the matching ui_unclip.
void ui_clip(struct ui *ui, struct ui_box box);
void ui_unclip(struct ui *ui);

// ---- fingers
struct ui_touch {
    bool over; // the pointer is over it and nothing above it
    bool went_down;
    bool held;   // since it went down here, wherever it is by now
    bool tapped; // let go over it
    double x, y; // of the pointer, within the box's top left
};
// An area that feels the pointer. Of areas that overlap, the one asked for first
// has it; `name` tells areas apart, also those of one frame from those of the last.
struct ui_touch ui_area(struct ui *ui, const char *name, struct ui_box box);

#ifdef __cplusplus
}
#endif
