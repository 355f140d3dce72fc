// What the joints that the network finds in each depth image decide beside the fit: where limbs and the body may be,
// and which way the person faces.
#include "capture/body/two_bone_ik.h"
#include "capture/tracking/point_hypotheses.h"
#include "capture/tracking/pose_init.h"
#include "capture/tracking/tracker_internal.h"

#define PERSON_RATE      0.1 // of a frame in the running mean of whether it is a person
#define BOX_ROOM         0.3 // of the expected body's size in the image
#define NEAR_PLANE_M     0.2
#define FOREIGN          0.9     // a cell that is none of the person's with this probability
#define FOREIGN_M        0.4     // and further than this from every joint
#define OTHER_PERSON_M   0.35    // the trunk is this far from where it is expected: it is somebody else's
#define NOTHING_LOG_ODDS (-10.0) // of a person where there is nothing to look at
#define UNSURE           0.1     // a vector to the left that is shorter has no direction
#define SURE_COSINE      0.5     // between its vector to the left and the followed one's: below, it is told
#define OWN_SHARE_MIN    0.3     // of the points: with fewer left the network is not believed
#define DIFFERS_M        0.10    // joints nearer to the fit's than this are the same
#define MOVE_SIGMA       1.5     // expected_sigma about a limb that the network has elsewhere
#define MOVE_ENERGY      20.0    // that a limb must gain for each metre that it moves
#define REFINE_GAIN      3.0     // any new fit reduces the energy by about this
enum { QUICK_ITERATIONS = 4 };

// The unit vector towards a body's left.
static struct vec3 left_of(const struct body_build *build)
{
    return v3_unit(v3_add(v3_sub(build->joint[JOINT_LEFT_SHOULDER], build->joint[JOINT_RIGHT_SHOULDER]),
                          v3_sub(build->joint[JOINT_LEFT_HIP], build->joint[JOINT_RIGHT_HIP])));
}

// Where the body is expected in the image, and room about it: what is further away is somebody else.
static struct pixel_box box_about(const struct lens *lens, const struct body_build *build)
{
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = build->joint[j];
        const struct pixel px = lens_project(lens, v3(p.x, p.y, fmax(p.z, NEAR_PLANE_M)));
        low[0] = fmin(low[0], px.x), high[0] = fmax(high[0], px.x);
        low[1] = fmin(low[1], px.y), high[1] = fmax(high[1], px.y);
    }
    const double room = BOX_ROOM * fmax(high[0] - low[0], high[1] - low[1]);
    return (struct pixel_box){(int)fmax(0, low[0] - room), (int)fmax(0, low[1] - room),
                              (int)fmin(lens->width - 1, high[0] + room), (int)fmin(lens->height - 1, high[1] + room)};
}

static double nearest_joint_m(const struct found_body *found, struct vec3 p)
{
    double min = 1e9;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (found->sigma_m[j] < (double)INFINITY)
            min = fmin(min, v3_distance(found->joint[j], p));
    return min;
}

// Points that the network is sure are not the person's, and that are far from every joint, are none of the evidence's:
// a hand is smaller than a cell.
static void drop_foreign_points(struct depth_evidence *evidence, const struct body_square *square,
                                const struct found_body *found)
{
    int kept = 0, cell;
    bool own[EVIDENCE_POINTS_MAX];
    for (int i = 0; i < evidence->count; i++) {
        const struct pixel px = lens_project(&evidence->lens, evidence->point[i].p);
        own[i] = !body_square_cell(square, px, &cell) || (double)found->none[cell] < FOREIGN ||
                 nearest_joint_m(found, evidence->point[i].p) < FOREIGN_M;
        kept += own[i];
    }
    if (kept < OWN_SHARE_MIN * evidence->count)
        return;
    kept = 0;
    for (int i = 0; i < evidence->count; i++)
        if (own[i])
            evidence->point[kept++] = evidence->point[i];
    evidence->count = kept;
}

