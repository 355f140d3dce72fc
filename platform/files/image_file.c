#include "platform/files/image_file.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"

#include <stdlib.h>
#include <string.h>

static enum status decode_png(const uint8_t *bytes, size_t count, const char *name, struct image *out)
{
    struct png_layout layout = {.kind = PNG_RGB8};
    void *pixels;
    enum status status = png_decode(bytes, count, name, &layout, &pixels);
    if (status == OK)
        *out = (struct image){layout.width, layout.height, pixels};
    return status;
}

static enum status decode_jpeg(const uint8_t *bytes, size_t count, const char *name, struct image *out)
{
    int width, height;
    enum status status = jpeg_size(bytes, count, &width, &height);
    uint8_t *rgb = status == OK ? malloc((size_t)width * (size_t)height * 3) : NULL;
    if (status == OK && !rgb)
        return fail(ERR_MEMORY, "%s: no memory for %d x %d pixels", name, width, height);
    if (status == OK)
        status = jpeg_decode(bytes, count, rgb, width, height);
    if (status != OK) {
        struct failure why;
        failure_keep(&why, status);
        free(rgb);
        return fail(status, "%s: %s", name, why.sentence);
    }
    *out = (struct image){width, height, rgb};
    return OK;
}

enum status image_refuse(const uint8_t *bytes, size_t count, const char *name, const char *wanted)
{
    const char *kind = file_kind_of(bytes, count, count);
    return kind ? fail(ERR_INPUT, "%s is no %s picture: it is %s", name, wanted, kind)
                : fail(ERR_INPUT, "%s is damaged, or no %s picture", name, wanted);
}

enum status image_decode(const uint8_t *bytes, size_t count, const char *name, struct image *out)
{
    static const uint8_t png[4] = {0x89, 'P', 'N', 'G'}, jpeg[2] = {0xff, 0xd8};
    *out = (struct image){0};
    if (count > sizeof png && !memcmp(bytes, png, sizeof png))
        return decode_png(bytes, count, name, out);
    if (count > sizeof jpeg && !memcmp(bytes, jpeg, sizeof jpeg))
        return decode_jpeg(bytes, count, name, out);
    return image_refuse(bytes, count, name, "PNG or JPEG");
}

enum status image_read(const char *path, struct image *out)
{
    uint8_t *bytes;
    size_t count;
    *out = (struct image){0};
    enum status status = file_read(path, &bytes, &count);
    if (status != OK)
        return status;
    status = image_decode(bytes, count, path, out);
    free(bytes);
    return status;
}

void image_gray(const uint8_t *rgb, size_t pixels, uint8_t *gray)
{
    for (size_t i = 0; i < pixels; i++)
        gray[i] = (uint8_t)((19595 * rgb[3 * i] + 38470 * rgb[3 * i + 1] + 7471 * rgb[3 * i + 2] + 32768) >> 16);
}
