#include "capture/recording/place.h"

#include <stdlib.h>

void place_tag_corners(const struct place_tag *tag, struct vec3 world[4])
{
    double h = tag->side_m / 2;
    const struct vec3 own[4] = {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}};
    for (int i = 0; i < 4; i++)
        world[i] = pose_apply(tag->world_from_tag, own[i]);
}

void place_free(struct place *place)
{
    for (int32_t i = 0; i < place->view_count; i++) {
        free(place->views[i].jpeg);
        free(place->views[i].depth);
    }
    free(place->views);
    free(place->points);
    free(place->tags);
    *place = (struct place){0};
}
