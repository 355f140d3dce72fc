// The house rules that no compiler holds: who may include whom, that a foreign
// header is named by its wrapper alone, that C++ lives only in wrappers, and that
// files are made and changed in one place, which spares recordings.
#include "tests/support/test.h"

#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <string.h>

enum { MOST_USED = 40 };

struct rule {
    const char *room;               // a file belongs to the longest room that its path begins with
    const char *may_use[MOST_USED]; // rooms beside its own, each further up in this table
};

static const struct rule rules[] = {
    {"base/", {0}},
    {"platform/files/", {"base/"}},
    {"platform/sensors/", {"platform/files/", "base/"}},
    {"platform/screen/", {"platform/files/", "base/"}},
    {"platform/vision/", {"base/"}},
    {"platform/network/", {"platform/files/", "base/"}},
    {"recording/", {"platform/network/", "platform/files/", "base/"}},
    {"neural/", {"platform/files/", "base/"}},
    {"formats/", {"recording/", "platform/files/", "base/"}},
    {"locate/", {"recording/", "platform/vision/", "base/"}},
    {"objects/",
     {"recording/", "platform/network/", "platform/vision/", "platform/sensors/", "platform/files/", "base/"}},
    {"capture/segmentation/", {"recording/", "base/"}},
    {"capture/body/", {"capture/segmentation/", "neural/", "recording/", "base/"}},
    {"capture/tracking/", {"capture/body/", "capture/segmentation/", "base/"}},
    {"capture/mapping/",
     {"locate/", "recording/", "platform/vision/", "platform/sensors/", "platform/files/", "base/"}},
    {"capture/calibration/", {"platform/vision/", "platform/files/", "base/"}},
    {"capture/coaching/", {"recording/", "base/"}},
    {"capture/",
     {"capture/coaching/", "capture/tracking/", "capture/body/", "capture/segmentation/", "locate/", "formats/",
      "neural/", "recording/", "platform/sensors/", "platform/files/", "base/"}},
    {"compare/", {"formats/", "recording/", "platform/files/", "base/"}},
    {"reenact/skeleton/", {"recording/", "base/"}},
    {"reenact/observation/", {"reenact/skeleton/", "recording/", "base/"}},
    {"reenact/retrieval/", {"reenact/skeleton/", "base/"}},
    {"reenact/avatar/", {"reenact/observation/", "reenact/skeleton/", "recording/", "platform/vision/", "base/"}},
    {"reenact/export/", {"reenact/avatar/", "reenact/skeleton/", "formats/", "platform/files/", "base/"}},
    {"reenact/frame/", {"reenact/avatar/", "reenact/observation/", "base/"}},
    {"reenact/scene/", {"reenact/skeleton/", "recording/", "platform/files/", "base/"}},
    {"reenact/render/",
     {"reenact/scene/", "reenact/frame/", "reenact/avatar/", "reenact/retrieval/", "reenact/observation/",
      "reenact/skeleton/", "recording/", "platform/screen/", "platform/sensors/", "base/"}},
    {"surround/picture/", {"base/"}},
    {"surround/reading/", {"surround/picture/", "formats/", "platform/files/", "base/"}},
    {"surround/alignment/", {"base/"}},
    {"surround/depth/", {"surround/picture/", "base/"}},
    {"surround/view/", {"surround/picture/", "base/"}},
    {"surround/",
     {"surround/view/", "surround/depth/", "surround/alignment/", "surround/reading/", "surround/picture/",
      "platform/files/", "base/"}},
    {"surround/drive/", {"surround/", "surround/view/", "platform/network/", "base/"}},
    {"surround/gpu/",
     {"surround/drive/", "surround/view/", "surround/picture/", "reenact/render/", "platform/screen/", "base/"}},
    {"surround/filmed/", {"surround/", "surround/picture/", "recording/", "platform/files/", "base/"}},
    {"app/state/", {"base/"}},
    {"app/camera/",
     {"app/state/", "reenact/render/", "locate/", "recording/", "platform/screen/", "platform/sensors/", "base/"}},
    {"app/view/",
     {"app/state/", "reenact/render/", "reenact/scene/", "reenact/frame/", "reenact/avatar/", "reenact/skeleton/",
      "recording/", "platform/screen/", "base/"}},
    {"app/place/",
     {"surround/filmed/", "surround/gpu/", "surround/", "surround/picture/", "reenact/render/", "reenact/scene/",
      "objects/", "locate/", "formats/", "recording/", "platform/screen/", "base/"}},
    {"app/live/",
     {"app/camera/", "compare/", "capture/", "recording/", "platform/sensors/", "platform/files/", "base/"}},
    {"app/ui/", {"app/view/", "app/state/", "compare/", "recording/", "platform/screen/", "platform/files/", "base/"}},
    {"app/viewer/",
     {"app/ui/", "app/live/", "app/place/", "app/view/", "app/camera/", "app/state/", "reenact/render/", "compare/",
      "capture/", "recording/", "platform/files/", "base/"}},
    {"app/drive/",
     {"app/viewer/", "app/ui/", "app/place/", "surround/gpu/", "surround/drive/", "surround/", "reenact/render/",
      "platform/screen/", "base/"}},
    {"app/studio/",
     {"app/viewer/", "app/ui/", "reenact/render/", "capture/", "capture/coaching/", "capture/mapping/", "recording/",
      "platform/screen/", "platform/sensors/", "platform/files/", "base/"}},
    {"app/start/",
     {"app/viewer/", "app/ui/", "app/state/", "reenact/render/", "recording/", "platform/screen/", "platform/files/",
      "base/"}},
    {"app/commands/",
     {"app/start/",           "app/studio/",      "app/drive/",        "app/viewer/",     "app/place/",
      "app/camera/",          "surround/filmed/", "surround/drive/",   "surround/",       "reenact/render/",
      "reenact/export/",      "reenact/avatar/",  "compare/",          "capture/",        "capture/coaching/",
      "capture/calibration/", "capture/mapping/", "objects/",          "locate/",         "recording/",
      "platform/vision/",     "platform/screen/", "platform/sensors/", "platform/files/", "base/"}},
    {"tests/", {0}}, // all of them
};

