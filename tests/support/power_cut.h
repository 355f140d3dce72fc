// A layer under SQLite (a VFS) that pretends to lose the power: what was written since a file's last sync is then lost,
// torn into sectors or kept out of order, as a disk may do it. Creating and removing a file count as durable
// immediately.
#pragma once
#include "base/status.h"

enum power_cut {
    POWER_CUT_LOSES_ALL,  // of the unsynced writes
    POWER_CUT_KEEPS_SOME, // any of them, and of those any sectors of 512 bytes
    POWER_CUT_KEEPS_FIRST // the earlier ones, the last of them torn
};

// Makes the layer SQLite's default. The process ends with exit code POWER_CUT_EXIT at its `operation`-th write,
// truncation or sync (0: never), and leaves the files as after a power cut.
enum { POWER_CUT_EXIT = 86 };
void power_cut_install(enum power_cut how, int64_t operation, uint64_t seed);
int64_t power_cut_operations(void); // so far
