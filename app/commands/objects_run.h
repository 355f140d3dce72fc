// The work of reenact-capture objects. Main thread.
#pragma once
#include "base/status.h"

struct objects_arguments {
    const char *pairs, *rig, *objects;
    const char *out, *into; // one of them: a JSON file, or a recording
    const char *knowledge;  // the knowledge base's address, or NULL
    bool force, json;
};

// Recognises in all pairs, learns each thing's shape and size from all of them, aligns once more, writes and reports.
// ERR_… of what it reads and writes.
MUST_CHECK enum status objects_run(const struct objects_arguments *a);

// Writes a folder that a web server can show as a knowledge base: for each thing of objects.json a file at its URL's
// path, JSON-LD made of its name, size, picture, and of the text NAME.txt beside objects.json, where there is one.
// ERR_EXISTS: a file is there already and `force` is not given.
MUST_CHECK enum status objects_serve(const char *objects, const char *folder, bool force);
