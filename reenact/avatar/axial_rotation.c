#include "reenact/avatar/axial_rotation.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { ANGLES = 25, SAMPLES = 600, SAMPLES_LEAST = 20, RIM_PX = 1 };

static const double STEP_RAD = 0.05, HEAD_STEP_RAD = 0.125; // between one turn that is tried and the next
static const double PRIOR_RAD = 0.3;                        // joints and depth are right to this
static const double THIGH_PRIOR_RAD = 0.15;                 // of a thigh: a bent knee tells
static const double HEAD_PRIOR_RAD = 0.5;                   // of a head, that is turned against the trunk
static const double RATE_RAD_S = 2;                         // and wrong by so much more or less after a second
static const double LEAST_FACING = 0.3;                     // cosine towards the camera
static const double DEPTH_AGREEMENT_M = 0.05;               // the reading that confirms a place lies this near
static const double DEPTH_HALF_COST_M = 0.02;               // and who is so far off is half somebody else
static const float COLOR_OUTLIER = 0.15F; // of colours from 0 to 1: who is farther off is somebody else
static const float UNKNOWN_COST = 0.35F;  // so cost is, of 1, what is seen of a place that nothing was learned of yet
static const float DEPTH_WEIGHT = 0.5F;   // counts for so much of what colours do: the shape is none of the best yet
static const double COLOR_SIGMA = 0.06;   // colours that are the same differ by this,
static const double INDEPENDENT_SAMPLES = 20; // and as they wander together, a part's count as no more than these
static const float GAIN_LEAST = 0.7F, GAIN_MOST = 1.4F; // a part may be lit so much less or more than it was
static const float MOST_WEIGHT = 20;                    // of what was learned of a place, in frames

// A place of one bone's surface that goes with it alone, and what was learned of its colour.
struct bone_sample {
    struct vec3 point, normal; // bind-pose axes
    float color[3], weight;    // sRGB, 0 to 1
};

struct bone_samples {
    struct bone_sample of[SAMPLES];
    int count;
};

// How likely a frame's rotations are, by what was followed until then.
struct angle_posterior {
    double of[BONE_COUNT][ANGLES];
    double time_s;
};

