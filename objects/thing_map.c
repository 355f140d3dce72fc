#include "objects/thing_map.h"

#include "base/depth_noise.h"
#include "base/linear_algebra.h"
#include "base/text.h"
#include "objects/thing.h"
#include "platform/files/json.h"
#include "platform/network/http_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- thing list

// `name` beside the file `path`.
static void path_beside(const char *path, const char *name, char *out, size_t bytes)
{
    const char *slash = strrchr(path, '/');
    const int folder = name[0] == '/' || !slash ? 0 : (int)(slash - path + 1);
    snprintf(out, bytes, "%.*s%s", folder, path, name);
}

static enum status read_thing(const struct json *object, const char *path, struct thing *out)
{
    const char *name = NULL, *picture = NULL, *url = "";
    char file[1024];
    if (!json_get_string(json_member(object, "name"), &name) || !*name || strlen(name) >= THING_NAME_BYTES)
        return fail(ERR_INPUT, "%s: each object needs a \"name\" of at most %d bytes", path, THING_NAME_BYTES - 1);
    if (!text_is_printable(name))
        return fail(ERR_INPUT, "%s: an object's name is not UTF-8 or holds control characters", path);
    if (!json_get_string(json_member(object, "picture"), &picture))
        return fail(ERR_INPUT, "%s: '%s' needs a \"picture\"", path, name);
    (void)json_get_string(json_member(object, "url"), &url);
    if (!text_is_printable(url))
        return fail(ERR_INPUT, "%s: the url of '%s' is not UTF-8 or holds control characters", path, name);
    if (strlen(url) >= THING_URL_BYTES)
        return fail(ERR_INPUT, "%s: the url of '%s' is longer than %d bytes", path, name, THING_URL_BYTES - 1);
    if (!json_get_number(json_member(object, "width_m"), &out->width_m) ||
        !json_get_number(json_member(object, "height_m"), &out->height_m) ||
        !(out->width_m > 0.001 && out->width_m < 100 && out->height_m > 0.001 && out->height_m < 100))
        return fail(ERR_INPUT, "%s: '%s' needs \"width_m\" and \"height_m\", in metres", path, name);
    strcpy(out->name, name);
    strcpy(out->url, url);
    address_hide_user(out->url); // it is kept and shown
    path_beside(path, picture, file, sizeof file);
    enum status status = image_read(file, &out->picture);
    if (status == OK && (out->picture.width < 24 || out->picture.height < 24))
        status = fail(ERR_INPUT, "%s: the picture is smaller than 24 x 24 pixels", file);
    return status;
}

enum status thing_list_read(const char *path, struct thing_list *out)
{
    struct json *root;
    *out = (struct thing_list){0};
    enum status status = json_read(path, &root);
    const struct json *objects = json_member(root, "objects");
    const int count = json_count(objects);
    if (status == OK && (!json_is_array(objects) || count < 1 || count > THINGS_MOST))
        status = fail(ERR_INPUT, "%s: \"objects\" lists 1 to %d things", path, THINGS_MOST);
    if (status == OK && !(out->things = calloc((size_t)count, sizeof *out->things)))
        status = fail(ERR_MEMORY, "%s: no memory", path);
    for (int i = 0; i < count && status == OK; i++) {
        status = read_thing(json_at(objects, i), path, &out->things[i]);
        out->count++;
        for (int k = 0; k < i && status == OK; k++)
            if (!strcmp(out->things[k].name, out->things[i].name))
                status = fail(ERR_INPUT, "%s: two things have the name '%s'", path, out->things[i].name);
    }
    json_free(&root);
    if (status != OK)
        thing_list_free(out);
    return status;
}

void thing_list_free(struct thing_list *list)
{
    for (int i = 0; i < list->count; i++)
        free(list->things[i].picture.rgb);
    free(list->things);
    *list = (struct thing_list){0};
}

// ---------------------------------------------------------------- thing update

