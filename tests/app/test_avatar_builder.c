// A take is prepared on a thread of its own: it ends with the same likeness every
// time, tells how far it is, and can be given up at any moment.
#include "tests/support/test.h"

#include "app/view/avatar_builder.h"
#include "base/clock.h"
#include "tests/support/rehearsal.h"

#include <stdatomic.h>
#include <string.h>

static struct rehearsal rehearsal;

static void count(void *self) { atomic_fetch_add((atomic_int *)self, 1); }

static struct likeness prepare(const char *take, enum status *status)
{
    atomic_int news = 0;
    struct preparation *p;
    struct likeness likeness = {0};
    const struct preparation_options how = {rehearsal.file, take, count, &news};
    EXPECT_STATUS(preparation_start(&p, &how), OK);
    double share = 0;
    struct room room;
    while (!preparation_ended(p, &likeness, &room, status)) {
        EXPECT_AT_LEAST(preparation_share(p), share);
        share = preparation_share(p);
        clock_sleep_until_ns(clock_now_ns() + 5000000);
    }
    room_free(&room);
    EXPECT_AT_LEAST(atomic_load(&news), *status == OK ? 3 : 1);
    preparation_close(&p);
    return likeness;
}

static void the_same_every_time(void **state)
{
    (void)state;
    enum status status;
    struct likeness a = prepare("turn", &status);
    EXPECT_STATUS(status, OK);
    struct likeness b = prepare("turn", &status);
    EXPECT_STATUS(status, OK);
    EXPECT_INT(a.surface.point_count, b.surface.point_count);
    size_t points = (size_t)a.surface.point_count;
    EXPECT_AT_LEAST((double)points, 5000);
    EXPECT_TRUE(!memcmp(a.surface.points, b.surface.points, sizeof *a.surface.points * points));
    EXPECT_TRUE(!memcmp(a.coat.color, b.coat.color, sizeof *a.coat.color * points));
    EXPECT_TRUE(!memcmp(a.adjustments, b.adjustments, sizeof *a.adjustments * (size_t)a.frame_count));
    likeness_free(&a);
    likeness_free(&b);
}

static void given_up_at_any_moment(void **state)
{
    (void)state;
    for (int ms = 0; ms < 500; ms = 2 * ms + 1) {
        atomic_int news = 0;
        struct preparation *p;
        const struct preparation_options how = {rehearsal.file, "turn", count, &news};
        EXPECT_STATUS(preparation_start(&p, &how), OK);
        clock_sleep_until_ns(clock_now_ns() + ms * 1000000ll);
        preparation_close(&p);
        EXPECT_TRUE(!p);
    }
}

static void what_is_not_there_is_said(void **state)
{
    (void)state;
    enum status status;
    struct likeness none = prepare("nobody", &status);
    EXPECT_STATUS(status, ERR_MISSING);
    EXPECT_SAYS("nobody");
    EXPECT_INT(none.surface.point_count, 0);
}

static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    return 0;
}

static int end(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_same_every_time),
        cmocka_unit_test(given_up_at_any_moment),
        cmocka_unit_test(what_is_not_there_is_said),
    };
    return cmocka_run_group_tests(tests, make, end);
}
