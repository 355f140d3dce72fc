#include "base/parallel.h"

#include <pthread.h>

enum { MOST_THREADS = 16 };

struct share {
    int first, step, count;
    void (*work)(void *, int);
    void *context;
};

static void *do_share(void *argument)
{
    const struct share *s = argument;
    for (int i = s->first; i < s->count; i += s->step)
        s->work(s->context, i);
    return NULL;
}

void parallel(int threads, int count, void (*work)(void *context, int i), void *context)
{
    int n = threads < count ? threads : count;
    n = n < 1 ? 1 : n > MOST_THREADS ? MOST_THREADS : n;
    struct share shares[MOST_THREADS];
    pthread_t thread[MOST_THREADS];
    bool runs[MOST_THREADS] = {false};
    for (int i = 0; i < n; i++)
        shares[i] = (struct share){i, n, count, work, context};
    for (int i = 1; i < n; i++)
        runs[i] = pthread_create(&thread[i], NULL, do_share, &shares[i]) == 0;
    do_share(&shares[0]);
    for (int i = 1; i < n; i++)
        if (runs[i])
            pthread_join(thread[i], NULL);
        else
            do_share(&shares[i]); // no thread to be had: do it here
}
