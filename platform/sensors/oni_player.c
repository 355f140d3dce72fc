#include "platform/sensors/oni_player.h"

#include "platform/files/file.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static _Noreturn void oni_player_run(const char *name);

// ---------------------------------------------------------------- oni file

// oni:FILE, the program's side: starts the process that plays the file (oni_player.h) and asks it for frames.

// The player answers within milliseconds, and of a file that says nothing any more after FILE_SILENCE_MS (3 s). Ten
// times that is left to a busy machine, an emulator or a sanitizer; a player that hangs is ended then.
enum { ANSWER_MS = 30000 };

enum { SIDE_MAX = 4096 }; // as openni.c's choice of video modes

struct oni_file {
    char *name;
    pid_t player; // 0: ended
    int channel, file, memory;
    const uint8_t *pictures;
    size_t picture_bytes;
    int64_t frames; // received
    struct source_facts *facts;
};

// ------------------------------------------------------------- the player's start and end

// In the new process, which has one thread: nothing here takes a lock.
static _Noreturn void become_player(const struct oni_file *file, int channel)
{
    const int given[] = {channel, file->file, file->memory};
    int high[COUNT_OF(given)];
    const int nothing = open("/dev/null", O_RDONLY); // what libraries say when they break is nobody's
    for (size_t i = 0; i < COUNT_OF(given); i++)
        high[i] = fcntl(given[i], F_DUPFD, PLAYER_DESCRIPTORS);
    for (int i = 0; i < PLAYER_CHANNEL; i++)
        dup2(nothing, i);
    for (size_t i = 0; i < COUNT_OF(given); i++)
        dup2(high[i], PLAYER_CHANNEL + (int)i);
    close_range(PLAYER_DESCRIPTORS, ~0U, 0);
    setpgid(0, 0); // Ctrl-C is the program's, which ends in good order
    // No core files of strangers' damage. 1, not 0: that holds for a core_pattern that is a pipe, too.
    setrlimit(RLIMIT_CORE, &(struct rlimit){1, 1});
    char *const words[] = {(char *)(uintptr_t)oni_player_name, file->name, NULL};
    execv("/proc/self/exe", words);
    oni_player_run(file->name); // under an emulator, which cannot start what it emulates
}

static enum status start_player(struct oni_file *file)
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends))
        return fail(ERR_IO, "%s: no connection to a process that plays it: %s", file->name, strerror(errno));
    file->channel = ends[0];
    file->player = fork();
    if (file->player == 0)
        become_player(file, ends[1]);
    close(ends[1]);
    if (file->player > 0)
        return OK;
    file->player = 0;
    return fail(ERR_MEMORY, "%s: the process that plays it does not start: %s", file->name, strerror(errno));
}

// Returns the signal that had ended it before; 0: none.
static int end_player(struct oni_file *file)
{
    int how = 0;
    if (!file->player)
        return 0;
    kill(file->player, SIGKILL);
    while (waitpid(file->player, &how, 0) < 0 && errno == EINTR)
        ;
    file->player = 0;
    return WIFSIGNALED(how) ? WTERMSIG(how) : 0;
}

// No answer: the player has ended (lost), or does not come to an end.
static enum status no_answer(struct oni_file *file, bool lost)
{
    // A dead one keeps the signal that ended it; the one of end_player then comes too late.
    const int by = lost ? end_player(file) : (end_player(file), 0);
    char where[64] = "while it opens it";
    if (file->pictures)
        snprintf(where, sizeof where, "after %lld of its pictures", (long long)file->frames);
    file->facts->remaining = 0;
    if (lost && by == SIGKILL)
        return fail(ERR_MEMORY, "%s cannot be read on: the process that plays it was killed; is memory short?",
                    file->name);
    if (!lost)
        return fail(ERR_INPUT, "%s is damaged: OpenNI2 comes to no end %s", file->name, where);
    return fail(ERR_INPUT, "%s is damaged: OpenNI2 breaks down %s", file->name, where);
}

// ------------------------------------------------------------- answers

static enum status take_answer(struct oni_file *file, struct oni_reply *reply)
{
    struct pollfd channel = {file->channel, POLLIN, 0};
    int ready;
    while ((ready = poll(&channel, 1, ANSWER_MS)) < 0 && errno == EINTR)
        ;
    if (ready <= 0)
        return no_answer(file, false);
    if (recv(file->channel, reply, sizeof *reply, 0) != (ssize_t)sizeof *reply)
        return no_answer(file, true);
    reply->sentence[sizeof reply->sentence - 1] = 0;
    reply->name[sizeof reply->name - 1] = 0;
    file->facts->remaining = reply->remaining;
    file->facts->dropped = reply->dropped;
    return reply->status < 0 ? fail(reply->status, "%s", reply->sentence) : reply->status;
}

// Not everything a broken player says is believed.
static enum status check_lens(const struct oni_file *file, const struct lens *lens, const char *what)
{
    if (lens->width < 1 || lens->height < 1 || lens->width > SIDE_MAX || lens->height > SIDE_MAX ||
        lens_check(lens, what) != OK)
        return fail(ERR_INPUT, "%s is damaged: its %s pictures are of an impossible shape", file->name, what);
    return OK;
}

