#include "reenact/avatar/axial_rotation.h"

#include "base/portable_math.h"
#include "reenact/observation/depth_frame.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { ANGLES = 25, SAMPLES = 600, SAMPLES_MIN = 20, RIM_PX = 1 };

// Tuned by hand on three takes of docs/results.md: dance, the small world's dancer, and the filmed man.
static const double STEP_RAD = 0.05, HEAD_STEP_RAD = 0.125; // between neighbouring angles
// Standard deviations of the angle that joints and depth give:
static const double PRIOR_RAD = 0.3;
static const double THIGH_PRIOR_RAD = 0.15;   // of a thigh, since a bent knee shows it
static const double HEAD_PRIOR_RAD = 0.5;     // of a head, which turns against the trunk
static const double RATE_RAD_S = 2;           // and of the change of its error in a second
static const double MIN_FACING = 0.3;         // cosine towards the camera
static const double DEPTH_HALF_COST_M = 0.02; // a depth sample this far behind a point costs a half
static const float COLOR_OUTLIER = 0.15F;     // scale of the robust colour cost; gamma-encoded, 0 to 1
static const float UNKNOWN_COST = 0.35F;      // of 1: of a visible point whose colour is not learned yet
static const float DEPTH_WEIGHT = 0.5F;       // of the depth cost against the colours', as the shape is still coarse
static const double COLOR_SIGMA = 0.06;       // standard deviation of equal colours' difference
static const double INDEPENDENT_SAMPLES = 20; // of a bone, at most: colour errors of neighbours are correlated
static const float GAIN_MIN = 0.7F, GAIN_MAX = 1.4F; // of a bone's brightness against the learned one
static const float MAX_WEIGHT = 20;                  // of a learned colour, in frames

// A point of the surface that moves rigidly with one bone, and its learned colour.
struct bone_sample {
    struct vec3 point, normal; // bind-pose axes
    float color[3], weight;    // gamma-encoded, 0 to 1; weight 0: not learned
};

struct bone_samples {
    struct bone_sample of[SAMPLES];
    int count;
};

// The probability of each angle of a tracked frame, given the frames tracked before.
struct angle_posterior {
    double of[BONE_COUNT][ANGLES];
    double time_s;
};

struct axial_rotation {
    const struct bind_pose *bind_pose;
    struct calibration calibration;
    struct pose depth_from_color;
    struct bone_samples samples[BONE_COUNT];
    struct angle_posterior first, last; // of the tracked frames: the seed's, the latest's
    bool tracking;
    int frames;
    double *seed_score;                // of each frame
    float (*cost)[BONE_COUNT][ANGLES]; // of each frame, bone and angle
};

static double step_of(int bone) { return bone == BONE_SKULL ? HEAD_STEP_RAD : STEP_RAD; }

static double angle_of(int bone, int k) { return (k - ANGLES / 2) * step_of(bone); }

static bool is_rigid(const struct bind_pose *bind_pose, struct vec3 point, int bone)
{
    const struct skin_weights skin = bind_pose_skin_weights(bind_pose, point);
    return skin.bone[0] == bone && skin.weight[0] > 0.8F;
}

static void find_samples(struct bone_samples *samples, const struct bind_pose *bind_pose,
                         const struct surface_mesh *surface, int bone)
{
    int all = 0, at = 0;
    for (int i = 0; i < surface->point_count; i++)
        all += is_rigid(bind_pose, surface->points[i], bone);
    const int every = all / SAMPLES + 1;
    for (int i = 0; i < surface->point_count; i++)
        if (is_rigid(bind_pose, surface->points[i], bone) && at++ % every == 0)
            samples->of[samples->count++] =
                (struct bone_sample){.point = surface->points[i], .normal = surface->normals[i]};
}

