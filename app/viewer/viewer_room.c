#include "app/viewer/viewer_room.h"

#include "app/viewer/viewer.h"

#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- room things

enum status room_things_open(struct room_things *out, struct recording *recording)
{
    *out = (struct room_things){0};
    const enum status status = place_things_read(recording, &out->known);
    if (status == ERR_MEMORY)
        return status;
    const size_t count = (size_t)out->known.count + 1;
    out->shown = calloc(count, sizeof *out->shown);
    out->solids = calloc(count, sizeof *out->solids);
    out->opened = calloc(count, sizeof *out->opened);
    if (!out->shown || !out->solids || !out->opened)
        return fail(ERR_MEMORY, "no memory for what stands in the room");
    for (int i = 0; i < out->known.count; i++) {
        const struct place_thing *t = &out->known.things[i];
        struct room_thing *s = &out->shown[i];
        *s = (struct room_thing){.name = t->name,
                                 .world_from_thing = t->world_from_thing,
                                 .width_m = t->width_m,
                                 .height_m = t->height_m,
                                 .sigma_m = t->sigma_m,
                                 .gone = t->gone};
        covariance_ellipsoid(&t->covariance, s->ellipsoid);
    }
    return OK;
}

void room_things_close(struct room_things *things)
{
    for (int i = 0; i < things->known.count && things->solids; i++)
        thing_solid_close(&things->solids[i]);
    free(things->shown);
    free(things->solids);
    free(things->opened);
    place_things_free(&things->known);
    *things = (struct room_things){0};
}

// Its body; empty where that cannot be made: the thing stays an outline.
static const struct thing_solid *room_things_solid(struct room_things *things, struct gpu *gpu, int i)
{
    if (!things->opened[i]) {
        things->opened[i] = true; // once: what cannot be opened stays an outline
        if (thing_solid_open(&things->solids[i], gpu, &things->known.things[i]) != OK)
            things->solids[i] = (struct thing_solid){0};
    }
    return &things->solids[i];
}

void room_things_draw(struct room_things *things, struct gpu *gpu, struct solid_renderer *renderer,
                      const struct solid_view *view)
{
    for (int i = 0; i < things->known.count; i++)
        thing_solid_draw(room_things_solid(things, gpu, i), renderer, view, things->known.things[i].world_from_thing);
}

// ---------------------------------------------------------------- viewer room

static const double PI = 3.14159265358979323846;
// Chosen by hand. A moving viewpoint asks for a new picture of the room once it is so far from the one that was asked
// for last; one that has come to rest for STILL_NS asks once more, for exactly its own.
static const double ASK_M = 0.04, ASK_RAD = 0.05;
static const int64_t STILL_NS = 150000000;
static const double PATH_M = 0.05;     // from one point of the tablet's path to the next
static const double TURN_RAD_S = 0.8;  // of the card's body
static const int64_t ANSWER_MS = 5000; // for which a knowledge base is waited for, on its thread
enum { TURNING_PX = 320 };
// A thing becomes hidden where less of it is seen than the first share, and seen again from the second on.
static const double HIDDEN_SHARE = 0.2, SEEN_SHARE = 0.35;
static const double FRONT_M = 0.02;    // asked for so far before its front: the room's surface has it, too, rounded
static const double MIDDLE_RATE = 0.4; // the points lie within so much of its front, from the middle to a side

// ---------------------------------------------------------------- opening

static enum status open_things(struct viewer *viewer)
{
    struct viewer_room *r = &viewer->room;
    const enum status status = room_things_open(&r->things, viewer->recording);
    if (status != OK)
        return status;
    const size_t count = (size_t)r->things.known.count + 1;
    r->pictures = calloc(count, sizeof *r->pictures);
    r->asked = calloc(count, sizeof *r->asked);
    return r->pictures && r->asked ? OK : fail(ERR_MEMORY, "no memory for what stands in the room");
}

