// The work of reenact-capture objects. Main thread.
#pragma once
#include "capture/mapping/mapper.h"
#include "objects/thing_map.h"
#include "objects/thing_search.h"

// ---------------------------------------------------------------- objects run

struct objects_arguments {
    const char *pairs, *rig, *objects;
    const char *out, *into; // one of them: a JSON file, or a recording
    const char *camera;     // instead of pairs: a camera's URI
    double seconds;         // with a camera; 0: no limit
    const char *knowledge;  // the knowledge base's address, or NULL
    bool force, json;
};

// ---------------------------------------------------------------- objects search

// Known things in a recording's place: in the pictures of a sweep, or before a camera that is localised in it.

// A sweep just mapped into the recording: its pictures, their poses, and the place as it was before (all 0: none).
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
MUST_CHECK enum status objects_in_sweep(const struct objects_arguments *arguments, const struct objects_sweep *sweep,
                                        struct objects_found *found);
