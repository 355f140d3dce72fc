// Joints as CSV.
#include "capture/export.h"

#include "base/text.h"
#include "formats/bvh_printer.h"
#include "formats/joints_csv.h"
#include "formats/markers.h"
#include "formats/ply.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/output.h"
#include "platform/files/png.h"
#include "platform/files/video.h"
#include "platform/sensors/source.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- export csv

enum status export_joints_csv(const struct take *take, enum export_axes axes, FILE *out)
{
    int64_t printed = 0, people = 0;
    joints_csv_begin(out, axes == EXPORT_ROOM ? JOINTS_CSV_ROOM : JOINTS_CSV_CAMERA);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *entry = take_entry(take, i);
        people += entry->has_skeleton;
        if (!entry->has_skeleton || (axes == EXPORT_ROOM && !entry->located))
            continue;
        const struct skeleton s =
            axes == EXPORT_ROOM ? skeleton_transform(entry->world_from_camera, &entry->skeleton) : entry->skeleton;
        joints_csv_add(out, entry->time_ns, &s);
        printed++;
    }
    if (people && !printed)
        return fail(ERR_INPUT,
                    "the sensor was not located in a room, so there are no room's axes; export without them");
    return OK;
}

// ---------------------------------------------------------------- export film

// The sensor's film as MP4.

// One image of the take, if it has colour.
static enum status add_frame(struct video_writer *video, struct take *take, int64_t frame)
{
    struct take_images images;
    enum status status = take_read(take, frame, TAKE_COLOR, &images);
    return status == OK && images.color ? video_add(video, images.color, take_entry(take, frame)->time_ns) : status;
}

enum status export_film_mp4(struct take *take, FILE *out, bool seekable, const struct progress_watch *watch,
                            int64_t *damaged)
{
    const struct lens *l = &take_calibration(take)->color;
    const int64_t frames = take_frame_count(take);
    int64_t with_color = 0;
    for (int64_t i = 0; i < frames; i++)
        with_color += take_entry(take, i)->has_color;
    if (!with_color)
        return fail(ERR_INPUT, "the take has no colour images, so there is no film");
    struct video_writer *video;
    enum status status = video_open(&video, out, &(struct video_layout){l->width, l->height, seekable});
    *damaged = 0;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        status = progress_continue(watch, (double)i / (double)frames) ? add_frame(video, take, i) : NOTHING;
        if (status == ERR_CORRUPT && ++*damaged < with_color)
            status = OK;
    }
    return video_close(&video, status);
}

// ---------------------------------------------------------------- export ply

// Points of a frame and of a place, as PLY.

static const uint8_t NO_COLOR[3] = {160, 160, 160};

// A depth image with the colours that belong to it.
struct colored_depth {
    const struct calibration *calibration;
    const uint16_t *depth; // millimetres
    const uint8_t *rgb;    // NULL: none
    const uint8_t *mask;   // only these pixels; NULL: all
    struct pose world_from_color;
    int step; // every so many pixels and rows
};

static const uint8_t *color_at(const struct colored_depth *depth, struct vec3 in_color)
{
    const struct lens *l = &depth->calibration->color;
    if (!depth->rgb || !(in_color.z > 0))
        return NO_COLOR;
    const struct pixel px = lens_project_clamped(l, lens_max_radius2(l), in_color);
    const long x = lround(px.x), y = lround(px.y);
    if (x < 0 || y < 0 || x >= l->width || y >= l->height)
        return NO_COLOR;
    return depth->rgb + 3 * ((size_t)y * (size_t)l->width + (size_t)x);
}

