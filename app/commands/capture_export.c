// reenact-capture export: writes a take, or the place, for other programs.
#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "base/progress.h"
#include "capture/export.h"
#include "platform/files/output.h"
#include "reenact/avatar/avatar.h"
#include "reenact/export/actor_export.h"
#include "reenact/export/armature.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum export_format {
    EXPORT_CSV,
    EXPORT_BVH,
    EXPORT_TRC,
    EXPORT_C3D,
    EXPORT_GLB,
    EXPORT_PLY,
    EXPORT_MP4,
    EXPORT_MCAP,
    EXPORT_FOLDER
};
enum export_ply { PLY_POINTS, PLY_ACTOR, PLY_MESH, PLY_PLACE };

struct export_arguments {
    const char *file, *take, *out, *html;
    int format; // enum export_format; -1: not given
    enum export_axes axes;
    enum export_ply what;
    int skeleton; // enum armature_naming; -1: not given
    double at_s;  // of the take; NaN: its representative frame
    bool every_frame, force;
};

// ---------------------------------------------------------------- the actor's avatar as a model

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

// Of the avatar, or of a take's points.
struct frame_writer {
    const struct export_arguments *given;
    struct take *take;
    const struct actor_export *actor;
};

static enum status write_frame_mesh(void *self, int64_t frame, FILE *out)
{
    const struct frame_writer *writer = self;
    return actor_export_mesh_ply(writer->actor, frame, out);
}

static enum status write_frame_points(void *self, int64_t frame, FILE *out)
{
    const struct frame_writer *writer = self;
    return export_points_ply(writer->take, frame, writer->given->what == PLY_ACTOR, out);
}

// Where the actor's model, a mesh or a folder of them go.
struct actor_target {
    int64_t frame; // of the mesh
    FILE *out;     // NULL: a folder
    int64_t *damaged;
};

static enum status write_actor(const struct export_arguments *given, struct take *take,
                               const struct actor_export *actor, const struct actor_target *target,
                               const struct progress_watch *watch)
{
    struct frame_writer writer = {given, take, actor};
    if (given->format == EXPORT_GLB)
        return write_model(given, actor, target->out);
    if (target->out)
        return write_mesh(actor, target->frame, target->out);
    return export_ply_folder(take, &(struct ply_frames){write_frame_mesh, &writer}, given->out, watch, target->damaged);
}

// The take's actor as .glb, with --html also as a page, or as the mesh of a frame or of each. NOTHING: the watch said
// to stop.
static enum status export_actor(const struct export_arguments *given, struct take *take,
                                const struct actor_target *target, const struct progress_watch *watch)
{
    const enum armature_naming naming = (enum armature_naming)given->skeleton;
    struct actor_export actor = {.take = take, .name = given->take, .armature = given->skeleton < 0 ? NULL : &naming};
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
        status = write_actor(given, take, &actor, target, watch);
    }
    avatar_free(&avatar);
    source_rays_close(&rays);
    skeleton_track_close(&track);
    take_skeletons_close(&skeletons);
    return status;
}

// ---------------------------------------------------------------- the command

enum {
    KEY_TAKE = COMMAND_KEY,
    KEY_AS,
    KEY_OUT,
    KEY_AXES,
    KEY_SKELETON,
    KEY_WHAT,
    KEY_AT,
    KEY_EVERY,
    KEY_HTML,
    KEY_FORCE
};

static const char *const format_names[] = {
    [EXPORT_CSV] = "joints-csv", [EXPORT_BVH] = "bvh",   [EXPORT_TRC] = "trc",
    [EXPORT_C3D] = "c3d",        [EXPORT_GLB] = "glb",   [EXPORT_PLY] = "ply",
    [EXPORT_MP4] = "mp4",        [EXPORT_MCAP] = "mcap", [EXPORT_FOLDER] = "folder"};
