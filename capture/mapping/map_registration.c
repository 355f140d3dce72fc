// Registration of frames by the landmarks they show.
#include "capture/mapping/map_internal.h"
#include "locate/relocalization.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- map bootstrap

// Incremental growth of the map: frames and tags are placed from one another, the unambiguous ones first, each step
// followed by bundle adjustment.

// Wider than for a finished map, because the tags' poses are initial values. Chosen by hand.
static const double BOOTSTRAP_RMS_PX = 6, INITIAL_POSE_PX = 1;
enum { ROUNDS = 15 };
// A second planar pose is discarded when its cost (whitened squared residuals) is more than twice the first one's plus
// this. Chosen by hand.
static const double UNAMBIGUOUS_COST = 100;

// Places frames that see a mapped tag; those with two possible planar poses only where `accept_ambiguous`. Returns how
// many were placed.
static int place_frames(struct map *map, bool accept_ambiguous)
{
    const struct lens *lens = &map->calibration.color;
    int placed = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pnp_solution fit;
        if (f->placed)
            continue;
        int count = map_tag_correspondences(map, f, tags);
        const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = lens->fx, .fy = lens->fy};
        enum status status = count ? pnp_solve(&problem, BOOTSTRAP_RMS_PX, &fit) : NOTHING;
        if (status == OK || (status == AMBIGUOUS && accept_ambiguous)) {
            f->placed = true;
            f->camera_from_world = fit.camera_from_world;
            placed++;
        }
    }
    return placed;
}

// Cost of a tag at this pose against its observations in the placed frames: whitened squared residuals.
static double tag_cost(const struct map *map, int32_t tag, const struct pose *world_from_tag)
{
    double cost = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->tag_index[k] != tag)
                continue;
            struct pnp_tag t = {.seen = &f->seen[k],
                                .depth = f->depths[k].count ? &f->depths[k] : NULL,
                                .world_from_tag = *world_from_tag,
                                .side_m = map->tags[tag].side_m,
                                .map_px = MAP_TAG_PX,
                                .used = true};
            cost += pnp_tag_cost(&t, &f->camera_from_world, INITIAL_POSE_PX, map->calibration.color.fx,
                                 map->calibration.color.fy);
        }
    }
    return cost;
}

// Initial values of a tag's pose: the one that explains all of its observations best, and the best one of another
// rotation. The planar pose problem has two solutions, which differ little for a distant tag; depth at a distance does
// not decide either.
struct tag_hypotheses {
    struct pose pose[2];
    double cost[2];
    int count;        // 0, 1 or 2
    int observations; // in placed frames
};

static const double DISTINCT_RAD = 0.15; // rotations closer than this are one solution

static void add_hypothesis(struct tag_hypotheses *hypotheses, struct pose pose, double cost)
{
    bool like_first = hypotheses->count && pose_angle(pose, hypotheses->pose[0]) < DISTINCT_RAD;
    if (!hypotheses->count || cost < hypotheses->cost[0]) {
        if (hypotheses->count && !like_first) {
            hypotheses->pose[1] = hypotheses->pose[0];
            hypotheses->cost[1] = hypotheses->cost[0];
            hypotheses->count = 2;
        }
        hypotheses->pose[0] = pose;
        hypotheses->cost[0] = cost;
        hypotheses->count = hypotheses->count ? hypotheses->count : 1;
        if (hypotheses->count == 2 && pose_angle(pose, hypotheses->pose[1]) < DISTINCT_RAD)
            hypotheses->count = 1;
    } else if (!like_first && (hypotheses->count < 2 || cost < hypotheses->cost[1])) {
        hypotheses->pose[1] = pose;
        hypotheses->cost[1] = cost;
        hypotheses->count = 2;
    }
}

