// Exports for other programs: CSV, BVH, TRC, C3D, PLY, folder and film, read back by code that shares nothing with the
// writers.
#include "tests/support/test.h"

#include "capture/export.h"
#include "formats/bvh_reader.h"
#include "formats/markers.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "platform/files/video.h"
#include "platform/sensors/source.h"
#include "tests/support/process.h"
#include "tests/support/read_mcap.h"
#include "tests/support/rehearsal.h"
#include "tests/support/sql.h"
#include "tests/world/world.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { FRAMES = 40 };

static struct scratch scratch;
static struct world *world;
static struct recording *recording;
static struct take *take;

// The head's covariance is not known, the others are 2 cm.
static struct skeleton truth(int i)
{
    struct skeleton s = world_joints_in_camera(world, i / 10.0, world_sensor_pose(world));
    const struct covariance3 c = covariance3_isotropic(4e-4);
    for (int j = 0; j < JOINT_COUNT; j++)
        if (j != JOINT_HEAD)
            joint_set_covariance(&s, (enum joint)j, &c);
    return s;
}

// What an export of `take` wrote; the caller frees it.
struct written {
    char *text;
    size_t count;
};

static FILE *begin(struct written *w)
{
    FILE *out = open_memstream(&w->text, &w->count);
    assert_non_null(out);
    return out;
}

static struct written written_csv(enum export_axes axes)
{
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_joints_csv(take, axes, out), OK);
    assert_int_equal(fclose(out), 0);
    return w;
}

static void check_csv(enum export_axes axes)
{
    struct written w = written_csv(axes);
    char *line = strtok(w.text, "\n");
    assert_string_equal(line, axes == EXPORT_ROOM ? "# axes: room" : "# axes: camera");
    line = strtok(NULL, "\n");
    assert_string_equal(line, "timestamp,joint,x_m,y_m,z_m,confidence,sigma_m");
    int rows = 0;
    while ((line = strtok(NULL, "\n"))) {
        double time_s, x, y, z, confidence, sigma_m;
        char name[32];
        const int fields =
            sscanf(line, "%lf,%31[^,],%lf,%lf,%lf,%lf,%lf", &time_s, name, &x, &y, &z, &confidence, &sigma_m);
        enum joint j;
        EXPECT_TRUE(joint_from_name(name, &j));
        EXPECT_INT(fields, j == JOINT_HEAD ? 6 : 7); // an empty field
        if (j != JOINT_HEAD)
            EXPECT_NEAR(sigma_m, 0.02, 2e-5);
        else
            EXPECT_TRUE(line[strlen(line) - 1] == ',');
        const struct skeleton wanted =
            axes == EXPORT_ROOM ? world_joints(world, rows / JOINT_COUNT / 10.0) : truth(rows / JOINT_COUNT);
        EXPECT_NEAR(time_s, 7 + rows / JOINT_COUNT / 10.0, 1e-6);
        EXPECT_NEAR(x, wanted.joint[j].x, 1e-5);
        EXPECT_NEAR(y, wanted.joint[j].y, 1e-5);
        EXPECT_NEAR(z, wanted.joint[j].z, 1e-5);
        rows++;
    }
    EXPECT_INT(rows, FRAMES * JOINT_COUNT);
    free(w.text);
}

static void test_csv_has_every_joint(void **state)
{
    (void)state;
    check_csv(EXPORT_SENSOR);
    check_csv(EXPORT_ROOM);
}

// Every joint to a millimetre, although the bones' lengths vary: by the reader of motion files that the world's actors
// are made from, in which a joint's position replaces its offset.
static void test_bvh_matches_take(void **state)
{
    (void)state;
    struct written w;
    struct bvh *bvh;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_bvh(take, out), OK);
    assert_int_equal(fclose(out), 0);
    EXPECT_STATUS(bvh_parse(&bvh, "motion.bvh", (const uint8_t *)w.text, w.count), OK);
    EXPECT_INT(bvh_joint_count(bvh), JOINT_COUNT);
    EXPECT_INT(bvh_frame_count(bvh), FRAMES);
    EXPECT_NEAR(bvh_frame_s(bvh), 0.1, 1e-6);
    double worst = 0;
    for (int i = 0; i < FRAMES; i++) {
        struct vec3 got[JOINT_COUNT];
        struct skeleton wanted = world_joints(world, i / 10.0);
        bvh_positions(bvh, i, got);
        for (int j = 0; j < JOINT_COUNT; j++) {
            int at = bvh_find(bvh, joint_name((enum joint)j));
            EXPECT_AT_LEAST(at, 0);
            struct vec3 p = wanted.joint[j]; // world, z up; the file has y up and centimetres
            worst = fmax(worst, v3_distance(v3_scale(got[at], 0.01), v3(p.x, p.z, -p.y)));
        }
    }
    print_message("joints from BVH: %.6f m at worst\n", worst);
    EXPECT_AT_MOST(worst, 0.001);
    bvh_free(&bvh);
    free(w.text);
}

// A take without images, with the skeletons of the world's first frames.
struct timed_take {
    struct scratch scratch;
    struct recording *recording;
    struct take *take;
};

