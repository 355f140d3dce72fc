#include "platform/files/file_kind.h"

#include <ctype.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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
    MARK(0, "PK\x03\x04", "a zip archive: unpack it first"),
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
    return is_text(bytes, count) ? bytes[0] == '{' || bytes[0] == '[' ? "JSON text" : "a text file" : NULL;
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
