#include "tests/world/training/training_image.h"

#include "base/clamp.h"
#include "tests/world/numbers.h"
#include "tests/world/world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const float FAR_M = 60;

struct screen_vertex {
    float x, y, z; // pixels, metres
};

struct training_renderer {
    struct vec3 *at;
    struct vec3f *normal;
    struct screen_vertex *screen;
    float person_m[TRAINING_PIXELS], room_m[TRAINING_PIXELS]; // z; 0: nothing
    uint16_t exact[TRAINING_PIXELS];                          // mm
};

enum status training_renderer_open(struct training_renderer **out, const struct training_people *people)
{
    struct training_renderer *r = *out = calloc(1, sizeof *r);
    size_t most_vertices = 1;
    for (int i = 0; i < people->figure_count; i++) {
        const size_t count = (size_t)people->figures[i].mesh.vertex_count;
        most_vertices = count > most_vertices ? count : most_vertices;
    }
    if (r) {
        r->at = malloc(most_vertices * sizeof *r->at);
        r->normal = malloc(most_vertices * sizeof *r->normal);
        r->screen = malloc(most_vertices * sizeof *r->screen);
    }
    if (r && r->at && r->normal && r->screen)
        return OK;
    training_renderer_close(out);
    return fail(ERR_MEMORY, "no memory to render training images");
}

void training_renderer_close(struct training_renderer **renderer)
{
    struct training_renderer *r = *renderer;
    if (!r)
        return;
    free(r->at);
    free(r->normal);
    free(r->screen);
    free(r);
    *renderer = NULL;
}

// ---------------------------------------------------------------- people

struct layer {
    const struct lens *lens;
    float *z;      // per pixel; 0: nothing
    uint8_t *part; // of the nearest
};

static void draw_triangle(const struct layer *layer, const struct screen_vertex v[3], uint8_t part)
{
    const float area = (v[1].x - v[0].x) * (v[2].y - v[0].y) - (v[1].y - v[0].y) * (v[2].x - v[0].x);
    if (!(area < -1e-6f)) // y points down: anticlockwise from outside is clockwise in the image
        return;
    const float low_x = minf(v[0].x, minf(v[1].x, v[2].x)), high_x = maxf(v[0].x, maxf(v[1].x, v[2].x));
    const float low_y = minf(v[0].y, minf(v[1].y, v[2].y)), high_y = maxf(v[0].y, maxf(v[1].y, v[2].y));
    const int width = layer->lens->width, height = layer->lens->height;
    const int x0 = (int)maxf(0, ceilf(low_x)), x1 = (int)minf((float)(width - 1), floorf(high_x)),
              y0 = (int)maxf(0, ceilf(low_y)), y1 = (int)minf((float)(height - 1), floorf(high_y));
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            const float fx = (float)x, fy = (float)y;
            const float a = ((v[1].x - fx) * (v[2].y - fy) - (v[1].y - fy) * (v[2].x - fx)) / area,
                        b = ((v[2].x - fx) * (v[0].y - fy) - (v[2].y - fy) * (v[0].x - fx)) / area, c = 1 - a - b;
            if (a < 0 || b < 0 || c < 0)
                continue;
            const float z = 1 / (a / v[0].z + b / v[1].z + c / v[2].z);
            const size_t pixel = (size_t)y * (size_t)width + (size_t)x;
            if (layer->z[pixel] > 0 && layer->z[pixel] <= z)
                continue;
            layer->z[pixel] = z;
            layer->part[pixel] = part;
        }
}

static void project(struct training_renderer *renderer, const struct training_scene *scene, int vertices)
{
    const struct pose camera_from_world = pose_inverse(scene->world_from_camera);
    double m[3][3];
    quat_to_matrix(camera_from_world.rotation, m);
    const struct vec3 t = camera_from_world.translation;
    for (int i = 0; i < vertices; i++) {
        const struct vec3 p = renderer->at[i];
        const double x = m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + t.x,
                     y = m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + t.y,
                     z = m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + t.z, in_front = fmax(z, 0.05);
        renderer->screen[i] = (struct screen_vertex){(float)(scene->lens.fx * x / in_front + scene->lens.cx),
                                                     (float)(scene->lens.fy * y / in_front + scene->lens.cy), (float)z};
    }
}

