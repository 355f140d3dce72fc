// Items that go through stages on several threads: each through all of them, one after the other; stages in order keep
// it; no more are under way than may be; and an error, or whoever does not want it any more, ends all.
#include "tests/support/test.h"

#include "base/clock.h"
#include "base/pipeline.h"

#include <stdatomic.h>
#include <stdlib.h>

enum { ITEMS = 400, IN_FLIGHT = 6, STAGES = 3, THREADS = 4, FAILING = 123 };

struct pipeline_case {
    struct pipeline pipeline;
    atomic_int stage_of[ITEMS]; // next
    atomic_int next[STAGES];    // of stages in order
    atomic_int under_way, most_under_way, at_work, most_at_work, done, wrong;
    int calls, give_up_after;
    double share;
    bool fails, slow;
};

static void raise_to(atomic_int *most, int value)
{
    int before = atomic_load(most);
    while (before < value && !atomic_compare_exchange_weak(most, &before, value))
        ;
}

static enum status work(void *context, int stage, int item)
{
    struct pipeline_case *c = context;
    raise_to(&c->most_at_work, atomic_fetch_add(&c->at_work, 1) + 1);
    if (stage == 0)
        raise_to(&c->most_under_way, atomic_fetch_add(&c->under_way, 1) + 1);
    if (c->pipeline.in_order[stage])
        atomic_fetch_add(&c->wrong, atomic_fetch_add(&c->next[stage], 1) != item);
    atomic_fetch_add(&c->wrong, atomic_load(&c->stage_of[item]) != stage);
    if (c->slow || (item * 7 + stage) % 5 == 0) // some take longer than others
        clock_sleep_until_ns(clock_now_ns() + 200000);
    atomic_store(&c->stage_of[item], stage + 1);
    if (stage == STAGES - 1) {
        atomic_fetch_sub(&c->under_way, 1);
        atomic_fetch_add(&c->done, 1);
    }
    atomic_fetch_sub(&c->at_work, 1);
    return c->fails && stage == 1 && item == FAILING ? fail(ERR_CORRUPT, "item %d is broken", item) : OK;
}

static bool went_on(void *context, double share)
{
    struct pipeline_case *c = context;
    atomic_fetch_add(&c->wrong, share < c->share || share > 1);
    c->share = share;
    return !c->give_up_after || ++c->calls < c->give_up_after;
}

static struct pipeline_case *course(void)
{
    struct pipeline_case *c = calloc(1, sizeof *c);
    assert_non_null(c);
    c->pipeline = (struct pipeline){.items = ITEMS,
                                    .stages = STAGES,
                                    .in_flight = IN_FLIGHT,
                                    .in_order = {true, false, true},
                                    .work = work,
                                    .went_on = went_on,
                                    .context = c};
    return c;
}

static void test_all_items_pass_all_stages(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, THREADS};
    for (size_t i = 0; i < COUNT_OF(threads); i++) {
        struct pipeline_case *c = course();
        EXPECT_STATUS(pipeline_run(&c->pipeline, threads[i]), OK);
        print_message("on %d threads: %d at work at a time, %d under way\n", threads[i], c->most_at_work,
                      c->most_under_way);
        EXPECT_INT(c->done, ITEMS);
        EXPECT_INT(c->wrong, 0);
        EXPECT_NEAR(c->share, 1, 0);
        EXPECT_AT_MOST(c->most_under_way, IN_FLIGHT);
        EXPECT_AT_MOST(c->most_at_work, threads[i]);
        EXPECT_AT_LEAST(c->most_at_work, threads[i] < 2 ? 1 : 2);
        free(c);
    }
}

// Where all stages are in order, each can still have an item of its own.
static void test_stages_run_concurrently(void **state)
{
    (void)state;
    struct pipeline_case *c = course();
    c->slow = c->pipeline.in_order[1] = true;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), OK);
    EXPECT_INT(c->done, ITEMS);
    EXPECT_INT(c->wrong, 0);
    EXPECT_AT_LEAST(c->most_at_work, 2);
    EXPECT_AT_MOST(c->most_at_work, STAGES);
    free(c);
}

static void test_error_ends_all(void **state)
{
    (void)state;
    struct pipeline_case *c = course();
    c->fails = true;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), ERR_CORRUPT);
    assert_string_equal(status_message(), "item 123 is broken");
    EXPECT_INT(c->wrong, 0);
    EXPECT_INT(c->at_work, 0);
    EXPECT_AT_MOST(c->done, FAILING + IN_FLIGHT);
    free(c);
}

static void test_unwanted_output_is_dropped(void **state)
{
    (void)state;
    struct pipeline_case *c = course();
    c->give_up_after = 20;
    EXPECT_STATUS(pipeline_run(&c->pipeline, THREADS), NOTHING);
    EXPECT_INT(c->calls, c->give_up_after);
    EXPECT_INT(c->at_work, 0);
    EXPECT_AT_MOST(c->done, ITEMS - 1);
    free(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_items_pass_all_stages),
        cmocka_unit_test(test_stages_run_concurrently),
        cmocka_unit_test(test_error_ends_all),
        cmocka_unit_test(test_unwanted_output_is_dropped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
