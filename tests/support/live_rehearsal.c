#include "tests/support/live_rehearsal.h"

#include "capture/recorder.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>

static void check(enum status status)
{
    if (status != OK) {
        fprintf(stderr, "the live rehearsal failed: %s\n", status_message());
        abort();
    }
}

static struct world *open_world(const char *motion, const char *figure, double aside_m)
{
    struct world *world;
    struct world_options options = world_default_options();
    options.motion = motion;
    options.threads = 2;
    options.spot.x += aside_m;
    if (!world_figure_named(figure, &options.figure))
        abort();
    check(world_open(&world, &options));
    return world;
}

static void record(const struct live_rehearsal *r, const struct place *place)
{
    struct recording_writer *writer;
    struct source *source;
    struct recorder_options options = {0};
    struct recorder_result result;
    check(recording_create(&writer, r->file));
    check(recording_put_place(writer, place));
    check(source_open(&source, r->right, SOURCE_SENSOR));
    check(recorder_run(source, writer, "exercise", place, &options, &result));
    source_close(&source);
    check(recording_close(&writer));
}

struct live_rehearsal live_rehearsal_make(int frames, double scale)
{
    struct live_rehearsal r = {.scratch = scratch_make()};
    struct world *teacher = open_world("exercise", "woman", 0),
                 *pupil = open_world("exercise-wrong", "man", LIVE_REHEARSAL_ASIDE_M);
    struct place place = film_true_place(teacher, scale);
    film_sensor(teacher, &r.scratch, "right", scale, 0, frames);
    film_sensor(pupil, &r.scratch, "wrong", scale, 0, frames);
    rehearse_camera(&r.scratch, "viewer", teacher, 1);
    snprintf(r.file, sizeof r.file, "%s/exercise.reenact", r.scratch.path);
    snprintf(r.right, sizeof r.right, "folder:%s/right", r.scratch.path);
    snprintf(r.wrong, sizeof r.wrong, "folder:%s/wrong", r.scratch.path);
    snprintf(r.camera, sizeof r.camera, "folder:%s/viewer", r.scratch.path);
    record(&r, &place);
    place_free(&place);
    world_close(&pupil);
    world_close(&teacher);
    return r;
}

void live_rehearsal_end(struct live_rehearsal *r) { scratch_remove(&r->scratch); }
