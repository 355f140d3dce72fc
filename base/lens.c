#include "base/lens.h"

#include "base/pixels.h"

bool lens_is_ideal(const struct lens *lens)
{
    return lens->k1 == 0 && lens->k2 == 0 && lens->p1 == 0 && lens->p2 == 0 && lens->k3 == 0;
}

bool lens_equal(const struct lens *a, const struct lens *b)
{
    return a->width == b->width && a->height == b->height && a->fx == b->fx && a->fy == b->fy && a->cx == b->cx &&
           a->cy == b->cy && a->k1 == b->k1 && a->k2 == b->k2 && a->p1 == b->p1 && a->p2 == b->p2 && a->k3 == b->k3;
}

struct lens lens_resized(const struct lens *lens, double share)
{
    const double min_px = 16;
    struct lens l = *lens;
    if (share == 1)
        return l;
    l.width = (int)fmax(fmin(min_px, lens->width), round(lens->width * share));
    l.height = (int)fmax(fmin(min_px, lens->height), round(lens->height * share));
    const double kx = (double)l.width / lens->width, ky = (double)l.height / lens->height;
    l.fx *= kx, l.fy *= ky;
    l.cx = (l.cx + 0.5) * kx - 0.5, l.cy = (l.cy + 0.5) * ky - 0.5; // (0, 0) is a pixel's centre
    return l;
}

// Brown-Conrady on the plane z = 1: (x, y) ideal to distorted.
static void distort_point(const struct lens *lens, double x, double y, double *xd, double *yd)
{
    double r2 = x * x + y * y;
    double radial = 1 + r2 * (lens->k1 + r2 * (lens->k2 + r2 * lens->k3));
    *xd = x * radial + 2 * lens->p1 * x * y + lens->p2 * (r2 + 2 * x * x);
    *yd = y * radial + lens->p1 * (r2 + 2 * y * y) + 2 * lens->p2 * x * y;
}

struct pixel lens_project(const struct lens *lens, struct vec3 p)
{
    double x = p.x / p.z, y = p.y / p.z, xd, yd;
    distort_point(lens, x, y, &xd, &yd);
    return (struct pixel){lens->fx * xd + lens->cx, lens->fy * yd + lens->cy};
}

double lens_max_radius2(const struct lens *lens)
{
    double largest = 0;
    const struct pixel corners[] = {
        {-0.5, -0.5}, {lens->width - 0.5, -0.5}, {-0.5, lens->height - 0.5}, {lens->width - 0.5, lens->height - 0.5}};
    for (int i = 0; i < 4; i++) {
        struct vec3 ray = lens_ray(lens, corners[i]);
        largest = fmax(largest, ray.x * ray.x + ray.y * ray.y);
    }
    return largest * 1.21;
}

struct pixel lens_project_clamped(const struct lens *lens, double largest_r2, struct vec3 p)
{
    double x = p.x / p.z, y = p.y / p.z, r2 = largest_r2;
    if (x * x + y * y <= r2)
        return lens_project(lens, p);
    double radial = 1 + r2 * (lens->k1 + r2 * (lens->k2 + r2 * lens->k3));
    return (struct pixel){lens->fx * x * radial + lens->cx, lens->fy * y * radial + lens->cy};
}

struct vec3 lens_ray(const struct lens *lens, struct pixel px)
{
    double xd = (px.x - lens->cx) / lens->fx, yd = (px.y - lens->cy) / lens->fy;
    if (lens_is_ideal(lens))
        return v3(xd, yd, 1);
    double x = xd, y = yd;
    for (int i = 0; i < 20; i++) {
        double fx, fy;
        distort_point(lens, x, y, &fx, &fy);
        double ex = fx - xd, ey = fy - yd;
        if (ex * ex + ey * ey < 1e-20)
            break;
        // Newton with the analytic Jacobian of distort()
        double r2 = x * x + y * y;
        double radial = 1 + r2 * (lens->k1 + r2 * (lens->k2 + r2 * lens->k3));
        double slope = 2 * (lens->k1 + r2 * (2 * lens->k2 + 3 * r2 * lens->k3)); // d radial / d x = slope * x
        double a = radial + slope * x * x + 2 * lens->p1 * y + 6 * lens->p2 * x;
        double b = slope * x * y + 2 * lens->p1 * x + 2 * lens->p2 * y;
        double d = radial + slope * y * y + 6 * lens->p1 * y + 2 * lens->p2 * x;
        double det = a * d - b * b;
        if (!(fabs(det) > 1e-12))
            break;
        x -= (d * ex - b * ey) / det;
        y -= (a * ey - b * ex) / det;
    }
    return v3(x, y, 1);
}

