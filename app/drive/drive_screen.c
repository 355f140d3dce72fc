#include "app/drive/drive_screen.h"

#include "app/drive/drive_controls.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the recorded place

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

// Borrows the place, which is the recording's. As recording_open and take_open; ERR_MEMORY, ERR_DEVICE. On error
// drive_place_close is needed, too.
static enum status drive_place_open(struct drive_place *drive_place, struct gpu *gpu, const char *file,
                                    const struct place *place)
{
    const char *slash = strrchr(file, '/');
    struct recording *recording;
    *drive_place = (struct drive_place){.place = place, .gpu = gpu, .state = room_state_start()};
    snprintf(drive_place->name, sizeof drive_place->name, "%s", slash ? slash + 1 : file);
    room_ui_start(&drive_place->ui);
    enum status status = recording_open(&recording, file);
    if (status == OK)
        status = room_things_open(&drive_place->things, recording);
    if (status == OK)
        status = read_actor(drive_place, recording);
    recording_free(&recording);
    if (status == OK)
        status = solid_renderer_open(&drive_place->renderer, gpu);
    return status == OK ? robot_place_finder_start(&drive_place->finder, place) : status;
}

// Before the surroundings that it was updated with are closed. Zeroed is fine.
static void drive_place_close(struct drive_place *place)
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

// ---------------------------------------------------------------- the place drawn

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

// view: of the image that is drawn already, in the robot's world; nothing is drawn beside it. ERR_DEVICE, ERR_MEMORY.
static enum status drive_place_draw(struct drive_place *place, const struct brush *brush,
                                    const struct figure_view *view)
{
    const struct ui_box box = figure_image_box(view);
    if (place->answer.state != ROBOT_PLACE_FOUND) {
        draw_line(place, brush, box);
        return OK;
    }
    struct room_page page = {.things = place->things.shown,
                             .count = place->things.known.count,
                             .tags = place->place->tags,
                             .tag_count = place->place->tag_count,
                             .map_view = *view,
                             .actor = place->has_actor ? &place->actor : NULL};
    page.map_view.world_from_camera = pose_multiply(place->answer.place_from_world, view->world_from_camera);
    const struct label_view where = {.view = &page.map_view, .number = 1, .bounds = box};
    ui_clip(brush->ui, box);
    const enum status status = draw_bodies(place, brush, &page.map_view);
    map_overlay_draw(brush, &page);
    (void)thing_labels_draw(brush, &place->ui, &place->state, &page, &where);
    ui_unclip(brush->ui);
    return status;
}

// ---------------------------------------------------------------- opening

enum status drive_screen_open(struct drive_screen *screen, struct gpu *gpu, struct drive_session *session,
                              const char *file, const struct place *place)
{
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    *screen = (struct drive_screen){.session = session,
                                    .gpu = gpu,
                                    .by_card = true,
                                    .has_place = file,
                                    .map_eye = {.orbit = true, .elevation = 1.1, .distance_m = 5}}; // chosen by hand
    const enum status status = ui_open(&screen->ui, gpu, &shaders, theme_faces(), FACE_COUNT);
    return status == OK && file ? drive_place_open(&screen->place, gpu, file, place) : status;
}

void drive_screen_close(struct drive_screen *screen)
{
    drive_place_close(&screen->place);
    for (int k = 0; k < DRIVE_PANES; k++) {
        operator_picture_close(&screen->pane[k].picture);
        gpu_texture_close(&screen->pane[k].texture);
    }
    ui_close(&screen->ui);
    *screen = (struct drive_screen){0};
}

struct ui_box drive_screen_box(const struct drive_screen *screen, double width, double height, int pane)
{
    const double share = screen->map ? 0.5 : 1, first = pane == DRIVE_MAP ? 0.5 : 0;
    return width >= height ? (struct ui_box){first * width, 0, share * width, height}
                           : (struct ui_box){0, first * height, width, share * height};
}

struct drive_eye *drive_screen_eye(struct drive_screen *screen, int pane)
{
    return pane == DRIVE_MAP ? &screen->map_eye : &screen->session->eye;
}

// ---------------------------------------------------------------- the panes' pictures

