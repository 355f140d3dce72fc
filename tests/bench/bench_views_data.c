#include "tests/bench/bench_views_data.h"

#include "capture/recorder.h"
#include "locate/camera_tracker.h"
#include "locate/tag_corners.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "tests/bench/bench_folder.h"
#include "tests/support/film.h"

#include <stdlib.h>
#include <string.h>

enum { FILMED = 240, VIEW_COUNT = 24, FILMED_BRIEF = 90, VIEW_COUNT_BRIEF = 12, MAX_FRAMES = 1000, JPEG_QUALITY = 98 };
static const double SCALE = 1, SAME_S = 0.002;

// The true joints of each frame of the take, in its colour camera's axes; and the sensor's pose in the truth's world.
struct truth {
    struct skeleton joints[MAX_FRAMES];
    struct vec3 waist[MAX_FRAMES];
    struct pose world_from_sensor; // the sensor does not move
};

static size_t pixels_of(const struct lens *lens) { return (size_t)lens->width * (size_t)lens->height; }

// The small world's brief take, which several stages of the page use.
static struct views_data brief_data;

void views_data_close(struct views_data *data)
{
    if (data->is_shared) {
        *data = (struct views_data){0};
        return;
    }
    for (int i = 0; i < data->count; i++) {
        free(data->image[i].room);
        free(data->image[i].expected);
        free(data->image[i].mask);
    }
    take_close(&data->own);
    take_close(&data->true_take);
    recording_free(&data->recording);
    if (data->scratch.path[0])
        scratch_remove(&data->scratch);
    *data = (struct views_data){0};
}

// ------------------------------------------------------------- the takes

static enum status record(struct views_data *data, const char *sensor, const struct place *place)
{
    struct recording_writer *writer = NULL;
    struct source *source = NULL;
    const struct recorder_options options = {0};
    struct recorder_result result;
    const char *path = scratch_file(&data->scratch, "views.reenact");
    enum status status = recording_create(&writer, path);
    if (status == OK)
        status = recording_put_place(writer, place);
    if (status == OK)
        status = source_open(&source, sensor, SOURCE_SENSOR);
    if (status == OK)
        status = recorder_run(source, writer, "own", place, &options, &result);
    if (status == OK && !result.located)
        status = fail(ERR_INPUT, "%s: the sensor cannot be found in the place", sensor);
    source_close(&source);
    enum status closed = recording_close(&writer);
    status = status == OK ? closed : status;
    if (status == OK)
        status = recording_open(&data->recording, path);
    if (status == OK)
        status = take_open(&data->own, data->recording, "own");
    if (status == OK && take_frame_count(data->own) > MAX_FRAMES)
        status = fail(ERR_INPUT, "%s is too long for the bench", sensor);
    return status;
}

static enum status add_true_frame(struct recording_writer *writer, struct take *take, int64_t i,
                                  const struct skeleton *joints)
{
    const struct take_entry *e = take_entry(take, i);
    const struct lens *lens = &take_calibration(take)->color;
    struct take_images seen;
    uint8_t *jpeg = NULL;
    size_t bytes = 0;
    enum status status = take_read(take, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &seen);
    if (status == OK && seen.color)
        status = jpeg_encode(seen.color, lens->width, lens->height, JPEG_QUALITY, &jpeg, &bytes);
    const struct take_frame frame = {e->time_ns, e->world_from_camera, e->located, jpeg, bytes, seen.depth,
                                     seen.mask,  e->has_skeleton,      *joints};
    if (status == OK)
        status = recording_add_frame(writer, &frame);
    free(jpeg);
    return status;
}