// label 0: the bone that moves the triangle most, plus 1.
static void draw_person(struct training_renderer *renderer, const struct training_scene *scene,
                        const struct training_person *person, uint8_t label, const struct layer *layer)
{
    const struct figure *figure = person->figure;
    figure_pose(figure, &person->posed, 0, figure->mesh.vertex_count, renderer->at, renderer->normal);
    project(renderer, scene, figure->mesh.vertex_count);
    for (int i = 0; i < figure->mesh.triangle_count; i++) {
        const int *t = figure->mesh.triangles[i];
        const struct screen_vertex v[3] = {renderer->screen[t[0]], renderer->screen[t[1]], renderer->screen[t[2]]};
        if (v[0].z < 0.1f || v[1].z < 0.1f || v[2].z < 0.1f)
            continue;
        draw_triangle(layer, v, label ? label : (uint8_t)(1 + figure->bindings[t[0]].bone[0]));
    }
}

// The share of the body's vertices that are outside of the picture, or behind the camera.
static double share_outside(const struct training_renderer *renderer, const struct lens *lens, int vertices)
{
    int outside = 0;
    for (int i = 0; i < vertices; i++) {
        const struct screen_vertex *v = &renderer->screen[i];
        outside += v->z < 0.1f || v->x < -0.5f || v->y < -0.5f || v->x > (float)lens->width - 0.5f ||
                   v->y > (float)lens->height - 0.5f;
    }
    return (double)outside / vertices;
}

// ---------------------------------------------------------------- room

struct ray {
    struct vec3 eye, way; // way: z of the camera's axes is 1 along it
};

static double box_distance(const struct training_solid *box, const struct ray *ray, double nearest)
{
    const double c = cos(box->turned), s = sin(box->turned);
    const struct vec3 e = v3_sub(ray->eye, box->at), w = ray->way;
    const double from[3] = {c * e.x + s * e.y, -s * e.x + c * e.y, e.z},
                 way[3] = {c * w.x + s * w.y, -s * w.x + c * w.y, w.z},
                 half[3] = {box->half.x, box->half.y, box->half.z};
    double enter = 0.05, leave = nearest;
    for (int k = 0; k < 3; k++) {
        const double inverse = 1 / (fabs(way[k]) < 1e-9 ? 1e-9 : way[k]), a = (-half[k] - from[k]) * inverse,
                     b = (half[k] - from[k]) * inverse;
        enter = most(enter, least(a, b));
        leave = least(leave, most(a, b));
    }
    return enter < leave ? enter : nearest;
}

// A capsule: the sphere about the axis' point that is nearest to the ray; exact at right angles, near it else.
static double rod_distance(const struct training_solid *rod, const struct ray *ray, double nearest)
{
    const struct vec3 along = v3_sub(rod->to, rod->at), e = v3_sub(ray->eye, rod->at);
    const double aa = v3_dot(along, along), aw = v3_dot(along, ray->way), ww = v3_dot(ray->way, ray->way),
                 ae = v3_dot(along, e), we = v3_dot(ray->way, e), det = aa * ww - aw * aw;
    const double share = det > 1e-12 ? least(1, most(0, (ae * ww - aw * we) / det)) : 0;
    const struct vec3 to = v3_sub(v3_scale(along, share), e);
    const double middle = v3_dot(to, ray->way) / ww, away2 = v3_dot(to, to) - middle * middle * ww,
                 in2 = rod->radius_m * rod->radius_m - away2;
    if (in2 <= 0)
        return nearest;
    const double t = middle - sqrt(in2 / ww);
    return t > 0.05 && t < nearest ? t : nearest;
}

