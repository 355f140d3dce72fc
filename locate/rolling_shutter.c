#include "locate/rolling_shutter.h"

#include "base/linear_algebra.h"

#include <string.h>

// Prior of a hand-held camera, standard deviations, rad/s and m/s; chosen by hand.
static const double HAND_ANGULAR_SPEED = 1, HAND_SPEED = 1;
// A hand-held camera is never faster: the clock or the pose jumped. Chosen by hand.
static const double MAX_ANGULAR_SPEED = 10, MAX_SPEED = 10;

struct shutter_motion shutter_motion_unknown(void)
{
    struct shutter_motion m = {.velocity = {0}};
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? HAND_ANGULAR_SPEED : HAND_SPEED;
        m.information[i * 7] = 1 / (sigma * sigma);
    }
    return m;
}

struct shutter_motion shutter_motion_prior(const double velocity[6], const double covariance[36])
{
    struct shutter_motion m = {.velocity = {0}};
    double angular = 0, linear = 0;
    for (int i = 0; i < 3; i++) {
        angular += velocity[i] * velocity[i];
        linear += velocity[3 + i] * velocity[3 + i];
    }
    if (!(angular <= MAX_ANGULAR_SPEED * MAX_ANGULAR_SPEED && linear <= MAX_SPEED * MAX_SPEED) ||
        !invert_symmetric(covariance, 6, m.information))
        return shutter_motion_unknown();
    memcpy(m.velocity, velocity, sizeof m.velocity);
    memcpy(m.expected, velocity, sizeof m.expected);
    return m;
}

double shutter_row_time(const struct lens *lens, double row)
{
    double rows = lens->height - 1;
    return rows > 0 ? lens->readout_s * (row - rows / 2) / rows : 0;
}

struct vec3 shutter_apply_motion(const struct shutter_motion *motion, double time_s, struct vec3 p)
{
    if (!motion || time_s == 0)
        return p;
    const double *v = motion->velocity;
    struct vec3 still = v3_sub(p, v3(v[3] * time_s, v[4] * time_s, v[5] * time_s));
    return quat_rotate(quat_from_rotation_vector(v3(-v[0] * time_s, -v[1] * time_s, -v[2] * time_s)), still);
}

struct pixel shutter_project(const struct lens *lens, const struct shutter_motion *motion, struct vec3 p)
{
    // Fixed point of the row; each round leaves a few hundredths of the error.
    enum { ROUNDS = 3 };
    struct pixel at = lens_project(lens, p);
    for (int i = 0; i < ROUNDS && motion; i++) {
        struct vec3 then = shutter_apply_motion(motion, shutter_row_time(lens, at.y), p);
        if (!(then.z > 1e-3))
            break;
        at = lens_project(lens, then);
    }
    return at;
}
