#include "surround/drive/simulated_rover.h"

#include "base/clamp.h"
#include "base/depth_noise.h"
#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- world of boxes

#define PI 3.14159265358979323846

static uint32_t mix_bits(uint32_t x)
{
    x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu; // integer hash (Wellons, lowbias32)
    return x ^ x >> 16;
}

// Squares of 9 cm in two shades, each with its own tint: something to see and to compare everywhere.
static void paint_box(const struct box *box, const double at[3], int axis, uint8_t rgb[3])
{
    const int u = (int)floor(at[(axis + 1) % 3] / 0.09), v = (int)floor(at[(axis + 2) % 3] / 0.09);
    const uint32_t tint = mix_bits((uint32_t)u * 73856093u ^ (uint32_t)v * 19349663u ^ (uint32_t)axis * 83492791u);
    for (int c = 0; c < 3; c++) {
        const int value = box->color[c] + (int)(tint >> (8 * c) & 63) - 32 - 10 * axis;
        rgb[c] = (uint8_t)clamp_int(value, 0, 255);
    }
}

// The slab method (Kay and Kajiya 1986). The axis of the face that is met in *axis.
static double intersect_box(const struct box *box, const double from[3], const double ray[3], int *axis)
{
    double enter = -1e9, leave = 1e9;
    int enter_axis = 0, leave_axis = 0;
    for (int i = 0; i < 3; i++) {
        if (fabs(ray[i]) < 1e-12) {
            if (from[i] < box->low[i] || from[i] > box->high[i])
                return 0;
            continue;
        }
        double a = (box->low[i] - from[i]) / ray[i], c = (box->high[i] - from[i]) / ray[i];
        if (a > c) {
            const double t = a;
            a = c;
            c = t;
        }
        if (a > enter) {
            enter = a;
            enter_axis = i;
        }
        if (c < leave) {
            leave = c;
            leave_axis = i;
        }
    }
    if (enter > leave)
        return 0;
    *axis = box->inside ? leave_axis : enter_axis;
    const double t = box->inside ? leave : enter;
    return t > 1e-6 ? t : 0;
}

double box_world_cast(const struct box_world *world, const double from[3], const double ray[3], uint8_t rgb[3])
{
    double nearest = 0;
    int axis = 0, box = -1;
    for (int i = 0; i < world->count; i++) {
        int face;
        const double t = intersect_box(&world->boxes[i], from, ray, &face);
        if (t > 0 && (box < 0 || t < nearest)) {
            nearest = t;
            axis = face;
            box = i;
        }
    }
    if (box >= 0 && rgb) {
        double at[3];
        for (int i = 0; i < 3; i++)
            at[i] = from[i] + nearest * ray[i];
        paint_box(&world->boxes[box], at, axis, rgb);
    }
    return nearest;
}

void box_world_panorama(const struct box_world *world, struct pose world_from_camera, int width, int height,
                        uint8_t *rgb)
{
    double m[3][3];
    quat_to_matrix(world_from_camera.rotation, m);
    const double from[3] = {world_from_camera.translation.x, world_from_camera.translation.y,
                            world_from_camera.translation.z};
    for (int v = 0; v < height; v++)
        for (int u = 0; u < width; u++) {
            const double a = (u + 0.5) / width * 2 * PI - PI, b = (v + 0.5) / height * PI;
            const double c[3] = {portable_sin(b) * portable_sin(a), -portable_cos(b),
                                 portable_sin(b) * portable_cos(a)};
            double ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = m[i][0] * c[0] + m[i][1] * c[1] + m[i][2] * c[2];
            uint8_t *out = rgb + 3 * ((size_t)v * (size_t)width + (size_t)u);
            out[0] = out[1] = out[2] = 0;
            box_world_cast(world, from, ray, out);
        }
}

// About normal: the sum of four uniform numbers.
static double normal_noise(uint32_t *state)
{
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        *state = mix_bits(*state + 0x9e3779b9u);
        sum += *state / 4294967296.0 - 0.5;
    }
    return sum * 1.7320508; // each has variance 1 / 12
}

void box_world_depth(const struct box_world *world, struct pose world_from_camera, const struct lens *lens,
                     double range_m, uint32_t seed, uint16_t *depth)
{
    double m[3][3];
    quat_to_matrix(world_from_camera.rotation, m);
    const double from[3] = {world_from_camera.translation.x, world_from_camera.translation.y,
                            world_from_camera.translation.z};
    uint32_t state = seed;
    for (int v = 0; v < lens->height; v++)
        for (int u = 0; u < lens->width; u++) {
            const struct vec3 c = v3_unit(v3((u - lens->cx) / lens->fx, (v - lens->cy) / lens->fy, 1));
            const double local[3] = {c.x, c.y, c.z};
            double ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = m[i][0] * local[0] + m[i][1] * local[1] + m[i][2] * local[2];
            double z = box_world_cast(world, from, ray, NULL) * c.z;
            if (seed && z > 0)
                z += normal_noise(&state) * depth_sigma_m(z);
            depth[(size_t)v * (size_t)lens->width + (size_t)u] = (uint16_t)(z > 0.3 && z < range_m ? z * 1e3 + 0.5 : 0);
        }
}

