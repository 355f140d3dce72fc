// Asks a knowledge base for what is newer of a recorded thing: its text and, where that is new or there is none yet,
// picture and model. Blocks as http_get does.
#pragma once
#include "objects/thing_knowledge.h"
#include "recording/recorded_things.h"

struct thing_update {
    bool changed;                     // *thing was: it is worth writing
    struct thing_knowledge knowledge; // of its text, where `known`
    bool known;
    char trouble[256];         // "" or why no text came
    char content_trouble[256]; // "" or why a picture or model did not
};

// reference: relative to base, which may be the whole address. What fails leaves what the thing had. limits: for the
// text; a picture or model may have THING_CONTENT_MOST bytes.
void thing_update_ask(struct recorded_thing *thing, const char *base, const char *reference,
                      const struct http_limits *limits, struct thing_update *out);
