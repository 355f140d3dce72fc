#include "tests/support/test.h"

#include "tests/support/answer.h"

#include <string.h>

static int lines_of(const char *text)
{
    int lines = 0;
    for (; *text; text++)
        lines += *text == '\n';
    return lines;
}

void expect_sentence(struct process_result said, const char *word, const char *file, int line)
{
    const int lines = lines_of(said.err);
    if (said.exit_code == 1 && lines == 1 && strstr(said.err, word))
        return;
    print_error("%s:%d: exit code %d, %d lines, wanted 1 and 1 and the words '%s'; stderr: %s\n", file, line,
                said.exit_code, lines, word, said.err);
    fail_test();
}

void expect_answer(struct process_result said, const char *words, const char *file, int line)
{
    if (!said.exit_code && strstr(said.out, words))
        return;
    print_error("%s:%d: exit code %d, wanted 0 and the words '%s'; stdout: %s\nstderr: %s\n", file, line,
                said.exit_code, words, said.out, said.err);
    fail_test();
}
