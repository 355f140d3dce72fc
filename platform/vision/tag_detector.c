#include "platform/vision/tag_detector.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

// *out NULL: the image is smaller than any decodable tag and than the library's tiles, or ERR_MEMORY.
static enum status detect_tags(apriltag_detector_t *detector, const struct gray_image *gray, zarray_t **out)
{
    const int width = gray->width, height = gray->height;
    *out = NULL;
    if (width < 16 || height < 16)
        return OK;
    image_u8_t image = {.width = width, .height = height, .stride = width, .buf = (uint8_t *)(uintptr_t)gray->pixels};
    *out = apriltag_detector_detect(detector, &image);
    return *out ? OK : fail(ERR_MEMORY, "no memory to detect tags in an image of %d x %d pixels", width, height);
}

// ---------------------------------------------------------------- tag families

// The library's mean distance of a cell's grey value from the border between black and white, 0 to 127. By hand: of
// printed tags in poor light it is 30 and more, of furniture that happens to have a code mostly below 10.
static const float CLEAR = 20;

static const struct {
    const char *name;
    apriltag_family_t *(*create)(void);
    void (*destroy)(apriltag_family_t *);
} families[TAG_FAMILIES] = {
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

struct tag_families {
    apriltag_detector_t *detector;
    apriltag_family_t *family[TAG_FAMILIES];
};

enum status tag_families_open(struct tag_families **out)
{
    struct tag_families *f = *out = calloc(1, sizeof *f);
    bool made = f && (f->detector = apriltag_detector_create());
    for (int i = 0; i < TAG_FAMILIES && made; i++) {
        made = (f->family[i] = families[i].create());
        if (made) // without errors corrected: with two the table of the largest family would take gigabytes
            apriltag_detector_add_family_bits(f->detector, f->family[i], 0);
    }
    if (!made) {
        tag_families_close(out);
        return fail(ERR_MEMORY, "no memory to look for tags of other families");
    }
    f->detector->quad_decimate = 1;
    f->detector->nthreads = 1;
    return OK;
}

void tag_families_close(struct tag_families **tag_families)
{
    if (!*tag_families)
        return;
    if ((*tag_families)->detector)
        apriltag_detector_destroy((*tag_families)->detector);
    for (int i = 0; i < TAG_FAMILIES; i++)
        if ((*tag_families)->family[i])
            families[i].destroy((*tag_families)->family[i]);
    free(*tag_families);
    *tag_families = NULL;
}

enum status tag_families_look(struct tag_families *tag_families, const struct gray_image *gray,
                              struct tag_of_family *out, int capacity, int *count)
{
    zarray_t *found;
    const enum status status = detect_tags(tag_families->detector, gray, &found);
    *count = 0;
    for (int i = 0; found && i < zarray_size(found) && *count < capacity; i++) {
        apriltag_detection_t *detection;
        zarray_get(found, i, &detection);
        for (int k = 0; k < TAG_FAMILIES && detection->decision_margin >= CLEAR; k++)
            if (detection->family == tag_families->family[k])
                out[(*count)++] = (struct tag_of_family){k, detection->id};
    }
    if (found)
        apriltag_detections_destroy(found);
    return status;
}

const char *tag_family_name(int family) { return families[family].name; }

// ---------------------------------------------------------------- tag detector

struct tag_detector {
    apriltag_detector_t *detector;
};

// The library's table of all codes with up to two wrong bits takes 18 MB and longer to fill than a picture to look
// through. It is only read then: it is made once and kept to the program's end, for all detectors of all threads.
static bool add_shared_family(apriltag_detector_t *detector)
{
    static pthread_mutex_t making = PTHREAD_MUTEX_INITIALIZER;
    static apriltag_family_t *family;
    pthread_mutex_lock(&making);
    if (!family)
        family = tag36h11_create();
    const bool made = family;
    if (made)
        apriltag_detector_add_family(detector, family);
    pthread_mutex_unlock(&making);
    return made;
}

enum status tag_detector_open(struct tag_detector **out, double quad_decimate)
{
    *out = NULL;
    if (!(quad_decimate >= 1 && quad_decimate <= TAG_MAX_DECIMATE))
        return fail(ERR_INPUT, "the tag detector's decimation must lie between 1 and %d, not %g", TAG_MAX_DECIMATE,
                    quad_decimate);
    struct tag_detector *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for the tag detector");
    f->detector = apriltag_detector_create();
    if (!f->detector || !add_shared_family(f->detector)) {
        tag_detector_close(&f);
        return fail(ERR_MEMORY, "no memory for the tag detector");
    }
    f->detector->quad_decimate = (float)quad_decimate;
    f->detector->nthreads = 1;
    *out = f;
    return OK;
}

void tag_detector_close(struct tag_detector **detector)
{
    if (!*detector)
        return;
    if ((*detector)->detector) {
        zarray_clear((*detector)->detector->tag_families); // or the shared table would be freed
        apriltag_detector_destroy((*detector)->detector);
    }
    free(*detector);
    *detector = NULL;
}

// By id, then from left to right: independent of the library's order.
static int compare_detections(const void *left, const void *right)
{
    const struct tag_detection *a = left, *b = right;
    if (a->id != b->id)
        return a->id < b->id ? -1 : 1;
    return (a->corner[0].x > b->corner[0].x) - (a->corner[0].x < b->corner[0].x);
}

enum status tag_detector_detect(struct tag_detector *detector, const struct gray_image *gray, struct tag_detection *out,
                                int capacity, int *count)
{
    zarray_t *found;
    const enum status status = detect_tags(detector->detector, gray, &found);
    *count = 0;
    for (int i = 0; found && i < zarray_size(found) && *count < capacity; i++) {
        apriltag_detection_t *detection;
        zarray_get(found, i, &detection);
        struct tag_detection seen = {.id = detection->id, .hamming_errors = detection->hamming};
        bool finite = true;
        for (int k = 0; k < 4; k++) {
            // The library's (0, 0) is the corner of the first pixel, here it is its centre.
            seen.corner[k] = (struct pixel){detection->p[k][0] - 0.5, detection->p[k][1] - 0.5};
            finite = finite && isfinite(seen.corner[k].x) && isfinite(seen.corner[k].y);
        }
        if (finite)
            out[(*count)++] = seen;
    }
    if (found)
        apriltag_detections_destroy(found);
    qsort(out, (size_t)*count, sizeof *out, compare_detections);
    return status;
}

bool tag_pattern(int32_t id, struct tag_pattern *out)
{
    apriltag_family_t *family = tag36h11_create();
    bool known = family && id >= 0 && (uint32_t)id < family->ncodes;
    if (known) {
        // The first bit is the code's most significant; bit_x, bit_y count cells from the black square's corner.
        *out = (struct tag_pattern){0};
        for (uint32_t i = 0; i < family->nbits; i++)
            out->cell[family->bit_y[i]][family->bit_x[i]] = family->codes[id] >> (family->nbits - 1 - i) & 1;
    }
    if (family)
        tag36h11_destroy(family);
    return known;
}
