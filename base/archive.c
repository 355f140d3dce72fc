#include "base/archive.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "archives are little-endian");

struct archive archive_reader(const void *bytes, size_t count)
{
    return (struct archive){.reading = true, .bytes = (uint8_t *)(uintptr_t)bytes, .count = count};
}

struct archive archive_writer(void) { return (struct archive){0}; }

static bool make_room(struct archive *archive, size_t wanted)
{
    if (archive->failed || wanted <= archive->capacity)
        return !archive->failed;
    const size_t capacity = 2 * wanted;
    uint8_t *grown = realloc(archive->bytes, capacity);
    if (!grown) {
        archive->failed = archive->out_of_memory = true;
        return false;
    }
    archive->bytes = grown;
    archive->capacity = capacity;
    return true;
}

void archive_bytes(struct archive *archive, void *value, size_t count)
{
    if (!archive->reading && make_room(archive, archive->count + count)) {
        if (count)
            memcpy(archive->bytes + archive->count, value, count);
        archive->count += count;
    }
    if (!archive->reading)
        return;
    archive->failed |= count > archive->count - archive->at;
    if (archive->failed) {
        memset(value, 0, count);
        return;
    }
    memcpy(value, archive->bytes + archive->at, count);
    archive->at += count;
}

void archive_array(struct archive *archive, void **array, int *count, size_t each)
{
    int32_t number = *count;
    ARCHIVE(archive, number);
    if (!archive->reading) {
        archive_bytes(archive, *array, (size_t)number * each);
        return;
    }
    *array = NULL;
    *count = 0;
    archive->failed |= number < 0 || (size_t)number > (archive->count - archive->at) / each;
    if (archive->failed)
        return;
    *array = malloc((size_t)number * each + 1);
    if (!*array) {
        archive->failed = archive->out_of_memory = true;
        return;
    }
    archive_bytes(archive, *array, (size_t)number * each);
    *count = number;
}

bool archive_is_whole(const struct archive *archive)
{
    return !archive->failed && (!archive->reading || archive->at == archive->count);
}
