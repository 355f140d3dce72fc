// The avatar of a painted person: it lies where they were seen, is closed, finds
// its way back when the joints are wrong, and may come after the first picture.
#include "tests/support/painted_person.h"
#include "tests/support/random.h"
#include "tests/support/test.h"

#include "reenact/avatar/avatar.h"
#include "reenact/avatar/silhouette_constraint.h"

#include <string.h>

static double mean_gap_mm(const struct silhouette_gaps *g)
{
    double sum = 0, count = 0;
    for (int p = 0; p < BONE_COUNT; p++) {
        sum += bone_chart_sum(&g->sum[p]);
        count += bone_chart_sum(&g->count[p]);
    }
    return 1000 * sum / count;
}

// Of a bone's sides, 0: that from which its own x axis points, 1: the other.
static bool of_side(int number, int side) { return (number % CHART_ANGLES < CHART_ANGLES / 2) == (side == 0); }

static double side_gap_mm(const struct silhouette_gaps *g, int bone, int side)
{
    double sum = 0, count = 0;
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++) {
        sum += of_side(i, side) ? (double)g->sum[bone].at[i] : 0;
        count += of_side(i, side) ? (double)g->count[bone].at[i] : 0;
    }
    return 1000 * sum / count;
}

static void thin_on_one_side(struct tsdf *v, int bone)
{
    struct bone_chart thinner[BONE_COUNT];
    memset(thinner, 0, sizeof thinner);
    for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
        thinner[bone].at[i] = of_side(i, 0) ? -0.010F : 0;
    tsdf_offset(v, thinner);
}

// The figure lies where the body was painted, is closed, finds its way back when the joints are wrong, and is made as
// wide as it is seen.
static void test_avatar_fits_depth(void **state)
{
    (void)state;
    static struct painted film;
    struct skeleton s = whole_body(0);
    paint_person(&film, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct painted_take stage;
    painted_take_open(&stage, &ideal, &frame, 1, &whole_measures);
    struct source_rays *rays;
    struct avatar figure;
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&figure, stage.take, rays, 10, NULL), OK);
    long all = 0, close = 0;
    for (int i = 0; i < figure.surface.point_count; i++) {
        const int bone = figure.skins[i].bone[0];
        if (figure.vertex_colors.filled[i] && (bone == PART_UPPER_TORSO || bone == PART_LOWER_TORSO))
            continue; // a back that nobody saw is not round as this body's is (test_volume)
        all++;
        close += fabs(bind_pose_distance(&figure.bind_pose, figure.surface.points[i])) < 0.015;
    }
    print_message("%d points, %ld of them anything but an unseen back, %ld within 15 mm\n", figure.surface.point_count,
                  all, close);
    EXPECT_AT_LEAST((double)all, 0.6 * figure.surface.point_count);
    EXPECT_AT_LEAST((double)close, 0.9 * (double)all);
    uint64_t edges = 0; // every edge is there once in either direction
    for (int c = 0; c < figure.surface.corner_count; c++) {
        uint64_t from = (uint64_t)figure.surface.corners[c],
                 to = (uint64_t)figure.surface.corners[c % 3 == 2 ? c - 2 : c + 1];
        uint64_t edge = (from < to ? from << 32 | to : to << 32 | from) * 0x9e3779b97f4a7c15u;
        edges += from < to ? edge : -edge;
    }
    EXPECT_TRUE(edges == 0);

    struct depth_frame observed;
    EXPECT_STATUS(depth_frame_open(&observed, stage.take, rays), OK);
    EXPECT_STATUS(depth_frame_read(&observed, stage.take, 0), OK);
    struct skeleton wrong = s;
    for (int j = 0; j < JOINT_COUNT; j++)
        wrong.joint[j] = v3_add(s.joint[j], v3(0.02, 0, 0.03));
    struct bone_transforms joints;
    EXPECT_STATUS(bone_transforms_of(&figure.bind_pose, &wrong, &joints), OK);
    const struct icp_input from = {joints, joint_noise_prior(), bone_corrections_identity(), false};
    const struct bone_corrections found = articulated_icp(figure.tsdf, &observed, &from, NULL);
    joints = bone_corrections_apply(&joints, &found);
    struct skeleton back = bone_transforms_skeleton(&figure.bind_pose, &joints);
    double before = 0, after = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        before += v3_distance(wrong.joint[j], s.joint[j]) / JOINT_COUNT;
        after += v3_distance(back.joint[j], s.joint[j]) / JOINT_COUNT;
    }
    print_message("joints %.1f mm off, then %.1f mm\n", before * 1000, after * 1000);
    EXPECT_AT_MOST(after, before / 2);

    static struct bone_chart thinner[BONE_COUNT]; // the frame's outline says by how much
    for (int p = 0; p < BONE_COUNT; p++)
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
            thinner[p].at[i] = -0.010F;
    struct silhouette_gaps as_made = {0}, thinned = {0}, met = {0};
    silhouette_measure(figure.tsdf, take_calibration(stage.take), &observed, &joints, &as_made);
    tsdf_offset(figure.tsdf, thinner);
    for (int i = 0; i < 20; i++) // as many frames as a part needs to be sure of
        silhouette_measure(figure.tsdf, take_calibration(stage.take), &observed, &joints, &thinned);
    tsdf_match_silhouettes(figure.tsdf, &thinned);
    silhouette_measure(figure.tsdf, take_calibration(stage.take), &observed, &joints, &met);
    print_message("outline off by %.1f mm, thinned %.1f mm, met %.1f mm\n", mean_gap_mm(&as_made),
                  mean_gap_mm(&thinned), mean_gap_mm(&met));
    EXPECT_NEAR(mean_gap_mm(&thinned) - mean_gap_mm(&as_made), 10, 2);
    EXPECT_NEAR(mean_gap_mm(&met), 0, 2);
    thin_on_one_side(figure.tsdf, PART_LEFT_THIGH);
    const struct silhouette_gaps none_yet = {0};
    thinned = met = none_yet;
    for (int i = 0; i < 20; i++)
        silhouette_measure(figure.tsdf, take_calibration(stage.take), &observed, &joints, &thinned);
    tsdf_match_silhouettes(figure.tsdf, &thinned);
    silhouette_measure(figure.tsdf, take_calibration(stage.take), &observed, &joints, &met);
    for (int side = 0; side < 2; side++) {
        const double was_mm = side_gap_mm(&thinned, PART_LEFT_THIGH, side),
                     is_mm = side_gap_mm(&met, PART_LEFT_THIGH, side);
        print_message("a thigh's side %d off by %.1f mm, met %.1f mm\n", side, was_mm, is_mm);
        EXPECT_NEAR(was_mm, side == 0 ? 10 : 0, 3);
        EXPECT_NEAR(is_mm, 0, 2);
    }
    depth_frame_close(&observed);
    avatar_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

