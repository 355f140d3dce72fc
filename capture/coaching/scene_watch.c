#include "capture/coaching/scene_watch.h"

#include "base/depth_noise.h"

#include <string.h>

// All chosen by hand.
static const int STILL_FRAMES = 90;        // what has not moved for so long is background: 3 s at 30 Hz
static const int SURE_FRAMES = 3;          // that show something farther than the background
static const int FROZEN_FRAMES = 10;       // noise alone changes a live picture from frame to frame
static const int PUSHED_FRAMES = 4;        // that agree
static const int MOST_FRAMES = 3;          // that one view counts for: never is one alone believed
static const double PUSHED_SHARE = 0.15;   // of the cells changed, and in three quarters of the picture ...
static const double PUSHED_QUARTER = 0.08; // ... this share at least
static const double PERSON_M2 = 0.12;      // a child's body that shows in part
static const double PERSON_HEIGHT_M = 0.7; // lower things are chairs, bags, dogs
static const double MIN_DEPTH_SHARE = 0.1;
static const double DARK = 40, BRIGHT = 225; // grey levels

void scene_watch_reset(struct scene_watch *w) { memset(w, 0, sizeof *w); }

// Differences below this are noise or the edges of things, millimetres.
static int tolerance_mm(int mm) { return 40 + (int)(4e3 * depth_sigma_m(mm * 1e-3)); }

struct grid {
    uint16_t depth[SCENE_CELLS];
    bool actor[SCENE_CELLS]; // or beside it
};

static void sample(const struct scene_view *view, struct grid *g)
{
    const struct lens *l = &view->calibration->depth;
    bool own[SCENE_CELLS];
    for (int r = 0; r < SCENE_ROWS; r++)
        for (int c = 0; c < SCENE_COLUMNS; c++) {
            const int x = (2 * c + 1) * l->width / (2 * SCENE_COLUMNS), y = (2 * r + 1) * l->height / (2 * SCENE_ROWS);
            const int i = y * l->width + x;
            g->depth[r * SCENE_COLUMNS + c] = view->depth[i];
            own[r * SCENE_COLUMNS + c] = view->mask && view->mask[i];
        }
    // Three cells about the actor's: what the mask leaves out of hands and hair.
    enum { REACH = 3 };
    memset(g->actor, 0, sizeof g->actor);
    for (int r = 0; r < SCENE_ROWS; r++)
        for (int c = 0; c < SCENE_COLUMNS; c++)
            if (own[r * SCENE_COLUMNS + c])
                for (int y = r < REACH ? 0 : r - REACH; y <= r + REACH && y < SCENE_ROWS; y++)
                    for (int x = c < REACH ? 0 : c - REACH; x <= c + REACH && x < SCENE_COLUMNS; x++)
                        g->actor[y * SCENE_COLUMNS + x] = true;
}

static bool is_frozen(struct scene_watch *w, const struct grid *g, int frames)
{
    const bool same = w->frames > 0 && !memcmp(g->depth, w->last, sizeof w->last);
    w->same_frames = same ? w->same_frames + frames : 0;
    return w->same_frames >= FROZEN_FRAMES;
}

static bool is_pushed(struct scene_watch *w, const struct grid *g, int frames)
{
    int all[4] = {0}, changed[4] = {0}, wide = 0;
    for (int i = 0; i < SCENE_CELLS; i++) {
        if (g->actor[i] || !g->depth[i] || !w->background[i])
            continue;
        const int quarter = 2 * (i / SCENE_COLUMNS >= SCENE_ROWS / 2) + (i % SCENE_COLUMNS >= SCENE_COLUMNS / 2);
        const int off = (int)g->depth[i] - w->background[i];
        all[quarter]++;
        changed[quarter] += off > tolerance_mm(g->depth[i]) || off < -tolerance_mm(w->background[i]);
    }
    double sum = 0, sum_changed = 0;
    for (int q = 0; q < 4; q++) {
        sum += all[q];
        sum_changed += changed[q];
        wide += all[q] > 0 && changed[q] > PUSHED_QUARTER * all[q];
    }
    const bool moved = wide >= 3 && sum_changed > PUSHED_SHARE * sum;
    w->moved_frames = moved ? w->moved_frames + frames : 0;
    return w->moved_frames >= PUSHED_FRAMES;
}

