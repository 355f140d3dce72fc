// Judges takes whose file keeps no verdict, on a thread of its own, so that nothing waits for it. The file is only
// read: the verdict is the caller's to keep in memory.
#pragma once
#include "recording/recorded_verdict.h"

#include <stdbool.h>

struct take_judge;

// notify, which may be NULL, is called on the thread when a verdict is there. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status take_judge_start(struct take_judge **out, const char *path, void (*notify)(void *self),
                                        void *notify_self);
void take_judge_close(struct take_judge **j); // NULL is fine; waits for the frame that is being looked at

// Judge the take `number`. False: another is being judged, or its verdict was not taken yet.
bool take_judge_ask(struct take_judge *judge, int number, const char *name);

// The verdict, once. False: not there (yet). *good: the take could be judged.
bool take_judge_take(struct take_judge *judge, int *number, struct take_verdict *out, bool *good);
