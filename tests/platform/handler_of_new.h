// What C cannot say: a reserve is made, and the handler of operator new called, as an operator that fails does.
#pragma once
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

struct reserve_trial {
    bool handled_before; // a handler is there without a reserve
    bool used_at_first;
    bool again[2]; // the handler returned, so that the operator tries again: at its first call, and at its second
    bool used_then;
    bool handled_within; // a handler is left while one of two reserves still lives
    bool handled_after;
};
struct reserve_trial try_reserve(void);

#ifdef __cplusplus
}
#endif
