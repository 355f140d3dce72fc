#include "tests/support/road_scene.h"

#include <stdlib.h>
#include <string.h>

static void add(struct road_scene *s, const double low[3], const double high[3], uint32_t color)
{
    struct box *b = &s->world.boxes[s->world.count++];
    *b = (struct box){.color = {(uint8_t)(color >> 16), (uint8_t)(color >> 8), (uint8_t)color}};
    memcpy(b->low, low, sizeof b->low);
    memcpy(b->high, high, sizeof b->high);
}

#define BOX(s, x0, y0, z0, x1, y1, z1, color) add(s, (double[3]){x0, y0, z0}, (double[3]){x1, y1, z1}, color)

static void build(struct road_scene *s)
{
    BOX(s, -30, -30, -1, 60, 30, 0, 0x585858);
    for (int side = -1; side <= 1; side += 2) {
        const double y = side * ROAD_LINE_Y;
        BOX(s, -30, y - 0.075, -0.01, 60, y + 0.075, 0.003, 0xd8d8d8);
        BOX(s, -30, side > 0 ? 3.5 : -5, 0, 60, side > 0 ? 5 : -3.5, 0.12, 0x908880);
    }
    BOX(s, 2, 7, 0, 12, 12, 6, 0x70a070);
    BOX(s, 15, 6.5, 0, 26, 12, 8, 0xa07060);
    BOX(s, -4, -12, 0, 6, -6.5, 7, 0x8080a0);
    BOX(s, 9, -12, 0, 22, -7, 5, 0xa0a070);
    BOX(s, 8, 2.2, 0, 12.5, 4, 1.9, 0x3050a0); // the van
    for (int i = 0; i < 4; i++) {
        const double x = 6.0 + 4 * i, y = i % 2 ? -4.2 : 4.3;
        BOX(s, x, y, 0, x + 0.14, y + 0.14, 4.5, 0xb0a090);
    }
}

static struct quat ahead(void)
{
    double level[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
    return quat_from_matrix(level);
}

static uint32_t next(uint32_t *state)
{
    *state ^= *state << 13, *state ^= *state >> 17, *state ^= *state << 5; // xorshift (Marsaglia 2003)
    return *state;
}

// Three line scanners on the vehicle: across the way, and slanting ahead and back.
static enum status scan(struct road_scene *s, uint32_t seed)
{
    enum { LINES = 220, RAYS = 180 };
    uint32_t random = seed;
    s->points = malloc((size_t)LINES * 3 * RAYS * sizeof *s->points);
    if (!s->points)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < LINES * 3 * RAYS; i++) {
        const double angle = 2 * 3.14159265358979 * (i % RAYS) / RAYS, slant = 0.8 * (i / RAYS % 3 - 1);
        const double from[3] = {-5 + 25.0 * (i / RAYS / 3) / LINES, 0, 1.9};
        const struct vec3 r = v3_unit(v3(slant, sin(angle), cos(angle)));
        const double ray[3] = {r.x, r.y, r.z};
        double away = box_world_cast(&s->world, from, ray, NULL);
        if (!(away > 0.5 && away < 40))
            continue;
        away += 0.01 * 1.7 * ((double)next(&random) / 4294967296.0 * 2 - 1);
        for (int k = 0; k < 3; k++)
            s->points[s->point_count][k] = (float)(from[k] + away * ray[k]);
        s->point_count++;
    }
    return OK;
}

enum status road_scene_make(struct road_scene *s, uint32_t seed)
{
    *s = (struct road_scene){0};
    build(s);
    enum status status = scan(s, seed);
    struct depth_options how = depth_default_options();
    how.sky = true;
    struct world_points points = {.xyz = (const float(*)[3])s->points, .count = s->point_count};
    for (int i = 0; i < ROAD_PANORAMAS && status == OK; i++) {
        uint8_t *rgb = malloc((size_t)ROAD_HEIGHT * ROAD_HEIGHT * 2 * 3);
        const struct pose at = {ahead(), v3(2.0 * i, 0, 2.1)};
        if (!rgb)
            return fail(ERR_MEMORY, "out of memory");
        box_world_panorama(&s->world, at, 2 * ROAD_HEIGHT, ROAD_HEIGHT, rgb);
        status = surround_picture_make(&s->pictures[i], rgb, 2 * ROAD_HEIGHT, ROAD_HEIGHT, NULL);
        if (status != OK)
            return status;
        surround_picture_place(&s->pictures[i], at);
        s->pictures[i].time_ns = i;
    }
    struct point_colors colors = {0};
    if (status == OK)
        status = point_colors_make(&colors, &points, s->pictures, ROAD_PANORAMAS);
    points.rgb = (const uint8_t(*)[4])colors.rgb;
    for (int i = 0; i < ROAD_PANORAMAS && status == OK; i++)
        status = dense_depth_make(&s->pictures[i], &points, &how);
    point_colors_free(&colors);
    return status;
}

void road_scene_free(struct road_scene *s)
{
    for (int i = 0; i < ROAD_PANORAMAS; i++)
        surround_picture_free(&s->pictures[i]);
    free(s->points);
    *s = (struct road_scene){0};
}

struct lens road_view_lens(int shrink)
{
    const double f = 483.0 / shrink;
    const int width = 640 / shrink, height = 512 / shrink;
    return (struct lens){
        .width = width, .height = height, .fx = f, .fy = f, .cx = (width - 1) / 2.0, .cy = (height - 1) / 2.0};
}

struct pose road_view(int number)
{
    const struct vec3 at = v3(0.7 + 1.3 * number, number % 2 ? -0.4 : 0.02, 1.38);
    return (struct pose){quat_multiply(quat_from_rotation_vector(v3(0, 0, number % 2 ? -0.02 : 0)), ahead()), at};
}

