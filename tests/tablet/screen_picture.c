// screen-picture OUT.png: what the first display of a KMS device shows at this moment,
// read from the memory that it is scanned out from, and in words: "picture" when there
// are many colours in its middle. Needs root. Kernel interfaces only.
#include "platform/png.h"

#include <drm.h>
#include <drm_mode.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

// The framebuffer of the first display that is on. False: none is.
static bool find_framebuffer(int card, struct drm_mode_fb_cmd *fb)
{
    uint32_t crtcs[16] = {0};
    struct drm_mode_card_res all = {.crtc_id_ptr = (uintptr_t)crtcs, .count_crtcs = 16};
    if (ioctl(card, DRM_IOCTL_MODE_GETRESOURCES, &all))
        return false;
    for (uint32_t i = 0; i < all.count_crtcs && i < 16; i++) {
        struct drm_mode_crtc crtc = {.crtc_id = crtcs[i]};
        if (ioctl(card, DRM_IOCTL_MODE_GETCRTC, &crtc) || !crtc.fb_id)
            continue;
        *fb = (struct drm_mode_fb_cmd){.fb_id = crtc.fb_id};
        if (!ioctl(card, DRM_IOCTL_MODE_GETFB, fb) && fb->handle)
            return true;
    }
    return false;
}

static void say_what_is_seen(const uint8_t *rgb, int width, int height)
{
    static bool met[4096];
    int colors = 0;
    for (int y = height / 4; y < height * 3 / 4; y++)
        for (int x = width / 4; x < width * 3 / 4; x++) {
            const uint8_t *p = rgb + 3 * (y * width + x);
            int which = (p[0] >> 4) << 8 | (p[1] >> 4) << 4 | p[2] >> 4;
            colors += !met[which];
            met[which] = true;
        }
    printf("%d colours: %s\n", colors, colors > 100 ? "picture" : "a plain ground");
}

static bool write_picture(int card, const struct drm_mode_fb_cmd *fb, const char *path)
{
    struct drm_mode_map_dumb map = {.handle = fb->handle};
    if (fb->bpp != 32 || ioctl(card, DRM_IOCTL_MODE_MAP_DUMB, &map))
        return false;
    size_t bytes = (size_t)fb->pitch * fb->height;
    const uint8_t *from = mmap(NULL, bytes, PROT_READ, MAP_SHARED, card, (off_t)map.offset);
    uint8_t *rgb = malloc(3 * (size_t)fb->width * fb->height);
    bool good = from != MAP_FAILED && rgb;
    for (size_t y = 0; y < fb->height && good; y++)
        for (size_t x = 0; x < fb->width; x++)
            for (size_t c = 0; c < 3; c++) // XRGB8888: blue comes first
                rgb[3 * (y * fb->width + x) + c] = from[y * fb->pitch + 4 * x + 2 - c];
    if (good)
        say_what_is_seen(rgb, (int)fb->width, (int)fb->height);
    good = good && png_write(path, PNG_RGB8, rgb, (int)fb->width, (int)fb->height) == OK;
    free(rgb);
    return good;
}

int main(int argc, char **argv)
{
    struct drm_mode_fb_cmd fb;
    int card = argc == 2 ? open("/dev/dri/card0", O_RDWR | O_CLOEXEC) : -1;
    if (card >= 0)
        ioctl(card, DRM_IOCTL_DROP_MASTER, 0); // whoever opens it first becomes its master; that is the app's to be
    if (card < 0 || !find_framebuffer(card, &fb) || !write_picture(card, &fb, argv[1])) {
        fprintf(stderr, "the display's picture cannot be read; usage: screen-picture OUT.png\n");
        return 1;
    }
    close(card);
    return 0;
}
