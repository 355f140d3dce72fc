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
    int agree;   // how many of the locator's matches agree with it
    int missing; // tags that must be in view but were not found
};

static struct match_query query_of(const struct locator *locator, bool with_depth, struct pnp_tag *tags)
{
    return (struct match_query){.points = locator->points,
                                .point_count = locator->point_count,
                                .index = &locator->index,
                                .depth = with_depth ? locator->feature_depths : NULL,
                                .lens = &locator->lens,
                                .tags = tags,
                                .tag_count = tags ? locator->observed_count : 0};
}

// The tags of the place that the detector sees.
static enum status detect_tags(struct locator *locator, struct tag_detector *detector,
                               const struct localization *localization)
{
    struct tag_detection seen[PNP_MAX_TAGS];
    int count;
    locator->observed_count = 0;
    enum status status =
        tag_detector_detect(detector, &(struct gray_image){locator->gray, locator->lens.width, locator->lens.height},
                            seen, PNP_MAX_TAGS, &count);
    if (status != OK)
        return status;
    for (int i = 0; i < count; i++) {
        for (int32_t k = 0; k < locator->tag_count; k++) {
            struct tag_observation fine;
            if (locator->tags[k].id == seen[i].id && tag_refine(locator->refiner, localization->color, seen[i].id,
                                                                &locator->patterns[k], seen[i].corner, &fine))
                locator_add_observation(locator, &fine, k, localization->depth);
        }
    }
    return OK;
}

static enum status solve_from_tags(struct locator *locator, struct pnp_tag *tags, struct pnp_solution *out)
{
    locator_pnp_tags(locator, tags);
    const struct pose_problem problem = locator_problem(locator, tags, NULL, 0);
    return pnp_solve(&problem, locator->options.max_rms_px, out);
}

// Landmarks constrain the pose where tags do so badly: one distant tag, several in a row. They also select one of two
// mirrored poses. Returns how many agree, into locator->matches; 0: too few, localization->found unchanged.
static int refine_with_landmarks(struct locator *locator, struct localization *localization, enum status *status)
{
    const struct match_query query = query_of(locator, localization->depth != NULL, localization->tags);
    struct pose first = localization->found.camera_from_world, second = localization->found.other;
    struct shutter_motion moving[2] = {localization->found.motion, localization->found.other_motion};
    int agree = 0, agree_second = 0;
    if (!landmarks_refine_pose(&query, locator->motion ? &moving[0] : NULL, &first, locator->matches, FEATURES_MAX,
                               &agree))
        agree = 0;
    if (*status == AMBIGUOUS && landmarks_refine_pose(&query, locator->motion ? &moving[1] : NULL, &second,
                                                      locator->other_matches, FEATURES_MAX, &agree_second)) {
        if (agree_second > agree) {
            memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
            first = second;
            moving[0] = moving[1];
            agree = agree_second;
        }
    }
    if (!agree)
        return 0;
    // Landmarks that pull the pose away from the tags belong to something that moved.
    for (int i = 0; i < locator->observed_count; i++)
        if (localization->tags[i].used &&
            !(pnp_tag_rms(&localization->tags[i], locator->motion ? &moving[0] : NULL, &first, locator->lens.fx,
                          locator->lens.fy) < locator->options.max_rms_px))
            return 0;
    localization->found.camera_from_world = first;
    localization->found.motion = moving[0];
    *status = OK;
    return agree;
}

// How many landmarks are within the image, including hidden ones and ones that look different from here.
static int count_visible_landmarks(const struct locator *locator, const struct pose *camera_from_world)
{
    int visible = 0;
    double wide = 0.5 * locator->lens.width / locator->lens.fx, high = 0.5 * locator->lens.height / locator->lens.fy;
    for (int32_t i = 0; i < locator->point_count; i++) {
        struct vec3 p = pose_apply(*camera_from_world, locator->points[i].world);
        visible += p.z > 0.1 && fabs(p.x) < wide * p.z && fabs(p.y) < high * p.z;
    }
    return visible;
}

