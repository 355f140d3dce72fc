// kill -9 while recording from a folder, which is read faster than it was filmed: at most a second of film is lost.
//
// test_kill_folder [COUNT]: that many kills, at random moments; default 8.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "recording/recording.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <signal.h>
#include <stdio.h>
#include <sys/inotify.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 64, HEIGHT = 48, FRAMES = 1500, RATE = 30 };

static int kills = 8;
static const uint64_t SEED = 20140901;
static struct scratch scratch;

// One picture of each kind, listed again and again under names of their own.
static void make_folder(void)
{
    static uint8_t color[3 * WIDTH * HEIGHT];
    static uint16_t depth[WIDTH * HEIGHT];
    static char rgb_list[FRAMES * 32], depth_list[FRAMES * 32];
    char name[64], other[512];
    uint8_t *jpeg, *png;
    size_t jpeg_bytes, png_bytes;
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        depth[k] = (uint16_t)(2000 + k % WIDTH);
        memset(color + 3 * k, k % 256, 3);
    }
    EXPECT_STATUS(jpeg_encode(color, WIDTH, HEIGHT, 90, &jpeg, &jpeg_bytes), OK);
    EXPECT_STATUS(png_encode(&(struct png_layout){PNG_GRAY16, WIDTH, HEIGHT}, depth, 1, &png, &png_bytes), OK);
    scratch_write(&scratch, "sensor/rgb/0.jpg", jpeg, jpeg_bytes);
    scratch_write(&scratch, "sensor/depth/0.png", png, png_bytes);
    size_t rgb_used = 0, depth_used = 0;
    for (int i = 0; i < FRAMES; i++) {
        if (i) {
            snprintf(name, sizeof name, "sensor/rgb/%d.jpg", i);
            snprintf(other, sizeof other, "%s", scratch_file(&scratch, name));
            EXPECT_INT(link(scratch_file(&scratch, "sensor/rgb/0.jpg"), other), 0);
            snprintf(name, sizeof name, "sensor/depth/%d.png", i);
            snprintf(other, sizeof other, "%s", scratch_file(&scratch, name));
            EXPECT_INT(link(scratch_file(&scratch, "sensor/depth/0.png"), other), 0);
        }
        rgb_used += (size_t)sprintf(rgb_list + rgb_used, "%.6f rgb/%d.jpg\n", 10 + (double)i / RATE, i);
        depth_used += (size_t)sprintf(depth_list + depth_used, "%.6f depth/%d.png\n", 10 + (double)i / RATE, i);
    }
    free(jpeg);
    free(png);
    scratch_text(&scratch, "sensor/rgb.txt", rgb_list);
    scratch_text(&scratch, "sensor/depth.txt", depth_list);
    const char *lens = "{\"width\": 64, \"height\": 48, \"fx\": 52.5, \"fy\": 52.5, \"cx\": 31.5, \"cy\": 23.5}";
    char text[600];
    snprintf(text, sizeof text, "{\"color\": %s, \"depth\": %s, \"registered\": true}", lens, lens);
    scratch_text(&scratch, "sensor/calibration.json", text);
}

// How many depth pictures have been opened since the watch began.
static int64_t opened(int watch)
{
    static char events[1 << 16] __attribute__((aligned(8)));
    int64_t count = 0;
    for (ssize_t bytes; (bytes = read(watch, events, sizeof events)) > 0;)
        for (char *at = events; at < events + bytes;
             at += sizeof(struct inotify_event) + ((struct inotify_event *)at)->len)
            count += (((struct inotify_event *)at)->mask & (IN_OPEN | IN_ISDIR)) == IN_OPEN;
    return count;
}

static void test_killed_take_loses_at_most_a_second(void **state)
{
    (void)state;
    struct rng rng = {SEED};
    char uri[600], path[512];
    int64_t worst = 0;
    int unborn = 0, whole = 0;
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    print_message("seed %llu, %d kills\n", (unsigned long long)SEED, kills);
    for (int i = 0; i < kills; i++) {
        snprintf(path, sizeof path, "%s", scratch_file(&scratch, "killed.reenact"));
        const int watch = inotify_init1(IN_NONBLOCK);
        assert_true(watch >= 0 && inotify_add_watch(watch, scratch_file(&scratch, "sensor/depth"), IN_OPEN) >= 0);
        const char *const argv[] = {PROGRAM_DIR "/reenact-capture",
                                    "record",
                                    "--sensor",
                                    uri,
                                    "--out",
                                    path,
                                    "--take",
                                    "long",
                                    "--no-body-points",
                                    NULL};
        const pid_t child = process_start(argv);
        clock_sleep_until_ns(clock_now_ns() + (int64_t)(1.2e9 * rng_uniform(&rng)));
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        const int64_t read_frames = opened(watch) - 1; // the first picture's size is looked at beforehand
        close(watch);
        struct recording_report report = {0};
        if (file_exists(path))
            EXPECT_STATUS(recording_verify(path, &report), OK);
        else
            unborn++;
        whole += report.takes && !report.interrupted_takes;
        const int64_t lost = read_frames - report.frames;
        worst = lost > worst ? lost : worst;
        EXPECT_AT_MOST((double)lost / RATE, 1.0);
        recording_discard(path);
    }
    print_message("%d files sound (%d takes already whole), %d not yet made; at most %lld frames (%.2f s) lost\n",
                  kills - unborn, whole, unborn, (long long)worst, (double)worst / RATE);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    make_folder();
    setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_killed_take_loses_at_most_a_second)};
    if (argc > 1)
        kills = atoi(argv[1]);
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
