#include "platform/files/compress.h"

#include <stdlib.h>
#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

// ---------------------------------------------------------------- checksum

uint32_t crc32_of(uint32_t crc, const void *bytes, size_t count)
{
    return count ? (uint32_t)crc32_z(crc, bytes, count) : crc; // of NULL zlib returns what a CRC begins with
}

// ---------------------------------------------------------------- compress

struct compressor {
    ZSTD_CCtx *pack;
    ZSTD_DCtx *unpack;
};

enum status compressor_open(struct compressor **out)
{
    struct compressor *c = calloc(1, sizeof *c);
    *out = NULL;
    if (c) {
        c->pack = ZSTD_createCCtx();
        c->unpack = ZSTD_createDCtx();
        if (c->pack && c->unpack) {
            *out = c;
            return OK;
        }
        compressor_close(&c);
    }
    return fail(ERR_MEMORY, "no memory for the compressor");
}

void compressor_close(struct compressor **compressor)
{
    if (!*compressor)
        return;
    ZSTD_freeCCtx((*compressor)->pack);
    ZSTD_freeDCtx((*compressor)->unpack);
    free(*compressor);
    *compressor = NULL;
}

size_t compress_bound(size_t count) { return ZSTD_compressBound(count); }

enum status compress_bytes(struct compressor *compressor, int level, const void *bytes, size_t count, void *out,
                           size_t *out_count)
{
    size_t got = ZSTD_compressCCtx(compressor->pack, out, ZSTD_compressBound(count), bytes, count, level);
    if (ZSTD_isError(got))
        return fail(ERR_MEMORY, "%zu bytes could not be compressed (%s)", count, ZSTD_getErrorName(got));
    *out_count = got;
    return OK;
}

enum status decompress_bytes(struct compressor *compressor, const void *bytes, size_t count, void *out,
                             size_t out_count)
{
    size_t got = ZSTD_decompressDCtx(compressor->unpack, out, out_count, bytes, count);
    if (ZSTD_isError(got)) {
        if (ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation)
            return fail(ERR_MEMORY, "no memory to decompress %zu bytes", count);
        return fail(ERR_CORRUPT, "compressed bytes are damaged (%s)", ZSTD_getErrorName(got));
    }
    if (got != out_count)
        return fail(ERR_CORRUPT, "compressed bytes hold %zu bytes where %zu were expected", got, out_count);
    return OK;
}
