// reenact-bench: runs the stages and prints error and time side by side.
#include "app/commands/command.h"
#include "base/clock.h"
#include "platform/files/jpeg.h"
#include "tests/bench/bench_page.h"
#include "tests/bench/bench_sections.h"
#include "tests/bench/bench_stages.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct bench {
    const struct bench_inputs *inputs;
    struct bench_result result;
    struct bench_plain plain;
    struct bench_page page;
    bool reported;                       // the stage writes to the page itself
    const struct bench_section *section; // NULL: no page is made
};

double bench_clock_ms(void) { return (double)clock_cpu_ns() * 1e-6; }

double bench_all_threads_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

const struct bench_inputs *bench_inputs(const struct bench *b) { return b->inputs; }

int bench_count(const struct bench *b, int usual, double share)
{
    const int less = (int)(usual * share + 0.5);
    return !b->inputs->brief ? usual : less < 2 ? 2 : less;
}

const struct bench_page *bench_report_to(struct bench *b)
{
    b->reported = true;
    return &b->page;
}

void bench_picture(struct bench *b, const char *caption, const uint8_t *rgb, int width, int height)
{
    // A stage has the one table or the other.
    struct bench_shots *shots = b->plain.columns ? &b->plain.shots : &b->result.shots;
    if (!b->inputs->brief || shots->count == BENCH_PICTURES)
        return;
    struct bench_shot *shot = &shots->at[shots->count];
    *shot = (struct bench_shot){.width = width, .height = height};
    snprintf(shot->caption, sizeof shot->caption, "%s", caption);
    if (jpeg_encode(rgb, width, height, 85, &shot->jpeg, &shot->bytes) == OK)
        shots->count++;
}

// ------------------------------------------------------------- running

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double bench_percentile(double *values, int count, double share)
{
    if (!count)
        return NAN;
    qsort(values, (size_t)count, sizeof *values, ascending);
    double at = share * (count - 1);
    int low = (int)at, high = low + 1 < count ? low + 1 : low;
    return values[low] + (at - low) * (values[high] - values[low]);
}

// measures[(round * items + item) * count + contender]; error NaN: missed. group: only this one's items; -1: all.
struct measures {
    const struct bench_measure *all;
    int items, rounds;
    size_t count;
    const struct bench_groups *groups;
};

static void sum_up(struct bench_row *row, const struct measures *m, size_t contender, int group, double *scratch)
{
    const struct bench_measure *measures = m->all;
    int items = m->items, rounds = m->rounds, taken = 0, answered = 0;
    size_t count = m->count;
    double *times = scratch, *errors = scratch + items, *of_item = scratch + 2 * items;
    for (int i = 0; i < items; i++) {
        if (group >= 0 && m->groups->of_item[i] != group)
            continue;
        for (int r = 0; r < rounds; r++)
            of_item[r] = measures[((size_t)r * (size_t)items + (size_t)i) * count + contender].time_ms;
        times[taken++] = bench_percentile(of_item, rounds, 0.5);
        // All but the time is the same in each round.
        const struct bench_measure *of = &measures[(size_t)i * count + contender];
        if (isnan(of->error)) {
            row->missed++;
            continue;
        }
        errors[answered++] = of->error;
        for (int k = 0; k < BENCH_EXTRAS; k++)
            row->extra[k] += of->extra[k];
    }
    for (int k = 0; k < BENCH_EXTRAS; k++)
        row->extra[k] = answered ? row->extra[k] / answered : NAN;
    row->error = bench_percentile(errors, answered, 0.5);
    row->error_p95 = bench_percentile(errors, answered, 0.95);
    row->time_ms = bench_percentile(times, taken, 0.5);
    row->time_p95_ms = bench_percentile(times, taken, 0.95);
}

