#include "capture/calibration/lens_calibration.h"

#include "platform/vision/chequers.h"
#include "platform/files/image_file.h"

#include <stdlib.h>
#include <string.h>

// All chosen by hand.
enum { LEAST_CIRCLES = 16 };
static const double NEW_VIEW_SHARE = 1.0 / 30; // of the picture's width, that the board's middle or corners moved

void lens_calibration_start(struct lens_calibration *c, const struct stereo_board *board, int width, int height)
{
    *c = (struct lens_calibration){.board = *board, .width = width, .height = height};
}

void lens_calibration_free(struct lens_calibration *c)
{
    free(c->circles);
    *c = (struct lens_calibration){.views = 0};
}

// How far the circles' outermost ones are from those of the last view, pixels.
static double moved_px(const struct lens_calibration *c, const struct circle *found, int count)
{
    const struct circle *last = c->circles + c->first[c->views - 1];
    const int last_count = c->first[c->views] - c->first[c->views - 1];
    double sum[2][5] = {{0}};
    for (int which = 0; which < 2; which++) {
        const struct circle *at = which ? found : last;
        const int n = which ? count : last_count;
        double left = INFINITY, right = -INFINITY, top = INFINITY, bottom = -INFINITY;
        for (int i = 0; i < n; i++) {
            left = fmin(left, at[i].at.x), right = fmax(right, at[i].at.x);
            top = fmin(top, at[i].at.y), bottom = fmax(bottom, at[i].at.y);
        }
        const double box[4] = {left, right, top, bottom};
        memcpy(sum[which], box, sizeof box);
    }
    double most = 0;
    for (int k = 0; k < 4; k++)
        most = fmax(most, fabs(sum[0][k] - sum[1][k]));
    return most;
}

// Circles of a part of the board, or all corners of the chequers. *count 0: it is not in sight.
static enum status find_board(const struct lens_calibration *c, const uint8_t *gray, struct circle *found, int *count)
{
    const struct stereo_board *b = &c->board;
    if (!c->chequers)
        return stereo_circles_find(gray, c->width, c->height, found, count);
    struct pixel *corners = malloc((size_t)b->columns * (size_t)b->rows * sizeof *corners);
    enum status status = corners ? chequers_find(gray, c->width, c->height, b->columns, b->rows, corners)
                                 : fail(ERR_MEMORY, "no memory to look for the board");
    *count = status == OK ? b->columns * b->rows : 0;
    for (int i = 0; i < *count; i++)
        found[i] = (struct circle){.at = corners[i], .column = i % b->columns, .row = i / b->columns};
    free(corners);
    return status == NOTHING ? OK : status;
}

enum status lens_calibration_add(struct lens_calibration *c, const uint8_t *rgb, bool *used)
{
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    struct circle *found = malloc(STEREO_MOST_CIRCLES * sizeof *found);
    uint8_t *gray = malloc(pixels);
    int count = 0;
    enum status status = found && gray ? OK : fail(ERR_MEMORY, "no memory to look for the board");
    *used = false;
    if (status == OK) {
        image_gray(rgb, pixels, gray);
        status = find_board(c, gray, found, &count);
    }
    c->frames++;
    if (status == OK && count >= LEAST_CIRCLES && c->views < LENS_MOST_VIEWS &&
        (!c->views || moved_px(c, found, count) > NEW_VIEW_SHARE * c->width)) {
        const int before = c->first[c->views];
        struct circle *more = realloc(c->circles, (size_t)(before + count) * sizeof *more);
        status = more ? OK : fail(ERR_MEMORY, "no memory for the board's circles");
        if (more) {
            c->circles = more;
            memcpy(more + before, found, (size_t)count * sizeof *more);
            c->first[++c->views] = before + count;
            *used = true;
        }
    }
    free(gray);
    free(found);
    return status;
}

enum status lens_calibration_solve(const struct lens_calibration *c, struct lens *lens, struct lens_report *report)
{
    struct stereo_view views[LENS_MOST_VIEWS];
    struct stereo_fit fit;
    struct lens found;
    *report = (struct lens_report){.views = c->views, .circles = c->first[c->views]};
    if (c->views < LENS_LEAST_VIEWS)
        return fail(ERR_INPUT,
                    "the board is in %d different pictures of %d; at least %d are needed, with the board tilted to all "
                    "sides and in all corners of the picture",
                    c->views, c->frames, LENS_LEAST_VIEWS);
    for (int i = 0; i < c->views; i++) {
        const struct circle *at = c->circles + c->first[i];
        const int count = c->first[i + 1] - c->first[i];
        views[i] = (struct stereo_view){{at, NULL}, {count, 0}, NULL};
    }
    enum status status = stereo_calibrate_one(&c->board, views, c->views, c->width, c->height, &found, &fit);
    if (status != OK)
        return status;
    report->rms_px = fit.rms_px;
    report->max_px = fit.max_px;
    report->focal_sigma = fit.focal_sigma;
    report->sigma_mm_per_m = 1e3 * report->focal_sigma;
    *lens = found;
    return OK;
}
