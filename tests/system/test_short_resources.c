// With little memory, or small stacks, the commands end with a sentence or do their work, and no signal ends them:
// neither in their own code nor in exit handlers of libraries.
#include "tests/support/test.h"

#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>

static struct scratch scratch;

// The loader's account of it is beside it: see reached_main().
static struct process_result limited(const char *limit, const char *command)
{
    char script[1200];
    snprintf(script, sizeof script,
             "cd '%s' && rm -f loader.* && ulimit %s && LD_DEBUG=files LD_DEBUG_OUTPUT=loader exec %s/%s", scratch.path,
             limit, PROGRAM_DIR, command);
    return PROCESS("/usr/bin/bash", "-c", script);
}

// Was the program of the last limited() begun? Initialisers of libraries, which the loader runs before, throw or crash
// for want of memory, which the program cannot catch.
static bool reached_main(void)
{
    return PROCESS("/usr/bin/bash", "-c", "grep -qs 'transferring control: .*/reenact' \"$0\"/loader.*", scratch.path)
               .exit_code == 0;
}

static void test_small_stacks(void **state)
{
    (void)state;
    static const char *const sizes[] = {"-s 128"};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        static const char *const commands[] = {
            "reenact-capture record --sensor folder:film/sensor --out a.reenact --take one --no-body-points",
            "reenact-capture export a.reenact --take one --as glb --out a.glb --force",
            "reenact-capture map --sensor folder:film/sensor --out b.reenact",
            "reenact compare a.reenact --take one --with a.reenact --with-take one",
            "reenact-capture verify a.reenact"};
        for (size_t k = 0; k < COUNT_OF(commands); k++) {
            const struct process_result said = limited(sizes[i], commands[k]);
            if (said.exit_code)
                print_error("%s, %s: %d, %s\n", sizes[i], commands[k], said.exit_code, said.err);
            EXPECT_INT(said.exit_code, 0);
        }
        PROCESS("/usr/bin/bash", "-c", "rm -f \"$0\"/[ab].reenact*", scratch.path);
        EXPECT_INT(limited(sizes[i], "reenact-capture nonsense").exit_code, 2);
    }
}

// From where the loader itself gives up to where there is enough.
static void test_little_memory(void **state)
{
    (void)state;
    int ended[2] = {0};
    EXPECT_INT(limited("-c 0", "reenact-capture record --sensor folder:film/sensor --out m.reenact --take one "
                               "--no-body-points")
                   .exit_code,
               0);
    for (int mb = 80; mb <= 130; mb += 5) {
        static const char *const commands[] = {"reenact-capture info m.reenact", "reenact-capture --help",
                                               "reenact-capture info none"};
        char limit[32];
        snprintf(limit, sizeof limit, "-v %d", mb * 1024);
        for (size_t k = 0; k < COUNT_OF(commands); k++) {
            const struct process_result said = limited(limit, commands[k]);
            if (said.exit_code >= 128)
                print_error("%d MB, %s: %d, %s\n", mb, commands[k], said.exit_code, said.err);
            EXPECT_TRUE(said.exit_code < 128 || !reached_main());
            EXPECT_TRUE(!said.exit_code || said.exit_code >= 128 || *said.err);
            ended[!said.exit_code]++;
            if (!said.exit_code)
                EXPECT_TRUE(reached_main()); // as the loader says it of one that worked
        }
    }
    print_message("%d ended with a sentence, %d did their work\n", ended[0], ended[1]);
    EXPECT_TRUE(ended[0] && ended[1]);
}

static int set_up(void **state)
{
    (void)state;
    char out[400];
    scratch = scratch_make();
    snprintf(out, sizeof out, "%s/film", scratch.path);
    const struct process_result said = PROCESS(PROGRAM_DIR "/film-world", "--out", out, "--what", "sensor", "--motion",
                                               "kata", "--size", "160x120", "--rate", "10", "--seconds", "2");
    return said.exit_code;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
#if defined(EMULATED)
    return 0; // its own memory and stacks are the emulator's
#endif
    if (SANITIZED)
        return 0; // they need both
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_small_stacks), cmocka_unit_test(test_little_memory)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
