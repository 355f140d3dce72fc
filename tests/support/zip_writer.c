#include "tests/support/zip_writer.h"

#include "platform/files/compress.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

static void append(uint8_t **to, size_t *count, size_t *capacity, const void *bytes, size_t more)
{
    if (*count + more > *capacity) {
        *capacity = 2 * (*count + more);
        *to = realloc(*to, *capacity);
        if (!*to)
            abort();
    }
    if (more)
        memcpy(*to + *count, bytes, more);
    *count += more;
}

static void put(struct zip_writer *zip, bool list, uint64_t value, int bytes)
{
    uint8_t out[8];
    for (int i = 0; i < bytes; i++)
        out[i] = (uint8_t)(value >> 8 * i);
    if (list)
        append(&zip->list, &zip->list_count, &zip->list_capacity, out, (size_t)bytes);
    else
        append(&zip->bytes, &zip->count, &zip->capacity, out, (size_t)bytes);
}

static uint8_t *deflate_bytes(const void *bytes, size_t count, size_t *packed)
{
    z_stream stream = {.next_in = (Bytef *)(uintptr_t)bytes, .avail_in = (uInt)count};
    if (deflateInit2(&stream, 6, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        abort();
    const size_t bound = deflateBound(&stream, (uLong)count);
    uint8_t *out = malloc(bound);
    stream.next_out = out;
    stream.avail_out = (uInt)bound;
    if (!out || deflate(&stream, Z_FINISH) != Z_STREAM_END)
        abort();
    *packed = stream.total_out;
    deflateEnd(&stream);
    return out;
}

// What the local header and the list have alike, from the method on.
static void put_sizes(struct zip_writer *zip, bool list, bool deflated, uint32_t crc, const uint64_t size[2])
{
    put(zip, list, deflated ? 8 : 0, 2);
    put(zip, list, 0, 4); // no time
    put(zip, list, crc, 4);
    put(zip, list, size[0], 4);
    put(zip, list, size[1], 4);
}

void zip_writer_add(struct zip_writer *zip, const char *name, const void *bytes, size_t count, bool deflated)
{
    size_t packed = count;
    uint8_t *own = deflated ? deflate_bytes(bytes, count, &packed) : NULL;
    const size_t at = zip->count;
    const uint32_t crc = crc32_of(0, bytes, count);
    const uint64_t size[2] = {packed, count};
    put(zip, false, 0x04034b50, 4);
    put(zip, false, 20, 2);
    put(zip, false, 0, 2);
    put_sizes(zip, false, deflated, crc, size);
    put(zip, false, strlen(name), 2);
    put(zip, false, 0, 2);
    append(&zip->bytes, &zip->count, &zip->capacity, name, strlen(name));
    append(&zip->bytes, &zip->count, &zip->capacity, own ? own : bytes, packed);
    free(own);
    put(zip, true, 0x02014b50, 4);
    put(zip, true, 20, 2);
    put(zip, true, 20, 2);
    put(zip, true, 0, 2);
    put_sizes(zip, true, deflated, crc, size);
    put(zip, true, strlen(name), 2);
    put(zip, true, 0, 2); // no extra field, no comment, disk 0, attributes
    put(zip, true, 0, 2);
    put(zip, true, 0, 8);
    put(zip, true, at, 4);
    append(&zip->list, &zip->list_count, &zip->list_capacity, name, strlen(name));
    zip->members++;
}

void zip_writer_end(struct zip_writer *zip)
{
    const size_t at = zip->count;
    append(&zip->bytes, &zip->count, &zip->capacity, zip->list, zip->list_count);
    put(zip, false, 0x06054b50, 4);
    put(zip, false, 0, 4);
    put(zip, false, (uint64_t)zip->members, 2);
    put(zip, false, (uint64_t)zip->members, 2);
    put(zip, false, zip->list_count, 4);
    put(zip, false, at, 4);
    put(zip, false, 0, 2);
}

void zip_writer_free(struct zip_writer *zip)
{
    free(zip->bytes);
    free(zip->list);
    *zip = (struct zip_writer){.count = 0};
}