void road_view_truth(const struct road_scene *s, const struct lens *lens, struct pose world_from_view, uint8_t *rgb,
                     float *depth)
{
    const double from[3] = {world_from_view.translation.x, world_from_view.translation.y,
                            world_from_view.translation.z};
    for (int v = 0; v < lens->height; v++)
        for (int u = 0; u < lens->width; u++) {
            const struct vec3 c = v3_unit(v3((u - lens->cx) / lens->fx, (v - lens->cy) / lens->fy, 1));
            const struct vec3 d = quat_rotate(world_from_view.rotation, c);
            const double ray[3] = {d.x, d.y, d.z};
            const size_t i = (size_t)v * (size_t)lens->width + (size_t)u;
            memset(rgb + 3 * i, 0, 3);
            depth[i] = (float)(box_world_cast(&s->world, from, ray, rgb + 3 * i) * c.z);
        }
}

// Brightness of the road `x` ahead and `y` to the left of the camera; negative: outside the picture.
static double brightness(const uint8_t *rgb, const struct lens *lens, const struct pose *view_from_world,
                         struct vec3 world)
{
    const struct vec3 c = pose_apply(*view_from_world, world);
    const double u = lens->fx * c.x / c.z + lens->cx, v = lens->fy * c.y / c.z + lens->cy;
    if (!(c.z > 0.1 && u >= 0 && v >= 0 && u < lens->width - 1 && v < lens->height - 1))
        return -1;
    const int x = (int)u, y = (int)v;
    double sum = 0;
    for (int k = 0; k < 4; k++) {
        const uint8_t *p = rgb + 3 * ((size_t)(y + k / 2) * (size_t)lens->width + (size_t)(x + k % 2));
        sum += (p[0] + p[1] + p[2]) / 3.0 * (k % 2 ? u - x : 1 - u + x) * (k / 2 ? v - y : 1 - v + y);
    }
    return sum;
}

enum { ROWS = 60, COLUMNS = 100, BAND = 8, LEAST_ROWS = 20 };
#define ROW_M    0.08 // from 3.6 m ahead
#define COLUMN_M 0.02

// The brightest band of a line's width against the road to both of its sides, in one row across; its middle in metres.
static bool band_in_row(const double *row, double from, double *at)
{
    double sums[COLUMNS + 1] = {0}, best = 20;
    bool found = false;
    for (int i = 0; i < COLUMNS; i++)
        sums[i + 1] = sums[i] + row[i];
    for (int i = BAND; i + 2 * BAND <= COLUMNS; i++) {
        const double left = sums[i] - sums[i - BAND], middle = sums[i + BAND] - sums[i];
        const double right = sums[i + 2 * BAND] - sums[i + BAND];
        const double contrast = (middle - fmax(left, right)) / BAND;
        if (contrast > best) {
            // The middle of the brightness above the darker side
            const double darker = fmin(left, right) / BAND;
            double weight = 0, moment = 0;
            for (int k = i - 2; k < i + BAND + 2; k++) {
                const double w = fmax(0, row[k] - darker - 0.3 * contrast);
                weight += w;
                moment += w * k;
            }
            best = contrast;
            *at = from + moment / weight * COLUMN_M;
            found = true;
        }
    }
    return found;
}

// y at x = 6 of the straight line that most points lie on within 6 cm, fitted by least squares.
static double line_at_6(const double (*points)[2], int count)
{
    double best[5] = {0};
    for (int a = 0; a < count; a++)
        for (int b = a + 8; b < count; b += 3) {
            const double slope = (points[b][1] - points[a][1]) / (points[b][0] - points[a][0]);
            double sum[5] = {0};
            for (int i = 0; i < count; i++) {
                const double x = points[i][0] - 6, y = points[i][1];
                if (fabs(points[a][1] + slope * (points[i][0] - points[a][0]) - y) > 0.06)
                    continue;
                sum[0] += 1, sum[1] += x, sum[2] += y, sum[3] += x * x, sum[4] += x * y;
            }
            if (sum[0] > best[0])
                memcpy(best, sum, sizeof best);
        }
    if (best[0] < LEAST_ROWS)
        return NAN;
    return (best[3] * best[2] - best[1] * best[4]) / (best[0] * best[3] - best[1] * best[1]);
}

void road_find_lines(const uint8_t *rgb, const struct lens *lens, struct pose world_from_view, double lines[2])
{
    const struct pose view_from_world = pose_inverse(world_from_view);
    struct vec3 along = quat_rotate(world_from_view.rotation, v3(0, 0, 1));
    along = v3_unit(v3(along.x, along.y, 0));
    const struct vec3 left = v3(-along.y, along.x, 0), foot = world_from_view.translation;
    for (int side = 0; side < 2; side++) {
        double points[ROWS][2];
        int count = 0;
        const double from = side ? -2.6 : 0.6;
        for (int r = 0; r < ROWS; r++) {
            double row[COLUMNS], x = 3.6 + r * ROW_M;
            bool inside = true;
            for (int c = 0; c < COLUMNS; c++) {
                const struct vec3 at =
                    v3_add(v3(foot.x, foot.y, 0), v3_add(v3_scale(along, x), v3_scale(left, from + c * COLUMN_M)));
                row[c] = brightness(rgb, lens, &view_from_world, at);
                inside &= row[c] >= 0;
            }
            points[count][0] = x;
            count += inside && band_in_row(row, from, &points[count][1]);
        }
        lines[side] = line_at_6((const double(*)[2])points, count);
    }
}