static struct tag_hypotheses hypothesize_tag(const struct map *map, int32_t tag)
{
    struct tag_hypotheses g = {.count = 0};
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            struct pose two[2];
            if (f->tag_index[k] != tag)
                continue;
            int n = planar_poses(map->tags[tag].side_m, f->seen[k].ray, two);
            for (int p = 0; p < n; p++) {
                struct pose world_from_tag = pose_multiply(pose_inverse(f->camera_from_world), two[p]);
                add_hypothesis(&g, world_from_tag, tag_cost(map, tag, &world_from_tag));
            }
            g.observations += n > 0;
        }
    }
    return g;
}

// The poses that an adjustment changes, to restore them.
struct pose_backup {
    struct pose *frames, *tags;
};

static void save_poses(const struct map *map, struct pose_backup *backup)
{
    for (int32_t i = 0; i < map->frame_count; i++)
        backup->frames[i] = map->frames[i].camera_from_world;
    for (int32_t i = 0; i < map->tag_count; i++)
        backup->tags[i] = map->tags[i].world_from_tag;
}

static void restore_poses(struct map *map, const struct pose_backup *backup)
{
    for (int32_t i = 0; i < map->frame_count; i++)
        map->frames[i].camera_from_world = backup->frames[i];
    for (int32_t i = 0; i < map->tag_count; i++)
        map->tags[i].world_from_tag = backup->tags[i];
}

// Adds the tag to the map, at that of its two poses with which the adjusted map has the lower cost.
static enum status add_bootstrap_tag(struct map *map, int32_t tag, const struct tag_hypotheses *hypotheses)
{
    map->tags[tag].mapped = true;
    map->tags[tag].world_from_tag = hypotheses->pose[0];
    if (hypotheses->count < 2 || hypotheses->cost[1] > 2 * hypotheses->cost[0] + UNAMBIGUOUS_COST)
        return OK;
    size_t frames = (size_t)map->frame_count, tags = (size_t)map->tag_count;
    struct pose *scratch = malloc((frames + tags) * 2 * sizeof *scratch);
    if (!scratch)
        return fail(ERR_MEMORY, "no memory to add a tag to the map");
    struct pose_backup before = {scratch, scratch + frames},
                       first = {scratch + frames + tags, scratch + 2 * frames + tags};
    double cost[2] = {0, 0};
    save_poses(map, &before);
    enum status status = map_bundle_adjust(map, ROUNDS, map->point_count > 0, &cost[0]);
    if (status == OK) {
        save_poses(map, &first);
        restore_poses(map, &before);
        map->tags[tag].world_from_tag = hypotheses->pose[1];
        if (map_bundle_adjust(map, ROUNDS, map->point_count > 0, &cost[1]) != OK || !(cost[1] < cost[0]))
            restore_poses(map, &first);
    }
    free(scratch);
    return status;
}

// Places frames and tags alternately, as far as their poses are unambiguous. Once landmarks constrain the frames, only
// the tags are adjusted.
static enum status grow_unambiguous(struct map *map)
{
    for (;;) {
        place_frames(map, false);
        enum status status = map_bundle_adjust(map, ROUNDS, map->point_count > 0, NULL);
        struct tag_hypotheses best = {.count = 0};
        int32_t next = -1;
        for (int32_t t = 0; t < map->tag_count && status == OK; t++) {
            struct tag_hypotheses candidate =
                map->tags[t].mapped ? (struct tag_hypotheses){.count = 0} : hypothesize_tag(map, t);
            if (candidate.observations > best.observations) {
                best = candidate;
                next = t;
            }
        }
        if (status != OK || next < 0)
            return status;
        status = add_bootstrap_tag(map, next, &best);
        if (status != OK)
            return status;
    }
}

static enum status bootstrap_from_landmarks(struct map *map)
{
    int placed;
    enum status status = map->has_prior ? OK : map_init_from_depth(map);
    if (status == OK)
        status = map_register_frames(map, &placed);
    if (status == OK)
        status = map_bundle_adjust(map, ROUNDS, false, NULL);
    return status == OK ? map_close_loops(map) : status;
}

