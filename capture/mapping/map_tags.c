// Lookup of the tags that frames show.
#include "base/linear_algebra.h"
#include "capture/mapping/map_internal.h"
#include "capture/mapping/mapper.h"
#include "locate/tag_corners.h"
#include "locate/tag_model.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/vision/tag_detector.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- map outlier tags

// Tags that one sweep shows in two positions: moved during the sweep, or two tags of the same id. The map could hold
// only one of the positions, and frames that see the tag at the other would be placed wrongly; so it is left out.

// All chosen by hand.
// Landmark inliers that confirm a frame's pose without the tag.
enum { MIN_POINTS = 20 };
static const double INLIER_PX = 4;
// A tag is displaced by at least this share of its side; less is measurement error.
static const double MIN_OFFSET_SHARE = 0.5;
// An outlier tag is displaced in at least so many frames, and in at least one of so many of all.
enum { MIN_DISPLACED = 2, ONE_IN = 8 };

// Whether a frame shows its k-th tag elsewhere than the map has it.
static bool tag_is_displaced(const struct map *map, const struct map_frame *frame, int32_t k)
{
    const struct map_tag *tag = &map->tags[frame->tag_index[k]];
    const struct pose expected = pose_multiply(frame->camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, frame->seen[k].ray, &expected) > MIN_OFFSET_SHARE * tag->side_m;
}

static bool landmarks_agree(const struct map *map, const struct map_frame *frame)
{
    const struct lens *lens = &map->calibration.color;
    int agree = 0;
    for (int32_t i = 0; i < frame->feature_count; i++) {
        const struct map_feature *feature = &frame->features[i];
        if (feature->point < 0)
            continue;
        struct vec3 p = pose_apply(frame->camera_from_world, map->points[feature->point].world);
        agree += p.z > 0 && map_reprojection_px(lens, p, &feature->feature) < INLIER_PX;
    }
    return agree >= MIN_POINTS;
}

// Whether the pose of the frame is confirmed without its k-th tag.
static bool pose_is_confirmed(const struct map *map, const struct map_frame *frame, int32_t k)
{
    for (int32_t i = 0; i < frame->seen_count; i++)
        if (i != k && map->tags[frame->tag_index[i]].mapped && !tag_is_displaced(map, frame, i))
            return true;
    return landmarks_agree(map, frame);
}

static bool is_outlier_tag(const struct map *map, int32_t tag)
{
    int displaced = 0, all = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->tag_index[k] != tag || !pose_is_confirmed(map, f, k))
                continue;
            all++;
            displaced += tag_is_displaced(map, f, k);
        }
    }
    return displaced >= MIN_DISPLACED && displaced * ONE_IN >= all;
}

// Another tag fixes the gauge, else a frame.
static void choose_new_reference(struct map *map)
{
    int32_t best = map_most_observed_tag(map, true);
    if (best >= 0) {
        map->tags[best].fixed = true;
        return;
    }
    for (int32_t i = 0; i < map->frame_count && map->fixed_frame < 0; i++)
        if (map->frames[i].placed)
            map->fixed_frame = i;
}

void map_remove_outlier_tags(struct map *map)
{
    bool held = map->held_points > 0 || map->fixed_frame >= 0;
    for (int32_t t = 0; t < map->tag_count; t++)
        map->tags[t].outlier = map->tags[t].mapped && is_outlier_tag(map, t);
    for (int32_t t = 0; t < map->tag_count; t++) {
        if (map->tags[t].outlier)
            map->tags[t].mapped = map->tags[t].fixed = false;
        held = held || map->tags[t].fixed;
    }
    if (!held)
        choose_new_reference(map);
}

// ---------------------------------------------------------------- tag list

// Reading of tags.json: which tags hang in the place and how large they are.

static int by_id(const void *left, const void *right)
{
    const struct mapper_tag *a = left, *b = right;
    return (a->id > b->id) - (a->id < b->id);
}

static enum status read_side(const struct json *member, const char *path, struct mapper_tag *out)
{
    const char *name = json_name(member);
    char *end;
    errno = 0;
    long id = strtol(name, &end, 10);
    if (end == name || *end || errno || id < 0 || id >= TAG_ID_COUNT)
        return fail(ERR_INPUT, "%s: '%s' in side_m is no tag number; tag36h11 has 0 to %d", path, name,
                    TAG_ID_COUNT - 1);
    double side;
    if (!json_get_number(member, &side) || !(side >= 0.005) || !(side <= 5))
        return fail(ERR_INPUT,
                    "%s: the side of tag %ld must be a number of metres between 0.005 and 5, "
                    "the outer edge of its black square",
                    path, id);
    *out = (struct mapper_tag){(int32_t)id, side};
    return OK;
}

