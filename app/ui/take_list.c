#include "app/ui/take_list.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The frame for the card: nearest to two fifths of the take that has an image and a skeleton; -1: none.
static int64_t cover_frame(const struct take *t)
{
    int64_t count = take_frame_count(t), wanted = count * 2 / 5;
    for (int64_t away = 0; away < count; away++)
        for (int side = -1; side <= 1; side += 2) {
            int64_t i = wanted + side * away;
            if (i >= 0 && i < count && take_entry(t, i)->has_color && take_entry(t, i)->has_skeleton)
                return i;
        }
    return -1;
}

static enum status make_card(struct take_list *l, struct gpu *gpu, struct recording *recording, int number)
{
    struct take_card *card = &l->cards[number];
    struct take *take;
    enum status status = take_open(&take, recording, card->name);
    if (status == ERR_MEMORY)
        return status;
    if (status != OK)
        return OK; // choosing it will report why
    int64_t frames = take_frame_count(take), cover = cover_frame(take);
    card->complete = take_is_complete(take);
    card->watchable = cover >= 0 && take_body(take)->representative_frame >= 0;
    if (frames > 1)
        card->length_ns = take_entry(take, frames - 1)->time_ns - take_entry(take, 0)->time_ns;
    const struct lens *lens = &take_calibration(take)->color;
    struct take_images images = {0};
    if (cover >= 0 && take_read(take, cover, TAKE_COLOR, &images) == OK && images.color) {
        status = gpu_texture_open(&l->images[number], gpu,
                                  &(struct gpu_texture_layout){GPU_RGB8, lens->width, lens->height, GPU_LINEAR},
                                  images.color);
        card->image = l->images[number];
        card->image_aspect = (double)lens->width / lens->height;
    }
    take_close(&take);
    return status;
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
        l->cards[i] =
            (struct take_card){.name = recording_take_name(recording, i), .complete = true, .watchable = true};
    return OK;
}

enum status take_list_load(struct take_list *l, struct gpu *gpu, struct recording *recording)
{
    if (l->loaded == l->count)
        return NOTHING;
    return make_card(l, gpu, recording, l->loaded++);
}

void take_list_close(struct take_list *l)
{
    for (int i = 0; i < l->count && l->images; i++)
        gpu_texture_close(&l->images[i]);
    free(l->cards);
    free(l->images);
    *l = (struct take_list){0};
}
