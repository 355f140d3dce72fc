// What is said of input that a foreign library refuses: our sentence, with the likely cause first, and not the
// library's own words. And what a file is that is not what it was taken for.
#include "tests/support/test.h"

#include "platform/files/database.h"
#include "platform/files/file.h"
#include "platform/files/image_file.h"
#include "platform/files/png.h"
#include "platform/files/video.h"
#include "platform/sensors/source.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>
#include <turbojpeg.h>
#include <unistd.h>

static struct scratch scratch;

// A film that cannot be written says why in the system's words, whatever FFmpeg makes of it, and nothing on stderr.
static enum status film_to(FILE *out, const int64_t *times_s, int count)
{
    static uint8_t rgb[64 * 64 * 3];
    struct rng rng = {1};
    struct video_writer *w;
    enum status status = video_open(&w, out, &(struct video_layout){64, 64, false});
    for (int i = 0; i < count && status == OK; i++) {
        for (size_t k = 0; k < sizeof rgb; k++)
            rgb[k] = (uint8_t)(rng_uniform(&rng) * 256);
        status = video_add(w, rgb, times_s[i] * 1000000000);
    }
    return video_close(&w, status);
}

static void test_films(void **state)
{
    (void)state;
    enum { SECONDS = 40 };
    int64_t times_s[SECONDS];
    char said[200] = "";
    for (int i = 0; i < SECONDS; i++)
        times_s[i] = i;
    FILE *kept = fopen(scratch_file(&scratch, "stderr"), "w+"), *full = fopen("/dev/full", "wb"), *good = tmpfile();
    assert_true(kept && full && good);
    const int before = dup(STDERR_FILENO);
    fflush(stderr);
    dup2(fileno(kept), STDERR_FILENO);
    const enum status on_full = film_to(full, times_s, SECONDS);
    char full_said[512];
    snprintf(full_said, sizeof full_said, "%s", status_message());
    times_s[2] = 86401; // a clock that jumped by a day
    const enum status a_day = film_to(good, times_s, 3);
    char day_said[512];
    snprintf(day_said, sizeof day_said, "%s", status_message());
    fflush(stderr);
    dup2(before, STDERR_FILENO);
    close(before);
    rewind(kept);
    if (strstr(full_said, "FFmpeg's libraries"))
        skip_without("FFmpeg's libraries");
    EXPECT_STATUS(on_full, ERR_IO);
    assert_string_equal(full_said, "the film could not be written: the disk is full");
    EXPECT_STATUS(a_day, ERR_INPUT);
    print_message("%s\n", day_said);
    EXPECT_TRUE(strstr(day_said, "24.0 hours apart") && strstr(day_said, "times are wrong"));
    EXPECT_TRUE(!fgets(said, sizeof said, kept)); // nothing was
    if (*said)
        print_error("on stderr: %s\n", said);
    fclose(full);
    fclose(good);
    fclose(kept);
}

static void expect_picture(const char *name, const char *words)
{
    struct image image;
    const enum status status = image_read(scratch_file(&scratch, name), &image);
    if (status != ERR_INPUT || !strstr(status_message(), words))
        print_error("%s: %s (%s)\n", name, status_name(status), status_message());
    EXPECT_STATUS(status, ERR_INPUT);
    EXPECT_SAYS(words);
    EXPECT_SAYS(name);
}