// A room's insides: headers that only files whose paths begin so may include. All others use the room's public ones.
static const struct {
    const char *header, *users[2];
} insides[] = {
    {"app/viewer/viewer_parts.h", {"app/viewer/"}},
    {"app/viewer/viewer_inside.h", {"app/viewer/", "tests/"}},
};

// Headers that are the language's or the system's own.
static const char *const own_headers[] = {
    "argp.h",    "assert.h", "complex.h", "ctype.h",    "dirent.h",    "errno.h",    "fcntl.h",   "fenv.h",
    "float.h",   "ftw.h",    "glob.h",    "inttypes.h", "limits.h",    "locale.h",   "math.h",    "poll.h",
    "pthread.h", "sched.h",  "setjmp.h",  "signal.h",   "spawn.h",     "stdalign.h", "stdarg.h",  "stdatomic.h",
    "stdbool.h", "stddef.h", "stdint.h",  "stdio.h",    "stdlib.h",    "string.h",   "strings.h", "time.h",
    "unistd.h",  "wchar.h",  "dlfcn.h",   "endian.h",   "semaphore.h",
};

enum { MOST_FILES = 2000, MOST_FOREIGN = 100 };

struct file {
    char path[256];
};

struct foreign {
    char header[512];
    char users[4][256];
    int user_count;
};

static struct file files[MOST_FILES];
static int file_count;
static struct foreign foreign[MOST_FOREIGN];
static int foreign_count;

static bool ends_with(const char *text, const char *end)
{
    size_t n = strlen(text), m = strlen(end);
    return n >= m && !strcmp(text + n - m, end);
}

static void list(const char *folder)
{
    char full[1024];
    snprintf(full, sizeof full, "%s/%s", SOURCE_DIR, folder);
    DIR *dir = opendir(full);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir));) {
        char path[256];
        if (entry->d_name[0] == '.')
            continue;
        assert_true(snprintf(path, sizeof path, "%s%s", folder, entry->d_name) < (int)sizeof path - 1);
        if (entry->d_type == DT_DIR) {
            strcat(path, "/");
            list(path);
        } else if (ends_with(path, ".c") || ends_with(path, ".h") || ends_with(path, ".cpp")) {
            assert_true(file_count < MOST_FILES);
            strcpy(files[file_count++].path, path);
        }
    }
    closedir(dir);
}

static const struct rule *rule_of(const char *path)
{
    const struct rule *best = NULL;
    for (size_t i = 0; i < COUNT_OF(rules); i++)
        if (!strncmp(path, rules[i].room, strlen(rules[i].room)) &&
            (!best || strlen(rules[i].room) > strlen(best->room)))
            best = &rules[i];
    return best;
}

