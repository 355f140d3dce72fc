// The driving program's side of ros_guard.h.
#include "platform/network/ros_guard.h"

#include "base/clock.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { READY_MS = 10000, END_MS = 1000 }; // left to a busy machine, by hand

const char ros_guard_name[] = "reenact-ros-guard";

struct ros_guard {
    pid_t process;
    int channel;
};

// In the new process, which has one thread: nothing here takes a lock.
static _Noreturn void become_guard(int channel, char *const *words)
{
    const int nothing = open("/dev/null", O_RDONLY); // the program says what there is to say
    const int high = fcntl(channel, F_DUPFD, GUARD_CHANNEL + 1);
    for (int i = 0; i < GUARD_CHANNEL; i++)
        dup2(nothing, i);
    dup2(high, GUARD_CHANNEL);
    close_range(GUARD_CHANNEL + 1, ~0U, 0);
    setsid(); // Ctrl-C, Ctrl-Z and a terminal that closes are the program's
    execv("/proc/self/exe", words);
    _exit(1);
}

// Its name, the master, what renames topics but the node itself: two nodes of one name end each other. To be freed.
static char **words_of(const char *master, const char *const *remap)
{
    size_t count = 0, used = 0;
    while (remap && remap[count])
        count++;
    const char **words = calloc(count + 3, sizeof *words);
    if (!words)
        return NULL;
    words[used++] = ros_guard_name;
    words[used++] = master;
    for (size_t i = 0; i < count; i++)
        if (strncmp(remap[i], "__name:=", strlen("__name:=")) != 0)
            words[used++] = remap[i];
    return (char **)(uintptr_t)words;
}

enum status ros_guard_start(struct ros_guard **out, const char *master, const char *const *remap)
{
    int ends[2];
    struct ros_guard *g = *out = calloc(1, sizeof *g);
    char **words = words_of(master, remap);
    enum status status = g && words ? OK : fail(ERR_MEMORY, "no memory for the robot's guard");
    if (status == OK && socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends))
        status = fail(ERR_IO, "no connection to a process that guards the robot: %s", strerror(errno));
    if (status == OK) {
        g->channel = ends[0];
        g->process = fork();
        if (g->process == 0)
            become_guard(ends[1], words);
        close(ends[1]);
        if (g->process < 0) {
            status = fail(ERR_IO, "the process that guards the robot does not start: %s", strerror(errno));
            close(g->channel);
        }
    }
    free(words);
    if (status != OK) {
        free(g);
        *out = NULL;
    }
    return status;
}

enum status ros_guard_wait(struct ros_guard *guard)
{
    struct pollfd channel = {guard->channel, POLLIN, 0};
    char word = 0;
    int ready;
    while ((ready = poll(&channel, 1, READY_MS)) < 0 && errno == EINTR)
        ;
    if (ready > 0 && recv(guard->channel, &word, 1, 0) == 1 && word == GUARD_BYTE_READY)
        return OK;
    return fail(ERR_IO, "the process that would stop the robot if this program dies cannot reach cmd_vel of the ROS "
                        "master; without it none is driven");
}

enum ros_guard_word ros_guard_beat(struct ros_guard *guard)
{
    const char beat = GUARD_BYTE_BEAT;
    enum ros_guard_word said = GUARD_SILENT;
    char word;
    ssize_t got;
    if (send(guard->channel, &beat, 1, MSG_NOSIGNAL | MSG_DONTWAIT) != 1)
        return GUARD_GONE; // also one that reads nothing any more
    while ((got = recv(guard->channel, &word, 1, MSG_DONTWAIT)) == 1)
        if (word == GUARD_BYTE_STOPPED)
            said = GUARD_STOPPED;
    return got == 0 || (errno != EAGAIN && errno != EINTR) ? GUARD_GONE : said;
}

void ros_guard_end(struct ros_guard **guard)
{
    const char farewell = GUARD_BYTE_FAREWELL;
    if (!*guard)
        return;
    (void)send((*guard)->channel, &farewell, 1, MSG_NOSIGNAL | MSG_DONTWAIT);
    close((*guard)->channel);
    const int64_t until_ns = clock_now_ns() + END_MS * 1000000LL;
    while (waitpid((*guard)->process, NULL, WNOHANG) == 0) {
        if (clock_now_ns() > until_ns)
            kill((*guard)->process, SIGKILL);
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    }
    free(*guard);
    *guard = NULL;
}
