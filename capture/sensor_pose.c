// Averages the poses of a sensor at rest, and decides by repeated checks that it was moved.
#include "capture/sensor_pose.h"

#include "base/portable_math.h"
#include "base/registered_depth.h"
#include "locate/tag_corners.h"
#include "locate/tag_model.h"
#include "recording/take_floor.h"

#include <stdlib.h>

// ---------------------------------------------------------------- gravity align

// Gravity from the floor plane.

// Up directions that differ by less agree: the accuracy of a plane fitted to a noisy floor. Chosen by hand.
static const double LEVEL_RAD = 0.004;

// How far from z = 0 a levelled plane may lie and still be the floor. Chosen by hand.
static const double FLOOR_M = 0.12;

// Rotates world_from_camera about `pivot` (world axes: the centre of the tags, which
// keep their positions in the image) until the floor is level. False, and no change,
// where pose and floor agree already, or where the plane would then
// not lie at z = 0 and so is not the floor.
static bool gravity_align_pose(struct pose *world_from_camera, struct vec3 pivot,
                               const struct floor_plane *floor_in_camera)
{
    struct vec3 up = quat_rotate(world_from_camera->rotation, floor_in_camera->up);
    if (v3_dot(up, v3(0, 0, 1)) > portable_cos(LEVEL_RAD))
        return false;
    struct quat rotation = quat_between(up, v3(0, 0, 1));
    struct pose level = {
        quat_unit(quat_multiply(rotation, world_from_camera->rotation)),
        v3_add(pivot, quat_rotate(rotation, v3_sub(world_from_camera->translation, pivot))),
    };
    if (fabs(level.translation.z - floor_in_camera->height_m) > FLOOR_M)
        return false;
    *world_from_camera = level;
    return true;
}

// ---------------------------------------------------------------- sensor tilt

// What compare/joint_samples.c takes for standing, and up to which tilt.
static const double STANDS_S = 1, STANDS_COS = 0.819; // 35 degrees

static bool is_actor_upright(const struct take *take)
{
    struct vec3 sum = {0, 0, 0}, axis;
    double seconds = 0;
    for (int64_t i = 0; i + 1 < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        const double step_s = ((double)take_entry(take, i + 1)->time_ns - (double)e->time_ns) * 1e-9;
        if (!e->has_skeleton || step_s > 0.2 || !skeleton_standing_axis(&e->skeleton, &axis))
            continue;
        sum = v3_add(sum, v3_scale(axis, step_s));
        seconds += step_s;
    }
    return seconds >= STANDS_S && v3_dot(v3_unit(sum), v3(0, -1, 0)) > STANDS_COS;
}

static bool shows_person(const struct take *take)
{
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (take_entry(take, i)->has_skeleton)
            return true;
    return false;
}

enum status sensor_tilt_judge(struct take *take, struct take_verdict *out)
{
    struct vec3 up;
    if (take_is_located(take) || !shows_person(take) || is_actor_upright(take))
        return OK;
    const enum status status = take_floor_up(take, &up);
    if (status == NOTHING)
        verdict_say(
            out, 0,
            "how the sensor is tilted is not known: stand upright for a second, have the floor in the picture, or "
            "map the room, to be compared rightly");
    return status == NOTHING ? OK : status;
}

// ---------------------------------------------------------------- sensor pose

// After the first frames, one frame in so many is checked: twice a second at 30 Hz. More often while there is a
// candidate as accurate as the mean, because until it is accepted the pose is wrong. Chosen by hand.
enum { CHECK_EVERY = 15, CHECK_SOON = 5 };

// A pose that differs from the mean by more than GATE_SIGMAS of its own standard deviations is a candidate; never for
// less than LEAST, by which a stand yields, and always for more than MOST. It is accepted when enough checks in a row
// agree with it, because a person who covers a tag makes poses that are off by centimetres, the same way for seconds.
// Candidates as accurate as the best pose in the mean need fewer checks. Chosen by hand.
static const double GATE_SIGMAS = 3;
static const double MIN_MOVED_M = 0.01, MIN_MOVED_RAD = 0.003, MAX_MOVED_M = 0.05, MAX_MOVED_RAD = 0.02;
enum { CHECKS_ACCURATE = 3, CHECKS_OTHER = 8 };