static enum status init_from_tag(struct map *map)
{
    int32_t reference = map_most_observed_tag(map, false);
    if (reference < 0)
        return fail(ERR_INPUT,
                    "none of the listed tags is in any picture; check that the tags are of the family tag36h11, "
                    "flat, whole and well lit, and their numbers in the list");
    map->tags[reference].mapped = map->tags[reference].fixed = true;
    map->tags[reference].world_from_tag = POSE_IDENTITY;
    return OK;
}

enum status map_bootstrap(struct map *map, bool use_points)
{
    map->fixed_frame = -1;
    if (!map->tag_count)
        return bootstrap_from_landmarks(map);
    enum status started = map->has_prior ? OK : init_from_tag(map);
    if (started != OK)
        return started;
    for (;;) {
        enum status status = grow_unambiguous(map);
        int placed = 0;
        if (status == OK && use_points)
            status = map_build_landmarks(map);
        if (status == OK && use_points)
            status = map_resolve_ambiguous_poses(map, &placed);
        if (status == OK && use_points && !placed)
            status = map_register_frames(map, &placed);
        if (status != OK)
            return status;
        // The better of two planar poses is accepted only when nothing else can be placed.
        if (!placed && !place_frames(map, true))
            return use_points ? OK
                              : map_bundle_adjust(map, ROUNDS, false, NULL); // else map_refine_landmarks adjusts all
    }
}

// ---------------------------------------------------------------- map merge

// Adding a sweep to an existing place. Takes and other sweeps were located by its tags and landmarks, so these keep
// their indices and positions, bit for bit. What is new is adjusted to them, with all observations of this sweep. Only
// a tag that was hung elsewhere is estimated again.

static const double SAME_SIDE_M = 1e-4; // one measurement, written down twice

static enum status add_merged_tag(struct map *map, int32_t id, double side_m)
{
    for (int32_t i = 0; i < map->tag_count; i++)
        if (map->tags[i].id == id)
            return fabs(map->tags[i].side_m - side_m) <= SAME_SIDE_M
                       ? OK
                       : fail(ERR_INPUT,
                              "tag %d is %g m wide in the place, but %g m in the list of tags; correct the list",
                              (int)id, map->tags[i].side_m, side_m);
    struct map_tag *tag = &map->tags[map->tag_count++];
    tag->id = id;
    tag->side_m = side_m;
    return tag_pattern(id, &tag->pattern)
               ? OK
               : fail(ERR_INPUT, "tag %d is not of the family tag36h11, which ends at %d", (int)id, TAG_ID_COUNT - 1);
}

enum status map_load_prior(struct map *map, const struct place *prior, const struct mapper_tag *tags, int32_t tag_count)
{
    int32_t old_tags = prior ? prior->tag_count : 0, old_points = prior ? prior->point_count : 0;
    map->has_prior = prior != NULL;
    map->point_capacity = old_points + MAP_MAX_CANDIDATES;
    map->tags = calloc((size_t)(old_tags + tag_count) + 1, sizeof *map->tags);
    map->points = malloc((size_t)map->point_capacity * sizeof *map->points);
    map->point_observations = calloc((size_t)map->point_capacity, sizeof *map->point_observations);
    if (!map->tags || !map->points || !map->point_observations)
        return fail(ERR_MEMORY, "no memory to map a place");
    enum status status = OK;
    for (int32_t i = 0; i < old_tags && status == OK; i++) {
        status = add_merged_tag(map, prior->tags[i].id, prior->tags[i].side_m);
        if (status == OK && map->tag_count == i)
            status = fail(ERR_INPUT, "the place has tag %d twice", (int)prior->tags[i].id);
        map->tags[i].world_from_tag = prior->tags[i].world_from_tag;
        memcpy(map->tags[i].covariance, prior->tags[i].covariance, sizeof map->tags[i].covariance);
        map->tags[i].mapped = map->tags[i].fixed = true;
    }
    for (int32_t i = 0; i < tag_count && status == OK; i++)
        status = add_merged_tag(map, tags[i].id, tags[i].side_m);
    if (old_points)
        memcpy(map->points, prior->points, (size_t)old_points * sizeof *map->points);
    map->point_count = map->held_points = old_points;
    return status;
}

