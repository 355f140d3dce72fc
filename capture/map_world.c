#include "capture/map_internal.h"
#include "capture/upright.h"

#include "locate/linear.h"

#include <stdlib.h>

static const double AGREE_COS = 0.985; // 10 degrees: hung by hand
static const double FLAT_COS = 0.94;   // 20 degrees: a surface that may be floor
static const double TILT_RAD = 0.14;   // 8 degrees: the floor may correct the tags by this much
enum { STEP_PX = 8, REACH_PX = 6, BINS = 800, MOST_FLOOR = 200000 };
static const double BIN_M = 0.01;

// A tag's direction that may point up: 0..4 are +y, -y, +x, -x (hanging, however
// turned; printed by OpenCV 4 it hangs upside down), +z (lying).
static struct vec3 direction(const struct map_tag *tag, int which)
{
    static const struct vec3 own[5] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}};
    return quat_rotate(tag->world_from_tag.rotation, own[which]);
}

// Up without tags: as most of the floors that single pictures show have it; as the camera
// was held where none does.
static struct vec3 seen_up(const struct map *m, struct vec3 held)
{
    struct vec3 up[MAP_MOST_FRAMES], best = held;
    int count = 0, most = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct floor_plane floor;
        if (m->frames[i].placed && m->frames[i].depth &&
            upright_floor(&m->calibration.depth, m->frames[i].depth, &floor))
            up[count++] = quat_rotate(quat_conjugate(m->frames[i].camera_from_world.rotation), floor.up);
    }
    for (int i = 0; i < count; i++) {
        struct vec3 sum = v3(0, 0, 0);
        int votes = 0;
        for (int k = 0; k < count; k++) {
            if (v3_dot(up[i], up[k]) > AGREE_COS) {
                sum = v3_add(sum, up[k]);
                votes++;
            }
        }
        if (votes > most) {
            most = votes;
            best = v3_unit(sum);
        }
    }
    return best;
}

// Up, as most tags have it; where that leaves a choice (all tags on one wall), as
// the camera was held.
static struct vec3 vote_up(const struct map *m)
{
    struct vec3 held = v3(0, 0, 0), best = v3(0, 0, 0);
    double most = -1e9;
    for (int32_t i = 0; i < m->frame_count; i++)
        if (m->frames[i].placed)
            held = v3_add(held, quat_rotate(quat_conjugate(m->frames[i].camera_from_world.rotation), v3(0, -1, 0)));
    held = v3_unit(held);
    if (m->reference < 0)
        return seen_up(m, held);
    for (int32_t i = 0; i < m->tag_count; i++) {
        for (int w = 0; w < 5 && m->tags[i].mapped; w++) {
            struct vec3 d = direction(&m->tags[i], w), sum = v3(0, 0, 0);
            double votes = 0;
            for (int32_t k = 0; k < m->tag_count; k++) {
                for (int v = 0; v < 5 && m->tags[k].mapped; v++) {
                    struct vec3 other = direction(&m->tags[k], v);
                    if (v3_dot(other, d) > AGREE_COS) {
                        sum = v3_add(sum, other);
                        votes += v < 2 || v == 4 ? 1 : 0.8; // few hang tags sideways
                        break;
                    }
                }
            }
            double score = votes + 2 * v3_dot(d, held);
            if (score > most) {
                most = score;
                best = v3_unit(sum);
            }
        }
    }
    return best;
}

struct surface {
    struct vec3 *points; // world
    double *weights, *areas;
    int32_t count;
};

static bool depth_point(const struct map *m, const struct map_frame *f, int x, int y, struct vec3 *out)
{
    const struct lens *lens = &m->calibration.color;
    if (x < 0 || y < 0 || x >= lens->width || y >= lens->height)
        return false;
    double z = f->depth[(size_t)y * (size_t)lens->width + (size_t)x] * 1e-3;
    if (!(z > 0.3) || z > 6)
        return false;
    *out = v3_scale(lens_ray(lens, (struct pixel){x, y}), z);
    return true;
}

