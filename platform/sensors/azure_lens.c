#include "platform/sensors/azure_lens.h"

#include "base/linear_algebra.h"
#include "base/pixels.h"
#include "platform/files/json.h"

#include <stdlib.h>
#include <string.h>

enum { PARAMETERS = 14, FIT_SAMPLES = 256, FIT_UNKNOWNS = 4 };

// A ray further out than this is none of the lens's, unless the calibration says otherwise: 120 degrees of view.
static const double DEFAULT_RADIUS = 1.7;

// In pixels of the mode's image, (0, 0) the centre of its first.
struct rational {
    int width, height;
    double fx, fy, cx, cy;
    double k[6], p1, p2;
    double max_r; // of the rays it is valid for
};

// ------------------------------------------------------------- the sensor's lens

static double radial_factor(const struct rational *l, double r2)
{
    const double *k = l->k;
    const double over = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2])), under = 1 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    return under != 0 ? over / under : over;
}

static struct pixel project(const struct rational *l, double x, double y)
{
    const double r2 = x * x + y * y, radial = radial_factor(l, r2);
    const double xd = x * radial + 2 * l->p1 * x * y + l->p2 * (r2 + 2 * x * x);
    const double yd = y * radial + l->p1 * (r2 + 2 * y * y) + 2 * l->p2 * x * y;
    return (struct pixel){l->fx * xd + l->cx, l->fy * yd + l->cy};
}

// The ray's distance from the axis (on the plane z = 1) whose image is `distorted` from the principal point: where the
// factor times r first reaches it, no further than max_r.
static double undistorted_radius(const struct rational *l, double distorted)
{
    enum { STEPS = 4096 };
    double last = 0;
    for (int i = 1; i <= STEPS; i++) {
        const double r = l->max_r * i / STEPS, out = r * radial_factor(l, r * r);
        if (out >= distorted)
            return out > last ? l->max_r * (i - 1 + (distorted - last) / (out - last)) / STEPS : r;
        if (out < last) // the distortion folds
            return l->max_r * (i - 1) / STEPS;
        last = out;
    }
    return l->max_r;
}

// The radius of the image's farthest corner.
static double image_radius(const struct rational *l)
{
    double largest = 0;
    for (int i = 0; i < 4; i++) {
        const double x = ((i % 2 ? l->width : 0) - 0.5 - l->cx) / l->fx;
        const double y = ((i / 2 ? l->height : 0) - 0.5 - l->cy) / l->fy;
        largest = fmax(largest, undistorted_radius(l, sqrt(x * x + y * y)));
    }
    return largest;
}

// ------------------------------------------------------------- ours

// c[0] + c[1] s + c[2] s^2 + c[3] s^3 for the factor, s = (r / R)^2, by least squares of pixels over the image's area.
// Returns the greatest deviation in pixels, infinite where there is no fit.
static double fit_polynomial(const struct rational *l, double radius, double c[FIT_UNKNOWNS])
{
    double a[FIT_UNKNOWNS * FIT_UNKNOWNS] = {0}, b[FIT_UNKNOWNS] = {0}, worst = 0;
    for (int i = 1; i <= FIT_SAMPLES; i++) {
        const double t = (double)i / FIT_SAMPLES, s = t * t, row[FIT_UNKNOWNS] = {1, s, s * s, s * s * s};
        const double weight = t * t * t, factor = radial_factor(l, s * radius * radius); // pixels^2 and a ring's area
        for (int j = 0; j < FIT_UNKNOWNS; j++) {
            b[j] += weight * row[j] * factor;
            for (int k = 0; k < FIT_UNKNOWNS; k++)
                a[j * FIT_UNKNOWNS + k] += weight * row[j] * row[k];
        }
    }
    if (!cholesky_factor(a, FIT_UNKNOWNS))
        return INFINITY;
    cholesky_solve(a, FIT_UNKNOWNS, b);
    memcpy(c, b, sizeof b);
    for (int i = 1; i <= FIT_SAMPLES; i++) {
        const double r = radius * i / FIT_SAMPLES, s = r * r / (radius * radius);
        const double off = c[0] + s * (c[1] + s * (c[2] + s * c[3])) - radial_factor(l, r * r);
        worst = fmax(worst, fabs(off) * r * fmax(l->fx, l->fy));
    }
    return worst;
}

