// Which tags of AprilTag's other families a picture shows: what was printed by mistake is named. Not for poses.
#pragma once
#include "platform/vision/tag_detector.h"

enum { TAG_FAMILIES = 8 }; // all that the library has but 36h11

struct tag_families; // belongs to one thread at a time

struct tag_of_family {
    int family; // 0 to TAG_FAMILIES - 1
    int32_t id;
};

// ERR_MEMORY: *out is NULL.
MUST_CHECK enum status tag_families_open(struct tag_families **out);
void tag_families_close(struct tag_families **f); // NULL is fine; sets *f = NULL

// *count: number of tags written to `out`, at most `capacity`. Those alone whose every cell is right and clear; of the
// smallest family a thing of other kinds may still look like one now and then. ERR_MEMORY.
MUST_CHECK enum status tag_families_look(struct tag_families *f, const struct gray_image *gray,
                                         struct tag_of_family *out, int capacity, int *count);

const char *tag_family_name(int family); // as AprilTag calls it
