// What depth does not show: which way a person faces at first, legs behind a table, an arm behind the back.
#include "tests/support/test.h"

#include "tests/support/tracked_film.h"

enum { FPS = 30 };

static bool is_mirrored(const struct skeleton *got, const struct skeleton *truth)
{
    enum joint l = JOINT_LEFT_SHOULDER, r = JOINT_RIGHT_SHOULDER;
    double keep = v3_distance(got->joint[l], truth->joint[l]) + v3_distance(got->joint[r], truth->joint[r]),
           cross = v3_distance(got->joint[l], truth->joint[r]) + v3_distance(got->joint[r], truth->joint[l]);
    return cross < 0.7 * keep;
}

// The sensor's pose, rotated about the room's middle by this angle to the figure's left.
static struct pose seen_from(const struct tracked_film *s, double azimuth_degrees)
{
    double half = azimuth_degrees * 3.14159265358979323846 / 360;
    return pose_multiply((struct pose){{0, 0, sin(half), cos(half)}, {0, 0, 0}}, world_sensor_pose(s->world));
}

static void test_any_initial_facing(void **state)
{
    (void)state;
    static const double azimuth[] = {0, 90, 180, 270};
    struct tracked_film s;
    tracked_film_open(&s, "man", "kata");
    for (size_t i = 0; i < COUNT_OF(azimuth); i += TRACKED_EACH) {
        struct pose from = seen_from(&s, azimuth[i]);
        int last = -1;
        tracker_reset(s.tracker);
        for (int k = 0; k < 25; k++) {
            double t = (double)k / FPS;
            struct skeleton got, truth = world_joints_in_camera(s.world, t, from);
            tracked_film_shoot(&s, from, t, (uint64_t)k);
            EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(t), s.depth, &got, NULL), OK);
            if (is_mirrored(&got, &truth))
                last = k;
        }
        print_message("seen from %g degrees: left and right are right from frame %d on\n", azimuth[i], last + 1);
        EXPECT_INT(last + 1, 0);
    }
    tracked_film_close(&s);
}

// Initial poses that are far from standing.
static void test_bent_or_kicking_initial_pose(void **state)
{
    (void)state;
    static const struct {
        const char *motion;
        double time_s, max_m;
    } starts[] = {{"bend", 4, 0.055}, {"kata", 3.9, 0.08}}; // 46 and 26 mm
    for (size_t i = 0; i < COUNT_OF(starts); i++) {
        struct tracked_film s;
        struct skeleton got;
        tracked_film_open(&s, "man", starts[i].motion);
        struct pose from = world_sensor_pose(s.world);
        tracked_film_shoot(&s, from, starts[i].time_s, 1);
        EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(starts[i].time_s), s.depth, &got, NULL), OK);
        struct skeleton truth = world_joints_in_camera(s.world, starts[i].time_s, from);
        print_message("%s, first seen at %.1f s: %.3f m off\n", starts[i].motion, starts[i].time_s,
                      error_of(&got, &truth));
        EXPECT_AT_MOST(error_of(&got, &truth), starts[i].max_m);
        tracked_film_close(&s);
    }
}

// Renders a table into the depth image: the box from `low` to `high`, world axes.
static void put_table(struct tracked_film *s, struct pose from, struct vec3 low, struct vec3 high)
{
    const struct lens *l = &s->calibration.depth;
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++) {
            struct vec3 ray = quat_rotate(from.rotation, lens_ray(l, (struct pixel){x, y})), o = from.translation;
            double d[3] = {ray.x, ray.y, ray.z}, at[3] = {o.x, o.y, o.z}, a[3] = {low.x, low.y, low.z},
                   b[3] = {high.x, high.y, high.z};
            double in = 0, out = 1e9;
            for (int k = 0; k < 3; k++) {
                double t0 = (a[k] - at[k]) / d[k], t1 = (b[k] - at[k]) / d[k];
                in = fmax(in, fmin(t0, t1));
                out = fmin(out, fmax(t0, t1));
            }
            uint16_t *here = &s->depth[y * l->width + x];
            if (in > 0.3 && in < out && (!*here || 1000 * in < *here)) {
                *here = (uint16_t)lround(1000 * in);
                s->truth_mask[y * l->width + x] = 0;
            }
        }
}

