// The small world filmed into folders and places, for tests of whole stages.
#pragma once
#include "capture/recording/place.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

// What the sensor on its stand sees: frames first_s, first_s + 1/30 ... written as a
// TUM folder `name` into the scratch folder. `scale`: of 640 x 480.
void film_sensor(const struct world *w, const struct scratch *scratch, const char *name, double scale, double first_s,
                 int frames);

// The world's tags as a place, as if they had been mapped without an error. The
// caller frees it with place_free.
struct place film_true_place(const struct world *w, double scale);

// Opens the world, nobody moving in it; its tags and points as they are mapped from a sweep of so many pictures,
// 640 x 480, by a sensor that reads depth with a Kinect's errors. *world_from_place: by the corners of its tags. The
// caller frees it with place_free, and closes the world.
struct place film_mapped_place(struct world **world, int pictures, struct pose *world_from_place);
