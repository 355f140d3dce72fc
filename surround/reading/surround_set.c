#include "surround/reading/surround_set.h"

#include "base/text.h"
#include "formats/ply.h"
#include "platform/files/file.h"
#include "platform/files/image_file.h"
#include "platform/files/json.h"
#include "platform/files/text_file.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- pose list

static bool parse_pose(const char *text, struct pose *out)
{
    struct vec3 *t = &out->translation;
    struct quat *q = &out->rotation;
    if (sscanf(text, "%lf %lf %lf %lf %lf %lf %lf", &t->x, &t->y, &t->z, &q->x, &q->y, &q->z, &q->w) != 7 ||
        !pose_finite(*out) || fabs(t->x) > 1e7 || fabs(t->y) > 1e7 || fabs(t->z) > 1e7)
        return false;
    const double length2 = q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w;
    *out = (struct pose){quat_unit(*q), *t};
    return length2 > 0.5 && length2 < 2;
}

static bool parse_time(const char *text, char **rest, int64_t *time_ns)
{
    const double seconds = strtod(text, rest);
    if (*rest == text || !(fabs(seconds) < SECONDS_MAX))
        return false;
    *time_ns = llround(seconds * 1e9);
    return true;
}

// "NAME/NUMBER" of a view without a time; a name must not lead out of the folder.
static bool parse_name(const char *text, char **rest, char out[64])
{
    char name[32], number[24];
    int used = 0;
    if (sscanf(text, "%31s %23s %n", name, number, &used) != 2 || !used || strchr(name, '/') || strchr(number, '/') ||
        name[0] == '.' || number[0] == '.')
        return false;
    snprintf(out, 64, "%s/%s", name, number);
    *rest = (char *)(uintptr_t)text + used;
    return true;
}

static enum status parse_entry(const char *line, int index, struct timed_pose *out)
{
    char *rest;
    *out = (struct timed_pose){0};
    if (isalpha((unsigned char)*line) || *line == '_') {
        if (!parse_name(line, &rest, out->name))
            return NOTHING;
    } else {
        snprintf(out->name, sizeof out->name, "%04d", index);
        if (!parse_time(line, &rest, &out->time_ns))
            return NOTHING;
    }
    return parse_pose(rest, &out->pose) ? OK : NOTHING;
}

enum status pose_list_read(const char *path, struct timed_pose **out, int *count)
{
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    struct timed_pose *list = malloc(text_file_lines_left(&file) * sizeof *list);
    if (!list)
        status = fail(ERR_MEMORY, "no memory for a list of poses");
    int n = 0;
    for (const char *line; status == OK && (line = text_file_line(&file)); n++) {
        if (parse_entry(line, n, &list[n]) != OK)
            status = fail(ERR_INPUT, "%s line %d is no pose: time (or name and number) and tx ty tz qx qy qz qw", path,
                          file.line);
        else if (n && list[n - 1].time_ns > list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, file.line);
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s holds no pose", path);
    text_file_close(&file);
    if (status != OK) {
        free(list);
        return status;
    }
    *out = list;
    *count = n;
    return OK;
}

static enum status parse_file(const char *folder, const char *name, const struct text_file *list, const char *line,
                              struct timed_file *out)
{
    char *rest, file[512];
    if (!parse_time(line, &rest, &out->time_ns) || sscanf(rest, "%511s", file) != 1)
        return fail(ERR_INPUT, "%s/%s line %d is no time and file", folder, name, list->line);
    if ((size_t)snprintf(out->path, sizeof out->path, "%s/%s", folder, file) >= sizeof out->path)
        return fail(ERR_INPUT, "%s/%s line %d: the path is too long", folder, name, list->line);
    return file_check_listed(folder, name, list->line, file);
}

enum status file_list_read(const char *folder, const char *name, struct timed_file **out, int *count)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    struct timed_file *list = malloc(text_file_lines_left(&file) * sizeof *list);
    if (!list)
        status = fail(ERR_MEMORY, "no memory for a list of poses");
    int n = 0;
    for (const char *line; status == OK && (line = text_file_line(&file)); n++) {
        status = parse_file(folder, name, &file, line, &list[n]);
        if (status == OK && n && list[n - 1].time_ns >= list[n].time_ns)
            status = fail(ERR_INPUT, "%s line %d: the times do not rise; sort the lines", path, file.line);
    }
    if (status == OK && !n)
        status = fail(ERR_INPUT, "%s names no file", path);
    text_file_close(&file);
    if (status != OK) {
        free(list);
        return status;
    }
    *out = list;
    *count = n;
    return OK;
}

struct pose pose_list_at(const struct timed_pose *list, int count, int64_t time_ns)
{
    int after = 0; // how many are before the time
    for (int end = count; after < end;) {
        const int middle = after + (end - after) / 2;
        if (list[middle].time_ns < time_ns)
            after = middle + 1;
        else
            end = middle;
    }
    if (after == 0)
        return list[0].pose;
    if (after == count)
        return list[count - 1].pose;
    const struct timed_pose *a = &list[after - 1], *b = &list[after];
    const double t = (double)(time_ns - a->time_ns) / (double)(b->time_ns - a->time_ns);
    return (struct pose){quat_slerp(a->pose.rotation, b->pose.rotation, t),
                         v3_mix(a->pose.translation, b->pose.translation, t)};
}