static void learn(struct scene_watch *w, const struct grid *g, int frames)
{
    for (int i = 0; i < SCENE_CELLS; i++) {
        const int z = g->depth[i];
        if (!z)
            continue;
        const int off = z > w->last[i] ? z - w->last[i] : w->last[i] - z;
        w->still[i] = (uint16_t)(w->last[i] && off < tolerance_mm(z) && w->still[i] < 60000 ? w->still[i] + frames : 0);
        if (g->actor[i])
            continue;
        const int behind = z - w->background[i];
        if (!w->background[i] || w->still[i] > STILL_FRAMES || (behind > tolerance_mm(z) && w->still[i] >= SURE_FRAMES))
            w->background[i] = (uint16_t)z;
        else if (behind > -tolerance_mm(z) && behind < tolerance_mm(z)) // its mean: a maximum would grow with the noise
            w->background[i] = (uint16_t)(w->background[i] + behind / 4);
    }
}

// The largest connected piece in front of the background, as a person would be: by flood fill on the grid.
static bool shows_person(const struct scene_watch *w, const struct grid *g, const struct lens *l)
{
    bool front[SCENE_CELLS];
    int16_t stack[SCENE_CELLS];
    const double cell_w = (double)l->width / SCENE_COLUMNS / l->fx, cell_h = (double)l->height / SCENE_ROWS / l->fy;
    for (int i = 0; i < SCENE_CELLS; i++)
        front[i] = !g->actor[i] && g->depth[i] && w->background[i] &&
                   g->depth[i] + 2 * tolerance_mm(w->background[i]) < w->background[i];
    for (int start = 0; start < SCENE_CELLS; start++) {
        int top = 0, first_row = SCENE_ROWS, last_row = 0;
        double area = 0, depth = 0, count = 0;
        if (!front[start])
            continue;
        front[start] = false;
        stack[top++] = (int16_t)start;
        while (top) {
            const int i = stack[--top], r = i / SCENE_COLUMNS, c = i % SCENE_COLUMNS;
            const double z = g->depth[i] * 1e-3;
            area += z * z * cell_w * cell_h;
            depth += z;
            count++;
            first_row = r < first_row ? r : first_row;
            last_row = r > last_row ? r : last_row;
            const int next[4] = {c ? i - 1 : i, c < SCENE_COLUMNS - 1 ? i + 1 : i, r ? i - SCENE_COLUMNS : i,
                                 r < SCENE_ROWS - 1 ? i + SCENE_COLUMNS : i};
            for (int k = 0; k < 4; k++)
                if (front[next[k]]) {
                    front[next[k]] = false;
                    stack[top++] = (int16_t)next[k];
                }
        }
        if (area >= PERSON_M2 && (last_row - first_row + 1) * cell_h * depth / count >= PERSON_HEIGHT_M)
            return true;
    }
    return false;
}

static double mean_luma(const struct scene_view *view)
{
    const struct calibration *k = view->calibration;
    const struct lens *l = &k->color;
    double sum = 0, count = 0;
    const bool masked = view->mask && k->registered && k->depth.width > 0;
    for (int y = 4; y < l->height; y += 8)
        for (int x = 4; x < l->width; x += 8) {
            const uint8_t *rgb = view->color + 3 * (y * l->width + x);
            if (masked && !view->mask[y * k->depth.height / l->height * k->depth.width + x * k->depth.width / l->width])
                continue;
            sum += 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
            count++;
        }
    return count > 0 ? sum / count : -1;
}

void scene_watch_next(struct scene_watch *w, const struct scene_view *view, struct scene_state *out)
{
    *out = (struct scene_state){.luma = -1};
    if (view->color) {
        out->luma = mean_luma(view);
        out->dark = out->luma >= 0 && out->luma < DARK;
        out->bright = out->luma > BRIGHT;
    }
    if (!view->depth)
        return;
    struct grid g;
    int valid = 0;
    const int frames = view->skipped < MOST_FRAMES ? view->skipped + 1 : MOST_FRAMES;
    sample(view, &g);
    for (int i = 0; i < SCENE_CELLS; i++)
        valid += g.depth[i] != 0;
    out->no_depth = valid < MIN_DEPTH_SHARE * SCENE_CELLS;
    out->frozen = is_frozen(w, &g, frames) && !out->no_depth;
    out->pushed = is_pushed(w, &g, frames);
    if (out->pushed) { // everything is learned again
        memset(w->background, 0, sizeof w->background);
        memset(w->still, 0, sizeof w->still);
        w->moved_frames = 0;
    }
    out->second_person = shows_person(w, &g, &view->calibration->depth);
    if (!w->moved_frames)
        learn(w, &g, frames);
    memcpy(w->last, g.depth, sizeof w->last);
    w->frames += frames;
}
