#include "surround/photo_refinement.h"

#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
enum { MOST_POINTS = 4000 };
#define GRAY_SCALE 16.0f
// Chosen on the rover set and on the small world's coarse panoramas: what is fainter says little; a residual's standard
// deviation in levels is between these.
#define LEAST_GRADIENT 4.0f
#define LEAST_SIGMA    1.5
#define MOST_SIGMA     8.0
#define OFF_PX         0.3   // resampling and depth move a point by so much of a pixel
#define INDEPENDENT    400.0 // neighbours and references err alike: all points count as so many

void photo_refinement_free(struct photo_refinement *r)
{
    for (int i = 0; i < PHOTO_REFERENCES; i++)
        free(r->references[i].gray);
    free(r->next.gray);
    free(r->points);
    *r = (struct photo_refinement){0};
}

// Sums of 1 2 1 along a row of brightness; a panorama's row joins its end. row has room for a pixel before and after.
static void sum_row(const struct surround_picture *p, int v, uint16_t *row, uint16_t *out)
{
    const uint8_t *rgb = p->rgb + 3 * (size_t)v * (size_t)p->width;
    const int w = p->width;
    for (int u = 0; u < w; u++)
        row[u + 1] = (uint16_t)((77 * rgb[3 * u] + 150 * rgb[3 * u + 1] + 29 * rgb[3 * u + 2]) >> 4);
    row[0] = p->panorama ? row[w] : row[1];
    row[w + 1] = p->panorama ? row[1] : row[w];
    for (int u = 0; u < w; u++)
        out[u] = (uint16_t)((row[u] + 2 * row[u + 1] + row[u + 2]) >> 2);
}

// Brightness times GRAY_SCALE.
static uint16_t *smoothed_gray(const struct surround_picture *p)
{
    const int w = p->width, h = p->height;
    uint16_t *gray = alloc_cache_aligned((size_t)w * (size_t)h * sizeof *gray);
    uint16_t *rows = alloc_cache_aligned((size_t)(w + 2) * 4 * sizeof *rows);
    if (!gray || !rows) {
        free(gray);
        free(rows);
        return NULL;
    }
    uint16_t *const row = rows + 3 * (w + 2);
    for (int v = 0; v <= h; v++) { // rows v - 2, v - 1 and v make row v - 1
        uint16_t *newest = rows + (v % 3) * (w + 2);
        if (v < h)
            sum_row(p, v, row, newest);
        const uint16_t *below = v < h ? newest : rows + ((v - 1) % 3) * (w + 2);
        const uint16_t *middle = rows + ((v + 2) % 3) * (w + 2);
        const uint16_t *above = v > 1 ? rows + ((v + 1) % 3) * (w + 2) : middle;
        for (int u = 0; v > 0 && u < w; u++)
            gray[(size_t)(v - 1) * (size_t)w + (size_t)u] = (uint16_t)((above[u] + 2 * middle[u] + below[u]) >> 2);
    }
    free(rows);
    return gray;
}

// Bilinear, with the gradient per pixel. False: outside.
static bool read_gray(const struct photo_reference *r, float u, float v, float out[3])
{
    const int w = r->shape.width, x = (int)floorf(u), y = (int)floorf(v);
    if (y < 0 || y + 1 >= r->shape.height || (!r->shape.panorama && (x < 0 || x + 1 >= w)))
        return false;
    const int left = x < 0 ? x + w : x, right = x + 1 < w ? x + 1 : 0;
    const uint16_t *row = r->gray + (size_t)y * (size_t)w;
    const float a = row[left], b = row[right], c = row[left + w], d = row[right + w];
    const float fu = u - (float)x, fv = v - (float)y;
    out[0] = ((1 - fv) * ((1 - fu) * a + fu * b) + fv * ((1 - fu) * c + fu * d)) / GRAY_SCALE;
    out[1] = ((1 - fv) * (b - a) + fv * (d - c)) / GRAY_SCALE;
    out[2] = ((1 - fu) * (c - a) + fu * (d - b)) / GRAY_SCALE;
    return true;
}

