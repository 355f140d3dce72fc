// What all commands of both programs share.
#include "app/commands/command.h"

#include "base/clock.h"
#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

// ---------------------------------------------------------------- source frames

enum status source_frames_next(struct source_frames *frames, struct frame *out)
{
    enum status status = NOTHING;
    while (!command_stopped()) {
        status = source_next(frames->source, out);
        if (status != ERR_INPUT) // one damaged frame; the next call continues after it
            break;
        frames->damaged++;
        if (frames->program) {
            progress_bar_end(frames->bar);
            fprintf(stderr, "%s: %s; left out\n", frames->program, status_message());
        }
        status = NOTHING;
    }
    if (status == OK)
        frames->count++;
    if (status != ERR_DEVICE || !frames->count)
        return status;
    snprintf(frames->cut, sizeof frames->cut, "%s", status_message());
    return NOTHING;
}

enum status source_frames_end(const struct source_frames *frames)
{
    return *frames->cut ? fail(ERR_DEVICE, "%s: the result is of what it gave until then", frames->cut) : OK;
}

// ---------------------------------------------------------------- picture count

static int64_t picture_count_all(const struct picture_count *count)
{
    return count->placed + count->ambiguous + count->not_placed + count->unreadable;
}

bool picture_count_is_few(const struct picture_count *count)
{
    return 2 * count->placed < count->placed + count->ambiguous + count->not_placed;
}

void picture_count_add(struct picture_count *count, enum status found)
{
    count->placed += found == OK;
    count->ambiguous += found == AMBIGUOUS;
    count->not_placed += found != OK && found != AMBIGUOUS;
}

const char *picture_count_text(const struct picture_count *picture_count, char out[PICTURE_COUNT_BYTES])
{
    const struct {
        int64_t count;
        const char *what;
    } others[] = {{picture_count->ambiguous, "ambiguous"},
                  {picture_count->not_placed, "not placed"},
                  {picture_count->unreadable, "unreadable or of another size"}};
    const long long all = picture_count_all(picture_count);
    snprintf(out, PICTURE_COUNT_BYTES, "%lld of %lld pictures placed", (long long)picture_count->placed, all);
    for (size_t k = 0; k < COUNT_OF(others); k++)
        if (others[k].count) {
            const size_t used = strlen(out);
            snprintf(out + used, PICTURE_COUNT_BYTES - used, ", %lld %s", (long long)others[k].count, others[k].what);
        }
    return out;
}

void picture_count_add_json(struct json *object, const struct picture_count *count)
{
    json_add_number(object, "pictures", (double)picture_count_all(count));
    json_add_number(object, "placed", (double)count->placed);
    json_add_number(object, "ambiguous", (double)count->ambiguous);
    json_add_number(object, "not_placed", (double)count->not_placed);
    json_add_number(object, "damaged", (double)count->unreadable);
}

// ---------------------------------------------------------------- command main

// How both programs begin and end: which command is meant, or which one was, and what holds for the whole process.

// ---------------------------------------------------------------- the process

// Ends the process without the exit handlers of libraries that were loaded with it: those of tracing libraries, which
// come with libcamera, crash where memory is short. What the program has to finish, it has finished.
static void exit_process(int code, void *nothing)
{
    (void)nothing;
    fflush(NULL);
#ifndef REENACT_SANITIZED // their reports are made by such handlers
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
    on_exit(exit_process, NULL);
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

static int run_command(const struct command *command, const char *name, int argc, char **argv)
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
    return run_command(command, name, argc, argv);
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

// The name that was probably meant by a mistyped one; NULL: none is near.
static const char *command_nearest(const char *word, const char *const *names, size_t count)
{
    const char *best = NULL;
    int min = strlen(word) < 4 ? 2 : 3; // fewer than so many errors
    for (size_t i = 0; i < count; i++) {
        const bool begins = strlen(word) >= 3 && !strncmp(names[i], word, strlen(word));
        const int errors = begins ? 1 : typing_errors(word, names[i]);
        if (errors < min) {
            min = errors;
            best = names[i];
        }
    }
    return best;
}

static int report_unknown_word(const char *program, const char *what, const char *also, const char *word,
                               const char *const *names, size_t count)
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
    return report_unknown_word(program, what, "", word, names, count);
}

