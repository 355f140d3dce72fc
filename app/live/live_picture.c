#include "app/live/live_picture.h"

#include "base/portable_math.h"
#include "base/registered_depth.h"

#include <math.h>
#include <string.h>

// ---------------------------------------------------------------- what hides the actor

// Chosen by hand.
static const double COVER_M = 0.08;  // clothes and hair beyond the limbs
static const double NEARER_M = 0.05; // what is less in front of a limb's axis is taken for touching it
static const double MIN_RADIUS_M = 0.04, TOO_NEAR_M = 0.2;

// One limb seen by the camera.
struct capsule {
    struct vec3 a, b;
    double radius_m;
};

struct box {
    int left, top, right, bottom; // right, bottom: one beyond
};

static void grow(struct box *box, const struct lens *lens, struct vec3 p, double radius_m)
{
    const struct pixel at = lens_project(lens, p);
    const double r = lens->fx * radius_m / p.z + 1;
    box->left = (int)fmax(0, fmin(box->left, floor(at.x - r)));
    box->top = (int)fmax(0, fmin(box->top, floor(at.y - r)));
    box->right = (int)fmin(lens->width, fmax(box->right, ceil(at.x + r)));
    box->bottom = (int)fmin(lens->height, fmax(box->bottom, ceil(at.y + r)));
}

// The depth of the limb's axis where the ray through `ray` (z = 1) comes nearest to it; INFINITY: it passes by.
static double axis_depth(const struct capsule *capsule, struct vec3 ray)
{
    const struct vec3 u = v3_unit(ray), w = v3_sub(capsule->b, capsule->a);
    const double along = v3_dot(w, u), length2 = v3_dot(w, w), across2 = length2 - along * along;
    // Of the points a + t w the one nearest to the line through the origin along u.
    double t = across2 > 1e-9 ? (v3_dot(capsule->a, u) * along - v3_dot(capsule->a, w)) / across2 : 0;
    t = fmin(1, fmax(0, t));
    const struct vec3 p = v3_add(capsule->a, v3_scale(w, t)), off = v3_sub(p, v3_scale(u, v3_dot(p, u)));
    return v3_dot(off, off) <= capsule->radius_m * capsule->radius_m ? p.z : INFINITY;
}

static void draw_limb(const struct lens *lens, const struct capsule *capsule, float *actor)
{
    struct box box = {lens->width, lens->height, 0, 0};
    if (capsule->a.z < TOO_NEAR_M || capsule->b.z < TOO_NEAR_M)
        return;
    grow(&box, lens, capsule->a, capsule->radius_m);
    grow(&box, lens, capsule->b, capsule->radius_m);
    for (int y = box.top; y < box.bottom; y++)
        for (int x = box.left; x < box.right; x++) {
            float *at = &actor[y * lens->width + x];
            // The pinhole's ray: distortion moves it by less than COVER_M.
            const struct vec3 ray = v3((x - lens->cx) / lens->fx, (y - lens->cy) / lens->fy, 1);
            *at = (float)fmin(*at, axis_depth(capsule, ray));
        }
}

// The live depth on the colour camera's pixels, metres; 0: none.
static void depth_on_color(const struct calibration *calibration, const uint16_t *depth, float *out)
{
    const int width = calibration->color.width, height = calibration->color.height;
    if (calibration->registered && !registered_depth_differs(calibration)) {
        for (int i = 0; i < width * height; i++)
            out[i] = (float)depth[i] * 0.001f;
        return;
    }
    memset(out, 0, sizeof *out * (size_t)width * (size_t)height);
    const int reach = (int)ceil(0.5 * calibration->color.fx / calibration->depth.fx);
    for (int i = 0; i < calibration->depth.width * calibration->depth.height; i++) {
        if (!depth[i])
            continue;
        const double z = depth[i] * 0.001;
        const struct vec3 ray = v3((i % calibration->depth.width - calibration->depth.cx) / calibration->depth.fx,
                                   (i / calibration->depth.width - calibration->depth.cy) / calibration->depth.fy, 1);
        const struct vec3 p = pose_apply(calibration->color_from_depth, v3_scale(ray, z));
        if (p.z < TOO_NEAR_M)
            continue;
        const struct pixel at = lens_project(&calibration->color, p);
        for (int y = (int)at.y - reach; y <= (int)at.y + reach; y++)
            for (int x = (int)at.x - reach; x <= (int)at.x + reach; x++)
                if (x >= 0 && y >= 0 && x < width && y < height) {
                    float *to = &out[y * width + x];
                    *to = *to > 0 && *to < (float)p.z ? *to : (float)p.z;
                }
    }
}

