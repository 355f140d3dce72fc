// Attempts kept as recordings: whole, never in another file's place, and nothing else is left beside the one watched.
#include "app/live/live_keeper.h"
#include "base/clock.h"
#include "tests/support/recording_sample.h"
#include "tests/support/scratch.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>

static struct scratch scratch;
static struct calibration calibration;
static uint16_t depth[WIDTH * HEIGHT];

// In the place of the C library's: what file systems answer that have no links, and those where no attempt can be given
// its name. The keeper's thread asks while the test's changes them.
static atomic_bool without_links, without_attempts;

static int refuse_name(const char *to, bool without)
{
    errno = without ? EPERM : EROFS;
    return without || (without_attempts && strstr(to, "-attempt-")) ? -1 : 0;
}

int link(const char *from, const char *to)
{
    return refuse_name(to, without_links) ? -1 : linkat(AT_FDCWD, from, AT_FDCWD, to, 0);
}

int rename(const char *from, const char *to)
{
    return refuse_name(to, false) ? -1 : renameat(AT_FDCWD, from, AT_FDCWD, to);
}

static struct live_keeper *open_keeper(void)
{
    struct live_keeper *k;
    const char *watched = scratch_file(&scratch, "form.reenact"); // need not be there
    EXPECT_STATUS(live_keeper_open(&k, &(struct live_keeper_options){.watched = watched}), OK);
    return k;
}

static void do_attempt(struct live_keeper *k, int number, int frames)
{
    live_keeper_begin(k, &calibration, number);
    for (int i = 0; i < frames; i++)
        live_keeper_add(k, &(struct keeper_frame){.time_ns = 1000 + i * INT64_C(33333333), .depth = depth});
    live_keeper_end(k);
}

// Asks to keep the attempt, and waits until that is done.
static struct live_keeper_state keep(struct live_keeper *k)
{
    const int before = live_keeper_query(k).kept;
    live_keeper_keep(k);
    for (int ms = 0; ms < 20000 && live_keeper_query(k).kept == before; ms++)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    const struct live_keeper_state state = live_keeper_query(k);
    EXPECT_INT(state.kept, before + 1);
    return state;
}

static void expect_kept(const char *name, int number, int64_t frames)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct recording_report report;
    char wanted[40];
    snprintf(wanted, sizeof wanted, "attempt %d", number);
    EXPECT_STATUS(recording_verify(scratch_file(&scratch, name), &report), OK);
    EXPECT_STATUS(recording_open(&r, scratch_file(&scratch, name)), OK);
    EXPECT_STATUS(take_open(&take, r, wanted), OK);
    EXPECT_INT(take_frame_count(take), frames);
    EXPECT_TRUE(take_is_complete(take));
    take_close(&take);
    recording_free(&r);
}

static int files_in_folder(void)
{
    int count = 0;
    DIR *dir = opendir(scratch.path);
    for (struct dirent *entry; (entry = readdir(dir));)
        count += strcmp(entry->d_name, ".") && strcmp(entry->d_name, "..");
    closedir(dir);
    return count;
}

static void expect_untouched(const char *name)
{
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(scratch_file(&scratch, name), &bytes, &count), OK);
    EXPECT_INT(count, 4);
    free(bytes);
}

static void keep_beside_other_files(void)
{
    struct live_keeper *k = open_keeper();
    scratch_text(&scratch, "form-attempt-1.reenact", "mine");
    do_attempt(k, 7, 12);
    struct live_keeper_state state = keep(k);
    EXPECT_TRUE(!state.failed && strstr(state.sentence, "form-attempt-2.reenact"));
    expect_kept("form-attempt-2.reenact", 7, 12);
    state = keep(k); // it has its name
    EXPECT_TRUE(state.failed && strstr(state.sentence, "no attempt"));
    do_attempt(k, 8, 3);
    EXPECT_TRUE(!keep(k).failed);
    do_attempt(k, 9, 3); // is not kept
    live_keeper_close(&k);
    expect_kept("form-attempt-3.reenact", 8, 3);
    expect_kept("form-attempt-2.reenact", 7, 12);
    expect_untouched("form-attempt-1.reenact");
    EXPECT_INT(files_in_folder(), 3);
}

