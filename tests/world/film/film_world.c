// film-world: renders the small world into folders, as a sensor and a tablet's camera would have recorded it, with the
// truth beside them.
#include "app/commands/command.h"
#include "platform/file.h"
#include "platform/jpeg.h"
#include "platform/json.h"
#include "platform/png.h"
#include "tests/world/world.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH_BYTES = 4096, QUALITY = 93 };

enum set { SET_PLACE = 1, SET_SENSOR = 2, SET_VIEWER = 4, SET_ALL = 7 };

struct film_options {
    const char *out;
    int sets;
    double seconds; // < 0: all
    int width, height;
    double focal_px;  // 0: as a Kinect's or a tablet's, by the width
    double rate_hz;   // 0: the reel's own
    double readout_s; // of a rolling shutter; the sensor on its stand has none
    bool clean;
    struct world_options world;
};

// One camera's film: its name, its rate, when its clock starts.
struct reel {
    const char *name;
    enum set set;
    double rate_hz, start_s;
    bool depth, actor;
};

static const struct reel reels[] = {
    {"place", SET_PLACE, 10, 940, true, false},
    {"sensor", SET_SENSOR, 30, 1000, true, true},
    {"viewer", SET_VIEWER, 10, 2000, false, false},
};

// A text that grows, written to its file at the end.
struct text_buffer {
    char *bytes;
    size_t count, room;
    bool failed;
};

static void add(struct text_buffer *t, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(struct text_buffer *t, const char *format, ...)
{
    char line[512];
    va_list list;
    va_start(list, format);
    int n = vsnprintf(line, sizeof line, format, list);
    va_end(list);
    assert(n >= 0 && n < (int)sizeof line);
    if (t->count + (size_t)n > t->room) {
        size_t room = 2 * t->room + 4096;
        char *bigger = realloc(t->bytes, room);
        if (!bigger) {
            t->failed = true;
            return;
        }
        t->bytes = bigger;
        t->room = room;
    }
    memcpy(t->bytes + t->count, line, (size_t)n);
    t->count += (size_t)n;
}

static enum status save_text(struct text_buffer *t, const char *folder, const char *name)
{
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    enum status status = t->failed ? fail(ERR_MEMORY, "out of memory for %s", path)
                                   : file_write(path, t->bytes ? t->bytes : "", t->count);
    free(t->bytes);
    *t = (struct text_buffer){0};
    return status;
}

static enum status save_json(struct json *root, const char *folder, const char *name)
{
    struct text_buffer t = {.bytes = json_print(root)};
    if (t.bytes)
        t.count = strlen(t.bytes);
    else
        t.failed = true;
    json_free(&root);
    return save_text(&t, folder, name);
}

// ---------------------------------------------------------------- what a user knows, and the truth

static void add_lens(struct json *root, const char *name, const struct lens *l, bool depth)
{
    struct json *o = json_add_object(root, name);
    json_add_number(o, "width", l->width);
    json_add_number(o, "height", l->height);
    json_add_number(o, "fx", l->fx);
    json_add_number(o, "fy", l->fy);
    json_add_number(o, "cx", l->cx);
    json_add_number(o, "cy", l->cy);
    struct json *d = json_add_array(o, "distortion");
    double k[5] = {l->k1, l->k2, l->p1, l->p2, l->k3};
    for (int i = 0; i < 5; i++)
        json_push_number(d, k[i]);
    if (depth)
        json_add_number(o, "unit_m", 0.001);
    if (l->readout_s > 0)
        json_add_number(o, "readout_ms", l->readout_s * 1e3);
}

static enum status save_calibration(const struct calibration *c, const char *folder)
{
    struct json *root = json_new_object();
    add_lens(root, "color", &c->color, false);
    if (c->depth.width) {
        add_lens(root, "depth", &c->depth, true);
        json_add_bool(root, "registered", c->registered);
    }
    json_add_string(root, "pixel_origin", "centre of the top-left pixel is (0,0)");
    return save_json(root, folder, "calibration.json");
}

static enum status save_tags(const struct world *w, const char *folder, const char *truth)
{
    int32_t count;
    const struct place_tag *tags = world_tags(w, &count);
    struct json *user = json_new_object(), *exact = json_new_object();
    json_add_string(user, "family", "tag36h11");
    struct json *sides = json_add_object(user, "side_m"), *list = json_add_array(exact, "tags");
    for (int i = 0; i < count; i++) {
        char id[16];
        snprintf(id, sizeof id, "%d", tags[i].id);
        json_add_number(sides, id, tags[i].side_m);
        struct json *tag = json_add_object(list, NULL);
        json_add_number(tag, "id", tags[i].id);
        json_add_number(tag, "size_m", tags[i].side_m);
        struct json *corners = json_add_array(tag, "corners");
        // place_tag_corners' order, computed here: the truth must not depend on what it judges
        static const double sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
        for (int k = 0; k < 4; k++) {
            double h = tags[i].side_m / 2;
            struct vec3 p = pose_apply(tags[i].world_from_tag, v3(sign[k][0] * h, sign[k][1] * h, 0));
            struct json *corner = json_add_array(corners, NULL);
            json_push_number(corner, p.x);
            json_push_number(corner, p.y);
            json_push_number(corner, p.z);
        }
    }
    enum status status = save_json(user, folder, "tags.json");
    enum status second = save_json(exact, truth, "tags_truth.json");
    return status ? status : second;
}

static void add_pose(struct text_buffer *t, double time, struct pose p)
{
    struct quat q = p.rotation;
    add(t, "%.6f %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n", time, p.translation.x, p.translation.y, p.translation.z, q.x,
        q.y, q.z, q.w);
}

static void add_joints(struct text_buffer *t, double time, const struct skeleton *s)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        add(t, "%.6f,%s,%.4f,%.4f,%.4f\n", time, joint_name((enum joint)j), s->joint[j].x, s->joint[j].y,
            s->joint[j].z);
}

