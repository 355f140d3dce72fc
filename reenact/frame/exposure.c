#include "reenact/frame/exposure.h"

enum { PASSES = 4, INNER_PX = 3 };

static const float SQUARELY = 0.5F; // of loaded_point's seen
static const double NEAR_M = 0.05;  // the reading that vouches for a place lies this near
static const double ODD = 0.2;      // of colours from 0 to 1: what is so far off counts a quarter
static const double PRIOR = 1;      // squares of such colours, summed: what is held against few places
static const double MOST = 1.4;

// Which pixel of the frame's own a place in a window's picture is; -1: outside.
static int pixel_of(const float at[2], const float window[4], int width, int height)
{
    const int x = (int)floorf(at[0] * window[2] + window[0]), y = (int)floorf(at[1] * window[3] + window[1]);
    return x < 0 || y < 0 || x >= width || y >= height ? -1 : y * width + x;
}

// The frame's colour of a point that it saw squarely, well within a surface; NULL: it did not.
static const uint8_t *shown_at(const struct brightness_look *look, const struct loaded_frame *f,
                               const struct loaded_point *p)
{
    const struct sight *s = look->sight;
    if (p->seen < SQUARELY)
        return NULL;
    const int depth = pixel_of(p->in_depth, f->windows[1], s->width, s->height);
    const int color = pixel_of(p->in_color, f->windows[0], look->color->width, look->color->height);
    if (depth < 0 || color < 0 || s->part[depth] >= PART_COUNT || s->edge[depth] < INNER_PX ||
        fabs(s->depth[depth] * 1e-3 - (double)p->away_m) > NEAR_M)
        return NULL;
    return look->rgb + 3 * (size_t)color;
}

float brightness_of(const struct brightness_look *look, const struct loaded_frame *f)
{
    const struct coat *coat = &look->likeness->coat;
    const int32_t *points = look->likeness->atlas.mesh.points;
    double ratio = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        double both = PRIOR, own = PRIOR;
        for (int i = 0; i < f->point_count; i++) {
            const uint8_t *rgb = coat->filled[points[i]] ? NULL : shown_at(look, f, &f->points[i]);
            double shown[3], known[3], off2 = 0;
            for (int c = 0; c < 3 && rgb; c++) {
                shown[c] = rgb[c] / 255.0;
                known[c] = (double)(sqrtf(coat->color[points[i]][c]) * f->points[i].light);
                off2 += (shown[c] - ratio * known[c]) * (shown[c] - ratio * known[c]);
            }
            const double trust = 1 / (1 + off2 / (ODD * ODD));
            for (int c = 0; c < 3 && rgb; c++) {
                both += trust * trust * shown[c] * known[c];
                own += trust * trust * known[c] * known[c];
            }
        }
        ratio = fmin(fmax(both / own, 1 / MOST), MOST);
    }
    return (float)ratio;
}
