// The controls (drive_controls.h) and the readings over the driver's picture: STOP, the stick, buttons with words, how
// fast the robot is, how far off what is nearest, in the colour of its warning, how old the picture is, and why it
// stands.
#pragma once
#include "app/drive/drive_controls.h"
#include "app/ui/widgets.h"

void drive_controls_draw(const struct drive_controls *c, const struct drive_readings *readings,
                         enum viewpoint viewpoint, bool map, const struct brush *b);
