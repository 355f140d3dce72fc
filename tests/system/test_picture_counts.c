// A camera's pictures are counted alike, and in the same words, by the commands that look for the camera in a place.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REENACT PROGRAM_DIR "/reenact"

static struct rehearsal rehearsal;

static void write_grey(const char *name, int width, int height, size_t less)
{
    uint8_t *rgb = malloc((size_t)width * (size_t)height * 3), *bytes;
    size_t count;
    assert_non_null(rgb);
    memset(rgb, 128, (size_t)width * (size_t)height * 3);
    EXPECT_STATUS(jpeg_encode(rgb, width, height, 90, &bytes, &count), OK);
    EXPECT_STATUS(file_write(scratch_file(&rehearsal.scratch, name), bytes, count - less), OK);
    free(bytes);
    free(rgb);
}

// The walk's four pictures, then one of nothing, two of another size and one that is cut short.
static void spoil_walk(void)
{
    uint8_t *list;
    size_t count;
    char text[2000];
    struct calibration c;
    EXPECT_STATUS(calibration_read(scratch_file(&rehearsal.scratch, "viewer/calibration.json"), &c), OK);
    EXPECT_STATUS(file_read(scratch_file(&rehearsal.scratch, "viewer/rgb.txt"), &list, &count), OK);
    snprintf(text, sizeof text, "%s\n9001 grey.jpg\n9002 half.jpg\n9003 turned.jpg\n9004 cut.jpg\n", (char *)list);
    free(list);
    scratch_text(&rehearsal.scratch, "viewer/rgb.txt", text);
    write_grey("viewer/grey.jpg", c.color.width, c.color.height, 0);
    write_grey("viewer/half.jpg", c.color.width / 2, c.color.height / 2, 0);
    write_grey("viewer/turned.jpg", c.color.height, c.color.width, 0);
    write_grey("viewer/cut.jpg", c.color.width, c.color.height, 300);
}

static void expect_counts(const char *text)
{
    static const struct {
        const char *name;
        int wanted;
    } counts[] = {{"pictures", 8}, {"placed", 4}, {"ambiguous", 0}, {"not_placed", 1}, {"damaged", 3}};
    struct json *root = NULL;
    scratch_text(&rehearsal.scratch, "said.json", text);
    EXPECT_STATUS(json_read(scratch_file(&rehearsal.scratch, "said.json"), &root), OK);
    for (size_t i = 0; i < COUNT_OF(counts); i++) {
        double value = -1;
        EXPECT_TRUE(json_get_number(json_member(root, counts[i].name), &value));
        if ((int)value != counts[i].wanted)
            print_error("%s\n", counts[i].name);
        EXPECT_INT((int)value, counts[i].wanted);
    }
    json_free(&root);
}

static void test_counts_and_words(void **state)
{
    (void)state;
    static const char words[] = "4 of 8 pictures placed, 1 not placed, 3 unreadable or of another size";
    char trajectory[300], pictures[300];
    spoil_walk();
    snprintf(trajectory, sizeof trajectory, "%s", scratch_file(&rehearsal.scratch, "walk.txt"));
    snprintf(pictures, sizeof pictures, "%s", scratch_file(&rehearsal.scratch, "pictures"));
    for (int json = 0; json < 2; json++)
        for (int render = 0; render < 2; render++) {
            const char *const last = json ? "--json" : "--force";
            const struct process_result said =
                render ? PROCESS(REENACT, "render", rehearsal.file, "--take", "turn", "--camera", rehearsal.camera,
                                 "--detail", "paper", "--out", pictures, "--force", last)
                       : PROCESS(REENACT, "locate", rehearsal.file, "--camera", rehearsal.camera, "--out", trajectory,
                                 "--force", last);
            EXPECT_INT(said.exit_code, 0);
            if (json)
                expect_counts(said.out);
            else if (!strstr(said.out, words))
                print_error("'%s' without '%s'\n", said.out, words);
            EXPECT_TRUE(json || strstr(said.out, words));
            // Each that cannot be read is named, with what is wrong with it.
            EXPECT_TRUE(strstr(said.err, "half.jpg has ") && strstr(said.err, "turned.jpg has "));
            EXPECT_TRUE(strstr(said.err, "cut.jpg: a JPEG picture is damaged"));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_counts_and_words)};
    rehearsal = rehearsal_make();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    rehearsal_end(&rehearsal);
    return failed;
}
