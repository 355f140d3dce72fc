// One allocation or one call of SQLite fails: every command says a sentence and ends with exit code 1, or does its work
// all the same, and then as well as ever; none crashes, and no recording is damaged or changed.
//
// test_failing_calls                      a few calls of each kind and command, drawn at random
// test_failing_calls SECONDS              for that long each command and kind, in random order until all have failed
// test_failing_calls SECONDS COMMAND SEED     of one command ("record"), by that seed
#include "tests/support/test.h"

#include "base/clock.h"
#include "capture/recording/recording.h"
#include "platform/file.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { ARGUMENTS_MAX = 16 };

enum { USUALLY = 3 }; // calls of a kind

static double seconds = 0;
static const char *only;
static uint64_t seed = 20261125;
static struct rehearsal rehearsal;
static char made[512], counted[512], folder[512];

static struct process_result run(const char *const *argv, const char *kind, long at)
{
    char text[32];
    snprintf(text, sizeof text, "%ld", at);
    setenv("LD_PRELOAD", FAIL_CALLS, 1);
    setenv("FAIL_CALL", kind, 1);
    setenv("FAIL_AT", text, 1);
    setenv("FAIL_COUNT", counted, 1);
    struct process_result said = process_run(argv);
    unsetenv("LD_PRELOAD");
    return said;
}

static long calls_of(void)
{
    uint8_t *bytes;
    size_t size;
    EXPECT_STATUS(file_read(counted, &bytes, &size), OK);
    const long calls = atol((char *)bytes);
    free(bytes);
    return calls;
}

static void remove_made(void)
{
    char command[600];
    recording_discard(made);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    EXPECT_INT(system(command), 0);
}

// What the command leaves behind: a recording's frames, or a file's bytes.
struct product {
    bool there;
    int64_t frames; // -1: not a recording
    size_t bytes;   // of another file
    uint32_t crc;
};

static struct product product_now(const char *what)
{
    struct product p = {.frames = -1, .there = file_exists(made)};
    struct recording_report report;
    uint8_t *bytes;
    if (!p.there)
        return p;
    const enum status status = recording_verify(made, &report);
    if (status != ERR_FORMAT) { // what was written until then is sound
        if (status != OK)
            print_error("%s: what it left is damaged: %s\n", what, status_message());
        EXPECT_STATUS(status, OK);
        p.frames = report.frames;
        return p;
    }
    EXPECT_STATUS(file_read(made, &bytes, &p.bytes), OK);
    for (size_t i = 0; i < p.bytes; i++)
        p.crc = p.crc * 16777619u ^ bytes[i];
    free(bytes);
    return p;
}

static bool product_equal(const struct product *a, const struct product *b)
{
    return a->there == b->there && a->frames == b->frames && a->bytes == b->bytes && a->crc == b->crc;
}

struct tally {
    int clean, same;
};

static void fail_one(const char *const *argv, const char *kind, long at, const struct product *whole,
                     struct tally *tally)
{
    char what[128];
    snprintf(what, sizeof what, "%s, %s %ld", argv[1], kind, at);
    remove_made();
    const struct process_result said = run(argv, kind, at);
    const struct product left = product_now(what);
    const size_t length = strlen(said.err);
    const bool sentence = length > 20 && said.err[length - 1] == '\n' && !strstr(said.err, "(null)");
    if (said.exit_code == 0 && product_equal(&left, whole)) {
        tally->same++;
    } else if (said.exit_code == 1 && sentence) {
        tally->clean++;
    } else {
        print_error("%s: exit code %d, '%s'; %lld frames or %zu bytes, whole %lld or %zu\n", what, said.exit_code,
                    said.err, (long long)left.frames, left.bytes, (long long)whole->frames, whole->bytes);
        fail_test();
    }
}

// Calls 1 to `count` in random order (Fisher and Yates).
static long *shuffled(long count, struct rng *rng)
{
    long *order = malloc((size_t)count * sizeof *order);
    for (long i = 0; i < count; i++) {
        const long at = (long)(rng_uniform(rng) * (double)(i + 1));
        order[i] = order[at];
        order[at] = i + 1;
    }
    return order;
}

// The calls that the command makes fail, one a run: USUALLY of them, or as many as the time allows.
static void fail_each(const char *const *argv, const char *kind)
{
    if (only && strcmp(only, argv[1]) != 0)
        return;
    remove_made();
    struct process_result said = run(argv, kind, 0);
    if (said.exit_code)
        print_error("%s %s: %s\n", argv[0], argv[1], said.err);
    EXPECT_INT(said.exit_code, 0);
    const struct product whole = product_now(argv[1]);
    const long calls = calls_of();
    struct rng rng = {seed};
    struct tally tally = {0};
    long *order = shuffled(calls, &rng), done = 0;
    const int64_t until_ns = clock_now_ns() + (int64_t)(seconds * 1e9);
    for (; done < calls && (seconds > 0 ? clock_now_ns() < until_ns : done < USUALLY); done++)
        fail_one(argv, kind, order[done], &whole, &tally);
    free(order);
    print_message("%-8s %-6s %ld of %ld calls: %d ended with a sentence, %d did their work all the same\n", argv[1],
                  kind, done, calls, tally.clean, tally.same);
}

static void test_commands(void **state)
{
    (void)state;
    char camera[600], sensor[600], tags[512];
    snprintf(camera, sizeof camera, "folder:%s", scratch_file(&rehearsal.scratch, "viewer"));
    snprintf(sensor, sizeof sensor, "folder:%s", scratch_file(&rehearsal.scratch, "sensor"));
    snprintf(tags, sizeof tags, "%s", scratch_file(&rehearsal.scratch, "tags.json"));
    const char *capture = PROGRAM_DIR "/reenact-capture", *reenact = PROGRAM_DIR "/reenact";
    const char *const commands[][ARGUMENTS_MAX] = {
        {capture, "record", "--sensor", sensor, "--out", made, "--take", "a", "--no-body-points", NULL},
        {capture, "verify", rehearsal.file, NULL},
        {capture, "info", rehearsal.file, NULL},
        {capture, "export", rehearsal.file, "--take", "turn", "--as", "joints-csv", "--out", made, NULL},
        {capture, "take", "copy", rehearsal.file, "--take", "turn", "--into", made, NULL},
        {capture, "map", "--sensor", sensor, "--tags", tags, "--out", made, NULL},
        {reenact, "render", rehearsal.file, "--take", "turn", "--camera", camera, "--detail", "paper", "--out", folder,
         NULL},
        {reenact, "compare", rehearsal.file, "--take", "turn", "--with", rehearsal.file, "--with-take", "turn", NULL},
    };
    uint8_t *before, *after;
    size_t size, size_after;
    EXPECT_STATUS(file_read(rehearsal.file, &before, &size), OK);
    for (size_t i = 0; i < COUNT_OF(commands); i++) {
        fail_each(commands[i], "alloc");
        fail_each(commands[i], "sqlite");
    }
    EXPECT_STATUS(file_read(rehearsal.file, &after, &size_after), OK);
    EXPECT_TRUE(size == size_after && !memcmp(before, after, size)); // none of them changes what it reads
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
    write_tags();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
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
    print_message("seed %llu\n", (unsigned long long)seed);
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
