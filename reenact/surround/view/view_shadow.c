// What might hide a pixel's surface: space on the way to it that no picture has looked into. A surface that was seen
// from elsewhere, behind the unseen inside or top of a box, is then not drawn as if it were in sight.
#include "reenact/surround/view/view_layers.h"

// Chosen on the rover set: cells are judged by their middle; steps along the ray; so much of it must be in shadow.
enum { CELL = 4, MOST_STEPS = 64 };
#define LEAST_STEP_M   0.06
#define SHADOW_M       0.15
#define NEAREST_M      0.3
#define BEFORE_SURFACE 0.10 // metres before the surface, where depth's own errors end

// Whether a picture knows the point to be free or to be a surface, or cannot say; false: something in front hides it.
static bool is_open(const struct surround_picture *p, const double world[3])
{
    struct picture_point at;
    if (!surround_picture_project(p, world, &at))
        return false; // a perspective picture that looks elsewhere
    const int u = (int)floorf(at.u + 0.5f), v = (int)floorf(at.v + 0.5f);
    const int x = u < 0 ? 0 : u >= p->width ? p->width - 1 : u, y = v < 0 ? 0 : v >= p->height ? p->height - 1 : v;
    const float inverse = p->inverse[(size_t)y * (size_t)p->width + (size_t)x];
    return inverse * at.distance < 1.04f; // unknown depth is negative
}

static bool in_shadow(const struct surround_view *view, const struct surround_picture *const *pictures, int count,
                      int x, int y)
{
    const float inverse_z = view->inverse_z[(size_t)y * (size_t)view->lens.width + (size_t)x];
    double end[3];
    surround_view_point(view, x, y, inverse_z, end);
    const struct vec3 eye = view->world_from_view.translation, d = v3_sub(v3(end[0], end[1], end[2]), eye);
    const double length = v3_length(d), last = fmin(length, 12) - BEFORE_SURFACE;
    const double step = fmax(LEAST_STEP_M, (last - NEAREST_M) / MOST_STEPS);
    double dark = 0;
    int lately = 0; // the picture that saw the last step: it often sees the next
    for (double t = NEAREST_M; t < last; t += step) {
        const double at[3] = {eye.x + d.x * t / length, eye.y + d.y * t / length, eye.z + d.z * t / length};
        bool open = is_open(pictures[lately], at);
        for (int i = 0; i < count && !open; i++)
            if ((open = is_open(pictures[i], at)))
                lately = i;
        dark = open ? 0 : dark + step;
        if (dark >= SHADOW_M)
            return true;
    }
    return false;
}

void view_mark_shadows(struct surround_view *view, const struct surround_picture *const *pictures, int count)
{
    const int w = view->lens.width, h = view->lens.height;
    for (int y0 = 0; y0 < h; y0 += CELL)
        for (int x0 = 0; x0 < w; x0 += CELL) {
            const int x1 = x0 + CELL < w ? x0 + CELL : w, y1 = y0 + CELL < h ? y0 + CELL : h;
            const int x = (x0 + x1) / 2, y = (y0 + y1) / 2;
            if (count && view->inverse_z[(size_t)y * (size_t)w + (size_t)x] >= 0 &&
                in_shadow(view, pictures, count, x, y))
                for (int v = y0; v < y1; v++)
                    for (int u = x0; u < x1; u++)
                        view->inverse_z[(size_t)v * (size_t)w + (size_t)u] = DEPTH_UNKNOWN;
        }
}
