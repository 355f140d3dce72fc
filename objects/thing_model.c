#include "objects/thing_model.h"

#include "base/clamp.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- texture pyramid

enum status texture_pyramid(struct texture_level *level, int levels)
{
    for (int l = 1; l < levels; l++) {
        const struct texture_level *from = &level[l - 1];
        struct texture_level *to = &level[l];
        *to = (struct texture_level){(from->width + 1) / 2, (from->height + 1) / 2, NULL};
        to->rgb = malloc((size_t)to->width * (size_t)to->height * 3 * sizeof *to->rgb);
        if (!to->rgb)
            return fail(ERR_MEMORY, "no memory for an image pyramid");
        for (int y = 0; y < to->height; y++) {
            const float *a = from->rgb + (size_t)(2 * y) * (size_t)from->width * 3;
            const float *b = 2 * y + 1 < from->height ? a + from->width * 3 : a;
            float *out = to->rgb + (size_t)y * (size_t)to->width * 3;
            for (int x = 0; x < to->width; x++)
                for (int c = 0; c < 3; c++) {
                    const int i = 6 * x + c, k = 2 * x + 1 < from->width ? i + 3 : i;
                    out[3 * x + c] = 0.25F * ((a[i] + a[k]) + (b[i] + b[k]));
                }
        }
    }
    return OK;
}

// ---------------------------------------------------------------- thing model

// Chosen by hand. A margin is even if most of its pixels differ by no more than this from its median colour.
enum { MARGIN_DIFFERENCE = 24, MARGIN_SHARE_PERCENT = 90 };

static int compare_bytes(const void *a, const void *b) { return *(const uint8_t *)a - *(const uint8_t *)b; }

static bool near_color(const uint8_t *px, const uint8_t color[3])
{
    for (int c = 0; c < 3; c++)
        if (abs(px[c] - color[c]) > MARGIN_DIFFERENCE)
            return false;
    return true;
}

// The edge's pixels, clockwise without order: index i of 2 (width + height) - 4.
static int edge_pixel(int i, int width, int height)
{
    if (i < width)
        return i;
    if (i < 2 * width)
        return (height - 1) * width + i - width;
    i -= 2 * width;
    return (1 + i / 2) * width + (i % 2 ? width - 1 : 0);
}

// True: the picture's edge has one even colour.
static bool margin_color(const struct image *picture, uint8_t *scratch, uint8_t color[3])
{
    const int n = 2 * (picture->width + picture->height) - 4;
    for (int c = 0; c < 3; c++) {
        for (int i = 0; i < n; i++)
            scratch[i] = picture->rgb[3 * edge_pixel(i, picture->width, picture->height) + c];
        qsort(scratch, (size_t)n, 1, compare_bytes);
        color[c] = scratch[n / 2];
    }
    int even = 0;
    for (int i = 0; i < n; i++)
        even += near_color(picture->rgb + 3 * edge_pixel(i, picture->width, picture->height), color);
    return even * 100 >= n * MARGIN_SHARE_PERCENT;
}

// Marks as outside what has the margin's colour and hangs together with the edge.
static void cut_margin(const struct image *picture, const uint8_t color[3], uint8_t *inside, int32_t *stack)
{
    const int w = picture->width, h = picture->height;
    int top = 0;
    memset(inside, 1, (size_t)w * (size_t)h);
    for (int i = 0; i < 2 * (w + h) - 4; i++) {
        const int at = edge_pixel(i, w, h);
        if (inside[at] && near_color(picture->rgb + 3 * at, color)) {
            inside[at] = 0;
            stack[top++] = at;
        }
    }
    while (top) {
        const int at = stack[--top], x = at % w;
        const int next[4] = {x ? at - 1 : -1, x + 1 < w ? at + 1 : -1, at - w, at + w < w * h ? at + w : -1};
        for (int k = 0; k < 4; k++)
            if (next[k] >= 0 && inside[next[k]] && near_color(picture->rgb + 3 * next[k], color)) {
                inside[next[k]] = 0;
                stack[top++] = next[k];
            }
    }
}

