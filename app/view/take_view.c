#include "app/view/take_view.h"

#include "app/view/frame_prefetch.h"
#include "app/state/playback_predictor.h"
#include "app/view/avatar_builder.h"
#include "base/clock.h"
#include "reenact/skeleton/skeleton_track.h"
#include "reenact/render/actor_renderer.h"

#include <stdlib.h>
#include <string.h>

struct stage {
    char *path, *take_name;
    struct gpu *gpu;
    struct recording *recording;
    struct take *take;
    struct recording *inset_recording; // the painter has the first for itself
    struct take *inset_take;
    struct motion *motion;
    struct painter *painter;         // made with the first picture, whose lens it needs
    struct preparation *preparation; // NULL: it has ended
    struct ahead *ahead;             // NULL: the painter has no likeness yet
    int64_t next[AHEAD_MOST];        // that the pictures to come show
    int next_count;
    struct foresight foresight;
    int64_t awaited, awaited_ns; // the frame that is shown and not there yet, and since when
    bool stands_in;              // another has been drawn for it, which will not do when nothing moves
    struct lens drawn_lens;
    struct gpu_texture *sources, *inset;
    int sources_width, sources_height;
    int64_t inset_frame;
    uint8_t *codes, *colors;   // of sources
    struct vec3 anchor, right; // where the actor begins; the sensor's right hand, level
    struct orbit orbit;
};

// From where one begins to walk round him, and what is then seen of the middle: him with a hand raised or reached out,
// which may be nearer.
static const double NEAREST_M = 3, FARTHEST_M = 3.4, TALL_M = 2.3, WIDE_M = 2.1;
// For a frame that is not there any other will do: while he plays always, for who loaded it meanwhile would hold up the
// picture; when he stands still, after a jump along the timeline, for as long as it takes to load it. Who waits longer
// than that waits for it.
static const int64_t ANY_NS = INT64_MAX, AWAIT_NS = 300000000;

static void find_beginning(struct stage *s)
{
    s->orbit = (struct orbit){v3(0, 0, 1), 0, 0.1, 3};
    s->right = v3(1, 0, 0);
    for (int64_t i = 0; i < take_frame_count(s->take); i++) {
        struct moment moment;
        const struct take_entry *entry = take_entry(s->take, i);
        int64_t since_ns = entry->time_ns - take_entry(s->take, 0)->time_ns;
        if (!entry->has_skeleton || motion_at(s->motion, since_ns, false, &moment) != OK)
            continue;
        enum joint middle = moment.skeleton.confidence[JOINT_WAIST] > 0 ? JOINT_WAIST : JOINT_NECK;
        struct vec3 body = moment.skeleton.joint[middle];
        struct vec3 from = v3_sub(moment.world_from_camera.translation, body);
        s->anchor = v3(body.x, body.y, 0);
        s->orbit = (struct orbit){body, atan2(from.x, -from.y), 0.12,
                                  fmin(fmax(NEAREST_M, hypot(from.x, from.y)), FARTHEST_M)};
        struct vec3 right = quat_rotate(moment.world_from_camera.rotation, v3(1, 0, 0));
        s->right = v3_unit(v3(right.x, right.y, 0));
        return;
    }
}

enum status stage_open(struct stage **out, struct gpu *gpu, const struct stage_options *options)
{
    const char *path = options->path, *take = options->take;
    *out = NULL;
    struct stage *s = calloc(1, sizeof *s);
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
        status = motion_open(&s->motion, s->take);
    const struct preparation_options how = {path, take, options->news, options->news_self};
    if (status == OK)
        status = preparation_start(&s->preparation, &how);
    if (status != OK) {
        stage_close(&s);
        return status;
    }
    find_beginning(s);
    *out = s;
    return OK;
}