static enum status read_list(const struct json *root, const char *path, struct mapper_tag **tags, int32_t *count)
{
    const char *family;
    if (!json_get_string(json_member(root, "family"), &family))
        return fail(ERR_INPUT, "%s: the text 'family' is missing; write \"family\": \"tag36h11\"", path);
    if (strcmp(family, "tag36h11"))
        return fail(ERR_INPUT, "%s: tags of the family '%s' are not known here; print tags of tag36h11", path, family);
    const struct json *sides = json_member(root, "side_m");
    if (!json_is_object(sides) || !json_count(sides))
        return fail(ERR_INPUT,
                    "%s: 'side_m' names no tag; write the side of each tag in metres, as in "
                    "\"side_m\": {\"0\": 0.2}",
                    path);
    int n = json_count(sides);
    if (n > TAG_ID_COUNT)
        return fail(ERR_INPUT, "%s: 'side_m' names %d tags; tag36h11 has %d", path, n, TAG_ID_COUNT);
    struct mapper_tag *list = calloc((size_t)n, sizeof *list);
    if (!list)
        return fail(ERR_MEMORY, "no memory for %d tags", n);
    enum status status = OK;
    const struct json *side = json_first(sides);
    for (int i = 0; side && status == OK; side = json_next(side), i++)
        status = read_side(side, path, &list[i]);
    if (status == OK)
        qsort(list, (size_t)n, sizeof *list, by_id);
    for (int i = 1; i < n && status == OK; i++)
        if (list[i].id == list[i - 1].id)
            status = fail(ERR_INPUT, "%s: tag %d is listed twice", path, (int)list[i].id);
    if (status != OK) {
        free(list);
        return status;
    }
    *tags = list;
    *count = n;
    return OK;
}

enum status mapper_read_tags(const char *path, struct mapper_tag **tags, int32_t *count)
{
    struct json *root;
    *tags = NULL;
    *count = 0;
    enum status status = json_read(path, &root);
    if (status != OK)
        return status;
    status = read_list(root, path, tags, count);
    json_free(&root);
    return status;
}

// ---------------------------------------------------------------- map no tags

// Why no listed tag is in any picture of a sweep.

// All chosen by hand.
enum { MAX_PICTURES = 8 /* that are looked at again */, MAX_OTHERS = 32 /* tags in one of them */ };
static const double SATURATED = 250, MUCH = 0.3, DARK_MEAN = 16;

struct looked {
    int pictures, overexposed, dark, mirrored; // mirrored: that show a listed tag in a mirror
    struct tag_of_family other[MAX_PICTURES + 1][MAX_OTHERS];
    int others[MAX_PICTURES + 1]; // of each picture: tags of other families
};

// What they are looked at with.
struct look {
    struct mirrored_tags *mirror;
    struct tag_families *families;
    uint8_t *rgb, *gray;
};

static bool is_listed(const struct map *map, int32_t id)
{
    for (int32_t t = 0; t < map->tag_count; t++)
        if (map->tags[t].id == id)
            return true;
    return false;
}

static void measure_light(const uint8_t *gray, size_t pixels, struct looked *out)
{
    double sum = 0, saturated = 0;
    for (size_t i = 0; i < pixels; i++) {
        sum += gray[i];
        saturated += gray[i] >= SATURATED;
    }
    out->overexposed += saturated > MUCH * (double)pixels;
    out->dark += sum < DARK_MEAN * (double)pixels;
}

static enum status look_at(const struct map *map, const struct map_frame *frame, const struct look *by,
                           struct looked *out)
{
    const struct lens *lens = &map->calibration.color;
    const struct gray_image image = {by->gray, lens->width, lens->height};
    int listed = 0;
    enum status status = jpeg_decode(frame->jpeg, frame->jpeg_bytes, by->rgb, lens->width, lens->height);
    if (status != OK)
        return status == ERR_CORRUPT ? OK : status;
    gray_from_rgb(by->rgb, lens_pixels(lens), by->gray);
    measure_light(by->gray, lens_pixels(lens), out);
    status =
        tag_families_look(by->families, &image, out->other[out->pictures], MAX_OTHERS, &out->others[out->pictures]);
    if (status != OK)
        return status;
    status = mirrored_tags_look(by->mirror, by->gray, &listed);
    out->mirrored += listed > 0;
    out->pictures++;
    return status;
}

// Some of the pictures that are kept, spread over the sweep.
static enum status look_again(const struct map *map, struct looked *out)
{
    const size_t pixels = lens_pixels(&map->calibration.color);
    int32_t ids[MAPPER_MAX_TAGS];
    int count = 0;
    for (int32_t t = 0; t < map->tag_count && count < MAPPER_MAX_TAGS; t++)
        ids[count++] = map->tags[t].id;
    struct look by = {.rgb = malloc(pixels * 4)};
    by.gray = by.rgb ? by.rgb + 3 * pixels : NULL;
    enum status status = by.rgb ? mirrored_tags_open(&by.mirror, &map->calibration.color, ids, count)
                                : fail(ERR_MEMORY, "no memory to look for tags");
    if (status == OK)
        status = tag_families_open(&by.families);
    const int32_t step = map->frame_count / MAX_PICTURES + 1;
    for (int32_t i = 0, due = 0; i < map->frame_count && status == OK; i++) {
        if (i < due || !map->frames[i].jpeg)
            continue;
        status = look_at(map, &map->frames[i], &by, out);
        due = i + step;
    }
    tag_families_close(&by.families);
    mirrored_tags_close(&by.mirror);
    free(by.rgb);
    return status;
}

