// The programs are hardened: position-independent, relocations read-only from the start, no executable stack, stack
// protectors and checked library calls. Read from their ELF files.
#include "tests/support/test.h"

#include "platform/files/file.h"

#include <elf.h>
#include <string.h>

struct program {
    uint8_t *bytes;
    size_t count;
    const Elf64_Ehdr *head;
};

static const Elf64_Phdr *segment(const struct program *p, uint32_t type)
{
    const Elf64_Phdr *all = (const Elf64_Phdr *)(const void *)(p->bytes + p->head->e_phoff);
    for (int i = 0; i < p->head->e_phnum; i++)
        if (all[i].p_type == type)
            return &all[i];
    return NULL;
}

static bool binds_now(const struct program *p)
{
    const Elf64_Phdr *dynamic = segment(p, PT_DYNAMIC);
    if (!dynamic)
        return false;
    const Elf64_Dyn *d = (const Elf64_Dyn *)(const void *)(p->bytes + dynamic->p_offset);
    for (; d->d_tag != DT_NULL; d++)
        if (d->d_tag == DT_BIND_NOW || (d->d_tag == DT_FLAGS && d->d_un.d_val & DF_BIND_NOW) ||
            (d->d_tag == DT_FLAGS_1 && d->d_un.d_val & DF_1_NOW))
            return true;
    return false;
}

static bool names(const struct program *p, const char *symbol)
{
    return memmem(p->bytes, p->count, symbol, strlen(symbol) + 1) != NULL;
}

static void test_programs_are_hardened(void **state)
{
    (void)state;
    static const char *const paths[] = {PROGRAM_DIR "/reenact", PROGRAM_DIR "/reenact-capture"};
    for (size_t i = 0; i < COUNT_OF(paths); i++) {
        struct program p;
        EXPECT_STATUS(file_read(paths[i], &p.bytes, &p.count), OK);
        p.head = (const Elf64_Ehdr *)(const void *)p.bytes;
        print_message("%s\n", paths[i]);
        EXPECT_INT(p.head->e_type, ET_DYN); // PIE
        EXPECT_TRUE(segment(&p, PT_GNU_RELRO) && binds_now(&p));
        const Elf64_Phdr *stack = segment(&p, PT_GNU_STACK);
        EXPECT_TRUE(stack && !(stack->p_flags & PF_X));
        EXPECT_TRUE(SANITIZED || names(&p, "__stack_chk_fail"));
        EXPECT_TRUE(SANITIZED || (names(&p, "__snprintf_chk") && names(&p, "__fprintf_chk")));
        free(p.bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_programs_are_hardened)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
