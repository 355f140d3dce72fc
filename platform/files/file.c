#include "platform/files/file.h"

#include "base/text.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <linux/magic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/vfs.h>
#include <unistd.h>

// ---------------------------------------------------------------- file kind

// Bytes at a place of the file and what they tell; the first line that fits counts. Chosen are the files that lie
// beside recordings, films and captures, and what downloads and e-mail make of them.
static const struct mark {
    size_t at;
    const char *bytes;
    size_t count;
    const char *kind;
} marks[] = {
#define MARK(at, bytes, kind)                                                                                          \
    {                                                                                                                  \
        at, bytes, sizeof(bytes) - 1, kind                                                                             \
    }
    MARK(0, "version https://git-lfs", "a pointer of Git LFS, not the file itself: run git lfs pull"),
    MARK(0, "SQLite format 3\0", "an SQLite file"),
    MARK(0, "NI10", "a recording of OpenNI2: give it as a sensor, oni:FILE"),
    MARK(0, "#ROSBAG", "a ROS bag"),
    MARK(0, "\x1a\x45\xdf\xa3", "a film (Matroska): give one of an Azure Kinect as a sensor, mkv:FILE"),
    MARK(4, "ftypheic", "a HEIC picture"),
    MARK(4, "ftyp", "a film (MP4 or alike)"),
    MARK(8, "AVI ", "a film (AVI)"),
    MARK(0, "\x89MCAP", "an MCAP file"),
    MARK(0, "PK\x03\x04", "a zip archive: unpack it first, or give one of Record3D as a sensor, r3d:FILE"),
    MARK(0, "PK\x05\x06", "a zip archive with nothing in it"),
    MARK(0, "\x1f\x8b", "packed (gzip): unpack it first"),
    MARK(0, "BZh", "packed (bzip2): unpack it first"),
    MARK(0,
         "\xfd"
         "7zXZ",
         "packed (xz): unpack it first"),
    MARK(0, "\x28\xb5\x2f\xfd", "packed (zstd): unpack it first"),
    MARK(0, "7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it first"),
    MARK(0, "Rar!", "a RAR archive: unpack it first"),
    MARK(257, "ustar", "a tar archive: unpack it first"),
    MARK(0, "\x89PNG", "a PNG picture"),
    MARK(0, "\xff\xd8\xff", "a JPEG picture"),
    MARK(0, "GIF8", "a GIF picture"),
    MARK(8, "WEBP", "a WebP picture"),
    MARK(0, "II*\0", "a TIFF picture"),
    MARK(0, "MM\0*", "a TIFF picture"),
    MARK(0, "BM", "a BMP picture"),
    MARK(0, "%PDF", "a PDF"),
    MARK(0, "glTF", "a glTF model"),
    MARK(0, "ply\n", "a PLY model"),
    MARK(0, "HIERARCHY", "motion in BVH"),
    MARK(0,
         "\x7f"
         "ELF",
         "a program"),
    MARK(0, "<!DOCTYPE", "a web page: was it fetched by a link to a page about the file?"),
    MARK(0, "<!doctype", "a web page: was it fetched by a link to a page about the file?"),
    MARK(0, "<html", "a web page: was it fetched by a link to a page about the file?"),
    MARK(0, "timestamp,joint,", "joints as CSV, which reenact compare reads"),
    MARK(0, "# axes:", "joints as CSV, which reenact compare reads"),
#undef MARK
};

static bool is_text(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (bytes[i] < 0x80 && !isprint(bytes[i]) && !isspace(bytes[i]))
            return false;
    return true;
}

static bool is_zero(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (bytes[i])
            return false;
    return true;
}

const char *file_kind_of(const uint8_t *bytes, size_t count, uint64_t total)
{
    if (!total)
        return "empty";
    for (size_t i = 0; i < COUNT_OF(marks); i++) {
        const struct mark *m = &marks[i];
        if (count >= m->at + m->count && !memcmp(bytes + m->at, m->bytes, m->count))
            return m->kind;
    }
    if (!count)
        return NULL;
    if (is_zero(bytes, count))
        return "nothing but zeros where it begins, as after a power cut or a copy that broke off";
    if (!is_text(bytes, count))
        return NULL;
    return bytes[0] == '{' || bytes[0] == '[' ? "JSON text" : "a text file";
}

