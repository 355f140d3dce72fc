#include "reenact/avatar/avatar.h"
#include "base/portable_math.h"

#include "base/pipeline.h"
#include "reenact/avatar/axial_rotation.h"
#include "reenact/avatar/silhouette_constraint.h"
#include "reenact/observation/depth_frame_cache.h"
#include "reenact/skeleton/take_skeletons.h"

#include <stdlib.h>
#include <string.h>

enum { SMOOTH_PASSES = 2, YAW_BINS = 24 };
static const double CORRECTION_DECAY = 0.85;           // share of a frame's corrections that the next starts with
static const double COARSE_VOXEL_M = 2 * TSDF_VOXEL_M; // joints err by centimetres: they give no finer shape

// The trunk's yaw, as one of YAW_BINS.
static int yaw_bin_of(const struct skeleton *s)
{
    struct vec3 across = v3_sub(s->joint[JOINT_LEFT_SHOULDER], s->joint[JOINT_RIGHT_SHOULDER]);
    int bin = (int)((portable_atan2(across.z, across.x) / (2 * 3.14159265358979) + 0.5) * YAW_BINS);
    return bin < YAW_BINS ? bin : YAW_BINS - 1;
}

// Half of the frames are spread evenly over the take's time, half over the person's yaw: a person who spins once within
// a second shows the back in a few frames only.
static enum status choose_frames(struct avatar *f, const struct take *take, int max_frames)
{
    int64_t frames = take_frame_count(take), usable = 0, frames_in_bin[YAW_BINS] = {0};
    int bins_used = 0;
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        usable++;
        bins_used += !frames_in_bin[yaw_bin_of(&e->skeleton)]++;
    }
    int64_t most = usable < max_frames ? usable : max_frames;
    if (!most)
        return NOTHING;
    f->frames = malloc(sizeof *f->frames * (size_t)most);
    f->frame_corrections = malloc(sizeof *f->frame_corrections * (size_t)most);
    if (!f->frames || !f->frame_corrections)
        return fail(ERR_MEMORY, "out of memory");
    double quota = 0.5;
    for (int64_t i = 0; i < frames && f->frame_count < most; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        quota += 0.5 * (double)most *
                 (1.0 / (double)usable + 1.0 / ((double)bins_used * (double)frames_in_bin[yaw_bin_of(&e->skeleton)]));
        if (quota >= 1) {
            f->frames[f->frame_count++] = i;
            quota = fmin(quota - 1, 1); // a frame is used only once
        }
    }
    return OK;
}

// A frame on its way through a pass.
struct frame_job {
    struct depth_frame depth_frame;
    struct bone_transforms transforms; // corrected as far as known by then
    struct joint_noise uncertainty;    // of these, in AVATAR_TSDF_ALIGNED
    uint8_t *rgb;                      // the frame's colours, in passes that need them
    struct deformation *deformation;   // the frame's, in AVATAR_COLOR_SAMPLES
    struct silhouette_gaps gaps;       // in passes that measure silhouettes
    enum status status;                // NOTHING: the frame is skipped
};

// One pass over all frames: each is read, aligned by itself, and integrated in the frames' order.
enum pass_stage { READ, ALIGN, INTEGRATE, STAGES };
enum { IN_FLIGHT = 6 };

struct avatar_build {
    struct avatar *avatar;
    struct take *take;
    struct take_skeletons *skeletons;
    struct depth_frame_cache *frame_cache;
    enum avatar_step pass;
    struct tsdf *target;                        // that is fused, in AVATAR_TSDF_*
    struct silhouette_gaps gaps;                // sums, in AVATAR_SILHOUETTES_*
    struct joint_noise_sum joint_errors;        // in AVATAR_TSDF_ALIGNED
    struct axial_rotation *rotations;           // in AVATAR_ROTATION_*
    struct vertex_color_builder *color_builder; // in AVATAR_COLOR_SAMPLES
    struct frame_job job[IN_FLIGHT];
    const struct progress_watch *watch;
    int threads, inner_threads;
    bool simple;    // avatar_options.simple
    bool has_shown; // a frame has shown the actor's surface; without any the shape is the prior's alone
};

