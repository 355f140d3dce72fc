#include "capture/point_finder.h"

#include "base/clock.h"
#include "base/threads.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- body points

// The mean of all channels, 0..255, below which an image is too dark; chosen by hand. A room in which a sensor's colour
// image shows anything has 40 and more.
enum { DARK = 16, SAMPLE_EVERY = 97 };

static bool is_dark(const uint8_t *rgb, size_t bytes)
{
    size_t sum = 0, count = 0;
    for (size_t i = 0; i < bytes; i += SAMPLE_EVERY, count++)
        sum += rgb[i];
    return sum < DARK * count;
}

static const enum pose_point_name pose_point[BODY_POINT_COUNT] = {
    [BODY_POINT_NOSE] = POSE_NOSE,
    [BODY_POINT_LEFT_EYE] = POSE_LEFT_EYE,
    [BODY_POINT_RIGHT_EYE] = POSE_RIGHT_EYE,
    [BODY_POINT_LEFT_EAR] = POSE_LEFT_EAR,
    [BODY_POINT_RIGHT_EAR] = POSE_RIGHT_EAR,
    [BODY_POINT_LEFT_SHOULDER] = POSE_LEFT_SHOULDER,
    [BODY_POINT_RIGHT_SHOULDER] = POSE_RIGHT_SHOULDER,
    [BODY_POINT_LEFT_ELBOW] = POSE_LEFT_ELBOW,
    [BODY_POINT_RIGHT_ELBOW] = POSE_RIGHT_ELBOW,
    [BODY_POINT_LEFT_WRIST] = POSE_LEFT_WRIST,
    [BODY_POINT_RIGHT_WRIST] = POSE_RIGHT_WRIST,
    [BODY_POINT_LEFT_HIP] = POSE_LEFT_HIP,
    [BODY_POINT_RIGHT_HIP] = POSE_RIGHT_HIP,
    [BODY_POINT_LEFT_KNEE] = POSE_LEFT_KNEE,
    [BODY_POINT_RIGHT_KNEE] = POSE_RIGHT_KNEE,
    [BODY_POINT_LEFT_ANKLE] = POSE_LEFT_ANKLE,
    [BODY_POINT_RIGHT_ANKLE] = POSE_RIGHT_ANKLE,
    [BODY_POINT_LEFT_HEEL] = POSE_LEFT_HEEL,
    [BODY_POINT_RIGHT_HEEL] = POSE_RIGHT_HEEL,
    [BODY_POINT_LEFT_TOE] = POSE_LEFT_TOE,
    [BODY_POINT_RIGHT_TOE] = POSE_RIGHT_TOE,
};

enum status body_points_of_image(struct pose_network *network, const uint8_t *rgb, int width, int height,
                                 struct body_points *out)
{
    struct pose_points found;
    memset(out, 0, sizeof *out);
    if (is_dark(rgb, 3 * (size_t)width * (size_t)height))
        return NOTHING;
    enum status status = pose_network_find(network, rgb, width, height, &found);
    if (status < 0)
        return status;
    out->person = status == OK;
    for (int k = 0; out->person && k < BODY_POINT_COUNT; k++) {
        const struct pose_point *p = &found.point[pose_point[k]];
        out->at[k] = (struct body_point){(float)p->x_px, (float)p->y_px, (float)p->visibility};
    }
    return OK;
}

// ---------------------------------------------------------------- point motion

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

void point_motion_add(struct point_motion *motion, int64_t time_ns, const struct skeleton *skeleton)
{
    struct tracked_frame *to = &motion->at[motion->next];
    *to = (struct tracked_frame){.time_ns = time_ns, .person = skeleton};
    if (skeleton) {
        memcpy(to->joint, skeleton->joint, sizeof to->joint);
        memcpy(to->confidence, skeleton->confidence, sizeof to->confidence);
    }
    motion->next = (motion->next + 1) % POINT_MOTION_FRAMES;
    motion->count += motion->count < POINT_MOTION_FRAMES;
}

