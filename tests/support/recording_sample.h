// A folder to write in and a small recording with a bit of everything, for tests of the recording file. Everything
// follows from SAMPLE_SEED.
#pragma once
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "recording/recording.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { WIDTH = 61, HEIGHT = 47, COLOR_WIDTH = 80, COLOR_HEIGHT = 60, FRAMES = 40, SAMPLE_SEED = 20140601 };

static char folder[64];

static inline const char *sample_path(const char *name)
{
    static char path[2][128];
    static int slot;
    slot = !slot;
    snprintf(path[slot], sizeof path[slot], "%s/%s", folder, name);
    return path[slot];
}

static inline int sample_folder_make(void **state)
{
    (void)state;
    // In memory where possible: hundreds of small files must not wait for a disk.
    bool has_memory = !access("/dev/shm", W_OK | X_OK);
    snprintf(folder, sizeof folder, "%s/reenact_test.XXXXXX", has_memory ? "/dev/shm" : "/tmp");
    return mkdtemp(folder) ? 0 : -1;
}

static inline int sample_folder_remove(void **state)
{
    (void)state;
    char command[200];
    snprintf(command, sizeof command, "chmod -R u+w %s; rm -rf %s", folder, folder);
    return system(command);
}

// ------------------------------------------------------------- data to record

static inline double sample_number(struct rng *rng) { return rng_normal(rng) * 3; }

static inline struct pose sample_pose(struct rng *rng)
{
    return (struct pose){
        quat_unit((struct quat){sample_number(rng), sample_number(rng), sample_number(rng), sample_number(rng)}),
        v3(sample_number(rng), sample_number(rng), -0.0)};
}

static inline struct calibration sample_calibration(void)
{
    return (struct calibration){
        .color = {COLOR_WIDTH, COLOR_HEIGHT, 70.1, 70.2, 39.5, 29.5, 0.1, -0.02, 1e-3, -1e-3, 0.003, 0, 0},
        .depth = {WIDTH, HEIGHT, 55.5, 55.7, 30, 23, 0, 0, 0, 0, 0, 0, 0},
        .color_from_depth = {{0.01, 0.02, 0.03, 0.9993}, {0.025, -1e-3, 1e-4}},
    };
}

static inline uint8_t *sample_jpeg(struct rng *rng, size_t *bytes)
{
    static uint8_t rgb[COLOR_WIDTH * COLOR_HEIGHT * 3];
    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(i / 37 + 40 * rng_uniform(rng));
    uint8_t *jpeg;
    assert_int_equal(jpeg_encode(rgb, COLOR_WIDTH, COLOR_HEIGHT, 90, &jpeg, bytes), OK);
    return jpeg;
}

static inline void sample_depth(struct rng *rng, uint16_t *depth)
{
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        depth[i] = (uint16_t)(rng_uniform(rng) < 0.1 ? 0 : rng_uniform(rng) < 0.01 ? 65535 : 2000 + i / 3);
}

static inline struct place sample_place(struct rng *rng)
{
    struct place p = {.calibration = sample_calibration(), .rms_px = 0.31, .rms_m = 0.004};
    p.tag_count = 3;
    p.point_count = 1000;
    p.view_count = 3;
    p.tags = calloc((size_t)p.tag_count, sizeof *p.tags);
    p.points = calloc((size_t)p.point_count, sizeof *p.points);
    p.views = calloc((size_t)p.view_count, sizeof *p.views);
    for (int i = 0; i < p.tag_count; i++)
        p.tags[i] = (struct place_tag){.id = 7 * i,
                                       .side_m = 0.16,
                                       .world_from_tag = sample_pose(rng),
                                       .rms_px = sample_number(rng),
                                       .observations = 5 + i};
    for (int i = 0; i < p.tag_count; i++)
        for (int k = 0; k < 21; k++)
            p.tags[i].covariance[k] = (float)(i + k) * 1e-6F;
    for (int i = 0; i < p.point_count; i++) {
        p.points[i].world = v3(sample_number(rng), sample_number(rng), sample_number(rng));
        for (int k = 0; k < 6; k++)
            p.points[i].covariance[k] = (float)(i + k) * 1e-6F;
        for (int k = 0; k < 3; k++)
            p.points[i].seen_from[k] = (float)(i - k) * 1e-3F;
        for (int k = 0; k < 32; k++)
            p.points[i].descriptor[k] = (uint8_t)(256 * rng_uniform(rng));
    }
    for (int i = 0; i < p.view_count; i++) {
        p.views[i].world_from_camera = sample_pose(rng);
        if (i != 1)
            p.views[i].jpeg = sample_jpeg(rng, &p.views[i].jpeg_bytes);
        if (i != 2) {
            p.views[i].depth = malloc(WIDTH * HEIGHT * 2);
            sample_depth(rng, p.views[i].depth);
        }
    }
    return p;
}

