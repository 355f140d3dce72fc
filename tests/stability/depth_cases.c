// Depth images: coding, segmentation, floor, bounds, samples inside a tag; quantised, empty, constant, saturated.
#include "base/depth_noise.h"
#include "capture/body/depth_evidence.h"
#include "capture/export.h"
#include "capture/segmentation/background_depth.h"
#include "capture/segmentation/segment.h"
#include "locate/tag_model.h"
#include "recording/depth_codec.h"
#include "tests/stability/stability.h"

#include <stdlib.h>
#include <string.h>

enum { WIDTH = 160, HEIGHT = 120, PIXELS = WIDTH * HEIGHT };
static const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 131, .fy = 131, .cx = 79.5, .cy = 59.5};

// What the image holds: the same depth everywhere, or two in turn.
enum pattern { CONSTANT, CHECKED, ROWS };

static void fill(uint16_t *depth, enum pattern pattern, uint16_t a, uint16_t b)
{
    for (int i = 0; i < PIXELS; i++) {
        const int x = i % WIDTH, y = i / WIDTH;
        depth[i] = pattern == CONSTANT ? a : pattern == CHECKED ? ((x + y) % 2 ? a : b) : y % 2 ? a : b;
    }
}

// in: pattern, a, b -> pixels that coding has changed.
static struct answer ask_coding(const double *in)
{
    static uint16_t depth[PIXELS], back[PIXELS];
    struct depth_coder *coder;
    const uint8_t *bytes;
    size_t count;
    int wrong = 0;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    enum status status = depth_coder_open(&coder);
    if (status == OK)
        status = depth_encode(coder, depth, WIDTH, HEIGHT, &bytes, &count);
    uint8_t *copy = status == OK ? malloc(count) : NULL;
    if (copy) {
        memcpy(copy, bytes, count);
        status = depth_decode(coder, copy, count, back, WIDTH, HEIGHT);
    }
    for (int i = 0; i < PIXELS; i++)
        wrong += depth[i] != back[i];
    free(copy);
    depth_coder_close(&coder);
    return answer_status(status, wrong);
}

// Thirteen bits of depth, as differences from the pixel before in eight bits.
static struct answer coded_in_bytes(const double *in)
{
    static uint16_t depth[PIXELS];
    int wrong = 0;
    uint16_t back = 0;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    for (int i = 0; i < PIXELS; i++) {
        back = (uint16_t)(back + (int8_t)((depth[i] & 0x1fff) - back));
        wrong += depth[i] != back;
    }
    return answer_value(wrong);
}

// A coded image with one byte changed, or cut: in: bytes kept, byte changed.
static struct answer ask_damaged(const double *in)
{
    static uint16_t depth[PIXELS], back[PIXELS];
    struct depth_coder *coder;
    const uint8_t *bytes;
    size_t count;
    fill(depth, CHECKED, 1000, 3000);
    enum status status = depth_coder_open(&coder);
    if (status == OK)
        status = depth_encode(coder, depth, WIDTH, HEIGHT, &bytes, &count);
    if (status == OK) {
        const size_t kept = (size_t)(in[0] * (double)count);
        uint8_t *copy = malloc(kept + 1);
        memcpy(copy, bytes, kept);
        status = copy ? depth_decode(coder, copy, kept, back, WIDTH, HEIGHT) : ERR_MEMORY;
        free(copy);
    }
    depth_coder_close(&coder);
    return answer_status(status, 0);
}

// What was decoded of it before.
static struct answer rest_of_zeros(const double *in) { return answer_value((1 - in[0]) * PIXELS); }

// The person's pixels in an image of one depth; in: pattern, a, b, frames.
static struct answer ask_person(const double *in)
{
    static uint16_t depth[PIXELS];
    static uint8_t mask[PIXELS];
    struct segmenter *s;
    int pixels = 0;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    enum status status = segmenter_open(&s, &lens);
    for (int i = 0; i < (int)in[3] && status >= 0; i++)
        status = segmenter_next(s, depth, NULL, 0, mask);
    for (int i = 0; i < PIXELS; i++)
        pixels += mask[i] != 0;
    segmenter_close(&s);
    return answer_status(status, pixels);
}

