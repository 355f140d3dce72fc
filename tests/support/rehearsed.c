#include "tests/support/rehearsed.h"

enum status rehearsed_open(struct rehearsed *out, int frames)
{
    *out = (struct rehearsed){.rehearsal = rehearsal_make()};
    enum status status = recording_open(&out->recording, out->rehearsal.file);
    if (status == OK)
        status = take_open(&out->take, out->recording, "turn");
    if (status == OK)
        status = source_rays_open(&out->rays, take_calibration(out->take));
    if (status == OK)
        status = take_skeletons_open(&out->skeletons, out->take);
    out->source = (struct frame_source){out->take, out->skeletons, out->rays};
    if (status == OK && frames)
        status = avatar_make(&out->avatar, out->take, out->rays,
                             &(struct avatar_options){.max_frames = frames, .threads = 4});
    return status;
}

void rehearsed_close(struct rehearsed *r)
{
    avatar_free(&r->avatar);
    source_rays_close(&r->rays);
    take_skeletons_close(&r->skeletons);
    take_close(&r->take);
    recording_free(&r->recording);
    rehearsal_end(&r->rehearsal);
}

struct pose rehearsed_orbit_pose(const struct rehearsed *r, int64_t frame, double angle_rad)
{
    const struct take_entry *e = take_entry(r->take, frame);
    const struct vec3 waist = pose_apply(e->world_from_camera, e->skeleton.joint[JOINT_WAIST]);
    struct pose yaw_motion = {quat_from_rotation_vector(v3(0, 0, angle_rad)), v3(0, 0, 0)};
    yaw_motion.translation = v3_sub(waist, quat_rotate(yaw_motion.rotation, waist));
    return pose_multiply(yaw_motion, e->world_from_camera);
}