// Chosen by hand.
static const double INLIER_RMS_PX = 6; // observations of a tag that was not moved fit better
enum { MIN_TAGS = 2 };                 // that agree: of two that disagree it is unknown which was moved
enum { MIN_POINTS = 20 };              // landmark inliers

// The pose of a frame by more than a single tag: by the place's landmarks, else by tags that agree.
static bool register_by_consensus(const struct map *map, struct map_scratch *scratch, const struct map_frame *frame,
                                  struct pnp_tag *tags, int tag_count, struct pose *camera_from_world)
{
    const struct lens *lens = &map->calibration.color;
    struct pnp_solution fit;
    int agree;
    map_index_features(scratch, map, frame);
    const struct match_query query = {
        .points = map->points, .point_count = map->held_points, .index = &scratch->index, .lens = lens};
    const struct pose_problem problem = {.tags = tags, .tag_count = tag_count, .fx = lens->fx, .fy = lens->fy};
    int count = relocalize_match(&query, scratch->matches, MAP_MAX_FEATURES);
    if (relocalize(&query, scratch->matches, count, NULL, camera_from_world, &agree) && agree >= MIN_POINTS)
        return true;
    if (pnp_solve(&problem, INLIER_RMS_PX, &fit) != OK || fit.used < MIN_TAGS)
        return false;
    *camera_from_world = fit.camera_from_world;
    return true;
}

enum status map_release_moved_tags(struct map *map)
{
    int votes[MAPPER_MAX_TAGS] = {0}; // frames in which the tag is where it was, less those where it is not
    const struct lens *lens = &map->calibration.color;
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to look for tags that were moved");
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pose pose;
        int count = map_tag_correspondences(map, f, tags), at = 0;
        if (!count || !register_by_consensus(map, d, f, tags, count, &pose))
            continue;
        for (int32_t k = 0; k < f->seen_count && at < count; k++) // in the order of map_tag_correspondences
            if (map->tags[f->tag_index[k]].mapped)
                votes[map->tags[f->tag_index[k]].id] +=
                    pnp_tag_rms(&tags[at++], NULL, &pose, lens->fx, lens->fy) < INLIER_RMS_PX ? 1 : -1;
    }
    free(d);
    for (int32_t t = 0; t < map->tag_count; t++)
        if (map->tags[t].fixed && votes[map->tags[t].id] < 0) {
            map->tags[t].moved = true;
            map->tags[t].fixed = map->tags[t].mapped = false;
        }
    return OK;
}

enum status map_check_overlap(const struct map *map)
{
    for (int32_t i = 0; i < map->frame_count; i++)
        if (map->frames[i].placed)
            return OK;
    return fail(ERR_INPUT, "the sweep shows nothing that is in the place already, so it cannot be registered to it; "
                           "begin it where the place is known, with its tags or much of what was filmed in sight");
}

// Rms of two sets of errors together.
static double rms_of_both(double a, double count_a, double b, double count_b)
{
    double count = count_a + count_b;
    return count > 0 ? sqrt((a * a * count_a + b * b * count_b) / count) : 0;
}

void map_merge_residuals(struct map *map, const struct place *prior)
{
    double earlier = 0, now = 0;
    bool any_tag = false;
    for (int32_t i = 0; i < map->tag_count; i++) {
        now += map->tags[i].observations;
        any_tag = any_tag || map->tags[i].mapped;
    }
    for (int32_t i = 0; i < prior->tag_count; i++) {
        const struct place_tag *old = &prior->tags[i];
        struct map_tag *tag = &map->tags[i]; // those of the place come first
        if (tag->moved)
            continue;
        tag->rms_px = rms_of_both(old->rms_px, old->observations, tag->rms_px, tag->observations);
        tag->observations += old->observations;
        earlier += old->observations;
    }
    if (!any_tag) { // then the errors are those of landmarks
        earlier = prior->point_count;
        now = map->tag_count ? 0 : map->point_count - map->held_points;
    }
    map->rms_px = rms_of_both(prior->rms_px, earlier, map->rms_px, now);
    map->rms_m = rms_of_both(prior->rms_m, prior->rms_m > 0 ? earlier : 0, map->rms_m, map->rms_m > 0 ? now : 0);
}

