#include "app/studio/studio_wish.h"

#include <stdio.h>
#include <string.h>

void studio_wish_open(struct studio_wish *wish)
{
    *wish->take = 0;
    pthread_mutex_init(&wish->lock, NULL);
}

void studio_wish_close(struct studio_wish *wish) { pthread_mutex_destroy(&wish->lock); }

void studio_wish_put(struct studio_wish *wish, const char *take)
{
    pthread_mutex_lock(&wish->lock);
    snprintf(wish->take, sizeof wish->take, "%s", take);
    pthread_mutex_unlock(&wish->lock);
}

bool studio_wish_waits(struct studio_wish *wish)
{
    pthread_mutex_lock(&wish->lock);
    const bool waits = *wish->take != 0;
    pthread_mutex_unlock(&wish->lock);
    return waits;
}

bool studio_wish_take(struct studio_wish *wish, char take[256])
{
    pthread_mutex_lock(&wish->lock);
    memcpy(take, wish->take, sizeof wish->take);
    *wish->take = 0;
    pthread_mutex_unlock(&wish->lock);
    return *take != 0;
}
