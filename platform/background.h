// Work that nobody waits for just now, beside what is to be seen.
#pragma once

// From here on the calling thread, and those that it starts, leave the processors to others as long as those want
// them, but for a tenth of a share. Where the system does not allow it, nothing changes.
void background_begin(void);
