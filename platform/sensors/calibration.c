// calibration.json: the lenses of a folder's camera or sensor, and the lenses stored for tablet cameras.
//
//   { "color": LENS, "depth": LENS, "registered": true,
//     "color_from_depth": { "translation_m": [x, y, z], "rotation": [x, y, z, w] } }
//   LENS: { "width", "height", "fx", "fy", "cx", "cy": numbers (pixels, the
//           centre of the top-left pixel is (0, 0)),
//           "distortion": [k1, k2, p1, p2, k3]   optional; k3 may be left out,
//           "readout_ms": of a rolling shutter, first row to last   optional, 0,
//           "focal_sigma": relative standard deviation of fx and fy   optional, 0,
//           "unit_m": metres per unit of a depth image   optional, 0.001 }
//
// At least one LENS. With both, "registered" says whether depth pixels lie on
// colour pixels; if not, "color_from_depth" is needed. Other
// members are ignored.
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/sensors/source_internal.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The number `name` of the object `what`. ERR_INPUT names both.
static enum status require_number(const struct json *object, const char *what, const char *name, const char *path,
                                  double *out)
{
    const struct json *value = json_member(object, name);
    if (json_get_number(value, out))
        return OK;
    return fail(ERR_INPUT, "%s: the number '%s.%s' is %s", path, what, name, value ? "not a number" : "missing");
}

static enum status need_pixels(const struct json *object, const char *what, const char *name, const char *path,
                               int *out)
{
    double value;
    enum status status = require_number(object, what, name, path, &value);
    if (status != OK)
        return status;
    if (!(value >= 1 && value <= 16384) || value != floor(value))
        return fail(ERR_INPUT, "%s: '%s.%s' is %g, but must be a whole number of pixels from 1 to 16384", path, what,
                    name, value);
    *out = (int)value;
    return OK;
}

// Reads an array of `min` to `max` numbers; those not given stay as they are.
static enum status read_numbers(const struct json *array, const char *what, const char *path, int min, int max,
                                double *out)
{
    int count = json_count(array);
    if (!json_is_array(array) || count < min || count > max)
        return min == max ? fail(ERR_INPUT, "%s: '%s' must be an array of %d numbers", path, what, max)
                          : fail(ERR_INPUT, "%s: '%s' must be an array of %d to %d numbers", path, what, min, max);
    for (int i = 0; i < count; i++)
        if (!json_get_number(json_at(array, i), &out[i]))
            return fail(ERR_INPUT, "%s: number %d of '%s' is not a number", path, i + 1, what);
    return OK;
}

static enum status read_lens(const struct json *object, const char *what, const char *path, struct lens *lens)
{
    if (!json_is_object(object))
        return fail(ERR_INPUT, "%s: '%s' is not an object", path, what);
    enum status status = need_pixels(object, what, "width", path, &lens->width);
    if (status == OK)
        status = need_pixels(object, what, "height", path, &lens->height);
    struct {
        const char *name;
        double *value;
    } numbers[] = {{"fx", &lens->fx}, {"fy", &lens->fy}, {"cx", &lens->cx}, {"cy", &lens->cy}};
    for (size_t i = 0; i < COUNT_OF(numbers) && status == OK; i++)
        status = require_number(object, what, numbers[i].name, path, numbers[i].value);
    const struct json *distortion = json_member(object, "distortion");
    double k[5] = {0};
    if (status == OK && distortion) {
        char name[32];
        snprintf(name, sizeof name, "%s.distortion", what);
        status = read_numbers(distortion, name, path, 4, 5, k);
    }
    lens->k1 = k[0];
    lens->k2 = k[1];
    lens->p1 = k[2];
    lens->p2 = k[3];
    lens->k3 = k[4];
    const struct json *readout = json_member(object, "readout_ms");
    double readout_ms = 0;
    if (status == OK && readout && !json_get_number(readout, &readout_ms))
        status = fail(ERR_INPUT, "%s: '%s.readout_ms' must be a number of milliseconds", path, what);
    lens->readout_s = readout_ms * 1e-3;
    const struct json *sigma = json_member(object, "focal_sigma");
    if (status == OK && sigma && !json_get_number(sigma, &lens->focal_sigma))
        status = fail(ERR_INPUT, "%s: '%s.focal_sigma' must be a number, 0.1 for a focal length unsure by a tenth",
                      path, what);
    if (status == OK && lens_check(lens, what) != OK)
        status = fail(ERR_INPUT, "%s: %s", path, status_message());
    return status;
}

static enum status read_unit(const struct json *depth, const char *path, double *unit_m)
{
    const struct json *unit = json_member(depth, "unit_m");
    if (!unit)
        return OK;
    if (!json_get_number(unit, unit_m) || !(*unit_m >= 1e-6 && *unit_m <= 1))
        return fail(ERR_INPUT, "%s: 'depth.unit_m' must be a length in metres from 0.000001 to 1", path);
    return OK;
}

