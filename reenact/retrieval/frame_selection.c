// Costs of frames for the whole body and for parts; their bounds for the pose index.
#include "reenact/retrieval/frame_selection.h"

#include "base/clamp.h"
#include "reenact/retrieval/pose_index.h"

#include <stdlib.h>

// How a frame shows a part, as far as joints determine it.
struct part_view {
    bool known;
    bool excluded;
    bool body_aligned;         // the axes below are body-aligned; else the axial rotation is unknown: viewer-aligned
    uint8_t neighbors_known;   // bit i: neighbors[i] is known
    float distance_m;          // from the camera
    float fixed_cost_m;        // of occlusion and uncertainty, whatever the query
    float camera_direction[3]; // unit, to the camera, in the part's axes
    float neighbors[3][3];     // the joints of neighbor_joints, in the part's axes, metres
};

// Arrays by frame added; apart from each other, as different searches read them.
struct frame_selector {
    int64_t count, capacity;
    int64_t *frames;
    struct skeleton *skeletons;          // camera axes
    struct part_view *views[PART_COUNT]; // one allocation, at views[0]
    struct pose_index *body_index, *part_index[PART_COUNT];
};

// Quanta of the bounds: coordinates reach 4 m from the neck, 1 m of a part's cost.
static const double BODY_UNIT_M = 1.0 / 2048, PART_UNIT_M = 1.0 / 8192;

// All but the neck, where skeletons are made to coincide.
static const enum joint body_joints[] = {
    JOINT_LEFT_HAND,      JOINT_RIGHT_HAND, JOINT_LEFT_FOOT,  JOINT_RIGHT_FOOT, JOINT_LEFT_ELBOW,
    JOINT_RIGHT_ELBOW,    JOINT_LEFT_KNEE,  JOINT_RIGHT_KNEE, JOINT_HEAD,       JOINT_LEFT_SHOULDER,
    JOINT_RIGHT_SHOULDER, JOINT_WAIST,      JOINT_LEFT_HIP,   JOINT_RIGHT_HIP,  JOINT_TORSO,
};

