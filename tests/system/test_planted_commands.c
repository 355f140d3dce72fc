// Every command on a recording beside which something is planted. What a killed program left is read as if it had been
// put into the file; anything else is answered with one sentence. No other file is touched, and who only reads leaves
// all as it was.
#include "tests/support/planted.h"
#include "tests/support/process.h"

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

enum { WORDS_MOST = 12 };

static char path[200], away[128], out[128], camera[160], library[128], victim[128];
static struct bytes sound, halfway, journal, naming, foreign, killed, killed_log, finished, foreign_log;

static const struct command {
    const char *words[WORDS_MOST];
    bool changes; // the recording
    bool lists;   // says it among others, and goes on
    bool shows;   // in a window, which is not there
} commands[] = {
    {{CAPTURE, "info", path}, false, false, false},
    {{CAPTURE, "info", "--json", path}, false, false, false},
    {{CAPTURE, "verify", path}, false, false, false},
    {{CAPTURE, "library", library}, false, true, false},
    {{CAPTURE, "export", path, "--take", "höher", "--as", "joints-csv", "--out", out}, false, false, false},
    {{CAPTURE, "export", path, "--take", "höher", "--as", "bvh", "--out", out}, false, false, false},
    {{CAPTURE, "repair", path, "--out", out}, false, false, false},
    {{CAPTURE, "objects", "list", path}, false, false, false},
    {{CAPTURE, "take", "copy", path, "--take", "second", "--into", out, "--name", "x"}, false, false, false},
    {{REENACT, "compare", path, "--take", "höher", "--with", path, "--with-take", "second"}, false, false, false},
    {{REENACT, "render", path, "--take", "höher", "--camera", camera, "--out", out}, false, false, true},
    {{REENACT, "locate", path, "--camera", camera, "--out", out}, false, false, true},
    {{REENACT, path}, false, false, true},
    {{CAPTURE, "take", "note", path, "--take", "second", "--note", "seen"}, true, false, false},
    {{CAPTURE, "take", "rename", path, "--take", "second", "--name", "third"}, true, false, false},
    {{CAPTURE, "take", "trim", path, "--take", "höher", "--from", "0", "--to", "0.5"}, true, false, false},
    {{CAPTURE, "take", "delete", path, "--take", "second"}, true, false, false},
    {{CAPTURE, "objects", "note", path, "--thing", "mug", "--text", "full"}, true, false, false},
};

static int set_up(void **state)
{
    if (sample_folder_make(state))
        return -1;
    snprintf(library, sizeof library, "%s", sample_path("recordings"));
    snprintf(path, sizeof path, "%s/dance.reenact", library);
    snprintf(away, sizeof away, "%s", sample_path("away.reenact"));
    snprintf(out, sizeof out, "%s", sample_path("made"));
    snprintf(camera, sizeof camera, "folder:%s", sample_path("camera"));
    snprintf(victim, sizeof victim, "%s", sample_path("victim"));
    EXPECT_STATUS(folder_make(library), OK);
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
    setenv("SDL_VIDEODRIVER", "x11", 1);

    sample_recording_write(path);
    sound = bytes_of(path);
    die_after(change_halfway, path);
    halfway = bytes_of(path);
    journal = bytes_of(beside(path, "-journal"));
    naming = named(journal, victim);
    recording_discard(path);
    put(path, sound);
    die_after(add_a_take, path);
    killed = bytes_of(path);
    killed_log = bytes_of(beside(path, "-wal"));
    struct recording_writer *w;
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    finished = bytes_of(path);
    recording_discard(path);
    sample_recording_write(path); // another
    die_after(change_halfway, path);
    foreign = bytes_of(beside(path, "-journal"));
    recording_discard(path);
    sample_recording_write(path);
    die_after(add_a_take, path);
    foreign_log = bytes_of(beside(path, "-wal"));
    recording_discard(path);
    return 0;
}

// ------------------------------------------------------------- running

struct plan {
    const char *name;
    struct bytes file;
    const char *ending;
    struct bytes side;
    const struct bytes *equal; // the file with all in it; NULL: what lies beside is refused
};

static struct process_result run(const struct command *c)
{
    recording_discard(out);
    char clear[200];
    snprintf(clear, sizeof clear, "rm -rf %s", out);
    EXPECT_INT(system(clear), 0);
    return process_run(c->words);
}

