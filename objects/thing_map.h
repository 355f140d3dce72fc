// Several sightings of things become one thing each in the map, in world axes.
//
// Method: information-weighted mean; a sighting that lies outside the 99.9 % ellipsoid of what is known is kept as
// where the thing may have been moved to; the second such sighting in a row, at about one place, moves it. A thing that
// should be in sight and is not found several times in a row is marked as gone. Pure.
#pragma once
#include "objects/thing.h"

struct mapped_thing {
    int thing;                    // in the list
    struct pose world_from_thing; // rotation: of the best sighting
    struct covariance3 covariance;
    bool known; // by thing_map_know
    int sightings, moves;
    int misses; // in a row; it was expected in sight
    bool gone;
    // A sighting elsewhere that waits for a second one.
    bool doubted;
    struct vec3 elsewhere;
    struct quat elsewhere_rotation;
    struct covariance3 elsewhere_covariance;
};

struct thing_map {
    struct mapped_thing things[THINGS_MOST];
    int count;
};

enum { THING_MISSES_TO_GONE = 3 };

// The thing is known already, from an earlier time: what is seen from now on counts from there.
void thing_map_know(struct thing_map *map, int thing, const struct pose *world_from_thing,
                    const struct covariance3 *covariance);

// Where it was known is empty: it moves to the single sighting elsewhere, if there is one, else it is gone.
void thing_map_absent(struct thing_map *map, int thing);

void thing_map_add(struct thing_map *map, const struct sighting *s, const struct pose *world_from_left);

// The thing was expected in full sight of both cameras at less than the distance at which it is recognised, and was not
// found.
void thing_map_miss(struct thing_map *map, int thing);

// NULL: never seen.
const struct mapped_thing *thing_map_find(const struct thing_map *map, int thing);
