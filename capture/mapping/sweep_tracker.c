#include "capture/mapping/sweep_tracker.h"

#include "capture/mapping/map_frontend.h"
#include "locate/relocalization.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// All chosen by hand; CARRIED_RAD_S, APART_M and CONTRADICTED_FRAMES on the one walk of
// tests/capture/test_sweep_plan.c.
static const double STEP_M = 0.15, STEP_RAD = 0.12; // from keyframe to keyframe
static const double TAG_RMS_PX = 6;                 // of poses from tags that are roughly placed
static const double PLAIN_COST = 100;               // of a tag's second planar pose, as the mapper has it
static const double EXPOSURE_S = 1.0 / 60, BLUR_PX = 10, FAR_M = 2; // exposure indoors; what most of a room is away
static const double NEAR_M = 0.5, NEAR_RAD = 0.4;                   // from one image to the next
static const double FAST_S = 0.3;                                   // as long is it said
static const double CARRIED_RAD_S = 2.5; // faster is no sensor turned: beyond half of it all is blurred
static const double APART_M = 1;         // from where a tag was: it is not the same pose
enum {
    MIN_AGREE = 20,           // landmarks
    LOST_FRAMES = 6,          // until it is said
    RELOCALIZE_EVERY = 5,     // frames without a pose
    BARE_EVERY = 15,          // frames with one
    CONTRADICTED_FRAMES = 10, // in a row, until landmarks are believed against the tags drawn before
    SWEEP_POINTS_MAX = 6000   // beside a prior's
};

struct sweep_tracker {
    const struct map *listed;
    struct map map; // its own tags and landmarks; frames[0] is the present one
    struct map_scratch scratch;
    struct sweep_plan plan;
    bool begun;
    struct pose last, before, keyframe; // camera_from_world
    int64_t last_ns, before_ns, fast_since_ns;
    bool has_last, has_before, too_fast;
    bool sure; // the present pose: enough landmarks agree
    int lost, contradicted;
};

// About the middle of what a prior place has.
static void start_plan(struct sweep_tracker *tracker)
{
    const struct map *own = &tracker->map;
    double x = 0, y = 0;
    int32_t count = 0;
    for (int32_t i = 0; i < own->point_count; i++, count++) {
        x += own->points[i].world.x;
        y += own->points[i].world.y;
    }
    for (int32_t i = 0; i < own->tag_count; i++)
        if (own->tags[i].mapped) {
            x += own->tags[i].world_from_tag.translation.x;
            y += own->tags[i].world_from_tag.translation.y;
            count++;
        }
    sweep_plan_start(&tracker->plan, count ? x / count : 0, count ? y / count : 0);
    for (int32_t i = 0; i < own->tag_count; i++)
        sweep_plan_set_tag(&tracker->plan, own->tags[i].id, false,
                           own->tags[i].mapped ? &own->tags[i].world_from_tag.translation : NULL, 0);
    for (int32_t i = 0; i < own->point_count; i++)
        sweep_plan_add_landmark(&tracker->plan, own->points[i].world);
}

enum status sweep_tracker_open(struct sweep_tracker **out, const struct map *map)
{
    struct sweep_tracker *t = calloc(1, sizeof *t);
    *out = t;
    if (!t)
        return fail(ERR_MEMORY, "no memory for the plan of a sweep");
    t->listed = map;
    struct map *own = &t->map;
    own->calibration = map->calibration;
    own->depth_scale = 1;
    own->fixed_frame = -1;
    own->has_depth = map_depth_usable(&map->calibration);
    own->has_prior = map->has_prior;
    own->held_points = map->held_points;
    own->point_capacity = map->point_count + SWEEP_POINTS_MAX;
    own->tags = calloc((size_t)map->tag_count + 1, sizeof *own->tags);
    own->points = malloc((size_t)own->point_capacity * sizeof *own->points);
    own->frames = calloc(1, sizeof *own->frames);
    if (!own->tags || !own->points || !own->frames) {
        sweep_tracker_close(out);
        return fail(ERR_MEMORY, "no memory for the plan of a sweep");
    }
    memcpy(own->tags, map->tags, (size_t)map->tag_count * sizeof *own->tags);
    memcpy(own->points, map->points, (size_t)map->point_count * sizeof *own->points);
    own->tag_count = map->tag_count;
    own->point_count = map->point_count;
    start_plan(t);
    t->begun = map->has_prior;
    return OK;
}