struct extent {
    int left, right, first, last; // inclusive
};

static enum status find_extent(const struct thing *thing, struct thing_model *model, struct extent *out)
{
    struct extent e = {model->width, -1, model->height, -1};
    for (int y = 0; y < model->height; y++) {
        int a = model->width, b = -1;
        for (int x = 0; x < model->width; x++)
            if (model->inside[y * model->width + x]) {
                a = x < a ? x : a;
                b = x;
            }
        model->half_px[y] = b < a ? 0 : (float)(b - a + 1) / 2;
        if (b < a)
            continue;
        e.left = a < e.left ? a : e.left;
        e.right = b > e.right ? b : e.right;
        e.first = y < e.first ? y : e.first;
        e.last = y;
    }
    *out = e;
    return e.right - e.left >= 8 && e.last - e.first >= 8
               ? OK
               : fail(ERR_INPUT, "the reference picture of '%s' shows nothing but its margin", thing->name);
}

static void scale_flat(const struct thing *thing, const struct extent *extent, struct thing_model *model)
{
    const double w = extent->right - extent->left + 1, h = extent->last - extent->first + 1, min = w < h ? w : h;
    model->scale[THING_FLAT] = (struct model_scale){
        .x = (extent->left + extent->right) / 2.0,
        .y = (extent->first + extent->last) / 2.0,
        .metres_per_px = (thing->width_m + thing->height_m) / (w + h), // pixels are square
        .size_sigma = sqrt(0.005 * 0.005 + 0.5 / (min * min)),
    };
    model->scale[THING_FLAT].middle_sigma_m = 0.5 * model->scale[THING_FLAT].metres_per_px; // half a pixel
}

// A solid of revolution in perspective, seen from the height of its middle. Its silhouette lies further back than its
// nearest line, so its picture is taller against its width than it is by about radius / distance. With that, the known
// sizes tell the distance; roughly, because of rounding to pixels and millimetres, so that it is weighed against what
// is usual for a photograph of a thing: 0.8 m, to a factor of two.
static void scale_turned(const struct thing *thing, const struct extent *extent, struct thing_model *model)
{
    const double w = extent->right - extent->left + 1, h = extent->last - extent->first + 1,
                 radius = thing->width_m / 2;
    const double usual = radius / 0.8, usual_sigma = 0.5 * usual;
    const double measured = (h / w) / (thing->height_m / thing->width_m) - 1;
    const double sigma = sqrt(1 / (w * w) + 1 / (h * h) + 0.004 * 0.004);
    const double information = 1 / (sigma * sigma) + 1 / (usual_sigma * usual_sigma);
    double growth = (measured / (sigma * sigma) + usual / (usual_sigma * usual_sigma)) / information;
    growth = clamp_double(growth, usual / 4, usual * 4);
    const double d = radius / growth;
    // what the front's plane shows of the silhouette's half width, and of the upper and lower edge's height
    const double half = d * radius / sqrt(d * d + 2 * d * radius);
    const double top = model->half_px[extent->first + 3], low = model->half_px[extent->last - 3];
    const double back_top = radius * (1 - top / (w / 2)), back_low = radius * (1 - low / (w / 2));
    const double up = thing->height_m / 2 / (1 + (back_top > 0 ? back_top : 0) / d);
    const double down = thing->height_m / 2 / (1 + (back_low > 0 ? back_low : 0) / d);
    struct model_scale *s = &model->scale[THING_TURNED];
    *s = (struct model_scale){.x = (extent->left + extent->right) / 2.0,
                              .metres_per_px = (2 * half + up + down) / (w + h)};
    s->y = (extent->first + extent->last) / 2.0 - (down - up) / 2 / s->metres_per_px;
    // With the distance's error; the second, 0.4 % of the height, chosen on the solids of data set `desk`.
    s->size_sigma = 0.02;
    s->middle_sigma_m = sqrt(0.25 * s->metres_per_px * s->metres_per_px + 1.6e-5 * thing->height_m * thing->height_m);
    model->radius_m = radius;
    model->distance_m = d;
}

