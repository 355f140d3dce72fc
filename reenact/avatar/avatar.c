#include "reenact/avatar/avatar.h"

#include "base/archive.h"
#include "base/portable_math.h"
#include "base/threads.h"
#include "recording/prepared.h"
#include "reenact/avatar/axial_rotation.h"
#include "reenact/avatar/deformation.h"
#include "reenact/avatar/tsdf.h"
#include "reenact/observation/depth_frame.h"
#include "reenact/skeleton/skeleton_track.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- avatar check

// Whether an avatar that was read from a file can be drawn: every number that something is looked up by is in range,
// and every other one is finite and one that a person's model can have. Not its TSDF, which tsdf.h checks. Pure.

// Farther, brighter, later than anything that a sensor sees of a person; chosen by hand so that sums and conversions of
// what passes cannot overflow.
#define MAX_M      100.0
#define MAX_COLOR  1000.0
#define MAX_S      1e7
#define UNIT_ERROR 1e-3 // of a unit vector's or quaternion's squared length

// False for what is not a number.
static bool is_within(double value, double max) { return fabs(value) <= max; }

static bool all_within(const double *values, size_t count, double max)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good &= is_within(values[i], max);
    return good;
}

static bool floats_within(const float *values, size_t count, double max)
{
    bool good = true;
    for (size_t i = 0; i < count; i++)
        good &= is_within((double)values[i], max);
    return good;
}

static bool points_within(const struct vec3 *points, int count, double max)
{
    return all_within(&points->x, 3 * (size_t)count, max);
}

static bool is_unit(struct vec3 v) { return is_within(v3_dot(v, v) - 1, UNIT_ERROR); }

static bool pose_is_rigid(const struct pose *pose)
{
    const struct quat q = pose->rotation;
    return is_within(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1, UNIT_ERROR) &&
           points_within(&pose->translation, 1, MAX_M);
}

static bool indices_within(const int32_t *numbers, int count, int32_t min, int32_t limit)
{
    for (int i = 0; i < count; i++)
        if (numbers[i] < min || numbers[i] >= limit)
            return false;
    return true;
}

// ------------------------------------------------------------- the parts

static bool bind_pose_is_sound(const struct bind_pose *pose)
{
    bool good = points_within(pose->skeleton.joint, JOINT_COUNT, MAX_M) &&
                floats_within(pose->skeleton.confidence, JOINT_COUNT, 1) &&
                all_within(pose->own_length, BONE_COUNT, MAX_M) && all_within(pose->radius, BONE_COUNT, MAX_M);
    for (int i = 0; i < BONE_COUNT && good; i++) {
        const struct bone_frame *f = &pose->frame[i];
        if (pose->known[i])
            good = points_within(&f->origin, 1, MAX_M) && is_within(f->length, MAX_M) && is_unit(f->x) &&
                   is_unit(f->y) && is_unit(f->z) && pose->radius[i] >= 0;
    }
    for (int j = 0; j < JOINT_COUNT && good; j++)
        good = covariance_is_finite(pose->skeleton.covariance[j]);
    return good && pose->known[PART_UPPER_TORSO];
}

static bool surface_is_sound(const struct avatar *avatar)
{
    const struct surface_mesh *s = &avatar->surface;
    const struct vertex_colors *c = &avatar->vertex_colors;
    const size_t points = (size_t)s->point_count;
    bool good = s->point_count > 0 && s->corner_count > 0 && s->corner_count % 3 == 0 &&
                indices_within(s->corners, s->corner_count, 0, s->point_count) &&
                points_within(s->points, s->point_count, MAX_M) &&
                points_within(s->normals, s->point_count, 1 + UNIT_ERROR) &&
                floats_within(c->color[0], 3 * points, MAX_COLOR) && floats_within(c->time_s, points, MAX_S) &&
                floats_within(c->irradiance.term, SH_TERMS, MAX_COLOR);
    good = good && deformation_grid_is_small(s);
    for (size_t i = 0; i < points && good; i++) {
        const struct skin_weights *w = &avatar->skins[i];
        good = floats_within(w->weight, SKIN_BONES, 1 + UNIT_ERROR);
        for (int k = 0; k < SKIN_BONES; k++)
            good = good && w->bone[k] < BONE_COUNT && w->weight[k] >= 0;
    }
    return good;
}

