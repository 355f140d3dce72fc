// Where the files lie that come with the programs: beside the program as cmake --install puts them, or in the sources
// that it was built from, three folders above it.
#pragma once
#include "base/status.h"

enum { INSTALLED_PATH_BYTES = 4096 };

// A text of the folder docs/, by its name: "sensors.md". Where it is found nowhere, "docs/sensors.md".
const char *installed_text(const char *name, char out[INSTALLED_PATH_BYTES]);

// The sample, a recording with a place and a take, where it was made (the target `sample`). NULL: it is not there.
const char *installed_sample(char out[INSTALLED_PATH_BYTES]);

// A program for the programs' own use, of the folder tools/. NULL: it is not there.
const char *installed_tool(const char *name, char out[INSTALLED_PATH_BYTES]);