static enum status make_levels(const struct thing *thing, struct thing_model *model)
{
    const size_t n = (size_t)model->width * (size_t)model->height * 3;
    model->level[0] = (struct texture_level){model->width, model->height, malloc(n * sizeof *model->level[0].rgb)};
    if (!model->level[0].rgb)
        return fail(ERR_MEMORY, "no memory for the picture of '%s'", thing->name);
    for (size_t i = 0; i < n; i++)
        model->level[0].rgb[i] = thing->picture.rgb[i];
    return texture_pyramid(model->level, MODEL_LEVELS);
}

void model_channel(const uint8_t *rgb, size_t pixels, int channel, uint8_t *plane)
{
    for (size_t i = 0; i < pixels; i++)
        plane[i] = rgb[3 * i + (channel ? 2 : 0)];
}

static enum status find_features(const struct thing *thing, struct thing_model *model, uint8_t *plane)
{
    enum status status = OK;
    for (int c = 0; c < MODEL_CHANNELS && status == OK; c++) {
        model->features[c] = malloc(MODEL_MAX_FEATURES * sizeof *model->features[c]);
        if (!model->features[c])
            return fail(ERR_MEMORY, "no memory for the features of '%s'", thing->name);
        model_channel(thing->picture.rgb, (size_t)model->width * (size_t)model->height, c, plane);
        status = scale_features_detect(plane, model->width, model->height, model->features[c], MODEL_MAX_FEATURES,
                                       &model->feature_count[c]);
    }
    return status;
}

enum status thing_model_make(const struct thing *thing, struct thing_model *out)
{
    const struct image *picture = &thing->picture;
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    *out = (struct thing_model){.width = picture->width, .height = picture->height};
    out->inside = malloc(pixels);
    out->half_px = malloc((size_t)picture->height * sizeof *out->half_px);
    uint8_t *plane = malloc(pixels);
    int32_t *stack = malloc((pixels + 1) * sizeof *stack);
    enum status status = OK;
    if (!out->inside || !out->half_px || !plane || !stack) {
        status = fail(ERR_MEMORY, "no memory for the picture of '%s'", thing->name);
    } else {
        uint8_t color[3];
        memset(out->inside, 1, pixels);
        if (margin_color(picture, plane, color))
            cut_margin(picture, color, out->inside, stack);
        struct extent extent;
        status = find_extent(thing, out, &extent);
        if (status == OK) {
            scale_flat(thing, &extent, out);
            scale_turned(thing, &extent, out);
        }
    }
    if (status == OK)
        status = make_levels(thing, out);
    if (status == OK)
        status = find_features(thing, out, plane);
    free(plane);
    free(stack);
    if (status != OK)
        thing_model_free(out);
    return status;
}

void thing_model_free(struct thing_model *model)
{
    free(model->inside);
    free(model->half_px);
    for (int i = 0; i < MODEL_LEVELS; i++)
        free(model->level[i].rgb);
    for (int i = 0; i < MODEL_CHANNELS; i++)
        free(model->features[i]);
    *model = (struct thing_model){0};
}

static void bilinear(const struct texture_level *level, double x, double y, float out[3])
{
    x = clamp_double(x, 0, level->width - 1);
    y = clamp_double(y, 0, level->height - 1);
    const int x0 = (int)x, y0 = (int)y, x1 = x0 + 1 < level->width ? x0 + 1 : x0,
              y1 = y0 + 1 < level->height ? y0 + 1 : y0;
    const float fx = (float)(x - x0), fy = (float)(y - y0);
    for (int c = 0; c < 3; c++) {
        const float a = level->rgb[(y0 * level->width + x0) * 3 + c], b = level->rgb[(y0 * level->width + x1) * 3 + c];
        const float d = level->rgb[(y1 * level->width + x0) * 3 + c], e = level->rgb[(y1 * level->width + x1) * 3 + c];
        out[c] = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * d + fx * e);
    }
}

