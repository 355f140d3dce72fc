#include "reenact/frame/exposure.h"

#include "reenact/observation/depth_agreement.h"

enum { PASSES = 4, INNER_PX = 3 };

static const float MIN_VISIBILITY = 0.5F; // of frame_layer_point. These constants are chosen by hand
static const double OUTLIER_SCALE = 0.2;  // of colours 0..1: a residual this large has weight a quarter
static const double PRIOR = 1;            // of the gain 1, in the unit of the sums: squared colours 0..1
static const double MAX_GAIN = 1.4;

// The frame's pixel at a window's texture coordinates; -1: outside.
static int pixel_of(const float at[2], const float window[4], int width, int height)
{
    const int x = (int)floorf(at[0] * window[2] + window[0]), y = (int)floorf(at[1] * window[3] + window[1]);
    return x < 0 || y < 0 || x >= width || y >= height ? -1 : y * width + x;
}

// The frame's colour of a point that it saw frontally, well within a surface; NULL: it did not.
static const uint8_t *sample_color(const struct exposure_input *in, const struct frame_layer *f,
                                   const struct frame_layer_point *p)
{
    const struct depth_frame *s = in->depth_frame;
    if (p->visibility < MIN_VISIBILITY)
        return NULL;
    const int depth = pixel_of(p->depth_uv, f->windows[1], s->width, s->height);
    const int color = pixel_of(p->color_uv, f->windows[0], in->color->width, in->color->height);
    if (depth < 0 || color < 0 || !depth_agrees(s, depth, (double)p->depth_m, INNER_PX))
        return NULL;
    return in->rgb + 3 * (size_t)color;
}

float exposure_estimate(const struct exposure_input *in, const struct frame_layer *f)
{
    const struct vertex_colors *vertex_colors = &in->avatar->vertex_colors;
    const int32_t *points = in->avatar->atlas.mesh.points;
    double gain = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        double shown_known = PRIOR, known_known = PRIOR;
        for (int i = 0; i < f->point_count; i++) {
            const uint8_t *rgb = vertex_colors->filled[points[i]] ? NULL : sample_color(in, f, &f->points[i]);
            double shown[3], known[3], residual2 = 0;
            for (int c = 0; c < 3 && rgb; c++) {
                shown[c] = rgb[c] / 255.0;
                known[c] = (double)(sqrtf(vertex_colors->color[points[i]][c]) * f->points[i].irradiance);
                residual2 += (shown[c] - gain * known[c]) * (shown[c] - gain * known[c]);
            }
            const double weight = 1 / (1 + residual2 / (OUTLIER_SCALE * OUTLIER_SCALE));
            for (int c = 0; c < 3 && rgb; c++) {
                shown_known += weight * weight * shown[c] * known[c];
                known_known += weight * weight * known[c] * known[c];
            }
        }
        gain = fmin(fmax(shown_known / known_known, 1 / MAX_GAIN), MAX_GAIN);
    }
    return (float)gain;
}
