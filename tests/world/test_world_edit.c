// Edited motions on the small world's figure: what is changed, by how much, and what is not.
#include "tests/support/test.h"

#include "tests/world/edit.h"
#include "tests/world/world.h"

enum { HZ = 20, MOST = 200 };
static const double MOST_BENT = 149; // of a knee, degrees
static const double DEGREES = 180 / 3.14159265358979323846;

static struct world_edit kata(enum world_edit_kind kind, double amount)
{
    return (struct world_edit){kind, 0.5, 5, 1.5, 3.5, amount};
}

// The joints at HZ; returns how many there are.
static int perform(const struct world_edit *e, struct skeleton joints[MOST])
{
    struct world_options options = world_default_options();
    double seconds;
    options.motion = "kata";
    options.edit = e;
    EXPECT_STATUS(world_preview_seconds(&options, &seconds), OK);
    EXPECT_NEAR(seconds, world_edit_seconds(e), 1e-9);
    const int count = (int)(seconds * HZ);
    EXPECT_STATUS(world_preview_joints(&options, 0, HZ, count, joints), OK);
    return count;
}

static struct skeleton reference_at(double stretch_s)
{
    struct world_options options = world_default_options();
    struct skeleton s;
    options.motion = "kata";
    EXPECT_STATUS(world_preview_joints(&options, 0.5 + stretch_s, HZ, 1, &s), OK);
    return s;
}

static double bend(const struct skeleton *s, enum joint a, enum joint b, enum joint c)
{
    const struct vec3 x = v3_sub(s->joint[b], s->joint[a]), y = v3_sub(s->joint[c], s->joint[b]);
    return atan2(v3_length(v3_cross(x, y)), v3_dot(x, y)) * DEGREES;
}

static double from_down(const struct skeleton *s, enum joint a, enum joint b)
{
    const struct vec3 d = v3_sub(s->joint[b], s->joint[a]);
    return atan2(hypot(d.x, d.y), -d.z) * DEGREES;
}

static double farthest(const struct skeleton *a, const struct skeleton *b)
{
    double most = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        most = fmax(most, v3_distance(a->joint[j], b->joint[j]));
    return most;
}

static void test_postures_change_by_their_degrees(void **state)
{
    (void)state;
    static const struct {
        enum world_edit_kind kind;
        enum joint a, b, c; // the bend of c against b, or from hanging where c is JOINT_COUNT
        double by;
    } edits[] = {
        {EDIT_LEFT_KNEE, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, 36},
        {EDIT_RIGHT_KNEE, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, 36},
        {EDIT_LEFT_ARM, JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_COUNT, -25},
        {EDIT_RIGHT_ARM, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_COUNT, -25},
    };
    static struct skeleton edited[MOST], plain[MOST];
    for (size_t k = 0; k < COUNT_OF(edits); k++) {
        const struct world_edit e = kata(edits[k].kind, fabs(edits[k].by)), none = kata(EDIT_NONE, 0);
        const int count = perform(&e, edited);
        EXPECT_INT(perform(&none, plain), count);
        for (int f = 0; f < count; f++) {
            const bool down = edits[k].c == JOINT_COUNT;
            const double was = down ? from_down(&plain[f], edits[k].a, edits[k].b)
                                    : bend(&plain[f], edits[k].a, edits[k].b, edits[k].c),
                         is = down ? from_down(&edited[f], edits[k].a, edits[k].b)
                                   : bend(&edited[f], edits[k].a, edits[k].b, edits[k].c),
                         time_s = (double)f / HZ;
            // Shoulders and hips give a little when arms and legs move: half a degree.
            if (time_s <= 1.5 || time_s >= 3.5)
                EXPECT_AT_MOST(farthest(&edited[f], &plain[f]), 1e-9);
            else if (time_s >= 1.8 && time_s <= 3.2)
                EXPECT_NEAR(is, fmax(0, fmin(MOST_BENT, was + edits[k].by)), 1.5);
        }
    }
}

