// Whether anything of the person moves. People sway and breathe; what does not move by a thing for seconds is
// furniture that was taken for somebody.
#include "capture/segmentation/segment_internal.h"

#include <string.h>

enum {
    BLOCK = 8, // cells: an arm's width at three metres
    BLOCKS_MOST = (COLUMNS_MAX / BLOCK + 1) * (COLUMNS_MAX / BLOCK + 1),
    OWN_SETTLED = 3,  // a cell's own depth is believed after so many sightings,
    OWN_AVERAGE = 8,  // and follows over as many
    BLOCK_LEAST = 15, // cells that say something together
};

#define STILL_MM       2.0 // less is no motion: sensors warm up
#define SIGMAS         3.0 // of the whole person's mean,
#define SIGMAS_OF_MANY 4.5 // and of one block's, of which there are a hundred
#define LEAST_SETTLED  0.5 // of the cells: rims flicker, but who walks takes most of theirs along
#define INNER          0.8 // of a block's: no rim runs through it

struct block {
    int cells, settled;
    double off_mm, variance_mm2; // summed over the settled ones
};

static void add(struct block *to, const struct block *from)
{
    to->cells += from->cells;
    to->settled += from->settled;
    to->off_mm += from->off_mm;
    to->variance_mm2 += from->variance_mm2;
}

static bool has_moved(const struct block *b, double sigmas)
{
    return fabs(b->off_mm) > STILL_MM * b->settled + sigmas * sqrt(b->variance_mm2);
}

static bool is_inner(const struct block *b) { return b->settled >= BLOCK_LEAST && b->settled >= INNER * b->cells; }

// One cell of the person's, and what it was before.
static struct block look_at(struct segmenter *s, int i)
{
    double d = s->depth[i], sigma = 1000 * depth_sigma_m(0.001 * d), off = d - (double)s->own[i];
    struct block b = {.cells = 1};
    bool known = s->own_watched[i] && s->own_watched[i] == s->watched - 1;
    s->own_watched[i] = s->watched;
    if (!known || fabs(off) > by_depth(s->same_mm, s->depth[i])) {
        s->own[i] = s->depth[i];
        s->own_sightings[i] = 1;
        return b;
    }
    if (s->own_sightings[i] >= OWN_SETTLED)
        b = (struct block){1, 1, off, sigma * sigma};
    s->own_sightings[i] += s->own_sightings[i] < OWN_AVERAGE;
    s->own[i] += (float)(off / s->own_sightings[i]);
    return b;
}

void segmenter_watch(struct segmenter *s)
{
    struct block blocks[BLOCKS_MOST], all = {0};
    int side = BLOCK;
    while ((s->width / side + 1) * (s->height / side + 1) > BLOCKS_MOST) // a picture much higher than wide
        side *= 2;
    int across = s->width / side + 1, down = s->height / side + 1;
    memset(blocks, 0, sizeof *blocks * (size_t)(across * down));
    s->watched++;
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        if (!s->person[i])
            continue;
        struct block cell = look_at(s, i);
        add(&blocks[i / s->width / side * across + i % s->width / side], &cell);
        add(&all, &cell);
    }
    if (!all.cells) // nobody, or hidden
        return;
    bool moved = all.settled < LEAST_SETTLED * all.cells || has_moved(&all, SIGMAS);
    for (int k = 0; k < across * down && !moved; k++)
        moved = is_inner(&blocks[k]) && has_moved(&blocks[k], SIGMAS_OF_MANY);
    // A picture in which somebody touches it, or a rim flickers, is not all.
    s->motionless = moved ? s->motionless / 2 : s->motionless + 1;
}

int segmenter_motionless(const struct segmenter *s) { return s->motionless; }

void segmenter_put_away(struct segmenter *s)
{
    for (int i = 0; i < s->width * s->height; i++)
        if (s->person[i] && s->depth[i]) {
            s->background[i] = s->depth[i];
            s->sightings[i] = SETTLED_FRAMES;
            s->nearer[i] = 0;
            segmenter_limit(s, i);
        }
    segmenter_forget_person(s);
}