// Distance between two convex outlines with corners in order; 0 where they overlap. Separating axes decide the latter.
static double outline_distance(const double (*a)[2], const double (*b)[2])
{
    bool apart = false;
    double best = 1e9;
    for (int pass = 0; pass < 2; pass++) {
        const double(*p)[2] = pass ? b : a, (*q)[2] = pass ? a : b;
        for (int i = 0; i < 4; i++) {
            const double *s = p[i], *e = p[(i + 1) % 4];
            const double ex = e[0] - s[0], ey = e[1] - s[1], length2 = ex * ex + ey * ey;
            bool all_outside = true;
            for (int k = 0; k < 4; k++) {
                const double qx = q[k][0] - s[0], qy = q[k][1] - s[1];
                all_outside &= ex * qy - ey * qx < 0; // corners run to the left
                const double t = fmax(0, fmin(1, (qx * ex + qy * ey) / length2));
                best = fmin(best, portable_hypot(qx - t * ex, qy - t * ey));
            }
            apart |= all_outside;
        }
    }
    return apart ? best : 0;
}

double box_world_clearance(const struct box_world *world, struct pose world_from_body, const double size_m[3])
{
    double corners[4][2], best = 1e9;
    for (int k = 0; k < 4; k++) {
        const double x = k == 0 || k == 3 ? -0.5 : 0.5, y = k < 2 ? -0.5 : 0.5;
        const struct vec3 p = pose_apply(world_from_body, v3(x * size_m[0], y * size_m[1], 0));
        corners[k][0] = p.x;
        corners[k][1] = p.y;
    }
    for (int i = 0; i < world->count; i++) {
        const struct box *b = &world->boxes[i];
        if (b->inside) {
            for (int k = 0; k < 4; k++)
                for (int c = 0; c < 2; c++)
                    best = fmin(best, fmin(corners[k][c] - b->low[c], b->high[c] - corners[k][c]));
            continue;
        }
        if (b->low[2] >= size_m[2] || b->high[2] <= 0)
            continue;
        const double outline[4][2] = {
            {b->low[0], b->low[1]}, {b->high[0], b->low[1]}, {b->high[0], b->high[1]}, {b->low[0], b->high[1]}};
        best = fmin(best, outline_distance((const double(*)[2])corners, outline));
    }
    return best;
}

// ---------------------------------------------------------------- rover

#define DOWN    0.43633231299858238 // 25 degrees
#define HEAD_M  1.15
#define DEPTH_M 0.9

struct rover_options rover_default_options(void)
{
    return (struct rover_options){.size_m = {0.6, 0.5, 1.2},
                                  .odometry_scale = 0.01,
                                  .odometry_turn = 0.02,
                                  .panorama_height = 256,
                                  .depth_width = 160,
                                  .depth_height = 120,
                                  .view = {.width = 320, .height = 240, .fx = 200, .fy = 200, .cx = 159.5, .cy = 119.5},
                                  .seed = 1};
}

