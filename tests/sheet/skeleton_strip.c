// skeleton-strip OUT.png COUNT FOLDER [FIRST LAST]: tracks the person in a folder of depth images (TUM layout) and
// shows COUNT instants between two of its frames side by side, depth as brightness, cropped to the person. Limbs of the
// person's left are orange, of their right blue; joints of low confidence are drawn thin, unknown ones not at all.
#include "capture/tracking/tracker.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "tests/support/skeleton_drawing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CELL_HEIGHT = 320, GAP = 4, MOST = 64 };

struct instant {
    uint16_t *depth;
    uint8_t *mask;
    struct skeleton skeleton; // colour camera's axes
};

struct strip {
    struct calibration calibration;
    struct instant instant[MOST];
    int count;
    int left, top, right, bottom; // of the person in all instants, and a little more; inclusive
};

static enum status keep_instant(struct strip *s, const uint16_t *depth, const uint8_t *mask,
                                const struct skeleton *skeleton)
{
    const struct lens *l = &s->calibration.depth;
    size_t pixels = (size_t)l->width * (size_t)l->height;
    struct instant *i = &s->instant[s->count++];
    i->depth = malloc(pixels * sizeof *i->depth);
    i->mask = malloc(pixels);
    if (!i->depth || !i->mask)
        return fail(ERR_MEMORY, "no memory for an image");
    memcpy(i->depth, depth, pixels * sizeof *i->depth);
    memcpy(i->mask, mask, pixels);
    i->skeleton = *skeleton;
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++)
            if (mask[y * l->width + x]) {
                s->left = x < s->left ? x : s->left, s->right = x > s->right ? x : s->right;
                s->top = y < s->top ? y : s->top, s->bottom = y > s->bottom ? y : s->bottom;
            }
    return OK;
}

static enum status track_person(struct strip *s, const char *folder, int count, int first, int last)
{
    char uri[4096];
    struct source *source;
    struct tracker *tracker = NULL;
    struct frame frame;
    struct skeleton skeleton;
    snprintf(uri, sizeof uri, "folder:%s", folder);
    enum status status = source_open(&source, uri, SOURCE_SENSOR);
    if (status != OK)
        return status;
    s->calibration = *source_calibration(source);
    const struct lens *l = &s->calibration.depth;
    int frames = (int)source_remaining(source);
    last = last < frames ? last : frames - 1;
    s->left = l->width, s->top = l->height, s->right = s->bottom = -1;
    uint8_t *mask = calloc((size_t)l->width, (size_t)l->height);
    status = mask ? tracker_open(&tracker, &s->calibration, NULL) : fail(ERR_MEMORY, "no memory for an image");
    for (int k = 0; status >= 0 && s->count < count && (status = source_next(source, &frame)) == OK; k++) {
        status = tracker_next(tracker, frame.time_ns, frame.depth, &skeleton, mask);
        int wanted = first + (count > 1 ? (last - first) * s->count / (count - 1) : 0);
        if (status >= 0 && k == wanted)
            status = keep_instant(s, frame.depth, mask, &skeleton);
    }
    tracker_close(&tracker);
    source_close(&source);
    free(mask);
    if (status < 0)
        return status;
    if (!s->count || s->right < 0)
        return fail(ERR_INPUT, "%s: no person is in these images", folder);
    enum { MARGIN = 6 };
    s->left = s->left > MARGIN ? s->left - MARGIN : 0, s->top = s->top > MARGIN ? s->top - MARGIN : 0;
    s->right = s->right + MARGIN < l->width ? s->right + MARGIN : l->width - 1;
    s->bottom = s->bottom + MARGIN < l->height ? s->bottom + MARGIN : l->height - 1;
    return OK;
}

// ---------------------------------------------------------------- drawing

static void paint_depth(const struct strip *s, const struct instant *i, const struct drawing *c)
{
    int wide = s->right - s->left + 1, high = s->bottom - s->top + 1, z_near = 65535, far = 0;
    const struct lens *l = &s->calibration.depth;
    for (int at = 0; at < l->width * l->height; at++)
        if (i->mask[at] && i->depth[at]) {
            z_near = i->depth[at] < z_near ? i->depth[at] : z_near;
            far = i->depth[at] > far ? i->depth[at] : far;
        }
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            int at = (s->top + y * high / c->height) * l->width + s->left + x * wide / c->width, d = i->depth[at];
            int grey = !d ? 20 : !i->mask[at] ? 60 : 235 - 120 * (d - z_near) / (far > z_near ? far - z_near : 1);
            memset(c->rgb + 3 * (y * c->stride + x), grey, 3);
        }
}

static enum status draw(const struct strip *s, const char *path)
{
    int width = CELL_HEIGHT * (s->right - s->left + 1) / (s->bottom - s->top + 1);
    const int stride = s->count * (width + GAP) - GAP;
    const struct lens *l = &s->calibration.depth;
    const struct drawn_window window = {s->left, s->top, (double)CELL_HEIGHT / (s->bottom - s->top + 1)};
    uint8_t *rgb = malloc(3 * (size_t)stride * CELL_HEIGHT);
    if (!rgb)
        return fail(ERR_MEMORY, "no memory for a strip of %d images", s->count);
    memset(rgb, 255, 3 * (size_t)stride * CELL_HEIGHT);
    for (int i = 0; i < s->count; i++) {
        const struct drawing cell = {rgb + 3 * i * (width + GAP), width, CELL_HEIGHT, stride};
        const struct skeleton in_depth =
            skeleton_transform(pose_inverse(s->calibration.color_from_depth), &s->instant[i].skeleton);
        paint_depth(s, &s->instant[i], &cell);
        drawing_put_skeleton(&cell, l, &in_depth, &window, false);
    }
    enum status status = png_write(path, PNG_RGB8, rgb, stride, CELL_HEIGHT);
    free(rgb);
    return status;
}

int main(int argc, char **argv)
{
    int count = argc > 2 ? atoi(argv[2]) : 0, first = argc > 5 ? atoi(argv[4]) : 0,
        last = argc > 5 ? atoi(argv[5]) : 1 << 30;
    if ((argc != 4 && argc != 6) || count < 1 || count > MOST || first < 0 || last < first) {
        fprintf(stderr, "usage: skeleton-strip OUT.png COUNT FOLDER [FIRST LAST]\n");
        return 2;
    }
    static struct strip strip;
    enum status status = track_person(&strip, argv[3], count, first, last);
    if (status == OK)
        status = draw(&strip, argv[1]);
    for (int i = 0; i < strip.count; i++) {
        free(strip.instant[i].depth);
        free(strip.instant[i].mask);
    }
    if (status != OK)
        fprintf(stderr, "skeleton-strip: %s\n", status_message());
    return status != OK;
}