enum status viewer_room_open(struct viewer *v)
{
    struct viewer_room *r = &v->room;
    r->asked_thing = ROOM_NOTHING;
    room_ui_start(&v->screens.room);
    if (!v->recording)
        return OK;
    enum status status = open_things(v);
    r->driven = recording_read_drive(v->recording, &r->drive) == OK; // what is damaged of it is no error
    if (status == OK)
        status = solid_renderer_open(&r->renderer, v->gpu);
    if (status == OK && v->options.ask_knowledge && r->things.known.count) {
        struct knowledge_asker_options how = {v->options.file, http_default_limits(), v->options.wake,
                                              v->options.wake_self};
        how.limits.connect_ms = how.limits.total_ms = (int)ANSWER_MS;
        status = knowledge_asker_start(&r->asker, &how);
    }
    v->state.room.thing_count = r->things.known.count;
    v->state.room.has_place = v->has_place || r->things.known.count;
    v->state.room.has_views = v->has_place;
    return status;
}

void viewer_room_close(struct viewer *viewer)
{
    struct viewer_room *r = &viewer->room;
    room_views_close(&r->views);
    room_worker_close(&r->worker);
    knowledge_asker_close(&r->asker);
    filmed_layer_close(&r->filmed);
    solid_mesh_close(&r->mesh);
    for (int i = 0; i < r->things.known.count && r->pictures; i++)
        gpu_texture_close(&r->pictures[i]);
    gpu_target_close(&r->turning);
    gpu_target_close(&r->map);
    gpu_target_close(&r->surface);
    solid_renderer_close(&r->renderer);
    free(r->pictures);
    free(r->asked);
    room_things_close(&r->things);
    *r = (struct viewer_room){0};
}

// ---------------------------------------------------------------- what the threads made

static enum status start_worker(struct viewer *viewer)
{
    struct room_worker_options options = {viewer->options.file, viewer->options.wake, viewer->options.wake_self, false};
    if (viewer->room.worker || !viewer->has_place)
        return OK;
    const enum room_drawing by = viewer->options.room_drawing;
    if (by == ROOM_DRAWN_BY_CARD || (by == ROOM_DRAWN_AS_FITS && !gpu_is_software(viewer->gpu)))
        options.hand_over = room_views_open(&viewer->room.views, viewer->gpu) == OK;
    return room_worker_start(&viewer->room.worker, &options);
}

static enum status take_mesh(struct viewer *viewer)
{
    struct viewer_room *r = &viewer->room;
    struct place_mesh made;
    if (!r->worker || !room_worker_take_mesh(r->worker, &made))
        return OK;
    struct solid_vertex *vertices = malloc(sizeof *vertices * (size_t)made.vertex_count);
    enum status status = vertices ? OK : fail(ERR_MEMORY, "no memory for the map");
    for (int i = 0; i < made.vertex_count && status == OK; i++) {
        const struct place_mesh_vertex *p = &made.vertices[i];
        vertices[i] = (struct solid_vertex){.at = {p->at[0], p->at[1], p->at[2]}, .color = {0, 0, 0, 1}};
        for (int k = 0; k < 3; k++)
            vertices[i].color[k] = (float)p->rgb[k] / 255;
    }
    if (status == OK)
        status = solid_mesh_open(&r->mesh, viewer->gpu, vertices, made.vertex_count, made.corners, made.corner_count);
    free(vertices);
    struct orbit *o = &viewer->state.room.map_orbit; // the whole room is seen
    o->centre = v3_mix(made.low, made.high, 0.5);
    o->distance_m = fmin(fmax(0.95 * v3_distance(made.low, made.high), 3), 12);
    r->mesh_low = made.low;
    r->mesh_high = made.high;
    place_mesh_free(&made);
    r->mesh_came = true;
    r->map_drawn = r->surface_drawn = false;
    viewer->state.changed = true;
    return status;
}

static enum answer answer_about(const struct viewer_room *room, int thing)
{
    if (knowledge_asker_asks(room->asker, thing))
        return ANSWER_ASKING;
    return room->things.known.things[thing].trouble[0] ? ANSWER_NONE : ANSWER_KEPT;
}

