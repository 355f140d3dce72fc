// One verdict on a take in all mouths: what `record` says is kept in the file, `library`, its page, its JSON and `info`
// say the same, also where it is not kept and the frames are judged again; it never outlives the frames that it was
// made from; and it knows what the take is for.
#include "tests/support/test.h"

#include "capture/take_verdict.h"
#include "platform/files/file.h"
#include "tests/support/answer.h"
#include "tests/support/film.h"
#include "tests/support/sql.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"

static struct scratch scratch;
static char file[512], uri[512];

static struct take_verdict verdict_of(const char *take)
{
    struct recording *r;
    struct take_verdict v;
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(take_verdict_get(r, take, NULL, &v), OK);
    recording_free(&r);
    return v;
}

static bool is_kept(const char *take)
{
    struct recording *r;
    struct take *t;
    struct take_verdict v;
    bool fits;
    EXPECT_STATUS(recording_open(&r, file), OK);
    EXPECT_STATUS(take_open(&t, r, take), OK);
    const enum status status = recorded_verdict_read(t, &v, &fits);
    take_close(&t);
    recording_free(&r);
    return status == OK && fits;
}

// All that is said of the take is `text`.
static void expect_in_all_mouths(const char *take)
{
    char text[VERDICT_TEXT_BYTES];
    const struct take_verdict v = verdict_of(take);
    uint8_t *page;
    size_t count;
    verdict_text(&v, text);
    printf("%s: %s\n", take, text);
    EXPECT_ANSWER(PROCESS(CAPTURE, "library", scratch.path, "--force", "--html", scratch_file(&scratch, "takes.html")),
                  text);
    EXPECT_ANSWER(PROCESS(CAPTURE, "library", scratch.path, "--json"), text);
    EXPECT_ANSWER(PROCESS(CAPTURE, "info", file), text);
    EXPECT_ANSWER(PROCESS(CAPTURE, "info", file, "--json"), verdict_headline(&v));
    EXPECT_STATUS(file_read(scratch_file(&scratch, "takes.html"), &page, &count), OK);
    EXPECT_TRUE(strstr((char *)page, text));
    free(page);
}

static void test_all_say_the_same(void **state)
{
    (void)state;
    struct process_result said =
        PROCESS(CAPTURE, "record", "--no-body-points", "--sensor", uri, "--out", file, "--take", "both");
    const struct take_verdict v = verdict_of("both");
    EXPECT_ANSWER(said, verdict_headline(&v));
    for (int i = 0; i < v.count; i++)
        EXPECT_ANSWER(said, v.line[i].text);
    EXPECT_TRUE(is_kept("both"));
    expect_in_all_mouths("both");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    // An older file has no verdict: the same frames give the same one.
    char kept[VERDICT_TEXT_BYTES], again[VERDICT_TEXT_BYTES];
    verdict_text(&v, kept);
    run_sql(file, "DROP TABLE verdict");
    EXPECT_TRUE(!is_kept("both"));
    const struct take_verdict anew = verdict_of("both");
    if (strcmp(kept, verdict_text(&anew, again))) {
        print_error("'%s' was kept, '%s' is judged from the frames\n", kept, again);
        fail_test();
    }
    expect_in_all_mouths("both");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
}

// The figure faces the sensor all the time: nothing is wrong with that where the take is to be compared.
static void test_a_verdict_knows_its_purpose(void **state)
{
    (void)state;
    static const struct {
        const char *purpose, *take;
        bool good, names_the_back;
    } cases[] = {{"both", "two", true, true}, {"compare", "exercise", true, false}, {"watch", "show", false, true}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        char text[VERDICT_TEXT_BYTES];
        const struct process_result said = PROCESS(CAPTURE, "record", "--no-body-points", "--sensor", uri, "--into",
                                                   file, "--take", cases[i].take, "--for", cases[i].purpose);
        EXPECT_INT(said.exit_code, 0);
        const struct take_verdict v = verdict_of(cases[i].take);
        verdict_text(&v, text);
        printf("for %s: %s\n", cases[i].purpose, text);
        EXPECT_TRUE(!strcmp(verdict_purpose_name(v.purpose), cases[i].purpose));
        EXPECT_TRUE(verdict_is_good(&v) == cases[i].good);
        EXPECT_TRUE((strstr(text, "from behind") != NULL) == cases[i].names_the_back);
        EXPECT_TRUE((strstr(said.out, "from behind") != NULL) == cases[i].names_the_back);
        expect_in_all_mouths(cases[i].take);
    }
    EXPECT_INT(PROCESS(CAPTURE, "record", "--sensor", uri, "--into", file, "--take", "x", "--for", "fun").exit_code, 2);
}

