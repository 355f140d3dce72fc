#include "surround/drive/robot_motion.h"

#include "base/portable_math.h"

struct pose robot_motion_after(struct pose world_from_body, struct drive_command c, double seconds)
{
    const double turn = c.turn_rate * seconds, way = c.speed * seconds;
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
