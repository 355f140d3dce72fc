// Stereo calibration on random sets of pairs, beside OpenCV's on the same sets, and what is said of sets that went
// wrong in the ways in which people's do. test_stereo_sets SETS [SEED]: the first part on more or other sets, a line
// for each.
#include "tests/support/test.h"

#include "tests/capture/stereo_by_opencv.h"

#include <stdio.h>

enum { SETS = SANITIZED ? 4 : 24, WRONG_SETS = SANITIZED ? 2 : 6, SEED = 11, WRONG_SEED = 12 };

static struct stereo_set set;

static enum status calibrate(struct stereo_rig *rig, struct stereo_report *report)
{
    return stereo_calibrate(&set.board, set.views, set.pairs, set.width, set.height, rig, report);
}

static double focal_error(const struct lens *left, const struct lens *right)
{
    const double ratio[4] = {left->fx / set.rig.left.fx, left->fy / set.rig.left.fy, right->fx / set.rig.right.fx,
                             right->fy / set.rig.right.fy};
    double most = 0;
    for (int i = 0; i < 4; i++)
        most = fmax(most, fabs(ratio[i] - 1));
    return most;
}

static double baseline_error(struct vec3 left_from_right)
{
    const struct vec3 truth = set.rig.left_from_right.translation;
    return v3_distance(left_from_right, truth) / v3_length(truth);
}

static struct vec3 opencv_left_from_right(const struct opencv_rig *rig)
{
    double m[3][3];
    for (int y = 0; y < 3; y++)
        for (int x = 0; x < 3; x++)
            m[y][x] = rig->right_from_left[y][x];
    const struct vec3 t = v3(rig->right_from_left[0][3], rig->right_from_left[1][3], rig->right_from_left[2][3]);
    return pose_inverse((struct pose){quat_from_matrix(m), t}).translation;
}

// What a calibration is right by, chosen by hand: five times what a good set gives.
static const double RIGHT_FOCAL = 0.02, RIGHT_BASELINE = 0.05;

struct tally {
    int ours_right, opencv_right, only_opencv, in_silence;
    double ours_focal, opencv_focal; // sums over the sets that both have right
    int both;
};

static void compare_set(int index, uint64_t seed, bool verbose, struct tally *tally)
{
    struct stereo_rig rig = {.left = {.fx = 0}};
    struct stereo_report report = {.views = 0};
    struct opencv_rig opencv = {.rms_px = 0};
    stereo_set_make(&set, seed, index);
    const enum status status = calibrate(&rig, &report);
    const double focal[2] = {focal_error(&rig.left, &rig.right), 0},
                 baseline = baseline_error(rig.left_from_right.translation);
    const bool right = status == OK && focal[0] < RIGHT_FOCAL && baseline < RIGHT_BASELINE;
    // Wrong by more than the calibration itself says, and no word of it.
    const bool in_silence = status == OK && !right && !*report.warning && focal[0] > 5 * report.focal_sigma;
    const bool solved = stereo_by_opencv(&set, &opencv) == OK;
    const double opencv_focal = focal_error(&opencv.lens[0], &opencv.lens[1]);
    const double opencv_baseline = baseline_error(opencv_left_from_right(&opencv));
    const bool opencv_right = solved && opencv_focal < RIGHT_FOCAL && opencv_baseline < RIGHT_BASELINE;
    tally->ours_right += right;
    tally->opencv_right += opencv_right;
    tally->only_opencv += opencv_right && !right;
    tally->in_silence += in_silence;
    if (right && opencv_right) {
        tally->both++;
        tally->ours_focal += focal[0];
        tally->opencv_focal += opencv_focal;
    }
    if (verbose || (opencv_right && !right) || in_silence)
        print_message(
            "set %d of seed %d: %d px, f/width %.2f, tilt %.2f rad, %d pairs, noise %.2f px | ours: %s, focal "
            "%.3f %%, baseline %.3f %%, rms %.3f px, sigma %.3f %% | OpenCV: %s, focal %.3f %%, baseline %.3f "
            "%%, rms %.3f px | %s\n",
            index, (int)seed, set.width, set.rig.left.fx / set.width, set.tilt_rad, set.pairs, set.noise_px,
            right ? "right" : "wrong", 100 * focal[0], 100 * baseline, report.rms_px[0], 100 * report.focal_sigma,
            opencv_right ? "right" : "wrong", 100 * opencv_focal, 100 * opencv_baseline, opencv.rms_px,
            status == OK ? report.warning : status_message());
}