// unlocated: so many frames at the beginning; after them the sensor is the world's.
struct timed_frames {
    const int64_t *times_ns;
    size_t count, unlocated;
    bool has_skeleton;
};

static struct timed_take timed_take_open(const struct timed_frames *f)
{
    struct timed_take t = {.scratch = scratch_make()};
    struct calibration calibration = world_calibration(0.25);
    struct recording_writer *writer;
    const char *path = scratch_file(&t.scratch, "take.reenact");
    EXPECT_STATUS(recording_create(&writer, path), OK);
    EXPECT_STATUS(recording_begin_take(writer, "t", &calibration), OK);
    for (size_t i = 0; i < f->count; i++) {
        const bool located = i >= f->unlocated;
        struct take_frame frame = {.time_ns = f->times_ns[i],
                                   .world_from_camera = located ? world_sensor_pose(world) : POSE_IDENTITY,
                                   .located = located,
                                   .has_skeleton = f->has_skeleton,
                                   .skeleton = truth((int)i)};
        EXPECT_STATUS(recording_add_frame(writer, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    EXPECT_STATUS(recording_open(&t.recording, path), OK);
    EXPECT_STATUS(take_open(&t.take, t.recording, "t"), OK);
    return t;
}

static void timed_take_close(struct timed_take *t)
{
    take_close(&t->take);
    recording_free(&t->recording);
    scratch_remove(&t->scratch);
}

// BVH has one step of time: through a gap the pose before it stays, so that what comes after it is at its time. A clock
// that jumps makes no gap.
static void test_bvh_keeps_time_over_gaps(void **state)
{
    (void)state;
    enum { TIMES = 5 };
    static const struct {
        int64_t ms[TIMES];
        int frames, last_but_one; // of the file
    } cases[] = {
        {{0, 100, 200, 700, 800}, 9, 7}, {{0, 100, 195, 300, 400}, 5, 3}, {{0, 100, 200, 900200, 900300}, 5, 3}};
    for (size_t k = 0; k < COUNT_OF(cases); k++) {
        int64_t times_ns[TIMES];
        for (int i = 0; i < TIMES; i++)
            times_ns[i] = cases[k].ms[i] * 1000000;
        struct timed_take t = timed_take_open(&(struct timed_frames){times_ns, TIMES, TIMES, true});
        struct written w;
        struct bvh *bvh;
        FILE *out = begin(&w);
        EXPECT_STATUS(export_bvh(t.take, out), OK);
        fclose(out);
        EXPECT_STATUS(bvh_parse(&bvh, "motion.bvh", (const uint8_t *)w.text, w.count), OK);
        EXPECT_INT(bvh_frame_count(bvh), cases[k].frames);
        EXPECT_NEAR(bvh_frame_s(bvh), 0.1, 1e-6);
        struct vec3 got[JOINT_COUNT];
        bvh_positions(bvh, cases[k].last_but_one, got);
        const struct vec3 p = truth(3).joint[JOINT_LEFT_HAND]; // y down
        const struct vec3 q = v3_scale(got[bvh_find(bvh, joint_name(JOINT_LEFT_HAND))], 0.01);
        EXPECT_AT_MOST(v3_distance(q, v3(p.x, -p.y, -p.z)), 0.001);
        bvh_free(&bvh);
        free(w.text);
        timed_take_close(&t);
    }
}

// A sensor that is located late: the file has the world's axes all along, and begins there.
static void test_bvh_has_the_same_axes_all_along(void **state)
{
    (void)state;
    static const int64_t times_ns[] = {0, 100000000, 200000000, 300000000};
    struct timed_take t = timed_take_open(&(struct timed_frames){times_ns, COUNT_OF(times_ns), 2, true});
    struct written w;
    struct bvh *bvh;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_bvh(t.take, out), OK);
    fclose(out);
    EXPECT_STATUS(bvh_parse(&bvh, "motion.bvh", (const uint8_t *)w.text, w.count), OK);
    EXPECT_INT(bvh_frame_count(bvh), 2);
    struct vec3 got[JOINT_COUNT];
    bvh_positions(bvh, 0, got);
    const struct vec3 p = world_joints(world, 0.2).joint[JOINT_HEAD]; // z up
    EXPECT_AT_MOST(v3_distance(v3_scale(got[bvh_find(bvh, joint_name(JOINT_HEAD))], 0.01), v3(p.x, p.z, -p.y)), 0.001);
    bvh_free(&bvh);
    free(w.text);
    timed_take_close(&t);
}

static void test_bvh_needs_a_person(void **state)
{
    (void)state;
    struct timed_take t = timed_take_open(&(struct timed_frames){(const int64_t[]){0, 100}, 2, 2, false});
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_bvh(t.take, out), ERR_INPUT);
    EXPECT_SAYS("no person");
    fclose(out);
    free(w.text);
    timed_take_close(&t);
}

// ---------------------------------------------------------------- markers

enum { MARKER_TIMES = 5 };
// 10 Hz with a step that is late, and half a second without a frame.
static const int64_t marker_times_ns[MARKER_TIMES] = {0, 100000000, 210000000, 300000000, 800000000};

// The take's hand at a time, y up, where it is known.
static struct vec3 hand_at(double at_s)
{
    for (int i = 0; i + 1 < MARKER_TIMES; i++) {
        const double from_s = 1e-9 * (double)marker_times_ns[i], to_s = 1e-9 * (double)marker_times_ns[i + 1];
        if (at_s >= from_s - 1e-6 && at_s <= to_s + 1e-6) {
            const struct vec3 p = v3_mix(truth(i).joint[JOINT_LEFT_HAND], truth(i + 1).joint[JOINT_LEFT_HAND],
                                         (at_s - from_s) / (to_s - from_s));
            return v3(p.x, -p.y, -p.z);
        }
    }
    return v3(0, 0, 0);
}

// The cells of a line, tab-separated; what lies between two tabs may be empty. Returns how many.
static int cells_of(char *line, char **cell, int max)
{
    int count = 0;
    line[strcspn(line, "\n")] = 0;
    for (char *next = line; next && count < max;)
        cell[count++] = strsep(&next, "\t");
    return count;
}

static void test_trc_matches_take(void **state)
{
    (void)state;
    enum { CELLS = 2 + 3 * JOINT_COUNT, HEADER = 6, ROWS = 9 };
    struct timed_take t = timed_take_open(&(struct timed_frames){marker_times_ns, MARKER_TIMES, MARKER_TIMES, true});
    struct written w;
    char *cell[CELLS + 2], *next;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_trc(t.take, "turn.trc", out), OK);
    fclose(out);
    next = w.text;
    for (int row = 0; row < HEADER + ROWS; row++) {
        char *line = strsep(&next, "\n");
        assert_non_null(line);
        const int count = cells_of(line, cell, CELLS + 2);
        if (row == 2) {
            EXPECT_NEAR(strtod(cell[0], NULL), 10, 1e-9);
            EXPECT_INT(strtol(cell[2], NULL, 10), ROWS);
            EXPECT_INT(strtol(cell[3], NULL, 10), JOINT_COUNT);
            EXPECT_TRUE(!strcmp(cell[4], "m"));
        }
        if (row < HEADER)
            continue;
        const double at_s = 0.1 * (row - HEADER);
        const bool gap = at_s > 0.35 && at_s < 0.75;
        EXPECT_INT(count, CELLS);
        EXPECT_INT(strtol(cell[0], NULL, 10), row - HEADER + 1);
        EXPECT_NEAR(strtod(cell[1], NULL), at_s, 1e-6);
        char **hand = cell + 2 + 3 * JOINT_LEFT_HAND;
        EXPECT_INT(!*hand[0], gap);
        if (!gap)
            EXPECT_AT_MOST(
                v3_distance(v3(strtod(hand[0], NULL), strtod(hand[1], NULL), strtod(hand[2], NULL)), hand_at(at_s)),
                2e-5);
    }
    EXPECT_TRUE(next && !*next); // nothing after the last row
    free(w.text);
    timed_take_close(&t);
}

