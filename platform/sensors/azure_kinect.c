// Recordings of an Azure Kinect (k4arecorder's .mkv) as a sensor, mkv:FILE, through FFmpeg's libraries; an optional
// part of the build.
//
// The file is Matroska (Azure Kinect Sensor SDK, "record file format"): the tracks COLOR (MJPEG, NV12, YUY2 or BGRA)
// and DEPTH (16 bits, big-endian, millimetres; FourCC b16g), found by their K4A_..._TRACK tags or names, the attachment
// calibration.json (azure_kinect.h), and the tag K4A_DEPTH_DELAY_NS, by which depth was exposed after colour. Infrared,
// motion and what else is there are passed over.
//
// A frame is a depth image with the colour image nearest in time, delay allowed for, at most half a frame apart. Depth
// is not registered to colour: each has its lens, and color_from_depth lies between them. Colour that is JPEG is handed
// on as it is, where the lens allows. Images without a time, or not later than the one before, are counted as dropped.
#include "platform/sensors/azure_kinect.h"

#include "base/linear_algebra.h"
#include "base/pixels.h"
#include "platform/files/json.h"
#include "platform/sensors/source_internal.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- azure lens

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

static double radial_factor(const struct rational *rational, double r2)
{
    const double *k = rational->k;
    const double over = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2])), under = 1 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    return under != 0 ? over / under : over;
}

static struct pixel project_point(const struct rational *rational, double x, double y)
{
    const double r2 = x * x + y * y, radial = radial_factor(rational, r2);
    const double xd = x * radial + 2 * rational->p1 * x * y + rational->p2 * (r2 + 2 * x * x);
    const double yd = y * radial + rational->p1 * (r2 + 2 * y * y) + 2 * rational->p2 * x * y;
    return (struct pixel){rational->fx * xd + rational->cx, rational->fy * yd + rational->cy};
}

// The ray's distance from the axis (on the plane z = 1) whose image is `distorted` from the principal point: where the
// factor times r first reaches it, no further than max_r.
static double undistorted_radius(const struct rational *rational, double distorted)
{
    enum { STEPS = 4096 };
    double last = 0;
    for (int i = 1; i <= STEPS; i++) {
        const double r = rational->max_r * i / STEPS, out = r * radial_factor(rational, r * r);
        if (out >= distorted)
            return out > last ? rational->max_r * (i - 1 + (distorted - last) / (out - last)) / STEPS : r;
        if (out < last) // the distortion folds
            return rational->max_r * (i - 1) / STEPS;
        last = out;
    }
    return rational->max_r;
}

// The radius of the image's farthest corner.
static double image_radius(const struct rational *rational)
{
    double largest = 0;
    for (int i = 0; i < 4; i++) {
        const double x = ((i % 2 ? rational->width : 0) - 0.5 - rational->cx) / rational->fx;
        const double y = ((i / 2 ? rational->height : 0) - 0.5 - rational->cy) / rational->fy;
        largest = fmax(largest, undistorted_radius(rational, sqrt(x * x + y * y)));
    }
    return largest;
}

// ------------------------------------------------------------- ours

// c[0] + c[1] s + c[2] s^2 + c[3] s^3 for the factor, s = (r / R)^2, by least squares of pixels over the image's area.
// Returns the greatest deviation in pixels, infinite where there is no fit.
static double fit_polynomial(const struct rational *rational, double radius, double c[FIT_UNKNOWNS])
{
    double a[FIT_UNKNOWNS * FIT_UNKNOWNS] = {0}, b[FIT_UNKNOWNS] = {0}, worst = 0;
    for (int i = 1; i <= FIT_SAMPLES; i++) {
        const double t = (double)i / FIT_SAMPLES, s = t * t, row[FIT_UNKNOWNS] = {1, s, s * s, s * s * s};
        const double weight = t * t * t,
                     factor = radial_factor(rational, s * radius * radius); // pixels^2 and a ring's area
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
        const double off = c[0] + s * (c[1] + s * (c[2] + s * c[3])) - radial_factor(rational, r * r);
        worst = fmax(worst, fabs(off) * r * fmax(rational->fx, rational->fy));
    }
    return worst;
}

