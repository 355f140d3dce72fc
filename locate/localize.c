// Localisation from scratch: tags from coarse to fine, landmarks around them, landmarks alone.
#include "locate/locator_internal.h"
#include "locate/relocalization.h"

#include <limits.h>
#include <string.h>

// Without a tag, of fewer than SURELY_ENOUGH landmarks that agree at least one in ONE_IN of all that should be in view
// must agree: an object that is also elsewhere, or that a distorted map holds twice, gives a pose from which nothing
// else is where it should be. Chosen by hand.
enum { SURELY_ENOUGH = 40, ONE_IN = 16 };
// And however many agree, so many must look alike: within a narrow search chance offers a feature that differs by up to
// 80 bits to every other landmark, and a pose that gathers such features is metres off. Features of something else
// hardly ever differ by as few as 45. Chosen on the tests' small world, where right poses of clear pictures have 19 and
// more, wrong ones (of mirrored, overexposed and noisy pictures) mostly up to 13; and of those that look alike
// anywhere 37 % and more, against 29 and 36 %. Other walks were left out.
enum { ALIKE_BITS = 45, MIN_ALIKE = 14, ONE_IN_AGREES = 3 };
static const double AGREE_PX = 4; // at the finest pyramid level
// So many times as many landmarks as agree with the tags outvote them. Chosen by hand.
enum { OUTVOTE_FACTOR = 3 };

// One image and what has been found in it so far.
struct localization {
    const uint8_t *color;
    const uint16_t *depth; // or NULL
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_solution found;
    int agree;   // how many of l->matches agree with it
    int missing; // tags that must be in view but were not found
};

static struct match_query query_of(const struct locator *l, bool with_depth, struct pnp_tag *tags)
{
    return (struct match_query){.points = l->points,
                                .point_count = l->point_count,
                                .index = &l->index,
                                .depth = with_depth ? l->feature_depths : NULL,
                                .lens = &l->lens,
                                .tags = tags,
                                .tag_count = tags ? l->observed_count : 0};
}

// The tags of the place that the detector sees.
static enum status detect_tags(struct locator *l, struct tag_detector *detector, const struct localization *s)
{
    struct tag_detection seen[PNP_MAX_TAGS];
    int count;
    l->observed_count = 0;
    enum status status = tag_detector_detect(detector, &(struct gray_image){l->gray, l->lens.width, l->lens.height},
                                             seen, PNP_MAX_TAGS, &count);
    if (status != OK)
        return status;
    for (int i = 0; i < count; i++) {
        for (int32_t k = 0; k < l->tag_count; k++) {
            struct tag_observation fine;
            if (l->tags[k].id == seen[i].id &&
                tag_refine(l->refiner, s->color, seen[i].id, &l->patterns[k], seen[i].corner, &fine))
                locator_add_observation(l, &fine, k, s->depth);
        }
    }
    return OK;
}

static enum status solve_from_tags(struct locator *l, struct pnp_tag *tags, struct pnp_solution *out)
{
    locator_pnp_tags(l, tags);
    const struct pose_problem problem = locator_problem(l, tags, NULL, 0);
    return pnp_solve(&problem, l->options.max_rms_px, out);
}

// Landmarks constrain the pose where tags do so badly: one distant tag, several in a row. They also select one of two
// mirrored poses. Returns how many agree, into l->matches; 0: too few, s->found unchanged.
static int refine_with_landmarks(struct locator *l, struct localization *s, enum status *status)
{
    const struct match_query query = query_of(l, s->depth != NULL, s->tags);
    struct pose first = s->found.camera_from_world, second = s->found.other;
    struct shutter_motion moving[2] = {s->found.motion, s->found.other_motion};
    int agree = 0, agree_second = 0;
    if (!landmarks_refine_pose(&query, l->motion ? &moving[0] : NULL, &first, l->matches, FEATURES_MAX, &agree))
        agree = 0;
    if (*status == AMBIGUOUS && landmarks_refine_pose(&query, l->motion ? &moving[1] : NULL, &second, l->other_matches,
                                                      FEATURES_MAX, &agree_second)) {
        if (agree_second > agree) {
            memcpy(l->matches, l->other_matches, sizeof l->matches);
            first = second;
            moving[0] = moving[1];
            agree = agree_second;
        }
    }
    if (!agree)
        return 0;
    // Landmarks that pull the pose away from the tags belong to something that moved.
    for (int i = 0; i < l->observed_count; i++)
        if (s->tags[i].used && !(pnp_tag_rms(&s->tags[i], l->motion ? &moving[0] : NULL, &first, l->lens.fx,
                                             l->lens.fy) < l->options.max_rms_px))
            return 0;
    s->found.camera_from_world = first;
    s->found.motion = moving[0];
    *status = OK;
    return agree;
}

