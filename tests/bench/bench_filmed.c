// Stage "filmed": every tenth picture of a filmed room is left out, and drawn from the others for the camera's own
// viewpoint, next to the plain coloured points of the same pictures, splatted. The error is the difference from the
// picture that the camera took, over all of its pixels, of which those that nothing was drawn in are grey. The poses
// are given: --data is a folder with rgb.txt, depth.txt (registered), calibration.json and trajectory.txt, or
// truth/trajectory.txt in its place; else the small world's empty room is filmed.
#include "platform/files/file.h"
#include "surround/surroundings.h"
#include "tests/bench/bench.h"
#include "tests/support/film.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { EVERY = 10, FIRST = 5, FILMED = 80, FILMED_SCALE = 2 /* of 640 x 480, divided by this */ };

struct filmed {
    struct scratch scratch;
    char folder[4096];
    struct surroundings room;
};

struct contender {
    struct filmed *all;
    bool plain, depth_test;
};

static bool is_kept(void *self, int capture)
{
    (void)self;
    return capture % EVERY != FIRST;
}

static enum status film_room(struct filmed *f)
{
    struct world_options options = world_default_options();
    struct world *world;
    char *list = calloc(FILMED, 160);
    enum status status = list ? world_open(&world, &options) : fail(ERR_MEMORY, "no memory for a list");
    if (status == OK) {
        film_sweep(world, &f->scratch, "sweep", 1.0 / FILMED_SCALE, FILMED, NULL);
        for (int i = 0, at = 0; i < FILMED; i++) {
            const double seconds = (double)WORLD_SWEEP_S * i / FILMED;
            const struct pose p = world_sweep_pose(world, seconds);
            at += sprintf(list + at, "%.6f %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n", 50 + seconds, p.translation.x,
                          p.translation.y, p.translation.z, p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w);
        }
        scratch_text(&f->scratch, "sweep/trajectory.txt", list);
        snprintf(f->folder, sizeof f->folder, "%s/sweep", f->scratch.path);
        world_close(&world);
    }
    free(list);
    return status;
}

// The folder itself, or one of links in which truth/trajectory.txt has its place.
static enum status find_room(struct filmed *f, const char *data)
{
    static const char *const links[][2] = {{"rgb", "rgb"},
                                           {"depth", "depth"},
                                           {"rgb.txt", "rgb.txt"},
                                           {"depth.txt", "depth.txt"},
                                           {"calibration.json", "calibration.json"},
                                           {"truth/trajectory.txt", "trajectory.txt"}};
    snprintf(f->folder, sizeof f->folder, "%s/trajectory.txt", data);
    const bool complete = file_exists(f->folder);
    snprintf(f->folder, sizeof f->folder, "%s", complete ? data : f->scratch.path);
    char *whole = realpath(data, NULL);
    enum status status = whole ? OK : fail(ERR_MISSING, "%s is missing", data);
    for (size_t i = 0; status == OK && !complete && i < COUNT_OF(links); i++) {
        char path[8192];
        snprintf(path, sizeof path, "%s/%s", whole, links[i][0]);
        if (symlink(path, scratch_file(&f->scratch, links[i][1])))
            status = fail(ERR_IO, "%s cannot be linked to", path);
    }
    free(whole);
    return status;
}

static void judge(const struct surround_view *view, const uint8_t *truth, struct bench_measure *out)
{
    const int pixels = view->lens.width * view->lens.height;
    double all = 0, seen = 0;
    int drawn = 0;
    for (int i = 0; i < pixels; i++) {
        double squares = 0;
        for (int c = 0; c < 3; c++) {
            const double d = view->rgb[3 * i + c] - truth[3 * i + c];
            squares += d * d / 3;
        }
        all += squares;
        if (view->source[i] == SOURCE_UNSEEN)
            continue;
        drawn++;
        seen += squares;
    }
    out->error = sqrt(all / pixels);
    out->extra[0] = 10 * log10(65025.0 * pixels / fmax(all, 1e-6));
    out->extra[1] = 10 * log10(65025.0 * drawn / fmax(seen, 1e-6));
    out->extra[2] = 100.0 * drawn / pixels;
}

static enum status measure(void *self, int item, struct bench_measure *out)
{
    const struct contender *c = self;
    struct surroundings *room = &c->all->room;
    const int capture = FIRST + EVERY * item;
    const struct pose at = room->set.captures[capture].guess;
    const struct surround_picture *const *pictures;
    struct surround_picture truth = {0};
    int count;
    room->plain = c->plain;
    room->options.view.depth_test = c->depth_test;
    enum status status = surroundings_prepare(room, at, &pictures, &count);
    const double started_ms = bench_clock_ms();
    if (status == OK)
        status = surroundings_draw(room, at);
    out->time_ms = bench_clock_ms() - started_ms;
    if (status == OK)
        status = surround_set_picture(&room->set, capture, &truth);
    if (status == OK)
        judge(&room->view, truth.rgb, out);
    surround_picture_free(&truth);
    return status;
}

static enum status run_all(struct bench *b, struct filmed *f)
{
    struct contender ours = {f, false, true}, untested = {f, false, false}, points = {f, true, true};
    const struct bench_contender contenders[] = {{"ours", measure, &ours, false},
                                                 {"ours, without the depth test", measure, &untested, false},
                                                 {"coloured points, splatted", measure, &points, true}};
    const int count = f->room.set.capture_count;
    if (count <= FIRST)
        return fail(ERR_INPUT, "a filmed room of %d pictures has none to leave out", count);
    f->room.delivers = is_kept;
    const enum status status = surroundings_advance(&f->room, INT64_MAX);
    return status == OK ? bench_run(b, contenders, COUNT_OF(contenders), (count - FIRST - 1) / EVERY + 1) : status;
}

static enum status run(struct bench *b)
{
    struct filmed *f = calloc(1, sizeof *f);
    const char *data = bench_inputs(b)->data;
    if (!f)
        return fail(ERR_MEMORY, "no memory");
    f->scratch = scratch_make();
    enum status status = data ? find_room(f, data) : film_room(f);
    if (status == OK)
        status = surroundings_open(&f->room, f->folder, NULL);
    if (status == OK && !f->room.set.filmed)
        status = fail(ERR_INPUT, "%s is no filmed room", f->folder);
    if (status == OK)
        status = run_all(b, f);
    surroundings_close(&f->room);
    scratch_remove(&f->scratch);
    free(f);
    return status;
}

const struct bench_stage bench_stage_filmed = {"filmed",
                                               "left-out pictures of a filmed room, drawn from the others",
                                               "rms_levels",
                                               "draw_ms",
                                               {"psnr_db", "psnr_drawn_db", "drawn_percent"},
                                               run};
