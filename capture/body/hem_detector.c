#include "capture/body/hem_detector.h"

// Chosen by hand; test_hem_detector measures the outcome on skirts, coats and trousers.
#define BIN_M      0.02
#define LEVEL_MIN  0.12 // of body height: above the ankles
#define LEVEL_MAX  0.38 // below hanging hands
#define NARROW     0.40 // at a hem; trousers have 0.3 or less
#define WIDE       0.18 // minimum width above a hem, of body height; two legs hardly reach it
#define KEEP_RATE  0.75 // of both thresholds, to keep the decision that there is a hem
#define WIDE_MIN_M 0.05 // narrower levels have no hem
enum { BINS = 60, GAP_BINS = 1, WINDOW_BINS = 5, HEM_FRAMES_MAX = 60 };

// The visible width of the person, metres, by level over the floor.
static void find_widths(const struct fit_task *task, double width[BINS])
{
    const struct depth_evidence *e = task->evidence;
    int stride = e->lens.width / 320 > 1 ? e->lens.width / 320 : 1;
    for (int i = 0; i < BINS; i++)
        width[i] = 0;
    for (int y = e->top; y <= e->bottom; y += stride)
        for (int x = e->left; x <= e->right; x += stride) {
            int at = y * e->lens.width + x, d = e->depth[at];
            if (!e->mask[at] || !d)
                continue;
            double z = d * 0.001;
            struct vec3 p = v3_scale(lens_ray(&e->lens, (struct pixel){x, y}), z);
            int bin = (int)floor((v3_dot(task->up, p) + task->floor_m) / BIN_M);
            if (bin >= 0 && bin < BINS)
                width[bin] += stride * z / e->lens.fx * (stride * z / e->lens.fy) / BIN_M;
        }
}

// The lowest bin that is fully visible: 0, or above where the image's lower edge crops the person.
static int lowest_bin(const struct fit_task *task)
{
    const struct depth_evidence *e = task->evidence;
    double high = 0;
    for (int y = e->bounds.bottom - CROP_MARGIN; y <= e->bottom; y++)
        for (int x = e->left; x <= e->right; x++) {
            int at = y * e->lens.width + x, d = e->depth[at];
            if (!e->mask[at] || !d)
                continue;
            struct vec3 p = v3_scale(lens_ray(&e->lens, (struct pixel){x, y}), d * 0.001);
            high = fmax(high, v3_dot(task->up, p) + task->floor_m);
        }
    return (int)ceil(high / BIN_M);
}

static double mean_of(const double width[BINS], int from, int to)
{
    double sum = 0;
    for (int i = from; i < to; i++)
        sum += width[i] / (to - from);
    return sum;
}

bool hem_detect(const struct fit_task *task, double height_m, struct hem *out)
{
    double width[BINS];
    *out = (struct hem){0};
    const struct depth_evidence *e = task->evidence;
    if (!task->have_floor || evidence_cropped_edges(e) & (CROP_LEFT | CROP_RIGHT))
        return false;
    find_widths(task, width);
    int lowest = lowest_bin(task), first = (int)(LEVEL_MIN * height_m / BIN_M);
    first = lowest && first < lowest + WINDOW_BINS ? lowest + WINDOW_BINS : first;
    if (first * BIN_M >= LEVEL_MAX * height_m)
        return false;
    for (int i = first; i < BINS - WINDOW_BINS && i * BIN_M < LEVEL_MAX * height_m; i++) {
        double over = mean_of(width, i + GAP_BINS, i + WINDOW_BINS),
               under = i > WINDOW_BINS ? mean_of(width, i - WINDOW_BINS, i - GAP_BINS) : over;
        double narrow = over > WIDE_MIN_M ? (over - under) / over : 0;
        if (narrow > out->narrow)
            *out = (struct hem){i * BIN_M, over, narrow};
    }
    return true;
}

void hem_update(struct hem_estimate *estimate, const struct hem *hem, double waist_level_m)
{
    estimate->count += estimate->count < HEM_FRAMES_MAX;
    double share = 1.0 / estimate->count;
    estimate->below_m += share * (waist_level_m - hem->level_m - estimate->below_m);
    estimate->wide_m += share * (hem->wide_m - estimate->wide_m);
    estimate->narrow += share * (hem->narrow - estimate->narrow);
}

bool hem_is_worn(double narrow, double wide_m, double height_m, bool wears)
{
    return narrow > (wears ? KEEP_RATE : 1) * NARROW && wide_m > (wears ? KEEP_RATE : 1) * WIDE * height_m;
}