// Points of depth whose surroundings face up.
static void collect_flat(const struct map *m, struct vec3 up, struct surface *s)
{
    const struct lens *lens = &m->calibration.color;
    int32_t pictures = 0;
    for (int32_t i = 0; i < m->frame_count; i++)
        pictures += m->frames[i].placed && m->frames[i].depth;
    int step = STEP_PX;
    while ((int64_t)pictures * (lens->width / step) * (lens->height / step) > MOST_FLOOR)
        step += 2;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        if (!f->placed || !f->depth)
            continue;
        struct pose world_from_camera = pose_inverse(f->camera_from_world);
        struct vec3 camera_up = quat_rotate(f->camera_from_world.rotation, up);
        for (int y = step; y < lens->height - step; y += step) {
            for (int x = step; x < lens->width - step; x += step) {
                struct vec3 p, l, r, t, b;
                if (s->count == MOST_FLOOR || !depth_point(m, f, x, y, &p) || !depth_point(m, f, x - REACH_PX, y, &l) ||
                    !depth_point(m, f, x + REACH_PX, y, &r) || !depth_point(m, f, x, y - REACH_PX, &t) ||
                    !depth_point(m, f, x, y + REACH_PX, &b))
                    continue;
                struct vec3 normal = v3_unit(v3_cross(v3_sub(r, l), v3_sub(t, b))); // towards the camera
                double facing = -v3_dot(normal, v3_unit(p));
                if (v3_dot(normal, camera_up) < FLAT_COS || facing < 0.1)
                    continue;
                s->points[s->count] = pose_apply(world_from_camera, p);
                s->weights[s->count] = 1 / (depth_sigma(p.z) * depth_sigma(p.z));
                s->areas[s->count++] = p.z * p.z * step * step / (lens->fx * lens->fy * facing);
            }
        }
    }
}

// The lowest height at which much flat surface lies. False: nowhere.
static bool lowest_level(const struct surface *s, struct vec3 up, double *height)
{
    double area[BINS] = {0}, low = 1e9, most = 0;
    for (int32_t i = 0; i < s->count; i++)
        low = fmin(low, v3_dot(up, s->points[i]));
    for (int32_t i = 0; i < s->count; i++) {
        int bin = (int)((v3_dot(up, s->points[i]) - low) / BIN_M);
        if (bin >= 0 && bin < BINS)
            area[bin] += s->areas[i];
    }
    double level[BINS] = {0};
    for (int i = 0; i < BINS; i++) {
        for (int k = -3; k <= 3; k++)
            level[i] += i + k >= 0 && i + k < BINS ? area[i + k] : 0;
        most = fmax(most, level[i]);
    }
    if (most < 0.5) // square metres, the same floor counted once for each frame
        return false;
    for (int i = 0; i < BINS; i++) {
        bool peak = level[i] > 0.3 * most;
        for (int k = -5; k <= 5; k++)
            peak = peak && (i + k < 0 || i + k >= BINS || level[i] >= level[i + k]);
        if (peak) {
            *height = low + (i + 0.5) * BIN_M;
            return true;
        }
    }
    return false;
}

// Fits the plane up . p = height to what lies near it. False: too little, too narrow, too tilted.
static bool fit_floor(const struct surface *s, struct vec3 *up, double *height)
{
    struct vec3 u = *up, x = v3_perpendicular(u), y = v3_cross(u, x);
    double a = 0, b = 0, c = *height;
    for (int round = 0; round < 6; round++) {
        double n[9] = {0}, g[3] = {0};
        for (int32_t i = 0; i < s->count; i++) {
            double px = v3_dot(x, s->points[i]), py = v3_dot(y, s->points[i]);
            double error = v3_dot(u, s->points[i]) - (a * px + b * py + c), sigma = 1 / sqrt(s->weights[i]);
            double bound = fmax(2 * sigma, round ? 0.01 : 0.03), weight = s->weights[i];
            weight /= (1 + error * error / (bound * bound)) * (1 + error * error / (bound * bound));
            const double q[3] = {px, py, 1};
            for (int k = 0; k < 3; k++) {
                g[k] += weight * q[k] * (error + a * px + b * py + c);
                for (int l = 0; l < 3; l++)
                    n[k * 3 + l] += weight * q[k] * q[l];
            }
        }
        double total = n[8], mx = n[6] / total, my = n[7] / total;
        double xx = n[0] / total - mx * mx, yy = n[4] / total - my * my, xy = n[3] / total - mx * my;
        double narrow = (xx + yy) / 2 - sqrt((xx - yy) * (xx - yy) / 4 + xy * xy);
        if (!(narrow > 0.2 * 0.2) || !cholesky(n, 3))
            return false;
        cholesky_solve(n, 3, g);
        a = g[0], b = g[1], c = g[2];
    }
    if (!(atan(hypot(a, b)) < TILT_RAD))
        return false;
    struct vec3 normal = v3_sub(u, v3_add(v3_scale(x, a), v3_scale(y, b)));
    double length = v3_length(normal);
    *up = v3_scale(normal, 1 / length);
    *height = c / length;
    return true;
}