static bool is_tag_in_picture(const struct looked *looked, int picture, struct tag_of_family tag)
{
    for (int i = 0; i < looked->others[picture]; i++)
        if (looked->other[picture][i].family == tag.family && looked->other[picture][i].id == tag.id)
            return true;
    return false;
}

// The other family of which most is seen, each tag in two pictures at least: what looks like a tag by chance does so
// from one place. -1: none.
static int other_family(const struct looked *looked)
{
    int seen[TAG_FAMILIES] = {0}, best = -1;
    for (int picture = 0; picture < looked->pictures; picture++)
        for (int i = 0; i < looked->others[picture]; i++) {
            bool again = false;
            for (int k = 0; k < looked->pictures; k++)
                again = again || (k != picture && is_tag_in_picture(looked, k, looked->other[picture][i]));
            seen[looked->other[picture][i].family] += again;
        }
    for (int i = 0; i < TAG_FAMILIES; i++)
        if (seen[i] > (best < 0 ? 0 : seen[best]))
            best = i;
    return best;
}

enum status map_explain_no_tags(const struct map *map, const int32_t *pictures_with_tag)
{
    struct looked looked = {0};
    int32_t unlisted = -1, twice = -1, others = 0;
    const enum status status = look_again(map, &looked);
    if (status != OK)
        return status;
    for (int32_t id = TAG_ID_COUNT - 1; id >= 0; id--) {
        if (pictures_with_tag[id] > 0 && is_listed(map, id))
            twice = id;
        if (pictures_with_tag[id] > 1 && !is_listed(map, id)) {
            unlisted = id;
            others++;
        }
    }
    if (2 * looked.mirrored > looked.pictures || (looked.mirrored > 1 && unlisted < 0 && twice < 0))
        return fail(ERR_INPUT, "the pictures are mirrored, so that none of the listed tags is recognised: switch the "
                               "camera's mirror off, or print the tags unmirrored");
    if (twice >= 0)
        return fail(ERR_INPUT,
                    "tag %d hangs more than once in the room, and no other of the listed tags is in any "
                    "picture: hang each number once",
                    (int)twice);
    if (unlisted >= 0)
        return fail(ERR_INPUT,
                    "the pictures show tag %d%s, but none of the listed tags: correct the numbers in the list",
                    (int)unlisted, others > 1 ? " and others" : "");
    if (other_family(&looked) >= 0)
        return fail(ERR_INPUT,
                    "the tags in the pictures are of the family %s; print those of tag36h11 (reenact-capture tags) and "
                    "hang them in their place",
                    tag_family_name(other_family(&looked)));
    if (2 * looked.overexposed > looked.pictures)
        return fail(ERR_INPUT, "the pictures are overexposed, and none of the listed tags is recognised: film with a "
                               "shorter exposure");
    if (2 * looked.dark > looked.pictures)
        return fail(ERR_INPUT, "the pictures are too dark, and none of the listed tags is recognised: film with more "
                               "light or a longer exposure");
    return fail(ERR_INPUT,
                "none of the listed tags is in any picture; check that the tags are of the family tag36h11, "
                "flat, whole and well lit, not too far away, with a white margin, and their numbers in the list");
}

// ---------------------------------------------------------------- map tags

int map_tag_correspondences(const struct map *map, const struct map_frame *frame, struct pnp_tag *out)
{
    int count = 0;
    for (int32_t i = 0; i < frame->seen_count && count < PNP_MAX_TAGS; i++) {
        const struct map_tag *tag = &map->tags[frame->tag_index[i]];
        if (tag->mapped)
            out[count++] = (struct pnp_tag){
                .seen = &frame->seen[i],
                .depth = frame->depths[i].count ? &frame->depths[i] : NULL,
                .world_from_tag = tag->world_from_tag,
                .side_m = tag->side_m,
                .map_px = MAP_TAG_PX,
                .used = true,
            };
    }
    return count;
}

int32_t map_most_observed_tag(const struct map *map, bool mapped)
{
    int32_t best = -1, max = 0;
    for (int32_t t = 0; t < map->tag_count; t++) {
        int32_t count = 0;
        if (mapped && !map->tags[t].mapped)
            continue;
        for (int32_t i = 0; i < map->frame_count; i++)
            for (int32_t k = 0; k < map->frames[i].seen_count; k++)
                count += map->frames[i].tag_index[k] == t;
        if (count > max) {
            max = count;
            best = t;
        }
    }
    return best;
}
