#include "app/view/take_view.h"

#include "app/view/frame_prefetch.h"
#include "app/state/playback_predictor.h"
#include "app/view/avatar_builder.h"
#include "base/clock.h"
#include "reenact/skeleton/skeleton_track.h"
#include "reenact/render/actor_renderer.h"

#include <stdlib.h>
#include <string.h>

struct take_view {
    char *path, *take_name;
    struct gpu *gpu;
    struct recording *recording;
    struct take *take;
    struct recording *inset_recording; // the renderer has the first for itself
    struct take *inset_take;
    struct skeleton_track *motion;
    struct renderer *renderer;       // made with the first picture, whose lens it needs
    struct avatar_builder *builder;  // NULL: it has ended
    struct frame_prefetch *prefetch; // NULL: the renderer has no avatar yet
    int64_t next[PREFETCH_MAX];      // that the pictures to come show
    int next_count;
    struct playback_predictor predictor;
    int64_t awaited, awaited_ns; // the frame that is shown and not there yet, and since when
    bool substituted;            // another has been drawn for it, which will not do when nothing moves
    struct lens drawn_lens;
    struct gpu_texture *sources, *inset;
    int sources_width, sources_height;
    int64_t inset_frame;
    uint8_t *codes, *colors;  // of sources
    struct vec3 pivot, right; // where the actor begins; the sensor's right hand, level
    struct orbit orbit;
};

// From where one begins to walk round him, and what is then seen of the middle: him with a hand raised or reached out,
// which may be nearer.
static const double NEAREST_M = 3, FARTHEST_M = 3.4, TALL_M = 2.3, WIDE_M = 2.1;
// For a frame that is not there any other will do: while he plays always, for who loaded it meanwhile would hold up the
// picture; when he stands still, after a jump along the timeline, for as long as it takes to load it. Who waits longer
// than that waits for it.
static const int64_t ANY_NS = INT64_MAX, AWAIT_NS = 300000000;

static void init_orbit(struct take_view *s)
{
    s->orbit = (struct orbit){v3(0, 0, 1), 0, 0.1, 3};
    s->right = v3(1, 0, 0);
    for (int64_t i = 0; i < take_frame_count(s->take); i++) {
        struct track_sample moment;
        const struct take_entry *entry = take_entry(s->take, i);
        int64_t since_ns = entry->time_ns - take_entry(s->take, 0)->time_ns;
        if (!entry->has_skeleton || skeleton_track_at(s->motion, since_ns, false, &moment) != OK)
            continue;
        enum joint middle = moment.skeleton.confidence[JOINT_WAIST] > 0 ? JOINT_WAIST : JOINT_NECK;
        struct vec3 body = moment.skeleton.joint[middle];
        struct vec3 from = v3_sub(moment.world_from_camera.translation, body);
        s->pivot = v3(body.x, body.y, 0);
        s->orbit = (struct orbit){body, atan2(from.x, -from.y), 0.12,
                                  fmin(fmax(NEAREST_M, hypot(from.x, from.y)), FARTHEST_M)};
        struct vec3 right = quat_rotate(moment.world_from_camera.rotation, v3(1, 0, 0));
        s->right = v3_unit(v3(right.x, right.y, 0));
        return;
    }
}

enum status take_view_open(struct take_view **out, struct gpu *gpu, const struct take_view_options *options)
{
    const char *path = options->path, *take = options->take;
    *out = NULL;
    struct take_view *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->gpu = gpu;
    s->inset_frame = s->awaited = -1;
    s->path = strdup(path);
    s->take_name = strdup(take);
    enum status status = s->path && s->take_name ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = recording_open(&s->recording, path);
    if (status == OK)
        status = take_open(&s->take, s->recording, take);
    if (status == OK)
        status = recording_open(&s->inset_recording, path);
    if (status == OK)
        status = take_open(&s->inset_take, s->inset_recording, take);
    if (status == OK)
        status = skeleton_track_open(&s->motion, s->take);
    const struct avatar_builder_options how = {path, take, options->notify, options->notify_self};
    if (status == OK)
        status = avatar_builder_start(&s->builder, &how);
    if (status != OK) {
        take_view_close(&s);
        return status;
    }
    init_orbit(s);
    *out = s;
    return OK;
}

