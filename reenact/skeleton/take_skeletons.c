#include "reenact/skeleton/take_skeletons.h"

#include "reenact/skeleton/joint_inpainting.h"

#include <stdlib.h>
#include <string.h>

struct take_skeletons {
    const struct take *take;
    struct skeleton **inpainted; // of each frame; NULL: nothing was inpainted there
};

// Keeps a copy only where inpainting changed a joint.
static enum status keep_if_changed(struct take_skeletons *s, int64_t frame)
{
    const struct take_entry *e = take_entry(s->take, frame);
    if (!e->has_skeleton)
        return OK;
    const struct skeleton inpainted = inpaint_skeleton(s->take, frame);
    if (!memcmp(inpainted.confidence, e->skeleton.confidence, sizeof inpainted.confidence))
        return OK;
    s->inpainted[frame] = malloc(sizeof inpainted);
    if (!s->inpainted[frame])
        return fail(ERR_MEMORY, "out of memory");
    *s->inpainted[frame] = inpainted;
    return OK;
}

enum status take_skeletons_open(struct take_skeletons **out, const struct take *take)
{
    const int64_t frames = take_frame_count(take);
    struct take_skeletons *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->take = take;
    s->inpainted = calloc((size_t)frames + 1, sizeof *s->inpainted);
    enum status status = s->inpainted ? OK : fail(ERR_MEMORY, "out of memory");
    for (int64_t i = 0; i < frames && status == OK; i++)
        status = keep_if_changed(s, i);
    if (status != OK)
        take_skeletons_close(out);
    return status;
}

void take_skeletons_close(struct take_skeletons **out)
{
    struct take_skeletons *s = *out;
    if (!s)
        return;
    for (int64_t i = 0; s->inpainted && i < take_frame_count(s->take); i++)
        free(s->inpainted[i]);
    free(s->inpainted);
    free(s);
    *out = NULL;
}

const struct skeleton *take_skeletons_at(const struct take_skeletons *s, int64_t frame)
{
    const struct skeleton *recorded = &take_entry(s->take, frame)->skeleton;
    return s->inpainted[frame] ? s->inpainted[frame] : recorded;
}
