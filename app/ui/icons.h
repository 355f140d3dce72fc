// The app's icons, drawn as strokes on a grid of 24 by 24.
#pragma once
#include "platform/screen/ui.h"

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
};

// size: of the icon's side, dp.
void icon_draw(struct ui *ui, enum icon icon, struct ui_point centre, double size, uint32_t color);
