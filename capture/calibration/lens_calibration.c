#include "capture/calibration/lens_calibration.h"

#include "base/linear_algebra.h"
#include "platform/files/image_file.h"
#include "platform/vision/chequers.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- readout

// All chosen by hand.
static const double MIN_SPEED_PX = 200; // a second: a shear of a pixel for a tag of 100 rows read in 20 ms
static const double MAX_SIGMA_S = 0.003, MAX_RMS_PX = 1.5, MAX_GAP_S = 0.12;
enum { UNKNOWNS = 5 }; // constant, along x, along y, their product, readout

void readout_add(struct readout *readout, double time_s, int32_t id, const struct pixel corner[4])
{
    if (readout->count == READOUT_MAX_FRAMES || (readout->count && readout->frames[0].id != id))
        return;
    struct readout_frame *f = &readout->frames[readout->count++];
    f->time_s = time_s;
    f->id = id;
    for (int k = 0; k < 4; k++) {
        const struct vec3 ray = lens_ray(&readout->lens, corner[k]);
        f->corner[k] = (struct pixel){readout->lens.fx * ray.x, readout->lens.fy * ray.y};
    }
}

static struct pixel middle_of(const struct readout_frame *frame)
{
    struct pixel m = {0, 0};
    for (int k = 0; k < 4; k++)
        m.x += frame->corner[k].x / 4, m.y += frame->corner[k].y / 4;
    return m;
}

// The displacement of the top edge against the bottom one, and the row of unknowns' factors. False: at a gap.
static bool build_equation(const struct readout *readout, int i, double row[UNKNOWNS], double *shear, double *speed)
{
    const struct readout_frame *f = &readout->frames[i];
    if (i == 0 || i + 1 == readout->count || readout->frames[i + 1].time_s - readout->frames[i - 1].time_s > MAX_GAP_S)
        return false;
    const struct pixel m = middle_of(f), before = middle_of(f - 1), after = middle_of(f + 1);
    const double passed_s = (f + 1)->time_s - (f - 1)->time_s;
    if (passed_s <= 0)
        return false;
    *speed = (after.x - before.x) / passed_s;
    const double height = 0.5 * (f->corner[3].y + f->corner[2].y - f->corner[0].y - f->corner[1].y);
    *shear = 0.5 * (f->corner[3].x + f->corner[2].x - f->corner[0].x - f->corner[1].x);
    const double x = m.x / readout->lens.fx, y = m.y / readout->lens.fy, rows = height / (readout->lens.height - 1);
    const double factors[UNKNOWNS] = {1, x, y, x * y, *speed * rows};
    memcpy(row, factors, sizeof factors);
    return true;
}

enum status readout_solve(const struct readout *readout, double *readout_s, struct readout_report *report)
{
    double n[UNKNOWNS * UNKNOWNS] = {0}, copy[UNKNOWNS * UNKNOWNS], g[UNKNOWNS] = {0}, row[UNKNOWNS], shear, speed;
    double to_left = 0, to_right = 0, squares = 0, max = 0;
    *report = (struct readout_report){.frames = 0};
    for (int i = 0; i < readout->count; i++) {
        if (!build_equation(readout, i, row, &shear, &speed))
            continue;
        report->frames++;
        to_left = fmax(to_left, -speed);
        to_right = fmax(to_right, speed);
        max = fmax(max, fabs(row[4]));
        for (int a = 0; a < UNKNOWNS; a++) {
            g[a] += row[a] * shear;
            for (int b = 0; b < UNKNOWNS; b++)
                n[UNKNOWNS * a + b] += row[a] * row[b];
        }
    }
    report->fastest_px_per_s = fmax(to_left, to_right);
    if (report->frames < READOUT_MIN_FRAMES)
        return fail(ERR_INPUT,
                    "the tag is in %d pictures one after the other; %d are needed: keep it in sight while the "
                    "camera is swung left and right",
                    report->frames, READOUT_MIN_FRAMES);
    if (fmin(to_left, to_right) < MIN_SPEED_PX)
        return fail(ERR_INPUT,
                    "the camera was swung at %.0f pixels a second to the left and %.0f to the right; swing it "
                    "faster, a turn of the wrist each way every second",
                    to_right, to_left);
    memcpy(copy, n, sizeof n);
    double inverse[UNKNOWNS * UNKNOWNS];
    // A tag that moves on a straight line leaves y and x y undetermined: a weak prior keeps them at 0.
    for (int a = 1; a < 4; a++)
        copy[UNKNOWNS * a + a] += 1e-6 * report->frames;
    if (!invert_symmetric(copy, UNKNOWNS, inverse))
        return fail(ERR_SOLVER, "the swing does not fix the read-out time");
    double solution[UNKNOWNS] = {0};
    for (int a = 0; a < UNKNOWNS; a++)
        for (int b = 0; b < UNKNOWNS; b++)
            solution[a] += inverse[UNKNOWNS * a + b] * g[b];
    for (int i = 0; i < readout->count; i++) {
        if (!build_equation(readout, i, row, &shear, &speed))
            continue;
        double off = shear;
        for (int a = 0; a < UNKNOWNS; a++)
            off -= row[a] * solution[a];
        squares += off * off;
    }
    report->rms_px = sqrt(squares / report->frames);
    report->sigma_s = report->rms_px * sqrt(inverse[UNKNOWNS * UNKNOWNS - 1]);
    report->bend_px = max * fabs(solution[4]);
    if (report->rms_px > MAX_RMS_PX || report->sigma_s > MAX_SIGMA_S)
        return fail(ERR_INPUT,
                    "the tag's shear fits a rolling shutter to %.1f pixels only; turn the camera without rolling "
                    "it, before a tag that hangs flat",
                    report->rms_px);
    if (solution[4] < -3 * report->sigma_s || solution[4] > LENS_MAX_READOUT_S)
        return fail(ERR_INPUT, "the pictures say a read-out of %.1f ms, which cannot be; are they upside down?",
                    solution[4] * 1e3);
    *readout_s = fmax(solution[4], 0);
    return OK;
}

