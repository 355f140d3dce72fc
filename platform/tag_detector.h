// Square tags of the family tag36h11 in a picture (AprilTag 3): which ones, and
// where their corners are to about a third of a pixel. Finer corners are
// locate/tag_corners's work. One thread inside, whatever the machine has: its pool
// becomes ten times slower beside another busy process.
#pragma once
#include "base/lens.h"

enum {
    TAG_CELLS = 8,      // cells along the side of the black square, its black rim included
    TAG_ID_COUNT = 587, // the family has the numbers 0 .. 586
    TAG_MAX_DECIMATE = 8,
};

struct tag_detection {
    int32_t id;
    int32_t hamming_errors; // 0..2, mended by the code
    struct pixel corner[4]; // bottom left, bottom right, top right, top left of the black
                            // square as the reader sees an upright tag; centre of the
                            // top-left pixel is (0, 0)
};

struct tag_detector; // belongs to one thread

// quad_decimate: squares are looked for in a picture this many times smaller;
// 1 = every pixel. ERR_INPUT: not in 1..TAG_MAX_DECIMATE. ERR_MEMORY.
MUST_CHECK enum status tag_detector_open(struct tag_detector **out, double quad_decimate);
void tag_detector_close(struct tag_detector **f); // NULL is fine; sets *f = NULL

// gray: width * height bytes. *count is how many were written to `out`, at most
// `capacity`, lowest number first; the same number can be there twice. None is
// OK with 0. ERR_MEMORY.
MUST_CHECK enum status tag_detector_detect(struct tag_detector *f, const uint8_t *gray, int width, int height,
                                           struct tag_detection *out, int capacity, int *count);

// What is printed on a tag: 1 is white, row 0 is the top row as the reader sees it.
struct tag_pattern {
    uint8_t cell[TAG_CELLS][TAG_CELLS];
};

// False, *out untouched: no such number.
bool tag_pattern(int32_t id, struct tag_pattern *out);