static void update_answers(struct viewer *viewer)
{
    struct viewer_room *r = &viewer->room;
    const int card = viewer->state.sheet == SHEET_CARD ? viewer->state.room.card : ROOM_NOTHING;
    if (!r->asker)
        return;
    if (knowledge_asker_take(r->asker, &r->things.known) >= 0)
        viewer->state.changed = true;
    if (card != r->asked_thing && card >= 0 && card < r->things.known.count)
        knowledge_asker_ask(r->asker, card, &r->things.known.things[card]);
    r->asked_thing = card;
    for (int i = 0; i < r->things.known.count; i++)
        r->things.shown[i].answer = answer_about(r, i);
}

static void update_path(struct viewer *viewer)
{
    struct viewer_room *r = &viewer->room;
    const struct camera_frame *f = viewer->frame;
    if (!f || !f->placed)
        return;
    const struct vec3 at = f->world_from_camera.translation;
    if (r->path_count && v3_distance(r->path[r->path_count - 1], at) < PATH_M)
        return;
    if (r->path_count == VIEWER_PATH_MAX) { // every second point of the older half goes
        int kept = 0;
        for (int i = 0; i < VIEWER_PATH_MAX; i++)
            if (i >= VIEWER_PATH_MAX / 2 || i % 2)
                r->path[kept++] = r->path[i];
        r->path_count = kept;
    }
    r->path[r->path_count++] = at;
}

void viewer_room_update(struct viewer *viewer, int64_t now_ns)
{
    const struct view_state *s = &viewer->state;
    (void)now_ns;
    update_path(viewer);
    update_answers(viewer);
    if (s->page != PAGE_WATCH || !viewer->take_view || !viewer->has_image) // the actor comes first
        return;
    if ((viewer_room_wants_filmed(viewer) || s->room.map) && start_worker(viewer) != OK)
        viewer->state.room.filmed = false; // without memory for a thread there is no room
    int views;
    if (viewer->room.worker && room_worker_idle(viewer->room.worker, &views) && !views)
        viewer->state.room.has_views = false;
    const struct room_picture *p = viewer->room.worker ? room_worker_latest(viewer->room.worker) : NULL;
    if (p && viewer_room_wants_filmed(viewer) && p->number != viewer->room.seen_number) {
        viewer->room.seen_number = p->number;
        viewer->state.changed = true;
    }
    float gains[ROOM_DEPTHS][3];
    const int64_t number = viewer->room.views ? room_worker_gains(viewer->room.worker, gains) : 0;
    if (number != viewer->room.seen_number && viewer->room.views && viewer_room_wants_filmed(viewer)) {
        viewer->room.seen_number = number;
        viewer->state.changed = true;
    }
    if (take_mesh(viewer) != OK)
        viewer->room.mesh_came = true; // it stays without a surface
    if (s->sheet == SHEET_CARD)
        viewer->state.changed = true; // the body turns
}

// ---------------------------------------------------------------- the filmed room

bool viewer_room_wants_filmed(const struct viewer *viewer)
{
    const struct view_state *s = &viewer->state;
    return s->page == PAGE_WATCH && s->orbiting && s->room.filmed && s->room.has_views &&
           take_view_is_located(viewer->take_view);
}

static bool are_poses_near(const struct pose *a, const struct pose *b, double m, double rad)
{
    return v3_distance(a->translation, b->translation) <= m && pose_angle(*a, *b) <= rad;
}