static void test_changed_frames_are_judged_anew(void **state)
{
    (void)state;
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "copy", file, "--take", "exercise", "--name", "copy"), "copy");
    EXPECT_TRUE(is_kept("copy"));
    EXPECT_INT(verdict_of("copy").purpose, PURPOSE_COMPARE);
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "trim", file, "--take", "copy", "--to", "0.5"), "shorter than a second");
    EXPECT_TRUE(is_kept("copy"));
    EXPECT_INT(verdict_of("copy").purpose, PURPOSE_COMPARE);
    EXPECT_TRUE(!verdict_is_good(&(struct take_verdict){0}));
    expect_in_all_mouths("copy");
    // Frames that went behind every program's back.
    run_sql(file, "DELETE FROM frame WHERE id >> 32 = 2 AND id % 4294967296 > 9;"
                  "DELETE FROM picture WHERE id >> 32 = 2 AND id % 4294967296 > 9");
    EXPECT_TRUE(!is_kept("two"));
    EXPECT_TRUE(verdict_of("two").spoilt == USE_ANY);
    expect_in_all_mouths("two");
    EXPECT_STATUS(recording_delete_take(file, "two", NULL), OK);
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    run_sql(file, "UPDATE verdict SET spoilt = 3 - spoilt");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 1);
    EXPECT_TRUE(!is_kept("exercise"));
    EXPECT_TRUE(verdict_is_good(&(struct take_verdict){.seen = true}));
}

// What `repair` saves is judged as it is now, for the purpose that it had; what nothing happened to keeps its verdict.
static void test_repaired_takes_keep_theirs(void **state)
{
    (void)state;
    char whole[512], broken[512], texts[3][VERDICT_TEXT_BYTES];
    snprintf(whole, sizeof whole, "%s", file);
    snprintf(broken, sizeof broken, "%s", scratch_file(&scratch, "broken.reenact"));
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "saved.reenact"));
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "copy", whole, "--take", "exercise", "--into", broken), "exercise");
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "copy", whole, "--take", "show", "--into", broken), "show");
    run_sql(broken, "UPDATE picture SET depth = zeroblob(9) WHERE id >> 32 = 2 AND id % 4294967296 < 20");
    EXPECT_ANSWER(PROCESS(CAPTURE, "repair", broken, "--out", file), "images of 20 more");
    EXPECT_TRUE(!unlink(broken));
    EXPECT_TRUE(is_kept("exercise") && is_kept("show"));
    const struct take_verdict sound = verdict_of("exercise"), torn = verdict_of("show");
    expect_in_all_mouths("exercise");
    expect_in_all_mouths("show");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    snprintf(file, sizeof file, "%s", whole);
    const struct take_verdict before = verdict_of("exercise");
    assert_string_equal(verdict_text(&sound, texts[0]), verdict_text(&before, texts[1]));
    EXPECT_INT(sound.purpose, PURPOSE_COMPARE);
    EXPECT_INT(torn.purpose, PURPOSE_WATCH);
    EXPECT_TRUE(strstr(verdict_text(&torn, texts[2]), "interrupted"));
}

#ifndef EMULATED // the limit is bash's
// Of a take for which the disk had no room, as many frames and persons are told as the file has.
static void test_a_full_disk_tells_what_it_took(void **state)
{
    (void)state;
    const char *full = scratch_file(&scratch, "full.reenact");
    int cut = 0;
    for (int kilobytes = SANITIZED ? 1600 : 1200; kilobytes <= 2000; kilobytes += SANITIZED ? 800 : 400) {
        char script[1500];
        long long frames = 0, tracked = 0;
        snprintf(script, sizeof script, "ulimit -f %d; %s record --no-body-points --sensor %s --out %s --take one",
                 kilobytes, CAPTURE, uri, full);
        const struct process_result said = PROCESS("/usr/bin/bash", "-c", script);
        const int found = sscanf(said.out, "take 'one': %lld frames, a person in %lld", &frames, &tracked);
        printf("%d kB: exit code %d, %lld frames, %lld with a person\n", kilobytes, said.exit_code, frames, tracked);
        if (!file_exists(full))
            continue; // not one frame
        EXPECT_INT(found, 2);
        cut += frames < 33 && said.exit_code == 1;
        char wanted[2][64];
        snprintf(wanted[0], sizeof wanted[0], "take 'one': %lld frames", frames);
        snprintf(wanted[1], sizeof wanted[1], "skeleton in %lld,", tracked);
        EXPECT_ANSWER(PROCESS(CAPTURE, "info", full), wanted[0]);
        EXPECT_ANSWER(PROCESS(CAPTURE, "info", full), wanted[1]);
        recording_discard(full);
    }
    EXPECT_AT_LEAST(cut, SANITIZED ? 1 : 2);
}
#endif

static int set_up(void **state)
{
    (void)state;
    struct world *world;
    struct world_options o = world_default_options();
    scratch = scratch_make();
    o.motion = "still";
    o.plain = o.unshadowed = true;
    o.threads = 2;
    EXPECT_STATUS(world_open(&world, &o), OK);
    film_sensor(world, &scratch, "sensor", 0.5, 0, 33);
    world_close(&world);
    snprintf(uri, sizeof uri, "folder:%s", scratch_file(&scratch, "sensor"));
    snprintf(file, sizeof file, "%s", scratch_file(&scratch, "takes.reenact"));
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_say_the_same),
        cmocka_unit_test(test_a_verdict_knows_its_purpose),
        cmocka_unit_test(test_repaired_takes_keep_theirs),
        cmocka_unit_test(test_changed_frames_are_judged_anew),
#ifndef EMULATED
        cmocka_unit_test(test_a_full_disk_tells_what_it_took),
#endif
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
