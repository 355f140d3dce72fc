#include "app/ui/take_list.h"

#include "base/image_shrink.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Reads the colour of the frame for the card: nearest to two fifths of the take that has an image and a skeleton. A
// damaged one is passed over, a few times. False: none.
static bool read_cover(struct take *t, struct take_images *images)
{
    enum { TRIES = 8 };
    int64_t count = take_frame_count(t), wanted = count * 2 / 5;
    int tried = 0;
    for (int64_t away = 0; away < count && tried < TRIES; away++)
        for (int side = -1; side <= 1; side += 2) {
            int64_t i = wanted + side * away;
            if (i < 0 || i >= count || !take_entry(t, i)->has_color || !take_entry(t, i)->has_skeleton)
                continue;
            if (take_read(t, i, TAKE_COLOR, images) == OK && images->color)
                return true;
            tried++;
        }
    return false;
}

// Why the actor cannot be drawn; NULL: it can.
static const char *trouble_with(const struct take *t)
{
    if (take_body(t)->representative_frame < 0)
        return "no person in it";
    return take_calibration(t)->color.width ? NULL : "no colour and no depth";
}

// Uploads the image no larger than a card shows it: of many takes of a large camera they would fill a tablet's memory.
static enum status upload_cover(struct take_list *l, struct gpu *gpu, int number, const uint8_t *rgb,
                                const struct lens *lens)
{
    enum { MOST_PX = 640 }; // of its width
    struct take_card *card = &l->cards[number];
    struct gpu_texture_layout layout = {GPU_RGB8, lens->width, lens->height, GPU_LINEAR};
    uint8_t *small = NULL;
    if (lens->width > MOST_PX) {
        layout.width = MOST_PX;
        layout.height = (int)fmax(1, floor((double)lens->height * MOST_PX / lens->width));
        small = malloc((size_t)layout.width * (size_t)layout.height * 3);
        if (!small)
            return fail(ERR_MEMORY, "out of memory");
        image_shrink(rgb, lens->width, lens->height, small, layout.width, layout.height);
    }
    const enum status status = gpu_texture_open(&l->images[number], gpu, &layout, small ? small : rgb);
    free(small);
    card->image = l->images[number];
    card->image_aspect = (double)lens->width / lens->height;
    return status;
}

void take_list_say(struct take_card *card, const struct take_verdict *v)
{
    card->judged = true;
    card->good = verdict_is_good(v);
    const int used = snprintf(card->verdict, sizeof card->verdict, "%s", verdict_headline(v));
    for (int i = 0; i < v->count; i++)
        if (verdict_shows_line(v, i)) {
            snprintf(card->verdict + used, sizeof card->verdict - (size_t)used, "; %s", v->line[i].text);
            break;
        }
}

// What is kept: to judge an older file's take would hold up the screen.
static enum status read_verdict(struct take_card *card, struct recording *recording)
{
    struct take *take;
    struct take_verdict v;
    bool fits = false;
    enum status status = card->judged ? NOTHING : take_open(&take, recording, card->name);
    if (status != OK)
        return status == ERR_MEMORY ? status : OK;
    status = recorded_verdict_read(take, &v, &fits);
    take_close(&take);
    if (status == OK && fits)
        take_list_say(card, &v);
    return status == ERR_MEMORY ? status : OK;
}

static enum status make_card(struct take_list *l, struct gpu *gpu, struct recording *recording, int number)
{
    struct take_card *card = &l->cards[number];
    struct take *take;
    enum status status = take_open_drawn(&take, recording, card->name);
    if (status == ERR_MEMORY)
        return status;
    if (status != OK) { // choosing it will report why
        card->complete = true;
        card->trouble = "damaged";
        return OK;
    }
    int64_t frames = take_frame_count(take);
    card->complete = take_is_complete(take);
    card->trouble = trouble_with(take);
    if (frames > 1)
        card->length_ns = take_entry(take, frames - 1)->time_ns - take_entry(take, 0)->time_ns;
    const struct lens *lens = &take_calibration(take)->color;
    struct take_images images = {0};
    if (read_cover(take, &images))
        status = upload_cover(l, gpu, number, images.color, lens);
    take_close(&take);
    return status == OK ? read_verdict(card, recording) : status;
}

enum status take_list_open(struct take_list *l, struct recording *recording, const char *path)
{
    *l = (struct take_list){.count = recording_take_count(recording)};
    const char *slash = strrchr(path, '/');
    snprintf(l->file, sizeof l->file, "%s", slash ? slash + 1 : path);
    size_t capacity = l->count > 0 ? (size_t)l->count : 1;
    l->cards = calloc(capacity, sizeof *l->cards);
    l->images = calloc(capacity, sizeof(struct gpu_texture *));
    if (!l->cards || !l->images) {
        take_list_close(l);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < l->count; i++)
        l->cards[i] = (struct take_card){.name = recording_take_name(recording, i)};
    return OK;
}

// How far a card is out of sight, in cards.
static int beyond(int i, int first, int end)
{
    if (i < first)
        return first - i;
    return i >= end ? i + 1 - end : 0;
}

enum status take_list_load(struct take_list *l, struct gpu *gpu, struct recording *recording, int first, int end)
{
    int next = -1;
    for (int i = 0; i < l->count; i++) {
        const int far = beyond(i, first, end);
        if (far > TAKE_LIST_AHEAD && l->images[i]) {
            gpu_texture_close(&l->images[i]);
            l->cards[i].image = NULL;
            l->cards[i].loaded = false;
        }
        if (far <= TAKE_LIST_AHEAD && !l->cards[i].loaded && (next < 0 || far < beyond(next, first, end)))
            next = i;
    }
    if (next < 0)
        return NOTHING;
    l->cards[next].loaded = true;
    return make_card(l, gpu, recording, next);
}

int take_list_unjudged(const struct take_list *l, int first, int end)
{
    int next = -1;
    for (int i = 0; i < l->count; i++) {
        const struct take_card *c = &l->cards[i];
        if (c->loaded && !c->judged && !c->unjudgeable && !c->trouble &&
            (next < 0 || beyond(i, first, end) < beyond(next, first, end)))
            next = i;
    }
    return next;
}

void take_list_close(struct take_list *l)
{
    for (int i = 0; i < l->count && l->images; i++)
        gpu_texture_close(&l->images[i]);
    free(l->cards);
    free(l->images);
    *l = (struct take_list){0};
}