void sweep_tracker_close(struct sweep_tracker **tracker)
{
    if (!*tracker)
        return;
    if ((*tracker)->map.frames)
        map_frame_free(&(*tracker)->map.frames[0]);
    free((*tracker)->map.frames);
    free((*tracker)->map.tags);
    free((*tracker)->map.points);
    free(*tracker);
    *tracker = NULL;
}

// A copy whose features can be assigned; tags are borrowed from the original, which outlives the call. NULL: no memory.
static struct map_frame *present_frame(struct sweep_tracker *tracker, const struct map_frame *observed)
{
    struct map_frame *f = &tracker->map.frames[0];
    free(f->features);
    *f = *observed;
    f->depth = NULL;
    f->jpeg = NULL;
    f->placed = f->visited = false;
    f->features = malloc(((size_t)observed->feature_count + 1) * sizeof *f->features);
    if (!f->features)
        return NULL;
    memcpy(f->features, observed->features, (size_t)observed->feature_count * sizeof *f->features);
    for (int32_t i = 0; i < f->feature_count; i++)
        f->features[i].point = -1;
    tracker->map.frame_count = 1;
    return f;
}

static void forget_borrowed(struct map_frame *frame)
{
    struct map_feature *features = frame->features;
    *frame = (struct map_frame){.features = features};
}

// ---------------------------------------------------------------- tags and landmarks that are new

static double tag_cost(const struct sweep_tracker *tracker, const struct map_frame *frame, int32_t k,
                       const struct pose *pose)
{
    const struct pnp_tag tag = {.seen = &frame->seen[k],
                                .depth = frame->depths[k].count ? &frame->depths[k] : NULL,
                                .world_from_tag = *pose,
                                .side_m = tracker->map.tags[frame->tag_index[k]].side_m,
                                .map_px = MAP_TAG_PX,
                                .used = true};
    return pnp_tag_cost(&tag, &frame->camera_from_world, 1, tracker->map.calibration.color.fx,
                        tracker->map.calibration.color.fy);
}

// Tags that this frame shows for the first time clearly are placed by it; of others the position alone is drawn.
static void place_tags(struct sweep_tracker *tracker, const struct map_frame *frame)
{
    const struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    for (int32_t k = 0; k < frame->seen_count; k++) {
        struct map_tag *tag = &tracker->map.tags[frame->tag_index[k]];
        struct pose two[2];
        double cost[2] = {0, 0};
        const int n = tag->mapped ? 0 : planar_poses(tag->side_m, frame->seen[k].ray, two);
        for (int i = 0; i < n; i++) {
            two[i] = pose_multiply(world_from_camera, two[i]);
            cost[i] = tag_cost(tracker, frame, k, &two[i]);
        }
        if (!n)
            continue;
        const int best = n > 1 && cost[1] < cost[0];
        tag->world_from_tag = two[best];
        tag->mapped = n == 1 || cost[!best] > 2 * cost[best] + PLAIN_COST;
        sweep_plan_set_tag(&tracker->plan, tag->id, true, &two[best].translation, 0);
    }
}

static void add_landmarks(struct sweep_tracker *tracker, struct map_frame *frame)
{
    const int32_t before = tracker->map.point_count;
    if (!tracker->map.has_depth)
        return;
    map_create_landmarks(&tracker->map, frame);
    for (int32_t i = before; i < tracker->map.point_count; i++)
        sweep_plan_add_landmark(&tracker->plan, tracker->map.points[i].world);
    tracker->keyframe = frame->camera_from_world;
}