void take_view_close(struct take_view **out)
{
    struct take_view *s = *out;
    if (!s)
        return;
    avatar_builder_close(&s->builder);
    prefetch_close(&s->prefetch); // before the renderer, whose avatar it uses
    gpu_texture_close(&s->sources);
    gpu_texture_close(&s->inset);
    renderer_close(&s->renderer);
    skeleton_track_close(&s->motion);
    take_close(&s->inset_take);
    recording_free(&s->inset_recording);
    take_close(&s->take);
    recording_free(&s->recording);
    free(s->codes);
    free(s->colors);
    free(s->path);
    free(s->take_name);
    free(s);
    *out = NULL;
}

int64_t take_view_frames(const struct take_view *s) { return take_frame_count(s->take); }

int64_t take_view_length_ns(const struct take_view *s)
{
    return take_entry(s->take, take_view_frames(s) - 1)->time_ns - take_entry(s->take, 0)->time_ns;
}

// From one recorded frame to the next.
static int64_t frame_step_ns(const struct take_view *s)
{
    int64_t frames = take_view_frames(s);
    return frames > 1 ? take_view_length_ns(s) / (frames - 1) : 1;
}

struct orbit take_view_orbit(const struct take_view *s) { return s->orbit; }

struct lens take_view_orbit_lens(int width, int height, struct ui_box free)
{
    const double f = NEAREST_M * fmax(1, fmin(free.h / TALL_M, free.w / WIDE_M));
    const double x = free.x + free.w / 2 - 0.5, y = free.y + free.h / 2 - 0.5; // (0, 0) is a pixel's centre
    return (struct lens){width, height, f, f, x, y, 0, 0, 0, 0, 0, 0, 0};
}

// ---------------------------------------------------------------- placing

static struct vec3 reflect(const struct take_view *s, struct vec3 p)
{
    return v3_sub(p, v3_scale(s->right, 2 * v3_dot(s->right, v3_sub(p, s->pivot))));
}

// The camera as the take's own world has it. Mirrored: the camera beyond the
// mirror, whose picture turned over left to right shows the actor mirrored.
static struct pose camera_in_take(const struct take_view *s, const struct take_view_request *request)
{
    struct pose world_from_take = placement_pose(&request->placement, s->pivot);
    struct pose camera = pose_multiply(pose_inverse(world_from_take), request->world_from_camera);
    if (!request->placement.mirrored)
        return camera;
    double m[3][3], r[3][3];
    quat_to_matrix(camera.rotation, m);
    const double n[3] = {s->right.x, s->right.y, s->right.z};
    for (int column = 0; column < 3; column++) {
        double along = 0;
        for (int i = 0; i < 3; i++)
            along += n[i] * m[i][column];
        for (int i = 0; i < 3; i++)
            r[i][column] = (m[i][column] - 2 * n[i] * along) * (column == 0 ? -1 : 1);
    }
    return (struct pose){quat_from_matrix(r), reflect(s, camera.translation)};
}

static struct lens lens_for(const struct take_view_request *request)
{
    struct lens l = request->lens;
    if (request->placement.mirrored) {
        l.cx = l.width - 1 - l.cx;
        l.p2 = -l.p2;
    }
    return l;
}

static void place_skeleton(const struct take_view *s, const struct take_view_request *request,
                           const struct track_sample *moment, struct take_view_image *out)
{
    struct pose world_from_take = placement_pose(&request->placement, s->pivot);
    out->has_skeleton = true;
    out->frame = moment->frame;
    out->skeleton = moment->skeleton;
    struct vec3 sum = v3(0, 0, 0);
    int feet = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = moment->skeleton.joint[j];
        p = pose_apply(world_from_take, request->placement.mirrored ? reflect(s, p) : p);
        out->skeleton.joint[j] = p;
        bool low = j == JOINT_LEFT_FOOT || j == JOINT_RIGHT_FOOT;
        if (low && moment->skeleton.confidence[j] > 0) {
            sum = v3_add(sum, p);
            feet++;
        }
    }
    out->floor_point = feet ? v3_scale(sum, 1.0 / feet) : out->skeleton.joint[JOINT_WAIST];
    out->floor_point.z = 0;
}

