#include "app/ui/take_list.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The frame that shows a take best: two fifths in, where there is a person.
static int64_t face_of(const struct take *t)
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

static enum status make_card(struct library *l, struct gpu *gpu, struct recording *recording, int number)
{
    struct take_card *card = &l->cards[number];
    struct take *take;
    card->name = recording_take_name(recording, number);
    enum status status = take_open(&take, recording, card->name);
    if (status == ERR_MEMORY)
        return status;
    if (status != OK)
        return OK; // it says why when it is chosen
    int64_t frames = take_frame_count(take), face = face_of(take);
    card->complete = take_is_complete(take);
    card->watchable = face >= 0 && take_body(take)->representative_frame >= 0;
    if (frames > 1)
        card->length_ns = take_entry(take, frames - 1)->time_ns - take_entry(take, 0)->time_ns;
    const struct lens *lens = &take_calibration(take)->color;
    struct take_pictures pictures = {0};
    if (face >= 0 && take_read(take, face, TAKE_COLOR, &pictures) == OK && pictures.color) {
        status = gpu_texture_open(&l->pictures[number], gpu, GPU_RGB8, lens->width, lens->height, GPU_LINEAR,
                                  pictures.color);
        card->picture = l->pictures[number];
        card->picture_shape = (double)lens->width / lens->height;
    }
    take_close(&take);
    return status;
}

enum status library_open(struct library *l, struct gpu *gpu, struct recording *recording, const char *path)
{
    *l = (struct library){.count = recording_take_count(recording)};
    const char *slash = strrchr(path, '/');
    snprintf(l->file, sizeof l->file, "%s", slash ? slash + 1 : path);
    size_t room = l->count > 0 ? (size_t)l->count : 1;
    l->cards = calloc(room, sizeof *l->cards);
    l->pictures = calloc(room, sizeof(struct gpu_texture *));
    enum status status = l->cards && l->pictures ? OK : fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < l->count && status == OK; i++)
        status = make_card(l, gpu, recording, i);
    if (status != OK)
        library_close(l);
    return status;
}

void library_close(struct library *l)
{
    for (int i = 0; i < l->count && l->pictures; i++)
        gpu_texture_close(&l->pictures[i]);
    free(l->cards);
    free(l->pictures);
    *l = (struct library){0};
}
