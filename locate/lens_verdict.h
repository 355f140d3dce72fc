// Whether a given lens is that of the pictures, from a lens fitted to them (platform/vision/bundle_adjustment.h): what
// is off, by how much, in words. Pure.
#pragma once
#include "base/lens.h"
#include "platform/vision/bundle_adjustment.h"

enum lens_fault {
    LENS_FITS,
    LENS_FOCAL,     // the focal length; by: the given one over the true one, less 1
    LENS_STRETCHED, // the pictures are narrower or lower than the lens says; by: true fy / fx over the given ratio,
                    // less 1
    LENS_CENTRE,    // the principal point; by: how far it is off, a share of the picture's width
    LENS_BENT,      // straight lines bend otherwise, as by a fisheye lens; by: how far at the corners, a share
};

struct lens_verdict {
    enum lens_fault fault;
    double by;
    double sigma; // standard deviation of `by`; 0: not known
    bool gross;   // nothing that is measured with it is of use
};

// Only what is both significant and material is a fault.
void lens_judge(const struct ba_lens *fitted, const struct lens *given, struct lens_verdict *out);

// "the calibrated focal length looks 3.1 % (± 0.2 %) too long"; "" where the lens fits. Returns `out`.
enum { LENS_TEXT_BYTES = 200 };
const char *lens_verdict_text(const struct lens_verdict *verdict, char out[LENS_TEXT_BYTES]);