// The points of the capture in hand that have a gradient in its own picture.
static enum status begin(struct photo_refinement *r, const struct surround_picture *picture,
                         const struct depth_points *points)
{
    if (!r->points && !(r->points = malloc(MOST_POINTS * sizeof *r->points)))
        return fail(ERR_MEMORY, "out of memory");
    free(r->next.gray);
    r->next = (struct photo_reference){*picture, smoothed_gray(picture)};
    r->next.shape.rgb = NULL;
    r->next.shape.inverse = NULL;
    r->next.shape.joined = NULL;
    r->next.shape.ray_table = NULL;
    if (!r->next.gray)
        return fail(ERR_MEMORY, "out of memory");
    struct surround_picture at_body = r->next.shape;
    surround_picture_place(&at_body, r->body_from_picture);
    const int stride = points->count / (4 * MOST_POINTS) + 1; // about a fourth have a gradient
    r->point_count = 0;
    for (int i = 0; i < points->count && r->point_count < MOST_POINTS; i += stride) {
        const float *b = points->xyz[i];
        const double body[3] = {b[0], b[1], b[2]};
        struct picture_point at;
        float gray[3];
        if (!surround_picture_project(&at_body, body, &at) || !read_gray(&r->next, at.u, at.v, gray) ||
            gray[1] * gray[1] + gray[2] * gray[2] < LEAST_GRADIENT * LEAST_GRADIENT)
            continue;
        r->points[r->point_count++] = (struct photo_point){{b[0], b[1], b[2]}, gray[0]};
    }
    return OK;
}

// The capture in hand is a reference from now on.
static void end(struct photo_refinement *r, struct pose world_from_picture)
{
    const int last = PHOTO_REFERENCES - 1;
    free(r->references[last].gray);
    memmove(r->references + 1, r->references, (size_t)last * sizeof *r->references);
    surround_picture_place(&r->next.shape, world_from_picture);
    r->references[0] = r->next;
    r->next = (struct photo_reference){0};
    if (r->reference_count < PHOTO_REFERENCES)
        r->reference_count++;
}

// How brightness changes with a world point that is seen with gradient (du, dv) per pixel.
static void world_gradient(const struct surround_picture *p, const double world[3], const float gray[3], double out[3])
{
    const struct vec3 *t = &p->world_from_camera.translation;
    const double d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    double c[3], n[3];
    for (int i = 0; i < 3; i++)
        c[i] = p->axes[0][i] * d[0] + p->axes[1][i] * d[1] + p->axes[2][i] * d[2];
    const double gu = gray[1], gv = gray[2];
    if (p->panorama) {
        const double flat2 = c[0] * c[0] + c[2] * c[2] + 1e-9, flat = sqrt(flat2), r2 = flat2 + c[1] * c[1];
        const double per_u = p->width / (2 * PI) / flat2, per_v = p->height / PI / r2;
        n[0] = gu * per_u * c[2] - gv * per_v * c[1] * c[0] / flat;
        n[1] = gv * per_v * flat;
        n[2] = -gu * per_u * c[0] - gv * per_v * c[1] * c[2] / flat;
    } else {
        n[0] = gu * p->lens.fx / c[2];
        n[1] = gv * p->lens.fy / c[2];
        n[2] = -(n[0] * c[0] + n[1] * c[1]) / c[2];
    }
    for (int i = 0; i < 3; i++)
        out[i] = p->axes[i][0] * n[0] + p->axes[i][1] * n[1] + p->axes[i][2] * n[2];
}

struct sight_of_point {
    double world[3];
    float gray[3]; // in the reference: brightness and its gradient
    bool seen;
};

