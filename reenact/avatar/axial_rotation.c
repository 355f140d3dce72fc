#include "reenact/avatar/axial_rotation.h"
#include "base/portable_math.h"

#include "reenact/observation/depth_frame.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { ANGLES = 25, SAMPLES = 600, SAMPLES_LEAST = 20, RIM_PX = 1 };

// Tuned by hand on three takes of docs/results.md: dance, the small world's dancer, and the filmed man.
static const double STEP_RAD = 0.05, HEAD_STEP_RAD = 0.125; // between neighbouring angles
// Standard deviations of the angle that joints and depth give:
static const double PRIOR_RAD = 0.3;
static const double THIGH_PRIOR_RAD = 0.15;   // of a thigh, since a bent knee shows it
static const double HEAD_PRIOR_RAD = 0.5;     // of a head, which turns against the trunk
static const double RATE_RAD_S = 2;           // and of the change of its error in a second
static const double LEAST_FACING = 0.3;       // cosine towards the camera
static const double DEPTH_HALF_COST_M = 0.02; // a depth sample this far behind a point costs a half
static const float COLOR_OUTLIER = 0.15F;     // scale of the robust colour cost; gamma-encoded, 0 to 1
static const float UNKNOWN_COST = 0.35F;      // of 1: of a visible point whose colour is not learned yet
static const float DEPTH_WEIGHT = 0.5F;       // of the depth cost against the colours', as the shape is still coarse
static const double COLOR_SIGMA = 0.06;       // standard deviation of equal colours' difference
static const double INDEPENDENT_SAMPLES = 20; // of a bone, at most: colour errors of neighbours are correlated
static const float GAIN_LEAST = 0.7F, GAIN_MOST = 1.4F; // of a bone's brightness against the learned one
static const float MOST_WEIGHT = 20;                    // of a learned colour, in frames

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

