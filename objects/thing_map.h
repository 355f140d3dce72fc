// Several sightings of things become one thing each in the map, in world axes.
//
// Method: information-weighted mean; a sighting that lies outside the 99.9 % ellipsoid of what is known is kept as
// where the thing may have been moved to; the second such sighting in a row, at about one place, moves it. A thing that
// should be in sight and is not found several times in a row is marked as gone. Pure.
#pragma once
#include "base/lens.h"
#include "objects/thing.h"
#include "objects/thing_align.h"
#include "objects/thing_knowledge.h"
#include "recording/recorded_things.h"

// ---------------------------------------------------------------- thing update

// Asks a knowledge base for what is newer of a recorded thing: its text and, where that is new or there is none yet,
// picture and model. Blocks as http_get does.

struct thing_update {
    bool changed;                     // *thing was: it is worth writing
    struct thing_knowledge knowledge; // of its text, where `known`
    bool known;
    char trouble[256];         // "" or why no text came
    char content_trouble[256]; // "" or why a picture or model did not
};

// reference: relative to base, which may be the whole address. What fails leaves what the thing had. limits: for the
// text; a picture or model may have THING_CONTENT_MAX bytes.
void thing_update_ask(struct recorded_thing *thing, const char *base, const char *reference,
                      const struct http_limits *limits, struct thing_update *out);

// ---------------------------------------------------------------- thing matches

// Which features of an image resemble those of a thing's picture. Pure.

struct thing_match {
    const struct scale_feature *model, *scene;
    int32_t distance2; // squared Euclidean distance of the descriptors
};

// For each feature of the model the two nearest of the view, in the same channel, as far as they are near at all.
// Writes at most `capacity`; returns their number.
int thing_matches(const struct thing_model *model, const struct thing_view *view, struct thing_match *out,
                  int capacity);

// ---------------------------------------------------------------- thing depth

// Where a thing stands by a depth picture: a single camera knows the distance only from the thing's size. Pure.

struct depth_view {
    const uint16_t *depth; // millimetres, 0 = no reading
    struct lens lens;
    struct pose depth_from_color;
};

// Corrects the sighting's distance, along its line of sight, to what the depth samples on the middle of its front say
// (their median), weighted with what the size says; its covariance shrinks. The sighting is of the colour camera.
// NOTHING: too few samples; it stays as it is. AMBIGUOUS: depth contradicts the size by far, so that it may be a
// picture of the thing: it stays as it is, and should not be believed.
MUST_CHECK enum status sighting_by_depth(struct sighting *sighting, const struct thing *thing,
                                         const struct depth_view *view);

// ---------------------------------------------------------------- thing visibility

// Whether a picture shows the place of a thing so clearly that the thing would be recognised if it stood there. Pure.

enum thing_sight {
    SIGHT_NONE,     // out of the picture, too small, too slanted, hidden, or it cannot be told
    SIGHT_OCCUPIED, // something stands at its place
    SIGHT_EMPTY,    // what is seen there is farther away than the thing would be
};

// camera_from_thing: where it is thought to stand. lens: of the picture; depth: of the same instant, without which
// nothing hides it that could be known of: SIGHT_NONE.
enum thing_sight thing_sight_of(const struct thing *thing, struct pose camera_from_thing, const struct lens *lens,
                                const struct depth_view *depth);

// ---------------------------------------------------------------- thing map

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

void thing_map_add(struct thing_map *map, const struct sighting *sighting, const struct pose *world_from_left);

// The thing was expected in full sight of both cameras at less than the distance at which it is recognised, and was not
// found.
void thing_map_miss(struct thing_map *map, int thing);

// NULL: never seen.
const struct mapped_thing *thing_map_find(const struct thing_map *map, int thing);