// The contender's median time in the rounds of one parity; NaN: there is no such round.
static double half_time(const struct measures *m, size_t contender, int parity, double *scratch)
{
    double *times = scratch, *of_item = scratch + 2 * m->items;
    for (int i = 0; i < m->items; i++) {
        int rounds = 0;
        for (int r = parity; r < m->rounds; r += 2)
            of_item[rounds++] = m->all[((size_t)r * (size_t)m->items + (size_t)i) * m->count + contender].time_ms;
        times[i] = bench_percentile(of_item, rounds, 0.5);
    }
    return m->rounds > 1 ? bench_percentile(times, m->items, 0.5) : NAN;
}

static void find_ratios(struct bench_result *r, const struct bench_contender *contenders, const struct measures *m,
                        double *scratch)
{
    size_t of_baseline = 0;
    for (size_t c = 0; c < m->count; c++)
        if (contenders[c].baseline)
            of_baseline = c;
    for (size_t k = 0; k < r->count; k++)
        for (int parity = 0; parity < 2; parity++)
            r->rows[k].ratio[parity] = r->rows[k].group
                                           ? NAN
                                           : half_time(m, k / (size_t)(1 + m->groups->count), parity, scratch) /
                                                 half_time(m, of_baseline, parity, scratch);
}

enum status bench_run(struct bench *b, const struct bench_contender *contenders, size_t count, int items)
{
    const struct bench_groups none = {0};
    return bench_run_grouped(b, contenders, count, items, &none);
}

enum status bench_run_grouped(struct bench *b, const struct bench_contender *contenders, size_t count, int items,
                              const struct bench_groups *groups)
{
    struct bench_result *result = &b->result;
    assert(!result->rows && count > 0 && items > 0);
    int rounds = result->rounds;
    size_t all = (size_t)rounds * (size_t)items * count;
    struct bench_measure *measures = calloc(all, sizeof *measures);
    double *scratch = calloc((size_t)(2 * items + rounds), sizeof *scratch);
    result->count = count * (size_t)(1 + groups->count);
    result->rows = calloc(result->count, sizeof *result->rows);
    result->items = items;
    enum status status = measures && scratch && result->rows ? OK : fail(ERR_MEMORY, "no memory for the bench");
    bool shown = isatty(STDERR_FILENO);
    for (size_t i = 0; status >= 0 && i < all; i++) {
        const struct bench_contender *c = &contenders[i % count];
        status = c->measure(c->self, (int)(i / count % (size_t)items), &measures[i]);
        if (status == NOTHING)
            measures[i].error = NAN;
        if (shown && i % count == 0)
            fprintf(stderr, "\r%s %zu/%zu ", result->stage->name, i / count + 1, all / count);
    }
    if (shown)
        fprintf(stderr, "\r\033[K");
    const struct measures done = {measures, items, rounds, count, groups};
    for (size_t k = 0; status >= 0 && k < result->count; k++) {
        struct bench_row *row = &result->rows[k];
        size_t contender = k / (size_t)(1 + groups->count);
        int group = (int)(k % (size_t)(1 + groups->count)) - 1;
        row->name = contenders[contender].name;
        row->group = group < 0 ? NULL : groups->names[group];
        row->baseline = contenders[contender].baseline && group < 0;
        row->usual = group < 0 && b->section && b->section->usual && !strcmp(row->name, b->section->usual);
        sum_up(row, &done, contender, group, scratch);
    }
    if (status >= 0)
        find_ratios(result, contenders, &done, scratch);
    free(measures);
    free(scratch);
    return status < 0 ? status : OK;
}

void bench_columns(struct bench *b, const char *const *names, size_t count)
{
    assert(!b->plain.columns && count > 0 && count <= BENCH_COLUMNS);
    b->plain.columns = count;
    memcpy(b->plain.column, names, count * sizeof *names);
}

