#include "objects/stereo_pairs.h"

#include "platform/files/text_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status read_line(const char *path, int line, const char *text, struct stereo_pair *out)
{
    char name[2][256];
    double v[8];
    if (sscanf(text, "%lf %lf %lf %lf %lf %lf %lf %lf %255s %255s", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6],
               &v[7], name[0], name[1]) != 10)
        return fail(ERR_INPUT, "%s, line %d: needs a time, seven numbers of a pose and two pictures", path, line);
    const struct quat q = {v[4], v[5], v[6], v[7]};
    const double length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    *out = (struct stereo_pair){.time_s = v[0], .world_from_left = {quat_unit(q), v3(v[1], v[2], v[3])}};
    if (!isfinite(v[0]) || !pose_finite(out->world_from_left) || !(length > 0.9 && length < 1.1))
        return fail(ERR_INPUT, "%s, line %d: the quaternion is not of length 1, or a number is not finite", path, line);
    const char *slash = strrchr(path, '/');
    for (int i = 0; i < 2; i++) {
        const int folder = name[i][0] == '/' || !slash ? 0 : (int)(slash - path + 1);
        if (snprintf(out->picture[i], PAIR_PATH_BYTES, "%.*s%s", folder, path, name[i]) >= PAIR_PATH_BYTES)
            return fail(ERR_INPUT, "%s, line %d: the path is too long", path, line);
    }
    return OK;
}

enum status stereo_pairs_read(const char *path, struct stereo_pair **pairs, int *count)
{
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    struct stereo_pair *out = malloc(text_file_lines_left(&file) * sizeof *out);
    if (!out)
        status = fail(ERR_MEMORY, "%s: no memory", path);
    int n = 0;
    for (const char *line; status == OK && (line = text_file_line(&file)); n++)
        status = read_line(path, file.line, line, &out[n]);
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s lists no pairs", path);
    text_file_close(&file);
    if (status != OK) {
        free(out);
        return status;
    }
    *pairs = out;
    *count = n;
    return OK;
}