// The lens with that polynomial; the focal length takes its constant.
static struct lens polynomial_lens(const struct rational *l, double radius, const double c[FIT_UNKNOWNS])
{
    const double r2 = radius * radius;
    return (struct lens){.width = l->width,
                         .height = l->height,
                         .fx = l->fx * c[0],
                         .fy = l->fy * c[0],
                         .cx = l->cx,
                         .cy = l->cy,
                         .k1 = c[1] / c[0] / r2,
                         .k2 = c[2] / c[0] / (r2 * r2),
                         .k3 = c[3] / c[0] / (r2 * r2 * r2),
                         .p1 = l->p1 / c[0],
                         .p2 = l->p2 / c[0]};
}

// A pinhole that sees what the image's sides see beside the principal point.
static struct lens pinhole_lens(const struct rational *l)
{
    const double left = l->cx + 0.5, right = l->width - 0.5 - l->cx, up = l->cy + 0.5, down = l->height - 0.5 - l->cy;
    const double fx = fmin(left / undistorted_radius(l, left / l->fx), right / undistorted_radius(l, right / l->fx));
    const double fy = fmin(up / undistorted_radius(l, up / l->fy), down / undistorted_radius(l, down / l->fy));
    const double share = fmin(fx / l->fx, fy / l->fy); // pixels stay as square as they were
    return (struct lens){
        .width = l->width, .height = l->height, .fx = share * l->fx, .fy = share * l->fy, .cx = l->cx, .cy = l->cy};
}

static enum status fill_remap(const struct rational *l, const struct lens *lens, struct azure_remap *out)
{
    out->from = malloc(2 * (size_t)l->width * (size_t)l->height * sizeof *out->from);
    if (!out->from)
        return fail(ERR_MEMORY, "no memory to rectify the images of an Azure Kinect");
    float *at = out->from;
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++, at += 2) {
            const double rx = (x - lens->cx) / lens->fx, ry = (y - lens->cy) / lens->fy;
            const struct pixel from = project(l, rx, ry);
            const bool inside = rx * rx + ry * ry <= l->max_r * l->max_r && from.x >= 0 && from.y >= 0 &&
                                from.x <= l->width - 1 && from.y <= l->height - 1;
            at[0] = inside ? (float)from.x : -1;
            at[1] = inside ? (float)from.y : -1;
        }
    return OK;
}

static enum status make_lens(const struct rational *l, const char *what, const char *name, struct lens *lens,
                             struct azure_remap *remap)
{
    const double radius = image_radius(l);
    double c[FIT_UNKNOWNS];
    *remap = (struct azure_remap){.width = l->width, .height = l->height};
    const bool fits = radius > 0 && fit_polynomial(l, radius, c) <= AZURE_FIT_PX && c[0] > 0;
    if (fits) {
        *lens = polynomial_lens(l, radius, c);
        if (lens_check(lens, what) == OK)
            return OK;
    }
    *lens = pinhole_lens(l);
    if (lens_check(lens, what) != OK)
        return fail(ERR_INPUT, "%s: %s", name, status_message());
    return fill_remap(l, lens, remap);
}

// ------------------------------------------------------------- reading

// The part of the chip that a mode takes: of an image of `full` pixels, `width` x `height` from `left`, `top`.
struct mode {
    int width, height, full_width, full_height, left, top;
};

static bool depth_mode_of(const int size[2], struct mode *out)
{
    static const struct mode modes[] = {
        {320, 288, 512, 512, 96, 90},     // NFOV_2X2BINNED
        {640, 576, 1024, 1024, 192, 180}, // NFOV_UNBINNED
        {512, 512, 512, 512, 0, 0},       // WFOV_2X2BINNED
        {1024, 1024, 1024, 1024, 0, 0},   // WFOV_UNBINNED
    };
    for (size_t i = 0; i < COUNT_OF(modes); i++)
        if (modes[i].width == size[0] && modes[i].height == size[1]) {
            *out = modes[i];
            return true;
        }
    return false;
}

// All colour modes have the chip's whole width, and its middle rows.
static bool color_mode_of(const int size[2], struct mode *out)
{
    const int full = size[0] / 4 * 3;
    if (size[0] < 4 || size[0] % 4 || size[1] < 1 || size[1] > full || (full - size[1]) % 2 ||
        !image_size_is_usable(size[0], full))
        return false;
    *out = (struct mode){size[0], size[1], size[0], full, 0, (full - size[1]) / 2};
    return true;
}

