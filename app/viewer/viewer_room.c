// The viewer's part for the room about the actor.
#include "app/place/room_worker.h"
#include "app/viewer/room_things.h"
#include "app/viewer/viewer_inside.h"
#include "app/viewer/viewer_parts.h"
#include "recording/recorded_things.h"

#include <stdio.h>
#include <stdlib.h>

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

enum { PATH_POINTS = 512 };

struct viewer_room {
    struct viewer_shared *shared;
    struct room_things things;
    struct gpu_texture **pictures; // of each thing, opened when first shown
    struct overlay_group *asked;   // points of each, of which is asked whether they are seen
    struct overlay overlay;
    bool seen_comes; // what was asked has not been read yet
    struct solid_renderer *renderer;
    struct gpu_target *turning; // the card's body

    struct room_worker *worker;
    struct room_views *views; // NULL: the worker draws, and `filmed` shows that
    struct filmed_layer *filmed;
    struct lens asked_lens; // of the worker
    struct pose asked_pose, seen_pose;
    int64_t seen_number; // of the worker's picture at the last update
    int64_t still_ns;    // since when the viewpoint has not moved

    struct solid_mesh *mesh;         // of the place
    struct vec3 mesh_low, mesh_high; // its bounds
    bool mesh_came;
    struct gpu_target *surface; // the mesh behind the orbit
    struct lens surface_lens;
    struct pose surface_pose; // that it shows
    bool surface_drawn;
    struct gpu_target *map;
    struct lens map_lens;
    struct pose map_pose; // that the map shows
    bool map_drawn;
    struct vec3 path[PATH_POINTS];
    int path_count;
    struct recorded_drive drive;
    bool driven; // a robot was, in the place

    struct knowledge_asker *asker;
    int asked_thing; // whose card was open at the last update
    struct thing_card card;
    char source[320];
    struct room_page page;
};

// ---------------------------------------------------------------- opening

static enum status open_things(struct viewer_room *room)
{
    const enum status status = room_things_open(&room->things, room->shared->recording);
    if (status != OK)
        return status;
    const size_t count = (size_t)room->things.known.count + 1;
    room->pictures = calloc(count, sizeof *room->pictures);
    room->asked = calloc(count, sizeof *room->asked);
    return room->pictures && room->asked ? OK : fail(ERR_MEMORY, "no memory for what stands in the room");
}

static enum status open_room(struct viewer_room *room)
{
    struct viewer_shared *shared = room->shared;
    enum status status = open_things(room);
    room->driven = recording_read_drive(shared->recording, &room->drive) == OK; // what is damaged of it is no error
    if (status == OK)
        status = solid_renderer_open(&room->renderer, shared->gpu);
    if (status == OK && shared->options.ask_knowledge && room->things.known.count) {
        struct knowledge_asker_options how = {shared->options.file, http_default_limits(), shared->options.wake,
                                              shared->options.wake_self};
        how.limits.connect_ms = how.limits.total_ms = (int)ANSWER_MS;
        status = knowledge_asker_start(&room->asker, &how);
    }
    shared->state.room.thing_count = room->things.known.count;
    shared->state.room.has_place = shared->has_place || room->things.known.count;
    shared->state.room.has_views = shared->has_place;
    return status;
}

enum status viewer_room_open(struct viewer_room **out, struct viewer_shared *shared)
{
    struct viewer_room *r = *out = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for the room");
    r->shared = shared;
    r->asked_thing = ROOM_NOTHING;
    room_ui_start(&shared->screens.room);
    const enum status status = shared->recording ? open_room(r) : OK;
    if (status != OK)
        viewer_room_close(out);
    return status;
}

void viewer_room_close(struct viewer_room **room)
{
    struct viewer_room *r = *room;
    if (!r)
        return;
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
    free(r);
    *room = NULL;
}

// ---------------------------------------------------------------- what the threads made

