#include "capture/coaching/coverage.h"

#include "base/portable_math.h"

#include <string.h>

// ---------------------------------------------------------------- body surface

static const double PI = 3.14159265358979323846;
static const double TRUNK_M = 0.48; // neck to waist of an average adult, as the skeleton has them
// A sample this much farther from every tube than its radius belongs to no part. Chosen by hand: loose clothes.
static const double FAR_M = 0.12;

// Radii of an average adult's clothed parts, metres, chosen by hand; and how far the surface reaches beyond both ends
// of the bone, as shares of its length: the head joint is half-way up the head, the hand is the root of the palm.
// flat: the trunk's depth over its width, by which its front and back face the front more than a tube's do.
static const struct {
    const char *name;
    double radius_m, before, beyond, flat;
} parts[SURFACE_PARTS] = {
    [PART_HEAD] = {"head", 0.095, 0, 1.0, 1},
    [PART_UPPER_TORSO] = {"chest", 0.14, 0.1, 0, 0.65},
    [PART_LOWER_TORSO] = {"belly", 0.14, 0, 0.6, 0.7},
    [PART_LEFT_UPPER_ARM] = {"left upper arm", 0.055, 0.15, 0, 1},
    [PART_LEFT_FOREARM] = {"left forearm", 0.045, 0, 0.65, 1},
    [PART_RIGHT_UPPER_ARM] = {"right upper arm", 0.055, 0.15, 0, 1},
    [PART_RIGHT_FOREARM] = {"right forearm", 0.045, 0, 0.65, 1},
    [PART_LEFT_THIGH] = {"left thigh", 0.085, 0, 0, 1},
    [PART_LEFT_SHIN] = {"left shin", 0.06, 0, 0.1, 1},
    [PART_RIGHT_THIGH] = {"right thigh", 0.085, 0, 0, 1},
    [PART_RIGHT_SHIN] = {"right shin", 0.06, 0, 0.1, 1},
    [SURFACE_LEFT_FOOT] = {"left foot", 0.05, 0.4, 1.0, 1},
    [SURFACE_RIGHT_FOOT] = {"right foot", 0.05, 0.4, 1.0, 1},
};

const char *surface_part_name(int part) { return parts[part].name; }

double surface_default_radius(int part) { return parts[part].radius_m; }

double surface_angle(int angle) { return (angle + 0.5) * 2 * PI / SURFACE_ANGLES; }

static bool is_joint_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0;
}

static struct vec3 perpendicular_component(struct vec3 v, struct vec3 unit)
{
    return v3_sub(v, v3_scale(unit, v3_dot(v, unit)));
}

// The trunk's axes from its joints; `weight` of the shoulders against the hips, since it may be twisted.
static bool trunk_front(const struct skeleton *skeleton, struct vec3 down, double weight, struct vec3 *left,
                        struct vec3 *front)
{
    struct vec3 sum = v3(0, 0, 0);
    if (is_joint_known(skeleton, JOINT_LEFT_SHOULDER) && is_joint_known(skeleton, JOINT_RIGHT_SHOULDER))
        sum = v3_scale(v3_unit(v3_sub(skeleton->joint[JOINT_LEFT_SHOULDER], skeleton->joint[JOINT_RIGHT_SHOULDER])),
                       weight);
    if (is_joint_known(skeleton, JOINT_LEFT_HIP) && is_joint_known(skeleton, JOINT_RIGHT_HIP))
        sum = v3_add(sum, v3_unit(v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP])));
    sum = perpendicular_component(sum, down);
    if (v3_length(sum) < 0.05)
        return false;
    *left = v3_unit(sum);
    *front = v3_cross(down, *left);
    return true;
}