// Whether the image's rim can be traced back: each of its pixels has a ray that projects to it. Beyond the fold of a
// strong distortion none does, and Newton's method would give some other one.
static bool is_invertible(const struct lens *lens)
{
    enum { ALONG = 8 };
    const double max_px = 0.1;
    if (lens_is_ideal(lens))
        return true;
    for (int i = 0; i < 4 * ALONG; i++) {
        const double along = i / 4 / (double)(ALONG - 1), x = along * (lens->width - 1), y = along * (lens->height - 1);
        const struct pixel rim[4] = {{x, 0}, {x, lens->height - 1}, {0, y}, {lens->width - 1, y}}, at = rim[i % 4];
        const struct vec3 ray = lens_ray(lens, at);
        const struct pixel back = lens_project(lens, ray);
        // On the near side of the fold, distances from the axis grow with the ray's.
        const double out = ray.x * (at.x - lens->cx) / lens->fx + ray.y * (at.y - lens->cy) / lens->fy;
        if (!(fabs(back.x - at.x) <= max_px && fabs(back.y - at.y) <= max_px && out >= 0))
            return false;
    }
    return true;
}

// How far the distortion moves pixels halfway from the centre to the corners. (At the corners themselves a fitted
// polynomial may be anything.)
static bool is_moderate(const struct lens *lens)
{
    const double x = 0.25 * lens->width / lens->fx, y = 0.25 * lens->height / lens->fy, r2 = x * x + y * y;
    const double radial = 1 + r2 * (lens->k1 + r2 * (lens->k2 + r2 * lens->k3));
    return radial >= 1 / LENS_MAX_RADIAL && radial <= LENS_MAX_RADIAL &&
           (fabs(lens->p1) + fabs(lens->p2)) * sqrt(r2) <= LENS_MAX_RADIAL;
}

enum status lens_check(const struct lens *lens, const char *what)
{
    if (!image_size_is_usable(lens->width, lens->height))
        return fail(
            ERR_INPUT,
            "the %s camera's calibration gives a picture of %d x %d pixels; at most %d a side and %d million in "
            "all can be used",
            what, lens->width, lens->height, IMAGE_SIDE_MAX, IMAGE_PIXELS_MAX / 1000000);
    double numbers[] = {lens->fx, lens->fy, lens->cx, lens->cy, lens->k1, lens->k2, lens->p1, lens->p2, lens->k3};
    for (size_t i = 0; i < COUNT_OF(numbers); i++)
        if (!isfinite(numbers[i]))
            return fail(ERR_INPUT, "the %s camera's calibration holds a number that is not finite", what);
    if (!(lens->fx > 0) || !(lens->fy > 0))
        return fail(ERR_INPUT, "the %s camera's focal length must be greater than 0, not %g x %g", what, lens->fx,
                    lens->fy);
    if (!(lens->fx >= LENS_MIN_FOCAL_PX && lens->fy >= LENS_MIN_FOCAL_PX && lens->fx <= LENS_MAX_PX &&
          lens->fy <= LENS_MAX_PX))
        return fail(ERR_INPUT, "the %s camera's focal length is %g x %g pixels, which no lens has", what, lens->fx,
                    lens->fy);
    if (!(fabs(lens->cx) <= LENS_MAX_PX && fabs(lens->cy) <= LENS_MAX_PX))
        return fail(ERR_INPUT,
                    "the %s camera's principal point is %g pixels right and %g below the first, which no "
                    "lens has",
                    what, lens->cx, lens->cy);
    if (!is_moderate(lens))
        return fail(ERR_INPUT, "the %s camera's distortion (%g, %g, %g, %g, %g) is far beyond any lens's", what,
                    lens->k1, lens->k2, lens->p1, lens->p2, lens->k3);
    if (!is_invertible(lens))
        return fail(ERR_INPUT,
                    "the %s camera's distortion folds the image over itself before its rim; check k1, k2, p1, p2, k3",
                    what);
    if (!(lens->readout_s >= 0 && lens->readout_s <= LENS_MAX_READOUT_S))
        return fail(ERR_INPUT, "the %s camera's readout_ms must be from 0 (no rolling shutter) to %g, not %g", what,
                    LENS_MAX_READOUT_S * 1e3, lens->readout_s * 1e3);
    if (!(lens->focal_sigma >= 0 && lens->focal_sigma <= LENS_MAX_FOCAL_SIGMA))
        return fail(ERR_INPUT, "the %s camera's focal_sigma must be from 0 (measured) to %g, not %g", what,
                    LENS_MAX_FOCAL_SIGMA, lens->focal_sigma);
    return OK;
}
