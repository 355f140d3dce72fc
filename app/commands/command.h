// What all commands of both programs share: choosing the command, parsing of common options, exit codes,
// the one sentence on stderr, the progress bar, and stopping on Ctrl-C. Used on the main thread only.
//
// A command parses its own arguments with argp, by command_parse, and
// returns the exit code: 0 success, 1 the input is at fault, 2 wrong usage.
#pragma once
#include "base/status.h"
#include "platform/sensors/source.h"

#include <argp.h>

struct command {
    const char *name;
    const char *about;                 // one line for the program's --help
    int (*run)(int argc, char **argv); // argv[0] is "program command"
};

// Runs the command that argv[1] names; prints the list for --help (0) or, without a fallback, for no command (2); for
// an unknown one says which may have been meant (2). `fallback`, where not NULL, takes no argv[1], or one that is a
// file's name or an option; its --help follows the list. When the program ends, exit handlers of libraries are not run.
// Threads have stacks of at least 8 MB.
int command_main(const char *about, const struct command *commands, size_t count, const struct command *fallback,
                 int argc, char **argv);

// Says that there is no command or action (`what`) of that name, and which one was probably meant; returns 2.
int command_unknown(const char *program, const char *what, const char *word, const char *const *names, size_t count);

// For a command that picks its options by hand: "reenact-capture 0.2.0" for argv[0] "reenact-capture calibrate".
void command_print_version(const char *program);

// Prints "program: sentence" of the last fail() to stderr; returns 1.
int command_failed(const char *program);

// Writes the malloc'ed text to the file, NULL: standard output, and frees it. ERR_MEMORY: text is NULL. ERR_IO.
MUST_CHECK enum status command_write_text(const char *path, char *text);

// Warns on stderr that `count` tags are not where the place has them, the lowest id being `first`. 0: no output.
void command_warn_moved_tags(const char *program, int32_t count, int32_t first);

// Warns on stderr that a recorded source left `count` pictures out because their times do not rise. 0: no output.
void command_warn_times(const char *program, int64_t count);

// Warns on stderr where colour and depth of a sensor run by different clocks.
struct source;
void command_warn_clocks(const char *program, const struct source *source);

// ---- For argp parsers. On wrong usage these print a sentence and end the program with exit code 2.

// An option key that has no letter. Use COMMAND_KEY + n, n = 0, 1, ...
enum { COMMAND_KEY = 0x100 };

// Options that several commands have.
#define COMMAND_OPTION_JSON(key)                                                                                       \
    {                                                                                                                  \
        "json", key, NULL, 0, "report as JSON", 0                                                                      \
    }
#define COMMAND_OPTION_QUAD_DECIMATE(key)                                                                              \
    {                                                                                                                  \
        "quad-decimate", key, "N", 0, "look for tags in pictures N times smaller (1 to 8, default 1: most reliable)",  \
            0                                                                                                          \
    }
double command_parse_quad_decimate(const struct argp_state *state, const char *value);

// How every command begins: argp_parse for its arguments, and --help (-h), --usage, --version (-V), alike everywhere
// and in every place; lack of memory in it ends the program with a sentence and exit code 1. From here on a file that
// may not grow (SIGXFSZ) is an error and no longer kills.
void command_parse(const struct argp *argp, int argc, char **argv, void *input);

// Prints the help of a part of a command whose options `argp` describes.
void command_print_help(const struct argp *argp, const char *program);

// --force of commands that write files.
#define COMMAND_OPTION_FORCE(key)                                                                                      \
    {                                                                                                                  \
        "force", key, NULL, 0, "write over files that exist; a recording is never overwritten", 0                      \
    }

// A required option must have been given.
void command_require(const struct argp_state *state, const void *given, const char *option);

// The value of an option that takes a decimal number from `min` to `max`.
double command_parse_number(const struct argp_state *state, const char *option, const char *value, double min,
                            double max);

