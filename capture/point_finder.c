#include "capture/point_finder.h"

#include "base/clock.h"
#include "base/thread_priority.h"
#include "base/worker_thread.h"
#include "capture/body_points.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static enum status find(struct point_finder *p, struct body_points *out)
{
    const struct point_finder_options *o = &p->options;
    if (o->find)
        return o->find(o->find_self, p->image, o->width, o->height, out);
    return body_points_of_image(p->network, p->image, o->width, o->height, out);
}

static void give_up(struct point_finder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    p->ready = false;
    snprintf(p->state.why_not, sizeof p->state.why_not, "%.255s", status_message());
    pthread_mutex_unlock(&p->worker.lock);
}

// False: closing. *restart: the image is the first of a film.
static bool wait_for_image(struct point_finder *p, bool *restart)
{
    pthread_mutex_lock(&p->worker.lock);
    while (!p->busy && !p->worker.closing)
        pthread_cond_wait(&p->worker.changed, &p->worker.lock);
    *restart = p->restart;
    p->restart = false;
    const bool closing = p->worker.closing;
    pthread_mutex_unlock(&p->worker.lock);
    return !closing;
}

static void publish(struct point_finder *p, enum status status, const struct body_points *points, int64_t begun_ns)
{
    const int64_t now_ns = clock_now_ns();
    pthread_mutex_lock(&p->worker.lock);
    p->state.looked++;
    p->state.looked_ms += (double)(now_ns - begun_ns) * 1e-6;
    p->rest_until_ns = now_ns + REST * (now_ns - begun_ns);
    if (status == OK && !p->restart) { // else of a film that is over
        p->points = *points;
        p->points_ns = p->image_ns;
        p->found = true;
    }
    p->busy = false;
    pthread_mutex_unlock(&p->worker.lock);
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

void point_finder_offer(struct point_finder *p, int64_t time_ns, const uint8_t *rgb)
{
    pthread_mutex_lock(&p->worker.lock);
    const bool is_free = p->ready && !p->busy && clock_now_ns() >= p->rest_until_ns;
    pthread_mutex_unlock(&p->worker.lock);
    if (++p->offered < LOOK_EVERY || !is_free)
        return;
    memcpy(p->image, rgb, 3 * (size_t)p->options.width * (size_t)p->options.height);
    p->offered = 0;
    pthread_mutex_lock(&p->worker.lock);
    p->image_ns = time_ns;
    p->busy = true;
    pthread_cond_signal(&p->worker.changed);
    pthread_mutex_unlock(&p->worker.lock);
}

bool point_finder_take(struct point_finder *p, int64_t *time_ns, struct body_points *out)
{
    pthread_mutex_lock(&p->worker.lock);
    const bool found = p->found;
    if (found) {
        *time_ns = p->points_ns;
        *out = p->points;
    }
    p->found = false;
    pthread_mutex_unlock(&p->worker.lock);
    return found;
}

void point_finder_restart(struct point_finder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    p->restart = true;
    p->found = false;
    pthread_mutex_unlock(&p->worker.lock);
}

struct point_finder_state point_finder_query(struct point_finder *p)
{
    pthread_mutex_lock(&p->worker.lock);
    const struct point_finder_state state = p->state;
    pthread_mutex_unlock(&p->worker.lock);
    return state;
}
