#include "capture/segment_internal.h"

#include <stdlib.h>
#include <string.h>

// label[] becomes 1 within four cells of the person, else 0: hair, flying pixels
// and shadows at the rim are no background.
static void mark_near_person(struct segmenter *s)
{
    enum { REACH = 4 };
    int w = s->width, h = s->height;
    for (int y = 0; y < h; y++) { // along the rows: how far from the last and to the next
        int far = REACH + 1;
        for (int x = 0; x < w; x++) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] = far <= REACH;
        }
        far = REACH + 1;
        for (int x = w - 1; x >= 0; x--) {
            far = s->person[y * w + x] ? 0 : far + 1;
            s->label[y * w + x] |= far <= REACH;
        }
    }
    // Down the columns, row by row; parent[] has how far each is from the last marked one.
    for (int x = 0; x < w; x++)
        s->parent[x] = REACH + 1;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= REACH);
        }
    for (int x = 0; x < w; x++)
        s->parent[x] = REACH + 1;
    for (int y = h - 1; y >= 0; y--)
        for (int x = 0; x < w; x++) {
            s->parent[x] = s->label[y * w + x] & 1 ? 0 : s->parent[x] + 1;
            s->label[y * w + x] |= 2 * (s->parent[x] <= REACH);
        }
}

void segmenter_learn(struct segmenter *s)
{
    int disagree = 0, known = 0;
    // Inside the person's bounds nothing is learned that is not clearly behind
    // them: it may be a part of them that the mask lost.
    int left = s->width, right = -1, top = s->height, bottom = -1, far = 0;
    for (int i = 0; i < s->width * s->height; i++)
        if (s->person[i]) {
            int x = i % s->width, y = i / s->width;
            left = x < left ? x : left, right = x > right ? x : right;
            top = y < top ? y : top, bottom = y > bottom ? y : bottom;
            far = s->depth[i] > far ? s->depth[i] : far;
        }
    mark_near_person(s);
    for (int i = 0; i < s->width * s->height; i++) {
        int x = i % s->width, y = i / s->width, d = s->depth[i];
        if (!d || s->label[i])
            continue;
        if (x > left - 8 && x < right + 8 && y > top - 8 && y < bottom + 4 && d < far + 400)
            continue;
        double z = d * 0.001;
        int b = s->background[i], same = (int)(1000 * (3 * 1.4142 * depth_sigma_m(z) + 0.01));
        if (!b || d > b + same) { // the room begins further back than believed
            disagree += b != 0;
            known += b != 0;
            s->background[i] = (uint16_t)d;
            s->sightings[i] = 1;
            s->nearer[i] = 0;
        } else if (d >= b - same) {
            known++;
            int n = s->sightings[i] < 30 ? s->sightings[i] : 30;
            s->background[i] = (uint16_t)((b * n + d + (n + 1) / 2) / (n + 1));
            s->sightings[i] += s->sightings[i] < 255;
            s->nearer[i] = 0;
        } else {
            known++;
            disagree++;
            if (++s->nearer[i] >= REPLACED_FRAMES) {
                s->background[i] = (uint16_t)d;
                s->sightings[i] = 1;
                s->nearer[i] = 0;
            }
        }
    }
    if (known > 500 && disagree > 0.4 * known) { // the sensor was moved: begin again
        size_t n = (size_t)s->width * (size_t)s->height;
        memset(s->background, 0, n * sizeof *s->background);
        memset(s->sightings, 0, n);
    }
}
