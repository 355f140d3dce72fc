#include "app/place/robot_place_finder.h"

#include "base/thread_priority.h"
#include "base/worker_thread.h"

#include <stdio.h>
#include <stdlib.h>

// Once found, one of so many captures is looked at. Chosen by hand: they come about every half metre, and the robot's
// own world drifts by millimetres in that.
enum { SELDOM = 8 };

struct robot_place_finder {
    struct robot_place *place; // the thread's
    int offered;               // captures there were when one was put last
    struct worker_thread worker;

    // Under its lock, which is never held while a picture is looked at:
    struct surround_picture picture; // to be looked at
    bool pending;
    struct robot_place_answer answer;
};

static void note(struct robot_place_finder *f, enum status status, struct pose place_from_world)
{
    struct robot_place_answer *a = &f->answer;
    a->looked++;
    if (status == OK) {
        a->state = ROBOT_PLACE_FOUND;
        a->place_from_world = place_from_world;
    } else if (a->state != ROBOT_PLACE_FOUND) { // once found it is kept
        a->state = status == NOTHING ? ROBOT_PLACE_TOO_LITTLE : ROBOT_PLACE_FAILED;
        snprintf(a->trouble, sizeof a->trouble, "%s", status == NOTHING ? "" : status_message());
    }
}

static void *run(void *self)
{
    struct robot_place_finder *f = self;
    thread_lower_priority();
    pthread_mutex_lock(&f->worker.lock);
    while (!f->worker.closing) {
        if (!f->pending) {
            pthread_cond_wait(&f->worker.changed, &f->worker.lock);
            continue;
        }
        const struct surround_picture picture = f->picture;
        pthread_mutex_unlock(&f->worker.lock);
        struct pose place_from_world = POSE_IDENTITY;
        enum status status = robot_place_look(f->place, &picture);
        if (status == OK || status == ERR_SOLVER) // a solver that failed did so on this picture only
            status = robot_place_settle(f->place, &place_from_world);
        pthread_mutex_lock(&f->worker.lock);
        note(f, status, place_from_world);
        f->pending = false;
    }
    pthread_mutex_unlock(&f->worker.lock);
    return NULL;
}

enum status robot_place_finder_start(struct robot_place_finder **out, const struct place *place)
{
    struct robot_place_finder *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    worker_thread_open(&f->worker);
    enum status status = robot_place_open(&f->place, place);
    if (status == OK)
        status = worker_thread_start(&f->worker, run, f, "to look for the robot in its place");
    if (status != OK)
        robot_place_finder_close(out);
    return status;
}

void robot_place_finder_close(struct robot_place_finder **out)
{
    struct robot_place_finder *f = *out;
    if (!f)
        return;
    worker_thread_close(&f->worker);
    robot_place_close(&f->place);
    free(f);
    *out = NULL;
}

void robot_place_finder_update(struct robot_place_finder *f, const struct surround_picture *pictures, int count,
                               struct robot_place_answer *out)
{
    pthread_mutex_lock(&f->worker.lock);
    const enum robot_place_state state = f->answer.state;
    const int due = f->offered + (state == ROBOT_PLACE_FOUND ? SELDOM : 1);
    if (!f->pending && state != ROBOT_PLACE_FAILED && count >= due) {
        f->picture = pictures[count - 1];
        f->pending = true;
        f->offered = count;
        pthread_cond_signal(&f->worker.changed);
    }
    *out = f->answer;
    pthread_mutex_unlock(&f->worker.lock);
}
