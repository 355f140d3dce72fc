// reenact-capture map --objects and objects --camera, as a user runs them: a poster of the rendered room is the known
// thing, found while mapping by depth, and again by a tablet's camera in the mapped place.
#include "tests/support/test.h"

#include "platform/files/png.h"
#include "recording/recorded_things.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char program[] = PROGRAM_DIR "/reenact-capture";
enum { SWEEP = 30 };

// The poster with words on the back wall: the middle of its front, and its size (tests/world/scene.c).
static const struct vec3 poster = {-0.58, 3.6, 1.62};
static const double wide_m = 0.70, high_m = 0.98;

static struct scratch scratch;
static struct world *world;
static char file[256], objects[256], tags[256], sweep[300];

// A photograph of it from straight before it, with some of the even wall around it.
static void photograph(void)
{
    const double away = 1.3, f = 650, margin = 1.08;
    struct lens lens = {
        .width = (int)(margin * f * wide_m / away), .height = (int)(margin * f * high_m / away), .fx = f, .fy = f};
    lens.cx = (lens.width - 1) / 2.0;
    lens.cy = (lens.height - 1) / 2.0;
    const double half = sqrt(0.5);
    const struct pose before = {{-half, 0, 0, half}, {poster.x, poster.y - away, poster.z}};
    uint8_t *rgb = malloc((size_t)lens.width * (size_t)lens.height * 3);
    const struct world_shot shot = {lens, before, 0, false};
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = rgb}), OK);
    EXPECT_STATUS(png_write(scratch_file(&scratch, "poster.png"), PNG_RGB8, rgb, lens.width, lens.height), OK);
    free(rgb);
}

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.threads = 2;
    scratch = scratch_make();
    if (world_open(&world, &options) != OK)
        return 1;
    film_sweep(world, &scratch, "sweep", 1, SWEEP, "tags.json");
    rehearse_camera(&scratch, "viewer", world, 1);
    photograph();
    scratch_text(&scratch, "objects.json",
                 "{\"objects\": [{\"name\": \"poster\", \"picture\": \"poster.png\", \"width_m\": 0.70, "
                 "\"height_m\": 0.98, \"url\": \"\"}]}");
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "room.reenact"));
    snprintf(objects, sizeof objects, "%s", scratch_file(&scratch, "objects.json"));
    snprintf(tags, sizeof tags, "%s", scratch_file(&scratch, "tags.json"));
    snprintf(sweep, sizeof sweep, "folder:%s", scratch_file(&scratch, "sweep"));
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

// The poster as the file has it, in the place's axes, and a tag of the place to compare with.
static struct recorded_thing read_poster(struct place *place)
{
    struct recording *r;
    struct recorded_thing *things, found;
    int count;
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_things(r, &things, &count), OK);
    EXPECT_INT(count, 1);
    assert_string_equal(things[0].name, "poster");
    found = things[0];
    recorded_things_free(&things, count);
    EXPECT_STATUS(recording_read_map(r, place), OK);
    recording_free(&r);
    return found;
}

// The thing's distance from every tag is the same in the place's axes and in the world's.
static void check_place(const struct recorded_thing *found, const struct place *place, double max_m)
{
    double worst = 0;
    int32_t count;
    const struct place_tag *truth = world_tags(world, &count);
    for (int32_t i = 0; i < place->tag_count; i++)
        for (int32_t k = 0; k < count; k++)
            if (truth[k].id == place->tags[i].id) {
                const double is =
                    v3_distance(found->world_from_thing.translation, place->tags[i].world_from_tag.translation);
                worst = fmax(worst, fabs(is - v3_distance(poster, truth[k].world_from_tag.translation)));
            }
    print_message("%d sightings, standard deviation %.1f mm; distances from %d tags off by %.1f mm at most\n",
                  (int)found->sightings, 1e3 * sqrt(covariance3_trace(&found->covariance)), (int)place->tag_count,
                  1e3 * worst);
    EXPECT_AT_LEAST(place->tag_count, 3);
    EXPECT_AT_MOST(worst, max_m);
}

static void test_found_while_mapping(void **state)
{
    (void)state;
    struct place place = {0};
    struct process_result r =
        PROCESS(program, "map", "--sensor", sweep, "--tags", tags, "--out", file, "--objects", objects);
    if (r.exit_code)
        print_error("%s\n", r.err);
    EXPECT_INT(r.exit_code, 0);
    EXPECT_TRUE(strstr(r.out, "1 things were found"));
    const struct recorded_thing found = read_poster(&place);
    check_place(&found, &place, 0.03);
    EXPECT_AT_LEAST(found.sightings, 1);
    place_free(&place);
    EXPECT_INT(
        PROCESS(program, "map", "--sensor", sweep, "--tags", tags, "--out", "x", "--objects", "/no/such").exit_code,
        1); // before the sweep
}

static void test_found_by_one_camera(void **state)
{
    (void)state;
    struct place place = {0};
    char camera[300];
    snprintf(camera, sizeof camera, "folder:%s", scratch_file(&scratch, "viewer"));
    struct process_result r = PROCESS(program, "objects", "--camera", camera, "--objects", objects, "--into", file);
    if (r.exit_code)
        print_error("%s\n", r.err);
    EXPECT_INT(r.exit_code, 0);
    print_message("%s", r.out);
    const struct recorded_thing found = read_poster(&place);
    check_place(&found, &place, 0.15); // 4 to 5 m away, by its size alone
    place_free(&place);
    EXPECT_INT(PROCESS(program, "objects", "--camera", camera, "--objects", objects).exit_code, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found_while_mapping),
        cmocka_unit_test(test_found_by_one_camera),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
