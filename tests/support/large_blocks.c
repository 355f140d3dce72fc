// Loaded before a program (LD_PRELOAD) that has the address sanitizer: its allocator maps each block that is larger
// than 256 KB anew, and shall get a block's pages from the kernel at once, not by a fault for each. That was a quarter
// of the time of tests that go through many pictures and grids. Does nothing to other programs.
#include <dlfcn.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/mman.h>

#ifndef MADV_POPULATE_WRITE
#define MADV_POPULATE_WRITE 23 // Linux 5.14; older ones refuse, and the pages come one by one
#endif

static const size_t PICTURE = (size_t)1 << 18, GRID = (size_t)1 << 22;

// A picture is filled by whoever asks for it. What is larger may stay empty for the most part: it gets pages of 2 MB,
// where it is touched.
static void take_pages(const volatile void *block, size_t size)
{
    const uintptr_t page = 4096, begin = (uintptr_t)block / page * page, end = ((uintptr_t)block + size) / page * page;
    if (size >= PICTURE)
        (void)madvise((void *)begin, end - begin, size < GRID ? MADV_POPULATE_WRITE : MADV_HUGEPAGE);
}

static void let_go(const volatile void *block) { (void)block; }

__attribute__((constructor)) static void begin(void)
{
    typedef int install(void (*)(const volatile void *, size_t), void (*)(const volatile void *));
    install *hook = (install *)dlsym(RTLD_DEFAULT, "__sanitizer_install_malloc_and_free_hooks");
    if (hook)
        (void)hook(take_pages, let_go);
}