// In the pane's size; where the driver draws by the processor as fine as the session's own picture, and all of that.
static enum status draw_by_card(struct drive_screen *screen, const struct viewer_surface *surface, int pane)
{
    struct drive_pane *p = &screen->pane[pane];
    const struct lens *own = drive_session_lens(screen->session);
    const struct ui_box box = drive_screen_box(screen, surface->width, surface->height, pane);
    const double fit = fmax(own->width / box.w, own->height / box.h); // the session's picture in the pane
    const double share = gpu_is_software(screen->gpu) ? fmin(1, fit) : 1;
    const int width = (int)(share * box.w), height = (int)(share * box.h);
    enum status status = p->picture ? OK : operator_picture_open(&p->picture, screen->gpu);
    if (status == OK)
        status = operator_picture_draw(p->picture, screen->session, width, height, &p->shown);
    if (status == OK)
        operator_picture_view(p->picture, &p->lens, &p->world_from_view);
    if (status != ERR_DEVICE)
        return status;
    screen->by_card = false; // from now on by the processor
    for (int k = 0; k < DRIVE_PANES; k++) {
        operator_picture_close(&screen->pane[k].picture);
        screen->pane[k].shown = NULL;
    }
    return OK;
}

static enum status draw_by_processor(struct drive_screen *screen, int pane)
{
    struct drive_pane *p = &screen->pane[pane];
    const struct surround_view *view;
    enum status status = drive_session_draw(screen->session, &view);
    if (status != OK)
        return status;
    const struct gpu_texture_layout layout = {GPU_RGB8, view->lens.width, view->lens.height, GPU_LINEAR};
    status = gpu_texture_put(&p->texture, screen->gpu, &layout, view->rgb);
    p->shown = p->texture;
    p->lens = view->lens;
    p->world_from_view = view->world_from_view;
    return status;
}

static enum status draw_panes(struct drive_screen *screen, const struct viewer_surface *surface)
{
    const struct drive_eye eye = screen->session->eye;
    enum status status = OK;
    bool near = false;
    double nearest_m = INFINITY;
    screen->session->wordless = screen->controls;
    for (int k = 0; k < (screen->map ? DRIVE_PANES : 1) && status == OK; k++) {
        screen->session->eye = k == DRIVE_MAP ? screen->map_eye : eye;
        status = screen->by_card ? draw_by_card(screen, surface, k) : draw_by_processor(screen, k);
        if (screen->session->near) // in one of them
            nearest_m = fmin(nearest_m, screen->session->nearest_m);
        near |= screen->session->near;
    }
    screen->session->eye = eye;
    screen->session->near = near;
    screen->session->nearest_m = nearest_m;
    return status;
}

// ---------------------------------------------------------------- the screen

// In the middle of its box, as large as fits.
static struct figure_view view_of(const struct drive_pane *pane, struct ui_box box)
{
    const double scale = fmin(box.w / pane->lens.width, box.h / pane->lens.height); // dp a pixel
    const struct cover cover = {scale, box.x + (box.w - scale * pane->lens.width) / 2,
                                box.y + (box.h - scale * pane->lens.height) / 2};
    return (struct figure_view){pane->lens, pane->world_from_view, cover, false};
}

static enum status draw_pane(struct drive_screen *screen, const struct brush *brush, int pane)
{
    const struct drive_pane *p = &screen->pane[pane];
    const struct ui_box box = drive_screen_box(screen, ui_width(brush->ui), ui_height(brush->ui), pane);
    if (!p->shown)
        return OK;
    const struct figure_view view = view_of(p, box);
    ui_image(brush->ui, p->shown, figure_image_box(&view), (struct ui_uv_rect){0, 0, 1, 1}, 0, 0xffffffff);
    return pane == DRIVE_MAP && screen->has_place ? drive_place_draw(&screen->place, brush, &view) : OK;
}

enum status drive_screen_draw(struct drive_screen *screen, const struct viewer_surface *surface, int64_t now_ns)
{
    const struct ui_input input = {
        .width_px = surface->width, .height_px = surface->height, .px_per_dp = surface->px_per_dp, .now_ns = now_ns};
    const struct brush brush = {screen->ui, theme_of(true), NULL};
    enum status status = draw_panes(screen, surface);
    if (status == OK && screen->has_place)
        drive_place_update(&screen->place, drive_session_surroundings(screen->session));
    if (status == OK)
        status = ui_begin(screen->ui, &input);
    if (status != OK)
        return status;
    for (int k = 0; k < (screen->map ? DRIVE_PANES : 1) && status == OK; k++)
        status = draw_pane(screen, &brush, k);
    if (screen->controls && status == OK) {
        const struct drive_readings readings = drive_session_readings(screen->session);
        drive_controls_draw(screen->controls, &readings, screen->session->eye.viewpoint, screen->map, &brush);
    }
    ui_end(screen->ui);
    return status == OK ? ui_draw(screen->ui, surface->target, surface->quarter_turns) : status;
}
