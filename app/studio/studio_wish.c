#include "app/studio/studio_wish.h"

#include <stdio.h>
#include <string.h>

void studio_wish_open(struct studio_wish *w)
{
    *w->take = 0;
    pthread_mutex_init(&w->lock, NULL);
}

void studio_wish_close(struct studio_wish *w) { pthread_mutex_destroy(&w->lock); }

void studio_wish_put(struct studio_wish *w, const char *take)
{
    pthread_mutex_lock(&w->lock);
    snprintf(w->take, sizeof w->take, "%s", take);
    pthread_mutex_unlock(&w->lock);
}

bool studio_wish_waits(struct studio_wish *w)
{
    pthread_mutex_lock(&w->lock);
    const bool waits = *w->take != 0;
    pthread_mutex_unlock(&w->lock);
    return waits;
}

bool studio_wish_take(struct studio_wish *w, char take[256])
{
    pthread_mutex_lock(&w->lock);
    memcpy(take, w->take, sizeof w->take);
    *w->take = 0;
    pthread_mutex_unlock(&w->lock);
    return *take != 0;
}