static void test_behind_table(void **state)
{
    (void)state;
    static const char *const motions[] = {"kata", "pirouette"};
    for (size_t m = 0; m < COUNT_OF(motions); m += TRACKED_EACH) {
        struct tracked_film s;
        tracked_film_open(&s, "man", motions[m]);
        struct pose from = world_sensor_pose(s.world);
        struct vec3 stand = world_joints(s.world, 0).joint[JOINT_WAIST];
        int mirrored = 0;
        double error = 0;
        for (int k = 0; k < 40; k++) {
            double t = (double)k / FPS;
            struct skeleton got, truth = world_joints_in_camera(s.world, t, from);
            tracked_film_shoot(&s, from, t, (uint64_t)k);
            put_table(&s, from, v3(stand.x - 0.7, stand.y - 1.1, 0), v3(stand.x + 0.7, stand.y - 0.5, 0.75));
            EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(t), s.depth, &got, NULL), OK);
            EXPECT_TRUE(got.confidence[JOINT_LEFT_FOOT] == 0 && got.confidence[JOINT_RIGHT_FOOT] == 0);
            mirrored += is_mirrored(&got, &truth);
            error += error_of(&got, &truth) / 40;
        }
        print_message("%s behind a table: %.3f m over the joints with confidence\n", motions[m], error);
        EXPECT_INT(mirrored, 0);
        EXPECT_AT_MOST(error, 0.035);
        tracked_film_close(&s);
    }
}

static void test_hidden_arm_is_recovered(void **state)
{
    (void)state;
    static const double azimuth[] = {0, 45, -45};
    struct tracked_film s;
    tracked_film_open(&s, "man", "hide");
    for (size_t i = 0; i < COUNT_OF(azimuth); i += TRACKED_EACH) {
        struct pose from = seen_from(&s, azimuth[i]);
        double hidden = 0, out = 0;
        int again = -1, out_k = 60; // by then it hangs visibly again
        tracker_reset(s.tracker);
        for (int k = 16; k < 82; k++) { // until here it hangs
            double t = (double)k / FPS;
            struct skeleton got, truth = world_joints_in_camera(s.world, t, from);
            tracked_film_shoot(&s, from, t, (uint64_t)k);
            EXPECT_STATUS(tracker_next(s.tracker, nanoseconds(t), s.depth, &got, NULL), OK);
            double e = v3_distance(got.joint[JOINT_LEFT_HAND], truth.joint[JOINT_LEFT_HAND]);
            hidden += k >= 36 && k < 54 ? e / 18 : 0;
            out = k >= 74 ? fmax(out, e) : out;
            if (k >= out_k && again < 0 && e < 0.12)
                again = k - out_k;
        }
        print_message(
            "from %g degrees: the hidden hand within %.2f m, found again %d frames after, then within %.2f m\n",
            azimuth[i], hidden, again, out);
        EXPECT_TRUE(again >= 0 && again <= 3);
        EXPECT_AT_MOST(out, 0.06);
    }
    tracked_film_close(&s);
}

static bool in_image(const struct lens *l, struct vec3 p)
{
    struct pixel px = lens_project(l, p);
    return px.x >= 0 && px.y >= 0 && px.x < l->width && px.y < l->height;
}

struct claims {
    int gone, claimed; // joints outside the image; of them, with confidence 1
    int visible, seen; // the same inside the image
};

// The last seconds of a visit, in which the figure walks out of the image.
static void watch_leave(const char *figure, double azimuth_degrees, struct claims *c)
{
    struct tracked_film s;
    tracked_film_open(&s, figure, "visit");
    struct pose from = seen_from(&s, azimuth_degrees);
    for (int k = 0; k < 3 * FPS; k++) {
        double t = world_seconds(s.world) - 3.5 + (double)k / FPS;
        struct skeleton got, truth = world_joints_in_camera(s.world, t, from);
        tracked_film_shoot(&s, from, t, (uint64_t)k);
        if (tracker_next(s.tracker, nanoseconds(t), s.depth, &got, NULL) != OK)
            continue;
        for (int j = 0; j < JOINT_COUNT; j++) {
            bool there = in_image(&s.calibration.depth, truth.joint[j]), sure = got.confidence[j] == 1;
            c->visible += there;
            c->seen += there && sure;
            c->gone += !there;
            c->claimed += !there && sure;
        }
    }
    tracked_film_close(&s);
}

// While a person walks out of the image, most joints outside it do not have confidence 1.
static void test_joints_outside_image_are_predicted(void **state)
{
    (void)state;
    static const struct {
        const char *figure;
        double azimuth_degrees;
    } films[] = {{"man", 0}, {"coat", 20}, {"child", 10}};
    struct claims c = {0};
    for (size_t i = 0; i < COUNT_OF(films); i++)
        watch_leave(films[i].figure, films[i].azimuth_degrees, &c);
    print_message("of %d joints outside the image %d have confidence 1, of %d inside %d\n", c.gone, c.claimed,
                  c.visible, c.seen);
    EXPECT_AT_LEAST(c.gone, 100);
    EXPECT_AT_MOST(c.claimed, 0.12 * c.gone); // 0.08
    EXPECT_AT_LEAST(c.seen, 0.3 * c.visible); // 0.38: people cut by the image's edge are in doubt
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_any_initial_facing),
        cmocka_unit_test(test_bent_or_kicking_initial_pose),
        cmocka_unit_test(test_behind_table),
        cmocka_unit_test(test_hidden_arm_is_recovered),
        cmocka_unit_test(test_joints_outside_image_are_predicted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
