// A slot for one item between two threads, newest wins: putting never waits, taking gets the newest item, and an item
// that is replaced before it was taken goes back to the thread that puts.
#pragma once
#include "base/status.h"

struct mailbox;

MUST_CHECK enum status mailbox_open(struct mailbox **out); // ERR_MEMORY
void mailbox_close(struct mailbox **m); // NULL is fine; neither thread may use it any more; an item in it is not freed

// Returns the replaced item, which belongs to the caller again, or NULL.
void *mailbox_put(struct mailbox *m, void *item);

// Takes the item, or NULL. wait: blocks until there is one; NULL then means stopped.
void *mailbox_take(struct mailbox *m, bool wait);

// Whether an item is waiting.
bool mailbox_full(struct mailbox *m);

// From either thread: mailbox_take returns NULL from now on.
void mailbox_stop(struct mailbox *m);
