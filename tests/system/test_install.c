// What a user meets first: --help, -h and --version alike in every command, what cmake --install puts where (programs,
// man pages and completion, which are made from the same help), and the package.
#include "tests/support/test.h"

#include "platform/files/database.h"
#include "platform/files/file.h"
#include "recording/recording.h"
#include "tests/support/process.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { COMMANDS_MAX = 40 };

static struct scratch scratch;

// The commands that the program lists: "  reenact-capture map        film the empty place".
static int commands_of(const char *program, char names[COMMANDS_MAX][32])
{
    const char *const path = !strcmp(program, "reenact") ? PROGRAM_DIR "/reenact" : PROGRAM_DIR "/reenact-capture";
    const struct process_result said = PROCESS(path, "--help");
    EXPECT_INT(said.exit_code, 0);
    char format[64];
    int count = 0;
    snprintf(format, sizeof format, "  %s %%31[a-zA-Z]", program);
    for (const char *at = said.out; at; at = strchr(at, '\n'), at += at != NULL)
        if (count < COMMANDS_MAX && !strncmp(at, "  ", 2) && sscanf(at, format, names[count]) == 1)
            count++;
    return count;
}

static void check_command(const char *path, const char *command)
{
    const struct process_result help = PROCESS(path, command, "--help"), h = PROCESS(path, command, "-h");
    const struct process_result version = PROCESS(path, command, "--version");
    if (help.exit_code || h.exit_code || version.exit_code)
        print_error("%s %s: --help %d, -h %d, --version %d\n", path, command, help.exit_code, h.exit_code,
                    version.exit_code);
    EXPECT_INT(help.exit_code || h.exit_code || version.exit_code, 0);
    EXPECT_TRUE(!strcmp(help.out, h.out) && strstr(help.out, "Usage"));
    const char *slash = strrchr(path, '/');
    EXPECT_TRUE(!strncmp(version.out, slash + 1, strlen(slash + 1)) && strstr(version.out, " 0."));
    EXPECT_TRUE(!*help.err && !*h.err && !*version.err);
}

static void test_help_and_version_are_alike(void **state)
{
    (void)state;
    const char *const programs[] = {"reenact", "reenact-capture"};
    for (size_t i = 0; i < COUNT_OF(programs); i++) {
        char path[512], names[COMMANDS_MAX][32];
        snprintf(path, sizeof path, "%s/%s", PROGRAM_DIR, programs[i]);
        const int count = commands_of(programs[i], names);
        EXPECT_AT_LEAST(count, 5);
        for (int k = 0; k < count; k++)
            check_command(path, names[k]);
        const struct process_result version = PROCESS(path, "--version");
        EXPECT_INT(version.exit_code, 0);
        EXPECT_TRUE(!strncmp(version.out, programs[i], strlen(programs[i])));
    }
}

static char *read_text(const char *path)
{
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(path, &bytes, &count), OK);
    return (char *)bytes;
}

// The words that bash would offer after `typed`.
static struct process_result complete(const char *file, const char *program, const char *function, const char *typed)
{
    char script[1024];
    snprintf(script, sizeof script,
             "source %s; COMP_WORDS=(%s %s); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); "
             "%s %s \"${COMP_WORDS[COMP_CWORD]}\"; echo \"${COMPREPLY[@]}\"",
             file, program, typed, function, program);
    return PROCESS("/usr/bin/bash", "-c", script);
}

// It has stages in place of commands.
static void check_bench(const char *prefix)
{
    char path[512];
    snprintf(path, sizeof path, "%s/bin/reenact-bench", prefix);
    const struct process_result stages = PROCESS(path);
    EXPECT_INT(stages.exit_code, 0);
    EXPECT_TRUE(strstr(stages.out, "tag-distance"));
    snprintf(path, sizeof path, "%s/share/man/man1/reenact-bench.1.gz", prefix);
    EXPECT_INT(PROCESS("gzip", "-d", path).exit_code, 0);
    path[strlen(path) - strlen(".gz")] = 0;
    char *page = read_text(path);
    EXPECT_TRUE(strstr(page, "[OPTION...] [STAGE]") && strstr(page, "tag\\-distance"));
    EXPECT_TRUE(strstr(page, "reenact-bench \\- Measures error against time"));
    free(page);
    snprintf(path, sizeof path, "%s/share/bash-completion/completions/reenact-bench", prefix);
    struct process_result said = complete(path, "reenact-bench", "_reenact_bench", "tag");
    EXPECT_TRUE(strstr(said.out, "tags") && strstr(said.out, "tag-distance") && !strstr(said.out, "depth"));
    said = complete(path, "reenact-bench", "_reenact_bench", "depth --rou");
    EXPECT_TRUE(strstr(said.out, "--rounds"));
    said = complete(path, "reenact-bench", "_reenact_bench", "--ht");
    EXPECT_TRUE(strstr(said.out, "--html"));
}

