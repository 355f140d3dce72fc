// One allocation or one call of SQLite fails: every command says a sentence and ends with exit code 1, or does its work
// all the same, and then as well as ever; none crashes, hangs or leaks, and no recording is damaged or changed.
//
// What fails is a call from a site (a call stack, tests/support/fail_sites.h): its first, and one of its later ones.
//
// test_failing_calls                      a few sites of each kind and command, drawn at random
// test_failing_calls SECONDS              for that long each command and kind, until all have failed
// test_failing_calls SECONDS COMMAND SEED KIND     of one command ("record"), by that seed, of one kind ("alloc")
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/json.h"
#include "recording/recording.h"
#include "tests/support/copy_file.h"
#include "tests/support/process.h"
#include "tests/support/recording_hash.h"
#include "tests/support/rehearsal.h"
#include "tests/support/sql.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { ARGUMENTS_MAX = 16 };

struct command {
    const char *before;     // the recording that `made` is a copy of when it starts; NULL: there is no `made`
    bool saves_what_it_can; // of a disk that fails
    const char *argv[ARGUMENTS_MAX];
};

enum { USUALLY = SANITIZED ? 1 : 2 }; // calls of a kind

struct site {
    char number[20], stack[512];
    long calls, blocks; // how many calls; blocks of memory that were not freed at the end
};

struct sites {
    int count;
    bool failed; // a call was made to fail
    struct site *at;
};

static double seconds = 0;
static const char *only, *only_kind;
static int defects;
static uint64_t seed = 20261125;
static struct rehearsal rehearsal;
static char made[512], counted[512], folder[512], damaged[512];

// Runs it with the site's turn-th call failing; site NULL: none.
static struct process_result run(const char *const *argv, const char *kind, const struct site *site, long turn)
{
    char text[32];
    snprintf(text, sizeof text, "%ld", turn);
    setenv("LD_PRELOAD", FAIL_CALLS, 1);
    setenv("MALLOC_PERTURB_", "165", 1); // glibc: what is not set, or was freed, holds no zeros and no old values
    setenv("FAIL_CALL", kind, 1);
    setenv("FAIL_SITE", site ? site->number : "0", 1);
    setenv("FAIL_TURN", text, 1);
    setenv("FAIL_COUNT", counted, 1);
    remove(counted);
    struct process_result said = process_run(argv);
    if (strstr(said.err, "Sanitizer") || strstr(said.err, "runtime error:"))
        said.exit_code = -1; // what it found is no sentence
    unsetenv("LD_PRELOAD");
    unsetenv("MALLOC_PERTURB_");
    return said;
}

// What the last run wrote; nothing of one that was killed. The caller frees .at.
static struct sites sites_read(void)
{
    struct sites sites = {0};
    char line[1024];
    FILE *file = fopen(counted, "r");
    if (!file)
        return sites;
    sites.failed = fgets(line, sizeof line, file) && atoi(line) == 1;
    while (fgets(line, sizeof line, file)) {
        sites.at = realloc(sites.at, (size_t)(sites.count + 1) * sizeof *sites.at);
        struct site *s = &sites.at[sites.count++];
        memset(s, 0, sizeof *s);
        sscanf(line, "%19s %ld %ld %511[^\n]", s->number, &s->calls, &s->blocks, s->stack);
    }
    fclose(file);
    return sites;
}

static void prepare_made(const struct command *command)
{
    char remove[600];
    recording_discard(made);
    snprintf(remove, sizeof remove, "rm -rf %s", folder);
    EXPECT_INT(system(remove), 0);
    if (command->before)
        copy_file(command->before, made);
}

// What the command makes: a recording, or a file, or pictures, or else what it says.
struct product {
    bool there, sound;
    uint64_t hash;
    uint64_t said; // hash of what was printed
};

static uint64_t mix_file(uint64_t hash, const char *path)
{
    uint8_t *bytes;
    size_t size;
    EXPECT_STATUS(file_read(path, &bytes, &size), OK);
    hash = mix(hash, bytes, size);
    free(bytes);
    return hash;
}

