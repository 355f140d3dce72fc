#include "tests/world/film/film_options.h"

#include "app/commands/command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct reel film_reels[FILM_REELS] = {
    {"place", SET_PLACE, 10, 940, true, false},
    {"sensor", SET_SENSOR, 30, 1000, true, true},
    {"viewer", SET_VIEWER, 10, 2000, false, false},
};

enum {
    KEY_OUT = COMMAND_KEY,
    KEY_WHAT,
    KEY_SECONDS,
    KEY_SIZE,
    KEY_FIGURE,
    KEY_MOTION,
    KEY_SEED,
    KEY_THREADS,
    KEY_CLEAN,
    KEY_READOUT,
    KEY_FOCAL,
    KEY_RATE,
    KEY_TABLE,
    KEY_BARE,
    KEY_TAGS,
    KEY_MOVED,
    KEY_AT,
    KEY_STAND,
    KEY_WALK
};

static void read_number(struct argp_state *state, const char *text, const char *option, double low, double high,
                        double *out)
{
    char *end;
    *out = strtod(text, &end);
    if (end == text || *end || !(*out >= low && *out <= high))
        argp_error(state, "--%s is '%s'; it must be a number from %g to %g", option, text, low, high);
}

// Up to the end or a colon. Returns where it ended.
static const char *read_tags(struct argp_state *state, const char *text, uint32_t *tags)
{
    const char *at = text;
    for (*tags = 0; *at && *at != ':';) {
        char *end;
        long id = strtol(at, &end, 10);
        if (end == at || (*end && *end != ',' && *end != ':') || id < 0 || id > 31)
            argp_error(state, "'%s' is no list of tags; it must be like 0,3,7", text);
        *tags |= 1u << id;
        at = *end == ',' ? end + 1 : end;
    }
    return at;
}

static void read_moved(struct argp_state *state, const char *text, struct world_moved *moved)
{
    char rest;
    const char *by = read_tags(state, text, &moved->tags);
    if (sscanf(by, ":%lf,%lf%c", &moved->right, &moved->up, &rest) != 2)
        argp_error(state, "--moved is '%s'; it must be like 0,3:0.3,-0.1", text);
}

static const double DEGREE = 3.14159265358979323846 / 180;

static void read_at(struct argp_state *state, const char *text, struct world_spot *spot)
{
    char rest;
    if (sscanf(text, "%lf,%lf,%lf%c", &spot->x, &spot->y, &spot->turned, &rest) != 3)
        argp_error(state, "--at is '%s'; it must be X,Y,DEGREES", text);
    spot->turned *= DEGREE;
}

