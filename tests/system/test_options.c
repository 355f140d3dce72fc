// What the programs say of their commands and options is what they take: --help everywhere, the completion and the man
// page that are made of it, the commands in the guide. And words that are no commands, and names that look like
// options.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

static struct scratch scratch;

// ------------------------------------------------------------- what there is

enum { MOST_WAYS = 60, MOST_OPTIONS = 60 };

// One way to use a program: "", "record", "objects serve", "calibrate --lens=x".
struct way {
    const char *program;
    char words[2][48];
    char options[MOST_OPTIONS][40];  // of its --help, "--as"
    char choices[MOST_OPTIONS][160]; // "a|b|c" where it takes one of them
    bool valued[MOST_OPTIONS];
    int count;
    char help[16384];
};

static struct way ways[MOST_WAYS];
static int way_count;

static struct process_result ask(const struct way *w, const char *first, const char *second)
{
    const char *const given[] = {w->words[0], w->words[1], first, second};
    const char *argv[8] = {w->program};
    int count = 1;
    for (size_t i = 0; i < COUNT_OF(given); i++)
        if (given[i] && *given[i])
            argv[count++] = given[i];
    return process_run(argv);
}

static void take_option(struct way *w, const char *at)
{
    const size_t length = strspn(at, "abcdefghijklmnopqrstuvwxyz0123456789-");
    snprintf(w->options[w->count], sizeof w->options[0], "%.*s", (int)length, at);
    for (int i = 0; i < w->count; i++)
        if (!strcmp(w->options[i], w->options[w->count]))
            return;
    w->valued[w->count] = at[length] == '=';
    char *choices = w->choices[w->count++];
    assert_true(w->count < MOST_OPTIONS);
    if (at[length] == '=' && isalpha((unsigned char)at[length + 1]))
        snprintf(choices, sizeof w->choices[0], "%.*s", (int)strcspn(at + length + 1, " \n"), at + length + 1);
    if (!strchr(choices, '|'))
        *choices = 0;
}

// The lines of options begin with six columns, which a short one may stand in.
static void add_way(const char *program, const char *first, const char *second)
{
    struct way *w = &ways[way_count++];
    assert_true(way_count < MOST_WAYS);
    w->program = program;
    snprintf(w->words[0], sizeof w->words[0], "%s", first);
    snprintf(w->words[1], sizeof w->words[1], "%s", second);
    const struct process_result said = ask(w, "--help", NULL);
    if (said.exit_code || *said.err || !strstr(said.out, "Usage"))
        print_error("%s %s %s --help: %d, %s\n", program, first, second, said.exit_code, said.err);
    EXPECT_TRUE(!said.exit_code && !*said.err && strstr(said.out, "Usage"));
    memcpy(w->help, said.out, sizeof w->help);
    for (const char *line = w->help; line; line = strchr(line, '\n'), line += line != NULL)
        if ((!strncmp(line, "      --", 8) || (!strncmp(line, "  -", 3) && !strncmp(line + 4, ", --", 4))))
            take_option(w, line + 6);
}

static void add_commands(const char *program, const char *name)
{
    const struct process_result said = PROCESS(program, "--help");
    char format[64], command[32];
    EXPECT_INT(said.exit_code, 0);
    snprintf(format, sizeof format, "  %s %%31[a-zA-Z]", name);
    for (const char *line = said.out; line; line = strchr(line, '\n'), line += line != NULL)
        if (!strncmp(line, "  ", 2) && sscanf(line, format, command) == 1)
            add_way(program, command, "");
}

static int find_ways(void **state)
{
    (void)state;
    scratch = scratch_make();
    setenv("COLUMNS", "200", 1);
    setenv("ARGP_HELP_FMT", "rmargin=190", 1);
    add_commands(REENACT, "reenact");
    add_commands(CAPTURE, "reenact-capture");
    static const char *const kinds[] = {"--board=x", "--lens=x", "--color-depth=x", "--rolling-shutter=x",
                                        "--stereo=x"};
    for (size_t i = 0; i < COUNT_OF(kinds); i++)
        add_way(CAPTURE, "calibrate", kinds[i]);
    static const char *const actions[] = {"serve", "list", "note"};
    for (size_t i = 0; i < COUNT_OF(actions); i++)
        add_way(CAPTURE, "objects", actions[i]);
    return 0;
}