// As the user guide describes the file, read by nothing of the writer's.
struct c3d_file {
    const uint8_t *at;
    size_t count;
};

static int word_at(const struct c3d_file *file, size_t byte)
{
    EXPECT_TRUE(byte + 2 <= file->count);
    return file->at[byte] | file->at[byte + 1] << 8;
}

static float float_at(const struct c3d_file *file, size_t byte)
{
    float value;
    EXPECT_TRUE(byte + 4 <= file->count);
    memcpy(&value, file->at + byte, sizeof value);
    return value;
}

// Where the data of a parameter begin: after its name, offset, type and dimensions. 0: there is none of that name.
static size_t c3d_parameter(const struct c3d_file *file, int group, const char *name)
{
    size_t at = 512 + 4;
    for (;;) {
        const int length = (int8_t)file->at[at], of = (int8_t)file->at[at + 1];
        const size_t next = at + 2 + (size_t)length;
        if (!length)
            return 0;
        EXPECT_TRUE(next + 4 < file->count);
        if (of == group && (size_t)length == strlen(name) && !memcmp(file->at + at + 2, name, (size_t)length))
            return next + 4 + file->at[next + 3];
        at = next + (size_t)word_at(file, next);
    }
}

static void test_c3d_matches_take(void **state)
{
    (void)state;
    enum { ROWS = 9 };
    struct timed_take t = timed_take_open(&(struct timed_frames){marker_times_ns, MARKER_TIMES, MARKER_TIMES, true});
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_c3d(t.take, out), OK);
    fclose(out);
    const struct c3d_file file = {(const uint8_t *)w.text, w.count};
    const size_t data = 512 * (size_t)(word_at(&file, 16) - 1), labels = c3d_parameter(&file, 1, "LABELS");
    EXPECT_INT(file.at[0], 2);
    EXPECT_INT(file.at[1], 0x50);
    EXPECT_INT(word_at(&file, 2), JOINT_COUNT);
    EXPECT_INT(word_at(&file, 6), 1);
    EXPECT_INT(word_at(&file, 8), ROWS);
    EXPECT_NEAR(float_at(&file, 20), 10, 1e-6);
    EXPECT_TRUE(float_at(&file, 12) < 0); // floating-point numbers
    EXPECT_INT(file.at[515], 84);
    EXPECT_INT(512 + 512 * file.at[514], data);
    EXPECT_INT(word_at(&file, c3d_parameter(&file, 1, "USED")), JOINT_COUNT);
    EXPECT_INT(word_at(&file, c3d_parameter(&file, 1, "FRAMES")), ROWS);
    EXPECT_INT(word_at(&file, c3d_parameter(&file, 1, "DATA_START")), word_at(&file, 16));
    EXPECT_INT(word_at(&file, c3d_parameter(&file, 4, "ACTUAL_END_FIELD")), ROWS);
    EXPECT_TRUE(!memcmp(file.at + c3d_parameter(&file, 1, "UNITS"), "mm", 2));
    EXPECT_TRUE(!memcmp(file.at + labels + 16 * JOINT_LEFT_HAND, "left_hand       ", 16));
    EXPECT_INT(c3d_parameter(&file, 2, "LABELS"), 0);
    EXPECT_INT(file.count, data + 16 * JOINT_COUNT * ROWS);
    for (int row = 0; row < ROWS; row++) {
        const size_t hand = data + 16 * (size_t)(JOINT_COUNT * row + JOINT_LEFT_HAND);
        const bool gap = row > 3 && row < 8;
        EXPECT_NEAR(float_at(&file, hand + 12), gap ? -1 : 0, 0);
        if (!gap)
            EXPECT_AT_MOST(v3_distance(v3((double)float_at(&file, hand), (double)float_at(&file, hand + 4),
                                          (double)float_at(&file, hand + 8)),
                                       v3_scale(hand_at(0.1 * row), 1000)),
                           0.01);
    }
    free(w.text);
    timed_take_close(&t);
}

