// film-world: renders the small world into folders, as a sensor and a tablet's camera would have recorded it, with the
// truth beside them.
#include "app/commands/command.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "tests/world/film/film_options.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PATH_BYTES = 4096, QUALITY = 93 };

// A text that grows, written to its file at the end.
struct text_buffer {
    char *bytes;
    size_t count, capacity;
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
    if (t->count + (size_t)n > t->capacity) {
        size_t capacity = 2 * t->capacity + 4096;
        char *bigger = realloc(t->bytes, capacity);
        if (!bigger) {
            t->failed = true;
            return;
        }
        t->bytes = bigger;
        t->capacity = capacity;
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

struct filming {
    const struct film_options *options;
    const struct world *world;
    const struct reel *reel;
    struct pixels *pixels; // buffers
};

// Writes frame `i` of a reel, at t seconds: its image, its depth, and what a viewer should have seen.
static enum status film_frame(const struct filming *film, const struct lens *lens, struct pose world_from_camera, int i,
                              double t)
{
    const struct film_options *f = film->options;
    const struct reel *r = film->reel;
    const struct world *w = film->world;
    struct pixels *px = film->pixels;
    char path[PATH_BYTES];
    uint64_t seed = f->world.seed * 1000003u + (uint64_t)i * 8 + r->set;
    struct world_shot shot = {*lens, world_from_camera, t, r->actor};
    struct world_image image = {px->color, r->depth ? px->depth : NULL, NULL};
    enum status status = lens->readout_s > 0 ? world_render_rolling(w, &shot, rolling_camera_pose,
                                                                    &(struct rolling_camera){w, r}, t, &image)
                                             : world_render(w, &shot, &image);
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
        status = film_frame(&(struct filming){f, w, r, px}, &c.color, pose, i, t);
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
        status = fail(ERR_MEMORY, "out of memory for images of %d x %d", f->width, f->height);
    if (!status)
        status = folder_make(truth);
    if (!status)
        status = save_tags(w, f->out, truth);
    for (size_t i = 0; i < FILM_REELS && !status && !command_stopped(); i++)
        if (f->sets & film_reels[i].set)
            status = film_reel(f, w, &film_reels[i], &px);
    free(px.color);
    free(px.mask);
    free(px.depth);
    world_close(&w);
    return status;
}

int main(int argc, char **argv)
{
    struct film_options f;
    film_read_options(argc, argv, &f);
    command_catch_signals();
    return film_all(&f) ? command_failed("film-world") : 0;
}