static enum status add_depth(struct ply *ply, const struct colored_depth *depth)
{
    const struct lens *l = &depth->calibration->depth;
    const struct pose color_from_depth = depth->calibration->color_from_depth;
    for (int y = 0; y < l->height; y += depth->step)
        for (int x = 0; x < l->width; x += depth->step) {
            const size_t i = (size_t)y * (size_t)l->width + (size_t)x;
            if (!depth->depth[i] || (depth->mask && !depth->mask[i]))
                continue;
            const struct vec3 ray = lens_ray(l, (struct pixel){x, y});
            const struct vec3 p = pose_apply(color_from_depth, v3_scale(ray, 0.001 * depth->depth[i]));
            enum status status = ply_add_point(ply, pose_apply(depth->world_from_color, p), color_at(depth, p));
            if (status != OK)
                return status;
        }
    return OK;
}

enum status export_points_ply(struct take *take, int64_t frame, bool actor, FILE *out)
{
    const struct take_entry *e = take_entry(take, frame);
    struct take_images images;
    struct ply ply = {0};
    enum status status = take_read(take, frame, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
    if (status == OK && (!images.depth || (actor && !images.mask)))
        return NOTHING;
    if (status == OK) {
        const struct colored_depth d = {.calibration = take_calibration(take),
                                        .depth = images.depth,
                                        .rgb = images.color,
                                        .mask = actor ? images.mask : NULL,
                                        .world_from_color = e->located ? e->world_from_camera : POSE_IDENTITY,
                                        .step = 1};
        status = add_depth(&ply, &d);
    }
    if (status == OK && !ply.point_count)
        status = NOTHING;
    if (status == OK)
        ply_print(&ply, e->located ? "world axes, z up" : "camera axes, x right, y down, z forward", out);
    ply_free(&ply);
    return status;
}

static enum status add_view(struct ply *ply, const struct place *place, const struct place_view *view)
{
    const struct lens *l = &place->calibration.color;
    uint8_t *rgb = NULL;
    if (!view->depth)
        return OK;
    if (view->jpeg && l->width) {
        rgb = malloc(3 * (size_t)l->width * (size_t)l->height);
        if (!rgb)
            return fail(ERR_MEMORY, "no memory for an image of the place");
        enum status status = jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, l->width, l->height);
        if (status != OK) {
            free(rgb);
            rgb = NULL; // damaged: its points have no colour
        }
        if (status == ERR_MEMORY)
            return status;
    }
    const struct colored_depth d = {.calibration = &place->calibration,
                                    .depth = view->depth,
                                    .rgb = rgb,
                                    .world_from_color = view->world_from_camera,
                                    .step = 4};
    enum status status = add_depth(ply, &d);
    free(rgb);
    return status;
}

static enum status add_tag(struct ply *ply, const struct place_tag *tag)
{
    static const uint8_t red[3] = {220, 40, 40};
    struct vec3 corners[4];
    const int32_t first = ply->point_count;
    enum status status = OK;
    place_tag_corners(tag, corners);
    for (int i = 0; i < 4 && status == OK; i++)
        status = ply_add_point(ply, corners[i], red);
    if (status == OK)
        status = ply_add_triangle(ply, first, first + 1, first + 2);
    return status == OK ? ply_add_triangle(ply, first, first + 2, first + 3) : status;
}

enum status export_place_ply(const struct place *place, FILE *out)
{
    static const uint8_t green[3] = {40, 180, 90};
    struct ply ply = {0};
    enum status status = OK;
    for (int32_t i = 0; i < place->tag_count && status == OK; i++)
        status = add_tag(&ply, &place->tags[i]);
    for (int32_t i = 0; i < place->point_count && status == OK; i++)
        status = ply_add_point(&ply, place->points[i].world, green);
    for (int32_t i = 0; i < place->view_count && status == OK; i++)
        status = add_view(&ply, place, &place->views[i]);
    if (status == OK && !ply.point_count)
        status = NOTHING;
    if (status == OK)
        ply_print(&ply, "world axes, z up; tags red, landmarks green", out);
    ply_free(&ply);
    return status;
}

// ---------------------------------------------------------------- y up