static void *duplicate_bytes(const void *bytes, size_t size)
{
    void *copy = malloc(size);
    if (copy)
        memcpy(copy, bytes, size);
    return copy;
}

enum status map_copy_prior_views(const struct place *prior, struct place *out)
{
    const struct lens *lens = &prior->calibration.depth;
    size_t depth_bytes = (size_t)lens->width * (size_t)lens->height * sizeof(uint16_t);
    for (int32_t i = 0; i < prior->view_count; i++) {
        const struct place_view *old = &prior->views[i];
        struct place_view *view = &out->views[out->view_count++];
        *view = *old;
        view->jpeg = old->jpeg ? duplicate_bytes(old->jpeg, old->jpeg_bytes) : NULL;
        view->depth = old->depth ? duplicate_bytes(old->depth, depth_bytes) : NULL;
        if ((old->jpeg && !view->jpeg) || (old->depth && !view->depth))
            return fail(ERR_MEMORY, "no memory for the pictures of the place");
    }
    return OK;
}

// ---------------------------------------------------------------- map registration

enum status map_resolve_ambiguous_poses(struct map *map, int *placed)
{
    struct map_scratch *d = malloc(sizeof *d);
    const struct lens *lens = &map->calibration.color;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pnp_solution fit;
        if (f->placed)
            continue;
        int count = map_tag_correspondences(map, f, tags), agree[2] = {0, 0};
        const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = lens->fx, .fy = lens->fy};
        if (!count || pnp_solve(&problem, 4, &fit) != AMBIGUOUS)
            continue;
        struct pose pose[2] = {fit.camera_from_world, fit.other};
        map_index_features(d, map, f);
        const struct match_query query = map_match_query(map, d, tags, count);
        for (int k = 0; k < 2; k++)
            if (!landmarks_refine_pose(&query, NULL, &pose[k], d->matches, MAP_MAX_FEATURES, &agree[k]))
                agree[k] = 0;
        int best = agree[1] > agree[0];
        // Both may have converged to the same pose, because the search radius is wide.
        if (!agree[best] || (2 * agree[best] < 3 * agree[!best] && pose_angle(pose[0], pose[1]) > 0.02))
            continue;
        f->camera_from_world = pose[best];
        f->placed = true;
        ++*placed;
    }
    free(d);
    return OK;
}

// Landmark inliers that a frame without a tag needs. Chosen by hand.
enum { MIN_INLIERS = 20 };

// Refines `guess` by the landmarks that d's frame shows, and places the frame there. False: too few inliers.
static bool refine_and_register(struct map *map, struct map_scratch *scratch, struct map_frame *frame,
                                struct pose guess)
{
    struct pnp_tag tags[PNP_MAX_TAGS];
    int count = 0, tag_count = map_tag_correspondences(map, frame, tags);
    const struct match_query query = map_match_query(map, scratch, tags, tag_count);
    if (!landmarks_refine_pose(&query, NULL, &guess, scratch->matches, MAP_MAX_FEATURES, &count) || count < MIN_INLIERS)
        return false;
    frame->camera_from_world = guess;
    frame->placed = frame->visited = true;
    map_assign_matches(frame, scratch, count);
    map_create_landmarks(map, frame);
    return true;
}

// The neighbour's pose, moved on as odometry moved from it to the frame.
static struct pose move_by_odometry(const struct map_frame *frame, const struct map_frame *neighbour)
{
    const struct pose frame_from_neighbour =
        pose_multiply(pose_inverse(frame->odometry_from_camera), neighbour->odometry_from_camera);
    return pose_multiply(frame_from_neighbour, neighbour->camera_from_world);
}