// Of the members' names: times are another every time.
static uint64_t mix_names(uint64_t hash, const struct json *value)
{
    for (const struct json *m = json_first(value); m; m = json_next(m))
        hash = mix_names(mix(hash, json_name(m), strlen(json_name(m))), m);
    return hash;
}

static uint64_t pictures_hash(void)
{
    uint64_t hash = 0;
    char path[600];
    struct json *stats = NULL;
    for (int i = 0; i < REHEARSAL_IMAGES; i++) {
        snprintf(path, sizeof path, "%s/%04d.png", folder, i);
        hash = file_exists(path) ? mix_file(hash, path) : mix(hash, "none", 4);
    }
    snprintf(path, sizeof path, "%s/stats.json", folder);
    if (json_read(path, &stats) == OK)
        hash = mix_names(hash, stats);
    json_free(&stats);
    return hash;
}

// Of the take that no command changes.
static uint64_t kept_take_hash(const char *path)
{
    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    const uint64_t hash = mix_take(0, r, "turn");
    recording_free(&r);
    return hash;
}

static struct product product_of(const struct command *command, const char *what, const struct process_result *said)
{
    struct product p = {.there = file_exists(made), .sound = true, .said = mix(0, said->out, strlen(said->out))};
    struct recording_report report;
    if (!p.there) {
        p.hash = file_exists(folder) ? pictures_hash() : p.said;
        return p;
    }
    const enum status status = recording_verify(made, &report);
    p.sound = status == OK || status == ERR_FORMAT; // what was written until then is sound, or it is no recording
    if (!p.sound)
        print_error("%s: what it left is damaged: %s\n", what, status_message());
    else if (command->before && !(p.sound = kept_take_hash(made) == kept_take_hash(command->before)))
        print_error("%s: it changed another take\n", what);
    else if (said->exit_code == 0)
        p.hash = status == OK ? hash_of(made) : mix_file(0, made);
    return p;
}

static bool product_equal(const struct product *a, const struct product *b)
{
    return a->there == b->there && a->hash == b->hash;
}

struct tally {
    int clean, same, missed; // missed: threads took turns in another order, and no call failed
};

// A call that shall fail.
struct failing {
    const struct site *site;
    long turn;
};

static void look_for_leaks(const char *what, const struct sites *sites, const struct sites *whole)
{
    for (int i = 0; i < sites->count; i++) {
        const struct site *s = &sites->at[i];
        long usual = 0;
        for (int k = 0; k < whole->count && !usual && s->blocks; k++)
            usual = strcmp(whole->at[k].number, s->number) ? 0 : whole->at[k].blocks;
        if (s->blocks > usual) {
            print_error("%s: %ld blocks leak, taken by %s\n", what, s->blocks, s->stack);
            defects++;
        }
    }
}

static void fail_one(const struct command *command, const char *kind, const struct failing *call,
                     const struct product *whole, const struct sites *usual, struct tally *tally)
{
    char what[700];
    snprintf(what, sizeof what, "%s, %s %s, turn %ld (%s)", command->argv[1], kind, call->site->number, call->turn,
             call->site->stack);
    prepare_made(command);
    const struct process_result said = run(command->argv, kind, call->site, call->turn);
    const struct product left = product_of(command, what, &said);
    const size_t length = strlen(said.err);
    const bool sentence = length > 20 && said.err[length - 1] == '\n' && !strstr(said.err, "(null)");
    struct sites sites = sites_read();
    if (said.exit_code == 0 && product_equal(&left, whole)) {
        tally->same += sites.failed;
        tally->missed += !sites.failed;
    } else if (said.exit_code == 1 && sentence) {
        tally->clean++;
    } else if (said.exit_code == 0 && command->saves_what_it_can && left.said != whole->said) {
        tally->clean++; // it said that it lost something

    } else {
        print_error("%s: exit code %d, '%s'%s\n", what, said.exit_code, said.err,
                    said.exit_code == 0 ? ", and what it made is not as usual" : "");
        defects++;
    }
    defects += !left.sound;
    look_for_leaks(what, &sites, usual);
    free(sites.at);
}

// Fisher and Yates.
static void shuffle(struct failing *calls, int count, struct rng *rng)
{
    for (int i = 0; i < count; i++) {
        const int at = (int)(rng_uniform(rng) * (double)(i + 1));
        const struct failing moved = calls[i];
        calls[i] = calls[at];
        calls[at] = moved;
    }
}

