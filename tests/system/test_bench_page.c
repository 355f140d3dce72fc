// The page of reenact-bench: it needs nothing from elsewhere, and a real browser (Chromium) shows it in light and dark,
// on a phone's width, and prints it. Without Chromium those are skipped.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/png.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <unistd.h>

#define CHROMIUM "/usr/bin/chromium"

static struct scratch scratch;
static char page[300];

static int make_page(void **state)
{
    (void)state;
    scratch = scratch_make();
    snprintf(page, sizeof page, "%s", scratch_file(&scratch, "page.html"));
    const struct process_result r =
        PROCESS(PROGRAM_DIR "/reenact-bench", "depth", "--html", page, "--json", "--rounds", "2");
    if (r.exit_code)
        print_error("%s\n", r.err);
    return r.exit_code;
}

static int remove_page(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

static void test_lists_stages(void **state)
{
    (void)state;
    const struct process_result r = PROCESS(PROGRAM_DIR "/reenact-bench");
    EXPECT_INT(r.exit_code, 0);
    EXPECT_TRUE(strstr(r.out, "\n* depth ") && strstr(r.out, "\n  stability "));
}

static void test_page_needs_nothing_from_elsewhere(void **state)
{
    (void)state;
    uint8_t *text = NULL;
    size_t size;
    EXPECT_STATUS(file_read(page, &text, &size), OK);
    const char *const html = (const char *)text;
    EXPECT_TRUE(!strncmp(html, "<!DOCTYPE html>", 15));
    EXPECT_TRUE(!strstr(html, "http://") && !strstr(html, "https://") && !strstr(html, "<script") &&
                !strstr(html, "@import") && !strstr(html, "<link"));
    for (const char *at = html; (at = strstr(at, "src=\"")); at += 5)
        EXPECT_TRUE(!strncmp(at + 5, "data:", 5));
    EXPECT_TRUE(strstr(html, "class=\"frontier\"") && strstr(html, "class=\"ring\"") && strstr(html, "(default)"));
    EXPECT_TRUE(strstr(html, "prefers-color-scheme:dark") && strstr(html, "@media print"));
    free(text);
}

// What an error looks like, at three settings.
static void test_a_stage_has_pictures(void **state)
{
    (void)state;
    char file[300];
    uint8_t *text = NULL;
    size_t size;
    int pictures = 0;
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "compare.html"));
    const struct process_result r = PROCESS(PROGRAM_DIR "/reenact-bench", "compare", "--html", file, "--rounds", "1");
    EXPECT_INT(r.exit_code, 0);
    EXPECT_STATUS(file_read(file, &text, &size), OK);
    for (const char *at = (const char *)text; (at = strstr(at, "src=\"data:image/jpeg;")); at++)
        pictures++;
    EXPECT_INT(pictures, 3);
    EXPECT_TRUE(strstr((const char *)text, "FastDTW, radius 1: "));
    free(text);
}

// Where Chromium keeps what it keeps: not with the user's settings, and the tests have no folder for those.
static const char *profile(char option[400])
{
    snprintf(option, 400, "--user-data-dir=%s", scratch_file(&scratch, "chromium"));
    return option;
}

// A screenshot's pixels, RGB; freed by the caller.
static uint8_t *shoot(const char *name, const char *scheme, int width, int height)
{
    char shot[300], option[400], size[64], preferred[64], url[320], kept[400];
    void *pixels = NULL;
    int w = 0, h = 0;
    snprintf(shot, sizeof shot, "%s", scratch_file(&scratch, name));
    snprintf(option, sizeof option, "--screenshot=%s", shot);
    snprintf(size, sizeof size, "--window-size=%d,%d", width, height);
    snprintf(preferred, sizeof preferred, "--blink-settings=preferredColorScheme=%s", scheme);
    snprintf(url, sizeof url, "file://%s", page);
    const struct process_result r = PROCESS(CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", profile(kept),
                                            "--hide-scrollbars", preferred, size, option, url);
    EXPECT_INT(r.exit_code, 0);
    EXPECT_STATUS(png_read(shot, PNG_RGB8, &pixels, &w, &h), OK);
    EXPECT_INT(w, width);
    EXPECT_INT(h, height);
    return pixels;
}

static bool no_browser(void)
{
#ifdef EMULATED
    print_message("not under an emulator\n");
    return true;
#else
    if (!access(CHROMIUM, X_OK))
        return false;
    print_message("without " CHROMIUM "\n");
    return true;
#endif
}

// Of the page's colours: how many pixels are its ground, and its marks.
static void count_colors(const uint8_t *rgb, int pixels, const uint8_t ground[3], const uint8_t mark[3], int *of_ground,
                         int *of_mark)
{
    *of_ground = *of_mark = 0;
    for (int i = 0; i < pixels; i++) {
        *of_ground += !memcmp(rgb + 3 * i, ground, 3);
        *of_mark += !memcmp(rgb + 3 * i, mark, 3);
    }
}

static void test_browser_shows_light_and_dark(void **state)
{
    (void)state;
    static const struct {
        const char *name, *scheme;
        int width;
        uint8_t ground[3], mark[3]; // as bench_page.c has them
    } views[] = {{"light.png", "1", 1000, {0xff, 0xff, 0xff}, {0x0b, 0x62, 0xc4}},
                 {"dark.png", "0", 1000, {0x12, 0x16, 0x1c}, {0x6d, 0xb1, 0xff}},
                 {"phone.png", "1", 390, {0xff, 0xff, 0xff}, {0x0b, 0x62, 0xc4}}};
    enum { HEIGHT = 1200 };
    if (no_browser())
        skip_without("a browser (chromium)");
    for (size_t i = 0; i < COUNT_OF(views); i++) {
        int ground, mark;
        uint8_t *rgb = shoot(views[i].name, views[i].scheme, views[i].width, HEIGHT);
        count_colors(rgb, views[i].width * HEIGHT, views[i].ground, views[i].mark, &ground, &mark);
        print_message("%s: %d of %d pixels ground, %d marks\n", views[i].name, ground, views[i].width * HEIGHT, mark);
        EXPECT_AT_LEAST(ground, 0.6 * views[i].width * HEIGHT);
        EXPECT_AT_LEAST(mark, 60);
        free(rgb);
    }
}

static void test_browser_prints(void **state)
{
    (void)state;
    char pdf[400], url[320], kept[400];
    uint8_t *bytes = NULL;
    size_t size = 0;
    if (no_browser())
        skip_without("a browser (chromium)");
    snprintf(pdf, sizeof pdf, "--print-to-pdf=%s", scratch_file(&scratch, "page.pdf"));
    snprintf(url, sizeof url, "file://%s", page);
    const struct process_result r =
        PROCESS(CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", profile(kept), pdf, url);
    EXPECT_INT(r.exit_code, 0);
    EXPECT_STATUS(file_read(scratch_file(&scratch, "page.pdf"), &bytes, &size), OK);
    EXPECT_TRUE(size > 5000 && !memcmp(bytes, "%PDF", 4));
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lists_stages), cmocka_unit_test(test_page_needs_nothing_from_elsewhere),
        cmocka_unit_test(test_a_stage_has_pictures), cmocka_unit_test(test_browser_shows_light_and_dark),
        cmocka_unit_test(test_browser_prints)};
    return cmocka_run_group_tests(tests, make_page, remove_page);
}