// The first frame: the world is where it stands, turned so that z is up.
static void place_first_frame(struct sweep_tracker *tracker, struct map_frame *frame, const uint16_t *depth)
{
    bool floor;
    struct pnp_solution fit;
    frame->camera_from_world = POSE_IDENTITY;
    frame->placed = true;
    if (!tracker->map.has_depth || !depth) { // then a tag that is seen clearly is the world
        const struct lens *lens = &tracker->map.calibration.color;
        if (!frame->seen_count)
            return;
        struct pnp_tag tag = {.seen = &frame->seen[0],
                              .world_from_tag = POSE_IDENTITY,
                              .side_m = tracker->map.tags[frame->tag_index[0]].side_m,
                              .map_px = MAP_TAG_PX,
                              .used = true};
        const struct pose_problem problem = {.tags = &tag, .tag_count = 1, .fx = lens->fx, .fy = lens->fy};
        if (pnp_solve(&problem, TAG_RMS_PX, &fit) != OK)
            return;
        tracker->map.tags[frame->tag_index[0]].mapped = true;
        tracker->map.tags[frame->tag_index[0]].world_from_tag = POSE_IDENTITY;
        frame->camera_from_world = fit.camera_from_world;
    } else {
        frame->depth = malloc((size_t)tracker->map.calibration.depth.width *
                              (size_t)tracker->map.calibration.depth.height * sizeof *frame->depth);
        if (!frame->depth)
            return;
        memcpy(frame->depth, depth,
               (size_t)tracker->map.calibration.depth.width * (size_t)tracker->map.calibration.depth.height *
                   sizeof *frame->depth);
    }
    // Tags that are not placed yet say nothing of up.
    const int32_t tags = tracker->map.tag_count;
    tracker->map.tag_count = frame->depth ? 0 : tags;
    tracker->begun = map_align_gravity(&tracker->map, &floor) == OK;
    tracker->map.tag_count = tags;
    free(frame->depth);
    frame->depth = NULL;
    const struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    const struct vec3 ahead = quat_rotate(world_from_camera.rotation, v3(0, 0, 1));
    tracker->plan.middle_x = world_from_camera.translation.x + ahead.x; // most of the room is ahead
    tracker->plan.middle_y = world_from_camera.translation.y + ahead.y;
}

// ---------------------------------------------------------------- the pose

static bool refine_pose(struct sweep_tracker *tracker, struct map_frame *frame, struct pose guess)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    int agree = 0;
    const int tag_count = map_tag_correspondences(&tracker->map, frame, tags);
    const struct match_query query = map_match_query(&tracker->map, &tracker->scratch, tags, tag_count);
    if (!landmarks_refine_pose(&query, NULL, &guess, tracker->scratch.matches, MAP_MAX_FEATURES, &agree) ||
        agree < MIN_AGREE)
        return false;
    frame->camera_from_world = guess;
    map_assign_matches(frame, &tracker->scratch, agree);
    return true;
}

// By the tags alone; of two poses the one that continues the last. *clear: several tags agree.
static bool solve_tags(struct sweep_tracker *tracker, const struct map_frame *frame, struct pose *out, bool *clear)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_solution fit;
    const struct lens *lens = &tracker->map.calibration.color;
    const int count = map_tag_correspondences(&tracker->map, frame, tags);
    const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = lens->fx, .fy = lens->fy};
    const enum status status = count ? pnp_solve(&problem, TAG_RMS_PX, &fit) : NOTHING;
    if (status != OK && status != AMBIGUOUS)
        return false;
    *out = fit.camera_from_world;
    *clear = status == OK && fit.used > 1;
    if (status == AMBIGUOUS && tracker->has_last &&
        pose_angle(fit.other, tracker->last) < pose_angle(*out, tracker->last))
        *out = fit.other;
    return status == OK || tracker->has_last;
}

static bool are_poses_near(struct pose a, struct pose b)
{
    return v3_distance(pose_inverse(a).translation, pose_inverse(b).translation) < NEAR_M &&
           pose_angle(a, b) < NEAR_RAD;
}

