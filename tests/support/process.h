// Runs a program as a user would and keeps what it said.
#pragma once
#include "base/status.h"

#include <sys/types.h>

struct process_result {
    int exit_code;               // 128 + signal when a signal ended it
    char out[16384], err[16384]; // the first bytes of each stream, ended by 0
};

// How many times as long as here a program of ours may take: cross-built ones run under an emulator.
#ifdef EMULATED
enum { PROCESS_PATIENCE = 20 };
#else
enum { PROCESS_PATIENCE = 1 };
#endif

// argv[0] is the path, one below /usr that of a program of this machine and not of ours; the list ends with NULL.
// Standard input is empty.
struct process_result process_run(const char *const *argv);

// PROGRAM(…): process_run with the arguments listed.
#define PROCESS(...) process_run((const char *const[]){__VA_ARGS__, NULL})

// Starts it with both streams thrown away; the caller waits for the child.
pid_t process_start(const char *const *argv);
