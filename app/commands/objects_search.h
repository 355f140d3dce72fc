// Known things in a recording's place: in the pictures of a sweep, or before a camera that is localised in it.
#pragma once
#include "app/commands/objects_run.h"
#include "capture/mapping/mapper.h"
#include "objects/sweep_pictures.h"

// A sweep just mapped into a->into: its pictures, their poses, and the place as it was before (all 0: none).
struct objects_sweep {
    const struct place *before;
    const struct sweep_pictures *pictures;
    const struct mapper *mapper; // finished
};
struct objects_found {
    int things, gone, searched; // searched: pictures
};
// Looks in the sweep's sharp pictures and keeps what is found there; what the recording knew, or the views of an
// earlier sweep show, and is no longer where it was, is marked as gone.
MUST_CHECK enum status objects_in_sweep(const struct objects_arguments *a, const struct objects_sweep *sweep,
                                        struct objects_found *found);

// Looks in the images of a->camera, for a->seconds (0: until its end, or Ctrl-C).
MUST_CHECK enum status objects_by_camera(const struct objects_arguments *a);