// 4 cm thick, its end round.
static void paint_tube(struct painted *out, struct vec3 from, struct vec3 to)
{
    for (int i = 0; i < PIXELS; i++) {
        const struct vec3 ray = lens_ray(&ideal, (struct pixel){i % W, i / W});
        const double depth = fmin(tube_depth(ray, from, to, 0.04, 0), ball_depth(ray, to, 0.04));
        if (!(depth * 1000 < out->depth[i]))
            continue;
        out->depth[i] = (uint16_t)lround(depth * 1000);
        out->mask[i] = 1;
    }
}

// Something that turns on what carries it.
struct turning_limb {
    enum joint joint;      // about this one
    int bone, carrier;     // as the rest pose calls them
    struct vec3 tip, axis; // metres from the joint, unturned; unit
};

// Laid on frames in which only this is turned, one way and the other: most of that is found.
static void expect_turned_alone(const struct turning_limb *t)
{
    enum { LEARNED = 5, WAYS = 3 }; // LEARNED: frames with it unturned, which make the shape sure
    static const double turn_rad[WAYS] = {0, 0.3, -0.3};
    static struct painted films[WAYS];
    struct skeleton s = whole_body(0);
    struct one_frame frames[LEARNED + WAYS - 1];
    for (int i = 0; i < WAYS; i++) {
        const struct vec3 tip = quat_rotate(quat_from_rotation_vector(v3_scale(t->axis, turn_rad[i])), t->tip);
        paint_person(&films[i], &ideal, &s, &whole_measures);
        paint_tube(&films[i], s.joint[t->joint], v3_add(s.joint[t->joint], tip));
    }
    for (int i = 0; i < LEARNED + WAYS - 1; i++) {
        const struct painted *film = &films[i < LEARNED ? 0 : i - LEARNED + 1];
        frames[i] = (struct one_frame){s, film->rgb, film->depth, film->mask};
    }
    struct painted_take stage;
    painted_take_open(&stage, &ideal, frames, COUNT_OF(frames), &whole_measures);
    struct source_rays *rays;
    struct avatar figure;
    struct depth_frame observed;
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&figure, stage.take, rays, COUNT_OF(frames), NULL), OK);
    EXPECT_STATUS(depth_frame_open(&observed, stage.take, rays), OK);
    double own_rad[WAYS], carrier_rad[WAYS];
    for (int i = 0; i < WAYS; i++) {
        struct icp_input from = {.joint_errors = joint_noise_prior(), .start = bone_corrections_identity()};
        EXPECT_STATUS(depth_frame_read(&observed, stage.take, LEARNED - 1 + i), OK);
        EXPECT_STATUS(bone_transforms_of(&figure.bind_pose, &s, &from.joints), OK);
        for (int frame = 0; frame < 5; frame++) // as when each follows the one before
            from.start = articulated_icp(figure.tsdf, &observed, &from, NULL);
        own_rad[i] = v3_dot(t->axis, quat_to_rotation_vector(from.start.bone[t->bone].rotation));
        carrier_rad[i] = v3_dot(t->axis, quat_to_rotation_vector(from.start.bone[t->carrier].rotation));
    }
    for (int i = 1; i < WAYS; i++) {
        print_message("turned by %.2f, found %.2f, what carries it %.2f\n", turn_rad[i], own_rad[i] - own_rad[0],
                      carrier_rad[i] - carrier_rad[0]);
        EXPECT_NEAR((own_rad[i] - own_rad[0]) / turn_rad[i], 0.9, 0.3);
        EXPECT_AT_MOST(fabs(carrier_rad[i] - carrier_rad[0]), 0.05);
    }
    depth_frame_close(&observed);
    avatar_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

