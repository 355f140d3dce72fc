// Left and right confused by a tracker for some frames: mended by the shortest way of the joints from frame to frame.
#include "compare/joint_samples.h"

#include <stdlib.h>

// One naming of both sides is right; the other exchanges these joints.
struct exchange {
    enum joint left[6], right[6];
    int count;
};

static const struct exchange exchanges[] = {
    {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
     {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
     6},
    {{JOINT_LEFT_ELBOW, JOINT_LEFT_HAND}, {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND}, 2},
    {{JOINT_LEFT_KNEE, JOINT_LEFT_FOOT}, {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}, 2},
};

static void apply(struct joint_sample *s, const struct exchange *e)
{
    for (int k = 0; k < e->count; k++) {
        const enum joint l = e->left[k], r = e->right[k];
        const struct vec3 joint = s->skeleton.joint[l];
        const float confidence = s->skeleton.confidence[l], sigma = s->sigma_m[l];
        s->skeleton.joint[l] = s->skeleton.joint[r];
        s->skeleton.confidence[l] = s->skeleton.confidence[r];
        s->sigma_m[l] = s->sigma_m[r];
        s->skeleton.joint[r] = joint;
        s->skeleton.confidence[r] = confidence;
        s->sigma_m[r] = sigma;
    }
}

// How far the joints go from one frame to the next, m, under the same naming and under exchanged ones. The two are
// equal where a joint is unknown.
static void ways(const struct joint_sample *from, const struct joint_sample *to, const struct exchange *e,
                 double way[2])
{
    way[0] = way[1] = 0;
    for (int k = 0; k < e->count; k++) {
        const enum joint l = e->left[k], r = e->right[k];
        const float *a = from->skeleton.confidence, *b = to->skeleton.confidence;
        if (!(a[l] > 0 && a[r] > 0 && b[l] > 0 && b[r] > 0))
            continue;
        const struct vec3 *p = from->skeleton.joint, *q = to->skeleton.joint;
        way[0] += v3_distance(p[l], q[l]) + v3_distance(p[r], q[r]);
        way[1] += v3_distance(p[l], q[r]) + v3_distance(p[r], q[l]);
    }
}

// An exchange is believed where it shortens the way by this, per joint: less than a pelvis' width, more than noise.
#define LEAST_GAIN_M 0.06

static int64_t mend(struct joint_samples *s, const struct exchange *e, uint8_t *exchanged)
{
    int64_t changes = 0, count = 0;
    exchanged[0] = 0;
    for (int64_t i = 1; i < s->count; i++) {
        double way[2];
        ways(&s->at[i - 1], &s->at[i], e, way);
        const bool swap = s->at[i].time_ns - s->at[i - 1].time_ns < 200000000 &&
                          way[0] - way[1] > LEAST_GAIN_M * 2 * e->count && way[1] < 0.6 * way[0];
        exchanged[i] = exchanged[i - 1] ^ swap;
        changes += swap;
        count += exchanged[i];
    }
    // A jump for good is a person who turned in a gap, or a tracker that lost them: then the majority is no guide.
    if (!changes || 5 * (2 * count > s->count ? s->count - count : count) > 2 * s->count)
        return 0;
    const uint8_t wrong = 2 * count <= s->count;
    int64_t changed = 0;
    for (int64_t i = 0; i < s->count; i++)
        if (exchanged[i] == wrong) {
            apply(&s->at[i], e);
            changed++;
        }
    return changed;
}

int64_t joint_samples_mend_sides(struct joint_samples *s)
{
    uint8_t *exchanged = s->count > 1 ? malloc((size_t)s->count) : NULL;
    int64_t changed = 0;
    for (size_t i = 0; i < COUNT_OF(exchanges) && exchanged; i++)
        changed += mend(s, &exchanges[i], exchanged);
    free(exchanged);
    return changed;
}