// ---------------------------------------------------------------- surround set

static const char *const camera_names[SURROUND_DEPTH_CAMERAS] = {"front", "left", "back", "right"};
static const double FARTHEST_M = 100; // a camera from the body's middle: no body is longer
#define MAX_APART_NS 50000000         // files of one instant: half of a frame at 10 Hz

static enum status read_lens(const struct json *from, const char *path, struct lens *out)
{
    double width, height;
    enum status status = json_need_number(from, "width", path, &width);
    if (status == OK)
        status = json_need_number(from, "height", path, &height);
    if (status == OK)
        status = json_need_number(from, "fx", path, &out->fx);
    if (status == OK)
        status = json_need_number(from, "fy", path, &out->fy);
    if (status == OK)
        status = json_need_number(from, "cx", path, &out->cx);
    if (status == OK)
        status = json_need_number(from, "cy", path, &out->cy);
    if (status != OK)
        return status;
    if (!(width >= 1 && width <= 16384 && height >= 1 && height <= 16384))
        return fail(ERR_INPUT, "%s: width and height must be from 1 to 16384", path);
    out->width = (int)width;
    out->height = (int)height;
    return lens_check(out, path);
}

// A matrix 4 x 4 of a rigid motion; absent: the identity, and not *placed.
static enum status read_motion(const struct json *from, const char *path, struct pose *out, bool *placed)
{
    *out = POSE_IDENTITY;
    const struct json *rows = json_member(from, "body_from_camera");
    *placed = rows != NULL;
    if (!rows)
        return OK;
    double m[3][3], t[3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            if (!json_get_number(json_at(json_at(rows, i), j), j < 3 ? &m[i][j] : &t[i]))
                return fail(ERR_INPUT, "%s: body_from_camera must be a 4 x 4 matrix", path);
    if (!matrix_is_rotation(m, 1e-3))
        return fail(ERR_INPUT, "%s: body_from_camera is no rotation of right-handed axes", path);
    for (int i = 0; i < 3; i++)
        if (!(fabs(t[i]) < FARTHEST_M))
            return fail(ERR_INPUT, "%s: body_from_camera is %g m from the body", path, fabs(t[i]));
    out->rotation = quat_from_matrix(m);
    out->translation = v3(t[0], t[1], t[2]);
    return OK;
}

static enum status read_calibration(struct surround_set *set, const struct json *root, const char *path)
{
    enum status status = read_lens(json_member(root, "view"), path, &set->view);
    const struct json *panorama = json_member(root, "panorama"), *body = json_member(root, "body");
    const char *projection = "";
    json_get_string(json_member(panorama, "projection"), &projection);
    if (status == OK && strcmp(projection, "equirectangular"))
        status = read_lens(panorama, path, &set->panorama_lens);
    if (status == OK)
        status = read_motion(panorama, path, &set->body_from_panorama, &set->panorama_placed);
    const double usual[3] = {0.6, 0.5, 1.2};
    const char *const names[3] = {"length_m", "width_m", "height_m"};
    for (int i = 0; i < 3; i++) {
        set->body_size_m[i] = usual[i];
        json_get_number(json_member(body, names[i]), &set->body_size_m[i]);
        if (!(set->body_size_m[i] > 0 && set->body_size_m[i] < 100))
            return fail(ERR_INPUT, "%s: the body's %s must be above 0", path, names[i]);
    }
    for (int c = 0; status == OK && c < SURROUND_DEPTH_CAMERAS; c++) {
        const struct json *one = json_member(json_member(root, "depth"), camera_names[c]);
        if (!one)
            continue;
        status = read_lens(one, path, &set->depth_cameras[c].lens);
        if (status == OK)
            status = read_motion(one, path, &set->depth_cameras[c].body_from_camera, &set->depth_cameras[c].placed);
    }
    return status;
}

static enum status read_filmed_calibration(struct surround_set *set, const struct json *root, const char *path)
{
    const struct json *color = json_member(root, "color"), *distortion = json_member(color, "distortion");
    enum status status = read_lens(color, path, &set->panorama_lens);
    if (status == OK)
        status = read_lens(json_member(root, "depth"), path, &set->depth_cameras[0].lens);
    if (status != OK)
        return status;
    struct lens *lens = &set->panorama_lens;
    double *const terms[5] = {&lens->k1, &lens->k2, &lens->p1, &lens->p2, &lens->k3};
    for (int i = 0; i < 5; i++)
        json_get_number(json_at(distortion, i), terms[i]);
    set->view = *lens;
    set->view.k1 = set->view.k2 = set->view.p1 = set->view.p2 = set->view.k3 = 0;
    set->body_from_panorama = set->depth_cameras[0].body_from_camera = POSE_IDENTITY;
    return lens_check(lens, path);
}

enum status surround_rig_read(struct surround_set *out, const char *path)
{
    *out = (struct surround_set){.robot = true};
    struct json *root;
    enum status status = json_read(path, &root);
    if (status != OK)
        return status;
    status = read_calibration(out, root, path);
    json_free(&root);
    if (status != OK)
        *out = (struct surround_set){0};
    return status;
}

static enum status open_calibration(struct surround_set *set, const char *folder)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/calibration.json", folder);
    struct json *root;
    enum status status = json_read(path, &root);
    if (status != OK)
        return status;
    status = set->filmed ? read_filmed_calibration(set, root, path) : read_calibration(set, root, path);
    json_free(&root);
    return status;
}