enum status axial_rotation_open(struct axial_rotation **out, const struct bind_pose *bind_pose,
                                const struct surface_mesh *surface, const struct calibration *calibration, int frames)
{
    struct axial_rotation *t = *out = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "no memory for the bones' axial rotation");
    t->bind_pose = bind_pose;
    t->calibration = *calibration;
    t->depth_from_color = pose_inverse(calibration->color_from_depth);
    t->frames = frames;
    t->cost = calloc((size_t)frames, sizeof *t->cost);
    t->seed_score = calloc((size_t)frames, sizeof *t->seed_score);
    if (!t->cost || !t->seed_score) {
        axial_rotation_close(out);
        return fail(ERR_MEMORY, "no memory for the bones' axial rotation");
    }
    for (int b = 0; b < BONE_COUNT; b++)
        if (bind_pose->known[b] && rotation_from_colors(b))
            find_samples(&t->samples[b], bind_pose, surface, b);
    return OK;
}

void axial_rotation_close(struct axial_rotation **rotation)
{
    if (!*rotation)
        return;
    free((*rotation)->cost);
    free((*rotation)->seed_score);
    free(*rotation);
    *rotation = NULL;
}

// A rotation about the bone's axis through its origin; bind-pose axes.
static struct pose axial_pose(const struct bind_pose *bind_pose, int bone, double angle)
{
    const struct bone_frame *f = &bind_pose->frame[bone];
    struct pose rotation = {quat_from_rotation_vector(v3_scale(f->z, angle)), {0, 0, 0}};
    rotation.translation = v3_sub(f->origin, quat_rotate(rotation.rotation, f->origin));
    return rotation;
}

// ---------------------------------------------------------------- the cost of an angle

// What a frame shows where a point of a bone projects at a hypothetical pose.
struct observation {
    const uint8_t *rgb; // of the pixel; NULL: not visible, or depth does not agree
    float off;          // depth cost, 0 to 1; negative: the point is occluded or turned away, no cost
};

static struct observation observe_sample(const struct axial_rotation *rotation,
                                         const struct axial_rotation_frame *frame, int bone,
                                         const struct bone_sample *sample, const struct pose *pose)
{
    struct observation observation = {NULL, -1};
    struct vec3 p = pose_apply(*pose, sample->point), n = quat_rotate(pose->rotation, sample->normal);
    if (-v3_dot(n, p) < MIN_FACING * v3_length(p))
        return observation;
    const bool registered = rotation->calibration.registered;
    const struct depth_frame *depth_frame = frame->depth_frame;
    struct vec3 d = registered ? p : pose_apply(rotation->depth_from_color, p);
    int in_depth = depth_pixel_at(&rotation->calibration.depth, d);
    if (in_depth < 0 || depth_frame->part[in_depth] == DEPTH_FRAME_MIXED)
        return observation;
    double behind = depth_frame->depth[in_depth] * 1e-3 - d.z;
    if (depth_frame->part[in_depth] == DEPTH_FRAME_BACKGROUND ||
        !bones_adjacent(depth_frame->part[in_depth], (int)bone_part(bone))) {
        observation.off = depth_frame->depth[in_depth] && behind > DEPTH_AGREEMENT_M ? 1 : -1;
        return observation;
    }
    if (behind < -DEPTH_AGREEMENT_M)
        return observation;
    observation.off = (float)(behind * behind / (behind * behind + DEPTH_HALF_COST_M * DEPTH_HALF_COST_M));
    int in_color = registered ? in_depth : depth_pixel_at(&rotation->calibration.color, p);
    if (in_color >= 0 && depth_frame->edge_distance[in_depth] >= RIM_PX && behind < DEPTH_AGREEMENT_M)
        observation.rgb = frame->rgb + 3 * (size_t)in_color;
    return observation;
}

static struct pose rotated_pose(const struct axial_rotation *rotation, const struct axial_rotation_frame *frame,
                                int bone, double angle)
{
    return pose_multiply(frame->transforms->bone[bone], axial_pose(rotation->bind_pose, bone, angle));
}

