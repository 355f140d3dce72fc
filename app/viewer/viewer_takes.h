// The viewer's list of takes: its cards are completed, and those judged whose file keeps no verdict (take_judge.h).
#pragma once
#include <stdbool.h>

struct viewer;

// Call while the takes are listed. True: there are cards left to complete.
bool viewer_takes_update(struct viewer *v);
