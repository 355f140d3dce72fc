// Immediate-mode drawing and touch areas for screens (Dear ImGui): shapes, text, and rectangles that take a pointer.
// Widgets are built from them in app/ui.
//
// Lengths are in dp, 1/160 inch at arm's length, x to the right and y down from the top left corner. Colours are
// 0xRRGGBBAA in sRGB, alpha not premultiplied. Text is UTF-8.
//
// Calls between ui_begin and ui_end are collected; ui_draw draws them into a target or window. One ui in a process at a
// time, on one thread.
#pragma once
#include "platform/screen/gpu_draw2d.h"

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
    // Other characters are not drawn; a large face's letters would fill most of the font atlas.
    bool digits_only, ascii_only; // ascii: and the degree sign
};

// The other functions name faces by their index in this list. ERR_MEMORY; ERR_DEVICE as gpu_draw2d_open. *out is NULL
// on error. Fonts are read by the first ui_begin.
MUST_CHECK enum status ui_open(struct ui **out, struct gpu *gpu, const struct gpu_draw2d_shaders *shaders,
                               const struct ui_face *faces, int face_count);
void ui_close(struct ui **ui); // NULL is fine

struct ui_input {
    int width_px, height_px; // of the upright image
    double px_per_dp;        // pixels per dp; a change rebuilds the font atlas
    int64_t now_ns;
    double pointer_x, pointer_y; // dp; of the first finger or the mouse
    bool pointer_down;
    bool pointer_there; // false: no finger and no mouse; nothing is hovered
};
// ERR_INPUT: a face is not a font. ERR_DEVICE: the font atlas is too large for the GPU. Do not call ui_end then.
MUST_CHECK enum status ui_begin(struct ui *ui, const struct ui_input *input);
void ui_end(struct ui *ui);

// Draws what the last ui_begin .. ui_end collected. target NULL: the window. quarter_turns: as in gpu_draw2d_view.
// ERR_DEVICE.
MUST_CHECK enum status ui_draw(struct ui *ui, struct gpu_target *target, int quarter_turns);

// The last frame held letters beyond Latin for the first time and has '?' in their place: the next one will show them,
// unless the GPU takes no atlas of that many. Greek, Cyrillic and Vietnamese are the faces' own; others, as Japanese,
// Chinese and Korean, come from the computer's fonts (system_fonts.h). Always '?': what no font has, and scripts whose
// letters are joined, reordered or run from right to left.
bool ui_letters_wanted(const struct ui *ui);

double ui_width(const struct ui *ui);
double ui_height(const struct ui *ui);
double ui_px_per_dp(const struct ui *ui); // of the last ui_begin

// ---- drawing
enum { UI_LAYERS = 3 };
// Of the shapes that follow; higher layers cover lower ones; 0 after ui_begin. Returns the one before.
int ui_layer(struct ui *ui, int layer);
void ui_fill(struct ui *ui, struct ui_box box, double radius, uint32_t color);
void ui_border(struct ui *ui, struct ui_box box, double radius, double thickness, uint32_t color);
void ui_fade(struct ui *ui, struct ui_box box, uint32_t top, uint32_t bottom); // vertical gradient
void ui_shadow(struct ui *ui, struct ui_box box, double radius, double spread, uint32_t color);
void ui_disc(struct ui *ui, struct ui_point centre, double radius, uint32_t color);
void ui_ring(struct ui *ui, struct ui_point centre, double radius, double thickness, uint32_t color);
void ui_line(struct ui *ui, struct ui_point a, struct ui_point b, double thickness, uint32_t color);
// A polyline with round joints.
void ui_stroke(struct ui *ui, const struct ui_point *points, int count, bool closed, double thickness, uint32_t color);
void ui_polygon(struct ui *ui, const struct ui_point *points, int count, uint32_t color); // convex

// An image: the part of the texture from (u0, v0) to (u1, v1), 0..1; u0 > u1 mirrors it. The texture has premultiplied
// alpha; tint's alpha is its opacity.
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
// The same in another size (dp, of a line) than the face's: soft where it is larger.
struct ui_point ui_text_extent(struct ui *ui, int face, double size, const char *text, double width);
void ui_text_sized(struct ui *ui, int face, double size, struct ui_box box, uint32_t color, const char *text);

// Nothing outside of box is drawn or touched until the matching ui_unclip.
void ui_clip(struct ui *ui, struct ui_box box);
void ui_unclip(struct ui *ui);

// ---- touch
struct ui_touch {
    bool over; // the pointer is over the area, and no other area covers it there
    bool went_down;
    bool held;   // the pointer went down in the area and is still down, wherever it is
    bool tapped; // the pointer went down and up in the area
    bool rests;  // the pointer has been over it, or down in it, for half a second
    bool rested; // and was so, and down, in the last frame: who holds it long asks what it is for
    double x, y; // of the pointer, relative to the box's top left
};
// An area that takes the pointer. Of overlapping areas the first one called gets it. `name` is the area's identity
// within a frame and from frame to frame.
struct ui_touch ui_area(struct ui *ui, const char *name, struct ui_box box);
// The pointer comes to rest on something: the next frames may show more without other input.
bool ui_comes_to_rest(const struct ui *ui);

struct ui_pointer {
    double x, y; // dp
    bool there, down;
};
struct ui_pointer ui_pointer_now(const struct ui *ui);

// ---- what the last frame laid out, in the order of drawing: for tests of screens that nobody looks at
enum { UI_MARK_TEXT_BYTES = 96 };
struct ui_mark {
    bool is_text;                  // else an area
    bool shortened;                // the text ends with …
    char text[UI_MARK_TEXT_BYTES]; // or the area's name; its beginning
    struct ui_box box, clip;       // dp; clip: outside of it nothing is drawn or touched
    int layer;
};
// Valid until the next ui_begin.
const struct ui_mark *ui_marks(const struct ui *ui, int *count);

#ifdef __cplusplus
}
#endif
