// Films the small world into folders and places, for tests of whole stages. Errors abort.
#pragma once
#include "platform/files/image_file.h"
#include "recording/place.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

// Films the sensor on its stand: frames first_s, first_s + 1/30 ... are written as a TUM folder `name` into the scratch
// folder. `scale`: of 640 x 480.
void film_sensor(const struct world *w, const struct scratch *scratch, const char *name, double scale, double first_s,
                 int frames);

// The same from the motion's start, at another rate.
void film_sensor_at(const struct world *w, const struct scratch *scratch, const char *name, double scale, double hz,
                    int frames);

// The same of a sweep of the empty room, `frames` evenly over WORLD_SWEEP_S. `tags`: a list of its tags, as tags.json,
// is written there, too.
void film_sweep(const struct world *w, const struct scratch *scratch, const char *name, double scale, int frames,
                const char *tags);

// A flat thing with a painted front that stands in the room: its origin is the front's middle, x right, y down, z away
// from who looks at it.
struct film_board {
    const struct image *front;
    struct pose world_from_board;
    double width_m, height_m;
};

struct film_boards {
    const struct film_board *boards;
    int count;
};

// film_sweep, 640 x 480, with boards in the room, which cast no shadow.
void film_sweep_of_boards(const struct world *w, const struct film_boards *boards, const struct scratch *scratch,
                          const char *name, int frames, const char *tags);

// The world's tags as a place, as if mapped without error. The caller frees it with place_free.
struct place film_true_place(const struct world *w, double scale);

// Opens the world without an actor; maps its tags and landmarks from a sweep of that many images, 640 x 480, by a
// sensor with a Kinect's depth noise. *world_from_place: by the corners of the tags. The caller frees the place with
// place_free, and closes the world.
struct place film_mapped_place(struct world **world, int images, struct pose *world_from_place);