// A clock that stands, goes back or jumps by hours: one step each, and every sample in its order.
static void test_markers_of_broken_clocks(void **state)
{
    (void)state;
    static const int64_t times_ms[][4] = {
        {0, 100, 100, 200}, {0, 100, 50, 150}, {0, 100, 90000000, 90000100}, {5, 5, 5, 5}, {9, 7, 4, 1}};
    for (size_t i = 0; i < COUNT_OF(times_ms); i++) {
        struct marker_sample samples[4];
        struct markers markers;
        for (int k = 0; k < 4; k++)
            samples[k] = (struct marker_sample){times_ms[i][k] * 1000000, truth(k)};
        EXPECT_STATUS(markers_make(&markers, samples, 4), OK);
        EXPECT_INT(markers.count, 4);
        EXPECT_NEAR(markers.at[0][JOINT_HEAD][0], truth(0).joint[JOINT_HEAD].x, 1e-6);
        EXPECT_NEAR(markers.at[3][JOINT_HEAD][0], truth(3).joint[JOINT_HEAD].x, 2e-3);
        markers_free(&markers);
    }
    struct markers none;
    EXPECT_STATUS(markers_make(&none, NULL, 0), ERR_INPUT);
}

static void test_markers_need_a_person(void **state)
{
    (void)state;
    struct timed_take t = timed_take_open(&(struct timed_frames){(const int64_t[]){0, 100}, 2, 2, false});
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_trc(t.take, "none.trc", out), ERR_INPUT);
    EXPECT_SAYS("no person");
    EXPECT_STATUS(export_c3d(t.take, out), ERR_INPUT);
    fclose(out);
    free(w.text);
    timed_take_close(&t);
}

static void test_room_axes_need_a_room(void **state)
{
    (void)state;
    struct timed_take t = timed_take_open(&(struct timed_frames){(const int64_t[]){1}, 1, 1, true});
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_joints_csv(t.take, EXPORT_ROOM, out), ERR_INPUT);
    EXPECT_SAYS("not located");
    fclose(out);
    free(w.text);
    timed_take_close(&t);
}

// A sensor's clock may begin anywhere: times before 0 have their sign once, in lists and in joints alike.
static void test_times_before_zero(void **state)
{
    (void)state;
    static const int64_t times_ns[] = {-2500000000, -1000000000, -250000000, 0, 250000000};
    struct timed_take t =
        timed_take_open(&(struct timed_frames){times_ns, COUNT_OF(times_ns), COUNT_OF(times_ns), true});
    struct written w;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_joints_csv(t.take, EXPORT_SENSOR, out), OK);
    fclose(out);
    const char *line = strstr(w.text, "sigma_m\n") + 8;
    for (size_t i = 0; i < COUNT_OF(times_ns) * JOINT_COUNT; i++, line = strchr(line, '\n') + 1) {
        char *end;
        EXPECT_NEAR(strtod(line, &end), (double)times_ns[i / JOINT_COUNT] * 1e-9, 1e-9);
        EXPECT_TRUE(*end == ',');
    }
    free(w.text);
    timed_take_close(&t);
}

// ---------------------------------------------------------------- what is filmed: a take with images

struct filmed {
    struct rehearsal rehearsal;
    struct recording *recording;
    struct take *take;
};