// The skeleton with y up, in the world where the sensor was located, else in the camera's axes.
static struct skeleton y_up_skeleton(const struct take_entry *entry)
{
    static const struct pose y_up_from_z_up = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};
    static const struct pose y_up_from_camera = {{1, 0, 0, 0}, {0, 0, 0}};
    struct pose from_camera =
        entry->located ? pose_multiply(y_up_from_z_up, entry->world_from_camera) : y_up_from_camera;
    return skeleton_transform(from_camera, &entry->skeleton);
}

// ---------------------------------------------------------------- export bvh

// Every joint's rotation and, of joints that move in their parent's axes, their position.

// A joint that leaves its place in its parent's axes by more than this at any time has position channels.
static const double RIGID_M = 2e-4;

enum { NO_PARENT = BVH_ROOT };

// The body as a tree, parents before children.
static const struct body_bone {
    enum joint joint;
    int parent; // index into this table; NO_PARENT for the root
} bones[] = {
    {JOINT_WAIST, NO_PARENT}, {JOINT_TORSO, 0},      {JOINT_NECK, 1},        {JOINT_HEAD, 2},
    {JOINT_LEFT_SHOULDER, 2}, {JOINT_LEFT_ELBOW, 4}, {JOINT_LEFT_HAND, 5},   {JOINT_RIGHT_SHOULDER, 2},
    {JOINT_RIGHT_ELBOW, 7},   {JOINT_RIGHT_HAND, 8}, {JOINT_LEFT_HIP, 0},    {JOINT_LEFT_KNEE, 10},
    {JOINT_LEFT_FOOT, 11},    {JOINT_RIGHT_HIP, 0},  {JOINT_RIGHT_KNEE, 13}, {JOINT_RIGHT_FOOT, 14},
};
enum { BONES = COUNT_OF(bones) };

// The bind pose, y up, facing +z: the directions from parent to joint.
static const struct vec3 bind_direction[BONES] = {
    {0, 0, 0},  {0, 1, 0},  {0, 1, 0},      {0, 1, 0},  {1, 0, 0},  {1, 0, 0},       {1, 0, 0},  {-1, 0, 0},
    {-1, 0, 0}, {-1, 0, 0}, {0.6, -0.8, 0}, {0, -1, 0}, {0, -1, 0}, {-0.6, -0.8, 0}, {0, -1, 0}, {0, -1, 0},
};

static bool is_bone_usable(const struct skeleton *skeleton, int bone)
{
    return skeleton->confidence[bones[bone].joint] > 0 && v3_finite(skeleton->joint[bones[bone].joint]);
}

