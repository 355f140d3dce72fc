// What a recording survives: a killed writer, a full disk, truncation, wrong bytes.
#include "base/clock.h"
#include "platform/files/database.h"
#include "recording/recording_schema.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"
#include "tests/support/single_file.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>

enum { AT_ONCE = 10, FRAME_NS = 33333333 };
enum { KILLS = SANITIZED ? 20 : 50, MUTATIONS = SANITIZED ? 30 : 80, CUTS = SANITIZED ? 20 : 40 };

static uint64_t seed;

static void remove_with_log(const char *path)
{
    static const char *const endings[] = {"", "-wal", "-journal", "-shm"};
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char name[4200];
        snprintf(name, sizeof name, "%s%s", path, endings[i]);
        unlink(name);
    }
}

// ------------------------------------------------------------- kill -9

// Adds frames at 30 Hz until it is killed; *added counts them.
static _Noreturn void record_until_killed(const char *path, volatile int64_t *added)
{
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    struct sample_frame m;
    if (recording_create(&w, path) != OK || recording_begin_take(w, "a", &calibration) != OK)
        _exit(1);
    sample_frame_make(&m, 0);
    int64_t start = clock_now_ns();
    for (int64_t i = 0;; i++) {
        m.frame.time_ns = i * FRAME_NS;
        clock_sleep_until_ns(start + i * FRAME_NS);
        if (recording_add_frame(w, &m.frame) != OK)
            _exit(1);
        *added = i + 1;
    }
}

// The file of a killed writer must be undamaged, and at most a second short.
static int64_t check_killed(const char *path, int64_t added)
{
    struct recording_report report;
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.takes, 1);
    EXPECT_INT(report.interrupted_takes, 1);
    EXPECT_INT(report.damaged_frames, 0);
    EXPECT_AT_MOST((double)(added - report.frames) * FRAME_NS * 1e-9, 1.0);
    EXPECT_AT_LEAST((double)(added + 1 - report.frames), 0);
    return added - report.frames;
}

