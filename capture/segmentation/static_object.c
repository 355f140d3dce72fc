// Whether anything of the person moves. People sway and breathe; what does not move by a thing for seconds is
// furniture that was taken for somebody.
#include "capture/segmentation/segment_internal.h"

#include <string.h>

enum {
    BLOCK = 8, // cells: an arm's width at three metres
    BLOCKS_MAX = (COLUMNS_MAX / BLOCK + 1) * (COLUMNS_MAX / BLOCK + 1),
    MEAN_CONFIRMED = 3,   // a cell's own depth is believed after so many sightings,
    MEAN_WINDOW = 8,      // and follows over as many
    BLOCK_CELLS_MIN = 15, // cells that say something together
};

#define STATIC_MM           2.0 // less is no motion: sensors warm up
#define PERSON_SIGMAS       3.0 // of the whole person's mean,
#define BLOCK_SIGMAS        4.5 // and of one block's, of which there are a hundred
#define CONFIRMED_SHARE_MIN 0.5 // of the cells: rims flicker, but who walks takes most of theirs along
#define INTERIOR_SHARE      0.8 // of a block's: no rim runs through it

struct motion_block {
    int cells, confirmed;
    double shift_mm, variance_mm2; // summed over the confirmed ones
};

static void add(struct motion_block *to, const struct motion_block *from)
{
    to->cells += from->cells;
    to->confirmed += from->confirmed;
    to->shift_mm += from->shift_mm;
    to->variance_mm2 += from->variance_mm2;
}

static bool has_moved(const struct motion_block *b, double sigmas)
{
    return fabs(b->shift_mm) > STATIC_MM * b->confirmed + sigmas * sqrt(b->variance_mm2);
}

static bool is_interior(const struct motion_block *b)
{
    return b->confirmed >= BLOCK_CELLS_MIN && b->confirmed >= INTERIOR_SHARE * b->cells;
}

// One cell of the person's, and what it was before.
static struct motion_block update_cell_mean(struct segmenter *s, int i)
{
    double d = s->depth[i], sigma = 1000 * depth_sigma_m(0.001 * d), off = d - (double)s->mean_depth[i];
    struct motion_block b = {.cells = 1};
    bool known = s->mean_updated[i] && s->mean_updated[i] == s->update_count - 1;
    s->mean_updated[i] = s->update_count;
    if (!known || fabs(off) > by_depth(s->noise_mm, s->depth[i])) {
        s->mean_depth[i] = s->depth[i];
        s->mean_count[i] = 1;
        return b;
    }
    if (s->mean_count[i] >= MEAN_CONFIRMED)
        b = (struct motion_block){1, 1, off, sigma * sigma};
    s->mean_count[i] += s->mean_count[i] < MEAN_WINDOW;
    s->mean_depth[i] += (float)(off / s->mean_count[i]);
    return b;
}

void segmenter_detect_motion(struct segmenter *s)
{
    struct motion_block blocks[BLOCKS_MAX], all = {0};
    int side = BLOCK;
    while ((s->width / side + 1) * (s->height / side + 1) > BLOCKS_MAX) // a picture much higher than wide
        side *= 2;
    int across = s->width / side + 1, down = s->height / side + 1;
    memset(blocks, 0, sizeof *blocks * (size_t)(across * down));
    s->update_count++;
    for (int n = 0; n < s->candidate_count; n++) {
        int i = s->candidate[n];
        if (!s->person[i])
            continue;
        struct motion_block cell = update_cell_mean(s, i);
        add(&blocks[i / s->width / side * across + i % s->width / side], &cell);
        add(&all, &cell);
    }
    if (!all.cells) // nobody, or hidden
        return;
    bool moved = all.confirmed < CONFIRMED_SHARE_MIN * all.cells || has_moved(&all, PERSON_SIGMAS);
    for (int k = 0; k < across * down && !moved; k++)
        moved = is_interior(&blocks[k]) && has_moved(&blocks[k], BLOCK_SIGMAS);
    // A picture in which somebody touches it, or a rim flickers, is not all.
    s->static_frames = moved ? s->static_frames / 2 : s->static_frames + 1;
}

int segmenter_static_frames(const struct segmenter *s) { return s->static_frames; }

void segmenter_absorb_static(struct segmenter *s)
{
    for (int i = 0; i < s->width * s->height; i++)
        if (s->person[i] && s->depth[i]) {
            s->background[i] = s->depth[i];
            s->observed_count[i] = CONFIRMED_FRAMES;
            s->nearer_count[i] = 0;
            segmenter_update_limit(s, i);
        }
    segmenter_drop_person(s);
}
