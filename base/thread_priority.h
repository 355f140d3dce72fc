// Work beside what is to be seen, which can do without it for some pictures.
#pragma once

// From here on the calling thread, and those that it starts, have a third of an ordinary thread's share of the
// processors where others want them; all that is left otherwise, and no real time, which its parent may have. Where the
// system does not allow it, nothing changes.
void thread_lower_priority(void);