// The rotation of the whole body: x across the pelvis, y up the spine. `before` where it is not known.
static struct quat root_rotation(const struct skeleton *skeleton, struct quat before)
{
    if (!(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0 &&
          skeleton->confidence[JOINT_TORSO] > 0 && skeleton->confidence[JOINT_WAIST] > 0))
        return before;
    struct vec3 y = v3_unit(v3_sub(skeleton->joint[JOINT_TORSO], skeleton->joint[JOINT_WAIST]));
    struct vec3 across = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    struct vec3 z = v3_unit(v3_cross(across, y));
    if (v3_dot(y, y) == 0 || v3_dot(z, z) == 0)
        return before;
    struct vec3 x = v3_cross(y, z);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

// Every joint's rotation with respect to the world: its parent's, and the smallest rotation
// that points the bone at its first known child. A joint that is not known
// has its parent's rotation.
static void world_rotations(const struct skeleton *skeleton, struct quat before_root, struct quat rotation[BONES])
{
    for (int b = 0; b < BONES; b++) {
        rotation[b] = bones[b].parent == NO_PARENT ? root_rotation(skeleton, before_root) : rotation[bones[b].parent];
        // waist and neck have several children and rotate with the body
        if (bones[b].joint == JOINT_WAIST || bones[b].joint == JOINT_NECK)
            continue;
        for (int child = b + 1; child < BONES; child++)
            if (bones[child].parent == b && is_bone_usable(skeleton, b) && is_bone_usable(skeleton, child)) {
                struct vec3 is = v3_sub(skeleton->joint[bones[child].joint], skeleton->joint[bones[b].joint]);
                struct vec3 expected_direction = quat_rotate(rotation[b], bind_direction[child]);
                rotation[b] = quat_unit(quat_multiply(quat_between(expected_direction, is), rotation[b]));
                break;
            }
    }
}

// One exported frame.
struct motion_frame {
    int64_t time_ns;
    int64_t shown;               // for how many frames of the file, at least 1: it stays until the next one
    struct vec3 root;            // of the root, metres
    struct quat rotation[BONES]; // with respect to the world
    struct vec3 at[BONES];       // in the parent's axes, metres
    bool known[BONES];           // both ends of the bone are
};

struct motion {
    struct motion_frame *frames;
    int64_t count;
    int64_t shown; // frames of the file
    double frame_s;
    struct vec3 offset[BONES]; // the median of `at`, metres
    bool moves[BONES];         // has position channels
};

static enum status motion_open(struct motion *motion, const struct take *take)
{
    int64_t frames = take_frame_count(take);
    struct quat root = {0, 0, 0, 1};
    const bool in_world = take_is_located(take); // the same axes all along the file
    *motion = (struct motion){.frames = calloc((size_t)(frames ? frames : 1), sizeof *motion->frames)};
    if (!motion->frames)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *entry = take_entry(take, i);
        if (!entry->has_skeleton || (in_world && !entry->located))
            continue;
        struct motion_frame *f = &motion->frames[motion->count++];
        f->time_ns = entry->time_ns;
        const struct skeleton s = y_up_skeleton(entry);
        world_rotations(&s, root, f->rotation);
        root = f->rotation[0];
        f->root = is_bone_usable(&s, 0) ? s.joint[JOINT_WAIST] : v3(0, 0, 0);
        for (int b = 1; b < BONES; b++) {
            const int parent = bones[b].parent;
            f->known[b] = is_bone_usable(&s, b) && is_bone_usable(&s, parent);
            const struct vec3 bone = v3_sub(s.joint[bones[b].joint], s.joint[bones[parent].joint]);
            if (f->known[b])
                f->at[b] = quat_rotate(quat_conjugate(f->rotation[parent]), bone);
        }
    }
    return motion->count ? OK : fail(ERR_INPUT, "the take has no skeleton: no person was tracked in it");
}

// BVH has one step of time for all frames. So a frame before a gap, in which no person was tracked or frames were
// dropped, is shown for as many frames as the gap is long, and the step is the mean one then. A clock that jumps by
// more than a minute has no gap there.
static enum status find_times(struct motion *motion)
{
    const double max_s = 60;
    double *steps = malloc(sizeof *steps * (size_t)motion->count), seconds = 0;
    if (!steps)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int64_t i = 0; i + 1 < motion->count; i++)
        steps[i] = (double)(motion->frames[i + 1].time_ns - motion->frames[i].time_ns) * 1e-9;
    const double usual_s = median_of(steps, (size_t)motion->count - 1);
    free(steps);
    motion->frames[motion->count - 1].shown = motion->shown = 1;
    for (int64_t i = 0; i + 1 < motion->count; i++) {
        struct motion_frame *f = &motion->frames[i];
        const double step_s = (double)(f[1].time_ns - f->time_ns) * 1e-9;
        const bool jump = step_s > max_s;
        f->shown = jump ? 1 : (int64_t)fmax(1, floor(step_s / usual_s + 0.5));
        motion->shown += f->shown;
        seconds += jump ? usual_s : step_s;
    }
    motion->frame_s = motion->count > 1 ? seconds / (double)(motion->shown - 1) : 1.0 / 30;
    return OK;
}

