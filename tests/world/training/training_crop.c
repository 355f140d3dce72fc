#include "tests/world/training/training_crop.h"

#include <stdlib.h>
#include <string.h>

#define TOO_SMALL_SHARE 0.2  // of squares about a person: without up to a third of what is seen of the person
#define FURNITURE_SHARE 0.12 // of squares where a person is: about furniture beside it

struct square {
    double x, y, side; // middle and side, pixels
};

static bool is_own(uint8_t part) { return part != TRAINING_NOTHING && part != TRAINING_OTHER; }

static struct square square_about_person(const struct training_image *image, struct rng *rng)
{
    int x0 = image->width, x1 = -1, y0 = image->height, y1 = -1;
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++)
            if (is_own(image->part[y * image->width + x])) {
                x0 = x < x0 ? x : x0;
                x1 = x > x1 ? x : x1;
                y0 = y < y0 ? y : y0;
                y1 = y > y1 ? y : y1;
            }
    if (rng_uniform(rng) < TOO_SMALL_SHARE) {
        int *const edges[4] = {&x0, &x1, &y0, &y1};
        const int which = rng_pick(rng, 4), extent = which < 2 ? x1 - x0 : y1 - y0,
                  lost = (int)(extent * rng_between(rng, 0, 0.35));
        *edges[which] += which % 2 ? -lost : lost;
    }
    const double side = fmax(x1 - x0, y1 - y0) + 1;
    struct square out = {.side = side * rng_between(rng, 1.04, 1.3)};
    out.x = 0.5 * (x0 + x1) + side * rng_between(rng, -0.06, 0.06);
    out.y = 0.5 * (y0 + y1) + side * rng_between(rng, -0.06, 0.06);
    return out;
}

static struct square square_anywhere(const struct training_scene *scene, const struct training_image *image,
                                     struct rng *rng)
{
    const int x = rng_pick(rng, image->width), y = rng_pick(rng, image->height),
              mm = image->depth[y * image->width + x];
    return (struct square){x, y, scene->lens.fx * rng_between(rng, 0.8, 2) / fmax(0.8, 1e-3 * mm)};
}

// About a piece of furniture; false: it is not in the picture, or too much of the person is in the square, too.
static bool square_about_solid(const struct training_scene *scene, const struct training_image *image, struct rng *rng,
                               struct square *out)
{
    if (!scene->solid_count)
        return false;
    const struct training_solid *solid = &scene->solid[rng_pick(rng, scene->solid_count)];
    const struct pose camera_from_world = pose_inverse(scene->world_from_camera);
    const struct vec3 half = solid->kind == SOLID_BOX ? solid->half : v3(0.2, 0.2, 0.2);
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    for (int i = 0; i < 8; i++) {
        const struct vec3 corner = v3(i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z);
        const struct vec3 turned = v3(cos(solid->turned) * corner.x - sin(solid->turned) * corner.y,
                                      sin(solid->turned) * corner.x + cos(solid->turned) * corner.y, corner.z);
        const struct vec3 p = pose_apply(camera_from_world, v3_add(solid->at, turned));
        const double px[2] = {scene->lens.fx * p.x / p.z + scene->lens.cx, scene->lens.fy * p.y / p.z + scene->lens.cy};
        if (p.z < 0.3)
            return false;
        for (int k = 0; k < 2; k++) {
            low[k] = fmax(0, fmin(low[k], px[k]));
            high[k] = fmin((k ? image->height : image->width) - 1, fmax(high[k], px[k]));
        }
    }
    const double side = fmax(high[0] - low[0], high[1] - low[1]) + 1;
    *out = (struct square){0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), side * rng_between(rng, 1.04, 1.3)};
    int own = 0, inside = 0;
    for (int i = 0; i < image->width * image->height; i++)
        if (is_own(image->part[i])) {
            own++;
            inside +=
                fabs(i % image->width - out->x) < out->side / 2 && fabs(i / image->width - out->y) < out->side / 2;
        }
    return low[0] < high[0] && low[1] < high[1] && side > 12 && inside * 5 <= own;
}

static int compare_depths(const void *a, const void *b)
{
    return (int)*(const uint16_t *)a - (int)*(const uint16_t *)b;
}

// The median of the person's readings; where there is no person, what a third of the readings is nearer than. 0: none.
static double middle_m(const struct training_crop *crop)
{
    uint16_t readings[CROP_CELLS * CROP_CELLS];
    size_t count = 0;
    for (int i = 0; i < CROP_CELLS * CROP_CELLS; i++)
        if (crop->depth[i] && (!crop->person || is_own(crop->part[i])))
            readings[count++] = crop->depth[i];
    if (count < 60)
        return 0;
    qsort(readings, count, sizeof *readings, compare_depths);
    return 1e-3 * readings[crop->person ? count / 2 : count / 3];
}

bool training_crop_make(const struct training_scene *scene, const struct training_image *image,
                        struct training_crop *out)
{
    struct rng rng = {scene->noise_seed ^ 0x9e3779b97f4a7c15u};
    if (scene->person_count && !image->person)
        return false;
    struct square square;
    const bool furniture =
        rng_uniform(&rng) < (image->person ? FURNITURE_SHARE : 0.5) && square_about_solid(scene, image, &rng, &square);
    if (!furniture)
        square = image->person ? square_about_person(image, &rng) : square_anywhere(scene, image, &rng);
    memset(out, 0, sizeof *out);
    out->cell_px = (float)(square.side / CROP_CELLS);
    out->left_px = (float)(square.x - square.side / 2 + 0.5);
    out->top_px = (float)(square.y - square.side / 2 + 0.5);
    out->fx = (float)scene->lens.fx;
    out->fy = (float)scene->lens.fy;
    out->cx = (float)scene->lens.cx;
    out->cy = (float)scene->lens.cy;
    out->facing_rad = (float)image->facing_rad;
    out->cut = (float)image->cut;
    out->hidden = (float)image->hidden;
    out->person = image->person && !furniture;
    out->sensor = (uint8_t)scene->sensor;
    out->posture = (uint8_t)scene->person[0].posture;
    for (int i = 0; i < CROP_CELLS; i++)
        for (int j = 0; j < CROP_CELLS; j++) {
            const int x = (int)floor((double)out->left_px + (double)out->cell_px * (j + 0.5)),
                      y = (int)floor((double)out->top_px + (double)out->cell_px * (i + 0.5));
            if (x < 0 || y < 0 || x >= image->width || y >= image->height)
                continue;
            out->depth[i * CROP_CELLS + j] = image->depth[y * image->width + x];
            out->part[i * CROP_CELLS + j] = image->part[y * image->width + x];
        }
    for (int j = 0; j < JOINT_COUNT && out->person; j++) {
        const struct vec3 p = image->joints.joint[j];
        const float values[4] = {(float)p.x, (float)p.y, (float)p.z, image->joints.confidence[j]};
        memcpy(out->joint[j], values, sizeof values);
    }
    out->middle_m = (float)middle_m(out);
    return out->middle_m > 0;
}
