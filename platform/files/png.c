#include "platform/files/png.h"

#include "base/pixels.h"
#include "platform/files/file.h"

#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Of one piece that libpng asks for: two rows of the widest picture, with room. A file of 48 bytes may ask for 900 MB.
enum { MEMORY_MAX = 4 << 20, CHUNK_BYTES_MAX = 1 << 20 };

static size_t pixel_bytes(enum png_kind kind) { return (size_t)kind; }

// ------------------------------------------------------------- reading

struct reader {
    const uint8_t *bytes;
    size_t count, at;
    char message[160]; // libpng's error
    bool out_of_memory;
};

// libpng's own memory, counted as such: a lack of it must not be taken for damage.
static png_voidp take_memory(png_structp png, png_alloc_size_t size)
{
    struct reader *reader = png_get_mem_ptr(png);
    void *memory = size <= MEMORY_MAX ? malloc(size) : NULL;
    reader->out_of_memory |= !memory && size <= MEMORY_MAX;
    return memory;
}

static void give_memory(png_structp png, png_voidp memory)
{
    (void)png;
    free(memory);
}

static void keep_message(png_structp png, png_const_charp message)
{
    struct reader *reader = png_get_error_ptr(png);
    snprintf(reader->message, sizeof reader->message, "%s", message);
    longjmp(png_jmpbuf(png), 1);
}

static void ignore_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void read_bytes(png_structp png, png_bytep out, png_size_t want)
{
    struct reader *reader = png_get_io_ptr(png);
    if (want > reader->count - reader->at)
        png_error(png, "the file is cut short");
    memcpy(out, reader->bytes + reader->at, want);
    reader->at += want;
}

// Sets libpng's conversions to `kind`. False: the samples have another bit depth.
static bool set_transforms(png_structp png, png_infop info, enum png_kind kind)
{
    int depth = png_get_bit_depth(png, info), color = png_get_color_type(png, info);
    if ((kind == PNG_GRAY16) != (depth == 16))
        return false;
    if (depth == 16)
        png_set_swap(png);
    if (color == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(png);
    if (color == PNG_COLOR_TYPE_GRAY && depth < 8)
        png_set_expand_gray_1_2_4_to_8(png);
    if (kind == PNG_RGBA8) {
        if (png_get_valid(png, info, PNG_INFO_tRNS))
            png_set_tRNS_to_alpha(png);
        png_set_filler(png, 0xff, PNG_FILLER_AFTER);
    } else {
        png_set_strip_alpha(png);
    }
    if (kind == PNG_GRAY8 || kind == PNG_GRAY16) {
        if (color & PNG_COLOR_MASK_COLOR)
            png_set_rgb_to_gray(png, 1, -1, -1);
    } else if (!(color & PNG_COLOR_MASK_COLOR)) {
        png_set_gray_to_rgb(png);
    }
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    return true;
}

static enum status not_png(const uint8_t *bytes, size_t count, const char *name)
{
    const char *kind = file_kind_of(bytes, count, count);
    if (!kind || strstr(kind, "PNG"))
        return fail(ERR_CORRUPT, "%s is damaged where it begins: it is no PNG picture", name);
    return fail(ERR_INPUT, "%s is no PNG picture: it is %s", name, kind);
}

enum status png_size(const uint8_t *bytes, size_t count, const char *name, int *width, int *height)
{
    // Width and height follow the header chunk's length and name. libpng, but not the standard, lets others go before.
    static const char begin[] = "\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
    if (count < 24 || memcmp(bytes, begin, sizeof begin - 1))
        return not_png(bytes, count, name);
    uint32_t size[2];
    for (int i = 0; i < 2; i++) {
        const uint8_t *at = bytes + 16 + 4 * i;
        size[i] = (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
    }
    if (size[0] < 1 || size[1] < 1 || size[0] > INT32_MAX || size[1] > INT32_MAX)
        return fail(ERR_CORRUPT, "%s is damaged: its size is impossible", name);
    *width = (int)size[0];
    *height = (int)size[1];
    return OK;
}

enum status png_decode(const uint8_t *bytes, size_t count, const char *name, struct png_layout *layout, void **pixels)
{
    const enum png_kind kind = layout->kind;
    int *width = &layout->width, *height = &layout->height;
    struct reader reader = {.bytes = bytes, .count = count};
    uint8_t *volatile rows = NULL; // volatile: written between setjmp and longjmp
    volatile enum status status = png_size(bytes, count, name, width, height);
    if (status != OK)
        return status;
    if (!image_size_is_usable(*width, *height))
        return fail(ERR_INPUT, "%s has %d x %d pixels; at most %d a side and %d million in all can be used", name,
                    *width, *height, IMAGE_SIDE_MAX, IMAGE_PIXELS_MAX / 1000000);
    png_structp png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &reader, keep_message, ignore_warning, &reader,
                                               take_memory, give_memory);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_read_struct(&png, NULL, NULL);
        return fail(ERR_MEMORY, "no memory to read %s", name);
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_read_struct(&png, &info, NULL);
        free(rows);
        return reader.out_of_memory ? fail(ERR_MEMORY, "no memory to read %s", name)
                                    : fail(ERR_CORRUPT, "%s is damaged (%s)", name, reader.message);
    }
    png_set_user_limits(png, IMAGE_SIDE_MAX, IMAGE_SIDE_MAX);
    png_set_chunk_malloc_max(png, CHUNK_BYTES_MAX);
    png_set_chunk_cache_max(png, 64);
    png_set_read_fn(png, &reader, read_bytes);
    png_read_info(png, info);
    if (!set_transforms(png, info, kind)) {
        status =
            kind == PNG_GRAY16
                ? fail(ERR_INPUT,
                       "%s has %d bits a pixel's value, so it holds no distances: depth pictures have 16 (PNG, gray)",
                       name, png_get_bit_depth(png, info))
                : fail(ERR_INPUT, "%s has 16 bits a colour; save it as a PNG of 8 bits, or as JPEG", name);
    } else {
        size_t stride = (size_t)*width * pixel_bytes(kind);
        if (png_get_rowbytes(png, info) != stride) {
            status = fail(ERR_INPUT, "%s has an unusual pixel layout", name);
        } else if (!(rows = malloc(stride * (size_t)*height))) {
            status = fail(ERR_MEMORY, "no memory for the %d x %d pixels of %s", *width, *height, name);
        } else {
            int passes = png_get_interlace_type(png, info) == PNG_INTERLACE_ADAM7 ? 7 : 1;
            for (int pass = 0; pass < passes; pass++)
                for (int y = 0; y < *height; y++)
                    png_read_row(png, rows + stride * (size_t)y, NULL);
            png_read_end(png, NULL);
        }
    }
    png_destroy_read_struct(&png, &info, NULL);
    if (status == OK)
        *pixels = rows;
    return status;
}