static double trunk_distance_m(const struct found_body *found, const struct body_build *expected)
{
    static const enum joint trunk[] = {JOINT_NECK, JOINT_TORSO, JOINT_WAIST};
    struct vec3 off = v3(0, 0, 0);
    for (size_t i = 0; i < COUNT_OF(trunk); i++)
        off = v3_add(off, v3_scale(v3_sub(found->joint[trunk[i]], expected->joint[trunk[i]]), 1.0 / COUNT_OF(trunk)));
    return v3_length(off);
}

void tracker_find_joints(struct tracker *tracker, struct fit_task *task)
{
    struct depth_evidence *e = tracker->evidence;
    struct body_build expected;
    struct pixel_box box = lens_box(&e->lens);
    if (tracker->following) {
        body_forward_kinematics(&task->shape.mean, &task->expected, &expected);
        box = box_about(&e->lens, &expected);
    }
    struct body_square square = body_square_about(&e->lens, e->depth, e->mask, box);
    if (!(square.side > 0))
        square = body_square_about(&e->lens, e->depth, e->mask, lens_box(&e->lens));
    tracker->has_joints = false;
    tracker->turned_cosine = 0;
    tracker->person_log_odds = NOTHING_LOG_ODDS;
    task->joints = NULL;
    if (!(square.side > 0)) // all of it is further away than any sensor sees a person
        return;
    struct found_body found;
    tracker->square = square;
    body_network_find(tracker->network, &e->lens, e->depth, NULL, &square, v3(0, 0, 0), &found);
    tracker->person_log_odds = found.log_odds;
    tracker->person_mean = tracker->following
                               ? tracker->person_mean + PERSON_RATE * (found.log_odds - tracker->person_mean)
                               : found.log_odds;
    joint_evidence_read(&tracker->untold, &found);
    if (tracker->following) {
        const struct vec3 left = left_of(&expected);
        tracker->turned_cosine = v3_dot(left, found.left);
        if (tracker->turned_cosine < SURE_COSINE)
            body_network_find(tracker->network, &e->lens, e->depth, NULL, &square, left, &found);
    }
    joint_evidence_read(&tracker->joints, &found);
    tracker->has_joints = !tracker->following || trunk_distance_m(&found, &expected) < OTHER_PERSON_M;
    task->joints = tracker->has_joints ? &tracker->joints : NULL;
    if (!tracker->has_joints)
        tracker->turned_cosine = 0;
    else if (found.log_odds > 0)
        drop_foreign_points(e, &square, &found);
}

void tracker_find_both_sides(struct tracker *tracker, struct joint_evidence told[2])
{
    const struct depth_evidence *e = tracker->evidence;
    const double sure = v3_length(tracker->untold.left);
    const struct vec3 left =
        sure > UNSURE ? v3_scale(tracker->untold.left, 1 / sure) : v3(1, 0, 0); // facing the sensor
    for (int i = 0; i < 2; i++) {
        struct found_body found;
        body_network_find(tracker->network, &e->lens, e->depth, NULL, &tracker->square, v3_scale(left, i ? -1 : 1),
                          &found);
        joint_evidence_read(&told[i], &found);
    }
}

// The fit so far, what is tried, and the energy that has to be undercut.
struct search {
    const struct fit_task *task;
    const struct body_shape shape;
    struct fit_scratch *scratch;
    double min;
};

// Takes scratch->trial if it is likelier. Moving costs: a followed limb is not given up for a slightly better place.
static bool take_trial(struct search *search)
{
    const struct fit_result *trial = &search->scratch->trial;
    double far_m = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        far_m = fmax(far_m, v3_distance(trial->build.joint[j], search->scratch->best.build.joint[j]));
    if (trial->energy + MOVE_ENERGY * far_m >= search->min)
        return false;
    search->min = trial->energy;
    search->scratch->best = *trial;
    return true;
}

