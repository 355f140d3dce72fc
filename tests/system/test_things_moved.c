// Things of a place over time, as a user keeps them: the rendered room is mapped with what stands in it, then one thing
// is taken away and one moved, and it is swept again into the same file. What is gone is marked, what was moved is
// where it is now, the rest stays; info says so.
#include "tests/support/test.h"

#include "platform/files/json.h"
#include "platform/files/png.h"
#include "recording/recorded_things.h"
#include "tests/support/align.h"
#include "tests/support/desk.h"
#include "tests/support/film.h"
#include "tests/support/process.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char program[] = PROGRAM_DIR "/reenact-capture";

enum { STAYS, MOVED, AWAY, BOARDS, FRAMES = 32, SEED = 12 };
static const char *const names[BOARDS] = {"board", "sign", "poster"};
static const int painted[BOARDS] = {0, 4, 5}; // the flat ones of tests/support/desk.h
#define LARGER 2.4                            // than on a desk

static struct scratch scratch;
static struct world *world;
static struct desk desk;
static struct film_board before[BOARDS], after[BOARDS];
static char file[256];

// Upright in the middle of the room's height, `away` metres from its middle at a bearing (radians, clockwise from
// y), facing the middle.
static struct pose standing(double bearing, double away)
{
    const double s = sin(bearing), c = cos(bearing);
    double axes[3][3] = {{c, 0, s}, {-s, 0, c}, {0, -1, 0}}; // columns: right, down, away from the middle
    return (struct pose){quat_from_matrix(axes), v3(away * s, away * c, 0.75)};
}

static void place_boards(void)
{
    static const double bearing[BOARDS] = {0.3, 2.4, 4.6};
    for (int i = 0; i < BOARDS; i++) {
        const struct thing *thing = &desk.storage[painted[i]];
        before[i] = (struct film_board){&desk.texture[painted[i]], standing(bearing[i], 1.5), LARGER * thing->width_m,
                                        LARGER * thing->height_m};
        after[i] = before[i];
    }
    after[MOVED].world_from_board = standing(bearing[MOVED] + 0.55, 1.7);
}

static void write_list(void)
{
    char text[2048] = "{\"objects\": [";
    for (int i = 0; i < BOARDS; i++) {
        const struct image *p = &desk.storage[painted[i]].picture;
        char path[64];
        snprintf(path, sizeof path, "%s.png", names[i]);
        EXPECT_STATUS(png_write(scratch_file(&scratch, path), PNG_RGB8, p->rgb, p->width, p->height), OK);
        sprintf(text + strlen(text),
                "%s{\"name\": \"%s\", \"picture\": \"%s.png\", \"width_m\": %g, \"height_m\": %g, \"url\": \"\"}",
                i ? ", " : "", names[i], names[i], before[i].width_m, before[i].height_m);
    }
    scratch_text(&scratch, "objects.json", strcat(text, "]}"));
}

static int make(void **state)
{
    (void)state;
    struct world_options options = world_default_options();
    options.threads = 2;
    scratch = scratch_make();
    print_message("seed %d\n", SEED);
    if (!desk_make(&desk, SEED) || world_open(&world, &options) != OK)
        return 1;
    place_boards();
    write_list();
    film_sweep_of_boards(world, &(struct film_boards){before, BOARDS}, &scratch, "before", FRAMES, "tags.json");
    film_sweep_of_boards(world, &(struct film_boards){after, AWAY}, &scratch, "after", FRAMES, NULL); // not the last
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "room.reenact"));
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    desk_free(&desk);
    world_close(&world);
    scratch_remove(&scratch);
    return 0;
}

// option: "--out", with the list of tags, or "--into".
static void sweep(const char *folder, const char *option)
{
    char uri[300], objects[300], tags[300];
    const bool first = !strcmp(option, "--out");
    snprintf(tags, sizeof tags, "%s", scratch_file(&scratch, "tags.json"));
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, folder));
    snprintf(objects, sizeof objects, "%s", scratch_file(&scratch, "objects.json"));
    const struct process_result r =
        PROCESS(program, "map", "--sensor", uri, option, file, "--objects", objects, first ? "--tags" : NULL, tags);
    print_message("%s", r.out);
    if (r.exit_code)
        print_error("%s\n", r.err);
    EXPECT_INT(r.exit_code, 0);
}

static const struct recorded_thing *find(const struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    print_error("%s is not in the recording\n", name);
    fail_test();
    return NULL;
}

// What the recording has, against where the boards stand.
static void check(const struct film_board boards[BOARDS], bool one_is_away)
{
    struct recording *r;
    struct recorded_thing *things;
    struct place place;
    struct pose world_from_place;
    int count;
    int32_t tag_count;
    const struct place_tag *tags = world_tags(world, &tag_count);
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(recording_read_things(r, &things, &count), OK);
    EXPECT_STATUS(recording_read_map(r, &place), OK);
    recording_free(&r);
    EXPECT_INT(count, BOARDS);
    EXPECT_AT_MOST(align_tags(&place, tags, tag_count, &world_from_place), 0.01);
    for (int i = 0; i < BOARDS; i++) {
        const struct recorded_thing *t = find(things, count, names[i]);
        const struct vec3 at = pose_apply(world_from_place, t->world_from_thing.translation);
        const double off_m = v3_distance(at, boards[i].world_from_board.translation);
        print_message("%s: off by %.1f mm, %d sightings%s\n", names[i], 1e3 * off_m, (int)t->sightings,
                      t->gone ? ", gone" : "");
        EXPECT_AT_MOST(off_m, 0.02); // the one that was moved went 0.9 m
        EXPECT_INT(t->gone, one_is_away && i == AWAY);
    }
    recorded_things_free(&things, count);
    place_free(&place);
}

// As a program reads it.
static void check_info(void)
{
    const struct process_result text = PROCESS(program, "info", file), r = PROCESS(program, "info", file, "--json");
    struct json *root = NULL;
    EXPECT_INT(r.exit_code, 0);
    EXPECT_STATUS(json_parse(r.out, strlen(r.out), "info", &root), OK);
    const struct json *list = json_member(root, "things");
    EXPECT_INT(json_count(list), BOARDS);
    int gone = 0;
    for (int i = 0; i < json_count(list); i++) {
        const char *name = "";
        bool is_gone = false;
        EXPECT_TRUE(json_get_bool(json_member(json_at(list, i), "gone"), &is_gone));
        EXPECT_TRUE(json_get_string(json_member(json_at(list, i), "name"), &name));
        EXPECT_INT(is_gone, !strcmp(name, names[AWAY]));
        gone += is_gone;
    }
    EXPECT_INT(gone, 1);
    json_free(&root);
    EXPECT_TRUE(strstr(text.out, ", gone\n"));
    EXPECT_TRUE(strstr(text.out, "thing 'board'"));
}

static void test_gone_moved_and_still_there(void **state)
{
    (void)state;
    sweep("before", "--out");
    check(before, false);
    sweep("after", "--into");
    check(after, true);
    check_info();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_gone_moved_and_still_there)};
    return cmocka_run_group_tests(tests, make, tidy);
}
