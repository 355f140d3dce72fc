// Files of every kind beside a recording, called as SQLite's would be: its own, another's, an older version's, cut,
// mutated, that name a file to be deleted, links, folders. Whatever lies there, no other file is touched, who reads
// changes nothing and makes nothing, and what is read is right or refused with a sentence; and so is what is written.
#include "tests/support/planted.h"
#include "tests/support/recording_hash.h"

#include <dirent.h>

enum { SEED = 20261128, MUTANTS = 40, CUTS = 12, NAMES_MOST = 40 };

static char path[128], side[140], victim[128];
static struct bytes sound, older, halfway, journal, foreign_journal, killed, killed_log, other, other_killed, other_log;
static uint64_t sound_hash, killed_hash;

// What the cases are made of.
static int set_up(void **state)
{
    if (sample_folder_make(state))
        return -1;
    snprintf(path, sizeof path, "%s", sample_path("case.reenact"));
    snprintf(victim, sizeof victim, "%s", sample_path("victim"));
    sample_recording_write(path);
    older = bytes_of(path);
    EXPECT_STATUS(recording_annotate_take(path, "höher", "another version", NULL), OK);
    sound = bytes_of(path);
    sound_hash = hash_of(path);
    die_after(change_halfway, path);
    halfway = bytes_of(path);
    journal = bytes_of(beside(path, "-journal"));
    recording_discard(path);

    put(path, sound);
    die_after(add_a_take, path);
    killed = bytes_of(path);
    killed_log = bytes_of(beside(path, "-wal"));
    killed_hash = hash_of(path);
    recording_discard(path);

    sample_recording_write(path); // made in the same way, but another
    other = bytes_of(path);
    die_after(change_halfway, path);
    foreign_journal = bytes_of(beside(path, "-journal"));
    recording_discard(path);
    put(path, other);
    die_after(add_a_take, path);
    other_killed = bytes_of(path);
    other_log = bytes_of(beside(path, "-wal"));
    recording_discard(path);
    return 0;
}

// ------------------------------------------------------------- what is done with them

static enum status read_all(const char *name)
{
    struct recording_report report;
    return recording_verify(name, &report);
}

static enum status repair(const char *name)
{
    struct recording_report report;
    const char *to = sample_path("../reenact_test_repaired");
    const enum status status = recording_repair(name, to, &report);
    recording_discard(to);
    return status == NOTHING ? OK : status;
}

static enum status list(const char *name)
{
    struct recording *r;
    const enum status status = recording_open(&r, name);
    recording_free(&r);
    return status;
}

static enum status copy_from(const char *name)
{
    struct take_copy_report report;
    const char *to = sample_path("../reenact_test_copied");
    const enum status status = recording_copy_take(name, "höher", to, "copy", &report);
    recording_discard(to);
    return status;
}

static enum status (*const readers[])(const char *name) = {read_all, list, repair, copy_from};

static enum status append(const char *name)
{
    struct recording_writer *w;
    const enum status status = recording_append(&w, name);
    return status == OK ? recording_close(&w) : status;
}

static enum status note(const char *name) { return recording_annotate_take(name, "höher", NULL, NULL); }

static enum status check(const char *name) { return recording_check_change(name); }

static enum status copy_into(const char *name)
{
    struct take_copy_report report;
    return recording_copy_take(name, "second", name, "copy", &report);
}

static enum status delete_it(const char *name)
{
    int64_t freed;
    return recording_delete_take(name, "second", &freed);
}

// The last two add to the content and take from it.
static enum status (*const writers[])(const char *name) = {append, note, check, copy_into, delete_it};
enum { SAME_WRITERS = 3 };

// ------------------------------------------------------------- a case

enum answer { RIGHT, SAID, EITHER };

struct plan {
    const char *name;
    struct bytes file; // the recording
    const char *ending;
    struct bytes side; // what lies beside; at NULL: `make` makes it
    void (*make)(void);
    enum answer readers, writers;
    uint64_t hash; // of what is right
};