// The lens with that polynomial; the focal length takes its constant.
static struct lens polynomial_lens(const struct rational *rational, double radius, const double c[FIT_UNKNOWNS])
{
    const double r2 = radius * radius;
    return (struct lens){.width = rational->width,
                         .height = rational->height,
                         .fx = rational->fx * c[0],
                         .fy = rational->fy * c[0],
                         .cx = rational->cx,
                         .cy = rational->cy,
                         .k1 = c[1] / c[0] / r2,
                         .k2 = c[2] / c[0] / (r2 * r2),
                         .k3 = c[3] / c[0] / (r2 * r2 * r2),
                         .p1 = rational->p1 / c[0],
                         .p2 = rational->p2 / c[0]};
}

// A pinhole that sees what the image's sides see beside the principal point.
static struct lens pinhole_lens(const struct rational *rational)
{
    const double left = rational->cx + 0.5, right = rational->width - 0.5 - rational->cx, up = rational->cy + 0.5,
                 down = rational->height - 0.5 - rational->cy;
    const double fx = fmin(left / undistorted_radius(rational, left / rational->fx),
                           right / undistorted_radius(rational, right / rational->fx));
    const double fy = fmin(up / undistorted_radius(rational, up / rational->fy),
                           down / undistorted_radius(rational, down / rational->fy));
    const double share = fmin(fx / rational->fx, fy / rational->fy); // pixels stay as square as they were
    return (struct lens){.width = rational->width,
                         .height = rational->height,
                         .fx = share * rational->fx,
                         .fy = share * rational->fy,
                         .cx = rational->cx,
                         .cy = rational->cy};
}

static enum status fill_remap(const struct rational *rational, const struct lens *lens, struct azure_remap *out)
{
    out->from = malloc(2 * (size_t)rational->width * (size_t)rational->height * sizeof *out->from);
    if (!out->from)
        return fail(ERR_MEMORY, "no memory to rectify the images of an Azure Kinect");
    float *at = out->from;
    for (int y = 0; y < rational->height; y++)
        for (int x = 0; x < rational->width; x++, at += 2) {
            const double rx = (x - lens->cx) / lens->fx, ry = (y - lens->cy) / lens->fy;
            const struct pixel from = project_point(rational, rx, ry);
            const bool inside = rx * rx + ry * ry <= rational->max_r * rational->max_r && from.x >= 0 && from.y >= 0 &&
                                from.x <= rational->width - 1 && from.y <= rational->height - 1;
            at[0] = inside ? (float)from.x : -1;
            at[1] = inside ? (float)from.y : -1;
        }
    return OK;
}

static enum status make_lens(const struct rational *rational, const char *what, const char *name, struct lens *lens,
                             struct azure_remap *remap)
{
    const double radius = image_radius(rational);
    double c[FIT_UNKNOWNS];
    *remap = (struct azure_remap){.width = rational->width, .height = rational->height};
    const bool fits = radius > 0 && fit_polynomial(rational, radius, c) <= AZURE_FIT_PX && c[0] > 0;
    if (fits) {
        *lens = polynomial_lens(rational, radius, c);
        if (lens_check(lens, what) == OK)
            return OK;
    }
    *lens = pinhole_lens(rational);
    if (lens_check(lens, what) != OK)
        return fail(ERR_INPUT, "%s: %s", name, status_message());
    return fill_remap(rational, lens, remap);
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
static void widen_intrinsics(double v[PARAMETERS])
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
        widen_intrinsics(v);
    scale_to_mode(v, mode, out);
    json_get_number(json_member(camera, "MetricRadius"), &radius);
    out->max_r = radius > 1e-4 && radius < 100 ? radius : DEFAULT_RADIUS;
    return OK;
}