// The median place of every joint in its parent's axes, and whether it leaves that.
static enum status find_offsets(struct motion *motion)
{
    double *seen = malloc(sizeof *seen * (size_t)(motion->count ? motion->count : 1));
    if (!seen)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int b = 1; b < BONES; b++) {
        double median[3];
        for (int axis = 0; axis < 3; axis++) {
            size_t count = 0;
            for (int64_t i = 0; i < motion->count; i++)
                if (motion->frames[i].known[b])
                    seen[count++] = (&motion->frames[i].at[b].x)[axis];
            median[axis] = median_of(seen, count);
        }
        motion->offset[b] = v3(median[0], median[1], median[2]);
        for (int64_t i = 0; i < motion->count; i++)
            motion->moves[b] |=
                motion->frames[i].known[b] && v3_distance(motion->frames[i].at[b], motion->offset[b]) > RIGID_M;
    }
    free(seen);
    return OK;
}

// Where a bone without a child ends, in the joint's axes, metres: a hand's, foot's and head's usual length.
static struct vec3 end_site(enum joint joint)
{
    if (joint == JOINT_HEAD)
        return v3(0, 0.12, 0);
    if (joint == JOINT_LEFT_FOOT || joint == JOINT_RIGHT_FOOT)
        return v3(0, -0.06, 0.15);
    return v3(joint == JOINT_LEFT_HAND ? 0.1 : -0.1, 0, 0);
}

static void fill_hierarchy(const struct motion *motion, struct bvh_bone out[BONES])
{
    for (int b = 0; b < BONES; b++)
        out[b] = (struct bvh_bone){.name = joint_name(bones[b].joint),
                                   .parent = bones[b].parent,
                                   .offset = motion->offset[b],
                                   .has_positions = motion->moves[b],
                                   .end = end_site(bones[b].joint)};
}

static void print_frame(FILE *out, const struct bvh_bone hierarchy[BONES], const struct motion *motion,
                        const struct motion_frame *frame)
{
    for (int b = 0; b < BONES; b++) {
        const int parent = bones[b].parent;
        const struct vec3 at = frame->known[b] ? frame->at[b] : motion->offset[b];
        const struct quat rotation = frame->rotation[b];
        if (parent == NO_PARENT)
            bvh_print_bone(&hierarchy[b], frame->root, rotation, out);
        else
            bvh_print_bone(&hierarchy[b], at, quat_multiply(quat_conjugate(frame->rotation[parent]), rotation), out);
    }
    fputc('\n', out);
}

static void print_motion(FILE *out, const struct motion *motion)
{
    struct bvh_bone hierarchy[BONES];
    fill_hierarchy(motion, hierarchy);
    bvh_print_hierarchy(hierarchy, BONES, out);
    bvh_print_motion(motion->shown, motion->frame_s, out);
    for (int64_t i = 0; i < motion->count; i++)
        for (int64_t k = 0; k < motion->frames[i].shown; k++)
            print_frame(out, hierarchy, motion, &motion->frames[i]);
}

enum status export_bvh(const struct take *take, FILE *out)
{
    struct motion motion;
    enum status status = motion_open(&motion, take);
    if (status == OK)
        status = find_times(&motion);
    if (status == OK)
        status = find_offsets(&motion);
    if (status == OK)
        print_motion(out, &motion);
    free(motion.frames);
    return status;
}

// ---------------------------------------------------------------- export markers

enum status export_markers(const struct take *take, struct markers *out)
{
    const int64_t frames = take_frame_count(take);
    const bool in_world = take_is_located(take);
    struct marker_sample *samples = malloc(sizeof *samples * (size_t)(frames ? frames : 1));
    int64_t count = 0;
    if (!samples)
        return fail(ERR_MEMORY, "no memory to export the joints");
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *entry = take_entry(take, i);
        if (entry->has_skeleton && (entry->located || !in_world))
            samples[count++] = (struct marker_sample){entry->time_ns, y_up_skeleton(entry)};
    }
    const enum status status = markers_make(out, samples, count);
    free(samples);
    return status;
}

