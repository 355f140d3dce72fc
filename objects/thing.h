// Things that are looked for, and where one was found.
//
// The thing's own axes: origin in the middle of what its reference picture shows, on the side that is seen; x right and
// y down in the picture, z away from the viewer. Metres.
#pragma once
#include "base/geometry.h"
#include "base/linear_algebra.h"
#include "platform/files/image_file.h"

enum { THING_NAME_BYTES = 64, THING_URL_BYTES = 512, THINGS_MOST = 64 };

struct thing {
    char name[THING_NAME_BYTES]; // unique in its list
    char url[THING_URL_BYTES];   // of what is known of it; relative to the knowledge base; may be empty
    struct image picture;        // the reference picture
    double width_m, height_m;    // of what it shows
};

struct thing_list {
    struct thing *things;
    int count;
};

// objects.json: {"objects": [{"name", "picture", "width_m", "height_m", "url"}]}, pictures relative to the file.
// ERR_INPUT with a sentence, ERR_MISSING, ERR_IO, ERR_CORRUPT, ERR_MEMORY. On error *out is all 0.
MUST_CHECK enum status thing_list_read(const char *path, struct thing_list *out);
void thing_list_free(struct thing_list *list);

// How the side that is seen is bent: flat, or a solid of revolution about a vertical axis (bottle, can, mug), whose
// radius at each height is half the picture's silhouette.
enum thing_shape { THING_FLAT, THING_TURNED, THING_SHAPES };

struct sighting {
    int thing; // in the list
    enum thing_shape shape;
    struct pose left_from_thing;
    double log_scale;              // natural logarithm of its true size over that in the list
    struct covariance3 covariance; // of left_from_thing.translation, in the left camera's axes
    double angle, angle_sigma;     // turn in the picture against the reference picture, clockwise, radians
    double score;                  // correlation of the reference picture with what is seen, at most 1
};