static const char *const axes_names[] = {[EXPORT_SENSOR] = "sensor", [EXPORT_ROOM] = "room"};
static const char *const skeleton_names[] = {[ARMATURE_OURS] = "ours",
                                             [ARMATURE_MIXAMO] = "mixamo",
                                             [ARMATURE_UNREAL] = "unreal",
                                             [ARMATURE_HUMANIK] = "humanik"};
static const char *const what_names[] = {
    [PLY_POINTS] = "points", [PLY_ACTOR] = "actor", [PLY_MESH] = "mesh", [PLY_PLACE] = "place"};

static const struct argp_option options[] = {
    {"take", KEY_TAKE, "NAME", 0, "the take; not for the place", 0},
    {"as", KEY_AS, "joints-csv|bvh|trc|c3d|glb|ply|mp4|mcap|folder", 0,
     "joints-csv (time, joint, position, confidence, standard deviation per axis), bvh (motion), trc, c3d "
     "(joints at a constant rate, for OpenSim and biomechanics), glb (the actor, animated and textured), ply (points "
     "or a mesh), mp4 (the sensor's film), mcap (images, joints and poses for Foxglove) or folder (TUM RGB-D)",
     0},
    {"out", KEY_OUT, "PATH", 0, "the file, or folder, to write; - is standard output", 0},
    {"axes", KEY_AXES, "sensor|room", 0, "of joints-csv: sensor (x right, y down, z forward; default) or room (z up)",
     0},
    {"skeleton", KEY_SKELETON, "ours|mixamo|unreal|humanik", 0,
     "of bvh and glb: bones of constant length in a T-pose at rest, moved by rotations alone, with these names "
     "(default: every joint where the take has it)",
     0},
    {"what", KEY_WHAT, "points|actor|mesh|place", 0,
     "of ply: points (a frame's, default), actor (a frame's points of the actor), mesh (the actor's model at that "
     "instant) or place (the room)",
     0},
    {"at", KEY_AT, "SECONDS", 0, "of ply: the instant of the take (default: its most typical frame)", 0},
    {"every-frame", KEY_EVERY, NULL, 0, "of ply: one file for each frame, in a new folder --out", 0},
    {"html", KEY_HTML, "FILE", 0, "with glb: also write a page that shows the actor in a browser", 0},
    {"force", KEY_FORCE, NULL, 0, "write over files that exist, though never over the recording", 0},
    {0},
};

static bool is_folder(const struct export_arguments *given)
{
    return given->format == EXPORT_FOLDER || given->every_frame;
}

static void check_arguments(struct argp_state *state, const struct export_arguments *given)
{
    const bool place = given->format == EXPORT_PLY && given->what == PLY_PLACE;
    command_require(state, given->file, "FILE");
    command_require(state, given->format >= 0 ? given : NULL, "--as FORMAT");
    if (!place)
        command_require(state, given->take, "--take NAME");
    command_require(state, given->out, "--out PATH");
    if (given->html && given->format != EXPORT_GLB)
        argp_error(state, "--html goes with --as glb");
    if (given->skeleton >= 0 && given->format != EXPORT_BVH && given->format != EXPORT_GLB)
        argp_error(state, "--skeleton goes with --as bvh or glb");
    if (given->every_frame && (given->format != EXPORT_PLY || place))
        argp_error(state, "--every-frame goes with --as ply and a take");
    if (given->every_frame && !isnan(given->at_s))
        argp_error(state, "--every-frame and --at exclude each other");
    if (!strcmp(given->out, "-") && is_folder(given))
        argp_error(state, "a folder cannot be written to standard output");
    if (given->html && !strcmp(given->out, given->html))
        argp_error(state, "--out and --html name the same file");
}