// A frame and its buffers. Some images are missing on purpose.
struct sample_frame {
    struct take_frame frame;
    uint8_t *jpeg;
    uint16_t depth[WIDTH * HEIGHT];
    uint8_t mask[WIDTH * HEIGHT];
};

static inline void sample_frame_make(struct sample_frame *m, int index)
{
    struct rng rng = {SAMPLE_SEED + (uint64_t)index};
    memset(m, 0, sizeof *m);
    m->frame.time_ns = -5 + index * INT64_C(33333333);
    m->frame.world_from_camera = sample_pose(&rng);
    m->frame.located = index % 3 == 0;
    sample_depth(&rng, m->depth);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        m->mask[i] = (i % WIDTH - 30) * (i % WIDTH - 30) + (i / WIDTH - 20) * (i / WIDTH - 20) < 150 + index;
    m->jpeg = sample_jpeg(&rng, &m->frame.jpeg_bytes);
    m->frame.jpeg = index % 7 == 3 ? NULL : m->jpeg;
    m->frame.depth = index % 7 == 4 ? NULL : m->depth;
    m->frame.mask = index % 7 == 5 ? NULL : m->mask;
    if (index % 7 == 6)
        m->frame.jpeg = NULL, m->frame.depth = NULL, m->frame.mask = NULL;
    m->frame.has_skeleton = index % 5 != 2;
    for (int j = 0; j < JOINT_COUNT; j++) {
        m->frame.skeleton.joint[j] = v3(sample_number(&rng), sample_number(&rng), sample_number(&rng));
        m->frame.skeleton.confidence[j] = (float)(j % 3) / 2;
        const struct covariance3 c = covariance3_outer(m->frame.skeleton.joint[j]);
        if (index % 4) // in every fourth frame they are not known
            joint_set_covariance(&m->frame.skeleton, (enum joint)j, &c);
    }
}

static inline void sample_frames_add(struct recording_writer *w, int from, int to)
{
    static struct sample_frame m;
    for (int i = from; i < to; i++) {
        sample_frame_make(&m, i);
        EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
        free(m.jpeg);
    }
}

static const struct body sample_body = {
    .representative_frame = 17,
    .radius_rate = {0.3, 0.5, 0.45, 0.2, 0.19, 0, 0.18, 0.21, 0.2, 0.2, 0.1},
};

// Two takes and a place; the second take stays open.
static inline void sample_recording_write(const char *path)
{
    struct rng rng = {SAMPLE_SEED};
    struct place place = sample_place(&rng);
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_put_place(w, &place), OK);
    place.rms_px = 0.25;
    EXPECT_STATUS(recording_put_place(w, &place), OK); // replaces
    EXPECT_STATUS(recording_begin_take(w, "höher", &calibration), OK);
    sample_frames_add(w, 0, FRAMES / 2);
    struct body body = sample_body;
    body.representative_frame = 3;
    EXPECT_STATUS(recording_put_body(w, &body), OK);
    sample_frames_add(w, FRAMES / 2, FRAMES);
    EXPECT_STATUS(recording_put_body(w, &sample_body), OK);
    EXPECT_STATUS(recording_put_dropped(w, 12), OK);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "second", &calibration), OK);
    sample_frames_add(w, 0, 3);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_TRUE(w == NULL);
    place_free(&place);
}
