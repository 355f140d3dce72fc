// reenact-capture calibrate --stereo: two cameras that are fixed to each other.
#include "app/commands/commands.h"
#include "capture/calibration/stereo_rig.h"
#include "platform/files/file.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct stereo_arguments {
    const char *folder, *out;
    bool json, force;
};

enum { KEY_STEREO = COMMAND_KEY, KEY_OUT, KEY_FORCE, KEY_JSON };

static const struct argp_option options[] = {
    {"stereo", KEY_STEREO, "DIR", 0, "pairs of pictures of a board of circles: DIR/left, DIR/right, DIR/board.json", 0},
    {"out", KEY_OUT, "RIG.json", 0, "where to write the lenses and the pose between the cameras", 0},
    {"force", KEY_FORCE, NULL, 0, "write over RIG.json", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct stereo_arguments *a = state->input;
    switch (key) {
    case KEY_STEREO: a->folder = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    case ARGP_KEY_END: command_require(state, a->folder, "--stereo DIR"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static enum status print_report(const struct stereo_rig *rig, const struct stereo_report *report, int pairs,
                                bool as_json)
{
    if (!as_json) {
        printf("%d of %d pairs; reprojection %.3f px left, %.3f px right (largest %.2f, %.2f)\n", report->views, pairs,
               report->rms_px[0], report->rms_px[1], report->max_px[0], report->max_px[1]);
        printf(
            "left  fx %.2f fy %.2f cx %.2f cy %.2f\nright fx %.2f fy %.2f cx %.2f cy %.2f (focal lengths to %.2f %%)\n",
            rig->left.fx, rig->left.fy, rig->left.cx, rig->left.cy, rig->right.fx, rig->right.fy, rig->right.cx,
            rig->right.cy, 100 * report->focal_sigma);
        printf("baseline %.2f mm, standard deviation %.2f mm\n", 1000 * report->baseline_m,
               1000 * report->baseline_sigma_m);
        return OK;
    }
    struct json *root = json_new_object();
    static const char *const sides[2] = {"left", "right"};
    json_add_number(root, "pairs", pairs);
    json_add_number(root, "pairs_used", report->views);
    for (int i = 0; i < 2; i++) {
        const struct lens *l = i ? &rig->right : &rig->left;
        struct json *camera = json_add_object(root, sides[i]);
        json_add_number(camera, "boards", report->boards[i]);
        json_add_number(camera, "circles", report->circles[i]);
        json_add_number(camera, "rms_px", report->rms_px[i]);
        json_add_number(camera, "max_px", report->max_px[i]);
        json_add_number(camera, "fx", l->fx);
        json_add_number(camera, "fy", l->fy);
        json_add_number(camera, "cx", l->cx);
        json_add_number(camera, "cy", l->cy);
    }
    json_add_number(root, "baseline_m", report->baseline_m);
    json_add_number(root, "baseline_sigma_m", report->baseline_sigma_m);
    json_add_number(root, "focal_sigma", report->focal_sigma);
    json_add_number(root, "pairs_left_out", report->left_out);
    json_add_string(root, "warning", report->warning);
    return command_print_json(&root);
}

const struct argp calibrate_stereo_argp = {
    options,
    parse_option,
    "--stereo DIR [--out RIG.json]",
    "Calibrate two cameras that are fixed to each other.\v"
    "Hold a flat board of dark circles before both cameras, near and far, turned to each side, into "
    "the pictures' corners; six pairs or more. The whole board must be seen by both in one at least.",
    NULL,
    NULL,
    NULL};

int capture_calibrate_stereo(int argc, char **argv)
{
    struct stereo_arguments a = {0};
    command_parse(&calibrate_stereo_argp, argc, argv, &a);
    struct stereo_rig rig;
    struct stereo_report report;
    int pairs = 0;
    enum status status = a.out ? file_check_output(a.out, a.force) : OK;
    if (status == OK)
        status = stereo_calibrate_folder(a.folder, &rig, &report, &pairs);
    if (status == OK && *report.warning)
        fprintf(stderr, "%s: warning: %s\n", argv[0], report.warning);
    if (status == OK && a.out) {
        char *text = stereo_rig_print(&rig);
        status = text ? file_write(a.out, text, strlen(text)) : fail(ERR_MEMORY, "no memory to write %s", a.out);
        free(text);
    }
    if (status == OK)
        status = print_report(&rig, &report, pairs, a.json);
    return status == OK ? 0 : command_failed(argv[0]);
}