static double room_distance(const struct training_scene *scene, const struct ray *ray)
{
    double nearest = ray->way.z < -1e-6 ? -ray->eye.z / ray->way.z : (double)FAR_M;
    for (int i = 0; i < scene->wall_count; i++) {
        const double n = v3_dot(scene->wall[i].normal, ray->way),
                     t = fabs(n) > 1e-6 ? v3_dot(scene->wall[i].normal, v3_sub(scene->wall[i].at, ray->eye)) / n : 0;
        if (n < 0 && t > 0.2 && t < nearest)
            nearest = t;
    }
    for (int i = 0; i < scene->solid_count; i++)
        nearest = scene->solid[i].kind == SOLID_BOX ? box_distance(&scene->solid[i], ray, nearest)
                                                    : rod_distance(&scene->solid[i], ray, nearest);
    return least(nearest, (double)FAR_M);
}

static void draw_room(const struct training_scene *scene, float *room_m)
{
    const struct lens *lens = &scene->lens;
    double m[3][3];
    quat_to_matrix(scene->world_from_camera.rotation, m);
    struct ray ray = {.eye = scene->world_from_camera.translation};
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++) {
            const double u = (x - lens->cx) / lens->fx, v = (y - lens->cy) / lens->fy;
            ray.way = v3(m[0][0] * u + m[0][1] * v + m[0][2], m[1][0] * u + m[1][1] * v + m[1][2],
                         m[2][0] * u + m[2][1] * v + m[2][2]);
            room_m[(size_t)y * (size_t)lens->width + (size_t)x] = (float)room_distance(scene, &ray);
        }
}

// ---------------------------------------------------------------- noise

// Time of flight: noise that grows with the distance, and pixels between front and back at edges.
static void time_of_flight_noise(const struct lens *lens, const uint16_t *exact, uint64_t seed, uint16_t *out)
{
    struct rng rng = {seed};
    const double level = rng_between(&rng, 0.6, 2);
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++) {
            const int at = y * lens->width + x, beside = x + 1 < lens->width ? at + 1 : at;
            double mm = exact[at];
            const double step = fabs(exact[beside] - mm);
            if (step > 60 && rng_uniform(&rng) < 0.35)
                mm = rng_uniform(&rng) < 0.4 ? 0 : mm + (exact[beside] - mm) * rng_uniform(&rng);
            mm += mm > 0 ? rng_normal(&rng) * level * (2 + 1e-3 * mm) : 0;
            out[at] = mm < 250 || mm > 8000 ? 0 : (uint16_t)mm;
        }
}

// A telephone's LiDAR measures some hundred points and fills in between them by the colour image: smooth, without
// holes, rounded at edges, and off by a share that varies slowly.
static void lidar_noise(const struct lens *lens, const uint16_t *exact, uint64_t seed, uint16_t *out)
{
    struct rng rng = {seed};
    const double scale = 1 + 0.004 * rng_normal(&rng), phase = rng_between(&rng, 0, 6),
                 wave = rng_between(&rng, 0.03, 0.1);
    enum { REACH = 2 };
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++) {
            double sum = 0, weight = 0;
            const double here = exact[y * lens->width + x];
            for (int k = -REACH; k <= REACH; k++) {
                const int nx = clamp_int(x + k, 0, lens->width - 1), ny = clamp_int(y + k, 0, lens->height - 1);
                const double a = exact[y * lens->width + nx], b = exact[ny * lens->width + x],
                             wa = fabs(a - here) < 400 ? 1 : 0.25, wb = fabs(b - here) < 400 ? 1 : 0.25;
                sum += wa * a + wb * b;
                weight += wa + wb;
            }
            const double mm = sum / weight * (scale + 0.004 * sin(wave * (x + 0.7 * y) + phase));
            out[y * lens->width + x] = mm < 200 || mm > 6000 ? 0 : (uint16_t)mm;
        }
}

static enum status add_noise(const struct training_scene *scene, const uint16_t *exact, uint16_t *out)
{
    if (scene->sensor == TRAINING_TIME_OF_FLIGHT)
        time_of_flight_noise(&scene->lens, exact, scene->noise_seed, out);
    else if (scene->sensor == TRAINING_LIDAR)
        lidar_noise(&scene->lens, exact, scene->noise_seed, out);
    else
        return world_depth_noise(&scene->lens, exact, scene->noise_seed, out);
    return OK;
}

