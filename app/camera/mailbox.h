// A place for one thing between two threads: whoever puts never waits, whoever
// takes gets the newest, what was not taken in time goes back to who put it.
#pragma once
#include "base/status.h"

struct latest;

MUST_CHECK enum status latest_open(struct latest **out); // ERR_MEMORY
void latest_close(struct latest **l); // NULL is fine; both threads are done with it, what is in it is not freed

// Returns what lay there untaken, which is the caller's again; else NULL.
void *latest_put(struct latest *l, void *item);

// What lies there, or NULL. wait: waits for something; NULL then means stopped.
void *latest_take(struct latest *l, bool wait);

// Does something lie there?
bool latest_waits(struct latest *l);

// From either side: nobody waits any more.
void latest_stop(struct latest *l);
