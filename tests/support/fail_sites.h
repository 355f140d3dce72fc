// The call sites from which a program makes calls of one kind, identified by their call stacks, how often each calls,
// and the blocks of memory that each has taken and not given back. Any thread may call.
//
// A site is a stack of return addresses, nearest first: up to SITE_PROGRAM_DEPTH inside the program, and before them up
// to SITE_LIBRARY_DEPTH inside the libraries that sites_start was given. Addresses count from where their module is
// loaded, so that a site has the same number in every run. Other modules' frames are left out.
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum {
    SITE_PROGRAM_DEPTH = 6,
    SITE_LIBRARY_DEPTH = 3, // SQLite's own functions beneath which memory is taken are SQLite's to test
    SITE_FRAMES_MAX = SITE_PROGRAM_DEPTH + SITE_LIBRARY_DEPTH,
    SITES_MAX = 1 << 15,
};

// Finds where the modules lie: the program, and the libraries in whose name one of `libraries` occurs (NULL ends them).
void sites_start(const char *const *libraries);

// Whether code of the program or of one of the libraries lies there.
bool sites_hold(const void *code);
bool sites_hold_in_program(const void *code);

// Counts a call from the present stack. *turn: which call of this site it is, counted from 1. -1: it cannot be told (a
// call of the unwinder itself, or too many sites); else the site's index.
int site_of_call(long *turn);

// The site's number: a hash of its stack.
uint64_t site_number(int site);

// A block was allocated from a site; any block was freed.
void site_takes(int site, const void *block);
void site_gives_back(const void *block);

// Writes a line a site: number, calls, blocks that it still has, stack.
void sites_write(const char *path, bool failed);