// ---------------------------------------------------------------- pictures

// A texture of that size, with those pixels.
static enum status upload_pixels(struct take_view *s, struct gpu_texture **texture, int *width, int *height,
                                 int new_width, int new_height, enum gpu_format format, const uint8_t *pixels)
{
    if (*texture && *width == new_width && *height == new_height) {
        gpu_texture_write(*texture, pixels);
        return OK;
    }
    gpu_texture_close(texture);
    *width = new_width;
    *height = new_height;
    return gpu_texture_open(texture, s->gpu, &(struct gpu_texture_layout){format, new_width, new_height, GPU_LINEAR},
                            pixels);
}

// From the renderer's codes to colours: green was seen just now, blue to violet was
// borrowed from ever farther away in time, orange nobody saw.
static void color_code(const uint8_t code[3], uint8_t rgba[4])
{
    static const uint8_t now[3] = {52, 211, 153}, filled[3] = {251, 146, 60}, recent[3] = {56, 189, 248},
                         distant[3] = {167, 62, 240};
    const int opacity = 205;
    double away_s = (256 * code[1] + code[2]) / 100.0, t = away_s / (away_s + 1);
    for (int c = 0; c < 3; c++) {
        double borrowed = recent[c] + t * (distant[c] - recent[c]);
        double color = code[0] < 40 ? 0 : code[0] < 128 ? now[c] : code[0] < 212 ? borrowed : filled[c];
        rgba[c] = (uint8_t)(color * opacity / 255);
    }
    rgba[3] = code[0] < 40 ? 0 : (uint8_t)opacity;
}

static enum status draw_sources(struct take_view *s, int width, int height, struct take_view_image *out)
{
    size_t pixels = (size_t)width * (size_t)height;
    uint8_t *codes = realloc(s->codes, 3 * pixels);
    s->codes = codes ? codes : s->codes;
    uint8_t *colors = realloc(s->colors, 4 * pixels);
    s->colors = colors ? colors : s->colors;
    if (!codes || !colors)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = renderer_read_source(s->renderer, codes);
    if (status != OK)
        return status;
    for (size_t i = 0; i < pixels; i++)
        color_code(codes + 3 * i, colors + 4 * i);
    status = upload_pixels(s, &s->sources, &s->sources_width, &s->sources_height, width, height, GPU_RGBA8, colors);
    out->sources = s->sources;
    return status;
}

static enum status upload_inset(struct take_view *s, int64_t frame, struct take_view_image *out)
{
    const struct lens *color = &take_calibration(s->inset_take)->color;
    if (frame < 0 || !take_entry(s->inset_take, frame)->has_color)
        return OK;
    if (frame != s->inset_frame) {
        struct take_images pictures;
        int width = color->width, height = color->height;
        enum status status = take_read(s->inset_take, frame, TAKE_COLOR, &pictures);
        if (status == OK && pictures.color)
            status = upload_pixels(s, &s->inset, &width, &height, width, height, GPU_RGB8, pictures.color);
        if (status != OK)
            return status;
        s->inset_frame = frame;
    }
    out->inset = s->inset;
    out->inset_aspect = (double)color->width / color->height;
    return OK;
}

static bool same(const struct lens *a, const struct lens *b) { return !memcmp(a, b, sizeof *a); }

static enum status ensure_renderer(struct take_view *s, const struct lens *lens)
{
    enum status status = OK;
    if (!s->renderer) {
        struct renderer_options how = renderer_default_options();
        how.detail = DETAIL_AUTO;
        how.sources = how.shadow = how.avatar_later = true;
        status = renderer_open(&s->renderer, s->gpu, s->take, lens, &how);
    } else if (!same(lens, &s->drawn_lens)) {
        status = renderer_set_lens(s->renderer, lens);
    }
    s->drawn_lens = *lens;
    return status;
}

