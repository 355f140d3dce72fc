// Detection of tags of the family 36h11 in an image (AprilTag 3; Krogius et al.
// 2019): numbers, and corners to about a third of a pixel; locate/tag_corners
// refines them. The library runs on the caller's thread only: its thread pool
// becomes ten times slower beside another busy process.
#pragma once
#include "base/lens.h"

enum {
    TAG_CELLS = 8,      // cells along the side of the black square, border included
    TAG_ID_COUNT = 587, // the family has the numbers 0 .. 586
    TAG_MAX_DECIMATE = 8,
};

struct tag_detection {
    int32_t id;
    int32_t hamming_errors; // 0..2 bits corrected by the code
    struct pixel corner[4]; // bottom left, bottom right, top right, top left of the black
                            // square as printed; the centre of the image's top-left pixel
                            // is (0, 0)
};

struct gray_image {
    const uint8_t *pixels; // width * height bytes
    int width, height;
};

struct tag_detector; // belongs to one thread at a time

// quad_decimate: squares are detected in an image this many times smaller per
// axis; 1: at full resolution. ERR_INPUT: not in 1..TAG_MAX_DECIMATE. ERR_MEMORY.
MUST_CHECK enum status tag_detector_open(struct tag_detector **out, double quad_decimate);
void tag_detector_close(struct tag_detector **detector); // NULL is fine; sets *detector = NULL

// *count: number of detections written to `out`, at
// most `capacity`, in order of id; an id can occur twice. None is OK with 0.
// ERR_MEMORY.
MUST_CHECK enum status tag_detector_detect(struct tag_detector *detector, const struct gray_image *gray,
                                           struct tag_detection *out, int capacity, int *count);

// The printed pattern of a tag: 1 is white, row 0 is the top row.
struct tag_pattern {
    uint8_t cell[TAG_CELLS][TAG_CELLS];
};

// False, *out untouched: no such number.
bool tag_pattern(int32_t id, struct tag_pattern *out);

// ---------------------------------------------------------------- tag families

// Which tags of AprilTag's other families a picture shows: what was printed by mistake is named. Not for poses.

enum { TAG_FAMILIES = 8 }; // all that the library has but 36h11

struct tag_families; // belongs to one thread at a time

struct tag_of_family {
    int family; // 0 to TAG_FAMILIES - 1
    int32_t id;
};

// ERR_MEMORY: *out is NULL.
MUST_CHECK enum status tag_families_open(struct tag_families **out);
void tag_families_close(struct tag_families **tag_families); // NULL is fine; sets *tag_families = NULL

// *count: number of tags written to `out`, at most `capacity`. Those alone whose every cell is right and clear; of the
// smallest family a thing of other kinds may still look like one now and then. ERR_MEMORY.
MUST_CHECK enum status tag_families_look(struct tag_families *families, const struct gray_image *gray,
                                         struct tag_of_family *out, int capacity, int *count);

const char *tag_family_name(int family); // as AprilTag calls it