static bool may_see(const char *user, const char *used)
{
    for (size_t i = 0; i < COUNT_OF(insides); i++) {
        if (strcmp(insides[i].header, used))
            continue;
        for (size_t k = 0; k < COUNT_OF(insides[i].users) && insides[i].users[k]; k++)
            if (!strncmp(insides[i].users[k], user, strlen(insides[i].users[k])))
                return true;
        return false;
    }
    return true;
}

static bool allowed(const char *user, const char *used)
{
    const struct rule *from = rule_of(user), *to = rule_of(used);
    if (!from || !to || !may_see(user, used))
        return false;
    if (from == to || !strcmp(from->room, "tests/"))
        return true;
    for (size_t i = 0; i < COUNT_OF(from->may_use) && from->may_use[i]; i++)
        if (!strcmp(from->may_use[i], to->room))
            return true;
    return false;
}

static bool is_own_header(const char *header)
{
    for (size_t i = 0; i < COUNT_OF(own_headers); i++)
        if (!strcmp(header, own_headers[i]))
            return true;
    // sys/ is the system's; without an ending it is the C++ library's
    return !strncmp(header, "sys/", 4) || !strncmp(header, "linux/", 6) || !strchr(header, '.');
}

static void note_foreign(const char *user, const char *header)
{
    if (is_own_header(header))
        return;
    int i = 0;
    while (i < foreign_count && strcmp(foreign[i].header, header))
        i++;
    assert_true(i < MOST_FOREIGN);
    if (i == foreign_count)
        strcpy(foreign[foreign_count++].header, header);
    if (foreign[i].user_count < 4)
        snprintf(foreign[i].users[foreign[i].user_count++], 256, "%s", user);
}

static int read_includes(const char *path)
{
    char full[1024], line[1024], name[512];
    int broken = 0;
    snprintf(full, sizeof full, "%s/%s", SOURCE_DIR, path);
    FILE *file = fopen(full, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, " # include \"%511[^\"]\"", name) == 1) {
            if (!allowed(path, name)) {
                print_error("%s may not include \"%s\"\n", path, name);
                broken++;
            }
        } else if (sscanf(line, " # include <%511[^>]>", name) == 1 && strncmp(path, "tests/", 6)) {
            note_foreign(path, name);
        }
    }
    fclose(file);
    return broken;
}

static void test_modules_include_only_allowed_modules(void **state)
{
    (void)state;
    int broken = 0;
    for (int i = 0; i < file_count; i++)
        broken += read_includes(files[i].path);
    EXPECT_AT_LEAST(file_count, 30); // the list itself is not empty
    EXPECT_INT(broken, 0);
}

static void test_foreign_headers_only_in_wrappers(void **state)
{
    (void)state;
    int broken = 0;
    for (int i = 0; i < foreign_count; i++)
        if (foreign[i].user_count > 2) {
            print_error("<%s> is named in %s, %s, %s: one wrapper is enough\n", foreign[i].header, foreign[i].users[0],
                        foreign[i].users[1], foreign[i].users[2]);
            broken++;
        }
    EXPECT_AT_LEAST(foreign_count, 5);
    EXPECT_INT(broken, 0);
}

static void test_cpp_lives_in_platform_and_tests_only(void **state)
{
    (void)state;
    int broken = 0;
    for (int i = 0; i < file_count; i++)
        if (ends_with(files[i].path, ".cpp") && strncmp(files[i].path, "platform/", 9) &&
            strncmp(files[i].path, "tests/", 6)) {
            print_error("%s is C++ outside a wrapper\n", files[i].path);
            broken++;
        }
    EXPECT_INT(broken, 0);
}

// ---------------------------------------------------------------- who writes files

// What makes or changes a file. platform/files/file.h and output.h write over no recording; all else goes through them.
static const char *const writing[] = {
    "O_CREAT",  "O_WRONLY", "O_RDWR",  "creat(",  "freopen(",  "ofstream", "rename(",      "renameat",
    "truncate", "link(",    "mkstemp", "tmpfile", "avio_open", "imwrite",  "write_to_png", "cairo_pdf_surface_create("};
static const char *const writers[] = {"platform/files/file.c", "platform/files/output.c", "platform/files/database.c"};

// The word stands in the line by itself, not at the end of another.
static bool has_word(const char *line, const char *word)
{
    for (const char *at = line; (at = strstr(at, word)); at++)
        if (at == line || !(isalnum((unsigned char)at[-1]) || at[-1] == '_'))
            return true;
    return false;
}

// "w", "a" or "r+" anywhere in it.
static bool opens_for_writing(const char *line)
{
    const char *open = strstr(line, "fopen("), *mode = open ? strrchr(open, '"') : NULL;
    while (mode && mode > open && mode[-1] != '"')
        if (strchr("wa+", *--mode))
            return true;
    return false;
}