static void place(const struct plan *p)
{
    recording_discard(path);
    put(victim, (struct bytes){(uint8_t *)"somebody's thesis", 17});
    put(path, p->file);
    snprintf(side, sizeof side, "%s%s", path, p->ending);
    if (p->side.at)
        put(side, p->side);
    else
        p->make();
}

// All names in the folder, in one text.
static void list_names(char *out, size_t room)
{
    char names[NAMES_MOST][64];
    int count = 0;
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir)) && count < NAMES_MOST;)
        snprintf(names[count++], sizeof names[0], "%.60s", e->d_name);
    closedir(dir);
    qsort(names, (size_t)count, sizeof names[0], (int (*)(const void *, const void *))strcmp);
    *out = 0;
    for (int i = 0; i < count; i++)
        strncat(strncat(out, names[i], room - strlen(out) - 1), " ", room - strlen(out) - 1);
}

static void expect_victim(const struct plan *p)
{
    if (!is_same(victim, (struct bytes){(uint8_t *)"somebody's thesis", 17}))
        print_error("%s\n", p->name);
    EXPECT_TRUE(is_same(victim, (struct bytes){(uint8_t *)"somebody's thesis", 17}));
}

static void expect_answer(const struct plan *p, enum answer wanted, const char *who, size_t k, enum status status)
{
    const bool good = wanted == RIGHT ? status == OK : wanted == SAID ? status < 0 : true;
    if (!good || (status < 0 && strlen(status_message()) < 10))
        print_error("%s, %s %zu: %d %s\n", p->name, who, k, status, status_message());
    EXPECT_TRUE(good && (status == OK || strlen(status_message()) >= 10));
}

static void run_readers(const struct plan *p)
{
    char before[NAMES_MOST * 64], after[NAMES_MOST * 64];
    place(p);
    list_names(before, sizeof before);
    for (size_t k = 0; k < COUNT_OF(readers); k++) {
        const enum status status = readers[k](path);
        expect_answer(p, p->readers, "reader", k, status);
        if (status == OK && k == 0)
            EXPECT_TRUE(hash_of(path) == p->hash);
        EXPECT_TRUE(is_same(path, p->file));
        if (p->side.at)
            EXPECT_TRUE(is_same(side, p->side));
        expect_victim(p);
    }
    list_names(after, sizeof after);
    if (strcmp(before, after))
        print_error("%s: %s became %s\n", p->name, before, after);
    EXPECT_TRUE(!strcmp(before, after));
}

static void run_writers(const struct plan *p)
{
    for (size_t k = 0; k < COUNT_OF(writers); k++) {
        place(p);
        const enum status status = writers[k](path);
        expect_answer(p, p->writers, "writer", k, status);
        expect_victim(p);
        if (status == OK && k < SAME_WRITERS)
            EXPECT_TRUE(hash_of(path) == p->hash);
        if (status == OK)
            EXPECT_STATUS(read_all(path), OK);
        else if (p->side.at)
            EXPECT_TRUE(is_same(path, p->file) && is_same(side, p->side));
        rmdir(side);
        unlink(side);
    }
}

static void run(const struct plan *p)
{
    run_readers(p);
    run_writers(p);
    recording_discard(path);
    rmdir(side);
}

// ------------------------------------------------------------- journals

static void make_folder(void) { EXPECT_STATUS(folder_make(side), OK); }
static void make_symlink(void) { EXPECT_INT(symlink(victim, side), 0); }
static void make_dangling(void) { EXPECT_INT(symlink(sample_path("nowhere"), side), 0); }
static void make_hard_link(void) { EXPECT_INT(link(victim, side), 0); }

