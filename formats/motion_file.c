#include "formats/motion_file.h"

#include "base/text.h"
#include "formats/bvh_reader.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum status bvh_points_read(const char *name, const uint8_t *bytes, size_t count, struct motion_points *out)
{
    struct bvh *bvh;
    enum status status = bvh_parse(&bvh, name, bytes, count);
    if (status != OK)
        return status;
    const int joints = bvh_joint_count(bvh);
    out->format = "BVH";
    out->up = UP_Y;
    status = motion_points_make_room(out, name, joints, bvh_frame_count(bvh));
    struct vec3 *at = malloc((size_t)joints * sizeof *at);
    if (status == OK && !at)
        status = fail(ERR_MEMORY, "no memory for the motion of %s", name);
    for (int j = 0; j < joints && status == OK; j++) {
        snprintf(out->names[j], POINT_NAME_BYTES, "%s", bvh_joint_name(bvh, j));
        text_make_printable(out->names[j]);
    }
    for (int i = 0; status == OK && i < out->frames; i++) {
        float *row = out->at + 3 * (size_t)i * (size_t)joints;
        bvh_positions(bvh, i, at);
        out->time_s[i] = i * bvh_frame_s(bvh);
        for (int k = 0; k < 3 * joints; k++)
            row[k] = (float)(&at[k / 3].x)[k % 3];
    }
    free(at);
    bvh_free(&bvh);
    return status;
}

// ---------------------------------------------------------------- which format

enum kind { KIND_NONE, KIND_BVH, KIND_TRC, KIND_C3D };

static bool begins_with(const uint8_t *bytes, size_t count, const char *word)
{
    return count >= strlen(word) && !memcmp(bytes, word, strlen(word));
}

static enum kind kind_of(const uint8_t *bytes, size_t count)
{
    const uint8_t *at = bytes, *end = bytes + count;
    if (count >= 4 && bytes[1] == 0x50 && bytes[0] >= 2 && bytes[0] < 128)
        return KIND_C3D;
    if (begins_with(at, (size_t)(end - at), "\xef\xbb\xbf"))
        at += 3;
    while (at < end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n'))
        at++;
    if (begins_with(at, (size_t)(end - at), "HIERARCHY"))
        return KIND_BVH;
    return begins_with(at, (size_t)(end - at), "PathFileType") ? KIND_TRC : KIND_NONE;
}

static bool has_ending(const char *path)
{
    static const char *const endings[] = {".bvh", ".trc", ".c3d"};
    const char *ending = strrchr(path, '.');
    for (size_t k = 0; k < COUNT_OF(endings) && ending; k++)
        if (!strcasecmp(ending, endings[k]))
            return true;
    return false;
}

bool is_motion_points_file(const char *path)
{
    static const char recording[] = "SQLite format 3";
    uint8_t begin[64];
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    const size_t got = fread(begin, 1, sizeof begin, file);
    fclose(file);
    return kind_of(begin, got) != KIND_NONE || (has_ending(path) && !begins_with(begin, got, recording));
}

enum status motion_points_read(const char *path, struct motion_points *out)
{
    uint8_t *bytes;
    size_t count;
    *out = (struct motion_points){.format = NULL};
    enum status status = file_read(path, &bytes, &count);
    if (status != OK)
        return status;
    switch (kind_of(bytes, count)) {
    case KIND_BVH: {
        const size_t mark = begins_with(bytes, count, "\xef\xbb\xbf") ? 3 : 0;
        status = bvh_points_read(path, bytes + mark, count - mark, out);
        break;
    }
    case KIND_TRC: status = trc_points_read(path, (char *)bytes, count, out); break;
    case KIND_C3D: status = c3d_points_read(path, bytes, count, out); break;
    case KIND_NONE:
        status = count ? fail(ERR_INPUT,
                              "%s is no BVH, TRC or C3D file: a BVH file begins with HIERARCHY, a TRC file with "
                              "PathFileType, as plain text",
                              path)
                       : fail(ERR_INPUT, "%s is empty", path);
        break;
    }
    free(bytes);
    if (status != OK)
        motion_points_free(out);
    return status;
}
