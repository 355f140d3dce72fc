#include "tests/support/limbs.h"

// A bone: its parent, its length, its direction in the bind pose (x left, y up, z to the front) and the amplitude of
// its swing (radians). Chosen by hand.
struct limb_bone {
    enum joint joint, from;
    double length_m, bind_direction[3], swing;
};

static const struct limb_bone bones[] = {
    {JOINT_HEAD, JOINT_NECK, 0.25, {0, 1, 0}, 0.2},
    {JOINT_LEFT_SHOULDER, JOINT_NECK, 0.18, {1, -0.1, 0}, 0.1},
    {JOINT_LEFT_ELBOW, JOINT_LEFT_SHOULDER, 0.28, {0.2, -1, 0}, 0.9},
    {JOINT_LEFT_HAND, JOINT_LEFT_ELBOW, 0.26, {0.1, -1, 0.1}, 1.1},
    {JOINT_RIGHT_SHOULDER, JOINT_NECK, 0.18, {-1, -0.1, 0}, 0.1},
    {JOINT_RIGHT_ELBOW, JOINT_RIGHT_SHOULDER, 0.28, {-0.2, -1, 0}, 0.9},
    {JOINT_RIGHT_HAND, JOINT_RIGHT_ELBOW, 0.26, {-0.1, -1, 0.1}, 1.1},
    {JOINT_TORSO, JOINT_NECK, 0.3, {0, -1, 0}, 0.15},
    {JOINT_WAIST, JOINT_TORSO, 0.2, {0, -1, 0}, 0.15},
    {JOINT_LEFT_HIP, JOINT_WAIST, 0.1, {1, -0.2, 0}, 0.08},
    {JOINT_LEFT_KNEE, JOINT_LEFT_HIP, 0.43, {0.05, -1, 0}, 0.5},
    {JOINT_LEFT_FOOT, JOINT_LEFT_KNEE, 0.42, {0, -1, 0}, 0.5},
    {JOINT_RIGHT_HIP, JOINT_WAIST, 0.1, {-1, -0.2, 0}, 0.08},
    {JOINT_RIGHT_KNEE, JOINT_RIGHT_HIP, 0.43, {-0.05, -1, 0}, 0.5},
    {JOINT_RIGHT_FOOT, JOINT_RIGHT_KNEE, 0.42, {0, -1, 0}, 0.5},
};

static const double TWO_PI = 6.283185307179586;

static void random_waves(struct limb_wave *waves, double amplitude, double hertz_most, struct rng *rng)
{
    for (int i = 0; i < LIMB_WAVES; i++)
        waves[i] = (struct limb_wave){amplitude * (0.15 + 0.5 * rng_uniform(rng)), 0.03 + hertz_most * rng_uniform(rng),
                                      TWO_PI * rng_uniform(rng)};
}

static double wave_at(const struct limb_wave *waves, double time_s)
{
    double sum = 0;
    for (int i = 0; i < LIMB_WAVES; i++)
        sum += waves[i].amplitude * sin(TWO_PI * waves[i].hertz * time_s + waves[i].phase);
    return sum;
}

struct limbs limbs_random(struct rng *rng)
{
    struct limbs l;
    random_waves(l.heading, 2.5, 0.1, rng);
    for (int j = 0; j < JOINT_COUNT; j++)
        for (int axis = 0; axis < 2; axis++)
            random_waves(l.swing[j][axis], 0, 0, rng);
    for (size_t i = 0; i < COUNT_OF(bones); i++)
        for (int axis = 0; axis < 2; axis++)
            random_waves(l.swing[bones[i].joint][axis], bones[i].swing, 0.5, rng);
    return l;
}

static struct vec3 with_noise(struct vec3 p, double noise_m, struct rng *rng)
{
    if (!(noise_m > 0))
        return p;
    double x = rng_normal(rng), y = rng_normal(rng), z = rng_normal(rng);
    return v3_add(p, v3_scale(v3(x, y, z), noise_m));
}

struct skeleton limbs_at(const struct limbs *l, double time_s, double noise_m, struct rng *rng)
{
    struct skeleton s = {.confidence = {[JOINT_NECK] = 1}};
    s.joint[JOINT_NECK] = v3(0, -0.4, 3);
    struct quat rotation = quat_from_rotation_vector(v3(0, wave_at(l->heading, time_s), 0));
    for (size_t i = 0; i < COUNT_OF(bones); i++) {
        const struct limb_bone *b = &bones[i];
        // Left of a person who faces the camera is the camera's right, up is -y, their front is -z.
        struct vec3 bind_vector =
            v3_scale(v3_unit(v3(b->bind_direction[0], -b->bind_direction[1], -b->bind_direction[2])), b->length_m);
        struct quat swing = quat_from_rotation_vector(
            v3(wave_at(l->swing[b->joint][0], time_s), 0, wave_at(l->swing[b->joint][1], time_s)));
        s.joint[b->joint] = v3_add(s.joint[b->from], quat_rotate(quat_multiply(rotation, swing), bind_vector));
        s.confidence[b->joint] = 1;
    }
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = with_noise(s.joint[j], noise_m, rng);
    return s;
}

struct skeleton limbs_rotated(const struct skeleton *s, double angle, double noise_m, struct rng *rng)
{
    struct skeleton rotated = *s;
    struct quat rotation = quat_from_rotation_vector(v3(0, angle, 0));
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 from_neck = v3_sub(s->joint[j], s->joint[JOINT_NECK]);
        rotated.joint[j] = with_noise(v3_add(s->joint[JOINT_NECK], quat_rotate(rotation, from_neck)), noise_m, rng);
    }
    return rotated;
}
