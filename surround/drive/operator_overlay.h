// What an operator sees over the surroundings: the robot's body, transparent and of its true size, hidden where
// something stands in front of it, with a mark at its front; the path that it has driven; an arrow along the arc that
// it will drive in the next two seconds; a line to what is nearest, with its distance, in a colour that warns; the
// picture's age; and a warning when the link is lost. Drawn into a surround_view.
#pragma once
#include "surround/drive/robot_motion.h"
#include "surround/view/surround_view.h"

struct operator_overlay {
    struct pose world_from_body;
    double size_m[3]; // length, width, height
    struct drive_command command;
    double age_s;                  // of the newest capture
    bool link_lost;                // the robot stands
    const struct drive_path *path; // NULL: none is drawn
    bool wordless;                 // neither distance, age nor warning are written
};

struct nearest_thing {
    double distance_m; // from the body's rectangle on the floor
    double at[3];      // world
    double from[3];    // the body's nearest point, at the same height
};

// The nearest thing in a drawn picture that stands between `low_m` above the floor and the body's height: of the
// distances of its pixels the tenth smallest, so that a single wrong pixel says nothing. NOTHING: none in the picture.
MUST_CHECK enum status nearest_in_view(const struct surround_view *view, struct pose world_from_body,
                                       const double size_m[3], double low_m, struct nearest_thing *out);

// The overlay but for the body's tint, in the view's pixels: lines two pixels wide at 85 %, then rectangles, later ones
// over earlier ones. Of *view the lens, the pose and the axes are used.
enum {
    OVERLAY_LINES = 64 + DRIVE_PATH_POINTS,
    OVERLAY_RECTS = 512,
    OVERLAY_LINE_PERCENT = 85,
    OVERLAY_BODY_PERCENT = 40
};
struct overlay_line {
    double ax, ay, bx, by;
    uint8_t color[3];
};
struct overlay_rect {
    int x, y, width, height;
    uint8_t grey;
    int percent;
};
struct overlay_shapes {
    struct overlay_line lines[OVERLAY_LINES];
    struct overlay_rect rects[OVERLAY_RECTS];
    int line_count, rect_count;
};
extern const uint8_t overlay_body_color[3];

// Red, orange and a pale grey, RGB.
enum overlay_warning { WARNING_TOUCHING, WARNING_NEAR, WARNING_NONE };
enum overlay_warning overlay_warning_of(double distance_m);
const uint8_t *overlay_warning_color(enum overlay_warning warning);

// thing NULL: no line.
void operator_overlay_shapes(struct overlay_shapes *out, const struct surround_view *view,
                             const struct operator_overlay *overlay, const struct nearest_thing *thing);
void operator_overlay_draw(struct surround_view *view, const struct operator_overlay *overlay,
                           const struct nearest_thing *thing);

// Viewpoints. First person: at the head, looking ahead. Third person: behind and above. Above: straight down.
enum viewpoint { VIEWPOINT_FIRST, VIEWPOINT_THIRD, VIEWPOINT_ABOVE };
struct pose operator_viewpoint(enum viewpoint kind, struct pose world_from_body, const double size_m[3]);
// A free one: round the body at `azimuth` (0: behind it), `elevation` above level and `distance_m`.
struct pose operator_orbit(struct pose world_from_body, double azimuth, double elevation, double distance_m);
