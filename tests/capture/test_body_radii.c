// Body radii measured in images of a puppet with known radii.
#include "tests/support/test.h"

#include "capture/body_radii.h"
#include "recording/place.h"

#include <string.h>

enum { WIDTH = 640, HEIGHT = 480 };

static struct calibration kinect(void)
{
    struct lens lens = {WIDTH, HEIGHT, 525, 525, 319.5, 239.5, 0, 0, 0, 0, 0, 0, 0};
    return (struct calibration){lens, lens, true, POSE_IDENTITY};
}

// Arms out, legs apart, 2.5 m away, facing the camera: the left hand is on the image's right.
static struct skeleton puppet(void)
{
    struct skeleton s;
    const struct vec3 joints[JOINT_COUNT] = {
        [JOINT_HEAD] = {0, -0.65, 2.5},
        [JOINT_NECK] = {0, -0.45, 2.5},
        [JOINT_LEFT_SHOULDER] = {0.2, -0.4, 2.5},
        [JOINT_LEFT_ELBOW] = {0.48, -0.35, 2.5},
        [JOINT_LEFT_HAND] = {0.75, -0.3, 2.5},
        [JOINT_RIGHT_SHOULDER] = {-0.2, -0.4, 2.5},
        [JOINT_RIGHT_ELBOW] = {-0.48, -0.35, 2.5},
        [JOINT_RIGHT_HAND] = {-0.75, -0.3, 2.5},
        [JOINT_TORSO] = {0, -0.15, 2.5},
        [JOINT_WAIST] = {0, 0.1, 2.5},
        [JOINT_LEFT_HIP] = {0.12, 0.18, 2.5},
        [JOINT_LEFT_KNEE] = {0.2, 0.6, 2.5},
        [JOINT_LEFT_FOOT] = {0.25, 1.0, 2.5},
        [JOINT_RIGHT_HIP] = {-0.12, 0.18, 2.5},
        [JOINT_RIGHT_KNEE] = {-0.2, 0.6, 2.5},
        [JOINT_RIGHT_FOOT] = {-0.25, 1.0, 2.5},
    };
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.joint[j] = joints[j];
        s.confidence[j] = 1;
    }
    return s;
}

static const double true_radius[PART_COUNT] = {
    [PART_HEAD] = 0.09,           [PART_UPPER_TORSO] = 0.16,  [PART_LOWER_TORSO] = 0.14,
    [PART_LEFT_UPPER_ARM] = 0.05, [PART_LEFT_FOREARM] = 0.04, [PART_RIGHT_UPPER_ARM] = 0.05,
    [PART_RIGHT_FOREARM] = 0.04,  [PART_LEFT_THIGH] = 0.075,  [PART_LEFT_SHIN] = 0.05,
    [PART_RIGHT_THIGH] = 0.075,   [PART_RIGHT_SHIN] = 0.05,
};

static uint16_t depth[WIDTH * HEIGHT];
static uint8_t mask[WIDTH * HEIGHT];

// Where a ray from the origin first meets the cylinder about a-b, without ends; infinite: never. The cylinder's axes:
// the quadratic of |p - a|^2 - ((p - a) . u)^2 = r^2 along the ray.
static double cylinder_z(struct vec3 ray, struct vec3 a, struct vec3 b, double radius)
{
    const struct vec3 bone = v3_sub(b, a), u = v3_unit(bone);
    const struct vec3 across = v3_sub(ray, v3_scale(u, v3_dot(ray, u))), from = v3_sub(a, v3_scale(u, v3_dot(a, u)));
    const double aa = v3_dot(across, across), ab = v3_dot(across, from), bb = v3_dot(from, from) - radius * radius;
    const double root = ab * ab - aa * bb;
    if (root < 0)
        return INFINITY;
    const double z = (ab - sqrt(root)) / aa; // the ray's z is 1
    const double along = v3_dot(v3_sub(v3_scale(ray, z), a), u);
    return along >= 0 && along <= v3_length(bone) ? z : INFINITY;
}

// Draws every part as a round body: what the sensor sees lies a radius before the bone, and its outline at the bone.
static void draw(const struct calibration *c, const struct skeleton *s)
{
    memset(depth, 0, sizeof depth);
    memset(mask, 0, sizeof mask);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const struct vec3 ray = lens_ray(&c->depth, (struct pixel){x, y});
            double nearest = INFINITY;
            for (int p = 0; p < PART_COUNT; p++)
                nearest = fmin(nearest,
                               cylinder_z(ray, s->joint[part_ends[p].from], s->joint[part_ends[p].to], true_radius[p]));
            if (isfinite(nearest)) {
                depth[y * WIDTH + x] = (uint16_t)lround(1000 * nearest);
                mask[y * WIDTH + x] = 1;
            }
        }
}

