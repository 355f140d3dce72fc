#include "surround/picture/surround_picture.h"

#include "base/clamp.h"
#include "base/portable_math.h"
#include "surround/picture/picture_lanes.h"
#include "surround/picture/surround_mesh.h"

#include <stdlib.h>
#include <string.h>

// Each of a vector's lower bytes, then one of another's.
#define ORDER_BYTES 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23
#define PI          3.14159265358979323846

enum status surround_picture_make(struct surround_picture *p, uint8_t *rgb, int width, int height,
                                  const struct lens *lens)
{
    *p = (struct surround_picture){.panorama = !lens, .width = width, .height = height, .rgb = rgb, .gain = {1, 1, 1}};
    if (lens)
        p->lens = *lens;
    p->ray_table = malloc(sizeof *p->ray_table * 2 * (size_t)(width + height));
    if (!p->ray_table) {
        surround_picture_free(p);
        return fail(ERR_MEMORY, "no memory for a picture of the surroundings");
    }
    for (int i = 0; i < width + height; i++) {
        const double angle = i < width ? (i + 0.5) / width * 2 * PI - PI : (i - width + 0.5) / height * PI;
        p->ray_table[2 * i] = (float)portable_sin(angle);
        p->ray_table[2 * i + 1] = (float)portable_cos(angle);
    }
    surround_picture_place(p, POSE_IDENTITY);
    return OK;
}

enum status surround_image_undistort(uint8_t *rgb, struct lens *lens)
{
    const size_t w = (size_t)lens->width, bytes = w * (size_t)lens->height * 3;
    if (lens_is_ideal(lens))
        return OK;
    uint8_t *taken = malloc(bytes);
    if (!taken)
        return fail(ERR_MEMORY, "no memory for a picture of the surroundings");
    memcpy(taken, rgb, bytes);
    const double largest = lens_max_radius2(lens);
    for (int v = 0; v < lens->height; v++)
        for (int u = 0; u < lens->width; u++) {
            const struct vec3 ray = v3((u - lens->cx) / lens->fx, (v - lens->cy) / lens->fy, 1);
            const struct pixel at = lens_project_clamped(lens, largest, ray);
            const double x = fmax(0, fmin(lens->width - 1.001, at.x)), y = fmax(0, fmin(lens->height - 1.001, at.y));
            const uint8_t *p = taken + 3 * ((size_t)y * w + (size_t)x);
            const double fx = x - (int)x, fy = y - (int)y;
            for (size_t c = 0; c < 3; c++)
                rgb[3 * ((size_t)v * w + (size_t)u) + c] =
                    (uint8_t)((1 - fy) * ((1 - fx) * p[c] + fx * p[c + 3]) +
                              fy * ((1 - fx) * p[c + 3 * w] + fx * p[c + 3 * w + 3]) + 0.5);
        }
    free(taken);
    lens->k1 = lens->k2 = lens->p1 = lens->p2 = lens->k3 = 0;
    return OK;
}

void surround_picture_free(struct surround_picture *picture)
{
    free(picture->rgb);
    free(picture->inverse);
    free(picture->joined);
    surround_picture_free_mesh(picture);
    free(picture->ray_table);
    *picture = (struct surround_picture){0};
}

void surround_picture_place(struct surround_picture *picture, struct pose world_from_camera)
{
    picture->world_from_camera = world_from_camera;
    quat_to_matrix(world_from_camera.rotation, picture->axes);
}

void surround_picture_ray(const struct surround_picture *picture, int u, int v, float ray[3])
{
    if (picture->panorama) {
        const float *column = picture->ray_table + 2 * u, *row = picture->ray_table + 2 * (picture->width + v);
        ray[0] = row[0] * column[0];
        ray[1] = -row[1];
        ray[2] = row[0] * column[1];
        return;
    }
    const float x = (float)((u - picture->lens.cx) / picture->lens.fx),
                y = (float)((v - picture->lens.cy) / picture->lens.fy);
    const float scale = 1 / sqrtf(x * x + y * y + 1);
    ray[0] = x * scale;
    ray[1] = y * scale;
    ray[2] = scale;
}

