// An operator new that fails is given each reserve once, the newest first, and fails as ever when none is left.
#include "tests/support/test.h"

#include "tests/platform/handler_of_new.h"

static void test_each_reserve_is_given_once(void **state)
{
    (void)state;
    const struct reserve_trial trial = try_reserve();
    EXPECT_TRUE(!trial.handled_before);
    for (int i = 0; i < 4; i++) {
        EXPECT_INT(trial.call[i].again, i == 1 || i == 2);
        EXPECT_INT(trial.call[i].inner, i >= 1);
        EXPECT_INT(trial.call[i].outer, i >= 2);
    }
    EXPECT_TRUE(trial.handled_within);
    EXPECT_TRUE(!trial.handled_after);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_each_reserve_is_given_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
