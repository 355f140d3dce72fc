// The command export, in two files: the formats made of the recording, and those made of the actor's avatar.
#pragma once
#include "app/commands/command.h"
#include "base/progress.h"
#include "capture/export.h"

#include <stdio.h>

enum export_format { EXPORT_CSV, EXPORT_BVH, EXPORT_GLB, EXPORT_PLY, EXPORT_MP4, EXPORT_FOLDER };
enum export_ply { PLY_POINTS, PLY_ACTOR, PLY_MESH, PLY_PLACE };

struct export_arguments {
    const char *file, *take, *out, *html;
    int format; // enum export_format; -1: not given
    enum export_axes axes;
    enum export_ply what;
    double at_s; // of the take; NaN: its representative frame
    bool force;
};

// The take's actor as .glb, with --html also as a page, or as the mesh of that frame. NOTHING: the watch said to stop.
MUST_CHECK enum status export_actor(const struct export_arguments *given, struct take *take, int64_t frame, FILE *out,
                                    const struct progress_watch *watch);
