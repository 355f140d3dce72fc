// Whether a camera's pictures and its lens belong together, from a few pictures of a known place: a wrong lens puts a
// camera metres away from where it is, and so do pictures that are mirrored or squeezed between black bars.
//
// Landmarks are recognised without regard to the lens; then the lens is found by which most of them agree, from the
// given one or one several times as long or short, with the poses free and the place held
// (platform/vision/bundle_adjustment.h).
//
//     struct picture_check *check;
//     if (picture_check_open(&check, &place, &lens) == OK)
//         for each picture:
//             picture_check_add(check, color)
//     picture_check_judge(check, &verdict)
//
// Deterministic; one thread at a time. Looks at ever fewer pictures of a long film: some 40 ms for each of those.
#pragma once
#include "base/lens.h"
#include "platform/vision/bundle_adjustment.h"
#include "recording/place.h"

// ---------------------------------------------------------------- lens verdict

// Whether a given lens is that of the pictures, from a lens fitted to them (platform/vision/bundle_adjustment.h): what
// is off, by how much, in words. Pure.

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

// ---------------------------------------------------------------- picture check

struct picture_check;

// Borrows the place; copies the lens. ERR_MEMORY.
MUST_CHECK enum status picture_check_open(struct picture_check **out, const struct place *place,
                                          const struct lens *lens);
void picture_check_close(struct picture_check **c); // NULL is fine; sets *c = NULL

// The next picture, RGB of the lens's size. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status picture_check_add(struct picture_check *check, const uint8_t *color);

struct picture_verdict {
    int looked_at, recognised; // pictures; those in which enough landmarks agree on a pose, with whatever lens
    struct lens_verdict lens;  // LENS_FITS, too, where too little is recognised
    bool mirrored;             // most are recognised only in a mirror, or several and no other at all
    bool barred;               // black bars above and below, or on both sides, in all of them
    bool overexposed, dark;    // most of them, largely
};

// lens: the one to judge, as estimated at the end; of the size given before. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status picture_check_judge(struct picture_check *check, const struct lens *lens,
                                           struct picture_verdict *out);

// The likeliest cause why pictures are placed wrongly or not at all, and what to do, in one sentence; "": none is
// known. badly_placed: fewer pictures could be placed than should be. *useless: no pose is of use. Returns `out`.
enum { PICTURE_TEXT_BYTES = 400 };
const char *picture_verdict_text(const struct picture_verdict *verdict, bool badly_placed, char out[PICTURE_TEXT_BYTES],
                                 bool *useless);
