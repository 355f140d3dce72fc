#include "locate/rolling_shutter.h"

#include "base/linear_algebra.h"

#include <string.h>

static const double HAND_ANGULAR_SPEED = 1, HAND_SPEED = 1; // rad/s, m/s
// Nobody carries a camera faster: a clock that jumped, or a pose that did.
static const double MAX_ANGULAR_SPEED = 10, MAX_SPEED = 10;

struct shutter_motion shutter_motion_unknown(void)
{
    struct shutter_motion m = {.speed = {0}};
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? HAND_ANGULAR_SPEED : HAND_SPEED;
        m.information[i * 7] = 1 / (sigma * sigma);
    }
    return m;
}

struct shutter_motion shutter_motion_prior(const double speed[6], const double covariance[36])
{
    struct shutter_motion m = {.speed = {0}};
    double turn = 0, shift = 0;
    for (int i = 0; i < 3; i++) {
        turn += speed[i] * speed[i];
        shift += speed[3 + i] * speed[3 + i];
    }
    if (!(turn <= MAX_ANGULAR_SPEED * MAX_ANGULAR_SPEED && shift <= MAX_SPEED * MAX_SPEED) ||
        !invert_symmetric(covariance, 6, m.information))
        return shutter_motion_unknown();
    memcpy(m.speed, speed, sizeof m.speed);
    memcpy(m.expected, speed, sizeof m.expected);
    return m;
}

double shutter_row_time(const struct lens *lens, double row)
{
    double rows = lens->height - 1;
    return rows > 0 ? lens->readout_s * (row - rows / 2) / rows : 0;
}

struct vec3 shutter_apply_motion(const struct shutter_motion *m, double time_s, struct vec3 p)
{
    if (!m || time_s == 0)
        return p;
    const double *v = m->speed;
    struct vec3 still = v3_sub(p, v3(v[3] * time_s, v[4] * time_s, v[5] * time_s));
    return quat_rotate(quat_from_rotation_vector(v3(-v[0] * time_s, -v[1] * time_s, -v[2] * time_s)), still);
}

struct pixel shutter_project(const struct lens *lens, const struct shutter_motion *m, struct vec3 p)
{
    // The row moves by a few hundredths of what it was wrong by each time.
    enum { ROUNDS = 3 };
    struct pixel at = lens_project(lens, p);
    for (int i = 0; i < ROUNDS && m; i++) {
        struct vec3 then = shutter_apply_motion(m, shutter_row_time(lens, at.y), p);
        if (!(then.z > 1e-3))
            break;
        at = lens_project(lens, then);
    }
    return at;
}