const char *file_kind(const char *path)
{
    struct stat about;
    uint8_t bytes[FILE_KIND_BYTES];
    if (stat(path, &about) || !S_ISREG(about.st_mode)) // a pipe would be waited for
        return NULL;
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return NULL;
    const ssize_t count = read(file, bytes, sizeof bytes);
    close(file);
    return count < 0 ? NULL : file_kind_of(bytes, (size_t)count, (uint64_t)about.st_size);
}

enum status file_fail_not_recording(const char *path)
{
    const char *kind = file_kind(path);
    if (kind)
        return fail(ERR_FORMAT, "%s is not a recording: it is %s", path, kind);
    return fail(ERR_FORMAT, "%s is not a recording, or where it begins it is destroyed; try reenact-capture repair",
                path);
}

// ---------------------------------------------------------------- file

enum status file_read(const char *path, uint8_t **bytes, size_t *count)
{
    struct stat about;
    if (stat(path, &about))
        return fail(errno == ENOENT || errno == ENOTDIR ? ERR_MISSING : ERR_IO, "%s: %s", path, strerror(errno));
    if (!S_ISREG(about.st_mode))
        return fail(ERR_INPUT, "%s is not a file", path);
    FILE *file = fopen(path, "rb");
    if (!file)
        return fail(ERR_IO, "%s: %s", path, strerror(errno));
    size_t size = (size_t)about.st_size;
    uint8_t *buffer = malloc(size + 1);
    if (!buffer) {
        fclose(file);
        return fail(ERR_MEMORY, "no memory to read the %zu bytes of %s", size, path);
    }
    size_t got = fread(buffer, 1, size, file);
    bool failed = ferror(file);
    fclose(file);
    if (failed) {
        free(buffer);
        return fail(ERR_IO, "%s could not be read", path);
    }
    buffer[got] = 0;
    *bytes = buffer;
    *count = got;
    return OK;
}

// ------------------------------------------------------------- writing

static struct {
    bool (*is_protected)(const char *path);
    const char *what;
} protection;

void file_protect(bool (*is_protected)(const char *path), const char *what)
{
    protection.is_protected = is_protected;
    protection.what = what;
}

static bool is_protected(const char *path) { return protection.is_protected && protection.is_protected(path); }

// The folder that `path` lies in.
static enum status folder_of(const char *path, char folder[FILE_PATH_BYTES])
{
    if (snprintf(folder, FILE_PATH_BYTES, "%s", path) >= FILE_PATH_BYTES)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    char *slash = strrchr(folder, '/');
    if (slash)
        slash[slash == folder] = 0;
    else
        strcpy(folder, ".");
    return OK;
}

static enum status check_folder(const char *path, const char *folder)
{
    struct stat about;
    if (stat(folder, &about))
        return fail(errno == ENOENT || errno == ENOTDIR ? ERR_MISSING : ERR_IO, "%s cannot be made: the folder %s: %s",
                    path, folder, strerror(errno));
    if (!S_ISDIR(about.st_mode))
        return fail(ERR_IO, "%s cannot be made: %s is a file", path, folder);
    if (access(folder, W_OK | X_OK))
        return fail(ERR_IO, "%s cannot be made: no permission to write into the folder %s", path, folder);
    return OK;
}

enum status file_check_name(const char *path)
{
    size_t end = strlen(path);
    while (end && path[end - 1] == '/')
        end--;
    size_t begin = end;
    while (begin && path[begin - 1] != '/')
        begin--;
    if (!*path)
        return fail(ERR_INPUT, "the output has no name");
    if (path[begin] == '-')
        return fail(ERR_INPUT,
                    "'%s' looks like an option, not like the name of an output: give a name that does not begin with -",
                    path);
    return OK;
}

enum status file_check_output(const char *path, bool force)
{
    struct stat about;
    char folder[FILE_PATH_BYTES];
    if (file_check_name(path) != OK)
        return ERR_INPUT;
    if (!stat(path, &about)) {
        if (S_ISDIR(about.st_mode))
            return fail(ERR_INPUT, "%s is a folder; give the name of a file", path);
        if (!S_ISREG(about.st_mode))
            return access(path, W_OK) ? fail(ERR_IO, "%s cannot be written: %s", path, strerror(errno)) : OK;
        if (is_protected(path))
            return fail(ERR_EXISTS, "%s is %s, which no command overwrites; choose another name", path,
                        protection.what);
        if (!force)
            return fail(ERR_EXISTS, "%s exists already; choose another name, or write over it with --force", path);
    }
    enum status status = folder_of(path, folder);
    return status == OK ? check_folder(path, folder) : status;
}