// OK, or NOTHING without a floor in depth.
static enum status find_floor(const struct map *m, struct vec3 *up, double *height)
{
    if (!m->calibration.registered || !m->calibration.depth.width)
        return NOTHING;
    struct surface s = {malloc(MOST_FLOOR * sizeof(struct vec3)), malloc(MOST_FLOOR * sizeof(double)),
                        malloc(MOST_FLOOR * sizeof(double)), 0};
    enum status status = NOTHING;
    if (s.points && s.weights && s.areas) {
        collect_flat(m, *up, &s);
        // Twice: the first time `up` is only as good as the tags hang.
        for (int round = 0; round < 2; round++)
            if (lowest_level(&s, *up, height) && fit_floor(&s, up, height))
                status = OK;
    } else {
        status = fail(ERR_MEMORY, "no memory to look for the floor");
    }
    free(s.points);
    free(s.weights);
    free(s.areas);
    return status;
}

static void transform(struct map *m, struct pose new_from_old)
{
    struct pose old_from_new = pose_inverse(new_from_old);
    for (int32_t i = 0; i < m->frame_count; i++)
        if (m->frames[i].placed)
            m->frames[i].camera_from_world = pose_multiply(m->frames[i].camera_from_world, old_from_new);
    for (int32_t i = 0; i < m->tag_count; i++)
        if (m->tags[i].mapped)
            m->tags[i].world_from_tag = pose_multiply(new_from_old, m->tags[i].world_from_tag);
    for (int32_t i = 0; i < m->point_count; i++)
        m->points[i].world = pose_apply(new_from_old, m->points[i].world);
}

// world_from_camera of the first frame that is placed.
static struct pose first_camera(const struct map *m)
{
    int32_t i = 0;
    while (i + 1 < m->frame_count && !m->frames[i].placed)
        i++;
    return pose_inverse(m->frames[i].camera_from_world);
}

static double lowest_point(const struct map *m, struct vec3 up)
{
    double low = 1e9;
    for (int32_t i = 0; i < m->point_count; i++)
        low = fmin(low, v3_dot(up, m->points[i].world));
    return m->point_count ? low : 0;
}

enum status map_level(struct map *m, bool *floor)
{
    struct vec3 up = vote_up(m);
    double height = 1e9;
    enum status status = find_floor(m, &up, &height);
    if (status < 0)
        return status;
    *floor = status == OK;
    const struct map_tag *first = NULL;
    for (int32_t i = 0; i < m->tag_count; i++) {
        const struct map_tag *tag = &m->tags[i];
        if (!tag->mapped)
            continue;
        if (!first || tag->id < first->id)
            first = tag;
        struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
        struct vec3 corner[4];
        place_tag_corners(&own, corner);
        for (int k = 0; k < 4 && !*floor; k++)
            height = fmin(height, v3_dot(up, corner[k]));
    }
    if (!first && !*floor)
        height = lowest_point(m, up);
    // x as the lowest tag has it; as its y where it hangs sideways and x is steep. Without a
    // tag, as the first picture has it.
    struct pose from = first ? first->world_from_tag : first_camera(m);
    struct vec3 x = quat_rotate(from.rotation, v3(1, 0, 0));
    if (fabs(v3_dot(x, up)) > 0.8)
        x = quat_rotate(from.rotation, v3(0, 1, 0));
    x = v3_unit(v3_sub(x, v3_scale(up, v3_dot(x, up))));
    struct vec3 y = v3_cross(up, x);
    double turn[3][3] = {{x.x, x.y, x.z}, {y.x, y.y, y.z}, {up.x, up.y, up.z}};
    struct pose new_from_old = {quat_from_matrix(turn), {0, 0, 0}};
    struct vec3 centre = quat_rotate(new_from_old.rotation, from.translation);
    new_from_old.translation = v3(-centre.x, -centre.y, -height);
    transform(m, new_from_old);
    return OK;
}
