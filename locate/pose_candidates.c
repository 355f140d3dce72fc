// pnp_solve of locate/pose_solver.h: the pose from tags alone, refined from both planar poses of every tag; the best
// and the second best distinct pose are kept.
#include "locate/pose_solver.h"

// Uncertainty added to corners from stage to stage, so that tags far from the one that gave the start can pull
// although they are pixels off. Chosen by hand.
static const double STAGES_PX[] = {8, 2, 0.5, 0};
// Two poses are distinct from here on, and fit equally well up to here. Chosen by hand; AMBIGUOUS_COST is a difference
// of robust costs.
static const double DISTINCT_RAD = 0.05, DISTINCT_M = 0.05, AMBIGUOUS_COST = 12;

// Sets used and rms_px; of tags with the same number only the best is used. Returns how many are used.
static int select_inliers(const struct pose_problem *problem, const struct shutter_motion *motion,
                          const struct pose *pose, double max_rms_px)
{
    struct pnp_tag *tags = problem->tags;
    int used = 0, count = problem->tag_count;
    for (int i = 0; i < count; i++) {
        tags[i].rms_px = pnp_tag_rms(&tags[i], motion, pose, problem->fx, problem->fy);
        tags[i].used = tags[i].rms_px <= max_rms_px;
    }
    for (int i = 0; i < count; i++)
        for (int k = 0; k < count; k++)
            if (i != k && tags[i].seen->id == tags[k].seen->id && tags[i].used && tags[k].used)
                tags[tags[i].rms_px <= tags[k].rms_px ? k : i].used = false;
    for (int i = 0; i < count; i++)
        used += tags[i].used;
    return used;
}

struct pose_candidate {
    struct pose pose;
    struct shutter_motion motion;
    double cost;
    int used;
    uint64_t which; // tags used: bit i is tag i
};

// From one starting pose to the pose that most tags agree on. staged: corners are uncertain at first, which leads out
// of a mirrored pose where other tags contradict it.
static struct pose_candidate refine_candidate(const struct pose_problem *problem, struct pose start, bool staged,
                                              double max_rms_px)
{
    struct pose_candidate c = {.pose = start};
    struct pose_problem own = {
        .tags = problem->tags, .tag_count = problem->tag_count, .fx = problem->fx, .fy = problem->fy};
    if (problem->motion) {
        c.motion = *problem->motion;
        own.motion = &c.motion;
    }
    for (int i = 0; i < own.tag_count; i++)
        own.tags[i].used = true;
    for (size_t s = staged ? 0 : COUNT_OF(STAGES_PX) - 1; s < COUNT_OF(STAGES_PX); s++) {
        own.tag_px = STAGES_PX[s];
        c.cost = pnp_refine(&own, &c.pose);
    }
    for (int round = 0; round < 3; round++) {
        uint64_t before = c.which;
        c.used = select_inliers(&own, own.motion, &c.pose, max_rms_px);
        c.which = 0;
        for (int i = 0; i < own.tag_count; i++)
            c.which |= (uint64_t)own.tags[i].used << i;
        if (!c.used || (round && c.which == before))
            break;
        c.cost = pnp_refine(&own, &c.pose);
    }
    return c;
}

static bool is_better(const struct pose_candidate *a, const struct pose_candidate *b)
{
    return a->used != b->used ? a->used > b->used : a->cost < b->cost;
}

static bool has_duplicate_id(const struct pnp_tag *tags, int count, int i)
{
    for (int k = 0; k < count; k++)
        if (k != i && tags[k].seen->id == tags[i].seen->id)
            return true;
    return false;
}

// Different rotations; or different positions that no tag supports both.
static bool are_distinct(const struct pose_candidate *a, const struct pose_candidate *b)
{
    if (pose_angle(a->pose, b->pose) > DISTINCT_RAD)
        return true;
    return !(a->which & b->which) &&
           v3_distance(pose_inverse(a->pose).translation, pose_inverse(b->pose).translation) > DISTINCT_M;
}

// Keeps the best pose and the best of those distinct from it.
static void keep_best_two(const struct pose_candidate *c, struct pose_candidate *best, struct pose_candidate *second)
{
    bool distinct = !best->used || are_distinct(c, best);
    if (!best->used || is_better(c, best)) {
        if (best->used && distinct)
            *second = *best;
        *best = *c;
        if (second->used && !are_distinct(second, best))
            second->used = 0;
    } else if (distinct && (!second->used || is_better(c, second))) {
        *second = *c;
    }
}

enum status pnp_solve(const struct pose_problem *problem, double max_rms_px, struct pnp_solution *out)
{
    struct pnp_tag *tags = problem->tags;
    const int count = problem->tag_count;
    struct pose_candidate best = {.used = 0}, second = {.used = 0};
    assert(count >= 0 && count <= PNP_MAX_TAGS);
    for (int i = 0; i < count; i++) {
        struct pose two[2];
        int n = planar_poses(tags[i].side_m, tags[i].seen->ray, two);
        for (int k = 0; k < 2 * n; k++) {
            bool staged = k >= n;
            if (staged && count == 1)
                break;
            struct pose start = pose_multiply(two[k % n], pose_inverse(tags[i].world_from_tag));
            struct pose_candidate c = refine_candidate(problem, start, staged, max_rms_px);
            if (c.used && pose_finite(c.pose))
                keep_best_two(&c, &best, &second);
        }
    }
    if (!best.used)
        return NOTHING;
    // Which of two tags with the same number is the mapped one, only another tag can decide.
    select_inliers(problem, problem->motion ? &best.motion : NULL, &best.pose, max_rms_px);
    bool confirmed = best.used > 1;
    for (int i = 0; i < count && !confirmed; i++)
        confirmed = tags[i].used && !has_duplicate_id(tags, count, i);
    if (!confirmed)
        return NOTHING;
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += tags[i].used ? tags[i].rms_px * tags[i].rms_px : 0;
    *out = (struct pnp_solution){.camera_from_world = best.pose,
                                 .other = second.pose,
                                 .rms_px = sqrt(sum / best.used),
                                 .cost = best.cost,
                                 .other_excess_cost = second.cost - best.cost,
                                 .used = best.used,
                                 .motion = best.motion,
                                 .other_motion = second.motion};
    bool alike = second.used == best.used && second.cost - best.cost < AMBIGUOUS_COST;
    return alike ? AMBIGUOUS : OK;
}