enum status bench_add_row(struct bench *b, const char *name, const double *values)
{
    struct bench_plain *p = &b->plain;
    assert(p->columns);
    struct bench_plain_row *more = realloc(p->rows, (p->count + 1) * sizeof *more);
    if (!more)
        return fail(ERR_MEMORY, "no memory for the bench");
    p->rows = more;
    struct bench_plain_row *row = &p->rows[p->count++];
    snprintf(row->name, sizeof row->name, "%s", name);
    memcpy(row->value, values, p->columns * sizeof *values);
    return OK;
}

// ------------------------------------------------------------- the program

enum {
    KEY_HTML = 0x200,
    KEY_MOTIONS = 256,
    KEY_SEQUENCES,
    KEY_BODIES,
    KEY_JOINTS,
    KEY_PLOT,
    KEY_DICE,
    KEY_SEED,
    KEY_ONLY,
    KEY_SECONDS,
    KEY_THREADS,
    KEY_STRIP,
    KEY_DUMP,
    KEY_COLOR,
    KEY_FEATURES,
    KEY_POSTURES,
    KEY_EMPTY,
    KEY_ANSWERS,
};

struct bench_arguments {
    const char *stage, *html, *json_file;
    struct bench_inputs inputs;
    bool json;
    int rounds;
    int argc; // the command, for the page
    char **argv;
};

static double number_from(const char *argument, struct argp_state *state, double low, double high)
{
    char *end;
    double value = strtod(argument, &end);
    if (*end || end == argument || !(value >= low && value <= high))
        argp_error(state, "'%s' is not a number from %g to %g", argument, low, high);
    return value;
}

