// View-dependent geometry: the surface that one picture's depth spans, drawn into a view's depth.
#include "surround/view/view_layers.h"

#include "surround/picture/picture_lanes.h"

enum { BLOCK = 16 };

struct warp {
    const struct surround_view *view;
    const struct surround_picture *p;
    float *inverse_z;
    float turn[3][3]; // view axes from the picture's
    float shift[3];   // the picture's place in the view's axes
    float fx, fy, cx, cy;
};

struct vertex {
    float x, y, inverse_z; // pixels of the view; 1 / z
    int32_t ahead;         // else the others mean nothing
};

// In units of the ray, so that the infinitely far needs no exception: q = turn ray + inverse shift, 1 / z = inverse /
// q.z
static struct vertex project(const struct warp *w, const float ray[3], float inverse)
{
    float q[3];
    for (int i = 0; i < 3; i++)
        q[i] = w->turn[i][0] * ray[0] + w->turn[i][1] * ray[1] + w->turn[i][2] * ray[2] + inverse * w->shift[i];
    struct vertex out = {.ahead = q[2] > 1e-4f};
    if (!out.ahead)
        return out;
    const float scale = 1 / q[2];
    out.x = w->fx * q[0] * scale + w->cx;
    out.y = w->fy * q[1] * scale + w->cy;
    out.inverse_z = inverse * scale;
    return out;
}

// The same of four pixels of a row.
static void project_four(const struct warp *w, const four ray[3], four inverse, struct vertex out[4])
{
    four q[3];
    for (int i = 0; i < 3; i++)
        q[i] = w->turn[i][0] * ray[0] + w->turn[i][1] * ray[1] + w->turn[i][2] * ray[2] + inverse * w->shift[i];
    const four scale = 1 / q[2];
    const four x = w->fx * q[0] * scale + w->cx, y = w->fy * q[1] * scale + w->cy, inverse_z = inverse * scale;
    const four ahead = (four)(q[2] > 1e-4f);
    // Transposed
    const four xy[2] = {__builtin_shufflevector(x, y, 0, 4, 1, 5), __builtin_shufflevector(x, y, 2, 6, 3, 7)};
    const four za[2] = {__builtin_shufflevector(inverse_z, ahead, 0, 4, 1, 5),
                        __builtin_shufflevector(inverse_z, ahead, 2, 6, 3, 7)};
    for (int k = 0; k < 2; k++) {
        const four first = __builtin_shufflevector(xy[k], za[k], 0, 1, 4, 5);
        const four second = __builtin_shufflevector(xy[k], za[k], 2, 3, 6, 7);
        memcpy(&out[2 * k], &first, sizeof first);
        memcpy(&out[2 * k + 1], &second, sizeof second);
    }
}

// libm's fminf is a call.
static float least(float a, float b) { return a < b ? a : b; }
static float most(float a, float b) { return a > b ? a : b; }

// The pixels from `low` to `high` that are within the view; none: *first > *last.
static void span(float low, float high, int size, int *first, int *last)
{
    if (!(high >= 0 && low <= (float)(size - 1))) {
        *first = 0;
        *last = -1;
        return;
    }
    *last = high < (float)(size - 1) ? (int)high : size - 1;
    *first = low > 0 ? (int)low : 0;
    *first += low > (float)*first;
}

static void triangle(const struct warp *w, const struct vertex *a, const struct vertex *b, const struct vertex *c)
{
    const int width = w->view->lens.width;
    const float area = (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
    if (!(area > 1e-8f)) // its back, or nothing
        return;
    int x0, x1, y0, y1;
    span(least(a->x, least(b->x, c->x)), most(a->x, most(b->x, c->x)), width, &x0, &x1);
    span(least(a->y, least(b->y, c->y)), most(a->y, most(b->y, c->y)), w->view->lens.height, &y0, &y1);
    if (x0 > x1 || y0 > y1)
        return;
    const float scale = 1 / area, slack = -1e-4f * area; // neighbours share their edge's pixels
    const float bx = (c->y - a->y) * scale, by = -(c->x - a->x) * scale;
    const float cx = -(b->y - a->y) * scale, cy = (b->x - a->x) * scale;
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            const float dx = (float)x - a->x, dy = (float)y - a->y;
            const float wb = bx * dx + by * dy, wc = cx * dx + cy * dy;
            if (wb < slack || wc < slack || wb + wc > 1 - slack)
                continue;
            const float value = a->inverse_z + wb * (b->inverse_z - a->inverse_z) + wc * (c->inverse_z - a->inverse_z);
            float *out = &w->inverse_z[(size_t)y * (size_t)width + (size_t)x];
            *out = value > *out ? value : *out;
        }
}