// Of the matches that nothing but their looks made, and that look alike, a part must agree with the pose: those of a
// mirrored picture do not. matches: in the order of the bits that differ.
static bool enough_alike_agree(const struct locator *locator, const struct landmark_match *matches, int count,
                               const struct shutter_motion *motion, const struct pose *camera_from_world)
{
    int alike = 0, agree = 0;
    for (int i = 0; i < count; i++) {
        const struct feature *seen = &locator->features[matches[i].feature];
        const struct place_landmark *point = &locator->points[matches[i].point];
        if (feature_distance(point->descriptor, seen->descriptor) > ALIKE_BITS)
            break;
        const struct vec3 at = shutter_apply_motion(motion, shutter_row_time(&locator->lens, seen->at.y),
                                                    pose_apply(*camera_from_world, point->world));
        const struct vec3 ray = lens_ray(&locator->lens, seen->at);
        alike++;
        agree += at.z > 0.1 && hypot(locator->lens.fx * (at.x / at.z - ray.x),
                                     locator->lens.fy * (at.y / at.z - ray.y)) < AGREE_PX * (double)seen->scale;
    }
    return ONE_IN_AGREES * agree >= alike;
}

static bool enough_alike(const struct locator *locator, const struct landmark_match *matches, int kept)
{
    int alike = 0;
    for (int i = 0; i < kept; i++)
        alike += feature_distance(locator->points[matches[i].point].descriptor,
                                  locator->features[matches[i].feature].descriptor) <= ALIKE_BITS;
    return alike >= MIN_ALIKE;
}

// Whether these landmarks are enough to accept the pose without a tag.
static bool enough_landmarks(const struct locator *locator, const struct landmark_match *matches, int kept,
                             const struct pose *camera_from_world)
{
    return kept >= LOCATOR_MIN_WITHOUT_TAGS && enough_alike(locator, matches, kept) &&
           (kept >= SURELY_ENOUGH || ONE_IN * kept >= count_visible_landmarks(locator, camera_from_world));
}

// Without tags. Returns how many landmarks agree, into `matches`; 0: no pose.
static int solve_from_landmarks(struct locator *locator, bool with_depth, struct landmark_match *matches,
                                struct pnp_solution *found)
{
    const struct match_query query = query_of(locator, with_depth, NULL);
    int agree = 0, kept = 0;
    struct pose pose;
    struct shutter_motion moving = locator->frame_motion, *motion = locator->motion ? &moving : NULL;
    struct landmark_match by_looks[FEATURES_MAX];
    int count = relocalize_match(&query, matches, FEATURES_MAX);
    memcpy(by_looks, matches, (size_t)count * sizeof *by_looks);
    if (!relocalize(&query, matches, count, motion, &pose, &agree) ||
        !landmarks_refine_pose(&query, motion, &pose, matches, FEATURES_MAX, &kept) ||
        !enough_landmarks(locator, matches, kept, &pose) ||
        !enough_alike_agree(locator, by_looks, count, motion, &pose))
        return 0;
    *found = (struct pnp_solution){.camera_from_world = pose, .other = pose, .motion = moving};
    return kept;
}

// The tags that agree with the pose found, and no others, are used.
static void select_inlier_tags(const struct locator *locator, struct pnp_tag *tags, struct pnp_solution *found)
{
    found->used =
        locator_select_inlier_tags(locator, tags, locator->motion ? &found->motion : NULL, &found->camera_from_world);
}

