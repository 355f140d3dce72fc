// Why no listed tag is in any picture of a sweep.
#include "capture/mapping/map_internal.h"

#include "locate/mirrored_tags.h"
#include "locate/tag_corners.h"
#include "platform/files/jpeg.h"
#include "platform/vision/tag_families.h"

#include <stdlib.h>
#include <string.h>

// All chosen by hand.
enum { MOST_PICTURES = 8 /* that are looked at again */, MOST_OTHERS = 32 /* tags in one of them */ };
static const double SATURATED = 250, MUCH = 0.3, DARK_MEAN = 16;

struct looked {
    int pictures, overexposed, dark, mirrored; // mirrored: that show a listed tag in a mirror
    struct tag_of_family other[MOST_PICTURES + 1][MOST_OTHERS];
    int others[MOST_PICTURES + 1]; // of each picture: tags of other families
};

// What they are looked at with.
struct look {
    struct mirrored_tags *mirror;
    struct tag_families *families;
    uint8_t *rgb, *gray;
};

static bool is_listed(const struct map *m, int32_t id)
{
    for (int32_t t = 0; t < m->tag_count; t++)
        if (m->tags[t].id == id)
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

static enum status look_at(const struct map *m, const struct map_frame *f, const struct look *by, struct looked *out)
{
    const struct lens *lens = &m->calibration.color;
    const struct gray_image image = {by->gray, lens->width, lens->height};
    int listed = 0;
    enum status status = jpeg_decode(f->jpeg, f->jpeg_bytes, by->rgb, lens->width, lens->height);
    if (status != OK)
        return status == ERR_CORRUPT ? OK : status;
    gray_from_rgb(by->rgb, lens_pixels(lens), by->gray);
    measure_light(by->gray, lens_pixels(lens), out);
    status =
        tag_families_look(by->families, &image, out->other[out->pictures], MOST_OTHERS, &out->others[out->pictures]);
    if (status != OK)
        return status;
    status = mirrored_tags_look(by->mirror, by->gray, &listed);
    out->mirrored += listed > 0;
    out->pictures++;
    return status;
}

// Some of the pictures that are kept, spread over the sweep.
static enum status look_again(const struct map *m, struct looked *out)
{
    const size_t pixels = lens_pixels(&m->calibration.color);
    int32_t ids[MAPPER_MAX_TAGS];
    int count = 0;
    for (int32_t t = 0; t < m->tag_count && count < MAPPER_MAX_TAGS; t++)
        ids[count++] = m->tags[t].id;
    struct look by = {.rgb = malloc(pixels * 4)};
    by.gray = by.rgb ? by.rgb + 3 * pixels : NULL;
    enum status status = by.rgb ? mirrored_tags_open(&by.mirror, &m->calibration.color, ids, count)
                                : fail(ERR_MEMORY, "no memory to look for tags");
    if (status == OK)
        status = tag_families_open(&by.families);
    const int32_t step = m->frame_count / MOST_PICTURES + 1;
    for (int32_t i = 0, due = 0; i < m->frame_count && status == OK; i++) {
        if (i < due || !m->frames[i].jpeg)
            continue;
        status = look_at(m, &m->frames[i], &by, out);
        due = i + step;
    }
    tag_families_close(&by.families);
    mirrored_tags_close(&by.mirror);
    free(by.rgb);
    return status;
}

static bool shows(const struct looked *l, int picture, struct tag_of_family tag)
{
    for (int i = 0; i < l->others[picture]; i++)
        if (l->other[picture][i].family == tag.family && l->other[picture][i].id == tag.id)
            return true;
    return false;
}

// The other family of which most is seen, each tag in two pictures at least: what looks like a tag by chance does so
// from one place. -1: none.
static int other_family(const struct looked *l)
{
    int seen[TAG_FAMILIES] = {0}, best = -1;
    for (int picture = 0; picture < l->pictures; picture++)
        for (int i = 0; i < l->others[picture]; i++) {
            bool again = false;
            for (int k = 0; k < l->pictures; k++)
                again = again || (k != picture && shows(l, k, l->other[picture][i]));
            seen[l->other[picture][i].family] += again;
        }
    for (int i = 0; i < TAG_FAMILIES; i++)
        if (seen[i] > (best < 0 ? 0 : seen[best]))
            best = i;
    return best;
}

enum status map_explain_no_tags(const struct map *m, const int32_t *pictures_with_tag)
{
    struct looked looked = {0};
    int32_t unlisted = -1, twice = -1, others = 0;
    const enum status status = look_again(m, &looked);
    if (status != OK)
        return status;
    for (int32_t id = TAG_ID_COUNT - 1; id >= 0; id--) {
        if (pictures_with_tag[id] > 0 && is_listed(m, id))
            twice = id;
        if (pictures_with_tag[id] > 1 && !is_listed(m, id)) {
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