// Records the take again with the true joints.
static enum status record_truth(struct views_data *data, const struct truth *truth)
{
    struct recording_writer *writer = NULL;
    const char *path = scratch_file(&data->scratch, "views.reenact");
    enum status status = recording_append(&writer, path);
    if (status == OK)
        status = recording_begin_take(writer, "true", take_calibration(data->own));
    for (int64_t i = 0; i < take_frame_count(data->own) && status == OK; i++)
        status = add_true_frame(writer, data->own, i, &truth->joints[i]);
    if (status == OK)
        status = recording_put_body(writer, take_body(data->own));
    if (status == OK)
        status = recording_end_take(writer);
    enum status closed = recording_close(&writer);
    status = status == OK ? closed : status;
    take_close(&data->own);
    recording_free(&data->recording);
    if (status == OK)
        status = recording_open(&data->recording, path);
    if (status == OK)
        status = take_open(&data->own, data->recording, "own");
    return status == OK ? take_open(&data->true_take, data->recording, "true") : status;
}

// ------------------------------------------------------------- the images

static uint8_t *copy(const uint8_t *bytes, size_t count)
{
    uint8_t *out = malloc(count);
    if (out)
        memcpy(out, bytes, count);
    return out;
}

// Adds an image, of which it keeps copies.
static enum status add_image(struct views_data *data, int64_t since_ns, struct pose truth, const uint8_t *room,
                             const uint8_t *expected, const uint8_t *mask)
{
    size_t pixels = pixels_of(&data->lens);
    struct views_image *p = &data->image[data->count++];
    *p = (struct views_image){.since_ns = since_ns, .truth = truth};
    p->room = copy(room, 3 * pixels);
    p->expected = copy(expected, 3 * pixels);
    p->mask = copy(mask, pixels);
    return p->room && p->expected && p->mask ? OK : fail(ERR_MEMORY, "no memory for the images");
}

static double angle_deg(struct vec3 sensor, struct vec3 viewer, struct vec3 person)
{
    struct vec3 a = v3_sub(sensor, person), b = v3_sub(viewer, person);
    a.z = b.z = 0;
    return acos(fmax(-1, fmin(1, v3_dot(v3_unit(a), v3_unit(b))))) * 57.29577951308232;
}

static void set_angles(struct views_data *data, const struct truth *truth)
{
    int64_t frames = take_frame_count(data->own), start = take_entry(data->own, 0)->time_ns;
    for (int i = 0; i < data->count; i++) {
        struct views_image *p = &data->image[i];
        int64_t best = 0;
        for (int64_t f = 1; f < frames; f++)
            if (llabs(take_entry(data->own, f)->time_ns - start - p->since_ns) <
                llabs(take_entry(data->own, best)->time_ns - start - p->since_ns))
                best = f;
        p->angle_deg = angle_deg(truth->world_from_sensor.translation, p->truth.translation, truth->waist[best]);
    }
}

// Localises the cameras, and puts their truth into the place's axes: the sensor, and with it the person, stands where
// we localise it, and the true cameras stand relative to it as in the truth. So the error includes the localisation of
// both.
static enum status find_images(struct views_data *data, const struct truth *truth, const struct place *place)
{
    const struct pose place_from_truth =
        pose_multiply(take_entry(data->own, 0)->world_from_camera, pose_inverse(truth->world_from_sensor));
    struct camera_tracker *track;
    int n = 0;
    enum status status = camera_tracker_open(&track, place, &data->lens, NULL);
    for (int i = 0; i < data->count && status >= 0; i++) {
        struct views_image *p = &data->image[i];
        struct location at;
        struct camera_motion motion;
        status = camera_tracker_process(track, p->room, NULL, p->since_ns, &at, &motion);
        p->placed = status == OK;
        if (!p->placed)
            continue;
        p->found = at.world_from_camera;
        n++;
    }
    camera_tracker_close(&track);
    if (status < 0)
        return status;
    if (n < 10)
        return fail(ERR_INPUT, "only %d of the images can be localised", n);
    for (int i = 0; i < data->count; i++)
        data->image[i].truth = pose_multiply(place_from_truth, data->image[i].truth);
    return OK;
}

// ------------------------------------------------------------- the small world

