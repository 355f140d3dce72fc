#include "tests/platform/handler_of_new.h"

#include "platform/vision/memory_reserve.hpp"

#include <new>

static bool handler_returns()
{
    try {
        std::get_new_handler()();
        return true;
    } catch (const std::bad_alloc &) {
        return false;
    }
}

struct reserve_trial try_reserve(void)
{
    reserve_trial trial = {};
    trial.handled_before = std::get_new_handler() != nullptr;
    {
        const memory_reserve outer(1000);
        {
            const memory_reserve inner(1000);
            for (int i = 0; i < 4; i++) {
                trial.call[i].again = i > 0 && handler_returns();
                trial.call[i].inner = inner.is_used();
                trial.call[i].outer = outer.is_used();
            }
        }
        trial.handled_within = std::get_new_handler() != nullptr;
    }
    trial.handled_after = std::get_new_handler() != nullptr;
    return trial;
}
