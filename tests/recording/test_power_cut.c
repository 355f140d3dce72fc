// Power cuts while a take is recorded: the file stays readable, and at most a second of film is lost.
//
// test_power_cut [COUNT]: that many cuts, at random operations; default 24.
#include "base/clock.h"
#include "tests/support/power_cut.h"
#include "tests/support/recording_sample.h"

#include <sys/mman.h>
#include <sys/wait.h>

enum { AT_ONCE = 12, FILMED = 60, FRAME_NS = 33333333 };

static int cuts = 24;

struct shared {
    volatile int64_t added, operations;
};

// Films for two seconds at 30 Hz, or until the power fails.
static _Noreturn void film(const char *path, struct shared *shared, enum power_cut how, int64_t operation,
                           uint64_t seed)
{
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    static struct sample_frame m;
    power_cut_install(how, operation, seed);
    sample_frame_make(&m, 0);
    if (recording_create(&w, path) != OK || recording_begin_take(w, "a", &calibration) != OK)
        _exit(1);
    const int64_t start = clock_now_ns();
    for (int64_t i = 0; i < FILMED; i++) {
        m.frame.time_ns = i * FRAME_NS;
        clock_sleep_until_ns(start + i * FRAME_NS);
        if (recording_add_frame(w, &m.frame) != OK)
            _exit(1);
        shared->added = i + 1;
    }
    if (recording_end_take(w) != OK || recording_close(&w) != OK)
        _exit(1);
    shared->operations = power_cut_operations();
    _exit(0);
}

static int wait_for(pid_t child)
{
    int how;
    waitpid(child, &how, 0);
    return WIFEXITED(how) ? WEXITSTATUS(how) : -1;
}

static void test_power_cuts(void **state)
{
    (void)state;
    struct rng rng = {SAMPLE_SEED};
    struct shared *shared =
        mmap(NULL, AT_ONCE * sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(shared != MAP_FAILED);
    pid_t child = fork();
    if (!child)
        film(sample_path("whole"), &shared[0], POWER_CUT_LOSES_ALL, 0, 1);
    EXPECT_INT(wait_for(child), 0);
    const int64_t operations = shared[0].operations;
    int64_t worst = 0;
    int unborn = 0, done = 0;
    print_message("seed %d, %d cuts, each at one of %lld operations\n", SAMPLE_SEED, cuts, (long long)operations);
    while (done < cuts) {
        pid_t children[AT_ONCE];
        char path[AT_ONCE][128];
        const int count = cuts - done < AT_ONCE ? cuts - done : AT_ONCE;
        for (int i = 0; i < count; i++) {
            snprintf(path[i], sizeof path[i], "%s/cut-%d", folder, done + i);
            const int64_t operation = 1 + (int64_t)(rng_uniform(&rng) * (double)operations * 0.98);
            shared[i].added = 0;
            fflush(NULL);
            if (!(children[i] = fork()))
                film(path[i], &shared[i], (enum power_cut)((done + i) % 3), operation, (uint64_t)(done + i));
        }
        for (int i = 0; i < count; i++) {
            const int code = wait_for(children[i]);
            EXPECT_TRUE(code == POWER_CUT_EXIT || code == 0);
            if (!file_exists(path[i])) { // cut before there was a file
                unborn++;
                EXPECT_AT_MOST((double)shared[i].added, 0);
                continue;
            }
            struct recording_report report;
            EXPECT_STATUS(recording_verify(path[i], &report), OK);
            const int64_t lost = shared[i].added - report.frames;
            worst = lost > worst ? lost : worst;
            EXPECT_AT_MOST((double)lost * FRAME_NS * 1e-9, 1.0);
            recording_discard(path[i]);
        }
        done += count;
    }
    print_message("%d files sound, %d not yet made, at most %lld frames (%.2f s) lost\n", done - unborn, unborn,
                  (long long)worst, (double)worst * FRAME_NS * 1e-9);
    munmap(shared, AT_ONCE * sizeof *shared);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_power_cuts)};
    if (argc > 1)
        cuts = atoi(argv[1]);
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
