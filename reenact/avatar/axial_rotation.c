#include "reenact/avatar/axial_rotation.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { TRIED = 25, SAMPLES = 600, LEAST_SEEN = 20, RIM_PX = 1 };

static const double STEP_RAD = 0.05, HEAD_STEP_RAD = 0.125; // between one turn that is tried and the next
static const double KNOWN_RAD = 0.3;                        // joints and depth are right to this
static const double THIGH_KNOWN_RAD = 0.15;                 // of a thigh: a bent knee tells
static const double HEAD_KNOWN_RAD = 0.5;                   // of a head, that is turned against the trunk
static const double RATE_RAD_S = 2;                         // and wrong by so much more or less after a second
static const double LEAST_FACING = 0.3;                     // cosine towards the camera
static const double NEAR_M = 0.05;                          // the reading that vouches for a place lies this near
static const double OFF_M = 0.02;                           // and who is so far off is half somebody else
static const float ODD = 0.15F;     // of colours from 0 to 1: who is farther off is somebody else
static const float UNKNOWN = 0.35F; // so odd is, of 1, what is seen of a place that nothing was learned of yet
static const float DEPTH = 0.5F;    // counts for so much of what colours do: the shape is none of the best yet
static const double COLOR = 0.06;   // colours that are the same differ by this,
static const double READINGS = 20;  // and as they wander together, a part's count as no more than these
static const float DIM = 0.7F, BRIGHT = 1.4F; // a part may be lit so much less or more than it was
static const float MOST_WEIGHT = 20;          // of what was learned of a place, in frames

// A place of one bone's surface that goes with it alone, and what was learned of its colour.
struct sample {
    struct vec3 point, normal; // rest axes
    float color[3], weight;    // sRGB, 0 to 1
};

struct samples {
    struct sample of[SAMPLES];
    int count;
};

// How likely a frame's turns are, by what was followed until then.
struct belief {
    double of[BONE_COUNT][TRIED];
    double time_s;
};

struct turns {
    const struct rest *rest;
    struct calibration calibration;
    struct pose depth_from_color;
    struct samples samples[BONE_COUNT];
    struct belief first, last; // of the frames that were followed
    bool following;
    int frames;
    double *telling;                 // of each frame: how well it says how what leads is turned
    float (*odd)[BONE_COUNT][TRIED]; // of each frame: the share of a bone's places whose colours are others
};

static double step_of(int bone) { return bone == BONE_SKULL ? HEAD_STEP_RAD : STEP_RAD; }
static double angle_of(int bone, int k) { return (k - TRIED / 2) * step_of(bone); }

static bool goes_alone(const struct rest *rest, struct vec3 point, int bone)
{
    const struct skin skin = rest_skin(rest, point);
    return skin.bone[0] == bone && skin.weight[0] > 0.8F;
}

static void find_samples(struct samples *s, const struct rest *rest, const struct surface *surface, int bone)
{
    int all = 0, at = 0;
    for (int i = 0; i < surface->point_count; i++)
        all += goes_alone(rest, surface->points[i], bone);
    const int every = all / SAMPLES + 1;
    for (int i = 0; i < surface->point_count; i++)
        if (goes_alone(rest, surface->points[i], bone) && at++ % every == 0)
            s->of[s->count++] = (struct sample){.point = surface->points[i], .normal = surface->normals[i]};
}