// How many landmarks are within the image, including hidden ones and ones that look different from here.
static int count_visible_landmarks(const struct locator *l, const struct pose *camera_from_world)
{
    int visible = 0;
    double wide = 0.5 * l->lens.width / l->lens.fx, high = 0.5 * l->lens.height / l->lens.fy;
    for (int32_t i = 0; i < l->point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, l->points[i].world);
        visible += p.z > 0.1 && fabs(p.x) < wide * p.z && fabs(p.y) < high * p.z;
    }
    return visible;
}

// Of the matches that nothing but their looks made, and that look alike, a part must agree with the pose: those of a
// mirrored picture do not. matches: in the order of the bits that differ.
static bool enough_alike_agree(const struct locator *l, const struct landmark_match *matches, int count,
                               const struct shutter_motion *motion, const struct pose *camera_from_world)
{
    int alike = 0, agree = 0;
    for (int i = 0; i < count; i++) {
        const struct feature *seen = &l->features[matches[i].feature];
        const struct place_landmark *point = &l->points[matches[i].point];
        if (feature_distance(point->descriptor, seen->descriptor) > ALIKE_BITS)
            break;
        const struct vec3 at = shutter_apply_motion(motion, shutter_row_time(&l->lens, seen->at.y),
                                                    pose_apply(*camera_from_world, point->world));
        const struct vec3 ray = lens_ray(&l->lens, seen->at);
        alike++;
        agree += at.z > 0.1 && hypot(l->lens.fx * (at.x / at.z - ray.x), l->lens.fy * (at.y / at.z - ray.y)) <
                                   AGREE_PX * (double)seen->scale;
    }
    return ONE_IN_AGREES * agree >= alike;
}

static bool enough_alike(const struct locator *l, const struct landmark_match *matches, int kept)
{
    int alike = 0;
    for (int i = 0; i < kept; i++)
        alike += feature_distance(l->points[matches[i].point].descriptor, l->features[matches[i].feature].descriptor) <=
                 ALIKE_BITS;
    return alike >= MIN_ALIKE;
}

// Whether these landmarks are enough to accept the pose without a tag.
static bool enough_landmarks(const struct locator *l, const struct landmark_match *matches, int kept,
                             const struct pose *camera_from_world)
{
    return kept >= LOCATOR_MIN_WITHOUT_TAGS && enough_alike(l, matches, kept) &&
           (kept >= SURELY_ENOUGH || ONE_IN * kept >= count_visible_landmarks(l, camera_from_world));
}

// Without tags. Returns how many landmarks agree, into `matches`; 0: no pose.
static int solve_from_landmarks(struct locator *l, bool with_depth, struct landmark_match *matches,
                                struct pnp_solution *found)
{
    const struct match_query query = query_of(l, with_depth, NULL);
    int agree = 0, kept = 0;
    struct pose pose;
    struct shutter_motion moving = l->frame_motion, *motion = l->motion ? &moving : NULL;
    struct landmark_match by_looks[FEATURES_MAX];
    int count = relocalize_match(&query, matches, FEATURES_MAX);
    memcpy(by_looks, matches, (size_t)count * sizeof *by_looks);
    if (!relocalize(&query, matches, count, motion, &pose, &agree) ||
        !landmarks_refine_pose(&query, motion, &pose, matches, FEATURES_MAX, &kept) ||
        !enough_landmarks(l, matches, kept, &pose) || !enough_alike_agree(l, by_looks, count, motion, &pose))
        return 0;
    *found = (struct pnp_solution){.camera_from_world = pose, .other = pose, .motion = moving};
    return kept;
}