enum status folder_check_output(const char *path, bool force)
{
    struct stat about;
    char above[FILE_PATH_BYTES];
    if (file_check_name(path) != OK)
        return ERR_INPUT;
    if (!stat(path, &about)) {
        if (!S_ISDIR(about.st_mode))
            return fail(ERR_EXISTS, "%s is a file where a folder was wanted", path);
        DIR *folder = opendir(path);
        int entries = 0;
        for (struct dirent *entry; folder && entries < 3 && (entry = readdir(folder));)
            entries++; // its own and its parent's are two
        if (folder)
            closedir(folder);
        if (entries > 2 && !force)
            return fail(ERR_EXISTS, "the folder %s is not empty; choose another, or write over its files with --force",
                        path);
        return check_folder(path, path);
    }
    if (snprintf(above, sizeof above, "%s", path) >= (int)sizeof above)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    while (stat(above, &about)) { // the nearest folder that exists
        char *slash = strrchr(above, '/');
        if (!slash || slash == above) {
            strcpy(above, slash ? "/" : ".");
            break;
        }
        *slash = 0;
    }
    return check_folder(path, above);
}

bool file_is_same(const char *a, const char *b)
{
    struct stat one, other;
    return !stat(a, &one) && !stat(b, &other) && one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

enum status file_begin(const char *path, char part[FILE_PATH_BYTES])
{
    if (file_check_name(path) != OK)
        return ERR_INPUT;
    // Exclusive, under a name that cannot be foreseen: a link laid there beforehand would be written through.
    for (int tries = 0; tries < 100; tries++) {
        uint64_t number = 0;
        if (getrandom(&number, sizeof number, 0) != (ssize_t)sizeof number)
            return fail(ERR_IO, "%s: no random name: %s", path, strerror(errno));
        if (snprintf(part, FILE_PATH_BYTES, "%s.%08llx.part", path, (unsigned long long)(number & 0xffffffff)) >=
            FILE_PATH_BYTES)
            return fail(ERR_INPUT, "the path %.60s… is too long", path);
        int file = open(part, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (file >= 0) {
            close(file);
            return OK;
        }
        if (errno != EEXIST)
            return fail(ERR_IO, "%s cannot be written: %s", path, strerror(errno));
    }
    return fail(ERR_EXISTS, "%s cannot be written: every name beside it is taken", path);
}

// Syncs the folder, so that the new name outlives a power cut. File systems that cannot are let be.
static void sync_folder(const char *path)
{
    char folder[FILE_PATH_BYTES];
    if (folder_of(path, folder) != OK)
        return;
    int file = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file >= 0) {
        fsync(file);
        close(file);
    }
}

static enum status end_file(const char *path, const char *part, enum status status, bool synced)
{
    if (status == OK && is_protected(path))
        status = fail(ERR_EXISTS, "%s is %s, which nothing overwrites; choose another name", path, protection.what);
    if (status == OK && synced) {
        int file = open(part, O_RDONLY | O_CLOEXEC);
        if (file < 0 || fsync(file))
            status = fail(ERR_IO, "%s could not be written: %s", path, strerror(errno));
        if (file >= 0)
            close(file);
    }
    if (status == OK && rename(part, path))
        status = fail(ERR_IO, "%s could not be written: %s", path, strerror(errno));
    if (status != OK)
        unlink(part);
    else if (synced)
        sync_folder(path);
    return status;
}

enum status file_end(const char *path, const char *part, enum status status)
{
    return end_file(path, part, status, true);
}

enum status file_name_new(const char *from, const char *to)
{
    struct stat about;
    if (file_check_name(to) != OK)
        return ERR_INPUT;
    if (link(from, to) == 0)
        unlink(from); // link() fails where the name is taken, rename() does not
    else if (errno == EEXIST || !lstat(to, &about))
        return fail(ERR_EXISTS, "%s is there already; choose another name or remove it first", to);
    else if (rename(from, to))
        return fail(ERR_IO, "%s cannot be made: %s", to, strerror(errno));
    sync_folder(to);
    return OK;
}

static enum status write_bytes(const char *to, const char *path, const void *bytes, size_t count)
{
    FILE *file = fopen(to, "wb");
    if (!file)
        return fail(ERR_IO, "%s could not be written: %s", path, strerror(errno));
    bool written = fwrite(bytes, 1, count, file) == count;
    const int error = errno;
    written = fclose(file) == 0 && written;
    return written ? OK : fail(ERR_IO, "%s could not be written: %s", path, strerror(errno ? errno : error));
}

static enum status write_file(const char *path, const void *bytes, size_t count, bool synced)
{
    struct stat about;
    char part[FILE_PATH_BYTES];
    if (!stat(path, &about) && !S_ISREG(about.st_mode) && !S_ISDIR(about.st_mode))
        return write_bytes(path, path, bytes, count); // a device or a pipe
    enum status status = file_begin(path, part);
    return status == OK ? end_file(path, part, write_bytes(part, path, bytes, count), synced) : status;
}

enum status file_write(const char *path, const void *bytes, size_t count)
{
    return write_file(path, bytes, count, true);
}

enum status file_write_unsynced(const char *path, const void *bytes, size_t count)
{
    return write_file(path, bytes, count, false);
}

bool file_exists(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0;
}

// Whether a path below a folder stays there: no ".." of it leads out.
static bool stays_below(const char *path)
{
    int depth = 0;
    for (const char *at = path; *at;) {
        const size_t length = strcspn(at, "/");
        if (length == 2 && !strncmp(at, "..", 2))
            depth--;
        else if (length && !(length == 1 && *at == '.'))
            depth++;
        if (depth < 0)
            return false;
        at += length + (at[length] == '/');
    }
    return true;
}

enum status file_check_listed(const char *folder, const char *list, int line, const char *name)
{
    if (!text_is_printable(name))
        return fail(ERR_INPUT, "%s/%s, line %d: the file's name is not UTF-8 or holds control characters", folder, list,
                    line);
    if (!stays_below(name))
        return fail(ERR_INPUT, "%s/%s, line %d: '%.100s' lies outside of the folder", folder, list, line, name);
    return OK;
}

// -1: not known.
static int64_t free_bytes(const char *path)
{
    struct statvfs about;
    if (statvfs(path, &about) || about.f_bavail > INT64_MAX / (about.f_frsize ? about.f_frsize : 1))
        return -1;
    return (int64_t)(about.f_bavail * about.f_frsize);
}

// By how many bytes the limits of one file's size let it grow. INT64_MAX: by any number.
static int64_t bytes_to_largest(const char *path)
{
    static const int64_t FAT_LARGEST = UINT32_MAX;
    struct stat about;
    struct statfs system;
    struct rlimit limit;
    int64_t largest = INT64_MAX;
    if (stat(path, &about))
        return INT64_MAX;
    if (!statfs(path, &system) && system.f_type == MSDOS_SUPER_MAGIC)
        largest = FAT_LARGEST;
    if (!getrlimit(RLIMIT_FSIZE, &limit) && limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < (uint64_t)largest)
        largest = (int64_t)limit.rlim_cur;
    if (largest == INT64_MAX)
        return INT64_MAX;
    return about.st_size < largest ? largest - about.st_size : 0;
}

int64_t file_room_bytes(const char *path)
{
    const int64_t free = free_bytes(path), more = bytes_to_largest(path);
    return more < free || (free < 0 && more < INT64_MAX) ? more : free;
}

bool file_is_at_largest(const char *path)
{
    enum { NEARLY = 64 << 20 }; // what was to be written next may be as large
    const int64_t free = free_bytes(path), more = bytes_to_largest(path);
    return more <= NEARLY && (free < 0 || free > more);
}

enum status folder_make(const char *path)
{
    char partial[4096];
    if (!file_exists(path) && file_check_name(path) != OK)
        return ERR_INPUT;
    if (snprintf(partial, sizeof partial, "%s", path) >= (int)sizeof partial)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    for (char *at = partial + 1;; at++) {
        if (*at && *at != '/')
            continue;
        char held = *at;
        *at = 0;
        struct stat about;
        if (mkdir(partial, 0777) && errno != EEXIST)
            return fail(ERR_IO, "the folder %s cannot be made: %s", partial, strerror(errno));
        if (stat(partial, &about) == 0 && !S_ISDIR(about.st_mode))
            return fail(ERR_IO, "%s is a file where a folder was wanted", partial);
        *at = held;
        if (!held)
            return OK;
    }
}

enum status folder_rename(const char *from, const char *to)
{
    return rename(from, to) ? fail(ERR_IO, "%s could not be written: %s", to, strerror(errno)) : OK;
}

static int remove_entry(const char *path, const struct stat *about, int kind, struct FTW *where)
{
    (void)about;
    (void)kind;
    (void)where;
    return remove(path);
}

void folder_remove(const char *path)
{
    enum { OPEN_FOLDERS = 8 };
    (void)nftw(path, remove_entry, OPEN_FOLDERS, FTW_DEPTH | FTW_PHYS);
}
