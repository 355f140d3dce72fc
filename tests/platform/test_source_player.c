// A source that is played: a film at its own pace, again and again without a gap; a source that is missing is tried
// again; suspending and closing end every wait.
#include "tests/support/test.h"

#include "base/clock.h"
#include "platform/sensors/source.h"
#include "tests/support/film.h"

#include <stdatomic.h>
#include <stdio.h>

enum { FRAMES = 4, STEP_MS = 40 };
static const double SCALE = 0.1;

static struct scratch scratch;
static struct world *world;

static const char *uri(const char *name)
{
    static char text[300];
    snprintf(text, sizeof text, "folder:%s", scratch_file(&scratch, name));
    return text;
}

// What its thread saw.
struct watcher {
    struct source_player player;
    atomic_int frames, rounds, failures;
    atomic_bool held;             // at the first frame
    int64_t shown_ns[8 * FRAMES]; // of the thread's until it has ended
    int64_t due_ns[8 * FRAMES];   // likewise
};

static enum status play(struct watcher *w)
{
    enum status status = source_player_open_source(&w->player);
    for (int i = 0; status == OK && !source_player_must_stop(&w->player); i++) {
        struct frame frame;
        status = source_player_next(&w->player, &frame);
        if (status != OK)
            break;
        EXPECT_TRUE(w->player.film && frame.depth);
        for (; i == 1 && atomic_load(&w->held) && !source_player_must_stop(&w->player); source_player_begin(&w->player))
            source_player_wait_until_ns(&w->player, clock_now_ns() + 1000000);
        source_player_wait_for_frame(&w->player);
        const int k = atomic_fetch_add(&w->frames, 1);
        if (k < (int)COUNT_OF(w->shown_ns)) {
            w->shown_ns[k] = clock_now_ns();
            w->due_ns[k] = w->player.due_ns;
        }
    }
    return status;
}

static void *run(void *self)
{
    struct watcher *w = self;
    while (source_player_wait_to_play(&w->player)) {
        const enum status status = play(w);
        source_player_close_source(&w->player);
        atomic_fetch_add(status < 0 ? &w->failures : &w->rounds, 1);
        if (status < 0)
            source_player_wait_to_retry(&w->player);
    }
    return NULL;
}

static void watch(struct watcher *w, const char *name, bool held)
{
    *w = (struct watcher){.held = held};
    EXPECT_STATUS(source_player_open(&w->player, uri(name), SOURCE_SENSOR), OK);
    EXPECT_STATUS(worker_thread_start(&w->player.worker, run, w, "to watch"), OK);
}

static void wait_for(atomic_int *count, int wanted)
{
    for (const int64_t until_ns = clock_now_ns() + 30000000000;
         atomic_load(count) < wanted && clock_now_ns() < until_ns;)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    EXPECT_AT_LEAST(atomic_load(count), wanted);
}

// No frame comes before its time: STEP_MS after the one before, from one round to the next as well.
static void test_a_film_keeps_its_pace(void **state)
{
    (void)state;
    struct watcher w;
    watch(&w, "film", false);
    wait_for(&w.rounds, 2);
    source_player_close(&w.player);
    for (int i = 1; i < 2 * FRAMES; i++) { // the first may itself have come late
        EXPECT_NEAR((double)(w.due_ns[i] - w.due_ns[0]) * 1e-6, i * STEP_MS, 0.1);
        EXPECT_AT_LEAST((double)(w.shown_ns[i] - w.due_ns[i]) * 1e-6, 0);
    }
}

static void test_a_film_can_be_held_at_its_first_frame(void **state)
{
    (void)state;
    struct watcher w;
    watch(&w, "film", true);
    wait_for(&w.frames, 1);
    clock_sleep_until_ns(clock_now_ns() + 5 * STEP_MS * INT64_C(1000000));
    EXPECT_INT(atomic_load(&w.frames), 1);
    const int64_t begun_ns = clock_now_ns();
    atomic_store(&w.held, false);
    wait_for(&w.rounds, 1);
    source_player_close(&w.player);
    EXPECT_AT_LEAST((double)(w.shown_ns[FRAMES - 1] - begun_ns) * 1e-6, (FRAMES - 1) * STEP_MS - 2.1);
}

// And closing does not wait for the next try.
static void test_what_is_missing_is_tried_again(void **state)
{
    (void)state;
    struct watcher w;
    watch(&w, "later", false);
    wait_for(&w.failures, 2);
    film_sensor_at(world, &scratch, "later", SCALE, 1000.0 / STEP_MS, FRAMES);
    wait_for(&w.frames, 1);
    source_player_close(&w.player);
    watch(&w, "never", false);
    wait_for(&w.failures, 1);
    const int64_t begun_ns = clock_now_ns();
    source_player_close(&w.player);
    EXPECT_AT_MOST((double)(clock_now_ns() - begun_ns) * 1e-6, 900);
}

static void test_nothing_is_open_while_suspended(void **state)
{
    (void)state;
    struct watcher w;
    watch(&w, "film", true); // it waits for its second frame
    wait_for(&w.frames, 1);
    source_player_suspend(&w.player, true);
    atomic_store(&w.held, false);
    wait_for(&w.rounds, 1);
    const int frames = atomic_load(&w.frames);
    clock_sleep_until_ns(clock_now_ns() + 3 * STEP_MS * INT64_C(1000000));
    EXPECT_INT(atomic_load(&w.frames), frames);
    EXPECT_TRUE(!w.player.source);
    source_player_suspend(&w.player, false);
    wait_for(&w.frames, frames + 1);
    source_player_close(&w.player);
}

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.plain = true;
    scratch = scratch_make();
    if (world_open(&world, &options) != OK)
        return -1;
    film_sensor_at(world, &scratch, "film", SCALE, 1000.0 / STEP_MS, FRAMES);
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_film_keeps_its_pace),
        cmocka_unit_test(test_a_film_can_be_held_at_its_first_frame),
        cmocka_unit_test(test_what_is_missing_is_tried_again),
        cmocka_unit_test(test_nothing_is_open_while_suspended),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