// The frame of a bone whose front is the trunk's, carried over by the shortest rotation.
static struct surface_frame frame_of(struct vec3 from, struct vec3 to, struct vec3 down, struct vec3 front, int part)
{
    struct surface_frame f = {.origin = from};
    const struct vec3 along = v3_sub(to, from);
    f.length = v3_length(along);
    if (f.length < 0.02)
        return f;
    f.z = v3_unit(along);
    const struct vec3 carried = part == PART_HEAD ? front : quat_rotate(quat_between(down, f.z), front);
    f.y = v3_unit(perpendicular_component(carried, f.z));
    f.x = part == PART_HEAD ? v3_cross(f.z, f.y) : v3_cross(f.y, f.z);
    f.from = -parts[part].before * f.length;
    f.to = (1 + parts[part].beyond) * f.length;
    f.known = true;
    return f;
}

// Elbow and knee: which way a bent limb turns about its own axis shows in the plane of its bend. Straight, it does not.
static const struct hinge {
    enum joint root, hinge, tip;
    enum part upper, lower;
    double sign; // +1: the tip swings to the front when the limb bends
} hinges[] = {
    {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM, 1},
    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, PART_RIGHT_UPPER_ARM, PART_RIGHT_FOREARM, 1},
    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, PART_LEFT_THIGH, PART_LEFT_SHIN, -1},
    {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, PART_RIGHT_THIGH, PART_RIGHT_SHIN, -1},
};

static void turn_to(struct surface_frame *frame, struct vec3 front, double share)
{
    frame->y = v3_unit(perpendicular_component(v3_mix(frame->y, front, share), frame->z));
    frame->x = v3_cross(frame->y, frame->z);
}

// Blended in from 15 to 45 degrees of bend, as the direction becomes certain.
static void turn_by_hinge(const struct hinge *hinge, struct surface_pose *out)
{
    struct surface_frame *upper = &out->part[hinge->upper], *lower = &out->part[hinge->lower];
    if (!upper->known || !lower->known)
        return;
    const double bend = portable_acos(fmax(-1, fmin(1, v3_dot(upper->z, lower->z))));
    const double share = fmin(fmax((bend - 0.26) / 0.52, 0), 1);
    if (share <= 0)
        return;
    turn_to(upper, v3_scale(v3_unit(perpendicular_component(lower->z, upper->z)), hinge->sign), share);
    turn_to(lower, v3_scale(v3_unit(perpendicular_component(upper->z, lower->z)), -hinge->sign), share);
}

static void add_foot(const struct skeleton *skeleton, int part, const struct surface_frame *shin, enum joint ankle,
                     struct surface_pose *out)
{
    if (!shin->known || !is_joint_known(skeleton, ankle))
        return;
    // The joint is the ankle; the foot points to the shin's front, 0.13 m to the ball of an average adult's.
    const struct vec3 from = v3_add(skeleton->joint[ankle], v3_scale(shin->z, 0.05 * out->scale)),
                      to = v3_add(from, v3_scale(shin->y, 0.1 * out->scale));
    struct surface_frame f = {.known = true, .origin = from, .z = shin->y, .length = v3_distance(from, to)};
    f.y = v3_scale(shin->z, -1); // the instep is the front, the sole the back
    f.x = v3_cross(f.y, f.z);
    f.from = -parts[part].before * f.length;
    f.to = (1 + parts[part].beyond) * f.length;
    out->part[part] = f;
}