static void test_radii_of_clear_pose(void **state)
{
    (void)state;
    struct calibration c = kinect();
    struct skeleton s = puppet();
    struct body_radii r;
    draw(&c, &s);
    body_radii_start(&r);
    EXPECT_TRUE(body_radii_add_frame(&r, 5, &c, &s, depth, mask));
    EXPECT_INT(r.body.representative_frame, 5);
    for (int p = 0; p < PART_COUNT; p++) {
        double length = v3_distance(s.joint[part_ends[p].from], s.joint[part_ends[p].to]);
        const double radius = r.body.radius_rate[p] * length;
        print_message("part %2d: %.1f mm of %.1f\n", p, 1000 * radius, 1000 * true_radius[p]);
        // A pixel is 4.8 mm wide at that distance. By the skin's depth the trunk was 6 % too thin.
        EXPECT_NEAR(radius, true_radius[p], 0.02 * true_radius[p]);
    }
}

static void test_score_prefers_paper_criteria(void **state)
{
    (void)state;
    struct skeleton good = puppet(), arms_down = puppet(), arms_forward = puppet(), crossed = puppet();
    arms_down.joint[JOINT_LEFT_HAND] = v3(0.22, 0.2, 2.5);
    arms_forward.joint[JOINT_LEFT_HAND] = v3(0.2, -0.4, 1.9);
    crossed.joint[JOINT_LEFT_FOOT].x = -0.3;
    crossed.joint[JOINT_RIGHT_FOOT].x = 0.3;
    double value = pose_score(&good);
    EXPECT_TRUE(value > pose_score(&arms_down) + 0.1);
    EXPECT_TRUE(value > pose_score(&arms_forward) + 0.1);
    EXPECT_TRUE(pose_score(&arms_down) > pose_score(&crossed));
    // Seen from behind, the same pose has the same score.
    struct skeleton back = good;
    for (int j = 0; j < JOINT_COUNT; j++)
        back.joint[j] = v3(-good.joint[j].x, good.joint[j].y, 5 - good.joint[j].z);
    EXPECT_NEAR(pose_score(&back), value, 1e-9);
}

static void test_unseen_part_has_no_radius(void **state)
{
    (void)state;
    struct calibration c = kinect();
    struct skeleton s = puppet();
    struct body_radii r;
    draw(&c, &s);
    const enum joint unseen[] = {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(unseen); i++) {
        s.confidence[unseen[i]] = 0;
        s.joint[unseen[i]] = v3(NAN, NAN, NAN);
    }
    body_radii_start(&r);
    EXPECT_TRUE(body_radii_add_frame(&r, 0, &c, &s, depth, mask));
    EXPECT_NEAR(r.body.radius_rate[PART_LEFT_SHIN], 0, 0);
    EXPECT_NEAR(r.body.radius_rate[PART_RIGHT_THIGH], 0, 0);
    EXPECT_AT_LEAST(r.body.radius_rate[PART_LEFT_FOREARM], 0.05);
}

static void test_hard_cases_give_no_radius_and_no_nan(void **state)
{
    (void)state;
    struct calibration c = kinect();
    struct skeleton s = puppet();
    draw(&c, &s);
    struct skeleton none = s;
    none.joint[JOINT_LEFT_HAND] = none.joint[JOINT_LEFT_ELBOW]; // a limb of zero length
    EXPECT_NEAR(body_radii_measure_part(&c, &none, depth, mask, PART_LEFT_FOREARM), 0, 0);
    struct skeleton behind = s;
    behind.joint[JOINT_LEFT_HAND].z = -1;
    EXPECT_NEAR(body_radii_measure_part(&c, &behind, depth, mask, PART_LEFT_FOREARM), 0, 0);
    struct skeleton outside = s;
    outside.joint[JOINT_LEFT_ELBOW].x += 2;
    outside.joint[JOINT_LEFT_HAND].x += 2;
    EXPECT_NEAR(body_radii_measure_part(&c, &outside, depth, mask, PART_LEFT_FOREARM), 0, 0);
    memset(depth, 0, sizeof depth);
    for (int p = 0; p < PART_COUNT; p++)
        EXPECT_NEAR(body_radii_measure_part(&c, &s, depth, mask, (enum part)p), 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_radii_of_clear_pose),
        cmocka_unit_test(test_score_prefers_paper_criteria),
        cmocka_unit_test(test_unseen_part_has_no_radius),
        cmocka_unit_test(test_hard_cases_give_no_radius_and_no_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