// Joints whose position relative to a part deforms its surface. Chosen by hand.
static const enum joint neighbor_joints[PART_COUNT][3] = {
    [PART_HEAD] = {JOINT_TORSO, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER},
    [PART_UPPER_TORSO] = {JOINT_WAIST, JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW},
    [PART_LOWER_TORSO] = {JOINT_NECK, JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
    [PART_LEFT_UPPER_ARM] = {JOINT_NECK, JOINT_TORSO, JOINT_LEFT_HAND},
    [PART_LEFT_FOREARM] = {JOINT_LEFT_SHOULDER, JOINT_NECK, JOINT_TORSO},
    [PART_RIGHT_UPPER_ARM] = {JOINT_NECK, JOINT_TORSO, JOINT_RIGHT_HAND},
    [PART_RIGHT_FOREARM] = {JOINT_RIGHT_SHOULDER, JOINT_NECK, JOINT_TORSO},
    [PART_LEFT_THIGH] = {JOINT_WAIST, JOINT_RIGHT_HIP, JOINT_LEFT_FOOT},
    [PART_LEFT_SHIN] = {JOINT_LEFT_HIP, JOINT_WAIST, JOINT_RIGHT_HIP},
    [PART_RIGHT_THIGH] = {JOINT_WAIST, JOINT_LEFT_HIP, JOINT_RIGHT_FOOT},
    [PART_RIGHT_SHIN] = {JOINT_RIGHT_HIP, JOINT_WAIST, JOINT_LEFT_HIP},
};

// Weights of a part's cost, chosen by hand. An equal pose about the part counts most: cloth, shading and
// occlusion follow it. The viewing direction comes next: a chord of 1 shows about a radius of surface
// that was not seen.
static const double VIEWPOINT_M = 0.25;  // a chord of 1 between the two directions to the camera
static const double NEIGHBOR_M = 1.5;    // a metre of mean difference of the joints around
static const double OCCLUDED_M = 0.5;    // the whole bone hidden
static const double RESOLUTION_M = 0.06; // twice as far away as what is to be shown
static const double UNCERTAIN_M = 0.3;   // ends of confidence 0

static enum status check_finite(const struct skeleton *skeleton)
{
    for (int j = 0; j < JOINT_COUNT; j++)
        if (skeleton->confidence[j] > 0 && !v3_finite(skeleton->joint[j]))
            return fail(ERR_INPUT, "the skeleton's %s is not at a finite place", joint_name((enum joint)j));
    return OK;
}

// Whether the segment from the camera (origin) to `p` passes within `radius` of bone a-b, before p.
static bool occludes(struct vec3 p, struct vec3 a, struct vec3 b, double radius)
{
    // Closest approach of the segments 0..p and a..b, by alternating projections: the
    // distance is convex, and accuracy of a centimetre suffices.
    double s = 1, t = 0.5;
    struct vec3 ab = v3_sub(b, a);
    double pp = v3_dot(p, p), bb = v3_dot(ab, ab);
    if (!(pp > 0) || !(bb > 0))
        return false;
    for (int i = 0; i < 8; i++) {
        t = v3_dot(v3_sub(v3_scale(p, s), a), ab) / bb;
        t = clamp_double(t, 0, 1);
        s = v3_dot(v3_mix(a, b, t), p) / pp;
        s = clamp_double(s, 0, 1);
    }
    return s < 1 && v3_distance(v3_scale(p, s), v3_mix(a, b, t)) < radius;
}

// Whether a part that shares no joint with part p lies between the camera and `at`.
static bool is_occluded(const struct skeleton *skeleton, const struct body *body, enum part part, struct vec3 at)
{
    struct part_ends ends = part_ends[part];
    for (int o = 0; o < PART_COUNT; o++) {
        struct part_ends other = part_ends[o];
        bool joined = other.from == ends.from || other.from == ends.to || other.to == ends.from || other.to == ends.to;
        if (o == (int)part || joined || !part_is_known(body, skeleton, (enum part)o))
            continue;
        struct vec3 a = skeleton->joint[other.from], b = skeleton->joint[other.to];
        if (occludes(at, a, b, body->radius_rate[o] * v3_distance(a, b)))
            return true;
    }
    return false;
}

// Share of the part that other parts hide from the camera, at four points along it.
static double occluded_share(const struct skeleton *skeleton, const struct body *body, enum part part)
{
    enum { SAMPLES = 4 };
    struct part_ends ends = part_ends[part];
    double radius = body->radius_rate[part] * v3_distance(skeleton->joint[ends.from], skeleton->joint[ends.to]);
    int hidden = 0;
    for (int i = 0; i < SAMPLES; i++) {
        struct vec3 at = v3_mix(skeleton->joint[ends.from], skeleton->joint[ends.to], (i + 0.5) / SAMPLES);
        double far = v3_length(at);
        if (!(far > radius))
            continue;
        at = v3_scale(at, 1 - radius / far); // on the side that faces the camera
        hidden += is_occluded(skeleton, body, part, at);
    }
    return (double)hidden / SAMPLES;
}

static void store_vec3(float out[3], struct vec3 v) { out[0] = (float)v.x, out[1] = (float)v.y, out[2] = (float)v.z; }

static struct vec3 load_vec3(const float v[3]) { return v3((double)v[0], (double)v[1], (double)v[2]); }

static struct part_view part_view_of(const struct skeleton *skeleton, const struct body *body, enum part part)
{
    struct part_view view = {0};
    struct bone_frame f;
    view.body_aligned = bone_frame_body_aligned(skeleton, part, &f);
    if (!view.body_aligned && !bone_frame_viewer_aligned(skeleton, part, v3(0, 0, 0), &f))
        return view;
    struct vec3 middle = bone_frame_midpoint(&f);
    view.distance_m = (float)v3_length(middle);
    if (!(view.distance_m > 1e-3F))
        return view;
    view.known = true;
    store_vec3(view.camera_direction, v3_unit(bone_frame_local_direction(&f, v3_scale(middle, -1))));
    for (int i = 0; i < 3; i++) {
        enum joint j = neighbor_joints[part][i];
        if (skeleton->confidence[j] > 0) {
            store_vec3(view.neighbors[i], bone_frame_local_point(&f, skeleton->joint[j]));
            view.neighbors_known |= (uint8_t)(1 << i);
        }
    }
    double uncertain =
        fmaxf(0, 1 - fminf(skeleton->confidence[part_ends[part].from], skeleton->confidence[part_ends[part].to]));
    double hidden = body ? occluded_share(skeleton, body, part) : 0;
    view.fixed_cost_m = (float)(OCCLUDED_M * hidden + UNCERTAIN_M * uncertain);
    return view;
}

// ---------------------------------------------------------------- bounds

// The cost is at least 16 / (joints known in the query) times the sum of distances.
static struct pose_index_point body_point(const struct skeleton *skeleton)
{
    struct pose_index_point point = {.known = 0};
    if (!(skeleton->confidence[JOINT_NECK] > 0))
        return point;
    for (size_t i = 0; i < COUNT_OF(body_joints); i++)
        if (skeleton->confidence[body_joints[i]] > 0) {
            point.position[i] = v3_sub(skeleton->joint[body_joints[i]], skeleton->joint[JOINT_NECK]);
            point.known |= 1u << i;
        }
    return point;
}

enum { PART_POSITIONS = 4 };

// Body-aligned and viewer-aligned axes are not comparable: for the rarer, viewer-aligned ones no position is known.
static struct pose_index_point part_point(const struct part_view *view)
{
    struct pose_index_point point = {.fixed_cost_m = (double)view->fixed_cost_m};
    if (!view->body_aligned)
        return point;
    point.position[0] = v3_scale(load_vec3(view->camera_direction), VIEWPOINT_M);
    for (int i = 0; i < 3; i++)
        point.position[i + 1] = v3_scale(load_vec3(view->neighbors[i]), NEIGHBOR_M / 3);
    point.known = 1 | (uint32_t)view->neighbors_known << 1;
    return point;
}

// ---------------------------------------------------------------- frames

static enum status open_arrays(struct frame_selector *selector)
{
    size_t capacity = selector->capacity > 0 ? (size_t)selector->capacity : 1;
    selector->frames = calloc(capacity, sizeof *selector->frames);
    selector->skeletons = calloc(capacity, sizeof *selector->skeletons);
    struct part_view *views = calloc(PART_COUNT * capacity, sizeof *views);
    bool enough = selector->frames && selector->skeletons && views;
    for (int p = 0; p < PART_COUNT && views; p++)
        selector->views[p] = views + (size_t)p * capacity;
    enum status status = enough ? OK : fail(ERR_MEMORY, "no memory for the choice of frames");
    if (status == OK)
        status = pose_index_open(&selector->body_index, COUNT_OF(body_joints), BODY_UNIT_M, selector->capacity);
    for (int p = 0; p < PART_COUNT && status == OK; p++)
        status = pose_index_open(&selector->part_index[p], PART_POSITIONS, PART_UNIT_M, selector->capacity);
    return status;
}

enum status frame_selector_open(struct frame_selector **out, int64_t capacity)
{
    assert(capacity >= 0);
    *out = NULL;
    struct frame_selector *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the choice of frames");
    s->capacity = capacity;
    enum status status = open_arrays(s);
    if (status != OK)
        frame_selector_close(&s);
    *out = s;
    return status;
}

void frame_selector_close(struct frame_selector **selector)
{
    if (!*selector)
        return;
    pose_index_close(&(*selector)->body_index);
    for (int p = 0; p < PART_COUNT; p++)
        pose_index_close(&(*selector)->part_index[p]);
    free((*selector)->views[0]);
    free((*selector)->skeletons);
    free((*selector)->frames);
    free(*selector);
    *selector = NULL;
}

enum status frame_selector_add(struct frame_selector *selector, int64_t frame, const struct skeleton *in_camera,
                               const struct body *body)
{
    assert(selector->count < selector->capacity &&
           (selector->count == 0 || selector->frames[selector->count - 1] < frame));
    enum status status = check_finite(in_camera);
    if (status != OK)
        return status;
    int64_t n = selector->count++;
    selector->frames[n] = frame;
    selector->skeletons[n] = *in_camera;
    struct pose_index_point point = body_point(in_camera);
    pose_index_add(selector->body_index, &point);
    for (int p = 0; p < PART_COUNT; p++) {
        selector->views[p][n] = part_view_of(in_camera, body, (enum part)p);
        point = part_point(&selector->views[p][n]);
        pose_index_add(selector->part_index[p], &point);
    }
    return OK;
}

void frame_selector_exclude(struct frame_selector *selector, int64_t frame, enum part part)
{
    int64_t low = 0, high = selector->count; // binary search
    while (low < high) {
        int64_t middle = low + (high - low) / 2;
        if (selector->frames[middle] < frame)
            low = middle + 1;
        else
            high = middle;
    }
    if (low < selector->count && selector->frames[low] == frame)
        selector->views[part][low].excluded = true;
}

static enum status fill_selection(const struct frame_selector *selector, const struct pose_index_query *query,
                                  struct frame_selection *out)
{
    if (query->number < 0)
        return NOTHING;
    *out = (struct frame_selection){selector->frames[query->number], query->cost_m};
    return OK;
}

// ---------------------------------------------------------------- the whole body

struct body_target {
    const struct skeleton *skeletons, *skeleton;
    int needed; // joints that must be known in both
};

// [D14] eq. 5 for one pair; negative: not comparable.
static double body_cost(const void *context, int64_t number)
{
    const struct body_target *target = context;
    const struct skeleton *skeleton = target->skeleton, *n = &target->skeletons[number];
    if (!(n->confidence[JOINT_NECK] > 0))
        return -1;
    int joints = 0;
    double sum = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(skeleton->confidence[j] > 0) || !(n->confidence[j] > 0))
            continue;
        joints++;
        sum += v3_distance(v3_sub(skeleton->joint[j], skeleton->joint[JOINT_NECK]),
                           v3_sub(n->joint[j], n->joint[JOINT_NECK]));
    }
    return joints >= target->needed ? sum * JOINT_COUNT / joints : -1;
}