static void ask_worker(struct viewer *viewer, const struct take_view_request *request, int64_t now_ns)
{
    struct viewer_room *r = &viewer->room;
    const struct pose *pose = &request->world_from_camera;
    const bool first = !r->asked_lens.width, same_lens = lens_equal(&r->asked_lens, &request->lens);
    if (!are_poses_near(&r->seen_pose, pose, 1e-6, 1e-6)) {
        r->seen_pose = *pose;
        r->still_ns = now_ns;
    }
    const bool still = now_ns - r->still_ns >= STILL_NS,
               exact = are_poses_near(&r->asked_pose, pose, 1e-6, 1e-6) && same_lens;
    if (!exact && !still)
        viewer->state.changed = true; // to look again
    if (!first && (exact || (!still && are_poses_near(&r->asked_pose, pose, ASK_M, ASK_RAD))))
        return;
    room_worker_ask(r->worker, &request->lens, *pose);
    r->asked_lens = request->lens;
    r->asked_pose = *pose;
}

enum status viewer_room_draw_filmed(struct viewer *v, const struct take_view_request *request, int64_t now_ns,
                                    const struct gpu_texture **out)
{
    struct viewer_room *r = &v->room;
    enum status status = OK;
    *out = NULL;
    if (!viewer_room_wants_filmed(v) || !r->worker)
        return OK;
    ask_worker(v, request, now_ns);
    if (r->views) {
        status = room_views_draw(r->views, r->worker, &request->lens, request->world_from_camera, out);
        v->state.changed |= room_views_more(r->views);
        return status;
    }
    const struct room_picture *p = room_worker_latest(r->worker);
    if (!p)
        return OK;
    if (!r->filmed)
        status = filmed_layer_open(&r->filmed, v->gpu);
    if (status != OK)
        return status;
    return filmed_layer_draw(r->filmed, r->renderer, p, &request->lens, request->world_from_camera, out);
}

// Of the view's size. What it shows is as coarse as the map: the recorded views lie over it.
enum status viewer_room_draw_surface(struct viewer *v, const struct take_view_request *request,
                                     struct take_view_image *out)
{
    struct viewer_room *r = &v->room;
    const struct lens *lens = &request->lens;
    enum status status = OK;
    if (!viewer_room_wants_filmed(v) || !r->mesh)
        return OK;
    if (!r->surface || !lens_equal(lens, &r->surface_lens)) {
        gpu_target_close(&r->surface);
        status = gpu_target_open(&r->surface, v->gpu, lens->width, lens->height);
        r->surface_drawn = false;
        r->surface_lens = *lens;
    }
    if (status != OK)
        return status;
    if (!r->surface_drawn || !are_poses_near(&r->surface_pose, &request->world_from_camera, 1e-9, 1e-9)) {
        const struct solid_view view = {r->surface, *lens, request->world_from_camera};
        gpu_target_clear(r->surface);
        solid_renderer_draw(r->renderer, &view, r->mesh, &(struct solid_look){POSE_IDENTITY, 1, NULL, true});
        r->surface_pose = request->world_from_camera;
        r->surface_drawn = true;
    }
    out->surface = gpu_target_texture(r->surface);
    out->room_low = r->mesh_low;
    out->room_high = r->mesh_high;
    return OK;
}

// ---------------------------------------------------------------- what hides things

// Points of the thing's front, moved towards the viewer: by the surface's own error, and, where the viewer looks at its
// back, by its width: the thing does not hide itself.
static void put_points(const struct room_thing *thing, struct vec3 eye, struct overlay_group *out)
{
    const struct vec3 middle = thing->world_from_thing.translation, to_eye = v3_unit(v3_sub(eye, middle));
    const struct vec3 back = quat_rotate(thing->world_from_thing.rotation, v3(0, 0, 1));
    const double behind = fmax(0, v3_dot(to_eye, back));
    const double towards_m =
        fmin(FRONT_M + behind * fmin(thing->width_m, thing->height_m), v3_distance(eye, middle) / 2);
    for (int i = 0; i < OVERLAY_POINTS; i++) {
        const struct vec3 at =
            v3((i % 3 - 1) * MIDDLE_RATE * thing->width_m, (i / 3 - 1) * MIDDLE_RATE * thing->height_m, 0);
        out->point[i] = v3_add(pose_apply(thing->world_from_thing, at), v3_scale(to_eye, towards_m));
    }
}