// A picture or model; what there was stays where the server does not give another.
static void ask_content(const char *url, const struct http_limits *options, struct thing_content *content,
                        struct thing_update *out)
{
    struct http_limits limits = *options;
    struct http_answer answer;
    limits.most_bytes = THING_CONTENT_MAX;
    if (!url[0])
        return;
    if (http_get(url, NULL, &limits, &answer) != OK) {
        snprintf(out->content_trouble, sizeof out->content_trouble, "%s", status_message());
        return;
    }
    if (!answer.count) {
        free(answer.body);
        return;
    }
    free(content->bytes);
    *content = (struct thing_content){answer.body, answer.count};
    out->changed = true;
}

void thing_update_ask(struct recorded_thing *thing, const char *base, const char *reference,
                      const struct http_limits *limits, struct thing_update *out)
{
    char *before = thing->knowledge ? strdup(thing->knowledge) : NULL;
    struct known k = {.text = thing->knowledge};
    *out = (struct thing_update){.changed = false};
    snprintf(k.url, sizeof k.url, "%s", thing->url);
    snprintf(k.etag, sizeof k.etag, "%s", thing->knowledge ? thing->etag : ""); // else the whole answer is wanted
    const enum status status = thing_knowledge_fetch(base, reference, limits, &k);
    snprintf(out->trouble, sizeof out->trouble, "%s", k.trouble);
    thing->knowledge = k.text;
    // A server that gives no ETag sends the same again and again.
    out->changed = k.text && (!before || strcmp(before, k.text) != 0 || strcmp(thing->url, k.url) != 0);
    free(before);
    strcpy(thing->url, k.url);
    strcpy(thing->etag, k.etag);
    out->known = k.text && thing_knowledge_parse(k.text, strlen(k.text), k.url, &out->knowledge) == OK;
    if (status < OK || !out->known)
        return;
    if (out->changed || !thing->image.bytes)
        ask_content(out->knowledge.image, limits, &thing->image, out);
    if (out->changed || !thing->model.bytes)
        ask_content(out->knowledge.model, limits, &thing->model, out);
}

// ---------------------------------------------------------------- thing matches

// Farther apart than this is chance: unrelated SIFT descriptors (of length 512) are about 500 apart. Chosen by hand.
enum { FARTHEST2 = 400 * 400 };

// Where most of the time goes. Compilers have one instruction for eight such products and their sums, but not between
// a sanitizer's checks of each.
__attribute__((no_sanitize("address", "undefined"))) static int32_t squared_distance(const int16_t *a, const int16_t *b)
{
    int32_t sum = 0;
    for (int i = 0; i < SCALE_FEATURE_DIMENSIONS; i++) {
        const int16_t d = (int16_t)(a[i] - b[i]);
        sum += d * d;
    }
    return sum;
}

int thing_matches(const struct thing_model *model, const struct thing_view *view, struct thing_match *out, int capacity)
{
    int count = 0;
    for (int c = 0; c < MODEL_CHANNELS; c++)
        for (int i = 0; i < model->feature_count[c]; i++) {
            struct thing_match best[2] = {{NULL, NULL, FARTHEST2}, {NULL, NULL, FARTHEST2}};
            for (int k = 0; k < view->feature_count[c]; k++) {
                const int32_t d = squared_distance(model->features[c][i].descriptor, view->features[c][k].descriptor);
                if (d >= best[1].distance2)
                    continue;
                const struct thing_match now = {&model->features[c][i], &view->features[c][k], d};
                if (d < best[0].distance2) {
                    best[1] = best[0];
                    best[0] = now;
                } else {
                    best[1] = now;
                }
            }
            for (int k = 0; k < 2 && count < capacity; k++)
                if (best[k].scene)
                    out[count++] = best[k];
        }
    return count;
}

// ---------------------------------------------------------------- thing visibility

