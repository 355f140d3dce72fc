#include "objects/thing_view.h"

#include <stdlib.h>

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
