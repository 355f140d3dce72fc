// Power cuts while takes are renamed, trimmed, deleted and copied: the file is then sound, and holds what it held
// before or what it was to hold; of a copy, maybe a part.
//
// test_power_cut_changes [COUNT]: that many cuts of each kind of change, evenly over its operations; default 18, 9
// under sanitizers.
#include "platform/files/file.h"
#include "recording/recording_schema.h"
#include "tests/support/power_cut.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"

#include <sys/mman.h>
#include <sys/wait.h>

static int cuts = SANITIZED ? 9 : 18;

static enum status rename_it(const char *path) { return recording_rename_take(path, "höher", "other"); }

static enum status note_it(const char *path) { return recording_annotate_take(path, "höher", "a note", "somebody"); }

static enum status delete_it(const char *path)
{
    int64_t freed;
    return recording_delete_take(path, "höher", &freed);
}

static enum status trim_it(const char *path)
{
    int64_t freed;
    return recording_trim_take(path, "höher", 300000000, 900000000, &freed);
}

static enum status copy_it(const char *path)
{
    struct take_copy_report report;
    return recording_copy_take(path, "höher", path, "zz", &report); // listed after the others
}

static const struct change {
    const char *name;
    enum status (*run)(const char *path);
    bool adds; // a part of it may be there
} changes[] = {{"rename", rename_it, false},
               {"note", note_it, false},
               {"delete", delete_it, false},
               {"trim", trim_it, false},
               {"copy", copy_it, true}};

// Changes the file, until the power fails at that operation. Returns the exit code.
static int change_until(const struct change *c, const char *path, enum power_cut how, int64_t operation,
                        volatile int64_t *operations)
{
    fflush(NULL);
    const pid_t child = fork();
    if (!child) {
        power_cut_install(how, operation, (uint64_t)operation);
        const enum status status = c->run(path);
        *operations = power_cut_operations();
        _exit(status != OK);
    }
    int state;
    EXPECT_INT(waitpid(child, &state, 0), child);
    return WIFEXITED(state) ? WEXITSTATUS(state) : -1;
}

static int takes_in(const char *path)
{
    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    const int count = recording_take_count(r);
    recording_free(&r);
    return count;
}

static void cut(const struct change *c, const uint8_t *bytes, size_t count, volatile int64_t *operations)
{
    char path[128];
    snprintf(path, sizeof path, "%s", sample_path(c->name));
    EXPECT_STATUS(file_write(path, bytes, count), OK);
    const uint64_t before = hash_of(path);
    EXPECT_INT(change_until(c, path, POWER_CUT_LOSES_ALL, 0, operations), 0);
    const uint64_t after = hash_of(path);
    const int64_t all = *operations;
    int changed = 0;
    for (int i = 0; i < cuts; i++) {
        recording_remove_files(path);
        EXPECT_STATUS(file_write(path, bytes, count), OK);
        const int code = change_until(c, path, (enum power_cut)(i % 3), 1 + i * all / cuts, operations);
        struct recording_report report;
        EXPECT_TRUE(code == POWER_CUT_EXIT || code == 0);
        EXPECT_STATUS(recording_verify(path, &report), OK);
        const uint64_t now = hash_of(path);
        const bool is_part = c->adds && takes_in(path) == 3;
        if (now != before && now != after && !is_part)
            print_error("%s: cut %d of %d holds neither\n", c->name, i, cuts);
        EXPECT_TRUE(now == before || now == after || is_part);
        changed += now != before;
    }
    recording_remove_files(path);
    print_message("%s: %d cuts over %lld operations, %d with the change in the file\n", c->name, cuts, (long long)all,
                  changed);
}

static void test_changes(void **state)
{
    (void)state;
    char path[128];
    uint8_t *bytes;
    size_t count;
    snprintf(path, sizeof path, "%s", sample_path("original"));
    sample_recording_write(path);
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    volatile int64_t *operations =
        mmap(NULL, sizeof *operations, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(operations != MAP_FAILED);
    for (size_t i = 0; i < COUNT_OF(changes); i++)
        cut(&changes[i], bytes, count, operations);
    munmap((void *)operations, sizeof *operations);
    free(bytes);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_changes)};
    if (argc > 1)
        cuts = atoi(argv[1]);
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
