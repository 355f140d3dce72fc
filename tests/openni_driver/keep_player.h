// For the leak sanitizer: keeps OpenNI2's player of .oni files loaded, so that
// its leaks are reported with its name, which leaks.txt suppresses, and not as
// addresses of an unloaded library. No other use.
#pragma once
#include <dlfcn.h>

static inline void keep_player(void)
{
    void *player = dlopen(OPENNI2_PLAYER, RTLD_NOW | RTLD_NODELETE);
    if (player)
        dlclose(player); // RTLD_NODELETE: it stays loaded
}
