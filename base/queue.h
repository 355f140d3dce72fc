// A bounded first-in first-out queue of pointers between threads: some put, another takes. It has a lock and no thread
// of its own.
#pragma once
#include "base/status.h"

struct queue;

MUST_CHECK enum status queue_open(struct queue **out, int capacity); // ERR_MEMORY; *out is then NULL
void queue_close(struct queue **q); // no thread may use it any more; items left in it are not freed. NULL is fine

// Waits until an item fits. False: the queue was stopped; the item stays the caller's.
bool queue_put(struct queue *q, void *item);

// Does not wait. False: full or stopped; the item stays the caller's.
bool queue_try_put(struct queue *q, void *item);

// Waits for an item. NULL: stopped and empty.
void *queue_take(struct queue *q);

// How many items are in it now.
int queue_count(struct queue *q);

bool queue_is_stopped(struct queue *q);

// From any thread: puts fail from now on; takes continue until the queue is empty.
void queue_stop(struct queue *q);