int live_occlusion_make(const struct live_occlusion *occlusion, uint8_t *rgba)
{
    const struct lens *lens = &occlusion->calibration->color;
    const int count = lens->width * lens->height;
    float *actor = occlusion->scratch, *live = occlusion->scratch + count;
    for (int i = 0; i < count; i++)
        actor[i] = INFINITY;
    for (int p = 0; p < PART_COUNT; p++) {
        const struct part_ends ends = part_ends[p];
        const struct vec3 a = occlusion->actor->joint[ends.from], b = occlusion->actor->joint[ends.to];
        if (!(occlusion->actor->confidence[ends.from] > 0 && occlusion->actor->confidence[ends.to] > 0))
            continue;
        const double radius_m = fmax(MIN_RADIUS_M, occlusion->body->radius_rate[p] * v3_distance(a, b));
        const struct capsule limb = {a, b, radius_m + COVER_M};
        draw_limb(lens, &limb, actor);
    }
    depth_on_color(occlusion->calibration, occlusion->depth, live);
    int hidden = 0;
    for (int i = 0; i < count; i++) {
        const bool hides = isfinite(actor[i]) && live[i] > 0 && live[i] < actor[i] - NEARER_M;
        const uint8_t *from = occlusion->rgb + 3 * i;
        uint8_t *to = rgba + 4 * i;
        to[0] = hides ? from[0] : 0, to[1] = hides ? from[1] : 0, to[2] = hides ? from[2] : 0;
        to[3] = hides ? 255 : 0;
        hidden += hides;
    }
    return hidden;
}

// ---------------------------------------------------------------- pose figure

// A person's axes, world: x to the left, y ahead, z up.
struct axes {
    struct vec3 left, ahead;
};

static bool axes_of(const struct skeleton *skeleton, double turn_rad, struct axes *out)
{
    if (!(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0))
        return false;
    struct vec3 left = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    left.z = 0;
    if (v3_length(left) < 0.02)
        return false;
    left = v3_unit(left);
    const double c = portable_cos(turn_rad), k = portable_sin(turn_rad);
    out->left = v3(c * left.x - k * left.y, k * left.x + c * left.y, 0);
    out->ahead = v3(out->left.y, -out->left.x, 0);
    return true;
}

static struct vec3 to_world(const struct axes *axes, double x, double y, double z)
{
    return v3_add(v3_add(v3_scale(axes->left, x), v3_scale(axes->ahead, y)), v3(0, 0, z));
}

// A vector turned from one person's axes to another's.
static struct vec3 turned(const struct axes *from, const struct axes *to, struct vec3 v)
{
    return to_world(to, v3_dot(v, from->left), v3_dot(v, from->ahead), v.z);
}

struct bone {
    enum joint from, to;
    enum part part;
    double usual_m; // where the person's own length is not known
};

// From the waist outwards; hips and shoulders are put in between.
static const struct bone trunk[] = {{JOINT_WAIST, JOINT_TORSO, PART_LOWER_TORSO, 0.2},
                                    {JOINT_TORSO, JOINT_NECK, PART_UPPER_TORSO, 0.25},
                                    {JOINT_NECK, JOINT_HEAD, PART_HEAD, 0.2}};
static const struct bone limbs[] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, PART_LEFT_UPPER_ARM, 0.3},
                                    {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, PART_LEFT_FOREARM, 0.26},
                                    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, PART_RIGHT_UPPER_ARM, 0.3},
                                    {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, PART_RIGHT_FOREARM, 0.26},
                                    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, PART_LEFT_THIGH, 0.42},
                                    {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, PART_LEFT_SHIN, 0.42},
                                    {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, PART_RIGHT_THIGH, 0.42},
                                    {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, PART_RIGHT_SHIN, 0.42}};

static void put_bone(const struct skeleton *person, const struct movement_frame *pose, const struct axes *to,
                     const struct bone *bone, struct skeleton *out)
{
    const bool measured = person->confidence[bone->from] > 0 && person->confidence[bone->to] > 0;
    const double length_m = measured ? v3_distance(person->joint[bone->from], person->joint[bone->to]) : bone->usual_m;
    const float *d = pose->direction[bone->part];
    const bool known = (pose->known >> bone->part & 1) && out->confidence[bone->from] > 0;
    out->joint[bone->to] = v3_add(out->joint[bone->from], v3_scale(to_world(to, d[0], d[1], d[2]), length_m));
    out->confidence[bone->to] = known;
}