static struct filmed filmed_open(void)
{
    struct filmed f = {.rehearsal = rehearsal_make()};
    EXPECT_STATUS(recording_open(&f.recording, f.rehearsal.file), OK);
    EXPECT_STATUS(take_open(&f.take, f.recording, "turn"), OK);
    return f;
}

static void filmed_close(struct filmed *f)
{
    take_close(&f->take);
    recording_free(&f->recording);
    rehearsal_end(&f->rehearsal);
}

// The points of a PLY file with float x y z and three bytes of colour each, as its header says; and its faces' number.
static int ply_points(const struct written *w, const uint8_t **points, int *faces)
{
    const char *end = strstr(w->text, "end_header\n"), *vertex = strstr(w->text, "element vertex ");
    const char *face = strstr(w->text, "element face ");
    assert_non_null(end);
    assert_non_null(vertex);
    *points = (const uint8_t *)end + strlen("end_header\n");
    *faces = face ? atoi(face + strlen("element face ")) : 0;
    const int count = atoi(vertex + strlen("element vertex "));
    EXPECT_INT(w->count - (size_t)(*points - (const uint8_t *)w->text), 15 * count + 13 * *faces);
    return count;
}

// A frame's points: as many as it has samples, each at the sample's depth from the sensor.
static void check_points(struct filmed *f)
{
    struct written w;
    struct take_images images;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_points_ply(f->take, 3, false, out), OK);
    assert_int_equal(fclose(out), 0);
    const uint8_t *points;
    int faces, at = 0;
    const int count = ply_points(&w, &points, &faces);
    EXPECT_INT(faces, 0);
    EXPECT_STATUS(take_read(f->take, 3, TAKE_DEPTH | TAKE_COLOR, &images), OK);
    const struct pose camera_from_world = pose_inverse(take_entry(f->take, 3)->world_from_camera);
    const struct lens *l = &take_calibration(f->take)->depth;
    for (int i = 0; i < l->width * l->height; i++) {
        float p[3];
        if (!images.depth[i])
            continue;
        memcpy(p, points + 15 * at, sizeof p);
        const struct vec3 in_camera = pose_apply(camera_from_world, v3((double)p[0], (double)p[1], (double)p[2]));
        if (i % 97 == 0) {
            EXPECT_NEAR(in_camera.z, 0.001 * images.depth[i], 1e-5);
            EXPECT_NEAR(lens_project(l, in_camera).x, i % l->width, 0.01);
            EXPECT_INT(points[15 * at + 12], images.color[3 * i]); // registered
        }
        at++;
    }
    EXPECT_INT(count, at);
    free(w.text);
}

static enum status write_points(void *self, int64_t frame, FILE *out)
{
    struct filmed *f = self;
    return frame == 2 ? NOTHING : export_points_ply(f->take, frame, true, out);
}

static enum status write_none(void *self, int64_t frame, FILE *out)
{
    (void)self, (void)frame, (void)out;
    return NOTHING;
}

// A file for each frame but the one that has no points, and the list with their times.
static void check_ply_folder(struct filmed *f)
{
    const struct ply_frames frames = {write_points, f}, none = {write_none, f};
    char dir[300], path[320], first[60];
    uint8_t *list;
    size_t count;
    int64_t damaged;
    snprintf(dir, sizeof dir, "%s/points", f->rehearsal.scratch.path);
    EXPECT_STATUS(export_ply_folder(f->take, &none, dir, NULL, &damaged), ERR_INPUT);
    EXPECT_SAYS("no frame");
    EXPECT_TRUE(!file_exists(dir));
    EXPECT_STATUS(export_ply_folder(f->take, &frames, dir, NULL, &damaged), OK);
    EXPECT_STATUS(export_ply_folder(f->take, &frames, dir, NULL, &damaged), ERR_EXISTS);
    for (int64_t i = 0; i < REHEARSAL_FRAMES; i++) {
        struct written one, in_folder;
        FILE *out = begin(&one);
        EXPECT_STATUS(export_points_ply(f->take, i, true, out), OK);
        fclose(out);
        snprintf(path, sizeof path, "%s/%06lld.ply", dir, (long long)i);
        EXPECT_INT(file_exists(path), i != 2);
        if (i != 2) {
            EXPECT_STATUS(file_read(path, (uint8_t **)&in_folder.text, &in_folder.count), OK);
            EXPECT_INT(in_folder.count, one.count);
            assert_memory_equal(in_folder.text, one.text, one.count);
            free(in_folder.text);
        }
        free(one.text);
    }
    snprintf(path, sizeof path, "%s/ply.txt", dir);
    EXPECT_STATUS(file_read(path, &list, &count), OK);
    int lines = 0;
    for (size_t i = 0; i < count; i++)
        lines += list[i] == '\n';
    EXPECT_INT(lines, REHEARSAL_FRAMES); // a heading, and one less
    snprintf(first, sizeof first, "\n%.9f 000000.ply\n", (double)take_entry(f->take, 0)->time_ns * 1e-9);
    assert_non_null(strstr((const char *)list, first));
    free(list);
}

