#include "capture/body/body_network.h"

#include "base/portable_math.h"
#include "neural/network.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEPTH_RANGE 0.7 // as tools/train_body has it
// Chosen by hand but where it says as what.
#define SIGMA   0.03 // of a joint that is all in its peak, in widths of the square; see sigma_m
#define SIGMA_M 0.05 // and of any joint: people's joints are not where the figures have them
#define NOWHERE 0.3  // a joint with less in its peak was not found
#define EDGE    0.04 // of the square's side: nearer to the image's edge nothing is found
#define MARGIN  1.17 // of the square about the bounds: the mean in training
enum {
    CELLS = BODY_NETWORK_CELLS,
    MAP = BODY_NETWORK_MAP,
    CHANNELS = 5,                                // depth, known, hint
    MAPS = 2 * JOINT_COUNT + BODY_NETWORK_PARTS, // of each joint its place and its depth; parts
    WHOLE = 4,
    WHOLE_CELLS = 6 * 6, // left, log-odds of a person; their maps
    REACH = 2,           // cells of a map about a peak that belong to it
    DEPTHS = 8192,       // mm that a histogram counts
};

// body.tflite. The assembler includes it: as text it would be five times as large.
extern const uint8_t body_network_weights[], body_network_weights_end[];
__asm__(".section .rodata\n"
        ".global body_network_weights, body_network_weights_end\n"
        ".balign 16\n"
        "body_network_weights: .incbin \"" BODY_NETWORK_WEIGHTS "\"\n"
        "body_network_weights_end: .byte 0\n"
        ".text\n");

struct body_network {
    struct network *network;
};

enum status body_network_open(struct body_network **out)
{
    struct tflite_model model;
    size_t maps, whole, input;
    struct body_network *n = *out = calloc(1, sizeof *n);
    if (!n)
        return fail(ERR_MEMORY, "no memory for the body's network");
    enum status status = tflite_read(&model, "the body's network", body_network_weights,
                                     (size_t)(body_network_weights_end - body_network_weights));
    if (status == OK)
        status = network_open(&n->network, "the body's network", &model, 3);
    if (status == OK) {
        network_input(n->network, &input);
        network_output(n->network, 0, &maps);
        network_output(n->network, 1, &whole);
        if (input != CELLS * CELLS * CHANNELS || maps != MAP * MAP * MAPS || whole != WHOLE_CELLS * WHOLE)
            status = fail(ERR_FORMAT, "the body's network has other sizes than this program");
    }
    if (status != OK)
        body_network_close(out);
    return status;
}

void body_network_close(struct body_network **network)
{
    if (!*network)
        return;
    network_close(&(*network)->network);
    free(*network);
    *network = NULL;
}

// ---------------------------------------------------------------- square

struct body_square body_square_about(const struct lens *lens, const uint16_t *depth, const uint8_t *mask,
                                     struct pixel_box box)
{
    int left = lens->width, right = -1, top = lens->height, bottom = -1, count = 0;
    uint32_t histogram[DEPTHS] = {0};
    for (int y = box.top; y <= box.bottom; y++)
        for (int x = box.left; x <= box.right; x++) {
            const size_t i = (size_t)y * (size_t)lens->width + (size_t)x;
            if (!mask[i] || !depth[i] || depth[i] >= DEPTHS)
                continue;
            left = x < left ? x : left;
            right = x > right ? x : right;
            top = y < top ? y : top;
            bottom = y;
            histogram[depth[i]]++;
            count++;
        }
    if (!count)
        return (struct body_square){0};
    int median = 0;
    for (int below = 0; below + (int)histogram[median] <= count / 2; median++)
        below += (int)histogram[median];
    const double side = MARGIN * (fmax(right - left, bottom - top) + 1);
    return (struct body_square){0.5 * (left + right - side), 0.5 * (top + bottom - side), side, 1e-3 * median};
}

double body_square_width_m(const struct body_square *square, const struct lens *lens)
{
    return square->side * square->middle_m / lens->fx;
}

bool body_square_pixel(const struct body_square *square, const struct lens *lens, int column, int row, int *pixel)
{
    const double cell = square->side / CELLS;
    const double x = floor(square->left + 0.5 + cell * (column + 0.5)),
                 y = floor(square->top + 0.5 + cell * (row + 0.5));
    if (!(x >= 0 && y >= 0 && x < lens->width && y < lens->height))
        return false;
    *pixel = (int)y * lens->width + (int)x;
    return true;
}

bool body_square_cell(const struct body_square *square, struct pixel px, int *cell)
{
    const double column = floor((px.x - square->left) / square->side * MAP),
                 row = floor((px.y - square->top) / square->side * MAP);
    if (!(column >= 0 && row >= 0 && column < MAP && row < MAP))
        return false;
    *cell = (int)row * MAP + (int)column;
    return true;
}

