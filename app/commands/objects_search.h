// Known things in a recording's place: in the views that were kept of it, or before a camera that is localised in it.
#pragma once
#include "app/commands/objects_run.h"

// Looks in the views of the place of a->into and keeps what is found there. *found: things.
MUST_CHECK enum status objects_in_place(const struct objects_arguments *a, int *found);

// The same with the images of a->camera, for a->seconds (0: until its end, or Ctrl-C).
MUST_CHECK enum status objects_by_camera(const struct objects_arguments *a);