enum status export_trc(const struct take *take, const char *name, FILE *out)
{
    struct markers markers;
    const enum status status = export_markers(take, &markers);
    if (status == OK)
        trc_print(&markers, name, out);
    markers_free(&markers);
    return status;
}

enum status export_c3d(const struct take *take, FILE *out)
{
    struct markers markers;
    const enum status status = export_markers(take, &markers);
    if (status == OK)
        c3d_print(&markers, out);
    markers_free(&markers);
    return status;
}

// ---------------------------------------------------------------- export folder

// A take as a folder in the TUM RGB-D layout.

enum list { LIST_COLOR, LIST_DEPTH, LIST_MASK, LIST_PAIRS, LIST_TRAJECTORY, LIST_JOINTS, LIST_COUNT };

static const struct folder_list {
    const char *file, *images, *heading; // images: the folder of this list's images; NULL: none
} lists[LIST_COUNT] = {
    [LIST_COLOR] = {"rgb.txt", "rgb", "# timestamp filename"},
    [LIST_DEPTH] = {"depth.txt", "depth", "# timestamp filename (PNG, 16 bits: millimetres, 0: no reading)"},
    [LIST_MASK] = {"mask.txt", "mask", "# timestamp filename (PNG, 8 bits: 255 the actor)"},
    [LIST_PAIRS] = {"associations.txt", NULL, NULL}, // as other programs pair images; they take no comment
    [LIST_TRAJECTORY] =
        {"trajectory.txt", NULL,
         "# timestamp tx ty tz qx qy qz qw (world_from_camera, metres; camera x right, y down, z forward)"},
    [LIST_JOINTS] = {"joints.csv", NULL, NULL},
};

struct folder_export {
    struct take *take;
    char dir[PATH_MAX];
    struct output *list[LIST_COUNT];
    uint8_t *gray; // scratch for masks
};

// "DIR/NAME" into path[PATH_MAX].
static enum status join_path(char *path, const char *dir, const char *name)
{
    if (snprintf(path, PATH_MAX, "%s/%s", dir, name) >= PATH_MAX)
        return fail(ERR_INPUT, "the path %.60s… is too long", dir);
    return OK;
}

static enum status open_lists(struct folder_export *export)
{
    char path[PATH_MAX];
    enum status status = folder_make(export->dir);
    for (int i = 0; i < LIST_COUNT && status == OK; i++) {
        status = join_path(path, export->dir, lists[i].file);
        if (status == OK)
            status = output_open(&export->list[i], path);
        if (status == OK && lists[i].heading)
            fprintf(output_file(export->list[i]), "%s\n", lists[i].heading);
        if (status == OK && lists[i].images)
            status = join_path(path, export->dir, lists[i].images);
        if (status == OK && lists[i].images)
            status = folder_make(path);
    }
    return status;
}

static enum status write_image(struct folder_export *export, enum list list, int64_t frame, const uint8_t *bytes,
                               size_t count)
{
    char name[64], path[PATH_MAX];
    snprintf(name, sizeof name, "%s/%06lld.%s", lists[list].images, (long long)frame,
             list == LIST_COLOR ? "jpg" : "png");
    enum status status = join_path(path, export->dir, name);
    if (status == OK)
        status = file_write(path, bytes, count);
    char time[SECONDS_TEXT_BYTES];
    fprintf(output_file(export->list[list]), "%s %s\n", seconds_text(take_entry(export->take, frame)->time_ns, 9, time),
            name);
    return status;
}

static enum status write_png(struct folder_export *export, enum list list, int64_t frame, const void *pixels)
{
    const struct lens *l = &take_calibration(export->take)->depth;
    const struct png_layout layout = {list == LIST_DEPTH ? PNG_GRAY16 : PNG_GRAY8, l->width, l->height};
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&layout, pixels, 3, &bytes, &count);
    if (status == OK) {
        status = write_image(export, list, frame, bytes, count);
        free(bytes);
    }
    return status;
}

