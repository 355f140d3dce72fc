// What of the room the page for watching shows beside the actor: names at the things, one thing's card, the search with
// its arrow, the map, and the recorded views behind an orbit. Pure.
#pragma once
#include "app/state/orbit.h"

enum { ROOM_FILTER_BYTES = 32, ROOM_NOTHING = -1 };

struct room_state {
    int thing_count; // of the recording
    bool has_place;  // there is something to draw a map of
    bool has_views;  // the place holds views with colour and depth

    bool names;                     // labels stand at the things
    bool map;                       // the map is beside the picture
    bool filmed;                    // recorded views are behind an orbit
    int card;                       // the thing whose card is open; ROOM_NOTHING
    int wanted;                     // the thing that an arrow leads to; ROOM_NOTHING
    char filter[ROOM_FILTER_BYTES]; // what was typed to search by
    bool enter;                     // the first thing that the filter leaves is meant
    struct orbit map_orbit;         // the map's viewpoint
};

struct room_state room_state_start(void);

// Text for the filter, which does not begin with a blank. False: there is nothing new.
bool room_state_type(struct room_state *s, const char *text);

// An arrow leads to that thing; to none if it does already.
void room_state_want(struct room_state *s, int thing);

// How visible a label is, 0 to 1: it fades with the distance (metres) and with the standard deviation of where the
// thing stands; a thing that was not found where it stood is fainter still.
double room_label_opacity(double distance_m, double sigma_m, bool gone);
