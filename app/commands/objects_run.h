// The work of reenact-capture objects. Main thread.
#pragma once
#include "objects/thing_map.h"

struct objects_arguments {
    const char *pairs, *rig, *objects;
    const char *out, *into; // one of them: a JSON file, or a recording
    const char *camera;     // instead of pairs: a camera's URI
    double seconds;         // with a camera; 0: no limit
    const char *knowledge;  // the knowledge base's address, or NULL
    bool force, json;
};

// Recognises in all pairs, learns each thing's shape and size from all of them, aligns once more, writes and reports.
// ERR_… of what it reads and writes.
MUST_CHECK enum status objects_run(const struct objects_arguments *a);

// Keeps the things of a map in the recording a->into, in place of those of the same names; what is known of them goes
// on, and a->knowledge is asked for more, with pictures and models: what fails costs a warning. Things that the map
// lacks stay. ERR_… of the recording.
MUST_CHECK enum status objects_into(const struct thing_map *map, const struct thing_list *things,
                                    const struct objects_arguments *a);

// Writes a folder that a web server can show as a knowledge base: for each thing of objects.json a file at its URL's
// path, JSON-LD made of its name, size, picture, and of the text NAME.txt beside objects.json, where there is one.
// ERR_EXISTS: a file is there already and `force` is not given.
MUST_CHECK enum status objects_serve(const char *objects, const char *folder, bool force);

// Prints the things of a recording and what is known of them.
MUST_CHECK enum status objects_list(const char *path, bool as_json);

// Writes a note to a thing of a recording; `at`, world axes: puts it there, and adds it if there is none of that name.
MUST_CHECK enum status objects_note(const char *path, const char *name, const char *text, const struct vec3 *at);
