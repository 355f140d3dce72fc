// Static object rejection: whether any part of the person moves. People sway and breathe; what does not move at all for
// seconds is furniture that was taken for a person. Tested against the running mean of each cell's depth: the whole
// person's mean shift, and that of blocks of cells.
#include "capture/segmentation/segment_internal.h"

#include <string.h>

enum {
    BLOCK = 8, // cells of 2 pixels: an arm's width at 3 m
    BLOCKS_MAX = (COLUMNS_MAX / BLOCK + 1) * (COLUMNS_MAX / BLOCK + 1),
    MEAN_CONFIRMED = 3,   // a cell's mean is used after so many samples,
    MEAN_WINDOW = 8,      // and averages over as many
    BLOCK_CELLS_MIN = 15, // confirmed cells that a block needs
};

// Chosen by hand; real people in recordings reached 3 static frames (STATIC_FRAMES_MIN in tracker_decide.c is 12).
#define STATIC_MM           2.0 // a smaller shift is no motion: sensors drift while they warm up
#define PERSON_SIGMAS       3.0 // significance of the whole person's mean shift,
#define BLOCK_SIGMAS        4.5 // and of one block's, of which there are about a hundred
#define CONFIRMED_SHARE_MIN 0.5 // of the cells; less is motion: edges flicker, a walking person changes most cells
#define INTERIOR_SHARE      0.8 // of a block's cells: no edge of the person runs through it

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

// Compares one of the person's cells with its mean, and updates that.
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
    while ((s->width / side + 1) * (s->height / side + 1) > BLOCKS_MAX) // an image much higher than wide
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
    if (!all.cells) // no person, or occluded
        return;
    bool moved = all.confirmed < CONFIRMED_SHARE_MIN * all.cells || has_moved(&all, PERSON_SIGMAS);
    for (int k = 0; k < across * down && !moved; k++)
        moved = is_interior(&blocks[k]) && has_moved(&blocks[k], BLOCK_SIGMAS);
    // One frame in which a person touches the object, or an edge flickers, only halves the count.
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