// All that is nearer than the wall that one expects behind a person.
static struct answer all_that_is_near(const double *in)
{
    static uint16_t depth[PIXELS];
    int pixels = 0;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    for (int i = 0; i < PIXELS; i++)
        pixels += depth[i] < 4000;
    return answer_value(pixels);
}

// in: pattern, a, b, whether the mask is empty -> points of the person.
static struct answer ask_evidence(const double *in)
{
    static uint16_t depth[PIXELS];
    static uint8_t mask[PIXELS];
    struct depth_evidence *e;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    memset(mask, in[3] > 0 ? 0 : 255, sizeof mask);
    const enum status status = evidence_open(&e, &lens);
    if (status != OK)
        return answer_status(status, 0);
    const bool enough = evidence_read(e, depth, mask, 600);
    const double points = e->count;
    evidence_close(&e);
    return enough ? answer_value(points) : answer_of(ANSWER_UNKNOWN);
}

static struct answer points_without_depth(const double *in)
{
    (void)in;
    return answer_value(600); // all at the camera
}

// in: depth inside a tag -> samples.
static struct answer ask_tag_depth(const double *in)
{
    static uint16_t depth[PIXELS];
    struct tag_observation seen = {.id = 0, .correlation = 1};
    static const double corner[4][2] = {{-0.2, 0.2}, {0.2, 0.2}, {0.2, -0.2}, {-0.2, -0.2}};
    struct tag_depth samples;
    fill(depth, (enum pattern)in[0], (uint16_t)in[1], (uint16_t)in[2]);
    for (int k = 0; k < 4; k++)
        seen.ray[k] = v3(corner[k][0], corner[k][1], 1);
    tag_read_depth(&seen, &lens, depth, &samples);
    double sum = 0;
    for (int i = 0; i < samples.count; i++)
        sum += samples.sample[i].z;
    return samples.count ? answer_value(sum / samples.count) : answer_of(ANSWER_UNKNOWN);
}

static struct answer mean_with_zeros(const double *in) { return answer_value((in[1] + in[2]) / 2000); }

// in: rim of pixels without depth on the left -> the first column with depth.
static struct answer ask_bounds(const double *in)
{
    static uint16_t depth[PIXELS];
    fill(depth, CONSTANT, in[1] > 0 ? (uint16_t)in[1] : 0, 0);
    for (int i = 0; i < PIXELS; i++)
        if (i % WIDTH < (int)in[0])
            depth[i] = 0;
    const struct image_bounds b = find_image_bounds(depth, &lens);
    return answer_value(b.left);
}

static struct answer first_with_depth(const double *in)
{
    return answer_value(in[1] > 0 ? in[0] : WIDTH); // no column at all
}

// How far two neighbouring samples of one wall may differ at in[0] mm, against the sensor's own steps there: at least
// twice a step of z^2 / (f b) eighths of a pixel.
static struct answer ask_step(const double *in)
{
    const double step_mm = in[0] * in[0] / (8 * 575.0 * 75);
    return answer_value(depth_step_mm((int)in[0]) >= 2 * step_mm);
}

static struct answer fixed_step(const double *in)
{
    const double step_mm = in[0] * in[0] / (8 * 575.0 * 75);
    return answer_value(30 >= 2 * step_mm);
}

static struct answer ask_median(const double *in)
{
    double values[3] = {in[1], in[2], in[3]};
    return answer_value(median_of(values, (size_t)in[0]));
}

static struct answer mean_of(const double *in)
{
    double sum = 0;
    for (int i = 0; i < (int)in[0]; i++)
        sum += in[1 + i];
    return answer_value(sum / in[0]);
}

// A wall seen by one view, rendered for a sensor that stands where the wall is behind it.
static struct answer ask_background(const double *in)
{
    static uint16_t depth[PIXELS], out[PIXELS];
    fill(depth, CONSTANT, 2000, 0);
    struct place_view view = {.world_from_camera = POSE_IDENTITY, .depth = depth};
    const struct place place = {.calibration = {.depth = lens, .registered = true, .color_from_depth = POSE_IDENTITY},
                                .views = &view,
                                .view_count = 1};
    const enum status status = background_depth_render(&place, &lens, (struct pose){{0, 0, 0, 1}, {0, 0, in[0]}}, out);
    const uint16_t middle = out[PIXELS / 2 + WIDTH / 2];
    return status == OK && !middle ? answer_of(ANSWER_UNKNOWN) : answer_status(status, middle);
}

