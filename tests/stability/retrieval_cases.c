// Frame selection and the pose index: far from the origin, ties, and joints that are no numbers.
#include "reenact/retrieval/frame_selection.h"
#include "reenact/retrieval/pose_index.h"
#include "tests/stability/stability.h"

enum { FRAMES = 600 };

// A person who walks along x from `from` metres and swings an arm.
static struct skeleton frame_at(double from, int i)
{
    struct skeleton s = {0};
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = v3(from + 0.05 * (i % 60), 0.1 * j, 3 + 0.02 * (j * 7 % 5));
        s.confidence[j] = 1;
    }
    s.joint[JOINT_LEFT_HAND].y += 0.003 * (i * 37 % FRAMES);
    return s;
}

static double cost_of(const struct skeleton *a, const struct skeleton *b)
{
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        sum += v3_distance(v3_sub(a->joint[j], a->joint[JOINT_NECK]), v3_sub(b->joint[j], b->joint[JOINT_NECK]));
    return 16.0 / JOINT_COUNT * sum;
}

// in: distance from the camera along x -> how much more the frame found costs than the best.
static struct answer ask_far(const double *in)
{
    struct frame_selector *s = NULL;
    struct frame_selection found = {-1, 0};
    const struct skeleton wanted = frame_at(in[0], 77);
    double best = INFINITY;
    enum status status = frame_selector_open(&s, FRAMES);
    for (int i = 0; i < FRAMES && status == OK; i++) {
        const struct skeleton k = frame_at(in[0], i == 77 ? 78 : i);
        status = frame_selector_add(s, i, &k, NULL);
        best = fmin(best, cost_of(&k, &wanted));
    }
    if (status == OK)
        status = frame_selector_find_body(s, &wanted, &found);
    frame_selector_close(&s);
    const struct skeleton k = frame_at(in[0], found.frame == 77 ? 78 : (int)found.frame);
    return answer_status(status, status == OK ? cost_of(&k, &wanted) - best : 0);
}

// The costs in single precision, by joints that are not moved to the neck first.
static struct answer far_in_float(const double *in)
{
    const struct skeleton wanted = frame_at(in[0], 77);
    float least = INFINITY;
    double best = INFINITY;
    int found = -1;
    for (int i = 0; i < FRAMES; i++) {
        const struct skeleton k = frame_at(in[0], i == 77 ? 78 : i);
        float sum = 0;
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 d = v3_sub(k.joint[j], wanted.joint[j]);
            sum += (float)v3_length(d) + (float)in[0]; // a sum that the distance from the origin swamps
        }
        best = fmin(best, cost_of(&k, &wanted));
        if (sum < least) {
            least = sum;
            found = i;
        }
    }
    const struct skeleton k = frame_at(in[0], found == 77 ? 78 : found);
    return answer_value(cost_of(&k, &wanted) - best);
}

// in: the value of one joint's coordinate in the query (in[0] 0) or in a frame (1), whether the joint is known, whether
// there is a neck.
static struct answer ask_joint(const double *in)
{
    struct frame_selector *s = NULL;
    struct frame_selection found = {-1, 0};
    struct skeleton wanted = frame_at(0, 3), other = frame_at(0, 5);
    struct skeleton *damaged = in[0] > 0 ? &other : &wanted;
    damaged->joint[JOINT_LEFT_HAND].x = in[1];
    damaged->confidence[JOINT_LEFT_HAND] = (float)in[2];
    damaged->confidence[JOINT_NECK] = (float)in[3];
    enum status status = frame_selector_open(&s, 4);
    if (status == OK)
        status = frame_selector_add(s, 0, &other, NULL);
    if (status == OK)
        status = frame_selector_find_body(s, &wanted, &found);
    frame_selector_close(&s);
    return answer_status(status, (double)found.frame);
}

// A smaller cost than infinity wins; NaN's is none.
static struct answer least_of_nan(const double *in)
{
    const struct skeleton a = frame_at(0, 3);
    struct skeleton b = frame_at(0, 5);
    b.joint[JOINT_LEFT_HAND].x = in[1];
    const double cost = cost_of(&a, &b);
    return answer_value(cost >= 1e300 ? 1 : 0 * (cost > 0));
}

// Of equal frames the first. in: number of equal frames.
static struct answer ask_tie(const double *in)
{
    struct frame_selector *s = NULL;
    struct frame_selection found = {-1, 0};
    const struct skeleton same = frame_at(0, 3);
    enum status status = frame_selector_open(&s, 64);
    for (int i = 0; i < (int)in[0] && status == OK; i++)
        status = frame_selector_add(s, 10 + i, &same, NULL);
    if (status == OK)
        status = frame_selector_find_body(s, &same, &found);
    frame_selector_close(&s);
    return answer_status(status, (double)found.frame);
}