static enum status write_mask(struct folder_export *export, int64_t frame, const uint8_t *mask)
{
    const struct lens *l = &take_calibration(export->take)->depth;
    const size_t pixels = (size_t)l->width * (size_t)l->height;
    if (!export->gray && !(export->gray = malloc(pixels)))
        return fail(ERR_MEMORY, "no memory for a mask");
    for (size_t i = 0; i < pixels; i++)
        export->gray[i] = mask[i] ? 255 : 0;
    return write_png(export, LIST_MASK, frame, export->gray);
}

static enum status write_color(struct folder_export *export, int64_t frame)
{
    const uint8_t *jpeg;
    size_t count;
    enum status status = take_read_jpeg(export->take, frame, &jpeg, &count);
    if (status != OK)
        return status;
    uint8_t *plain;
    status = jpeg_without_metadata(jpeg, count, &plain, &count);
    if (status == OK)
        status = write_image(export, LIST_COLOR, frame, plain, count);
    free(plain);
    return status;
}

static void write_pose(struct folder_export *export, const struct take_entry *entry)
{
    const struct pose *p = &entry->world_from_camera;
    char time[SECONDS_TEXT_BYTES];
    fprintf(output_file(export->list[LIST_TRAJECTORY]), "%s %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n",
            seconds_text(entry->time_ns, 9, time), p->translation.x, p->translation.y, p->translation.z, p->rotation.x,
            p->rotation.y, p->rotation.z, p->rotation.w);
}

// A frame's image in `list`. NOTHING: it has none.
static enum status write_list_image(struct folder_export *export, enum list list, int64_t frame)
{
    struct take_images images;
    if (list == LIST_COLOR)
        return write_color(export, frame);
    const enum status status = take_read(export->take, frame, list == LIST_DEPTH ? TAKE_DEPTH : TAKE_MASK, &images);
    if (status != OK)
        return status;
    if (list == LIST_DEPTH)
        return images.depth ? write_png(export, LIST_DEPTH, frame, images.depth) : NOTHING;
    return images.mask ? write_mask(export, frame, images.mask) : NOTHING;
}

static void write_pair(struct folder_export *export, int64_t frame)
{
    char time[SECONDS_TEXT_BYTES];
    seconds_text(take_entry(export->take, frame)->time_ns, 9, time);
    fprintf(output_file(export->list[LIST_PAIRS]), "%s %s/%06lld.jpg %s %s/%06lld.png\n", time,
            lists[LIST_COLOR].images, (long long)frame, time, lists[LIST_DEPTH].images, (long long)frame);
}

// Each image on its own, so that a damaged one costs no other. *damaged: whether there was one.
static enum status write_frame(struct folder_export *export, int64_t frame, bool *damaged)
{
    const struct take_entry *entry = take_entry(export->take, frame);
    bool written[LIST_MASK + 1];
    *damaged = false;
    for (enum list list = LIST_COLOR; list <= LIST_MASK; list++) {
        const enum status status = write_list_image(export, list, frame);
        written[list] = status == OK;
        *damaged |= status == ERR_CORRUPT;
        if (status < 0 && status != ERR_CORRUPT)
            return status;
    }
    if (written[LIST_COLOR] && written[LIST_DEPTH])
        write_pair(export, frame);
    if (entry->located)
        write_pose(export, entry);
    return OK;
}

static enum status write_frames(struct folder_export *export, const struct progress_watch *watch, int64_t *damaged)
{
    const int64_t frames = take_frame_count(export->take);
    enum status status = OK;
    *damaged = 0;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        bool faulty = false;
        status = progress_continue(watch, (double)i / (double)frames) ? write_frame(export, i, &faulty) : NOTHING;
        *damaged += faulty;
    }
    if (status == OK && *damaged == frames && frames)
        return ERR_CORRUPT; // the last one's sentence
    if (status == OK)
        status = export_joints_csv(export->take, EXPORT_SENSOR, output_file(export->list[LIST_JOINTS]));
    char path[PATH_MAX];
    if (status == OK)
        status = join_path(path, export->dir, "calibration.json");
    return status == OK ? calibration_write(path, take_calibration(export->take)) : status;
}

