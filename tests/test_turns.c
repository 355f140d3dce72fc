// A round head that turns on a still trunk: depth and joints say nothing of it, its colours do.
#include "tests/support/painted_person.h"
#include "tests/test.h"

#include "reenact/likeness.h"

#include <string.h>

enum { FRAMES = 16 };

static const double EACH_RAD = 0.05; // from one frame to the next: 1.25 rad/s

// How a head is coloured: gaily all round, all the same, or dark hair but for a face.
enum head { GAY, PLAIN, FACE };

// Colours that go with the head, which is turned by `turn_rad` about its own upright axis.
static void paint_head(struct painted *out, const struct skeleton *s, double turn_rad, enum head head_is)
{
    const struct vec3 neck = s->joint[JOINT_NECK], head = s->joint[JOINT_HEAD];
    const double reach = 1.1 * (1 + whole_measures.radius_rate[PART_HEAD]) * v3_distance(neck, head);
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 p = v3_scale(lens_ray(&ideal, (struct pixel){i % W, i / W}), out->depth[i] * 1e-3);
        if (!out->mask[i] || p.y > neck.y || v3_distance(p, neck) > reach)
            continue;
        const double about = head_is == PLAIN ? 0 : atan2(p.x - head.x, head.z - p.z) - turn_rad;
        uint8_t *at = out->rgb + 3 * i;
        if (head_is == FACE) {
            memset(at, fabs(about) < 0.7 && p.y > head.y - 0.03 ? 200 : 40, 3);
            continue;
        }
        at[0] = (uint8_t)(128 + 100 * sin(3 * about));
        at[1] = (uint8_t)(128 + 100 * sin(5 * about + 1));
        at[2] = (uint8_t)(128 + 100 * sin(2 * about + 2));
    }
}

// How the likeness has the head turned in each frame, about the same axis; turn_rad: how it is, then how it has it.
static void found_turns(enum head head_is, double *turn_rad)
{
    static struct painted films[FRAMES];
    struct one_frame frames[FRAMES];
    struct skeleton s = whole_body(0);
    for (int i = 0; i < FRAMES; i++) {
        paint_person(&films[i], &ideal, &s, &whole_measures);
        paint_head(&films[i], &s, turn_rad[i], head_is);
        frames[i] = (struct one_frame){s, films[i].rgb, films[i].depth, films[i].mask};
    }
    struct painted_take stage;
    struct source_rays *rays;
    struct likeness figure;
    struct posture joints;
    painted_take_open(&stage, &ideal, frames, FRAMES, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(likeness_make(&figure, stage.take, rays, FRAMES, NULL), OK);
    EXPECT_INT(figure.frame_count, FRAMES);
    EXPECT_STATUS(posture_of(&figure.rest, &s, &joints), OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct posture turned = posture_adjusted(&joints, &figure.adjustments[i]);
        const struct quat by =
            quat_multiply(turned.bone[BONE_SKULL].rotation, quat_conjugate(joints.bone[BONE_SKULL].rotation));
        turn_rad[i] = -quat_to_rotation_vector(by).y; // y is down
    }
    likeness_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

// Which way it looked in the mean nobody can tell; how it turned from frame to frame they can.
static void a_head_is_turned_as_its_colors_are(void **state)
{
    (void)state;
    double turn_rad[FRAMES], mean = 0, square = 0;
    for (int i = 0; i < FRAMES; i++)
        turn_rad[i] = (i - FRAMES / 2) * EACH_RAD;
    found_turns(GAY, turn_rad);
    for (int i = 0; i < FRAMES; i++)
        mean += (turn_rad[i] - (i - FRAMES / 2) * EACH_RAD) / FRAMES;
    for (int i = 0; i < FRAMES; i++) {
        const double off = turn_rad[i] - (i - FRAMES / 2) * EACH_RAD - mean;
        square += off * off / FRAMES;
    }
    print_message("turned by %.2f in all, found %.2f; off by %.3f rad\n", (FRAMES - 1) * EACH_RAD,
                  turn_rad[FRAMES - 1] - turn_rad[0], sqrt(square));
    EXPECT_AT_MOST(sqrt(square), 0.08);
}

static void what_has_no_texture_stays(void **state)
{
    (void)state;
    double turn_rad[FRAMES] = {0}, most = 0;
    found_turns(PLAIN, turn_rad);
    for (int i = 0; i < FRAMES; i++)
        most = fmax(most, fabs(turn_rad[i]));
    print_message("without texture turned by %.3f rad at most\n", most);
    EXPECT_AT_MOST(most, 0.125); // no further than to the next of the turns that are tried
}

// Who looks aside at first, hair towards the sensor, and then turns to it, has a face on one side only.
static void who_looks_aside_first_has_one_face(void **state)
{
    (void)state;
    double turn_rad[FRAMES];
    for (int i = 0; i < FRAMES; i++)
        turn_rad[i] = i < FRAMES / 2 ? 1.2 : 1.2 * (FRAMES - 1 - i) / (FRAMES / 2);
    found_turns(FACE, turn_rad);
    double aside = 0;
    for (int i = 0; i < FRAMES / 2; i++)
        aside += turn_rad[i] / (FRAMES / 2);
    print_message("looked 1.20 rad aside, found %.2f, at last %.2f\n", aside, turn_rad[FRAMES - 1]);
    EXPECT_NEAR(aside - turn_rad[FRAMES - 1], 1.2, 0.4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_head_is_turned_as_its_colors_are),
        cmocka_unit_test(what_has_no_texture_stays),
        cmocka_unit_test(who_looks_aside_first_has_one_face),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
