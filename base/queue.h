// A bounded queue of pointers between two threads: one puts, one takes.
#pragma once
#include "base/status.h"

struct queue;

MUST_CHECK enum status queue_open(struct queue **out, int capacity); // ERR_MEMORY
void queue_close(struct queue **q); // both threads must be done with it; items left in it are not freed

// Waits for room. False: the other side has stopped; the item stays the caller's.
bool queue_put(struct queue *q, void *item);

// Does not wait. False: full or stopped; the item stays the caller's.
bool queue_try_put(struct queue *q, void *item);

// Waits for an item. NULL: stopped, and nothing is left.
void *queue_take(struct queue *q);

// From either side: no more puts; takes go on until the queue is empty.
void queue_stop(struct queue *q);
