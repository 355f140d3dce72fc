// training-images: depth images of people with truth, for training a body model, to standard output or a file; or a
// picture of some of them to look at; or crops about the person (training_crop.h), of which those that show too little
// of a person are passed over.
//
// Each image, little-endian: "RTI1"; uint16 width, height; uint8 sensor, whether a person is in it, the posture, 0;
// float32 fx, fy, cx, cy, shares cut and hidden, facing (radians); 16 joints of float32 x, y, z (camera axes, metres)
// and confidence; width * height uint16 of depth (mm); as many uint8 of parts (training_image.h).
#include "app/commands/command.h"
#include "base/pixels.h"
#include "platform/files/png.h"
#include "tests/world/training/training_crop.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    KEY_COUNT = COMMAND_KEY,
    KEY_SEED,
    KEY_FIRST,
    KEY_FIGURES,
    KEY_FIGURE_SEED,
    KEY_BODIES,
    KEY_MOTIONS,
    KEY_WITHOUT,
    KEY_OUT,
    KEY_CROPS,
    KEY_SHEET
};
enum { WITHOUT_MOST = 64 };

struct arguments {
    struct training_people_wish people;
    const char *without[WITHOUT_MOST + 1];
    int without_count;
    uint64_t seed;
    int first, count;
    const char *out, *sheet;
    bool crops;
};

static uint64_t whole_number(struct argp_state *state, const char *text, const char *option, double low, double high)
{
    char *end;
    const double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        argp_error(state, "--%s is '%s'; it must be a number from %g to %g", option, text, low, high);
    return (uint64_t)value;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    struct arguments *a = state->input;
    switch (key) {
    case KEY_COUNT: a->count = (int)whole_number(state, text, "count", 1, 1e9); return 0;
    case KEY_SEED: a->seed = whole_number(state, text, "seed", 0, 1e15); return 0;
    case KEY_FIRST: a->first = (int)whole_number(state, text, "first", 0, 1e9); return 0;
    case KEY_FIGURES: a->people.figures = (int)whole_number(state, text, "figures", 1, 2000); return 0;
    case KEY_FIGURE_SEED: a->people.seed = whole_number(state, text, "figure-seed", 0, 1e15); return 0;
    case KEY_BODIES: a->people.bodies = text; return 0;
    case KEY_MOTIONS: a->people.folder = text; return 0;
    case KEY_WITHOUT:
        if (a->without_count == WITHOUT_MOST)
            argp_error(state, "--without at most %d times", WITHOUT_MOST);
        a->without[a->without_count++] = text;
        return 0;
    case KEY_OUT: a->out = text; return 0;
    case KEY_CROPS: a->crops = true; return 0;
    case KEY_SHEET: a->sheet = text; return 0;
    case ARGP_KEY_ARG: argp_error(state, "'%s' is no option", text); return EINVAL;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// ---------------------------------------------------------------- records

static bool write_record(FILE *to, const struct training_scene *scene, const struct training_image *image)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    const uint16_t size[2] = {(uint16_t)image->width, (uint16_t)image->height};
    const uint8_t kinds[4] = {(uint8_t)scene->sensor, image->person, (uint8_t)scene->person[0].posture, 0};
    const float numbers[7] = {(float)scene->lens.fx,   (float)scene->lens.fy, (float)scene->lens.cx,
                              (float)scene->lens.cy,   (float)image->cut,     (float)image->hidden,
                              (float)image->facing_rad};
    float joints[JOINT_COUNT][4];
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = image->joints.joint[j];
        const float values[4] = {(float)p.x, (float)p.y, (float)p.z, (float)image->joints.confidence[j]};
        memcpy(joints[j], values, sizeof values);
    }
    return fwrite("RTI1", 1, 4, to) == 4 && fwrite(size, sizeof size, 1, to) == 1 &&
           fwrite(kinds, sizeof kinds, 1, to) == 1 && fwrite(numbers, sizeof numbers, 1, to) == 1 &&
           fwrite(joints, sizeof joints, 1, to) == 1 && fwrite(image->depth, 2, pixels, to) == pixels &&
           fwrite(image->part, 1, pixels, to) == pixels;
}

static bool write_crop(FILE *to, const struct training_scene *scene, const struct training_image *image)
{
    struct training_crop crop;
    return !training_crop_make(scene, image, &crop) || fwrite(&crop, sizeof crop, 1, to) == 1;
}

// ---------------------------------------------------------------- a sheet to look at

enum { CELL_W = 320, CELL_H = 240, COLUMNS = 6 };

static void put_pixel(uint8_t *rgb, int width, int x, int y, const uint8_t color[3])
{
    memcpy(rgb + 3 * ((size_t)y * (size_t)width + (size_t)x), color, 3);
}