static error_t parse_dice(int key, char *argument, struct argp_state *state, struct bench_dice *dice)
{
    switch (key) {
    case KEY_DICE: dice->films = (int)number_from(argument, state, 1, 100000); return 0;
    case KEY_SEED: dice->seed = (uint64_t)number_from(argument, state, 0, 1e15); return 0;
    case KEY_ONLY: dice->only = (int)number_from(argument, state, 0, 1e9); return 0;
    case KEY_SECONDS: dice->seconds = number_from(argument, state, 0.1, 20); return 0;
    case KEY_THREADS: dice->threads = (int)number_from(argument, state, 1, 16); return 0;
    case KEY_STRIP: dice->strip = argument; return 0;
    case KEY_DUMP: dice->dump = argument; return 0;
    case KEY_COLOR: dice->color = true; return 0;
    case KEY_FEATURES: dice->features = argument; return 0;
    case KEY_POSTURES: dice->postures = true; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static void check_together(const struct bench_arguments *a, struct argp_state *state)
{
    const struct bench_inputs *in = &a->inputs;
    const bool dice = in->dice.films > 0;
    const bool attempts = a->stage && (!strcmp(a->stage, "attempts") || !strcmp(a->stage, "judging"));
    const int skeleton = (in->motions || dice) + !!in->joints + !!in->sequences + in->bodies + !!in->empty.count;
    if (!!in->data + skeleton > 1)
        argp_error(state, "one of --data, --motions, --dice, --bodies, --joints, --sequences and --empty at a time; "
                          "but --dice with --motions");
    if (skeleton && !attempts && (!a->stage || strcmp(a->stage, "skeleton")))
        argp_error(state, "--motions, --dice, --bodies, --joints, --sequences and --empty are the skeleton stage's; "
                          "--motions and --dice those of attempts and judging, too");
    if (attempts && (in->data || in->bodies || in->joints || in->sequences || in->empty.count || in->dice.color ||
                     in->dice.strip || in->dice.features))
        argp_error(state, "of the films' options the attempts stage has --motions, --dice, --seed, --only, --seconds, "
                          "--threads and --dump");
    if (!dice && !attempts &&
        (in->dice.only >= 0 || in->dice.color || in->dice.strip || in->dice.dump || in->dice.features))
        argp_error(state, "--only, --color, --strip, --dump and --features go with --dice");
    if (in->dice.postures && (!dice || attempts || in->motions))
        argp_error(state, "--postures goes with --dice of the skeleton stage, without --motions");
    if (in->answers && (!a->stage || strcmp(a->stage, "stability")))
        argp_error(state, "--answers is the stability stage's");
    if (in->plot && (!a->stage || strcmp(a->stage, "levels")))
        argp_error(state, "--plot is the levels stage's");
}

static error_t parse(int key, char *argument, struct argp_state *state)
{
    struct bench_arguments *a = state->input;
    char *end;
    switch (key) {
    case 'j':
        a->json = a->inputs.json = true;
        a->json_file = argument;
        return 0;
    case KEY_ANSWERS: a->inputs.answers = argument; return 0;
    case KEY_HTML: a->html = argument; return 0;
    case 'd': a->inputs.data = argument; return 0;
    case KEY_MOTIONS: a->inputs.motions = argument; return 0;
    case KEY_SEQUENCES: a->inputs.sequences = argument; return 0;
    case KEY_JOINTS: a->inputs.joints = argument; return 0;
    case KEY_EMPTY:
        if (a->inputs.empty.count == BENCH_FOLDERS)
            argp_error(state, "--empty at most %d times", BENCH_FOLDERS);
        a->inputs.empty.path[a->inputs.empty.count++] = argument;
        return 0;
    case KEY_BODIES: a->inputs.bodies = true; return 0;
    case KEY_PLOT: a->inputs.plot = argument; return 0;
    case 'r':
        a->rounds = (int)strtol(argument, &end, 10);
        if (*end || a->rounds < 1 || a->rounds > 1000)
            argp_error(state, "--rounds is a number from 1 to 1000, not '%s'", argument);
        return 0;
    case ARGP_KEY_ARG:
        if (a->stage)
            argp_error(state, "one STAGE at a time, or none with --html or --json for all");
        a->stage = argument;
        return 0;
    case ARGP_KEY_END: check_together(a, state); return 0;
    default: return parse_dice(key, argument, state, &a->inputs.dice);
    }
}

static char *list_stages(int key, const char *text, void *input)
{
    (void)input;
    if (key != ARGP_KEY_HELP_POST_DOC)
        return (char *)(uintptr_t)text; // argp's convention: the same pointer means unchanged
    size_t bytes = 32;
    for (size_t i = 0; i < COUNT_OF(bench_stages); i++)
        bytes += strlen(bench_stages[i]->name) + strlen(bench_stages[i]->about) + 8;
    char *list = malloc(bytes);
    size_t used = list ? (size_t)sprintf(list, "Stages:\n") : 0;
    for (size_t i = 0; list && i < COUNT_OF(bench_stages); i++)
        used += (size_t)sprintf(list + used, "  %s: %s\n", bench_stages[i]->name, bench_stages[i]->about);
    return list; // argp frees it
}

// One stage, as text or as JSON.
static enum status run_stage(const struct bench_arguments *a, const struct bench_stage *stage, struct json *stages)
{
    struct bench b = {.inputs = &a->inputs,
                      .result = {.stage = stage, .rounds = a->rounds},
                      .plain = {.stage = stage},
                      .page = {NULL, stages}};
    const enum status status = stage->run(&b);
    if (status == OK && b.plain.columns) {
        if (stages)
            bench_add_plain_json(stages, &b.plain);
        else
            bench_print_plain(&b.plain);
    } else if (status == OK && !b.reported) {
        if (stages)
            bench_add_json(stages, &b.result);
        else
            bench_print_table(&b.result);
    }
    if (status < 0)
        fprintf(stderr, "reenact-bench: %s: %s\n", stage->name, status_message());
    bench_result_free(&b.result);
    bench_plain_free(&b.plain);
    return status;
}

// All stages that the page has, briefly; their results are kept for what several of them together say.
static enum status run_section(const struct bench_arguments *a, const struct bench_section *section,
                               struct json *stages, struct bench_whole *whole, struct bench_result *result)
{
    struct bench b = {.inputs = &a->inputs,
                      .result = {.stage = section->stage, .rounds = a->rounds},
                      .plain = {.stage = section->stage},
                      .section = section};
    const double from_s = (double)clock_now_ns() * 1e-9;
    const enum status status = section->stage->run(&b);
    b.result.took_s = (double)clock_now_ns() * 1e-9 - from_s;
    fprintf(stderr, "reenact-bench: %-12s %6.1f s%s%s\n", section->stage->name, b.result.took_s,
            status == OK ? "" : ": ", status == OK ? "" : status_message());
    if (status != OK || b.plain.columns)
        bench_result_free(&b.result);
    if (status == OK && b.plain.columns) {
        assert(whole->plain_count < BENCH_PLAINS);
        whole->plain[whole->plain_count] = b.plain;
        whole->plain_section[whole->plain_count++] = section;
    } else if (status == OK) {
        if (stages)
            bench_add_json(stages, &b.result);
        *result = b.result;
        whole->count++;
    } else {
        bench_plain_free(&b.plain);
    }
    return status;
}

// All stages that the page has, briefly; their results are kept for what several of them together say.
static int run_page(struct bench_arguments *a, struct json *stages)
{
    enum { SECTIONS = COUNT_OF(bench_sections) };
    struct bench_result results[SECTIONS] = {{0}};
    const struct bench_section *sections[SECTIONS] = {NULL};
    struct bench_whole whole = {.results = results, .sections = sections, .argc = a->argc, .argv = a->argv};
    const double begun_s = (double)clock_now_ns() * 1e-9;
    enum status status = OK;
    a->inputs.brief = true;
    for (int i = 0; i < SECTIONS && status == OK; i++) {
        const struct bench_section *section = &bench_sections[i];
        const int at = whole.count;
        if (a->stage && strcmp(a->stage, section->stage->name))
            continue;
        sections[at] = section;
        status = run_section(a, section, stages, &whole, &results[at]);
    }
    FILE *html = status == OK && a->html ? fopen(a->html, "w") : NULL;
    if (status == OK && a->html && !html)
        status = fail(ERR_IO, "%s cannot be written", a->html);
    const struct bench_page page = {html, stages};
    if (status == OK)
        status = bench_put_whole(&page, &whole, begun_s);
    if (html && fclose(html) && status == OK)
        status = fail(ERR_IO, "%s could not be written", a->html);
    if (status != OK)
        fprintf(stderr, "reenact-bench: %s\n", status_message());
    for (int i = 0; i < SECTIONS; i++)
        bench_result_free(&results[i]);
    for (int i = 0; i < whole.plain_count; i++)
        bench_plain_free(&whole.plain[i]);
    return status != OK;
}

static int write_json(const struct bench_arguments *a, const struct json *root)
{
    char *text = json_print(root);
    FILE *file = a->json_file ? fopen(a->json_file, "w") : stdout;
    int code = !text || !file || fputs(text, file) < 0;
    if (file && file != stdout && fclose(file))
        code = 1;
    if (code)
        fprintf(stderr, "reenact-bench: the JSON could not be written\n");
    free(text);
    return code;
}

static bool is_on_page(const struct bench_stage *stage)
{
    bool is = false;
    for (size_t i = 0; i < COUNT_OF(bench_sections); i++)
        is = is || bench_sections[i].stage == stage;
    return is;
}

static void list_all(void)
{
    puts("reenact-bench STAGE runs one of these; --html FILE or --json=FILE runs all of them with a * for one page.\n");
    for (size_t i = 0; i < COUNT_OF(bench_stages); i++)
        printf("%c %-14s %s\n", is_on_page(bench_stages[i]) ? '*' : ' ', bench_stages[i]->name, bench_stages[i]->about);
}

int main(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"json", 'j', "FILE", OPTION_ARG_OPTIONAL, "Print one JSON object, or write it to FILE", 0},
        {"html", KEY_HTML, "FILE", 0, "Run every stage, or STAGE, briefly, and write a page about all of it", 0},
        {"data", 'd', "DIR", 0, "Use the images of this folder (TUM layout) instead of synthetic ones", 0},
        {"motions", KEY_MOTIONS, "DIR", 0, "skeleton, attempts: a figure moves by this folder's BVH files", 0},
        {"bodies", KEY_BODIES, NULL, 0, "skeleton: track figures of all sizes and clothes", 0},
        {"joints", KEY_JOINTS, "DIR", 0, "skeleton: joint by joint, next to this folder's truth", 0},
        {"sequences", KEY_SEQUENCES, "DIR", 0,
         "skeleton: track the people in this folder's folders, next to the Kinect SDK's joints", 0},
        {"empty", KEY_EMPTY, "DIR", 0,
         "skeleton: how many images of this folder, in which there is no person, are taken for one (repeatable)", 0},
        {"dice", KEY_DICE, "N", 0, "skeleton, attempts: N random films, with --motions of its BVH files too", 0},
        {"seed", KEY_SEED, "S", 0, "dice: of the films (1)", 0},
        {"only", KEY_ONLY, "I", 0, "dice: film I of this seed alone", 0},
        {"seconds", KEY_SECONDS, "T", 0, "dice: of a film, at most (5)", 0},
        {"threads", KEY_THREADS, "N", 0, "dice: films made at a time (2)", 0},
        {"color", KEY_COLOR, NULL, 0,
         "dice: also with points of the colour images (networks of reenact-capture models)", 0},
        {"strip", KEY_STRIP, "DIR", 0, "dice: draw images of the worst films, or of the only one, into this folder", 0},
        {"dump", KEY_DUMP, "FILE", 0,
         "dice: write each joint's error in each frame, as CSV; attempts: a folder for the joints of each film", 0},
        {"postures", KEY_POSTURES, NULL, 0,
         "dice: of people who sit (the chair is not there), kneel, lie, are on all fours or prop themselves up", 0},
        {"features", KEY_FEATURES, "FILE", 0, "dice: write what errors are judged by, for tools/calibrate_joint_error",
         0},
        {"answers", KEY_ANSWERS, "FILE", 0, "stability: also store the answers that the test compares with", 0},
        {"plot", KEY_PLOT, "FILE", 0, "levels: also draw error against time, as an SVG", 0},
        {"rounds", 'r', "N", 0, "Number of rounds; the median counts (5)", 0},
        {0},
    };
    static const struct argp argp = {.options = options,
                                     .parser = parse,
                                     .args_doc = "[STAGE]",
                                     .doc = "Measures error against time, next to what a user would take instead.\v ",
                                     .help_filter = list_stages};
    argp_err_exit_status = 2;
    struct bench_arguments a = {
        .rounds = 0,
        .argc = argc,
        .argv = argv,
        .inputs.dice = {.seed = 1, .only = -1, .seconds = 5, .threads = 2},
    };
    command_parse(&argp, argc, argv, &a);
    const struct bench_stage *stage = NULL;
    for (size_t i = 0; i < COUNT_OF(bench_stages) && a.stage; i++)
        if (!strcmp(a.stage, bench_stages[i]->name))
            stage = bench_stages[i];
    if (a.stage && !stage) {
        fprintf(stderr, "reenact-bench: there is no stage '%s'; without arguments it lists them\n", a.stage);
        return 2;
    }
    const bool whole = a.html || (!a.stage && a.json);
    if (!stage && !whole) {
        list_all();
        return 0;
    }
    if (!a.rounds)
        a.rounds = whole ? 2 : 5;
    struct json *root = a.json ? json_new_object() : NULL, *stages = root ? json_add_array(root, "stages") : NULL;
    int code = whole ? run_page(&a, stages) : run_stage(&a, stage, stages) != OK;
    if (root && !code)
        code = write_json(&a, root);
    json_free(&root);
    return code;
}