static const struct json *find_camera(const struct json *root, const char *location)
{
    const struct json *cameras = json_member(json_member(root, "CalibrationInformation"), "Cameras");
    for (const struct json *json = json_first(cameras); json; json = json_next(json)) {
        const char *text;
        if (json_get_string(json_member(json, "Location"), &text) && !strcmp(text, location))
            return json;
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

void azure_calibration_free(struct azure_calibration *calibration)
{
    free(calibration->color.from);
    free(calibration->depth.from);
    *calibration = (struct azure_calibration){0};
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

// ---------------------------------------------------------------- azure kinect

#ifdef REENACT_FFMPEG
#include "platform/files/ffmpeg_library.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"

#include <inttypes.h>
#include <stdio.h>

static const struct ffmpeg_library *_Atomic ffmpeg; // the same for all; set before the first file is opened

enum { QUEUED_MAX = 64 }; // images of one track that may lie before their partners of the other

static const int64_t FRAME_NS = 33333333; // where the file does not say

struct waiting { // images of a track that were read and not yet shown, in order
    AVPacket *packet[QUEUED_MAX];
    int64_t time_ns[QUEUED_MAX];
    int count;
    int stream;      // -1: there is no such track
    int64_t last_ns; // of all that were ever read
};

enum color_kind { COLOR_JPEG, COLOR_NV12, COLOR_YUY2, COLOR_BGRA };

struct kinect {
    char *path;
    AVFormatContext *format;
    struct waiting color, depth;
    enum color_kind color_kind;
    bool big_endian; // depth
    struct azure_calibration calibration;
    int64_t delay_ns, half_ns; // of depth after colour; half a frame
    int64_t index;             // of the next frame
    bool ended, damaged, told; // damaged: the file ended by an error; told: at_end() has said so
    AVPacket *shown;           // whose bytes the last frame's jpeg are
    uint8_t *rgb, *rectified;
    uint16_t *mm, *rectified_mm;
    struct source_facts *facts;
};

// ------------------------------------------------------------- reading on

// The oldest image of a track, out of its queue; the caller frees it.
static AVPacket *take_first(struct waiting *waiting, int64_t *time_ns)
{
    AVPacket *first = waiting->packet[0];
    *time_ns = waiting->time_ns[0];
    waiting->count--;
    memmove(waiting->packet, waiting->packet + 1, (size_t)waiting->count * sizeof *waiting->packet);
    memmove(waiting->time_ns, waiting->time_ns + 1, (size_t)waiting->count * sizeof *waiting->time_ns);
    return first;
}

static void drop_first(struct waiting *waiting)
{
    int64_t time_ns;
    AVPacket *first = take_first(waiting, &time_ns);
    ffmpeg->av_packet_free(&first);
}

// Puts the image into its track's queue, which owns it from then on.
static void queue_packet(struct kinect *kinect, AVPacket *packet)
{
    struct waiting *w = NULL;
    if (packet->stream_index == kinect->depth.stream)
        w = &kinect->depth;
    else if (packet->stream_index == kinect->color.stream)
        w = &kinect->color;
    if (!w) {
        ffmpeg->av_packet_free(&packet);
        return;
    }
    const AVRational base = kinect->format->streams[w->stream]->time_base;
    const int64_t time_ns = packet->pts == AV_NOPTS_VALUE
                                ? INT64_MIN
                                : ffmpeg->av_rescale_q(packet->pts, base, (AVRational){1, 1000000000});
    if (time_ns <= w->last_ns || llabs(time_ns) > INT64_MAX / 4) { // the latter: of no clock
        kinect->facts->dropped += w == &kinect->depth;
        ffmpeg->av_packet_free(&packet);
        return;
    }
    if (w == &kinect->color)
        stream_times_add(&kinect->facts->color_times, time_ns);
    else
        stream_times_add(&kinect->facts->depth_times, time_ns);
    if (w->count == QUEUED_MAX)
        drop_first(w);
    w->packet[w->count] = packet;
    w->time_ns[w->count++] = w->last_ns = time_ns;
}

// Reads one image of any track. NOTHING: the end, also where the file is damaged.
static enum status read_on(struct kinect *kinect)
{
    if (kinect->ended)
        return NOTHING;
    AVPacket *packet = ffmpeg->av_packet_alloc();
    if (!packet)
        return fail(ERR_MEMORY, "no memory for the images of %s", kinect->path);
    const int error = ffmpeg->av_read_frame(kinect->format, packet);
    if (error >= 0) {
        queue_packet(kinect, packet);
        return OK;
    }
    ffmpeg->av_packet_free(&packet);
    if (error == AVERROR(ENOMEM))
        return fail(ERR_MEMORY, "no memory for the images of %s", kinect->path);
    kinect->ended = true;
    kinect->damaged = error != AVERROR_EOF;
    return NOTHING;
}

// Once, after all that was read of it: ERR_INPUT for a file that does not reach the end it states, else NOTHING.
static enum status at_end(struct kinect *kinect)
{
    enum { FRAMES = 5 }; // the other tracks may go on a little longer
    const int64_t last_ns =
        kinect->depth.last_ns > kinect->color.last_ns ? kinect->depth.last_ns : kinect->color.last_ns;
    // Of no clock, in a damaged file, is no statement. Microseconds.
    const int64_t stated_us = kinect->format->duration < INT64_MAX / 4000 ? kinect->format->duration : 0;
    const double missing_s = stated_us * 1e-6 - (last_ns == INT64_MIN ? 0 : (double)last_ns * 1e-9);
    if (kinect->told)
        return NOTHING;
    kinect->told = true;
    if (missing_s > 2 * FRAMES * 1e-9 * (double)kinect->half_ns)
        return fail(ERR_INPUT, "%s breaks off %.1f s before its end: it is damaged", kinect->path, missing_s);
    return kinect->damaged ? fail(ERR_INPUT, "%s is damaged after %" PRId64 " frames", kinect->path, kinect->index)
                           : NOTHING;
}

// Reads until the next depth image is there, and colour at least as late. At the end as at_end().
static enum status read_pair(struct kinect *kinect)
{
    enum status status = OK;
    while (status == OK) {
        const bool has_depth = kinect->depth.count > 0;
        const bool waits = kinect->color.stream >= 0 && kinect->depth.count < QUEUED_MAX &&
                           (!has_depth || kinect->color.last_ns < kinect->depth.time_ns[0] - kinect->delay_ns);
        if (has_depth && !waits)
            return OK;
        status = read_on(kinect);
    }
    if (status != NOTHING)
        return status;
    return kinect->depth.count ? OK : at_end(kinect);
}

// The colour image that belongs to `time_ns`, out of the queue with all before it; NULL: none.
static AVPacket *take_color(struct kinect *kinect, int64_t time_ns)
{
    struct waiting *w = &kinect->color;
    int nearest = -1;
    for (int i = 0; i < w->count; i++)
        if (llabs(w->time_ns[i] - time_ns) <= kinect->half_ns &&
            (nearest < 0 || llabs(w->time_ns[i] - time_ns) < llabs(w->time_ns[nearest] - time_ns)))
            nearest = i;
    for (int i = 0; i < nearest; i++)
        drop_first(w);
    while (nearest < 0 && w->count && w->time_ns[0] < time_ns - kinect->half_ns)
        drop_first(w);
    int64_t unused;
    return nearest < 0 ? NULL : take_first(w, &unused);
}

// ------------------------------------------------------------- images

static enum status show_depth(struct kinect *kinect, const AVPacket *packet, struct frame *out)
{
    const AVCodecParameters *p = kinect->format->streams[kinect->depth.stream]->codecpar;
    const size_t area = (size_t)p->width * (size_t)p->height;
    if ((size_t)packet->size < 2 * area)
        return fail(ERR_INPUT, "%s, depth of frame %" PRId64 ": %d bytes instead of %zu", kinect->path,
                    kinect->index - 1, packet->size, 2 * area);
    const uint8_t *in = packet->data;
    for (size_t i = 0; i < area; i++, in += 2)
        kinect->mm[i] = (uint16_t)(kinect->big_endian ? in[0] << 8 | in[1] : in[1] << 8 | in[0]);
    if (kinect->calibration.depth.from)
        azure_remap_depth(&kinect->calibration.depth, kinect->mm, kinect->rectified_mm);
    out->depth = kinect->calibration.depth.from ? kinect->rectified_mm : kinect->mm;
    return OK;
}

// Decodes into kinect->rgb.
static enum status decode_color(struct kinect *kinect, const AVPacket *packet)
{
    const AVCodecParameters *p = kinect->format->streams[kinect->color.stream]->codecpar;
    const size_t width = (size_t)p->width, area = width * (size_t)p->height;
    const struct yuv_layout layout = {{YUV_BT601, false}, p->width, p->height};
    static const size_t half_bytes[] = {[COLOR_NV12] = 3, [COLOR_YUY2] = 4, [COLOR_BGRA] = 8}; // of a pixel
    if (kinect->color_kind == COLOR_JPEG) {
        enum status status = jpeg_decode(packet->data, (size_t)packet->size, kinect->rgb, p->width, p->height);
        if (status == ERR_CORRUPT)
            status = fail(ERR_INPUT, "%s, colour of frame %" PRId64 ": %s", kinect->path, kinect->index - 1,
                          status_message());
        return status;
    }
    if ((size_t)packet->size < area * half_bytes[kinect->color_kind] / 2)
        return fail(ERR_INPUT, "%s, colour of frame %" PRId64 ": %d bytes are too few", kinect->path, kinect->index - 1,
                    packet->size);
    if (kinect->color_kind == COLOR_NV12)
        pixels_from_nv12(packet->data, width, packet->data + area, width, &layout, kinect->rgb);
    else if (kinect->color_kind == COLOR_YUY2)
        pixels_from_yuv422(packet->data, 2 * width, true, &layout, kinect->rgb);
    else
        pixels_from_packed(packet->data, 4 * width, PACKED_BGRX, p->width, p->height, kinect->rgb);
    return OK;
}

// Takes over the packet, whose JPEG the frame may point into.
static enum status show_color(struct kinect *kinect, AVPacket *packet, struct frame *out)
{
    kinect->shown = packet;
    enum status status = decode_color(kinect, packet);
    if (status != OK)
        return status;
    const struct azure_remap *remap = &kinect->calibration.color;
    out->color = remap->from ? kinect->rectified : kinect->rgb;
    if (remap->from) {
        azure_remap_color(remap, kinect->rgb, kinect->rectified);
    } else if (kinect->color_kind == COLOR_JPEG) {
        out->jpeg = packet->data;
        out->jpeg_bytes = (size_t)packet->size;
    }
    return OK;
}

static enum status kinect_next(void *self, struct frame *out)
{
    struct kinect *k = self;
    ffmpeg->av_packet_free(&k->shown);
    enum status status = read_pair(k);
    if (status != OK)
        return status;
    AVPacket *depth = take_first(&k->depth, &out->time_ns);
    snprintf(out->name, sizeof out->name, "%04" PRId64, k->index++);
    status = show_depth(k, depth, out);
    ffmpeg->av_packet_free(&depth);
    AVPacket *color = take_color(k, out->time_ns - k->delay_ns);
    k->facts->pairs += color != NULL;
    if (status != OK)
        ffmpeg->av_packet_free(&color);
    return color ? show_color(k, color, out) : status;
}

// ------------------------------------------------------------- opening

static const char *tag_value(const AVDictionary *tags, const char *name)
{
    const AVDictionaryEntry *entry = ffmpeg->av_dict_get(tags, name, NULL, 0);
    return entry ? entry->value : NULL;
}

// The track of that name; -1: none.
static int find_track(const struct kinect *kinect, const char *name)
{
    char key[32];
    snprintf(key, sizeof key, "K4A_%s_TRACK", name);
    for (unsigned i = 0; i < kinect->format->nb_streams; i++) {
        const AVStream *s = kinect->format->streams[i];
        const char *title = tag_value(s->metadata, "title");
        if (s->codecpar->codec_type == AVMEDIA_TYPE_VIDEO &&
            (tag_value(s->metadata, key) || (title && !strcmp(title, name))))
            return (int)i;
    }
    return -1;
}

static enum status check_track(struct kinect *kinect, int stream, const char *what)
{
    const AVCodecParameters *p = kinect->format->streams[stream]->codecpar;
    if (!image_size_is_usable(p->width, p->height))
        return fail(ERR_INPUT, "%s: its %s images of %d x %d pixels cannot be used", kinect->path, what, p->width,
                    p->height);
    return OK;
}

static enum status find_tracks(struct kinect *kinect)
{
    kinect->depth.stream = find_track(kinect, "DEPTH");
    kinect->color.stream = find_track(kinect, "COLOR");
    if (kinect->depth.stream < 0)
        return fail(ERR_INPUT, "%s is no recording of an Azure Kinect with depth: it has no track DEPTH", kinect->path);
    enum status status = check_track(kinect, kinect->depth.stream, "depth");
    if (status == OK && kinect->color.stream >= 0)
        status = check_track(kinect, kinect->color.stream, "colour");
    if (status != OK)
        return status;
    const AVCodecParameters *d = kinect->format->streams[kinect->depth.stream]->codecpar;
    kinect->big_endian = d->codec_tag == MKTAG('b', '1', '6', 'g');
    if (d->codec_id != AV_CODEC_ID_RAWVIDEO || (!kinect->big_endian && d->codec_tag != MKTAG('Y', '1', '6', ' ')))
        return fail(ERR_INPUT, "%s: its depth is not of 16 uncompressed bits (b16g)", kinect->path);
    if (kinect->color.stream < 0)
        return OK;
    const AVCodecParameters *c = kinect->format->streams[kinect->color.stream]->codecpar;
    const bool raw = c->codec_id == AV_CODEC_ID_RAWVIDEO;
    if (c->codec_id == AV_CODEC_ID_MJPEG)
        kinect->color_kind = COLOR_JPEG;
    else if (raw && c->codec_tag == MKTAG('N', 'V', '1', '2') && !(c->height % 2))
        kinect->color_kind = COLOR_NV12; // and the mode's width is a multiple of 4
    else if (raw && c->codec_tag == MKTAG('Y', 'U', 'Y', '2'))
        kinect->color_kind = COLOR_YUY2;
    else if (raw && c->codec_tag == MKTAG('B', 'G', 'R', 'A'))
        kinect->color_kind = COLOR_BGRA;
    else
        return fail(ERR_INPUT, "%s: its colour is neither MJPEG, NV12, YUY2 nor BGRA", kinect->path);
    return OK;
}

static enum status read_calibration(struct kinect *kinect)
{
    const char *file = tag_value(kinect->format->metadata, "K4A_CALIBRATION_FILE");
    const AVStream *found = NULL;
    for (unsigned i = 0; i < kinect->format->nb_streams && !found; i++) {
        const AVStream *s = kinect->format->streams[i];
        const char *name = tag_value(s->metadata, "filename");
        if (s->codecpar->codec_type == AVMEDIA_TYPE_ATTACHMENT && s->codecpar->extradata_size > 0 && name &&
            !strcmp(name, file ? file : "calibration.json"))
            found = s;
    }
    if (!found)
        return fail(ERR_INPUT, "%s holds no calibration.json, without which its depth means nothing", kinect->path);
    int size[2][2] = {{0}};
    const int streams[2] = {kinect->color.stream, kinect->depth.stream};
    for (int i = 0; i < 2; i++)
        if (streams[i] >= 0) {
            size[i][0] = kinect->format->streams[streams[i]]->codecpar->width;
            size[i][1] = kinect->format->streams[streams[i]]->codecpar->height;
        }
    char name[300];
    snprintf(name, sizeof name, "calibration.json in %.250s", kinect->path);
    enum status status =
        azure_calibration_parse((const char *)found->codecpar->extradata, (size_t)found->codecpar->extradata_size, name,
                                size[0], size[1], &kinect->calibration);
    if (status == OK)
        kinect->facts->calibration = kinect->calibration.lenses;
    return status;
}

static void read_clock(struct kinect *kinect)
{
    const AVRational rate = kinect->format->streams[kinect->depth.stream]->avg_frame_rate;
    const char *delay = tag_value(kinect->format->metadata, "K4A_DEPTH_DELAY_NS");
    int64_t frame_ns = FRAME_NS;
    if (rate.num > 0 && rate.den > 0)
        frame_ns = ffmpeg->av_rescale(1000000000, rate.den, rate.num);
    if (frame_ns < 1000000 || frame_ns > 1000000000)
        frame_ns = FRAME_NS;
    kinect->half_ns = frame_ns / 2;
    kinect->delay_ns = delay ? strtoll(delay, NULL, 10) : 0;
    if (kinect->delay_ns < -frame_ns || kinect->delay_ns > frame_ns) // the sensor allows less
        kinect->delay_ns = 0;
    kinect->color.last_ns = kinect->depth.last_ns = INT64_MIN;
}

static enum status alloc_images(struct kinect *kinect)
{
    const struct calibration *c = &kinect->calibration.lenses;
    const size_t color = (size_t)c->color.width * (size_t)c->color.height;
    const size_t depth = (size_t)c->depth.width * (size_t)c->depth.height;
    kinect->rgb = malloc(3 * color + 1);
    kinect->mm = malloc(2 * depth + 1);
    if (kinect->calibration.color.from)
        kinect->rectified = malloc(3 * color + 1);
    if (kinect->calibration.depth.from)
        kinect->rectified_mm = malloc(2 * depth + 1);
    if (!kinect->rgb || !kinect->mm || (kinect->calibration.color.from && !kinect->rectified) ||
        (kinect->calibration.depth.from && !kinect->rectified_mm))
        return fail(ERR_MEMORY, "no memory for the images of %s", kinect->path);
    return OK;
}

static enum status not_matroska(const char *path)
{
    const char *kind = file_kind(path);
    if (kind && strstr(kind, "Matroska"))
        return fail(ERR_INPUT, "%s is cut short or damaged where it begins", path);
    return fail(ERR_INPUT, "%s is no film of an Azure Kinect (Matroska, .mkv)%s%s", path, kind ? ": it is " : "",
                kind ? kind : "");
}

static enum status open_file(struct kinect *kinect)
{
    if (!file_exists(kinect->path))
        return fail(ERR_MISSING, "there is no file %s", kinect->path);
    char url[FILE_PATH_BYTES + 8];
    if (snprintf(url, sizeof url, "file:%s", kinect->path) >= (int)sizeof url)
        return fail(ERR_INPUT, "the path %.60s… is too long", kinect->path);
    const int error = ffmpeg->avformat_open_input(&kinect->format, url, ffmpeg->av_find_input_format("matroska"), NULL);
    if (error == AVERROR(ENOMEM))
        return fail(ERR_MEMORY, "no memory to open %s", kinect->path);
    if (error < 0)
        return not_matroska(kinect->path);
    return OK;
}

static void kinect_close(void *self)
{
    struct kinect *k = self;
    if (!k)
        return;
    while (k->color.count)
        drop_first(&k->color);
    while (k->depth.count)
        drop_first(&k->depth);
    ffmpeg->av_packet_free(&k->shown);
    ffmpeg->avformat_close_input(&k->format);
    azure_calibration_free(&k->calibration);
    free(k->rgb);
    free(k->rectified);
    free(k->mm);
    free(k->rectified_mm);
    free(k->path);
    free(k);
}

enum status mkv_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted; // a sensor
    *self = NULL;
    ffmpeg = ffmpeg_library();
    if (!ffmpeg)
        return fail(ERR_INPUT, "FFmpeg's libraries, without which %s cannot be read, are not installed", where);
    struct kinect *k = calloc(1, sizeof *k);
    if (!k || !(k->path = strdup(where))) {
        free(k);
        return fail(ERR_MEMORY, "no memory to open %s", where);
    }
    k->facts = facts;
    enum status status = open_file(k);
    if (status == OK)
        status = find_tracks(k);
    if (status == OK)
        status = read_calibration(k);
    if (status == OK)
        status = alloc_images(k);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        kinect_close(k);
        return failure_restore(&first);
    }
    read_clock(k);
    facts->live = false;
    *self = k;
    return OK;
}

const struct source_kind mkv_kind = {kinect_next, kinect_close};

#else
enum status mkv_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    (void)facts;
    *self = NULL;
    return fail(ERR_INPUT, "this program was built without FFmpeg's libraries, so it cannot read %s", where);
}

const struct source_kind mkv_kind = {0};
#endif