// Of --text, percent: 1, 1.25 or 1.5.
double command_parse_text_size(const struct argp_state *state, const char *value);

// The value of an option that takes two whole numbers as in 1280x800, each from `min` to `max`.
void command_parse_size(const struct argp_state *state, const char *option, const char *value, int min, int max,
                        int size[2]);

// The value of an option that takes one of `count` names, as its index.
int command_parse_choice(const struct argp_state *state, const char *option, const char *value,
                         const char *const *names, int count);

// The argument of a command that takes one FILE, into *file; a second one is wrong usage.
void command_take_file(const struct argp_state *state, const char **file, const char *value);

// For a command that takes options only.
void command_refuse_argument(const struct argp_state *state, const char *value);

// Parses the arguments of a command that takes one FILE and --json.
struct file_arguments {
    const char *path;
    bool json;
};
void command_parse_file(int argc, char **argv, const char *doc, struct file_arguments *out);

// An empty tree for a report. ERR_MEMORY.
struct json;
MUST_CHECK enum status command_begin_json(struct json **root);

// Prints the tree to stdout and frees it. ERR_MEMORY.
MUST_CHECK enum status command_print_json(struct json **root);

// From the first call on, Ctrl-C, SIGTERM and the end of the terminal (SIGHUP) no longer end the program but make
// command_stopped() true, so that long work can end in good order. Each call resets
// command_stopped(), for the next piece of work.
void command_catch_signals(void);
bool command_stopped(void);

// A bar on stderr where that is a terminal, else a line every ten seconds, with the time left as soon as that is known.
// total <= 0: only the count is shown.
struct progress_bar {
    const char *what;
    int64_t total, done;
    int64_t started_ns, drawn_ns, printed_ns;
    char note[192]; // shown behind the bar
};
void progress_bar_start(struct progress_bar *bar, const char *what, int64_t total);
void progress_bar_step(struct progress_bar *bar); // one more done
void progress_bar_end(struct progress_bar *bar);  // clears the line

// ---------------------------------------------------------------- source frames

// A source's frames one by one, for commands that go through all of them. Main thread.

struct source_frames {
    struct source *source; // borrowed
    const char *program;   // says each damaged frame on stderr, having cleared the bar; NULL: they are only counted
    struct progress_bar *bar;
    int64_t count, damaged;
    char cut[200]; // why a live source failed before it was told to end: "the … was unplugged"; "": it did not
};

// OK: *out is the next frame; damaged ones are left out. NOTHING: the end, or Ctrl-C; or the source failed, but not
// before its first frame: what it gave until then counts, and `cut` is to be said with the result. Errors of
// source_next.
MUST_CHECK enum status source_frames_next(struct source_frames *frames, struct frame *out);

// When the result is written. ERR_DEVICE with a sentence: it was cut short.
MUST_CHECK enum status source_frames_end(const struct source_frames *frames);

// ---------------------------------------------------------------- picture count

// What became of a camera's pictures, counted and said alike by all commands that look for the camera in a place. Every
// picture is in one of the four.

struct picture_count {
    int64_t placed;
    int64_t ambiguous;  // two poses fit nearly as well
    int64_t not_placed; // nothing of the place was recognised
    int64_t unreadable; // damaged, or of another size than the calibration's
};

// Fewer than half of those that could be read were placed.
bool picture_count_is_few(const struct picture_count *count);

// Counts a picture by the tracker's answer: OK, AMBIGUOUS, or nothing recognised.
void picture_count_add(struct picture_count *count, enum status found);

// "7 of 14 pictures placed, 1 ambiguous, 6 unreadable or of another size"; what there is none of is left out.
enum { PICTURE_COUNT_BYTES = 160 };
const char *picture_count_text(const struct picture_count *picture_count, char out[PICTURE_COUNT_BYTES]);

// "pictures", "placed", "ambiguous", "not_placed", "damaged".
struct json;
void picture_count_add_json(struct json *object, const struct picture_count *count);
