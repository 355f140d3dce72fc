// Round parts that turn about themselves: depth and joints say nothing of it, their colours do.
#include "tests/support/painted_person.h"
#include "tests/support/test.h"

#include "reenact/avatar/avatar.h"

#include <string.h>

enum { FRAMES = 16 };

// How a part is coloured: gaily all round, all the same, or as a head of dark hair with a face.
enum colors { GAY, PLAIN, FACE };

// Who turns, with colours that go with them: a head about the upright, or a straight left thigh about itself.
struct turning_part {
    int bone;
    enum joint about; // is inside it
    enum colors colors;
};

// Whether a place of the person's surface is the turning part's.
static bool is_turning(const struct turning_part *who, const struct skeleton *s, struct vec3 p)
{
    if (who->bone == BONE_SKULL) {
        const struct vec3 neck = s->joint[JOINT_NECK];
        const double reach = (1 + whole_measures.radius_rate[PART_HEAD]) * v3_distance(neck, s->joint[JOINT_HEAD]);
        return p.y < neck.y && v3_distance(p, neck) < 1.1 * reach;
    }
    const struct vec3 hip = s->joint[JOINT_LEFT_HIP], knee = s->joint[JOINT_LEFT_KNEE];
    return p.x > 0 && p.y > hip.y && p.y < knee.y;
}

// Its colours, turned by `turn_rad`.
static void paint_turning(struct painted *out, const struct turning_part *who, const struct skeleton *s,
                          double turn_rad)
{
    const struct vec3 middle = s->joint[who->about];
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 p = v3_scale(lens_ray(&ideal, (struct pixel){i % W, i / W}), out->depth[i] * 1e-3);
        if (!out->mask[i] || !is_turning(who, s, p))
            continue;
        const double about = who->colors == PLAIN ? 0 : atan2(p.x - middle.x, middle.z - p.z) - turn_rad;
        uint8_t *at = out->rgb + 3 * i;
        if (who->colors == FACE) {
            memset(at, fabs(about) < 0.7 && p.y > middle.y - 0.03 ? 200 : 40, 3);
            continue;
        }
        at[0] = (uint8_t)(128 + 100 * sin(3 * about));
        at[1] = (uint8_t)(128 + 100 * sin(5 * about + 1));
        at[2] = (uint8_t)(128 + 100 * sin(2 * about + 2));
    }
}

// How the avatar has the part turned in each frame, about the same axis; turn_rad: how it is, then how it has it.
static void found_rotations(const struct turning_part *who, double *turn_rad)
{
    static struct painted films[FRAMES];
    struct one_frame frames[FRAMES];
    struct skeleton s = whole_body(0);
    if (who->bone == PART_LEFT_THIGH) // upright, so that it turns about the same axis as a head
        s.joint[JOINT_LEFT_KNEE].x = s.joint[JOINT_LEFT_FOOT].x = s.joint[JOINT_LEFT_HIP].x;
    for (int i = 0; i < FRAMES; i++) {
        paint_person(&films[i], &ideal, &s, &whole_measures);
        paint_turning(&films[i], who, &s, turn_rad[i]);
        frames[i] = (struct one_frame){s, films[i].rgb, films[i].depth, films[i].mask};
    }
    struct painted_take stage;
    struct source_rays *rays;
    struct avatar figure;
    struct bone_transforms joints;
    painted_take_open(&stage, &ideal, frames, FRAMES, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&figure, stage.take, rays, &(struct avatar_options){.max_frames = FRAMES, .threads = 4}),
                  OK);
    EXPECT_INT(figure.frame_count, FRAMES);
    EXPECT_STATUS(bone_transforms_of(&figure.bind_pose, &s, &joints), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct bone_transforms turned = bone_corrections_apply(&joints, &figure.frame_corrections[i]);
        const struct quat by =
            quat_multiply(turned.bone[who->bone].rotation, quat_conjugate(joints.bone[who->bone].rotation));
        turn_rad[i] = -quat_to_rotation_vector(by).y; // y is down
    }
    avatar_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

// Which way it looks in the mean nobody can tell; how it turns from frame to frame they can.
static void expect_followed(const struct turning_part *who, double each_rad, double most_off_rad)
{
    double turn_rad[FRAMES], mean = 0, square = 0;
    for (int i = 0; i < FRAMES; i++)
        turn_rad[i] = (i - FRAMES / 2) * each_rad;
    found_rotations(who, turn_rad);
    for (int i = 0; i < FRAMES; i++)
        mean += (turn_rad[i] - (i - FRAMES / 2) * each_rad) / FRAMES;
    for (int i = 0; i < FRAMES; i++) {
        const double off = turn_rad[i] - (i - FRAMES / 2) * each_rad - mean;
        square += off * off / FRAMES;
    }
    print_message("turned by %.2f in all, found %.2f; off by %.3f rad\n", (FRAMES - 1) * each_rad,
                  turn_rad[FRAMES - 1] - turn_rad[0], sqrt(square));
    EXPECT_AT_MOST(sqrt(square), most_off_rad);
}

static void test_head_rotation_follows_colors(void **state)
{
    (void)state;
    const struct turning_part head = {BONE_SKULL, JOINT_HEAD, GAY};
    expect_followed(&head, 0.05, 0.08); // 1.25 rad/s
}

// A straight leg's joints do not tell how it is turned: a bent knee's would.
static void test_straight_thigh_rotation_follows_colors(void **state)
{
    (void)state;
    const struct turning_part thigh = {PART_LEFT_THIGH, JOINT_LEFT_HIP, GAY};
    expect_followed(&thigh, 0.03, 0.05); // 0.14 rad off if it stayed
}

static void test_textureless_part_is_unchanged(void **state)
{
    (void)state;
    double turn_rad[FRAMES] = {0}, most = 0;
    found_rotations(&(struct turning_part){BONE_SKULL, JOINT_HEAD, PLAIN}, turn_rad);
    for (int i = 0; i < FRAMES; i++)
        most = fmax(most, fabs(turn_rad[i]));
    print_message("without texture turned by %.3f rad at most\n", most);
    EXPECT_AT_MOST(most, 0.125); // no further than to the next of the turns that are tried
}

// Who looks aside at first, hair towards the sensor, and then turns to it, has a face on one side only.
static void test_initial_sideways_gaze_gives_one_face(void **state)
{
    (void)state;
    double turn_rad[FRAMES];
    for (int i = 0; i < FRAMES; i++)
        turn_rad[i] = i < FRAMES / 2 ? 1.2 : 1.2 * (FRAMES - 1 - i) / (FRAMES / 2);
    found_rotations(&(struct turning_part){BONE_SKULL, JOINT_HEAD, FACE}, turn_rad);
    double aside = 0;
    for (int i = 0; i < FRAMES / 2; i++)
        aside += turn_rad[i] / (FRAMES / 2);
    print_message("looked 1.20 rad aside, found %.2f, at last %.2f\n", aside, turn_rad[FRAMES - 1]);
    EXPECT_NEAR(aside - turn_rad[FRAMES - 1], 1.2, 0.4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_head_rotation_follows_colors),
        cmocka_unit_test(test_straight_thigh_rotation_follows_colors),
        cmocka_unit_test(test_textureless_part_is_unchanged),
        cmocka_unit_test(test_initial_sideways_gaze_gives_one_face),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
