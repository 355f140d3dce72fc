#include "neural/pose_network.h"

#include "base/portable_math.h"
#include "neural/network.h"
#include "platform/files/file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    DETECTOR_SIDE = 224,
    LANDMARK_SIDE = 256,
    HEATMAP_SIDE = 64,
    HEATMAP_REACH = 3, // cells about a point that refine it
    DETECTIONS = 2254,
    DETECTION_VALUES = 12, // box: middle, size; then four points
    POINTS = 39,           // the 33 and six that the next image's square comes from
    POINT_VALUES = 5,
    CENTER_POINT = 33, // the hips' middle
    TOP_POINT = 34,    // says how large the person is and how tilted
};
static const double FOUND = 0.5;       // of the detector's and the landmark network's scores, as MediaPipe has it
static const double SAME_BOX = 0.3;    // intersection over union from which on two boxes are one person's
static const double SQUARE = 2 * 1.25; // the square's side, of the distance between the two points

// A square of the image, rotated; pixels.
struct square {
    double x, y; // of its middle; the top-left pixel's centre is (0, 0)
    double side, rotation;
};

struct anchor {
    double x, y; // of the image's side
};

struct pose_network {
    struct network *detector, *landmarks;
    struct anchor anchor[DETECTIONS];
    struct square square; // of the next image
    bool following;
};

// ---------------------------------------------------------------- opening

static void fill_anchors(struct anchor anchor[DETECTIONS])
{
    static const struct {
        int cells, each; // a grid of cells x cells, so many detections in each
    } grid[] = {{28, 2}, {14, 2}, {7, 6}};
    int count = 0;
    for (size_t g = 0; g < COUNT_OF(grid); g++)
        for (int i = 0; i < grid[g].cells * grid[g].cells * grid[g].each; i++) {
            const int cell = i / grid[g].each, cells = grid[g].cells;
            anchor[count++] = (struct anchor){(cell % cells + 0.5) / cells, (cell / cells + 0.5) / cells};
        }
    assert(count == DETECTIONS);
}

static void default_folder(char *out, size_t bytes)
{
    const char *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
    if (data && *data)
        snprintf(out, bytes, "%s/reenact/models", data);
    else
        snprintf(out, bytes, "%s/.local/share/reenact/models", home ? home : "");
}

static enum status open_one(struct network **out, const char *folder, const char *name, unsigned outputs)
{
    char path[1024];
    uint8_t *bytes;
    size_t count;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (access(path, R_OK))
        return fail(ERR_MISSING, "the network %s is not there; reenact-capture models --fetch fetches it", path);
    struct tflite_model model;
    enum status status = file_read(path, &bytes, &count);
    if (status != OK)
        return status;
    status = tflite_read(&model, path, bytes, count);
    free(bytes);
    return status == OK ? network_open(out, path, &model, outputs) : status;
}

// A network of another size would be read beyond its end.
static bool has_sizes(struct network *network, size_t input, const size_t *output, int outputs)
{
    size_t count;
    network_input(network, &count);
    bool right = count == input;
    for (int i = 0; right && i < outputs; i++)
        if (output[i]) {
            network_output(network, i, &count);
            right = count == output[i];
        }
    return right;
}

enum status pose_network_open(struct pose_network **out, const char *folder, enum pose_network_size size)
{
    static const size_t detector_outputs[] = {DETECTIONS * DETECTION_VALUES, DETECTIONS};
    static const size_t landmark_outputs[] = {POINTS * POINT_VALUES, 1, 0, HEATMAP_SIDE * HEATMAP_SIDE * POINTS};
    char found[1000];
    struct pose_network *n = *out = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "no memory for the pose network");
    if (!folder)
        default_folder(found, sizeof found);
    fill_anchors(n->anchor);
    const char *landmarks = size == POSE_NETWORK_FULL ? "pose_landmark_full.tflite" : "pose_landmark_lite.tflite";
    enum status status = open_one(&n->detector, folder ? folder : found, "pose_detection.tflite", 3);
    if (status == OK)
        status = open_one(&n->landmarks, folder ? folder : found, landmarks, 1 | 2 | 8);
    if (status == OK && (!has_sizes(n->detector, 3 * DETECTOR_SIDE * DETECTOR_SIDE, detector_outputs, 2) ||
                         !has_sizes(n->landmarks, 3 * LANDMARK_SIDE * LANDMARK_SIDE, landmark_outputs, 4)))
        status = fail(ERR_FORMAT, "the networks in %s are not those that reenact-capture models --fetch fetches",
                      folder ? folder : found);
    if (status != OK)
        pose_network_close(out);
    return status;
}