// The sites' first calls in random order, then one later call of each that makes more.
static struct failing *calls_of(const struct sites *sites, int *count, struct rng *rng)
{
    struct failing *calls = malloc(2 * (size_t)sites->count * sizeof *calls + 1);
    *count = sites->count;
    for (int i = 0; i < sites->count; i++) {
        const struct site *s = &sites->at[i];
        calls[i] = (struct failing){s, 1};
        if (s->calls > 1)
            calls[(*count)++] = (struct failing){s, 2 + (long)(rng_uniform(rng) * (double)(s->calls - 1))};
    }
    shuffle(calls, sites->count, rng);
    shuffle(calls + sites->count, *count - sites->count, rng);
    return calls;
}

// The calls that the command makes fail, one a run: USUALLY of them, or as many as the time allows.
static void fail_each(const struct command *command, const char *kind)
{
    const char *const *argv = command->argv;
    if ((only && strcmp(only, argv[1]) != 0) || (only_kind && strcmp(only_kind, kind) != 0))
        return;
    prepare_made(command);
    struct process_result said = run(argv, kind, NULL, 0);
    if (said.exit_code)
        print_error("%s %s: %s\n", argv[0], argv[1], said.err);
    EXPECT_INT(said.exit_code, 0);
    const struct product whole = product_of(command, argv[1], &said);
    struct sites sites = sites_read();
    struct rng rng = {seed};
    struct tally tally = {0};
    int count, done = 0;
    struct failing *calls = calls_of(&sites, &count, &rng);
    const int64_t until_ns = clock_now_ns() + (int64_t)(seconds * 1e9);
    for (; done < count && (seconds > 0 ? clock_now_ns() < until_ns : done < USUALLY); done++)
        fail_one(command, kind, &calls[done], &whole, &sites, &tally);
    print_message(
        "%-8s %-6s %d of %d calls from %d sites: %d ended with a sentence, %d did their work all the same, %d "
        "not reached\n",
        argv[1], kind, done, count, sites.count, tally.clean, tally.same, tally.missed);
    free(calls);
    free(sites.at);
}

// With sanitizers alloc or sqlite of some commands, in turn, and not the last ones, which take minutes there. What was
// taken with new is not told from a leak there, for their operator delete does not call free.
static bool is_tried(size_t command, size_t kind)
{
    return !SANITIZED || (command < 15 && kind != 1 && kind == command % 3);
}

