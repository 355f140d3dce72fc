// An avatar built in the background is the same every time; progress is reported, and building can be cancelled at any
// moment.
#include "tests/support/test.h"

#include "app/view/avatar_builder.h"
#include "base/clock.h"
#include "tests/support/rehearsed.h"

#include <stdatomic.h>
#include <string.h>

static struct rehearsed rehearsed;

static void count(void *self) { atomic_fetch_add((atomic_int *)self, 1); }

static struct avatar build(const char *path, enum status *status)
{
    atomic_int news = 0;
    struct avatar_builder *p;
    struct avatar avatar = {0};
    const struct avatar_builder_options how = {path, rehearsed.take, count, &news};
    EXPECT_STATUS(avatar_builder_start(&p, &how), OK);
    double share = 0;
    struct occluder_mesh occluders;
    while (!avatar_builder_finished(p, &avatar, &occluders, status)) {
        EXPECT_AT_LEAST(avatar_builder_progress(p), share);
        share = avatar_builder_progress(p);
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    occluder_mesh_free(&occluders);
    EXPECT_AT_LEAST(atomic_load(&news), *status == OK ? 3 : 1);
    avatar_builder_close(&p);
    return avatar;
}

static void test_deterministic(void **state)
{
    (void)state;
    enum status status;
    struct avatar a = build(rehearsed.rehearsal.file, &status);
    EXPECT_STATUS(status, OK);
    struct avatar b = build(rehearsed.rehearsal.file, &status);
    EXPECT_STATUS(status, OK);
    EXPECT_INT(a.surface.point_count, b.surface.point_count);
    size_t points = (size_t)a.surface.point_count;
    EXPECT_AT_LEAST((double)points, 5000);
    EXPECT_TRUE(!memcmp(a.surface.points, b.surface.points, sizeof *a.surface.points * points));
    EXPECT_TRUE(!memcmp(a.vertex_colors.color, b.vertex_colors.color, sizeof *a.vertex_colors.color * points));
    EXPECT_TRUE(!memcmp(a.frame_corrections, b.frame_corrections, sizeof *a.frame_corrections * (size_t)a.frame_count));
    avatar_free(&a);
    avatar_free(&b);
}

static void test_cancel_at_any_moment(void **state)
{
    (void)state;
    for (int ms = 0; ms < 500; ms = 2 * ms + 1) {
        atomic_int news = 0;
        struct avatar_builder *p;
        const struct avatar_builder_options how = {rehearsed.rehearsal.file, rehearsed.take, count, &news};
        EXPECT_STATUS(avatar_builder_start(&p, &how), OK);
        clock_sleep_until_ns(clock_now_ns() + ms * 1000000ll);
        avatar_builder_close(&p);
        EXPECT_TRUE(!p);
    }
}

static void test_missing_input_is_reported(void **state)
{
    (void)state;
    enum status status;
    struct avatar none = build("/nowhere/at.all", &status);
    EXPECT_STATUS(status, ERR_MISSING);
    EXPECT_SAYS("/nowhere/at.all");
    EXPECT_INT(none.surface.point_count, 0);
}

static int make(void **state)
{
    (void)state;
    EXPECT_STATUS(rehearsed_open(&rehearsed, 0), OK);
    return 0;
}

static int end(void **state)
{
    (void)state;
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_deterministic),
        cmocka_unit_test(test_cancel_at_any_moment),
        cmocka_unit_test(test_missing_input_is_reported),
    };
    return cmocka_run_group_tests(tests, make, end);
}
