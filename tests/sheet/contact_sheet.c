// contact-sheet OUT COLUMNS CELL_WIDTH IMAGE...: images side by side in one, for the demo and the documentation. PNG
// (.png) and JPEG (.jpg) in and out, all of one aspect ratio.
#include "platform/file.h"
#include "platform/jpeg.h"
#include "platform/png.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { GAP = 4 };

struct sheet_image {
    uint8_t *rgb;
    int width, height;
};

static enum status read_jpeg(const char *path, struct sheet_image *out)
{
    uint8_t *bytes;
    size_t count;
    enum status status = file_read(path, &bytes, &count);
    if (status != OK)
        return status;
    status = jpeg_size(bytes, count, &out->width, &out->height);
    if (status == OK && !(out->rgb = malloc(3 * (size_t)out->width * (size_t)out->height)))
        status = fail(ERR_MEMORY, "no memory for %s", path);
    if (status == OK)
        status = jpeg_decode(bytes, count, out->rgb, out->width, out->height);
    free(bytes);
    return status;
}

static bool is_jpeg(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && !strcmp(dot, ".jpg");
}

static enum status read_image(const char *path, struct sheet_image *out)
{
    if (is_jpeg(path))
        return read_jpeg(path, out);
    return png_read(path, PNG_RGB8, (void **)&out->rgb, &out->width, &out->height);
}

// Box filter: averages the pixels under each cell pixel.
static void shrink_into(const struct sheet_image *from, uint8_t *sheet, int stride, int x0, int y0, int width,
                        int height)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            for (int c = 0; c < 3; c++) {
                int left = x * from->width / width, right = (x + 1) * from->width / width;
                int top = y * from->height / height, bottom = (y + 1) * from->height / height;
                long sum = 0, count = 0;
                for (int v = top; v < bottom || v == top; v++)
                    for (int u = left; u < right || u == left; u++, count++)
                        sum += from->rgb[3 * (v * from->width + u) + c];
                sheet[3 * ((y0 + y) * stride + x0 + x) + c] = (uint8_t)(sum / count);
            }
}

static enum status write_picture(const char *path, const uint8_t *rgb, int width, int height)
{
    if (!is_jpeg(path))
        return png_write(path, PNG_RGB8, rgb, width, height);
    uint8_t *bytes;
    size_t count;
    enum status status = jpeg_encode(rgb, width, height, 88, &bytes, &count);
    if (status == OK) {
        status = file_write(path, bytes, count);
        free(bytes);
    }
    return status;
}

static enum status make_sheet(const char *out, int columns, int width, char **paths, int count)
{
    uint8_t *sheet = NULL;
    int sheet_width = 0, sheet_height = 0, height = 0;
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        struct sheet_image picture = {0};
        status = read_image(paths[i], &picture);
        if (status == OK && !sheet) {
            height = width * picture.height / picture.width;
            int rows = (count + columns - 1) / columns;
            sheet_width = columns * (width + GAP) + GAP;
            sheet_height = rows * (height + GAP) + GAP;
            sheet = malloc(3 * (size_t)sheet_width * (size_t)sheet_height);
            if (!sheet)
                status = fail(ERR_MEMORY, "no memory for a sheet of %d x %d pixels", sheet_width, sheet_height);
            else
                memset(sheet, 255, 3 * (size_t)sheet_width * (size_t)sheet_height);
        }
        if (status == OK)
            shrink_into(&picture, sheet, sheet_width, GAP + i % columns * (width + GAP),
                        GAP + i / columns * (height + GAP), width, height);
        free(picture.rgb);
    }
    if (status == OK)
        status = write_picture(out, sheet, sheet_width, sheet_height);
    free(sheet);
    return status;
}

int main(int argc, char **argv)
{
    int columns = argc > 2 ? atoi(argv[2]) : 0, width = argc > 3 ? atoi(argv[3]) : 0;
    if (argc < 5 || columns < 1 || width < 8) {
        fprintf(stderr, "usage: contact-sheet OUT COLUMNS CELL_WIDTH PICTURE...\n");
        return 2;
    }
    if (make_sheet(argv[1], columns, width, argv + 4, argc - 4) != OK) {
        fprintf(stderr, "contact-sheet: %s\n", status_message());
        return 1;
    }
    return 0;
}
