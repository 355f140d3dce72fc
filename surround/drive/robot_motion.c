#include "surround/drive/robot_motion.h"

#include "base/portable_math.h"

// ---------------------------------------------------------------- head tracker

struct pose head_tracker_eye(struct head_tracker *tracker, struct pose place_from_camera, struct vec3 viewpoint)
{
    if (!tracker->centred) {
        // Looking straight up or down, the top or bottom of the picture says which way
        struct vec3 ahead = quat_rotate(place_from_camera.rotation, v3(0, 0, 1));
        if (ahead.x * ahead.x + ahead.y * ahead.y < 0.02)
            ahead = quat_rotate(place_from_camera.rotation, v3(0, ahead.z > 0 ? 1 : -1, 0));
        const double length = sqrt(ahead.x * ahead.x + ahead.y * ahead.y);
        tracker->c = length > 0 ? ahead.x / length : 1;
        tracker->s = length > 0 ? ahead.y / length : 0;
        tracker->origin = place_from_camera.translation;
        tracker->centred = true;
    }
    double back[3][3] = {{tracker->c, tracker->s, 0}, {-tracker->s, tracker->c, 0}, {0, 0, 1}};
    const struct quat turn = quat_from_matrix(back);
    const struct vec3 moved = v3_sub(place_from_camera.translation, tracker->origin);
    return (struct pose){quat_multiply(turn, place_from_camera.rotation), v3_add(viewpoint, quat_rotate(turn, moved))};
}

// ---------------------------------------------------------------- drive path

#define FINEST_M 0.05 // chosen by hand: of a path of up to 12 m nothing is left out

void drive_path_add(struct drive_path *path, struct vec3 at)
{
    if (!path->count)
        path->spacing_m = FINEST_M;
    else if (!(v3_distance(path->at[path->count - 1], at) >= path->spacing_m)) // NaN, too
        return;
    if (path->count == DRIVE_PATH_POINTS) {
        path->count = DRIVE_PATH_POINTS / 2;
        path->spacing_m *= 2;
        for (int i = 0; i < path->count; i++)
            path->at[i] = path->at[2 * i];
    }
    path->at[path->count++] = at;
}

// ---------------------------------------------------------------- robot motion

struct pose robot_motion_after(struct pose world_from_body, struct drive_command command, double seconds)
{
    const double turn = command.turn_rate * seconds, way = command.speed * seconds;
    // sin(t) / t and (1 - cos(t)) / t
    const double along = fabs(turn) > 1e-6 ? portable_sin(turn) / turn : 1;
    const double aside = fabs(turn) > 1e-6 ? (1 - portable_cos(turn)) / turn : turn / 2;
    const struct pose moved = {quat_from_rotation_vector(v3(0, 0, turn)), v3(way * along, way * aside, 0)};
    return pose_multiply(world_from_body, moved);
}

bool drive_link_delivers(const struct drive_link *link, uint32_t number)
{
    uint32_t x = number * 0x9e3779b9u ^ link->seed;
    x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu, x ^= x >> 16;
    return x / 4294967296.0 >= link->loss;
}

struct drive_command link_watch_command(const struct link_watch *watch, struct drive_command last, int64_t now_ns,
                                        bool *lost)
{
    *lost = !watch->heard || (double)(now_ns - watch->heard_ns) * 1e-9 > watch->patience_s;
    return *lost ? (struct drive_command){0, 0} : last;
}