static void quad(const struct warp *w, const struct vertex v[4])
{
    if (!v[0].ahead || !v[1].ahead || !v[2].ahead || !v[3].ahead)
        return;
    int first, last;
    span(least(least(v[0].x, v[1].x), least(v[2].x, v[3].x)), most(most(v[0].x, v[1].x), most(v[2].x, v[3].x)),
         w->view->lens.width, &first, &last);
    if (first > last) // between two columns of pixels
        return;
    span(least(least(v[0].y, v[1].y), least(v[2].y, v[3].y)), most(most(v[0].y, v[1].y), most(v[2].y, v[3].y)),
         w->view->lens.height, &first, &last);
    if (first > last)
        return;
    triangle(w, &v[0], &v[1], &v[2]);
    triangle(w, &v[1], &v[3], &v[2]);
}

// Where four pixels are not one surface, each covers its own quarter between their centres.
static void quarters(const struct warp *w, const float rays[4][3], const float inverse[4])
{
    for (int k = 0; k < 4; k++) {
        if (inverse[k] < 0)
            continue;
        struct vertex v[4];
        for (int c = 0; c < 4; c++) {
            // Corner c of the quarter: half way from pixel k towards pixel c's column and row
            const int across = (k & 1) != (c & 1) ? k ^ 1 : k, down = (k >> 1) != (c >> 1) ? k ^ 2 : k;
            float ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = rays[k][i] + 0.5f * (rays[across][i] - rays[k][i]) + 0.5f * (rays[down][i] - rays[k][i]);
            v[c] = project(w, ray, inverse[k]);
        }
        quad(w, v);
    }
}

// A cell that is not one surface.
static void cell(const struct warp *w, int u, int v)
{
    const struct surround_picture *p = w->p;
    const int right = u + 1 < p->width ? u + 1 : 0, columns[4] = {u, right, u, right};
    float rays[4][3], inverse[4];
    int known = 0;
    for (int k = 0; k < 4; k++) {
        inverse[k] = p->inverse[(size_t)(v + (k >> 1)) * (size_t)p->width + (size_t)columns[k]];
        known += inverse[k] >= 0;
    }
    if (!known)
        return;
    for (int k = 0; k < 4; k++)
        surround_picture_ray(p, columns[k], v + (k >> 1), rays[k]);
    quarters(w, (const float(*)[3])rays, inverse);
}

// The pixels of a block with its last column and row, each projected once; then cell by cell. A cell that is joined is
// known.
static void block(const struct warp *w, int u0, int v0, int u1, int v1)
{
    const struct surround_picture *p = w->p;
    struct vertex vertices[BLOCK + 1][BLOCK + 4];
    for (int v = v0; v <= v1; v++) {
        const float *row = p->inverse + (size_t)v * (size_t)p->width;
        int u = u0;
        for (; u < u1 && u + 4 <= p->width; u += 4) {
            four rays[3], inverse;
            memcpy(&inverse, row + u, sizeof inverse);
            surround_picture_rays(p, u, v, rays);
            project_four(w, rays, inverse, &vertices[v - v0][u - u0]);
        }
        for (; u <= u1; u++) {
            const int column = u < p->width ? u : 0;
            float ray[3];
            surround_picture_ray(p, column, v, ray);
            vertices[v - v0][u - u0] = project(w, ray, row[column]);
        }
    }
    for (int v = v0; v < v1; v++)
        for (int u = u0; u < u1; u++) {
            const struct vertex *above = &vertices[v - v0][u - u0], *below = &vertices[v - v0 + 1][u - u0];
            if (p->joined[(size_t)v * (size_t)p->width + (size_t)u] & JOINED_DIAGONAL)
                quad(w, (struct vertex[4]){above[0], above[1], below[0], below[1]});
            else
                cell(w, u, v);
        }
}

