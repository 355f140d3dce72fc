// A live sensor that is unplugged while an attempt is made and kept, and comes back as another one, with smaller images
// and timestamps that start again; and one without colour. OpenNI2's fake sensor.
#include "tests/support/test.h"

#include "app/live/live_keeper.h"
#include "app/live/live_sensor.h"
#include "base/clock.h"
#include "platform/sensors/source.h"
#include "recording/depth_picture.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/film.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct scratch scratch;

static void fake(const char *name, const char *value)
{
    char full[64];
    snprintf(full, sizeof full, "REENACT_FAKE_SENSOR%s%s", *name ? "_" : "", name);
    setenv(full, value, 1);
}

static const char *folder_of(const char *name)
{
    static char path[300];
    snprintf(path, sizeof path, "%s", scratch_file(&scratch, name));
    return path;
}

// Until the sensor gave `more` frames of that width, or, with width 0, until it is in trouble.
static void wait_for(struct live_sensor *s, int width, int more)
{
    const int64_t until_ns = clock_now_ns() + INT64_C(60000000000);
    int64_t last = 0;
    int count = 0;
    bool done = false;
    while (!done && clock_now_ns() < until_ns) {
        clock_sleep_until_ns(clock_now_ns() + 5000000);
        const struct live_frame *f = live_sensor_latest(s);
        count += f && f->number != last && f->calibration.depth.width == width;
        last = f ? f->number : last;
        done = width ? count >= more : strstr(live_sensor_query(s).trouble, "unplugged") != NULL;
    }
    EXPECT_TRUE(done);
}

static void keep(struct live_keeper *k, const char *wanted)
{
    const int before = live_keeper_query(k).kept;
    const int64_t until_ns = clock_now_ns() + INT64_C(20000000000);
    live_keeper_keep(k);
    while (live_keeper_query(k).kept == before && clock_now_ns() < until_ns)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    const struct live_keeper_state state = live_keeper_query(k);
    if (state.failed || !strstr(state.sentence, wanted))
        print_error("%s\n", state.sentence);
    EXPECT_TRUE(!state.failed && strstr(state.sentence, wanted));
}

static void expect_take(const char *file, const char *name, int width, int64_t least, int64_t most)
{
    struct recording *r;
    struct take *take;
    struct take_images images;
    struct recording_report report;
    EXPECT_STATUS(recording_verify(scratch_file(&scratch, file), &report), OK);
    EXPECT_STATUS(recording_open(&r, scratch_file(&scratch, file)), OK);
    EXPECT_STATUS(take_open(&take, r, name), OK);
    EXPECT_TRUE(take_is_complete(take));
    EXPECT_INT(take_calibration(take)->depth.width, width);
    EXPECT_AT_LEAST((double)take_frame_count(take), (double)least);
    EXPECT_AT_MOST((double)take_frame_count(take), (double)most);
    for (int64_t i = 0; i < take_frame_count(take); i++)
        EXPECT_STATUS(take_read(take, i, TAKE_COLOR | TAKE_DEPTH, &images), OK);
    take_close(&take);
    recording_free(&r);
}

static void test_another_sensor_in_its_place(void **state)
{
    (void)state;
    struct live_sensor *sensor;
    struct live_keeper *keeper;
    const char *watched = scratch_file(&scratch, "form.reenact"); // need not be there
    fake("", folder_of("large"));
    fake("FPS", "15");
    fake("AT_END", "loop");
    fake("UNPLUG_AFTER", "14");
    EXPECT_STATUS(live_keeper_open(&keeper, &(struct live_keeper_options){.watched = watched}), OK);
    const struct live_sensor_options options = {.sensor = "openni", .keeper = keeper, .no_body_points = true};
    EXPECT_STATUS(live_sensor_open(&sensor, &options), OK);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 1, .run = true});
    wait_for(sensor, 0, 0);
    fake("", folder_of("small"));
    fake("UNPLUG_AFTER", "-1");
    wait_for(sensor, 160, 6); // the attempt goes on, for the judge
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 1, .run = false});
    wait_for(sensor, 160, 1);
    keep(keeper, "form-attempt-1.reenact");
    expect_take("form-attempt-1.reenact", "attempt 1", 320, 1, 15);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 2, .run = true});
    wait_for(sensor, 160, 4);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 2, .run = false});
    wait_for(sensor, 160, 2);
    keep(keeper, "form-attempt-2.reenact");
    expect_take("form-attempt-2.reenact", "attempt 2", 160, 1, 1000);
    live_sensor_close(&sensor);
    live_keeper_close(&keeper);
}