static int lines_of(const char *text)
{
    int lines = 0;
    for (; *text; text++)
        lines += *text == '\n';
    return lines;
}

// What the command says of a file without anything beside it; sizes and times of files may differ.
static void expect_same_answer(const struct plan *p, const struct command *c, const struct process_result *said)
{
    recording_discard(path);
    put(path, *p->equal);
    const struct process_result wanted = run(c);
    if (said->exit_code != wanted.exit_code || lines_of(said->out) != lines_of(wanted.out))
        print_error("%s, %s %s: %d %s%s, wanted %d %s%s\n", p->name, c->words[1], c->words[2], said->exit_code,
                    said->out, said->err, wanted.exit_code, wanted.out, wanted.err);
    EXPECT_INT(said->exit_code, wanted.exit_code);
    EXPECT_INT(lines_of(said->out), lines_of(wanted.out));
    EXPECT_INT(lines_of(said->err), lines_of(wanted.err));
}

static void expect_refusal(const struct plan *p, const struct command *c, const struct process_result *said)
{
    const bool good = c->lists ? said->exit_code == 0 && strstr(said->err, beside(path, p->ending))
                               : said->exit_code == 1 && (c->shows || strstr(said->err, beside(path, p->ending)));
    if (!good || lines_of(said->err) != 1)
        print_error("%s, %s %s: %d %s%s\n", p->name, c->words[1], c->words[2], said->exit_code, said->out, said->err);
    EXPECT_TRUE(good);
    EXPECT_INT(lines_of(said->err), 1);
}

static void try_all(const struct plan *p)
{
    static uint8_t thesis[] = "somebody's thesis";
    const struct bytes precious = {thesis, sizeof thesis};
    for (size_t i = 0; i < COUNT_OF(commands); i++) {
        const struct command *c = &commands[i];
        recording_discard(path);
        put(victim, precious);
        put(path, p->file);
        put(beside(path, p->ending), p->side);
        const struct process_result said = run(c);
        EXPECT_TRUE(is_same(victim, precious));
        if (!c->changes || !p->equal) {
            EXPECT_TRUE(is_same(path, p->file));
            EXPECT_TRUE(is_same(beside(path, p->ending), p->side));
        }
        if (p->equal)
            expect_same_answer(p, c, &said);
        else
            expect_refusal(p, c, &said);
    }
    recording_discard(path);
}

static void test_own_journal(void **state)
{
    (void)state;
    try_all(&(struct plan){"own journal", halfway, "-journal", journal, &sound});
}

static void test_own_log(void **state)
{
    (void)state;
    try_all(&(struct plan){"own log", killed, "-wal", killed_log, &finished});
}

static void test_journal_that_names_a_file(void **state)
{
    (void)state;
    try_all(&(struct plan){"naming journal", halfway, "-journal", naming, NULL});
}

static void test_journal_of_another(void **state)
{
    (void)state;
    try_all(&(struct plan){"foreign journal", sound, "-journal", foreign, NULL});
}

static void test_log_of_another(void **state)
{
    (void)state;
    try_all(&(struct plan){"foreign log", killed, "-wal", foreign_log, NULL});
}

// Copied elsewhere with what lies beside it, it is the same.
static void test_copied_along(void **state)
{
    (void)state;
    put(away, halfway);
    put(beside(away, "-journal"), journal);
    EXPECT_INT(PROCESS(CAPTURE, "verify", away).exit_code, 0);
    recording_discard(away);
    put(away, killed);
    put(beside(away, "-wal"), killed_log);
    EXPECT_INT(PROCESS(CAPTURE, "verify", away).exit_code, 0);
    recording_discard(away);
}

static int tear_down(void **state)
{
    struct bytes *const all[] = {&sound,  &halfway,    &journal,  &naming,     &foreign,
                                 &killed, &killed_log, &finished, &foreign_log};
    for (size_t i = 0; i < COUNT_OF(all); i++)
        free(all[i]->at);
    return sample_folder_remove(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_own_journal),
        cmocka_unit_test(test_own_log),
        cmocka_unit_test(test_journal_that_names_a_file),
        cmocka_unit_test(test_journal_of_another),
        cmocka_unit_test(test_log_of_another),
        cmocka_unit_test(test_copied_along),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