static int no_command(const char *program, const char *word, const struct command *commands, size_t count,
                      bool file_too)
{
    const char *names[64];
    count = count < COUNT_OF(names) ? count : COUNT_OF(names);
    for (size_t i = 0; i < count; i++)
        names[i] = commands[i].name;
    return report_unknown_word(program, "command", file_too ? " and no such file" : "", word, names, count);
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

static int choose_command(const struct choice *choice)
{
    const struct command *const commands = choice->commands, *const fallback = choice->fallback;
    const size_t count = choice->count;
    const int argc = choice->argc;
    char **const argv = choice->argv;
    const char *const about = choice->about;
    const char *slash = strrchr(argv[0], '/');
    const char *program = slash ? slash + 1 : argv[0];
    const char *word = argc > 1 ? argv[1] : NULL;
    if (!word && fallback)
        return run_command(fallback, program, argc, argv);
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
        return run_command(fallback, program, argc - 1, argv + 1);
    if (fallback && (help || !is_word(word)))
        return run_command(fallback, program, argc, argv);
    return no_command(program, word, commands, count, fallback);
}

static void *choose_on_thread(void *self)
{
    struct choice *c = self;
    c->code = choose_command(c);
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
    return choose_command(&c);
}

// ---------------------------------------------------------------- command

int command_failed(const char *program)
{
    fprintf(stderr, "%s: %s\n", program, status_message());
    return 1;
}

enum status command_write_text(const char *path, char *text)
{
    if (!text)
        return fail(ERR_MEMORY, "no memory for the report");
    enum status status = OK;
    if (path)
        status = file_write(path, text, strlen(text));
    else
        fputs(text, stdout);
    free(text);
    return status;
}

void command_warn_moved_tags(const char *program, int32_t count, int32_t first)
{
    if (count)
        fprintf(stderr,
                "%s: warning: tag %d%s not where the place has %s, and ignored; put %s back, or add a new "
                "sweep with reenact-capture map --into\n",
                program, (int)first, count > 1 ? " and others are" : " is", count > 1 ? "them" : "it",
                count > 1 ? "them" : "it");
}

void command_warn_times(const char *program, int64_t count)
{
    if (count)
        fprintf(stderr,
                "%s: warning: %lld pictures were left out: their times are not later than those of the pictures before "
                "them\n",
                program, (long long)count);
}

void command_warn_clocks(const char *program, const struct source *source)
{
    char text[STREAM_CLOCKS_TEXT_BYTES];
    if (*source_clocks(source, text))
        fprintf(stderr, "%s: warning: %s\n", program, text);
}

enum { KEY_USAGE = 1 }; // no command's, and no letter

// What every command understands beside its own options.
static error_t parse_common(int key, char *value, struct argp_state *state)
{
    (void)value;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = state->input; return 0;
    case 'h':
    case '?': argp_state_help(state, stdout, ARGP_HELP_STD_HELP); return 0;
    case KEY_USAGE: argp_state_help(state, stdout, ARGP_HELP_USAGE | ARGP_HELP_EXIT_OK); return 0;
    case 'V': command_print_version(state->name); exit(0);
    default: return ARGP_ERR_UNKNOWN;
    }
}

// --help, --usage and --version are recognised at any position, also in the place of an option's value.
static const char *asked_for(int argc, char **argv)
{
    static const char *const all[] = {"--help", "-h", "-?", "--usage", "--version", "-V"};
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++)
        for (size_t k = 0; k < COUNT_OF(all); k++)
            if (!strcmp(argv[i], all[k]))
                return all[k];
    return NULL;
}

static const struct argp_option *find_option(const struct argp_option *options, const char *word)
{
    const size_t length = strcspn(word + 2, "=");
    for (const struct argp_option *o = options; !strncmp(word, "--", 2) && length && o && (o->name || o->key); o++)
        if (o->name && strlen(o->name) == length && !strncmp(o->name, word + 2, length))
            return o;
    return NULL;
}