void point_motion_clear(struct point_motion *motion) { motion->count = 0; }

// The frame that was added `back` before the last; NULL: there is none.
static const struct tracked_frame *frame_back(const struct point_motion *motion, int back)
{
    return back < motion->count ? &motion->at[(motion->next + POINT_MOTION_FRAMES - 1 - back) % POINT_MOTION_FRAMES]
                                : NULL;
}

static const struct tracked_frame *frame_at(const struct point_motion *motion, int64_t time_ns)
{
    for (int back = 0; back < motion->count; back++)
        if (frame_back(motion, back)->time_ns == time_ns)
            return frame_back(motion, back);
    return NULL;
}

// Where the joint is at now_ns, by its last two frames. Known in the last one.
static struct vec3 predicted(const struct point_motion *motion, enum joint joint, int64_t now_ns)
{
    const struct tracked_frame *last = frame_back(motion, 0), *before = frame_back(motion, 1);
    if (!before || !(before->confidence[joint] > 0) || before->time_ns >= last->time_ns)
        return last->joint[joint];
    const double share = (double)(now_ns - last->time_ns) / (double)(last->time_ns - before->time_ns);
    return v3_mix(before->joint[joint], last->joint[joint], 1 + share);
}

bool point_motion_apply(const struct point_motion *motion, const struct lens *color, int64_t from_ns, int64_t now_ns,
                        struct body_points *points)
{
    if (from_ns == now_ns)
        return true;
    const struct tracked_frame *from = frame_at(motion, from_ns), *last = frame_back(motion, 0);
    if (!from || now_ns < from_ns || now_ns - from_ns > POINT_MOTION_MAX_NS)
        return false;
    for (int k = 0; k < BODY_POINT_COUNT && points->person; k++) {
        const enum joint j = joint_of[k];
        if (!(from->confidence[j] > 0 && last->confidence[j] > 0))
            continue;
        const struct vec3 then = from->joint[j], now = predicted(motion, j, now_ns);
        if (!(then.z > 0 && now.z > 0))
            continue;
        const struct pixel p = lens_project(color, then), q = lens_project(color, now);
        points->at[k].x_px += (float)(q.x - p.x);
        points->at[k].y_px += (float)(q.y - p.y);
    }
    return true;
}

// ---------------------------------------------------------------- point finder

// As the recorder looks (recorder.c); and each look is followed by REST times as long without one.
enum { LOOK_EVERY = 3, REST = 3 };

struct point_finder {
    struct point_finder_options options;
    struct pose_network *network; // used by the thread only
    uint8_t *image;               // the thread's while `busy`
    int64_t offered;              // images since the last look began
    struct worker_thread worker;

    // Under its lock:
    bool ready, busy, restart;
    int64_t image_ns;      // time of `image`
    int64_t rest_until_ns; // by clock_now_ns
    bool found;            // `points` has not been taken
    int64_t points_ns;     // time of their image
    struct body_points points;
    struct point_finder_state state;
};

static enum status find(struct point_finder *finder, struct body_points *out)
{
    const struct point_finder_options *o = &finder->options;
    if (o->find)
        return o->find(o->find_self, finder->image, o->width, o->height, out);
    return body_points_of_image(finder->network, finder->image, o->width, o->height, out);
}

static void give_up(struct point_finder *finder)
{
    pthread_mutex_lock(&finder->worker.lock);
    finder->ready = false;
    snprintf(finder->state.why_not, sizeof finder->state.why_not, "%.255s", status_message());
    pthread_mutex_unlock(&finder->worker.lock);
}

// False: closing. *restart: the image is the first of a film.
static bool wait_for_image(struct point_finder *finder, bool *restart)
{
    pthread_mutex_lock(&finder->worker.lock);
    while (!finder->busy && !finder->worker.closing)
        pthread_cond_wait(&finder->worker.changed, &finder->worker.lock);
    *restart = finder->restart;
    finder->restart = false;
    const bool closing = finder->worker.closing;
    pthread_mutex_unlock(&finder->worker.lock);
    return !closing;
}

