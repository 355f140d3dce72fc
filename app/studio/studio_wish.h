// The name of a take for which something is wanted, handed from the window's thread to the session's.
#pragma once
#include "base/status.h"

#include <pthread.h>

struct studio_wish {
    pthread_mutex_t lock;
    char take[256]; // "": none
};

void studio_wish_open(struct studio_wish *wish);
void studio_wish_close(struct studio_wish *wish);
void studio_wish_put(struct studio_wish *wish, const char *take);
bool studio_wish_waits(struct studio_wish *wish);
bool studio_wish_take(struct studio_wish *wish, char take[256]); // and there is none any more; false: there was none