static void check_place(struct filmed *f)
{
    struct written w;
    struct place place;
    EXPECT_STATUS(recording_read_place(f->recording, &place), OK);
    FILE *out = begin(&w);
    EXPECT_STATUS(export_place_ply(&place, out), OK);
    assert_int_equal(fclose(out), 0);
    const uint8_t *points;
    int faces;
    EXPECT_AT_LEAST(ply_points(&w, &points, &faces), 4 * place.tag_count);
    EXPECT_INT(faces, 2 * place.tag_count);
    float p[3];
    struct vec3 corners[4];
    memcpy(p, points, sizeof p);
    place_tag_corners(&place.tags[0], corners);
    EXPECT_NEAR((double)p[0], corners[0].x, 1e-5);
    EXPECT_NEAR((double)p[2], corners[0].z, 1e-5);
    place_free(&place);
    free(w.text);
}

// The folder read as a sensor has the take's times, depth and JPEG bytes.
static void check_folder(struct filmed *f)
{
    int64_t damaged;
    char dir[300], uri[320];
    snprintf(dir, sizeof dir, "%s/tum", f->rehearsal.scratch.path);
    snprintf(uri, sizeof uri, "folder:%s", dir);
    EXPECT_STATUS(export_folder(f->take, dir, NULL, &damaged), OK);
    EXPECT_INT(damaged, 0);
    EXPECT_STATUS(export_folder(f->take, dir, NULL, &damaged), ERR_EXISTS);
    struct source *source;
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    EXPECT_TRUE(lens_equal(&source_calibration(source)->depth, &take_calibration(f->take)->depth));
    const size_t pixels =
        (size_t)take_calibration(f->take)->depth.width * (size_t)take_calibration(f->take)->depth.height;
    for (int64_t i = 0; i < take_frame_count(f->take); i++) {
        struct frame frame;
        struct take_images images;
        const uint8_t *jpeg;
        size_t count;
        EXPECT_STATUS(source_next(source, &frame), OK);
        EXPECT_INT(frame.time_ns, take_entry(f->take, i)->time_ns);
        EXPECT_STATUS(take_read(f->take, i, TAKE_DEPTH, &images), OK);
        assert_memory_equal(frame.depth, images.depth, pixels * sizeof *images.depth);
        EXPECT_STATUS(take_read_jpeg(f->take, i, &jpeg, &count), OK);
        EXPECT_INT(frame.jpeg_bytes, count);
        assert_memory_equal(frame.jpeg, jpeg, count);
    }
    source_close(&source);
}

// ---------------------------------------------------------------- MCAP

static double json_number(const struct json *object, const char *name)
{
    double value = NAN;
    EXPECT_TRUE(json_get_number(json_member(object, name), &value));
    return value;
}

// The bytes of a base64 text, decoded by a table of its own; the caller frees them.
static uint8_t *decode(const char *text, size_t *count)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    uint8_t *out = malloc(strlen(text));
    uint32_t bits = 0;
    int held = 0;
    *count = 0;
    for (; *text && *text != '='; text++) {
        bits = bits << 6 | (uint32_t)(strchr(digits, *text) - digits);
        held += 6;
        if (held >= 8) {
            held -= 8;
            out[(*count)++] = (uint8_t)(bits >> held);
        }
    }
    return out;
}

// One message of the file against the take.
static void check_message(struct filmed *f, const char *topic, const struct json *m, int64_t frame)
{
    const struct take_entry *entry = take_entry(f->take, frame);
    const struct lens *l = &take_calibration(f->take)->depth;
    const char *data = NULL;
    if (!strcmp(topic, "/camera/color") || !strcmp(topic, "/camera/depth")) {
        struct take_images images;
        size_t count, wanted = sizeof *images.depth * lens_pixels(l);
        EXPECT_TRUE(json_get_string(json_member(m, "data"), &data));
        uint8_t *bytes = decode(data, &count);
        const uint8_t *jpeg;
        if (topic[8] == 'c') {
            EXPECT_STATUS(take_read_jpeg(f->take, frame, &jpeg, &wanted), OK);
        } else {
            EXPECT_STATUS(take_read(f->take, frame, TAKE_DEPTH, &images), OK);
            jpeg = (const uint8_t *)images.depth;
            EXPECT_INT(json_number(m, "step"), 2 * l->width);
        }
        EXPECT_INT(count, wanted);
        assert_memory_equal(bytes, jpeg, wanted);
        free(bytes);
    } else if (!strcmp(topic, "/actor/joints")) {
        const struct json *hand = json_member(json_member(m, "joints"), "left_hand");
        const struct vec3 p = pose_apply(entry->world_from_camera, entry->skeleton.joint[JOINT_LEFT_HAND]);
        EXPECT_NEAR(json_number(hand, "x"), p.x, 1e-5);
        EXPECT_NEAR(json_number(hand, "z"), p.z, 1e-5);
    } else if (!strcmp(topic, "/tf")) {
        const struct json *t = json_at(json_member(m, "transforms"), 0);
        EXPECT_NEAR(json_number(json_member(t, "translation"), "x"), entry->world_from_camera.translation.x, 1e-5);
        EXPECT_NEAR(json_number(json_member(t, "rotation"), "w"), entry->world_from_camera.rotation.w, 1e-7);
    } else if (!strcmp(topic, "/actor/skeleton")) {
        const struct json *entity = json_at(json_member(m, "entities"), 0);
        const struct json *sphere = json_at(json_member(entity, "spheres"), 0);
        EXPECT_NEAR(json_number(json_member(json_member(sphere, "pose"), "position"), "y"),
                    entry->skeleton.joint[JOINT_HEAD].y, 1e-5);
    }
}