static void test_what_is_installed(void **state)
{
    (void)state;
    char prefix[300], path[512], names[COMMANDS_MAX][32];
    snprintf(prefix, sizeof prefix, "%s", scratch_file(&scratch, "usr"));
    struct process_result said = PROCESS(CMAKE, "--install", BUILD_DIR, "--prefix", prefix);
    if (said.exit_code)
        print_error("%s%s\n", said.out, said.err);
    EXPECT_INT(said.exit_code, 0);
    snprintf(path, sizeof path, "%s/bin/reenact-capture", prefix);
    said = PROCESS(path, "--version");
    EXPECT_INT(said.exit_code, 0);
    snprintf(path, sizeof path, "%s/share/doc/reenact/copyright", prefix);
    char *licences = read_text(path);
    EXPECT_TRUE(strstr(licences, "Apache-2.0") && strstr(licences, "Dear ImGui"));
    free(licences);
    snprintf(path, sizeof path, "%s/share/man/man1/reenact-capture.1.gz", prefix);
    EXPECT_INT(PROCESS("gzip", "-d", path).exit_code, 0);
    path[strlen(path) - strlen(".gz")] = 0;
    char *page = read_text(path);
    const int count = commands_of("reenact-capture", names);
    for (int i = 0; i < count; i++) {
        char section[64];
        snprintf(section, sizeof section, ".SH \"REENACT-CAPTURE %.31s\"", names[i]);
        if (!strstr(page, section))
            print_error("the man page lacks %s\n", section);
        EXPECT_TRUE(strstr(page, section));
    }
    EXPECT_TRUE(strstr(page, "no\\-body\\-points"));
    free(page);
    snprintf(path, sizeof path, "%s/share/bash-completion/completions/reenact-capture", prefix);
    said = complete(path, "reenact-capture", "_reenact_capture", "re");
    EXPECT_TRUE(strstr(said.out, "record") && strstr(said.out, "repair") && !strstr(said.out, "map"));
    said = complete(path, "reenact-capture", "_reenact_capture", "record --no");
    EXPECT_TRUE(strstr(said.out, "--no-body-points"));
    snprintf(path, sizeof path, "%s/share/bash-completion/completions/reenact", prefix);
    said = complete(path, "reenact", "_reenact", "film.reenact --full");
    EXPECT_TRUE(strstr(said.out, "--fullscreen"));
    said = complete(path, "reenact", "_reenact", "render film.reenact --det");
    EXPECT_TRUE(strstr(said.out, "--detail"));
    check_bench(prefix);
}

// Every relative link of a text that was installed leads to a file that was, too.
static int check_links(const char *folder, const char *name)
{
    char path[700], link[400], to[1200];
    int links = 0;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    char *text = read_text(path);
    for (const char *at = text; (at = strstr(at, "]("));) {
        at += 2;
        snprintf(link, sizeof link, "%.*s", (int)strcspn(at, ")#"), at);
        if (!*link || strstr(link, "://"))
            continue;
        snprintf(to, sizeof to, "%s/%s", folder, link);
        if (access(to, R_OK))
            print_error("%s: %s was not installed\n", path, link);
        EXPECT_INT(access(to, R_OK), 0);
        links++;
    }
    free(text);
    return links;
}

static void test_installed_texts_find_each_other(void **state)
{
    (void)state;
    char prefix[300], folder[400], path[600], *page;
    snprintf(prefix, sizeof prefix, "%s", scratch_file(&scratch, "usr"));
    snprintf(folder, sizeof folder, "%s/share/doc/reenact", prefix);
    EXPECT_AT_LEAST(check_links(folder, "README.md"), 5);
    static const char *const texts[] = {"guide.md", "sensors.md", "limitations.md", "results.md", "method.md"};
    snprintf(folder, sizeof folder, "%s/share/doc/reenact/docs", prefix);
    for (size_t i = 0; i < COUNT_OF(texts); i++)
        check_links(folder, texts[i]);
    // The page of the headers has the first room's and the last one's, and what they say.
    snprintf(path, sizeof path, "%s/api.html", folder);
    page = read_text(path);
    EXPECT_TRUE(strstr(page, "id=\"base/geometry.h\"") && strstr(page, "id=\"app/commands/command.h\""));
    EXPECT_TRUE(strstr(page, "struct vec3") && !strstr(page, "_internal.h</h2>"));
    free(page);
    // What the programs themselves name.
    snprintf(path, sizeof path, "%s/share/man/man1/reenact-capture.1", prefix); // unpacked above
    page = read_text(path);
    snprintf(path, sizeof path, "The guide, %s/guide.md.", folder);
    char escaped[1200], *out = escaped; // as roff has a -
    for (const char *at = path; *at; at++)
        out += sprintf(out, "%s%c", *at == '-' ? "\\" : "", *at);
    EXPECT_TRUE(strstr(page, escaped));
    free(page);
    unsetenv("REENACT_FAKE_SENSOR");
    snprintf(path, sizeof path, "%s/bin/reenact-capture", prefix);
    const struct process_result said = PROCESS(path, "devices");
    print_message("%s%s", said.out, said.err);
    snprintf(path, sizeof path, "%s/sensors.md says", folder);
    EXPECT_TRUE(strstr(said.out, "openni") || strstr(said.err, path));
}