// A point's colour in the frame, and the learned one.
struct color_pair {
    float seen[3], known[3];
};

// The mean cost of the frame if a bone is at `pose`. *count: of the visible points.
static float angle_cost(const struct axial_rotation *rotation, const struct axial_rotation_frame *frame, int bone,
                        const struct pose *pose, int *count)
{
    const struct bone_samples *s = &rotation->samples[bone];
    struct color_pair pairs[SAMPLES];
    float both = 0, own = 0, cost = 0, depth_cost = 0;
    int depth_count = 0, known = 0, unknown = 0;
    for (int i = 0; i < s->count; i++) {
        const struct observation observation = observe_sample(rotation, frame, bone, &s->of[i], pose);
        if (observation.off >= 0)
            depth_cost += observation.off, depth_count++;
        if (!observation.rgb)
            continue;
        if (!(s->of[i].weight > 0)) {
            unknown++;
            continue;
        }
        struct color_pair *p = &pairs[known++];
        for (int c = 0; c < 3; c++) {
            p->seen[c] = (float)observation.rgb[c] / 255;
            p->known[c] = s->of[i].color[c];
            both += p->seen[c] * p->known[c];
            own += p->known[c] * p->known[c];
        }
    }
    const float gain = fminf(fmaxf(own > 0 ? both / own : 1, GAIN_MIN), GAIN_MAX);
    for (int i = 0; i < known; i++) {
        float off2 = 0;
        for (int c = 0; c < 3; c++) {
            float off = pairs[i].seen[c] - gain * pairs[i].known[c];
            off2 += off * off / 3;
        }
        cost += off2 / (off2 + COLOR_OUTLIER * COLOR_OUTLIER);
    }
    *count = known + unknown;
    cost += UNKNOWN_COST * (float)unknown;
    return cost / (float)(*count > 0 ? *count : 1) +
           DEPTH_WEIGHT * depth_cost / (float)(depth_count > 0 ? depth_count : 1);
}

// Of every angle; all 0 where too few points are visible at any of them.
static void angle_costs(const struct axial_rotation *rotation, const struct axial_rotation_frame *frame, int bone,
                        float cost[ANGLES])
{
    int min = SAMPLES;
    for (int k = 0; k < ANGLES && min >= SAMPLES_MIN; k++) {
        int count;
        struct pose pose = rotated_pose(rotation, frame, bone, angle_of(bone, k));
        cost[k] = angle_cost(rotation, frame, bone, &pose, &count);
        min = count < min ? count : min;
    }
    if (min < SAMPLES_MIN)
        memset(cost, 0, sizeof(float) * ANGLES);
}

void axial_rotation_measure(struct axial_rotation *rotation, int i, const struct axial_rotation_frame *frame)
{
    for (int b = 0; b < BONE_COUNT; b++)
        if (rotation->samples[b].count)
            angle_costs(rotation, frame, b, rotation->cost[i][b]);
}

// ---------------------------------------------------------------- probabilities

static void normalize_weights(double *w)
{
    double sum = 0;
    for (int k = 0; k < ANGLES; k++)
        sum += w[k];
    for (int k = 0; k < ANGLES; k++)
        w[k] /= sum;
}

// The motion model: probabilities of a frame's angles from those of its neighbour, `apart_s` away.
static void diffuse_angles(const double *from, double apart_s, int bone, double *to)
{
    const double moved = RATE_RAD_S * fmax(fabs(apart_s), 0.01) / step_of(bone);
    for (int k = 0; k < ANGLES; k++) {
        to[k] = 0;
        for (int j = 0; j < ANGLES; j++)
            to[k] += from[j] * portable_exp(-0.5 * (k - j) * (k - j) / (moved * moved));
    }
    normalize_weights(to);
}