// It goes to the front and down, and turns outwards or inwards, seen from the toes.
static void test_foot_rotation_is_independent(void **state)
{
    (void)state;
    expect_turned_alone(
        &(struct turning_limb){JOINT_LEFT_FOOT, BONE_LEFT_FOOT, PART_LEFT_SHIN, {0, 0.05, -0.17}, {0, -1, 0}});
}

// In a tall hat, it leans over to one side or the other.
static void test_head_lean_is_independent(void **state)
{
    (void)state;
    expect_turned_alone(&(struct turning_limb){JOINT_HEAD, BONE_SKULL, PART_HEAD, {0, -0.25, 0}, {0, 0, -1}});
}

// How far joints err, as a avatar found it from frames whose joints were thrown off by up to so much along each axis.
static struct joint_noise errors_found(double thrown_m)
{
    enum { FRAMES = 10 };
    static struct painted film;
    struct rng rng = {5};
    const struct skeleton s = whole_body(0);
    struct one_frame frames[FRAMES];
    paint_person(&film, &ideal, &s, &whole_measures);
    for (int i = 0; i < FRAMES; i++) {
        frames[i] = (struct one_frame){s, film.rgb, film.depth, film.mask};
        for (int j = 0; j < JOINT_COUNT; j++)
            frames[i].skeleton.joint[j] =
                v3_add(s.joint[j],
                       v3_scale(v3(2 * rng_uniform(&rng) - 1, 2 * rng_uniform(&rng) - 1, 2 * rng_uniform(&rng) - 1),
                                thrown_m));
    }
    struct painted_take stage;
    struct source_rays *rays;
    struct avatar figure;
    painted_take_open(&stage, &ideal, frames, FRAMES, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&figure, stage.take, rays, FRAMES, NULL), OK);
    const struct joint_noise found = figure.joint_errors;
    avatar_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
    return found;
}

static void test_joint_weights_follow_noise(void **state)
{
    (void)state;
    const double THROWN_M = 0.05, middle_m = THROWN_M / sqrt(3) / sqrt(2); // the mean of its two joints' errors
    const struct joint_noise exact = errors_found(0), thrown = errors_found(THROWN_M);
    for (int p = 0; p < PART_COUNT; p++) {
        print_message("part %d: exact %.1f mm %.2f rad; thrown off by %.1f mm: %.1f mm %.2f rad\n", p,
                      1000 * exact.m[p], exact.rad[p], 1000 * middle_m, 1000 * thrown.m[p], thrown.rad[p]);
        EXPECT_AT_MOST(exact.m[p], 0.3 * middle_m);
        EXPECT_NEAR(thrown.m[p] / middle_m, 1, 0.4);
        EXPECT_AT_MOST(exact.rad[p], thrown.rad[p]);
    }
}