struct axial_rotation {
    const struct bind_pose *bind_pose;
    struct calibration calibration;
    struct pose depth_from_color;
    struct bone_samples samples[BONE_COUNT];
    struct angle_posterior first, last; // of the frames that were followed
    bool tracking;
    int frames;
    double *seed_score;                // of each frame: how well it says how what leads is turned
    float (*cost)[BONE_COUNT][ANGLES]; // of each frame: the share of a bone's places whose colours are others
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
        return fail(ERR_MEMORY, "out of memory");
    t->bind_pose = bind_pose;
    t->calibration = *calibration;
    t->depth_from_color = pose_inverse(calibration->color_from_depth);
    t->frames = frames;
    t->cost = calloc((size_t)frames, sizeof *t->cost);
    t->seed_score = calloc((size_t)frames, sizeof *t->seed_score);
    if (!t->cost || !t->seed_score) {
        axial_rotation_close(out);
        return fail(ERR_MEMORY, "out of memory");
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

// The bone turned about itself, in bind-pose axes.
static struct pose axial_turn(const struct bind_pose *bind_pose, int bone, double angle)
{
    const struct bone_frame *f = &bind_pose->frame[bone];
    struct pose turn = {quat_from_rotation_vector(v3_scale(f->z, angle)), {0, 0, 0}};
    turn.translation = v3_sub(f->origin, quat_rotate(turn.rotation, f->origin));
    return turn;
}

// ---------------------------------------------------------------- what a frame says

static int pixel_at(const struct lens *lens, struct vec3 p)
{
    if (!(p.z > 0.05))
        return -1;
    struct pixel px = lens_project(lens, p);
    int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
    return x < 0 || y < 0 || x >= lens->width || y >= lens->height ? -1 : y * lens->width + x;
}

// What a frame shows where a place of a bone would be.
struct observation {
    const uint8_t *rgb; // of the pixel; NULL: no surface that could be this place
    float off;          // 0 to 1: how far what is seen there is from it; negative: something else hides the place
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
    int in_depth = pixel_at(&t->calibration.depth, d);
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
    int in_color = registered ? in_depth : pixel_at(&t->calibration.color, p);
    if (in_color >= 0 && s->edge_distance[in_depth] >= RIM_PX && behind < DEPTH_AGREEMENT_M)
        observation.rgb = frame->rgb + 3 * (size_t)in_color;
    return observation;
}

static struct pose rotated_pose(const struct axial_rotation *t, const struct axial_rotation_frame *frame, int bone,
                                double angle)
{
    return pose_multiply(frame->transforms->bone[bone], axial_turn(t->bind_pose, bone, angle));
}

// Colours that a frame shows where others are known.
struct color_pair {
    float seen[3], known[3];
};

// How cost the frame is if a bone is at `pose`: 0 to 1. *count: of the places that it shows.
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
    const float light = fminf(fmaxf(own > 0 ? both / own : 1, GAIN_LEAST), GAIN_MOST);
    for (int i = 0; i < known; i++) {
        float off2 = 0;
        for (int c = 0; c < 3; c++) {
            float off = pairs[i].seen[c] - light * pairs[i].known[c];
            off2 += off * off / 3;
        }
        cost += off2 / (off2 + COLOR_OUTLIER * COLOR_OUTLIER);
    }
    *count = known + unknown;
    cost += UNKNOWN_COST * (float)unknown;
    return cost / (float)(*count > 0 ? *count : 1) +
           DEPTH_WEIGHT * depth_cost / (float)(depth_count > 0 ? depth_count : 1);
}

// Of every turn; all alike where too few places are seen to say anything.
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

// ---------------------------------------------------------------- frames together

static void normalize(double *w)
{
    double sum = 0;
    for (int k = 0; k < ANGLES; k++)
        sum += w[k];
    for (int k = 0; k < ANGLES; k++)
        w[k] /= sum;
}

// What is worth how much at a frame, if at its neighbour, `apart_s` away, it is so much.
static void diffuse(const double *from, double apart_s, int bone, double *to)
{
    const double moved = RATE_RAD_S * fmax(fabs(apart_s), 0.01) / step_of(bone);
    for (int k = 0; k < ANGLES; k++) {
        to[k] = 0;
        for (int j = 0; j < ANGLES; j++)
            to[k] += from[j] * exp(-0.5 * (k - j) * (k - j) / (moved * moved));
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

static void angle_likelihood(const float cost[ANGLES], int bone, double own[ANGLES])
{
    const double known = prior_sigma_rad(bone);
    const double each =
        0.5 * INDEPENDENT_SAMPLES * (double)(COLOR_OUTLIER * COLOR_OUTLIER) / (COLOR_SIGMA * COLOR_SIGMA);
    for (int k = 0; k < ANGLES; k++) {
        double angle = angle_of(bone, k) / known;
        own[k] = exp(-0.5 * angle * angle - each * (double)cost[k]);
    }
    normalize(own);
}

// Of the bone at `pose`: each place's mean over the frames that saw it.
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

// Whose colours say where to begin: the skull's if it is there, for hardly anything else differs as much from side to
// side. -1: nothing's. How it is turned there is taken from the joints, so that ought to be where people face straight
// ahead: the face shows, and the trunk's front does.
static int seed_bone(const struct axial_rotation *t)
{
    for (int b = BONE_COUNT - 1; b >= 0; b--)
        if (t->samples[b].count)
            return b;
    return -1;
}

// How much the colours differ that a frame shows of a bone: summed squares, of 255.
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

// Cosine between where the bone's front points and the way to the camera.
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
        t->last = t->first; // from there on to the beginning
    for (int b = 0; b < BONE_COUNT; b++) {
        if (!t->samples[b].count)
            continue;
        float cost[ANGLES];
        double before[ANGLES], angle = 0;
        angle_costs(t, frame, b, cost);
        angle_likelihood(cost, b, before);
        if (t->tracking) {
            double own[ANGLES];
            memcpy(own, before, sizeof own);
            diffuse(t->last.of[b], frame->time_s - t->last.time_s, b, before);
            for (int k = 0; k < ANGLES; k++)
                before[k] *= own[k];
            normalize(before);
        }
        for (int k = 0; k < ANGLES; k++)
            angle += before[k] * angle_of(b, k);
        memcpy(t->last.of[b], before, sizeof before);
        struct pose pose = rotated_pose(t, frame, b, angle);
        update_colors(t, frame, b, &pose);
    }
    t->last.time_s = frame->time_s;
    if (!t->tracking)
        t->first = t->last;
    t->tracking = true;
}

// The mean of what is likely, of each frame.
static void smooth_angles(const struct axial_rotation *t, int bone, const double *time_s, double (*before)[ANGLES],
                          double *angle)
{
    double own[ANGLES], now[ANGLES], behind[ANGLES];
    for (int i = 0; i < t->frames; i++) {
        for (int k = 0; k < ANGLES; k++)
            before[i][k] = 1;
        if (i > 0) {
            angle_likelihood(t->cost[i - 1][bone], bone, own);
            for (int k = 0; k < ANGLES; k++)
                now[k] = before[i - 1][k] * own[k];
            diffuse(now, time_s[i] - time_s[i - 1], bone, before[i]);
        }
    }
    for (int k = 0; k < ANGLES; k++)
        behind[k] = 1;
    for (int i = t->frames - 1; i >= 0; i--) {
        double sum = 0;
        angle_likelihood(t->cost[i][bone], bone, own);
        angle[i] = 0;
        for (int k = 0; k < ANGLES; k++) {
            now[k] = own[k] * behind[k];
            sum += now[k] * before[i][k];
            angle[i] += now[k] * before[i][k] * angle_of(bone, k);
        }
        angle[i] /= sum;
        if (i > 0)
            diffuse(now, time_s[i] - time_s[i - 1], bone, behind);
    }
}

enum status axial_rotation_apply(const struct axial_rotation *t, const double *time_s,
                                 struct bone_corrections *frame_corrections)
{
    double(*before)[ANGLES] = malloc(sizeof *before * (size_t)t->frames);
    double *angle = malloc(sizeof *angle * (size_t)t->frames);
    enum status status = before && angle ? OK : fail(ERR_MEMORY, "out of memory");
    for (int b = 0; b < BONE_COUNT && status == OK; b++) {
        if (!t->samples[b].count)
            continue;
        smooth_angles(t, b, time_s, before, angle);
        for (int i = 0; i < t->frames; i++)
            frame_corrections[i].bone[b] =
                pose_multiply(frame_corrections[i].bone[b], axial_turn(t->bind_pose, b, angle[i]));
    }
    free(before);
    free(angle);
    return status;
}