void surround_picture_rays(const struct surround_picture *picture, int u, int v, four ray[3])
{
    if (picture->panorama) {
        const float *row = picture->ray_table + 2 * (picture->width + v);
        four a, b;
        memcpy(&a, picture->ray_table + 2 * u, sizeof a);
        memcpy(&b, picture->ray_table + 2 * u + 4, sizeof b);
        ray[0] = row[0] * __builtin_shufflevector(a, b, 0, 2, 4, 6);
        ray[1] = FOUR(-row[1]);
        ray[2] = row[0] * __builtin_shufflevector(a, b, 1, 3, 5, 7);
        return;
    }
    const four_doubles column = {u, u + 1, u + 2, u + 3};
    const four x = __builtin_convertvector((column - picture->lens.cx) / picture->lens.fx, four);
    const float y = (float)((v - picture->lens.cy) / picture->lens.fy);
    const four scale = 1 / four_sqrt(x * x + y * y + 1);
    ray[0] = x * scale;
    ray[1] = y * scale;
    ray[2] = scale;
}

float surround_picture_distance(const struct surround_picture *picture, const double world[3], float camera[3])
{
    const struct vec3 *t = &picture->world_from_camera.translation;
    const double d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    for (int i = 0; i < 3; i++)
        camera[i] = (float)(picture->axes[0][i] * d[0] + picture->axes[1][i] * d[1] + picture->axes[2][i] * d[2]);
    return sqrtf(camera[0] * camera[0] + camera[2] * camera[2] + camera[1] * camera[1]);
}

bool surround_picture_find(const struct surround_picture *picture, const float c[3], struct picture_point *out)
{
    if (picture->panorama) {
        const float flat2 = c[0] * c[0] + c[2] * c[2];
        const float w = (float)picture->width, h = (float)picture->height;
        out->u = (fast_atan2(c[0], c[2]) * (float)(1 / (2 * PI)) + 0.5f) * w - 0.5f;
        out->v = fast_atan2(sqrtf(flat2), -c[1]) * (float)(1 / PI) * h - 0.5f;
        if (out->u >= w - 0.5f)
            out->u -= w;
        return out->distance > 1e-6f;
    }
    if (c[2] < 1e-3f)
        return false;
    out->u = (float)(picture->lens.fx * (double)(c[0] / c[2]) + picture->lens.cx);
    out->v = (float)(picture->lens.fy * (double)(c[1] / c[2]) + picture->lens.cy);
    return out->u > -0.5f && out->v > -0.5f && out->u < (float)picture->width - 0.5f &&
           out->v < (float)picture->height - 0.5f;
}

bool surround_picture_project(const struct surround_picture *picture, const double world[3], struct picture_point *out)
{
    float camera[3];
    out->distance = surround_picture_distance(picture, world, camera);
    return surround_picture_find(picture, camera, out);
}

void surround_picture_distances(const struct surround_picture *picture, const four_doubles world[3], four camera[3],
                                struct four_points *out)
{
    const struct vec3 *t = &picture->world_from_camera.translation;
    const four_doubles d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    for (int i = 0; i < 3; i++) {
        const four_doubles sum = picture->axes[0][i] * d[0] + picture->axes[1][i] * d[1] + picture->axes[2][i] * d[2];
        camera[i] = __builtin_convertvector(sum, four);
    }
    out->distance = four_sqrt(camera[0] * camera[0] + camera[2] * camera[2] + camera[1] * camera[1]);
}

void surround_picture_find_four(const struct surround_picture *picture, const four c[3], struct four_points *out)
{
    const float w = (float)picture->width, h = (float)picture->height;
    if (picture->panorama) {
        const four flat = four_sqrt(c[0] * c[0] + c[2] * c[2]);
        const four u = (four_atan2(c[0], c[2]) * (float)(1 / (2 * PI)) + 0.5f) * w - 0.5f;
        out->u = FOUR_SELECT(u >= w - 0.5f, u - w, u);
        out->v = four_atan2(flat, -c[1]) * (float)(1 / PI) * h - 0.5f;
        out->inside = out->distance > 1e-6f;
        return;
    }
    const four_doubles x = __builtin_convertvector(c[0] / c[2], four_doubles);
    const four_doubles y = __builtin_convertvector(c[1] / c[2], four_doubles);
    out->u = __builtin_convertvector(picture->lens.fx * x + picture->lens.cx, four);
    out->v = __builtin_convertvector(picture->lens.fy * y + picture->lens.cy, four);
    out->inside = (c[2] >= 1e-3f) & (out->u > -0.5f) & (out->v > -0.5f) & (out->u < w - 0.5f) & (out->v < h - 0.5f);
}

