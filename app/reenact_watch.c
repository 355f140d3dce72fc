// The actor in a window, without a tablet's camera: looked at by orbiting.
#include "app/commands.h"

#include "app/orbit.h"
#include "platform/clock.h"
#include "platform/window.h"
#include "reenact/motion.h"
#include "reenact/painter.h"

#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 960, HEIGHT = 720, FRAME_MS = 16 };

struct arguments {
    const char *file, *take;
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct arguments *given = state->input;
    switch (key) {
    case COMMAND_KEY: given->take = value; return 0;
    case ARGP_KEY_ARG:
        if (given->file)
            argp_error(state, "one FILE, not two");
        given->file = value;
        return 0;
    case ARGP_KEY_END: command_need(state, given->file, "FILE"); return 0;
    }
    return ARGP_ERR_UNKNOWN;
}

// Everything that is open while one take is watched.
struct watch {
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
    struct painter *painter;
    struct motion *motion;
    struct window *window;
    uint8_t *backdrop, *picture; // RGB
    struct orbit orbit;
    int64_t length_ns, time_ns;
    bool playing;
};

static void watch_close(struct watch *w)
{
    free(w->backdrop);
    free(w->picture);
    window_close(&w->window);
    motion_close(&w->motion);
    painter_close(&w->painter);
    gpu_close(&w->gpu);
    take_close(&w->take);
    recording_free(&w->recording);
}

// A quiet grey that is darker below, so that the feet have something to stand on.
static void paint_backdrop(uint8_t *rgb)
{
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < 3 * WIDTH; x++)
            rgb[y * 3 * WIDTH + x] = (uint8_t)(y < HEIGHT / 2 ? 232 : 232 - 90 * (y - HEIGHT / 2) / HEIGHT);
}

static enum status watch_open(struct watch *w, const struct arguments *given)
{
    struct lens lens = {WIDTH, HEIGHT, 0.9 * WIDTH, 0.9 * WIDTH, (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0, 0, 0, 0, 0, 0};
    struct painter_options options = painter_default_options();
    enum status status = recording_open(&w->recording, given->file);
    if (status == OK && !given->take && !recording_take_count(w->recording))
        status = fail(ERR_MISSING, "%s holds no take; film one with reenact-capture record", given->file);
    if (status == OK)
        status = take_open(&w->take, w->recording, given->take ? given->take : recording_take_name(w->recording, 0));
    if (status == OK)
        status = motion_open(&w->motion, w->take);
    if (status == OK)
        status = gpu_open(&w->gpu);
    if (status == OK)
        status = painter_open(&w->painter, w->gpu, w->take, &lens, &options);
    if (status == OK && (!(w->backdrop = malloc(3 * WIDTH * HEIGHT)) || !(w->picture = malloc(3 * WIDTH * HEIGHT))))
        status = fail(ERR_MEMORY, "no memory for the picture");
    if (status == OK)
        status = window_open(&w->window, given->file, WIDTH, HEIGHT);
    if (status != OK)
        return status;
    paint_backdrop(w->backdrop);
    int64_t frames = take_frame_count(w->take);
    w->length_ns = take_entry(w->take, frames - 1)->time_ns - take_entry(w->take, 0)->time_ns;
    w->playing = true;
    return OK;
}

// Looks at the actor from where the sensor stood.
static void aim(struct watch *w)
{
    for (int64_t i = 0; i < take_frame_count(w->take); i++) {
        struct moment moment;
        const struct take_entry *entry = take_entry(w->take, i);
        int64_t since_ns = entry->time_ns - take_entry(w->take, 0)->time_ns;
        if (!entry->has_skeleton || motion_at(w->motion, since_ns, false, &moment) != OK)
            continue;
        enum joint middle = moment.skeleton.confidence[JOINT_WAIST] > 0 ? JOINT_WAIST : JOINT_NECK;
        struct vec3 from = v3_sub(entry->world_from_camera.translation, moment.skeleton.joint[middle]);
        w->orbit = (struct orbit){moment.skeleton.joint[middle], atan2(from.x, -from.y), 0.1,
                                  fmax(2, hypot(from.x, from.y))};
        return;
    }
}

// The actor walks; the camera's aim follows slowly.
static void follow(struct watch *w)
{
    struct moment moment;
    if (motion_at(w->motion, w->time_ns, true, &moment) == OK && moment.skeleton.confidence[JOINT_WAIST] > 0)
        w->orbit.centre = v3_mix(w->orbit.centre, moment.skeleton.joint[JOINT_WAIST], 0.05);
}

static enum status draw(struct watch *w)
{
    struct painter_view view = {orbit_world_from_camera(&w->orbit), w->time_ns, w->backdrop};
    struct painter_result drawn;
    enum status status = painter_draw(w->painter, &view, &drawn);
    if (status == OK)
        status = painter_read(w->painter, w->picture);
    return status == OK ? window_show(w->window, w->picture) : status;
}

static enum status watch_loop(struct watch *w)
{
    aim(w);
    int64_t before = clock_now_ns();
    while (!command_stopped()) {
        struct window_events events = window_poll(w->window, FRAME_MS);
        int64_t now = clock_now_ns();
        if (events.quit)
            break;
        w->playing ^= events.play_pause;
        if (w->playing)
            w->time_ns += now - before;
        before = now;
        if (events.steps) {
            w->playing = false;
            w->time_ns += events.steps * (w->length_ns / take_frame_count(w->take));
        }
        if (w->length_ns > 0)
            w->time_ns = (w->time_ns % w->length_ns + w->length_ns) % w->length_ns;
        orbit_move(&w->orbit, events.drag_x, events.drag_y, events.zoom);
        follow(w);
        enum status status = draw(w);
        if (status != OK)
            return status;
    }
    return OK;
}

int reenact_watch(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"take", COMMAND_KEY, "NAME", 0, "the take to watch; the first where none is named", 0},
        {0},
    };
    static const struct argp argp = {
        options, parse, "FILE",
        "Watch a take in a window.\vDrag to walk round, wheel or two fingers to come nearer, space to pause, arrow keys "
        "to step, Q to leave.", 0, 0, 0};
    struct arguments given = {0};
    argp_parse(&argp, argc, argv, 0, NULL, &given);
    struct watch watch = {0};
    command_catch_stop();
    enum status status = watch_open(&watch, &given);
    if (status == OK)
        status = watch_loop(&watch);
    watch_close(&watch);
    return status == OK ? 0 : command_failed(argv[0]);
}
