// reenact-capture tags: tags to print, and the list of them that `map` reads.
#include "app/commands/commands.h"
#include "capture/calibration/printed_tags.h"
#include "platform/files/file.h"
#include "platform/vision/tag_detector.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct tags_arguments {
    const char *out, *ids;
    double side_mm;
    int paper;
    bool force;
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct tags_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->out = value; return 0;
    case COMMAND_KEY + 1: a->ids = value; return 0;
    case COMMAND_KEY + 2:
        a->side_mm = command_parse_number(state, "--side", value, PRINTED_SIDE_MIN_M * 1e3, PRINTED_SIDE_MAX_M * 1e3);
        return 0;
    case COMMAND_KEY + 3:
        a->paper = command_parse_choice(state, "--paper", value, paper_names, COUNT_OF(paper_names));
        return 0;
    case COMMAND_KEY + 4: a->force = true; return 0;
    case ARGP_KEY_ARG: command_refuse_argument(state, value); return 0;
    case ARGP_KEY_END: command_require(state, a->out, "--out FILE.pdf"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// "0-5,8" into numbers, in that order. ERR_INPUT.
static enum status parse_ids(const char *text, int32_t out[TAG_ID_COUNT], int *count)
{
    const char *at = text;
    *count = 0;
    while (*at) {
        char *end;
        if (!isdigit((unsigned char)*at))
            break;
        long from = strtol(at, &end, 10), to = from;
        at = end;
        if (*at == '-') {
            if (!isdigit((unsigned char)at[1]))
                break;
            to = strtol(at + 1, &end, 10);
            at = end;
        }
        if (from < 0 || to < from || to >= TAG_ID_COUNT)
            return fail(ERR_INPUT, "--ids %s: tag36h11 has the numbers 0 to %d", text, TAG_ID_COUNT - 1);
        for (long id = from; id <= to; id++) {
            if (*count == TAG_ID_COUNT)
                return fail(ERR_INPUT, "--ids %s names a tag twice", text);
            out[(*count)++] = (int32_t)id;
        }
        if (*at != ',')
            break;
        at++;
    }
    return *at || !*count ? fail(ERR_INPUT, "--ids %s: write numbers and ranges, as in 0-5,8", text) : OK;
}

// "x/tags.pdf" to "x/tags.json". ERR_INPUT: another ending.
static enum status list_path(const char *pdf, char *out, size_t capacity)
{
    size_t length = strlen(pdf);
    if (length < 5 || strcmp(pdf + length - 4, ".pdf"))
        return fail(ERR_INPUT, "%s: the name of the pages must end in .pdf; the list goes beside them as .json", pdf);
    if (length + 2 > capacity)
        return fail(ERR_INPUT, "the path is too long");
    snprintf(out, capacity, "%.*s.json", (int)length - 4, pdf);
    return OK;
}

static enum status write_all(const struct printed_tags *wanted, const struct tags_arguments *arguments)
{
    struct page *page;
    char *text = NULL, list[1024];
    const struct paper_size size = paper_size(wanted->paper);
    enum status status = list_path(arguments->out, list, sizeof list);
    if (status == OK)
        status = file_check_output(arguments->out, arguments->force);
    if (status == OK)
        status = file_check_output(list, arguments->force);
    if (status == OK)
        status = page_open(&page, arguments->out, size.width_mm, size.height_mm, 0);
    if (status != OK)
        return status;
    status = printed_tags_draw(wanted, page);
    if (status == OK)
        status = page_finish(&page);
    page_discard(&page);
    if (status == OK)
        status = printed_tags_list(wanted, &text);
    if (status == OK)
        status = file_write(list, text, strlen(text));
    free(text);
    if (status == OK)
        printf("%s: %d tags of %g mm on %d pages; %s lists them for map --tags\n", arguments->out, wanted->count,
               wanted->side_m * 1e3, printed_tags_pages(wanted), list);
    return status;
}

int capture_tags(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"out", COMMAND_KEY, "FILE.pdf", 0, "the pages to make; FILE.json, the list of tags, goes beside them", 0},
        {"ids", COMMAND_KEY + 1, "LIST", 0, "numbers of tag36h11, as in 0-5,8 (default 0-5)", 0},
        {"side", COMMAND_KEY + 2, "MM", 0, "outer edge of the black square, millimetres (default 150)", 0},
        {"paper", COMMAND_KEY + 3, "a4|letter", 0, "of the pages (default a4)", 0},
        {"force", COMMAND_KEY + 4, NULL, 0, "replace existing files", 0},
        {0},
    };
    static const struct argp argp = {
        options,
        parse_option,
        NULL,
        "Tags to print, and the list of them for map.\vPrint at 100 %, check the ruler at the foot of a page, cut at "
        "the marks (the white margin belongs to the tag) and hang the tags flat. A tag larger than the page comes in "
        "parts to be glued edge to edge on cardboard.",
        NULL,
        NULL,
        NULL};
    struct tags_arguments a = {.ids = "0-5", .side_mm = 150};
    int32_t ids[TAG_ID_COUNT];
    struct printed_tags wanted = {.ids = ids};
    command_parse(&argp, argc, argv, &a);
    wanted.side_m = a.side_mm * 1e-3;
    wanted.paper = (enum paper)a.paper;
    enum status status = parse_ids(a.ids, ids, &wanted.count);
    if (status == OK)
        status = write_all(&wanted, &a);
    return status == OK ? 0 : command_failed(argv[0]);
}