static bool atlas_is_sound(const struct texture_atlas *atlas, int surface_points)
{
    const struct uv_mesh *m = &atlas->mesh;
    const int triangles = m->corner_count / 3;
    bool good = m->point_count > 0 && triangles > 0 && indices_within(m->points, m->point_count, 0, surface_points) &&
                indices_within(m->corners, m->corner_count, 0, m->point_count) &&
                indices_within(m->neighbor[0], 3 * triangles, -1, triangles) &&
                points_within(atlas->points, m->point_count, MAX_M) &&
                points_within(atlas->normals, m->point_count, 1 + UNIT_ERROR);
    for (int i = 0; i < m->point_count && good; i++)
        good =
            m->at[i][0] >= 0 && m->at[i][0] <= (float)m->width && m->at[i][1] >= 0 && m->at[i][1] <= (float)m->height;
    return good;
}

static bool frames_are_sound(const struct avatar *avatar, const struct take *take)
{
    bool good = avatar->frame_count > 0;
    for (int i = 0; i < avatar->frame_count && good; i++) {
        good = avatar->frames[i] >= (i ? avatar->frames[i - 1] + 1 : 0) && avatar->frames[i] < take_frame_count(take);
        for (int b = 0; b < BONE_COUNT && good; b++)
            good = pose_is_rigid(&avatar->frame_corrections[i].bone[b]);
    }
    return good;
}

// of that take
static bool avatar_is_sound(const struct avatar *avatar, const struct take *take)
{
    const struct joint_noise *errors = &avatar->joint_errors;
    return bind_pose_is_sound(&avatar->bind_pose) && surface_is_sound(avatar) &&
           atlas_is_sound(&avatar->atlas, avatar->surface.point_count) && frames_are_sound(avatar, take) &&
           all_within(errors->m, BONE_COUNT, MAX_M) && all_within(errors->rad, BONE_COUNT, MAX_M);
}

// ---------------------------------------------------------------- avatar store

// archive_array for a typed pointer.
#define ARRAY(a, pointer, count)                                                                                       \
    do {                                                                                                               \
        void *array_ = (pointer);                                                                                      \
        archive_array((a), &array_, &(count), sizeof *(pointer));                                                      \
        (pointer) = array_;                                                                                            \
    } while (0)

static void bind_pose_archive(struct archive *archive, struct bind_pose *pose)
{
    ARCHIVE(archive, pose->skeleton.joint);
    ARCHIVE(archive, pose->skeleton.confidence);
    ARCHIVE(archive, pose->skeleton.covariance);
    for (int i = 0; i < BONE_COUNT; i++) {
        uint8_t known = pose->known[i];
        ARCHIVE(archive, known);
        pose->known[i] = known != 0;
    }
    ARCHIVE(archive, pose->frame);
    ARCHIVE(archive, pose->own_length);
    ARCHIVE(archive, pose->radius);
}

// Arrays of the surface's points; *count comes back as their number, or the archive fails.
static void surface_archive(struct archive *archive, struct avatar *avatar)
{
    struct surface_mesh *s = &avatar->surface;
    struct vertex_colors *c = &avatar->vertex_colors;
    int points = s->point_count, normals = points, colors = points, times = points, filled = points;
    ARRAY(archive, s->points, points);
    ARRAY(archive, s->normals, normals);
    ARRAY(archive, c->color, colors);
    ARRAY(archive, c->time_s, times);
    ARRAY(archive, c->filled, filled);
    ARRAY(archive, s->corners, s->corner_count);
    ARCHIVE(archive, c->irradiance);
    s->point_count = points;
    archive->failed |= normals != points || colors != points || times != points || filled != points;
}

