#include "tests/bench/bench_skeleton_picture.h"

#include "tests/support/skeleton_drawing.h"

#include <math.h>
#include <stdlib.h>

enum { WIDTH = 240, HEIGHT = 320 };
static const double MARGIN_M = 0.3; // about the true joints

static struct drawn_window window_about(const struct lens *l, const struct skeleton *truth)
{
    double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct pixel px = lens_project(l, truth->joint[j]);
        const double margin = MARGIN_M * l->fx / truth->joint[j].z;
        x0 = fmin(x0, px.x - margin), x1 = fmax(x1, px.x + margin);
        y0 = fmin(y0, px.y - margin), y1 = fmax(y1, px.y + margin);
    }
    const double width = fmin(l->width, fmax(x1 - x0, (y1 - y0) * WIDTH / HEIGHT));
    x0 = fmin(fmax(0, (x0 + x1 - width) / 2), l->width - width);
    y0 = fmin(fmax(0, (y0 + y1 - width * HEIGHT / WIDTH) / 2), fmax(0, l->height - width * HEIGHT / WIDTH));
    return (struct drawn_window){x0, y0, WIDTH / width};
}

void bench_skeleton_picture(struct bench *b, const char *caption, const struct skeleton_instant *of)
{
    const struct lens *l = &of->calibration->depth;
    const struct pose depth_from_color = pose_inverse(of->calibration->color_from_depth);
    const struct skeleton truth = skeleton_transform(depth_from_color, of->truth),
                          estimate = skeleton_transform(depth_from_color, of->estimate);
    const struct drawn_window window = window_about(l, &truth);
    const struct drawing d = {malloc(3 * (size_t)WIDTH * HEIGHT), WIDTH, HEIGHT, WIDTH};
    if (!d.rgb)
        return;
    drawing_put_depth(&d, l, of->depth, &window);
    drawing_put_skeleton(&d, l, &estimate, &window, false);
    drawing_put_skeleton(&d, l, &truth, &window, true);
    bench_picture(b, caption, d.rgb, WIDTH, HEIGHT);
    free(d.rgb);
}
