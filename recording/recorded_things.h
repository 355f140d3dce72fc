// The things that stand in a recording's place and what is known of them; docs/format.md, table `thing`. Kept in the
// file, so that it is there without the network.
#pragma once
#include "base/linear_algebra.h"
#include "recording/recording.h"

// ---------------------------------------------------------------- recorded drive

// Where a robot was driven in a recording's place, for the app's map; docs/format.md, table `drive`.

enum { RECORDED_DRIVE_POINTS = 256 };

struct recorded_drive {
    double size_m[3]; // of the robot's body: length, width, height
    struct pose
        world_from_body; // where it stood at the end: x ahead, y left, z up, origin on the floor; the place's world
    struct vec3 path[RECORDED_DRIVE_POINTS]; // of that origin, from the beginning
    int path_count;
};

// NOTHING: no robot was driven there; *out is then untouched. ERR_CORRUPT, ERR_IO.
MUST_CHECK enum status recording_read_drive(struct recording *recording, struct recorded_drive *out);

// In place of an earlier one. ERR_INPUT: a number is not finite; otherwise as recording_change.
MUST_CHECK enum status recording_write_drive(const char *path, const struct recorded_drive *drive);

// ---------------------------------------------------------------- recorded things

struct recorded_thing {
    char name[64];   // UTF-8, unique in the file, not empty
    char url[512];   // where what is known came from; may be empty
    char etag[128];  // of that answer; may be empty
    char note[1024]; // written by hand; may be empty
    char *knowledge; // JSON-LD of the last good answer, malloc'ed; NULL: none
    struct pose world_from_thing;
    struct covariance3 covariance; // of the translation, m^2; all 0: not known
    double width_m, height_m;
    int32_t sightings;
    bool gone; // it was expected and not found
    // What was fetched with the knowledge, as the server sent it; malloc'ed, NULL: none. docs/format.md, thing_content.
    struct thing_content {
        uint8_t *bytes;
        size_t count;
    } image, model; // PNG or JPEG; binary glTF
};
enum { THING_CONTENT_MAX = 16 << 20 }; // bytes of one

// *things is malloc'ed; recorded_things_free frees it. A file without the table has none. ERR_CORRUPT: one of them is
// damaged; ERR_IO, ERR_MEMORY; on error there are none. A picture or model that is damaged is left out. Names,
// addresses and notes are printable (base/text.h): what a terminal or server would obey is read as '?'.
MUST_CHECK enum status recording_read_things(struct recording *recording, struct recorded_thing **things, int *count);
// The same, but what is damaged costs itself alone and is counted. ERR_IO, ERR_MEMORY.
struct things_lost {
    int things, contents; // contents: pictures and models
};
MUST_CHECK enum status recording_salvage_things(struct recording *recording, struct recorded_thing **things, int *count,
                                                struct things_lost *lost);
// A copy of its own; what *to held before is lost. ERR_MEMORY: *to can be freed.
MUST_CHECK enum status recorded_thing_copy(struct recorded_thing *to, const struct recorded_thing *from);
void recorded_things_free(struct recorded_thing **things, int count);

// Replaces all things of an existing recording in one transaction. ERR_INPUT: a name is empty or twice, a number is not
// finite; ERR_MISSING, ERR_FORMAT, ERR_IO, ERR_CORRUPT. On error the file is as it was.
MUST_CHECK enum status recording_write_things(const char *path, const struct recorded_thing *things, int count);
