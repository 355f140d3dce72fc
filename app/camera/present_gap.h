// The time between two pictures: from when one has been handed to the display until the next is drawn. What has to be
// computed beside the pictures begins then, and disturbs none where it has ended by the next. Any thread may call.
#pragma once
#include "base/status.h"

struct present_gap;

MUST_CHECK enum status present_gap_open(struct present_gap **out); // ERR_MEMORY
void present_gap_close(struct present_gap **l);                    // NULL is fine; nobody may be waiting

void present_gap_begin(struct present_gap *l); // a picture has been shown

// How many have begun by now: what present_gap_wait wants to know.
int64_t present_gap_count(struct present_gap *l);
// Until more have begun than `count`, or for 50 ms: it may be that nothing is drawn.
void present_gap_wait(struct present_gap *l, int64_t count);
