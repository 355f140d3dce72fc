#include "recording/place.h"

#include "platform/files/jpeg.h"

#include <stdlib.h>

void place_tag_corners(const struct place_tag *tag, struct vec3 world[4])
{
    double h = tag->side_m / 2;
    const struct vec3 own[4] = {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}};
    for (int i = 0; i < 4; i++)
        world[i] = pose_apply(tag->world_from_tag, own[i]);
}

static void free_view(struct place_view *view)
{
    free(view->jpeg);
    free(view->depth);
}

enum status place_drop_undecodable_views(struct place *place, int32_t *lost)
{
    const struct lens *lens = &place->calibration.color;
    uint8_t *rgb = malloc((size_t)lens->width * (size_t)lens->height * 3 + 1); // + 1: malloc(0) may be NULL
    enum status status = rgb ? OK : fail(ERR_MEMORY, "no memory for an image");
    int32_t kept = 0, i = 0;
    for (; i < place->view_count && status == OK; i++) {
        struct place_view *view = &place->views[i];
        if (view->jpeg)
            status = jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, lens->width, lens->height);
        if (status == OK)
            place->views[kept++] = *view;
        else if (status == ERR_CORRUPT)
            free_view(view), status = OK;
        else
            break;
    }
    *lost = i - kept;
    while (i < place->view_count) // of which an error left unknown whether they can be decoded
        place->views[kept++] = place->views[i++];
    place->view_count = kept;
    free(rgb);
    return status;
}

void place_free(struct place *place)
{
    for (int32_t i = 0; i < place->view_count; i++)
        free_view(&place->views[i]);
    free(place->views);
    free(place->points);
    free(place->tags);
    *place = (struct place){0};
}