double take_view_progress(const struct take_view *s) { return s->builder ? avatar_builder_progress(s->builder) : 1; }

bool take_view_waiting(const struct take_view *s) { return s->substituted; }

// Until the frame is there nothing better can be drawn, and who tried would keep the processor from loading it.
bool take_view_final(const struct take_view *s)
{
    const bool better =
        s->substituted && (prefetch_has(s->prefetch, s->awaited) || clock_now_ns() - s->awaited_ns >= AWAIT_NS);
    return !s->renderer || (renderer_upload_done(s->renderer) && !better);
}

enum status take_view_adopt_avatar(struct take_view *s)
{
    struct avatar avatar;
    struct occluder_mesh occluders;
    enum status status;
    if (!s->builder || !s->renderer || !avatar_builder_finished(s->builder, &avatar, &occluders, &status))
        return OK;
    avatar_builder_close(&s->builder);
    enum status given = renderer_set_avatar(s->renderer, status == OK ? &avatar : NULL);
    enum status walls = renderer_set_room(s->renderer, &occluders);
    return status < 0 ? status : given < 0 ? given : walls;
}

// The frames of the pictures to come that the renderer does not keep.
static int predict_frames(struct take_view *s, const struct take_view_request *request, int64_t frames[PREFETCH_MAX])
{
    const struct playback_now now = {.at_ns = request->time_ns,
                                     .length_ns = take_view_length_ns(s),
                                     .frame_ns = frame_step_ns(s),
                                     .playing = request->playing,
                                     .loop = request->loop,
                                     .clock_ns = clock_now_ns(),
                                     .load_ns = prefetch_load_ns(s->prefetch)};
    int64_t at_ns[PREDICTED_MAX];
    int foreseen = playback_predict(&s->predictor, &now, at_ns), count = 0;
    for (int i = 0; i < foreseen && count < PREFETCH_MAX; i++) {
        struct track_sample moment;
        bool listed = skeleton_track_at(s->motion, at_ns[i], false, &moment) != OK ||
                      renderer_nearest_resident_frame(s->renderer, moment.frame, 0) >= 0;
        for (int k = 0; k < count; k++)
            listed |= frames[k] == moment.frame;
        if (!listed)
            frames[count++] = moment.frame;
    }
    return count;
}

// How far from its frame a picture may be drawn with another one that is there.
static int64_t frame_tolerance_ns(struct take_view *s, const struct take_view_request *request, int64_t frame)
{
    const int64_t now_ns = clock_now_ns();
    if (request->sources)
        return 0;
    if (request->playing)
        return ANY_NS;
    if (frame != s->awaited)
        s->awaited = frame, s->awaited_ns = now_ns;
    return now_ns - s->awaited_ns < AWAIT_NS ? ANY_NS : 0;
}

// Before what was wanted before, for whoever moves along the timeline may have gone on before a frame is there.
static void want_first(struct take_view *s, int64_t frame)
{
    int64_t before[PREFETCH_MAX];
    const int count = s->next_count;
    memcpy(before, s->next, sizeof before);
    s->next[0] = frame;
    s->next_count = 1;
    for (int i = 0; i < count && s->next_count < PREFETCH_MAX; i++)
        if (before[i] != frame && renderer_nearest_resident_frame(s->renderer, before[i], 0) < 0)
            s->next[s->next_count++] = before[i];
}