void pose_network_close(struct pose_network **network)
{
    if (!*network)
        return;
    network_close(&(*network)->detector);
    network_close(&(*network)->landmarks);
    free(*network);
    *network = NULL;
}

void pose_network_restart(struct pose_network *network) { network->following = false; }

// ---------------------------------------------------------------- the image

struct image {
    const uint8_t *rgb;
    int width, height;
};

static float pixel_at(const struct image *image, int x, int y, int channel)
{
    return x < 0 || y < 0 || x >= image->width || y >= image->height
               ? 0
               : (float)image->rgb[3 * ((size_t)y * (size_t)image->width + (size_t)x) + (size_t)channel];
}

// The square, `side` pixels wide, bilinear, black outside the image; values from low to high.
static void crop_square(const struct image *image, const struct square *square, int side, float low, float high,
                        float *out)
{
    const double c = portable_cos(square->rotation), sine = portable_sin(square->rotation), scale = square->side / side;
    const float gain = (high - low) / 255;
    for (int v = 0; v < side; v++)
        for (int u = 0; u < side; u++, out += 3) {
            const double across = (u + 0.5 - side / 2.0) * scale, down = (v + 0.5 - side / 2.0) * scale;
            double x = square->x + c * across - sine * down, y = square->y + sine * across + c * down;
            x = fmin(fmax(x, -2), image->width + 1); // beyond it is black anyway, and an int holds it
            y = fmin(fmax(y, -2), image->height + 1);
            const int left = (int)floor(x), top = (int)floor(y);
            const float a = (float)(x - left), b = (float)(y - top);
            for (int k = 0; k < 3; k++) {
                const float above = (1 - a) * pixel_at(image, left, top, k) + a * pixel_at(image, left + 1, top, k);
                const float below =
                    (1 - a) * pixel_at(image, left, top + 1, k) + a * pixel_at(image, left + 1, top + 1, k);
                out[k] = low + gain * ((1 - b) * above + b * below);
            }
        }
}

static double logistic(double x) { return 1 / (1 + portable_exp(-fmin(fmax(x, -100), 100))); }

// The square about a person whose hips' middle and top point these are.
static struct square square_about(double x, double y, double top_x, double top_y)
{
    const double dx = top_x - x, dy = top_y - y;
    return (struct square){x, y, SQUARE * portable_hypot(dx, dy), portable_atan2(dx, -dy)};
}

// ---------------------------------------------------------------- detecting

// One detection, of the image's side.
struct detection {
    double value[DETECTION_VALUES];
};

static struct detection detection_at(const struct pose_network *network, const float *boxes, int i)
{
    struct detection d;
    for (int k = 0; k < DETECTION_VALUES; k++) {
        const bool size = k == 2 || k == 3;
        const double middle = k % 2 ? network->anchor[i].y : network->anchor[i].x;
        d.value[k] = (double)boxes[DETECTION_VALUES * i + k] / DETECTOR_SIDE + (size ? 0 : middle);
    }
    return d;
}

static double intersection_over_union(const struct detection *a, const struct detection *b)
{
    double both = 1;
    for (int k = 0; k < 2; k++) {
        const double low = fmax(a->value[k] - a->value[2 + k] / 2, b->value[k] - b->value[2 + k] / 2);
        const double high = fmin(a->value[k] + a->value[2 + k] / 2, b->value[k] + b->value[2 + k] / 2);
        both *= fmax(high - low, 0);
    }
    const double either = a->value[2] * a->value[3] + b->value[2] * b->value[3] - both;
    return either > 0 ? both / either : 0;
}