static enum status start_worker(struct viewer_room *room)
{
    struct room_worker_options options = {room->shared->options.file, room->shared->options.wake,
                                          room->shared->options.wake_self, false};
    if (room->worker || !room->shared->has_place)
        return OK;
    const enum room_drawing by = room->shared->options.room_drawing;
    if (by == ROOM_DRAWN_BY_CARD || (by == ROOM_DRAWN_AS_FITS && !gpu_is_software(room->shared->gpu)))
        options.hand_over = room_views_open(&room->views, room->shared->gpu) == OK;
    return room_worker_start(&room->worker, &options);
}

static enum status take_mesh(struct viewer_room *room)
{
    struct place_mesh made;
    if (!room->worker || !room_worker_take_mesh(room->worker, &made))
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
        status = solid_mesh_open(&room->mesh, room->shared->gpu, vertices, made.vertex_count, made.corners,
                                 made.corner_count);
    free(vertices);
    struct orbit *o = &room->shared->state.room.map_orbit; // the whole room is seen
    o->centre = v3_mix(made.low, made.high, 0.5);
    o->distance_m = fmin(fmax(0.95 * v3_distance(made.low, made.high), 3), 12);
    room->mesh_low = made.low;
    room->mesh_high = made.high;
    place_mesh_free(&made);
    room->mesh_came = true;
    room->map_drawn = room->surface_drawn = false;
    room->shared->state.changed = true;
    return status;
}

static enum answer answer_about(const struct viewer_room *room, int thing)
{
    if (knowledge_asker_asks(room->asker, thing))
        return ANSWER_ASKING;
    return room->things.known.things[thing].trouble[0] ? ANSWER_NONE : ANSWER_KEPT;
}

static void update_answers(struct viewer_room *room)
{
    const int card = room->shared->state.sheet == SHEET_CARD ? room->shared->state.room.card : ROOM_NOTHING;
    if (!room->asker)
        return;
    if (knowledge_asker_take(room->asker, &room->things.known) >= 0)
        room->shared->state.changed = true;
    if (card != room->asked_thing && card >= 0 && card < room->things.known.count)
        knowledge_asker_ask(room->asker, card, &room->things.known.things[card]);
    room->asked_thing = card;
    for (int i = 0; i < room->things.known.count; i++)
        room->things.shown[i].answer = answer_about(room, i);
}

static void update_path(struct viewer_room *room)
{
    const struct camera_frame *f = room->shared->frame;
    if (!f || !f->placed)
        return;
    const struct vec3 at = f->world_from_camera.translation;
    if (room->path_count && v3_distance(room->path[room->path_count - 1], at) < PATH_M)
        return;
    if (room->path_count == PATH_POINTS) { // every second point of the older half goes
        int kept = 0;
        for (int i = 0; i < PATH_POINTS; i++)
            if (i >= PATH_POINTS / 2 || i % 2)
                room->path[kept++] = room->path[i];
        room->path_count = kept;
    }
    room->path[room->path_count++] = at;
}

void viewer_room_update(struct viewer_room *room)
{
    const struct view_state *s = &room->shared->state;
    update_path(room);
    update_answers(room);
    if (s->page != PAGE_WATCH || !room->shared->take_view || !room->shared->has_image) // the actor comes first
        return;
    if ((viewer_room_wants_filmed(room) || s->room.map) && start_worker(room) != OK)
        room->shared->state.room.filmed = false; // without memory for a thread there is no room
    int views;
    if (room->worker && room_worker_idle(room->worker, &views) && !views)
        room->shared->state.room.has_views = false;
    const struct room_picture *p = room->worker ? room_worker_latest(room->worker) : NULL;
    if (p && viewer_room_wants_filmed(room) && p->number != room->seen_number) {
        room->seen_number = p->number;
        room->shared->state.changed = true;
    }
    float gains[ROOM_DEPTHS][3];
    const int64_t number = room->views ? room_worker_gains(room->worker, gains) : 0;
    if (number != room->seen_number && room->views && viewer_room_wants_filmed(room)) {
        room->seen_number = number;
        room->shared->state.changed = true;
    }
    if (take_mesh(room) != OK)
        room->mesh_came = true; // it stays without a surface
    if (s->sheet == SHEET_CARD)
        room->shared->state.changed = true; // the body turns
}