// The tags that agree with the pose found, and no others, are used.
static void select_inlier_tags(const struct locator *l, struct pnp_tag *tags, struct pnp_solution *found)
{
    found->used = locator_select_inlier_tags(l, tags, l->motion ? &found->motion : NULL, &found->camera_from_world);
}

// The pose again, with tags that the detector missed; a pose that landmarks agree with is only refined.
static enum status solve_with_predicted(struct locator *l, struct localization *s, enum status status)
{
    struct pnp_solution again;
    if (s->agree) { // tags that were moved may be more than those that agree with the landmarks
        enum status sure = OK;
        memcpy(l->other_matches, l->matches, sizeof l->matches);
        locator_pnp_tags(l, s->tags);
        select_inlier_tags(l, s->tags, &s->found);
        int now = refine_with_landmarks(l, s, &sure);
        if (now)
            s->agree = now;
        else
            memcpy(l->matches, l->other_matches, sizeof l->matches);
        return sure;
    }
    enum status more = solve_from_tags(l, s->tags, &again);
    if (more == NOTHING || again.used < s->found.used)
        return status;
    s->found = again;
    return more;
}

// A tag was moved if hardly a landmark is where it should be from the pose that it gives, no more than agree by chance,
// and many times as many landmarks give another pose. Several tags that agree have to be outvoted.
static void check_against_landmarks(struct locator *l, struct localization *s, enum status *status)
{
    struct pnp_solution other;
    if (ONE_IN * s->agree >= count_visible_landmarks(l, &s->found.camera_from_world))
        return;
    int kept = solve_from_landmarks(l, s->depth != NULL, l->other_matches, &other);
    if (!kept || kept < OUTVOTE_FACTOR * s->agree || (s->found.used > 1 && kept < SURELY_ENOUGH))
        return;
    select_inlier_tags(l, s->tags, &other);
    memcpy(l->matches, l->other_matches, sizeof l->matches);
    s->found = other;
    s->agree = kept;
    *status = OK;
}

// From the tags that the detector sees, with the landmarks around.
static enum status localize_from_tags(struct locator *l, struct tag_detector *detector, struct localization *s)
{
    s->agree = 0;
    enum status status = detect_tags(l, detector, s);
    if (status != OK)
        return status;
    status = solve_from_tags(l, s->tags, &s->found);
    if (locator_detect_rolling_shutter(l, s->tags, status == NOTHING ? NULL : &s->found))
        status = solve_from_tags(l, s->tags, &s->found);
    if (status != NOTHING && l->point_count)
        s->agree = refine_with_landmarks(l, s, &status);
    if (status != NOTHING && l->point_count)
        check_against_landmarks(l, s, &status);
    return status;
}

// Adds the tags that must also be in view, and counts those that are missing.
static enum status add_predicted_tags(struct locator *l, struct localization *s, enum status status)
{
    struct shutter_motion expected = l->frame_motion;
    l->frame_motion = s->found.motion;
    int more = locator_detect_predicted(l, s->color, s->depth, &s->found.camera_from_world, INT_MAX, &s->missing);
    l->frame_motion = expected;
    return more ? solve_with_predicted(l, s, status) : status;
}

// From a half-size image, in which most tags are detected in a quarter of the time; the others are looked for where
// they must be. NOTHING, too, where the full image may give more: nothing confirms what a single tag says, tags
// contradict each other, or one that must be in view is missing (moved or hidden).
static enum status localize_coarse(struct locator *l, struct localization *s)
{
    s->missing = 0;
    if (!l->coarse_detector)
        return NOTHING;
    enum status status = localize_from_tags(l, l->coarse_detector, s);
    if (status == OK && (s->agree || s->found.used > 1))
        status = add_predicted_tags(l, s, status);
    if (status < 0)
        return status;
    bool sure = status == OK && (s->agree || s->found.used > 1) && s->found.used == l->observed_count && !s->missing;
    return sure ? OK : NOTHING;
}

