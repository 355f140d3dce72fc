#include "platform/sensors/oni_player.h"

#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

const char oni_player_name[] = "reenact-oni-player";

// Ends the process with its program. Not by PR_SET_PDEATHSIG: that is bound to the thread that started this process,
// which may end long before the program does.
static void *end_with_program(void *nothing)
{
    struct pollfd channel = {PLAYER_CHANNEL, POLLRDHUP, 0};
    while (poll(&channel, 1, -1) < 0 || !(channel.revents & (POLLRDHUP | POLLHUP | POLLERR | POLLNVAL)))
        ;
    _exit(0);
    return nothing;
}

static bool answer(struct oni_reply *reply, enum status status, const struct source_facts *facts,
                   const struct frame *frame)
{
    reply->status = status;
    snprintf(reply->sentence, sizeof reply->sentence, "%s", status < 0 ? status_message() : "");
    reply->calibration = facts->calibration;
    reply->remaining = facts->remaining;
    reply->dropped = facts->dropped;
    reply->time_ns = frame->time_ns;
    memcpy(reply->name, frame->name, sizeof reply->name);
    reply->has_color = frame->color;
    return send(PLAYER_CHANNEL, reply, sizeof *reply, MSG_NOSIGNAL) == (ssize_t)sizeof *reply;
}

_Noreturn void oni_player_run(const char *name)
{
    static struct source_facts facts = {.remaining = -1};
    static struct oni_reply reply;
    struct frame frame = {0};
    void *self = NULL;
    pthread_t watch;
    char asked;
    enum status status = OK;
    if (pthread_create(&watch, NULL, end_with_program, NULL))
        status = fail(ERR_MEMORY, "no memory to play %s", name);
    if (status == OK)
        status = oni_play(&self, name, &facts);
    while (answer(&reply, status, &facts, &frame) && self && recv(PLAYER_CHANNEL, &asked, 1, 0) == 1) {
        frame = (struct frame){0};
        status = openni_kind.next(self, &frame);
    }
    _exit(0);
}

__attribute__((constructor)) static void play_if_asked(int argc, char **argv)
{
    if (argc == 2 && !strcmp(argv[0], oni_player_name))
        oni_player_run(argv[1]);
}
