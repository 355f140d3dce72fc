// Prefetched frame layers are the same, byte for byte, as synchronously loaded ones; only wanted frames are loaded; and
// prefetching can be cancelled at any moment.
#include "tests/support/test.h"

#include "app/view/frame_prefetch.h"
#include "base/clock.h"
#include "platform/files/database.h"
#include "tests/support/rehearsed.h"

#include <string.h>
#include <time.h>

enum { FRAMES_FOR_AVATAR = 1 };

// Factor between the delays before cancelling: fewer trials under an emulator.
#ifdef EMULATED
enum { LATER = 20 };
#else
enum { LATER = SANITIZED ? 20 : 2 };
#endif

static struct rehearsed rehearsed;

static struct frame_prefetch *start(const char *path)
{
    struct frame_prefetch *a;
    const struct frame_prefetch_options options = {path, rehearsed.take, rehearsed.skeletons, &rehearsed.avatar};
    EXPECT_STATUS(prefetch_start(&a, &options), OK);
    return a;
}

// Polls for the frame, as the renderer does.
static bool take_in_time(struct frame_prefetch *a, int64_t frame, struct frame_layer *out)
{
    const int64_t until = clock_now_ns() + 60000000000;
    while (clock_now_ns() < until) {
        if (prefetch_take(a, frame, out))
            return true;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    return false;
}

static void expect_same_texture(const struct frame_layer_image *a, const struct frame_layer_image *b,
                                size_t bytes_a_pixel)
{
    EXPECT_INT(a->width, b->width);
    EXPECT_INT(a->height, b->height);
    EXPECT_TRUE(!memcmp(a->pixels, b->pixels, bytes_a_pixel * (size_t)a->width * (size_t)a->height));
}

static void expect_same(const struct frame_layer *a, const struct frame_layer *b)
{
    EXPECT_INT(a->frame, b->frame);
    EXPECT_INT(a->has_images, b->has_images);
    expect_same_texture(&a->color, &b->color, 3);
    expect_same_texture(&a->depth, &b->depth, 4);
    EXPECT_TRUE(!memcmp(a->windows, b->windows, sizeof a->windows));
    EXPECT_TRUE(!memcmp(&a->corrections, &b->corrections, sizeof a->corrections));
    EXPECT_INT(a->point_count, rehearsed.avatar.atlas.mesh.point_count);
    EXPECT_INT(b->point_count, a->point_count);
    EXPECT_INT(a->triangle_count, rehearsed.avatar.atlas.mesh.corner_count / 3);
    EXPECT_INT(b->triangle_count, a->triangle_count);
    EXPECT_TRUE(!memcmp(a->shift, b->shift, sizeof *a->shift * (size_t)a->point_count));
    EXPECT_TRUE(!memcmp(a->points, b->points, sizeof *a->points * (size_t)a->point_count));
    EXPECT_TRUE(
        !memcmp(a->triangle_visible, b->triangle_visible, sizeof *a->triangle_visible * (size_t)a->triangle_count));
}

// In any order: earlier loads have no effect on later ones.
static void test_same_as_synchronous_load(void **state)
{
    (void)state;
    static const int64_t shown[] = {0, 1, 6, 0};
    struct frame_prefetch *a = start(rehearsed.rehearsal.file);
    struct frame_layer_loader *own;
    struct frame_layer before = {0};
    EXPECT_STATUS(frame_layer_loader_open(&own, &rehearsed.source, &rehearsed.avatar), OK);
    for (size_t i = 0; i < COUNT_OF(shown); i++) {
        struct frame_layer prefetched, direct;
        prefetch_request(a, &shown[i], i + 1 < COUNT_OF(shown) ? 2 : 1);
        EXPECT_TRUE(take_in_time(a, shown[i], &prefetched));
        EXPECT_STATUS(frame_layer_loader_load(own, shown[i], &direct), OK);
        EXPECT_TRUE(direct.has_images);
        EXPECT_AT_LEAST(direct.color.width, 10);
        expect_same(&prefetched, &direct);
        EXPECT_TRUE(i == 0 || memcmp(before.shift, direct.shift,
                                     sizeof *direct.shift * (size_t)rehearsed.avatar.atlas.mesh.point_count));
        frame_layer_free(&before);
        frame_layer_free(&prefetched);
        before = direct;
    }
    frame_layer_free(&before);
    frame_layer_loader_close(&own);
    prefetch_close(&a);
}

static void test_loads_only_requested_frames(void **state)
{
    (void)state;
    struct frame_prefetch *a = start(rehearsed.rehearsal.file);
    struct frame_layer frame;
    const int64_t first[] = {1, 2}, then[] = {5};
    prefetch_request(a, first, 2);
    EXPECT_TRUE(take_in_time(a, 1, &frame));
    frame_layer_free(&frame);
    prefetch_request(a, then, 1); // a jump along the timeline
    EXPECT_TRUE(take_in_time(a, 5, &frame));
    EXPECT_INT(frame.frame, 5);
    EXPECT_AT_LEAST((double)prefetch_load_ns(a), 1e5);
    frame_layer_free(&frame);
    for (int64_t i = 0; i < 8; i++)
        EXPECT_TRUE(!prefetch_take(a, i, &frame)); // 1 and 5 are gone, 2 is not wanted any more
    prefetch_close(&a);
    EXPECT_TRUE(!a);
}

static void test_cancel_at_any_moment(void **state)
{
    (void)state;
    for (int ms = 0; ms < 50; ms = LATER * ms + 1) {
        const int64_t wanted[] = {0, 1, 2, 3, 4, 5};
        struct frame_prefetch *a = start(rehearsed.rehearsal.file);
        prefetch_request(a, wanted, PREFETCH_MAX);
        clock_sleep_until_ns(clock_now_ns() + ms * 1000000ll);
        prefetch_close(&a);
    }
}

// The recording cannot be opened: no frame becomes ready, and nothing waits.
static void test_unloadable_frame_does_not_block(void **state)
{
    (void)state;
    struct frame_prefetch *a = start("/nowhere/at.all");
    struct frame_layer frame;
    const int64_t wanted[] = {0};
    prefetch_request(a, wanted, 1);
    for (int i = 0; i < 20; i++) {
        EXPECT_TRUE(!prefetch_take(a, 0, &frame));
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    prefetch_close(&a);
}

// Several damaged frames in a row: each is tried once, not repeatedly, and is there without images.
static void test_damaged_frame_is_skipped(void **state)
{
    (void)state;
    struct database *db;
    EXPECT_STATUS(database_open(&db, rehearsed.rehearsal.file, DATABASE_WRITE), OK);
    EXPECT_STATUS(database_run(db, "UPDATE picture SET depth = x'00'"), OK);
    database_close(&db);
    struct frame_prefetch *a = start(rehearsed.rehearsal.file);
    struct frame_layer frame;
    const int64_t wanted[] = {3, 4, 5};
    prefetch_request(a, wanted, 3);
    clock_sleep_until_ns(clock_now_ns() + (SANITIZED ? INT64_C(3000000000) : 300000000)); // each was tried once
    const clock_t before = clock(); // processor time of all threads
    clock_sleep_until_ns(clock_now_ns() + 300000000);
    EXPECT_AT_MOST((double)(clock() - before) / CLOCKS_PER_SEC, 0.1);
    for (int i = 0; i < 3; i++) {
        if (prefetch_take(a, wanted[i], &frame)) {
            EXPECT_TRUE(!frame.has_images);
            frame_layer_free(&frame);
        }
    }
    prefetch_close(&a);
}

static int make(void **state)
{
    (void)state;
    EXPECT_STATUS(rehearsed_open(&rehearsed, FRAMES_FOR_AVATAR), OK);
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
        cmocka_unit_test(test_same_as_synchronous_load), cmocka_unit_test(test_loads_only_requested_frames),
        cmocka_unit_test(test_cancel_at_any_moment),     cmocka_unit_test(test_unloadable_frame_does_not_block),
        cmocka_unit_test(test_damaged_frame_is_skipped), // last: it damages the recording
    };
    return cmocka_run_group_tests(tests, make, end);
}
