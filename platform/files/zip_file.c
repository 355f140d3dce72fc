#include "platform/files/zip_file.h"

#include "platform/files/compress.h"
#include "platform/files/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

// Records of the format: their marks, and their sizes without names and extra fields.
enum {
    END_BYTES = 22,
    END64_BYTES = 56,
    LOCATOR64_BYTES = 20,
    ENTRY_BYTES = 46,
    LOCAL_BYTES = 30,
    COMMENT_MAX = 65535
};
static const uint32_t end_mark = 0x06054b50, end64_mark = 0x06064b50, locator64_mark = 0x07064b50,
                      entry_mark = 0x02014b50, local_mark = 0x04034b50;
static const uint32_t IN_EXTRA = 0xffffffff; // a size or an offset of 32 bits that stands in the ZIP64 extra field
enum { ENCRYPTED = 1, STORED = 0, DEFLATED = 8, EXTRA_ZIP64 = 1 };

struct member {
    const char *name;
    uint64_t packed, plain, at; // bytes; `at`: of its local header
    uint32_t crc;
    uint16_t method;
};

struct zip_file {
    char *path;
    int file;
    uint64_t bytes; // of all
    char *names;
    struct member *members;
    int64_t count;
};

static uint16_t half_at(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }
static uint32_t word_at(const uint8_t *at) { return half_at(at) | (uint32_t)half_at(at + 2) << 16; }
static uint64_t long_at(const uint8_t *at) { return word_at(at) | (uint64_t)word_at(at + 4) << 32; }

// False: not all of it is there, or it cannot be read.
static bool read_at(const struct zip_file *zip, uint64_t at, void *to, size_t count)
{
    uint8_t *out = to;
    if (at > zip->bytes || count > zip->bytes - at)
        return false;
    while (count) {
        const ssize_t got = pread(zip->file, out, count, (off_t)at);
        if (got <= 0)
            return false;
        out += got;
        at += (uint64_t)got;
        count -= (size_t)got;
    }
    return true;
}

static enum status refuse(const struct zip_file *zip, const char *why)
{
    return fail(ERR_INPUT, "%s %s", zip->path, why);
}

static const char *const cut_short =
    "is cut short or damaged: the list of what is in it is missing, which stands at its end; copy it again";

// ---------------------------------------------------------------- the list

struct directory {
    uint64_t at, bytes, count;
};

static enum status read_end64(const struct zip_file *zip, uint64_t locator_at, struct directory *out)
{
    uint8_t locator[LOCATOR64_BYTES], end[END64_BYTES];
    if (!read_at(zip, locator_at, locator, sizeof locator) || word_at(locator) != locator64_mark ||
        !read_at(zip, long_at(locator + 8), end, sizeof end) || word_at(end) != end64_mark)
        return refuse(zip, cut_short);
    *out = (struct directory){long_at(end + 48), long_at(end + 40), long_at(end + 32)};
    return OK;
}

// The record `end`, which stands at `at`.
static enum status use_end(const struct zip_file *zip, const uint8_t *end, uint64_t at, struct directory *out)
{
    *out = (struct directory){word_at(end + 16), word_at(end + 12), half_at(end + 10)};
    const bool large = out->at == IN_EXTRA || out->bytes == IN_EXTRA || out->count == 0xffff;
    if (large && at >= LOCATOR64_BYTES)
        return read_end64(zip, at - LOCATOR64_BYTES, out);
    return half_at(end + 4) || half_at(end + 8) != half_at(end + 10)
               ? refuse(zip, "is one of several parts of an archive; join them first")
               : OK;
}

// The record at the archive's end, behind which only a comment may follow.
static enum status read_end(const struct zip_file *zip, struct directory *out)
{
    const size_t look = zip->bytes < END_BYTES + COMMENT_MAX ? (size_t)zip->bytes : END_BYTES + COMMENT_MAX;
    const uint64_t from = zip->bytes - look;
    uint8_t *tail = malloc(look + 1);
    if (!tail)
        return fail(ERR_MEMORY, "no memory to open %s", zip->path);
    size_t i = look >= END_BYTES && read_at(zip, from, tail, look) ? look - END_BYTES + 1 : 0;
    bool found = false;
    while (i && !found) {
        i--;
        found = word_at(tail + i) == end_mark && half_at(tail + i + 20) == look - i - END_BYTES;
    }
    const enum status status = found ? use_end(zip, tail + i, from + i, out) : refuse(zip, cut_short);
    free(tail);
    return status;
}

