// Which level of detail is chosen, by what it costs and how wrong it is.
#include "tests/support/test.h"

#include "base/level_of_detail.h"

#include <math.h>

static const double error_px[DETAIL_LEVELS] = {8, 6, 1.5, 1};

// From near: paper, parts, fused, full 6, 7, 4, 5 ms; from afar 1, 1.2, 2, 2. Playing, full reads 40 ms more each time.
static struct detail_costs some_costs(void)
{
    return (struct detail_costs){.measured = true,
                                 .px_per_m = {400, 100},
                                 .still_ms = {{6, 1}, {7, 1.2}, {4, 2}, {5, 2}},
                                 .playing_ms = {{9, 4}, {20, 15}, {4, 2}, {45, 42}}};
}

static void test_cheapest_of_those_that_are_good_enough(void **state)
{
    (void)state;
    const struct detail_costs costs = some_costs();
    EXPECT_INT(detail_choose(&costs, error_px, 400, 1, DETAIL_FULL), DETAIL_FULL);
    EXPECT_INT(detail_choose(&costs, error_px, 400, 0, DETAIL_FULL), DETAIL_FULL); // none is; the finest
    EXPECT_INT(detail_choose(&costs, error_px, 400, 2, DETAIL_FULL), DETAIL_FUSED);
    EXPECT_INT(detail_choose(&costs, error_px, 100, 20, DETAIL_FULL), DETAIL_FUSED); // paper's reading is dearer
    struct detail_costs read = costs;
    read.playing_ms[DETAIL_PAPER][1] = 1.5;
    EXPECT_INT(detail_choose(&read, error_px, 100, 20, DETAIL_FULL), DETAIL_PAPER);
    EXPECT_INT(detail_choose(&read, error_px, 20, 20, DETAIL_FULL), DETAIL_PAPER); // beyond what was measured
    EXPECT_NEAR(detail_share_of_full(&read, DETAIL_PAPER, 100), 1.5 / 42, 1e-9);
    EXPECT_NEAR(detail_share_of_full(&read, DETAIL_FULL, 250), 1, 1e-9);
}

// Not even where reading the frame makes the finest level dearer: who pauses would see a slower picture.
static void test_never_dearer_than_the_finest(void **state)
{
    (void)state;
    struct detail_costs costs = some_costs();
    costs.still_ms[DETAIL_FUSED][0] = 5.5;
    EXPECT_INT(detail_choose(&costs, error_px, 400, 20, DETAIL_FULL), DETAIL_FULL);
}

static void test_odd_costs_choose_what_can_be_drawn(void **state)
{
    (void)state;
    const struct detail_costs none = {0};
    EXPECT_INT(detail_choose(&none, error_px, 400, 7, DETAIL_FULL), DETAIL_PARTS); // by their order
    EXPECT_INT(detail_choose(&none, error_px, 400, 0, DETAIL_PARTS), DETAIL_PARTS);
    EXPECT_TRUE(isnan(detail_share_of_full(&none, DETAIL_PAPER, 400)));
    struct detail_costs costs = some_costs(); // measured before there was an avatar
    for (int size = 0; size < 2; size++)
        for (int level = DETAIL_FUSED; level < DETAIL_LEVELS; level++)
            costs.still_ms[level][size] = costs.playing_ms[level][size] = INFINITY;
    EXPECT_INT(detail_choose(&costs, error_px, 100, 2, DETAIL_FULL), DETAIL_FULL);
    EXPECT_INT(detail_choose(&costs, error_px, 100, 20, DETAIL_PARTS), DETAIL_PAPER);
    const double unknown[DETAIL_LEVELS] = {NAN, NAN, NAN, NAN};
    EXPECT_INT(detail_choose(&costs, unknown, 100, 20, DETAIL_FULL), DETAIL_FULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cheapest_of_those_that_are_good_enough),
        cmocka_unit_test(test_never_dearer_than_the_finest),
        cmocka_unit_test(test_odd_costs_choose_what_can_be_drawn),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
