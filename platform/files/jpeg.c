#include "platform/files/jpeg.h"

#include "base/pixels.h"

#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

// A lack of memory is no damage. libjpeg-turbo says which only in words.
static enum status decode_failed(tjhandle handle)
{
    const char *why = tjGetErrorStr2(handle);
    if (strstr(why, "emory"))
        return fail(ERR_MEMORY, "no memory to decode a picture");
    return fail(ERR_CORRUPT, "a JPEG picture is damaged (%s)", why);
}

// Of four inks: no colours that a screen has without the printer's profile.
static enum status check_colorspace(int colorspace)
{
    return colorspace == TJCS_CMYK || colorspace == TJCS_YCCK
               ? fail(ERR_INPUT, "a JPEG picture is in CMYK, for a printer; save it in RGB")
               : OK;
}

enum status jpeg_size(const uint8_t *bytes, size_t count, int *width, int *height)
{
    tjhandle handle = tjInitDecompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to decode a picture");
    int subsampling, colorspace;
    enum status status = OK;
    *width = *height = 0; // stays so, without an error, when the data end before the image begins
    if (tjDecompressHeader3(handle, bytes, (unsigned long)count, width, height, &subsampling, &colorspace))
        status = decode_failed(handle);
    else if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
        status = fail(ERR_INPUT, "a JPEG picture has a printer's colours (CMYK); save it with a screen's (RGB)");
    else if (*width < 1 || *height < 1)
        status = fail(ERR_CORRUPT, "a JPEG picture is damaged: it ends before its picture begins");
    else if (!image_size_is_usable(*width, *height))
        status =
            fail(ERR_INPUT, "a JPEG picture has %d x %d pixels; at most %d a side and %d million in all can be used",
                 *width, *height, IMAGE_SIDE_MAX, IMAGE_PIXELS_MAX / 1000000);
    else
        status = check_colorspace(colorspace);
    tjDestroy(handle);
    return status;
}

enum status jpeg_decode(const uint8_t *bytes, size_t count, uint8_t *rgb, int width, int height)
{
    tjhandle handle = tjInitDecompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to decode a picture");
    int w = 0, h = 0, subsampling, colorspace;
    enum status status = OK;
    // A warning ("premature end of file") means missing pixels: an error here.
    if (tjDecompressHeader3(handle, bytes, (unsigned long)count, &w, &h, &subsampling, &colorspace))
        status = decode_failed(handle);
    else if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
        status = fail(ERR_INPUT, "a JPEG picture has a printer's colours (CMYK); save it with a screen's (RGB)");
    else if (w != width || h != height)
        status =
            fail(ERR_CORRUPT, "a JPEG picture has %d x %d pixels where %d x %d were expected", w, h, width, height);
    else if ((status = check_colorspace(colorspace)) != OK)
        ; // said
    else if (tjDecompress2(handle, bytes, (unsigned long)count, rgb, width, 0, height, TJPF_RGB,
                           TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS))
        status = decode_failed(handle);
    tjDestroy(handle);
    return status;
}

enum status jpeg_encode(const uint8_t *rgb, int width, int height, int quality, uint8_t **bytes, size_t *count)
{
    tjhandle handle = tjInitCompress();
    if (!handle)
        return fail(ERR_MEMORY, "no memory to encode a picture");
    unsigned char *coded = NULL;
    unsigned long size = 0;
    enum status status = OK;
    if (tjCompress2(handle, rgb, width, 0, height, TJPF_RGB, &coded, &size, TJSAMP_420, quality, TJFLAG_ACCURATEDCT)) {
        status = fail(ERR_MEMORY, "a picture could not be encoded as JPEG (%s)", tjGetErrorStr2(handle));
    } else if (!(*bytes = malloc(size))) {
        status = fail(ERR_MEMORY, "no memory for an encoded picture of %lu bytes", size);
    } else {
        memcpy(*bytes, coded, size);
        *count = size;
    }
    tjFree(coded);
    tjDestroy(handle);
    return status;
}