static void test_kill_at_any_moment(void **state)
{
    (void)state;
    struct rng rng = {seed};
    volatile int64_t *added =
        mmap(NULL, AT_ONCE * sizeof *added, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(added != MAP_FAILED);
    printf("frames short:");
    for (int round = 0; round < KILLS / AT_ONCE; round++) {
        pid_t child[AT_ONCE];
        int64_t when_ns[AT_ONCE];
        char path[AT_ONCE][128];
        for (int i = 0; i < AT_ONCE; i++) {
            snprintf(path[i], sizeof path[i], "%s/killed-%d-%d", folder, round, i);
            added[i] = 0;
            when_ns[i] = (int64_t)(1.4e9 * rng_uniform(&rng));
            fflush(NULL);
            if (!(child[i] = fork()))
                record_until_killed(path[i], &added[i]);
        }
        bool killed[AT_ONCE] = {false};
        int64_t first_ns[AT_ONCE] = {0}, give_up_ns = clock_now_ns() + INT64_C(60000000000);
        for (int alive = AT_ONCE; alive;) {
            assert_true(clock_now_ns() < give_up_ns);
            for (int i = 0; i < AT_ONCE; i++) {
                int64_t now = clock_now_ns();
                if (!first_ns[i] && added[i])
                    first_ns[i] = now;
                if (!killed[i] && first_ns[i] && now >= first_ns[i] + when_ns[i]) {
                    kill(child[i], SIGKILL);
                    waitpid(child[i], NULL, 0);
                    killed[i] = true;
                    alive--;
                }
            }
            clock_sleep_until_ns(clock_now_ns() + 300000);
        }
        for (int i = 0; i < AT_ONCE; i++) {
            printf(" %lld", (long long)check_killed(path[i], added[i]));
            if (round)
                remove_with_log(path[i]);
        }
    }
    printf("\n");
    munmap((void *)added, AT_ONCE * sizeof *added);
}

static void test_append_after_kill(void **state)
{
    (void)state;
    // The first round's last file.
    const char *path = sample_path("killed-0-9");
    struct calibration calibration = sample_calibration();
    struct recording_report before, report;
    struct recording_writer *w;
    EXPECT_STATUS(recording_verify(path, &before), OK);
    EXPECT_STATUS(recording_append(&w, path), OK);
    EXPECT_STATUS(recording_begin_take(w, "b", &calibration), OK);
    sample_frames_add(w, 0, 4);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_TRUE(database_is_single_file(path));
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_INT(report.interrupted_takes, 1); // says the truth about itself
    EXPECT_INT(report.frames, before.frames + 4);
    EXPECT_STATUS(recording_repair(path, sample_path("needless"), &report), NOTHING); // a kill damages nothing
    EXPECT_TRUE(!file_exists(sample_path("needless")));
}

// ------------------------------------------------------------- full disk

// The sentence for a file that may not grow while there is room on the disk.
static bool says_why(void) { return strstr(status_message(), "no larger file"); }

// Returns 0 if everything went as recording.h states; *added: frames that were accepted.
static int fill_disk(const char *path, rlim_t most, volatile int64_t *added)
{
    signal(SIGXFSZ, SIG_IGN);
    struct rlimit limit = {most, most};
    if (setrlimit(RLIMIT_FSIZE, &limit))
        return 1;
    struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    enum status status = recording_create(&w, path);
    if (status != OK)
        return w || status != ERR_IO || file_exists(path) ? 2 : 0;
    status = recording_begin_take(w, "a", &calibration);
    static struct sample_frame m;
    for (int i = 0; status == OK && i < 4000; i++) {
        sample_frame_make(&m, i);
        status = recording_add_frame(w, &m.frame);
        *added += status == OK;
        free(m.jpeg);
    }
    if (status != ERR_IO || !says_why() || !strstr(status_message(), path)) {
        print_error("a full disk says '%s'\n", status_message());
        return 3;
    }
    if (*added && recording_add_frame(w, &m.frame) == OK)
        return 4;
    if (!file_is_at_largest(path) || file_room_bytes(path) > (int64_t)most)
        return 6;
    status = recording_close(&w);
    return status == ERR_IO && !w && says_why() ? 0 : 5;
}

static void test_full_disk(void **state)
{
    (void)state;
    volatile int64_t *added = mmap(NULL, sizeof *added, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(added != MAP_FAILED);
    const rlim_t limits[] = {0, 70000, 200000, 500000, 700000, 1000000, 2500000};
    printf("full disk, frames added and kept:");
    for (size_t i = 0; i < COUNT_OF(limits); i++) {
        char path[128];
        snprintf(path, sizeof path, "%s/full-%zu", folder, i);
        *added = 0;
        fflush(NULL);
        pid_t child = fork();
        if (!child)
            _exit(fill_disk(path, limits[i], added));
        int how;
        waitpid(child, &how, 0);
        EXPECT_INT(how, 0);
        if (!file_exists(path))
            continue;
        struct recording_report report;
        EXPECT_STATUS(recording_verify(path, &report), OK);
        printf(" %lld/%lld", (long long)*added, (long long)report.frames);
        EXPECT_AT_MOST((double)report.frames, (double)*added);
        struct recording_writer *w; // with free space again, it goes on
        EXPECT_STATUS(recording_append(&w, path), OK);
        EXPECT_STATUS(recording_close(&w), OK);
    }
    printf("\n");
    munmap((void *)added, sizeof *added);
}

// ------------------------------------------------------------- damage

// Opens, verifies and repairs a damaged file; returns the number of frames that repair saved, -1: it failed.
static int64_t use_damaged(const char *path, uint64_t whole_hash, int *undetected)
{
    struct recording_report report;
    enum status status = recording_verify(path, &report);
    if (status == OK) { // the damage must lie in unused bytes
        ++*undetected;
        EXPECT_TRUE(hash_of(path) == whole_hash);
        return report.frames;
    }
    EXPECT_AT_MOST(status, -1);
    EXPECT_SAYS(path);
    EXPECT_AT_LEAST(report.findings + (status != ERR_CORRUPT) + !report.frames, 1);
    char repaired[128];
    uint8_t *before, *after;
    size_t count, count_after;
    snprintf(repaired, sizeof repaired, "%s", sample_path("repaired"));
    EXPECT_STATUS(file_read(path, &before, &count), OK);
    status = recording_repair(path, repaired, &report);
    EXPECT_STATUS(file_read(path, &after, &count_after), OK);
    EXPECT_TRUE(count == count_after && !memcmp(before, after, count)); // the input is only read
    free(before);
    free(after);
    if (status != OK) {
        EXPECT_SAYS(path);
        EXPECT_TRUE(!file_exists(repaired));
        return -1;
    }
    int64_t saved = report.frames;
    EXPECT_STATUS(recording_verify(repaired, &report), OK);
    EXPECT_INT(report.frames, saved);
    remove_with_log(repaired);
    return saved;
}

static void test_cut_anywhere(void **state)
{
    (void)state;
    struct rng rng = {seed + 1};
    uint8_t *bytes;
    size_t count;
    sample_recording_write(sample_path("whole"));
    uint64_t hash = hash_of(sample_path("whole"));
    EXPECT_STATUS(file_read(sample_path("whole"), &bytes, &count), OK);
    int undetected = 0;
    printf("of %d frames, saved after cuts:", FRAMES + 3);
    for (int i = 0; i < CUTS; i++) {
        size_t at = i < 3   ? (size_t)(i * 50)
                    : i % 2 ? count / 65536 * 65536 * (size_t)i / CUTS / 65536 * 65536
                            : (size_t)(rng_uniform(&rng) * (double)count);
        EXPECT_STATUS(file_write(sample_path("cut"), bytes, at), OK);
        printf(" %lld", (long long)use_damaged(sample_path("cut"), hash, &undetected));
        remove_with_log(sample_path("cut"));
    }
    printf("\n");
    EXPECT_INT(undetected, 0);
    free(bytes);
}

static void test_wrong_bytes_anywhere(void **state)
{
    (void)state;
    struct rng rng = {seed + 2};
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(sample_path("whole"), &bytes, &count), OK);
    uint64_t hash = hash_of(sample_path("whole"));
    int undetected = 0;
    printf("saved after wrong bytes:");
    for (int i = 0; i < MUTATIONS; i++) {
        uint8_t *wrong = malloc(count);
        assert_non_null(wrong);
        memcpy(wrong, bytes, count);
        // Single bytes anywhere, or a run of zeros, or bytes at the start of the tables.
        int changes = 1 + (int)(8 * rng_uniform(&rng));
        for (int k = 0; k < changes; k++) {
            size_t at = (size_t)(rng_uniform(&rng) * (double)(i % 4 == 3 ? 66000 : count));
            wrong[at] ^= (uint8_t)(1 << (int)(8 * rng_uniform(&rng)));
        }
        if (i % 4 == 1) {
            size_t at = (size_t)(rng_uniform(&rng) * (double)(count - 5000));
            memset(wrong + at, 0, 5000);
        }
        EXPECT_STATUS(file_write(sample_path("wrong"), wrong, count), OK);
        free(wrong);
        printf(" %lld", (long long)use_damaged(sample_path("wrong"), hash, &undetected));
        remove_with_log(sample_path("wrong"));
    }
    printf("; %d of %d were not detected\n", undetected, MUTATIONS);
    free(bytes);
}

// A table's name may be damaged so that SQLite still finds it: an optional table must then not count as absent.
static void test_wrong_byte_in_table_name(void **state)
{
    (void)state;
    static const char *const name[] = {"place",       "place_view", "take",       "frame",      "picture",
                                       "point_error", "tag_error",  "point_side", "joint_error"};
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(sample_path("whole"), &bytes, &count), OK);
    uint64_t hash = hash_of(sample_path("whole"));
    int undetected = 0;
    for (size_t i = 0; i < COUNT_OF(name); i++) {
        char row[64]; // of sqlite_schema: type, name, tbl_name
        size_t length = (size_t)snprintf(row, sizeof row, "table%s%s", name[i], name[i]);
        uint8_t *at = memmem(bytes, count, row, length);
        assert_non_null(at);
        size_t letters[] = {1, strlen("table") + 1};
        for (size_t k = 0; k < COUNT_OF(letters); k++) {
            at[letters[k]] ^= 'a' ^ 'A';
            EXPECT_STATUS(file_write(sample_path("name"), bytes, count), OK);
            at[letters[k]] ^= 'a' ^ 'A';
            EXPECT_INT(use_damaged(sample_path("name"), hash, &undetected), FRAMES + 3);
            remove_with_log(sample_path("name"));
        }
    }
    printf("%d of %zu names were not detected\n", undetected, 2 * COUNT_OF(name));
    free(bytes);
}