static enum status film_images(struct views_data *data, const struct world *world, double seconds, bool brief)
{
    const int views = brief ? VIEW_COUNT_BRIEF : VIEW_COUNT;
    data->lens = world_viewer_calibration(SCALE).color;
    size_t pixels = pixels_of(&data->lens);
    uint8_t *room = malloc(3 * pixels), *with = malloc(3 * pixels), *mask = malloc(pixels);
    enum status status = room && with && mask ? OK : fail(ERR_MEMORY, "no memory for an image");
    for (int i = 0; i < views && status == OK; i++) {
        double t = seconds * i / views;
        struct world_shot shot = {data->lens, world_viewer_pose(world, t), t, false};
        status = world_render(world, &shot, &(struct world_image){.color = room});
        shot.actor = true;
        if (status == OK)
            status = world_render(world, &shot, &(struct world_image){.color = with, .mask = mask});
        if (status == OK)
            status = add_image(data, (int64_t)llround(t * 1e9), shot.world_from_camera, room, with, mask);
    }
    free(room);
    free(with);
    free(mask);
    return status;
}

static enum status film(struct views_data *data, struct truth *truth, bool brief)
{
    struct world_options options = world_default_options();
    struct world *world;
    enum status status = world_open(&world, &options);
    if (status != OK)
        return status;
    double seconds = fmin(world_seconds(world), (brief ? FILMED_BRIEF : FILMED) / 30.0);
    struct pose sensor = world_sensor_pose(world);
    char uri[300];
    film_sensor(world, &data->scratch, "sensor", SCALE, 0, (int)(seconds * 30));
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&data->scratch, "sensor"));
    struct place place = film_true_place(world, SCALE);
    status = record(data, uri, &place);
    truth->world_from_sensor = sensor;
    for (int64_t i = 0; status == OK && i < take_frame_count(data->own); i++) {
        double t = (double)(take_entry(data->own, i)->time_ns - take_entry(data->own, 0)->time_ns) * 1e-9;
        truth->joints[i] = world_joints_in_camera(world, t, sensor);
        truth->waist[i] = world_joints(world, t).joint[JOINT_WAIST];
    }
    if (status == OK)
        status = record_truth(data, truth);
    if (status == OK)
        status = film_images(data, world, seconds, brief);
    if (status == OK)
        set_angles(data, truth);
    if (status == OK)
        status = find_images(data, truth, &place);
    place_free(&place);
    world_close(&world);
    return status;
}

// ------------------------------------------------------------- a folder

static int64_t frame_at(const struct take *take, double seconds)
{
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (fabs((double)take_entry(take, i)->time_ns * 1e-9 - seconds) < SAME_S)
            return i;
    return -1;
}

static enum status read_truth(const struct views_data *data, const char *folder, struct truth *truth)
{
    FILE *joints = NULL, *poses = NULL;
    char line[512], name[64];
    double t;
    struct vec3 p;
    enum status status = bench_open_truth(folder, "joints_truth.csv", &joints);
    if (status == OK)
        status = bench_open_truth(folder, "sensor_truth.txt", &poses);
    while (status == OK && fgets(line, sizeof line, joints)) {
        enum joint j;
        if (sscanf(line, "%lf,%63[^,],%lf,%lf,%lf", &t, name, &p.x, &p.y, &p.z) != 5 || !joint_from_name(name, &j))
            continue;
        int64_t i = frame_at(data->own, t);
        if (i >= 0) {
            truth->joints[i].joint[j] = p;
            truth->joints[i].confidence[j] = 1;
        }
    }
    for (int64_t i = 0; status == OK && i < take_frame_count(data->own); i++) {
        struct pose sensor;
        if (!bench_truth_at(poses, (double)take_entry(data->own, i)->time_ns * 1e-9, &sensor))
            status = fail(ERR_INPUT, "%s: the sensor's truth lacks frame %d", folder, (int)i);
        truth->waist[i] = truth->joints[i].joint[JOINT_WAIST];
        truth->world_from_sensor = sensor;
        truth->joints[i] = skeleton_transform(pose_inverse(sensor), &truth->joints[i]);
    }
    if (joints)
        fclose(joints);
    if (poses)
        fclose(poses);
    return status;
}

