#include "tests/support/rehearsal.h"

#include "capture/recorder.h"
#include "platform/files/jpeg.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(enum status status)
{
    if (status != OK) {
        fprintf(stderr, "the rehearsal failed: %s\n", status_message());
        abort();
    }
}

void rehearse_lens(const struct scratch *scratch, const char *name, const struct lens *l)
{
    char path[64], text[512];
    snprintf(text, sizeof text,
             "{\"color\": {\"width\": %d, \"height\": %d, \"fx\": %.9g, \"fy\": %.9g, \"cx\": %.9g, \"cy\": %.9g, "
             "\"distortion\": [%.9g, %.9g, %.9g, %.9g, %.9g], \"focal_sigma\": %.9g}}",
             l->width, l->height, l->fx, l->fy, l->cx, l->cy, l->k1, l->k2, l->p1, l->p2, l->k3, l->focal_sigma);
    snprintf(path, sizeof path, "%s/calibration.json", name);
    scratch_text(scratch, path, text);
}

void rehearse_camera(const struct scratch *scratch, const char *name, const struct world *w, double scale)
{
    struct calibration c = world_viewer_calibration(scale);
    const struct lens *l = &c.color;
    size_t pixels = (size_t)l->width * (size_t)l->height, count;
    uint8_t *rgb = malloc(3 * pixels), *bytes;
    char list[1024] = "", path[64];
    if (!rgb)
        abort();
    for (int i = 0; i < REHEARSAL_IMAGES; i++) {
        double time_s = 0.8 * i;
        struct world_shot shot = {*l, w ? world_viewer_pose(w, time_s) : POSE_IDENTITY, time_s, false};
        if (w)
            check(world_render(w, &shot, &(struct world_image){.color = rgb}));
        for (size_t p = 0; p < 3 * pixels && !w; p++)
            rgb[p] = (uint8_t)(168 + p / 3 % (size_t)l->width / 40);
        check(jpeg_encode(rgb, l->width, l->height, 92, &bytes, &count));
        snprintf(path, sizeof path, "%s/rgb/%04d.jpg", name, i);
        scratch_write(scratch, path, bytes, count);
        free(bytes);
        sprintf(list + strlen(list), "%.3f rgb/%04d.jpg\n", 10 + 0.1 * i, i);
    }
    free(rgb);
    snprintf(path, sizeof path, "%s/rgb.txt", name);
    scratch_text(scratch, path, list);
    rehearse_lens(scratch, name, l);
}

static void record(struct recording_writer *writer, const struct rehearsal *r, const struct place *place,
                   const char *take)
{
    struct source *source;
    struct recorder_options options = {0};
    struct recorder_result result;
    char uri[300];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&r->scratch, "sensor"));
    check(source_open(&source, uri, SOURCE_SENSOR));
    check(recorder_run(source, writer, take, place, &options, &result));
    source_close(&source);
}

struct rehearsal rehearsal_make(void)
{
    struct rehearsal r = {.scratch = scratch_make()};
    struct world *world;
    struct world_options options = world_default_options();
    options.threads = 2;
    check(world_open(&world, &options));
    struct place place = film_true_place(world, 1);
    film_sensor(world, &r.scratch, "sensor", 1, 0.5, REHEARSAL_FRAMES);
    snprintf(r.file, sizeof r.file, "%s/dancer.reenact", r.scratch.path);
    snprintf(r.camera, sizeof r.camera, "folder:%s/viewer", r.scratch.path);
    snprintf(r.blind, sizeof r.blind, "folder:%s/wall", r.scratch.path);
    struct recording_writer *writer;
    check(recording_create(&writer, r.file));
    check(recording_put_place(writer, &place));
    record(writer, &r, &place, "turn");
    record(writer, &r, &place, "once more");
    check(recording_close(&writer));
    rehearse_camera(&r.scratch, "viewer", world, 1);
    rehearse_camera(&r.scratch, "wall", NULL, 1);
    place_free(&place);
    world_close(&world);
    return r;
}

void rehearsal_end(struct rehearsal *r) { scratch_remove(&r->scratch); }
