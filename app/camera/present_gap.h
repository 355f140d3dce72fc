// The time between two pictures: from when one has been handed to the display until the next is drawn. What has to be
// computed beside the pictures begins then, and disturbs none where it has ended by the next. Any thread may call.
#pragma once
#include "base/status.h"

struct lull;

MUST_CHECK enum status lull_open(struct lull **out); // ERR_MEMORY
void lull_close(struct lull **l);                    // NULL is fine; nobody may be waiting

void lull_begins(struct lull *l); // a picture has been shown

// How many have begun by now: what lull_wait wants to know.
int64_t lull_count(struct lull *l);
// Until more have begun than `count`, or for 50 ms: it may be that nothing is drawn.
void lull_wait(struct lull *l, int64_t count);
