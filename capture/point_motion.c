#include "capture/point_motion.h"

#include <string.h>

static const enum joint joint_of[BODY_POINT_COUNT] = {
    [BODY_POINT_NOSE] = JOINT_HEAD,
    [BODY_POINT_LEFT_EYE] = JOINT_HEAD,
    [BODY_POINT_RIGHT_EYE] = JOINT_HEAD,
    [BODY_POINT_LEFT_EAR] = JOINT_HEAD,
    [BODY_POINT_RIGHT_EAR] = JOINT_HEAD,
    [BODY_POINT_LEFT_SHOULDER] = JOINT_LEFT_SHOULDER,
    [BODY_POINT_RIGHT_SHOULDER] = JOINT_RIGHT_SHOULDER,
    [BODY_POINT_LEFT_ELBOW] = JOINT_LEFT_ELBOW,
    [BODY_POINT_RIGHT_ELBOW] = JOINT_RIGHT_ELBOW,
    [BODY_POINT_LEFT_WRIST] = JOINT_LEFT_HAND,
    [BODY_POINT_RIGHT_WRIST] = JOINT_RIGHT_HAND,
    [BODY_POINT_LEFT_HIP] = JOINT_LEFT_HIP,
    [BODY_POINT_RIGHT_HIP] = JOINT_RIGHT_HIP,
    [BODY_POINT_LEFT_KNEE] = JOINT_LEFT_KNEE,
    [BODY_POINT_RIGHT_KNEE] = JOINT_RIGHT_KNEE,
    [BODY_POINT_LEFT_ANKLE] = JOINT_LEFT_FOOT,
    [BODY_POINT_RIGHT_ANKLE] = JOINT_RIGHT_FOOT,
    [BODY_POINT_LEFT_HEEL] = JOINT_LEFT_FOOT,
    [BODY_POINT_RIGHT_HEEL] = JOINT_RIGHT_FOOT,
    [BODY_POINT_LEFT_TOE] = JOINT_LEFT_FOOT,
    [BODY_POINT_RIGHT_TOE] = JOINT_RIGHT_FOOT,
};

void point_motion_add(struct point_motion *m, int64_t time_ns, const struct skeleton *skeleton)
{
    struct tracked_frame *to = &m->at[m->next];
    *to = (struct tracked_frame){.time_ns = time_ns, .person = skeleton};
    if (skeleton) {
        memcpy(to->joint, skeleton->joint, sizeof to->joint);
        memcpy(to->confidence, skeleton->confidence, sizeof to->confidence);
    }
    m->next = (m->next + 1) % POINT_MOTION_FRAMES;
    m->count += m->count < POINT_MOTION_FRAMES;
}

void point_motion_clear(struct point_motion *m) { m->count = 0; }

// The frame that was added `back` before the last; NULL: there is none.
static const struct tracked_frame *frame_back(const struct point_motion *m, int back)
{
    return back < m->count ? &m->at[(m->next + POINT_MOTION_FRAMES - 1 - back) % POINT_MOTION_FRAMES] : NULL;
}

static const struct tracked_frame *frame_at(const struct point_motion *m, int64_t time_ns)
{
    for (int back = 0; back < m->count; back++)
        if (frame_back(m, back)->time_ns == time_ns)
            return frame_back(m, back);
    return NULL;
}

// Where the joint is at now_ns, by its last two frames. Known in the last one.
static struct vec3 predicted(const struct point_motion *m, enum joint j, int64_t now_ns)
{
    const struct tracked_frame *last = frame_back(m, 0), *before = frame_back(m, 1);
    if (!before || !(before->confidence[j] > 0) || before->time_ns >= last->time_ns)
        return last->joint[j];
    const double share = (double)(now_ns - last->time_ns) / (double)(last->time_ns - before->time_ns);
    return v3_mix(before->joint[j], last->joint[j], 1 + share);
}

bool point_motion_apply(const struct point_motion *m, const struct lens *color, int64_t from_ns, int64_t now_ns,
                        struct body_points *points)
{
    if (from_ns == now_ns)
        return true;
    const struct tracked_frame *from = frame_at(m, from_ns), *last = frame_back(m, 0);
    if (!from || now_ns < from_ns || now_ns - from_ns > POINT_MOTION_MOST_NS)
        return false;
    for (int k = 0; k < BODY_POINT_COUNT && points->person; k++) {
        const enum joint j = joint_of[k];
        if (!(from->confidence[j] > 0 && last->confidence[j] > 0))
            continue;
        const struct vec3 then = from->joint[j], now = predicted(m, j, now_ns);
        if (!(then.z > 0 && now.z > 0))
            continue;
        const struct pixel p = lens_project(color, then), q = lens_project(color, now);
        points->at[k].x_px += (float)(q.x - p.x);
        points->at[k].y_px += (float)(q.y - p.y);
    }
    return true;
}