static struct tally compare_sets(int sets, uint64_t seed, bool verbose)
{
    struct tally tally = {.both = 0};
    for (int i = 0; i < sets; i++)
        compare_set(i, seed, verbose, &tally);
    print_message("seed %d: %d sets; right: ours %d, OpenCV %d, OpenCV alone %d; wrong without a word: ours %d; mean "
                  "focal error where both are right: ours %.4f %%, OpenCV %.4f %%\n",
                  (int)seed, sets, tally.ours_right, tally.opencv_right, tally.only_opencv, tally.in_silence,
                  100 * tally.ours_focal / tally.both, 100 * tally.opencv_focal / tally.both);
    return tally;
}

static void test_as_robust_as_opencv(void **state)
{
    (void)state;
    const struct tally tally = compare_sets(SETS, SEED, false);
    EXPECT_INT(tally.only_opencv, 0);
    EXPECT_INT(tally.in_silence, 0);
    EXPECT_AT_MOST(tally.ours_focal, tally.opencv_focal);
}

// ------------------------------------------------------------- sets that went wrong

// The bounds and the fisheye's angles were chosen while looking at sets of SEED; these were left out.

// The sets are made once: that takes as long as calibrating by them.
static void make(int index)
{
    static struct stereo_set made[WRONG_SETS];
    if (!made[index].pairs)
        stereo_set_make(&made[index], WRONG_SEED, index);
    set = made[index];
    for (int v = 0; v < set.pairs; v++)
        for (int camera = 0; camera < 2; camera++)
            set.views[v].circles[camera] = set.circles[v][camera];
    print_message("set %d of seed %d, %d pairs, tilt %.2f rad\n", index, WRONG_SEED, set.pairs, set.tilt_rad);
}

static void expect_refused(const char *says)
{
    struct stereo_rig rig;
    struct stereo_report report;
    EXPECT_STATUS(calibrate(&rig, &report), ERR_INPUT);
    EXPECT_SAYS(says);
}

// Gives each left picture the right picture `order[v]`.
static void reorder_right(const int *order)
{
    struct stereo_view was[STEREO_SET_MOST_PAIRS];
    memcpy(was, set.views, sizeof was);
    for (int v = 0; v < set.pairs; v++) {
        set.views[v].circles[1] = was[order[v]].circles[1];
        set.views[v].count[1] = was[order[v]].count[1];
    }
}

static void test_shuffled_pairs(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        int order[STEREO_SET_MOST_PAIRS];
        make(i);
        for (int v = 0; v < set.pairs; v++)
            order[v] = (v * 7 + 5) % set.pairs; // no constant step where 7 divides not the count
        for (int v = 0; v < set.pairs && set.pairs % 7 == 0; v++)
            order[v] = set.pairs - 1 - v;
        reorder_right(order);
        expect_refused("do not belong together");
    }
}

static void test_pairs_out_of_step(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        int order[STEREO_SET_MOST_PAIRS];
        make(i);
        const int shift = 1 + i % 3;
        for (int v = 0; v < set.pairs; v++)
            order[v] = (v + set.pairs - shift) % set.pairs;
        reorder_right(order);
        expect_refused("out of step");
    }
}

static void test_one_pair_of_two_instants(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        struct stereo_rig rig;
        struct stereo_report report;
        int order[STEREO_SET_MOST_PAIRS];
        make(i);
        for (int v = 0; v < set.pairs; v++)
            order[v] = v;
        order[2] = 5;
        order[5] = 2;
        set.views[2].name = "third.png";
        reorder_right(order);
        EXPECT_STATUS(calibrate(&rig, &report), OK);
        EXPECT_INT(report.left_out, 2);
        EXPECT_TRUE(strstr(report.warning, "'third.png' first") != NULL);
        EXPECT_AT_MOST(focal_error(&rig.left, &rig.right), RIGHT_FOCAL);
        EXPECT_AT_MOST(baseline_error(rig.left_from_right.translation), RIGHT_BASELINE);
    }
}

