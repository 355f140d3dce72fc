#include "tests/support/work.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

static bool first_line(const char *task, const char *name, char *line, int size)
{
    char path[300];
    snprintf(path, sizeof path, "/proc/self/task/%s/%s", task, name);
    FILE *file = fopen(path, "r");
    const bool there = file && fgets(line, size, file);
    if (file)
        fclose(file);
    return there;
}

static double stolen_so_far_ms(void)
{
    double ticks = 0;
    FILE *file = fopen("/proc/stat", "r");
    if (file) {
        if (fscanf(file, "cpu %*f %*f %*f %*f %*f %*f %*f %lf", &ticks) != 1)
            ticks = 0;
        fclose(file);
    }
    return ticks * 1e3 / (double)sysconf(_SC_CLK_TCK);
}

struct work work_so_far(void)
{
    struct work w = {.stolen_ms = stolen_so_far_ms()};
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    w.faults = (double)usage.ru_minflt;
    DIR *dir = opendir("/proc/self/task");
    for (const struct dirent *task; dir && (task = readdir(dir));) {
        char name[32], line[100];
        double ran_ns, waited_ns;
        if (!first_line(task->d_name, "comm", name, sizeof name) ||
            !first_line(task->d_name, "schedstat", line, sizeof line) ||
            sscanf(line, "%lf %lf", &ran_ns, &waited_ns) != 2)
            continue;
        // Without a graphics card the driver draws on threads of its own.
        const bool draws = atoi(task->d_name) == getpid() || !strncmp(name, "llvmpipe", 8);
        w.cpu_ms += draws ? ran_ns * 1e-6 : 0;
        w.waited_ms += draws ? waited_ns * 1e-6 : 0;
        w.other_threads_ms += draws ? 0 : ran_ns * 1e-6;
    }
    if (dir)
        closedir(dir);
    return w;
}

struct work work_since(const struct work *before)
{
    const struct work now = work_so_far();
    return (struct work){now.cpu_ms - before->cpu_ms, now.waited_ms - before->waited_ms,
                         now.other_threads_ms - before->other_threads_ms, now.faults - before->faults,
                         now.stolen_ms - before->stolen_ms};
}
