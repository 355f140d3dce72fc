#include "tests/bench/bench_folder.h"

#include "capture/mapping/mapper.h"
#include "platform/sensors/source.h"

#include <stdlib.h>

static const double SAME_S = 0.02;

enum status bench_map_folder(const char *data, struct place *out)
{
    char path[4096];
    struct mapper_tag *tags = NULL;
    struct mapper *m = NULL;
    struct source *sensor = NULL;
    struct mapper_report report;
    struct frame frame;
    int32_t count;
    snprintf(path, sizeof path, "%s/tags.json", data);
    enum status status = mapper_read_tags(path, &tags, &count);
    snprintf(path, sizeof path, "folder:%s/place", data);
    if (status == OK)
        status = source_open(&sensor, path, SOURCE_SENSOR);
    if (status == OK)
        status = mapper_open(&m, source_calibration(sensor), tags, count, NULL);
    while (status == OK && (status = source_next(sensor, &frame)) == OK)
        status = mapper_add(m, &frame);
    if (status == NOTHING)
        status = mapper_finish(m, out, &report);
    mapper_close(&m);
    source_close(&sensor);
    free(tags);
    return status;
}

enum status bench_open_truth(const char *data, const char *name, FILE **out)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/truth/%s", data, name);
    *out = fopen(path, "r");
    return *out ? OK : fail(ERR_MISSING, "%s is missing", path);
}

bool bench_truth_at(FILE *trajectory, double seconds, struct pose *out)
{
    char line[512];
    rewind(trajectory);
    while (fgets(line, sizeof line, trajectory)) {
        double t;
        struct pose p;
        if (sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %lf", &t, &p.translation.x, &p.translation.y, &p.translation.z,
                   &p.rotation.x, &p.rotation.y, &p.rotation.z, &p.rotation.w) == 8 &&
            fabs(t - seconds) < SAME_S) {
            *out = (struct pose){quat_unit(p.rotation), p.translation};
            return true;
        }
    }
    return false;
}