// The installed program fetches the networks, by whatever of npm, curl and wget there is: here scripts that give what
// is in a folder, or nothing.
static void test_networks_are_fetched(void **state)
{
    (void)state;
    char program[400], command[8000];
    const char *data = scratch_file(&scratch, "data");
    static const char *const known = "\"${XDG_DATA_HOME:-$HOME/.local/share}/reenact/models\"";
    snprintf(program, sizeof program, "%s", scratch_file(&scratch, "usr/bin/reenact-capture"));
    static const char *const tools[] = {"npm", "curl", "wget"};
    static const char *const writes[] = {"x.tgz", "package.tgz", "package.tgz"};
    const struct process_result there = PROCESS("/usr/bin/bash", "-c",
                                                "test -f \"${XDG_DATA_HOME:-$HOME/.local/share}"
                                                "/reenact/models/pose_landmark_lite.tflite\"");
    for (size_t i = 0; i < COUNT_OF(tools); i++)
        for (int good = 0; good < 2; good++) {
            if (good && there.exit_code)
                continue; // none to give
            // The tool finds only itself and what a shell has; the package is made of the networks, or of other files.
            snprintf(
                command, sizeof command,
                "set -e; rm -rf '%s' '%s/t'; mkdir -p '%s/t/bin' '%s/t/package'; cd '%s/t'; "
                "for f in pose_landmark_full.tflite pose_landmark_lite.tflite pose_detection.tflite; do "
                "if [ %d = 1 ]; then cp %s/$f package/; else echo no > package/$f; fi; done; "
                "mv package/pose_detection.tflite package/pose_solution_packed_assets.data; tar -czf all.tgz package; "
                "for p in sh sha256sum tar gzip mktemp rm mv mkdir chmod cp; do ln -s \"$(command -v $p)\" bin/$p; "
                "done; "
                "printf '#!/bin/sh\nwhile [ $# -gt 0 ]; do case $1 in --output) o=$2;; --output-document=*) "
                "o=${1#*=};; esac; shift; done\ncp %s/t/all.tgz ${o:-%s}\n' > bin/%s; chmod +x bin/%s; "
                "export XDG_DATA_HOME='%s' PATH='%s/t/bin'; %s models --fetch && %s models",
                data, scratch.path, scratch.path, scratch.path, scratch.path, good, known, scratch.path, writes[i],
                tools[i], tools[i], data, scratch.path, program, program);
            const struct process_result said = PROCESS("/usr/bin/bash", "-c", command);
            if (said.exit_code != !good)
                print_error("%s: %d, %s%s\n", tools[i], said.exit_code, said.out, said.err);
            EXPECT_INT(said.exit_code, !good);
            EXPECT_TRUE(strstr(good ? said.out : said.err, good ? "networks for body points are in" : "not those"));
            snprintf(command, sizeof command, "%s/reenact/models/pose_landmark_full.tflite", data);
            EXPECT_INT(!access(command, R_OK), good);
        }
    snprintf(command, sizeof command, "XDG_DATA_HOME='%s/none' %s models", scratch.path, program);
    const struct process_result said = PROCESS("/usr/bin/bash", "-c", command);
    EXPECT_INT(said.exit_code, 1);
    EXPECT_TRUE(strstr(said.err, "reenact-capture models --fetch") && strstr(said.err, "/none/reenact/models"));
}

