// Letters beyond Latin: not in the atlas until a text holds them, and then from the next frame on; what the app's font
// lacks comes from the computer's fonts. Debian's fontconfig brings DejaVu Sans, which has Georgian and Arabic.
#include "tests/support/test.h"

#include "app/ui/theme.h"
#include "platform/screen/gpu_internal.h"
#include "platform/screen/ui.h"
#include "reenact/render/shaders.h"

static struct gpu *gpu;
static struct ui *ui;

static const char greek[] = "Ελένη", cyrillic[] = "Мария", vietnamese[] = "Nguyễn", latin[] = "Zoë",
                  georgian[] = "გიორგი", arabic[] = "سلام";

// One frame with that text in all faces. Returns its width in the body's, dp.
static double draw_at(double px_per_dp, const char *text)
{
    const struct ui_input input = {.width_px = 640, .height_px = 480, .px_per_dp = px_per_dp};
    EXPECT_STATUS(ui_begin(ui, &input), OK);
    for (int face = 0; face < FACE_COUNT; face++)
        ui_text(ui, face, (struct ui_point){10, 10}, 0xffffffff, text);
    const double width = ui_text_width(ui, FACE_BODY, text);
    ui_end(ui);
    return width;
}

static double draw(const char *text) { return draw_at(1, text); }

static void test_letters_come_with_the_next_frame(void **state)
{
    (void)state;
    const double question_marks[3] = {draw("?????"), draw("?????"), draw("Nguy?n")};
    const char *const names[3] = {greek, cyrillic, vietnamese};
    draw(latin);
    EXPECT_TRUE(!ui_letters_wanted(ui));
    for (int i = 0; i < 3; i++) {
        const double before = draw(names[i]);
        EXPECT_TRUE(ui_letters_wanted(ui) == (i == 0));
        if (i == 0)
            EXPECT_NEAR(before, question_marks[i], 0.01);
        const double width = draw(names[i]);
        print_message("%s %.1f, question marks %.1f\n", names[i], width, question_marks[i]);
        EXPECT_TRUE(!ui_letters_wanted(ui));
        EXPECT_AT_LEAST(fabs(width - question_marks[i]), 0.5);
    }
}

static void test_letters_of_the_computers_fonts(void **state)
{
    (void)state;
    const double question_marks = draw("??????");
    EXPECT_NEAR(draw(georgian), question_marks, 0.01);
    EXPECT_TRUE(ui_letters_wanted(ui));
    const double width = draw(georgian);
    print_message("%s %.1f, question marks %.1f\n", georgian, width, question_marks);
    EXPECT_TRUE(!ui_letters_wanted(ui));
    EXPECT_AT_LEAST(fabs(width - question_marks), 0.5);
    EXPECT_NEAR(draw_at(1.5, georgian), width, 0.05 * width); // of another size, too
    draw(latin);
    EXPECT_AT_LEAST(fabs(draw(greek) - draw("?????")), 0.5); // with the others
    EXPECT_NEAR(draw(georgian), width, 0.01);
}

// They would have to be joined and drawn from right to left; and no font has U+2C2F. Neither is asked for again and
// again.
static void test_letters_that_cannot_be_drawn(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        EXPECT_NEAR(draw(arabic), draw("????"), 0.01);
        EXPECT_TRUE(!ui_letters_wanted(ui));
        draw("\u2c2f"); // no letter at all
    }
    EXPECT_TRUE(!ui_letters_wanted(ui));
    EXPECT_NEAR(draw("\u2c2f"), draw("?"), 0.01);
    EXPECT_AT_LEAST(draw("\xff\xe3\x81"), 1); // not UTF-8
    EXPECT_TRUE(!ui_letters_wanted(ui));
}

// Where the GPU takes no atlas of that many letters, the others are still drawn.
static void test_small_gpu(void **state)
{
    (void)state;
    const int largest = gpu->max_size;
    gpu->max_size = 1024;
    const double width = draw_at(0.7, latin);
    draw_at(0.7, cyrillic);
    for (int i = 0; i < 2; i++) {
        draw_at(0.7, cyrillic);
        EXPECT_TRUE(!ui_letters_wanted(ui));
    }
    EXPECT_NEAR(draw_at(0.7, cyrillic), draw_at(0.7, "?????"), 0.01);
    EXPECT_NEAR(draw_at(0.7, latin), width, 0.01);
    gpu->max_size = largest;
    EXPECT_AT_LEAST(fabs(draw_at(1, cyrillic) - draw_at(1, "?????")), 0.5); // a larger one later
}

static int set_up(void **state)
{
    (void)state;
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    return gpu_open(&gpu) != OK || ui_open(&ui, gpu, &shaders, theme_faces(), FACE_COUNT) != OK;
}

static int tear_down(void **state)
{
    (void)state;
    ui_close(&ui);
    gpu_close(&gpu);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_letters_come_with_the_next_frame), cmocka_unit_test(test_letters_of_the_computers_fonts),
        cmocka_unit_test(test_letters_that_cannot_be_drawn), cmocka_unit_test(test_small_gpu)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
