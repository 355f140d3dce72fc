// What became of a camera's pictures, counted and said alike by all commands that look for the camera in a place. Every
// picture is in one of the four.
#pragma once
#include "base/status.h"

struct picture_count {
    int64_t placed;
    int64_t ambiguous;  // two poses fit nearly as well
    int64_t not_placed; // nothing of the place was recognised
    int64_t unreadable; // damaged, or of another size than the calibration's
};

int64_t picture_count_all(const struct picture_count *c);

// Fewer than half of those that could be read were placed.
bool picture_count_is_few(const struct picture_count *c);

// Counts a picture by the tracker's answer: OK, AMBIGUOUS, or nothing recognised.
void picture_count_add(struct picture_count *c, enum status found);

// "7 of 14 pictures placed, 1 ambiguous, 6 unreadable or of another size"; what there is none of is left out.
enum { PICTURE_COUNT_BYTES = 160 };
const char *picture_count_text(const struct picture_count *c, char out[PICTURE_COUNT_BYTES]);

// "pictures", "placed", "ambiguous", "not_placed", "damaged".
struct json;
void picture_count_add_json(struct json *object, const struct picture_count *c);