static double aside_of(const struct skeleton *a, const struct skeleton *b)
{
    static const enum joint ends[] = {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND,
                                      JOINT_LEFT_KNEE,  JOINT_LEFT_FOOT, JOINT_RIGHT_KNEE,  JOINT_RIGHT_FOOT};
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(ends); i++)
        sum += hypot(a->joint[ends[i]].x - b->joint[ends[i]].x, a->joint[ends[i]].y - b->joint[ends[i]].y);
    return sum / COUNT_OF(ends);
}

// The avatar of that many of a take's frames, laid on its last, whose joints are said to be `wrong`: where it has
// them.
static struct skeleton laid_on_last(const struct one_frame *frames, int count, int learned,
                                    const struct skeleton *wrong)
{
    struct painted_take stage;
    struct source_rays *rays;
    struct avatar figure;
    struct depth_frame observed;
    struct icp_input from = {.joint_errors = joint_noise_prior(), .start = bone_corrections_identity()};
    painted_take_open(&stage, &ideal, frames, count, &whole_measures);
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&figure, stage.take, rays, learned, NULL), OK);
    EXPECT_TRUE(figure.frames[0] == 0);
    EXPECT_STATUS(depth_frame_open(&observed, stage.take, rays), OK);
    EXPECT_STATUS(depth_frame_read(&observed, stage.take, count - 1), OK);
    EXPECT_STATUS(bone_transforms_of(&figure.bind_pose, wrong, &from.joints), OK);
    const struct bone_corrections found = articulated_icp(figure.tsdf, &observed, &from, NULL);
    const struct bone_transforms adjusted = bone_corrections_apply(&from.joints, &found);
    const struct skeleton laid = bone_transforms_skeleton(&figure.bind_pose, &adjusted);
    depth_frame_close(&observed);
    avatar_free(&figure);
    source_rays_close(&rays);
    painted_take_close(&stage);
    return laid;
}

// Of one frame's avatar, laid on one in which depth comes in steps of 6 cm: it hardly tells where a limb is sideways,
// but the outline does.
static void test_limbs_lie_within_silhouette(void **state)
{
    (void)state;
    enum { STEP_MM = 60 };
    static struct painted films[2];
    struct skeleton s = whole_body(0), wrong = s;
    struct one_frame frames[2];
    for (int i = 0; i < 2; i++) {
        paint_person(&films[i], &ideal, &s, &whole_measures);
        frames[i] = (struct one_frame){s, films[i].rgb, films[i].depth, films[i].mask};
    }
    for (int i = 0; i < PIXELS; i++)
        films[1].depth[i] = (uint16_t)((films[1].depth[i] + STEP_MM / 2) / STEP_MM * STEP_MM);
    for (int j = 0; j < JOINT_COUNT; j++)
        wrong.joint[j] = v3_add(s.joint[j], v3(0.03, 0, 0));
    const struct skeleton back = laid_on_last(frames, 2, 1, &wrong);
    print_message("%.1f mm aside, then %.1f mm\n", 1000 * aside_of(&wrong, &s), 1000 * aside_of(&back, &s));
    EXPECT_AT_MOST(aside_of(&back, &s), 0.009); // 18 mm by depth alone
}