static enum status open_build(struct avatar_build *r, struct take *take, const struct source_rays *rays)
{
    const struct avatar *f = r->avatar;
    const struct lens *lens = &take_calibration(take)->color;
    enum status status = take_skeletons_open(&r->skeletons, take);
    const struct frame_source source = {take, r->skeletons, rays};
    if (status == OK)
        status = depth_frame_cache_open(&r->frame_cache, &source, f->frames, f->frame_count, AVATAR_CACHE_BYTES);
    for (int i = 0; i < IN_FLIGHT && status == OK; i++) {
        status = depth_frame_open(&r->job[i].depth_frame, take, rays);
        r->job[i].rgb = malloc(3 * (size_t)lens->width * (size_t)lens->height);
        if (status == OK && !r->job[i].rgb)
            status = fail(ERR_MEMORY, "out of memory");
    }
    r->take = take;
    return status;
}

static void close_build(struct avatar_build *r)
{
    depth_frame_cache_close(&r->frame_cache);
    take_skeletons_close(&r->skeletons);
    vertex_color_close(&r->color_builder);
    axial_rotation_close(&r->rotations);
    for (int i = 0; i < IN_FLIGHT; i++) {
        depth_frame_close(&r->job[i].depth_frame);
        deformation_close(&r->job[i].deformation);
        free(r->job[i].rgb);
    }
}

static bool needs_colors(enum avatar_step pass)
{
    return pass == AVATAR_ROTATION_SEED || pass == AVATAR_ROTATION_TRACK || pass == AVATAR_ROTATION_MEASURE ||
           pass == AVATAR_COLOR_SAMPLES;
}

// NOTHING: the frame shows no actor, or lacks the colours that the pass needs.
static enum status read_frame(struct avatar_build *r, struct frame_job *job, int i)
{
    const struct depth_frame *s = &job->depth_frame;
    const enum status status =
        depth_frame_cache_read(r->frame_cache, i, &job->depth_frame, needs_colors(r->pass) ? job->rgb : NULL);
    return status == OK && s->right < s->left ? NOTHING : status;
}

static bool measures_silhouettes(enum avatar_step pass)
{
    return pass == AVATAR_SILHOUETTES_FROM_JOINTS || pass == AVATAR_SILHOUETTES_ALIGNED ||
           pass == AVATAR_SILHOUETTES_FINAL;
}

static double time_of(const struct avatar_build *r, int i)
{
    return (double)(take_entry(r->take, r->avatar->frames[i])->time_ns - take_entry(r->take, 0)->time_ns) * 1e-9;
}

static struct axial_rotation_frame rotation_frame_of(const struct avatar_build *r, const struct frame_job *job, int i)
{
    return (struct axial_rotation_frame){&job->depth_frame, job->rgb, &job->transforms, time_of(r, i)};
}

// Initial value of a frame's registration: the first pass uses the joints, whose errors differ from frame to frame; the
// second the previous frame's corrections; later ones the frame's own.
static struct bone_corrections initial_corrections(const struct avatar_build *r, int i)
{
    const struct bone_corrections none = bone_corrections_identity(), *all = r->avatar->frame_corrections;
    if (r->pass == AVATAR_TSDF_FROM_JOINTS || (r->pass == AVATAR_TSDF_ALIGNED && i == 0))
        return none;
    return r->pass == AVATAR_TSDF_ALIGNED ? bone_corrections_mix(&none, &all[i - 1], CORRECTION_DECAY) : all[i];
}