enum status turns_open(struct turns **out, const struct rest *rest, const struct surface *surface,
                       const struct calibration *calibration, int frames)
{
    struct turns *t = *out = calloc(1, sizeof *t);
    if (!t)
        return fail(ERR_MEMORY, "out of memory");
    t->rest = rest;
    t->calibration = *calibration;
    t->depth_from_color = calibration->registered ? POSE_IDENTITY : pose_inverse(calibration->color_from_depth);
    t->frames = frames;
    t->odd = calloc((size_t)frames, sizeof *t->odd);
    t->telling = calloc((size_t)frames, sizeof *t->telling);
    if (!t->odd || !t->telling) {
        turns_close(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int b = 0; b < BONE_COUNT; b++)
        if (rest->known[b] && turned_by_colors(b))
            find_samples(&t->samples[b], rest, surface, b);
    return OK;
}

void turns_close(struct turns **t)
{
    if (!*t)
        return;
    free((*t)->odd);
    free((*t)->telling);
    free(*t);
    *t = NULL;
}

// The bone turned about itself, in rest axes.
static struct pose turned_by(const struct rest *rest, int bone, double angle)
{
    const struct part_frame *f = &rest->frame[bone];
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
struct look {
    const uint8_t *rgb; // of the pixel; NULL: no surface that could be this place
    float off;          // 0 to 1: how far what is seen there is from it; negative: something else hides the place
};

static struct look look_at(const struct turns *t, const struct turns_frame *frame, int bone,
                           const struct sample *sample, const struct pose *pose)
{
    struct look look = {NULL, -1};
    struct vec3 p = pose_apply(*pose, sample->point), n = quat_rotate(pose->rotation, sample->normal);
    if (-v3_dot(n, p) < LEAST_FACING * v3_length(p))
        return look;
    const bool registered = t->calibration.registered;
    const struct sight *s = frame->sight;
    struct vec3 d = registered ? p : pose_apply(t->depth_from_color, p);
    int in_depth = pixel_at(&t->calibration.depth, d);
    if (in_depth < 0 || s->part[in_depth] == SIGHT_RIM)
        return look;
    double behind = s->depth[in_depth] * 1e-3 - d.z;
    if (s->part[in_depth] == SIGHT_ROOM || !bones_meet(s->part[in_depth], (int)bone_part(bone))) {
        look.off = s->depth[in_depth] && behind > NEAR_M ? 1 : -1;
        return look;
    }
    if (behind < -NEAR_M)
        return look;
    look.off = (float)(behind * behind / (behind * behind + OFF_M * OFF_M));
    int in_color = registered ? in_depth : pixel_at(&t->calibration.color, p);
    if (in_color >= 0 && s->edge[in_depth] >= RIM_PX && behind < NEAR_M)
        look.rgb = frame->rgb + 3 * (size_t)in_color;
    return look;
}

static struct pose turned_pose(const struct turns *t, const struct turns_frame *frame, int bone, double angle)
{
    return pose_multiply(frame->posture->bone[bone], turned_by(t->rest, bone, angle));
}

// Colours that a frame shows where others are known.
struct pair {
    float seen[3], known[3];
};

// How odd the frame is if a bone is at `pose`: 0 to 1. *count: of the places that it shows.
static float odd_at(const struct turns *t, const struct turns_frame *frame, int bone, const struct pose *pose,
                    int *count)
{
    const struct samples *s = &t->samples[bone];
    struct pair pairs[SAMPLES];
    float both = 0, own = 0, odd = 0, beside = 0;
    int asked = 0, known = 0, unknown = 0;
    for (int i = 0; i < s->count; i++) {
        const struct look look = look_at(t, frame, bone, &s->of[i], pose);
        if (look.off >= 0)
            beside += look.off, asked++;
        if (!look.rgb)
            continue;
        if (!(s->of[i].weight > 0)) {
            unknown++;
            continue;
        }
        struct pair *p = &pairs[known++];
        for (int c = 0; c < 3; c++) {
            p->seen[c] = (float)look.rgb[c] / 255;
            p->known[c] = s->of[i].color[c];
            both += p->seen[c] * p->known[c];
            own += p->known[c] * p->known[c];
        }
    }
    const float light = fminf(fmaxf(own > 0 ? both / own : 1, DIM), BRIGHT);
    for (int i = 0; i < known; i++) {
        float off2 = 0;
        for (int c = 0; c < 3; c++) {
            float off = pairs[i].seen[c] - light * pairs[i].known[c];
            off2 += off * off / 3;
        }
        odd += off2 / (off2 + ODD * ODD);
    }
    *count = known + unknown;
    odd += UNKNOWN * (float)unknown;
    return odd / (float)(*count > 0 ? *count : 1) + DEPTH * beside / (float)(asked > 0 ? asked : 1);
}

// Of every turn; all alike where too few places are seen to say anything.
static void odd_turns(const struct turns *t, const struct turns_frame *frame, int bone, float odd[TRIED])
{
    int least = SAMPLES;
    for (int k = 0; k < TRIED && least >= LEAST_SEEN; k++) {
        int count;
        struct pose pose = turned_pose(t, frame, bone, angle_of(bone, k));
        odd[k] = odd_at(t, frame, bone, &pose, &count);
        least = count < least ? count : least;
    }
    if (least < LEAST_SEEN)
        memset(odd, 0, sizeof(float) * TRIED);
}

void turns_measure(struct turns *t, int i, const struct turns_frame *frame)
{
    for (int b = 0; b < BONE_COUNT; b++)
        if (t->samples[b].count)
            odd_turns(t, frame, b, t->odd[i][b]);
}

// ---------------------------------------------------------------- frames together

static void to_one(double *w)
{
    double sum = 0;
    for (int k = 0; k < TRIED; k++)
        sum += w[k];
    for (int k = 0; k < TRIED; k++)
        w[k] /= sum;
}

// What is worth how much at a frame, if at its neighbour, `apart_s` away, it is so much.
static void pass_on(const double *from, double apart_s, int bone, double *to)
{
    const double moved = RATE_RAD_S * fmax(fabs(apart_s), 0.01) / step_of(bone);
    for (int k = 0; k < TRIED; k++) {
        to[k] = 0;
        for (int j = 0; j < TRIED; j++)
            to[k] += from[j] * exp(-0.5 * (k - j) * (k - j) / (moved * moved));
    }
    to_one(to);
}

static double known_rad(int bone)
{
    switch (bone) {
    case PART_LEFT_THIGH:
    case PART_RIGHT_THIGH: return THIGH_KNOWN_RAD;
    case BONE_SKULL: return HEAD_KNOWN_RAD;
    default: return KNOWN_RAD;
    }
}

static void own_worth(const float odd[TRIED], int bone, double own[TRIED])
{
    const double known = known_rad(bone);
    const double each = 0.5 * READINGS * (double)(ODD * ODD) / (COLOR * COLOR);
    for (int k = 0; k < TRIED; k++) {
        double angle = angle_of(bone, k) / known;
        own[k] = exp(-0.5 * angle * angle - each * (double)odd[k]);
    }
    to_one(own);
}

// Of the bone at `pose`: each place's mean over the frames that saw it.
static void learn(struct turns *t, const struct turns_frame *frame, int bone, const struct pose *pose)
{
    for (int i = 0; i < t->samples[bone].count; i++) {
        struct sample *s = &t->samples[bone].of[i];
        const uint8_t *rgb = look_at(t, frame, bone, s, pose).rgb;
        if (!rgb)
            continue;
        for (int c = 0; c < 3; c++)
            s->color[c] += ((float)rgb[c] / 255 - s->color[c]) / (s->weight + 1);
        s->weight = fminf(s->weight + 1, MOST_WEIGHT);
    }
}

// Whose colours say where to begin: the skull's if it is there, for hardly anything else differs as much from side to
// side. -1: nothing's. How it is turned there is taken from the joints, so that ought to be where people look straight
// ahead: the face shows, and the trunk's front does.
static int leading(const struct turns *t)
{
    for (int b = BONE_COUNT - 1; b >= 0; b--)
        if (t->samples[b].count)
            return b;
    return -1;
}

// How much the colours differ that a frame shows of a bone: summed squares, of 255.
static double variety_of(const struct turns *t, const struct turns_frame *frame, int bone)
{
    double sum[3] = {0}, square = 0;
    int count = 0;
    for (int k = 0; k < t->samples[bone].count; k++) {
        const uint8_t *rgb = look_at(t, frame, bone, &t->samples[bone].of[k], &frame->posture->bone[bone]).rgb;
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
static double facing(const struct turns *t, int bone, const struct pose *pose)
{
    const struct vec3 front = quat_rotate(pose->rotation, (struct vec3){0, 0, -1});
    const struct vec3 at = pose_apply(*pose, t->rest->frame[bone].origin);
    return -v3_dot(front, at) / fmax(v3_length(at), DBL_MIN);
}

void turns_look(struct turns *t, int i, const struct turns_frame *frame)
{
    const int bone = leading(t);
    if (bone >= 0)
        t->telling[i] = variety_of(t, frame, bone) * fmax(facing(t, bone, &frame->posture->bone[bone]), 0);
}

int turns_order(const struct turns *t, int nth)
{
    int first = 0;
    for (int i = 1; i < t->frames; i++)
        first = t->telling[i] > t->telling[first] ? i : first;
    return first + nth < t->frames ? first + nth : t->frames - 1 - nth;
}

void turns_follow(struct turns *t, const struct turns_frame *frame)
{
    if (t->following && frame->time_s < t->first.time_s && t->last.time_s > t->first.time_s)
        t->last = t->first; // from there on to the beginning
    for (int b = 0; b < BONE_COUNT; b++) {
        if (!t->samples[b].count)
            continue;
        float odd[TRIED];
        double before[TRIED], angle = 0;
        odd_turns(t, frame, b, odd);
        own_worth(odd, b, before);
        if (t->following) {
            double own[TRIED];
            memcpy(own, before, sizeof own);
            pass_on(t->last.of[b], frame->time_s - t->last.time_s, b, before);
            for (int k = 0; k < TRIED; k++)
                before[k] *= own[k];
            to_one(before);
        }
        for (int k = 0; k < TRIED; k++)
            angle += before[k] * angle_of(b, k);
        memcpy(t->last.of[b], before, sizeof before);
        struct pose pose = turned_pose(t, frame, b, angle);
        learn(t, frame, b, &pose);
    }
    t->last.time_s = frame->time_s;
    if (!t->following)
        t->first = t->last;
    t->following = true;
}

// The mean of what is likely, of each frame.
static void weigh(const struct turns *t, int bone, const double *time_s, double (*before)[TRIED], double *angle)
{
    double own[TRIED], now[TRIED], behind[TRIED];
    for (int i = 0; i < t->frames; i++) {
        for (int k = 0; k < TRIED; k++)
            before[i][k] = 1;
        if (i > 0) {
            own_worth(t->odd[i - 1][bone], bone, own);
            for (int k = 0; k < TRIED; k++)
                now[k] = before[i - 1][k] * own[k];
            pass_on(now, time_s[i] - time_s[i - 1], bone, before[i]);
        }
    }
    for (int k = 0; k < TRIED; k++)
        behind[k] = 1;
    for (int i = t->frames - 1; i >= 0; i--) {
        double sum = 0;
        own_worth(t->odd[i][bone], bone, own);
        angle[i] = 0;
        for (int k = 0; k < TRIED; k++) {
            now[k] = own[k] * behind[k];
            sum += now[k] * before[i][k];
            angle[i] += now[k] * before[i][k] * angle_of(bone, k);
        }
        angle[i] /= sum;
        if (i > 0)
            pass_on(now, time_s[i] - time_s[i - 1], bone, behind);
    }
}

enum status turns_apply(const struct turns *t, const double *time_s, struct adjustment *adjustments)
{
    double(*before)[TRIED] = malloc(sizeof *before * (size_t)t->frames);
    double *angle = malloc(sizeof *angle * (size_t)t->frames);
    enum status status = before && angle ? OK : fail(ERR_MEMORY, "out of memory");
    for (int b = 0; b < BONE_COUNT && status == OK; b++) {
        if (!t->samples[b].count)
            continue;
        weigh(t, b, time_s, before, angle);
        for (int i = 0; i < t->frames; i++)
            adjustments[i].bone[b] = pose_multiply(adjustments[i].bone[b], turned_by(t->rest, b, angle[i]));
    }
    free(before);
    free(angle);
    return status;
}
