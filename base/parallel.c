#include "base/parallel.h"

#include "base/clamp.h"

#include <pthread.h>

enum { MAX_THREADS = 16 };

struct parallel_share {
    int first, step, count;
    void (*work)(void *, int);
    void *context;
};

static void *run_share(void *argument)
{
    const struct parallel_share *s = argument;
    for (int i = s->first; i < s->count; i += s->step)
        s->work(s->context, i);
    return NULL;
}

void parallel_for(int threads, int count, void (*work)(void *context, int i), void *context)
{
    const int n = clamp_int(threads < count ? threads : count, 1, MAX_THREADS);
    struct parallel_share shares[MAX_THREADS];
    pthread_t thread[MAX_THREADS];
    bool runs[MAX_THREADS] = {false};
    for (int i = 0; i < n; i++)
        shares[i] = (struct parallel_share){i, n, count, work, context};
    for (int i = 1; i < n; i++)
        runs[i] = pthread_create(&thread[i], NULL, run_share, &shares[i]) == 0;
    run_share(&shares[0]);
    for (int i = 1; i < n; i++)
        if (runs[i])
            pthread_join(thread[i], NULL);
        else
            run_share(&shares[i]); // no thread could be created: do it here
}
