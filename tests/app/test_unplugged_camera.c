// A tablet's camera that is unplugged, or stopped by Ctrl-C, while a command goes through its images: what it gave
// until then is not lost. No such camera is here: a folder plays it, whose end is its failure.
#include "tests/support/test.h"

#include "app/commands/commands.h"
#include "platform/files/file.h"
#include "platform/sensors/source.h"
#include "tests/support/rehearsal.h"

#include <signal.h>
#include <string.h>

enum status __real_source_next(struct source *s, struct frame *out);
enum status __wrap_source_next(struct source *s, struct frame *out);
bool __wrap_source_is_live(const struct source *s);

static struct rehearsal rehearsal;
static int given, most = 1000000; // images of the camera, and after how many it fails
static bool pressed;              // instead of failing: Ctrl-C

enum status __wrap_source_next(struct source *s, struct frame *out)
{
    given++;
    if (pressed && given == most)
        raise(SIGINT);
    if (given <= most)
        return __real_source_next(s, out);
    *out = (struct frame){0};
    return fail(ERR_DEVICE, "the camera was unplugged");
}

bool __wrap_source_is_live(const struct source *s)
{
    (void)s;
    return true;
}

static const char *path_of(const char *name)
{
    static char ring[4][512];
    static int next;
    char *path = ring[next++ % 4];
    snprintf(path, sizeof ring[0], "%s", scratch_file(&rehearsal.scratch, name));
    return path;
}

static int lines_of(const char *path)
{
    uint8_t *text;
    size_t bytes;
    int lines = 0;
    EXPECT_STATUS(file_read(path, &text, &bytes), OK);
    for (size_t i = 0; i < bytes; i++)
        lines += text[i] == '\n' && i && text[i - 1] != '\n';
    free(text);
    return lines;
}

static int run(int (*command)(int, char **), int images, bool stop, const char *const *arguments)
{
    char *argv[16];
    int argc = 0;
    for (; arguments[argc]; argc++)
        argv[argc] = (char *)(uintptr_t)arguments[argc];
    argv[argc] = NULL;
    given = 0;
    most = images;
    pressed = stop;
    return command(argc, argv);
}

static int locate(int images, bool stop, const char *out)
{
    const char *const arguments[] = {
        "reenact locate", rehearsal.file, "--camera", rehearsal.camera, "--out", out, "--force", NULL};
    return run(reenact_locate, images, stop, arguments);
}

static int render(int images, bool stop, const char *folder, const char *film)
{
    const char *const arguments[] = {"reenact render",      rehearsal.file, "--take", "turn",  "--camera",
                                     rehearsal.camera,      "--detail",     "paper",  "--out", folder,
                                     film ? "--mp4" : NULL, film,           NULL};
    return run(reenact_render, images, stop, arguments);
}

static void test_locate(void **state)
{
    (void)state;
    const char *out = path_of("trajectory.txt");
    EXPECT_INT(locate(0, false, out), 1); // it gave nothing
    EXPECT_TRUE(!file_exists(out));
    EXPECT_INT(locate(3, false, out), 1);
    EXPECT_SAYS("unplugged");
    EXPECT_INT(lines_of(out), 3);
    EXPECT_INT(locate(2, true, out), 0);
    EXPECT_INT(lines_of(out), 2);
}

static void test_render(void **state)
{
    (void)state;
    EXPECT_INT(render(0, false, path_of("none"), NULL), 1);
    EXPECT_INT(render(3, false, path_of("cut"), NULL), 1);
    EXPECT_SAYS("unplugged");
    EXPECT_INT(lines_of(path_of("cut/trajectory.txt")), 1 + 3); // and what its columns are
    EXPECT_TRUE(file_exists(path_of("cut/stats.json")) && file_exists(path_of("cut/0002.png")));
}

// A live camera has no end of its own.
static void test_film_of_a_camera_that_is_stopped(void **state)
{
    (void)state;
    const char *film = path_of("stopped.mp4");
    const int code = render(2, true, path_of("stopped"), film);
    if (code && strstr(status_message(), "FFmpeg"))
        skip_without("FFmpeg's libraries");
    EXPECT_INT(code, 0);
    EXPECT_TRUE(file_exists(film));
    EXPECT_INT(lines_of(path_of("stopped/trajectory.txt")), 1 + 2);
    film = path_of("cut.mp4");
    EXPECT_INT(render(2, false, path_of("cut film"), film), 1);
    EXPECT_TRUE(file_exists(film));
}

static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_locate),
        cmocka_unit_test(test_render),
        cmocka_unit_test(test_film_of_a_camera_that_is_stopped),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