// What was loaded goes to the renderer. What this picture shows is waited for only where nothing within `within_ns`
// stands in for it.
static enum status use_prefetched(struct take_view *s, const struct take_view_request *request, int64_t frame,
                                  int64_t within_ns)
{
    const struct avatar *avatar = renderer_avatar(s->renderer);
    const struct frame_prefetch_options how = {s->path, s->take_name, avatar};
    struct frame_layer loaded;
    enum status status = OK;
    if (!avatar)
        return OK;
    if (!s->prefetch)
        status = prefetch_start(&s->prefetch, &how);
    while (status == OK && prefetch_take_any(s->prefetch, &loaded))
        status = renderer_add_frame(s->renderer, &loaded);
    if (status != OK)
        return status;
    playback_predictor_report(&s->predictor, renderer_nearest_resident_frame(s->renderer, frame, 0) >= 0);
    if (renderer_nearest_resident_frame(s->renderer, frame, within_ns) < 0 &&
        prefetch_take(s->prefetch, frame, &loaded))
        status = renderer_add_frame(s->renderer, &loaded);
    if (status != OK)
        return status;
    int64_t foreseen[PREFETCH_MAX];
    const int count = predict_frames(s, request, foreseen);
    s->substituted = !request->playing && renderer_nearest_resident_frame(s->renderer, frame, 0) < 0 &&
                     renderer_nearest_resident_frame(s->renderer, frame, within_ns) >= 0;
    if (s->substituted) {
        want_first(s, frame);
    } else {
        s->next_count = count;
        memcpy(s->next, foreseen, sizeof s->next);
    }
    return OK;
}

void take_view_presented(struct take_view *s)
{
    if (s->prefetch)
        prefetch_request(s->prefetch, s->next, s->next_count);
}

// Pixels as shares of the picture, which is turned over later.
static struct ui_uv_rect part_within(const struct renderer_result *drawn, bool flip_x)
{
    const struct gpu_box *box = &drawn->within;
    if (!box->width)
        return (struct ui_uv_rect){0, 0, 1, 1};
    const double left = (double)box->left / drawn->width, right = left + (double)box->width / drawn->width;
    const double top = (double)box->top / drawn->height, bottom = top + (double)box->height / drawn->height;
    return (struct ui_uv_rect){flip_x ? 1 - right : left, top, flip_x ? 1 - left : right, bottom};
}

static enum status draw_actor(struct take_view *s, const struct take_view_request *request, int64_t frame,
                              struct take_view_image *out)
{
    struct lens lens = lens_for(request);
    struct affine_map viewer_from_room = affine_from_pose(pose_inverse(request->world_from_camera));
    for (int i = 0; i < 4 && request->placement.mirrored; i++)
        viewer_from_room.row[0][i] = -viewer_from_room.row[0][i]; // the picture is turned over later
    struct renderer_view view = {.world_from_camera = camera_in_take(s, request),
                                 .time_ns = request->time_ns,
                                 .viewer_from_room = request->camera ? &viewer_from_room : NULL, // the studio is empty
                                 .within_ns = frame_tolerance_ns(s, request, frame),
                                 .also_paper = request->former};
    struct renderer_result result;
    enum status status = ensure_renderer(s, &lens);
    if (status != OK)
        return status;
    renderer_set_resolution_scale(s->renderer, request->resolution_scale);
    renderer_set_sources(s->renderer, request->sources);
    renderer_set_error(s->renderer, request->error_px);
    status = frame >= 0 ? use_prefetched(s, request, frame, view.within_ns) : OK;
    if (status == OK)
        status = renderer_draw(s->renderer, &view, &result);
    if (status != OK)
        return status;
    out->actor = renderer_actor_texture(s->renderer);
    out->shadow = renderer_shadow_texture(s->renderer);
    out->former = request->former ? renderer_paper_texture(s->renderer) : NULL;
    out->prepared = result.level != DETAIL_PAPER;
    out->actor_part = part_within(&result, request->placement.mirrored);
    out->flip_x = request->placement.mirrored;
    out->parts = result.parts;
    return request->sources ? draw_sources(s, result.width, result.height, out) : OK;
}

enum status take_view_draw(struct take_view *s, const struct take_view_request *request, struct take_view_image *out)
{
    *out = (struct take_view_image){
        .lens = request->lens, .world_from_camera = request->world_from_camera, .camera = request->camera, .frame = -1};
    enum status status = OK;
    struct track_sample moment;
    bool there = skeleton_track_at(s->motion, request->time_ns, true, &moment) == OK;
    s->substituted = false;
    if (there)
        place_skeleton(s, request, &moment, out);
    if (!request->camera_lost)
        status = draw_actor(s, request, there ? moment.frame : -1, out);
    if (status == OK && request->inset && there)
        status = upload_inset(s, moment.frame, out);
    return status;
}
