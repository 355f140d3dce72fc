// What a program answered, checked. Where it is not as wanted, the exit code and what it said are printed with the line
// of the caller, and the test fails.
#pragma once
#include "tests/support/process.h"

// Exit code 1, and exactly one line on standard error, with `word` in it.
#define EXPECT_SENTENCE(said, word) expect_sentence(said, word, __FILE__, __LINE__)
void expect_sentence(struct process_result said, const char *word, const char *file, int line);

// Exit code 0, and `words` on standard output.
#define EXPECT_ANSWER(said, words) expect_answer(said, words, __FILE__, __LINE__)
void expect_answer(struct process_result said, const char *words, const char *file, int line);