// Chosen by hand, on the safe side of what is recognised. MIN_PX: side of a square of as many pixels as it covers;
// MIN_FACING: cosine of the angle at which it is seen; MARGIN_PX: from the image's edge.
#define MIN_PX     60.0
#define MIN_FACING 0.72
#define MARGIN_PX  6.0
#define NEAREST_M  0.25
// Depth: NEARER_M + NEARER_SHARE of the distance nearer than the thing is before it, so much farther is beyond it. Of
// the samples at most HIDDEN_SHARE may be before it, at least READ_SHARE must be there, and EMPTY_SHARE of those make
// the place empty.
#define NEARER_M     0.04
#define NEARER_SHARE 0.02
#define HIDDEN_SHARE 0.1
#define READ_SHARE   0.5
#define EMPTY_SHARE  0.7
enum { VISIBILITY_SIDE = 9 };

// The pixels that its front covers; 0: a corner is not well inside the image.
static double covered_px(const struct thing *thing, const struct pose *camera_from_thing, const struct lens *lens)
{
    static const double corner[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    const double largest = lens_max_radius2(lens);
    struct pixel px[4];
    double area = 0;
    for (int i = 0; i < 4; i++) {
        const struct vec3 p =
            pose_apply(*camera_from_thing, v3(corner[i][0] * thing->width_m, corner[i][1] * thing->height_m, 0));
        if (!(p.z > NEAREST_M))
            return 0;
        px[i] = lens_project_clamped(lens, largest, p);
        if (px[i].x < MARGIN_PX || px[i].y < MARGIN_PX || px[i].x > lens->width - 1 - MARGIN_PX ||
            px[i].y > lens->height - 1 - MARGIN_PX)
            return 0;
    }
    for (int i = 0; i < 4; i++)
        area += px[i].x * px[(i + 1) % 4].y - px[(i + 1) % 4].x * px[i].y;
    return fabs(area) / 2;
}

// The depth sample at a point, over the point's own depth; 0: none.
static double depth_ratio(const struct depth_view *view, struct vec3 in_camera, double *z_m)
{
    const struct vec3 p = pose_apply(view->depth_from_color, in_camera);
    *z_m = p.z;
    if (!(p.z > 0.1))
        return 0;
    const struct pixel px = lens_project(&view->lens, p);
    const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
    if (!(x >= 0 && y >= 0 && x < view->lens.width && y < view->lens.height))
        return 0;
    return view->depth[(size_t)y * (size_t)view->lens.width + (size_t)x] * 1e-3 / p.z;
}

enum thing_sight thing_sight_of(const struct thing *thing, struct pose camera_from_thing, const struct lens *lens,
                                const struct depth_view *depth)
{
    const struct vec3 to_thing = camera_from_thing.translation;
    const double facing = v3_dot(quat_rotate(camera_from_thing.rotation, v3(0, 0, 1)), v3_unit(to_thing));
    if (!depth || !(to_thing.z > NEAREST_M) || facing < MIN_FACING ||
        covered_px(thing, &camera_from_thing, lens) < MIN_PX * MIN_PX)
        return SIGHT_NONE;
    int read = 0, before = 0, beyond = 0;
    for (int i = 0; i < VISIBILITY_SIDE * VISIBILITY_SIDE; i++) {
        const double u = (double)(i % VISIBILITY_SIDE) / (VISIBILITY_SIDE - 1) - 0.5,
                     v = (double)(i / VISIBILITY_SIDE) / (VISIBILITY_SIDE - 1) - 0.5;
        const struct vec3 at = v3(0.9 * u * thing->width_m, 0.9 * v * thing->height_m, 0);
        double z_m;
        const double ratio = depth_ratio(depth, pose_apply(camera_from_thing, at), &z_m);
        if (!(ratio > 0))
            continue;
        const double off_m = (ratio - 1) * z_m, clear_m = NEARER_M + NEARER_SHARE * z_m;
        read++;
        before += off_m < -clear_m;
        // A solid of revolution bends away from its front by half its width.
        beyond += off_m > clear_m + thing->width_m / 2;
    }
    if (read < READ_SHARE * VISIBILITY_SIDE * VISIBILITY_SIDE || before > HIDDEN_SHARE * read)
        return SIGHT_NONE;
    return beyond >= EMPTY_SHARE * read ? SIGHT_EMPTY : SIGHT_OCCUPIED;
}

// ---------------------------------------------------------------- thing depth

// Chosen by hand. MIDDLE: half of the front's share that is sampled: nearer to its rim a solid is bent away. BIAS: of a
// structured-light sensor's depth that is common to neighbouring samples, share of the depth. CONTRADICTION: share of
// the distance beyond which size and depth speak of two things.
enum { DEPTH_SIDE = 9, LEAST = 12 };
#define MIDDLE        0.18
#define BIAS          0.004
#define CONTRADICTION 0.15

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Measured over predicted depth at points of the front's middle, sorted; their number.
static int ratios_of(const struct sighting *sighting, const struct thing *thing, const struct depth_view *view,
                     double ratio[DEPTH_SIDE * DEPTH_SIDE])
{
    int count = 0;
    for (int i = 0; i < DEPTH_SIDE * DEPTH_SIDE; i++) {
        const double u = 2.0 * (i % DEPTH_SIDE) / (DEPTH_SIDE - 1) - 1,
                     v = 2.0 * (i / DEPTH_SIDE) / (DEPTH_SIDE - 1) - 1;
        const struct vec3 at = v3(MIDDLE * u * thing->width_m, MIDDLE * v * thing->height_m, 0);
        const struct vec3 p = pose_apply(view->depth_from_color, pose_apply(sighting->left_from_thing, at));
        if (!(p.z > 0.1))
            continue;
        const struct pixel px = lens_project(&view->lens, p);
        const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
        if (!(x >= 0 && y >= 0 && x < view->lens.width && y < view->lens.height))
            continue;
        const uint16_t mm = view->depth[(size_t)y * (size_t)view->lens.width + (size_t)x];
        if (mm)
            ratio[count++] = mm * 1e-3 / p.z;
    }
    qsort(ratio, (size_t)count, sizeof *ratio, compare_doubles);
    return count;
}

enum status sighting_by_depth(struct sighting *sighting, const struct thing *thing, const struct depth_view *view)
{
    double ratio[DEPTH_SIDE * DEPTH_SIDE];
    const int count = ratios_of(sighting, thing, view, ratio);
    if (count < LEAST)
        return NOTHING;
    const struct vec3 at = sighting->left_from_thing.translation, ray = v3_unit(at);
    const double distance = v3_length(at), measured = distance * ratio[count / 2];
    const double before = covariance3_along(&sighting->covariance, ray);
    if (!(fabs(measured - distance) < CONTRADICTION * distance + 4 * sqrt(before)))
        return AMBIGUOUS;
    const double noise = depth_sigma_m(measured), bias = BIAS * measured;
    const double variance = bias * bias + 1.5707963 * noise * noise / count; // of a median: pi / 2 of a mean's
    const double gain = before / (before + variance);
    const double fused = distance + gain * (measured - distance);
    // All of it lies along the ray; only the component along it shrinks.
    const struct covariance3 shrink = covariance3_outer(v3_scale(ray, sqrt(gain * before)));
    const struct covariance3 minus = covariance3_scale(&shrink, -1);
    sighting->left_from_thing.translation = v3_scale(at, fused / distance);
    sighting->covariance = covariance3_add(&sighting->covariance, &minus);
    return OK;
}

// ---------------------------------------------------------------- thing map

#define OUTSIDE   16.27 // chi^2 with 3 degrees of freedom, 99.9 %
#define BY_HAND_M 0.1   // standard deviation of a place without a covariance: chosen by hand
#define JITTER2   1e-8  // m^2, added before inverting: 0.1 mm

static bool invert_covariance(const struct covariance3 *covariance3, double out[9])
{
    const double m[9] = {covariance3->xx + JITTER2, covariance3->xy,           covariance3->xz,
                         covariance3->xy,           covariance3->yy + JITTER2, covariance3->yz,
                         covariance3->xz,           covariance3->yz,           covariance3->zz + JITTER2};
    return invert_symmetric(m, 3, out);
}

static struct vec3 multiply_vector(const double m[9], struct vec3 v)
{
    return v3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
              m[6] * v.x + m[7] * v.y + m[8] * v.z);
}

