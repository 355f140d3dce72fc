#include "tests/support/fail_sites.h"

#include <link.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unwind.h>

enum { MODULES_MAX = 64, BLOCKS_MAX = 1 << 20 };

static struct module {
    uintptr_t base, begin, end;
    const char *name;
    bool program;
} modules[MODULES_MAX];
static int module_count;

static struct site {
    uint64_t number;
    long calls, blocks;
    int depth;
    struct {
        int module;
        uintptr_t offset;
    } frames[SITE_FRAMES_MAX];
} sites[SITES_MAX];

// Where blocks lie, by their address, with linear probing.
static struct {
    const void *block; // NULL: free; GONE: was removed
    int site;
} blocks[BLOCKS_MAX];
static const char gone;
static int block_count;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static _Thread_local bool unwinding __attribute__((tls_model("initial-exec")));

static int add_module(struct dl_phdr_info *info, size_t size, void *context)
{
    const char *const *libraries = context;
    const bool program = !*info->dlpi_name;
    (void)size;
    while (!program && *libraries && !strstr(info->dlpi_name, *libraries))
        libraries++;
    for (int i = 0; i < info->dlpi_phnum && (program || *libraries); i++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[i];
        if (p->p_type == PT_LOAD && (p->p_flags & PF_X) && module_count < MODULES_MAX) {
            const char *slash = strrchr(info->dlpi_name, '/');
            modules[module_count++] = (struct module){info->dlpi_addr, info->dlpi_addr + p->p_vaddr,
                                                      info->dlpi_addr + p->p_vaddr + p->p_memsz,
                                                      slash ? slash + 1 : info->dlpi_name, program};
        }
    }
    return 0;
}

void sites_start(const char *const *libraries)
{
    union {
        const char *const *words;
        void *context;
    } names = {libraries};
    dl_iterate_phdr(add_module, names.context);
}

static int module_at(uintptr_t code)
{
    for (int i = 0; i < module_count; i++)
        if (code >= modules[i].begin && code < modules[i].end)
            return i;
    return -1;
}

bool sites_hold(const void *code) { return module_at((uintptr_t)code) >= 0; }

bool sites_hold_in_program(const void *code)
{
    const int module = module_at((uintptr_t)code);
    return module >= 0 && modules[module].program;
}

struct walk {
    struct site *site;
    int of_program, of_library; // frames
};

static _Unwind_Reason_Code add_frame(struct _Unwind_Context *context, void *data)
{
    struct walk *walk = data;
    struct site *site = walk->site;
    const uintptr_t code = _Unwind_GetIP(context);
    const int module = module_at(code);
    if (module < 0)
        return _URC_NO_REASON;
    if (walk->of_program == SITE_PROGRAM_DEPTH)
        return _URC_END_OF_STACK;
    if (!modules[module].program && (walk->of_program > 0 || walk->of_library == SITE_LIBRARY_DEPTH))
        return _URC_NO_REASON;
    walk->of_program += modules[module].program;
    walk->of_library += !modules[module].program;
    site->frames[site->depth].module = module;
    site->frames[site->depth++].offset = code - modules[module].base;
    return _URC_NO_REASON;
}

// FNV-1a of the stack.
static uint64_t number_of(const struct site *site)
{
    uint64_t hash = 14695981039346656037u;
    for (int i = 0; i < site->depth; i++) {
        const uint64_t parts[] = {(uint64_t)site->frames[i].module, site->frames[i].offset};
        for (size_t b = 0; b < sizeof parts; b++)
            hash = (hash ^ ((const uint8_t *)parts)[b]) * 1099511628211u;
    }
    return hash ? hash : 1;
}

int site_of_call(long *turn)
{
    struct site here = {0};
    struct walk walk = {&here, 0, 0};
    if (unwinding)
        return -1;
    unwinding = true;
    _Unwind_Backtrace(add_frame, &walk);
    unwinding = false;
    here.number = number_of(&here);
    int found = -1;
    pthread_mutex_lock(&lock);
    for (int i = 0; i < SITES_MAX && found < 0; i++) {
        const int at = (int)((here.number + (uint64_t)i) % SITES_MAX);
        if (!sites[at].number)
            sites[at] = here;
        if (sites[at].number == here.number)
            found = at;
    }
    if (found >= 0)
        *turn = ++sites[found].calls;
    pthread_mutex_unlock(&lock);
    return found;
}

uint64_t site_number(int site) { return sites[site].number; }

static size_t first_place(const void *block) { return (uintptr_t)block / 16 * 2654435761u % BLOCKS_MAX; }

void site_takes(int site, const void *block)
{
    if (site < 0 || !block)
        return;
    pthread_mutex_lock(&lock);
    size_t at = first_place(block);
    while (blocks[at].block && blocks[at].block != &gone)
        at = (at + 1) % BLOCKS_MAX;
    if (block_count < BLOCKS_MAX / 2) {
        block_count += !blocks[at].block;
        blocks[at].block = block;
        blocks[at].site = site;
        sites[site].blocks++;
    }
    pthread_mutex_unlock(&lock);
}

void site_gives_back(const void *block)
{
    if (!block)
        return;
    pthread_mutex_lock(&lock);
    size_t at = first_place(block);
    while (blocks[at].block && blocks[at].block != block)
        at = (at + 1) % BLOCKS_MAX;
    if (blocks[at].block) {
        blocks[at].block = &gone;
        sites[blocks[at].site].blocks--;
    }
    pthread_mutex_unlock(&lock);
}

void sites_write(const char *path, bool failed)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return;
    fprintf(file, "%d\n", failed);
    for (int i = 0; i < SITES_MAX; i++) {
        const struct site *s = &sites[i];
        if (!s->number)
            continue;
        fprintf(file, "%llx %ld %ld", (unsigned long long)s->number, s->calls, s->blocks);
        for (int k = 0; k < s->depth; k++)
            fprintf(file, " %s+%llx", modules[s->frames[k].module].name, (unsigned long long)s->frames[k].offset);
        fprintf(file, "\n");
    }
    fclose(file);
}