// The pose of one camera relative to the other; called only where there are two.
static enum status read_relation(const struct json *root, const char *path, struct calibration *out)
{
    if (!json_get_bool(json_member(root, "registered"), &out->registered))
        return fail(ERR_INPUT,
                    "%s: 'registered' must say true or false: whether the depth pixels are the colour camera's", path);
    const struct json *pose = json_member(root, "color_from_depth");
    if (out->registered)
        return OK;
    if (!pose)
        return fail(ERR_INPUT, "%s: 'registered' is false, so 'color_from_depth' is needed, but it is missing", path);
    double t[3], q[4];
    enum status status =
        read_numbers(json_member(pose, "translation_m"), "color_from_depth.translation_m", path, 3, 3, t);
    if (status == OK)
        status = read_numbers(json_member(pose, "rotation"), "color_from_depth.rotation", path, 4, 4, q);
    if (status != OK)
        return status;
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(length - 1) < 1e-2))
        return fail(ERR_INPUT, "%s: 'color_from_depth.rotation' is no unit quaternion (x, y, z, w)", path);
    for (int i = 0; i < 3; i++)
        if (!(fabs(t[i]) <= 100)) // metres; no sensor is that wide
            return fail(ERR_INPUT, "%s: the cameras of 'color_from_depth.translation_m' are %g m apart", path, t[i]);
    out->color_from_depth.rotation = quat_unit((struct quat){q[0], q[1], q[2], q[3]});
    out->color_from_depth.translation = v3(t[0], t[1], t[2]);
    return OK;
}

enum status calibration_read_with_unit(const char *path, struct calibration *out, double *unit_m)
{
    struct calibration c = {.registered = true, .color_from_depth = POSE_IDENTITY};
    double unit = 0.001;
    struct json *root;
    enum status status = json_read(path, &root);
    if (status == ERR_MISSING)
        return fail(ERR_MISSING, "%s is missing; a folder of pictures needs it beside rgb.txt and depth.txt", path);
    if (status != OK)
        return status;
    const struct json *color = json_member(root, "color"), *depth = json_member(root, "depth");
    if (!color && !depth)
        status = fail(ERR_INPUT, "%s describes neither 'color' nor 'depth'", path);
    if (status == OK && color)
        status = read_lens(color, "color", path, &c.color);
    if (status == OK && depth)
        status = read_lens(depth, "depth", path, &c.depth);
    if (status == OK && depth)
        status = read_unit(depth, path, &unit);
    if (status == OK && color && depth)
        status = read_relation(root, path, &c);
    json_free(&root);
    if (status == OK) {
        *out = c;
        *unit_m = unit;
    }
    return status;
}

enum status calibration_read(const char *path, struct calibration *out)
{
    double unit_m;
    return calibration_read_with_unit(path, out, &unit_m);
}

static struct json *add_lens(struct json *root, const char *name, const struct lens *lens)
{
    struct json *object = json_add_object(root, name);
    const struct {
        const char *name;
        double value;
    } numbers[] = {{"width", lens->width},
                   {"height", lens->height},
                   {"fx", lens->fx},
                   {"fy", lens->fy},
                   {"cx", lens->cx},
                   {"cy", lens->cy},
                   {"readout_ms", lens->readout_s * 1e3},
                   {"focal_sigma", lens->focal_sigma}};
    for (size_t i = 0; i < COUNT_OF(numbers); i++)
        json_add_number(object, numbers[i].name, numbers[i].value);
    struct json *distortion = json_add_array(object, "distortion");
    const double coefficients[] = {lens->k1, lens->k2, lens->p1, lens->p2, lens->k3};
    for (size_t i = 0; i < COUNT_OF(coefficients); i++)
        json_push_number(distortion, coefficients[i]);
    return object;
}

void calibration_add_json(struct json *root, const struct calibration *calibration)
{
    if (calibration->color.width)
        add_lens(root, "color", &calibration->color);
    if (calibration->depth.width)
        json_add_number(add_lens(root, "depth", &calibration->depth), "unit_m", 0.001);
    if (calibration->color.width && calibration->depth.width) {
        json_add_bool(root, "registered", calibration->registered);
        struct json *relation = json_add_object(root, "color_from_depth");
        struct json *translation = json_add_array(relation, "translation_m");
        struct json *rotation = json_add_array(relation, "rotation");
        const struct pose *p = &calibration->color_from_depth;
        for (int i = 0; i < 3; i++)
            json_push_number(translation, (&p->translation.x)[i]);
        for (int i = 0; i < 4; i++)
            json_push_number(rotation, (&p->rotation.x)[i]);
    }
}

enum status calibration_write(const char *path, const struct calibration *calibration)
{
    struct json *root = json_new_object();
    calibration_add_json(root, calibration);
    char *text = json_print(root);
    json_free(&root);
    enum status status =
        text ? file_write(path, text, strlen(text)) : fail(ERR_MEMORY, "no memory to write a calibration");
    free(text);
    return status;
}

