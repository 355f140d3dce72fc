// Why no listed tag is in any picture of a sweep.
#include "capture/mapping/map_internal.h"

#include "locate/tag_corners.h"
#include "platform/jpeg.h"

#include <stdlib.h>
#include <string.h>

// All chosen by hand.
enum { MOST_PICTURES = 8 }; // that are looked at again
static const double SATURATED = 250, MUCH = 0.3, DARK_MEAN = 16;

struct looked {
    int pictures, overexposed, dark, mirrored; // mirrored: that show a listed tag in a mirror
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

static enum status look_at(const struct map *m, const struct map_frame *f, struct tag_detector *detector, uint8_t *rgb,
                           uint8_t *gray, struct looked *out)
{
    const struct lens *lens = &m->calibration.color;
    struct tag_detection seen[PNP_MAX_TAGS];
    int count;
    bool listed = false;
    enum status status = jpeg_decode(f->jpeg, f->jpeg_bytes, rgb, lens->width, lens->height);
    if (status != OK)
        return status == ERR_CORRUPT ? OK : status;
    gray_from_rgb(rgb, lens_pixels(lens), gray);
    measure_light(gray, lens_pixels(lens), out);
    gray_mirror(gray, lens->width, lens->height);
    status = tag_detector_detect(detector, &(struct gray_image){gray, lens->width, lens->height}, seen, PNP_MAX_TAGS,
                                 &count);
    for (int i = 0; status == OK && i < count; i++)
        listed = listed || is_listed(m, seen[i].id);
    out->mirrored += listed;
    out->pictures++;
    return status;
}

// Some of the pictures that are kept, spread over the sweep.
static enum status look_again(const struct map *m, struct looked *out)
{
    const size_t pixels = lens_pixels(&m->calibration.color);
    uint8_t *rgb = malloc(pixels * 4), *gray = rgb ? rgb + 3 * pixels : NULL;
    struct tag_detector *detector = NULL;
    enum status status = rgb ? tag_detector_open(&detector, 1) : fail(ERR_MEMORY, "no memory to look for tags");
    const int32_t step = m->frame_count / MOST_PICTURES + 1;
    for (int32_t i = 0, due = 0; i < m->frame_count && status == OK; i++) {
        if (i < due || !m->frames[i].jpeg)
            continue;
        status = look_at(m, &m->frames[i], detector, rgb, gray, out);
        due = i + step;
    }
    tag_detector_close(&detector);
    free(rgb);
    return status;
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