// Field by field: the struct has padding.
static void skins_archive(struct archive *archive, struct avatar *avatar)
{
    const size_t points = (size_t)avatar->surface.point_count;
    if (archive->reading && !archive->failed) {
        avatar->skins = malloc(points * sizeof *avatar->skins + 1);
        archive->failed |= archive->out_of_memory |= !avatar->skins;
    }
    for (size_t i = 0; i < points && !archive->failed; i++) {
        ARCHIVE(archive, avatar->skins[i].bone);
        ARCHIVE(archive, avatar->skins[i].weight);
    }
}

static void atlas_archive(struct archive *archive, struct texture_atlas *atlas)
{
    struct uv_mesh *m = &atlas->mesh;
    int points = m->point_count, at = points, moved = points, normals = points, triangles = m->corner_count / 3;
    ARCHIVE(archive, m->width);
    ARCHIVE(archive, m->height);
    archive->failed |= m->width < 1 || m->height < 1 || m->width > 4096 || m->height > 4096;
    int texels = archive->failed ? 0 : 3 * m->width * m->height, times = archive->failed ? 0 : 4 * m->width * m->height;
    const int wanted_texels = texels, wanted_times = times;
    ARRAY(archive, m->points, points);
    ARRAY(archive, m->at, at);
    ARRAY(archive, m->corners, m->corner_count);
    ARRAY(archive, m->neighbor, triangles);
    ARRAY(archive, atlas->points, moved);
    ARRAY(archive, atlas->normals, normals);
    ARRAY(archive, atlas->color, texels);
    ARRAY(archive, atlas->seen_time, times);
    m->point_count = points;
    archive->failed |= at != points || moved != points || normals != points || m->corner_count != 3 * triangles ||
                       texels != wanted_texels || times != wanted_times;
}

static void avatar_archive(struct archive *archive, struct avatar *avatar)
{
    int corrections = avatar->frame_count;
    bind_pose_archive(archive, &avatar->bind_pose);
    surface_archive(archive, avatar);
    skins_archive(archive, avatar);
    atlas_archive(archive, &avatar->atlas);
    ARCHIVE(archive, avatar->joint_errors);
    ARRAY(archive, avatar->frames, avatar->frame_count);
    ARRAY(archive, avatar->frame_corrections, corrections);
    archive->failed |= corrections != avatar->frame_count;
}

enum status avatar_pack(const struct avatar *avatar, uint8_t **bytes, size_t *count)
{
    struct archive a = archive_writer();
    struct avatar copy = *avatar; // of the pointers; writing changes nothing
    avatar_archive(&a, &copy);
    tsdf_archive(&a, &copy.tsdf, NULL);
    if (!archive_is_whole(&a)) {
        free(a.bytes);
        return fail(ERR_MEMORY, "no memory to keep the avatar");
    }
    *bytes = a.bytes;
    *count = a.count;
    return OK;
}

enum status avatar_unpack(struct avatar *out, const struct take *take, const void *bytes, size_t count)
{
    struct archive a = archive_reader(bytes, count);
    *out = (struct avatar){0};
    avatar_archive(&a, out);
    if (!a.failed)
        tsdf_archive(&a, &out->tsdf, &(struct tsdf_of){&out->bind_pose, take_calibration(take)});
    if (archive_is_whole(&a) && avatar_is_sound(out, take))
        return OK;
    avatar_free(out);
    return a.out_of_memory ? fail(ERR_MEMORY, "no memory for the avatar")
                           : fail(ERR_CORRUPT, "what the recording keeps of the actor's model cannot be used");
}

enum status avatar_load(struct avatar *out, const struct take *take)
{
    uint8_t *bytes;
    size_t count;
    *out = (struct avatar){0};
    enum status status = prepared_read(take, PREPARED_AVATAR, AVATAR_VERSION, &bytes, &count);
    if (status != OK)
        return status;
    status = avatar_unpack(out, take, bytes, count);
    free(bytes);
    return status == ERR_CORRUPT ? NOTHING : status;
}