// The pictures of a rig with the two cameras of another one.
static void test_two_cameras_that_have_nothing_to_do_with_each_other(void **state)
{
    (void)state;
    static struct stereo_set other;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        int k = 100 + i;
        do
            stereo_set_make(&other, WRONG_SEED, k++);
        while (other.pairs < set.pairs);
        for (int v = 0; v < set.pairs; v++) {
            set.views[v].circles[1] = other.views[v].circles[1];
            set.views[v].count[1] = other.views[v].count[1];
        }
        struct stereo_rig rig;
        struct stereo_report report;
        EXPECT_STATUS(calibrate(&rig, &report), ERR_INPUT);
    }
}

static void mirror(int camera)
{
    for (int v = 0; v < set.pairs; v++)
        for (int i = 0; i < set.views[v].count[camera]; i++) {
            struct circle *c = &set.circles[v][camera][i];
            const int column = c->column;
            c->at.x = set.width - 1 - c->at.x;
            c->column = c->row; // the lattice's sense of rotation stays
            c->row = column;
        }
}

static void test_a_mirrored_camera(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        mirror(i % 2);
        expect_refused("mirrored");
    }
}

static void expect_warning(const char *says)
{
    struct stereo_rig rig;
    struct stereo_report report;
    EXPECT_STATUS(calibrate(&rig, &report), OK);
    if (!strstr(report.warning, says))
        print_error("'%s' does not say '%s'\n", report.warning, says);
    EXPECT_TRUE(strstr(report.warning, says) != NULL);
}

static void test_exchanged_folders(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        for (int v = 0; v < set.pairs; v++) {
            const struct stereo_view was = set.views[v];
            set.views[v].circles[0] = was.circles[1];
            set.views[v].circles[1] = was.circles[0];
            set.views[v].count[0] = was.count[1];
            set.views[v].count[1] = was.count[0];
        }
        expect_warning("are exchanged");
        make(i);
        mirror(0);
        mirror(1);
        expect_warning("mirrored");
    }
}

// A camera that hangs upside down beside one that does not.
static void test_a_camera_upside_down(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        struct stereo_rig rig;
        struct stereo_report report;
        make(i);
        for (int v = 0; v < set.pairs; v++)
            for (int k = 0; k < set.views[v].count[1]; k++) {
                struct circle *c = &set.circles[v][1][k];
                c->at = (struct pixel){set.width - 1 - c->at.x, set.height - 1 - c->at.y};
            }
        EXPECT_STATUS(calibrate(&rig, &report), OK);
        EXPECT_AT_MOST(baseline_error(rig.left_from_right.translation), RIGHT_BASELINE);
        EXPECT_NEAR(pose_angle(rig.left_from_right, set.rig.left_from_right), M_PI, 0.05);
    }
}

// The board was carried on while one camera waited for its picture.
static void test_pictures_of_two_instants(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        struct rng rng = {(uint64_t)WRONG_SEED + (uint64_t)i};
        make(i);
        for (int v = 0; v < set.pairs; v++) {
            const double dx = rng_between(&rng, -0.012, 0.012) * set.width;
            const double dy = rng_between(&rng, -0.012, 0.012) * set.width;
            for (int k = 0; k < set.views[v].count[1]; k++) {
                set.circles[v][1][k].at.x += dx;
                set.circles[v][1][k].at.y += dy;
            }
        }
        expect_refused("same instant");
    }
}

static void test_the_same_picture_again_and_again(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        for (int v = 0; v < set.pairs; v++)
            set.views[v] = set.views[v % 3];
        expect_refused("stands still");
    }
}

static void test_one_camera_twice(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        for (int v = 0; v < set.pairs; v++) {
            set.views[v].circles[1] = set.views[v].circles[0];
            set.views[v].count[1] = set.views[v].count[0];
        }
        expect_refused("the same pictures");
    }
}

