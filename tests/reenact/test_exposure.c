// The exposure gain of a frame that is darker or brighter than the others is found from what it shows of the actor, and
// applied to all points.
#include "tests/support/test.h"

#include "reenact/frame/frame_layer.h"
#include "tests/support/rehearsed.h"
#include "tests/support/retake.h"

enum { FRAME = 2 };

static struct rehearsed rehearsed;

// Changes a colour value of the frame. across: 0..1 from the left of the actor's bounds to the right.
typedef int changing(int value, double across);

static int darker(int value, double across)
{
    (void)across;
    return value * 7 / 10;
}

static int brighter(int value, double across)
{
    (void)across;
    return value * 6 / 5 < 255 ? value * 6 / 5 : 255;
}

static int black(int value, double across)
{
    (void)value, (void)across;
    return 0;
}

static int glaring_on_one_side(int value, double across) { return across < 0.25 ? 255 : value; }

struct changed {
    struct recording *recording;
    struct take *take;
};

static void change_frame(void *self, struct retaken *f)
{
    changing *const *change = self;
    const int pixels = f->width * f->height;
    int left = f->width, right = -1;
    for (int p = 0; p < pixels; p++)
        if (f->mask[p]) {
            const int x = p % f->width;
            left = x < left ? x : left, right = x > right ? x : right;
        }
    for (int p = 0; p < 3 * pixels && f->number == FRAME; p++)
        f->rgb[p] = (uint8_t)(*change)(f->rgb[p], (p / 3 % f->width - left) / (double)(right - left));
}

// A copy of the take with FRAME changed.
static struct changed change_take(const char *name, changing *change)
{
    struct changed out;
    retake(rehearsed.rehearsal.file, "turn", name, change_frame, &change);
    EXPECT_STATUS(recording_open(&out.recording, rehearsed.rehearsal.file), OK);
    EXPECT_STATUS(take_open(&out.take, out.recording, name), OK);
    return out;
}

static void load(struct take *of, struct frame_layer *out)
{
    struct take_skeletons *skeletons;
    struct frame_layer_loader *loader;
    EXPECT_STATUS(take_skeletons_open(&skeletons, of), OK);
    const struct frame_source source = {of, skeletons, rehearsed.rays};
    EXPECT_STATUS(frame_layer_loader_open(&loader, &source, &rehearsed.avatar), OK);
    EXPECT_STATUS(frame_layer_loader_load(loader, FRAME, out), OK);
    EXPECT_TRUE(out->has_images);
    frame_layer_loader_close(&loader);
    take_skeletons_close(&skeletons);
}

// Gain relative to the unchanged frame's; checks that all points' irradiance is multiplied by it.
static double ratio(const char *name, changing *change)
{
    struct frame_layer as_it_is, other;
    struct changed changed = change_take(name, change);
    load(rehearsed.take, &as_it_is);
    load(changed.take, &other);
    const double found = (double)(other.exposure_gain / as_it_is.exposure_gain);
    print_message("%s: %.3f, as it is %.3f; ratio %.3f\n", name, (double)other.exposure_gain,
                  (double)as_it_is.exposure_gain, found);
    for (int i = 0; i < other.point_count; i++) // whether visible or not
        EXPECT_NEAR((double)other.points[i].irradiance, (double)as_it_is.points[i].irradiance * found, 1e-5);
    frame_layer_free(&as_it_is);
    frame_layer_free(&other);
    take_close(&changed.take);
    recording_free(&changed.recording);
    return found;
}

static void test_darker_frame_exposure(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("darker", darker), 0.7, 0.025);
}

static void test_brighter_frame_exposure(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("brighter", brighter), 1.2, 0.025);
}

// Glare, or another person's hand.
static void test_outliers_are_ignored(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("glaring", glaring_on_one_side), 1, 0.025);
}

static void test_actor_is_not_blackened(void **state)
{
    (void)state;
    EXPECT_AT_LEAST(ratio("black", black), 0.7);
}

static int make(void **state)
{
    (void)state;
    EXPECT_STATUS(rehearsed_open(&rehearsed, REHEARSAL_FRAMES), OK);
    return 0;
}

static int end(void **state)
{
    (void)state;
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_darker_frame_exposure),
        cmocka_unit_test(test_brighter_frame_exposure),
        cmocka_unit_test(test_outliers_are_ignored),
        cmocka_unit_test(test_actor_is_not_blackened),
    };
    return cmocka_run_group_tests(tests, make, end);
}