static double prior_sigma_rad(int bone)
{
    switch (bone) {
    case PART_LEFT_THIGH:
    case PART_RIGHT_THIGH: return THIGH_PRIOR_RAD;
    case BONE_SKULL: return HEAD_PRIOR_RAD;
    default: return PRIOR_RAD;
    }
}

// Of each angle: the prior times the likelihood of its cost.
static void angle_likelihood(const float cost[ANGLES], int bone, double own[ANGLES])
{
    const double sigma = prior_sigma_rad(bone);
    const double each =
        0.5 * INDEPENDENT_SAMPLES * (double)(COLOR_OUTLIER * COLOR_OUTLIER) / (COLOR_SIGMA * COLOR_SIGMA);
    for (int k = 0; k < ANGLES; k++) {
        double angle = angle_of(bone, k) / sigma;
        own[k] = portable_exp(-0.5 * angle * angle - each * (double)cost[k]);
    }
    normalize_weights(own);
}

// Learns the colours of the bone's points, with the bone at `pose`: the mean over the frames that show them.
static void update_colors(struct axial_rotation *rotation, const struct axial_rotation_frame *frame, int bone,
                          const struct pose *pose)
{
    for (int i = 0; i < rotation->samples[bone].count; i++) {
        struct bone_sample *s = &rotation->samples[bone].of[i];
        const uint8_t *rgb = observe_sample(rotation, frame, bone, s, pose).rgb;
        if (!rgb)
            continue;
        for (int c = 0; c < 3; c++)
            s->color[c] += ((float)rgb[c] / 255 - s->color[c]) / (s->weight + 1);
        s->weight = fminf(s->weight + 1, MAX_WEIGHT);
    }
}

// The bone whose texture chooses the seed: the skull if known, since hardly anything else differs as much from side to
// side. -1: none. At the seed its angle is taken from the joints, so the seed should be a frame in which people face
// straight ahead: face and trunk's front both show.
static int seed_bone(const struct axial_rotation *rotation)
{
    for (int b = BONE_COUNT - 1; b >= 0; b--)
        if (rotation->samples[b].count)
            return b;
    return -1;
}

