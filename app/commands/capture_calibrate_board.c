// reenact-capture calibrate --board: what calibration needs on paper.
#include "app/commands/commands.h"
#include "capture/calibration/color_depth.h"
#include "capture/calibration/printed_tags.h"
#include "platform/files/output.h"

#include <stdio.h>
#include <string.h>

struct board_arguments {
    const char *out;
    int paper;
    bool discs, chequers, force;
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct board_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->out = value; return 0;
    case COMMAND_KEY + 1: a->discs = true; return 0;
    case COMMAND_KEY + 2:
        a->paper = command_parse_choice(state, "--paper", value, paper_names, COUNT_OF(paper_names));
        return 0;
    case COMMAND_KEY + 3: a->force = true; return 0;
    case COMMAND_KEY + 4: a->chequers = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option options[] = {
    {"board", COMMAND_KEY, "FILE.pdf", 0, "the page to make: a board of circles, for --lens", 0},
    {"discs", COMMAND_KEY + 1, NULL, 0, "instead the black discs for --color-depth, to be cut out", 0},
    {"chequers", COMMAND_KEY + 4, NULL, 0, "instead a board of chequers, for --lens", 0},
    {"paper", COMMAND_KEY + 2, "a4|letter", 0, "of the page (default a4)", 0},
    {"force", COMMAND_KEY + 3, NULL, 0, "write over FILE.pdf", 0},
    {0},
};

const struct argp calibrate_board_argp = {
    options,
    parse_option,
    NULL,
    "Boards to print for calibration.\vThe discs are glued on blocks 5 cm high, and "
    "these on a white board, 4 across and "
    "3 down, 12 cm from middle to middle.",
    NULL,
    NULL,
    NULL};

int capture_calibrate_board(int argc, char **argv)
{
    struct board_arguments a = {0};
    struct page *page;
    command_parse(&calibrate_board_argp, argc, argv, &a);
    const enum paper paper = (enum paper)a.paper;
    const struct paper_size size = paper_size(paper);
    const struct disc_board discs = disc_board_default();
    enum status status = output_check(a.out, NULL, a.force);
    if (status == OK)
        status = page_open(&page, a.out, size.width_mm, size.height_mm, 0);
    if (status == OK) {
        if (a.discs)
            printed_discs_draw(paper, discs.columns * discs.rows, discs.radius_m, page);
        else if (a.chequers)
            printed_chequers_draw(paper, page);
        else
            printed_board_draw(paper, page);
        status = page_finish(&page);
    }
    if (status != OK)
        return command_failed(argv[0]);
    const struct stereo_board board = a.chequers ? printed_chequers(paper) : printed_board(paper);
    FILE *say = strcmp(a.out, "-") ? stdout : stderr;
    if (a.discs)
        fprintf(say, "%s: %d discs of %g mm across\n", a.out, discs.columns * discs.rows, discs.radius_m * 2e3);
    else
        fprintf(say, "%s: %d x %d %s, %g mm apart; calibrate --lens with --%s %dx%d\n", a.out, board.columns,
                board.rows, a.chequers ? "inner corners" : "circles", board.pitch_m * 1e3,
                a.chequers ? "chequers" : "circles", board.columns, board.rows);
    return 0;
}