// The pose again, with tags that the detector missed; a pose that landmarks agree with is only refined.
static enum status solve_with_predicted(struct locator *locator, struct localization *localization, enum status status)
{
    struct pnp_solution again;
    if (localization->agree) { // tags that were moved may be more than those that agree with the landmarks
        enum status sure = OK;
        memcpy(locator->other_matches, locator->matches, sizeof locator->matches);
        locator_pnp_tags(locator, localization->tags);
        select_inlier_tags(locator, localization->tags, &localization->found);
        int now = refine_with_landmarks(locator, localization, &sure);
        if (now)
            localization->agree = now;
        else
            memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
        return sure;
    }
    enum status more = solve_from_tags(locator, localization->tags, &again);
    if (more == NOTHING || again.used < localization->found.used)
        return status;
    localization->found = again;
    return more;
}

// A tag was moved if hardly a landmark is where it should be from the pose that it gives, no more than agree by chance,
// and many times as many landmarks give another pose. Several tags that agree have to be outvoted.
static void check_against_landmarks(struct locator *locator, struct localization *localization, enum status *status)
{
    struct pnp_solution other;
    if (ONE_IN * localization->agree >= count_visible_landmarks(locator, &localization->found.camera_from_world))
        return;
    int kept = solve_from_landmarks(locator, localization->depth != NULL, locator->other_matches, &other);
    if (!kept || kept < OUTVOTE_FACTOR * localization->agree || (localization->found.used > 1 && kept < SURELY_ENOUGH))
        return;
    select_inlier_tags(locator, localization->tags, &other);
    memcpy(locator->matches, locator->other_matches, sizeof locator->matches);
    localization->found = other;
    localization->agree = kept;
    *status = OK;
}

// From the tags that the detector sees, with the landmarks around.
static enum status localize_from_tags(struct locator *locator, struct tag_detector *detector,
                                      struct localization *localization)
{
    localization->agree = 0;
    enum status status = detect_tags(locator, detector, localization);
    if (status != OK)
        return status;
    status = solve_from_tags(locator, localization->tags, &localization->found);
    if (locator_detect_rolling_shutter(locator, localization->tags, status == NOTHING ? NULL : &localization->found))
        status = solve_from_tags(locator, localization->tags, &localization->found);
    if (status != NOTHING && locator->point_count)
        localization->agree = refine_with_landmarks(locator, localization, &status);
    if (status != NOTHING && locator->point_count)
        check_against_landmarks(locator, localization, &status);
    return status;
}

// Adds the tags that must also be in view, and counts those that are missing.
static enum status add_predicted_tags(struct locator *locator, struct localization *localization, enum status status)
{
    struct shutter_motion expected = locator->frame_motion;
    locator->frame_motion = localization->found.motion;
    int more = locator_detect_predicted(locator, localization->color, localization->depth,
                                        &localization->found.camera_from_world, INT_MAX, &localization->missing);
    locator->frame_motion = expected;
    return more ? solve_with_predicted(locator, localization, status) : status;
}

// From a half-size image, in which most tags are detected in a quarter of the time; the others are looked for where
// they must be. NOTHING, too, where the full image may give more: nothing confirms what a single tag says, tags
// contradict each other, or one that must be in view is missing (moved or hidden).
static enum status localize_coarse(struct locator *locator, struct localization *localization)
{
    localization->missing = 0;
    if (!locator->coarse_detector)
        return NOTHING;
    enum status status = localize_from_tags(locator, locator->coarse_detector, localization);
    if (status == OK && (localization->agree || localization->found.used > 1))
        status = add_predicted_tags(locator, localization, status);
    if (status < 0)
        return status;
    bool sure = status == OK && (localization->agree || localization->found.used > 1) &&
                localization->found.used == locator->observed_count && !localization->missing;
    return sure ? OK : NOTHING;
}

// From the full image: tags, or else landmarks alone.
static enum status localize_fine(struct locator *locator, struct localization *localization)
{
    enum status status = localize_from_tags(locator, locator->detector, localization);
    if (status == NOTHING) {
        locator->observed_count = 0; // no pose fits the tags
        localization->agree = locator->point_count ? solve_from_landmarks(locator, localization->depth != NULL,
                                                                          locator->matches, &localization->found)
                                                   : 0;
        if (!localization->agree)
            return NOTHING;
        status = OK;
    }
    return status < 0 ? status : add_predicted_tags(locator, localization, status);
}