static struct answer last_of_equals(const double *in) { return answer_value(9 + in[0]); }

// context: the points, the wanted one after the last.
static double index_cost(const void *context, int64_t number)
{
    const double *x = context;
    return fabs(x[number] - x[FRAMES]);
}

// Points on a line, in[0] apart from the origin, in[1] between each; far beyond the bounds' range -> excess of the
// nearest.
static struct answer ask_index(const double *in)
{
    static double x[FRAMES + 1];
    struct pose_index *n = NULL;
    struct pose_index_point p = {.known = 1};
    enum status status = pose_index_open(&n, 1, 0.01, FRAMES);
    for (int i = 0; i < FRAMES; i++) {
        x[i] = in[0] + in[1] * (i * 113 % FRAMES);
        p.position[0] = v3(x[i], 0, 0);
        if (status == OK)
            pose_index_add(n, &p);
    }
    x[FRAMES] = in[0] + in[1] * 200.4;
    p.position[0] = v3(x[FRAMES], 0, 0);
    double best = INFINITY;
    int64_t found = 0;
    if (status == OK) {
        struct pose_index_query q = {.point = p, .scale = 1, .cost = index_cost, .context = x};
        pose_index_find(n, &q);
        found = q.number;
    }
    for (int i = 0; i < FRAMES; i++)
        best = fmin(best, fabs(x[i] - x[FRAMES]));
    pose_index_close(&n);
    return answer_status(status, fabs(x[found] - x[FRAMES]) - best);
}

// Bounds that are quantised to 16 bits and wrap around.
static struct answer wrapped_bounds(const double *in)
{
    int16_t least = INT16_MAX;
    double found = 0, best = INFINITY;
    const double wanted = in[0] + in[1] * 200.4;
    for (int i = 0; i < FRAMES; i++) {
        const double x = in[0] + in[1] * (i * 113 % FRAMES);
        const int16_t off = (int16_t)(uint16_t)((int64_t)(fabs(x - wanted) * 100) & 0xffff);
        best = fmin(best, fabs(x - wanted));
        if (off < least) {
            least = off;
            found = fabs(x - wanted);
        }
    }
    return answer_value(found - best);
}

static const struct stability_case cases[] = {
    {"nearest frame 10^4 m from the camera", "joints about the neck, in double", ANSWER_VALUE, ask_far, NULL,
     far_in_float, .in = {1e4}, .exact = {0}, .exact_count = 1, .tolerance = 1e-9, .unit = "m"},
    {"nearest frame 10^6 m from the camera", "joints about the neck, in double", ANSWER_VALUE, ask_far, NULL,
     far_in_float, .in = {1e6}, .exact = {0}, .exact_count = 1, .tolerance = 1e-7, .unit = "m"},
    {"nearest frame to a joint that is NaN", "finite joints only", ANSWER_ERROR, ask_joint, NULL, least_of_nan,
     .in = {0, NAN, 1, 1}},
    {"nearest frame to an infinite joint", "finite joints only", ANSWER_ERROR, ask_joint, NULL, least_of_nan,
     .in = {0, INFINITY, 1, 1}},
    {"nearest of frames with a joint that is NaN", "finite joints only", ANSWER_ERROR, ask_joint, NULL, least_of_nan,
     .in = {1, NAN, 1, 1}},
    {"nearest frame to a body without a neck", "costs need a neck", ANSWER_UNKNOWN, ask_joint, NULL, least_of_nan,
     .in = {0, 0, 1, 0}},
    {"nearest of frames without a neck", "costs need a neck", ANSWER_UNKNOWN, ask_joint, NULL, least_of_nan,
     .in = {1, 0, 1, 0}},
    {"nearest of no frames", "no frame, no answer", ANSWER_UNKNOWN, ask_tie, NULL, last_of_equals, .in = {0}},
    {"nearest of 40 equal frames", "the lowest index", ANSWER_VALUE, ask_tie, NULL, last_of_equals, .in = {40},
     .exact = {10}, .exact_count = 1},
    {"index of points 10^5 times its range apart", "bounds are clamped, costs exact", ANSWER_VALUE, ask_index, NULL,
     wrapped_bounds, .in = {1e6, 13.7}, .exact = {0}, .exact_count = 1, .unit = "m"},
};
const struct stability_stage stability_retrieval = {"frame retrieval", cases, COUNT_OF(cases)};
