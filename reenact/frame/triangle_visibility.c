#include "reenact/frame/triangle_visibility.h"

static const double DEPTH_TOLERANCE_M = 0.09;        // from here on depth_agreement.glsl rejects the frame's colour
static const double SLACK_PX = 1e-3, SLACK_M = 1e-4; // for the shader's rounding

// A triangle projected into the depth image: corners in texels, depth as a plane over them.
struct depth_triangle {
    double at[3][2];
    double depth_m, slope[2]; // at its first corner, and the change for one texel
};

// False: it is seen edge-on, and nothing can be said of its inside.
static bool project_triangle(const struct frame_layer *f, const int32_t *corners, struct depth_triangle *out)
{
    double edges[2][3]; // from its first corner to the others: x, y in texels, depth in metres
    for (int k = 0; k < 3; k++) {
        const struct frame_layer_point *p = &f->points[corners[k]];
        out->at[k][0] = (double)p->depth_uv[0] * f->depth.width;
        out->at[k][1] = (double)p->depth_uv[1] * f->depth.height;
        if (k == 0) {
            out->depth_m = (double)p->depth_m;
            continue;
        }
        edges[k - 1][0] = out->at[k][0] - out->at[0][0];
        edges[k - 1][1] = out->at[k][1] - out->at[0][1];
        edges[k - 1][2] = (double)p->depth_m - out->depth_m;
    }
    const double area = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0];
    if (fabs(area) < 1e-6)
        return false;
    out->slope[0] = (edges[0][2] * edges[1][1] - edges[1][2] * edges[0][1]) / area;
    out->slope[1] = (edges[1][2] * edges[0][0] - edges[0][2] * edges[1][0]) / area;
    return true;
}

// Whether the triangle may overlap a texel's square, which lies outside none of its edges.
static bool texel_overlaps(const struct depth_triangle *l, int x, int y)
{
    bool all = true;
    for (int k = 0; k < 3; k++) {
        const double *a = l->at[k], *b = l->at[(k + 1) % 3], *c = l->at[(k + 2) % 3];
        const double across[2] = {a[1] - b[1], b[0] - a[0]};
        const double inwards = across[0] * (c[0] - a[0]) + across[1] * (c[1] - a[1]) > 0 ? 1 : -1;
        const double middle = inwards * (across[0] * (x + 0.5 - a[0]) + across[1] * (y + 0.5 - a[1]));
        all = all && middle + (0.5 + SLACK_PX) * (fabs(across[0]) + fabs(across[1])) >= 0;
    }
    return all;
}

// Whether a texel's depth may agree with some of the triangle.
static bool texel_agrees(const struct frame_layer_image *depth, const struct depth_triangle *l, int x, int y)
{
    const uint8_t *texel = depth->pixels + 4 * ((size_t)y * (size_t)depth->width + (size_t)x);
    const double seen_m = (texel[0] * 256 + texel[1]) * 1e-3;
    const double middle_m = l->depth_m + l->slope[0] * (x + 0.5 - l->at[0][0]) + l->slope[1] * (y + 0.5 - l->at[0][1]);
    const double reach_m = (0.5 + SLACK_PX) * (fabs(l->slope[0]) + fabs(l->slope[1])) + SLACK_M;
    return texel[2] > 0 && fabs(middle_m - seen_m) - reach_m < DEPTH_TOLERANCE_M;
}

static bool may_be_visible(const struct frame_layer *f, const int32_t *corners)
{
    struct depth_triangle l;
    int low[2], high[2];
    float most = 0;
    for (int k = 0; k < 3; k++)
        most = fmaxf(most, f->points[corners[k]].visibility);
    if (!f->has_images || !(most > 0))
        return false;
    if (!project_triangle(f, corners, &l))
        return true;
    for (int a = 0; a < 2; a++) {
        // Outside the image the texture is clamped to its border, which agrees with nothing.
        const double last = (a ? f->depth.height : f->depth.width) - 1;
        low[a] = (int)floor(fmax(fmin(l.at[0][a], fmin(l.at[1][a], l.at[2][a])) - SLACK_PX, 0));
        high[a] = (int)floor(fmin(fmax(l.at[0][a], fmax(l.at[1][a], l.at[2][a])) + SLACK_PX, last));
    }
    for (int y = low[1]; y <= high[1]; y++)
        for (int x = low[0]; x <= high[0]; x++)
            if (texel_overlaps(&l, x, y) && texel_agrees(&f->depth, &l, x, y))
                return true;
    return false;
}

void triangle_visibility_find(const struct uv_mesh *mesh, const struct frame_layer *f, bool *out)
{
    for (int t = 0; t < mesh->corner_count / 3; t++)
        out[t] = may_be_visible(f, mesh->corners + 3 * (size_t)t);
}