// ---------------------------------------------------------------- truth

static void fill_joints(const struct training_scene *scene, const struct training_renderer *renderer,
                        struct training_image *out)
{
    const struct training_person *person = &scene->person[0];
    const struct pose camera_from_world = pose_inverse(scene->world_from_camera);
    out->joints = skeleton_transform(camera_from_world, &person->posed.joints);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = out->joints.joint[j];
        const int x = (int)lround(scene->lens.fx * p.x / fmax(p.z, 0.05) + scene->lens.cx),
                  y = (int)lround(scene->lens.fy * p.y / fmax(p.z, 0.05) + scene->lens.cy);
        out->joints.confidence[j] = 0;
        if (p.z < 0.1 || x < 0 || y < 0 || x >= out->width || y >= out->height)
            continue;
        const size_t pixel = (size_t)y * (size_t)out->width + (size_t)x;
        const bool own = out->part[pixel] != TRAINING_NOTHING && out->part[pixel] != TRAINING_OTHER;
        const double before_m = p.z - (double)renderer->person_m[pixel];
        out->joints.confidence[j] = own && before_m < person->figure->joint_radius[j] + 0.08 ? 1 : 0.5f;
    }
    const struct vec3 ahead = quat_rotate(
        camera_from_world.rotation, quat_rotate(person->posed.world_from_bind[BONE_PELVIS].rotation, v3(0, -1, 0)));
    out->facing_rad = atan2(-ahead.x, -ahead.z);
}

// The other person and the room may stand before the person.
static void merge_layers(struct training_renderer *renderer, const float *other_m, struct training_image *out)
{
    const size_t pixels = (size_t)out->width * (size_t)out->height;
    size_t body = 0, seen = 0;
    for (size_t i = 0; i < pixels; i++) {
        const float own = renderer->person_m[i], room = renderer->room_m[i], other = other_m ? other_m[i] : 0;
        float z = room;
        uint8_t part = TRAINING_NOTHING;
        if (own > 0 && own < z) {
            z = own;
            part = out->part[i];
        }
        if (other > 0 && other < z) {
            z = other;
            part = TRAINING_OTHER;
        }
        body += own > 0;
        seen += part != TRAINING_NOTHING && part != TRAINING_OTHER;
        out->part[i] = part;
        renderer->exact[i] = z < 30 ? (uint16_t)(z * 1000 + 0.5f) : 0;
    }
    out->hidden = body ? 1 - (double)seen / (double)body : 0;
    out->person = seen >= 60 && seen * 20 >= body;
}

enum status training_image_render(struct training_renderer *renderer, const struct training_scene *scene,
                                  struct training_image *out)
{
    static _Thread_local float other_m[TRAINING_PIXELS];
    static _Thread_local uint8_t other_part[TRAINING_PIXELS];
    const size_t pixels = lens_pixels(&scene->lens);
    out->width = scene->lens.width;
    out->height = scene->lens.height;
    out->joints = (struct skeleton){0};
    out->cut = out->facing_rad = 0;
    memset(out->part, TRAINING_NOTHING, pixels);
    memset(renderer->person_m, 0, pixels * sizeof *renderer->person_m);
    if (scene->person_count > 1) {
        memset(other_m, 0, pixels * sizeof *other_m);
        draw_person(renderer, scene, &scene->person[1], TRAINING_OTHER,
                    &(struct layer){&scene->lens, other_m, other_part});
    }
    if (scene->person_count) {
        const struct training_person *person = &scene->person[0];
        draw_person(renderer, scene, person, 0, &(struct layer){&scene->lens, renderer->person_m, out->part});
        out->cut = share_outside(renderer, &scene->lens, person->figure->mesh.vertex_count);
    }
    draw_room(scene, renderer->room_m);
    merge_layers(renderer, scene->person_count > 1 ? other_m : NULL, out);
    if (scene->person_count)
        fill_joints(scene, renderer, out);
    return add_noise(scene, renderer->exact, out->depth);
}