// The best detection, averaged with those of the same person by their scores. False: there is none.
static bool detect_person(struct pose_network *network, const struct image *image, struct square *out)
{
    const struct square whole = {(image->width - 1) / 2.0, (image->height - 1) / 2.0, fmax(image->width, image->height),
                                 0};
    size_t count;
    crop_square(image, &whole, DETECTOR_SIDE, -1, 1, network_input(network->detector, &count));
    network_run(network->detector);
    const float *boxes = network_output(network->detector, 0, &count),
                *scores = network_output(network->detector, 1, &count);
    int best = 0;
    for (int i = 1; i < DETECTIONS; i++)
        if (scores[i] > scores[best])
            best = i;
    if (!(logistic((double)scores[best]) >= FOUND))
        return false;
    const struct detection first = detection_at(network, boxes, best);
    struct detection mean = {{0}};
    double weights = 0;
    for (int i = 0; i < DETECTIONS; i++) {
        const double weight = logistic((double)scores[i]);
        const struct detection d = detection_at(network, boxes, i);
        if (weight < FOUND || (i != best && intersection_over_union(&first, &d) < SAME_BOX))
            continue;
        for (int k = 0; k < DETECTION_VALUES; k++)
            mean.value[k] += weight * d.value[k];
        weights += weight;
    }
    double at[4]; // the hips' middle and the top point
    for (int k = 0; k < 4; k++)
        at[k] = (k % 2 ? whole.y : whole.x) + (mean.value[4 + k] / weights - 0.5) * whole.side;
    *out = square_about(at[0], at[1], at[2], at[3]);
    return true;
}

// ---------------------------------------------------------------- points

// A point's place in the square, 0..1, made finer by the heatmap's mean about it where that is sure.
static void refine_point(const float *heatmap, int point, double *u, double *v)
{
    const int x = (int)floor(*u * HEATMAP_SIDE), y = (int)floor(*v * HEATMAP_SIDE);
    if (x < 0 || y < 0 || x >= HEATMAP_SIDE || y >= HEATMAP_SIDE)
        return;
    double sum = 0, sum_x = 0, sum_y = 0, max = 0;
    for (int j = y - HEATMAP_REACH; j <= y + HEATMAP_REACH; j++)
        for (int i = x - HEATMAP_REACH; i <= x + HEATMAP_REACH; i++) {
            if (i < 0 || j < 0 || i >= HEATMAP_SIDE || j >= HEATMAP_SIDE)
                continue;
            const double weight = logistic((double)heatmap[(j * HEATMAP_SIDE + i) * POINTS + point]);
            sum += weight;
            sum_x += i * weight;
            sum_y += j * weight;
            max = fmax(max, weight);
        }
    if (max < FOUND)
        return;
    *u = sum_x / sum / HEATMAP_SIDE;
    *v = sum_y / sum / HEATMAP_SIDE;
}

static void find_points(struct pose_network *network, const struct image *image, struct pose_point point[POINTS],
                        double *score)
{
    const struct square *s = &network->square;
    size_t count;
    crop_square(image, s, LANDMARK_SIDE, 0, 1, network_input(network->landmarks, &count));
    network_run(network->landmarks);
    const float *values = network_output(network->landmarks, 0, &count),
                *heatmap = network_output(network->landmarks, 3, &count);
    *score = (double)network_output(network->landmarks, 1, &count)[0];
    const double c = portable_cos(s->rotation), sine = portable_sin(s->rotation);
    for (int i = 0; i < POINTS; i++) {
        const float *value = values + (ptrdiff_t)POINT_VALUES * i;
        double u = fmin(fmax((double)value[0] / LANDMARK_SIDE, -10), 10);
        double v = fmin(fmax((double)value[1] / LANDMARK_SIDE, -10), 10);
        refine_point(heatmap, i, &u, &v);
        const double across = (u - 0.5) * s->side, down = (v - 0.5) * s->side;
        point[i] = (struct pose_point){
            .x_px = s->x + c * across - sine * down,
            .y_px = s->y + sine * across + c * down,
            .z_px = (double)value[2] / LANDMARK_SIDE * s->side,
            .visibility = logistic((double)value[3]),
            .presence = logistic((double)value[4]),
        };
    }
}

enum status pose_network_find(struct pose_network *network, const uint8_t *rgb, int width, int height,
                              struct pose_points *out)
{
    const struct image image = {rgb, width, height};
    struct pose_point point[POINTS];
    for (bool again = network->following;; again = false) {
        if (!network->following && !detect_person(network, &image, &network->square))
            return NOTHING;
        double score;
        find_points(network, &image, point, &score);
        network->following = score >= FOUND;
        if (network->following) {
            out->score = score;
            break;
        }
        if (!again)
            return NOTHING; // else the detector has its say: the person may have gone elsewhere
    }
    memcpy(out->point, point, sizeof out->point);
    network->square =
        square_about(point[CENTER_POINT].x_px, point[CENTER_POINT].y_px, point[TOP_POINT].x_px, point[TOP_POINT].y_px);
    network->following = network->square.side > 1;
    return OK;
}