// The range of a block's inverse depths; of one without any *nearest is negative.
static void range_of(const struct surround_picture *p, const int from[2], const int to[2], float *farthest,
                     float *nearest)
{
    four low = FOUR(1e9f), high = FOUR(-1.0f);
    for (int v = from[1]; v <= to[1]; v++) {
        const float *row = p->inverse + (size_t)v * (size_t)p->width;
        int u = from[0];
        for (; u + 3 <= to[0] && u + 4 <= p->width; u += 4) {
            four inverse;
            memcpy(&inverse, row + u, sizeof inverse);
            high = FOUR_SELECT(inverse > high, inverse, high);
            low = FOUR_SELECT((inverse < low) & (inverse >= 0), inverse, low);
        }
        for (; u <= to[0]; u++) {
            const float inverse = row[u < p->width ? u : 0];
            high[0] = most(inverse, high[0]);
            low[0] = inverse >= 0 && inverse < low[0] ? inverse : low[0];
        }
    }
    *farthest = least(least(low[0], low[1]), least(low[2], low[3]));
    *nearest = most(most(high[0], high[1]), most(high[2], high[3]));
}

// Whether a block of pixels may be in sight: not all of its corners, nearest and farthest, beyond one edge of the view.
static bool may_be_seen(const struct warp *w, int u0, int v0, int u1, int v1)
{
    const struct surround_picture *p = w->p;
    float farthest, nearest;
    range_of(p, (const int[2]){u0, v0}, (const int[2]){u1, v1}, &farthest, &nearest);
    if (nearest < 0)
        return false;
    int outside[5] = {0};
    const float margin = 0.1f; // the block bulges between its corners
    const float x0 = -(w->cx + 1) / w->fx - margin, x1 = ((float)w->view->lens.width - w->cx) / w->fx + margin;
    const float y0 = -(w->cy + 1) / w->fy - margin, y1 = ((float)w->view->lens.height - w->cy) / w->fy + margin;
    for (int k = 0; k < 8; k++) {
        float ray[3], q[3];
        surround_picture_ray(p, (k & 1 ? u1 : u0) % p->width, k & 2 ? v1 : v0, ray);
        for (int i = 0; i < 3; i++)
            q[i] = w->turn[i][0] * ray[0] + w->turn[i][1] * ray[1] + w->turn[i][2] * ray[2] +
                   (k & 4 ? nearest : farthest) * w->shift[i];
        outside[0] += q[2] < -margin;
        outside[1] += q[0] < x0 * q[2] - margin * (q[2] < 0);
        outside[2] += q[0] > x1 * q[2] + margin * (q[2] < 0);
        outside[3] += q[1] < y0 * q[2] - margin * (q[2] < 0);
        outside[4] += q[1] > y1 * q[2] + margin * (q[2] < 0);
    }
    for (int i = 0; i < 5; i++)
        if (outside[i] == 8)
            return false;
    return true;
}

void view_warp(const struct surround_view *view, const struct surround_picture *p, float *inverse_z)
{
    struct warp w = {.view = view,
                     .p = p,
                     .inverse_z = inverse_z,
                     .fx = (float)view->lens.fx,
                     .fy = (float)view->lens.fy,
                     .cx = (float)view->lens.cx,
                     .cy = (float)view->lens.cy};
    const struct vec3 away = v3_sub(p->world_from_camera.translation, view->world_from_view.translation);
    const double d[3] = {away.x, away.y, away.z};
    for (int i = 0; i < 3; i++) {
        double shift = 0;
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int m = 0; m < 3; m++)
                sum += view->axes[m][i] * p->axes[m][k];
            w.turn[i][k] = (float)sum;
            shift += view->axes[k][i] * d[k];
        }
        w.shift[i] = (float)shift;
    }
    for (size_t i = 0; i < (size_t)view->lens.width * (size_t)view->lens.height; i++)
        inverse_z[i] = DEPTH_UNKNOWN;
    const int columns = p->panorama ? p->width : p->width - 1; // the last column of a panorama joins the first
    for (int v0 = 0; v0 < p->height - 1; v0 += BLOCK)
        for (int u0 = 0; u0 < columns; u0 += BLOCK) {
            const int v1 = v0 + BLOCK < p->height - 1 ? v0 + BLOCK : p->height - 1;
            const int u1 = u0 + BLOCK < columns ? u0 + BLOCK : columns;
            if (!may_be_seen(&w, u0, v0, u1, v1))
                continue;
            block(&w, u0, v0, u1, v1);
        }
}