static void test_elbow_and_trunk(void **state)
{
    (void)state;
    static struct skeleton edited[MOST], plain[MOST];
    const struct world_edit none = kata(EDIT_NONE, 0), elbow = kata(EDIT_LEFT_ELBOW, 25), lean = kata(EDIT_LEAN, 20);
    const int count = perform(&none, plain);
    perform(&elbow, edited);
    for (int f = (int)(1.8 * HZ); f < (int)(3.2 * HZ); f++)
        EXPECT_NEAR(bend(&edited[f], JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND),
                    bend(&plain[f], JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND) + 25, 4);
    EXPECT_INT(perform(&lean, edited), count);
    for (int f = (int)(1.8 * HZ); f < (int)(3.2 * HZ); f++) {
        const struct vec3 was = v3_sub(plain[f].joint[JOINT_NECK], plain[f].joint[JOINT_TORSO]),
                          is = v3_sub(edited[f].joint[JOINT_NECK], edited[f].joint[JOINT_TORSO]);
        EXPECT_NEAR(atan2(v3_length(v3_cross(was, is)), v3_dot(was, is)) * DEGREES, 20, 1);
        EXPECT_NEAR(v3_distance(edited[f].joint[JOINT_LEFT_FOOT], plain[f].joint[JOINT_LEFT_FOOT]), 0, 1e-9);
    }
}

// What is only timed otherwise shows the instant of the reference that the map says.
static void test_times_are_as_the_map_says(void **state)
{
    (void)state;
    static struct skeleton edited[MOST];
    static const struct {
        enum world_edit_kind kind;
        double amount, seconds;
    } edits[] = {{EDIT_TEMPO, 1.25, 4}, {EDIT_PAUSE, 0.8, 5.8}, {EDIT_MISSING, 0, 3}, {EDIT_EXTRA, 2, 7}};
    for (size_t k = 0; k < COUNT_OF(edits); k++) {
        const struct world_edit e = kata(edits[k].kind, edits[k].amount);
        EXPECT_NEAR(world_edit_seconds(&e), edits[k].seconds, 1e-9);
        const int count = perform(&e, edited);
        int compared = 0;
        double before_s = 0;
        for (int f = 0; f < count; f++) {
            const double reference_s = world_edit_reference_s(&e, (double)f / HZ);
            if (isnan(reference_s))
                continue;
            EXPECT_AT_LEAST(reference_s, before_s);
            before_s = reference_s;
            if (e.kind == EDIT_MISSING && fabs((double)f / HZ - 1.5) < 0.1)
                continue; // bridged
            const struct skeleton wanted = reference_at(reference_s);
            EXPECT_AT_MOST(farthest(&edited[f], &wanted), 1e-6);
            compared++;
        }
        EXPECT_AT_LEAST(compared, e.kind == EDIT_EXTRA ? count - 41 : count - 5);
    }
    const struct world_edit late = kata(EDIT_LATE, 0.3);
    const int count = perform(&late, edited);
    for (int f = HZ; f < count; f++) {
        const struct skeleton now = reference_at((double)f / HZ), then = reference_at((double)f / HZ - 0.3);
        EXPECT_NEAR(bend(&edited[f], JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND),
                    bend(&then, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND), 0.01);
        EXPECT_NEAR(v3_distance(edited[f].joint[JOINT_LEFT_HAND], now.joint[JOINT_LEFT_HAND]), 0, 1e-9);
    }
}

static void test_mirrored_is_the_other_side(void **state)
{
    (void)state;
    static const enum joint pairs[][2] = {{JOINT_LEFT_HAND, JOINT_RIGHT_HAND},
                                          {JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE},
                                          {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT},
                                          {JOINT_NECK, JOINT_NECK}};
    static struct skeleton edited[MOST], plain[MOST];
    const struct world_edit mirrored = kata(EDIT_MIRRORED, 0), none = kata(EDIT_NONE, 0);
    const int count = perform(&mirrored, edited);
    perform(&none, plain);
    for (int f = 0; f < count; f++)
        for (size_t k = 0; k < COUNT_OF(pairs); k++) {
            const struct vec3 p = plain[f].joint[pairs[k][1]];
            EXPECT_NEAR(v3_distance(edited[f].joint[pairs[k][0]], v3(-p.x, p.y, p.z)), 0, 1e-6);
        }
}

static void test_what_is_no_stretch_is_refused(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    double seconds;
    struct world_edit e = kata(EDIT_PAUSE, 1);
    options.motion = "kata";
    options.edit = &e;
    e.seconds = 500;
    EXPECT_STATUS(world_preview_seconds(&options, &seconds), ERR_INPUT);
    EXPECT_SAYS("not within the motion");
    e = kata(EDIT_LEAN, 20);
    e.to_s = 1;
    struct world *w;
    EXPECT_STATUS(world_open(&w, &options), ERR_INPUT);
    EXPECT_SAYS("otherwise");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_postures_change_by_their_degrees), cmocka_unit_test(test_elbow_and_trunk),
        cmocka_unit_test(test_times_are_as_the_map_says),        cmocka_unit_test(test_mirrored_is_the_other_side),
        cmocka_unit_test(test_what_is_no_stretch_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
