#include "surround/filmed/filmed_room.h"

#include "platform/files/jpeg.h"
#include "surround/picture/surround_picture.h"

#include <stdlib.h>

enum { DEPTH_STEP = 2 }; // every second row and column of a depth picture

static bool is_usable(const struct place *place, const struct place_view *view)
{
    return view->jpeg && view->depth && place->calibration.depth.width && place->calibration.color.width;
}

int filmed_room_views(const struct place *place)
{
    int count = 0;
    for (int i = 0; i < place->view_count; i++)
        count += is_usable(place, &place->views[i]);
    return count;
}

static enum status take_view(struct surroundings *room, const struct place *place, const struct place_view *view)
{
    struct lens lens = place->calibration.color;
    uint8_t *rgb = malloc((size_t)lens.width * (size_t)lens.height * 3);
    struct surround_picture picture = {0};
    struct depth_points points = {0};
    enum status status = rgb ? jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, lens.width, lens.height)
                             : fail(ERR_MEMORY, "no memory for the filmed room");
    if (status == OK)
        status = surround_image_undistort(rgb, &lens);
    if (status != OK) {
        free(rgb);
        return status;
    }
    status = surround_picture_make(&picture, rgb, lens.width, lens.height, &lens);
    if (status == OK)
        status = depth_points_add(&points, view->depth, &place->calibration.depth, place->calibration.color_from_depth,
                                  DEPTH_STEP);
    if (status == OK)
        status = surroundings_take_placed(room, &picture, &points, view->world_from_camera);
    else
        surround_picture_free(&picture);
    depth_points_free(&points);
    return status;
}

enum status filmed_room_open(struct surroundings *room, const struct place *place, const struct lens *view,
                             const struct surroundings_options *how)
{
    *room = (struct surroundings){0};
    if (!place->calibration.color.width)
        return fail(ERR_INPUT, "the place was filmed without a colour camera, so there is no picture of it to draw");
    enum status status = surroundings_open_live(room, SURROUNDINGS_FILMED, view, POSE_IDENTITY, how);
    for (int i = 0; status == OK && i < place->view_count; i++)
        if (is_usable(place, &place->views[i]) &&
            (status = take_view(room, place, &place->views[i])) == ERR_CORRUPT) // a damaged view costs itself alone
            status = OK;
    if (status != OK)
        surroundings_close(room);
    return status;
}

enum status filmed_room_set_lens(struct surroundings *room, const struct lens *view)
{
    surround_view_close(&room->view);
    return surround_view_open(&room->view, view);
}

enum status filmed_room_trim(struct surroundings *room, struct pose world_from_view, int max)
{
    const struct surround_picture **ranked = malloc((size_t)(room->taken + 1) * sizeof *ranked);
    if (!ranked)
        return fail(ERR_MEMORY, "no memory for the filmed room");
    int count = 0;
    for (int i = 0; i < room->taken; i++)
        if (room->pictures[i].inverse)
            ranked[count++] = &room->pictures[i];
    const enum status status = count > max ? surround_view_rank(world_from_view, ranked, count) : OK;
    for (int i = max; i < count && status == OK; i++) {
        const ptrdiff_t at = ranked[i] - room->pictures;
        free(room->pictures[at].inverse);
        free(room->pictures[at].joined);
        surround_picture_free_mesh(&room->pictures[at]);
        room->pictures[at].inverse = NULL;
        room->pictures[at].joined = NULL;
        room->stale[at] = true;
    }
    free(ranked);
    return status;
}
