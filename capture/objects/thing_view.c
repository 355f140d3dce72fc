#include "capture/objects/thing_view.h"

#include <stdlib.h>

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

static enum status find_features(const uint8_t *rgb, struct thing_view *v)
{
    const size_t pixels = (size_t)v->lens.width * (size_t)v->lens.height;
    uint8_t *plane = malloc(pixels);
    enum status status = plane ? OK : fail(ERR_MEMORY, "no memory for an image's features");
    for (int c = 0; c < MODEL_CHANNELS && status == OK; c++) {
        v->features[c] = malloc(VIEW_MOST_FEATURES * sizeof *v->features[c]);
        if (!v->features[c]) {
            status = fail(ERR_MEMORY, "no memory for an image's features");
            break;
        }
        model_channel(rgb, pixels, c, plane);
        status = scale_features_detect(plane, v->lens.width, v->lens.height, v->features[c], VIEW_MOST_FEATURES,
                                       &v->feature_count[c]);
    }
    free(plane);
    return status;
}

enum status thing_view_make(const struct lens *lens, const struct pose *camera_from_left, const uint8_t *rgb,
                            bool features, struct thing_view *out)
{
    const size_t n = (size_t)lens->width * (size_t)lens->height * 3;
    *out =
        (struct thing_view){.lens = *lens, .largest_r2 = lens_max_radius2(lens), .camera_from_left = *camera_from_left};
    out->level[0] = (struct texture_level){lens->width, lens->height, malloc(n * sizeof *out->level[0].rgb)};
    enum status status = out->level[0].rgb ? OK : fail(ERR_MEMORY, "no memory for an image");
    for (size_t i = 0; i < n && status == OK; i++)
        out->level[0].rgb[i] = rgb[i];
    if (status == OK)
        status = texture_pyramid(out->level, VIEW_LEVELS);
    if (status == OK && features)
        status = find_features(rgb, out);
    if (status != OK)
        thing_view_free(out);
    return status;
}

void thing_view_free(struct thing_view *v)
{
    for (int i = 0; i < VIEW_LEVELS; i++)
        free(v->level[i].rgb);
    for (int i = 0; i < MODEL_CHANNELS; i++)
        free(v->features[i]);
    *v = (struct thing_view){0};
}
