// A film from files whose recording cannot be written further: the reader, which waits until enough of it is in the
// file, ends with the writer's error.
#include "tests/support/test.h"

#include "capture/recorder.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "tests/support/scratch.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { WIDTH = 160, HEIGHT = 120, FRAMES = 40, PATIENCE_S = 60 };

static struct scratch scratch;

// An empty room.
static void make_folder(void)
{
    static uint8_t color[3 * WIDTH * HEIGHT];
    static uint16_t depth[WIDTH * HEIGHT];
    char rgb_list[4096] = "", depth_list[4096] = "", name[64];
    struct rng rng = {5};
    for (size_t i = 0; i < COUNT_OF(depth); i++)
        depth[i] = (uint16_t)(2000 + rng_uniform(&rng) * 500); // codes badly
    uint8_t *jpeg, *png;
    size_t jpeg_count, png_count;
    EXPECT_STATUS(jpeg_encode(color, WIDTH, HEIGHT, 90, &jpeg, &jpeg_count), OK);
    EXPECT_STATUS(png_encode(&(struct png_layout){PNG_GRAY16, WIDTH, HEIGHT}, depth, 1, &png, &png_count), OK);
    for (int i = 0; i < FRAMES; i++) {
        snprintf(name, sizeof name, "sensor/rgb/%d.jpg", i);
        scratch_write(&scratch, name, jpeg, jpeg_count);
        snprintf(name, sizeof name, "sensor/depth/%d.png", i);
        scratch_write(&scratch, name, png, png_count);
        sprintf(rgb_list + strlen(rgb_list), "%.6f rgb/%d.jpg\n", 10 + i / 30.0, i);
        sprintf(depth_list + strlen(depth_list), "%.6f depth/%d.png\n", 10 + i / 30.0, i);
    }
    free(jpeg);
    free(png);
    scratch_text(&scratch, "sensor/rgb.txt", rgb_list);
    scratch_text(&scratch, "sensor/depth.txt", depth_list);
    const char *lens = "{\"width\": 160, \"height\": 120, \"fx\": 131.25, \"fy\": 131.25, \"cx\": 79.5, \"cy\": 59.5}";
    char text[400];
    snprintf(text, sizeof text, "{\"color\": %s, \"depth\": %s, \"registered\": true}", lens, lens);
    scratch_text(&scratch, "sensor/calibration.json", text);
}

// Records with that much room for a file. Returns 0 where that ended with the sentence for it, or with the whole film.
static int record_within(rlim_t most)
{
    char uri[300], path[300];
    struct source *source;
    struct recording_writer *writer;
    struct recorder_options options = {0};
    struct recorder_result result;
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, "film.reenact"));
    alarm(PATIENCE_S);
    signal(SIGXFSZ, SIG_IGN);
    const struct rlimit limit = {most, most};
    if (setrlimit(RLIMIT_FSIZE, &limit) || source_open(&source, uri, SOURCE_SENSOR) != OK)
        return 9;
    enum status status = recording_create(&writer, path);
    if (status == OK) {
        status = recorder_run(source, writer, "t", NULL, &options, &result);
        printf("%lld bytes: %lld frames, %s\n", (long long)most, (long long)result.frames,
               status == OK ? "all" : status_message());
        fflush(stdout);
    }
    const bool says_why = status == OK || strstr(status_message(), "no larger file");
    const enum status closed = recording_close(&writer);
    (void)closed;
    source_close(&source);
    return status == OK || (status == ERR_IO && says_why) ? 0 : 1;
}

static void test_reader_ends_with_the_writer(void **state)
{
    (void)state;
    make_folder();
    for (rlim_t most = 600000; most <= 1800000; most += 150000) {
        fflush(NULL);
        const pid_t child = fork();
        if (!child)
            _exit(record_within(most));
        int how;
        waitpid(child, &how, 0);
        EXPECT_TRUE(WIFEXITED(how)); // not by the alarm
        EXPECT_INT(how, 0);
        recording_discard(scratch_file(&scratch, "film.reenact"));
    }
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_reader_ends_with_the_writer)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