// The mirror shows its depth; what is kept of the attempt has no colour.
static void test_sensor_without_color(void **state)
{
    (void)state;
    struct live_sensor *sensor;
    struct live_keeper *keeper;
    struct recording *r;
    struct take *take;
    fake("", folder_of("colorless"));
    fake("FPS", "15");
    fake("UNPLUG_AFTER", "-1");
    const char *watched = scratch_file(&scratch, "depth.reenact");
    EXPECT_STATUS(live_keeper_open(&keeper, &(struct live_keeper_options){.watched = watched}), OK);
    const struct live_sensor_options options = {.sensor = "openni", .keeper = keeper};
    EXPECT_STATUS(live_sensor_open(&sensor, &options), OK);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 1, .run = true});
    wait_for(sensor, 160, 6);
    const struct live_frame *f = live_sensor_latest(sensor);
    EXPECT_TRUE(f->rgb && lens_equal(&f->calibration.color, &f->calibration.depth));
    int person = 0, light = 0;
    for (int i = 0; i < 160 * 120; i++) {
        person += f->mask[i] && f->depth[i];
        light += f->rgb[3 * i] > f->rgb[3 * i + 2]; // the person's colour; all else is grey
    }
    print_message("%d pixels of a person, %d in their colour\n", person, light);
    EXPECT_AT_LEAST(person, 100);
    EXPECT_INT(light, person);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 1, .run = false});
    wait_for(sensor, 160, 2);
    keep(keeper, "depth-attempt-1.reenact");
    live_sensor_close(&sensor);
    live_keeper_close(&keeper);
    EXPECT_STATUS(recording_open(&r, scratch_file(&scratch, "depth-attempt-1.reenact")), OK);
    EXPECT_STATUS(take_open(&take, r, "attempt 1"), OK);
    EXPECT_TRUE(!take_calibration(take)->color.width && take_entry(take, 0)->has_depth);
    take_close(&take);
    recording_free(&r);
}

// The folder `from` as a sensor without colour films it.
static void film_without_color(const char *from, const char *to)
{
    char command[1200], path[400];
    struct calibration calibration;
    snprintf(path, sizeof path, "%s/calibration.json", folder_of(from));
    EXPECT_STATUS(calibration_read(path, &calibration), OK);
    calibration.color = (struct lens){0};
    snprintf(command, sizeof command, "mkdir %s && cd %s && ln -s ../%s/depth ../%s/depth.txt .",
             scratch_file(&scratch, to), scratch_file(&scratch, to), from, from);
    EXPECT_INT(system(command), 0);
    snprintf(path, sizeof path, "%s/calibration.json", folder_of(to));
    EXPECT_STATUS(calibration_write(path, &calibration), OK);
}

// The folder `from` as a sensor films it whose colour camera fails after that many images.
static void film_failing_color(const char *from, const char *to, int images)
{
    char command[1600];
    snprintf(command, sizeof command,
             "mkdir %s && cd %s && ln -s ../%s/rgb ../%s/depth ../%s/depth.txt ../%s/calibration.json . && "
             "grep -v '^#' ../%s/rgb.txt | head -n %d > rgb.txt",
             scratch_file(&scratch, to), scratch_file(&scratch, to), from, from, from, from, from, images);
    EXPECT_INT(system(command), 0);
}

// Its last images stay for half a second, then the mirror shows depth.
static void test_color_camera_fails(void **state)
{
    (void)state;
    enum { IMAGES = 4 };
    struct live_sensor *sensor;
    char uri[400];
    int64_t first_drawn = 0, last = 0;
    film_failing_color("small", "failing", IMAGES);
    snprintf(uri, sizeof uri, "folder:%s", folder_of("failing"));
    const struct live_sensor_options options = {.sensor = uri, .every_frame = true, .no_body_points = true};
    EXPECT_STATUS(live_sensor_open(&sensor, &options), OK);
    live_sensor_wish(sensor, &(struct live_wish){.attempt = 1, .run = true});
    const int64_t until_ns = clock_now_ns() + INT64_C(60000000000);
    for (bool ended = false; !ended && clock_now_ns() < until_ns;) {
        ended = live_sensor_query(sensor).ended; // then the last frame is there
        const struct live_frame *f = live_sensor_latest(sensor);
        if (f && f->number != last) {
            last = f->number;
            first_drawn = f->rgb && f->number > IMAGES && !first_drawn ? f->number : first_drawn;
            if (f->number < IMAGES + DEPTH_PICTURE_AFTER)
                EXPECT_TRUE((f->rgb != NULL) == (f->number <= IMAGES));
            else
                EXPECT_TRUE(f->rgb && lens_equal(&f->calibration.color, &f->calibration.depth));
        }
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    print_message("colour in %d frames, depth from frame %lld of %lld on\n", IMAGES, (long long)first_drawn,
                  (long long)last);
    EXPECT_AT_LEAST((double)first_drawn, IMAGES + DEPTH_PICTURE_AFTER);
    live_sensor_close(&sensor);
}

static int make(void **state)
{
    (void)state;
    struct world *world;
    struct world_options options = world_default_options();
    options.threads = 2;
    scratch = scratch_make();
    if (world_open(&world, &options) != OK)
        return -1;
    film_sensor(world, &scratch, "large", 0.5, 0.5, 30);
    film_sensor(world, &scratch, "small", 0.25, 0.5, 30);
    film_without_color("small", "colorless");
    world_close(&world);
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    keep_player();
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_another_sensor_in_its_place),
                                       cmocka_unit_test(test_sensor_without_color),
                                       cmocka_unit_test(test_color_camera_fails)};
    return cmocka_run_group_tests(tests, make, tidy);
}
