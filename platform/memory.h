// Memory that was freed but that the process still holds.
#pragma once

// Gives it back to the system, where the C library can: after work that took much more than what is left of it, which
// else stays a process's own for as long as it runs. Takes some 10 ms a hundred megabytes. Any thread may call.
void memory_give_back(void);
