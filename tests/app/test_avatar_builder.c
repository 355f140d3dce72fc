// An avatar built in the background is the same every time, and the one that the recording keeps; progress is reported,
// and building can be cancelled at any moment.
#include "tests/support/test.h"

#include "app/view/avatar_builder.h"
#include "base/clock.h"
#include "reenact/avatar/avatar.h"
#include "tests/support/rehearsed.h"

#include <stdatomic.h>
#include <string.h>

static struct rehearsed rehearsed;

static void count(void *self) { atomic_fetch_add((atomic_int *)self, 1); }

// What a builder gave.
struct built {
    struct avatar avatar;
    enum status status, kept;
    int simple_points; // of the simple avatar's surface; 0: there was none
};

static struct built build(const char *path)
{
    atomic_int news = 0;
    struct avatar_builder *p;
    struct built b = {0};
    const struct avatar_builder_options options = {path, rehearsed.take, count, &news};
    EXPECT_STATUS(avatar_builder_start(&p, &options), OK);
    avatar_builder_begin(p, AVATAR_WANTED_FULL);
    double share = 0;
    for (enum avatar_news got = AVATAR_NO_NEWS; got != AVATAR_FULL;) {
        EXPECT_AT_LEAST(avatar_builder_progress(p), share);
        share = avatar_builder_progress(p);
        got = avatar_builder_take(p, &b.avatar, &b.status);
        if (got == AVATAR_SIMPLE) {
            EXPECT_STATUS(b.status, OK);
            EXPECT_INT(b.simple_points, 0); // once
            b.simple_points = b.avatar.surface.point_count;
            avatar_free(&b.avatar);
        }
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    struct occluder_mesh occluders = {0};
    while (!avatar_builder_ended(p))
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    EXPECT_TRUE(avatar_builder_take_occluders(p, &occluders));
    EXPECT_TRUE(!avatar_builder_take_occluders(p, &occluders));
    occluder_mesh_free(&occluders);
    EXPECT_AT_LEAST(atomic_load(&news), 1);
    b.kept = avatar_builder_kept(p);
    avatar_builder_close(&p);
    return b;
}

static void expect_same(const struct avatar *a, const struct avatar *b)
{
    uint8_t *bytes[2];
    size_t counts[2];
    EXPECT_STATUS(avatar_pack(a, &bytes[0], &counts[0]), OK);
    EXPECT_STATUS(avatar_pack(b, &bytes[1], &counts[1]), OK);
    EXPECT_INT(counts[0], counts[1]);
    assert_memory_equal(bytes[0], bytes[1], counts[0]);
    free(bytes[0]);
    free(bytes[1]);
}

// While another program records into the file.
static void test_what_cannot_be_kept_is_said(void **state)
{
    (void)state;
    struct recording_writer *writer;
    EXPECT_STATUS(recording_append(&writer, rehearsed.rehearsal.file), OK);
    struct built a = build(rehearsed.rehearsal.file);
    EXPECT_STATUS(a.status, OK);
    EXPECT_STATUS(a.kept, ERR_IO);
    EXPECT_SAYS("made again");
    EXPECT_STATUS(recording_close(&writer), OK);
    avatar_free(&a.avatar);
}

// The first time a simple avatar comes before the full one. The second time the full one is read from the recording,
// the same to the bit; and it is what avatar_make gives.
static void test_kept_avatar_is_the_same(void **state)
{
    (void)state;
    struct built a = build(rehearsed.rehearsal.file), b = build(rehearsed.rehearsal.file);
    EXPECT_STATUS(a.status, OK);
    EXPECT_STATUS(b.status, OK);
    EXPECT_TRUE(a.kept == OK && b.kept == OK);
    EXPECT_AT_LEAST(a.avatar.surface.point_count, 5000);
    EXPECT_AT_LEAST(a.simple_points, 1000);
    EXPECT_INT(b.simple_points, 0);
    expect_same(&a.avatar, &b.avatar);
    if (!SANITIZED) { // no thread takes part in it
        struct avatar made;
        const struct avatar_options options = avatar_default_options();
        EXPECT_STATUS(avatar_make(&made, rehearsed.take, rehearsed.rays, &options), OK);
        expect_same(&a.avatar, &made);
        avatar_free(&made);
    }
    avatar_free(&a.avatar);
    avatar_free(&b.avatar);
}

// Who looks from afar waits for the simple avatar alone; the full one is made once it is wanted.
static void test_full_avatar_waits_until_it_is_wanted(void **state)
{
    (void)state;
    atomic_int news = 0;
    struct avatar_builder *p;
    struct avatar avatar;
    enum status status;
    enum avatar_news got;
    struct recording_writer *writer; // so that nothing is kept for the other tests
    const struct avatar_builder_options options = {rehearsed.rehearsal.file, rehearsed.take, count, &news};
    EXPECT_STATUS(recording_append(&writer, rehearsed.rehearsal.file), OK);
    EXPECT_STATUS(avatar_builder_start(&p, &options), OK);
    avatar_builder_begin(p, AVATAR_WANTED_SIMPLE);
    while ((got = avatar_builder_take(p, &avatar, &status)) == AVATAR_NO_NEWS)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    EXPECT_INT(got, AVATAR_SIMPLE);
    EXPECT_STATUS(status, OK);
    avatar_free(&avatar);
    avatar_builder_begin(p, AVATAR_WANTED_NONE); // never less
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    EXPECT_INT(avatar_builder_take(p, &avatar, &status), AVATAR_NO_NEWS);
    EXPECT_NEAR(avatar_builder_progress(p), 0, 0);
    avatar_builder_begin(p, AVATAR_WANTED_FULL);
    while ((got = avatar_builder_take(p, &avatar, &status)) == AVATAR_NO_NEWS)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    EXPECT_INT(got, AVATAR_FULL);
    EXPECT_STATUS(status, OK);
    avatar_free(&avatar);
    avatar_builder_close(&p);
    EXPECT_STATUS(recording_close(&writer), OK);
}

static void test_cancel_at_any_moment(void **state)
{
    (void)state;
    for (int ms = 0; ms < 500; ms = (SANITIZED ? 8 : 2) * ms + 1) {
        atomic_int news = 0;
        struct avatar_builder *p;
        const struct avatar_builder_options options = {rehearsed.rehearsal.file, rehearsed.take, count, &news};
        EXPECT_STATUS(avatar_builder_start(&p, &options), OK);
        avatar_builder_begin(p, AVATAR_WANTED_FULL);
        clock_sleep_until_ns(clock_now_ns() + ms * 1000000ll);
        avatar_builder_close(&p);
        EXPECT_TRUE(!p);
    }
}

static void test_missing_input_is_reported(void **state)
{
    (void)state;
    const struct built none = build("/nowhere/at.all");
    EXPECT_STATUS(none.status, ERR_MISSING);
    EXPECT_SAYS("/nowhere/at.all");
    EXPECT_STATUS(none.kept, OK);
    EXPECT_INT(none.avatar.surface.point_count, 0);
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
        cmocka_unit_test(test_full_avatar_waits_until_it_is_wanted),
        cmocka_unit_test(test_what_cannot_be_kept_is_said),
        cmocka_unit_test(test_kept_avatar_is_the_same),
        cmocka_unit_test(test_cancel_at_any_moment),
        cmocka_unit_test(test_missing_input_is_reported),
    };
    return cmocka_run_group_tests(tests, make, end);
}