// Registers a frame to the shape so far, relabels it, and does what the pass measures on one frame alone.
static enum status align_frame(struct avatar_build *r, struct frame_job *job, int i)
{
    struct avatar *f = r->avatar;
    struct icp_input from = {.joint_errors = f->joint_errors,
                             .start = initial_corrections(r, i),
                             .axial_fixed = r->pass == AVATAR_TSDF_FINAL};
    struct bone_corrections *a = &f->frame_corrections[i];
    *a = r->pass == AVATAR_TSDF_ALIGNED && i > 0 ? f->frame_corrections[i - 1] : from.start;
    enum status status = job->status;
    if (status == OK)
        status = bone_transforms_of(&f->bind_pose, take_skeletons_at(r->skeletons, f->frames[i]), &from.joints);
    if (status != OK)
        return status;
    if (r->pass == AVATAR_TSDF_ALIGNED || r->pass == AVATAR_TSDF_FINAL)
        *a = articulated_icp(f->tsdf, &job->depth_frame, &from,
                             r->pass == AVATAR_TSDF_ALIGNED ? &job->uncertainty : NULL);
    job->transforms = bone_corrections_apply(&from.joints, a);
    if (measures_silhouettes(r->pass)) {
        job->gaps = (struct silhouette_gaps){0};
        silhouette_measure(f->tsdf, take_calibration(r->take), &job->depth_frame, &job->transforms, &job->gaps);
        return OK;
    }
    if (r->pass == AVATAR_COLOR_SAMPLES) // without background colours
        status = depth_frame_clean_colors(&job->depth_frame, take_calibration(r->take), job->rgb, job->rgb);
    struct skeleton better = bone_transforms_skeleton(&f->bind_pose, &job->transforms);
    depth_frame_relabel(&job->depth_frame, &better);
    const struct axial_rotation_frame frame = rotation_frame_of(r, job, i);
    if (r->pass == AVATAR_ROTATION_SEED)
        axial_rotation_score_seed(r->rotations, i, &frame);
    if (r->pass == AVATAR_ROTATION_MEASURE)
        axial_rotation_measure(r->rotations, i, &frame);
    if (r->pass == AVATAR_COLOR_SAMPLES) {
        const struct deformation_model model = {f->tsdf, &f->surface, f->skins};
        if (!r->simple)
            deformation_fit(job->deformation, &model, &job->depth_frame, &job->transforms, NULL);
    }
    return status;
}

static enum status integrate_frame(struct avatar_build *r, const struct frame_job *job, int i)
{
    const struct axial_rotation_frame frame = rotation_frame_of(r, job, i);
    if (r->pass == AVATAR_TSDF_ALIGNED)
        joint_noise_add(&r->joint_errors, &r->avatar->bind_pose, r->avatar->frame_corrections[i].bone,
                        &job->uncertainty);
    if (measures_silhouettes(r->pass))
        silhouette_gaps_add(&r->gaps, &job->gaps);
    else if (r->pass == AVATAR_ROTATION_TRACK)
        axial_rotation_track(r->rotations, &frame);
    else if (r->pass == AVATAR_COLOR_SAMPLES)
        vertex_color_add(r->color_builder,
                         &(struct vertex_color_frame){&job->depth_frame, job->rgb, &job->transforms, job->deformation,
                                                      take_entry(r->take, r->avatar->frames[i])->world_from_camera,
                                                      time_of(r, i)});
    else if (r->target) {
        r->has_shown = true;
        return tsdf_integrate(r->target, &job->depth_frame, &job->transforms);
    }
    return OK;
}

// Stages that run at the same time share nothing that any of them changes.
static enum status do_stage(void *context, int stage, int item)
{
    struct avatar_build *r = context;
    struct frame_job *job = &r->job[item % IN_FLIGHT];
    const int i = r->pass == AVATAR_ROTATION_TRACK ? axial_rotation_order(r->rotations, item) : item;
    if (stage == READ)
        job->status = read_frame(r, job, i);
    else if (stage == ALIGN)
        job->status = align_frame(r, job, i);
    else if (job->status == OK)
        job->status = integrate_frame(r, job, i);
    return job->status;
}

static bool report_pass_progress(void *context, double share)
{
    const struct avatar_build *r = context;
    return progress_continue(r->watch, (r->pass + share) / (AVATAR_COLOR_SAMPLES + 1));
}

