#include "app/commands/filmed_path.h"

#include "platform/jpeg.h"

#include <stdlib.h>

static enum status take_view(struct filmed_path *p, const struct place *place, const struct place_view *view)
{
    struct lens lens = place->calibration.color;
    uint8_t *rgb = malloc((size_t)lens.width * (size_t)lens.height * 3);
    struct surround_picture picture = {0};
    struct depth_points points = {0};
    enum status status = rgb ? jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, lens.width, lens.height)
                             : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = surround_image_undistort(rgb, &lens);
    if (status != OK) {
        free(rgb);
        return status;
    }
    status = surround_picture_make(&picture, rgb, lens.width, lens.height, &lens);
    if (status == OK)
        status =
            depth_points_add(&points, view->depth, &place->calibration.depth, place->calibration.color_from_depth, 2);
    if (status == OK)
        status = surroundings_take_placed(&p->room, &picture, &points, view->world_from_camera);
    else
        surround_picture_free(&picture);
    depth_points_free(&points);
    return status;
}

enum status filmed_path_open(struct filmed_path *p, const struct place *place, const char *path)
{
    *p = (struct filmed_path){.lens = place->calibration.color};
    struct lens *lens = &p->lens;
    lens->k1 = lens->k2 = lens->p1 = lens->p2 = lens->k3 = lens->readout_s = lens->focal_sigma = 0;
    if (!lens->width)
        return fail(ERR_INPUT, "the place was filmed without a colour camera, so there is no picture of it to draw");
    enum status status = pose_list_read(path, &p->poses, &p->count);
    if (status == OK)
        status = surroundings_open_live(&p->room, SURROUNDINGS_FILMED, lens, POSE_IDENTITY, NULL);
    for (int i = 0; status == OK && i < place->view_count; i++)
        if (place->views[i].jpeg && place->views[i].depth && place->calibration.depth.width)
            status = take_view(p, place, &place->views[i]);
    if (status != OK)
        filmed_path_close(p);
    return status;
}

void filmed_path_close(struct filmed_path *p)
{
    surroundings_close(&p->room);
    free(p->poses);
    *p = (struct filmed_path){0};
}

enum status filmed_path_draw(struct filmed_path *p, int i) { return surroundings_draw(&p->room, p->poses[i].pose); }