static void catmull_rom(float t, float weight[4])
{
    weight[0] = ((-0.5f * t + 1) * t - 0.5f) * t;
    weight[1] = (1.5f * t - 2.5f) * t * t + 1;
    weight[2] = ((-1.5f * t + 2) * t + 0.5f) * t;
    weight[3] = (0.5f * t - 0.5f) * t * t;
}

static int column_of(const struct surround_picture *picture, int u)
{
    return clamp_int(surround_picture_column(picture, u), 0, picture->width - 1);
}

typedef uint8_t bytes16 __attribute__((vector_size(16)));
typedef uint16_t words8 __attribute__((vector_size(16)));

// Red, green and blue of a pixel as numbers; the fourth means nothing. Reads four bytes.
static four pixel_color(const uint8_t *rgb)
{
    uint32_t four_bytes;
    memcpy(&four_bytes, rgb, sizeof four_bytes);
    const bytes16 none = {0}, bytes = (bytes16)(four_ints){(int32_t)four_bytes};
    const words8 words = (words8)__builtin_shufflevector(bytes, none, ORDER_BYTES), no_words = {0};
    return __builtin_convertvector((four_ints)__builtin_shufflevector(words, no_words, 0, 8, 1, 9, 2, 10, 3, 11), four);
}

void surround_picture_sample(const struct surround_picture *picture, float u, float v, float rgb[3])
{
    const int x = floor_of(u), y = floor_of(v);
    const bool within = x >= 1 && x + 3 < picture->width; // and a pixel more, whose first byte is read
    float wx[4], wy[4];
    four sum = {0};
    catmull_rom(u - (float)x, wx);
    catmull_rom(v - (float)y, wy);
    for (int j = 0; j < 4; j++) {
        const int row = clamp_int(y + j - 1, 0, picture->height - 1);
        const uint8_t *from = picture->rgb + 3 * (size_t)row * (size_t)picture->width;
        four line = {0};
        for (int i = 0; i < 4; i++) {
            const int column = within ? x + i - 1 : column_of(picture, x + i - 1);
            const uint8_t *pixel = from + 3 * (size_t)column;
            line += wx[i] * (within ? pixel_color(pixel) : (four){pixel[0], pixel[1], pixel[2]});
        }
        sum += wy[j] * line;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = clamp_float(sum[c] * picture->gain[c], 0, 255);
}

// Whether b follows a on one surface: little apart, or on the line through what lies before a or after b.
static bool is_continuous(float before, float a, float b, float after)
{
    if (a < 0 || b < 0)
        return false;
    const float tolerance = 0.03f * (a > b ? a : b);
    return fabsf(b - a) <= tolerance || (before >= 0 && fabsf(2 * a - before - b) <= tolerance) ||
           (after >= 0 && fabsf(2 * b - after - a) <= tolerance);
}

void surround_picture_join(struct surround_picture *picture)
{
    const int w = picture->width, h = picture->height;
    for (int v = 0; v < h; v++)
        for (int u = 0; u < w; u++) {
            const float *row = picture->inverse + (size_t)v * (size_t)w;
            const bool last = !picture->panorama && u == w - 1;
            uint8_t joined = 0;
            if (!last && is_continuous(row[column_of(picture, u - 1)], row[u], row[column_of(picture, u + 1)],
                                       row[column_of(picture, u + 2)]))
                joined |= JOINED_RIGHT;
            if (v + 1 < h &&
                is_continuous(row[v > 0 ? u - w : u], row[u], row[u + w], row[v + 2 < h ? u + 2 * w : u + w]))
                joined |= JOINED_DOWN;
            picture->joined[(size_t)v * (size_t)w + (size_t)u] = joined;
        }
    for (int v = 0; v + 1 < h; v++)
        for (int u = 0; u < w; u++) {
            uint8_t *here = picture->joined + (size_t)v * (size_t)w + (size_t)u;
            const uint8_t *right = picture->joined + (size_t)v * (size_t)w + (size_t)column_of(picture, u + 1);
            if ((*here & 3) == 3 && (*right & JOINED_DOWN) && (here[w] & JOINED_RIGHT))
                *here |= JOINED_DIAGONAL;
        }
}
