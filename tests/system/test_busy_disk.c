// Filming 30 frames a second, through OpenNI2 and the recorder's queues, beside a process that keeps the disk busy: how
// many frames are dropped, how many waited, and the longest that the sensor's thread took to hand one over.
//
//     test_busy_disk                     a few seconds; the figures are printed
//     test_busy_disk MINUTES [FOLDER]    as long as given, on FOLDER's disk; no frame may be lost, no hand-over take 2
//     ms
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/json.h"
#include "recording/recording.h"
#include "tests/support/film.h"
#include "tests/support/process.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

enum { FILMED = 20, FPS = 30, BLOCK = 1 << 20, BLOCKS = 64 };

static const double HANDOVER_MS = 2;
static double minutes = 0;
static const char *disk;

// Writes blocks and syncs each, over and over in 64 MB, until it is killed; or the disk is full, which is busy enough.
static pid_t keep_busy(const char *path)
{
    const pid_t child = fork();
    if (child)
        return child;
    static uint8_t block[BLOCK];
    const int fd = open(path, O_CREAT | O_WRONLY, 0600);
    if (fd < 0)
        _exit(1);
    for (uint64_t i = 0;; i++) {
        memset(block, (int)i, sizeof block);
        if (pwrite(fd, block, sizeof block, (off_t)(i % BLOCKS) * BLOCK) < 0 || fsync(fd))
            usleep(1000);
    }
}

// Films until SIGINT, which `timeout` sends.
static struct process_result film_for(double seconds, const char *file)
{
    char text[32];
    snprintf(text, sizeof text, "%.1f", seconds);
    return PROCESS("/usr/bin/timeout", "-s", "INT", "--preserve-status", text, PROGRAM_DIR "/reenact-capture", "record",
                   "--sensor", "openni:0", "--out", file, "--take", "busy", "--no-body-points", "--json");
}

static double number_of(const struct json *root, const char *name)
{
    double value = NAN;
    EXPECT_TRUE(json_get_number(json_member(root, name), &value));
    return value;
}

struct filming {
    double frames, dropped, handover_ms;
};

// Films for so long and checks that the recording is sound. beside: what is printed.
static struct filming film_once(double seconds, const char *file, const char *beside)
{
    struct filming f;
    struct json *root;
    struct recording_report report;
    const struct process_result said = film_for(seconds, file);
    if (said.exit_code)
        print_error("exit code %d: %s\n", said.exit_code, said.err);
    EXPECT_INT(said.exit_code, 0);
    EXPECT_STATUS(json_parse(said.out, strlen(said.out), "the report", &root), OK);
    f.frames = number_of(root, "frames");
    f.dropped = number_of(root, "dropped");
    f.handover_ms = number_of(root, "handover_ms");
    print_message("%.0f s, %s: %.0f frames, %.0f dropped, at most %.0f waited, slowest hand-over %.2f ms, %.1f MB/s\n",
                  seconds, beside, f.frames, f.dropped, number_of(root, "waiting_max"), f.handover_ms,
                  number_of(root, "mb_per_s"));
    EXPECT_STATUS(recording_verify(file, &report), OK);
    EXPECT_NEAR((double)report.frames, f.frames, 0);
    EXPECT_AT_LEAST(f.frames, 1);
    json_free(&root);
    recording_discard(file);
    return f;
}

static void test_beside_a_busy_disk(void **state)
{
    (void)state;
    struct scratch film = scratch_make();
    struct world_options options = world_default_options();
    struct world *w;
    options.plain = true;
    EXPECT_STATUS(world_open(&w, &options), OK);
    film_sensor(w, &film, "film", 0.5, 0, FILMED);
    world_close(&w);
    char fps[16], path[512], file[512];
    snprintf(fps, sizeof fps, "%d", FPS);
    snprintf(path, sizeof path, "%s/busy.%d.part", disk ? disk : film.path, (int)getpid());
    snprintf(file, sizeof file, "%s/film.%d.reenact", disk ? disk : film.path, (int)getpid());
    setenv("REENACT_FAKE_SENSOR", scratch_file(&film, "film"), 1);
    setenv("REENACT_FAKE_SENSOR_FPS", fps, 1);
    setenv("REENACT_FAKE_SENSOR_AT_END", "loop", 1);
    setenv("LD_LIBRARY_PATH", OPENNI2_DIR, 1);
    // OpenNI2 unloads its drivers before the program's leaks are looked for, which then have no library's name.
    setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    const double seconds = minutes > 0 ? 60 * minutes : 3;
    film_once(seconds, file, "alone");
    const pid_t busy = keep_busy(path);
    const struct filming f = film_once(seconds, file, "beside a busy disk");
    kill(busy, SIGKILL);
    waitpid(busy, NULL, 0);
    unlink(path);
    if (minutes > 0) {
        EXPECT_NEAR(f.dropped, 0, 0);
        EXPECT_AT_MOST(f.handover_ms, HANDOVER_MS);
        EXPECT_AT_LEAST(f.frames, (seconds - 3) * FPS); // it takes a moment to begin
    }
    scratch_remove(&film);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_beside_a_busy_disk)};
    if (argc > 1)
        minutes = atof(argv[1]);
    if (argc > 2)
        disk = argv[2];
#ifdef EMULATED
    return 0;
#endif
    return cmocka_run_group_tests(tests, NULL, NULL);
}
