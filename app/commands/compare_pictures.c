#include "app/commands/compare_pictures.h"

#include "compare/joint_samples.h"
#include "platform/files/png.h"
#include "reenact/render/actor_renderer.h"

#include <stdlib.h>

enum { WIDTH = 330, HEIGHT = 440 };
static const double FOCAL_PX = 900;

struct compare_pictures {
    struct recording *recording;
    struct take *take;
    struct gpu *gpu;
    struct renderer *renderer;
    struct lens lens;
    int64_t first_ns; // of the comparison's time 0
    uint8_t *rgba, *ground;
};

static enum status open_take(struct compare_pictures *p, const char *path, const char *name)
{
    enum status status = recording_open(&p->recording, path);
    if (status == OK)
        status = take_open_drawn(&p->take, p->recording, name ? name : recording_take_name(p->recording, 0));
    if (status != OK)
        return status;
    const int64_t first = take_first_sample(p->take);
    if (first < 0)
        return fail(ERR_INPUT, "no person was tracked in %s", path);
    p->first_ns = take_entry(p->take, first)->time_ns;
    return OK;
}

enum status compare_pictures_open(struct compare_pictures **out, const char *path, const char *take)
{
    struct compare_pictures *p = *out = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for pictures");
    p->lens = (struct lens){.width = WIDTH,
                            .height = HEIGHT,
                            .fx = FOCAL_PX,
                            .fy = FOCAL_PX,
                            .cx = (WIDTH - 1) / 2.0,
                            .cy = (HEIGHT - 1) / 2.0};
    struct renderer_options how = renderer_default_options();
    enum status status = open_take(p, path, take);
    if (status == OK)
        status = gpu_open(&p->gpu);
    if (status == OK)
        status = renderer_open(&p->renderer, p->gpu, p->take, &p->lens, &how);
    p->rgba = malloc((size_t)WIDTH * HEIGHT * 4);
    p->ground = calloc((size_t)WIDTH * HEIGHT, 3);
    if (status == OK && (!p->rgba || !p->ground))
        status = fail(ERR_MEMORY, "no memory for pictures");
    if (status != OK)
        compare_pictures_close(out);
    return status;
}

void compare_pictures_close(struct compare_pictures **out)
{
    struct compare_pictures *p = *out;
    *out = NULL;
    if (!p)
        return;
    renderer_close(&p->renderer);
    gpu_close(&p->gpu);
    take_close(&p->take);
    recording_free(&p->recording);
    free(p->rgba);
    free(p->ground);
    free(p);
}

static int64_t nearest(const struct compare_pictures *p, int64_t time_ns)
{
    int64_t best = -1, least = INT64_MAX;
    for (int64_t i = 0; i < take_frame_count(p->take); i++) {
        const int64_t off = llabs(take_entry(p->take, i)->time_ns - time_ns);
        if (off < least && take_frame_is_sample(p->take, i)) {
            least = off;
            best = i;
        }
    }
    return best;
}

struct person {
    struct vec3 joint[JOINT_COUNT]; // world; without a place the level camera's, z up (skeleton_track.h)
    bool known[JOINT_COUNT];
    struct vec3 left, up, middle;
    double reach_m; // of the farthest joint from the middle
};

static bool person_of(const struct compare_pictures *p, int64_t frame, struct person *out)
{
    const struct take_entry *entry = take_entry(p->take, frame);
    struct vec3 low = v3(1e9, 1e9, 1e9), high = v3(-1e9, -1e9, -1e9);
    for (int j = 0; j < JOINT_COUNT; j++) {
        out->known[j] = entry->skeleton.confidence[j] > 0;
        out->joint[j] = entry->located
                            ? pose_apply(entry->world_from_camera, entry->skeleton.joint[j])
                            : v3(entry->skeleton.joint[j].x, entry->skeleton.joint[j].z, -entry->skeleton.joint[j].y);
        if (!out->known[j])
            continue;
        const struct vec3 v = out->joint[j];
        low = v3(fmin(low.x, v.x), fmin(low.y, v.y), fmin(low.z, v.z));
        high = v3(fmax(high.x, v.x), fmax(high.y, v.y), fmax(high.z, v.z));
    }
    const bool hips = out->known[JOINT_LEFT_HIP] && out->known[JOINT_RIGHT_HIP];
    const enum joint l = hips ? JOINT_LEFT_HIP : JOINT_LEFT_SHOULDER, r = hips ? JOINT_RIGHT_HIP : JOINT_RIGHT_SHOULDER;
    out->up = v3(0, 0, 1);
    const struct vec3 across = v3_sub(out->joint[l], out->joint[r]);
    out->left = v3_unit(v3_sub(across, v3_scale(out->up, v3_dot(across, out->up))));
    out->middle = v3_mix(low, high, 0.5);
    out->reach_m = 0.5 * v3_distance(low, high);
    return out->known[l] && out->known[r] && v3_length(out->left) > 0.5;
}

// A camera before the person, turned to their left by azimuth_rad, level, so far away that they fill the picture.
static struct pose camera_before(const struct person *who, double azimuth_rad)
{
    const struct vec3 ahead = v3_cross(who->left, who->up),
                      from = v3_add(v3_scale(ahead, cos(azimuth_rad)), v3_scale(who->left, sin(azimuth_rad))),
                      z = v3_scale(from, -1), y = v3_scale(who->up, -1), x = v3_cross(y, z);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    const double away_m = FOCAL_PX * (who->reach_m + 0.1) / (0.5 * HEIGHT);
    return (struct pose){.rotation = quat_from_matrix(m), .translation = v3_add(who->middle, v3_scale(from, away_m))};
}

// The part's two joints in the picture.
static void mark(const struct compare_pictures *p, const struct person *who, struct pose world_from_camera, int part,
                 struct report_picture *out)
{
    if (part < 0 || !who->known[part_ends[part].from] || !who->known[part_ends[part].to])
        return;
    const struct pose camera_from_world = pose_inverse(world_from_camera);
    const struct pixel from = lens_project(&p->lens, pose_apply(camera_from_world, who->joint[part_ends[part].from])),
                       to = lens_project(&p->lens, pose_apply(camera_from_world, who->joint[part_ends[part].to]));
    out->marked = true;
    out->from_px[0] = from.x;
    out->from_px[1] = from.y;
    out->to_px[0] = to.x;
    out->to_px[1] = to.y;
}

enum status compare_pictures_draw(struct compare_pictures *p, double time_s, double azimuth_rad, int part,
                                  struct report_picture *out)
{
    struct person who;
    *out = (struct report_picture){0};
    const int64_t frame = nearest(p, p->first_ns + (int64_t)(time_s * 1e9));
    if (frame < 0 || !person_of(p, frame, &who))
        return NOTHING;
    const struct renderer_view view = {.world_from_camera = camera_before(&who, azimuth_rad),
                                       .time_ns = take_entry(p->take, frame)->time_ns - take_entry(p->take, 0)->time_ns,
                                       .color = p->ground};
    struct renderer_result result;
    enum status status = renderer_draw(p->renderer, &view, &result);
    if (status == OK && !result.parts)
        return NOTHING;
    if (status == OK)
        status = renderer_read_actor(p->renderer, p->rgba);
    if (status == OK)
        status = png_encode(&(struct png_layout){PNG_RGBA8, WIDTH, HEIGHT}, p->rgba, 6, &out->png, &out->png_size);
    out->width_px = WIDTH;
    out->height_px = HEIGHT;
    if (status == OK)
        mark(p, &who, view.world_from_camera, part, out);
    return status;
}
