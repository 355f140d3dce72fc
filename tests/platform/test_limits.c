// What a file from a stranger may not do: take all memory, name files outside its folder, describe a lens that cannot
// be.
#include "tests/support/test.h"

#include "base/pixels.h"
#include "base/text.h"
#include "capture/mapping/mapper.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

static struct scratch scratch;

static const char *const head =
    "{\"color\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5},"
    "\"depth\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5},"
    "\"registered\": true}";

static enum status open_folder(enum source_wanted wanted)
{
    struct source *s;
    char uri[600];
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "in"));
    enum status status = source_open(&s, uri, wanted);
    source_close(&s);
    return status;
}

static void make_folder(void)
{
    static const uint8_t pixels[16384 * 3];
    scratch_text(&scratch, "in/calibration.json", head);
    scratch_text(&scratch, "in/rgb.txt", "0 a/0.png\n1 b/0.png\n");
    EXPECT_STATUS(folder_make(scratch_file(&scratch, "in/a")), OK);
    EXPECT_STATUS(folder_make(scratch_file(&scratch, "in/b")), OK);
    EXPECT_STATUS(png_write(scratch_file(&scratch, "in/a/0.png"), PNG_RGB8, pixels, 8, 6), OK);
    EXPECT_STATUS(png_write(scratch_file(&scratch, "in/b/0.png"), PNG_RGB8, pixels, 8, 6), OK);
}

static void test_names_in_lists(void **state)
{
    (void)state;
    make_folder();
    static const struct {
        const char *list, *words;
    } bad[] = {{"0 ../out.png\n", "outside of the folder"},
               {"0 a/../../out.png\n", "outside of the folder"},
               {"0 a/\xff.png\n", "not UTF-8"},
               {"0 a/\x1b[2J.png\n", "control"}};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        scratch_text(&scratch, "in/rgb.txt", bad[i].list);
        EXPECT_STATUS(open_folder(SOURCE_CAMERA), ERR_INPUT);
        EXPECT_SAYS(bad[i].words);
        EXPECT_TRUE(text_is_printable(status_message()));
    }
    scratch_text(&scratch, "in/rgb.txt", "0 a/../a/0.png\n");
    EXPECT_STATUS(open_folder(SOURCE_CAMERA), OK);
}

// Two files of one name in two folders would write over one another's results.
static void test_frames_have_names_of_their_own(void **state)
{
    (void)state;
    struct source *s;
    struct frame frame;
    char uri[600], names[2][32];
    make_folder();
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "in"));
    EXPECT_STATUS(source_open(&s, uri, SOURCE_CAMERA), OK);
    for (int i = 0; i < 2; i++) {
        EXPECT_STATUS(source_next(s, &frame), OK);
        snprintf(names[i], sizeof names[i], "%s", frame.name);
    }
    source_close(&s);
    print_message("%s %s\n", names[0], names[1]);
    EXPECT_TRUE(strcmp(names[0], names[1]));
}

static void test_lenses_that_cannot_be(void **state)
{
    (void)state;
    const struct lens good = {640, 480, 525, 525, 319.5, 239.5, 0.26, -0.9, -0.002, 0.001, 1.1, 0, 0};
    EXPECT_STATUS(lens_check(&good, "color"), OK);
    struct lens bad[8];
    for (size_t i = 0; i < COUNT_OF(bad); i++)
        bad[i] = good;
    bad[0].fx = 1e300;
    bad[1].fy = 1e-3;
    bad[2].k1 = 1e9;
    bad[3].cx = 1e7;
    bad[4].width = bad[4].height = 16384;
    bad[5].p1 = 1e4;
    bad[6].k3 = NAN;
    bad[7].width = 1 << 20;
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        EXPECT_STATUS(lens_check(&bad[i], "color"), ERR_INPUT);
        print_message("%s\n", status_message());
    }
}

// Of this process, bytes; libraries alone take some hundred MB of addresses.
static rlim_t addresses_in_use(void)
{
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    assert_non_null(file);
    EXPECT_INT(fscanf(file, "%lu", &pages), 1);
    fclose(file);
    return (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
}

// A child that may use no more memory than that, beyond what it has; returns what `check` returns.
static int with_memory(rlim_t bytes, int (*check)(void))
{
    fflush(NULL);
    const rlim_t most = addresses_in_use() + bytes;
    pid_t child = fork();
    if (!child) {
        const struct rlimit limit = {most, most};
        setrlimit(RLIMIT_AS, &limit);
        _exit(check());
    }
    int how;
    waitpid(child, &how, 0);
    return WIFEXITED(how) ? WEXITSTATUS(how) : 128 + WTERMSIG(how);
}

static int read_bomb(void)
{
    void *pixels;
    int width, height;
    enum status status = png_read(scratch_file(&scratch, "bomb.png"), PNG_GRAY8, &pixels, &width, &height);
    return status == ERR_INPUT && strstr(status_message(), "16384 x 16384") ? 0 : 1;
}

static void test_pictures_above_the_limit(void **state)
{
    (void)state;
    uint8_t *black = calloc(16384, 16384), *bytes;
    size_t count;
    assert_non_null(black);
    EXPECT_STATUS(png_encode(&(struct png_layout){PNG_GRAY8, 16384, 16384}, black, 1, &bytes, &count), OK);
    free(black);
    scratch_write(&scratch, "bomb.png", bytes, count);
    free(bytes);
    EXPECT_TRUE(!image_size_is_usable(16384, 16384) && image_size_is_usable(8192, 4096));
    // A sanitizer's shadow memory needs more than any limit.
    EXPECT_INT(SANITIZED ? read_bomb() : with_memory(192 << 20, read_bomb), 0);
    // A chunk that claims 900 MB (an sPLT chunk of a file of 48 bytes).
    void *pixels;
    int width, height;
    EXPECT_STATUS(png_read(SOURCE_DIR "/tests/fuzz/corpus/png/chunk-of-900-mb", PNG_GRAY8, &pixels, &width, &height),
                  ERR_CORRUPT);
    // Another chunk before the header, with other numbers where a size is expected: libpng alone would take it.
    EXPECT_STATUS(
        png_read(SOURCE_DIR "/tests/fuzz/corpus/png/chunk-before-header", PNG_GRAY16, &pixels, &width, &height),
        ERR_CORRUPT);
    EXPECT_SAYS("no PNG picture");
}

static void test_long_tag_lists(void **state)
{
    (void)state;
    enum { MANY = 60000 };
    char *text = malloc(MANY * 16 + 64);
    assert_non_null(text);
    size_t used = (size_t)sprintf(text, "{\"family\": \"tag36h11\", \"side_m\": {");
    for (int i = 0; i < MANY; i++)
        used += (size_t)sprintf(text + used, "%s\"%d\": 0.2", i ? "," : "", i % 587);
    sprintf(text + used, "}}");
    scratch_text(&scratch, "many.json", text);
    free(text);
    struct mapper_tag *tags;
    int32_t count;
    EXPECT_STATUS(mapper_read_tags(scratch_file(&scratch, "many.json"), &tags, &count), ERR_INPUT);
    EXPECT_SAYS("60000 tags");
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
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names_in_lists),        cmocka_unit_test(test_frames_have_names_of_their_own),
        cmocka_unit_test(test_lenses_that_cannot_be), cmocka_unit_test(test_pictures_above_the_limit),
        cmocka_unit_test(test_long_tag_lists),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