// From tags and landmarks alone, independently of earlier images.
static enum status localize_from_scratch(struct locator *locator, struct localization *localization)
{
    locator_begin_frame(locator, localization->color);
    enum status status = locator->point_count ? locator_extract_features(locator, localization->depth) : OK;
    if (status == OK)
        status = localize_coarse(locator, localization);
    if (status == NOTHING) {
        status = localize_fine(locator, localization);
        if (status == NOTHING)
            return NOTHING;
    }
    if (status < 0)
        return status;
    locator->frame_motion = localization->found.motion;
    localization->found.rms_px = locator_rms(locator, localization->tags, &localization->found.camera_from_world);
    return status;
}

// A corner that is a feature at several pyramid levels has the same error in all of them, so it must count once.
// Returns how many points are left.
static int drop_duplicates(const struct locator *locator, struct pnp_point *points, int count)
{
    static const double SAME_PX = 4;
    int kept = 0;
    for (int i = 0; i < count; i++) {
        bool again = false;
        for (int k = 0; k < kept && !again; k++)
            again = fabs(points[k].x - points[i].x) * locator->lens.fx < SAME_PX &&
                    fabs(points[k].y - points[i].y) * locator->lens.fy < SAME_PX;
        if (!again)
            points[kept++] = points[i];
    }
    return kept;
}

// The covariance of the pose found, and *out. NOTHING: it is too uncertain.
static enum status evaluate_pose(struct locator *locator, struct localization *localization, enum status status,
                                 double covariance[36], struct location *out)
{
    struct pnp_point points[FEATURES_MAX];
    const struct match_query query = query_of(locator, localization->depth != NULL, NULL);
    const struct pose *pose = &localization->found.camera_from_world;
    double widened[36];
    landmark_correspondences(&query, pose, locator->matches, localization->agree, points);
    const struct pose_problem problem =
        locator_problem(locator, localization->tags, points, drop_duplicates(locator, points, localization->agree));
    const bool known = pnp_covariance(&problem, pose, covariance);
    if (known && status == OK)
        focal_estimate_add(&locator->focal, &problem, pose);
    memcpy(widened, covariance, sizeof widened);
    locator_add_focal_variance(locator, &problem, pose, widened);
    if (!known || !locator_fill_result(locator, &localization->found, localization->agree, widened, covariance, out))
        status = NOTHING;
    if (status == OK)
        locator_vote_moved_tags(locator, localization->tags, localization->agree, pose);
    return status;
}

// keep_tracks: existing tracks are continued from the pose found, where enough of them are found.
static enum status localize_camera(struct locator *locator, const uint8_t *color, const uint16_t *depth,
                                   bool keep_tracks, struct location *out)
{
    struct localization s = {.color = color, .depth = depth, .found = {.used = 0}};
    double covariance[36] = {0};
    enum status status = localize_from_scratch(locator, &s);
    if (status == OK || status == AMBIGUOUS)
        status = evaluate_pose(locator, &s, status, covariance, out);
    if (keep_tracks && status == OK && locator_track_patches(locator, &s.found.camera_from_world)) {
        enum status tracked = locator_solve_tracks(locator, color, depth, s.found.camera_from_world, out);
        if (tracked == NOTHING)
            locator->track_count = 0;
        return tracked == NOTHING ? OK : tracked;
    }
    locator->track_count = 0;
    if (status == OK || status == AMBIGUOUS)
        locator_start_tracks(locator, s.tags, s.agree, &s.found.camera_from_world, covariance);
    return status;
}

enum status locator_localize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize_camera(l, color, depth, false, out);
}

enum status locator_relocalize(struct locator *l, const uint8_t *color, const uint16_t *depth, struct location *out)
{
    return localize_camera(l, color, depth, true, out);
}
