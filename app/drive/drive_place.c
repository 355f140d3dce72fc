#include "app/drive/drive_place.h"

#include <stdio.h>
#include <string.h>

// Its first frame whose joints and whose camera's place are known.
static bool first_figure(const struct take *take, struct skeleton *out)
{
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->located)
            continue;
        *out = skeleton_transform(e->world_from_camera, &e->skeleton);
        return true;
    }
    return false;
}

// A take that cannot be read shows no actor, as one without.
static enum status read_actor(struct drive_place *place, struct recording *recording)
{
    const int count = recording_take_count(recording);
    for (int i = 0; i < count && !place->has_actor; i++) {
        struct take *take;
        const enum status status = take_open(&take, recording, recording_take_name(recording, i));
        if (status == ERR_MEMORY)
            return status;
        place->has_actor = status == OK && first_figure(take, &place->actor);
        take_close(&take);
    }
    return OK;
}

enum status drive_place_open(struct drive_place *p, struct gpu *gpu, const char *file, const struct place *place)
{
    const char *slash = strrchr(file, '/');
    struct recording *recording;
    *p = (struct drive_place){.place = place, .gpu = gpu, .state = room_state_start()};
    snprintf(p->name, sizeof p->name, "%s", slash ? slash + 1 : file);
    room_ui_start(&p->ui);
    enum status status = recording_open(&recording, file);
    if (status == OK)
        status = room_things_open(&p->things, recording);
    if (status == OK)
        status = read_actor(p, recording);
    recording_free(&recording);
    if (status == OK)
        status = solid_renderer_open(&p->renderer, gpu);
    return status == OK ? robot_place_finder_start(&p->finder, place) : status;
}

void drive_place_close(struct drive_place *place)
{
    robot_place_finder_close(&place->finder);
    gpu_target_close(&place->bodies);
    solid_renderer_close(&place->renderer);
    room_things_close(&place->things);
    *place = (struct drive_place){0};
}

void drive_place_update(struct drive_place *place, const struct surroundings *seen)
{
    robot_place_finder_update(place->finder, seen->pictures, seen->taken, &place->answer);
}

// ---------------------------------------------------------------- drawing

static void draw_line(const struct drive_place *place, const struct brush *brush, struct ui_box box)
{
    static const double height = 36;
    const struct robot_place_answer *a = &place->answer;
    char text[480];
    if (a->state == ROBOT_PLACE_FAILED)
        snprintf(text, sizeof text, "The robot is not looked for in %s: %s", place->name, a->trouble);
    else if (a->state == ROBOT_PLACE_TOO_LITTLE)
        snprintf(text, sizeof text, "Too little of the place of %s was seen yet", place->name);
    else
        snprintf(text, sizeof text, "Looking for the robot in the place of %s", place->name);
    const double width = fmin(ui_text_width(brush->ui, FACE_SMALL, text) + 32, box.w - 2 * GAP);
    const struct ui_box pill = {box.x + (box.w - width) / 2, box.y + MARGIN, width, height};
    ui_fill(brush->ui, pill, height / 2, brush->theme->glass);
    label_centred(brush, FACE_SMALL, inner(pill, 8), brush->theme->text, text);
}

static enum status draw_bodies(struct drive_place *place, const struct brush *brush, const struct figure_view *view)
{
    const struct lens *l = &view->lens;
    enum status status = OK;
    if (!place->things.known.count)
        return OK;
    if (!place->bodies || place->bodies_width != l->width || place->bodies_height != l->height) {
        gpu_target_close(&place->bodies);
        place->bodies_width = l->width;
        place->bodies_height = l->height;
        status = gpu_target_open(&place->bodies, place->gpu, l->width, l->height);
    }
    if (status != OK)
        return status;
    gpu_target_clear(place->bodies);
    room_things_draw(&place->things, place->gpu, place->renderer,
                     &(struct solid_view){place->bodies, *l, view->world_from_camera});
    ui_image(brush->ui, gpu_target_texture(place->bodies), figure_image_box(view), (struct ui_uv_rect){0, 0, 1, 1}, 0,
             0xffffffff);
    return OK;
}

enum status drive_place_draw(struct drive_place *p, const struct brush *b, const struct figure_view *view)
{
    const struct ui_box box = figure_image_box(view);
    if (p->answer.state != ROBOT_PLACE_FOUND) {
        draw_line(p, b, box);
        return OK;
    }
    struct room_page page = {.things = p->things.shown,
                             .count = p->things.known.count,
                             .tags = p->place->tags,
                             .tag_count = p->place->tag_count,
                             .map_view = *view,
                             .actor = p->has_actor ? &p->actor : NULL};
    page.map_view.world_from_camera = pose_multiply(p->answer.place_from_world, view->world_from_camera);
    const struct label_view where = {.view = &page.map_view, .number = 1, .bounds = box};
    ui_clip(b->ui, box);
    const enum status status = draw_bodies(p, b, &page.map_view);
    map_overlay_draw(b, &page);
    (void)thing_labels_draw(b, &p->ui, &p->state, &page, &where);
    ui_unclip(b->ui);
    return status;
}
