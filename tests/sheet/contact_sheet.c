// contact-sheet OUT COLUMNS CELL_WIDTH IMAGE...: images side by side in one, for the demo and the documentation. PNG
// (.png) and JPEG (.jpg) in and out, all of one aspect ratio.
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"

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

struct sheet_cell {
    uint8_t *at; // its first pixel
    int stride;  // pixels from row to row
    int width, height;
};

// The mean of channel c over a range of columns and rows, of at least one pixel.
static uint8_t box_mean(const struct sheet_image *from, const int columns[2], const int rows[2], int c)
{
    long sum = 0, count = 0;
    for (int v = rows[0]; v < rows[1] || v == rows[0]; v++)
        for (int u = columns[0]; u < columns[1] || u == columns[0]; u++, count++)
            sum += from->rgb[3 * (v * from->width + u) + c];
    return (uint8_t)(sum / count);
}

static void shrink_into(const struct sheet_image *from, const struct sheet_cell *cell)
{
    for (int y = 0; y < cell->height; y++)
        for (int x = 0; x < cell->width; x++) {
            const int columns[2] = {x * from->width / cell->width, (x + 1) * from->width / cell->width};
            const int rows[2] = {y * from->height / cell->height, (y + 1) * from->height / cell->height};
            for (int c = 0; c < 3; c++)
                cell->at[3 * (y * cell->stride + x) + c] = box_mean(from, columns, rows, c);
        }
}

static enum status write_image(const char *path, const uint8_t *rgb, int width, int height)
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
        struct sheet_image image = {0};
        status = read_image(paths[i], &image);
        if (status == OK && !sheet) {
            height = width * image.height / image.width;
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
            shrink_into(&image, &(struct sheet_cell){sheet + 3 * ((GAP + i / columns * (height + GAP)) * sheet_width +
                                                                  GAP + i % columns * (width + GAP)),
                                                     sheet_width, width, height});
        free(image.rgb);
    }
    if (status == OK)
        status = write_image(out, sheet, sheet_width, sheet_height);
    free(sheet);
    return status;
}

int main(int argc, char **argv)
{
    int columns = argc > 2 ? atoi(argv[2]) : 0, width = argc > 3 ? atoi(argv[3]) : 0;
    if (argc < 5 || columns < 1 || width < 8) {
        fprintf(stderr, "usage: contact-sheet OUT COLUMNS CELL_WIDTH IMAGE...\n");
        return 2;
    }
    if (make_sheet(argv[1], columns, width, argv + 4, argc - 4) != OK) {
        fprintf(stderr, "contact-sheet: %s\n", status_message());
        return 1;
    }
    return 0;
}