enum status avatar_save(const uint8_t *bytes, size_t count, const char *path, const struct take *take)
{
    return prepared_write(path, take, PREPARED_AVATAR, AVATAR_VERSION, bytes, count);
}

enum status avatar_obtain(struct avatar *out, struct take *take, const struct source_rays *rays,
                          const struct avatar_options *options)
{
    const enum status status = avatar_load(out, take);
    return status == OK ? OK : avatar_make(out, take, rays, options);
}

// ---------------------------------------------------------------- avatar

enum { SMOOTH_PASSES = 2, YAW_BINS = 24 };
static const double CORRECTION_DECAY = 0.85;           // share of a frame's corrections that the next starts with
static const double COARSE_VOXEL_M = 2 * TSDF_VOXEL_M; // joints err by centimetres: they give no finer shape

// The trunk's yaw, as one of YAW_BINS.
static int yaw_bin_of(const struct skeleton *skeleton)
{
    struct vec3 across = v3_sub(skeleton->joint[JOINT_LEFT_SHOULDER], skeleton->joint[JOINT_RIGHT_SHOULDER]);
    int bin = (int)((portable_atan2(across.z, across.x) / (2 * 3.14159265358979) + 0.5) * YAW_BINS);
    return bin < YAW_BINS ? bin : YAW_BINS - 1;
}

