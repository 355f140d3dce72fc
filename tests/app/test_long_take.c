// A long take, made of a short one's frames again and again: opening it and moving along its timeline decode only what
// is shown, however long it is.
//
//     test_long_take                   some seconds of take
//     test_long_take MINUTES FILE      only makes FILE, whose take "long" has that length: to be opened with
//                                      reenact FILE --take long --stats
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>

enum { SECONDS = 4, FPS = 30, SCRUBS = 15 };

static struct rehearsal rehearsal;
static struct glass glass;

// Copies the frames of "turn", forwards and backwards in turn so that nothing jumps.
static void add_frames(struct recording_writer *writer, struct take *from, int64_t count)
{
    const int64_t there = take_frame_count(from), step_ns = 1000000000 / FPS;
    for (int64_t i = 0; i < count; i++) {
        const int64_t at = i % (2 * there - 2), k = at < there ? at : 2 * there - 2 - at;
        const struct take_entry *e = take_entry(from, k);
        const uint8_t *jpeg;
        size_t bytes;
        struct take_images seen;
        EXPECT_STATUS(take_read(from, k, TAKE_DEPTH | TAKE_MASK, &seen), OK);
        EXPECT_STATUS(take_read_jpeg(from, k, &jpeg, &bytes), OK);
        const struct take_frame frame = {i * step_ns, e->world_from_camera, e->located, jpeg, bytes, seen.depth,
                                         seen.mask,   e->has_skeleton,      e->skeleton};
        EXPECT_STATUS(recording_add_frame(writer, &frame), OK);
    }
}

// The recording `file` with the take "long" of `count` frames, and the short one's place.
static void make_long(const char *file, int64_t count)
{
    struct recording *recording;
    struct recording_writer *writer;
    struct place place;
    struct take *from;
    EXPECT_STATUS(recording_open(&recording, rehearsal.file), OK);
    EXPECT_STATUS(recording_read_place(recording, &place), OK);
    EXPECT_STATUS(take_open(&from, recording, "turn"), OK);
    EXPECT_STATUS(recording_create(&writer, file), OK);
    EXPECT_STATUS(recording_put_place(writer, &place), OK);
    EXPECT_STATUS(recording_begin_take(writer, "long", take_calibration(from)), OK);
    add_frames(writer, from, count);
    EXPECT_STATUS(recording_put_body(writer, take_body(from)), OK);
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    place_free(&place);
    take_close(&from);
    recording_free(&recording);
}

static int64_t decoded(void) { return take_view_frames_decoded(viewer_take_view(glass.viewer)); }

static void open_glass(const char *file)
{
    const struct viewer_options options = {.file = file, .take = "long", .refresh_hz = 60, .fixed_resolution = true};
    glass_open(&glass, GLASS_LONG / 2, GLASS_SHORT / 2, &options);
    glass_draw(&glass);
}

// Draws what changes until nothing is being loaded any more.
static void wait_loaded(void)
{
    const int64_t until_ns = clock_now_ns() + 20000000000;
    while (take_view_waiting(viewer_take_view(glass.viewer)) && clock_now_ns() < until_ns)
        glass_draw(&glass);
    EXPECT_TRUE(!take_view_waiting(viewer_take_view(glass.viewer)));
}

// Until the last place is shown and what belongs to it is there: on a busy machine it is asked for later than drawn.
static void settle(void)
{
    int64_t before;
    int rounds = 0;
    do {
        before = decoded();
        glass_draw(&glass);
        wait_loaded();
    } while (decoded() != before && ++rounds < 20);
}

static void test_decodes_what_it_shows(void **state)
{
    (void)state;
    const char *file = scratch_file(&rehearsal.scratch, "long.reenact");
    char kept[512];
    snprintf(kept, sizeof kept, "%s", file);
    make_long(kept, SECONDS * FPS);
    open_glass(kept);
    glass_seek(&glass, 0);
    glass_prepare(&glass); // the avatar is made, and kept in the file
    glass_close(&glass);
    open_glass(kept);
    const int64_t opening = decoded();
    print_message("second opening: %lld of %lld frames decoded\n", (long long)opening,
                  (long long)take_view_frames(viewer_take_view(glass.viewer)));
    EXPECT_AT_MOST((double)opening, 3);
    glass_seek(&glass, 0);
    glass_prepare(&glass);
    glass_wait_idle(&glass);
    wait_loaded();
    const int64_t before = decoded();
    for (int i = 1; i <= SCRUBS; i++) {
        glass_seek(&glass, (double)i / (SCRUBS + 1));
        glass_draw(&glass);
    }
    wait_loaded();
    const int64_t scrubbed = decoded() - before;
    print_message("%d places of the timeline: %lld frames decoded\n", SCRUBS, (long long)scrubbed);
    EXPECT_AT_MOST((double)scrubbed, SCRUBS + 6); // the places, and what is loaded ahead of the last
    settle();
    const int64_t paused = decoded();
    for (int i = 0; i < 10; i++)
        glass_draw(&glass);
    EXPECT_INT(decoded() - paused, 0);
    glass_close(&glass);
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

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_decodes_what_it_shows)};
    if (argc > 2) {
        rehearsal = rehearsal_make();
        make_long(argv[2], (int64_t)(atof(argv[1]) * 60 * FPS));
        rehearsal_end(&rehearsal);
        return 0;
    }
    return cmocka_run_group_tests(tests, make, end);
}