static bool makes_files(const char *line)
{
    bool makes = opens_for_writing(line);
    for (size_t i = 0; i < COUNT_OF(writing); i++)
        makes |= has_word(line, writing[i]);
    return makes;
}

static int count_writing(const char *path, bool print)
{
    char full[1024], line[1024];
    int count = 0;
    snprintf(full, sizeof full, "%s/%s", SOURCE_DIR, path);
    FILE *file = fopen(full, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file)) {
        char *comment = strstr(line, "//");
        if (comment)
            *comment = 0;
        if (makes_files(line)) {
            count++;
            if (print)
                print_error("%s makes or changes a file by itself: %s\n", path, line);
        }
    }
    fclose(file);
    return count;
}

static void test_files_are_written_in_one_place(void **state)
{
    (void)state;
    int broken = 0;
    for (int i = 0; i < file_count; i++) {
        bool may = !strncmp(files[i].path, "tests/", 6);
        for (size_t k = 0; k < COUNT_OF(writers); k++)
            may |= !strcmp(files[i].path, writers[k]);
        broken += may ? 0 : count_writing(files[i].path, true);
    }
    EXPECT_INT(broken, 0);
    for (size_t k = 0; k < COUNT_OF(writers); k++)
        EXPECT_AT_LEAST(count_writing(writers[k], false), 1);
    EXPECT_TRUE(makes_files("FILE *to = fopen(path, \"w\");") && makes_files("fopen(name(\"x\"), \"r+b\")"));
    EXPECT_TRUE(makes_files("if (rename(a, b))") && makes_files("std::ofstream to;"));
    EXPECT_TRUE(!makes_files("fopen(path, \"rb\")") && !makes_files("database_rename(&db, to)"));
    EXPECT_TRUE(!makes_files("unlink(path)"));
}

// No arrow goes up: what a room may use stands before it in the table.
static void test_the_table_has_floors(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT_OF(rules); i++)
        for (size_t k = 0; k < MOST_USED && rules[i].may_use[k]; k++) {
            const struct rule *used = rule_of(rules[i].may_use[k]);
            if (!used || used >= &rules[i])
                print_error("%s may not use %s, which stands below it\n", rules[i].room, rules[i].may_use[k]);
            EXPECT_TRUE(used && used < &rules[i]);
        }
}

// The check itself, on cases that it must refuse.
static void test_the_rule_can_fail(void **state)
{
    (void)state;
    EXPECT_TRUE(!allowed("base/lens.c", "platform/files/png.h"));
    EXPECT_TRUE(!allowed("platform/files/png.c", "recording/place.h"));
    EXPECT_TRUE(!allowed("reenact/retrieval/frame_selection.c", "capture/tracking/tracker.h"));
    EXPECT_TRUE(!allowed("recording/place.c", "capture/tracking/tracker.h"));
    EXPECT_TRUE(!allowed("capture/tracking/tracker.c", "reenact/retrieval/frame_selection.h"));
    EXPECT_TRUE(!allowed("reenact/retrieval/frame_selection.c", "app/commands/command.h"));
    EXPECT_TRUE(!allowed("reenact/retrieval/frame_selection.c", "locate/locator.h"));
    EXPECT_TRUE(!allowed("reenact/skeleton/bind_pose.c", "reenact/avatar/avatar.h"));
    EXPECT_TRUE(allowed("reenact/skeleton/bind_pose.c", "recording/skeleton.h"));
    EXPECT_TRUE(!allowed("app/studio/studio.c", "app/viewer/viewer_inside.h"));
    EXPECT_TRUE(!allowed("tests/app/test_screens.c", "app/viewer/viewer_parts.h"));
    EXPECT_TRUE(allowed("app/viewer/viewer_live.c", "app/viewer/viewer_parts.h"));
}

int main(void)
{
    const char *const rooms[] = {"base/",    "platform/", "recording/", "neural/",   "formats/", "locate/", "objects/",
                                 "capture/", "compare/",  "reenact/",   "surround/", "app/",     "tests/"};
    for (size_t i = 0; i < COUNT_OF(rooms); i++)
        list(rooms[i]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_modules_include_only_allowed_modules),
        cmocka_unit_test(test_foreign_headers_only_in_wrappers),
        cmocka_unit_test(test_cpp_lives_in_platform_and_tests_only),
        cmocka_unit_test(test_files_are_written_in_one_place),
        cmocka_unit_test(test_the_table_has_floors),
        cmocka_unit_test(test_the_rule_can_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
