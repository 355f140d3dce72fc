#include "locate/mirrored_tags.h"

#include "locate/tag_corners.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_SHOWN = 64 };

struct mirrored_tags {
    struct lens lens;
    struct tag_detector *detector;
    uint8_t *gray;
    bool counts[TAG_ID_COUNT];
};

enum status mirrored_tags_open(struct mirrored_tags **out, const struct lens *lens, const int32_t *ids, int count)
{
    struct mirrored_tags *m = calloc(1, sizeof *m);
    *out = NULL;
    if (!m || !(m->gray = malloc(lens_pixels(lens)))) {
        mirrored_tags_close(&m);
        return fail(ERR_MEMORY, "no memory to look for mirrored tags");
    }
    m->lens = *lens;
    for (int i = 0; i < TAG_ID_COUNT; i++)
        m->counts[i] = !ids;
    for (int i = 0; i < count && ids; i++)
        if (ids[i] >= 0 && ids[i] < TAG_ID_COUNT)
            m->counts[ids[i]] = true;
    const enum status status = tag_detector_open(&m->detector, 1);
    if (status != OK)
        mirrored_tags_close(&m);
    *out = m;
    return status;
}

void mirrored_tags_close(struct mirrored_tags **m)
{
    if (!*m)
        return;
    tag_detector_close(&(*m)->detector);
    free((*m)->gray);
    free(*m);
    *m = NULL;
}

enum status mirrored_tags_look_straight(struct mirrored_tags *m, const uint8_t *gray, int *shown)
{
    struct tag_detection seen[MOST_SHOWN];
    int count = 0;
    const struct gray_image image = {gray, m->lens.width, m->lens.height};
    const enum status status = tag_detector_detect(m->detector, &image, seen, MOST_SHOWN, &count);
    *shown = 0;
    for (int i = 0; status == OK && i < count; i++)
        *shown += m->counts[seen[i].id];
    return status;
}

enum status mirrored_tags_look(struct mirrored_tags *m, const uint8_t *gray, int *shown)
{
    memcpy(m->gray, gray, lens_pixels(&m->lens));
    gray_mirror(m->gray, m->lens.width, m->lens.height);
    return mirrored_tags_look_straight(m, m->gray, shown);
}
