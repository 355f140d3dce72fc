#include "app/live/live_occlusion.h"

#include <math.h>
#include <string.h>

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
    if (calibration->registered) {
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