static void test_journals(void **state)
{
    (void)state;
    static uint8_t text[] = "a shopping list, and not a journal at all: bread, milk, eggs", nothing[600];
    const struct bytes absolute = named(journal, victim), relative = named(journal, "victim"),
                       of_sound = named(foreign_journal, victim);
    const struct plan plans[] = {
        {"own", halfway, "-journal", journal, NULL, RIGHT, RIGHT, sound_hash},
        {"own, done with", sound, "-journal", {nothing, sizeof nothing}, NULL, RIGHT, RIGHT, sound_hash},
        {"none", sound, "-journal", {nothing, 0}, NULL, RIGHT, RIGHT, sound_hash},
        {"of another file", sound, "-journal", foreign_journal, NULL, SAID, SAID, 0},
        {"of another file, beside one that was killed, too", halfway, "-journal", foreign_journal, NULL, SAID, SAID, 0},
        {"of a newer version", older, "-journal", journal, NULL, SAID, SAID, 0},
        {"names a file", halfway, "-journal", absolute, NULL, SAID, SAID, 0},
        {"names a file nearby", halfway, "-journal", relative, NULL, SAID, SAID, 0},
        {"of another file, names a file", sound, "-journal", of_sound, NULL, SAID, SAID, 0},
        {"text", sound, "-journal", {text, sizeof text}, NULL, SAID, SAID, 0},
        {"folder", sound, "-journal", {0}, make_folder, SAID, SAID, 0},
        {"link", sound, "-journal", {0}, make_symlink, SAID, SAID, 0},
        {"link to nothing", sound, "-journal", {0}, make_dangling, SAID, SAID, 0},
        {"hard link", sound, "-journal", {0}, make_hard_link, SAID, SAID, 0},
    };
    for (size_t i = 0; i < COUNT_OF(plans); i++)
        run(&plans[i]);
    free(absolute.at);
    free(relative.at);
    free(of_sound.at);
}

// ------------------------------------------------------------- logs

static void test_logs(void **state)
{
    (void)state;
    static uint8_t text[] = "a shopping list, and not a log at all: bread, milk, eggs", nothing[600];
    const struct plan plans[] = {
        {"own", killed, "-wal", killed_log, NULL, RIGHT, RIGHT, killed_hash},
        {"none", sound, "-wal", {nothing, 0}, NULL, RIGHT, RIGHT, sound_hash},
        {"never written", sound, "-wal", {nothing, sizeof nothing}, NULL, RIGHT, RIGHT, sound_hash},
        {"of another file", sound, "-wal", other_log, NULL, SAID, SAID, 0},
        {"of another file, beside one that was killed, too", killed, "-wal", other_log, NULL, SAID, SAID, 0},
        {"of this one, beside another that was killed, too", other_killed, "-wal", killed_log, NULL, SAID, SAID, 0},
        {"of a newer version", older, "-wal", killed_log, NULL, SAID, SAID, 0},
        {"text", sound, "-wal", {text, sizeof text}, NULL, SAID, SAID, 0},
        {"folder", sound, "-wal", {0}, make_folder, SAID, SAID, 0},
        {"link", sound, "-wal", {0}, make_symlink, SAID, SAID, 0},
        {"link to nothing", sound, "-wal", {0}, make_dangling, SAID, SAID, 0},
        {"hard link", sound, "-wal", {0}, make_hard_link, SAID, SAID, 0},
        {"index that is a link", sound, "-shm", {0}, make_symlink, RIGHT, EITHER, sound_hash},
        {"index that is a hard link", sound, "-shm", {0}, make_hard_link, RIGHT, EITHER, sound_hash},
    };
    for (size_t i = 0; i < COUNT_OF(plans); i++)
        run(&plans[i]);
}

// Beside the log of a killed writer the index would be made anew: cut to 3 bytes, through whatever link.
static void log_and_index(const struct plan *p)
{
    place(p);
    put(beside(path, "-wal"), killed_log);
    for (size_t k = 0; k < COUNT_OF(readers); k++)
        EXPECT_STATUS(readers[k](path), OK);
    EXPECT_TRUE(hash_of(path) == killed_hash && is_same(beside(path, "-wal"), killed_log));
    expect_victim(p);
    for (size_t k = 0; k < COUNT_OF(writers); k++) {
        EXPECT_STATUS(writers[k](path), ERR_IO);
        EXPECT_SAYS("move it away");
        expect_victim(p);
    }
    recording_discard(path);
}