static bool locate_frame(struct sweep_tracker *tracker, struct map_frame *frame)
{
    struct pose guess, by_tags;
    bool clear = false;
    tracker->sure = true;
    map_index_features(&tracker->scratch, &tracker->map, frame);
    if (tracker->has_last && !tracker->lost) {
        guess = tracker->last;
        if (tracker->has_before) // as it moved before
            guess = pose_multiply(pose_multiply(tracker->last, pose_inverse(tracker->before)), tracker->last);
        if (refine_pose(tracker, frame, guess) || refine_pose(tracker, frame, tracker->last))
            return true;
    }
    if (solve_tags(tracker, frame, &by_tags, &clear)) {
        if (refine_pose(tracker, frame, by_tags))
            return true;
        // Of one distant tag the pose may be a mirrored one: it is believed only where it goes on from the last.
        frame->camera_from_world = by_tags;
        tracker->sure = clear;
        if (clear || (tracker->has_last && !tracker->lost && are_poses_near(by_tags, tracker->last)))
            return true;
    }
    if (tracker->lost % RELOCALIZE_EVERY)
        return false;
    int agree;
    const struct match_query query = map_match_query(&tracker->map, &tracker->scratch, NULL, 0);
    const int count = relocalize_match(&query, tracker->scratch.matches, MAP_MAX_FEATURES);
    tracker->sure = relocalize(&query, tracker->scratch.matches, count, NULL, &guess, &agree) &&
                    refine_pose(tracker, frame, guess) &&
                    (!tracker->has_last || pose_angle(frame->camera_from_world, tracker->last) <
                                               CARRIED_RAD_S * 1e-9 * (double)(frame->time_ns - tracker->last_ns));
    return tracker->sure;
}

// Patterns repeat and rugs are symmetric; numbers of tags do not repeat. Whether most of the tags in view that are
// drawn in the plan would be elsewhere by this pose. What was drawn wrongly first is not believed for ever.
static bool is_pose_contradicted(struct sweep_tracker *tracker, const struct map_frame *frame)
{
    const struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    int apart = 0, same = 0;
    for (int32_t k = 0; k < frame->seen_count; k++) {
        const struct map_tag *tag = &tracker->map.tags[frame->tag_index[k]];
        const struct sweep_tag *drawn = NULL;
        struct pose two[2];
        for (int i = 0; i < tracker->plan.tag_count && !drawn; i++)
            drawn = tracker->plan.tag[i].id == tag->id && tracker->plan.tag[i].placed ? &tracker->plan.tag[i] : NULL;
        if (!drawn || !planar_poses(tag->side_m, frame->seen[k].ray, two))
            continue;
        const struct vec3 at = pose_apply(world_from_camera, two[0].translation);
        const bool far = hypot(at.x - drawn->x, at.y - drawn->y) > APART_M;
        apart += far;
        same += !far;
    }
    tracker->contradicted = apart > same ? tracker->contradicted + 1 : 0;
    return tracker->contradicted > 0 && tracker->contradicted <= CONTRADICTED_FRAMES;
}

// How far a point of the room moves in the picture while it is exposed.
static void judge_speed(struct sweep_tracker *tracker, const struct map_frame *frame)
{
    const double passed_s = (double)(frame->time_ns - tracker->last_ns) * 1e-9;
    if (!tracker->has_last || tracker->lost || !(passed_s > 0)) {
        tracker->fast_since_ns = 0;
        return;
    }
    const struct pose a = pose_inverse(tracker->last), b = pose_inverse(frame->camera_from_world);
    const double moved = pose_angle(a, b) + v3_distance(a.translation, b.translation) / FAR_M;
    const bool fast = moved / passed_s * EXPOSURE_S * tracker->map.calibration.color.fx > BLUR_PX;
    if (!fast)
        tracker->fast_since_ns = 0;
    else if (!tracker->fast_since_ns)
        tracker->fast_since_ns = frame->time_ns;
    tracker->too_fast = fast && (double)(frame->time_ns - tracker->fast_since_ns) * 1e-9 >= FAST_S;
}

static void integrate_frame(struct sweep_tracker *tracker, struct map_frame *frame, const uint16_t *depth)
{
    const struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    judge_speed(tracker, frame);
    frame->placed = true;
    if (tracker->sure)
        place_tags(tracker, frame);
    const struct pose keyframe = pose_inverse(tracker->keyframe);
    if (v3_distance(keyframe.translation, world_from_camera.translation) > STEP_M ||
        pose_angle(keyframe, world_from_camera) > STEP_RAD || !tracker->has_last) {
        if (tracker->sure)
            add_landmarks(tracker, frame);
    }
    if (depth && tracker->map.has_depth)
        sweep_plan_add_depth(&tracker->plan, &tracker->map.calibration.depth, depth, world_from_camera);
    sweep_plan_move(&tracker->plan, &world_from_camera);
    if (tracker->plan.frames_located % BARE_EVERY == 0)
        sweep_plan_find_bare(&tracker->plan);
    tracker->has_before = tracker->has_last && !tracker->lost;
    tracker->before = tracker->last;
    tracker->last = frame->camera_from_world;
    tracker->last_ns = frame->time_ns;
    tracker->has_last = true;
    tracker->lost = 0;
}