// A desktop tells a recording by what it holds, whatever it is called, and from other SQLite files; what opens it, and
// the studio, are in the menu's own form.
static void test_a_desktop_knows_recordings(void **state)
{
    (void)state;
    char share[300], path[512], command[1400];
    snprintf(share, sizeof share, "%s", scratch_file(&scratch, "usr/share"));
    const char *const entries[] = {"reenact", "reenact-studio"};
    for (size_t i = 0; i < COUNT_OF(entries); i++) {
        snprintf(path, sizeof path, "%s/applications/%s.desktop", share, entries[i]);
        EXPECT_INT(access(path, R_OK), 0);
        if (access("/usr/bin/desktop-file-validate", X_OK))
            continue;
        const struct process_result said = PROCESS("/usr/bin/desktop-file-validate", path);
        if (said.exit_code || *said.out)
            print_error("%s\n", said.out);
        EXPECT_TRUE(!said.exit_code && !*said.out);
    }
    snprintf(path, sizeof path, "%s/metainfo/io.github.reenact.reenact.metainfo.xml", share);
    EXPECT_INT(access(path, R_OK), 0);
    if (!access("/usr/bin/appstreamcli", X_OK)) {
        const struct process_result said = PROCESS("/usr/bin/appstreamcli", "validate", "--no-net", path);
        print_message("%s", said.out);
        EXPECT_INT(said.exit_code, 0);
    }
    snprintf(path, sizeof path, "%s/icons/hicolor/scalable/apps/reenact.svg", share);
    EXPECT_INT(access(path, R_OK), 0);
    if (access("/usr/bin/update-mime-database", X_OK) || access("/usr/bin/gio", X_OK))
        skip_without("shared-mime-info and libglib2.0-bin");
    struct recording_writer *w;
    struct database *db;
    EXPECT_STATUS(recording_create(&w, scratch_file(&scratch, "named-otherwise")), OK);
    EXPECT_STATUS(recording_close(&w), OK);
    scratch_text(&scratch, "cut.reenact", "SQ");
    EXPECT_STATUS(database_open(&db, scratch_file(&scratch, "other"), DATABASE_CREATE), OK);
    EXPECT_STATUS(database_run(db, "CREATE TABLE t(id)"), OK);
    database_close(&db);
    snprintf(command, sizeof command,
             "update-mime-database %s/mime && cd %s && for file in named-otherwise cut.reenact other; do "
             "XDG_DATA_HOME=%s gio info -a standard::content-type $file | grep content-type; done",
             share, scratch.path, share);
    const struct process_result said = PROCESS("/usr/bin/bash", "-c", command);
    print_message("%s%s", said.out, said.err);
    const char *first = strstr(said.out, "application/x-reenact"),
               *second = first ? strstr(first + 1, "application/x-reenact") : NULL;
    EXPECT_TRUE(second && !strstr(second + 1, "application/x-reenact"));
    EXPECT_TRUE(second && strstr(second, "sqlite3"));
}

// The package of Debian's own tools: what it depends on is found by the libraries that the programs link.
static void test_package_can_be_unpacked_and_run(void **state)
{
    (void)state;
    char folder[300], path[1024];
    if (SANITIZED)
        return;
    if (access("/usr/bin/dpkg-shlibdeps", X_OK))
        skip_without("dpkg-dev");
    snprintf(folder, sizeof folder, "%s", scratch_file(&scratch, "package"));
    struct process_result said = PROCESS(CPACK, "--config", BUILD_DIR "/CPackConfig.cmake", "-G", "DEB", "-B", folder);
    if (said.exit_code)
        print_error("%s%s\n", said.out, said.err);
    EXPECT_INT(said.exit_code, 0);
    snprintf(path, sizeof path,
             "dpkg-deb -x %s/reenact_*.deb %s/root && dpkg-deb -f %s/reenact_*.deb Depends Maintainer", folder, folder,
             folder);
    said = PROCESS("/usr/bin/bash", "-c", path);
    EXPECT_INT(said.exit_code, 0);
    const char *maintainer = strstr(said.out, "Maintainer: ");
    print_message("%s\n", maintainer ? maintainer : "no maintainer");
    EXPECT_TRUE(maintainer && strchr(maintainer, '<') && strchr(maintainer, '@') && !strstr(maintainer, "README"));
    EXPECT_TRUE(strstr(said.out, "libsqlite3-0") && strstr(said.out, "libopenni2-0"));
    snprintf(path, sizeof path, "%s/root/usr/bin/reenact", folder);
    said = PROCESS(path, "--version");
    EXPECT_INT(said.exit_code, 0);
    snprintf(path, sizeof path, "%s/root/usr/lib/udev/rules.d/60-reenact-sensors.rules", folder);
    EXPECT_INT(access(path, R_OK), 0);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_help_and_version_are_alike),
#ifndef EMULATED
        cmocka_unit_test(test_what_is_installed),
        cmocka_unit_test(test_installed_texts_find_each_other),
        cmocka_unit_test(test_networks_are_fetched),
        cmocka_unit_test(test_a_desktop_knows_recordings),
        cmocka_unit_test(test_package_can_be_unpacked_and_run),
#endif
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
