#include "app/viewer/viewer_takes.h"

#include "app/viewer/viewer.h"
#include "base/clock.h"

static const int64_t CARDS_NS = 50000000; // how long one update may complete cards; chosen by hand

static void adopt_verdict(struct viewer *v)
{
    struct take_verdict verdict;
    int number;
    bool good;
    if (!v->judge || !take_judge_take(v->judge, &number, &verdict, &good))
        return;
    if (good)
        take_list_say(&v->takes.cards[number], &verdict);
    else
        v->takes.cards[number].unjudgeable = true;
    v->state.changed = true;
}

// A thread for which there is no memory is tried again with the next update.
static void ask_for_verdict(struct viewer *v)
{
    const int wanted = take_list_unjudged(&v->takes, v->screens.first_in_sight, v->screens.end_in_sight);
    if (wanted < 0)
        return;
    if (v->judge || take_judge_start(&v->judge, v->options.file, v->options.wake, v->options.wake_self) == OK)
        status_ignore(
            take_judge_ask(v->judge, wanted, v->takes.cards[wanted].name)); // asked again with the next update
}

bool viewer_takes_update(struct viewer *v)
{
    if (v->state.page != PAGE_TAKES || !v->recording)
        return false;
    const int64_t until_ns = clock_now_ns() + CARDS_NS;
    enum status status = OK;
    while (status == OK && clock_now_ns() < until_ns) {
        status = take_list_load(&v->takes, v->gpu, v->recording, v->screens.first_in_sight, v->screens.end_in_sight);
        v->state.changed |= status == OK;
    }
    adopt_verdict(v);
    if (status == NOTHING)
        ask_for_verdict(v);
    return status == OK;
}
