// reenact-capture objects: known things before a stereo rig.
#include "app/commands/commands.h"

#include "app/commands/objects_search.h"
#include "base/text.h"
#include "recording/recording.h"
#include "platform/files/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    KEY_STEREO = COMMAND_KEY,
    KEY_RIG,
    KEY_OBJECTS,
    KEY_OUT,
    KEY_INTO,
    KEY_KNOWLEDGE,
    KEY_FORCE,
    KEY_JSON,
    KEY_CAMERA,
    KEY_SECONDS
};

static const struct argp_option options[] = {
    {"stereo", KEY_STEREO, "PAIRS.txt", 0, "pairs of pictures with the left camera's pose in the world", 0},
    {"rig", KEY_RIG, "RIG.json", 0, "the two cameras, as reenact-capture calibrate --stereo writes them", 0},
    {"camera", KEY_CAMERA, "URI", 0,
     "instead of pairs: libcamera, libcamera:N or folder:DIR, localised in the place of --into FILE; distances come "
     "from "
     "the things' sizes",
     0},
    {"seconds", KEY_SECONDS, "S", 0, "with --camera: look for S seconds; without it until it ends or Ctrl-C", 0},
    {"objects", KEY_OBJECTS, "OBJECTS.json", 0, "what to look for: names, reference pictures, sizes, URLs", 0},
    {"out", KEY_OUT, "FILE.json", 0, "where to write what was found", 0},
    {"into", KEY_INTO, "FILE", 0, "instead: keep the things in this recording's place, in whose axes the poses are", 0},
    {"knowledge", KEY_KNOWLEDGE, "URL", 0,
     "with --into: ask this knowledge base what is known of each thing; what was known stays if it does not answer", 0},
    {"force", KEY_FORCE, NULL, 0, "write over FILE.json", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct objects_arguments *a = state->input;
    switch (key) {
    case KEY_STEREO: a->pairs = value; return 0;
    case KEY_RIG: a->rig = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.1, 1e6); return 0;
    case KEY_OBJECTS: a->objects = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_INTO: a->into = value; return 0;
    case KEY_KNOWLEDGE: a->knowledge = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case ARGP_KEY_ARG:
        exit(command_unknown(state->name, "action", value, (const char *const[]){"list", "note", "serve"}, 3));
    case ARGP_KEY_END:
        command_require(state, a->objects, "--objects OBJECTS.json");
        if (a->camera) {
            command_require(state, a->into, "--into FILE");
            if (a->out || a->pairs || a->rig)
                argp_error(state, "--camera goes with --into FILE, not with --out, --stereo or --rig");
            return 0;
        }
        command_require(state, a->pairs, "--stereo PAIRS.txt");
        command_require(state, a->rig, "--rig RIG.json");
        if (!a->into == !a->out)
            argp_error(state, "either --out FILE.json, or --into FILE, an existing recording");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static error_t parse_serve(int key, char *value, struct argp_state *state)
{
    struct objects_arguments *a = state->input;
    switch (key) {
    case KEY_OBJECTS: a->objects = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->out, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->out, "DIR");
        command_require(state, a->objects, "--objects OBJECTS.json");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int serve(int argc, char **argv)
{
    static const struct argp_option serve_options[] = {
        {"objects", KEY_OBJECTS, "OBJECTS.json", 0, "the things; NAME.txt beside it describes the thing NAME", 0},
        {"force", KEY_FORCE, NULL, 0, "write over files in DIR", 0},
        {0},
    };
    struct objects_arguments a = {0};
    const struct argp argp = {serve_options,
                              parse_serve,
                              "DIR --objects OBJECTS.json",
                              "Write a folder of JSON-LD and pictures that a web server shows as a knowledge base.",
                              NULL,
                              NULL,
                              NULL};
    command_parse(&argp, argc, argv, &a);
    return objects_serve(a.objects, a.out, a.force) == OK ? 0 : command_failed(argv[0]);
}

struct note_arguments {
    const char *path, *thing, *text;
    struct vec3 at;
    bool has_place, json;
};

enum { KEY_THING = COMMAND_KEY + 20, KEY_TEXT, KEY_AT };

// "1.5,0,-2": decimal metres, at most 100 km off.
static struct vec3 parse_point(const struct argp_state *state, const char *value)
{
    enum { MOST_M = 100000 };
    char text[128], *rest = text;
    double at[3] = {0, 0, 0};
    bool good = snprintf(text, sizeof text, "%s", value) < (int)sizeof text;
    for (int k = 0; k < 3 && good; k++) {
        char *comma = strchr(rest, ',');
        good = (k < 2) == (comma != NULL);
        if (comma)
            *comma = 0;
        good = good && text_number(rest, &at[k]) && fabs(at[k]) <= MOST_M;
        rest = comma ? comma + 1 : rest;
    }
    if (!good)
        argp_error(state, "--at takes X,Y,Z in metres, at most %d, not '%s'", MOST_M, value);
    return v3(at[0], at[1], at[2]);
}

static error_t parse_note(int key, char *value, struct argp_state *state)
{
    struct note_arguments *a = state->input;
    switch (key) {
    case KEY_JSON: a->json = true; return 0;
    case KEY_THING: a->thing = value; return 0;
    case KEY_TEXT: a->text = value; return 0;
    case KEY_AT:
        a->at = parse_point(state, value);
        a->has_place = true;
        return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->path, value); return 0;
    case ARGP_KEY_END: command_require(state, a->path, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int list(int argc, char **argv)
{
    static const struct argp_option list_options[] = {COMMAND_OPTION_JSON(KEY_JSON), {0}};
    struct note_arguments a = {0};
    const struct argp argp = {.options = list_options,
                              .parser = parse_note,
                              .args_doc = "FILE",
                              .doc = "List the things of a recording and what is known of them."};
    command_parse(&argp, argc, argv, &a);
    return objects_list(a.path, a.json) == OK ? 0 : command_failed(argv[0]);
}

static int note(int argc, char **argv)
{
    static const struct argp_option note_options[] = {
        {"thing", KEY_THING, "NAME", 0, "which thing", 0},
        {"text", KEY_TEXT, "TEXT", 0, "what to write of it; empty: the note goes", 0},
        {"at", KEY_AT, "X,Y,Z", 0, "where it stands, in the place's axes, metres; a new name is added", 0},
        {0},
    };
    struct note_arguments a = {0};
    const struct argp argp = {.options = note_options,
                              .parser = parse_note,
                              .args_doc = "FILE --thing NAME --text TEXT [--at X,Y,Z]",
                              .doc = "Write a note to a thing of a recording, or name a new one by hand."};
    command_parse(&argp, argc, argv, &a);
    if (!a.thing || !a.text) {
        fprintf(stderr, "%s: --thing NAME and --text TEXT are needed\n", argv[0]);
        return 2;
    }
    return objects_note(a.path, a.thing, a.text, a.has_place ? &a.at : NULL) == OK ? 0 : command_failed(argv[0]);
}

int capture_objects(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*run)(int argc, char **argv);
    } actions[] = {{"list", list}, {"note", note}, {"serve", serve}};
    for (size_t i = 0; i < COUNT_OF(actions) && argc > 1; i++) {
        char name[160]; // as its sentences begin
        if (strcmp(argv[1], actions[i].name))
            continue;
        snprintf(name, sizeof name, "%s %s", argv[0], argv[1]);
        argv[1] = name;
        return actions[i].run(argc - 1, argv + 1);
    }
    struct objects_arguments a = {0};
    const struct argp argp = {
        options,
        parse,
        "--stereo PAIRS.txt --rig RIG.json --objects OBJECTS.json (--out FILE.json | --into FILE)\n"
        "--camera URI --objects OBJECTS.json --into FILE\n"
        "serve DIR --objects OBJECTS.json\n"
        "list FILE\n"
        "note FILE --thing NAME --text TEXT [--at X,Y,Z]",
        "Find known things before a stereo rig, or a camera in a known place, and say where they stand.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &a);
    enum status status = a.out ? file_check_output(a.out, a.force) : recording_check_change(a.into);
    if (status == OK)
        status = a.camera ? objects_by_camera(&a) : objects_run(&a);
    return status == OK ? 0 : command_failed(argv[0]);
}