static enum status read_array(const struct json *array, const char *what, const char *name, int count, double *out)
{
    if (json_count(array) < count || !json_is_array(array))
        return fail(ERR_INPUT, "%s: '%s' of a camera must be an array of %d numbers", name, what, count);
    for (int i = 0; i < count; i++)
        if (!json_get_number(json_at(array, i), &out[i]))
            return fail(ERR_INPUT, "%s: number %d of '%s' of a camera is not a number", name, i + 1, what);
    return OK;
}

// camera_from_reference: "Rt", a row-major matrix and metres.
static enum status read_pose(const struct json *camera, const char *name, struct pose *out)
{
    double m[9], t[3], rotation[3][3];
    const struct json *rt = json_member(camera, "Rt");
    enum status status = read_array(json_member(rt, "Rotation"), "Rt.Rotation", name, 9, m);
    if (status == OK)
        status = read_array(json_member(rt, "Translation"), "Rt.Translation", name, 3, t);
    if (status != OK)
        return status;
    for (int i = 0; i < 9; i++)
        rotation[i / 3][i % 3] = m[i];
    if (!matrix_is_rotation(rotation, 1e-2))
        return fail(ERR_INPUT, "%s: 'Rt.Rotation' of a camera is no rotation", name);
    for (int i = 0; i < 3; i++)
        if (!(fabs(t[i]) <= 100)) // metres; no sensor is that wide
            return fail(ERR_INPUT, "%s: the cameras are %g m apart", name, t[i]);
    *out = (struct pose){quat_unit(quat_from_matrix(rotation)), v3(t[0], t[1], t[2])};
    return OK;
}

// Normalised parameters times the chip's size in the mode, less what the mode crops.
static void scale_to_mode(const double v[PARAMETERS], const struct mode *mode, struct rational *out)
{
    *out = (struct rational){.width = mode->width,
                             .height = mode->height,
                             .fx = v[2] * mode->full_width,
                             .fy = v[3] * mode->full_height,
                             .cx = v[0] * mode->full_width - mode->left - 0.5, // normalised ones begin at a corner
                             .cy = v[1] * mode->full_height - mode->top - 0.5,
                             .p2 = v[12],
                             .p1 = v[13]};
    memcpy(out->k, &v[4], sizeof out->k);
}

// Early sensors calibrated 16:9 of colour's 4:3; to the whole.
static void widen(double v[PARAMETERS])
{
    v[1] = (v[1] * 2304 + 384) / 3072;
    v[3] = v[3] * 2304 / 3072;
}

static enum status read_camera(const struct json *camera, const char *name, bool is_color, const struct mode *mode,
                               struct rational *out, struct pose *pose)
{
    const char *type = "";
    double v[PARAMETERS], width, height, radius = 0;
    const struct json *intrinsics = json_member(camera, "Intrinsics");
    json_get_string(json_member(intrinsics, "ModelType"), &type);
    const bool brown = !strcmp(type, "CALIBRATION_LensDistortionModelBrownConrady");
    if (!brown && strcmp(type, "CALIBRATION_LensDistortionModelRational6KT") != 0)
        return fail(ERR_INPUT, "%s: a camera's lens model '%.60s' is not known", name, type);
    enum status status = read_array(json_member(intrinsics, "ModelParameters"), "ModelParameters", name, PARAMETERS, v);
    if (status == OK)
        status = json_need_number(camera, "SensorWidth", name, &width);
    if (status == OK)
        status = json_need_number(camera, "SensorHeight", name, &height);
    if (status == OK)
        status = read_pose(camera, name, pose);
    if (status != OK)
        return status;
    if (!(v[2] > 0 && v[3] > 0))
        return fail(ERR_INPUT, "%s: a camera's focal length must be greater than 0", name);
    if (v[10] != 0 || v[11] != 0)
        return fail(ERR_INPUT, "%s: a camera's distortion has a centre of its own, which is not supported", name);
    if (!brown) // the same terms without their factor of two
        v[12] /= 2, v[13] /= 2;
    if (is_color && fabs(width * 9 - height * 16) < 16)
        widen(v);
    scale_to_mode(v, mode, out);
    json_get_number(json_member(camera, "MetricRadius"), &radius);
    out->max_r = radius > 1e-4 && radius < 100 ? radius : DEFAULT_RADIUS;
    return OK;
}