// A table's SQL text may be damaged so that it still parses, but id is a column like others.
static void test_wrong_byte_in_table_text(void **state)
{
    (void)state;
    static const char text[] = "(id INTEGER PRIMARY KEY";
    uint8_t *bytes, *at;
    size_t count;
    EXPECT_STATUS(file_read(sample_path("whole"), &bytes, &count), OK);
    uint64_t hash = hash_of(sample_path("whole"));
    int texts = 0, undetected = 0;
    for (size_t from = 0; (at = memmem(bytes + from, count - from, text, sizeof text - 1)); texts++) {
        from = (size_t)(at - bytes) + sizeof text - 1;
        uint8_t *blank = at + sizeof "(id INTEGER" - 1;
        *blank = '0';
        EXPECT_STATUS(file_write(sample_path("text"), bytes, count), OK);
        *blank = ' ';
        EXPECT_INT(use_damaged(sample_path("text"), hash, &undetected), FRAMES + 3);
        struct recording_writer *w; // another take can be added to what repair makes of it
        struct recording_report report;
        EXPECT_STATUS(recording_append(&w, sample_path("text")), ERR_CORRUPT);
        EXPECT_STATUS(recording_repair(sample_path("text"), sample_path("made"), &report), OK);
        EXPECT_INT(report.frames, FRAMES + 3);
        EXPECT_STATUS(recording_append(&w, sample_path("made")), OK);
        EXPECT_STATUS(recording_close(&w), OK);
        remove_with_log(sample_path("made"));
        remove_with_log(sample_path("text"));
    }
    printf("%d tables' texts, %d were not detected\n", texts, undetected);
    EXPECT_AT_LEAST(texts, 5);
    free(bytes);
}