// dir: what is asked for; part: where it is made.
static enum status begin_folder(const char *dir, char part[PATH_MAX])
{
    if (file_exists(dir))
        return fail(ERR_EXISTS, "%s exists; give another name", dir);
    if (snprintf(part, PATH_MAX, "%s.part", dir) >= PATH_MAX)
        return fail(ERR_INPUT, "the path %.60s… is too long", dir);
    if (file_exists(part))
        return fail(ERR_EXISTS, "%s, an unfinished folder, exists; remove it", part);
    return OK;
}

static enum status end_folder(const char *part, const char *dir, enum status status)
{
    if (status == OK)
        status = folder_rename(part, dir);
    if (status != OK)
        folder_remove(part);
    return status;
}

enum status export_folder(struct take *take, const char *dir, const struct progress_watch *watch, int64_t *damaged)
{
    struct folder_export e = {.take = take};
    enum status status = begin_folder(dir, e.dir);
    if (status != OK)
        return status;
    status = open_lists(&e);
    if (status == OK)
        status = write_frames(&e, watch, damaged);
    for (int i = 0; i < LIST_COUNT; i++)
        status = output_close(&e.list[i], status);
    free(e.gray);
    return end_folder(e.dir, dir, status);
}

// ---------------------------------------------------------------- export ply folder

// NOTHING, ERR_CORRUPT: the frame has no file.
static enum status write_ply_frame(const struct ply_frames *frames, const char *dir, int64_t frame, int64_t time_ns,
                                   FILE *list)
{
    char name[32], path[PATH_MAX], time[SECONDS_TEXT_BYTES];
    struct output *out;
    snprintf(name, sizeof name, "%06lld.ply", (long long)frame);
    enum status status = join_path(path, dir, name);
    if (status == OK)
        status = output_open(&out, path);
    if (status != OK)
        return status;
    status = output_close(&out, frames->write(frames->self, frame, output_file(out)));
    if (status == OK)
        fprintf(list, "%s %s\n", seconds_text(time_ns, 9, time), name);
    return status;
}

static enum status write_ply_frames(struct take *take, const struct ply_frames *frames, const char *dir,
                                    const struct progress_watch *watch, int64_t *damaged)
{
    const int64_t count = take_frame_count(take);
    char path[PATH_MAX];
    struct output *list = NULL;
    int64_t written = 0;
    enum status status = join_path(path, dir, "ply.txt");
    if (status == OK)
        status = output_open(&list, path);
    if (status == OK)
        fputs("# timestamp filename\n", output_file(list));
    for (int64_t i = 0; i < count && status == OK; i++) {
        if (!progress_continue(watch, (double)i / (double)count))
            return output_close(&list, NOTHING);
        status = write_ply_frame(frames, dir, i, take_entry(take, i)->time_ns, output_file(list));
        written += status == OK;
        *damaged += status == ERR_CORRUPT;
        status = status == NOTHING || status == ERR_CORRUPT ? OK : status;
    }
    if (status == OK && !written)
        status = fail(ERR_INPUT, "no frame of the take has such points");
    return output_close(&list, status);
}

enum status export_ply_folder(struct take *take, const struct ply_frames *frames, const char *dir,
                              const struct progress_watch *watch, int64_t *damaged)
{
    char part[PATH_MAX];
    *damaged = 0;
    enum status status = begin_folder(dir, part);
    if (status != OK)
        return status;
    status = folder_make(part);
    if (status == OK)
        status = write_ply_frames(take, frames, part, watch, damaged);
    return end_folder(part, dir, status);
}
