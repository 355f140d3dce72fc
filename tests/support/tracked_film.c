#include "tests/support/test.h"

#include "tests/support/tracked_film.h"

#include "base/linear_algebra.h"

#include <string.h>

void tracked_film_open(struct tracked_film *f, const char *figure, const char *motion)
{
    memset(f, 0, sizeof *f);
    struct world_options options = world_default_options();
    options.plain = true;
    options.motion = motion;
    EXPECT_TRUE(world_figure_named(figure, &options.figure));
    EXPECT_STATUS(world_open(&f->world, &options), OK);
    f->calibration = world_calibration(0.5);
    f->pixels = (size_t)f->calibration.depth.width * (size_t)f->calibration.depth.height;
    f->depth = calloc(f->pixels, sizeof *f->depth);
    f->mask = calloc(f->pixels, 1);
    f->truth_mask = calloc(f->pixels, 1);
    assert_true(f->depth && f->mask && f->truth_mask);
    EXPECT_STATUS(tracker_open(&f->tracker, &f->calibration, NULL), OK);
}

void tracked_film_close(struct tracked_film *f)
{
    tracker_close(&f->tracker);
    world_close(&f->world);
    free(f->depth);
    free(f->mask);
    free(f->truth_mask);
}

void tracked_film_shoot(struct tracked_film *f, struct pose world_from_camera, double time_s, uint64_t seed)
{
    struct world_shot shot = {f->calibration.depth, world_from_camera, time_s, true};
    struct world_image image = {.depth = f->depth, .mask = f->truth_mask};
    EXPECT_STATUS(world_render(f->world, &shot, &image), OK);
    EXPECT_STATUS(world_depth_noise(&shot.lens, f->depth, seed, f->depth), OK);
}

int64_t nanoseconds(double seconds) { return (int64_t)llround(seconds * 1e9); }

struct pose moved(struct pose world_from_camera, struct vec3 by)
{
    return pose_multiply(world_from_camera, (struct pose){{0, 0, 0, 1}, by});
}

double error_of(const struct skeleton *got, const struct skeleton *truth)
{
    double sum = 0;
    int count = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        EXPECT_TRUE(v3_finite(got->joint[j]));
        if (got->confidence[j] > 0) {
            sum += v3_distance(got->joint[j], truth->joint[j]);
            count++;
        }
    }
    return count ? sum / count : -1;
}

double joint_mahalanobis_squared(const struct skeleton *got, const struct skeleton *truth, enum joint j)
{
    const struct covariance3 c = joint_covariance(got, j);
    const double m[9] = {c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz};
    const struct vec3 off = v3_sub(got->joint[j], truth->joint[j]);
    const double d[3] = {off.x, off.y, off.z};
    double inverse[9], square = 0;
    EXPECT_TRUE(invert_symmetric(m, 3, inverse));
    for (int i = 0; i < 9; i++)
        square += d[i / 3] * inverse[i] * d[i % 3];
    return square;
}
