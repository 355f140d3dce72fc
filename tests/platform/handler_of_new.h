// What C cannot say: a reserve is made, and the handler of operator new called, as an operator that fails does.
#pragma once
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

struct reserve_trial {
    bool handled_before; // a handler is there without a reserve
    struct {
        bool again;        // the handler returned, so that the operator tries again
        bool inner, outer; // which reserve is used then
    } call[4];             // before the first call, and after each of three, while two reserves live
    bool handled_within;   // a handler is left while one of them still lives
    bool handled_after;
};
struct reserve_trial try_reserve(void);

#ifdef __cplusplus
}
#endif
