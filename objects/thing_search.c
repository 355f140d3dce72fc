#include "objects/thing_search.h"

#include "objects/thing_map.h"
#include "objects/thing_recognition.h"
#include "platform/files/jpeg.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- sweep pictures

// Chosen by hand. NEIGHBOURS: on either side, which show about the same; SHARP: of the sharpest of them.
enum { NEIGHBOURS = 3, QUALITY = 92 };
static const double SHARP = 0.5;

void sweep_pictures_start(struct sweep_pictures *pictures, const struct calibration *calibration)
{
    *pictures = (struct sweep_pictures){.calibration = *calibration, .stride = 1};
    struct lens *l = &pictures->depth_lens;
    *l = calibration->depth;
    if (!(l->width > 1 && l->height > 1)) {
        *l = (struct lens){0};
        return;
    }
    l->width /= 2, l->height /= 2; // every second sample, from the first on
    l->fx /= 2, l->fy /= 2, l->cx /= 2, l->cy /= 2;
}

static void free_picture(struct sweep_picture *picture)
{
    free(picture->jpeg);
    free(picture->depth);
    *picture = (struct sweep_picture){0};
}

void sweep_pictures_free(struct sweep_pictures *pictures)
{
    for (int i = 0; i < pictures->count; i++)
        free_picture(&pictures->pictures[i]);
    *pictures = (struct sweep_pictures){0};
}

// Of green: the variance of the difference of neighbours in a row, over that of values eight pixels apart. Motion blur
// and defocus take the first away and leave the second.
static double sharpness_of(const uint8_t *rgb, int width, int height)
{
    enum { FAR = 8 };
    double near = 0, far = 1;
    for (int y = 0; y < height; y += 2)
        for (int x = 0; x + FAR < width; x += 2) {
            const uint8_t *p = rgb + 3 * ((size_t)y * (size_t)width + (size_t)x) + 1;
            const int a = p[3] - p[0], b = p[(size_t)3 * FAR] - p[0];
            near += a * a;
            far += b * b;
        }
    return near / far;
}

static void thin_out(struct sweep_pictures *pictures)
{
    int kept = 0;
    for (int i = 0; i < pictures->count; i++)
        if (i % 2)
            free_picture(&pictures->pictures[i]);
        else
            pictures->pictures[kept++] = pictures->pictures[i];
    pictures->count = kept;
    pictures->stride *= 2;
}

static enum status copy_jpeg(const struct sweep_pictures *pictures, const struct frame *frame,
                             struct sweep_picture *picture)
{
    const struct lens *l = &pictures->calibration.color;
    if (!frame->jpeg)
        return jpeg_encode(frame->color, l->width, l->height, QUALITY, &picture->jpeg, &picture->jpeg_bytes);
    if (!(picture->jpeg = malloc(frame->jpeg_bytes)))
        return fail(ERR_MEMORY, "no memory for a picture of the sweep");
    memcpy(picture->jpeg, frame->jpeg, frame->jpeg_bytes);
    picture->jpeg_bytes = frame->jpeg_bytes;
    return OK;
}

static enum status copy_depth(const struct sweep_pictures *pictures, const uint16_t *depth,
                              struct sweep_picture *picture)
{
    const struct lens *l = &pictures->depth_lens;
    if (!(picture->depth = malloc(sizeof *picture->depth * (size_t)l->width * (size_t)l->height)))
        return fail(ERR_MEMORY, "no memory for a depth picture of the sweep");
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++)
            picture->depth[y * l->width + x] =
                depth[(size_t)2 * (size_t)y * (size_t)pictures->calibration.depth.width + 2 * (size_t)x];
    return OK;
}

enum status sweep_pictures_add(struct sweep_pictures *pictures, const struct frame *frame)
{
    if (!frame->color || pictures->seen++ % pictures->stride)
        return OK;
    if (pictures->count == SWEEP_PICTURES_MAX)
        thin_out(pictures);
    if ((pictures->seen - 1) % pictures->stride)
        return OK;
    struct sweep_picture *p = &pictures->pictures[pictures->count];
    const struct lens *l = &pictures->calibration.color;
    *p =
        (struct sweep_picture){.time_ns = frame->time_ns, .sharpness = sharpness_of(frame->color, l->width, l->height)};
    enum status status = copy_jpeg(pictures, frame, p);
    if (status == OK && frame->depth && pictures->depth_lens.width)
        status = copy_depth(pictures, frame->depth, p);
    if (status == OK)
        pictures->count++;
    else
        free_picture(p);
    return status;
}

bool sweep_picture_is_sharp(const struct sweep_pictures *pictures, int picture)
{
    double best = 0;
    for (int i = picture - NEIGHBOURS; i <= picture + NEIGHBOURS; i++)
        if (i >= 0 && i < pictures->count && pictures->pictures[i].sharpness > best)
            best = pictures->pictures[i].sharpness;
    return pictures->pictures[picture].sharpness >= SHARP * best;
}