// Less accurate poses than the locator accepts by default are used, because the floor improves them.
static const double WORST_SIGMA_M = 1;

// The mean is final after this many poses.
enum { ENOUGH_POSES = 40 };

struct sensor_pose {
    struct locator *locator;
    struct calibration calibration;
    struct vec3 *references; // the tags' centres, world axes; in a place without tags its landmarks
    int32_t reference_count;
    int64_t frame, with_color; // frames so far; those with a colour image
    int poses;                 // in the mean; 0 = not located
    struct pose mean;
    double mean_weight;
    double min_sigma_m;   // of the poses in the mean
    int candidate_checks; // that agreed with the candidate in a row; 0 = there is none
    struct pose candidate;
    bool candidate_is_accurate; // about as accurate as the best pose in the mean
    int moves, far_moves;
    struct mirrored_tags *mirror; // NULL: the place has no tags, or it was looked for them often enough
    uint8_t *gray;                // for it
    int mirror_looks, mirror_shows;
    struct sensor_sight sight;
    uint16_t *resized; // depth on colour's pixels; NULL: it lies there already, or is not registered
    double scale_sum;  // of sight.depth_scale
    int scales;
};

static enum status open_mirror(struct sensor_pose *pose, const struct place *place)
{
    if (!place->tag_count)
        return OK;
    int32_t *ids = malloc((size_t)place->tag_count * sizeof *ids);
    pose->gray = malloc(lens_pixels(&pose->calibration.color));
    for (int32_t i = 0; i < place->tag_count && ids; i++)
        ids[i] = place->tags[i].id;
    const enum status status = ids && pose->gray
                                   ? mirrored_tags_open(&pose->mirror, &pose->calibration.color, ids, place->tag_count)
                                   : fail(ERR_MEMORY, "no memory to locate the sensor");
    free(ids);
    return status;
}

enum status sensor_pose_open(struct sensor_pose **out, const struct place *place, const struct calibration *calibration)
{
    struct sensor_pose *s = calloc(1, sizeof *s);
    *out = NULL;
    if (!s)
        return fail(ERR_MEMORY, "no memory to locate the sensor");
    s->calibration = *calibration;
    s->mean = POSE_IDENTITY;
    s->reference_count = place->tag_count ? place->tag_count : place->point_count;
    struct locator_options options = locator_default_options();
    options.max_position_sigma_m = WORST_SIGMA_M;
    struct lens lens = calibration->color;
    lens.readout_s = 0; // no rolling shutter correction: the sensor is at rest
    enum status status = locator_open(&s->locator, place, &lens, &options);
    if (registered_depth_differs(calibration))
        s->resized = malloc(lens_pixels(&calibration->color) * sizeof *s->resized);
    if (status == OK && (!(s->references = malloc(sizeof *s->references * (size_t)(s->reference_count + 1))) ||
                         (registered_depth_differs(calibration) && !s->resized)))
        status = fail(ERR_MEMORY, "no memory to locate the sensor");
    if (status != OK) {
        sensor_pose_close(&s);
        return status;
    }
    if ((status = open_mirror(s, place)) != OK) {
        sensor_pose_close(&s);
        return status;
    }
    for (int32_t i = 0; i < s->reference_count; i++)
        s->references[i] = place->tag_count ? place->tags[i].world_from_tag.translation : place->points[i].world;
    *out = s;
    return OK;
}

void sensor_pose_close(struct sensor_pose **pose)
{
    if (*pose) {
        locator_close(&(*pose)->locator);
        mirrored_tags_close(&(*pose)->mirror);
        free((*pose)->gray);
        free((*pose)->references);
        free((*pose)->resized);
    }
    free(*pose);
    *pose = NULL;
}

// Whether a pose agrees with an earlier one within its covariance (6-vector: rotation, then translation).
static bool is_pose_consistent(const struct location *found, struct pose before)
{
    const double *c = found->covariance;
    double angle = GATE_SIGMAS * sqrt(c[0] + c[7] + c[14]), shift = GATE_SIGMAS * found->position_sigma_m;
    angle = fmin(fmax(angle, MIN_MOVED_RAD), MAX_MOVED_RAD);
    shift = fmin(fmax(shift, MIN_MOVED_M), MAX_MOVED_M);
    return v3_distance(found->world_from_camera.translation, before.translation) < shift &&
           pose_angle(found->world_from_camera, before) < angle;
}

