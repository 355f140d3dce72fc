// Runs a program as a user would and keeps its output.
#pragma once
#include "base/status.h"

#include <sys/types.h>

struct process_result {
    int exit_code;               // 128 + signal when a signal ended it
    char out[16384], err[16384]; // the first bytes of each stream, zero-terminated
};

// How many times longer a program of ours may take: cross-built ones run under an emulator.
#ifdef EMULATED
enum { PROCESS_PATIENCE = 20 };
#else
enum { PROCESS_PATIENCE = 1 };
#endif

// argv[0] is the path (one below /usr is run natively, all others through the emulator); the list ends with NULL.
// Standard input is empty.
struct process_result process_run(const char *const *argv);

// PROGRAM(…): process_run with the arguments listed.
#define PROCESS(...) process_run((const char *const[]){__VA_ARGS__, NULL})

// The same on a terminal whose user has typed `typed` already: standard input and error are the terminal, and what it
// shows is in .err, without the echo.
struct process_result process_run_on_terminal(const char *typed, const char *const *argv);

// Starts it with both streams discarded; the caller waits for the child.
pid_t process_start(const char *const *argv);