static bool are_points_apart(struct vec3 a, const struct covariance3 *ca, struct vec3 b, const struct covariance3 *cb)
{
    const struct covariance3 sum = covariance3_add(ca, cb);
    const struct vec3 d = v3_sub(a, b);
    double m[9];
    return invert_covariance(&sum, m) && v3_dot(d, multiply_vector(m, d)) > OUTSIDE;
}

// a and its covariance become the information-weighted mean with b.
static void fuse_positions(struct vec3 *a, struct covariance3 *ca, struct vec3 b, const struct covariance3 *cb)
{
    double ia[9], ib[9], sum[9], mean[9];
    if (!invert_covariance(ca, ia) || !invert_covariance(cb, ib))
        return;
    for (int i = 0; i < 9; i++)
        sum[i] = ia[i] + ib[i];
    if (!invert_symmetric(sum, 3, mean))
        return;
    *a = multiply_vector(mean, v3_add(multiply_vector(ia, *a), multiply_vector(ib, b)));
    *ca = (struct covariance3){mean[0], mean[1], mean[2], mean[4], mean[5], mean[8]};
}

static struct mapped_thing *map_entry(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing)
            return &map->things[i];
    if (map->count == THINGS_MOST)
        return NULL;
    map->things[map->count] = (struct mapped_thing){.thing = thing};
    return &map->things[map->count++];
}