// A take's calibration with a wrong image size: repair takes the size from the images.
static void test_wrong_byte_in_size(void **state)
{
    (void)state;
    struct calibration calibration = sample_calibration();
    uint8_t *bytes, *at, blob[CALIBRATION_BYTES];
    size_t count;
    EXPECT_STATUS(file_read(sample_path("whole"), &bytes, &count), OK);
    uint64_t hash = hash_of(sample_path("whole"));
    put_calibration(blob, &calibration);
    int found = 0, undetected = 0;
    for (size_t from = 0; (at = memmem(bytes + from, count - from, blob, sizeof blob)); found++) {
        from = (size_t)(at - bytes) + sizeof blob;
        const size_t sizes[] = {0, 4, 80, 84}; // width and height for colour, then for depth
        for (size_t i = 0; i < COUNT_OF(sizes); i++) {
            at[sizes[i]] ^= 2;
            EXPECT_STATUS(file_write(sample_path("size"), bytes, count), OK);
            at[sizes[i]] ^= 2;
            EXPECT_INT(use_damaged(sample_path("size"), hash, &undetected), FRAMES + 3);
            remove_with_log(sample_path("size"));
        }
    }
    printf("%d calibrations\n", found);
    EXPECT_AT_LEAST(found, 1);
    EXPECT_INT(undetected, 0);
    free(bytes);
}

int main(void)
{
    setvbuf(stdout, NULL, _IOLBF, 0);
    const char *given = getenv("REENACT_TEST_SEED");
    seed = given ? strtoull(given, NULL, 0) : (uint64_t)clock_now_ns();
    printf("seed REENACT_TEST_SEED=%llu\n", (unsigned long long)seed);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kill_at_any_moment),
        cmocka_unit_test(test_append_after_kill),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_cut_anywhere),
        cmocka_unit_test(test_wrong_bytes_anywhere),
        cmocka_unit_test(test_wrong_byte_in_table_name),
        cmocka_unit_test(test_wrong_byte_in_table_text),
        cmocka_unit_test(test_wrong_byte_in_size),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