static int forget(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

static const struct way *way_of(const char *program, const char *first, const char *second)
{
    const struct way *found = NULL;
    for (int i = 0; i < way_count; i++)
        if (!strcmp(ways[i].program, program) && !strcmp(ways[i].words[0], first) &&
            (!*ways[i].words[1] || !strcmp(ways[i].words[1], second)))
            found = &ways[i]; // the one with an action of its own comes later
    return found;
}

static bool has_option(const struct way *w, const char *option)
{
    for (int i = 0; i < w->count; i++)
        if (!strcmp(w->options[i], option))
            return true;
    return false;
}

// ------------------------------------------------------------- help and programs

// The option behind it is not there, so nothing is done, whatever the first one does.
static void take_one(const struct way *w, int k)
{
    char given[64], refused[80];
    snprintf(given, sizeof given, "%s%s", w->options[k], w->valued[k] ? "=none-of-these" : "");
    snprintf(refused, sizeof refused, "unrecognized option '%s", w->options[k]);
    const struct process_result said = ask(w, given, "--no-such-option");
    if (said.exit_code != 2 || strstr(said.err, refused))
        print_error("%s %s %s %s: %d, %s\n", w->program, w->words[0], w->words[1], given, said.exit_code, said.err);
    EXPECT_TRUE(said.exit_code == 2 && !strstr(said.err, refused));
    if (!*w->choices[k])
        return;
    char list[200] = "", *out = list; // "a|b|c" as "a, b or c"
    for (const char *at = w->choices[k]; *at; at++)
        out += *at != '|' ? (*out = *at, 1) : sprintf(out, "%s", strchr(at + 1, '|') ? ", " : " or ");
    *out = 0;
    if (!strstr(said.err, list))
        print_error("%s %s: '%s' is not in %s\n", w->words[0], given, list, said.err);
    EXPECT_TRUE(strstr(said.err, list));
}

// Many at once, as starting a program takes long. Options are read one after the other: those before the one that is
// not there were taken where it is refused. Else the value of one was refused, which the answer names: that one was
// taken as well, and those before it, and what comes behind is asked again.
static void take_all(const struct way *w, const int *asked, int count)
{
    while (count > 0) {
        char given[MOST_OPTIONS][64], refused[64];
        const char *argv[MOST_OPTIONS + 5] = {w->program};
        int words = 1, named = 0;
        for (int i = 0; i < 2; i++)
            if (*w->words[i])
                argv[words++] = w->words[i];
        for (int i = 0; i < count; i++) {
            const int k = asked[i];
            snprintf(given[i], sizeof given[i], "%s%s", w->options[k], w->valued[k] ? "=none-of-these" : "");
            argv[words++] = given[i];
        }
        argv[words] = "--no-such-option";
        const struct process_result said = process_run(argv);
        if (said.exit_code == 2 && strstr(said.err, "unrecognized option '--no-such-option"))
            return;
        const char *option = strstr(said.err, ": --");
        snprintf(refused, sizeof refused, "%.*s", option ? (int)strcspn(option + 2, " =") : 0,
                 option ? option + 2 : "");
        while (named < count && strcmp(w->options[asked[named]], refused) != 0)
            named++;
        if (said.exit_code != 2 || named == count) {
            named = 0;
            take_one(w, asked[0]);
        }
        asked += named + 1;
        count -= named + 1;
    }
}

static void test_options_of_the_help_are_taken(void **state)
{
    (void)state;
    int taken = 0;
    for (int i = 0; i < way_count; i++) {
        const struct way *w = &ways[i];
        int asked[MOST_OPTIONS], count = 0;
        for (int k = 0; k < w->count; k++) {
            if (!strcmp(w->options[k], "--help") || !strcmp(w->options[k], "--usage") ||
                !strcmp(w->options[k], "--version") || (!strcmp(w->words[0], "calibrate") && !*w->words[1]))
                continue; // calibrate as a whole: its kinds are asked one by one
            taken++;
            if (*w->choices[k])
                take_one(w, k);
            else
                asked[count++] = k;
        }
        take_all(w, asked, count);
    }
    print_message("%d options of %d ways\n", taken, way_count);
    EXPECT_AT_LEAST(taken, 120);
}

// argp lists every option that is not hidden: none is, but the second short name of --help.
static void test_no_option_is_hidden(void **state)
{
    (void)state;
    const struct process_result said =
        PROCESS("/usr/bin/grep", "-rn", "OPTION_HIDDEN\\|OPTION_NO_USAGE", SOURCE_DIR "/app/commands");
    EXPECT_TRUE(strstr(said.out, "command.c") && !strchr(strchr(said.out, '\n') + 1, '\n'));
}

static void test_help_in_every_place(void **state)
{
    (void)state;
    static const char *const lines[] = {"reenact-capture calibrate --board --help",
                                        "reenact-capture calibrate --lens --help",
                                        "reenact-capture calibrate --color-depth --help",
                                        "reenact-capture calibrate --rolling-shutter --help",
                                        "reenact-capture calibrate --stereo --help",
                                        "reenact-capture calibrate --board -h",
                                        "reenact-capture calibrate --out --help --board",
                                        "reenact-capture take trim --help",
                                        "reenact-capture take trim x.reenact --take --help",
                                        "reenact-capture objects serve --help",
                                        "reenact-capture objects note x.reenact --text --help",
                                        "reenact-capture record --out --help",
                                        "reenact-capture export x.reenact --as --help",
                                        "reenact-capture tags --out --help",
                                        "reenact x.reenact --help",
                                        "reenact --help x.reenact",
                                        "reenact compare --html --help",
                                        "reenact render --mp4 -h x.reenact"};
    for (size_t i = 0; i < COUNT_OF(lines); i++) {
        char command[600];
        snprintf(command, sizeof command, "cd '%s' && %s/%s", scratch.path, PROGRAM_DIR, lines[i]);
        const struct process_result said = PROCESS("/usr/bin/bash", "-c", command);
        if (said.exit_code || *said.err || !strstr(said.out, "Usage"))
            print_error("%s: %d, %s\n", lines[i], said.exit_code, said.err);
        EXPECT_TRUE(!said.exit_code && !*said.err && strstr(said.out, "Usage"));
    }
    const struct way *watch = way_of(REENACT, "FILE", ""), *calibrate = way_of(CAPTURE, "calibrate", "");
    EXPECT_TRUE(has_option(watch, "--camera") && has_option(watch, "--sensor") && has_option(watch, "--light"));
    EXPECT_TRUE(strstr(PROCESS(REENACT, "--help").out, "--sensor=URI"));
    EXPECT_TRUE(has_option(calibrate, "--circles") && has_option(calibrate, "--out") &&
                has_option(calibrate, "--discs"));
}

static void test_a_mistyped_command(void **state)
{
    (void)state;
    static const struct {
        const char *program, *word, *says;
    } cases[] = {
        {REENACT, "rendr", "reenact: there is no command 'rendr' and no such file; did you mean render?"},
        {REENACT, "comapre", "did you mean compare?"},
        {REENACT, "loc", "did you mean locate?"},
        {REENACT, "quux", "reenact: there is no command 'quux' and no such file; reenact --help"},
        {CAPTURE, "recrod", "reenact-capture: there is no command 'recrod'; did you mean record?"},
        {CAPTURE, "exprt", "did you mean export?"},
        {CAPTURE, "x", "reenact-capture --help"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        const struct process_result said = PROCESS(cases[i].program, cases[i].word, "x");
        if (said.exit_code != 2 || !strstr(said.err, cases[i].says))
            print_error("%s: %d, %s\n", cases[i].word, said.exit_code, said.err);
        EXPECT_TRUE(said.exit_code == 2 && strstr(said.err, cases[i].says) && !*said.out);
    }
    const struct process_result action = PROCESS(CAPTURE, "take", "trmi", "x.reenact", "--take", "x");
    EXPECT_TRUE(action.exit_code == 2 && strstr(action.err, "take: there is no action 'trmi'; did you mean trim?"));
    const struct process_result thing = PROCESS(CAPTURE, "objects", "serv", "x");
    EXPECT_TRUE(thing.exit_code == 2 && strstr(thing.err, "objects: there is no action 'serv'; did you mean serve?"));
    // A file's name is a file's.
    const struct process_result said = PROCESS(REENACT, "nowhere.reenact");
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(!strncmp(said.err, "reenact: nowhere.reenact", 24));
    EXPECT_TRUE(!strncmp(PROCESS(REENACT, "a.reenact", "b.reenact").err, "reenact: ", 9));
    // An option that has lost its value.
    const struct process_result lost = PROCESS(CAPTURE, "record", "--sensor", "--out", "x.reenact", "--take", "x");
    EXPECT_TRUE(lost.exit_code == 2 && strstr(lost.err, "--sensor needs a value"));
}

// ------------------------------------------------------------- names

static void test_no_output_looks_like_an_option(void **state)
{
    (void)state;
    static const char *const lines[] = {"reenact-capture calibrate --board=-x.pdf",
                                        "reenact-capture calibrate --board --hepl",
                                        "reenact-capture calibrate --board=./--help",
                                        "reenact-capture calibrate --stereo . --out=-x",
                                        "reenact-capture tags --out=-tags.pdf",
                                        "reenact-capture record --sensor folder:. --take a --out=-x.reenact",
                                        "reenact-capture map --sensor folder:. --out=-x.reenact",
                                        "reenact-capture library . --html=-x.html",
                                        "reenact-capture take copy x.reenact --take a --into=-x.reenact",
                                        "reenact-capture objects serve --objects o.json -- -x",
                                        "reenact drive sim: --seconds 1 --out=-x",
                                        "reenact surround . --views v.txt --out=-x"};
    scratch_text(&scratch, "o.json", "{\"objects\": []}");
    for (size_t i = 0; i < COUNT_OF(lines); i++) {
        char command[600];
        snprintf(command, sizeof command, "cd '%s' && %s/%s", scratch.path, PROGRAM_DIR, lines[i]);
        const struct process_result said = PROCESS("/usr/bin/bash", "-c", command);
        if (!said.exit_code || said.exit_code > 2)
            print_error("%s: %d, %s\n", lines[i], said.exit_code, said.err);
        EXPECT_TRUE(said.exit_code == 1 || said.exit_code == 2);
    }
    char command[400];
    snprintf(command, sizeof command, "ls -A '%s' | grep '^-'", scratch.path);
    const struct process_result found = PROCESS("/usr/bin/bash", "-c", command);
    print_message("%s", found.out);
    EXPECT_INT(found.exit_code, 1);
    // What all outputs go through.
    EXPECT_STATUS(file_check_name(""), ERR_INPUT);
    EXPECT_STATUS(file_check_name("-"), ERR_INPUT); // standard output is asked for before
    EXPECT_STATUS(file_check_name("a/--help/"), ERR_INPUT);
    EXPECT_STATUS(file_check_name("a-b/c--d"), OK);
    EXPECT_STATUS(file_check_name("-a/b"), OK); // that folder must be there already
    EXPECT_STATUS(file_write(scratch_file(&scratch, "-x"), "x", 1), ERR_INPUT);
    EXPECT_STATUS(folder_make(scratch_file(&scratch, "--x")), ERR_INPUT);
}

// ------------------------------------------------------------- texts

// Of each line of a text that is a command, as it stands there, the options.
static int check_commands(const char *path)
{
    uint8_t *bytes;
    size_t size;
    int commands = 0;
    EXPECT_STATUS(file_read(path, &bytes, &size), OK);
    for (char *rest = (char *)bytes, *line; (line = strsep(&rest, "\n"));) {
        char program[32], first[64] = "", second[64] = "";
        if (sscanf(line, "    %31[a-z-] %63s %63s", program, first, second) < 2 || strncmp(line, "    r", 5) ||
            (strcmp(program, "reenact") && strcmp(program, "reenact-capture")))
            continue;
        line[strcspn(line, "#;")] = 0;
        char *behind = strstr(line + 8, "    "); // what it does
        if (behind)
            *behind = 0;
        const char *at = !strcmp(program, "reenact") ? REENACT : CAPTURE;
        first[strcspn(first, "|")] = 0;
        const struct way *w = way_of(at, first, second);
        if (!w && !strcmp(program, "reenact"))
            w = way_of(at, "FILE", "");
        if (!w)
            print_error("%s: there is no '%s %s'\n", path, program, first);
        EXPECT_TRUE(w);
        commands++;
        for (const char *option = line; (option = strstr(option, " --"));) {
            char word[64];
            option++;
            snprintf(word, sizeof word, "%.*s", (int)strcspn(option, " =)]|,`"), option);
            if (!has_option(w, word))
                print_error("%s: '%s %s' takes no %s\n", path, program, first, word);
            EXPECT_TRUE(has_option(w, word));
        }
    }
    free(bytes);
    return commands;
}

static void test_commands_of_the_guide(void **state)
{
    (void)state;
    EXPECT_AT_LEAST(check_commands(SOURCE_DIR "/docs/guide.md"), 30);
    EXPECT_AT_LEAST(check_commands(SOURCE_DIR "/README.md"), 5);
}

#ifndef EMULATED // made by bash and CMake, natively
static void expect_offered(const char *program, const char *typed, const char *const *wanted, int count, bool all)
{
    char script[1200];
    const char *name = strrchr(program, '/') + 1;
    snprintf(script, sizeof script,
             "cd '%s'; PATH=%s:$PATH; source ./%s.bash; COMP_WORDS=(%s %s); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); "
             "_%s; printf '%%s\\n' \"${COMPREPLY[@]}\"",
             scratch.path, PROGRAM_DIR, name, name, typed, !strcmp(name, "reenact") ? "reenact" : "reenact_capture");
    const struct process_result said = PROCESS("/usr/bin/bash", "-c", script);
    int lines = 0;
    for (const char *at = said.out; *at; at++)
        lines += *at == '\n';
    for (int i = 0; i < count; i++) {
        char line[80];
        snprintf(line, sizeof line, "%s\n", wanted[i]);
        const char *found = strstr(said.out, line);
        while (found && found != said.out && found[-1] != '\n')
            found = strstr(found + 1, line);
        if (!found)
            print_error("%s %s: %s is not offered, but %s%s\n", name, typed, wanted[i], said.out, said.err);
        EXPECT_TRUE(found);
    }
    if (all && lines != count)
        print_error("%s %s: %s\n", name, typed, said.out);
    EXPECT_TRUE(!all || lines == count);
}

// The takes' names are those of the recording that was typed, as bash would have them typed.
static void offer_takes(void)
{
    static const char *const names[] = {"one", "two\\ of\\ them", "say\\ \\\"hi\\\""};
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(SOURCE_DIR "/tests/recording/data/joint_error.reenact", &bytes, &count), OK);
    scratch_write(&scratch, "a.reenact", bytes, count);
    scratch_write(&scratch, "b.reenact", bytes, count);
    free(bytes);
    const char *b = scratch_file(&scratch, "b.reenact");
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", b, "--take", "one", "--name", "two of them").exit_code, 0);
    EXPECT_INT(PROCESS(CAPTURE, "take", "copy", b, "--take", "one", "--name", "say \"hi\"").exit_code, 0);
    expect_offered(CAPTURE, "export a.reenact --take ''", names, 1, true);
    expect_offered(CAPTURE, "take trim b.reenact --take ''", names, 3, true);
    expect_offered(CAPTURE, "take trim b.reenact --take = tw", names + 1, 1, true);
    expect_offered(REENACT, "b.reenact --take ''", names, 3, true);
    expect_offered(REENACT, "compare a.reenact --with b.reenact --take ''", names, 1, true);
    expect_offered(REENACT, "compare a.reenact --with b.reenact --with-take ''", names, 3, true);
}

static void test_completion_offers_what_is_taken(void **state)
{
    (void)state;
    static const char *const programs[] = {REENACT, CAPTURE};
    for (size_t i = 0; i < COUNT_OF(programs); i++) {
        char program[300], out[300];
        snprintf(program, sizeof program, "-DPROGRAM=%s", programs[i]);
        snprintf(out, sizeof out, "-DOUT=%s", scratch.path);
        const struct process_result said =
            PROCESS(CMAKE, program, out, "-DDOC=/usr/share/doc/reenact", "-P", SOURCE_DIR "/tools/manual.cmake");
        if (said.exit_code)
            print_error("%s%s\n", said.out, said.err);
        EXPECT_INT(said.exit_code, 0);
    }
    for (int i = 0; i < way_count; i++) {
        const struct way *w = &ways[i];
        const char *wanted[MOST_OPTIONS];
        char typed[160];
        if (!strcmp(w->words[0], "calibrate") && *w->words[1])
            continue; // offered together
        for (int k = 0; k < w->count; k++)
            wanted[k] = w->options[k];
        snprintf(typed, sizeof typed, "%s %s %s --", w->words[0], w->words[1], *w->words[1] ? "x" : "");
        expect_offered(w->program, typed, wanted, w->count, true);
        for (int k = 0; k < w->count; k++) {
            const char *values[16];
            char list[160], *rest = list;
            int count = 0;
            snprintf(list, sizeof list, "%s", w->choices[k]);
            for (char *value; *list && (value = strsep(&rest, "|"));)
                values[count++] = value;
            snprintf(typed, sizeof typed, "%s x %s ''", w->words[0], w->options[k]);
            if (count)
                expect_offered(w->program, typed, values, count, true);
            snprintf(typed, sizeof typed, "%s x %s = ''", w->words[0], w->options[k]); // --as=…, as bash takes it apart
            if (count)
                expect_offered(w->program, typed, values, count, true);
        }
    }
    offer_takes();
    static const char *const takes[] = {"rename", "delete", "trim", "copy", "note", "expect"};
    expect_offered(CAPTURE, "take ''", takes, COUNT_OF(takes), false);
    static const char *const things[] = {"serve", "list", "note"};
    expect_offered(CAPTURE, "objects ''", things, COUNT_OF(things), true);
}

static void test_man_page_has_every_option(void **state)
{
    (void)state;
    static const char *const programs[] = {REENACT, CAPTURE};
    for (size_t p = 0; p < COUNT_OF(programs); p++) {
        char name[64];
        uint8_t *page;
        size_t size;
        snprintf(name, sizeof name, "%s.1", strrchr(programs[p], '/') + 1);
        EXPECT_STATUS(file_read(scratch_file(&scratch, name), &page, &size), OK);
        for (int i = 0; i < way_count; i++)
            for (int k = 0; k < ways[i].count && !strcmp(ways[i].program, programs[p]); k++) {
                char escaped[96], *out = escaped;
                for (const char *at = ways[i].options[k]; *at; at++)
                    out += sprintf(out, "%s%c", *at == '-' ? "\\" : "", *at);
                if (!strstr((char *)page, escaped))
                    print_error("%s lacks %s\n", name, ways[i].options[k]);
                EXPECT_TRUE(strstr((char *)page, escaped));
            }
        EXPECT_TRUE(strstr((char *)page, "/usr/share/doc/reenact/guide.md"));
        free(page);
    }
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_options_of_the_help_are_taken),
        cmocka_unit_test(test_no_option_is_hidden),
        cmocka_unit_test(test_help_in_every_place),
        cmocka_unit_test(test_a_mistyped_command),
        cmocka_unit_test(test_no_output_looks_like_an_option),
        cmocka_unit_test(test_commands_of_the_guide),
#ifndef EMULATED
        cmocka_unit_test(test_completion_offers_what_is_taken),
        cmocka_unit_test(test_man_page_has_every_option),
#endif
    };
    return cmocka_run_group_tests(tests, find_ways, forget);
}
