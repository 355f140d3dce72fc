// Measures radii: [D14], equation 4 and section 4.1.
#include "capture/body_radii.h"

#include "base/depth_noise.h"
#include "base/portable_math.h"
#include "capture/export.h"
#include "recording/place.h"

#include <string.h>

// Samples lie between these shares of a part's length; near the joints the
// neighbouring part would be measured. Chosen by hand.
static const double FIRST_SHARE = 0.25, LAST_SHARE = 0.85;
enum { SAMPLES = 13, SAMPLES_MIN = 5 };

// No part of a person reaches further than this from its bone, metres.
static const double RADIUS_MAX_M = 0.35;

void body_radii_start(struct body_radii *radii)
{
    *radii = (struct body_radii){.body.representative_frame = -1, .best = -1};
    for (int p = 0; p < PART_COUNT; p++)
        radii->part_best[p] = -1;
}

// A skeleton in the depth camera's axes and image.
struct projected_skeleton {
    struct vec3 joint[JOINT_COUNT]; // depth camera's axes
    struct pixel pixel[JOINT_COUNT];
    bool usable[JOINT_COUNT]; // known and in front of the camera
};

static struct projected_skeleton project_skeleton(const struct calibration *calibration,
                                                  const struct skeleton *skeleton)
{
    struct projected_skeleton seen;
    struct pose depth_from_color = pose_inverse(calibration->color_from_depth);
    for (int j = 0; j < JOINT_COUNT; j++) {
        seen.joint[j] = pose_apply(depth_from_color, skeleton->joint[j]);
        seen.usable[j] = skeleton->confidence[j] > 0 && v3_finite(seen.joint[j]) && seen.joint[j].z > 0.1;
        seen.pixel[j] = seen.usable[j] ? lens_project(&calibration->depth, seen.joint[j]) : (struct pixel){0, 0};
    }
    return seen;
}

// Distance of pixel (x, y) from a part's bone, pixels; *along is its projection onto the bone, 0
// at `from` and 1 at `to`, outside for a pixel that is not alongside.
static double distance_to_part(const struct projected_skeleton *seen, enum part part, double x, double y, double *along)
{
    struct pixel a = seen->pixel[part_ends[part].from], b = seen->pixel[part_ends[part].to];
    double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
    *along = length2 > 0 ? ((x - a.x) * dx + (y - a.y) * dy) / length2 : 0;
    double t = fmax(0, fmin(1, *along));
    return portable_hypot(x - a.x - t * dx, y - a.y - t * dy);
}

// Relative thickness of the parts, as shares of the thickest: half the
// widths of an adult (Drillis and Contini 1966); only decides which of two
// bones a pixel between them belongs to.
static const double thickness[PART_COUNT] = {
    [PART_HEAD] = 0.55,         [PART_UPPER_TORSO] = 1,       [PART_LOWER_TORSO] = 0.95,   [PART_LEFT_UPPER_ARM] = 0.3,
    [PART_LEFT_FOREARM] = 0.25, [PART_RIGHT_UPPER_ARM] = 0.3, [PART_RIGHT_FOREARM] = 0.25, [PART_LEFT_THIGH] = 0.5,
    [PART_LEFT_SHIN] = 0.35,    [PART_RIGHT_THIGH] = 0.5,     [PART_RIGHT_SHIN] = 0.35,
};

// True where no other bone beside the pixel is nearer, in units of the parts' thicknesses: a walk from the torso ends
// where a lowered arm begins.
static bool belongs_to(const struct projected_skeleton *seen, enum part part, double x, double y)
{
    double along, own = distance_to_part(seen, part, x, y, &along) / thickness[part];
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_ends ends = part_ends[p];
        if (p == (int)part || !seen->usable[ends.from] || !seen->usable[ends.to])
            continue;
        double other = distance_to_part(seen, (enum part)p, x, y, &along) / thickness[p];
        if (along >= 0 && along <= 1 && other < own)
            return false;
    }
    return true;
}

// The radius of a cylinder whose axis lies at depth z and whose outline is `half_px` from it in the image: the
// outline's rays touch it, so that it is seen a little wider than the radius at that depth.
static double radius_of_outline(double half_px, double fx, double z)
{
    const double slope = half_px / fx;
    return z * slope / sqrt(1 + slope * slope);
}

// The mean of the middle half: less rounded to whole pixels than the median, and as little moved by outliers. Sorts.
static double middle_mean(double *values, int count)
{
    for (int i = 1; i < count; i++)
        for (int k = i; k > 0 && values[k] < values[k - 1]; k--) {
            const double swap = values[k];
            values[k] = values[k - 1], values[k - 1] = swap;
        }
    const int left = count / 4;
    double sum = 0;
    for (int i = left; i < count - left; i++)
        sum += values[i];
    return sum / (count - 2 * left);
}

struct person_image {
    const struct lens *lens;
    const uint16_t *depth;
    const uint8_t *mask;
};

// Depth of the person at (x, y), millimetres, nearest pixel; 0 outside the mask or the image.
static int person_mm(const struct person_image *image, double x, double y)
{
    int ix = (int)lround(x), iy = (int)lround(y);
    if (ix < 0 || iy < 0 || ix >= image->lens->width || iy >= image->lens->height)
        return 0;
    size_t at = (size_t)iy * (size_t)image->lens->width + (size_t)ix;
    return image->mask[at] ? image->depth[at] : 0;
}