// A camera's axes (x right, y down, z ahead) in the body's (x ahead, y left, z up), turned left by `turn` and then
// `down`.
static struct quat body_from_camera(double turn, double down)
{
    double level[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
    const struct quat looking = quat_from_matrix(level);
    const struct quat pitched = quat_multiply(quat_from_rotation_vector(v3(0, down, 0)), looking);
    return quat_multiply(quat_from_rotation_vector(v3(0, 0, turn)), pitched);
}

struct pose rover_head(void) { return (struct pose){body_from_camera(0, 0), v3(0, 0, HEAD_M)}; }

struct pose rover_depth_camera(int camera)
{
    const double turn = camera * 1.5707963267948966;
    return (struct pose){body_from_camera(turn, DOWN), v3(0.2 * portable_cos(turn), 0.2 * portable_sin(turn), DEPTH_M)};
}

struct lens rover_depth_lens(const struct rover_options *options)
{
    const double f = options->depth_width * 0.89; // as a Kinect's
    return (struct lens){.width = options->depth_width,
                         .height = options->depth_height,
                         .fx = f,
                         .fy = f,
                         .cx = (options->depth_width - 1) / 2.0,
                         .cy = (options->depth_height - 1) / 2.0};
}

enum status simulated_rover_open(struct simulated_rover *rover, const struct box_world *world, struct pose start,
                                 const struct rover_options *how)
{
    *rover = (struct simulated_rover){
        .world = *world, .options = *how, .start = start, .world_from_body = start, .odometry = POSE_IDENTITY};
    const enum status status =
        surroundings_open_live(&rover->surroundings, SURROUNDINGS_ROBOT, &how->view, rover_head(), NULL);
    return status == OK ? simulated_rover_step(rover, (struct drive_command){0, 0}, 0) : status;
}

void simulated_rover_close(struct simulated_rover *rover) { surroundings_close(&rover->surroundings); }

static enum status depth_of(struct simulated_rover *rover, struct depth_points *points)
{
    const struct rover_options *options = &rover->options;
    const struct lens lens = rover_depth_lens(options);
    uint16_t *depth = malloc((size_t)lens.width * (size_t)lens.height * sizeof *depth);
    enum status status = depth ? OK : fail(ERR_MEMORY, "no memory for the simulated robot");
    for (int c = 0; status == OK && c < SURROUND_DEPTH_CAMERAS; c++) {
        const struct pose at = rover_depth_camera(c);
        const uint32_t seed = options->seed * 2654435761u + (uint32_t)(4 * rover->surroundings.taken + c) + 1;
        box_world_depth(&rover->world, pose_multiply(rover->world_from_body, at), &lens, ROVER_RANGE_M, seed, depth);
        status = depth_points_add(points, depth, &lens, at, 1);
    }
    free(depth);
    return status;
}

static enum status capture_surroundings(struct simulated_rover *rover)
{
    const int height = rover->options.panorama_height, width = 2 * height;
    struct surroundings *s = &rover->surroundings;
    struct depth_points points = {0};
    struct surround_picture picture;
    uint8_t *rgb = malloc((size_t)width * (size_t)height * 3);
    enum status status = rgb ? OK : fail(ERR_MEMORY, "no memory for the simulated robot");
    if (status != OK)
        return status;
    box_world_panorama(&rover->world, pose_multiply(rover->world_from_body, s->body_from_panorama), width, height, rgb);
    status = surround_picture_make(&picture, rgb, width, height, NULL);
    if (status != OK)
        return status;
    picture.time_ns = rover->captured_ns = rover->time_ns;
    status = depth_of(rover, &points);
    if (status == OK)
        status = surroundings_take(s, &picture, &points, rover->odometry);
    else
        surround_picture_free(&picture);
    depth_points_free(&points);
    return status;
}

enum status simulated_rover_step(struct simulated_rover *rover, struct drive_command command, double seconds)
{
    rover->command = rover->touched ? (struct drive_command){0, 0} : command;
    rover->time_ns += llround(seconds * 1e9);
    const struct pose moved = robot_motion_after(rover->world_from_body, rover->command, seconds);
    if (box_world_clearance(&rover->world, moved, rover->options.size_m) <= 0)
        rover->touched = true;
    else {
        const struct drive_command reported = {rover->command.speed * (1 + rover->options.odometry_scale),
                                               rover->command.turn_rate * (1 + rover->options.odometry_turn)};
        rover->world_from_body = moved;
        rover->odometry = robot_motion_after(rover->odometry, reported, seconds);
    }
    if (surroundings_wants(&rover->surroundings, rover->odometry, rover->time_ns - rover->captured_ns))
        return capture_surroundings(rover);
    return OK;
}

struct pose simulated_rover_pose(const struct simulated_rover *rover)
{
    return surroundings_bridge(&rover->surroundings, rover->odometry);
}

static void add_box(struct box_world *world, const double low[3], const double high[3], uint32_t color, bool inside)
{
    struct box *b = &world->boxes[world->count++];
    memcpy(b->low, low, sizeof b->low);
    memcpy(b->high, high, sizeof b->high);
    for (int c = 0; c < 3; c++)
        b->color[c] = (uint8_t)(color >> (16 - 8 * c));
    b->inside = inside;
}

void rover_stage_world(int stage, struct box_world *world, struct pose *start)
{
    *world = (struct box_world){0};
    *start = POSE_IDENTITY;
    if (stage == 1) { // 0.9 m wide
        add_box(world, (double[3]){-1.5, -0.45, 0}, (double[3]){6, 0.45, 2.5}, 0xb0b0a8, true);
    } else if (stage == 2) { // bent by two boxes
        add_box(world, (double[3]){-1.5, -1.2, 0}, (double[3]){6, 1.2, 2.5}, 0xb0b0a8, true);
        add_box(world, (double[3]){1.2, -1.2, 0}, (double[3]){1.7, 0, 1}, 0x906030, false);
        add_box(world, (double[3]){3.2, 0, 0}, (double[3]){3.7, 1.2, 1}, 0x906030, false);
    } else { // the wall ahead, with things beside
        add_box(world, (double[3]){-1.5, -1.5, 0}, (double[3]){2.2, 1.6, 2.5}, 0xb0b0a8, true);
        add_box(world, (double[3]){0.8, 0.9, 0}, (double[3]){1.2, 1.3, 0.7}, 0x906030, false);
        add_box(world, (double[3]){1.0, -1.3, 0}, (double[3]){1.3, -1.0, 0.5}, 0xd06020, false);
    }
}