// First guess: by odometry; without it the neighbour's pose, moved on as the neighbour was from the frame before it.
// Second: without motion.
static bool register_from_neighbour(struct map *map, struct map_scratch *scratch, int32_t i, int step)
{
    const struct map_frame *neighbour = &map->frames[i - step];
    struct pose guess = neighbour->camera_from_world;
    int32_t before = i - 2 * step;
    if (map->frames[i].has_odometry && neighbour->has_odometry)
        guess = move_by_odometry(&map->frames[i], neighbour);
    else if (before >= 0 && before < map->frame_count && map->frames[before].placed)
        guess = pose_multiply(pose_multiply(guess, pose_inverse(map->frames[before].camera_from_world)), guess);
    map_index_features(scratch, map, &map->frames[i]);
    return refine_and_register(map, scratch, &map->frames[i], guess) ||
           refine_and_register(map, scratch, &map->frames[i], neighbour->camera_from_world);
}

static bool relocalize_frame(struct map *map, struct map_scratch *scratch, struct map_frame *frame)
{
    struct pose guess;
    int agree;
    map_index_features(scratch, map, frame);
    const struct match_query query = map_match_query(map, scratch, NULL, 0);
    int count = relocalize_match(&query, scratch->matches, MAP_MAX_FEATURES);
    return relocalize(&query, scratch->matches, count, NULL, &guess, &agree) &&
           refine_and_register(map, scratch, frame, guess);
}

// Drift grows from frame to frame. Everything is adjusted before it exceeds the search radius of landmark matching, so
// that loops can close. Chosen by hand.
enum { ADJUST_EVERY = 20, ADJUST_ROUNDS = 6 };

static enum status count_placed(struct map *map, int *placed)
{
    return ++*placed % ADJUST_EVERY == 0 ? map_bundle_adjust(map, ADJUST_ROUNDS, false, NULL) : OK;
}

static enum status register_pass(struct map *map, struct map_scratch *scratch, int step, int *placed)
{
    enum status status = OK;
    for (int32_t n = 1; n < map->frame_count && status == OK; n++) {
        int32_t i = step > 0 ? n : map->frame_count - 1 - n;
        if (!map->frames[i].placed && map->frames[i - step].placed && register_from_neighbour(map, scratch, i, step))
            status = count_placed(map, placed);
    }
    return status;
}

enum status map_register_frames(struct map *map, int *placed)
{
    struct map_scratch *d = malloc(sizeof *d);
    enum status status = OK;
    int before;
    *placed = 0;
    if (!d)
        return fail(ERR_MEMORY, "no memory to map landmarks");
    do {
        before = *placed;
        status = register_pass(map, d, 1, placed);
        if (status == OK)
            status = register_pass(map, d, -1, placed);
        for (int32_t i = 0; i < map->frame_count && status == OK && *placed == before; i++)
            if (!map->frames[i].placed && relocalize_frame(map, d, &map->frames[i]))
                status = count_placed(map, placed);
    } while (status == OK && *placed > before);
    free(d);
    return status;
}

enum status map_init_from_depth(struct map *map)
{
    int max = 0;
    for (int32_t i = 0; i < map->frame_count; i++) {
        int count = 0;
        for (int32_t k = 0; k < map->frames[i].feature_count; k++)
            count += map->frames[i].features[k].depth > 0;
        if (count > max) {
            max = count;
            map->fixed_frame = i;
        }
    }
    if (max < MIN_INLIERS)
        return fail(ERR_INPUT, "no picture shows enough that can be recognised and has depth; film a place with "
                               "things in it, in good light, or hang tags and list them");
    struct map_frame *f = &map->frames[map->fixed_frame];
    f->placed = f->visited = true;
    f->camera_from_world = POSE_IDENTITY;
    map_create_landmarks(map, f);
    return OK;
}