// Every message of the file is valid JSON, at the time of its frame; images, joints and poses are the take's.
static void check_mcap(struct filmed *f)
{
    struct written w;
    struct read_mcap file;
    int64_t damaged;
    FILE *out = begin(&w);
    EXPECT_STATUS(export_mcap(f->take, out, NULL, &damaged), OK);
    assert_int_equal(fclose(out), 0);
    EXPECT_INT(damaged, 0);
    read_mcap((const uint8_t *)w.text, w.count, &file);
    int64_t frame = 0;
    int seen[READ_MCAP_CHANNELS] = {0};
    for (int c = 0; c < file.channels; c++) {
        struct json *schema;
        EXPECT_STATUS(json_parse(file.schema[c], strlen(file.schema[c]), file.topic[c], &schema), OK);
        json_free(&schema);
    }
    for (int i = 0; i < file.count; i++) {
        const struct read_message *message = &file.messages[i];
        struct json *m;
        EXPECT_STATUS(json_parse(message->data, message->count, file.topic[message->channel], &m), OK);
        while ((int64_t)message->time_ns > take_entry(f->take, frame)->time_ns)
            frame++;
        EXPECT_INT(message->time_ns, take_entry(f->take, frame)->time_ns);
        check_message(f, file.topic[message->channel], m, frame);
        seen[message->channel]++;
        json_free(&m);
    }
    for (int c = 0; c < file.channels; c++)
        EXPECT_INT(seen[c], strstr(file.topic[c], "calibration") ? 1 : REHEARSAL_FRAMES);
    read_mcap_free(&file);
    free(w.text);
}

static bool stop_at_once(void *self, double share)
{
    (void)self;
    return share < 0.3;
}

// Stopped half-way, nothing remains.
static void check_stopped(struct filmed *f)
{
    int64_t damaged;
    char dir[300], part[310];
    const struct progress_watch watch = {.on_progress = stop_at_once};
    snprintf(dir, sizeof dir, "%s/half", f->rehearsal.scratch.path);
    snprintf(part, sizeof part, "%s.part", dir);
    EXPECT_STATUS(export_folder(f->take, dir, &watch, &damaged), NOTHING);
    EXPECT_TRUE(!file_exists(dir));
    EXPECT_TRUE(!file_exists(part));
}

static bool has_loaded(const char *library)
{
    char line[1024];
    bool found = false;
    FILE *maps = fopen("/proc/self/maps", "r");
    assert_non_null(maps);
    while (!found && fgets(line, sizeof line, maps))
        found = strstr(line, library) != NULL;
    fclose(maps);
    return found;
}

// A film of one image lasts a thirtieth of a second.
static void check_single_image(const char *path)
{
    static const uint8_t black[16 * 16 * 3];
    struct video_writer *w;
    FILE *out = fopen(path, "w+b");
    assert_non_null(out);
    EXPECT_STATUS(video_open(&w, out, &(struct video_layout){16, 16, true}), OK);
    const enum status status = video_add(w, black, 5);
    EXPECT_STATUS(video_close(&w, status), OK);
    fclose(out);
    const struct process_result r = PROCESS("/usr/bin/ffprobe", "-v", "error", "-show_entries",
                                            "stream=nb_frames,duration", "-of", "csv=p=0", path);
    double seconds;
    int frames;
    EXPECT_INT(sscanf(r.out, "%lf,%d", &seconds, &frames), 2);
    EXPECT_INT(frames, 1);
    EXPECT_NEAR(seconds, 1.0 / 30, 1e-3);
}

// The film has every image, by FFmpeg's own program. Its libraries, and all that they bring, wait for the film.
static void check_film(struct filmed *f)
{
    int64_t damaged;
    char path[300];
    EXPECT_TRUE(!has_loaded("libavcodec"));
    snprintf(path, sizeof path, "%s/film.mp4", f->rehearsal.scratch.path);
    FILE *out = fopen(path, "w+b");
    assert_non_null(out);
    enum status status = export_film_mp4(f->take, out, true, NULL, &damaged);
    fclose(out);
    if (status == ERR_INPUT) {
        EXPECT_SAYS("FFmpeg");
        return;
    }
    EXPECT_STATUS(status, OK);
    EXPECT_TRUE(has_loaded("libavcodec"));
    if (access("/usr/bin/ffprobe", X_OK))
        return;
    const struct process_result r =
        PROCESS("/usr/bin/ffprobe", "-v", "error", "-count_frames", "-select_streams", "v", "-show_entries",
                "stream=width,height,duration,nb_read_frames", "-of", "csv=p=0", path);
    const struct lens *l = &take_calibration(f->take)->color;
    int width, height, frames;
    double seconds;
    print_message("%s", r.out);
    EXPECT_INT(sscanf(r.out, "%d,%d,%lf,%d", &width, &height, &seconds, &frames), 4);
    EXPECT_TRUE(width == l->width && height == l->height);
    EXPECT_INT(frames, REHEARSAL_FRAMES);
    const struct take_entry *first = take_entry(f->take, 0), *last = take_entry(f->take, REHEARSAL_FRAMES - 1);
    // The last image, too, is shown for a frame.
    EXPECT_NEAR(seconds, (double)(last->time_ns - first->time_ns) * 1e-9 * frames / (frames - 1), 1e-3);
    assert_string_equal(r.err, "");
    check_single_image(path);
}

