#include "locate/lens_verdict.h"

#include <math.h>
#include <stdio.h>

// Less is no fault. A focal length 2 % off puts a wall at 4 m 8 cm away; lenses that are calibrated with care, maps of
// them and the fit itself differ by up to 1 %. The principal point's error is mostly taken for a turn of the camera.
// Chosen on films of the tests' small world with right and wrong lenses; other rooms and real films were left out.
static const double FOCAL = 0.02, STRETCHED = 0.03, CENTRE = 0.02, BENT = 0.03;
static const double SURE_SIGMA = 4;
// From here on the pictures show another lens, or are processed ones, and distances from them are off by as much.
static const double GROSS = 0.12, GROSS_CENTRE = 0.15;
// A lens that bends by so much, and at least by this share of how far the focal length is off, both in units of the
// bounds above, is named for that: a focal length makes up for a part of it.
static const double SURELY_BENT = 0.05, BENT_SHARE = 0.5;

struct judged {
    double by, sigma, least;
};

static bool is_fault(const struct judged *j) { return fabs(j->by) > j->least && fabs(j->by) > SURE_SIGMA * j->sigma; }

void lens_judge(const struct ba_lens *fitted, const struct lens *given, struct lens_verdict *out)
{
    const double *c = fitted->covariance;
    const double wide = 0.5 * given->width / given->fx, high = 0.5 * given->height / given->fy;
    const double mean = (fitted->focal[0] + fitted->focal[1]) / 2, corner = wide * wide + high * high;
    const double sigma_focal = sqrt(fmax(c[0] + c[6] + 2 * c[1], 0)) / 2,
                 sigma_apart = sqrt(fmax(c[0] + c[6] - 2 * c[1], 0));
    const struct judged all[] = {
        [LENS_FOCAL] = {1 / mean - 1, sigma_focal / (mean * mean), FOCAL},
        [LENS_STRETCHED] = {fitted->focal[1] / fitted->focal[0] - 1, sigma_apart / mean, STRETCHED},
        [LENS_CENTRE] = {hypot(fitted->shift[0] / wide, fitted->shift[1] * given->fy / given->fx / wide) / 2,
                         sqrt(fmax(fmax(c[12], c[18]), 0)) / wide / 2, CENTRE},
        [LENS_BENT] = {fitted->bend * corner, sqrt(fmax(c[24], 0)) * corner, BENT},
    };
    enum lens_fault worst = LENS_FITS;
    for (enum lens_fault f = LENS_FOCAL; f <= LENS_BENT; f++)
        if (is_fault(&all[f]) &&
            (worst == LENS_FITS || fabs(all[f].by) / all[f].least > fabs(all[worst].by) / all[worst].least))
            worst = f;
    if (worst == LENS_FOCAL && is_fault(&all[LENS_BENT]) && fabs(all[LENS_BENT].by) > SURELY_BENT &&
        fabs(all[LENS_BENT].by) / BENT > BENT_SHARE * fabs(all[LENS_FOCAL].by) / FOCAL)
        worst = LENS_BENT;
    *out = (struct lens_verdict){.fault = worst};
    if (worst == LENS_FITS)
        return;
    out->by = all[worst].by;
    out->sigma = all[worst].sigma;
    out->gross = fabs(out->by) > (worst == LENS_CENTRE ? GROSS_CENTRE : GROSS);
}

const char *lens_verdict_text(const struct lens_verdict *v, char out[LENS_TEXT_BYTES])
{
    char by[64];
    const double percent = 100 * fabs(v->by);
    if (v->gross || !(v->sigma > 0)) // a fit from so far away falls short
        snprintf(by, sizeof by, "at least %.0f %%", percent);
    else
        snprintf(by, sizeof by, "%.1f %% (± %.1f %%)", percent, fmax(100 * v->sigma, 0.1));
    switch (v->fault) {
    case LENS_FOCAL:
        snprintf(out, LENS_TEXT_BYTES, "the calibrated focal length looks %s too %s", by, v->by > 0 ? "long" : "short");
        break;
    case LENS_STRETCHED:
        snprintf(out, LENS_TEXT_BYTES, "the pictures look %s %s than the calibrated lens takes them", by,
                 v->by < 0 ? "lower" : "higher");
        break;
    case LENS_CENTRE:
        snprintf(out, LENS_TEXT_BYTES, "the calibrated principal point looks off by %s of the picture's width", by);
        break;
    case LENS_BENT:
        snprintf(out, LENS_TEXT_BYTES,
                 "the pictures bend straight lines otherwise than the calibrated lens, by %s at their corners", by);
        break;
    default: *out = 0;
    }
    return out;
}