// Half of the frames are spread evenly over the take's time, half over the person's yaw: a person who spins once within
// a second shows the back in a few frames only.
static enum status choose_frames(struct avatar *avatar, const struct take *take, int max_frames)
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
    int64_t max = usable < max_frames ? usable : max_frames;
    if (!max)
        return NOTHING;
    avatar->frames = malloc(sizeof *avatar->frames * (size_t)max);
    avatar->frame_corrections = malloc(sizeof *avatar->frame_corrections * (size_t)max);
    if (!avatar->frames || !avatar->frame_corrections)
        return fail(ERR_MEMORY, "no memory for the avatar");
    double quota = 0.5;
    for (int64_t i = 0; i < frames && avatar->frame_count < max; i++) {
        const struct take_entry *e = take_entry(take, i);
        if (!e->has_skeleton || !e->has_depth)
            continue;
        quota += 0.5 * (double)max *
                 (1.0 / (double)usable + 1.0 / ((double)bins_used * (double)frames_in_bin[yaw_bin_of(&e->skeleton)]));
        if (quota >= 1) {
            avatar->frames[avatar->frame_count++] = i;
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

static enum status open_build(struct avatar_build *build, struct take *take, const struct source_rays *rays)
{
    const struct avatar *avatar = build->avatar;
    const struct lens *lens = &take_calibration(take)->color;
    enum status status = take_skeletons_open(&build->skeletons, take);
    const struct frame_source source = {take, build->skeletons, rays};
    if (status == OK)
        status = depth_frame_cache_open(&build->frame_cache, &source, avatar->frames, avatar->frame_count,
                                        AVATAR_CACHE_BYTES);
    for (int i = 0; i < IN_FLIGHT && status == OK; i++) {
        status = depth_frame_open(&build->job[i].depth_frame, take, rays);
        build->job[i].rgb = malloc(3 * (size_t)lens->width * (size_t)lens->height);
        if (status == OK && !build->job[i].rgb)
            status = fail(ERR_MEMORY, "no memory for the avatar");
    }
    build->take = take;
    return status;
}

static void close_build(struct avatar_build *build)
{
    depth_frame_cache_close(&build->frame_cache);
    take_skeletons_close(&build->skeletons);
    vertex_color_close(&build->color_builder);
    axial_rotation_close(&build->rotations);
    for (int i = 0; i < IN_FLIGHT; i++) {
        depth_frame_close(&build->job[i].depth_frame);
        deformation_close(&build->job[i].deformation);
        free(build->job[i].rgb);
    }
}

static double time_of(const struct avatar_build *build, int i)
{
    return (double)(take_entry(build->take, build->avatar->frames[i])->time_ns - take_entry(build->take, 0)->time_ns) *
           1e-9;
}

static struct axial_rotation_frame rotation_frame_of(const struct avatar_build *build, const struct frame_job *job,
                                                     int i)
{
    return (struct axial_rotation_frame){&job->depth_frame, job->rgb, &job->transforms, time_of(build, i)};
}

// ---------------------------------------------------------------- passes

static void relabel_frame(struct avatar_build *build, struct frame_job *job)
{
    const struct skeleton better = bone_transforms_skeleton(&build->avatar->bind_pose, &job->transforms);
    depth_frame_relabel(&job->depth_frame, &better);
}

static enum status measure_labels(struct avatar_build *build, struct frame_job *job, int i)
{
    (void)i;
    relabel_frame(build, job);
    return OK;
}

static enum status measure_silhouettes(struct avatar_build *build, struct frame_job *job, int i)
{
    (void)i;
    job->gaps = (struct silhouette_gaps){0};
    silhouette_measure(build->avatar->tsdf, take_calibration(build->take), &job->depth_frame, &job->transforms,
                       &job->gaps);
    return OK;
}

static enum status measure_seed(struct avatar_build *build, struct frame_job *job, int i)
{
    relabel_frame(build, job);
    const struct axial_rotation_frame frame = rotation_frame_of(build, job, i);
    axial_rotation_score_seed(build->rotations, i, &frame);
    return OK;
}

static enum status measure_rotations(struct avatar_build *build, struct frame_job *job, int i)
{
    relabel_frame(build, job);
    const struct axial_rotation_frame frame = rotation_frame_of(build, job, i);
    axial_rotation_measure(build->rotations, i, &frame);
    return OK;
}

static enum status measure_deformation(struct avatar_build *build, struct frame_job *job, int i)
{
    (void)i;
    const struct avatar *avatar = build->avatar;
    const enum status status = // leaves out the background's colours
        depth_frame_clean_colors(&job->depth_frame, take_calibration(build->take), job->rgb, job->rgb);
    const struct deformation_model model = {avatar->tsdf, &avatar->surface, avatar->skins};
    relabel_frame(build, job);
    if (!build->simple)
        deformation_fit(job->deformation, &model, &job->depth_frame, &job->transforms, NULL);
    return status;
}

static enum status add_shape(struct avatar_build *build, const struct frame_job *job, int i)
{
    (void)i;
    build->has_shown = true;
    return tsdf_integrate(build->target, &job->depth_frame, &job->transforms);
}

static enum status add_registered_shape(struct avatar_build *build, const struct frame_job *job, int i)
{
    joint_noise_add(&build->joint_errors, &build->avatar->bind_pose, build->avatar->frame_corrections[i].bone,
                    &job->uncertainty);
    return add_shape(build, job, i);
}

static enum status add_silhouettes(struct avatar_build *build, const struct frame_job *job, int i)
{
    (void)i;
    silhouette_gaps_add(&build->gaps, &job->gaps);
    return OK;
}

static enum status add_to_track(struct avatar_build *build, const struct frame_job *job, int i)
{
    const struct axial_rotation_frame frame = rotation_frame_of(build, job, i);
    axial_rotation_track(build->rotations, &frame);
    return OK;
}

static enum status add_colors(struct avatar_build *build, const struct frame_job *job, int i)
{
    const struct vertex_color_frame frame = {&job->depth_frame,
                                             job->rgb,
                                             &job->transforms,
                                             job->deformation,
                                             take_entry(build->take, build->avatar->frames[i])->world_from_camera,
                                             time_of(build, i)};
    vertex_color_add(build->color_builder, &frame);
    return OK;
}

// Where a frame's registration starts: at its joints, whose errors differ from frame to frame; at the previous frame's
// corrections, so that frames are aligned in order; at its own corrections of a pass before.
enum pass_start { START_AT_JOINTS, START_AT_PREVIOUS, START_AT_OWN };

// What a pass does with a frame.
static const struct pass {
    enum pass_start start;
    bool registers;      // to the shape so far, from that start; else the start is taken as it is
    bool axial_fixed;    // when it registers: the axial rotations stay
    bool uncertain;      // when it registers: its uncertainty is wanted
    bool needs_colors;   // a frame that lacks them is skipped
    bool in_track_order; // of axial_rotation_order, not of time
    enum status (*measure)(struct avatar_build *build, struct frame_job *job, int i);   // on the frame alone
    enum status (*add)(struct avatar_build *build, const struct frame_job *job, int i); // to the sums; NULL: nothing
} passes[AVATAR_COLOR_SAMPLES + 1] = {
    [AVATAR_TSDF_FROM_JOINTS] = {.start = START_AT_JOINTS, .measure = measure_labels, .add = add_shape},
    [AVATAR_SILHOUETTES_FROM_JOINTS] = {.start = START_AT_OWN, .measure = measure_silhouettes, .add = add_silhouettes},
    [AVATAR_TSDF_ALIGNED] = {.start = START_AT_PREVIOUS,
                             .registers = true,
                             .uncertain = true,
                             .measure = measure_labels,
                             .add = add_registered_shape},
    [AVATAR_SILHOUETTES_ALIGNED] = {.start = START_AT_OWN, .measure = measure_silhouettes, .add = add_silhouettes},
    [AVATAR_ROTATION_SEED] = {.start = START_AT_OWN, .needs_colors = true, .measure = measure_seed},
    [AVATAR_ROTATION_TRACK] = {.start = START_AT_OWN,
                               .needs_colors = true,
                               .in_track_order = true,
                               .measure = measure_labels,
                               .add = add_to_track},
    [AVATAR_ROTATION_MEASURE] = {.start = START_AT_OWN, .needs_colors = true, .measure = measure_rotations},
    [AVATAR_TSDF_FINAL] =
        {.start = START_AT_OWN, .registers = true, .axial_fixed = true, .measure = measure_labels, .add = add_shape},
    [AVATAR_SILHOUETTES_FINAL] = {.start = START_AT_OWN, .measure = measure_silhouettes, .add = add_silhouettes},
    [AVATAR_COLOR_SAMPLES] = {.start = START_AT_OWN,
                              .needs_colors = true,
                              .measure = measure_deformation,
                              .add = add_colors},
};

// ---------------------------------------------------------------- a frame in a pass

// NOTHING: the frame shows no actor, or lacks the colours that the pass needs.
static enum status read_frame(struct avatar_build *build, struct frame_job *job, int i)
{
    const struct depth_frame *frame = &job->depth_frame;
    uint8_t *rgb = passes[build->pass].needs_colors ? job->rgb : NULL;
    const enum status status = depth_frame_cache_read(build->frame_cache, i, &job->depth_frame, rgb);
    return status == OK && frame->right < frame->left ? NOTHING : status;
}

static struct bone_corrections initial_corrections(const struct avatar_build *build, int i)
{
    const struct bone_corrections none = bone_corrections_identity(), *all = build->avatar->frame_corrections;
    const enum pass_start start = passes[build->pass].start;
    if (start == START_AT_JOINTS || (start == START_AT_PREVIOUS && i == 0))
        return none;
    return start == START_AT_PREVIOUS ? bone_corrections_mix(&none, &all[i - 1], CORRECTION_DECAY) : all[i];
}

// Places a frame, registered to the shape so far where the pass does that, and measures it.
static enum status align_frame(struct avatar_build *build, struct frame_job *job, int i)
{
    struct avatar *avatar = build->avatar;
    const struct pass *pass = &passes[build->pass];
    struct icp_input from = {
        .joint_errors = avatar->joint_errors, .start = initial_corrections(build, i), .axial_fixed = pass->axial_fixed};
    struct bone_corrections *corrections = &avatar->frame_corrections[i];
    *corrections = pass->start == START_AT_PREVIOUS && i > 0 ? avatar->frame_corrections[i - 1] : from.start;
    enum status status = job->status;
    if (status == OK)
        status = bone_transforms_of(&avatar->bind_pose, take_skeletons_at(build->skeletons, avatar->frames[i]),
                                    &from.joints);
    if (status != OK)
        return status;
    if (pass->registers)
        *corrections =
            articulated_icp(avatar->tsdf, &job->depth_frame, &from, pass->uncertain ? &job->uncertainty : NULL);
    job->transforms = bone_corrections_apply(&from.joints, corrections);
    return pass->measure(build, job, i);
}

// Stages that run at the same time share nothing that any of them changes.
static enum status do_stage(void *context, int stage, int item)
{
    struct avatar_build *build = context;
    struct frame_job *job = &build->job[item % IN_FLIGHT];
    const struct pass *pass = &passes[build->pass];
    const int i = pass->in_track_order ? axial_rotation_order(build->rotations, item) : item;
    if (stage == READ)
        job->status = read_frame(build, job, i);
    else if (stage == ALIGN)
        job->status = align_frame(build, job, i);
    else if (job->status == OK && pass->add)
        job->status = pass->add(build, job, i);
    return job->status;
}

static bool report_pass_progress(void *context, double share)
{
    const struct avatar_build *build = context;
    return progress_continue(build->watch, (build->pass + share) / (AVATAR_COLOR_SAMPLES + 1));
}

// NOTHING: the avatar is not wanted any more.
static enum status run_pass(struct avatar *avatar, struct avatar_build *build, enum avatar_step pass)
{
    const struct pipeline pipeline = {
        .items = avatar->frame_count,
        .stages = STAGES,
        .in_flight = IN_FLIGHT,
        .in_order = {[READ] = true, [ALIGN] = passes[pass].start == START_AT_PREVIOUS, [INTEGRATE] = true},
        .work = do_stage,
        .on_progress = report_pass_progress,
        .context = build};
    build->pass = pass;
    progress_begin_step(build->watch, pass);
    return pipeline_run(&pipeline, build->threads);
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

static enum status make_round(struct avatar *avatar, struct avatar_build *build, const struct fusion_round *round)
{
    enum status status = tsdf_open(&build->target, &avatar->bind_pose, take_calibration(build->take), round->step_m,
                                   build->inner_threads);
    if (status == OK && avatar->tsdf)
        status = tsdf_copy_free_space(build->target, avatar->tsdf);
    if (status == OK)
        status = run_pass(avatar, build, round->shape);
    if (status != OK) {
        tsdf_close(&build->target);
        return status;
    }
    tsdf_close(&avatar->tsdf);
    avatar->tsdf = build->target;
    build->target = NULL;
    if (round->shape == AVATAR_TSDF_FINAL)
        tsdf_flatten_unseen_trunk(avatar->tsdf);
    if (round != &rounds[0])
        status = tsdf_smooth(avatar->tsdf, SMOOTH_PASSES);
    build->gaps = (struct silhouette_gaps){0};
    if (status == OK)
        status = run_pass(avatar, build, round->silhouettes);
    if (status == OK)
        tsdf_match_silhouettes(avatar->tsdf, &build->gaps);
    return status;
}

// Corrects the axial rotations of each frame's round bones by their colours.
static enum status find_axial_rotations(struct avatar *avatar, struct avatar_build *build)
{
    struct surface_mesh surface = {0};
    double *time_s = malloc(sizeof *time_s * (size_t)avatar->frame_count);
    enum status status =
        time_s ? tsdf_extract_surface(avatar->tsdf, &surface) : fail(ERR_MEMORY, "no memory for the avatar");
    if (status == OK)
        status = axial_rotation_open(&build->rotations, &avatar->bind_pose, &surface, take_calibration(build->take),
                                     avatar->frame_count);
    if (status == OK)
        status = run_pass(avatar, build, AVATAR_ROTATION_SEED);
    if (status == OK)
        status = run_pass(avatar, build, AVATAR_ROTATION_TRACK);
    if (status == OK)
        status = run_pass(avatar, build, AVATAR_ROTATION_MEASURE);
    for (int i = 0; i < avatar->frame_count && status == OK; i++)
        time_s[i] = time_of(build, i);
    if (status == OK)
        status = axial_rotation_apply(build->rotations, time_s, avatar->frame_corrections);
    surface_mesh_free(&surface);
    free(time_s);
    return status;
}

// The first round has the joints only. A tracker that assumes too thick or too thin a person puts the joints too far or
// not far enough behind the observed surface, from every side, so that front and back are fused too far apart or too
// near. Silhouettes, seen from the side, have the right width: each round ends with the shape matched to them, and the
// second registers the frames to that. The third registers them again, with axial rotations from colours and with the
// joints weighted by their measured errors.
static enum status make_shape(struct avatar *avatar, struct avatar_build *build)
{
    enum status status = OK;
    avatar->joint_errors = joint_noise_prior();
    for (size_t i = 0; i < (build->simple ? 1 : COUNT_OF(rounds)) && status == OK; i++) {
        status = make_round(avatar, build, &rounds[i]);
        if (status == OK && !build->has_shown)
            status = NOTHING;
        if (status != OK || rounds[i].shape != AVATAR_TSDF_ALIGNED)
            continue;
        avatar->joint_errors = joint_noise_estimate(&build->joint_errors);
        status = find_axial_rotations(avatar, build);
    }
    if (status == OK && build->simple)
        status = tsdf_smooth(avatar->tsdf, SMOOTH_PASSES);
    if (status != OK)
        return status;
    progress_begin_step(build->watch, AVATAR_SURFACE);
    return tsdf_extract_surface(avatar->tsdf, &avatar->surface);
}

static enum status make_vertex_colors(struct avatar *avatar, struct avatar_build *build)
{
    avatar->skins = malloc(sizeof *avatar->skins * (size_t)avatar->surface.point_count);
    if (!avatar->skins)
        return fail(ERR_MEMORY, "no memory for the avatar");
    for (int i = 0; i < avatar->surface.point_count; i++)
        avatar->skins[i] = bind_pose_skin_weights(&avatar->bind_pose, avatar->surface.points[i]);
    const struct vertex_color_target target = {&avatar->bind_pose, &avatar->surface, avatar->skins};
    enum status status =
        vertex_color_open(&build->color_builder, &target, take_calibration(build->take), build->inner_threads);
    for (int i = 0; i < IN_FLIGHT && status == OK; i++)
        status = deformation_open(&build->job[i].deformation, &avatar->bind_pose, &avatar->surface,
                                  take_calibration(build->take));
    if (status == OK)
        status = run_pass(avatar, build, AVATAR_COLOR_SAMPLES);
    progress_begin_step(build->watch, AVATAR_VERTEX_COLORS);
    return status == OK ? vertex_color_solve(build->color_builder, &avatar->vertex_colors) : status;
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

void avatar_free(struct avatar *avatar)
{
    tsdf_close(&avatar->tsdf);
    surface_mesh_free(&avatar->surface);
    vertex_colors_free(&avatar->vertex_colors);
    texture_atlas_free(&avatar->atlas);
    free(avatar->skins);
    free(avatar->frames);
    free(avatar->frame_corrections);
    *avatar = (struct avatar){0};
}

struct bone_corrections avatar_corrections(const struct avatar *avatar, int64_t frame)
{
    int after = 0;
    while (after < avatar->frame_count && avatar->frames[after] < frame)
        after++;
    if (after == avatar->frame_count)
        return avatar->frame_corrections[after - 1];
    if (after == 0 || avatar->frames[after] == frame)
        return avatar->frame_corrections[after];
    double t =
        (double)(frame - avatar->frames[after - 1]) / (double)(avatar->frames[after] - avatar->frames[after - 1]);
    return bone_corrections_mix(&avatar->frame_corrections[after - 1], &avatar->frame_corrections[after], t);
}