static void test_index_that_is_a_link(void **state)
{
    (void)state;
    const struct plan links = {"index, link", killed, "-shm", {0}, make_symlink, RIGHT, SAID, killed_hash};
    const struct plan hard = {"index, hard link", killed, "-shm", {0}, make_hard_link, RIGHT, SAID, killed_hash};
    log_and_index(&links);
    log_and_index(&hard);
}

// ------------------------------------------------------------- spoilt ones

// Right, or said; what is neither must be found by verify.
static void expect_harmless(const struct plan *p)
{
    place(p);
    const enum status status = read_all(path);
    if (status == OK && hash_of(path) != p->hash)
        print_error("%s: read as if it were right\n", p->name);
    EXPECT_TRUE(status < 0 || hash_of(path) == p->hash);
    EXPECT_TRUE(is_same(path, p->file) && is_same(side, p->side));
    const enum status written = note(path);
    EXPECT_TRUE(written == OK || (is_same(path, p->file) && is_same(side, p->side)));
    expect_victim(p);
    recording_discard(path);
}

static void spoil(struct plan p, struct rng *rng)
{
    const struct bytes whole = p.side;
    for (int i = 0; i < CUTS; i++) {
        p.side.count = (size_t)(rng_uniform(rng) * (double)whole.count);
        p.name = "cut";
        expect_harmless(&p);
    }
    p.side = (struct bytes){malloc(whole.count), whole.count};
    for (int i = 0; i < MUTANTS; i++) {
        memcpy(p.side.at, whole.at, whole.count);
        const int bytes = 1 + (int)(rng_uniform(rng) * 3);
        for (int k = 0; k < bytes; k++) {
            const double reach = i % 2 ? 64 : (double)whole.count; // half of them in the header
            p.side.at[(size_t)(rng_uniform(rng) * reach)] ^= (uint8_t)(1 + rng_uniform(rng) * 255);
        }
        p.name = "mutated";
        expect_harmless(&p);
    }
    free(p.side.at);
}

static void test_spoilt_journals(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    print_message("seed %d\n", SEED);
    spoil((struct plan){"", halfway, "-journal", journal, NULL, EITHER, EITHER, sound_hash}, &rng);
    spoil((struct plan){"", sound, "-journal", foreign_journal, NULL, EITHER, EITHER, sound_hash}, &rng);
}

// A log that is cut is the log of a program that was killed earlier: less is there, and that is no fault.
static void expect_log_harmless(struct plan *p)
{
    place(p);
    const enum status status = read_all(path);
    EXPECT_TRUE(is_same(path, p->file) && is_same(side, p->side));
    if (status == OK)
        EXPECT_STATUS(list(path), OK);
    const enum status written = note(path);
    EXPECT_TRUE(written == OK || (is_same(path, p->file) && is_same(side, p->side)));
    expect_victim(p);
    recording_discard(path);
}

static void test_spoilt_logs(void **state)
{
    (void)state;
    struct rng rng = {SEED + 1};
    struct plan p = {"", killed, "-wal", {malloc(killed_log.count), killed_log.count}, NULL, EITHER, EITHER, 0};
    print_message("seed %d\n", SEED + 1);
    for (int i = 0; i < MUTANTS; i++) {
        memcpy(p.side.at, killed_log.at, killed_log.count);
        const double reach = i % 2 ? 64 : (double)killed_log.count;
        p.side.at[(size_t)(rng_uniform(&rng) * reach)] ^= (uint8_t)(1 + rng_uniform(&rng) * 255);
        p.side.count = i % 4 ? killed_log.count : (size_t)(rng_uniform(&rng) * (double)killed_log.count);
        expect_log_harmless(&p);
    }
    free(p.side.at);
}

static int tear_down(void **state)
{
    struct bytes *const all[] = {&sound,  &older,      &halfway, &journal,      &foreign_journal,
                                 &killed, &killed_log, &other,   &other_killed, &other_log};
    for (size_t i = 0; i < COUNT_OF(all); i++)
        free(all[i]->at);
    return sample_folder_remove(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_journals),
        cmocka_unit_test(test_logs),
        cmocka_unit_test(test_index_that_is_a_link),
        cmocka_unit_test(test_spoilt_journals),
        cmocka_unit_test(test_spoilt_logs),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