enum status frame_selector_find_body(const struct frame_selector *selector, const struct skeleton *in_viewer,
                                     struct frame_selection *out)
{
    enum status status = check_finite(in_viewer);
    if (status != OK)
        return status;
    if (!(in_viewer->confidence[JOINT_NECK] > 0))
        return NOTHING;
    int known = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        known += in_viewer->confidence[j] > 0;
    struct body_target target = {selector->skeletons, in_viewer, (known + 1) / 2};
    struct pose_index_query query = {
        .point = body_point(in_viewer), .scale = (double)JOINT_COUNT / known, .cost = body_cost, .context = &target};
    pose_index_find(selector->body_index, &query);
    return fill_selection(selector, &query, out);
}

// ---------------------------------------------------------------- one part

struct part_target {
    const struct part_view *views;
    struct part_view view;
};

static double part_cost(const void *context, int64_t number)
{
    const struct part_target *target = context;
    const struct part_view *view = &target->view, *n = &target->views[number];
    if (!n->known || n->excluded)
        return -1;
    // Between known and unknown axial rotation, a right angle is assumed (a chord of 1.4).
    double cost = VIEWPOINT_M * (view->body_aligned == n->body_aligned
                                     ? v3_distance(load_vec3(view->camera_direction), load_vec3(n->camera_direction))
                                     : 1.4);
    double sum = 0;
    int joints = 0;
    for (int i = 0; i < 3 && view->body_aligned == n->body_aligned; i++)
        if ((view->neighbors_known & n->neighbors_known) >> i & 1) {
            sum += v3_distance(load_vec3(view->neighbors[i]), load_vec3(n->neighbors[i]));
            joints++;
        }
    if (joints)
        cost += NEIGHBOR_M * sum / joints;
    // More resolution than the viewer needs is no advantage.
    if (n->distance_m > view->distance_m)
        cost += RESOLUTION_M * ((double)n->distance_m / (double)view->distance_m - 1);
    return cost + (double)n->fixed_cost_m;
}