bool surface_pose_of(const struct skeleton *skeleton, struct surface_pose *out)
{
    *out = (struct surface_pose){0};
    if (!is_joint_known(skeleton, JOINT_NECK) || !is_joint_known(skeleton, JOINT_WAIST))
        return false;
    const struct vec3 trunk = v3_sub(skeleton->joint[JOINT_WAIST], skeleton->joint[JOINT_NECK]), down = v3_unit(trunk);
    struct vec3 hip_left, hip_front;
    if (v3_length(trunk) < 0.1 || !trunk_front(skeleton, down, 4, &out->left, &out->front) ||
        !trunk_front(skeleton, down, 0.25, &hip_left, &hip_front))
        return false;
    out->known = true;
    out->up = v3_scale(down, -1);
    out->scale = v3_length(trunk) / TRUNK_M;
    for (int p = 0; p < PART_COUNT; p++) {
        const enum joint from = part_ends[p].from, to = part_ends[p].to;
        const bool lower = p == PART_LOWER_TORSO || p >= PART_LEFT_THIGH;
        if (is_joint_known(skeleton, from) && is_joint_known(skeleton, to))
            out->part[p] =
                frame_of(skeleton->joint[from], skeleton->joint[to], down, lower ? hip_front : out->front, p);
    }
    for (size_t i = 0; i < COUNT_OF(hinges); i++)
        turn_by_hinge(&hinges[i], out);
    add_foot(skeleton, SURFACE_LEFT_FOOT, &out->part[PART_LEFT_SHIN], JOINT_LEFT_FOOT, out);
    add_foot(skeleton, SURFACE_RIGHT_FOOT, &out->part[PART_RIGHT_SHIN], JOINT_RIGHT_FOOT, out);
    return true;
}

// Signed distance of a point from a part's tube; *along: metres from the bone's first joint.
static double tube_distance(const struct surface_frame *frame, double radius, struct vec3 p, double *along)
{
    const struct vec3 v = v3_sub(p, frame->origin);
    *along = v3_dot(v, frame->z);
    const double at = fmin(fmax(*along, frame->from + radius), fmax(frame->to - radius, frame->from + radius));
    return v3_length(v3_sub(v, v3_scale(frame->z, at))) - radius;
}

// The cell at this share of a part's length; what lies beyond an end is in the last cell there.
static int height_of(double share)
{
    if (share <= 0)
        return 0;
    return share >= 1 ? SURFACE_HEIGHTS - 1 : (int)(share * SURFACE_HEIGHTS);
}

// The part whose tube is nearest to the point. False: it is far from all, as a thing in the hand is.
static bool surface_hit_of(const struct surface_pose *pose, struct vec3 p, struct surface_hit *out)
{
    double best = FAR_M * pose->scale, best_along = 0;
    int part = -1;
    for (int k = 0; k < SURFACE_PARTS; k++) {
        double along;
        if (!pose->part[k].known)
            continue;
        const double off = tube_distance(&pose->part[k], parts[k].radius_m * pose->scale, p, &along);
        if (off < best) {
            best = off;
            best_along = along;
            part = k;
        }
    }
    if (part < 0)
        return false;
    const struct surface_frame *f = &pose->part[part];
    const struct vec3 radial = perpendicular_component(v3_sub(p, f->origin), f->z);
    const double angle = portable_atan2(v3_dot(radial, f->x), v3_dot(radial, f->y));
    const double share = (best_along - f->from) / (f->to - f->from);
    out->part = part;
    out->angle = (int)floor(angle / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES) % SURFACE_ANGLES;
    out->height = height_of(share);
    out->radius_m = v3_length(radial);
    // Near a rounded end the surface leans along the bone.
    const double radius = parts[part].radius_m * pose->scale;
    const double beyond = fmax(best_along - (f->to - radius), 0) + fmin(best_along - (f->from + radius), 0);
    const bool rounded = part == PART_HEAD || part >= SURFACE_LEFT_FOOT;
    const double wide = v3_dot(radial, f->x) * (1 - parts[part].flat * parts[part].flat);
    out->outward = v3_unit(v3_add(v3_sub(radial, v3_scale(f->x, wide)), v3_scale(f->z, rounded ? beyond : 0)));
    return true;
}

struct vec3 surface_rest_direction(int part, int height, int angle)
{
    const double a = surface_angle(angle), left = portable_sin(a), front = portable_cos(a);
    if (part < PART_COUNT) {
        const bool crown = part == PART_HEAD && height == SURFACE_HEIGHTS - 1;
        return crown ? v3_unit(v3(0.5 * left, 0.5 * front, 1)) : v3(left, front, 0);
    }
    // A foot lies along the front; its own front is up.
    if (height == SURFACE_HEIGHTS - 1)
        return v3_unit(v3(0.5 * left, 1, 0.5 * front));
    return v3(left, 0, front);
}