// ------------------------------------------------------------- tablet cameras

enum status camera_calibration_file(const char *id, char *path, size_t size)
{
    const char *config = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    int length;
    if (config && *config == '/')
        length = snprintf(path, size, "%s/reenact/cameras/", config);
    else
        length = snprintf(path, size, "%s/.config/reenact/cameras/", home ? home : "");
    size_t at = length < 0 ? size : (size_t)length;
    for (; *id && at + sizeof ".json" < size; id++)
        path[at++] = isalnum((unsigned char)*id) || *id == '-' || *id == '.' ? *id : '_';
    if (*id || at + sizeof ".json" >= size)
        return fail(ERR_INPUT, "the path of the camera's calibration is too long");
    snprintf(path + at, size - at, ".json");
    return OK;
}

// The same, its folder made where it is missing. Errors of folder_make, too.
static enum status camera_file_for_writing(const char *id, char *path, size_t size)
{
    const enum status status = camera_calibration_file(id, path, size);
    if (status != OK)
        return status;
    char *slash = strrchr(path, '/');
    *slash = 0;
    const enum status made = folder_make(path);
    *slash = '/';
    return made;
}

enum status camera_lens_read(const char *id, struct lens *out)
{
    char path[4096];
    struct calibration c;
    enum status status = camera_calibration_file(id, path, sizeof path);
    if (status != OK)
        return status;
    if (!file_exists(path))
        return NOTHING;
    status = calibration_read(path, &c);
    if (status == OK && !c.color.width)
        status = fail(ERR_INPUT, "%s does not describe 'color'", path);
    if (status == OK)
        *out = c.color;
    return status;
}

// Lower bound of the focal_sigma that is saved, so that self-calibration in another place can still correct the focal
// length. Chosen by hand.
static const double MIN_SAVED_SIGMA = 0.005;

enum status camera_lens_save(const char *id, const struct lens *lens)
{
    char path[4096];
    enum status status = camera_file_for_writing(id, path, sizeof path);
    if (status != OK)
        return status;
    struct calibration kept = {.color = *lens};
    kept.color.focal_sigma = fmax(MIN_SAVED_SIGMA, lens->focal_sigma);
    return calibration_write(path, &kept);
}

enum status camera_lens_scale(struct lens *lens, int width, int height, const char *id)
{
    double x = (double)width / lens->width, y = (double)height / lens->height;
    if (fabs(x / y - 1) > 0.005)
        return fail(ERR_INPUT,
                    "the camera %s gives pictures of %d x %d, but was calibrated with %d x %d: calibrate it again", id,
                    width, height, lens->width, lens->height);
    lens->fx *= x;
    lens->fy *= y;
    lens->cx = (lens->cx + 0.5) * x - 0.5; // (0, 0) is a pixel's centre
    lens->cy = (lens->cy + 0.5) * y - 0.5;
    lens->width = width;
    lens->height = height;
    return OK;
}

enum status device_calibration_save(const char *id, const struct calibration *calibration)
{
    char path[4096];
    enum status status = camera_file_for_writing(id, path, sizeof path);
    if (status != OK)
        return status;
    return calibration_write(path, calibration);
}

// A lens as it was measured, at the size of the device's images. width 0: it was not.
static enum status take_lens(const struct lens *measured, struct lens *out, const char *id)
{
    if (!measured->width || !out->width)
        return OK;
    struct lens scaled = *measured;
    enum status status = camera_lens_scale(&scaled, out->width, out->height, id);
    if (status == OK)
        *out = scaled;
    return status;
}

enum status device_calibration_apply(const char *id, struct calibration *calibration)
{
    char path[4096];
    struct calibration stored;
    enum status status = camera_calibration_file(id, path, sizeof path);
    if (status != OK)
        return status;
    if (!file_exists(path))
        return OK;
    status = calibration_read(path, &stored);
    if (status == OK)
        status = take_lens(&stored.color, &calibration->color, id);
    if (status == OK)
        status = take_lens(calibration->registered ? &stored.color : &stored.depth, &calibration->depth, id);
    if (status == OK && !calibration->registered && stored.color.width && stored.depth.width && !stored.registered)
        calibration->color_from_depth = stored.color_from_depth;
    return status;
}

// Of fields of view between 50 and 75 degrees.
static const double GUESS_SIGMA = 0.15;

struct lens camera_lens_guess(int width, int height)
{
    double f = 0.5 * width * sqrt(3); // tan 30 degrees is 1 / sqrt 3
    return (struct lens){.width = width,
                         .height = height,
                         .fx = f,
                         .fy = f,
                         .cx = 0.5 * (width - 1),
                         .cy = 0.5 * (height - 1),
                         .focal_sigma = GUESS_SIGMA};
}