void thing_map_know(struct thing_map *map, int thing, const struct pose *world_from_thing,
                    const struct covariance3 *covariance)
{
    struct mapped_thing *t = map_entry(map, thing);
    if (!t)
        return;
    *t = (struct mapped_thing){.thing = thing, .world_from_thing = *world_from_thing, .known = true};
    t->covariance = covariance3_trace(covariance) > 0 ? *covariance : covariance3_isotropic(BY_HAND_M * BY_HAND_M);
}

static void move_thing(struct mapped_thing *thing, struct quat rotation)
{
    thing->world_from_thing = (struct pose){rotation, thing->elsewhere};
    thing->covariance = thing->elsewhere_covariance;
    thing->moves++;
    thing->doubted = false;
}

void thing_map_add(struct thing_map *map, const struct sighting *sighting, const struct pose *world_from_left)
{
    struct mapped_thing *t = map_entry(map, sighting->thing);
    const struct pose world = pose_multiply(*world_from_left, sighting->left_from_thing);
    const struct covariance3 c = covariance3_rotate(world_from_left->rotation, &sighting->covariance);
    if (!t)
        return;
    t->misses = 0;
    t->gone = false;
    if (!t->sightings++ && !t->known) {
        t->world_from_thing = world;
        t->covariance = c;
        return;
    }
    if (!are_points_apart(t->world_from_thing.translation, &t->covariance, world.translation, &c)) {
        if (covariance3_trace(&c) < covariance3_trace(&t->covariance))
            t->world_from_thing.rotation = world.rotation;
        fuse_positions(&t->world_from_thing.translation, &t->covariance, world.translation, &c);
        t->doubted = false;
        return;
    }
    if (t->doubted && !are_points_apart(t->elsewhere, &t->elsewhere_covariance, world.translation, &c)) {
        fuse_positions(&t->elsewhere, &t->elsewhere_covariance, world.translation, &c);
        move_thing(t, world.rotation);
        return;
    }
    t->doubted = true;
    t->elsewhere = world.translation;
    t->elsewhere_rotation = world.rotation;
    t->elsewhere_covariance = c;
}

void thing_map_absent(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++) {
        struct mapped_thing *t = &map->things[i];
        if (t->thing == thing && t->doubted)
            move_thing(t, t->elsewhere_rotation);
        else if (t->thing == thing)
            t->gone = true;
    }
}

void thing_map_miss(struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing && ++map->things[i].misses >= THING_MISSES_TO_GONE)
            map->things[i].gone = true;
}

const struct mapped_thing *thing_map_find(const struct thing_map *map, int thing)
{
    for (int i = 0; i < map->count; i++)
        if (map->things[i].thing == thing)
            return &map->things[i];
    return NULL;
}
