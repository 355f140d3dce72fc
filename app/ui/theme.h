// The app's theme: type, spacing and colours (sRGB, 0xRRGGBBAA), light and dark. Lengths in dp; 9 mm, the smallest
// reliable touch target, are 56.7 dp.
#pragma once
#include "platform/screen/ui.h"

// ---------------------------------------------------------------- icons

// The app's icons, drawn as strokes on a grid of 24 by 24.

enum icon {
    ICON_PLAY,
    ICON_PAUSE,
    ICON_STEP_BACK,
    ICON_STEP_ON,
    ICON_LOOP,
    ICON_MIRROR,
    ICON_LAYERS,
    ICON_PHOTO,
    ICON_ORBIT,
    ICON_CAMERA,
    ICON_MOVE,
    ICON_BACK,
    ICON_CLOSE,
    ICON_SUN,
    ICON_MOON,
    ICON_CHECK,
    ICON_TAG,
    ICON_WARNING,
    ICON_BONES,
    ICON_DROPS,
    ICON_INSET,
    ICON_BARS,
    ICON_MAP,
    ICON_FIND,
    ICON_ROOM,
    ICON_COMPARE,
};

// size: of the icon's side, dp.
void icon_draw(struct ui *ui, enum icon icon, struct ui_point centre, double size, uint32_t color);

// ---------------------------------------------------------------- theme

// TINY: words under icons. CUE: what is read from three metres; ASCII and the degree sign alone.
enum face { FACE_TINY, FACE_SMALL, FACE_BODY, FACE_STRONG, FACE_HEAD, FACE_TITLE, FACE_CUE, FACE_COUNT_IN, FACE_COUNT };
extern const struct ui_face *theme_faces(void); // FACE_COUNT of them

static const double TARGET = 58, GAP = 8, MARGIN = 16, ROUND = 18;

struct theme {
    uint32_t ground;  // behind everything
    uint32_t surface; // of panels on the ground
    uint32_t glass;   // of panels over an image
    uint32_t raised;  // of buttons on panels
    uint32_t hairline;
    uint32_t text, quiet; // quiet: for secondary text
    uint32_t accent, on_accent;
    uint32_t warn;
    uint32_t ghost;                // of the pose to come
    uint32_t right, wrong, unseen; // verdicts: the same, different, cannot tell; they differ in shape, too
    uint32_t shadow;
    uint32_t sky, floor, grid; // of the studio behind an orbit
};
const struct theme *theme_of(bool dark);

// The colour with its alpha multiplied by `share`.
uint32_t faint(uint32_t color, double share);