// ---------------------------------------------------------------- images

struct pixels {
    uint8_t *color, *mask;
    uint16_t *depth;
};

static enum status save_jpeg(const uint8_t *rgb, const struct lens *l, const char *path)
{
    uint8_t *bytes;
    size_t count;
    enum status status = jpeg_encode(rgb, l->width, l->height, QUALITY, &bytes, &count);
    if (status)
        return status;
    status = file_write(path, bytes, count);
    free(bytes);
    return status;
}

static struct pose camera_at(const struct world *w, const struct reel *r, double t)
{
    return r->set == SET_PLACE    ? world_sweep_pose(w, t)
           : r->set == SET_SENSOR ? world_sensor_pose(w)
                                  : world_viewer_pose(w, t);
}

struct rolling_camera {
    const struct world *world;
    const struct reel *reel;
};

static struct pose rolling_camera_pose(const void *context, double time_s)
{
    const struct rolling_camera *c = context;
    return camera_at(c->world, c->reel, time_s);
}

// Frame `i` of a reel: its image, its depth, and what a viewer should have seen.
static enum status film_frame(const struct film_options *f, const struct world *w, const struct reel *r,
                              const struct lens *lens, struct pose world_from_camera, int i, double t,
                              struct pixels *px)
{
    char path[PATH_BYTES];
    uint64_t seed = f->world.seed * 1000003u + (uint64_t)i * 8 + r->set;
    struct world_shot shot = {*lens, world_from_camera, t, r->actor};
    struct world_image picture = {px->color, r->depth ? px->depth : NULL, NULL};
    enum status status = lens->readout_s > 0 ? world_render_rolling(w, &shot, rolling_camera_pose,
                                                                    &(struct rolling_camera){w, r}, t, &picture)
                                             : world_render(w, &shot, &picture);
    if (!status && r->depth && !f->clean)
        status = world_depth_noise(lens, px->depth, seed, px->depth);
    if (!status) {
        if (!f->clean)
            world_color_noise(px->color, lens->width, lens->height, seed);
        snprintf(path, sizeof path, "%s/%s/rgb/%04d.jpg", f->out, r->name, i);
        status = save_jpeg(px->color, lens, path);
    }
    if (!status && r->depth) {
        snprintf(path, sizeof path, "%s/%s/depth/%04d.png", f->out, r->name, i);
        status = png_write(path, PNG_GRAY16, px->depth, lens->width, lens->height);
    }
    if (status || r->set != SET_VIEWER)
        return status;
    shot.actor = true;
    status = world_render(w, &shot, &(struct world_image){px->color, NULL, px->mask});
    if (!status) {
        if (!f->clean)
            world_color_noise(px->color, lens->width, lens->height, seed);
        snprintf(path, sizeof path, "%s/truth/expected/%04d.jpg", f->out, i);
        status = save_jpeg(px->color, lens, path);
    }
    for (size_t k = 0; k < (size_t)lens->width * (size_t)lens->height && !status; k++)
        px->mask[k] = px->mask[k] ? 255 : 0;
    if (!status) {
        snprintf(path, sizeof path, "%s/truth/mask/%04d.png", f->out, i);
        status = png_write(path, PNG_GRAY8, px->mask, lens->width, lens->height);
    }
    return status;
}

