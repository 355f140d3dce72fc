// A place for one thing between two threads: whoever puts never waits, whoever
// takes gets the newest, what was not taken in time goes back to who put it.
#pragma once
#include "base/status.h"

struct mailbox;

MUST_CHECK enum status mailbox_open(struct mailbox **out); // ERR_MEMORY
void mailbox_close(struct mailbox **l); // NULL is fine; both threads are done with it, what is in it is not freed

// Returns what lay there untaken, which is the caller's again; else NULL.
void *mailbox_put(struct mailbox *l, void *item);

// What lies there, or NULL. wait: waits for something; NULL then means stopped.
void *mailbox_take(struct mailbox *l, bool wait);

// Does something lie there?
bool mailbox_full(struct mailbox *l);

// From either side: nobody waits any more.
void mailbox_stop(struct mailbox *l);