static bool is_far(struct pose a, struct pose b)
{
    return !(v3_distance(a.translation, b.translation) < MAX_MOVED_M && pose_angle(a, b) < MAX_MOVED_RAD);
}

static void update_mean_pose(struct sensor_pose *sensor_pose, struct pose pose, double weight)
{
    double share = weight / (sensor_pose->mean_weight + weight);
    sensor_pose->mean.translation = v3_mix(sensor_pose->mean.translation, pose.translation, share);
    sensor_pose->mean.rotation = quat_slerp(sensor_pose->mean.rotation, pose.rotation, share);
    sensor_pose->mean_weight += weight;
    sensor_pose->poses++;
}

static void restart_from(struct sensor_pose *pose, const struct location *found, double weight)
{
    pose->sight.mirrored = false;
    pose->mean = found->world_from_camera;
    pose->mean_weight = weight;
    pose->min_sigma_m = found->position_sigma_m;
    pose->poses = 1;
    pose->candidate_checks = 0;
}

// True when enough checks in a row have agreed with the candidate.
static bool candidate_is_accepted(struct sensor_pose *pose, const struct location *found)
{
    bool continues = pose->candidate_checks && is_pose_consistent(found, pose->candidate);
    pose->candidate = found->world_from_camera;
    pose->candidate_checks = continues ? pose->candidate_checks + 1 : 1;
    pose->candidate_is_accurate = found->position_sigma_m <= 1.5 * pose->min_sigma_m;
    return pose->candidate_checks >= (pose->candidate_is_accurate ? CHECKS_ACCURATE : CHECKS_OTHER);
}

// The mean of the references that are in the image at this pose.
static struct vec3 visible_reference_centre(const struct sensor_pose *pose, struct pose world_from_camera)
{
    struct pose camera_from_world = pose_inverse(world_from_camera);
    struct vec3 sum = {0, 0, 0};
    int count = 0;
    for (int32_t i = 0; i < pose->reference_count; i++) {
        struct vec3 p = pose_apply(camera_from_world, pose->references[i]);
        if (p.z < 0.1)
            continue;
        struct pixel at = lens_project(&pose->calibration.color, p);
        if (at.x >= 0 && at.y >= 0 && at.x < pose->calibration.color.width && at.y < pose->calibration.color.height) {
            sum = v3_add(sum, pose->references[i]);
            count++;
        }
    }
    return count ? v3_scale(sum, 1.0 / count) : world_from_camera.translation;
}

// Aligns the pose to the floor in the depth image.
static void align_to_floor(const struct sensor_pose *pose, const uint16_t *depth, struct pose *world_from_color)
{
    struct floor_plane floor;
    if (!depth || !floor_plane_find(&pose->calibration.depth, depth, &floor))
        return;
    struct pose world_from_depth = pose_multiply(*world_from_color, pose->calibration.color_from_depth);
    if (gravity_align_pose(&world_from_depth, visible_reference_centre(pose, *world_from_color), &floor))
        *world_from_color = pose_multiply(world_from_depth, pose_inverse(pose->calibration.color_from_depth));
}

// Of one image it is off by up to a hundredth, by the tags' corners and the depth's steps.
static void note_depth_scale(struct sensor_pose *pose)
{
    enum { ENOUGH = 5 };
    const double scale = locator_depth_scale(pose->locator);
    if (!(scale > 0))
        return;
    pose->scale_sum += scale;
    pose->sight.depth_scale = ++pose->scales < ENOUGH ? 0 : pose->scale_sum / pose->scales;
}

// Where no tag is seen: whether the first such images show one in a mirror. Once one was seen as it is, never again.
static enum status look_in_mirror(struct sensor_pose *pose, const uint8_t *color)
{
    enum { LOOKS = 6, ENOUGH = 2 };
    int shown = 0;
    if (!pose->mirror)
        return OK;
    if (pose->sight.tag_count || pose->poses || pose->mirror_looks == LOOKS) {
        mirrored_tags_close(&pose->mirror);
        return OK;
    }
    gray_from_rgb(color, lens_pixels(&pose->calibration.color), pose->gray);
    const enum status status = mirrored_tags_look(pose->mirror, pose->gray, &shown);
    pose->mirror_looks++;
    pose->mirror_shows += shown > 0;
    pose->sight.mirrored = pose->mirror_shows >= ENOUGH;
    return status;
}