static void read_stand(struct argp_state *state, const char *text, struct world_stand *s)
{
    char rest;
    if (sscanf(text, "%lf,%lf,%lf,%lf,%lf,%lf,%lf%c", &s->eye.x, &s->eye.y, &s->eye.z, &s->target.x, &s->target.y,
               &s->target.z, &s->roll, &rest) != 7)
        argp_error(state, "--stand is '%s'; it must be X,Y,Z,X,Y,Z,DEGREES", text);
    s->roll *= DEGREE;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    struct film_options *f = state->input;
    double number = 0;
    char rest;
    switch (key) {
    case KEY_OUT: f->out = text; break;
    case KEY_WHAT:
        f->sets = !strcmp(text, "all") ? SET_ALL : 0;
        for (size_t i = 0; i < FILM_REELS; i++)
            if (!strcmp(text, film_reels[i].name))
                f->sets = film_reels[i].set;
        if (!f->sets)
            argp_error(state, "--what is '%s'; it must be place, sensor, viewer or all", text);
        break;
    case KEY_SECONDS: read_number(state, text, "seconds", 0, 3600, &f->seconds); break;
    case KEY_SIZE:
        if (sscanf(text, "%dx%d%c", &f->width, &f->height, &rest) != 2 || f->width < 64 || f->width > 4096 ||
            f->height < 64 || f->height > 4096)
            argp_error(state, "--size is '%s'; it must be like 640x480, 64 to 4096 both ways", text);
        break;
    case KEY_FIGURE:
        if (!world_figure_named(text, &f->world.figure))
            argp_error(state, "--figure is '%s'; there are %s", text, world_figure_names());
        break;
    case KEY_MOTION: f->world.motion = text; break;
    case KEY_SEED:
        read_number(state, text, "seed", 0, 4294967295.0, &number);
        f->world.seed = (uint64_t)number;
        break;
    case KEY_THREADS:
        read_number(state, text, "threads", 1, 16, &number);
        f->world.threads = (int)number;
        break;
    case KEY_READOUT:
        read_number(state, text, "readout", 0, LENS_MAX_READOUT_S * 1e3, &number);
        f->readout_s = number * 1e-3;
        break;
    case KEY_CLEAN: f->clean = true; break;
    case KEY_FOCAL: read_number(state, text, "focal", 30, 8000, &f->focal_px); break;
    case KEY_RATE: read_number(state, text, "rate", 0.5, 240, &f->rate_hz); break;
    case KEY_TABLE: f->world.table = true; break;
    case KEY_BARE: f->world.bare = true; break;
    case KEY_TAGS:
        if (*read_tags(state, text, &f->world.tags))
            argp_error(state, "--tags is '%s'; it must be like 0,3,7", text);
        break;
    case KEY_MOVED: read_moved(state, text, &f->world.moved); break;
    case KEY_AT: read_at(state, text, &f->world.spot); break;
    case KEY_STAND: read_stand(state, text, &f->world.stand); break;
    case KEY_WALK:
        if (sscanf(text, "%lf,%lf%c", &f->world.walk.distance_m, &f->world.walk.round, &rest) != 2)
            argp_error(state, "--walk is '%s'; it must be METRES,DEGREES", text);
        f->world.walk.round *= DEGREE;
        break;
    case ARGP_KEY_END: command_require(state, f->out, "out"); break;
    default: return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

void film_read_options(int argc, char **argv, struct film_options *out)
{
    static const struct argp_option options[] = {
        {"out", KEY_OUT, "DIR", 0, "Where to write place/, sensor/, viewer/, tags.json and truth/", 0},
        {"what", KEY_WHAT, "SET", 0,
         "place (the empty room, hand-held sensor), sensor (the take), viewer (a tablet carried round) or all "
         "(the default)",
         0},
        {"seconds", KEY_SECONDS, "S", 0, "Film no more than this", 0},
        {"size", KEY_SIZE, "WxH", 0, "Of the images; default 640x480", 0},
        {"figure", KEY_FIGURE, "NAME", 0, "woman (the default), man, child, heavy, skirt, coat, tall", 0},
        {"motion", KEY_MOTION, "NAME", 0,
         "pirouette (the default), kata, still, bend, walk, hide, visit, exercise, exercise-wrong (the same with known "
         "mistakes); a posture as standing, sitting-on-floor, all-fours, push-up, lying-on-back, of a seed push-up:7; "
         "or "
         "the path of a .bvh file",
         0},
        {"seed", KEY_SEED, "N", 0, "Of posters, camera shake and noise; default 1", 0},
        {"threads", KEY_THREADS, "N", 0, "Default 1; the files do not depend on it", 0},
        {"readout", KEY_READOUT, "MS", 0,
         "Hand-held cameras have a rolling shutter: the last row is read this much after the first", 0},
        {"clean", KEY_CLEAN, NULL, 0, "No noise on colour and depth", 0},
        {"focal", KEY_FOCAL, "PX", 0,
         "The camera's focal length in pixels; default 525/640 of the width, the tablet's 545/640", 0},
        {"rate", KEY_RATE, "HZ", 0, "Images a second; default 10, the take 30", 0},
        {"table", KEY_TABLE, NULL, 0, "A table to the right of the actor's path", 0},
        {"bare", KEY_BARE, NULL, 0, "No posters on the walls, no rug", 0},
        {"tags", KEY_TAGS, "LIST", 0, "Which of the tags 0 to 14 are present: 0,3,7; default all", 0},
        {"moved", KEY_MOVED, "LIST:RIGHT,UP", 0, "Tags that were moved, and by how many metres on their wall", 0},
        {"at", KEY_AT, "X,Y,DEGREES", 0, "Where the motion takes place, and how far it is rotated", 0},
        {"stand", KEY_STAND, "X,Y,Z,X,Y,Z,DEGREES", 0,
         "Where the sensor stands, what it looks at, and how far it is rolled; default 0.1,-3.1,1.15,0.02,0,1,0.23", 0},
        {"walk", KEY_WALK, "METRES,DEGREES", 0, "How far from the actor the viewer walks, and how far round", 0},
        {0},
    };
    static const struct argp argp = {options,
                                     parse,
                                     NULL,
                                     "Renders the tests' small world: a room with tags, and a figure that moves in it, "
                                     "into folders in the TUM RGB-D layout with the truth beside them.",
                                     NULL,
                                     NULL,
                                     NULL};
    *out = (struct film_options){
        .sets = SET_ALL, .seconds = -1, .width = 640, .height = 480, .world = world_default_options()};
    argp_err_exit_status = 2;
    command_parse(&argp, argc, argv, out);
}
