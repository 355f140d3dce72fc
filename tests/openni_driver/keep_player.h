// For the leak sanitizer: keeps OpenNI2's player of .oni files in memory, so
// that what it loses is told by its name (leaks.txt) and not by bare addresses
// of a library that is gone. No other use.
#pragma once
#include <dlfcn.h>

static inline void keep_player(void)
{
    void *player = dlopen(OPENNI2_PLAYER, RTLD_NOW | RTLD_NODELETE);
    if (player)
        dlclose(player); // stays all the same
}