// From the full image: tags, or else landmarks alone.
static enum status localize_fine(struct locator *l, struct localization *s)
{
    enum status status = localize_from_tags(l, l->detector, s);
    if (status == NOTHING) {
        l->observed_count = 0; // no pose fits the tags
        s->agree = l->point_count ? solve_from_landmarks(l, s->depth != NULL, l->matches, &s->found) : 0;
        if (!s->agree)
            return NOTHING;
        status = OK;
    }
    return status < 0 ? status : add_predicted_tags(l, s, status);
}

// From tags and landmarks alone, independently of earlier images.
static enum status localize_from_scratch(struct locator *l, struct localization *s)
{
    locator_begin_frame(l, s->color);
    enum status status = l->point_count ? locator_extract_features(l, s->depth) : OK;
    if (status == OK)
        status = localize_coarse(l, s);
    if (status == NOTHING) {
        status = localize_fine(l, s);
        if (status == NOTHING)
            return NOTHING;
    }
    if (status < 0)
        return status;
    l->frame_motion = s->found.motion;
    s->found.rms_px = locator_rms(l, s->tags, &s->found.camera_from_world);
    return status;
}

// A corner that is a feature at several pyramid levels has the same error in all of them, so it must count once.
// Returns how many points are left.
static int drop_duplicates(const struct locator *l, struct pnp_point *points, int count)
{
    static const double SAME_PX = 4;
    int kept = 0;
    for (int i = 0; i < count; i++) {
        bool again = false;
        for (int k = 0; k < kept && !again; k++)
            again = fabs(points[k].x - points[i].x) * l->lens.fx < SAME_PX &&
                    fabs(points[k].y - points[i].y) * l->lens.fy < SAME_PX;
        if (!again)
            points[kept++] = points[i];
    }
    return kept;
}

// The covariance of the pose found, and *out. NOTHING: it is too uncertain.
static enum status evaluate_pose(struct locator *l, struct localization *s, enum status status, double covariance[36],
                                 struct location *out)
{
    struct pnp_point points[FEATURES_MAX];
    const struct match_query query = query_of(l, s->depth != NULL, NULL);
    const struct pose *pose = &s->found.camera_from_world;
    double widened[36];
    landmark_correspondences(&query, pose, l->matches, s->agree, points);
    const struct pose_problem problem = locator_problem(l, s->tags, points, drop_duplicates(l, points, s->agree));
    const bool known = pnp_covariance(&problem, pose, covariance);
    if (known && status == OK)
        focal_estimate_add(&l->focal, &problem, pose);
    memcpy(widened, covariance, sizeof widened);
    locator_add_focal_variance(l, &problem, pose, widened);
    if (!known || !locator_fill_result(l, &s->found, s->agree, widened, covariance, out))
        status = NOTHING;
    if (status == OK)
        locator_vote_moved_tags(l, s->tags, s->agree, pose);
    return status;
}

// keep_tracks: existing tracks are continued from the pose found, where enough of them are found.
static enum status localize(struct locator *l, const uint8_t *color, const uint16_t *depth, bool keep_tracks,
                            struct location *out)
{
    struct localization s = {.color = color, .depth = depth, .found = {.used = 0}};
    double covariance[36] = {0};
    enum status status = localize_from_scratch(l, &s);
    if (status == OK || status == AMBIGUOUS)
        status = evaluate_pose(l, &s, status, covariance, out);
    if (keep_tracks && status == OK && locator_track_patches(l, &s.found.camera_from_world)) {
        enum status tracked = locator_solve_tracks(l, color, depth, s.found.camera_from_world, out);
        if (tracked == NOTHING)
            l->track_count = 0;
        return tracked == NOTHING ? OK : tracked;
    }
    l->track_count = 0;
    if (status == OK || status == AMBIGUOUS)
        locator_start_tracks(l, s.tags, s.agree, &s.found.camera_from_world, covariance);
    return status;
}

enum status locator_localize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize(l, color, depth, false, out);
}

enum status locator_relocalize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize(l, color, depth, true, out);
}
