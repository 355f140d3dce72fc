#include "app/ui/screenshot.h"

#include "platform/files/file.h"
#include "platform/files/jpeg.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { QUALITY = 94 };

enum status screenshot_path(const char *folder, char *path, size_t capacity)
{
    char own[400], name[64];
    const char *home = getenv("HOME"), *pictures = getenv("XDG_PICTURES_DIR");
    if (!folder) {
        const char *base = pictures ? pictures : home;
        if (!base)
            base = ".";
        if (snprintf(own, sizeof own, "%s%s", base, pictures ? "" : "/Pictures") >= (int)sizeof own)
            return fail(ERR_INPUT, "the name of the folder for screenshots is too long");
        folder = own;
    }
    enum status status = folder_make(folder);
    if (status != OK)
        return status;
    time_t now = time(NULL);
    struct tm local;
    localtime_r(&now, &local);
    strftime(name, sizeof name, "reenact-%Y-%m-%d-%H%M%S", &local);
    for (int n = 1; n < 1000; n++) { // there may be several in a second
        char number[16] = "";
        if (n > 1)
            snprintf(number, sizeof number, "-%d", n);
        if (snprintf(path, capacity, "%s/%s%s.jpg", folder, name, number) >= (int)capacity)
            return fail(ERR_INPUT, "the name of the folder for screenshots is too long");
        if (!file_exists(path))
            return OK;
    }
    return fail(ERR_IO, "%s has too many screenshots of this second", folder);
}

static enum status write_jpeg(const uint8_t *rgba, int width, int height, const char *path)
{
    size_t pixels = (size_t)width * (size_t)height, count;
    uint8_t *rgb = malloc(3 * pixels), *bytes;
    if (!rgb)
        return fail(ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < pixels; i++)
        memcpy(rgb + 3 * i, rgba + 4 * i, 3);
    enum status status = jpeg_encode(rgb, width, height, QUALITY, &bytes, &count);
    free(rgb);
    if (status != OK)
        return status;
    status = file_write(path, bytes, count);
    free(bytes);
    return status;
}

enum status screenshot_take(const struct brush *b, struct gpu *gpu, const struct take_view_image *image,
                            const struct view_state *s, const char *path)
{
    const int width = image->lens.width, height = image->lens.height;
    struct gpu_target *target;
    uint8_t *rgba = malloc((size_t)width * (size_t)height * 4);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = gpu_target_open(&target, gpu, width, height);
    const struct ui_input input = {.width_px = width, .height_px = height, .px_per_dp = ui_px_per_dp(b->ui)};
    if (status == OK)
        status = ui_begin(b->ui, &input);
    if (status == OK) {
        struct view_state without_ring = *s;
        without_ring.moving = false;
        compositor_draw(b, (struct ui_box){0, 0, ui_width(b->ui), ui_height(b->ui)}, image, &without_ring);
        ui_end(b->ui);
        status = ui_draw(b->ui, target, 0);
    }
    if (status == OK)
        status = gpu_target_read(target, rgba);
    if (status == OK)
        status = write_jpeg(rgba, width, height, path);
    gpu_target_close(&target);
    free(rgba);
    return status;
}