static void fill_input(const struct body_square *square, const struct lens *lens, const uint16_t *depth,
                       const uint8_t *mask, struct vec3 hint, float *input)
{
    const double range_m = DEPTH_RANGE * body_square_width_m(square, lens);
    for (int i = 0; i < CELLS * CELLS; i++, input += CHANNELS) {
        int pixel;
        const bool inside = body_square_pixel(square, lens, i % CELLS, i / CELLS, &pixel);
        const int mm = inside && (!mask || mask[pixel]) ? depth[pixel] : 0;
        const double off = (1e-3 * mm - square->middle_m) / range_m;
        const bool known = mm > 0 && fabs(off) < 1;
        input[0] = known ? (float)off : 0;
        input[1] = known;
        input[2] = (float)hint.x;
        input[3] = (float)hint.y;
        input[4] = (float)hint.z;
    }
}

// ---------------------------------------------------------------- answer

// A joint's place in the maps: the mean about the highest, of which each weighs as its probability.
struct peak {
    double column, row, depth; // cells; widths of the square from its middle
    double share;              // of all probability
};

static struct peak find_peak(const float *maps, int joint)
{
    const float *place = maps + joint, *depth = maps + JOINT_COUNT + joint;
    int highest = 0;
    for (int i = 1; i < MAP * MAP; i++)
        if (place[i * MAPS] > place[highest * MAPS])
            highest = i;
    struct peak peak = {0};
    double all = 0, near = 0;
    for (int i = 0; i < MAP * MAP; i++) {
        const double p = portable_exp((double)(place[i * MAPS] - place[highest * MAPS]));
        all += p;
        if (abs(i % MAP - highest % MAP) > REACH || abs(i / MAP - highest / MAP) > REACH)
            continue;
        near += p;
        peak.column += p * (i % MAP);
        peak.row += p * (i / MAP);
        peak.depth += p * (double)depth[i * MAPS];
    }
    peak.column /= near;
    peak.row /= near;
    peak.depth /= near;
    peak.share = near / all;
    return peak;
}

// The first of the parts is none; softmax.
static float none_share(const float *parts)
{
    double highest = (double)parts[0], sum = 0;
    for (int k = 1; k < BODY_NETWORK_PARTS; k++)
        highest = fmax(highest, (double)parts[k]);
    for (int k = 0; k < BODY_NETWORK_PARTS; k++)
        sum += portable_exp((double)parts[k] - highest);
    return (float)(portable_exp((double)parts[0] - highest) / sum);
}

// What the image's edge cuts off is found at the edge: a joint there says nothing.
static bool is_at_edge(const struct lens *lens, struct pixel px, double margin_px)
{
    return !(px.x > margin_px && px.y > margin_px && px.x < lens->width - 1 - margin_px &&
             px.y < lens->height - 1 - margin_px);
}

void body_network_find(struct body_network *network, const struct lens *lens, const uint16_t *depth,
                       const uint8_t *mask, const struct body_square *square, struct vec3 hint, struct found_body *out)
{
    size_t count;
    assert(square->side > 0 && square->middle_m > 0);
    fill_input(square, lens, depth, mask, hint, network_input(network->network, &count));
    network_run(network->network);
    const float *maps = network_output(network->network, 0, &count);
    const double width_m = body_square_width_m(square, lens), cell_px = square->side / MAP;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct peak peak = find_peak(maps, j);
        const struct pixel px = {square->left + cell_px * (peak.column + 0.5),
                                 square->top + cell_px * (peak.row + 0.5)};
        out->joint[j] = v3_scale(lens_ray(lens, px), fmax(0.1, square->middle_m + width_m * peak.depth));
        const double by_peak_m = SIGMA * width_m / (peak.share * sqrt(peak.share));
        const bool nowhere = peak.share < NOWHERE || is_at_edge(lens, px, EDGE * square->side);
        out->sigma_m[j] = nowhere ? (double)INFINITY : sqrt(by_peak_m * by_peak_m + SIGMA_M * SIGMA_M);
    }
    for (int i = 0; i < MAP * MAP; i++)
        out->none[i] = none_share(maps + i * MAPS + 2 * JOINT_COUNT);
    const float *whole = network_output(network->network, 1, &count);
    double mean[WHOLE] = {0};
    for (int i = 0; i < WHOLE_CELLS * WHOLE; i++)
        mean[i % WHOLE] += (double)whole[i] / WHOLE_CELLS;
    out->left = v3(mean[0], mean[1], mean[2]);
    out->log_odds = mean[3];
}