void stage_close(struct stage **out)
{
    struct stage *s = *out;
    if (!s)
        return;
    preparation_close(&s->preparation);
    ahead_close(&s->ahead); // before the painter, whose likeness it uses
    gpu_texture_close(&s->sources);
    gpu_texture_close(&s->inset);
    painter_close(&s->painter);
    motion_close(&s->motion);
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

int64_t stage_frames(const struct stage *s) { return take_frame_count(s->take); }

int64_t stage_length_ns(const struct stage *s)
{
    return take_entry(s->take, stage_frames(s) - 1)->time_ns - take_entry(s->take, 0)->time_ns;
}

// From one recorded frame to the next.
static int64_t frame_step_ns(const struct stage *s)
{
    int64_t frames = stage_frames(s);
    return frames > 1 ? stage_length_ns(s) / (frames - 1) : 1;
}

struct orbit stage_orbit(const struct stage *s) { return s->orbit; }

struct lens stage_orbit_lens(int width, int height, struct ui_box free)
{
    const double f = NEAREST_M * fmax(1, fmin(free.h / TALL_M, free.w / WIDE_M));
    const double x = free.x + free.w / 2 - 0.5, y = free.y + free.h / 2 - 0.5; // (0, 0) is a pixel's centre
    return (struct lens){width, height, f, f, x, y, 0, 0, 0, 0, 0, 0, 0};
}

// ---------------------------------------------------------------- placing

static struct vec3 reflect(const struct stage *s, struct vec3 p)
{
    return v3_sub(p, v3_scale(s->right, 2 * v3_dot(s->right, v3_sub(p, s->anchor))));
}

// The camera as the take's own world has it. Mirrored: the camera beyond the
// mirror, whose picture turned over left to right shows the actor mirrored.
static struct pose camera_in_take(const struct stage *s, const struct stage_look *look)
{
    struct pose world_from_take = placement_pose(&look->placement, s->anchor);
    struct pose camera = pose_multiply(pose_inverse(world_from_take), look->world_from_camera);
    if (!look->placement.mirrored)
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

static struct lens lens_for(const struct stage_look *look)
{
    struct lens l = look->lens;
    if (look->placement.mirrored) {
        l.cx = l.width - 1 - l.cx;
        l.p2 = -l.p2;
    }
    return l;
}

static void place_skeleton(const struct stage *s, const struct stage_look *look, const struct moment *moment,
                           struct stage_picture *out)
{
    struct pose world_from_take = placement_pose(&look->placement, s->anchor);
    out->has_skeleton = true;
    out->frame = moment->frame;
    out->skeleton = moment->skeleton;
    struct vec3 sum = v3(0, 0, 0);
    int feet = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = moment->skeleton.joint[j];
        p = pose_apply(world_from_take, look->placement.mirrored ? reflect(s, p) : p);
        out->skeleton.joint[j] = p;
        bool low = j == JOINT_LEFT_FOOT || j == JOINT_RIGHT_FOOT;
        if (low && moment->skeleton.confidence[j] > 0) {
            sum = v3_add(sum, p);
            feet++;
        }
    }
    out->standing = feet ? v3_scale(sum, 1.0 / feet) : out->skeleton.joint[JOINT_WAIST];
    out->standing.z = 0;
}

// ---------------------------------------------------------------- pictures

// A texture of that size, with those pixels.
static enum status show_pixels(struct stage *s, struct gpu_texture **texture, int *width, int *height, int new_width,
                               int new_height, enum gpu_format format, const uint8_t *pixels)
{
    if (*texture && *width == new_width && *height == new_height) {
        gpu_texture_write(*texture, pixels);
        return OK;
    }
    gpu_texture_close(texture);
    *width = new_width;
    *height = new_height;
    return gpu_texture_open(texture, s->gpu, format, new_width, new_height, GPU_LINEAR, pixels);
}

// From the painter's codes to colours: green was seen just now, blue to violet was
// borrowed from ever farther away in time, orange nobody saw.
static void color_code(const uint8_t code[3], uint8_t rgba[4])
{
    static const uint8_t now[3] = {52, 211, 153}, filled[3] = {251, 146, 60}, near[3] = {56, 189, 248},
                         far[3] = {167, 62, 240};
    const int opacity = 205;
    double away_s = (256 * code[1] + code[2]) / 100.0, t = away_s / (away_s + 1);
    for (int c = 0; c < 3; c++) {
        double borrowed = near[c] + t * (far[c] - near[c]);
        double color = code[0] < 40 ? 0 : code[0] < 128 ? now[c] : code[0] < 212 ? borrowed : filled[c];
        rgba[c] = (uint8_t)(color * opacity / 255);
    }
    rgba[3] = code[0] < 40 ? 0 : (uint8_t)opacity;
}

static enum status show_sources(struct stage *s, int width, int height, struct stage_picture *out)
{
    size_t pixels = (size_t)width * (size_t)height;
    uint8_t *codes = realloc(s->codes, 3 * pixels);
    s->codes = codes ? codes : s->codes;
    uint8_t *colors = realloc(s->colors, 4 * pixels);
    s->colors = colors ? colors : s->colors;
    if (!codes || !colors)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = painter_read_source(s->painter, codes);
    if (status != OK)
        return status;
    for (size_t i = 0; i < pixels; i++)
        color_code(codes + 3 * i, colors + 4 * i);
    status = show_pixels(s, &s->sources, &s->sources_width, &s->sources_height, width, height, GPU_RGBA8, colors);
    out->sources = s->sources;
    return status;
}

static enum status show_inset(struct stage *s, int64_t frame, struct stage_picture *out)
{
    const struct lens *color = &take_calibration(s->inset_take)->color;
    if (frame < 0 || !take_entry(s->inset_take, frame)->has_color)
        return OK;
    if (frame != s->inset_frame) {
        struct take_pictures pictures;
        int width = color->width, height = color->height;
        enum status status = take_read(s->inset_take, frame, TAKE_COLOR, &pictures);
        if (status == OK && pictures.color)
            status = show_pixels(s, &s->inset, &width, &height, width, height, GPU_RGB8, pictures.color);
        if (status != OK)
            return status;
        s->inset_frame = frame;
    }
    out->inset = s->inset;
    out->inset_shape = (double)color->width / color->height;
    return OK;
}

static bool same(const struct lens *a, const struct lens *b) { return !memcmp(a, b, sizeof *a); }

static enum status have_painter(struct stage *s, const struct lens *lens)
{
    enum status status = OK;
    if (!s->painter) {
        struct painter_options how = painter_default_options();
        how.detail = DETAIL_AUTO;
        how.sources = how.shadow = how.likeness_later = true;
        status = painter_open(&s->painter, s->gpu, s->take, lens, &how);
    } else if (!same(lens, &s->drawn_lens)) {
        status = painter_set_lens(s->painter, lens);
    }
    s->drawn_lens = *lens;
    return status;
}

double stage_prepared(const struct stage *s) { return s->preparation ? preparation_share(s->preparation) : 1; }

bool stage_awaits(const struct stage *s) { return s->stands_in; }

// Until the frame is there nothing better can be drawn, and who tried would keep the processor from loading it.
bool stage_settled(const struct stage *s)
{
    const bool better = s->stands_in && (ahead_has(s->ahead, s->awaited) || clock_now_ns() - s->awaited_ns >= AWAIT_NS);
    return !s->painter || (painter_settled(s->painter) && !better);
}

enum status stage_prepare(struct stage *s)
{
    struct likeness likeness;
    struct room room;
    enum status status;
    if (!s->preparation || !s->painter || !preparation_ended(s->preparation, &likeness, &room, &status))
        return OK;
    preparation_close(&s->preparation);
    enum status given = painter_give_likeness(s->painter, status == OK ? &likeness : NULL);
    enum status walls = painter_give_room(s->painter, &room);
    return status < 0 ? status : given < 0 ? given : walls;
}

// The frames of the pictures to come that the painter does not keep.
static int frames_ahead(struct stage *s, const struct stage_look *look, int64_t frames[AHEAD_MOST])
{
    const struct foresight_now now = {.at_ns = look->time_ns,
                                      .length_ns = stage_length_ns(s),
                                      .each_ns = frame_step_ns(s),
                                      .playing = look->playing,
                                      .loop = look->loop,
                                      .clock_ns = clock_now_ns(),
                                      .takes_ns = ahead_takes_ns(s->ahead)};
    int64_t at_ns[FORESEEN_MOST];
    int foreseen = foresee(&s->foresight, &now, at_ns), count = 0;
    for (int i = 0; i < foreseen && count < AHEAD_MOST; i++) {
        struct moment moment;
        bool listed =
            motion_at(s->motion, at_ns[i], false, &moment) != OK || painter_near(s->painter, moment.frame, 0) >= 0;
        for (int k = 0; k < count; k++)
            listed |= frames[k] == moment.frame;
        if (!listed)
            frames[count++] = moment.frame;
    }
    return count;
}

// How far from its frame a picture may be drawn with another one that is there.
static int64_t within(struct stage *s, const struct stage_look *look, int64_t frame)
{
    const int64_t now_ns = clock_now_ns();
    if (look->sources)
        return 0;
    if (look->playing)
        return ANY_NS;
    if (frame != s->awaited)
        s->awaited = frame, s->awaited_ns = now_ns;
    return now_ns - s->awaited_ns < AWAIT_NS ? ANY_NS : 0;
}

// Before what was wanted before, for whoever moves along the timeline may have gone on before a frame is there.
static void want_first(struct stage *s, int64_t frame)
{
    int64_t before[AHEAD_MOST];
    const int count = s->next_count;
    memcpy(before, s->next, sizeof before);
    s->next[0] = frame;
    s->next_count = 1;
    for (int i = 0; i < count && s->next_count < AHEAD_MOST; i++)
        if (before[i] != frame && painter_near(s->painter, before[i], 0) < 0)
            s->next[s->next_count++] = before[i];
}

// What was loaded goes to the painter. What this picture shows is waited for only where nothing within `within_ns`
// stands in for it.
static enum status use_ahead(struct stage *s, const struct stage_look *look, int64_t frame, int64_t within_ns)
{
    const struct likeness *likeness = painter_likeness(s->painter);
    const struct ahead_options how = {s->path, s->take_name, likeness};
    struct loaded_frame loaded;
    enum status status = OK;
    if (!likeness)
        return OK;
    if (!s->ahead)
        status = ahead_start(&s->ahead, &how);
    while (status == OK && ahead_take_any(s->ahead, &loaded))
        status = painter_give_frame(s->painter, &loaded);
    if (status != OK)
        return status;
    foresight_met(&s->foresight, painter_near(s->painter, frame, 0) >= 0);
    if (painter_near(s->painter, frame, within_ns) < 0 && ahead_take(s->ahead, frame, &loaded))
        status = painter_give_frame(s->painter, &loaded);
    if (status != OK)
        return status;
    int64_t foreseen[AHEAD_MOST];
    const int count = frames_ahead(s, look, foreseen);
    s->stands_in =
        !look->playing && painter_near(s->painter, frame, 0) < 0 && painter_near(s->painter, frame, within_ns) >= 0;
    if (s->stands_in) {
        want_first(s, frame);
    } else {
        s->next_count = count;
        memcpy(s->next, foreseen, sizeof s->next);
    }
    return OK;
}

void stage_shown(struct stage *s)
{
    if (s->ahead)
        ahead_want(s->ahead, s->next, s->next_count);
}

// Pixels as shares of the picture, which is turned over later.
static struct ui_part part_within(const struct painter_result *drawn, bool turned_over)
{
    const struct gpu_box *box = &drawn->within;
    if (!box->width)
        return (struct ui_part){0, 0, 1, 1};
    const double left = (double)box->left / drawn->width, right = left + (double)box->width / drawn->width;
    const double top = (double)box->top / drawn->height, bottom = top + (double)box->height / drawn->height;
    return (struct ui_part){turned_over ? 1 - right : left, top, turned_over ? 1 - left : right, bottom};
}

static enum status draw_actor(struct stage *s, const struct stage_look *look, int64_t frame, struct stage_picture *out)
{
    struct lens lens = lens_for(look);
    struct part_map viewer_from_room = part_map_of(pose_inverse(look->world_from_camera));
    for (int i = 0; i < 4 && look->placement.mirrored; i++)
        viewer_from_room.row[0][i] = -viewer_from_room.row[0][i]; // the picture is turned over later
    struct painter_view view = {.world_from_camera = camera_in_take(s, look),
                                .time_ns = look->time_ns,
                                .viewer_from_room = look->camera ? &viewer_from_room : NULL, // the studio is empty
                                .within_ns = within(s, look, frame),
                                .also_paper = look->former};
    struct painter_result result;
    enum status status = have_painter(s, &lens);
    if (status != OK)
        return status;
    painter_set_fineness(s->painter, look->fineness);
    painter_set_sources(s->painter, look->sources);
    painter_set_error(s->painter, look->error_px);
    status = frame >= 0 ? use_ahead(s, look, frame, view.within_ns) : OK;
    if (status == OK)
        status = painter_draw(s->painter, &view, &result);
    if (status != OK)
        return status;
    out->actor = painter_actor_texture(s->painter);
    out->shadow = painter_shadow_texture(s->painter);
    out->former = look->former ? painter_paper_texture(s->painter) : NULL;
    out->prepared = result.level != DETAIL_PAPER;
    out->actor_part = part_within(&result, look->placement.mirrored);
    out->turned_over = look->placement.mirrored;
    out->parts = result.parts;
    return look->sources ? show_sources(s, result.width, result.height, out) : OK;
}

enum status stage_draw(struct stage *s, const struct stage_look *look, struct stage_picture *out)
{
    *out = (struct stage_picture){
        .lens = look->lens, .world_from_camera = look->world_from_camera, .camera = look->camera, .frame = -1};
    enum status status = OK;
    struct moment moment;
    bool there = motion_at(s->motion, look->time_ns, true, &moment) == OK;
    s->stands_in = false;
    if (there)
        place_skeleton(s, look, &moment, out);
    if (!look->nobody)
        status = draw_actor(s, look, there ? moment.frame : -1, out);
    if (status == OK && look->inset && there)
        status = show_inset(s, moment.frame, out);
    return status;
}