// ---------------------------------------------------------------- thing search

// Standard deviation of a picture's position in its place, metres; chosen by hand, above what keyframes of a mapped
// place have.
#define POSE_SIGMA_M 0.002
// How far away a thing may be: the length of a room.
#define FARTHEST_M 8

// Viewpoints so far apart, or that look another way by so much, are two: errors of one are not those of the other.
// Chosen by hand.
#define APART_M   0.1
#define APART_RAD 0.12
// Of a miss where depth shows that the place is empty, and where something stands there that was not recognised.
#define EMPTY_VOTE    1.0
#define OCCUPIED_VOTE 0.5
#define ABSENT        3.0
enum { MISSES_MAX = 12 };
#define SAME_PLACE 0.5 // of its larger side: it stands there still

// What is expected of a thing, and where it was in clear sight and not recognised.
struct expectation {
    bool any;
    struct pose world_from_thing;
    struct covariance3 covariance;
    struct pose missed_from[MISSES_MAX]; // world_from_camera
    int misses;
    double absent;
    bool there; // it was recognised at its place
};

struct searched {
    struct lens lens;
    struct pose world_from_camera;
    uint8_t *rgb;
    uint16_t *depth; // NULL: none
    struct depth_view depth_view;
    struct detection *detections;
    int count;
};

struct thing_search {
    const struct thing_list *things;
    struct recognizer *recognizer;
    struct thing_traits traits[THINGS_MOST];
    struct expectation expected[THINGS_MOST];
    struct pose kept_from[THINGS_MOST]; // the viewpoint from which a thing was kept last
    bool kept[THINGS_MOST];
    struct searched *pictures;
    int count;
};

enum status thing_search_open(struct thing_search **out, const struct thing_list *things)
{
    struct thing_search *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory to look for things");
    s->things = things;
    struct recognition_options how = recognition_default_options();
    how.farthest_m = FARTHEST_M;
    const enum status status = recognizer_open(&s->recognizer, things, &how);
    if (status != OK)
        thing_search_close(out);
    return status;
}

static void free_searched(struct searched *searched)
{
    free(searched->rgb);
    free(searched->depth);
    free(searched->detections);
}

void thing_search_close(struct thing_search **search)
{
    if (!*search)
        return;
    for (int i = 0; i < (*search)->count; i++)
        free_searched(&(*search)->pictures[i]);
    free((*search)->pictures);
    recognizer_close(&(*search)->recognizer);
    free(*search);
    *search = NULL;
}

static bool is_apart(struct pose a, struct pose b)
{
    return v3_distance(a.translation, b.translation) >= APART_M || pose_angle(a, b) >= APART_RAD;
}

// Leaves out what is seen from about where it was seen before: it says nothing new, and its picture costs memory.
static void leave_out_repeated(struct thing_search *search, struct searched *searched)
{
    int count = 0;
    for (int i = 0; i < searched->count; i++) {
        const int thing = searched->detections[i].thing;
        if (search->kept[thing] && !is_apart(search->kept_from[thing], searched->world_from_camera))
            continue;
        search->kept[thing] = true;
        search->kept_from[thing] = searched->world_from_camera;
        searched->detections[count++] = searched->detections[i];
    }
    searched->count = count;
}

// Copies what the second look needs.
static enum status keep_picture(struct thing_search *search, struct searched *searched, const uint8_t *rgb,
                                const struct depth_view *depth)
{
    const size_t pixels = (size_t)searched->lens.width * (size_t)searched->lens.height;
    struct searched *grown = realloc(search->pictures, sizeof *grown * ((size_t)search->count + 1));
    if (grown)
        search->pictures = grown;
    searched->rgb = malloc(3 * pixels);
    bool good = grown && searched->rgb;
    if (good)
        memcpy(searched->rgb, rgb, 3 * pixels);
    if (good && depth) {
        const size_t samples = (size_t)depth->lens.width * (size_t)depth->lens.height;
        searched->depth = malloc(sizeof *searched->depth * samples);
        good = searched->depth != NULL;
        if (good)
            memcpy(searched->depth, depth->depth, sizeof *searched->depth * samples);
        searched->depth_view = *depth;
        searched->depth_view.depth = searched->depth;
    }
    if (!good)
        return fail(ERR_MEMORY, "no memory for a picture with things");
    search->pictures[search->count++] = *searched;
    return OK;
}

void thing_search_expect(struct thing_search *search, int thing, const struct pose *world_from_thing,
                         const struct covariance3 *covariance)
{
    search->expected[thing] =
        (struct expectation){.any = true, .world_from_thing = *world_from_thing, .covariance = *covariance};
}