enum status png_read(const char *path, enum png_kind kind, void **pixels, int *width, int *height)
{
    uint8_t *bytes;
    size_t count;
    enum status status = file_read(path, &bytes, &count);
    if (status == OK) {
        struct png_layout layout = {.kind = kind};
        status = png_decode(bytes, count, path, &layout, pixels);
        *width = layout.width;
        *height = layout.height;
        free(bytes);
    }
    return status;
}

// ------------------------------------------------------------- writing

struct png_buffer {
    uint8_t *bytes;
    size_t count, capacity;
};

static void append_bytes(png_structp png, png_bytep data, png_size_t count)
{
    struct png_buffer *memory = png_get_io_ptr(png);
    if (memory->count + count > memory->capacity) {
        size_t capacity = (memory->count + count) * 2;
        uint8_t *bytes = realloc(memory->bytes, capacity);
        if (!bytes)
            png_error(png, "no memory");
        memory->bytes = bytes;
        memory->capacity = capacity;
    }
    memcpy(memory->bytes + memory->count, data, count);
    memory->count += count;
}

static void flush_nothing(png_structp png) { (void)png; }

enum status png_encode(const struct png_layout *layout, const void *pixels, int level, uint8_t **bytes, size_t *count)
{
    const enum png_kind kind = layout->kind;
    const int width = layout->width, height = layout->height;
    static const int color_type[] = {[PNG_GRAY8] = PNG_COLOR_TYPE_GRAY,
                                     [PNG_GRAY16] = PNG_COLOR_TYPE_GRAY,
                                     [PNG_RGB8] = PNG_COLOR_TYPE_RGB,
                                     [PNG_RGBA8] = PNG_COLOR_TYPE_RGB_ALPHA};
    struct reader complaint = {0};
    struct png_buffer memory = {0};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &complaint, keep_message, ignore_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_write_struct(&png, NULL);
        return fail(ERR_MEMORY, "no memory to write a picture");
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        free(memory.bytes);
        return fail(ERR_MEMORY, "a picture could not be encoded as PNG (%s)", complaint.message);
    }
    png_set_write_fn(png, &memory, append_bytes, flush_nothing);
    png_set_compression_level(png, level);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, kind == PNG_GRAY16 ? 16 : 8, color_type[kind],
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    if (kind == PNG_GRAY16)
        png_set_swap(png);
    size_t stride = (size_t)width * pixel_bytes(kind);
    for (int y = 0; y < height; y++)
        png_write_row(png, (png_const_bytep)pixels + stride * (size_t)y);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    *bytes = memory.bytes;
    *count = memory.count;
    return OK;
}

enum status png_write(const char *path, enum png_kind kind, const void *pixels, int width, int height)
{
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&(struct png_layout){kind, width, height}, pixels, 6, &bytes, &count);
    if (status == OK) {
        status = file_write(path, bytes, count);
        free(bytes);
    }
    return status;
}
