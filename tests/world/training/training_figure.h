// Figures that another program made (tools/makehuman_figures), to be skinned and posed like figure.h's own. Internal to
// tests/world.
//
// A file, little-endian: "RFG1"; int32 vertices, triangles; float64 height (m), woman (0 or 1), girth (body.h), 16
// joints x 3, left and right wrist x 3, skull x 3, direction of the left arm x 3, 16 joints' distances to the skin;
// float32 vertices x 3, their normals x 3, their weights x 3; uint8 their bones x 3 (enum bone); int32 triangles x 3.
// The bind frame is body.h's.
#pragma once
#include "tests/world/figure.h"

// ERR_MISSING, ERR_IO, ERR_MEMORY; ERR_CORRUPT: no such file, or one that is damaged. *out is then empty.
MUST_CHECK enum status training_figure_read(struct figure *out, const char *path);