// ---------------------------------------------------------------- the filmed room

bool viewer_room_wants_filmed(const struct viewer_room *room)
{
    const struct view_state *s = &room->shared->state;
    return s->page == PAGE_WATCH && s->orbiting && s->room.filmed && s->room.has_views &&
           take_view_is_located(room->shared->take_view);
}

static bool are_poses_near(const struct pose *a, const struct pose *b, double m, double rad)
{
    return v3_distance(a->translation, b->translation) <= m && pose_angle(*a, *b) <= rad;
}

static void ask_worker(struct viewer_room *room, const struct take_view_request *request, int64_t now_ns)
{
    const struct pose *pose = &request->world_from_camera;
    const bool first = !room->asked_lens.width, same_lens = lens_equal(&room->asked_lens, &request->lens);
    if (!are_poses_near(&room->seen_pose, pose, 1e-6, 1e-6)) {
        room->seen_pose = *pose;
        room->still_ns = now_ns;
    }
    const bool still = now_ns - room->still_ns >= STILL_NS,
               exact = are_poses_near(&room->asked_pose, pose, 1e-6, 1e-6) && same_lens;
    if (!exact && !still)
        room->shared->state.changed = true; // to look again
    if (!first && (exact || (!still && are_poses_near(&room->asked_pose, pose, ASK_M, ASK_RAD))))
        return;
    room_worker_ask(room->worker, &request->lens, *pose);
    room->asked_lens = request->lens;
    room->asked_pose = *pose;
}

enum status viewer_room_draw_filmed(struct viewer_room *room, const struct take_view_request *request, int64_t now_ns,
                                    const struct gpu_texture **out)
{
    enum status status = OK;
    *out = NULL;
    if (!viewer_room_wants_filmed(room) || !room->worker)
        return OK;
    ask_worker(room, request, now_ns);
    if (room->views) {
        status = room_views_draw(room->views, room->worker, &request->lens, request->world_from_camera, out);
        room->shared->state.changed |= room_views_more(room->views);
        return status;
    }
    const struct room_picture *p = room_worker_latest(room->worker);
    if (!p)
        return OK;
    if (!room->filmed)
        status = filmed_layer_open(&room->filmed, room->shared->gpu);
    if (status != OK)
        return status;
    return filmed_layer_draw(room->filmed, room->renderer, p, &request->lens, request->world_from_camera, out);
}

