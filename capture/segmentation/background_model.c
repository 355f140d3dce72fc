// The background model: a running mean of the empty room's depth in each cell, updated outside the person.
#include "capture/segmentation/segment_internal.h"

#include <stdlib.h>
#include <string.h>

// Grid cells, of 2 pixels at 640 columns; chosen by hand.
enum {
    PERSON_MARGIN = 4,      // hair, flying pixels and depth shadows around the person are no background
    BOUNDS_MARGIN = 8,      // around the person's bounding box, within which only clearly farther depth is learned
    BOUNDS_MARGIN_DOWN = 4, // the same below it
    BEHIND_MM = 400,        // clearly farther: this much behind the person's farthest cell
    MEAN_FRAMES = 30,       // window of the running mean
    MOVED_CELLS_MIN = 500,  // a moved sensor is judged by at least so many known cells,
};
#define MOVED_SHARE 0.4 // of which more than this share disagree

struct cell_box { // cells, inclusive
    int left, top, right, bottom;
};

// label[] becomes positive within PERSON_MARGIN cells of the person, along the rows and then down the columns, else 0.
static void dilate_person(struct segmenter *s, struct cell_box person)
{
    int w = s->width, h = s->height;
    memset(s->label, 0, (size_t)w * (size_t)h * sizeof *s->label);
    int x0 = person.left > PERSON_MARGIN ? person.left - PERSON_MARGIN : 0,
        x1 = person.right + PERSON_MARGIN < w ? person.right + PERSON_MARGIN : w - 1,
        y0 = person.top > PERSON_MARGIN ? person.top - PERSON_MARGIN : 0,
        y1 = person.bottom + PERSON_MARGIN < h ? person.bottom + PERSON_MARGIN : h - 1;
    for (int y = person.top; y <= person.bottom;
         y++) { // distance along the row to the nearest cell of the person, from the left and from the right
        int far = PERSON_MARGIN + 1;
        for (int x = person.left; x <= x1; x++) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] = far <= PERSON_MARGIN;
        }
        far = PERSON_MARGIN + 1;
        for (int x = person.right; x >= x0; x--) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] |= far <= PERSON_MARGIN;
        }
    }
    // Down the columns, row by row; parent[] holds the distance to the last marked row.
    for (int x = x0; x <= x1; x++)
        s->parent[x] = PERSON_MARGIN + 1;
    for (int y = person.top; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= PERSON_MARGIN);
        }
    for (int x = x0; x <= x1; x++)
        s->parent[x] = PERSON_MARGIN + 1;
    for (int y = person.bottom; y >= y0; y--)
        for (int x = x0; x <= x1; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= PERSON_MARGIN);
        }
}

// Updates a cell by one depth sample. Returns 1: it agrees with the background, -1: it does not, 0: none was known.
static int update_background_cell(struct segmenter *s, int i, int d)
{
    int b = s->background[i], same = by_depth(s->noise_mm, d);
    if (b && d <= b + same && d >= b - same) {
        int n = s->observed_count[i] < MEAN_FRAMES ? s->observed_count[i] : MEAN_FRAMES;
        s->background[i] = (uint16_t)((b * n + d + (n + 1) / 2) / (n + 1));
        s->observed_count[i] += s->observed_count[i] < 255;
        s->nearer_count[i] = 0;
    } else if (!b || d > b ||
               ++s->nearer_count[i] >= REPLACEMENT_FRAMES) { // farther than the background replaces it immediately
        s->background[i] = (uint16_t)d;
        s->observed_count[i] = 1;
        s->nearer_count[i] = 0;
    }
    segmenter_update_limit(s, i);
    if (!b)
        return 0;
    return d <= b + same && d >= b - same ? 1 : -1;
}

void segmenter_update_background(struct segmenter *s)
{
    int disagree = 0, known = 0, far = 0;
    segmenter_detect_motion(s);
    struct cell_box person = {s->width, s->height, -1, -1};
    for (int n = 0; n < s->candidate_count; n++)
        if (s->person[s->candidate[n]]) {
            int i = s->candidate[n], x = i % s->width, y = i / s->width;
            person.left = x < person.left ? x : person.left, person.right = x > person.right ? x : person.right;
            person.top = y < person.top ? y : person.top, person.bottom = y;
            far = s->depth[i] > far ? s->depth[i] : far;
        }
    dilate_person(s, person);
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            int i = y * s->width + x, d = s->depth[i];
            if (!d || s->label[i])
                continue;
            // Inside the person's bounds only depth clearly behind the person is learned: the rest may be a part of
            // the person that the mask lost.
            if (d < far + BEHIND_MM && x > person.left - BOUNDS_MARGIN && x < person.right + BOUNDS_MARGIN &&
                y > person.top - BOUNDS_MARGIN && y < person.bottom + BOUNDS_MARGIN_DOWN)
                continue;
            int agreement = update_background_cell(s, i, d);
            known += agreement != 0;
            disagree += agreement < 0;
        }
    if (known > MOVED_CELLS_MIN && disagree > MOVED_SHARE * known) { // the sensor was moved: start from scratch
        size_t n = (size_t)s->width * (size_t)s->height;
        memset(s->background, 0, n * sizeof *s->background);
        memset(s->observed_count, 0, n);
        memcpy(s->depth_limit, s->static_limit, n * sizeof *s->depth_limit);
    }
}