// The arm hangs before the hip, and joints have it nearer to the sensor by about what it is thick: what is seen of its
// front lies where its back would be. It is not laid on that from behind.
static void test_arm_is_not_fitted_back_to_front(void **state)
{
    (void)state;
    enum { LEARNED = 5 }; // frames with the arm held apart, which make the shape sure
    const double TOO_CLOSE_M = 0.06;
    static struct painted films[2];
    static const enum joint arm[] = {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND};
    struct skeleton apart = whole_body(0), before = apart;
    struct one_frame frames[LEARNED + 1];
    before.joint[JOINT_RIGHT_ELBOW] = v3(-0.28, -0.17, 2.42);
    before.joint[JOINT_RIGHT_HAND] = v3(-0.2, 0.1, 2.42);
    paint_person(&films[0], &ideal, &apart, &whole_measures);
    paint_person(&films[1], &ideal, &before, &whole_measures);
    for (int i = 0; i < LEARNED; i++)
        frames[i] = (struct one_frame){apart, films[0].rgb, films[0].depth, films[0].mask};
    frames[LEARNED] = (struct one_frame){before, films[1].rgb, films[1].depth, films[1].mask};
    struct skeleton wrong = before;
    for (size_t i = 0; i < COUNT_OF(arm); i++)
        wrong.joint[arm[i]].z -= TOO_CLOSE_M;
    const struct skeleton laid = laid_on_last(frames, LEARNED + 1, LEARNED, &wrong);
    for (size_t i = 0; i < COUNT_OF(arm); i++) {
        const double gap_mm = 1000 * (before.joint[arm[i]].z - laid.joint[arm[i]].z);
        print_message("%s: %.0f mm too near, then %.1f mm\n", joint_name(arm[i]), 1000 * TOO_CLOSE_M, gap_mm);
        EXPECT_NEAR(gap_mm, 0, 10);
    }
}

struct patience {
    int calls, most;
    double share;
};

static bool be_patient(void *self, double share)
{
    struct patience *p = self;
    EXPECT_AT_LEAST(share, p->share);
    EXPECT_AT_MOST(share, 1);
    p->share = share;
    return ++p->calls < p->most;
}

// A avatar that comes later is drawn as paper until it is there, and then as if it
// had been there from the beginning; and whoever does not want it any more is heard.
static void test_avatar_may_come_later(void **state)
{
    (void)state;
    static struct painted film;
    static struct drawn at_once, before, after;
    static uint8_t green[PIXELS * 3];
    struct skeleton s = whole_body(0);
    paint_person(&film, &ideal, &s, &whole_measures);
    struct one_frame frame = {s, film.rgb, film.depth, film.mask};
    struct painted_take stage;
    painted_take_open(&stage, &ideal, &frame, 1, &whole_measures);
    struct renderer *p = painted_take_renderer(&stage, &ideal, DETAIL_FULL);
    draw_picture(p, POSE_IDENTITY, 0, green, &at_once);
    renderer_close(&p);

    struct source_rays *rays;
    struct avatar avatar;
    struct patience calm = {.most = INT32_MAX}, impatient = {.most = 2};
    const struct progress_watch watch = {.on_progress = be_patient, .self = &calm},
                                hasty = {.on_progress = be_patient, .self = &impatient};
    EXPECT_STATUS(source_rays_open(&rays, take_calibration(stage.take)), OK);
    EXPECT_STATUS(avatar_make(&avatar, stage.take, rays, AVATAR_FRAMES, &hasty), NOTHING);
    EXPECT_INT(impatient.calls, 2);
    EXPECT_STATUS(avatar_make(&avatar, stage.take, rays, AVATAR_FRAMES, &watch), OK);
    EXPECT_AT_LEAST(calm.calls, 3);

    struct renderer_options o = renderer_default_options();
    o.avatar_later = true;
    EXPECT_STATUS(renderer_open(&p, stage.gpu, stage.take, &ideal, &o), OK);
    draw_picture(p, POSE_IDENTITY, 0, green, &before);
    EXPECT_INT(before.result.level, DETAIL_PAPER);
    EXPECT_INT(before.result.parts, PART_COUNT);
    EXPECT_STATUS(renderer_set_avatar(p, &avatar), OK);
    int pictures = 0;
    do
        draw_picture(p, POSE_IDENTITY, 0, green, &after);
    while (!renderer_upload_done(p) && ++pictures < 100);
    print_message("%d pictures until it was all there\n", pictures);
    EXPECT_AT_LEAST(pictures, 1); // not all at once
    EXPECT_INT(after.result.level, DETAIL_FULL);
    EXPECT_TRUE(!memcmp(after.actor, at_once.actor, sizeof after.actor));
    renderer_close(&p);
    source_rays_close(&rays);
    painted_take_close(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_avatar_fits_depth),           cmocka_unit_test(test_foot_rotation_is_independent),
        cmocka_unit_test(test_joint_weights_follow_noise),  cmocka_unit_test(test_head_lean_is_independent),
        cmocka_unit_test(test_limbs_lie_within_silhouette), cmocka_unit_test(test_arm_is_not_fitted_back_to_front),
        cmocka_unit_test(test_avatar_may_come_later),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