// Of the view's size. What it shows is as coarse as the map: the recorded views lie over it.
enum status viewer_room_draw_surface(struct viewer_room *room, const struct take_view_request *request,
                                     struct take_view_image *out)
{
    const struct lens *lens = &request->lens;
    enum status status = OK;
    if (!viewer_room_wants_filmed(room) || !room->mesh)
        return OK;
    if (!room->surface || !lens_equal(lens, &room->surface_lens)) {
        gpu_target_close(&room->surface);
        status = gpu_target_open(&room->surface, room->shared->gpu, lens->width, lens->height);
        room->surface_drawn = false;
        room->surface_lens = *lens;
    }
    if (status != OK)
        return status;
    if (!room->surface_drawn || !are_poses_near(&room->surface_pose, &request->world_from_camera, 1e-9, 1e-9)) {
        const struct solid_view view = {room->surface, *lens, request->world_from_camera};
        gpu_target_clear(room->surface);
        solid_renderer_draw(room->renderer, &view, room->mesh, &(struct solid_look){POSE_IDENTITY, 1, NULL, true});
        room->surface_pose = request->world_from_camera;
        room->surface_drawn = true;
    }
    out->surface = gpu_target_texture(room->surface);
    out->room_low = room->mesh_low;
    out->room_high = room->mesh_high;
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

void viewer_room_ask_seen(struct viewer_room *room, struct take_view_request *request)
{
    const int count = room->things.known.count < ROOM_LABELS_MAX ? room->things.known.count : ROOM_LABELS_MAX;
    _Static_assert(OVERLAY_POINTS == 9, "3 x 3");
    _Static_assert((int)ROOM_LABELS_MAX <= (int)OVERLAY_GROUPS_MAX, "each label is asked for");
    if (!room->shared->state.room.names || !count || request->camera_lost ||
        !take_view_is_located(room->shared->take_view))
        return;
    for (int i = 0; i < count; i++)
        put_points(&room->things.shown[i], request->world_from_camera.translation, &room->asked[i]);
    room->overlay = (struct overlay){.groups = room->asked, .group_count = count};
    request->overlay = &room->overlay;
}

void viewer_room_expect_seen(struct viewer_room *room, bool asked) { room->seen_comes = asked; }

enum status viewer_room_read_seen(struct viewer_room *room)
{
    float share[OVERLAY_GROUPS_MAX];
    int count;
    if (!room->seen_comes)
        return OK;
    room->seen_comes = false;
    const enum status status = take_view_read_seen(room->shared->take_view, share, &count);
    for (int i = 0; i < count && i < room->things.known.count && status == OK; i++) {
        const bool hidden = share[i] < (room->things.shown[i].hidden ? SEEN_SHARE : HIDDEN_SHARE);
        room->shared->state.changed |= hidden != room->things.shown[i].hidden;
        room->things.shown[i].hidden = hidden;
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

static enum status draw_map(struct viewer_room *room, struct ui_box box, double px_per_dp)
{
    const struct lens lens = lens_of_map((int)fmax(box.w * px_per_dp, 16), (int)fmax(box.h * px_per_dp, 16));
    const struct pose pose = orbit_world_from_camera(&room->shared->state.room.map_orbit);
    enum status status = OK;
    room->page.map_view = (struct figure_view){lens, pose, {1 / px_per_dp, box.x, box.y}, false};
    if (!room->map || !lens_equal(&lens, &room->map_lens)) {
        gpu_target_close(&room->map);
        status = gpu_target_open(&room->map, room->shared->gpu, lens.width, lens.height);
        room->map_drawn = false;
        room->map_lens = lens;
    }
    if (status != OK)
        return status;
    if (!room->map_drawn || !are_poses_near(&room->map_pose, &pose, 0, 0)) {
        const struct solid_view view = {room->map, lens, pose};
        gpu_target_clear(room->map);
        if (room->mesh)
            solid_renderer_draw(room->renderer, &view, room->mesh, &(struct solid_look){POSE_IDENTITY, 1, NULL, true});
        room_things_draw(&room->things, room->shared->gpu, room->renderer, &view);
        room->map_pose = pose;
        room->map_drawn = true;
    }
    room->page.map = gpu_target_texture(room->map);
    room->page.map_is_coming = room->shared->has_place && !room->mesh_came;
    return OK;
}

static void fill_viewer(struct viewer_room *room)
{
    struct room_page *p = &room->page;
    const struct camera_frame *f = room->shared->frame;
    p->path = room->path;
    p->path_count = room->path_count;
    if (f && f->placed && !room->shared->state.orbiting) {
        p->viewer_known = true;
        p->world_from_viewer = f->world_from_camera;
        p->viewer_lens = f->lens;
    } else if (room->shared->state.orbiting && room->shared->has_image &&
               take_view_is_located(room->shared->take_view)) {
        p->viewer_known = true;
        p->world_from_viewer = room->shared->image.world_from_camera;
        p->viewer_lens = room->shared->image.lens;
    }
}

// ---------------------------------------------------------------- the card

static void describe_source(struct viewer_room *room, int i)
{
    const struct place_thing *t = &room->things.known.things[i];
    const enum answer answer = room->things.shown[i].answer;
    room->card.source_warns = answer == ANSWER_NONE || t->gone;
    if (answer == ANSWER_ASKING)
        snprintf(room->source, sizeof room->source, "Asking for what is newer …");
    else if (answer == ANSWER_NONE)
        snprintf(room->source, sizeof room->source, "%s%s",
                 t->known ? "Kept in the recording; nothing newer came: " : "", t->trouble);
    else if (t->gone)
        snprintf(room->source, sizeof room->source, "It was not found where it stood.");
    else if (t->unkept)
        snprintf(room->source, sizeof room->source,
                 "From its server; the recording cannot be written, so it is forgotten when this is closed.");
    else if (t->known)
        snprintf(room->source, sizeof room->source, "Kept in the recording.");
    else
        snprintf(room->source, sizeof room->source, "Nothing more is known of it.");
    room->card.source = room->source;
}

static enum status open_picture(struct viewer_room *room, int i)
{
    const struct image *image = &room->things.known.things[i].picture;
    if (room->pictures[i] || !image->width || image->width > gpu_max_size(room->shared->gpu) ||
        image->height > gpu_max_size(room->shared->gpu))
        return OK;
    const struct gpu_texture_layout how = {GPU_RGB8, image->width, image->height, GPU_LINEAR};
    return gpu_texture_open(&room->pictures[i], room->shared->gpu, &how, image->rgb);
}

static enum status draw_card(struct viewer_room *room, int64_t now_ns)
{
    const int i = room->shared->state.room.card;
    if (room->shared->state.sheet != SHEET_CARD || i < 0 || i >= room->things.known.count)
        return OK;
    const struct place_thing *t = &room->things.known.things[i];
    const struct thing_knowledge *k = &t->knowledge;
    enum status status = open_picture(room, i);
    if (status == OK && !room->turning)
        status = gpu_target_open(&room->turning, room->shared->gpu, TURNING_PX, TURNING_PX);
    if (status != OK)
        return status;
    const double angle = TURN_RAD_S * (double)(now_ns % 1000000000000) * 1e-9;
    thing_solid_draw_turning(room_things_solid(&room->things, room->shared->gpu, i), room->renderer, room->turning,
                             fmod(angle, 2 * PI));
    room->card =
        (struct thing_card){.name = k->name[0] ? k->name : t->name,
                            .description = k->description,
                            .weight = k->weight,
                            .material = k->material,
                            .instructions = k->instructions,
                            .note = t->note,
                            .picture = room->pictures[i],
                            .picture_aspect = t->picture.height ? (double)t->picture.width / t->picture.height : 1,
                            .body = gpu_target_texture(room->turning),
                            .is_model = room->things.solids[i].is_model};
    describe_source(room, i);
    room->page.card = &room->card;
    return OK;
}

enum status viewer_room_draw(struct viewer_room *room, const struct viewer_surface *surface, int64_t now_ns)
{
    const double px = surface->px_per_dp;
    const struct layout l =
        layout_of(surface->width / px, surface->height / px, &room->shared->state, &room->shared->image);
    room->page = (struct room_page){.things = room->things.shown,
                                    .count = room->things.known.count,
                                    .tags = room->shared->place.tags,
                                    .tag_count = room->shared->place.tag_count};
    if (room->driven)
        room->page.drive = &room->drive;
    room->page.apart = !take_view_is_located(room->shared->take_view);
    if (room->shared->image.has_skeleton && take_view_is_located(room->shared->take_view))
        room->page.actor = &room->shared->image.skeleton;
    enum status status = draw_card(room, now_ns);
    if (status == OK && l.map.w > 0) {
        fill_viewer(room);
        status = draw_map(room, l.map, px);
    }
    return status;
}

const struct room_page *viewer_room_page(const struct viewer_room *room) { return &room->page; }

struct viewer_room_view viewer_room_view_of(struct viewer_room *room)
{
    return (struct viewer_room_view){.page = &room->page,
                                     .things = &room->things,
                                     .worker = room->worker,
                                     .views = room->views,
                                     .turning = room->turning,
                                     .surface = room->surface,
                                     .surface_lens = room->surface_lens,
                                     .mesh_came = room->mesh_came,
                                     .wants_filmed = viewer_room_wants_filmed(room),
                                     .driven = &room->driven};
}