// The reference's exposure over the capture's: of the brightness of all points, which is robust enough for a scale.
static double exposure_of(const struct photo_refinement *r, const struct sight_of_point *sights)
{
    double product = 0, square = 0;
    for (int i = 0; i < r->point_count; i++) {
        if (!sights[i].seen)
            continue;
        product += (double)sights[i].gray[0] * (double)r->points[i].gray;
        square += (double)r->points[i].gray * (double)r->points[i].gray;
    }
    return square > 0 ? product / square : 1;
}

// Standard deviation of a reference's residuals, from their median, which outliers up to half do not move.
static double spread_of(const struct photo_refinement *r, const struct sight_of_point *sights, double exposure)
{
    int bins[256] = {0}, count = 0, below = 0, bin = 0;
    for (int i = 0; i < r->point_count; i++) {
        if (!sights[i].seen)
            continue;
        const double off = 4 * fabs((double)sights[i].gray[0] - exposure * (double)r->points[i].gray);
        bins[off < 255 ? (int)off : 255]++;
        count++;
    }
    while (bin < 255 && 2 * (below + bins[bin]) < count)
        below += bins[bin++];
    return fmin(MOST_SIGMA, fmax(LEAST_SIGMA, 1.4826 * (bin + 0.5) / 4));
}

static double share_of(const struct photo_refinement *r)
{
    return fmin(1, INDEPENDENT / ((double)r->point_count * r->reference_count + 1));
}

static void add_reference(const struct photo_refinement *r, const struct photo_reference *reference,
                          const struct pose *now, struct sight_of_point *sights, struct normal_equations *e)
{
    double m[3][3];
    quat_to_matrix(now->rotation, m);
    const double origin[3] = {now->translation.x, now->translation.y, now->translation.z};
    for (int i = 0; i < r->point_count; i++) {
        struct sight_of_point *s = &sights[i];
        const float *b = r->points[i].body;
        struct picture_point at;
        for (int k = 0; k < 3; k++)
            s->world[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + origin[k];
        s->seen = surround_picture_project(&reference->shape, s->world, &at) && at.distance > 0.3f &&
                  read_gray(reference, at.u, at.v, s->gray);
    }
    const double exposure = exposure_of(r, sights), sigma = spread_of(r, sights, exposure);
    for (int i = 0; i < r->point_count; i++) {
        const struct sight_of_point *s = &sights[i];
        if (!s->seen)
            continue;
        const double residual = (double)s->gray[0] - exposure * (double)r->points[i].gray;
        // Tukey's weight: what another thing hides in the reference says nothing
        const double share = residual / (4.7 * sigma), rest = 1 - share * share;
        if (rest <= 0)
            continue;
        const double slope2 = (double)(s->gray[1] * s->gray[1] + s->gray[2] * s->gray[2]);
        double n[3], arm[3];
        world_gradient(&reference->shape, s->world, s->gray, n);
        for (int k = 0; k < 3; k++)
            arm[k] = s->world[k] - origin[k];
        normal_equations_add(e, n, arm, residual,
                             share_of(r) * rest * rest / (sigma * sigma + slope2 * OFF_PX * OFF_PX));
    }
}

static void add(void *self, const struct pose *world_from_body, struct normal_equations *e)
{
    const struct photo_refinement *r = self;
    struct sight_of_point *sights = malloc(((size_t)r->point_count + 1) * sizeof *sights);
    for (int k = 0; sights && k < r->reference_count; k++) // without memory the planes decide alone
        add_reference(r, &r->references[k], world_from_body, sights, e);
    free(sights);
}

enum status photo_alignment_add(struct photo_refinement *r, struct depth_alignment *alignment,
                                const struct surround_picture *picture, const struct depth_points *points,
                                struct pose odometry, struct pose *world_from_body)
{
    enum status status = begin(r, picture, points);
    if (status != OK)
        return status;
    alignment->more = (struct pose_evidence){add, r};
    status = depth_alignment_add(alignment, points, odometry, world_from_body);
    alignment->more = (struct pose_evidence){0};
    if (status == OK)
        end(r, pose_multiply(*world_from_body, r->body_from_picture));
    return status;
}