// ---------------------------------------------------------------- lens calibration

// All chosen by hand.
enum { MIN_CIRCLES = 16 };
static const double NEW_VIEW_SHARE = 1.0 / 30; // of the picture's width, that the board's middle or corners moved

void lens_calibration_start(struct lens_calibration *calibration, const struct stereo_board *board, int width,
                            int height)
{
    *calibration = (struct lens_calibration){.board = *board, .width = width, .height = height};
}

void lens_calibration_free(struct lens_calibration *calibration)
{
    free(calibration->circles);
    *calibration = (struct lens_calibration){.views = 0};
}

// How far the circles' outermost ones are from those of the last view, pixels.
static double moved_px(const struct lens_calibration *calibration, const struct circle *found, int count)
{
    const struct circle *last = calibration->circles + calibration->first[calibration->views - 1];
    const int last_count = calibration->first[calibration->views] - calibration->first[calibration->views - 1];
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
    double max = 0;
    for (int k = 0; k < 4; k++)
        max = fmax(max, fabs(sum[0][k] - sum[1][k]));
    return max;
}

// Circles of a part of the board, or all corners of the chequers. *count 0: it is not in sight.
static enum status find_board(const struct lens_calibration *calibration, const uint8_t *gray, struct circle *found,
                              int *count)
{
    const struct stereo_board *b = &calibration->board;
    if (!calibration->chequers)
        return stereo_circles_find(gray, calibration->width, calibration->height, found, count);
    struct pixel *corners = malloc((size_t)b->columns * (size_t)b->rows * sizeof *corners);
    enum status status =
        corners ? chequers_find(gray, calibration->width, calibration->height, b->columns, b->rows, corners)
                : fail(ERR_MEMORY, "no memory to look for the board");
    *count = status == OK ? b->columns * b->rows : 0;
    for (int i = 0; i < *count; i++)
        found[i] = (struct circle){.at = corners[i], .column = i % b->columns, .row = i / b->columns};
    free(corners);
    return status == NOTHING ? OK : status;
}

enum status lens_calibration_add(struct lens_calibration *calibration, const uint8_t *rgb, bool *used)
{
    const size_t pixels = (size_t)calibration->width * (size_t)calibration->height;
    struct circle *found = malloc(STEREO_MAX_CIRCLES * sizeof *found);
    uint8_t *gray = malloc(pixels);
    int count = 0;
    enum status status = found && gray ? OK : fail(ERR_MEMORY, "no memory to look for the board");
    *used = false;
    if (status == OK) {
        image_gray(rgb, pixels, gray);
        status = find_board(calibration, gray, found, &count);
    }
    calibration->frames++;
    if (status == OK && count >= MIN_CIRCLES && calibration->views < LENS_MAX_VIEWS &&
        (!calibration->views || moved_px(calibration, found, count) > NEW_VIEW_SHARE * calibration->width)) {
        const int before = calibration->first[calibration->views];
        struct circle *more = realloc(calibration->circles, (size_t)(before + count) * sizeof *more);
        status = more ? OK : fail(ERR_MEMORY, "no memory for the board's circles");
        if (more) {
            calibration->circles = more;
            memcpy(more + before, found, (size_t)count * sizeof *more);
            calibration->first[++calibration->views] = before + count;
            *used = true;
        }
    }
    free(gray);
    free(found);
    return status;
}

enum status lens_calibration_solve(const struct lens_calibration *calibration, struct lens *lens,
                                   struct lens_report *report)
{
    struct stereo_view views[LENS_MAX_VIEWS];
    struct stereo_fit fit;
    struct lens found;
    *report = (struct lens_report){.views = calibration->views, .circles = calibration->first[calibration->views]};
    if (calibration->views < LENS_MIN_VIEWS)
        return fail(ERR_INPUT,
                    "the board is in %d different pictures of %d; at least %d are needed, with the board tilted to all "
                    "sides and in all corners of the picture",
                    calibration->views, calibration->frames, LENS_MIN_VIEWS);
    for (int i = 0; i < calibration->views; i++) {
        const struct circle *at = calibration->circles + calibration->first[i];
        const int count = calibration->first[i + 1] - calibration->first[i];
        views[i] = (struct stereo_view){{at, NULL}, {count, 0}, NULL};
    }
    enum status status = stereo_calibrate_one(&calibration->board, views, calibration->views, calibration->width,
                                              calibration->height, &found, &fit);
    if (status != OK)
        return status;
    report->rms_px = fit.rms_px;
    report->max_px = fit.max_px;
    report->focal_sigma = fit.focal_sigma;
    report->sigma_mm_per_m = 1e3 * report->focal_sigma;
    *lens = found;
    return OK;
}