// Lines of a list that are no comment.
static int lines_in(const char *dir, const char *list)
{
    char path[320];
    uint8_t *text;
    size_t count;
    int lines = 0;
    snprintf(path, sizeof path, "%s/%s", dir, list);
    EXPECT_STATUS(file_read(path, &text, &count), OK);
    for (size_t i = 0; i < count; i++)
        lines += text[i] == '\n';
    lines -= count && text[0] == '#';
    free(text);
    return lines;
}

// A damaged image costs itself alone, and is counted; where all are, nothing is written.
static void check_damaged(struct filmed *f)
{
    int64_t damaged;
    char dir[300], film[310];
    run_sql(f->rehearsal.file, "UPDATE picture SET color = zeroblob(50) WHERE id = (1 << 32) + 3;"
                               "UPDATE picture SET depth = zeroblob(9) WHERE id = (1 << 32) + 5");
    snprintf(dir, sizeof dir, "%s/rest", f->rehearsal.scratch.path);
    EXPECT_STATUS(export_folder(f->take, dir, NULL, &damaged), OK);
    EXPECT_INT(damaged, 2);
    EXPECT_INT(lines_in(dir, "rgb.txt"), REHEARSAL_FRAMES - 1);
    EXPECT_INT(lines_in(dir, "depth.txt"), REHEARSAL_FRAMES - 1);
    EXPECT_INT(lines_in(dir, "mask.txt"), REHEARSAL_FRAMES);
    EXPECT_INT(lines_in(dir, "associations.txt"), REHEARSAL_FRAMES - 2); // frames that have both
    snprintf(film, sizeof film, "%s.mp4", dir);
    for (int all = 0; all < 2; all++) {
        FILE *out = fopen(film, "w+b");
        assert_non_null(out);
        const enum status status = export_film_mp4(f->take, out, true, NULL, &damaged);
        fclose(out);
        if (status == ERR_INPUT) // built without FFmpeg's libraries
            break;
        EXPECT_STATUS(status, all ? ERR_CORRUPT : OK);
        EXPECT_INT(damaged, all ? REHEARSAL_FRAMES : 1);
        run_sql(f->rehearsal.file, "UPDATE picture SET color = zeroblob(50), depth = zeroblob(9), mask = zeroblob(9)");
    }
    snprintf(dir, sizeof dir, "%s/none", f->rehearsal.scratch.path);
    EXPECT_STATUS(export_folder(f->take, dir, NULL, &damaged), ERR_CORRUPT);
    EXPECT_TRUE(!file_exists(dir));
}

static void test_images_come_back(void **state)
{
    (void)state;
    struct filmed f = filmed_open();
    check_points(&f);
    check_ply_folder(&f);
    check_place(&f);
    check_mcap(&f);
    check_folder(&f);
    check_stopped(&f);
    check_film(&f);
    check_damaged(&f);
    filmed_close(&f);
}

static int set_up(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    struct calibration calibration = world_calibration(0.25);
    struct recording_writer *writer;
    options.plain = true;
    scratch = scratch_make();
    const char *path = scratch_file(&scratch, "take.reenact");
    if (world_open(&world, &options) != OK || recording_create(&writer, path) != OK ||
        recording_begin_take(writer, "t", &calibration) != OK)
        return -1;
    for (int i = 0; i < FRAMES; i++) {
        struct take_frame frame = {.time_ns = 7000000000 + i * 100000000LL,
                                   .world_from_camera = world_sensor_pose(world),
                                   .located = true,
                                   .has_skeleton = true,
                                   .skeleton = truth(i)};
        if (recording_add_frame(writer, &frame) != OK)
            return -1;
    }
    if (recording_end_take(writer) != OK || recording_close(&writer) != OK)
        return -1;
    return recording_open(&recording, path) == OK && take_open(&take, recording, "t") == OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    take_close(&take);
    recording_free(&recording);
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_csv_has_every_joint),      cmocka_unit_test(test_bvh_matches_take),
        cmocka_unit_test(test_bvh_keeps_time_over_gaps), cmocka_unit_test(test_bvh_has_the_same_axes_all_along),
        cmocka_unit_test(test_trc_matches_take),         cmocka_unit_test(test_c3d_matches_take),
        cmocka_unit_test(test_markers_need_a_person),    cmocka_unit_test(test_markers_of_broken_clocks),
        cmocka_unit_test(test_bvh_needs_a_person),       cmocka_unit_test(test_room_axes_need_a_room),
        cmocka_unit_test(test_times_before_zero),        cmocka_unit_test(test_images_come_back),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