static error_t parse_option(int key, char *value, struct argp_state *state)
{
    struct export_arguments *given = state->input;
    switch (key) {
    case KEY_TAKE: given->take = value; return 0;
    case KEY_AS:
        given->format = command_parse_choice(state, "--as", value, format_names, COUNT_OF(format_names));
        return 0;
    case KEY_OUT:
        for (size_t length = strlen(value); length > 1 && value[length - 1] == '/';)
            value[--length] = 0; // a folder's name, as shells complete it
        given->out = value;
        return 0;
    case KEY_AXES:
        given->axes = (enum export_axes)command_parse_choice(state, "--axes", value, axes_names, COUNT_OF(axes_names));
        return 0;
    case KEY_SKELETON:
        given->skeleton = command_parse_choice(state, "--skeleton", value, skeleton_names, COUNT_OF(skeleton_names));
        return 0;
    case KEY_WHAT:
        given->what = (enum export_ply)command_parse_choice(state, "--what", value, what_names, COUNT_OF(what_names));
        return 0;
    case KEY_AT: given->at_s = command_parse_number(state, "--at", value, 0, 1e6); return 0;
    case KEY_EVERY: given->every_frame = true; return 0;
    case KEY_HTML: given->html = value; return 0;
    case KEY_FORCE: given->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &given->file, value); return 0;
    case ARGP_KEY_END: check_arguments(state, given); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// The frame that --at names, or the take's representative frame.
static int64_t chosen_frame(const struct export_arguments *given, const struct take *take)
{
    const int64_t frames = take_frame_count(take), typical = take_body(take)->representative_frame;
    if (isnan(given->at_s))
        return typical >= 0 ? typical : frames / 2;
    int64_t best = 0;
    double min = INFINITY;
    for (int64_t i = 0; i < frames; i++) {
        const double since_s = (double)(take_entry(take, i)->time_ns - take_entry(take, 0)->time_ns) * 1e-9;
        if (fabs(since_s - given->at_s) < min) {
            min = fabs(since_s - given->at_s);
            best = i;
        }
    }
    return best;
}

static bool on_progress(void *self, double share)
{
    struct progress_bar *progress = self;
    while (progress->done < (int64_t)(share * (double)progress->total))
        progress_bar_step(progress);
    return !command_stopped();
}

static enum status write_place(struct recording *recording, const struct export_arguments *given, FILE *out)
{
    struct place place = {0};
    enum status status = recording_read_place(recording, &place);
    if (status == OK)
        status = export_place_ply(&place, out);
    place_free(&place);
    return status == NOTHING ? fail(ERR_INPUT, "%s holds no place", given->file) : status;
}

static enum status write_points(struct take *take, const struct export_arguments *given, FILE *out)
{
    const enum status status = export_points_ply(take, chosen_frame(given, take), given->what == PLY_ACTOR, out);
    return status == NOTHING ? fail(ERR_INPUT, "that frame has no such points; give another --at") : status;
}

static enum status write_armature(const struct take *take, const struct export_arguments *given, FILE *out)
{
    struct markers markers;
    struct armature_fit fit;
    enum status status = export_markers(take, &markers);
    if (status == OK)
        status = armature_bvh_print(&markers, (enum armature_naming)given->skeleton, out, &fit);
    if (status == OK)
        fprintf(
            stderr,
            "reenact-capture export: bones of constant length: joints are %.0f mm off on average, %.0f mm at most\n",
            1000 * fit.mean_m, 1000 * fit.max_m);
    markers_free(&markers);
    return status;
}

static enum status write_take(struct take *take, const struct export_arguments *given, const struct output *out,
                              const struct progress_watch *watch, int64_t *damaged)
{
    FILE *file = output_file(out);
    const struct actor_target target = {chosen_frame(given, take), file, damaged};
    switch ((enum export_format)given->format) {
    case EXPORT_CSV: return export_joints_csv(take, given->axes, file);
    case EXPORT_BVH: return given->skeleton < 0 ? export_bvh(take, file) : write_armature(take, given, file);
    case EXPORT_TRC: return export_trc(take, given->out, file);
    case EXPORT_C3D: return export_c3d(take, file);
    case EXPORT_GLB: return export_actor(given, take, &target, watch);
    case EXPORT_PLY:
        return given->what == PLY_MESH ? export_actor(given, take, &target, watch) : write_points(take, given, file);
    case EXPORT_MP4: return export_film_mp4(take, file, output_can_seek(out), watch, damaged);
    case EXPORT_MCAP: return export_mcap(take, file, watch, damaged);
    case EXPORT_FOLDER: break; // is no file
    }
    return OK;
}

// Takes without colour are drawn from their depth where people look at what comes out.
static enum status open_take(struct take **out, struct recording *recording, const struct export_arguments *given)
{
    const bool looked_at = given->format == EXPORT_GLB || given->format == EXPORT_MP4 ||
                           (given->format == EXPORT_PLY && given->what == PLY_MESH);
    return looked_at ? take_open_drawn(out, recording, given->take) : take_open(out, recording, given->take);
}

// What was written lacks some of the take's frames.
static void warn_of_gaps(const struct export_arguments *given, const struct take *take, int64_t damaged)
{
    const long long frames = take_frame_count(take);
    long long colorless = 0;
    for (int64_t i = 0; i < frames && given->format == EXPORT_MP4; i++)
        colorless += !take_entry(take, i)->has_color;
    if (damaged)
        fprintf(stderr,
                "reenact-capture export: warning: images of %lld of %lld frames are damaged and left out; "
                "reenact-capture verify says which\n",
                (long long)damaged, frames);
    if (colorless)
        fprintf(stderr,
                "reenact-capture export: warning: %lld of %lld frames have no colour image and are not in the film\n",
                colorless, frames);
}

static enum status write_folder(struct take *take, const struct export_arguments *given,
                                const struct progress_watch *watch, int64_t *damaged)
{
    struct frame_writer writer = {given, take, NULL};
    if (given->format == EXPORT_FOLDER)
        return export_folder(take, given->out, watch, damaged);
    if (given->what == PLY_MESH)
        return export_actor(given, take, &(struct actor_target){.damaged = damaged}, watch);
    return export_ply_folder(take, &(struct ply_frames){write_frame_points, &writer}, given->out, watch, damaged);
}

static enum status write_out(struct recording *recording, const struct export_arguments *given,
                             const struct progress_watch *watch)
{
    const bool place = given->format == EXPORT_PLY && given->what == PLY_PLACE;
    struct take *take = NULL;
    struct output *out = NULL;
    int64_t damaged = 0;
    enum status status = place ? OK : open_take(&take, recording, given);
    if (status == OK && take && !take_frame_count(take))
        status = fail(ERR_INPUT, "the take '%s' holds no frame", given->take);
    if (status == OK && is_folder(given)) {
        status = write_folder(take, given, watch, &damaged);
    } else if (status == OK) {
        status = output_open(&out, given->out);
        if (status == OK)
            status =
                place ? write_place(recording, given, output_file(out)) : write_take(take, given, out, watch, &damaged);
        if (status == NOTHING && command_stopped())
            status = fail(ERR_IO, "stopped");
        status = output_close(&out, status);
    }
    if (status == NOTHING && command_stopped())
        status = fail(ERR_IO, "stopped");
    if (status == OK && take)
        warn_of_gaps(given, take, damaged);
    take_close(&take);
    return status;
}

int capture_export(int argc, char **argv)
{
    static const struct argp argp = {
        options, parse_option, "FILE", "Writes a take, or the place, for other programs.", 0, 0, 0};
    struct export_arguments given = {.format = -1, .skeleton = -1, .at_s = NAN};
    struct progress_bar progress;
    const struct progress_watch watch = {.on_progress = on_progress, .self = &progress};
    command_parse(&argp, argc, argv, &given);
    struct recording *recording = NULL;
    enum status status = recording_open(&recording, given.file);
    if (status == OK)
        status = output_check(given.out, given.file, given.force && !is_folder(&given));
    if (status == OK && given.html)
        status = output_check(given.html, given.file, given.force);
    if (status == OK) {
        command_catch_signals();
        progress_bar_start(&progress, "exporting", 100);
        status = write_out(recording, &given, &watch);
        progress_bar_end(&progress);
    }
    recording_free(&recording);
    return status == OK ? 0 : command_failed(argv[0]);
}
