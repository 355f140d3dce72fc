// Preloaded (LD_PRELOAD) into programs with the address sanitizer, whose allocator maps each block of more than 256 KB
// with mmap: prefaults it (MADV_POPULATE_WRITE), since page faults were a quarter of the time of tests that go through
// many images and grids. Does nothing to other programs.
#include <dlfcn.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/mman.h>

#ifndef MADV_POPULATE_WRITE
#define MADV_POPULATE_WRITE 23 // Linux 5.14; older ones refuse, and the pages come one by one
#endif

static const size_t PICTURE = (size_t)1 << 18, GRID = (size_t)1 << 22;

// An image is written as a whole. A larger block may stay sparse: it gets transparent huge pages instead.
static void prefault(const volatile void *block, size_t size)
{
    const uintptr_t page = 4096, begin = (uintptr_t)block / page * page, end = ((uintptr_t)block + size) / page * page;
    if (size >= PICTURE)
        (void)madvise((void *)begin, end - begin, size < GRID ? MADV_POPULATE_WRITE : MADV_HUGEPAGE);
}

static void ignore_free(const volatile void *block) { (void)block; }

__attribute__((constructor)) static void begin(void)
{
    typedef int install(void (*)(const volatile void *, size_t), void (*)(const volatile void *));
    install *hook = (install *)dlsym(RTLD_DEFAULT, "__sanitizer_install_malloc_and_free_hooks");
    if (hook)
        (void)hook(prefault, ignore_free);
}