static void test_attempts_get_names_that_no_file_has(void **state)
{
    (void)state;
    keep_beside_other_files();
}

// As on a memory card.
static void test_a_file_system_without_links(void **state)
{
    (void)state;
    without_links = true;
    keep_beside_other_files();
}

static void test_what_could_not_be_kept_can_be_kept_later(void **state)
{
    (void)state;
    struct live_keeper *k = open_keeper();
    do_attempt(k, 1, 5);
    without_attempts = true;
    struct live_keeper_state now = keep(k);
    EXPECT_TRUE(now.failed && strstr(now.sentence, "Not kept") && strstr(now.sentence, strerror(EROFS)));
    without_attempts = false;
    now = keep(k);
    EXPECT_TRUE(!now.failed && strstr(now.sentence, "form-attempt-1.reenact"));
    live_keeper_close(&k);
    expect_kept("form-attempt-1.reenact", 1, 5);
    EXPECT_INT(files_in_folder(), 1);
}

static void test_a_name_that_ends_otherwise(void **state)
{
    (void)state;
    struct live_keeper *k;
    const char *watched = scratch_file(&scratch, "a.reenact.old");
    EXPECT_STATUS(live_keeper_open(&k, &(struct live_keeper_options){.watched = watched}), OK);
    do_attempt(k, 1, 2);
    EXPECT_TRUE(strstr(keep(k).sentence, "a.reenact.old-attempt-1.reenact"));
    live_keeper_close(&k);
}

static void make_recording(const char *name, bool closed, struct recording_writer **w)
{
    EXPECT_STATUS(recording_create(w, scratch_file(&scratch, name)), OK);
    if (closed)
        EXPECT_STATUS(recording_close(w), OK);
}

// A killed program's spool is removed; not one in use, not another recording's, nor what only has such a name.
static void test_what_a_killed_program_left_is_removed(void **state)
{
    (void)state;
    struct recording_writer *closed, *in_use;
    make_recording(".form.reenact.attempt-0123abcd", true, &closed);
    make_recording(".form.reenact.attempt-89abcdef", false, &in_use);
    make_recording(".form2.reenact.attempt-01234567", true, &closed);
    make_recording(".form.reenact.attempt-holiday1", true, &closed);
    scratch_text(&scratch, ".form.reenact.attempt-00000000", "mine"); // no recording
    struct live_keeper *k = open_keeper();
    do_attempt(k, 1, 2);
    EXPECT_TRUE(!keep(k).failed);
    live_keeper_close(&k);
    EXPECT_TRUE(!file_exists(scratch_file(&scratch, ".form.reenact.attempt-0123abcd")));
    EXPECT_TRUE(file_exists(scratch_file(&scratch, ".form.reenact.attempt-89abcdef")));
    EXPECT_TRUE(file_exists(scratch_file(&scratch, ".form2.reenact.attempt-01234567")));
    EXPECT_TRUE(file_exists(scratch_file(&scratch, ".form.reenact.attempt-holiday1")));
    expect_untouched(".form.reenact.attempt-00000000");
    EXPECT_STATUS(recording_close(&in_use), OK);
}

static int make(void **state)
{
    (void)state;
    struct rng rng = {SAMPLE_SEED};
    print_message("seed %d\n", SAMPLE_SEED);
    without_links = without_attempts = false;
    calibration = sample_calibration();
    sample_depth(&rng, depth);
    scratch = scratch_make();
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    without_links = without_attempts = false;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_attempts_get_names_that_no_file_has, make, tidy),
        cmocka_unit_test_setup_teardown(test_a_file_system_without_links, make, tidy),
        cmocka_unit_test_setup_teardown(test_what_could_not_be_kept_can_be_kept_later, make, tidy),
        cmocka_unit_test_setup_teardown(test_a_name_that_ends_otherwise, make, tidy),
        cmocka_unit_test_setup_teardown(test_what_a_killed_program_left_is_removed, make, tidy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