// A walk across a part in the image: from `start` in unit steps of `direction`, pixels.
struct edge_walk {
    enum part part;
    struct pixel start, direction;
    double furthest_px;
};

static bool is_trunk(enum part part) { return part == PART_UPPER_TORSO || part == PART_LOWER_TORSO; }

// Walks to the edge of the part. Returns the pixels walked, or -1 when the image border cuts the part or something
// nearer hides it; a limb also where another one begins: that is no outline of it. Lowered arms leave the trunk no
// other.
static double walk_to_edge(const struct projected_skeleton *seen, const struct person_image *image,
                           const struct edge_walk *walk)
{
    double z = person_mm(image, walk->start.x, walk->start.y) / 1000.0;
    for (double step = 1; step <= walk->furthest_px; step++) {
        double px = walk->start.x + step * walk->direction.x, py = walk->start.y + step * walk->direction.y;
        if (px < 0.5 || py < 0.5 || px > image->lens->width - 1.5 || py > image->lens->height - 1.5)
            return -1;
        int mm = person_mm(image, px, py);
        if (mm && (mm / 1000.0 < z - depth_limb_step_m(z)))
            return is_trunk(walk->part) ? step - 0.5 : -1;
        const bool ends = !mm || mm / 1000.0 > z + depth_limb_step_m(z);
        if (!ends && !belongs_to(seen, walk->part, px, py))
            return is_trunk(walk->part) ? step - 0.5 : -1;
        if (ends)
            return step - 0.5; // the edge lies between this pixel and the last
        z = mm / 1000.0;
    }
    return walk->furthest_px;
}

// Chosen by hand: what lies further off leaves the part's image.
static const double MEASURED_SIGMA_MAX_M = 0.15;

// A joint that is not seen and may be anywhere. One that is only less sure to be right is used: where it is wrong, the
// surface is seldom at the bone's depth along the whole part, which is checked.
static bool is_guessed(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] < 1 && !(joint_sigma_m(skeleton, joint) <= MEASURED_SIGMA_MAX_M);
}

double body_radii_measure_part(const struct calibration *calibration, const struct skeleton *skeleton,
                               const uint16_t *depth, const uint8_t *mask, enum part part)
{
    struct projected_skeleton seen = project_skeleton(calibration, skeleton);
    struct part_ends ends = part_ends[part];
    if (!seen.usable[ends.from] || !seen.usable[ends.to] || is_guessed(skeleton, ends.from) ||
        is_guessed(skeleton, ends.to))
        return 0;
    struct pixel a = seen.pixel[ends.from], b = seen.pixel[ends.to];
    double length_px = portable_hypot(b.x - a.x, b.y - a.y);
    if (length_px < 4) // seen end-on: no rectangle
        return 0;
    double nx = -(b.y - a.y) / length_px, ny = (b.x - a.x) / length_px;
    struct person_image image = {&calibration->depth, depth, mask};
    double radii[SAMPLES];
    int count = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double t = FIRST_SHARE + (LAST_SHARE - FIRST_SHARE) * i / (SAMPLES - 1);
        double x = a.x + t * (b.x - a.x), y = a.y + t * (b.y - a.y);
        int mm = person_mm(&image, x, y);
        double bone_z = seen.joint[ends.from].z + t * (seen.joint[ends.to].z - seen.joint[ends.from].z);
        // The surface here must be this part's: not far from its bone.
        if (!mm || fabs(mm / 1000.0 - bone_z) > RADIUS_MAX_M)
            continue;
        double px_per_m = calibration->depth.fx / bone_z;
        struct edge_walk to_one = {part, {x, y}, {nx, ny}, RADIUS_MAX_M * px_per_m};
        struct edge_walk to_other = {part, {x, y}, {-nx, -ny}, RADIUS_MAX_M * px_per_m};
        double one = walk_to_edge(&seen, &image, &to_one), other = walk_to_edge(&seen, &image, &to_other);
        if (one >= 0 && other >= 0)
            radii[count++] = radius_of_outline((one + other) / 2, calibration->depth.fx, bone_z);
    }
    if (count < SAMPLES_MIN)
        return 0;
    return middle_mean(radii, count);
}

bool body_radii_add_frame(struct body_radii *radii, int64_t index, const struct calibration *calibration,
                          const struct skeleton *skeleton, const uint16_t *depth, const uint8_t *mask)
{
    double value = pose_score(skeleton);
    bool changed = false;
    if (value > radii->best) {
        radii->best = value;
        radii->body.representative_frame = index;
        changed = true;
    }
    for (int p = 0; p < PART_COUNT; p++) {
        if (value <= radii->part_best[p])
            continue;
        double length = v3_distance(skeleton->joint[part_ends[p].from], skeleton->joint[part_ends[p].to]);
        double radius = body_radii_measure_part(calibration, skeleton, depth, mask, (enum part)p);
        if (radius > 0 && length > 0.01) {
            radii->body.radius_rate[p] = radius / length;
            radii->part_best[p] = value;
            changed = true;
        }
    }
    return changed;
}
