// Sources for the first images of a long take are chosen from some of its frames, and from all as soon as a thread has
// prepared that: then the choice is the exact one.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/screen/gpu.h"
#include "reenact/render/cylinder_renderer.h"
#include "tests/support/rehearsed.h"

enum { FIRST = 3 };

static void test_choice_becomes_exact(void **state)
{
    (void)state;
    struct rehearsed rehearsed;
    struct gpu *gpu;
    struct cylinder_renderer *exact, *early;
    EXPECT_STATUS(rehearsed_open(&rehearsed, 0), OK);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(cylinder_renderer_open(&exact, gpu, rehearsed.take, 1 << 24, 0), OK);
    EXPECT_STATUS(cylinder_renderer_open(&early, gpu, rehearsed.take, 1 << 24, FIRST), OK);
    const int64_t frames = take_frame_count(rehearsed.take), until_ns = clock_now_ns() + 20000000000;
    int64_t right = 0;
    // Each frame, asked for by its own skeleton, is its own nearest.
    while (right < frames && clock_now_ns() < until_ns) {
        right = 0;
        for (int64_t i = 0; i < frames; i++) {
            struct frame_selection wanted, got;
            const struct skeleton *s = &take_entry(rehearsed.take, i)->skeleton;
            EXPECT_STATUS(cylinder_renderer_select(exact, s, &wanted), OK);
            EXPECT_STATUS(cylinder_renderer_select(early, s, &got), OK);
            EXPECT_INT(wanted.frame, i);
            right += got.frame == wanted.frame;
        }
    }
    EXPECT_INT(right, frames);
    cylinder_renderer_close(&early);
    EXPECT_STATUS(cylinder_renderer_open(&early, gpu, rehearsed.take, 1 << 24, 1), OK);
    cylinder_renderer_close(&early); // while the thread may be at work
    cylinder_renderer_close(&exact);
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_choice_becomes_exact)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
