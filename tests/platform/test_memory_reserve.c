// An operator new that fails is given the reserve once, by all who share it, and without one fails as ever.
#include "tests/platform/handler_of_new.h"
#include "tests/support/test.h"

static void test_reserve_is_given_once(void **state)
{
    (void)state;
    const struct reserve_trial trial = try_reserve();
    EXPECT_TRUE(!trial.handled_before);
    EXPECT_TRUE(!trial.used_at_first);
    EXPECT_TRUE(trial.again[0]);
    EXPECT_TRUE(!trial.again[1]);
    EXPECT_TRUE(trial.used_then);
    EXPECT_TRUE(trial.handled_within);
    EXPECT_TRUE(!trial.handled_after);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_reserve_is_given_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