// What did not fit into 32 bits. False: it is not there.
static bool read_extra(const uint8_t *at, size_t left, struct member *member)
{
    uint64_t *const wide[] = {&member->plain, &member->packed, &member->at}; // in the order in which they stand there
    while (left >= 4) {
        const size_t size = half_at(at + 2);
        if (size > left - 4)
            return false;
        const uint8_t *value = at + 4, *const end = value + size;
        for (size_t i = 0; half_at(at) == EXTRA_ZIP64 && i < COUNT_OF(wide); i++)
            if (*wide[i] == IN_EXTRA) {
                if (end - value < 8)
                    return false;
                *wide[i] = long_at(value);
                value += 8;
            }
        at = end;
        left -= 4 + size;
    }
    return true;
}

// The entry at `at`, its name copied to *names; returns its size, 0: damaged.
static size_t read_entry(const uint8_t *at, size_t left, struct member *member, char **names)
{
    if (left < ENTRY_BYTES || word_at(at) != entry_mark)
        return 0;
    const size_t name = half_at(at + 28), extra = half_at(at + 30), comment = half_at(at + 32);
    const size_t size = ENTRY_BYTES + name + extra + comment;
    if (size > left || memchr(at + ENTRY_BYTES, 0, name))
        return 0;
    *member = (struct member){.name = *names,
                              .packed = word_at(at + 20),
                              .plain = word_at(at + 24),
                              .at = word_at(at + 42),
                              .crc = word_at(at + 16),
                              .method = half_at(at + 8) & ENCRYPTED ? UINT16_MAX : half_at(at + 10)};
    memcpy(*names, at + ENTRY_BYTES, name);
    (*names)[name] = 0;
    *names += name + 1;
    return read_extra(at + ENTRY_BYTES + name, extra, member) ? size : 0;
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(((const struct member *)a)->name, ((const struct member *)b)->name);
}

static enum status read_entries(struct zip_file *zip, const struct directory *directory, const uint8_t *list)
{
    size_t left = (size_t)directory->bytes;
    char *names = zip->names;
    for (; (uint64_t)zip->count < directory->count; zip->count++) {
        const size_t size = read_entry(list, left, &zip->members[zip->count], &names);
        if (!size)
            return refuse(zip, "is damaged: the list of what is in it cannot be read; copy it again");
        list += size;
        left -= size;
    }
    qsort(zip->members, (size_t)zip->count, sizeof *zip->members, compare_names);
    return OK;
}

static enum status read_directory(struct zip_file *zip)
{
    struct directory directory = {0};
    enum status status = read_end(zip, &directory);
    if (status != OK)
        return status;
    if (directory.at > zip->bytes || directory.bytes > zip->bytes - directory.at ||
        directory.count > directory.bytes / ENTRY_BYTES)
        return refuse(zip, cut_short);
    if (directory.bytes > ZIP_MEMBER_MAX)
        return refuse(zip, "lists more files than any archive that belongs here");
    uint8_t *list = malloc((size_t)directory.bytes + 1);
    zip->names = malloc((size_t)directory.bytes + 1); // each entry is longer than its name
    zip->members = calloc((size_t)directory.count + 1, sizeof *zip->members);
    if (!list || !zip->names || !zip->members)
        status = fail(ERR_MEMORY, "no memory for the list of %s", zip->path);
    else if (!read_at(zip, directory.at, list, (size_t)directory.bytes))
        status = fail(ERR_IO, "%s could not be read", zip->path);
    else
        status = read_entries(zip, &directory, list);
    free(list);
    return status;
}

// ---------------------------------------------------------------- opening

static enum status open_file(struct zip_file *zip)
{
    struct stat about;
    uint8_t first[4];
    if (stat(zip->path, &about)) // before it is opened: a pipe would be waited for
        return errno == ENOENT || errno == ENOTDIR ? fail(ERR_MISSING, "there is no file %s", zip->path)
                                                   : fail(ERR_IO, "%s: %s", zip->path, strerror(errno));
    if (!S_ISREG(about.st_mode))
        return fail(ERR_INPUT, "%s is not a file", zip->path);
    zip->file = open(zip->path, O_RDONLY | O_CLOEXEC);
    if (zip->file < 0)
        return fail(ERR_IO, "%s: %s", zip->path, strerror(errno));
    zip->bytes = (uint64_t)about.st_size;
    if (read_at(zip, 0, first, sizeof first) && (word_at(first) == local_mark || word_at(first) == end_mark))
        return OK;
    const char *kind = file_kind(zip->path);
    return fail(ERR_INPUT, "%s is no archive (ZIP)%s%s", zip->path, kind ? ": it is " : "", kind ? kind : "");
}

