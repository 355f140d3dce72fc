#include "surround/drive/simulated_rover.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

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

enum status simulated_rover_open(struct simulated_rover *r, const struct box_world *world, struct pose start,
                                 const struct rover_options *how)
{
    *r = (struct simulated_rover){
        .world = *world, .options = *how, .start = start, .world_from_body = start, .odometry = POSE_IDENTITY};
    const enum status status =
        surroundings_open_live(&r->surroundings, SURROUNDINGS_ROBOT, &how->view, rover_head(), NULL);
    return status == OK ? simulated_rover_step(r, (struct drive_command){0, 0}, 0) : status;
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

enum status simulated_rover_step(struct simulated_rover *r, struct drive_command command, double seconds)
{
    r->command = r->touched ? (struct drive_command){0, 0} : command;
    r->time_ns += llround(seconds * 1e9);
    const struct pose moved = robot_motion_after(r->world_from_body, r->command, seconds);
    if (box_world_clearance(&r->world, moved, r->options.size_m) <= 0)
        r->touched = true;
    else {
        const struct drive_command reported = {r->command.speed * (1 + r->options.odometry_scale),
                                               r->command.turn_rate * (1 + r->options.odometry_turn)};
        r->world_from_body = moved;
        r->odometry = robot_motion_after(r->odometry, reported, seconds);
    }
    if (surroundings_wants(&r->surroundings, r->odometry, r->time_ns - r->captured_ns))
        return capture_surroundings(r);
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
