#include "tests/bench/bench_skeleton_data.h"

#include "platform/files/file.h"
#include "platform/sensors/source.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES_MOST = 300 };

void skeleton_data_close(struct skeleton_data *data)
{
    for (int i = 0; i < data->count; i++) {
        free(data->frame[i].depth);
        free(data->frame[i].gray);
        free(data->frame[i].color);
    }
    free(data->frame);
    *data = (struct skeleton_data){0};
}

static void to_gray(const uint8_t *rgb, size_t count, uint8_t *gray)
{
    for (size_t i = 0; i < count; i++)
        gray[i] = (uint8_t)((77 * rgb[3 * i] + 150 * rgb[3 * i + 1] + 29 * rgb[3 * i + 2] + 128) >> 8);
}

// The next frame, with buffers for its images; NULL: out of memory.
static struct skeleton_frame *add_frame(struct skeleton_data *data)
{
    const struct lens *depth = &data->calibration.depth, *color = &data->calibration.color;
    const bool looked = data->count % SKELETON_LOOK_EVERY == 0;
    struct skeleton_frame *f = &data->frame[data->count++];
    f->depth = calloc((size_t)depth->width * (size_t)depth->height, sizeof *f->depth);
    f->gray = calloc((size_t)color->width, (size_t)color->height);
    f->color = looked ? calloc(3 * (size_t)color->width, (size_t)color->height) : NULL;
    return f->depth && f->gray && (f->color || !looked) ? f : NULL;
}

static void take_color(struct skeleton_frame *f, const uint8_t *rgb, size_t pixels)
{
    to_gray(rgb, pixels, f->gray);
    if (f->color)
        memcpy(f->color, rgb, 3 * pixels);
}

static enum status film(struct skeleton_data *data, int frames)
{
    struct world_options options = world_default_options();
    options.motion = "kata";
    struct world *w;
    enum status status = world_open(&w, &options);
    if (status != OK)
        return status;
    data->calibration = world_calibration(1);
    struct lens lens = data->calibration.depth;
    struct pose from = world_sensor_pose(w);
    size_t pixels = (size_t)lens.width * (size_t)lens.height;
    uint8_t *rgb = malloc(3 * pixels);
    for (int k = 0; k < frames && status == OK; k++) {
        struct skeleton_frame *f = add_frame(data);
        double t = k / 30.0;
        struct world_shot shot = {lens, from, t, true};
        if (!rgb || !f) {
            status = fail(ERR_MEMORY, "no memory for the images");
            break;
        }
        f->time_ns = (int64_t)llround(t * 1e9);
        f->truth = world_joints_in_camera(w, t, from);
        status = world_render(w, &shot, &(struct world_image){.color = rgb, .depth = f->depth});
        if (status == OK)
            status = world_depth_noise(&lens, f->depth, (uint64_t)k, f->depth);
        take_color(f, rgb, pixels);
    }
    free(rgb);
    world_close(&w);
    return status;
}

// ------------------------------------------------------------- a folder

// Opens the first of the two places where `name` is; an error names the second.
static enum status open_truth(const char *folder, const char *name, FILE **out)
{
    static const char *const places[] = {"truth", "../truth"};
    char path[4096];
    *out = NULL;
    for (size_t i = 0; i < COUNT_OF(places) && !*out; i++) {
        snprintf(path, sizeof path, "%s/%s/%s", folder, places[i], name);
        *out = fopen(path, "r");
    }
    return *out ? OK : fail(ERR_MISSING, "%s: there is no truth to measure by", path);
}

static struct skeleton_frame *frame_at(struct skeleton_data *data, double time_s)
{
    for (int i = 0; i < data->count; i++)
        if (fabs((double)data->frame[i].time_ns * 1e-9 - time_s) < 0.002)
            return &data->frame[i];
    return NULL;
}

static enum status read_truth(struct skeleton_data *data, const char *folder)
{
    FILE *joints, *poses = NULL;
    char line[512], name[64];
    enum status status = open_truth(folder, "joints_truth.csv", &joints);
    if (status == OK)
        status = open_truth(folder, "sensor_truth.txt", &poses);
    double t;
    struct vec3 p;
    while (status == OK && fgets(line, sizeof line, joints)) {
        enum joint j;
        struct skeleton_frame *f = NULL;
        if (sscanf(line, "%lf,%63[^,],%lf,%lf,%lf", &t, name, &p.x, &p.y, &p.z) == 5 && joint_from_name(name, &j))
            f = frame_at(data, t);
        if (f) {
            f->truth.joint[j] = p;
            f->truth.confidence[j] = 1;
        }
    }
    while (status == OK && fgets(line, sizeof line, poses)) {
        struct quat q;
        struct skeleton_frame *f = NULL;
        if (sscanf(line, "%lf %lf %lf %lf %lf %lf %lf %lf", &t, &p.x, &p.y, &p.z, &q.x, &q.y, &q.z, &q.w) == 8)
            f = frame_at(data, t);
        for (int j = 0; f && j < JOINT_COUNT; j++)
            f->truth.joint[j] = quat_rotate(quat_conjugate(q), v3_sub(f->truth.joint[j], p));
    }
    if (joints)
        fclose(joints);
    if (poses)
        fclose(poses);
    for (int i = 0; i < data->count && status == OK; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            if (!(data->frame[i].truth.confidence[j] > 0))
                return fail(ERR_INPUT, "%s: image %d has no true %s", folder, i, joint_name((enum joint)j));
    return status;
}

static enum status read_folder(struct skeleton_data *data, const char *folder)
{
    char uri[4096];
    struct source *source;
    snprintf(uri, sizeof uri, "folder:%s", folder);
    enum status status = source_open(&source, uri, SOURCE_SENSOR);
    if (status != OK)
        return status;
    data->calibration = *source_calibration(source);
    size_t depth = (size_t)data->calibration.depth.width * (size_t)data->calibration.depth.height,
           color = (size_t)data->calibration.color.width * (size_t)data->calibration.color.height;
    struct frame frame;
    while (data->count < FRAMES_MOST && (status = source_next(source, &frame)) == OK) {
        struct skeleton_frame *f = add_frame(data);
        if (!f || !frame.depth || !frame.color) {
            status = f ? fail(ERR_INPUT, "%s: image %s lacks colour or depth", folder, frame.name)
                       : fail(ERR_MEMORY, "no memory for the images of %s", folder);
            break;
        }
        f->time_ns = frame.time_ns;
        memcpy(f->depth, frame.depth, depth * sizeof *f->depth);
        take_color(f, frame.color, color);
    }
    source_close(&source);
    return status < 0 ? status : read_truth(data, folder);
}

enum status skeleton_data_open(struct skeleton_data *data, const char *folder, int filmed)
{
    *data = (struct skeleton_data){0};
    data->frame = calloc(FRAMES_MOST, sizeof *data->frame);
    enum status status = data->frame ? OK : fail(ERR_MEMORY, "no memory for the bench");
    if (status == OK)
        status = folder ? read_folder(data, folder) : film(data, filmed);
    if (status != OK)
        skeleton_data_close(data);
    return status;
}