// The texture that a frame shows of a bone: the sum of squared deviations from the mean colour, bytes.
static double color_variance(const struct axial_rotation *rotation, const struct axial_rotation_frame *frame, int bone)
{
    double sum[3] = {0}, square = 0;
    int count = 0;
    for (int k = 0; k < rotation->samples[bone].count; k++) {
        const uint8_t *rgb =
            observe_sample(rotation, frame, bone, &rotation->samples[bone].of[k], &frame->transforms->bone[bone]).rgb;
        if (!rgb)
            continue;
        for (int c = 0; c < 3; c++) {
            sum[c] += rgb[c];
            square += (double)rgb[c] * rgb[c];
        }
        count++;
    }
    return count ? square - (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / count : 0;
}

// Cosine between the bone's front and the direction to the camera.
static double facing_cosine(const struct axial_rotation *rotation, int bone, const struct pose *pose)
{
    const struct vec3 front = quat_rotate(pose->rotation, (struct vec3){0, 0, -1});
    const struct vec3 at = pose_apply(*pose, rotation->bind_pose->frame[bone].origin);
    return -v3_dot(front, at) / fmax(v3_length(at), DBL_MIN);
}

void axial_rotation_score_seed(struct axial_rotation *rotation, int i, const struct axial_rotation_frame *frame)
{
    const int bone = seed_bone(rotation);
    if (bone >= 0)
        rotation->seed_score[i] = color_variance(rotation, frame, bone) *
                                  fmax(facing_cosine(rotation, bone, &frame->transforms->bone[bone]), 0);
}

int axial_rotation_order(const struct axial_rotation *rotation, int nth)
{
    int first = 0;
    for (int i = 1; i < rotation->frames; i++)
        first = rotation->seed_score[i] > rotation->seed_score[first] ? i : first;
    return first + nth < rotation->frames ? first + nth : rotation->frames - 1 - nth;
}

void axial_rotation_track(struct axial_rotation *rotation, const struct axial_rotation_frame *frame)
{
    if (rotation->tracking && frame->time_s < rotation->first.time_s && rotation->last.time_s > rotation->first.time_s)
        rotation->last = rotation->first; // the second half: from the seed to the beginning
    for (int b = 0; b < BONE_COUNT; b++) {
        if (!rotation->samples[b].count)
            continue;
        float cost[ANGLES];
        double posterior[ANGLES], angle = 0;
        angle_costs(rotation, frame, b, cost);
        angle_likelihood(cost, b, posterior);
        if (rotation->tracking) {
            double likelihood[ANGLES];
            memcpy(likelihood, posterior, sizeof likelihood);
            diffuse_angles(rotation->last.of[b], frame->time_s - rotation->last.time_s, b, posterior);
            for (int k = 0; k < ANGLES; k++)
                posterior[k] *= likelihood[k];
            normalize_weights(posterior);
        }
        for (int k = 0; k < ANGLES; k++)
            angle += posterior[k] * angle_of(b, k);
        memcpy(rotation->last.of[b], posterior, sizeof posterior);
        struct pose pose = rotated_pose(rotation, frame, b, angle);
        update_colors(rotation, frame, b, &pose);
    }
    rotation->last.time_s = frame->time_s;
    if (!rotation->tracking)
        rotation->first = rotation->last;
    rotation->tracking = true;
}

// Forward-backward smoothing; angle: of each frame, the mean of its posterior. forward: scratch, one row a frame.
static void smooth_angles(const struct axial_rotation *rotation, int bone, const double *time_s,
                          double (*forward)[ANGLES], double *angle)
{
    double likelihood[ANGLES], now[ANGLES], backward[ANGLES];
    for (int i = 0; i < rotation->frames; i++) {
        for (int k = 0; k < ANGLES; k++)
            forward[i][k] = 1;
        if (i > 0) {
            angle_likelihood(rotation->cost[i - 1][bone], bone, likelihood);
            for (int k = 0; k < ANGLES; k++)
                now[k] = forward[i - 1][k] * likelihood[k];
            diffuse_angles(now, time_s[i] - time_s[i - 1], bone, forward[i]);
        }
    }
    for (int k = 0; k < ANGLES; k++)
        backward[k] = 1;
    for (int i = rotation->frames - 1; i >= 0; i--) {
        double sum = 0;
        angle_likelihood(rotation->cost[i][bone], bone, likelihood);
        angle[i] = 0;
        for (int k = 0; k < ANGLES; k++) {
            now[k] = likelihood[k] * backward[k];
            sum += now[k] * forward[i][k];
            angle[i] += now[k] * forward[i][k] * angle_of(bone, k);
        }
        angle[i] /= sum;
        if (i > 0)
            diffuse_angles(now, time_s[i] - time_s[i - 1], bone, backward);
    }
}

enum status axial_rotation_apply(const struct axial_rotation *rotation, const double *time_s,
                                 struct bone_corrections *frame_corrections)
{
    double(*forward)[ANGLES] = malloc(sizeof *forward * (size_t)rotation->frames);
    double *angle = malloc(sizeof *angle * (size_t)rotation->frames);
    enum status status = forward && angle ? OK : fail(ERR_MEMORY, "no memory for the bones' axial rotation");
    for (int b = 0; b < BONE_COUNT && status == OK; b++) {
        if (!rotation->samples[b].count)
            continue;
        smooth_angles(rotation, b, time_s, forward, angle);
        for (int i = 0; i < rotation->frames; i++)
            frame_corrections[i].bone[b] =
                pose_multiply(frame_corrections[i].bone[b], axial_pose(rotation->bind_pose, b, angle[i]));
    }
    free(forward);
    free(angle);
    return status;
}