static void test_pictures(void **state)
{
    (void)state;
    static uint16_t deep[16 * 16];
    static uint8_t cmyk[16 * 16 * 4];
    EXPECT_STATUS(png_write(scratch_file(&scratch, "deep.png"), PNG_GRAY16, deep, 16, 16), OK);
    expect_picture("deep.png", "save it as a PNG of 8 bits");
    unsigned char *coded = NULL;
    unsigned long size = 0;
    tjhandle handle = tjInitCompress();
    EXPECT_INT(tjCompress2(handle, cmyk, 16, 0, 16, TJPF_CMYK, &coded, &size, TJSAMP_444, 90, 0), 0);
    scratch_write(&scratch, "print.jpg", coded, size);
    tjFree(coded);
    tjDestroy(handle);
    expect_picture("print.jpg", "CMYK");
    EXPECT_SAYS("RGB");
    scratch_write(&scratch, "a.webp", "RIFF\0\0\0\0WEBPVP8 ", 16);
    expect_picture("a.webp", "it is a WebP picture");
    void *pixels;
    int width, height;
    EXPECT_STATUS(png_read(scratch_file(&scratch, "a.webp"), PNG_GRAY16, &pixels, &width, &height), ERR_INPUT);
    EXPECT_SAYS("a.webp is no PNG picture: it is a WebP picture");
    static uint8_t shallow[16 * 16];
    EXPECT_STATUS(png_write(scratch_file(&scratch, "depth.png"), PNG_GRAY8, shallow, 16, 16), OK);
    EXPECT_STATUS(png_read(scratch_file(&scratch, "depth.png"), PNG_GRAY16, &pixels, &width, &height), ERR_INPUT);
    EXPECT_SAYS("8 bits");
    EXPECT_SAYS("no distances");
}

static void test_what_is_no_recording(void **state)
{
    (void)state;
    static const struct {
        const char *name, *bytes;
        size_t count;
        const char *is;
    } cases[] = {
#define CASE(name, bytes, is) {name, bytes, sizeof(bytes) - 1, is}
        CASE("pointer", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n", "git lfs pull"),
        CASE("zip", "PK\x03\x04 and the rest of it", "a zip archive: unpack it first"),
        CASE("mkv", "\x1a\x45\xdf\xa3 and the rest", "mkv:FILE"),
        CASE("mp4",
             "\0\0\0\x18"
             "ftypisom",
             "a film"),
        CASE("oni", "NI10\0\0\0\0", "oni:FILE"),
        CASE("csv", "timestamp,joint,x_m\n", "reenact compare"),
        CASE("new csv", "# axes: room\ntimestamp,joint,x_m\n", "reenact compare"),
        CASE("other csv", "frame,x,y\n1,2,3\n", "a text file"),
        CASE("json", "{\"a\": 1}", "JSON"),
        CASE("page", "<!DOCTYPE html><html>", "a web page"),
        CASE("zeros", "\0\0\0\0\0\0\0\0\0\0\0\0", "nothing but zeros"),
        CASE("empty", "", "empty"),
        CASE("noise", "\x91\x02\xee\x00\x17\xc3\x88", "repair"),
#undef CASE
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        struct database *db;
        struct source *s;
        char uri[400];
        char path[320];
        snprintf(path, sizeof path, "%s", scratch_file(&scratch, cases[i].name));
        scratch_write(&scratch, cases[i].name, cases[i].bytes, cases[i].count);
        if (cases[i].count) { // SQLite takes an empty file for an empty database
            EXPECT_STATUS(database_open(&db, path, DATABASE_READ), ERR_FORMAT);
            EXPECT_SAYS("is not a recording");
            EXPECT_SAYS(cases[i].is);
            EXPECT_TRUE(!strstr(status_message(), "SQLite"));
        }
        snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, cases[i].name));
        EXPECT_STATUS(source_open(&s, uri, SOURCE_SENSOR), ERR_INPUT);
        EXPECT_SAYS("is no folder of pictures: it is");
        EXPECT_SAYS(strcmp(cases[i].name, "noise") ? cases[i].is : "a file");
        EXPECT_STATUS(source_open(&s, path, SOURCE_SENSOR), ERR_INPUT);
        EXPECT_SAYS(!strcmp(cases[i].name, "oni")   ? "write oni:/"
                    : !strcmp(cases[i].name, "mkv") ? "write mkv:/"
                    : !strcmp(cases[i].name, "zip") ? "write r3d:/"
                                                    : "names no sensor; a sensor is");
        EXPECT_STATUS(source_open(&s, scratch.path, SOURCE_CAMERA), ERR_INPUT);
        EXPECT_SAYS("write folder:/");
    }
    EXPECT_TRUE(!file_kind(scratch.path) && !file_kind(scratch_file(&scratch, "nowhere")));
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
        cmocka_unit_test(test_films),
        cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_what_is_no_recording),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