// Depth in grey, nearer is lighter; parts tinted, joints as dots: white where they are seen.
static void draw_cell(const struct training_scene *scene, const struct training_image *image, uint8_t *rgb, int width,
                      int x0, int y0)
{
    for (int y = 0; y < CELL_H; y++)
        for (int x = 0; x < CELL_W; x++) {
            const int ix = x * image->width / CELL_W, iy = y * image->height / CELL_H, at = iy * image->width + ix;
            const double mm = image->depth[at];
            const int grey = mm > 0 ? (int)(230 * exp(-mm / 3500)) : 0, part = image->part[at];
            const bool own = part != TRAINING_NOTHING && part != TRAINING_OTHER;
            uint8_t color[3] = {(uint8_t)grey, (uint8_t)grey, (uint8_t)(mm > 0 ? grey : 60)};
            for (int c = 0; c < 3 && own; c++)
                color[c] = (uint8_t)(grey / 2 + (part * (37 + 29 * c)) % 120);
            put_pixel(rgb, width, x0 + x, y0 + y, color);
        }
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = image->joints.joint[j];
        const uint8_t color[3] = {255, (uint8_t)(image->joints.confidence[j] > 0.75f ? 255 : 60), 0};
        if (!(image->joints.confidence[j] > 0))
            continue;
        const int px = (int)((scene->lens.fx * p.x / p.z + scene->lens.cx) * CELL_W / image->width),
                  py = (int)((scene->lens.fy * p.y / p.z + scene->lens.cy) * CELL_H / image->height);
        for (int dy = -2; dy <= 2; dy++)
            for (int dx = -2; dx <= 2; dx++)
                if (px + dx >= 0 && px + dx < CELL_W && py + dy >= 0 && py + dy < CELL_H)
                    put_pixel(rgb, width, x0 + px + dx, y0 + py + dy, color);
    }
}

// ---------------------------------------------------------------- main

static enum status make_images(const struct arguments *arguments, const struct training_people *people, FILE *to,
                               uint8_t *sheet)
{
    struct training_renderer *renderer;
    struct training_image *image = malloc(sizeof *image);
    enum status status = training_renderer_open(&renderer, people);
    if (status == OK && !image)
        status = fail(ERR_MEMORY, "no memory for a training image");
    for (int i = 0; i < arguments->count && status == OK && !command_stopped(); i++) {
        struct training_scene scene;
        training_scene_draw(people, arguments->seed, arguments->first + i, &scene);
        status = training_image_render(renderer, &scene, image);
        if (status == OK && sheet)
            draw_cell(&scene, image, sheet, COLUMNS * CELL_W, i % COLUMNS * CELL_W, i / COLUMNS * CELL_H);
        else if (status == OK && !(arguments->crops ? write_crop(to, &scene, image) : write_record(to, &scene, image)))
            status = fail(ERR_IO, "the images cannot be written");
    }
    training_renderer_close(&renderer);
    free(image);
    return status;
}

static enum status make_sheet(const struct arguments *arguments, const struct training_people *people)
{
    const int width = COLUMNS * CELL_W, height = (arguments->count + COLUMNS - 1) / COLUMNS * CELL_H;
    uint8_t *sheet = calloc((size_t)width * (size_t)height, 3);
    enum status status =
        sheet ? make_images(arguments, people, NULL, sheet) : fail(ERR_MEMORY, "no memory for the sheet");
    if (status == OK)
        status = png_write(arguments->sheet, PNG_RGB8, sheet, width, height);
    free(sheet);
    return status;
}

static enum status make_file(const struct arguments *arguments, const struct training_people *people)
{
    if (!arguments->out && isatty(STDOUT_FILENO))
        return fail(ERR_INPUT, "the images are no text: give --out FILE, or --sheet FILE to look at some");
    FILE *to = arguments->out ? fopen(arguments->out, "wbx") : stdout;
    if (!to)
        return fail(ERR_IO, "%s cannot be made, or is there already", arguments->out);
    enum status status = make_images(arguments, people, to, NULL);
    if ((arguments->out ? fclose(to) : fflush(to)) && status == OK)
        status = fail(ERR_IO, "the images cannot be written");
    return status;
}

int main(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"count", KEY_COUNT, "N", 0, "How many images (12)", 0},
        {"first", KEY_FIRST, "I", 0, "Number of the first (0)", 0},
        {"seed", KEY_SEED, "S", 0, "Of the images (1)", 0},
        {"figures", KEY_FIGURES, "N", 0, "From how many people (24)", 0},
        {"figure-seed", KEY_FIGURE_SEED, "S", 0, "Of these people (1)", 0},
        {"bodies", KEY_BODIES, "DIR", 0, "Two of three from this folder of tools/makehuman_figures instead", 0},
        {"motions", KEY_MOTIONS, "DIR", 0, "Also poses of this folder's BVH files", 0},
        {"without", KEY_WITHOUT, "NAME", 0, "But not of this file (repeatable)", 0},
        {"out", KEY_OUT, "FILE", 0, "Write to this new file; default standard output", 0},
        {"crops", KEY_CROPS, NULL, 0, "Squares about the person instead of images", 0},
        {"sheet", KEY_SHEET, "FILE", 0, "Draw them into this PNG instead", 0},
        {0},
    };
    const struct argp argp = {
        options, parse,
        NULL,    "Depth images of people with the truth: parts of the body, joints, facing. For training a body model.",
        NULL,    NULL,
        NULL};
    struct arguments a = {.people = {.seed = 1, .figures = 24}, .seed = 1, .count = 12};
    argp_parse(&argp, argc, argv, 0, NULL, &a);
    a.people.held_out = a.without;
    command_catch_signals();
    struct training_people people;
    enum status status = training_people_open(&people, &a.people);
    if (status == OK)
        status = a.sheet ? make_sheet(&a, &people) : make_file(&a, &people);
    training_people_close(&people);
    return status == OK ? 0 : command_failed("training-images");
}
