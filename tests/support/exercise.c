#include "tests/support/test.h"

#include "tests/support/exercise.h"

struct exercise exercise_default(void)
{
    return (struct exercise){.seconds = 6, .rate_hz = 30, .tempo = 1, .size = 1, .z_m = 3, .range = 1};
}

// Up and down within a repetition, 0..1, and still for a moment at both ends.
static double wave(double phase)
{
    const double x = phase - floor(phase);
    return 0.5 - 0.5 * cos(2 * 3.14159265358979323846 * x);
}

struct pose_angles {
    double arm[2], elbow[2], knee[2], thigh[2], lean, turn; // left, right
};

static struct pose_angles angles_at(const struct exercise *e, double time_s)
{
    double t = time_s;
    if (e->pause_s > 0 && t > e->pause_at_s)
        t = fmax(e->pause_at_s, t - e->pause_s);
    t = e->still ? 0 : t * e->tempo + e->begin_s;
    const double left = e->range * wave(t / 3), late = e->range * wave((t - e->right_arm_late_s * e->tempo) / 3);
    struct pose_angles a = {{0.2 + 1.6 * left, 0.2 + 2.2 * late},
                            {0.2 + 0.2 * left, 0.3 + 1.1 * late},
                            {0.1 + 1.0 * left, 0.1 + 1.0 * left},
                            {0.05 + 0.5 * left, 0.05 + 0.5 * left},
                            0.05 + 0.3 * left,
                            0};
    if (e->walking) {
        const double swing = sin(2 * 3.14159265358979323846 * t);
        a = (struct pose_angles){
            {0.15, 0.15}, {0.4, 0.4}, {0.3 + 0.3 * swing, 0.3 - 0.3 * swing}, {0.4 * swing, -0.4 * swing}, 0.05, 0};
    }
    if (time_s >= e->wrong_from_s && time_s <= e->wrong_to_s) {
        a.elbow[1] += e->right_elbow_rad;
        a.elbow[0] += e->left_elbow_rad;
        a.arm[0] += e->left_arm_rad;
        a.knee[1] += e->right_knee_rad;
        a.lean += e->lean_rad;
        a.turn += e->turn_rad;
    }
    return a;
}

// Body axes: x left, y ahead, z up.
static struct vec3 sideways(double side, double rad) { return v3(side * sin(rad), 0, -cos(rad)); }
static struct vec3 ahead(double rad) { return v3(0, sin(rad), -cos(rad)); }

// About the vertical, to the left.
static struct vec3 turned(struct vec3 p, double rad)
{
    return v3(p.x * cos(rad) + p.y * sin(rad), p.y * cos(rad) - p.x * sin(rad), p.z);
}

static void pose(const struct pose_angles *a, struct vec3 joint[JOINT_COUNT])
{
    const struct vec3 trunk = v3(0, sin(a->lean), cos(a->lean));
    joint[JOINT_WAIST] = v3(0, 0, 1);
    joint[JOINT_TORSO] = v3_add(joint[JOINT_WAIST], v3_scale(trunk, 0.22));
    joint[JOINT_NECK] = v3_add(joint[JOINT_TORSO], v3_scale(trunk, 0.25));
    joint[JOINT_HEAD] = v3_add(joint[JOINT_NECK], v3_scale(trunk, 0.18));
    static const enum joint arm[2][3] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
                                         {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND}};
    static const enum joint leg[2][3] = {{JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
                                         {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}};
    for (int s = 0; s < 2; s++) {
        const double side = s ? -1 : 1;
        joint[arm[s][0]] = v3_add(joint[JOINT_NECK], turned(v3(side * 0.18, 0, -0.02), a->turn));
        joint[arm[s][1]] = v3_add(joint[arm[s][0]], turned(v3_scale(sideways(side, a->arm[s]), 0.28), a->turn));
        joint[arm[s][2]] =
            v3_add(joint[arm[s][1]], turned(v3_scale(sideways(side, a->arm[s] + a->elbow[s]), 0.25), a->turn));
        joint[leg[s][0]] = v3_add(joint[JOINT_WAIST], v3(side * 0.09, 0, -0.05));
        joint[leg[s][1]] = v3_add(joint[leg[s][0]], v3_scale(ahead(a->thigh[s]), 0.42));
        joint[leg[s][2]] = v3_add(joint[leg[s][1]], v3_scale(ahead(a->thigh[s] - a->knee[s]), 0.42));
    }
}

static void exchange_sides(struct vec3 joint[JOINT_COUNT])
{
    static const enum joint pairs[][2] = {
        {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}, {JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW},
        {JOINT_LEFT_HAND, JOINT_RIGHT_HAND},         {JOINT_LEFT_HIP, JOINT_RIGHT_HIP},
        {JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},         {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT},
    };
    for (int j = 0; j < JOINT_COUNT; j++)
        joint[j].x = -joint[j].x;
    for (size_t k = 0; k < COUNT_OF(pairs); k++) {
        const struct vec3 swap = joint[pairs[k][0]];
        joint[pairs[k][0]] = joint[pairs[k][1]];
        joint[pairs[k][1]] = swap;
    }
}

struct skeleton exercise_at(const struct exercise *e, double time_s, struct rng *rng)
{
    const struct pose_angles a = angles_at(e, time_s);
    struct vec3 joint[JOINT_COUNT];
    struct skeleton s = {0};
    pose(&a, joint);
    if (e->mirrored)
        exchange_sides(joint);
    const double c = cos(e->yaw_rad), n = sin(e->yaw_rad);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = v3_scale(joint[j], e->size);
        // Facing the camera the person's left is the picture's right, and ahead is towards the camera.
        const struct vec3 camera = v3(p.x, 1 - p.z, -p.y);
        s.joint[j] = v3(c * camera.x + n * camera.z + e->x_m, camera.y, -n * camera.x + c * camera.z + e->z_m);
        if (rng)
            s.joint[j] = v3_add(s.joint[j], rng_normal3(rng, e->noise_m));
        s.confidence[j] = 1;
    }
    return s;
}

void exercise_samples(const struct exercise *e, struct rng *rng, struct joint_samples *out)
{
    *out = (struct joint_samples){0};
    const int count = (int)(e->seconds * e->rate_hz + 0.5);
    for (int i = 0; i < count; i++) {
        struct joint_sample s = {.time_ns = (int64_t)(i / e->rate_hz * 1e9),
                                 .skeleton = exercise_at(e, i / e->rate_hz, rng)};
        for (int j = 0; j < JOINT_COUNT; j++)
            s.sigma_m[j] = default_sigma_m(1);
        EXPECT_STATUS(joint_samples_add(out, &s), OK);
    }
}
