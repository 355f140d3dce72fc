// reenact-capture export: the actor's avatar as a model.
#include "app/commands/capture_export.h"
#include "platform/files/output.h"
#include "reenact/avatar/avatar.h"
#include "reenact/export/actor_export.h"

#include <stdlib.h>

static enum status write_page(const struct export_arguments *given, const uint8_t *glb, size_t count)
{
    struct output *page;
    enum status status = output_open(&page, given->html);
    if (status != OK)
        return status;
    actor_export_page(given->take, glb, count, output_file(page));
    return output_close(&page, OK);
}

static enum status write_model(const struct export_arguments *given, const struct actor_export *actor, FILE *out)
{
    uint8_t *glb;
    size_t count;
    enum status status = actor_export_glb(actor, &glb, &count);
    if (status != OK)
        return status;
    fwrite(glb, 1, count, out);
    if (given->html)
        status = write_page(given, glb, count);
    free(glb);
    return status;
}

static enum status write_mesh(const struct actor_export *actor, int64_t frame, FILE *out)
{
    const enum status status = actor_export_mesh_ply(actor, frame, out);
    return status == NOTHING ? fail(ERR_INPUT, "the actor's trunk is not known at that instant; give another --at")
                             : status;
}

enum status export_actor(const struct export_arguments *given, struct take *take, int64_t frame, FILE *out,
                         const struct progress_watch *watch)
{
    struct actor_export actor = {.take = take, .name = given->take};
    struct take_skeletons *skeletons = NULL;
    struct skeleton_track *track = NULL;
    struct source_rays *rays = NULL;
    struct avatar avatar = {0};
    struct avatar_options how = avatar_default_options();
    how.watch = watch;
    if (!take_calibration(take)->depth.width)
        return fail(ERR_INPUT, "the take has no depth, so there is no model of the actor");
    enum status status = take_skeletons_open(&skeletons, take);
    if (status == OK)
        status = skeleton_track_open(&track, take, skeletons);
    if (status == OK)
        status = source_rays_open(&rays, take_calibration(take));
    if (status == OK)
        status = avatar_obtain(&avatar, take, rays, &how);
    if (status == NOTHING && !command_stopped())
        status = fail(ERR_INPUT, "the take shows too little of a person for a model");
    if (status == OK) {
        actor.skeletons = skeletons;
        actor.track = track;
        actor.avatar = &avatar;
        status = given->format == EXPORT_GLB ? write_model(given, &actor, out) : write_mesh(&actor, frame, out);
    }
    avatar_free(&avatar);
    source_rays_close(&rays);
    skeleton_track_close(&track);
    take_skeletons_close(&skeletons);
    return status;
}