static enum status make_folders(const struct film_options *f, const struct reel *r)
{
    const char *names[] = {"rgb", r->depth ? "depth" : "rgb"};
    char path[PATH_BYTES];
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(names) && !status; i++) {
        snprintf(path, sizeof path, "%s/%s/%s", f->out, r->name, names[i]);
        status = folder_make(path);
    }
    static const char *const truths[] = {"truth", "truth/expected", "truth/mask"};
    for (size_t i = 0; i < (r->set == SET_VIEWER ? 3u : 1u) && !status; i++) {
        snprintf(path, sizeof path, "%s/%s", f->out, truths[i]);
        status = folder_make(path);
    }
    return status;
}

// The image has the height asked for, about the lens's own centre; pixels are square.
static struct calibration calibration_of(const struct film_options *f, const struct reel *r)
{
    double scale = f->width / 640.0;
    struct calibration c = r->set == SET_VIEWER ? world_viewer_calibration(scale) : world_calibration(scale);
    struct lens *l = &c.color;
    l->cy += (f->height - l->height) / 2.0;
    l->height = f->height;
    if (f->focal_px > 0)
        l->fx = l->fy = f->focal_px;
    if (r->set != SET_VIEWER)
        c.depth = *l;
    return c;
}

static enum status film_reel(const struct film_options *f, const struct world *w, const struct reel *r,
                             struct pixels *px)
{
    enum status status = make_folders(f, r);
    if (status)
        return status;
    double rate_hz = f->rate_hz > 0 ? f->rate_hz : r->rate_hz,
           length = r->set == SET_PLACE ? WORLD_SWEEP_S : world_seconds(w);
    if (f->seconds >= 0)
        length = fmin(length, f->seconds);
    struct calibration c = calibration_of(f, r);
    c.color.readout_s = r->set == SET_SENSOR ? 0 : f->readout_s;
    struct text_buffer rgb = {0}, depth = {0}, poses = {0}, joints = {0};
    add(&poses, "# timestamp tx ty tz qx qy qz qw (world_from_camera, metres; camera x right y down z forward)\n");
    add(&joints, "timestamp,joint,x_m,y_m,z_m\n");
    int count = (int)floor(length * rate_hz + 1e-6) + 1;
    struct progress_bar bar;
    progress_bar_start(&bar, r->name, count);
    for (int i = 0; i < count && !status && !command_stopped(); i++) {
        double t = i / rate_hz, stamp = r->start_s + t;
        struct pose pose = camera_at(w, r, t);
        status = film_frame(f, w, r, &c.color, pose, i, t, px);
        add(&rgb, "%.6f rgb/%04d.jpg\n", stamp, i);
        add(&depth, "%.6f depth/%04d.png\n", stamp, i);
        add_pose(&poses, stamp, pose);
        struct skeleton s = world_joints(w, t);
        add_joints(&joints, stamp, &s);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    char folder[PATH_BYTES], truth[PATH_BYTES], name[64];
    snprintf(folder, sizeof folder, "%s/%s", f->out, r->name);
    snprintf(truth, sizeof truth, "%s/truth", f->out);
    snprintf(name, sizeof name, "%s_truth.txt", r->name);
    enum status ends[] = {save_text(&rgb, folder, "rgb.txt"), r->depth ? save_text(&depth, folder, "depth.txt") : OK,
                          save_text(&poses, truth, name),
                          r->set == SET_SENSOR ? save_text(&joints, truth, "joints_truth.csv") : OK,
                          save_calibration(&c, folder)};
    for (size_t i = 0; i < COUNT_OF(ends) && !status; i++)
        status = ends[i];
    free(depth.bytes);
    free(joints.bytes);
    return status;
}

static enum status film_all(const struct film_options *f)
{
    struct world *w;
    enum status status = world_open(&w, &f->world);
    if (status)
        return status;
    char truth[PATH_BYTES];
    snprintf(truth, sizeof truth, "%s/truth", f->out);
    size_t n = (size_t)f->width * (size_t)f->height;
    struct pixels px = {malloc(n * 3), malloc(n), malloc(n * 2)};
    if (!px.color || !px.mask || !px.depth)
        status = fail(ERR_MEMORY, "out of memory for pictures of %d x %d", f->width, f->height);
    if (!status)
        status = folder_make(truth);
    if (!status)
        status = save_tags(w, f->out, truth);
    for (size_t i = 0; i < COUNT_OF(reels) && !status && !command_stopped(); i++)
        if (f->sets & reels[i].set)
            status = film_reel(f, w, &reels[i], &px);
    free(px.color);
    free(px.mask);
    free(px.depth);
    world_close(&w);
    return status;
}

// ---------------------------------------------------------------- options

enum {
    KEY_OUT = COMMAND_KEY,
    KEY_WHAT,
    KEY_SECONDS,
    KEY_SIZE,
    KEY_FIGURE,
    KEY_MOTION,
    KEY_SEED,
    KEY_THREADS,
    KEY_CLEAN,
    KEY_READOUT,
    KEY_FOCAL,
    KEY_RATE,
    KEY_TABLE,
    KEY_BARE,
    KEY_TAGS,
    KEY_MOVED,
    KEY_AT,
    KEY_STAND,
    KEY_WALK
};

static void read_number(struct argp_state *state, const char *text, const char *option, double low, double high,
                        double *out)
{
    char *end;
    *out = strtod(text, &end);
    if (end == text || *end || !(*out >= low && *out <= high))
        argp_error(state, "--%s is '%s'; it must be a number from %g to %g", option, text, low, high);
}

// Up to the end or a colon. Returns where it ended.
static const char *read_tags(struct argp_state *state, const char *text, uint32_t *tags)
{
    const char *at = text;
    for (*tags = 0; *at && *at != ':';) {
        char *end;
        long id = strtol(at, &end, 10);
        if (end == at || (*end && *end != ',' && *end != ':') || id < 0 || id > 31)
            argp_error(state, "'%s' is no list of tags; it must be like 0,3,7", text);
        *tags |= 1u << id;
        at = *end == ',' ? end + 1 : end;
    }
    return at;
}

static void read_moved(struct argp_state *state, const char *text, struct world_moved *moved)
{
    char rest;
    const char *by = read_tags(state, text, &moved->tags);
    if (sscanf(by, ":%lf,%lf%c", &moved->right, &moved->up, &rest) != 2)
        argp_error(state, "--moved is '%s'; it must be like 0,3:0.3,-0.1", text);
}

static const double DEGREE = 3.14159265358979323846 / 180;

static void read_at(struct argp_state *state, const char *text, struct world_spot *spot)
{
    char rest;
    if (sscanf(text, "%lf,%lf,%lf%c", &spot->x, &spot->y, &spot->turned, &rest) != 3)
        argp_error(state, "--at is '%s'; it must be X,Y,DEGREES", text);
    spot->turned *= DEGREE;
}

static void read_stand(struct argp_state *state, const char *text, struct world_stand *s)
{
    char rest;
    if (sscanf(text, "%lf,%lf,%lf,%lf,%lf,%lf,%lf%c", &s->eye.x, &s->eye.y, &s->eye.z, &s->target.x, &s->target.y,
               &s->target.z, &s->roll, &rest) != 7)
        argp_error(state, "--stand is '%s'; it must be X,Y,Z,X,Y,Z,DEGREES", text);
    s->roll *= DEGREE;
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    struct film_options *f = state->input;
    double number = 0;
    char rest;
    switch (key) {
    case KEY_OUT: f->out = text; break;
    case KEY_WHAT:
        f->sets = !strcmp(text, "all") ? SET_ALL : 0;
        for (size_t i = 0; i < COUNT_OF(reels); i++)
            if (!strcmp(text, reels[i].name))
                f->sets = reels[i].set;
        if (!f->sets)
            argp_error(state, "--what is '%s'; it must be place, sensor, viewer or all", text);
        break;
    case KEY_SECONDS: read_number(state, text, "seconds", 0, 3600, &f->seconds); break;
    case KEY_SIZE:
        if (sscanf(text, "%dx%d%c", &f->width, &f->height, &rest) != 2 || f->width < 64 || f->width > 4096 ||
            f->height < 64 || f->height > 4096)
            argp_error(state, "--size is '%s'; it must be like 640x480, 64 to 4096 both ways", text);
        break;
    case KEY_FIGURE:
        if (!world_figure_named(text, &f->world.figure))
            argp_error(state, "--figure is '%s'; there are %s", text, world_figure_names());
        break;
    case KEY_MOTION: f->world.motion = text; break;
    case KEY_SEED:
        read_number(state, text, "seed", 0, 4294967295.0, &number);
        f->world.seed = (uint64_t)number;
        break;
    case KEY_THREADS:
        read_number(state, text, "threads", 1, 16, &number);
        f->world.threads = (int)number;
        break;
    case KEY_READOUT:
        read_number(state, text, "readout", 0, LENS_MAX_READOUT_S * 1e3, &number);
        f->readout_s = number * 1e-3;
        break;
    case KEY_CLEAN: f->clean = true; break;
    case KEY_FOCAL: read_number(state, text, "focal", 30, 8000, &f->focal_px); break;
    case KEY_RATE: read_number(state, text, "rate", 0.5, 240, &f->rate_hz); break;
    case KEY_TABLE: f->world.table = true; break;
    case KEY_BARE: f->world.bare = true; break;
    case KEY_TAGS:
        if (*read_tags(state, text, &f->world.tags))
            argp_error(state, "--tags is '%s'; it must be like 0,3,7", text);
        break;
    case KEY_MOVED: read_moved(state, text, &f->world.moved); break;
    case KEY_AT: read_at(state, text, &f->world.spot); break;
    case KEY_STAND: read_stand(state, text, &f->world.stand); break;
    case KEY_WALK:
        if (sscanf(text, "%lf,%lf%c", &f->world.walk.distance_m, &f->world.walk.round, &rest) != 2)
            argp_error(state, "--walk is '%s'; it must be METRES,DEGREES", text);
        f->world.walk.round *= DEGREE;
        break;
    case ARGP_KEY_END: command_require(state, f->out, "out"); break;
    default: return ARGP_ERR_UNKNOWN;
    }
    return 0;
}

int main(int argc, char **argv)
{
    static const struct argp_option options[] = {
        {"out", KEY_OUT, "DIR", 0, "Where to write place/, sensor/, viewer/, tags.json and truth/", 0},
        {"what", KEY_WHAT, "SET", 0,
         "place (the empty room, sensor in the hand), sensor (the take), viewer (a tablet that walks round) or all "
         "(the default)",
         0},
        {"seconds", KEY_SECONDS, "S", 0, "Film no more than this", 0},
        {"size", KEY_SIZE, "WxH", 0, "Of the pictures; 640x480 unless told", 0},
        {"figure", KEY_FIGURE, "NAME", 0, "woman (the default), man, child, heavy, skirt, coat, tall", 0},
        {"motion", KEY_MOTION, "NAME", 0,
         "pirouette (the default), kata, still, bend, walk, hide, visit, or the path of a .bvh file", 0},
        {"seed", KEY_SEED, "N", 0, "Of posters, hands and noise; 1 unless told", 0},
        {"threads", KEY_THREADS, "N", 0, "1 unless told; the files do not depend on it", 0},
        {"readout", KEY_READOUT, "MS", 0,
         "Cameras in the hand have a rolling shutter: the last row is read this much after the first", 0},
        {"clean", KEY_CLEAN, NULL, 0, "No noise on colour and depth", 0},
        {"focal", KEY_FOCAL, "PX", 0,
         "The camera's focal length, pixels of its picture; 525/640 of the width, the tablet's 545/640, unless told",
         0},
        {"rate", KEY_RATE, "HZ", 0, "Pictures a second; 10, the take 30, unless told", 0},
        {"table", KEY_TABLE, NULL, 0, "A table to the right of the actor's way", 0},
        {"bare", KEY_BARE, NULL, 0, "No pictures on the walls, no rug", 0},
        {"tags", KEY_TAGS, "LIST", 0, "Which of the tags 0 to 14 hang: 0,3,7; all unless told", 0},
        {"moved", KEY_MOVED, "LIST:RIGHT,UP", 0, "Tags that hang so many metres from where they hung", 0},
        {"at", KEY_AT, "X,Y,DEGREES", 0, "Where the motion takes place, and how far it is turned", 0},
        {"stand", KEY_STAND, "X,Y,Z,X,Y,Z,DEGREES", 0,
         "Where the sensor stands, what it looks at, and how far it is rolled; 0.1,-3.1,1.15,0.02,0,1,0.23 unless told",
         0},
        {"walk", KEY_WALK, "METRES,DEGREES", 0, "How far from the actor the viewer walks, and how far round", 0},
        {0},
    };
    static const struct argp argp = {
        options,
        parse,
        NULL,
        "Films the small world that the tests know: a room with tags, and a figure that moves in it, "
        "as folders in the TUM RGB-D layout with the truth beside them.",
        NULL,
        NULL,
        NULL};
    struct film_options f = {
        .sets = SET_ALL, .seconds = -1, .width = 640, .height = 480, .world = world_default_options()};
    argp_err_exit_status = 2;
    argp_parse(&argp, argc, argv, 0, NULL, &f);
    command_catch_signals();
    return film_all(&f) ? command_failed("film-world") : 0;
}
