// The pipeline on several threads: each item passes all stages in order; ordered stages keep the order of items; the
// limit of items in flight holds; an error or on_progress ends the run.
#include "tests/support/test.h"

#include "base/clock.h"
#include "base/threads.h"

#include <stdatomic.h>
#include <stdlib.h>

enum { ITEMS = 400, IN_FLIGHT = 6, STAGES = 3, THREADS = 4, FAILING = 123 };

struct pipeline_case {
    struct pipeline pipeline;
    atomic_int stage_of[ITEMS]; // the next stage of each item
    atomic_int next[STAGES];    // the next item of an ordered stage
    atomic_int in_flight_now, most_in_flight, running, most_running, done, wrong;
    int calls, cancel_after;
    double share;
    bool fails, slow;
};

static void raise_maximum(atomic_int *maximum, int value)
{
    int before = atomic_load(maximum);
    while (before < value && !atomic_compare_exchange_weak(maximum, &before, value))
        ;
}

static enum status work(void *context, int stage, int item)
{
    struct pipeline_case *c = context;
    raise_maximum(&c->most_running, atomic_fetch_add(&c->running, 1) + 1);
    if (stage == 0)
        raise_maximum(&c->most_in_flight, atomic_fetch_add(&c->in_flight_now, 1) + 1);
    if (c->pipeline.in_order[stage])
        atomic_fetch_add(&c->wrong, atomic_fetch_add(&c->next[stage], 1) != item);
    atomic_fetch_add(&c->wrong, atomic_load(&c->stage_of[item]) != stage);
    if (c->slow || (item * 7 + stage) % 5 == 0) // some take longer than others
        clock_sleep_until_ns(clock_now_ns() + 200000);
    atomic_store(&c->stage_of[item], stage + 1);
    if (stage == STAGES - 1) {
        atomic_fetch_sub(&c->in_flight_now, 1);
        atomic_fetch_add(&c->done, 1);
    }
    atomic_fetch_sub(&c->running, 1);
    return c->fails && stage == 1 && item == FAILING ? fail(ERR_CORRUPT, "item %d is broken", item) : OK;
}

static bool on_progress(void *context, double share)
{
    struct pipeline_case *c = context;
    atomic_fetch_add(&c->wrong, share < c->share || share > 1);
    c->share = share;
    return !c->cancel_after || ++c->calls < c->cancel_after;
}

static struct pipeline_case *make_case(void)
{
    struct pipeline_case *c = calloc(1, sizeof *c);
    assert_non_null(c);
    c->pipeline = (struct pipeline){.items = ITEMS,
                                    .stages = STAGES,
                                    .in_flight = IN_FLIGHT,
                                    .in_order = {true, false, true},
                                    .work = work,
                                    .on_progress = on_progress,
                                    .context = c};
    return c;
}

static void test_all_items_pass_all_stages(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, THREADS};
    for (size_t i = 0; i < COUNT_OF(threads); i++) {
        struct pipeline_case *c = make_case();
        EXPECT_STATUS(pipeline_run(&c->pipeline, threads[i]), OK);
        print_message("on %d threads: %d running at a time, %d in flight\n", threads[i], c->most_running,
                      c->most_in_flight);
        EXPECT_INT(c->done, ITEMS);
        EXPECT_INT(c->wrong, 0);
        EXPECT_NEAR(c->share, 1, 0);
        EXPECT_AT_MOST(c->most_in_flight, IN_FLIGHT);
        EXPECT_AT_MOST(c->most_running, threads[i]);
        EXPECT_AT_LEAST(c->most_running, threads[i] < 2 ? 1 : 2);
        free(c);
    }
}

// Ordered stages still run at the same time, on different items.
static void test_stages_run_concurrently(void **state)
{
    (void)state;
    struct pipeline_case *c = make_case();
    c->slow = c->pipeline.in_order[1] = true;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), OK);
    EXPECT_INT(c->done, ITEMS);
    EXPECT_INT(c->wrong, 0);
    EXPECT_AT_LEAST(c->most_running, 2);
    EXPECT_AT_MOST(c->most_running, STAGES);
    free(c);
}

static void test_error_ends_all(void **state)
{
    (void)state;
    struct pipeline_case *c = make_case();
    c->fails = true;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), ERR_CORRUPT);
    assert_string_equal(status_message(), "item 123 is broken");
    EXPECT_INT(c->wrong, 0);
    EXPECT_INT(c->running, 0);
    EXPECT_AT_MOST(c->done, FAILING + IN_FLIGHT);
    free(c);
}

static void test_cancel_ends_all(void **state)
{
    (void)state;
    struct pipeline_case *c = make_case();
    c->cancel_after = 20;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), NOTHING);
    EXPECT_INT(c->calls, c->cancel_after);
    EXPECT_INT(c->running, 0);
    EXPECT_AT_MOST(c->done, ITEMS - 1);
    free(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_items_pass_all_stages),
        cmocka_unit_test(test_stages_run_concurrently),
        cmocka_unit_test(test_error_ends_all),
        cmocka_unit_test(test_cancel_ends_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
