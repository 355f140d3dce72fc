// What all commands of both programs share: choosing the command, exit codes,
// the one sentence on stderr, the progress bar, and stopping on Ctrl-C.
//
// A command parses its own arguments with argp (so --help works everywhere) and
// returns the exit code: 0 success, 1 the input is at fault, 2 wrong usage.
#pragma once
#include "base/status.h"

#include <argp.h>

struct command {
    const char *name;
    const char *about;                 // one line for the program's --help
    int (*run)(int argc, char **argv); // argv[0] is "program command"
};

// Runs the command that argv[1] names; prints the list for --help (0) or for
// no or an unknown command (2). `fallback`, where not NULL, takes an argv[1]
// that is no command's name.
int command_main(const char *about, const struct command *commands, size_t count, const struct command *fallback,
                 int argc, char **argv);

// Prints "program: sentence" of the last fail() to stderr; returns 1.
int command_failed(const char *program);

// Says that `count` tags hang elsewhere than the place has them, the first of them number `first`; of 0, nothing.
void command_warn_moved_tags(const char *program, int32_t count, int32_t first);

// For argp: an option key that has no letter. Use COMMAND_KEY + n, n = 0, 1, ...
enum { COMMAND_KEY = 0x100 };

// Ends with exit code 2 and a sentence when a needed option is missing.
void command_require(const struct argp_state *state, const void *given, const char *option);

// The value of an option that takes a number from `least` to `most`; ends with exit
// code 2 and a sentence where it is none.
double command_parse_number(const struct argp_state *state, const char *option, const char *value, double least,
                            double most);

// The arguments of a command that takes one FILE and --json.
struct file_arguments {
    const char *path;
    bool json;
};
void command_parse_file(int argc, char **argv, const char *doc, struct file_arguments *out);

// Prints the tree to stdout and frees it. ERR_MEMORY.
struct json;
MUST_CHECK enum status command_print_json(struct json **root);

// From the first call on, Ctrl-C and SIGTERM no longer end the program but make
// command_stopped() true, so that long work can end in good order. Each call forgets
// an earlier one, for the next piece of work.
void command_catch_signals(void);
bool command_stopped(void);

// A bar on a terminal, nothing elsewhere. total <= 0: only the count is known.
struct progress_bar {
    const char *what;
    int64_t total, done;
    int64_t drawn_ns;
};
void progress_bar_start(struct progress_bar *p, const char *what, int64_t total);
void progress_bar_step(struct progress_bar *p); // one more done
void progress_bar_end(struct progress_bar *p);  // clears the line