// The expected image of that name, and the mask of the person in it.
static enum status read_expected(const struct views_data *data, const char *folder, const char *name, uint8_t *rgb,
                                 uint8_t **mask)
{
    char path[4096];
    uint8_t *bytes = NULL;
    size_t count;
    void *pixels = NULL;
    int width, height;
    snprintf(path, sizeof path, "%s/truth/expected/%s.jpg", folder, name);
    enum status status = file_read(path, &bytes, &count);
    if (status == OK)
        status = jpeg_decode(bytes, count, rgb, data->lens.width, data->lens.height);
    free(bytes);
    snprintf(path, sizeof path, "%s/truth/mask/%s.png", folder, name);
    if (status == OK)
        status = png_read(path, PNG_GRAY8, &pixels, &width, &height);
    if (status == OK && (width != data->lens.width || height != data->lens.height))
        status = fail(ERR_INPUT, "%s is not of the images' size", path);
    for (size_t i = 0; status == OK && i < pixels_of(&data->lens); i++)
        ((uint8_t *)pixels)[i] = ((uint8_t *)pixels)[i] > 127;
    *mask = pixels;
    return status;
}

static enum status read_images(struct views_data *data, const char *folder)
{
    char uri[4096];
    struct source *camera = NULL;
    struct frame frame;
    FILE *truth = NULL;
    int64_t first_ns = -1;
    enum status status = bench_open_truth(folder, "viewer_truth.txt", &truth);
    snprintf(uri, sizeof uri, "folder:%s/viewer", folder);
    if (status == OK)
        status = source_open(&camera, uri, SOURCE_CAMERA);
    if (status == OK)
        data->lens = source_calibration(camera)->color;
    uint8_t *expected = malloc(3 * pixels_of(&data->lens) + 1);
    if (status == OK && !expected)
        status = fail(ERR_MEMORY, "no memory for an image");
    while (status == OK && data->count < VIEWS_MAX && (status = source_next(camera, &frame)) == OK) {
        struct pose pose;
        uint8_t *mask = NULL;
        first_ns = first_ns < 0 ? frame.time_ns : first_ns;
        if (!bench_truth_at(truth, (double)frame.time_ns * 1e-9, &pose))
            continue;
        status = read_expected(data, folder, frame.name, expected, &mask);
        if (status == OK)
            status = add_image(data, frame.time_ns - first_ns, pose, frame.color, expected, mask);
        free(mask);
    }
    free(expected);
    if (truth)
        fclose(truth);
    source_close(&camera);
    return status == NOTHING ? OK : status;
}

static enum status read_folder(struct views_data *data, const char *folder, struct truth *truth)
{
    struct place place = {0};
    char uri[4096];
    snprintf(uri, sizeof uri, "folder:%s/sensor", folder);
    enum status status = bench_map_folder(folder, &place);
    if (status == OK)
        status = record(data, uri, &place);
    if (status == OK)
        status = read_truth(data, folder, truth);
    if (status == OK)
        status = record_truth(data, truth);
    if (status == OK)
        status = read_images(data, folder);
    if (status == OK)
        set_angles(data, truth);
    if (status == OK)
        status = find_images(data, truth, &place);
    place_free(&place);
    return status;
}

static void close_brief(void) { views_data_close(&brief_data); }

static enum status open_alone(struct views_data *data, const char *folder, bool brief)
{
    *data = (struct views_data){.scratch = scratch_make()};
    struct truth *truth = calloc(1, sizeof *truth);
    if (!truth)
        return fail(ERR_MEMORY, "no memory for the truth");
    enum status status = folder ? read_folder(data, folder, truth) : film(data, truth, brief);
    free(truth);
    return status;
}

enum status views_data_open(struct views_data *data, const char *folder, bool brief)
{
    if (folder || !brief)
        return open_alone(data, folder, brief);
    enum status status = OK;
    if (!brief_data.count) {
        status = open_alone(&brief_data, NULL, true);
        if (status == OK && atexit(close_brief))
            status = fail(ERR_MEMORY, "no memory for the bench");
        if (status != OK)
            views_data_close(&brief_data);
    }
    *data = brief_data;
    data->is_shared = true;
    return status;
}