// ---------------------------------------------------------------- coverage

static const int MAX_SAMPLES = 3000;
// Pixels a metre of the colour image from which on a view is as fine as the picture shows: an actor of 1.75 m that
// fills 400 lines of a tablet's 640 x 480. Chosen by hand.
static const double FINE_PX_PER_M = 150;
static const double SHARP_PX = 2; // blur up to this costs nothing; the texture atlas has no finer detail

void coverage_reset(struct coverage *coverage) { memset(coverage, 0, sizeof *coverage); }

double coverage_facing(const struct surface_pose *pose)
{
    // From the trunk to the camera, which is at the origin.
    const struct vec3 to_camera = v3_scale(pose->part[PART_UPPER_TORSO].origin, -1);
    return portable_atan2(v3_dot(to_camera, pose->left), v3_dot(to_camera, pose->front));
}

static int angle_sector(double angle)
{
    return (int)floor(angle / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
}

// Every step-th pixel of every step-th row, so that at most MAX_SAMPLES of the mask are read.
static int step_of(const struct lens *lens, const uint8_t *mask)
{
    int count = 0;
    const int pixels = lens->width * lens->height;
    for (int i = 0; i < pixels; i += 7)
        count += mask[i] != 0;
    int step = 1;
    while (count * 7 / (step * step) > MAX_SAMPLES)
        step++;
    return step;
}

static void add_sample(struct coverage *coverage, const struct surface_pose *pose, struct vec3 p, double fineness)
{
    struct surface_hit at;
    if (!surface_hit_of(pose, p, &at))
        return;
    const double cosine = -v3_dot(at.outward, v3_unit(p));
    struct coverage_cell *cell = &coverage->cell[at.part][at.height][at.angle];
    cell->radius_m += (float)at.radius_m;
    cell->samples++;
    if (cosine < COVERAGE_COSINE)
        return;
    cell->views++;
    cell->quality = fmaxf(cell->quality, (float)(cosine * fineness));
}

// Unknown, or so uncertain that the picture shows it: half of what is still called known. Chosen by hand.
static bool is_guessed(const struct skeleton *skeleton, enum joint joint)
{
    const double sigma_m = joint_sigma_m(skeleton, joint);
    return skeleton->confidence[joint] <= 0 ||
           (skeleton->confidence[joint] < 1 && !(sigma_m <= 0.5 * KNOWN_SIGMA_MAX_M));
}

static void add_samples(struct coverage *coverage, const struct coverage_view *view, const struct surface_pose *pose)
{
    const struct calibration *calibration = view->calibration;
    const struct lens *lens = &calibration->depth;
    const double sharpness = view->blur_px > SHARP_PX ? SHARP_PX / view->blur_px : 1;
    const double focal = calibration->color.width > 0 ? calibration->color.fx : lens->fx;
    const int step = step_of(lens, view->mask);
    // Another pixel of each step x step block in every look.
    const int dx = (int)(coverage->looks % (unsigned)step),
              dy = (int)(coverage->looks / (unsigned)step % (unsigned)step);
    for (int y = dy; y < lens->height; y += step)
        for (int x = dx; x < lens->width; x += step) {
            const int i = y * lens->width + x;
            if (!view->mask[i] || !view->depth[i])
                continue;
            const double z = view->depth[i] * 1e-3;
            const struct vec3 ray = v3((x - lens->cx) / lens->fx, (y - lens->cy) / lens->fy, 1);
            const struct vec3 p = pose_apply(calibration->color_from_depth, v3_scale(ray, z));
            add_sample(coverage, pose, p, fmin(1, focal / z / FINE_PX_PER_M) * sharpness);
        }
    coverage->looks++;
}

bool coverage_add(struct coverage *coverage, const struct coverage_view *view)
{
    struct surface_pose pose;
    coverage->frames++;
    for (int j = 0; j < JOINT_COUNT; j++)
        coverage->guessed[j] += is_guessed(view->skeleton, (enum joint)j);
    if (!surface_pose_of(view->skeleton, &pose) || !pose.part[PART_UPPER_TORSO].known)
        return false;
    if (view->depth)
        add_samples(coverage, view, &pose);
    for (int part = 0; part < SURFACE_PARTS; part++)
        if (pose.part[part].known) {
            coverage->length_m[part] += pose.part[part].to - pose.part[part].from;
            coverage->lengths[part]++;
        }
    coverage->facing[angle_sector(coverage_facing(&pose))]++;
    return true;
}

// ---------------------------------------------------------------- the surface

bool coverage_cell_seen(const struct coverage *coverage, int part, int height, int angle)
{
    return coverage->cell[part][height][angle].quality > 0;
}

// Where parts join, their tubes enter one another, and these cells are no surface: the ends towards the trunk, and of
// the trunk the sides where the limbs leave it. As on a body that stands with arms and legs somewhat spread.
static bool inside_another(int part, int height, int angle)
{
    const double a = surface_angle(angle), left = portable_sin(a);
    const bool inner_left = left<-0.5, inner_right = left> 0.5;
    switch (part) {
    case PART_HEAD: return height == 0;                            // the neck in the chest
    case PART_UPPER_TORSO: return height <= 2 && fabs(left) > 0.7; // shoulders
    case PART_LOWER_TORSO: return height == SURFACE_HEIGHTS - 1;   // hips
    case PART_LEFT_UPPER_ARM: return height == 0 && inner_left;    // armpits
    case PART_RIGHT_UPPER_ARM: return height == 0 && inner_right;
    case PART_LEFT_THIGH: return height <= 1 && inner_left; // crotch
    case PART_RIGHT_THIGH: return height <= 1 && inner_right;
    case SURFACE_LEFT_FOOT:
    case SURFACE_RIGHT_FOOT: return height <= 1 && portable_cos(a) > 0.5; // the ankle
    default: return false;
    }
}

double coverage_cell_area(const struct coverage *coverage, int part, int height, int angle)
{
    if (inside_another(part, height, angle) || !coverage->lengths[part])
        return 0;
    const struct coverage_cell *cell = &coverage->cell[part][height][angle];
    double radius = cell->samples ? cell->radius_m / cell->samples : 0;
    if (!cell->samples) { // of the same height's other sides, else an average adult's
        double sum = 0, samples = 0;
        for (int k = 0; k < SURFACE_ANGLES; k++) {
            sum += coverage->cell[part][height][k].radius_m;
            samples += coverage->cell[part][height][k].samples;
        }
        radius = samples > 0 ? sum / samples : surface_default_radius(part);
    }
    return coverage->length_m[part] / coverage->lengths[part] / SURFACE_HEIGHTS * radius * (2 * PI / SURFACE_ANGLES);
}

static int side_of(int angle) { return (angle + SURFACE_ANGLES / 8) % SURFACE_ANGLES / (SURFACE_ANGLES / 4); }

static void sum_part(const struct coverage *coverage, int part, enum coverage_side side, double *seen, double *all)
{
    for (int h = 0; h < SURFACE_HEIGHTS; h++)
        for (int a = 0; a < SURFACE_ANGLES; a++) {
            if (side != COVERAGE_ALL_SIDES && side_of(a) != (int)side)
                continue;
            const double area = coverage_cell_area(coverage, part, h, a);
            *all += area;
            *seen += coverage_cell_seen(coverage, part, h, a) ? area : 0;
        }
}

double coverage_part_share(const struct coverage *coverage, int part, enum coverage_side side)
{
    double seen = 0, all = 0;
    sum_part(coverage, part, side, &seen, &all);
    return all > 0 ? seen / all : 0;
}

double coverage_share(const struct coverage *coverage)
{
    double seen = 0, all = 0;
    for (int part = 0; part < SURFACE_PARTS; part++)
        sum_part(coverage, part, COVERAGE_ALL_SIDES, &seen, &all);
    return all > 0 ? seen / all : 0;
}