// NOTHING: the avatar is not wanted any more. AVATAR_TSDF_ALIGNED starts each frame from the previous one, in order.
static enum status run_pass(struct avatar *f, struct avatar_build *r, enum avatar_step pass)
{
    const struct pipeline pipeline = {
        .items = f->frame_count,
        .stages = STAGES,
        .in_flight = IN_FLIGHT,
        .in_order = {[READ] = true, [ALIGN] = pass == AVATAR_TSDF_ALIGNED, [INTEGRATE] = true},
        .work = do_stage,
        .on_progress = report_pass_progress,
        .context = r};
    r->pass = pass;
    progress_begin_step(r->watch, pass);
    return pipeline_run(&pipeline, r->threads);
}

// One pass over the frames fuses a shape, the next measures it against their silhouettes.
static const struct fusion_round {
    enum avatar_step shape, silhouettes;
    double step_m;
} rounds[] = {
    {AVATAR_TSDF_FROM_JOINTS, AVATAR_SILHOUETTES_FROM_JOINTS, COARSE_VOXEL_M},
    {AVATAR_TSDF_ALIGNED, AVATAR_SILHOUETTES_ALIGNED, TSDF_VOXEL_M},
    {AVATAR_TSDF_FINAL, AVATAR_SILHOUETTES_FINAL, TSDF_VOXEL_M},
};

static enum status make_round(struct avatar *f, struct avatar_build *r, const struct fusion_round *round)
{
    enum status status =
        tsdf_open(&r->target, &f->bind_pose, take_calibration(r->take), round->step_m, r->inner_threads);
    if (status == OK && f->tsdf)
        status = tsdf_copy_free_space(r->target, f->tsdf);
    if (status == OK)
        status = run_pass(f, r, round->shape);
    if (status != OK) {
        tsdf_close(&r->target);
        return status;
    }
    tsdf_close(&f->tsdf);
    f->tsdf = r->target;
    r->target = NULL;
    if (round->shape == AVATAR_TSDF_FINAL)
        tsdf_flatten_unseen_trunk(f->tsdf);
    if (round != &rounds[0])
        status = tsdf_smooth(f->tsdf, SMOOTH_PASSES);
    r->gaps = (struct silhouette_gaps){0};
    if (status == OK)
        status = run_pass(f, r, round->silhouettes);
    if (status == OK)
        tsdf_match_silhouettes(f->tsdf, &r->gaps);
    return status;
}

// Corrects the axial rotations of each frame's round bones by their colours.
static enum status find_axial_rotations(struct avatar *f, struct avatar_build *r)
{
    struct surface_mesh surface = {0};
    double *time_s = malloc(sizeof *time_s * (size_t)f->frame_count);
    enum status status = time_s ? tsdf_extract_surface(f->tsdf, &surface) : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = axial_rotation_open(&r->rotations, &f->bind_pose, &surface, take_calibration(r->take), f->frame_count);
    if (status == OK)
        status = run_pass(f, r, AVATAR_ROTATION_SEED);
    if (status == OK)
        status = run_pass(f, r, AVATAR_ROTATION_TRACK);
    if (status == OK)
        status = run_pass(f, r, AVATAR_ROTATION_MEASURE);
    for (int i = 0; i < f->frame_count && status == OK; i++)
        time_s[i] = time_of(r, i);
    if (status == OK)
        status = axial_rotation_apply(r->rotations, time_s, f->frame_corrections);
    surface_mesh_free(&surface);
    free(time_s);
    return status;
}

