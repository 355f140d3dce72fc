#include "tests/support/skeleton_drawing.h"

#include <math.h>
#include <string.h>

static uint8_t *pixel_at(const struct drawing *d, int x, int y)
{
    return d->rgb + 3 * ((size_t)y * (size_t)d->stride + (size_t)x);
}

void drawing_put_depth(const struct drawing *d, const struct lens *lens, const uint16_t *depth,
                       const struct drawn_window *w)
{
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++) {
            const int column = (int)fmin(lens->width - 1, w->x0 + x / w->scale);
            const int row = (int)fmin(lens->height - 1, w->y0 + y / w->scale);
            const int mm = depth[(size_t)row * (size_t)lens->width + (size_t)column];
            memset(pixel_at(d, x, y), mm ? (int)fmax(30, 230 - 0.035 * mm) : 0, 3);
        }
}

void drawing_put_line(const struct drawing *d, struct pixel a, struct pixel b, double radius, const uint8_t rgb[3])
{
    const double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
    const int x0 = (int)fmax(0, fmin(a.x, b.x) - radius - 1), x1 = (int)fmin(d->width - 1, fmax(a.x, b.x) + radius + 1);
    const int y0 = (int)fmax(0, fmin(a.y, b.y) - radius - 1),
              y1 = (int)fmin(d->height - 1, fmax(a.y, b.y) + radius + 1);
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            double t = length2 > 0 ? ((x - a.x) * dx + (y - a.y) * dy) / length2 : 0;
            t = fmin(1, fmax(0, t));
            const double cover = fmin(1, radius + 0.5 - hypot(x - a.x - t * dx, y - a.y - t * dy));
            uint8_t *to = pixel_at(d, x, y);
            for (int k = 0; k < 3 && cover > 0; k++)
                to[k] = (uint8_t)lround(to[k] + cover * (rgb[k] - to[k]));
        }
}

// false: unknown, or so far outside that its line says nothing.
static bool place_joint(const struct drawing *d, const struct lens *lens, const struct skeleton *s, enum joint j,
                        const struct drawn_window *w, struct pixel *out)
{
    if (!(s->confidence[j] > 0) || !(s->joint[j].z > 0.1))
        return false;
    *out = lens_project(lens, s->joint[j]);
    out->x = (out->x + 0.5 - w->x0) * w->scale - 0.5;
    out->y = (out->y + 0.5 - w->y0) * w->scale - 0.5;
    return fabs(out->x) < 10 * d->width && fabs(out->y) < 10 * d->height;
}

static const uint8_t *color_of(enum joint j)
{
    static const uint8_t left[3] = {255, 140, 0}, right[3] = {40, 120, 255}, middle[3] = {40, 190, 60};
    const char *name = joint_name(j);
    return !strncmp(name, "left_", 5) ? left : !strncmp(name, "right_", 6) ? right : middle;
}

void drawing_put_skeleton(const struct drawing *d, const struct lens *lens, const struct skeleton *s,
                          const struct drawn_window *w, bool truth)
{
    static const uint8_t white[3] = {255, 255, 255};
    static const enum joint bone[][2] = {
        {JOINT_NECK, JOINT_HEAD},
        {JOINT_NECK, JOINT_TORSO},
        {JOINT_TORSO, JOINT_WAIST},
        {JOINT_NECK, JOINT_LEFT_SHOULDER},
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
        {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
        {JOINT_NECK, JOINT_RIGHT_SHOULDER},
        {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
        {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
        {JOINT_WAIST, JOINT_LEFT_HIP},
        {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
        {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
        {JOINT_WAIST, JOINT_RIGHT_HIP},
        {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
        {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
    };
    for (size_t k = 0; k < COUNT_OF(bone); k++) {
        const enum joint a = bone[k][0], b = bone[k][1];
        struct pixel from, to;
        if (!place_joint(d, lens, s, a, w, &from) || !place_joint(d, lens, s, b, w, &to))
            continue;
        const bool sure = s->confidence[a] >= 1 && s->confidence[b] >= 1;
        drawing_put_line(d, from, to, truth ? 0.4 : sure ? 1.5 : 0.7, truth ? white : color_of(b));
        drawing_put_line(d, to, to, truth ? 1 : s->confidence[b] >= 1 ? 3 : 1.7, truth ? white : color_of(b));
    }
}