static void find_samples(struct bone_samples *s, const struct bind_pose *bind_pose, const struct surface_mesh *surface,
                         int bone)
{
    int all = 0, at = 0;
    for (int i = 0; i < surface->point_count; i++)
        all += is_rigid(bind_pose, surface->points[i], bone);
    const int every = all / SAMPLES + 1;
    for (int i = 0; i < surface->point_count; i++)
        if (is_rigid(bind_pose, surface->points[i], bone) && at++ % every == 0)
            s->of[s->count++] = (struct bone_sample){.point = surface->points[i], .normal = surface->normals[i]};
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

void axial_rotation_close(struct axial_rotation **t)
{
    if (!*t)
        return;
    free((*t)->cost);
    free((*t)->seed_score);
    free(*t);
    *t = NULL;
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

static struct observation observe(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                                  const struct bone_sample *sample, const struct pose *pose)
{
    struct observation observation = {NULL, -1};
    struct vec3 p = pose_apply(*pose, sample->point), n = quat_rotate(pose->rotation, sample->normal);
    if (-v3_dot(n, p) < LEAST_FACING * v3_length(p))
        return observation;
    const bool registered = t->calibration.registered;
    const struct depth_frame *s = frame->depth_frame;
    struct vec3 d = registered ? p : pose_apply(t->depth_from_color, p);
    int in_depth = depth_pixel_at(&t->calibration.depth, d);
    if (in_depth < 0 || s->part[in_depth] == DEPTH_FRAME_MIXED)
        return observation;
    double behind = s->depth[in_depth] * 1e-3 - d.z;
    if (s->part[in_depth] == DEPTH_FRAME_BACKGROUND || !bones_adjacent(s->part[in_depth], (int)bone_part(bone))) {
        observation.off = s->depth[in_depth] && behind > DEPTH_AGREEMENT_M ? 1 : -1;
        return observation;
    }
    if (behind < -DEPTH_AGREEMENT_M)
        return observation;
    observation.off = (float)(behind * behind / (behind * behind + DEPTH_HALF_COST_M * DEPTH_HALF_COST_M));
    int in_color = registered ? in_depth : depth_pixel_at(&t->calibration.color, p);
    if (in_color >= 0 && s->edge_distance[in_depth] >= RIM_PX && behind < DEPTH_AGREEMENT_M)
        observation.rgb = frame->rgb + 3 * (size_t)in_color;
    return observation;
}

static struct pose rotated_pose(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                                double angle)
{
    return pose_multiply(frame->transforms->bone[bone], axial_pose(t->bind_pose, bone, angle));
}

// A point's colour in the frame, and the learned one.
struct color_pair {
    float seen[3], known[3];
};

// The mean cost of the frame if a bone is at `pose`. *count: of the visible points.
static float angle_cost(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                        const struct pose *pose, int *count)
{
    const struct bone_samples *s = &t->samples[bone];
    struct color_pair pairs[SAMPLES];
    float both = 0, own = 0, cost = 0, depth_cost = 0;
    int depth_count = 0, known = 0, unknown = 0;
    for (int i = 0; i < s->count; i++) {
        const struct observation observation = observe(t, frame, bone, &s->of[i], pose);
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
    const float gain = fminf(fmaxf(own > 0 ? both / own : 1, GAIN_LEAST), GAIN_MOST);
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
static void angle_costs(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                        float cost[ANGLES])
{
    int least = SAMPLES;
    for (int k = 0; k < ANGLES && least >= SAMPLES_LEAST; k++) {
        int count;
        struct pose pose = rotated_pose(t, frame, bone, angle_of(bone, k));
        cost[k] = angle_cost(t, frame, bone, &pose, &count);
        least = count < least ? count : least;
    }
    if (least < SAMPLES_LEAST)
        memset(cost, 0, sizeof(float) * ANGLES);
}

void axial_rotation_measure(struct axial_rotation *t, int i, const struct axial_rotation_frame *frame)
{
    for (int b = 0; b < BONE_COUNT; b++)
        if (t->samples[b].count)
            angle_costs(t, frame, b, t->cost[i][b]);
}

// ---------------------------------------------------------------- probabilities

static void normalize(double *w)
{
    double sum = 0;
    for (int k = 0; k < ANGLES; k++)
        sum += w[k];
    for (int k = 0; k < ANGLES; k++)
        w[k] /= sum;
}

// The motion model: probabilities of a frame's angles from those of its neighbour, `apart_s` away.
static void diffuse(const double *from, double apart_s, int bone, double *to)
{
    const double moved = RATE_RAD_S * fmax(fabs(apart_s), 0.01) / step_of(bone);
    for (int k = 0; k < ANGLES; k++) {
        to[k] = 0;
        for (int j = 0; j < ANGLES; j++)
            to[k] += from[j] * portable_exp(-0.5 * (k - j) * (k - j) / (moved * moved));
    }
    normalize(to);
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
    normalize(own);
}

// Learns the colours of the bone's points, with the bone at `pose`: the mean over the frames that show them.
static void update_colors(struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                          const struct pose *pose)
{
    for (int i = 0; i < t->samples[bone].count; i++) {
        struct bone_sample *s = &t->samples[bone].of[i];
        const uint8_t *rgb = observe(t, frame, bone, s, pose).rgb;
        if (!rgb)
            continue;
        for (int c = 0; c < 3; c++)
            s->color[c] += ((float)rgb[c] / 255 - s->color[c]) / (s->weight + 1);
        s->weight = fminf(s->weight + 1, MOST_WEIGHT);
    }
}

// The bone whose texture chooses the seed: the skull if known, since hardly anything else differs as much from side to
// side. -1: none. At the seed its angle is taken from the joints, so the seed should be a frame in which people face
// straight ahead: face and trunk's front both show.
static int seed_bone(const struct axial_rotation *t)
{
    for (int b = BONE_COUNT - 1; b >= 0; b--)
        if (t->samples[b].count)
            return b;
    return -1;
}

// The texture that a frame shows of a bone: the sum of squared deviations from the mean colour, bytes.
static double color_variance(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone)
{
    double sum[3] = {0}, square = 0;
    int count = 0;
    for (int k = 0; k < t->samples[bone].count; k++) {
        const uint8_t *rgb = observe(t, frame, bone, &t->samples[bone].of[k], &frame->transforms->bone[bone]).rgb;
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
static double facing(const struct axial_rotation *t, int bone, const struct pose *pose)
{
    const struct vec3 front = quat_rotate(pose->rotation, (struct vec3){0, 0, -1});
    const struct vec3 at = pose_apply(*pose, t->bind_pose->frame[bone].origin);
    return -v3_dot(front, at) / fmax(v3_length(at), DBL_MIN);
}

void axial_rotation_score_seed(struct axial_rotation *t, int i, const struct axial_rotation_frame *frame)
{
    const int bone = seed_bone(t);
    if (bone >= 0)
        t->seed_score[i] = color_variance(t, frame, bone) * fmax(facing(t, bone, &frame->transforms->bone[bone]), 0);
}

int axial_rotation_order(const struct axial_rotation *t, int nth)
{
    int first = 0;
    for (int i = 1; i < t->frames; i++)
        first = t->seed_score[i] > t->seed_score[first] ? i : first;
    return first + nth < t->frames ? first + nth : t->frames - 1 - nth;
}

void axial_rotation_track(struct axial_rotation *t, const struct axial_rotation_frame *frame)
{
    if (t->tracking && frame->time_s < t->first.time_s && t->last.time_s > t->first.time_s)
        t->last = t->first; // the second half: from the seed to the beginning
    for (int b = 0; b < BONE_COUNT; b++) {
        if (!t->samples[b].count)
            continue;
        float cost[ANGLES];
        double posterior[ANGLES], angle = 0;
        angle_costs(t, frame, b, cost);
        angle_likelihood(cost, b, posterior);
        if (t->tracking) {
            double likelihood[ANGLES];
            memcpy(likelihood, posterior, sizeof likelihood);
            diffuse(t->last.of[b], frame->time_s - t->last.time_s, b, posterior);
            for (int k = 0; k < ANGLES; k++)
                posterior[k] *= likelihood[k];
            normalize(posterior);
        }
        for (int k = 0; k < ANGLES; k++)
            angle += posterior[k] * angle_of(b, k);
        memcpy(t->last.of[b], posterior, sizeof posterior);
        struct pose pose = rotated_pose(t, frame, b, angle);
        update_colors(t, frame, b, &pose);
    }
    t->last.time_s = frame->time_s;
    if (!t->tracking)
        t->first = t->last;
    t->tracking = true;
}

// Forward-backward smoothing; angle: of each frame, the mean of its posterior. forward: scratch, one row a frame.
static void smooth_angles(const struct axial_rotation *t, int bone, const double *time_s, double (*forward)[ANGLES],
                          double *angle)
{
    double likelihood[ANGLES], now[ANGLES], backward[ANGLES];
    for (int i = 0; i < t->frames; i++) {
        for (int k = 0; k < ANGLES; k++)
            forward[i][k] = 1;
        if (i > 0) {
            angle_likelihood(t->cost[i - 1][bone], bone, likelihood);
            for (int k = 0; k < ANGLES; k++)
                now[k] = forward[i - 1][k] * likelihood[k];
            diffuse(now, time_s[i] - time_s[i - 1], bone, forward[i]);
        }
    }
    for (int k = 0; k < ANGLES; k++)
        backward[k] = 1;
    for (int i = t->frames - 1; i >= 0; i--) {
        double sum = 0;
        angle_likelihood(t->cost[i][bone], bone, likelihood);
        angle[i] = 0;
        for (int k = 0; k < ANGLES; k++) {
            now[k] = likelihood[k] * backward[k];
            sum += now[k] * forward[i][k];
            angle[i] += now[k] * forward[i][k] * angle_of(bone, k);
        }
        angle[i] /= sum;
        if (i > 0)
            diffuse(now, time_s[i] - time_s[i - 1], bone, backward);
    }
}

enum status axial_rotation_apply(const struct axial_rotation *t, const double *time_s,
                                 struct bone_corrections *frame_corrections)
{
    double(*forward)[ANGLES] = malloc(sizeof *forward * (size_t)t->frames);
    double *angle = malloc(sizeof *angle * (size_t)t->frames);
    enum status status = forward && angle ? OK : fail(ERR_MEMORY, "no memory for the bones' axial rotation");
    for (int b = 0; b < BONE_COUNT && status == OK; b++) {
        if (!t->samples[b].count)
            continue;
        smooth_angles(t, b, time_s, forward, angle);
        for (int i = 0; i < t->frames; i++)
            frame_corrections[i].bone[b] =
                pose_multiply(frame_corrections[i].bone[b], axial_pose(t->bind_pose, b, angle[i]));
    }
    free(forward);
    free(angle);
    return status;
}
