#include "base/memory.h"

#include <stdlib.h> // says which C library this is
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/mman.h>

void *memory_in_lines(size_t bytes)
{
    enum { PAGE = 2 << 20 };
    size_t unit = bytes < PAGE ? MEMORY_LINE : PAGE;
    size_t whole = (bytes + unit - 1) / unit * unit;
    void *memory = aligned_alloc(unit, whole > 0 ? whole : unit);
    if (memory && unit == PAGE)
        (void)madvise(memory, whole, MADV_HUGEPAGE); // a wish: without, all is as slow as before
    return memory;
}

void memory_give_back(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}