void viewer_room_ask_seen(struct viewer *viewer, struct take_view_request *request)
{
    struct viewer_room *r = &viewer->room;
    const int count = r->things.known.count < ROOM_LABELS_MAX ? r->things.known.count : ROOM_LABELS_MAX;
    _Static_assert(OVERLAY_POINTS == 9, "3 x 3");
    _Static_assert((int)ROOM_LABELS_MAX <= (int)OVERLAY_GROUPS_MAX, "each label is asked for");
    if (!viewer->state.room.names || !count || request->camera_lost || !take_view_is_located(viewer->take_view))
        return;
    for (int i = 0; i < count; i++)
        put_points(&r->things.shown[i], request->world_from_camera.translation, &r->asked[i]);
    r->overlay = (struct overlay){.groups = r->asked, .group_count = count};
    request->overlay = &r->overlay;
}

enum status viewer_room_read_seen(struct viewer *v)
{
    struct viewer_room *r = &v->room;
    float share[OVERLAY_GROUPS_MAX];
    int count;
    if (!r->seen_comes)
        return OK;
    r->seen_comes = false;
    const enum status status = take_view_read_seen(v->take_view, share, &count);
    for (int i = 0; i < count && i < r->things.known.count && status == OK; i++) {
        const bool hidden = share[i] < (r->things.shown[i].hidden ? SEEN_SHARE : HIDDEN_SHARE);
        v->state.changed |= hidden != r->things.shown[i].hidden;
        r->things.shown[i].hidden = hidden;
    }
    return status;
}

// ---------------------------------------------------------------- the map

// The middle is a little above that of the box, whose lower part the controls may cover.
static struct lens lens_of_map(int width, int height)
{
    const double f = 0.9 * (width < height ? width : height);
    return (struct lens){
        .width = width, .height = height, .fx = f, .fy = f, .cx = (width - 1) / 2.0, .cy = 0.42 * height};
}

static enum status draw_map(struct viewer *viewer, struct ui_box box, double px_per_dp)
{
    struct viewer_room *r = &viewer->room;
    const struct lens lens = lens_of_map((int)fmax(box.w * px_per_dp, 16), (int)fmax(box.h * px_per_dp, 16));
    const struct pose pose = orbit_world_from_camera(&viewer->state.room.map_orbit);
    enum status status = OK;
    r->page.map_view = (struct figure_view){lens, pose, {1 / px_per_dp, box.x, box.y}, false};
    if (!r->map || !lens_equal(&lens, &r->map_lens)) {
        gpu_target_close(&r->map);
        status = gpu_target_open(&r->map, viewer->gpu, lens.width, lens.height);
        r->map_drawn = false;
        r->map_lens = lens;
    }
    if (status != OK)
        return status;
    if (!r->map_drawn || !are_poses_near(&r->map_pose, &pose, 0, 0)) {
        const struct solid_view view = {r->map, lens, pose};
        gpu_target_clear(r->map);
        if (r->mesh)
            solid_renderer_draw(r->renderer, &view, r->mesh, &(struct solid_look){POSE_IDENTITY, 1, NULL, true});
        room_things_draw(&r->things, viewer->gpu, r->renderer, &view);
        r->map_pose = pose;
        r->map_drawn = true;
    }
    r->page.map = gpu_target_texture(r->map);
    r->page.map_is_coming = viewer->has_place && !r->mesh_came;
    return OK;
}

static void fill_viewer(struct viewer *viewer)
{
    struct room_page *p = &viewer->room.page;
    const struct camera_frame *f = viewer->frame;
    p->path = viewer->room.path;
    p->path_count = viewer->room.path_count;
    if (f && f->placed && !viewer->state.orbiting) {
        p->viewer_known = true;
        p->world_from_viewer = f->world_from_camera;
        p->viewer_lens = f->lens;
    } else if (viewer->state.orbiting && viewer->has_image && take_view_is_located(viewer->take_view)) {
        p->viewer_known = true;
        p->world_from_viewer = viewer->image.world_from_camera;
        p->viewer_lens = viewer->image.lens;
    }
}

