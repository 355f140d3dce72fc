// A frame that is darker or brighter than the others is told to be so by what it shows of the person, and the sides it
// does not show are drawn as dark.
#include "tests/test.h"

#include "platform/jpeg.h"
#include "reenact/frame_loader.h"
#include "tests/support/rehearsed.h"

#include <stdlib.h>
#include <string.h>

enum { FRAME = 2, JPEG_QUALITY = 98 };

static struct rehearsed rehearsed;

// What is done to a pixel of the frame. across: 0 to 1, from the left of the person's box to the right.
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

// The take once more, FRAME changed.
static struct changed change_take(const char *name, changing *change)
{
    const struct lens *lens = &take_calibration(rehearsed.take)->color;
    struct recording_writer *writer;
    EXPECT_STATUS(recording_append(&writer, rehearsed.rehearsal.file), OK);
    EXPECT_STATUS(recording_begin_take(writer, name, take_calibration(rehearsed.take)), OK);
    for (int64_t i = 0; i < take_frame_count(rehearsed.take); i++) {
        const struct take_entry *e = take_entry(rehearsed.take, i);
        struct take_pictures seen;
        EXPECT_STATUS(take_read(rehearsed.take, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &seen), OK);
        uint8_t *rgb = malloc(3 * (size_t)lens->width * (size_t)lens->height), *jpeg;
        size_t bytes;
        memcpy(rgb, seen.color, 3 * (size_t)lens->width * (size_t)lens->height);
        int left = lens->width, right = -1;
        for (int p = 0; p < lens->width * lens->height; p++)
            if (seen.mask[p]) {
                const int x = p % lens->width;
                left = x < left ? x : left, right = x > right ? x : right;
            }
        for (int p = 0; p < 3 * lens->width * lens->height && i == FRAME; p++)
            rgb[p] = (uint8_t)change(rgb[p], (p / 3 % lens->width - left) / (double)(right - left));
        EXPECT_STATUS(jpeg_encode(rgb, lens->width, lens->height, JPEG_QUALITY, &jpeg, &bytes), OK);
        const struct take_frame frame = {e->time_ns, e->world_from_camera, e->located, jpeg, bytes, seen.depth,
                                         seen.mask,  e->has_skeleton,      e->skeleton};
        EXPECT_STATUS(recording_add_frame(writer, &frame), OK);
        free(jpeg);
        free(rgb);
    }
    EXPECT_STATUS(recording_put_body(writer, take_body(rehearsed.take)), OK);
    EXPECT_STATUS(recording_end_take(writer), OK);
    EXPECT_STATUS(recording_close(&writer), OK);
    struct changed out;
    EXPECT_STATUS(recording_open(&out.recording, rehearsed.rehearsal.file), OK);
    EXPECT_STATUS(take_open(&out.take, out.recording, name), OK);
    return out;
}

static void load(struct take *of, struct loaded_frame *out)
{
    struct frame_loader *loader;
    EXPECT_STATUS(frame_loader_open(&loader, of, rehearsed.rays, &rehearsed.likeness), OK);
    EXPECT_STATUS(frame_loader_load(loader, FRAME, out), OK);
    EXPECT_TRUE(out->seen);
    frame_loader_close(&loader);
}

// Compared with the frame as it is; and all points' light goes with it.
static double ratio(const char *name, changing *change)
{
    struct loaded_frame as_it_is, other;
    struct changed changed = change_take(name, change);
    load(rehearsed.take, &as_it_is);
    load(changed.take, &other);
    const double found = (double)(other.brighter / as_it_is.brighter);
    print_message("%s: %.3f, as it is %.3f; ratio %.3f\n", name, (double)other.brighter, (double)as_it_is.brighter,
                  found);
    for (int i = 0; i < other.point_count; i++) // whichever way they face
        EXPECT_NEAR((double)other.points[i].light, (double)as_it_is.points[i].light * found, 1e-5);
    loaded_frame_free(&as_it_is);
    loaded_frame_free(&other);
    take_close(&changed.take);
    recording_free(&changed.recording);
    return found;
}

static void a_darker_frame_is_told(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("darker", darker), 0.7, 0.03);
}

static void a_brighter_frame_is_told(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("brighter", brighter), 1.2, 0.03);
}

// Glare, or somebody else's hand.
static void what_is_odd_does_not_count(void **state)
{
    (void)state;
    EXPECT_NEAR(ratio("glaring", glaring_on_one_side), 1, 0.03);
}

static void nobody_turns_black(void **state)
{
    (void)state;
    EXPECT_AT_LEAST(ratio("black", black), 0.6);
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
        cmocka_unit_test(a_darker_frame_is_told),
        cmocka_unit_test(a_brighter_frame_is_told),
        cmocka_unit_test(what_is_odd_does_not_count),
        cmocka_unit_test(nobody_turns_black),
    };
    return cmocka_run_group_tests(tests, make, end);
}