static void test_commands(void **state)
{
    (void)state;
    char camera[600], sensor[600], tags[512];
    snprintf(camera, sizeof camera, "folder:%s", scratch_file(&rehearsal.scratch, "viewer"));
    snprintf(sensor, sizeof sensor, "folder:%s", scratch_file(&rehearsal.scratch, "sensor"));
    snprintf(tags, sizeof tags, "%s", scratch_file(&rehearsal.scratch, "tags.json"));
    const char *capture = PROGRAM_DIR "/reenact-capture", *reenact = PROGRAM_DIR "/reenact";
    const struct command commands[] = {
        {NULL,
         false,
         {capture, "record", "--sensor", sensor, "--out", made, "--take", "a", "--no-body-points", "--json", NULL}},
        {rehearsal.file, false, {capture, "record", "--sensor", sensor, "--into", made, "--take", "a", "--json", NULL}},
        {NULL, false, {capture, "verify", rehearsal.file, NULL}},
        {NULL, false, {capture, "verify", rehearsal.file, "--json", NULL}},
        {NULL, false, {capture, "info", rehearsal.file, NULL}},
        {NULL, false, {capture, "info", rehearsal.file, "--json", NULL}},
        {NULL, false, {capture, "export", rehearsal.file, "--take", "turn", "--as", "joints-csv", "--out", made, NULL}},
        {NULL, false, {capture, "export", rehearsal.file, "--take", "turn", "--as", "bvh", "--out", made, NULL}},
        {NULL, false, {capture, "export", rehearsal.file, "--take", "turn", "--as", "mcap", "--out", made, NULL}},
        {NULL, false, {capture, "take", "copy", rehearsal.file, "--take", "turn", "--into", made, NULL}},
        {rehearsal.file, false, {capture, "take", "rename", made, "--take", "once more", "--name", "again", NULL}},
        {rehearsal.file, false, {capture, "take", "trim", made, "--take", "once more", "--from", "0.05", NULL}},
        {rehearsal.file, false, {capture, "take", "delete", made, "--take", "once more", NULL}},
        {NULL, true, {capture, "repair", damaged, "--out", made, NULL}},
        {NULL, false, {capture, "map", "--sensor", sensor, "--tags", tags, "--out", made, "--json", NULL}},
        {NULL,
         false,
         {reenact, "render", rehearsal.file, "--take", "turn", "--camera", camera, "--detail", "paper", "--out", folder,
          NULL}},
        {NULL,
         false,
         {reenact, "render", rehearsal.file, "--take", "turn", "--camera", camera, "--detail", "full", "--out", folder,
          NULL}},
        {NULL,
         false,
         {reenact, "compare", rehearsal.file, "--take", "turn", "--with", rehearsal.file, "--with-take", "turn", NULL}},
        {NULL,
         false,
         {reenact, "compare", rehearsal.file, "--take", "turn", "--with", rehearsal.file, "--with-take", "turn",
          "--json", NULL}},
    };
    uint8_t *before, *after;
    size_t size, size_after;
    EXPECT_STATUS(file_read(rehearsal.file, &before, &size), OK);
    const char *const kinds[] = {"alloc", "new", "sqlite"};
    for (size_t i = 0; i < COUNT_OF(commands); i++)
        for (size_t k = 0; k < COUNT_OF(kinds); k++)
            if (seconds > 0 || is_tried(i, k))
                fail_each(&commands[i], kinds[k]);
    EXPECT_STATUS(file_read(rehearsal.file, &after, &size_after), OK);
    EXPECT_TRUE(size == size_after && !memcmp(before, after, size)); // none of them changes what it reads
    EXPECT_INT(defects, 0);
    free(before);
    free(after);
}

// tags.json of the recording's place.
static void write_tags(void)
{
    char text[4096] = "{\"family\": \"tag36h11\", \"side_m\": {";
    struct recording *r;
    struct place place;
    EXPECT_STATUS(recording_open(&r, rehearsal.file), OK);
    EXPECT_STATUS(recording_read_place(r, &place), OK);
    for (int32_t i = 0; i < place.tag_count; i++)
        sprintf(text + strlen(text), "%s\"%d\": %g", i ? ", " : "", (int)place.tags[i].id, place.tags[i].side_m);
    strcat(text, "}}");
    scratch_text(&rehearsal.scratch, "tags.json", text);
    place_free(&place);
    recording_free(&r);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    snprintf(made, sizeof made, "%s", scratch_file(&rehearsal.scratch, "made"));
    snprintf(counted, sizeof counted, "%s", scratch_file(&rehearsal.scratch, "calls"));
    snprintf(folder, sizeof folder, "%s", scratch_file(&rehearsal.scratch, "pictures"));
    snprintf(damaged, sizeof damaged, "%s", scratch_file(&rehearsal.scratch, "damaged"));
    copy_file(rehearsal.file, damaged);
    run_sql(damaged, "UPDATE picture SET depth_crc = 0 WHERE id = (SELECT min(id) FROM picture)");
    write_tags();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

// The address sanitizer's allocator comes behind the one that fails. Blocks of the loader are leaks to it then; what
// the programs themselves leak is counted here.
static void allow_order(void)
{
    const char *given = getenv("ASAN_OPTIONS");
    char options[512];
    snprintf(options, sizeof options, "%s%sverify_asan_link_order=0:detect_leaks=0", given ? given : "",
             given ? ":" : "");
    setenv("ASAN_OPTIONS", options, 1);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_commands)};
    if (argc > 1)
        seconds = atof(argv[1]);
    if (argc > 2)
        only = argv[2];
    if (argc > 3)
        seed = strtoull(argv[3], NULL, 10);
    if (argc > 4)
        only_kind = argv[4];
    print_message("seed %llu\n", (unsigned long long)seed);
    if (SANITIZED)
        allow_order();
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