static enum status find_part(const struct frame_selector *selector, const struct skeleton *in_viewer, enum part part,
                             struct frame_selection *out)
{
    const struct part_target target = {selector->views[part], part_view_of(in_viewer, NULL, part)};
    if (!target.view.known)
        return NOTHING;
    struct pose_index_query query = {
        .point = part_point(&target.view), .scale = 1, .cost = part_cost, .context = &target};
    pose_index_find(selector->part_index[part], &query);
    return fill_selection(selector, &query, out);
}

enum status frame_selector_find_part(const struct frame_selector *selector, const struct skeleton *in_viewer,
                                     enum part p, struct frame_selection *out)
{
    const enum status status = check_finite(in_viewer);
    return status == OK ? find_part(selector, in_viewer, p, out) : status;
}

enum status frame_selector_find_parts(const struct frame_selector *selector, const struct skeleton *in_viewer,
                                      struct frame_selection out[PART_COUNT])
{
    const enum status status = check_finite(in_viewer);
    if (status != OK)
        return status;
    enum status any = NOTHING;
    for (int p = 0; p < PART_COUNT; p++) {
        out[p] = (struct frame_selection){-1, 0};
        if (find_part(selector, in_viewer, (enum part)p, &out[p]) == OK)
            any = OK;
    }
    return any;
}