static void test_a_board_that_was_not_turned(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        struct rng rng = {(uint64_t)WRONG_SEED + (uint64_t)i};
        make(i);
        // What a frontal board gives: a lattice of one scale, moved in the picture's plane.
        for (int v = 0; v < set.pairs; v++)
            for (int camera = 0; camera < 2; camera++) {
                const double step = 0.05 * set.width, x = rng_between(&rng, 0, 0.1) * set.width;
                set.views[v].count[camera] = 0;
                for (int row = 0; row < set.board.rows; row++)
                    for (int column = 0; column < set.board.columns; column++) {
                        const double noise = rng_normal(&rng) * 0.05;
                        set.circles[v][camera][set.views[v].count[camera]++] = (struct circle){
                            {x + step * column + noise, x + step * row}, step * step * 0.28, column, row};
                    }
            }
        expect_refused("turned too little");
    }
}

// A true fisheye's pictures: equidistant, or equisolid as many are; the corners are `half_angle_deg` from the axis.
static void bend(int camera, double half_angle_deg, bool equisolid)
{
    const struct lens *l = camera ? &set.rig.right : &set.rig.left;
    const double corner = hypot(set.width, set.height) / 2, half = half_angle_deg * M_PI / 180;
    for (int v = 0; v < set.pairs; v++)
        for (int k = 0; k < set.views[v].count[camera]; k++) {
            struct pixel *at = &set.circles[v][camera][k].at;
            const double x = at->x - l->cx, y = at->y - l->cy, r = hypot(x, y);
            // The set's picture is taken for the middle of a pinhole picture that reaches out to the half angle.
            const double angle = atan(r / corner * tan(half));
            const double bent = corner * (equisolid ? sin(angle / 2) / sin(half / 2) : angle / half);
            *at = (struct pixel){l->cx + x * bent / r, l->cy + y * bent / r};
        }
}

static void test_a_fisheye(void **state)
{
    (void)state;
    int named = 0, seen = 0;
    for (int i = 0; i < WRONG_SETS; i++) {
        struct stereo_rig rig;
        struct stereo_report report;
        make(i);
        bend(i % 2, 75 + i % 3 * 4, i % 4 == 1);
        const enum status status = calibrate(&rig, &report);
        print_message("  %s\n", status == OK ? "calibrated" : status_message());
        // A board far away fills the middle alone, which a pinhole explains: such a set may be calibrated.
        named += status == ERR_INPUT && strstr(status_message(), "fisheye") != NULL;
        seen += status == ERR_INPUT;
    }
    // Now and then an equisolid one is taken for a bent board.
    EXPECT_AT_LEAST(named, 0.75 * seen);
    EXPECT_AT_LEAST(seen, WRONG_SETS / 2);
}

static void test_another_board_than_was_said(void **state)
{
    (void)state;
    for (int i = 0; i < WRONG_SETS; i++) {
        make(i);
        set.board.columns--;
        set.board.rows--;
        expect_refused("more circles than was said");
        make(i);
        set.board.columns += 3;
        expect_refused("at most");
    }
}

int main(int count, char **arguments)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_robust_as_opencv),
        cmocka_unit_test(test_shuffled_pairs),
        cmocka_unit_test(test_pairs_out_of_step),
        cmocka_unit_test(test_one_pair_of_two_instants),
        cmocka_unit_test(test_two_cameras_that_have_nothing_to_do_with_each_other),
        cmocka_unit_test(test_a_mirrored_camera),
        cmocka_unit_test(test_exchanged_folders),
        cmocka_unit_test(test_a_camera_upside_down),
        cmocka_unit_test(test_pictures_of_two_instants),
        cmocka_unit_test(test_the_same_picture_again_and_again),
        cmocka_unit_test(test_one_camera_twice),
        cmocka_unit_test(test_a_board_that_was_not_turned),
        cmocka_unit_test(test_a_fisheye),
        cmocka_unit_test(test_another_board_than_was_said),
    };
    if (count > 1) {
        (void)compare_sets(atoi(arguments[1]), count > 2 ? (uint64_t)atoi(arguments[2]) : SEED, true);
        return 0;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