// Depth at colour's pixels; NULL: there is none.
static const uint16_t *depth_on_color(struct sensor_pose *pose, const uint16_t *depth)
{
    if (!depth || !pose->calibration.registered)
        return NULL;
    if (!pose->resized)
        return depth;
    registered_depth_resize(&pose->calibration, depth, pose->resized);
    return pose->resized;
}

enum status sensor_pose_update(struct sensor_pose *pose, const uint8_t *color, const uint16_t *depth)
{
    const int64_t frame = pose->frame++;
    if (!color)
        return OK;
    const bool warming_up = pose->with_color++ < SENSOR_POSE_WARM_UP; // a colour camera may start later than its depth
    const bool soon = pose->candidate_checks && pose->candidate_is_accurate && frame % CHECK_SOON == 0;
    if (!warming_up && frame % CHECK_EVERY && !soon)
        return OK;
    struct location found;
    enum status status = locator_localize(pose->locator, color, depth_on_color(pose, depth), &found);
    pose->sight.tag_count = locator_seen_tags(pose->locator, pose->sight.tags, SENSOR_SIGHT_TAGS);
    pose->sight.points = status == OK ? found.points_used : 0;
    note_depth_scale(pose);
    if (status == NOTHING) {
        const enum status looked = look_in_mirror(pose, color);
        if (looked != OK)
            return looked;
    }
    if (status == NOTHING || status == AMBIGUOUS)
        return OK;
    if (status != OK)
        return status;
    align_to_floor(pose, depth, &found.world_from_camera);
    double sigma_m = fmax(found.position_sigma_m, 1e-4), weight = 1 / (sigma_m * sigma_m);
    if (!pose->poses) {
        restart_from(pose, &found, weight);
    } else if (is_pose_consistent(&found, pose->mean)) {
        pose->candidate_checks = 0;
        pose->min_sigma_m = fmin(pose->min_sigma_m, found.position_sigma_m);
        if (pose->poses < ENOUGH_POSES)
            update_mean_pose(pose, found.world_from_camera, weight);
    } else if (candidate_is_accepted(pose, &found)) {
        pose->moves += !warming_up;
        pose->far_moves += !warming_up && is_far(found.world_from_camera, pose->mean);
        restart_from(pose, &found, weight);
    }
    return OK;
}

// The solvers' libraries round differently from one processor model to the next, in the ninth digit, and later stages
// compare with thresholds, where that is enough to change a pixel. So the pose is rounded, far below its accuracy: to
// 0.06 mm and 0.001 degrees.
static double round_to_step(double x, double steps) { return round(x * steps) / steps; }

static struct pose round_reproducibly(struct pose pose)
{
    const double rotation_steps = 1 << 17, steps_a_m = 1 << 14;
    const struct quat q = pose.rotation;
    const struct vec3 t = pose.translation;
    return (struct pose){
        quat_unit((struct quat){round_to_step(q.x, rotation_steps), round_to_step(q.y, rotation_steps),
                                round_to_step(q.z, rotation_steps), round_to_step(q.w, rotation_steps)}),
        v3(round_to_step(t.x, steps_a_m), round_to_step(t.y, steps_a_m), round_to_step(t.z, steps_a_m))};
}

bool sensor_pose_get(const struct sensor_pose *pose, struct pose *world_from_camera)
{
    *world_from_camera = round_reproducibly(pose->mean);
    return pose->poses > 0;
}

// Errors of single images average out, those of the map do not: a third of a single pose's deviation is kept as such.
void sensor_pose_get_sight(const struct sensor_pose *pose, struct sensor_sight *out)
{
    *out = pose->sight;
    out->position_sigma_m = pose->poses ? sqrt(1 / pose->mean_weight + pose->min_sigma_m * pose->min_sigma_m / 9) : 0;
}

int sensor_pose_moves(const struct sensor_pose *pose) { return pose->moves; }

int sensor_pose_far_moves(const struct sensor_pose *pose) { return pose->far_moves; }

int32_t sensor_pose_moved_tags(const struct sensor_pose *pose, int32_t *first)
{
    return locator_moved_tags(pose->locator, first);
}
