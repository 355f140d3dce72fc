// How both programs begin and end: which command is meant, or which one was, and what holds for the whole process.
#include "app/commands/command.h"

#include "base/text.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

// ---------------------------------------------------------------- the process

// Ends the process without the exit handlers of libraries that were loaded with it: those of tracing libraries, which
// come with libcamera, crash where memory is short. What the program has to finish, it has finished.
static void leave(int code, void *nothing)
{
    (void)nothing;
    fflush(NULL);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) // their reports are made by such handlers
    _exit(code);
#else
    (void)code;
#endif
}

// As large as Linux gives them by default, also where `ulimit -s` allows less, which is then also the size that threads
// get: ours and libraries' count on it.
enum { STACK_BYTES = 8 << 20 };

static void prepare_process(void)
{
    pthread_attr_t usual;
    size_t bytes = 0;
    on_exit(leave, NULL);
    if (pthread_getattr_default_np(&usual))
        return;
    if (!pthread_attr_getstacksize(&usual, &bytes) && bytes < STACK_BYTES &&
        !pthread_attr_setstacksize(&usual, STACK_BYTES))
        (void)pthread_setattr_default_np(&usual);
    pthread_attr_destroy(&usual);
}

// ---------------------------------------------------------------- the command

void command_print_version(const char *program)
{
    printf("%.*s %s\n", (int)strcspn(program, " "), program, REENACT_VERSION);
}

static void print_commands(FILE *to, const char *about, const struct command *commands, size_t count,
                           const char *program)
{
    fprintf(to, "%s\n\n", about);
    for (size_t i = 0; i < count; i++)
        fprintf(to, "  %s %-10s %s\n", program, commands[i].name, commands[i].about);
    fprintf(to, "\n%s COMMAND --help says more; --version prints the version.\n", program);
}

static int run(const struct command *command, const char *name, int argc, char **argv)
{
    char copy[128]; // argv[0] may be written to
    snprintf(copy, sizeof copy, "%s", name);
    argv[0] = copy;
    const int code = command->run(argc, argv);
    if (!fflush(stdout) && !ferror(stdout))
        return code;
    fprintf(stderr, "%s: the report could not be written: %s\n", name, strerror(errno));
    return code ? code : 1;
}

static int run_named(const struct command *command, const char *program, int argc, char **argv)
{
    char name[128];
    snprintf(name, sizeof name, "%s %s", program, command->name);
    return run(command, name, argc, argv);
}

// How many letters must be added, left out, exchanged or swapped with their neighbour to make `b` of `a` (Damerau 1964,
// each place changed once); words of commands are short.
static int typing_errors(const char *a, const char *b)
{
    enum { MOST = 24 };
    int cost[MOST + 1][MOST + 1];
    const int n = (int)strlen(a), m = (int)strlen(b);
    if (n > MOST || m > MOST)
        return MOST;
    for (int i = 0; i <= n; i++)
        for (int k = 0; k <= m; k++) {
            if (!i || !k) {
                cost[i][k] = i + k;
                continue;
            }
            int best = cost[i - 1][k - 1] + (a[i - 1] != b[k - 1]);
            best = cost[i - 1][k] + 1 < best ? cost[i - 1][k] + 1 : best;
            best = cost[i][k - 1] + 1 < best ? cost[i][k - 1] + 1 : best;
            if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1] && cost[i - 2][k - 2] + 1 < best)
                best = cost[i - 2][k - 2] + 1;
            cost[i][k] = best;
        }
    return cost[n][m];
}

const char *command_nearest(const char *word, const char *const *names, size_t count)
{
    const char *best = NULL;
    int least = strlen(word) < 4 ? 2 : 3; // fewer than so many errors
    for (size_t i = 0; i < count; i++) {
        const bool begins = strlen(word) >= 3 && !strncmp(names[i], word, strlen(word));
        const int errors = begins ? 1 : typing_errors(word, names[i]);
        if (errors < least) {
            least = errors;
            best = names[i];
        }
    }
    return best;
}

static int unknown(const char *program, const char *what, const char *also, const char *word, const char *const *names,
                   size_t count)
{
    char shown[80];
    const char *meant = command_nearest(word, names, count);
    snprintf(shown, sizeof shown, "%s", word);
    text_make_printable(shown);
    fprintf(stderr, "%s: there is no %s '%s'%s; ", program, what, shown, also);
    if (meant)
        fprintf(stderr, "did you mean %s?\n", meant);
    else
        fprintf(stderr, "%s --help lists them\n", program);
    return 2;
}

int command_unknown(const char *program, const char *what, const char *word, const char *const *names, size_t count)
{
    return unknown(program, what, "", word, names, count);
}

static int no_command(const char *program, const char *word, const struct command *commands, size_t count,
                      bool file_too)
{
    const char *names[64];
    count = count < COUNT_OF(names) ? count : COUNT_OF(names);
    for (size_t i = 0; i < count; i++)
        names[i] = commands[i].name;
    return unknown(program, "command", file_too ? " and no such file" : "", word, names, count);
}

// Whether a word was meant as a command's name rather than a file's or an option.
static bool is_word(const char *text)
{
    return *text && !text[strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_-")] && *text != '-' &&
           access(text, F_OK);
}

struct choice {
    const char *about;
    const struct command *commands, *fallback;
    size_t count;
    int argc, code;
    char **argv;
};

static int choose(const struct choice *c)
{
    const struct command *const commands = c->commands, *const fallback = c->fallback;
    const size_t count = c->count;
    const int argc = c->argc;
    char **const argv = c->argv;
    const char *const about = c->about;
    const char *slash = strrchr(argv[0], '/');
    const char *program = slash ? slash + 1 : argv[0];
    const char *word = argc > 1 ? argv[1] : NULL;
    if (!word) {
        print_commands(stderr, about, commands, count, program);
        return 2;
    }
    for (size_t i = 0; i < count; i++)
        if (!strcmp(word, commands[i].name))
            return run_named(&commands[i], program, argc - 1, argv + 1);
    if (!strcmp(word, "--version") || !strcmp(word, "-V")) {
        command_print_version(program);
        return 0;
    }
    const bool help = !strcmp(word, "--help") || !strcmp(word, "-h");
    if (help) {
        print_commands(stdout, about, commands, count, program);
        if (!fallback)
            return 0;
        printf("\n"); // and what it does without a command
        fflush(stdout);
    }
    if (fallback && !strcmp(word, fallback->name)) // as it stands in the list
        return run(fallback, program, argc - 1, argv + 1);
    if (fallback && (help || !is_word(word)))
        return run(fallback, program, argc, argv);
    return no_command(program, word, commands, count, fallback);
}

static void *choose_on_thread(void *self)
{
    struct choice *c = self;
    c->code = choose(c);
    return NULL;
}

int command_main(const char *about, const struct command *commands, size_t count, const struct command *fallback,
                 int argc, char **argv)
{
    struct choice c = {about, commands, fallback, count, argc, 0, argv};
    struct rlimit stack;
    pthread_t thread;
    argp_err_exit_status = 2;
    prepare_process();
    if (!getrlimit(RLIMIT_STACK, &stack) && stack.rlim_cur < STACK_BYTES &&
        !pthread_create(&thread, NULL, choose_on_thread, &c)) {
        pthread_join(thread, NULL);
        return c.code;
    }
    return choose(&c);
}