static struct answer through_the_back(const double *in) { return answer_value(fabs(2 - in[0]) * 1000); }

static const struct stability_case cases[] = {
    {"coding 0 and 60000 in turn", "escape symbols", ANSWER_VALUE, ask_coding, NULL, coded_in_bytes,
     .in = {CHECKED, 0, 60000}, .exact = {0}, .exact_count = 1, .unit = "pixels"},
    {"coding a constant image of 60000", "ranks of depths", ANSWER_VALUE, ask_coding, NULL, coded_in_bytes,
     .in = {CONSTANT, 60000, 0}, .exact = {0}, .exact_count = 1, .unit = "pixels", .tolerance = 0},
    {"coding rows of 0 and 5000 mm in turn", "ranks of depths", ANSWER_VALUE, ask_coding, NULL, coded_in_bytes,
     .in = {ROWS, 0, 5000}, .exact = {0}, .exact_count = 1, .unit = "pixels"},
    {"decoding half of an image's bytes", "a length and bounds", ANSWER_ERROR, ask_damaged, NULL, rest_of_zeros,
     .in = {0.5}, .unit = "pixels"},
    {"decoding no bytes", "a length and bounds", ANSWER_ERROR, ask_damaged, NULL, rest_of_zeros, .in = {0},
     .unit = "pixels"},
    {"person in an image without depth", "0 is no depth", ANSWER_UNKNOWN, ask_person, NULL, all_that_is_near,
     .in = {CONSTANT, 0, 0, 5}, .unit = "pixels"},
    {"person in an image of one depth, 2 m", "size and place of a person", ANSWER_UNKNOWN, ask_person, NULL,
     all_that_is_near, .in = {CONSTANT, 2000, 0, 5}, .unit = "pixels"},
    {"person in an image of 0 and 2 m in turn", "continuous depth", ANSWER_UNKNOWN, ask_person, NULL, all_that_is_near,
     .in = {CHECKED, 0, 2000, 5}, .unit = "pixels"},
    {"person in an image of rows 1 m and 3 m", "continuous depth", ANSWER_UNKNOWN, ask_person, NULL, all_that_is_near,
     .in = {ROWS, 1000, 3000, 5}, .unit = "pixels"},
    {"points of a person without depth", "0 is no depth", ANSWER_UNKNOWN, ask_evidence, NULL, points_without_depth,
     .in = {CONSTANT, 0, 0, 0}, .unit = "points"},
    {"points of an empty mask", "enough pixels to fit", ANSWER_UNKNOWN, ask_evidence, NULL, points_without_depth,
     .in = {CONSTANT, 2000, 0, 1}, .unit = "points"},
    {"depth inside a tag, every second pixel 0", "0 is no depth", ANSWER_VALUE, ask_tag_depth, NULL, mean_with_zeros,
     .in = {CHECKED, 0, 2000}, .exact = {2}, .exact_count = 1, .tolerance = 1e-9, .unit = "m"},
    {"depth inside a tag that has none", "enough samples", ANSWER_UNKNOWN, ask_tag_depth, NULL, mean_with_zeros,
     .in = {CONSTANT, 0, 0}, .unit = "m"},
    {"rim of an image without any depth", "the whole image then", ANSWER_VALUE, ask_bounds, NULL, first_with_depth,
     .in = {0, 0}, .exact = {0}, .exact_count = 1, .unit = "px"},
    {"steps of a sensor's depth at 5 m", "steps grow with the square", ANSWER_VALUE, ask_step, NULL, fixed_step,
     .in = {5000}, .exact = {1}, .exact_count = 1},
    {"median of nothing", "0 of none", ANSWER_VALUE, ask_median, NULL, mean_of, .in = {0}, .exact = {0},
     .exact_count = 1},
    {"median with one value of 1e300", "order, not sums", ANSWER_VALUE, ask_median, NULL, mean_of,
     .in = {3, 1, 1e300, 2}, .exact = {2}, .exact_count = 1},
    {"background from behind the wall that was mapped", "in front of the sensor only", ANSWER_UNKNOWN, ask_background,
     NULL, through_the_back, .in = {3}, .unit = "mm"},
};
const struct stability_stage stability_depth = {"depth and segmentation", cases, COUNT_OF(cases)};