// An option that wants a value and is followed by another option has lost its value: --sensor --out FILE.
static void check_values(const struct argp_option *options, int argc, char **argv, const char *asked)
{
    for (int i = 1; i + 1 < argc && !asked && strcmp(argv[i], "--") != 0; i++) {
        const struct argp_option *option = strchr(argv[i], '=') ? NULL : find_option(options, argv[i]);
        if (!option || !option->arg || option->flags & OPTION_ARG_OPTIONAL)
            continue;
        if (find_option(options, argv[++i])) {
            fprintf(stderr, "%s: %s needs a value, and %s is another option; %s=%s gives it that value\n", argv[0],
                    argv[i - 1], argv[i], argv[i - 1], argv[i]);
            exit(2);
        }
    }
}

void command_parse(const struct argp *argp, int argc, char **argv, void *input)
{
    static const struct argp_option options[] = {
        {"help", 'h', NULL, 0, "print this help", -1},
        {NULL, '?', NULL, OPTION_HIDDEN, NULL, -1},
        {"usage", KEY_USAGE, NULL, 0, "print the options in short", -1},
        {"version", 'V', NULL, 0, "print the version", -1},
        {0},
    };
    const struct argp_child children[] = {{argp, 0, NULL, 0}, {0}};
    const struct argp common = {.options = options, .parser = parse_common, .children = children};
    signal(SIGXFSZ, SIG_IGN);
    char *alone[] = {argv[0], (char *)(uintptr_t)asked_for(argc, argv), NULL};
    check_values(argp->options, argc, argv, alone[1]);
    const error_t error = alone[1] ? argp_parse(&common, 2, alone, ARGP_NO_HELP, NULL, input)
                                   : argp_parse(&common, argc, argv, ARGP_NO_HELP, NULL, input);
    if (!error)
        return;
    fprintf(stderr, "%s: the arguments cannot be read: %s\n", argv[0], strerror(error));
    exit(1);
}

void command_print_help(const struct argp *argp, const char *program)
{
    char name[128];
    snprintf(name, sizeof name, "%s", program);
    argp_help(argp, stdout, ARGP_HELP_SHORT_USAGE | ARGP_HELP_LONG | ARGP_HELP_PRE_DOC, name);
}

void command_require(const struct argp_state *state, const void *given, const char *option)
{
    if (!given)
        argp_error(state, "%s is needed", option);
}

double command_parse_number(const struct argp_state *state, const char *option, const char *value, double min,
                            double max)
{
    double x = 0;
    if (!text_number(value, &x) || !(x >= min && x <= max))
        argp_error(state, "%s takes a number from %.12g to %.12g, not '%s'", option, min, max, value);
    return x;
}

double command_parse_text_size(const struct argp_state *state, const char *value)
{
    const double percent = command_parse_number(state, "--text", value, 100, 150);
    if (fabs(remainder(percent, 25)) > 1e-9)
        argp_error(state, "--text takes 100, 125 or 150, not '%s'", value);
    return percent / 100;
}

void command_parse_size(const struct argp_state *state, const char *option, const char *value, int min, int max,
                        int size[2])
{
    int used = 0;
    const char *cross = strchr(value, 'x');
    if (!cross || !isdigit((unsigned char)*value) || !isdigit((unsigned char)cross[1]) ||
        sscanf(value, "%5dx%5d%n", &size[0], &size[1], &used) != 2 || value[used] || size[0] < min || size[0] > max ||
        size[1] < min || size[1] > max)
        argp_error(state, "%s takes a size like %dx%d, at most %dx%d, not '%s'", option, min, min, max, max, value);
}

double command_parse_quad_decimate(const struct argp_state *state, const char *value)
{
    return command_parse_number(state, "--quad-decimate", value, 1, 8);
}

int command_parse_choice(const struct argp_state *state, const char *option, const char *value,
                         const char *const *names, int count)
{
    char list[256] = "";
    for (int i = 0; i < count; i++) {
        if (!strcmp(value, names[i]))
            return i;
        const size_t used = strlen(list);
        const char *before = i + 1 < count ? ", " : " or ";
        snprintf(list + used, sizeof list - used, "%s%s", i ? before : "", names[i]);
    }
    argp_error(state, "%s takes %s, not '%s'", option, list, value);
    return 0;
}

void command_take_file(const struct argp_state *state, const char **file, const char *value)
{
    if (*file)
        argp_error(state, "one FILE, not two: '%s'", value);
    *file = value;
}

void command_refuse_argument(const struct argp_state *state, const char *value)
{
    argp_error(state, "'%s' is not understood", value);
}