// ---------------------------------------------------------------- the card

static void describe_source(struct viewer *viewer, int i)
{
    struct viewer_room *r = &viewer->room;
    const struct place_thing *t = &r->things.known.things[i];
    const enum answer answer = r->things.shown[i].answer;
    r->card.source_warns = answer == ANSWER_NONE || t->gone;
    if (answer == ANSWER_ASKING)
        snprintf(r->source, sizeof r->source, "Asking for what is newer …");
    else if (answer == ANSWER_NONE)
        snprintf(r->source, sizeof r->source, "%s%s", t->known ? "Kept in the recording; nothing newer came: " : "",
                 t->trouble);
    else if (t->gone)
        snprintf(r->source, sizeof r->source, "It was not found where it stood.");
    else if (t->unkept)
        snprintf(r->source, sizeof r->source,
                 "From its server; the recording cannot be written, so it is forgotten when this is closed.");
    else if (t->known)
        snprintf(r->source, sizeof r->source, "Kept in the recording.");
    else
        snprintf(r->source, sizeof r->source, "Nothing more is known of it.");
    r->card.source = r->source;
}

static enum status open_picture(struct viewer *viewer, int i)
{
    const struct image *image = &viewer->room.things.known.things[i].picture;
    if (viewer->room.pictures[i] || !image->width || image->width > gpu_max_size(viewer->gpu) ||
        image->height > gpu_max_size(viewer->gpu))
        return OK;
    const struct gpu_texture_layout how = {GPU_RGB8, image->width, image->height, GPU_LINEAR};
    return gpu_texture_open(&viewer->room.pictures[i], viewer->gpu, &how, image->rgb);
}

static enum status draw_card(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_room *r = &viewer->room;
    const int i = viewer->state.room.card;
    if (viewer->state.sheet != SHEET_CARD || i < 0 || i >= r->things.known.count)
        return OK;
    const struct place_thing *t = &r->things.known.things[i];
    const struct thing_knowledge *k = &t->knowledge;
    enum status status = open_picture(viewer, i);
    if (status == OK && !r->turning)
        status = gpu_target_open(&r->turning, viewer->gpu, TURNING_PX, TURNING_PX);
    if (status != OK)
        return status;
    const double angle = TURN_RAD_S * (double)(now_ns % 1000000000000) * 1e-9;
    thing_solid_draw_turning(room_things_solid(&r->things, viewer->gpu, i), r->renderer, r->turning,
                             fmod(angle, 2 * PI));
    r->card =
        (struct thing_card){.name = k->name[0] ? k->name : t->name,
                            .description = k->description,
                            .weight = k->weight,
                            .material = k->material,
                            .instructions = k->instructions,
                            .note = t->note,
                            .picture = r->pictures[i],
                            .picture_aspect = t->picture.height ? (double)t->picture.width / t->picture.height : 1,
                            .body = gpu_target_texture(r->turning),
                            .is_model = r->things.solids[i].is_model};
    describe_source(viewer, i);
    r->page.card = &r->card;
    return OK;
}

enum status viewer_room_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns)
{
    struct viewer_room *r = &v->room;
    const double px = surface->px_per_dp;
    const struct layout l = layout_of(surface->width / px, surface->height / px, &v->state, &v->image);
    r->page = (struct room_page){.things = r->things.shown,
                                 .count = r->things.known.count,
                                 .tags = v->place.tags,
                                 .tag_count = v->place.tag_count};
    if (r->driven)
        r->page.drive = &r->drive;
    r->page.apart = !take_view_is_located(v->take_view);
    if (v->image.has_skeleton && take_view_is_located(v->take_view))
        r->page.actor = &v->image.skeleton;
    enum status status = draw_card(v, now_ns);
    if (status == OK && l.map.w > 0) {
        fill_viewer(v);
        status = draw_map(v, l.map, px);
    }
    return status;
}