// Texture at (x, y) of the full picture, averaged over about `spread` of its pixels: trilinear between levels.
static void texture_at(const struct thing_model *model, double x, double y, double spread, float out[3])
{
    int level = 0;
    double size = 1;
    while (level + 2 < MODEL_LEVELS && size * 2 <= spread) {
        size *= 2;
        level++;
    }
    double share = spread / size - 1;
    if (spread <= 1)
        share = 0;
    else if (spread >= 2 * size)
        share = 1;
    float fine[3], coarse[3];
    bilinear(&model->level[level], (x + 0.5) / size - 0.5, (y + 0.5) / size - 0.5, fine);
    bilinear(&model->level[level + 1], (x + 0.5) / (2 * size) - 0.5, (y + 0.5) / (2 * size) - 0.5, coarse);
    for (int c = 0; c < 3; c++)
        out[c] = (float)((1 - share) * fine[c] + share * coarse[c]);
}

// All pixels within `reach` of (x, y) along both axes show the thing.
static bool well_inside(const struct thing_model *model, double x, double y, double reach)
{
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            const int px = (int)floor(x + i * reach + 0.5), py = (int)floor(y + j * reach + 0.5);
            if (px < 0 || py < 0 || px >= model->width || py >= model->height || !model->inside[py * model->width + px])
                return false;
        }
    return true;
}

// The point of the solid of revolution that the picture shows at (x, y). False: beside it.
static bool turned_point(const struct thing_model *model, double x, double y, struct vec3 *at, struct vec3 *normal,
                         float *facing)
{
    const struct model_scale *s = &model->scale[THING_TURNED];
    const int row = (int)floor(y + 0.5) < model->height ? (int)floor(y + 0.5) : model->height - 1;
    const double px = (x - s->x) * s->metres_per_px, py = (y - s->y) * s->metres_per_px, d = model->distance_m,
                 axis = model->radius_m;
    const double half = model->half_px[row] * s->metres_per_px, r = half * (d + axis) / sqrt(d * d + half * half);
    // the ray (px t, py t, d t - d) meets the circle x^2 + (z - axis)^2 = r^2
    const double a = px * px + d * d, b = d * (d + axis), c = (d + axis) * (d + axis) - r * r, root = b * b - a * c;
    if (!(root > 0) || !(r > 0))
        return false;
    const double t = (b - sqrt(root)) / a;
    *at = v3(px * t, py * t, d * t - d);
    *normal = v3_unit(v3(at->x, 0, at->z - axis));
    *facing = (float)v3_dot(*normal, v3_unit(v3(-px, -py, -d)));
    return true;
}

void thing_sample(const struct thing_model *model, double px_per_metre, int max, struct thing_samples *out)
{
    const struct model_scale *flat = &model->scale[THING_FLAT];
    const double spread = 1 / (px_per_metre * flat->metres_per_px); // picture's pixels for one of the image
    const double area = (double)model->width * model->height;
    double step = spread < 1 ? 1 : spread;
    while (area / (step * step) > max)
        step *= 1.05;
    out->count = 0;
    for (double y = step / 2 - 0.5; y < model->height; y += step)
        for (double x = step / 2 - 0.5; x < model->width && out->count < max; x += step) {
            if (!well_inside(model, x, y, 0.9 * spread + 0.5))
                continue;
            const int i = out->count;
            out->at[THING_FLAT][i] = v3((x - flat->x) * flat->metres_per_px, (y - flat->y) * flat->metres_per_px, 0);
            out->facing[THING_FLAT][i] = 1;
            out->normal[THING_FLAT][i] = v3(0, 0, -1);
            if (!turned_point(model, x, y, &out->at[THING_TURNED][i], &out->normal[THING_TURNED][i],
                              &out->facing[THING_TURNED][i]))
                out->facing[THING_TURNED][i] = 0;
            texture_at(model, x, y, spread, out->color[i]);
            out->count++;
        }
}
