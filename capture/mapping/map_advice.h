// What a finished map says to the person who swept the room: how good it is, and what to film again. Pure.
#pragma once
#include "capture/mapping/mapper.h"

enum { MAP_ADVICE_LINES = 12 };

struct map_advice {
    char summary[200];  // "tags fit to 0.21 pixels, depth to 6 mm; the worst tag is known to 4 mm"
    double worst_tag_m; // standard deviation of the position of the tag known worst; 0: none
    int32_t worst_tag;
    int count;
    char line[MAP_ADVICE_LINES][340]; // what is wrong and what to do; none: nothing is
};

// What the sweep's source did; zeroed: nothing went wrong.
struct sweep_trouble {
    int64_t damaged; // pictures that were left out
    char cut[200];   // why the sensor failed before the sweep was over: "the … was unplugged"; "": it did not
};

void map_advise(const struct place *place, const struct mapper_report *report, const struct sweep_trouble *trouble,
                struct map_advice *out);
