// reenact-capture library DIR: the takes of all recordings in a folder.
#include "app/commands/commands.h"
#include "app/commands/take_summary.h"
#include "base/text.h"
#include "capture/take_verdict.h"
#include "platform/files/file.h"
#include "platform/files/json.h"

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { THUMBNAIL_HEIGHT = 120, FILES_MAX = 100000, OPEN_FOLDERS = 16 };

struct library_arguments {
    const char *folder, *html;
    bool json, force;
};

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct library_arguments *a = state->input;
    switch (key) {
    case COMMAND_KEY: a->json = true; return 0;
    case COMMAND_KEY + 1: a->html = value; return 0;
    case COMMAND_KEY + 2: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->folder, value); return 0;
    case ARGP_KEY_END: command_require(state, a->folder, "DIR"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// ------------------------------------------------------------- the files

// nftw has no context: one search at a time, on the main thread.
static struct {
    char **paths;
    int count;
    bool out_of_memory;
} found;

static int add_file(const char *path, const struct stat *about, int kind, struct FTW *at)
{
    static const char ending[] = ".reenact";
    const size_t length = strlen(path);
    (void)about;
    (void)at;
    if (kind != FTW_F || length < sizeof ending || strcmp(path + length - (sizeof ending - 1), ending) ||
        found.count >= FILES_MAX)
        return 0;
    char **grown = realloc(found.paths, sizeof *grown * ((size_t)found.count + 1)), *copy = strdup(path);
    if (grown)
        found.paths = grown;
    if (!grown || !copy) {
        free(copy);
        found.out_of_memory = true;
        return 1;
    }
    grown[found.count++] = copy;
    return 0;
}

static int by_name(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

static enum status find_files(const char *folder)
{
    if (!file_exists(folder))
        return fail(ERR_MISSING, "there is no folder %s", folder);
    nftw(folder, add_file, OPEN_FOLDERS, FTW_PHYS);
    if (found.out_of_memory)
        return fail(ERR_MEMORY, "no memory to list %s", folder);
    if (found.count)
        qsort(found.paths, (size_t)found.count, sizeof *found.paths, by_name);
    return OK;
}

// ------------------------------------------------------------- output

static enum status put_row(FILE *html, struct take *take, const char *file, const struct take_summary *summary,
                           const struct take_verdict *verdict)
{
    char text[VERDICT_TEXT_BYTES];
    uint8_t *jpeg = NULL;
    size_t bytes = 0;
    enum status status = take_thumbnail(take, THUMBNAIL_HEIGHT, &jpeg, &bytes);
    if (status < 0)
        return status;
    fputs("<tr><td>", html);
    if (status == OK) {
        fputs("<img alt=\"\" src=\"data:image/jpeg;base64,", html);
        html_put_base64(html, jpeg, bytes);
        fputs("\">", html);
    }
    free(jpeg);
    fputs("<td><b>", html);
    html_put_text(html, summary->name);
    fputs("</b><br>", html);
    html_put_text(html, file);
    fprintf(html, "<td>%.1f s<br>%lld frames<td>", summary->duration_s, (long long)summary->frames);
    html_put_text(html, verdict_text(verdict, text));
    fputs("<td>", html);
    html_put_text(html, summary->alias);
    if (*summary->alias && *summary->note)
        fputs("<br>", html);
    html_put_text(html, summary->note);
    fputs("</tr>\n", html);
    return OK;
}

static void print_take(const struct take_summary *summary, const struct take_verdict *verdict)
{
    enum { NAME = 24 };
    char text[VERDICT_TEXT_BYTES];
    const int length = text_length(summary->name);
    printf("  %s%*s %7.1f s  %s", summary->name, length < NAME ? NAME - length : 0, "", summary->duration_s,
           verdict_text(verdict, text));
    if (*summary->alias)
        printf("  [%s]", summary->alias);
    if (*summary->note)
        printf("  \"%s\"", summary->note);
    putchar('\n');
}

static void add_take(struct json *list, const char *file, const struct take_summary *summary,
                     const struct take_verdict *verdict)
{
    char text[VERDICT_TEXT_BYTES];
    struct json *take = json_add_object(list, NULL);
    json_add_string(take, "file", file);
    json_add_string(take, "take", summary->name);
    json_add_number(take, "duration_s", summary->duration_s);
    json_add_number(take, "frames", (double)summary->frames);
    json_add_string(take, "quality", verdict_text(verdict, text));
    verdict_add_json(take, verdict);
    json_add_string(take, "alias", summary->alias);
    json_add_string(take, "note", summary->note);
}

// ------------------------------------------------------------- the command

// shown: its path, as a terminal can show it.
static enum status list_take(struct recording *recording, const char *shown, int index, struct json *list, FILE *html)
{
    struct take *take;
    struct take_verdict verdict;
    enum status status = take_verdict_get(recording, recording_take_name(recording, index), NULL, &verdict);
    if (status == OK)
        status = take_open_drawn(&take, recording, recording_take_name(recording, index));
    if (status != OK)
        return status;
    struct take_summary s = take_summarize(take, recording_take_name(recording, index));
    if (list)
        add_take(list, shown, &s, &verdict);
    else
        print_take(&s, &verdict);
    if (html)
        status = put_row(html, take, shown, &s, &verdict);
    take_close(&take);
    return status;
}

static enum status list_file(const char *program, const char *path, struct json *list, FILE *html)
{
    struct recording *r;
    char *shown = strdup(path);
    if (!shown)
        return fail(ERR_MEMORY, "no memory to list %s", path);
    text_make_printable(shown);
    enum status status = recording_open(&r, path);
    if (status == OK) {
        if (!list)
            printf("%s%s\n", shown, recording_take_count(r) ? "" : ": no take");
        for (int i = 0; i < recording_take_count(r) && status != ERR_MEMORY; i++) {
            status = list_take(r, shown, i, list, html);
            if (status < 0)
                fprintf(stderr, "%s: warning: %s\n", program, status_message());
        }
        recording_free(&r);
    } else {
        fprintf(stderr, "%s: warning: %s\n", program, status_message()); // one bad file costs itself alone
    }
    free(shown);
    return status == ERR_MEMORY ? status : OK;
}

static enum status list_all(const char *program, const struct library_arguments *arguments, struct json *list,
                            FILE *html)
{
    enum status status = find_files(arguments->folder);
    if (html)
        fputs("<!doctype html><meta charset=\"utf-8\"><title>Takes</title><style>body{font:15px sans-serif;margin:2em}"
              "td{padding:.4em 1em;vertical-align:middle;border-top:1px solid #ccc}img{display:block;height:120px}"
              "</style><table>\n",
              html);
    for (int i = 0; i < found.count && status == OK; i++)
        status = list_file(program, found.paths[i], list, html);
    if (html)
        fputs("</table>\n", html);
    if (status == OK && !found.count && !list)
        printf("no recording (*.reenact) in %s\n", arguments->folder);
    for (int i = 0; i < found.count; i++)
        free(found.paths[i]);
    free(found.paths);
    return status;
}

int capture_library(int argc, char **argv)
{
    static const struct argp_option options[] = {
        COMMAND_OPTION_JSON(COMMAND_KEY),
        {"html", COMMAND_KEY + 1, "FILE", 0, "also write a page with a picture of each take", 0},
        COMMAND_OPTION_FORCE(COMMAND_KEY + 2),
        {0},
    };
    static const struct argp argp = {
        options, parse_option,
        "DIR",   "Lists the takes of all recordings (*.reenact) in a folder and those below it.",
        0,       0,
        0};
    struct library_arguments a = {0};
    command_parse(&argp, argc, argv, &a);
    char *page = NULL;
    size_t bytes = 0;
    FILE *html = NULL;
    struct json *root = NULL, *list = NULL;
    enum status status = a.html ? file_check_output(a.html, a.force) : OK;
    if (status == OK && a.json)
        status = command_begin_json(&root);
    if (status == OK && a.json && !(list = json_add_array(root, "takes")))
        status = fail(ERR_MEMORY, "no memory to list the takes");
    if (status == OK && a.html && !(html = open_memstream(&page, &bytes)))
        status = fail(ERR_MEMORY, "no memory for a page");
    if (status == OK)
        status = list_all(argv[0], &a, list, html);
    if (html && (fclose(html) || !page) && status == OK)
        status = fail(ERR_MEMORY, "no memory for a page");
    if (status == OK && a.html)
        status = file_write(a.html, page, bytes);
    if (status == OK && root)
        status = command_print_json(&root);
    json_free(&root);
    free(page);
    return status == OK ? 0 : command_failed(argv[0]);
}
