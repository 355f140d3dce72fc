// screen-check SCREEN.png CAMERA DRAWN: checks that a screenshot shows the actor in one of the
// camera's images. CAMERA: the folder that the camera showed. DRAWN: the output of `reenact
// render --layers` for it. Finds the image that the screen shows, and compares the pixels of
// the actor with what `render` draws and with the camera's image without the actor.
#include "app/ui/view_compositor.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

struct rgb_image {
    uint8_t *rgb;
    int width, height;
};

// Mean squared differences from the screen, 8-bit values.
struct difference {
    double room;           // outside the actor, to the camera's image
    double drawn, without; // within the actor, to what `render` draws and to the camera's image
    long actor_pixels;
};

// In the middle of the screen, where there are neither controls nor messages.
static struct difference compare(const struct rgb_image *screen, const uint8_t *camera, const uint8_t *drawn,
                                 const uint8_t *actor, const struct lens *lens)
{
    struct cover cover = cover_of(lens, (struct ui_box){0, 0, screen->width, screen->height});
    struct difference d = {0};
    long room_pixels = 0;
    for (int y = screen->height / 3; y < screen->height * 7 / 10; y++)
        for (int x = screen->width / 8; x < screen->width * 7 / 8; x++) {
            int px = (int)((x - cover.x) / cover.scale), py = (int)((y - cover.y) / cover.scale);
            size_t at = (size_t)py * (size_t)lens->width + (size_t)px;
            double with = 0, bare = 0;
            for (size_t c = 0; c < 3; c++) {
                double seen = screen->rgb[3 * ((size_t)y * (size_t)screen->width + (size_t)x) + c];
                with += pow(seen - drawn[3 * at + c], 2) / 3;
                bare += pow(seen - camera[3 * at + c], 2) / 3;
            }
            if (actor[4 * at + 3] == 255) {
                d.drawn += with;
                d.without += bare;
                d.actor_pixels++;
            } else if (actor[4 * at + 3] == 0) {
                d.room += bare;
                room_pixels++;
            }
        }
    d.room /= fmax(1, (double)room_pixels);
    d.drawn /= fmax(1, (double)d.actor_pixels);
    d.without /= fmax(1, (double)d.actor_pixels);
    return d;
}

// Compares the screen with the camera's frame and the output of `render` for it.
static enum status compare_with_camera(const struct rgb_image *screen, const char *folder, const struct frame *frame,
                                       const struct lens *lens, struct difference *out)
{
    char path[4096];
    void *drawn = NULL, *actor = NULL;
    int width, height;
    snprintf(path, sizeof path, "%s/%s.png", folder, frame->name);
    enum status status = png_read(path, PNG_RGB8, &drawn, &width, &height);
    if (status == OK && (width != lens->width || height != lens->height))
        status = fail(ERR_INPUT, "%s is not of the camera's size", path);
    snprintf(path, sizeof path, "%s/%s_actor.png", folder, frame->name);
    if (status == OK)
        status = png_read(path, PNG_RGBA8, &actor, &width, &height);
    if (status == OK)
        *out = compare(screen, frame->color, drawn, actor, lens);
    free(drawn);
    free(actor);
    return status;
}

static enum status find(const struct rgb_image *screen, const char *camera_uri, const char *folder, char name[32],
                        struct difference *best)
{
    struct source *camera;
    enum status status = source_open(&camera, camera_uri, SOURCE_CAMERA);
    if (status != OK)
        return status;
    struct frame frame;
    best->room = INFINITY;
    while ((status = source_next(camera, &frame)) == OK) {
        struct difference d;
        status = compare_with_camera(screen, folder, &frame, &source_calibration(camera)->color, &d);
        if (status != OK)
            break;
        if (d.room < best->room) {
            *best = d;
            snprintf(name, 32, "%s", frame.name);
        }
    }
    source_close(&camera);
    return status == NOTHING ? OK : status;
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        fprintf(stderr, "usage: screen-check SCREEN.png CAMERA_FOLDER DRAWN_FOLDER\n");
        return 2;
    }
    struct rgb_image screen = {0};
    struct difference d = {0};
    char name[32] = "", uri[4096];
    void *pixels = NULL;
    snprintf(uri, sizeof uri, "folder:%s", argv[2]);
    enum status status = png_read(argv[1], PNG_RGB8, &pixels, &screen.width, &screen.height);
    screen.rgb = pixels;
    if (status == OK)
        status = find(&screen, uri, argv[3], name, &d);
    free(pixels);
    if (status != OK) {
        fprintf(stderr, "screen-check: %s\n", status_message());
        return 1;
    }
    printf(
        "%s: shows the camera's image %s, rms difference %.1f; at the actor's %ld pixels, rms difference %.1f to the "
        "rendered image, %.1f to the camera's\n",
        argv[1], name, sqrt(d.room), d.actor_pixels, sqrt(d.drawn), sqrt(d.without));
    const bool shown = sqrt(d.room) < 15 && d.actor_pixels > 500 && d.drawn < d.without / 2;
    if (!shown)
        fprintf(stderr, "screen-check: %s does not show the actor in the camera's image\n", argv[1]);
    return shown ? 0 : 1;
}
