// Axial rotation of round bones, which depth and joints do not show and colours do.
#include "tests/support/test.h"

#include "reenact/avatar/avatar.h"
#include "tests/support/painted_person.h"

#include <string.h>

enum { FRAMES = 16 };

// How a bone is coloured: textured all round, uniform, or as a head of dark hair with a face.
enum colors { TEXTURED, UNIFORM, FACE };

// What rotates about the vertical, with its colours: a head, or a straight left thigh.
struct rotating_bone {
    int bone;
    enum joint center; // inside it
    enum colors colors;
};

// Whether a point of the person's surface is the bone's.
static bool is_rotating(const struct rotating_bone *what, const struct skeleton *s, struct vec3 p)
{
    if (what->bone == BONE_SKULL) {
        const struct vec3 neck = s->joint[JOINT_NECK];
        const double reach = (1 + whole_measures.radius_rate[PART_HEAD]) * v3_distance(neck, s->joint[JOINT_HEAD]);
        return p.y < neck.y && v3_distance(p, neck) < 1.1 * reach;
    }
    const struct vec3 hip = s->joint[JOINT_LEFT_HIP], knee = s->joint[JOINT_LEFT_KNEE];
    return p.x > 0 && p.y > hip.y && p.y < knee.y;
}

// Its colours, rotated by angle_rad.
static void paint_rotating(struct painted *out, const struct rotating_bone *what, const struct skeleton *s,
                           double angle_rad)
{
    const struct vec3 center = s->joint[what->center];
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 p = v3_scale(lens_ray(&ideal, (struct pixel){i % W, i / W}), out->depth[i] * 1e-3);
        if (!out->mask[i] || !is_rotating(what, s, p))
            continue;
        const double about = what->colors == UNIFORM ? 0 : atan2(p.x - center.x, center.z - p.z) - angle_rad;
        uint8_t *at = out->rgb + 3 * i;
        if (what->colors == FACE) {
            memset(at, fabs(about) < 0.7 && p.y > center.y - 0.03 ? 200 : 40, 3);
            continue;
        }
        at[0] = (uint8_t)(128 + 100 * sin(3 * about));
        at[1] = (uint8_t)(128 + 100 * sin(5 * about + 1));
        at[2] = (uint8_t)(128 + 100 * sin(2 * about + 2));
    }
}

// The bone's rotation in each frame as the avatar finds it. angle_rad: in: the true ones; out: those found.
static void found_rotations(const struct rotating_bone *what, double *angle_rad)
{
    static struct painted films[FRAMES];
    struct one_frame frames[FRAMES];
    struct skeleton s = whole_body(0);
    if (what->bone == PART_LEFT_THIGH) // vertical, so that its axis is the same as a head's
        s.joint[JOINT_LEFT_KNEE].x = s.joint[JOINT_LEFT_FOOT].x = s.joint[JOINT_LEFT_HIP].x;
    for (int i = 0; i < FRAMES; i++) {
        paint_person(&films[i], &ideal, &s, &whole_measures);
        paint_rotating(&films[i], what, &s, angle_rad[i]);
        frames[i] = (struct one_frame){s, films[i].rgb, films[i].depth, films[i].mask};
    }
    struct painted_take take;
    struct source_rays *rays;
    struct avatar avatar;
    struct bone_transforms joints;
    painted_take_open(&take, &ideal, frames, FRAMES, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(take.take)), OK);
    EXPECT_STATUS(avatar_make(&avatar, take.take, rays, &(struct avatar_options){.max_frames = FRAMES, .threads = 4}),
                  OK);
    EXPECT_INT(avatar.frame_count, FRAMES);
    EXPECT_STATUS(bone_transforms_of(&avatar.bind_pose, &s, &joints), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct bone_transforms rotated = bone_corrections_apply(&joints, &avatar.frame_corrections[i]);
        const struct quat by =
            quat_multiply(rotated.bone[what->bone].rotation, quat_conjugate(joints.bone[what->bone].rotation));
        angle_rad[i] = -quat_to_rotation_vector(by).y; // y is down
    }
    avatar_free(&avatar);
    source_rays_close(&rays);
    painted_take_close(&take);
}

// Colours determine the rotation from frame to frame, but not its mean, which is subtracted.
static void expect_followed(const struct rotating_bone *what, double each_rad, double most_off_rad)
{
    double angle_rad[FRAMES], mean = 0, square = 0;
    for (int i = 0; i < FRAMES; i++)
        angle_rad[i] = (i - FRAMES / 2) * each_rad;
    found_rotations(what, angle_rad);
    for (int i = 0; i < FRAMES; i++)
        mean += (angle_rad[i] - (i - FRAMES / 2) * each_rad) / FRAMES;
    for (int i = 0; i < FRAMES; i++) {
        const double off = angle_rad[i] - (i - FRAMES / 2) * each_rad - mean;
        square += off * off / FRAMES;
    }
    print_message("rotated by %.2f in all, found %.2f; off by %.3f rad\n", (FRAMES - 1) * each_rad,
                  angle_rad[FRAMES - 1] - angle_rad[0], sqrt(square));
    EXPECT_AT_MOST(sqrt(square), most_off_rad);
}

static void test_head_rotation_follows_colors(void **state)
{
    (void)state;
    const struct rotating_bone head = {BONE_SKULL, JOINT_HEAD, TEXTURED};
    expect_followed(&head, 0.05, 0.05); // 1.25 rad/s
}

// A straight leg's joints do not show its axial rotation; a bent knee's would.
static void test_straight_thigh_rotation_follows_colors(void **state)
{
    (void)state;
    const struct rotating_bone thigh = {PART_LEFT_THIGH, JOINT_LEFT_HIP, TEXTURED};
    expect_followed(&thigh, 0.03, 0.04); // 0.14 rad off without any rotation
}

static void test_textureless_part_is_unchanged(void **state)
{
    (void)state;
    double angle_rad[FRAMES] = {0}, most = 0;
    found_rotations(&(struct rotating_bone){BONE_SKULL, JOINT_HEAD, UNIFORM}, angle_rad);
    for (int i = 0; i < FRAMES; i++)
        most = fmax(most, fabs(angle_rad[i]));
    print_message("without texture rotated by %.3f rad at most\n", most);
    EXPECT_AT_MOST(most, 0.07); // about half of the step between the angles that are tried
}

// A head that is turned away at first, hair towards the sensor, and then faces it, has a face on one side only.
static void test_head_turned_away_at_first_has_one_face(void **state)
{
    (void)state;
    double angle_rad[FRAMES];
    for (int i = 0; i < FRAMES; i++)
        angle_rad[i] = i < FRAMES / 2 ? 1.2 : 1.2 * (FRAMES - 1 - i) / (FRAMES / 2);
    found_rotations(&(struct rotating_bone){BONE_SKULL, JOINT_HEAD, FACE}, angle_rad);
    double away = 0;
    for (int i = 0; i < FRAMES / 2; i++)
        away += angle_rad[i] / (FRAMES / 2);
    print_message("1.20 rad away at first, found %.2f, at last %.2f\n", away, angle_rad[FRAMES - 1]);
    EXPECT_NEAR(away - angle_rad[FRAMES - 1], 1.2, 0.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_head_rotation_follows_colors),
        cmocka_unit_test(test_straight_thigh_rotation_follows_colors),
        cmocka_unit_test(test_textureless_part_is_unchanged),
        cmocka_unit_test(test_head_turned_away_at_first_has_one_face),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
