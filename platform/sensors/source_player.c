#include "platform/sensors/source_player.h"

#include "base/clock.h"

#include <stdlib.h>
#include <string.h>

static const int64_t RETRY_NS = 1000000000;

enum status source_player_open(struct source_player *p, const char *uri, enum source_wanted wanted)
{
    *p = (struct source_player){.wanted = wanted};
    worker_thread_open(&p->worker);
    p->uri = strdup(uri);
    return p->uri ? OK : fail(ERR_MEMORY, "no memory for the source's name");
}

void source_player_close(struct source_player *player)
{
    worker_thread_close(&player->worker);
    source_close(&player->source);
    free(player->uri);
    player->uri = NULL;
}

void source_player_suspend(struct source_player *player, bool suspend)
{
    pthread_mutex_lock(&player->worker.lock);
    player->suspended = suspend;
    pthread_cond_broadcast(&player->worker.changed);
    pthread_mutex_unlock(&player->worker.lock);
}

// ---------------------------------------------------------------- waiting

bool source_player_wait_to_play(struct source_player *player)
{
    pthread_mutex_lock(&player->worker.lock);
    while (player->suspended && !player->worker.closing)
        pthread_cond_wait(&player->worker.changed, &player->worker.lock);
    const bool closing = player->worker.closing;
    pthread_mutex_unlock(&player->worker.lock);
    return !closing;
}

bool source_player_must_stop(struct source_player *player)
{
    pthread_mutex_lock(&player->worker.lock);
    const bool stop = player->worker.closing || player->suspended;
    pthread_mutex_unlock(&player->worker.lock);
    return stop;
}

void source_player_wait_until_ns(struct source_player *player, int64_t when_ns)
{
    pthread_mutex_lock(&player->worker.lock);
    while (!player->worker.closing && !player->suspended &&
           condition_wait_until_ns(&player->worker.changed, &player->worker.lock, when_ns))
        continue;
    pthread_mutex_unlock(&player->worker.lock);
}

void source_player_wait_for_frame(struct source_player *player)
{
    if (player->film)
        source_player_wait_until_ns(player, player->due_ns);
}

void source_player_wait_to_retry(struct source_player *player)
{
    source_player_wait_until_ns(player, clock_now_ns() + RETRY_NS);
}

// ---------------------------------------------------------------- the source

enum status source_player_open_source(struct source_player *p)
{
    source_player_close_source(p);
    enum status status = source_open(&p->source, p->uri, p->wanted);
    p->film = status == OK && !source_is_live(p->source);
    p->began_ns = 0;
    return status;
}

void source_player_close_source(struct source_player *player) { source_close(&player->source); }

// When the film's frame of that time is due.
static void schedule(struct source_player *player, int64_t time_ns)
{
    const int64_t now_ns = clock_now_ns(), before_ns = player->due_ns, next_ns = player->due_ns + player->interval_ns;
    const bool first = !player->began_ns;
    if (first) {
        player->first_ns = time_ns;
        player->began_ns = now_ns > next_ns ? now_ns : next_ns;
    }
    player->due_ns = player->began_ns + time_ns - player->first_ns;
    player->interval_ns = first ? 0 : player->due_ns - before_ns;
}

enum status source_player_next(struct source_player *p, struct frame *out)
{
    enum status status = source_next(p->source, out);
    if (status == NOTHING && !p->film)
        return fail(ERR_DEVICE, "the %s has stopped", p->wanted == SOURCE_SENSOR ? "sensor" : "camera");
    if (status == OK && p->film)
        schedule(p, out->time_ns);
    return status;
}

void source_player_begin(struct source_player *player)
{
    const int64_t since_first_ns = player->due_ns - player->began_ns;
    player->began_ns = clock_now_ns();
    player->due_ns = player->began_ns + since_first_ns;
    player->interval_ns = 0;
}

void source_player_delay(struct source_player *player, int64_t delay_ns) { player->began_ns += delay_ns; }

void source_player_resume(struct source_player *player) { player->began_ns = player->due_ns = player->interval_ns = 0; }