static void put_hips(const struct skeleton *person, const struct axes *from, const struct axes *to,
                     struct skeleton *out)
{
    const struct vec3 middle = v3_mix(person->joint[JOINT_LEFT_HIP], person->joint[JOINT_RIGHT_HIP], 0.5);
    const struct vec3 waist = person->confidence[JOINT_WAIST] > 0 ? person->joint[JOINT_WAIST] : middle;
    static const enum joint hips[2] = {JOINT_LEFT_HIP, JOINT_RIGHT_HIP};
    out->joint[JOINT_WAIST] = waist;
    out->confidence[JOINT_WAIST] = 1;
    for (int i = 0; i < 2; i++) {
        out->joint[hips[i]] = v3_add(waist, turned(from, to, v3_sub(person->joint[hips[i]], waist)));
        out->confidence[hips[i]] = 1;
    }
}

static void put_shoulders(const struct skeleton *person, const struct movement_frame *pose, const struct axes *to,
                          struct skeleton *out)
{
    const bool measured = person->confidence[JOINT_LEFT_SHOULDER] > 0 && person->confidence[JOINT_RIGHT_SHOULDER] > 0;
    const double width_m =
        measured ? v3_distance(person->joint[JOINT_LEFT_SHOULDER], person->joint[JOINT_RIGHT_SHOULDER]) : 0.36;
    // The shoulders' middle lies below the neck, along the trunk, by as much as the person's.
    const struct vec3 neck = out->joint[JOINT_NECK], down = v3_unit(v3_sub(out->joint[JOINT_TORSO], neck));
    double drop_m = 0;
    if (measured && person->confidence[JOINT_NECK] > 0)
        drop_m = v3_distance(person->joint[JOINT_NECK],
                             v3_mix(person->joint[JOINT_LEFT_SHOULDER], person->joint[JOINT_RIGHT_SHOULDER], 0.5));
    const struct vec3 middle = v3_add(neck, v3_scale(down, drop_m));
    const bool known = pose->known >> PART_COUNT & 1;
    const struct vec3 across =
        known ? to_world(to, pose->shoulders[0], pose->shoulders[1], pose->shoulders[2]) : to->left;
    out->joint[JOINT_LEFT_SHOULDER] = v3_add(middle, v3_scale(across, 0.5 * width_m));
    out->joint[JOINT_RIGHT_SHOULDER] = v3_add(middle, v3_scale(across, -0.5 * width_m));
    out->confidence[JOINT_LEFT_SHOULDER] = out->confidence[JOINT_RIGHT_SHOULDER] = out->confidence[JOINT_NECK];
}

// The height of the lower foot; false: neither is known.
static bool lower_foot(const struct skeleton *skeleton, double *z)
{
    const bool left = skeleton->confidence[JOINT_LEFT_FOOT] > 0, right = skeleton->confidence[JOINT_RIGHT_FOOT] > 0;
    *z = INFINITY;
    if (left)
        *z = skeleton->joint[JOINT_LEFT_FOOT].z;
    if (right)
        *z = fmin(*z, skeleton->joint[JOINT_RIGHT_FOOT].z);
    return left || right;
}

bool pose_figure_make(const struct skeleton *person, const struct movement_frame *now,
                      const struct movement_frame *pose, struct skeleton *out)
{
    struct axes from, to;
    if (!axes_of(person, 0, &from) || !axes_of(person, (double)pose->heading - now->heading, &to))
        return false;
    struct skeleton made = {0};
    put_hips(person, &from, &to, &made);
    for (size_t i = 0; i < COUNT_OF(trunk); i++)
        put_bone(person, pose, &to, &trunk[i], &made);
    put_shoulders(person, pose, &to, &made);
    for (size_t i = 0; i < COUNT_OF(limbs); i++)
        put_bone(person, pose, &to, &limbs[i], &made);
    double stands, floats;
    if (lower_foot(person, &stands) && lower_foot(&made, &floats))
        for (int j = 0; j < JOINT_COUNT; j++)
            made.joint[j].z += stands - floats;
    *out = made;
    return true;
}