// Fits a pose and takes it if it is likelier.
static bool try_pose(struct search *search, const struct body_pose *pose)
{
    struct fit_task task = *search->task;
    struct fit_scratch *scratch = search->scratch;
    task.learn_shape = false;
    task.shape.mean = search->shape;
    task.kernel_m = SEARCH_KERNEL_M;
    task.iterations = QUICK_ITERATIONS;
    task.expected = *pose;
    task.expected_sigma = MOVE_SIGMA;
    body_fit(&task, pose, &scratch->trial);
    return take_trial(search);
}

// 0 where it was not found.
static double joint_differs_m(const struct joint_evidence *joints, const struct body_build *build, enum joint joint)
{
    return joints->sigma_m[joint] < (double)INFINITY ? v3_distance(joints->joint[joint], build->joint[joint]) : 0;
}

static double limb_differs_m(const struct joint_evidence *joints, const struct body_build *build, int k)
{
    const struct body_limb *limb = &body_limbs[k];
    return fmax(joint_differs_m(joints, build, limb->bend), joint_differs_m(joints, build, limb->tip));
}

static double trunk_differs_m(const struct joint_evidence *joints, const struct body_build *build)
{
    double max = 0;
    for (int k = 0; k < LIMB_COUNT; k++)
        max = fmax(max, joint_differs_m(joints, build, body_limbs[k].root));
    return max;
}

// The limbs of the bit set where the network has them.
static bool try_limbs(struct search *search, const struct body_build *found, unsigned limbs)
{
    struct body_pose pose = search->scratch->best.pose;
    for (int k = 0; k < LIMB_COUNT; k++)
        if (limbs & 1u << k)
            limb_transfer(k, &search->shape, found, &pose);
    return try_pose(search, &pose);
}

// Where the colour image's points have a limb, if they dispute where it is.
static bool try_points(struct search *search, int k)
{
    struct limb_target target[LIMB_TARGETS_MAX];
    const struct fit_result *best = &search->scratch->best;
    const struct point_evidence *points = search->task->points;
    if (!points || !point_limb_is_disputed(points, &best->build, k))
        return false;
    bool moved = false;
    const int count = point_limb_targets(points, &best->build, k, target);
    for (int i = 0; i < count; i++) {
        struct body_pose pose = best->pose;
        pose.rotation[body_limbs[k].end] = (struct quat){0, 0, 0, 1};
        two_bone_ik(&search->shape, &pose, body_limbs[k].upper, target[i].end, target[i].pole);
        moved |= try_pose(search, &pose);
    }
    return moved;
}

bool tracker_try_joints(struct tracker *tracker, const struct fit_task *task)
{
    struct fit_scratch *scratch = tracker->scratch;
    struct search search = {.task = task, .shape = scratch->best.shape, .scratch = scratch};
    const struct body_pose now = scratch->best.pose,
                           found = joint_evidence_pose(&tracker->joints, &search.shape, task->up);
    struct body_build there;
    struct fit_task wide = *task;
    bool moved = false;
    wide.kernel_m = SEARCH_KERNEL_M;
    body_evaluate(&wide, &now, &search.shape, &scratch->other);
    search.min = scratch->other.energy - REFINE_GAIN;
    body_forward_kinematics(&search.shape, &found, &there);
    if (tracker->has_joints && trunk_differs_m(&tracker->joints, &scratch->best.build) > DIFFERS_M) {
        wide.shape.mean = search.shape;
        pose_init_fit(&wide, &found, scratch);
        moved = take_trial(&search);
    }
    for (int first = 0; first < LIMB_COUNT && tracker->has_joints; first += 2) { // exchanged legs have to move at once
        unsigned differ = 0;
        for (int k = first; k < first + 2; k++)
            if (limb_differs_m(&tracker->joints, &scratch->best.build, k) > DIFFERS_M)
                differ |= 1u << k;
        if (differ)
            moved |= try_limbs(&search, &there, differ);
        for (int k = first; k < first + 2 && differ == 3u << first; k++)
            if (limb_differs_m(&tracker->joints, &scratch->best.build, k) > DIFFERS_M)
                moved |= try_limbs(&search, &there, 1u << k);
    }
    for (int k = 0; k < LIMB_COUNT; k++)
        moved |= try_points(&search, k);
    return moved;
}