static void publish(struct point_finder *finder, enum status status, const struct body_points *points, int64_t begun_ns)
{
    const int64_t now_ns = clock_now_ns();
    pthread_mutex_lock(&finder->worker.lock);
    finder->state.looked++;
    finder->state.looked_ms += (double)(now_ns - begun_ns) * 1e-6;
    finder->rest_until_ns = now_ns + REST * (now_ns - begun_ns);
    if (status == OK && !finder->restart) { // else of a film that is over
        finder->points = *points;
        finder->points_ns = finder->image_ns;
        finder->found = true;
    }
    finder->busy = false;
    pthread_mutex_unlock(&finder->worker.lock);
}

static void *look(void *self)
{
    struct point_finder *p = self;
    thread_lower_priority();
    enum status status = p->options.find ? OK : pose_network_open(&p->network, NULL, POSE_NETWORK_LITE);
    pthread_mutex_lock(&p->worker.lock);
    p->ready = status == OK;
    pthread_mutex_unlock(&p->worker.lock);
    for (bool restart; status >= 0 && wait_for_image(p, &restart);) {
        struct body_points points;
        const int64_t begun_ns = clock_now_ns();
        if (restart && p->network)
            pose_network_restart(p->network);
        status = find(p, &points);
        publish(p, status, &points, begun_ns);
    }
    if (status < 0)
        give_up(p);
    pose_network_close(&p->network);
    return NULL;
}

enum status point_finder_open(struct point_finder **out, const struct point_finder_options *options)
{
    *out = NULL;
    struct point_finder *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory to look for body points");
    p->options = *options;
    worker_thread_open(&p->worker);
    p->image = malloc(3 * (size_t)options->width * (size_t)options->height + 1);
    enum status status = p->image ? OK : fail(ERR_MEMORY, "no memory to look for body points");
    if (status == OK)
        status = worker_thread_start(&p->worker, look, p, "to look for body points");
    *out = p;
    if (status != OK)
        point_finder_close(out);
    return status;
}

void point_finder_close(struct point_finder **out)
{
    struct point_finder *p = *out;
    if (!p)
        return;
    worker_thread_close(&p->worker);
    free(p->image);
    free(p);
    *out = NULL;
}

void point_finder_offer(struct point_finder *finder, int64_t time_ns, const uint8_t *rgb)
{
    pthread_mutex_lock(&finder->worker.lock);
    const bool is_free = finder->ready && !finder->busy && clock_now_ns() >= finder->rest_until_ns;
    pthread_mutex_unlock(&finder->worker.lock);
    if (++finder->offered < LOOK_EVERY || !is_free)
        return;
    memcpy(finder->image, rgb, 3 * (size_t)finder->options.width * (size_t)finder->options.height);
    finder->offered = 0;
    pthread_mutex_lock(&finder->worker.lock);
    finder->image_ns = time_ns;
    finder->busy = true;
    pthread_cond_signal(&finder->worker.changed);
    pthread_mutex_unlock(&finder->worker.lock);
}

bool point_finder_take(struct point_finder *finder, int64_t *time_ns, struct body_points *out)
{
    pthread_mutex_lock(&finder->worker.lock);
    const bool found = finder->found;
    if (found) {
        *time_ns = finder->points_ns;
        *out = finder->points;
    }
    finder->found = false;
    pthread_mutex_unlock(&finder->worker.lock);
    return found;
}

void point_finder_restart(struct point_finder *finder)
{
    pthread_mutex_lock(&finder->worker.lock);
    finder->restart = true;
    finder->found = false;
    pthread_mutex_unlock(&finder->worker.lock);
}

struct point_finder_state point_finder_query(struct point_finder *finder)
{
    pthread_mutex_lock(&finder->worker.lock);
    const struct point_finder_state state = finder->state;
    pthread_mutex_unlock(&finder->worker.lock);
    return state;
}
