#include "capture/coaching/coverage.h"

#include "base/portable_math.h"

#include <string.h>

static const double PI = 3.14159265358979323846;
static const int MOST_SAMPLES = 3000;
// Pixels a metre of the colour image from which on a view is as fine as the picture shows: an actor of 1.75 m that
// fills 400 lines of a tablet's 640 x 480. Chosen by hand.
static const double FINE_PX_PER_M = 150;
static const double SHARP_PX = 2; // blur up to this costs nothing; the texture atlas has no finer detail

void coverage_reset(struct coverage *c) { memset(c, 0, sizeof *c); }

double coverage_facing(const struct surface_pose *pose)
{
    // From the trunk to the camera, which is at the origin.
    const struct vec3 to_camera = v3_scale(pose->part[PART_UPPER_TORSO].origin, -1);
    return portable_atan2(v3_dot(to_camera, pose->left), v3_dot(to_camera, pose->front));
}

static int sector(double angle)
{
    return (int)floor(angle / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
}

// Every step-th pixel of every step-th row, so that at most MOST_SAMPLES of the mask are read.
static int step_of(const struct lens *lens, const uint8_t *mask)
{
    int count = 0;
    const int pixels = lens->width * lens->height;
    for (int i = 0; i < pixels; i += 7)
        count += mask[i] != 0;
    int step = 1;
    while (count * 7 / (step * step) > MOST_SAMPLES)
        step++;
    return step;
}

static void add_sample(struct coverage *c, const struct surface_pose *pose, struct vec3 p, double fineness)
{
    struct surface_hit at;
    if (!surface_hit_of(pose, p, &at))
        return;
    const double cosine = -v3_dot(at.outward, v3_unit(p));
    struct coverage_cell *cell = &c->cell[at.part][at.height][at.angle];
    cell->radius_m += (float)at.radius_m;
    cell->samples++;
    if (cosine < COVERAGE_COSINE)
        return;
    cell->views++;
    cell->quality = fmaxf(cell->quality, (float)(cosine * fineness));
}

// Unknown, or so uncertain that the picture shows it: half of what is still called known. Chosen by hand.
static bool is_guessed(const struct skeleton *s, enum joint j)
{
    const double sigma_m = joint_sigma_m(s, j);
    return s->confidence[j] <= 0 || (s->confidence[j] < 1 && !(sigma_m <= 0.5 * KNOWN_SIGMA_MAX_M));
}

static void add_samples(struct coverage *c, const struct coverage_view *view, const struct surface_pose *pose)
{
    const struct calibration *k = view->calibration;
    const struct lens *lens = &k->depth;
    const double sharpness = view->blur_px > SHARP_PX ? SHARP_PX / view->blur_px : 1;
    const double focal = k->color.width > 0 ? k->color.fx : lens->fx;
    const int step = step_of(lens, view->mask);
    // Another pixel of each step x step block in every look.
    const int dx = (int)(c->looks % (unsigned)step), dy = (int)(c->looks / (unsigned)step % (unsigned)step);
    for (int y = dy; y < lens->height; y += step)
        for (int x = dx; x < lens->width; x += step) {
            const int i = y * lens->width + x;
            if (!view->mask[i] || !view->depth[i])
                continue;
            const double z = view->depth[i] * 1e-3;
            const struct vec3 ray = v3((x - lens->cx) / lens->fx, (y - lens->cy) / lens->fy, 1);
            const struct vec3 p = pose_apply(k->color_from_depth, v3_scale(ray, z));
            add_sample(c, pose, p, fmin(1, focal / z / FINE_PX_PER_M) * sharpness);
        }
    c->looks++;
}

bool coverage_add(struct coverage *c, const struct coverage_view *view)
{
    struct surface_pose pose;
    if (!surface_pose_of(view->skeleton, &pose) || !pose.part[PART_UPPER_TORSO].known)
        return false;
    if (view->depth)
        add_samples(c, view, &pose);
    for (int part = 0; part < SURFACE_PARTS; part++)
        if (pose.part[part].known) {
            c->length_m[part] += pose.part[part].to - pose.part[part].from;
            c->lengths[part]++;
        }
    for (int j = 0; j < JOINT_COUNT; j++)
        c->guessed[j] += is_guessed(view->skeleton, (enum joint)j);
    c->facing[sector(coverage_facing(&pose))]++;
    c->frames++;
    return true;
}

// ---------------------------------------------------------------- the surface

bool coverage_cell_seen(const struct coverage *c, int part, int height, int angle)
{
    return c->cell[part][height][angle].quality > 0;
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

double coverage_cell_area(const struct coverage *c, int part, int height, int angle)
{
    if (inside_another(part, height, angle) || !c->lengths[part])
        return 0;
    const struct coverage_cell *cell = &c->cell[part][height][angle];
    double radius = cell->samples ? cell->radius_m / cell->samples : 0;
    if (!cell->samples) { // of the same height's other sides, else an average adult's
        double sum = 0, samples = 0;
        for (int k = 0; k < SURFACE_ANGLES; k++) {
            sum += c->cell[part][height][k].radius_m;
            samples += c->cell[part][height][k].samples;
        }
        radius = samples > 0 ? sum / samples : surface_default_radius(part);
    }
    return c->length_m[part] / c->lengths[part] / SURFACE_HEIGHTS * radius * (2 * PI / SURFACE_ANGLES);
}

static int side_of(int angle) { return (angle + SURFACE_ANGLES / 8) % SURFACE_ANGLES / (SURFACE_ANGLES / 4); }

static void sum_part(const struct coverage *c, int part, enum coverage_side side, double *seen, double *all)
{
    for (int h = 0; h < SURFACE_HEIGHTS; h++)
        for (int a = 0; a < SURFACE_ANGLES; a++) {
            if (side != COVERAGE_ALL_SIDES && side_of(a) != (int)side)
                continue;
            const double area = coverage_cell_area(c, part, h, a);
            *all += area;
            *seen += coverage_cell_seen(c, part, h, a) ? area : 0;
        }
}

double coverage_part_share(const struct coverage *c, int part, enum coverage_side side)
{
    double seen = 0, all = 0;
    sum_part(c, part, side, &seen, &all);
    return all > 0 ? seen / all : 0;
}

double coverage_share(const struct coverage *c)
{
    double seen = 0, all = 0;
    for (int part = 0; part < SURFACE_PARTS; part++)
        sum_part(c, part, COVERAGE_ALL_SIDES, &seen, &all);
    return all > 0 ? seen / all : 0;
}
