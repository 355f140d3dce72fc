// Tags to print: rendered as a printer would and read back by the detector at the size that was asked for.
#include "tests/support/test.h"

#include "capture/calibration/printed_tags.h"
#include "capture/mapping/mapper.h"
#include "platform/vision/tag_detector.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <unistd.h>

static const double DPI = 100;

// The tags of the only page, as its picture shows them.
static int read_page(const struct printed_tags *wanted, struct tag_detection *out, int capacity)
{
    struct page *page;
    struct tag_detector *detector;
    int width, height, stride, count;
    const struct paper_size size = paper_size(wanted->paper);
    EXPECT_STATUS(page_open(&page, NULL, size.width_mm, size.height_mm, DPI), OK);
    EXPECT_STATUS(printed_tags_draw(wanted, page), OK);
    const uint8_t *pixels = page_pixels(page, &width, &height, &stride);
    uint8_t *gray = malloc((size_t)width * (size_t)height);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            gray[y * width + x] = (uint8_t)(255 - pixels[y * stride + x]); // ink to light
    EXPECT_STATUS(tag_detector_open(&detector, 1), OK);
    EXPECT_STATUS(tag_detector_detect(detector, &(struct gray_image){gray, width, height}, out, capacity, &count), OK);
    tag_detector_close(&detector);
    free(gray);
    EXPECT_STATUS(page_finish(&page), OK);
    return count;
}

static double side_mm(const struct tag_detection *tag)
{
    double sum = 0;
    for (int k = 0; k < 4; k++)
        sum += hypot(tag->corner[k].x - tag->corner[(k + 1) % 4].x, tag->corner[k].y - tag->corner[(k + 1) % 4].y);
    return sum / 4 / DPI * 25.4;
}

static void test_printed_tags_have_their_size(void **state)
{
    (void)state;
    const int32_t ids[] = {0, 7, 30, 586, 12, 3};
    const double sides[] = {0.04, 0.07, 0.15};
    for (int paper = 0; paper < 2; paper++)
        for (size_t s = 0; s < COUNT_OF(sides); s++) {
            struct printed_tags wanted = {ids, 6, sides[s], (enum paper)paper};
            struct tag_detection seen[16];
            if (printed_tags_pages(&wanted) > 1)
                wanted.count = 6 / printed_tags_pages(&wanted); // one page's
            EXPECT_INT(printed_tags_pages(&wanted), 1);
            int count = read_page(&wanted, seen, 16);
            EXPECT_INT(count, wanted.count);
            for (int i = 0; i < count; i++)
                EXPECT_NEAR(side_mm(&seen[i]), sides[s] * 1e3, 0.5); // two pixels; the detector reads a third of one
        }
}

static void test_large_tags_take_several_pages(void **state)
{
    (void)state;
    const int32_t ids[] = {1, 2};
    // 0.4 m with margins is 0.5 m: three parts of 167 mm across A4's 186 mm, two of 253 mm down
    const struct printed_tags wanted = {ids, 2, 0.4, PAPER_A4};
    EXPECT_INT(printed_tags_pages(&wanted), 2 * 3 * 2);
    EXPECT_INT(printed_tags_pages(&(struct printed_tags){ids, 2, 0.15, PAPER_A4}), 2);
}

static void test_files(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    const int32_t ids[] = {0, 1, 40};
    const struct printed_tags wanted = {ids, 3, 0.4, PAPER_LETTER};
    const struct paper_size size = paper_size(PAPER_LETTER);
    struct page *page;
    char *text;
    struct mapper_tag *tags;
    int32_t count;
    EXPECT_STATUS(page_open(&page, scratch_file(&scratch, "tags.pdf"), size.width_mm, size.height_mm, 0), OK);
    EXPECT_STATUS(printed_tags_draw(&wanted, page), OK);
    EXPECT_STATUS(page_finish(&page), OK);
    EXPECT_INT(access(scratch_file(&scratch, "tags.pdf"), R_OK), 0);
    // What map reads is what was printed.
    EXPECT_STATUS(printed_tags_list(&wanted, &text), OK);
    scratch_text(&scratch, "tags.json", text);
    free(text);
    EXPECT_STATUS(mapper_read_tags(scratch_file(&scratch, "tags.json"), &tags, &count), OK);
    EXPECT_INT(count, 3);
    EXPECT_INT(tags[2].id, 40);
    EXPECT_NEAR(tags[2].side_m, 0.4, 0);
    free(tags);
    // Nothing stays of pages that were given up.
    EXPECT_STATUS(page_open(&page, scratch_file(&scratch, "no.pdf"), size.width_mm, size.height_mm, 0), OK);
    page_discard(&page);
    EXPECT_TRUE(access(scratch_file(&scratch, "no.pdf"), F_OK) != 0);
    scratch_remove(&scratch);
}

static void test_refused(void **state)
{
    (void)state;
    const int32_t twice[] = {1, 1}, far[] = {587};
    struct page *page;
    EXPECT_STATUS(page_open(&page, NULL, 0, 297, 50), ERR_INPUT);
    EXPECT_STATUS(page_open(&page, "/nowhere/x.pdf", 210, 297, 0), ERR_IO);
    EXPECT_STATUS(page_open(&page, NULL, 210, 297, 50), OK);
    EXPECT_STATUS(printed_tags_draw(&(struct printed_tags){twice, 2, 0.1, PAPER_A4}, page), ERR_INPUT);
    EXPECT_STATUS(printed_tags_draw(&(struct printed_tags){far, 1, 0.1, PAPER_A4}, page), ERR_INPUT);
    EXPECT_STATUS(printed_tags_draw(&(struct printed_tags){twice, 1, 5, PAPER_A4}, page), ERR_INPUT);
    EXPECT_STATUS(printed_tags_draw(&(struct printed_tags){twice, 0, 0.1, PAPER_A4}, page), ERR_INPUT);
    page_discard(&page);
}

int main(void)
{
    if (!page_available()) {
        printf("built without cairo: no pages to print\n");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_printed_tags_have_their_size),
        cmocka_unit_test(test_large_tags_take_several_pages),
        cmocka_unit_test(test_files),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