static enum status map_pictures(struct oni_file *file, const struct calibration *calibration)
{
    struct stat about;
    enum status status = check_lens(file, &calibration->depth, "depth");
    if (status == OK && calibration->color.width)
        status = check_lens(file, &calibration->color, "colour");
    if (status != OK)
        return status;
    file->picture_bytes = 2 * lens_pixels(&calibration->depth) + 3 * lens_pixels(&calibration->color);
    // Sealed: memory that got smaller later would be a signal here.
    if (fcntl(file->memory, F_ADD_SEALS, F_SEAL_SHRINK) || fstat(file->memory, &about) ||
        (uint64_t)about.st_size < file->picture_bytes)
        return fail(ERR_MEMORY, "no memory for the pictures of %s", file->name);
    void *pictures = mmap(NULL, file->picture_bytes, PROT_READ, MAP_SHARED, file->memory, 0);
    if (pictures == MAP_FAILED)
        return fail(ERR_MEMORY, "no memory for the pictures of %s", file->name);
    file->pictures = pictures;
    return OK;
}

static enum status oni_next(void *self, struct frame *out)
{
    struct oni_file *f = self;
    struct oni_reply reply;
    if (!f->player)
        return NOTHING; // it broke down, which was said
    if (send(f->channel, "", 1, MSG_NOSIGNAL) != 1)
        return no_answer(f, true);
    const enum status status = take_answer(f, &reply);
    if (status != OK)
        return status;
    f->frames++;
    out->time_ns = reply.time_ns;
    memcpy(out->name, reply.name, sizeof out->name);
    out->depth = (const uint16_t *)(const void *)f->pictures;
    out->color = reply.has_color ? f->pictures + 2 * lens_pixels(&f->facts->calibration.depth) : NULL;
    return OK;
}

// ------------------------------------------------------------- opening

static void oni_close(void *self)
{
    struct oni_file *f = self;
    if (!f)
        return;
    end_player(f);
    if (f->pictures)
        munmap((void *)(uintptr_t)f->pictures, f->picture_bytes);
    const int descriptors[] = {f->channel, f->file, f->memory};
    for (size_t i = 0; i < COUNT_OF(descriptors); i++)
        if (descriptors[i] >= 0)
            close(descriptors[i]);
    free(f->name);
    free(f);
}

static enum status open_file(struct oni_file *file)
{
    struct stat about;
    uint8_t begin[FILE_KIND_BYTES];
    file->file = open(file->name, O_RDONLY | O_CLOEXEC | O_NONBLOCK); // a pipe would be waited for
    if (file->file < 0 || fstat(file->file, &about))
        return errno == ENOENT || errno == ENOTDIR ? fail(ERR_MISSING, "there is no file %s", file->name)
                                                   : fail(ERR_IO, "%s: %s", file->name, strerror(errno));
    if (S_ISDIR(about.st_mode))
        return fail(ERR_INPUT, "%s is a folder; pictures in one are opened as folder:%s", file->name, file->name);
    if (!S_ISREG(about.st_mode))
        return fail(ERR_INPUT, "%s is not a file", file->name);
    const ssize_t count = pread(file->file, begin, sizeof begin, 0);
    if (count < 0)
        return fail(ERR_IO, "%s: %s", file->name, strerror(errno));
    if (count >= 4 && !memcmp(begin, "NI10", 4))
        return OK;
    const char *kind = file_kind_of(begin, (size_t)count, (uint64_t)about.st_size);
    return fail(ERR_INPUT, "%s is no recording of OpenNI2%s%s", file->name, kind ? ": it is " : "", kind ? kind : "");
}

static enum status open_all(struct oni_file *file)
{
    struct oni_reply reply;
    enum status status = open_file(file);
    if (status == OK && (file->memory = memfd_create("pictures of an .oni file", MFD_CLOEXEC | MFD_ALLOW_SEALING)) < 0)
        status = fail(ERR_MEMORY, "no memory for the pictures of %s: %s", file->name, strerror(errno));
    if (status == OK)
        status = start_player(file);
    if (status == OK)
        status = take_answer(file, &reply);
    if (status == OK)
        status = map_pictures(file, &reply.calibration);
    if (status == OK)
        file->facts->calibration = reply.calibration;
    return status;
}

enum status oni_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    *self = NULL;
    struct oni_file *f = calloc(1, sizeof *f);
    char *name = strdup(where);
    if (!f || !name) {
        free(f);
        free(name);
        return fail(ERR_MEMORY, "no memory to open %s", where);
    }
    *f = (struct oni_file){.name = name, .channel = -1, .file = -1, .memory = -1, .facts = facts};
    const enum status status = open_all(f);
    if (status == OK)
        *self = f;
    else
        oni_close(f);
    return status;
}

const struct source_kind oni_kind = {oni_next, oni_close};

// ---------------------------------------------------------------- oni player

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

static bool send_reply(struct oni_reply *reply, enum status status, const struct source_facts *facts,
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

// The player itself; does not return.
static _Noreturn void oni_player_run(const char *name)
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
    while (send_reply(&reply, status, &facts, &frame) && self && recv(PLAYER_CHANNEL, &asked, 1, 0) == 1) {
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