void sweep_tracker_add(struct sweep_tracker *tracker, const struct map_frame *observed, const uint16_t *depth)
{
    struct map_frame *f = present_frame(tracker, observed);
    if (!f)
        return;
    for (int32_t k = 0; k < f->seen_count; k++)
        sweep_plan_set_tag(&tracker->plan, tracker->map.tags[f->tag_index[k]].id, true, NULL, 0);
    bool found = false;
    if (!tracker->begun) {
        place_first_frame(tracker, f, depth);
        found = tracker->sure = tracker->begun;
    } else {
        found = locate_frame(tracker, f) && !is_pose_contradicted(tracker, f);
    }
    if (found) {
        integrate_frame(tracker, f, depth);
    } else {
        sweep_plan_move(&tracker->plan, NULL);
        tracker->lost++;
        tracker->too_fast = tracker->fast_since_ns != 0;
    }
    forget_borrowed(f);
}

// ---------------------------------------------------------------- what to do next

// Where a place is, for the person who holds the sensor.
static const char *direction_of(const struct sweep_plan *plan, double x, double y)
{
    static const double PI = 3.14159265358979323846;
    if (!plan->located)
        return "marked in the plan";
    double turn = atan2(y - plan->y, x - plan->x) - plan->heading_rad;
    turn -= 2 * PI * floor((turn + PI) / (2 * PI));
    if (fabs(turn) < 0.6)
        return "ahead";
    if (fabs(turn) > 0.8 * PI)
        return "behind you";
    return turn > 0 ? "to your left" : "to your right";
}

static enum sweep_hint hint_of(const struct sweep_tracker *tracker, const struct mapper_progress *progress)
{
    if (!tracker->has_last)
        return SWEEP_LOOKING;
    if (tracker->lost >= LOST_FRAMES)
        return SWEEP_LOST;
    if (tracker->too_fast)
        return SWEEP_SLOWER;
    if (progress->apart_a >= 0)
        return SWEEP_TOGETHER;
    if (progress->first_unseen >= 0)
        return SWEEP_MISSING;
    return tracker->plan.bare_count ? SWEEP_BARE_PLACE : SWEEP_ENOUGH;
}

const struct sweep_plan *sweep_tracker_plan(struct sweep_tracker *tracker, const struct mapper_progress *progress)
{
    struct sweep_plan *p = &tracker->plan;
    char *out = p->text;
    const size_t max = sizeof p->text;
    p->hint = hint_of(tracker, progress);
    switch (p->hint) {
    case SWEEP_LOOKING: snprintf(out, max, "nothing is recognised yet: show it something with print, or a tag"); break;
    case SWEEP_SLOWER: snprintf(out, max, "slower: the picture is blurred"); break;
    case SWEEP_LOST: snprintf(out, max, "lost: go back to what was seen before, then on more slowly"); break;
    case SWEEP_TOGETHER:
        snprintf(out, max, "%d of %d tags · show tag %d together with tag %d, or with what is between them",
                 (int)progress->seen, (int)progress->listed, (int)progress->apart_a, (int)progress->apart_b);
        break;
    case SWEEP_MISSING:
        snprintf(out, max, "%d of %d tags · tag %d is still missing", (int)progress->seen, (int)progress->listed,
                 (int)progress->first_unseen);
        break;
    case SWEEP_BARE_PLACE:
        snprintf(out, max, "a corner %s is bare: hang a tag there, or put something with print",
                 direction_of(p, p->bare[0].x, p->bare[0].y));
        break;
    default:
        if (progress->listed)
            snprintf(out, max, "all %d tags are seen", (int)progress->listed);
        else
            snprintf(out, max, "move slowly, come back to where you began");
    }
    return p;
}