// The first round has the joints only. A tracker that assumes too thick or too thin a person puts the joints too far or
// not far enough behind the observed surface, from every side, so that front and back are fused too far apart or too
// near. Silhouettes, seen from the side, have the right width: each round ends with the shape matched to them, and the
// second registers the frames to that. The third registers them again, with axial rotations from colours and with the
// joints weighted by their measured errors.
static enum status make_shape(struct avatar *f, struct avatar_build *r)
{
    enum status status = OK;
    f->joint_errors = joint_noise_prior();
    for (size_t i = 0; i < (r->simple ? 1 : COUNT_OF(rounds)) && status == OK; i++) {
        status = make_round(f, r, &rounds[i]);
        if (status == OK && !r->has_shown)
            status = NOTHING;
        if (status != OK || rounds[i].shape != AVATAR_TSDF_ALIGNED)
            continue;
        f->joint_errors = joint_noise_estimate(&r->joint_errors);
        status = find_axial_rotations(f, r);
    }
    if (status == OK && r->simple)
        status = tsdf_smooth(f->tsdf, SMOOTH_PASSES);
    if (status != OK)
        return status;
    progress_begin_step(r->watch, AVATAR_SURFACE);
    return tsdf_extract_surface(f->tsdf, &f->surface);
}

static enum status make_vertex_colors(struct avatar *f, struct avatar_build *r)
{
    f->skins = malloc(sizeof *f->skins * (size_t)f->surface.point_count);
    if (!f->skins)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < f->surface.point_count; i++)
        f->skins[i] = bind_pose_skin_weights(&f->bind_pose, f->surface.points[i]);
    const struct vertex_color_target target = {&f->bind_pose, &f->surface, f->skins};
    enum status status = vertex_color_open(&r->color_builder, &target, take_calibration(r->take), r->inner_threads);
    for (int i = 0; i < IN_FLIGHT && status == OK; i++)
        status = deformation_open(&r->job[i].deformation, &f->bind_pose, &f->surface, take_calibration(r->take));
    if (status == OK)
        status = run_pass(f, r, AVATAR_COLOR_SAMPLES);
    progress_begin_step(r->watch, AVATAR_VERTEX_COLORS);
    return status == OK ? vertex_color_solve(r->color_builder, &f->vertex_colors) : status;
}

struct avatar_options avatar_default_options(void)
{
    return (struct avatar_options){.max_frames = AVATAR_FRAMES, .threads = 4};
}

enum status avatar_make(struct avatar *out, struct take *take, const struct source_rays *rays,
                        const struct avatar_options *options)
{
    *out = (struct avatar){0};
    struct avatar_build build = {.avatar = out, .watch = options->watch};
    build.threads = options->threads;
    build.simple = options->simple;
    build.inner_threads = options->threads > 1 ? options->threads / 2 : 1;
    enum status status = bind_pose_make(&out->bind_pose, take);
    if (status == OK)
        status = choose_frames(out, take, options->max_frames);
    if (status == OK)
        status = open_build(&build, take, rays);
    if (status == OK)
        status = make_shape(out, &build);
    if (status == OK)
        status = make_vertex_colors(out, &build);
    progress_begin_step(options->watch, AVATAR_ATLAS);
    if (status == OK)
        status = texture_atlas_make(&out->atlas, &out->surface, &out->vertex_colors, build.inner_threads);
    close_build(&build);
    if (status != OK)
        avatar_free(out);
    return status;
}

void avatar_free(struct avatar *f)
{
    tsdf_close(&f->tsdf);
    surface_mesh_free(&f->surface);
    vertex_colors_free(&f->vertex_colors);
    texture_atlas_free(&f->atlas);
    free(f->skins);
    free(f->frames);
    free(f->frame_corrections);
    *f = (struct avatar){0};
}

struct bone_corrections avatar_corrections(const struct avatar *f, int64_t frame)
{
    int after = 0;
    while (after < f->frame_count && f->frames[after] < frame)
        after++;
    if (after == f->frame_count)
        return f->frame_corrections[after - 1];
    if (after == 0 || f->frames[after] == frame)
        return f->frame_corrections[after];
    double t = (double)(frame - f->frames[after - 1]) / (double)(f->frames[after] - f->frames[after - 1]);
    return bone_corrections_mix(&f->frame_corrections[after - 1], &f->frame_corrections[after], t);
}
