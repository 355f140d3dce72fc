#include "tests/support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

// The emulator's command for a cross-built program, then NULL.
static const char *const emulator[] = {EMULATOR NULL};

static void become(const char *const *argv, int in, int out, int err)
{
    int nothing = open("/dev/null", O_RDWR);
    dup2(in < 0 ? nothing : in, STDIN_FILENO);
    dup2(out < 0 ? nothing : out, STDOUT_FILENO);
    dup2(err < 0 ? nothing : err, STDERR_FILENO);
    const char *words[64] = {0};
    size_t count = 0;
    const bool ours = strncmp(argv[0], "/usr/", 5);
    for (const char *const *word = emulator; ours && *word && count < COUNT_OF(words) - 1; word++)
        words[count++] = *word;
    while (*argv && count < COUNT_OF(words) - 1)
        words[count++] = *argv++;
    execvp(words[0], (char *const *)(uintptr_t)words);
    _exit(127);
}

// Appends what can be read; false at the end of the stream.
static bool drain(int fd, char *text, size_t size, size_t *used)
{
    char block[4096];
    ssize_t got = read(fd, block, sizeof block);
    if (got <= 0)
        return false;
    size_t room = size - 1 - *used, kept = (size_t)got < room ? (size_t)got : room;
    memcpy(text + *used, block, kept);
    *used += kept;
    text[*used] = 0;
    return true;
}

// out, err: pairs of ends, to read and to write; all are closed. in < 0: nothing.
static struct process_result run(const char *const *argv, int in, const int out[2], const int err[2])
{
    struct process_result said = {0};
    pid_t child = fork();
    if (child == 0) {
        close(out[0]);
        close(err[0]);
        become(argv, in, out[1], err[1]);
    }
    close(out[1]);
    close(err[1]);
    size_t out_used = 0, err_used = 0;
    struct pollfd open_ends[2] = {{out[0], POLLIN, 0}, {err[0], POLLIN, 0}};
    while (open_ends[0].fd >= 0 || open_ends[1].fd >= 0) {
        poll(open_ends, 2, -1);
        if (open_ends[0].revents && !drain(out[0], said.out, sizeof said.out, &out_used))
            open_ends[0].fd = -1;
        if (open_ends[1].revents && !drain(err[0], said.err, sizeof said.err, &err_used))
            open_ends[1].fd = -1;
    }
    close(out[0]);
    close(err[0]);
    int status;
    waitpid(child, &status, 0);
    said.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return said;
}

struct process_result process_run(const char *const *argv)
{
    int out[2], err[2];
    if (pipe(out) || pipe(err))
        abort();
    return run(argv, -1, out, err);
}

struct process_result process_run_on_terminal(const char *typed, const char *const *argv)
{
    int out[2], err[2] = {posix_openpt(O_RDWR | O_NOCTTY), -1};
    if (pipe(out) || err[0] < 0 || grantpt(err[0]) || unlockpt(err[0]))
        abort();
    err[1] = open(ptsname(err[0]), O_RDWR | O_NOCTTY);
    struct termios how;
    if (err[1] < 0 || tcgetattr(err[1], &how))
        abort();
    how.c_lflag &= ~(tcflag_t)ECHO;
    if (tcsetattr(err[1], TCSANOW, &how) || write(err[0], typed, strlen(typed)) != (ssize_t)strlen(typed))
        abort();
    return run(argv, err[1], out, err);
}

pid_t process_start(const char *const *argv)
{
    pid_t child = fork();
    if (child == 0)
        become(argv, -1, -1, -1);
    return child;
}