static error_t parse_file(int key, char *argument, struct argp_state *state)
{
    struct file_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->json = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->path, argument); return 0;
    case ARGP_KEY_END: command_require(state, a->path, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

void command_parse_file(int argc, char **argv, const char *doc, struct file_arguments *out)
{
    static const struct argp_option options[] = {
        COMMAND_OPTION_JSON(COMMAND_KEY),
        {0},
    };
    const struct argp argp = {.options = options, .parser = parse_file, .args_doc = "FILE", .doc = doc};
    *out = (struct file_arguments){0};
    command_parse(&argp, argc, argv, out);
}

enum status command_begin_json(struct json **root)
{
    return (*root = json_new_object()) ? OK : fail(ERR_MEMORY, "no memory to print the report");
}

enum status command_print_json(struct json **root)
{
    char *text = json_print(*root);
    json_free(root);
    if (!text)
        return fail(ERR_MEMORY, "no memory to print the report");
    fputs(text, stdout);
    free(text);
    return OK;
}

static volatile sig_atomic_t stopped;

static void handle_stop_signal(int signal)
{
    (void)signal;
    stopped = 1;
}

void command_catch_signals(void)
{
    struct sigaction action = {.sa_handler = handle_stop_signal};
    stopped = 0;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
}

bool command_stopped(void) { return stopped; }

// "2 min 5 s left", from the time that what is done took; "": too early to say.
static void time_left(const struct progress_bar *bar, int64_t now_ns, char out[32])
{
    const int64_t min_ns = 2000000000;
    const double spent_s = (double)(now_ns - bar->started_ns) * 1e-9;
    *out = 0;
    if (bar->done < 1 || bar->done >= bar->total || now_ns - bar->started_ns < min_ns)
        return;
    const double left_s = ceil(spent_s * (double)(bar->total - bar->done) / (double)bar->done);
    if (left_s < 60)
        snprintf(out, 32, "%.0f s left", left_s);
    else if (left_s < 3600)
        snprintf(out, 32, "%.0f min %.0f s left", floor(left_s / 60), fmod(left_s, 60));
    else
        snprintf(out, 32, "%.1f h left", left_s / 3600);
}

static void draw_progress(struct progress_bar *bar, int64_t now_ns)
{
    enum { WIDTH = 30 };
    char left[32];
    if (bar->total > 0) {
        int filled = (int)(bar->done * WIDTH / bar->total);
        fprintf(stderr, "\r%s [", bar->what);
        for (int i = 0; i < WIDTH; i++)
            fputc(i < filled ? '#' : '.', stderr);
        time_left(bar, now_ns, left);
        fprintf(stderr, "] %lld/%lld %s%s%s\033[K", (long long)bar->done, (long long)bar->total, left,
                *left && *bar->note ? " · " : "", bar->note);
    } else {
        fprintf(stderr, "\r%s %lld %s\033[K", bar->what, (long long)bar->done, bar->note);
    }
    fflush(stderr);
}

// Not on a terminal: a line now and then, which a log can hold.
static void print_progress(struct progress_bar *bar, int64_t now_ns)
{
    const int64_t every_ns = 10000000000;
    char left[32] = "";
    if (now_ns - (bar->printed_ns ? bar->printed_ns : bar->started_ns) < every_ns)
        return;
    bar->printed_ns = now_ns;
    if (bar->total > 0)
        time_left(bar, now_ns, left);
    fprintf(stderr, "%s: %lld", bar->what, (long long)bar->done);
    if (bar->total > 0)
        fprintf(stderr, " of %lld%s%s", (long long)bar->total, *left ? ", " : "", left);
    fputc('\n', stderr);
}

void progress_bar_start(struct progress_bar *bar, const char *what, int64_t total)
{
    *bar = (struct progress_bar){.what = what, .total = total, .started_ns = clock_now_ns()};
}

void progress_bar_step(struct progress_bar *bar)
{
    bar->done++;
    int64_t now = clock_now_ns();
    if (!isatty(STDERR_FILENO)) {
        print_progress(bar, now);
    } else if (now - bar->drawn_ns > 100000000) {
        bar->drawn_ns = now;
        draw_progress(bar, now);
    }
}

void progress_bar_end(struct progress_bar *bar)
{
    if (bar->drawn_ns)
        fprintf(stderr, "\r\033[K");
    bar->drawn_ns = 0;
}
