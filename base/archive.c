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

static bool make_room(struct archive *a, size_t wanted)
{
    if (a->failed || wanted <= a->capacity)
        return !a->failed;
    const size_t capacity = 2 * wanted;
    uint8_t *grown = realloc(a->bytes, capacity);
    if (!grown) {
        a->failed = a->out_of_memory = true;
        return false;
    }
    a->bytes = grown;
    a->capacity = capacity;
    return true;
}

void archive_bytes(struct archive *a, void *value, size_t count)
{
    if (!a->reading && make_room(a, a->count + count)) {
        if (count)
            memcpy(a->bytes + a->count, value, count);
        a->count += count;
    }
    if (!a->reading)
        return;
    a->failed |= count > a->count - a->at;
    if (a->failed) {
        memset(value, 0, count);
        return;
    }
    memcpy(value, a->bytes + a->at, count);
    a->at += count;
}

void archive_array(struct archive *a, void **array, int *count, size_t each)
{
    int32_t number = *count;
    ARCHIVE(a, number);
    if (!a->reading) {
        archive_bytes(a, *array, (size_t)number * each);
        return;
    }
    *array = NULL;
    *count = 0;
    a->failed |= number < 0 || (size_t)number > (a->count - a->at) / each;
    if (a->failed)
        return;
    *array = malloc((size_t)number * each + 1);
    if (!*array) {
        a->failed = a->out_of_memory = true;
        return;
    }
    archive_bytes(a, *array, (size_t)number * each);
    *count = number;
}

bool archive_is_whole(const struct archive *a) { return !a->failed && (!a->reading || a->at == a->count); }