static const struct json *find_camera(const struct json *root, const char *location)
{
    const struct json *cameras = json_member(json_member(root, "CalibrationInformation"), "Cameras");
    for (const struct json *c = json_first(cameras); c; c = json_next(c)) {
        const char *text;
        if (json_get_string(json_member(c, "Location"), &text) && !strcmp(text, location))
            return c;
    }
    return NULL;
}

// One camera, from the JSON to its lens.
static enum status take_camera(const struct json *root, const char *name, bool is_color, const int size[2],
                               struct azure_calibration *out, struct pose *pose)
{
    const char *what = is_color ? "color" : "depth";
    const struct json *camera =
        find_camera(root, is_color ? "CALIBRATION_CameraLocationPV0" : "CALIBRATION_CameraLocationD0");
    struct mode mode;
    struct rational l = {0};
    if (!camera)
        return fail(ERR_INPUT, "%s says nothing of the %s camera of an Azure Kinect", name, what);
    if (!(is_color ? color_mode_of(size, &mode) : depth_mode_of(size, &mode)))
        return fail(ERR_INPUT, "%s: no mode of an Azure Kinect gives %s of %d x %d pixels", name, what, size[0],
                    size[1]);
    enum status status = read_camera(camera, name, is_color, &mode, &l, pose);
    if (status == OK)
        status = make_lens(&l, what, name, is_color ? &out->lenses.color : &out->lenses.depth,
                           is_color ? &out->color : &out->depth);
    return status;
}

enum status azure_calibration_parse(const char *json, size_t count, const char *name, const int color[2],
                                    const int depth[2], struct azure_calibration *out)
{
    struct json *root;
    struct pose color_from_reference = POSE_IDENTITY, depth_from_reference = POSE_IDENTITY;
    *out = (struct azure_calibration){.lenses.color_from_depth = POSE_IDENTITY};
    while (count && !json[count - 1]) // the recorder keeps C's terminator
        count--;
    enum status status = json_parse(json, count, name, &root);
    if (status != OK)
        return status;
    if (depth[0])
        status = take_camera(root, name, false, depth, out, &depth_from_reference);
    if (status == OK && color[0])
        status = take_camera(root, name, true, color, out, &color_from_reference);
    json_free(&root);
    if (status == OK && color[0] && depth[0])
        out->lenses.color_from_depth = pose_multiply(color_from_reference, pose_inverse(depth_from_reference));
    out->lenses.registered = !color[0] || !depth[0];
    if (status != OK)
        azure_calibration_free(out);
    return status;
}

void azure_calibration_free(struct azure_calibration *c)
{
    free(c->color.from);
    free(c->depth.from);
    *c = (struct azure_calibration){0};
}

// ------------------------------------------------------------- images

void azure_remap_color(const struct azure_remap *remap, const uint8_t *in, uint8_t *out)
{
    const size_t area = (size_t)remap->width * (size_t)remap->height, row = 3 * (size_t)remap->width;
    for (size_t i = 0; i < area; i++, out += 3) {
        const float x = remap->from[2 * i], y = remap->from[2 * i + 1];
        if (x < 0) {
            memset(out, 0, 3);
            continue;
        }
        const int left = (int)x, top = (int)y;
        const float fx = x - (float)left, fy = y - (float)top;
        const uint8_t *a = in + (size_t)top * row + 3 * (size_t)left;
        const size_t right = left + 1 < remap->width ? 3 : 0, below = top + 1 < remap->height ? row : 0;
        for (size_t k = 0; k < 3; k++) {
            const float above = (float)a[k] + fx * (float)(a[k + right] - a[k]);
            const float under = (float)a[k + below] + fx * (float)(a[k + below + right] - a[k + below]);
            out[k] = (uint8_t)(above + fy * (under - above) + 0.5f);
        }
    }
}

void azure_remap_depth(const struct azure_remap *remap, const uint16_t *in, uint16_t *out)
{
    const size_t area = (size_t)remap->width * (size_t)remap->height;
    for (size_t i = 0; i < area; i++) {
        const float x = remap->from[2 * i], y = remap->from[2 * i + 1];
        out[i] = x < 0 ? 0 : in[(size_t)(y + 0.5f) * (size_t)remap->width + (size_t)(x + 0.5f)];
    }
}