// The picture shows the thing where it was known.
static bool is_there(const struct thing_search *search, const struct searched *searched, int thing)
{
    const struct thing *t = &search->things->things[thing];
    const struct vec3 at = search->expected[thing].world_from_thing.translation;
    for (int i = 0; i < searched->count; i++)
        for (int shape = 0; shape < THING_SHAPES && searched->detections[i].thing == thing; shape++) {
            const struct vec3 found =
                pose_apply(searched->world_from_camera, searched->detections[i].by[shape].left_from_thing.translation);
            if (searched->detections[i].found[shape] &&
                v3_distance(found, at) < SAME_PLACE * fmax(t->width_m, t->height_m))
                return true;
        }
    return false;
}

static void note_misses(struct thing_search *search, const struct searched *searched, const struct depth_view *depth)
{
    for (int i = 0; i < search->things->count; i++) {
        struct expectation *e = &search->expected[i];
        e->there |= e->any && is_there(search, searched, i);
        if (!e->any || e->there || e->misses == MISSES_MAX)
            continue;
        const enum thing_sight sight = thing_sight_of(
            &search->things->things[i], pose_multiply(pose_inverse(searched->world_from_camera), e->world_from_thing),
            &searched->lens, depth);
        bool counts = sight != SIGHT_NONE;
        for (int k = 0; k < e->misses; k++)
            counts &= is_apart(e->missed_from[k], searched->world_from_camera);
        if (!counts)
            continue;
        e->missed_from[e->misses++] = searched->world_from_camera;
        e->absent += sight == SIGHT_EMPTY ? EMPTY_VOTE : OCCUPIED_VOTE;
    }
}

enum status thing_search_add(struct thing_search *search, const struct lens *lens, struct pose world_from_camera,
                             const uint8_t *rgb, const struct depth_view *depth)
{
    struct searched p = {.lens = *lens,
                         .world_from_camera = world_from_camera,
                         .detections = calloc((size_t)search->things->count + 1, sizeof *p.detections)};
    const struct pose here = POSE_IDENTITY;
    struct thing_view view;
    if (!p.detections)
        return fail(ERR_MEMORY, "no memory to look for things");
    enum status status = thing_view_make(lens, &here, rgb, true, &view);
    if (status == OK) {
        status = recognizer_find(search->recognizer, &view, 1, p.detections, &p.count);
        thing_view_free(&view);
    }
    if (status == OK) {
        note_misses(search, &p, depth);
        leave_out_repeated(search, &p);
    }
    for (int i = 0; i < p.count && status == OK; i++)
        thing_traits_add(&search->traits[p.detections[i].thing], search->recognizer, &p.detections[i]);
    if (status == OK && p.count)
        status = keep_picture(search, &p, rgb, depth);
    if (status != OK || !p.count)
        free_searched(&p);
    return status;
}

static enum status refine_detections(struct thing_search *search, const struct searched *searched,
                                     struct thing_map *out, int *sightings, int *contradicted)
{
    const struct pose here = POSE_IDENTITY;
    struct thing_view view;
    enum status status = thing_view_make(&searched->lens, &here, searched->rgb, false, &view);
    if (status != OK)
        return status;
    for (int i = 0; i < searched->count && status >= OK; i++) {
        struct sighting found;
        const int thing = searched->detections[i].thing;
        status =
            recognizer_refine(search->recognizer, &searched->detections[i], &search->traits[thing], &view, 1, &found);
        if (status != OK)
            continue;
        if (searched->depth &&
            sighting_by_depth(&found, &search->things->things[thing], &searched->depth_view) == AMBIGUOUS) {
            ++*contradicted;
            continue;
        }
        const struct covariance3 pose = covariance3_isotropic(POSE_SIGMA_M * POSE_SIGMA_M);
        found.covariance = covariance3_add(&found.covariance, &pose);
        thing_map_add(out, &found, &searched->world_from_camera);
        ++*sightings;
    }
    thing_view_free(&view);
    return status < OK ? status : OK;
}

enum status thing_search_finish(struct thing_search *search, struct thing_map *out, int *sightings, int *contradicted)
{
    enum status status = OK;
    *out = (struct thing_map){0};
    *sightings = *contradicted = 0;
    for (int i = 0; i < search->things->count; i++)
        if (search->expected[i].any)
            thing_map_know(out, i, &search->expected[i].world_from_thing, &search->expected[i].covariance);
    for (int i = 0; i < search->count && status == OK; i++)
        status = refine_detections(search, &search->pictures[i], out, sightings, contradicted);
    for (int i = 0; i < search->things->count && status == OK; i++) {
        const struct mapped_thing *t = thing_map_find(out, i);
        if (t && !t->moves && !search->expected[i].there && search->expected[i].absent >= ABSENT)
            thing_map_absent(out, i);
    }
    return status;
}