// The file nearest to a time, or NULL. `from`: where the search begins, 0 or as the call for an earlier time left it.
static const char *file_at(const struct timed_file *list, int count, int64_t time_ns, int *from)
{
    while (*from + 1 < count && llabs(list[*from + 1].time_ns - time_ns) < llabs(list[*from].time_ns - time_ns))
        ++*from;
    const struct timed_file *best = count ? &list[*from] : NULL;
    return best && llabs(best->time_ns - time_ns) <= MAX_APART_NS ? best->path : NULL;
}

static enum status read_captures(struct surround_set *set, const char *folder)
{
    enum status status =
        file_list_read(folder, set->filmed ? "rgb.txt" : "panorama.txt", &set->files[0], &set->capture_count);
    int counts[SURROUND_DEPTH_CAMERAS] = {0};
    for (int c = 0; status == OK && set->robot && c < SURROUND_DEPTH_CAMERAS; c++) {
        char name[64];
        snprintf(name, sizeof name, "depth_%s.txt", camera_names[c]);
        if (set->depth_cameras[c].lens.width)
            status = file_list_read(folder, name, &set->files[1 + c], &counts[c]);
    }
    if (status == OK && set->filmed)
        status = file_list_read(folder, "depth.txt", &set->files[1], &counts[0]);
    if (status == OK && !(set->captures = calloc((size_t)set->capture_count, sizeof *set->captures)))
        status = fail(ERR_MEMORY, "no memory for the set of captures");
    int nearest[SURROUND_DEPTH_CAMERAS] = {0};
    for (int i = 0; status == OK && i < set->capture_count; i++) {
        struct capture *capture = &set->captures[i];
        capture->time_ns = set->files[0][i].time_ns;
        capture->panorama = set->files[0][i].path;
        for (int c = 0; c < SURROUND_DEPTH_CAMERAS; c++)
            capture->depth[c] = file_at(set->files[1 + c], counts[c], capture->time_ns, &nearest[c]);
        capture->guess = pose_list_at(set->odometry, set->odometry_count, capture->time_ns);
    }
    return status;
}

static enum status read_set(struct surround_set *set, const char *folder)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/odometry.txt", folder);
    set->robot = file_exists(path);
    if (!set->robot) {
        snprintf(path, sizeof path, "%s/rgb.txt", folder);
        set->filmed = file_exists(path);
        snprintf(path, sizeof path, "%s/%s", folder, set->filmed ? "trajectory.txt" : "panorama_poses.txt");
    }
    enum status status = open_calibration(set, folder);
    if (status == OK)
        status = pose_list_read(path, &set->odometry, &set->odometry_count);
    if (status == OK)
        status = read_captures(set, folder);
    if (status == OK && !set->robot && !set->filmed) {
        snprintf(path, sizeof path, "%s/points.ply", folder);
        status = ply_points_read(path, &set->points, &set->point_count);
    }
    return status;
}

enum status surround_set_read(struct surround_set *out, const char *folder)
{
    *out = (struct surround_set){0};
    const enum status status = read_set(out, folder);
    if (status != OK)
        surround_set_free(out);
    return status;
}

void surround_set_free(struct surround_set *set)
{
    free(set->captures);
    free(set->odometry);
    free(set->points);
    for (int i = 0; i <= SURROUND_DEPTH_CAMERAS; i++)
        free(set->files[i]);
    *set = (struct surround_set){0};
}

enum status surround_set_picture(const struct surround_set *set, int capture, struct surround_picture *out)
{
    struct image image;
    const struct lens *lens = set->panorama_lens.width ? &set->panorama_lens : NULL;
    enum status status = image_read(set->captures[capture].panorama, &image);
    if (status != OK)
        return status;
    if (lens && (lens->width != image.width || lens->height != image.height)) {
        free(image.rgb);
        return fail(ERR_INPUT, "%s is not of calibration.json's size", set->captures[capture].panorama);
    }
    struct lens ideal = set->panorama_lens;
    if (lens)
        status = surround_image_undistort(image.rgb, &ideal);
    if (status != OK) {
        free(image.rgb);
        return status;
    }
    status = surround_picture_make(out, image.rgb, image.width, image.height, lens ? &ideal : NULL);
    out->time_ns = set->captures[capture].time_ns;
    return status;
}