enum status zip_file_open(struct zip_file **out, const char *path)
{
    struct zip_file *zip = *out = calloc(1, sizeof *zip);
    if (!zip || !(zip->path = strdup(path))) {
        free(zip);
        *out = NULL;
        return fail(ERR_MEMORY, "no memory to open %s", path);
    }
    zip->file = -1;
    enum status status = open_file(zip);
    if (status == OK)
        status = read_directory(zip);
    if (status != OK)
        zip_file_close(out);
    return status;
}

void zip_file_close(struct zip_file **zip)
{
    if (!*zip)
        return;
    if ((*zip)->file >= 0)
        close((*zip)->file);
    free((*zip)->members);
    free((*zip)->names);
    free((*zip)->path);
    free(*zip);
    *zip = NULL;
}

int64_t zip_file_count(const struct zip_file *zip) { return zip->count; }

const char *zip_file_name(const struct zip_file *zip, int64_t member) { return zip->members[member].name; }

int64_t zip_file_find(const struct zip_file *zip, const char *name)
{
    const struct member wanted = {.name = name};
    const struct member *found =
        bsearch(&wanted, zip->members, (size_t)zip->count, sizeof *zip->members, compare_names);
    return found ? found - zip->members : -1;
}

// ---------------------------------------------------------------- a member

static enum status refuse_member(const struct zip_file *zip, const struct member *member, const char *why)
{
    return fail(ERR_INPUT, "%s in %s %s", member->name, zip->path, why);
}

// Where its packed bytes begin, behind a local header whose extra field may differ from the list's. 0: it has none.
static uint64_t data_of(const struct zip_file *zip, const struct member *member)
{
    uint8_t header[LOCAL_BYTES];
    if (!read_at(zip, member->at, header, sizeof header) || word_at(header) != local_mark)
        return 0;
    return member->at + LOCAL_BYTES + half_at(header + 26) + half_at(header + 28);
}

// Fills exactly out[plain]. False: damaged.
static bool inflate_bytes(const uint8_t *packed, size_t packed_count, uint8_t *out, size_t plain)
{
    z_stream stream = {.next_in = (Bytef *)(uintptr_t)packed, .avail_in = (uInt)packed_count};
    uint8_t spare; // deflated data of no bytes wants room all the same
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK)
        return false;
    stream.next_out = plain ? out : &spare;
    stream.avail_out = plain ? (uInt)plain : 1;
    const int ended = inflate(&stream, Z_FINISH);
    const bool whole = ended == Z_STREAM_END && stream.total_out == plain;
    inflateEnd(&stream);
    return whole;
}

static enum status unpack_member(const struct zip_file *zip, const struct member *member, const uint8_t *packed,
                                 uint8_t *out)
{
    bool sound = member->method == DEFLATED ? inflate_bytes(packed, (size_t)member->packed, out, (size_t)member->plain)
                                            : member->packed == member->plain;
    if (sound && member->method == STORED)
        memcpy(out, packed, (size_t)member->plain);
    sound = sound && crc32_of(0, out, (size_t)member->plain) == member->crc;
    return sound ? OK : refuse_member(zip, member, "is damaged");
}

enum status zip_file_read(struct zip_file *zip, int64_t member, uint8_t **bytes, size_t *count)
{
    const struct member *m = &zip->members[member];
    if (m->method == UINT16_MAX)
        return refuse_member(zip, m, "is encrypted; unpack the archive and pack it again without a password");
    if (m->method != STORED && m->method != DEFLATED)
        return refuse_member(zip, m, "is packed in a way that is not known; pack it again by Deflate");
    if (m->plain > ZIP_MEMBER_MAX || m->packed > ZIP_MEMBER_MAX)
        return refuse_member(zip, m, "is larger than anything that belongs there");
    const uint64_t at = data_of(zip, m);
    if (!at || at > zip->bytes || m->packed > zip->bytes - at)
        return refuse_member(zip, m, "is damaged or cut off");
    uint8_t *packed = malloc((size_t)m->packed + 1), *out = malloc((size_t)m->plain + 1);
    enum status status = OK;
    if (!packed || !out)
        status = fail(ERR_MEMORY, "no memory for %s in %s", m->name, zip->path);
    else if (!read_at(zip, at, packed, (size_t)m->packed))
        status = fail(ERR_IO, "%s could not be read", zip->path);
    else
        status = unpack_member(zip, m, packed, out);
    free(packed);
    if (status != OK) {
        free(out);
        return status;
    }
    out[m->plain] = 0;
    *bytes = out;
    *count = (size_t)m->plain;
    return OK;
}
