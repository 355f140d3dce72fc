// What the teacher says counts, by the commands: said with `take expect`, kept in the recording, used by `compare`;
// what cannot be is refused with a sentence and changes nothing.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "recording/recorded_expectation.h"
#include "tests/support/answer.h"
#include "tests/support/exercise.h"
#include "tests/support/recording_hash.h"
#include "tests/support/recording_sample.h"
#include "tests/support/sql.h"

#include <string.h>

#define CAPTURE PROGRAM_DIR "/reenact-capture"
#define REENACT PROGRAM_DIR "/reenact"

static char file[128], csv[128], page[128];
static struct rng rng = {3};

static uint64_t bytes_hash(void)
{
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(file, &bytes, &count), OK);
    const uint64_t hash = mix(1, bytes, count);
    free(bytes);
    return hash;
}

// Joints alone, as a sensor's take has them, from the camera's axes.
static void add_take(struct recording_writer *w, const char *name, const struct exercise *e, int without)
{
    const struct calibration calibration = sample_calibration();
    EXPECT_STATUS(recording_begin_take(w, name, &calibration), OK);
    for (int i = 0; i < without + (int)(e->seconds * 30); i++) {
        struct take_frame frame = {.time_ns = INT64_C(7000000000) + i * INT64_C(33333333),
                                   .world_from_camera = POSE_IDENTITY,
                                   .has_skeleton = i >= without};
        if (frame.has_skeleton)
            frame.skeleton = exercise_at(e, (i - without) / 30.0, &rng);
        EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
}

static void write_recording(void)
{
    struct recording_writer *w;
    struct exercise e = exercise_default(), bent = e, walk = e;
    bent.right_elbow_rad = 0.8;
    bent.wrong_to_s = 6;
    walk.walking = true;
    EXPECT_STATUS(recording_create(&w, file), OK);
    add_take(w, "teacher", &e, 30); // the person comes after a second
    add_take(w, "pupil", &bent, 0);
    add_take(w, "again", &e, 0);
    add_take(w, "walk", &walk, 0);
    EXPECT_STATUS(recording_close(&w), OK);
}

#define EXPECT(...) PROCESS(CAPTURE, "take", "expect", file, "teacher", __VA_ARGS__)
#define COMPARE(...)                                                                                                   \
    PROCESS(REENACT, "compare", file, "--take", "teacher", "--with", file, "--with-take", "pupil", __VA_ARGS__)

static void test_it_is_said_kept_and_used(void **state)
{
    (void)state;
    const char *const nothing = "everything counts";
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "expect", file, "--take", "teacher"), nothing);
    EXPECT_ANSWER(COMPARE("--figures"), "Right elbow");
    EXPECT_TRUE(!strstr(COMPARE("--figures").out, "expected"));
    EXPECT_ANSWER(EXPECT("--tolerance", "knees=20", "--ignore", "head"),
                  "the head does not matter; the knees within 20°");
    EXPECT_ANSWER(EXPECT("--ignore", "right_elbow", "--from", "1", "--to", "4.5"), // added to it
                  "take 'teacher': the head, the right elbow do not matter; the knees within 20°; only 1.0 s to 4.5 s");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
    const char *const said =
        "expected: the head, the right elbow do not matter; the knees within 20°; only 1.0 s to 4.5 s\n";
    EXPECT_ANSWER(COMPARE("--figures"), said);
    EXPECT_TRUE(!strstr(COMPARE("--figures").out, "elbow 4"));
    EXPECT_ANSWER(COMPARE("--json"), "\"ignored\": [\"head\", \"right_forearm\"], \"tolerance_deg\": {\"left_shin\": "
                                     "20.0, \"right_shin\": 20.0}, \"from_s\": 1.000, \"to_s\": 4.500");
    uint8_t *html;
    size_t count;
    EXPECT_INT(COMPARE("--html", page, "--figures").exit_code, 0);
    EXPECT_STATUS(file_read(page, &html, &count), OK);
    EXPECT_TRUE(strstr((char *)html, "Expected here: the head, the right elbow do not matter"));
    free(html);
    // Options of a comparison precede it, or leave it aside.
    EXPECT_ANSWER(COMPARE("--tolerance", "knees=30"), "the knees within 30°; only 1.0 s to 4.5 s");
    EXPECT_TRUE(!strstr(COMPARE("--everything").out, "expected"));
    EXPECT_ANSWER(COMPARE("--everything", "--ignore", "right arm"), "expected: the right arm does not matter\n");
    // It stays where it was filmed.
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "trim", file, "--take", "teacher", "--from", "1.5"), "trimmed");
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "expect", file, "teacher"), "only 0.5 s to 4.0 s");
    EXPECT_ANSWER(EXPECT("--clear", "--ignore", "arms"), "take 'teacher': the arms do not matter\n");
    EXPECT_ANSWER(EXPECT("--clear"), nothing);
    EXPECT_ANSWER(EXPECT("--clear"), nothing);
}

static void test_further_references(void **state)
{
    (void)state;
    EXPECT_ANSWER(EXPECT("--reference", "again", "--reference", "again"),
                  "what 1 further reference differs by is right");
    EXPECT_ANSWER(COMPARE("--json"), "\"further_references\": 1");
    EXPECT_ANSWER(COMPARE("--reference-take", "again"), "what 2 further references differ by is right");
    EXPECT_ANSWER(COMPARE("--reference", file, "--reference-take", "again"), "what 2 further references");
    const struct process_result other = COMPARE("--reference-take", "walk");
    EXPECT_INT(other.exit_code, 1);
    EXPECT_TRUE(strstr(other.err, "take 'walk' does not do as the reference does"));
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "rename", file, "--take", "again", "--name", "once more"), "once more");
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "expect", file, "teacher"), "what 1 further reference differs by is right");
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "delete", file, "--take", "once more"), "deleted");
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "expect", file, "teacher"), "everything counts");
}

static void test_what_cannot_be_is_refused(void **state)
{
    (void)state;
    EXPECT_ANSWER(EXPECT("--tolerance", "all=15"), "everything within 15°");
    static const struct {
        const char *option, *value, *word;
    } cases[] = {{"--tolerance", "knees=0", "degrees"},   {"--tolerance", "knees=-5", "degrees"},
                 {"--tolerance", "knees=400", "degrees"}, {"--tolerance", "nose=4", "knees"},
                 {"--tolerance", "20", "PART=DEGREES"},   {"--ignore", "all", "matters"},
                 {"--ignore", "tail", "'tail'"},          {"--reference", "nobody", "nobody"},
                 {"--reference", "teacher", "itself"},    {"--reference", "walk", "walk"},
                 {"--from", "9", "not in the reference"}, {"--to", "99", "not in the reference"}};
    const uint64_t before = bytes_hash();
    for (size_t i = 0; i < COUNT_OF(cases); i++)
        EXPECT_SENTENCE(EXPECT(cases[i].option, cases[i].value), cases[i].word);
    EXPECT_SENTENCE(EXPECT("--from", "3", "--to", "2"), "none");
    EXPECT_SENTENCE(EXPECT("--ignore", "head", "--tolerance", "knees=0"), "degrees");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "take", "expect", file, "nobody", "--ignore", "head"), "nobody");
    EXPECT_SENTENCE(PROCESS(CAPTURE, "take", "expect", csv, "nobody"), csv);
    EXPECT_TRUE(bytes_hash() == before);
    EXPECT_INT(PROCESS(CAPTURE, "take", "expect", file).exit_code, 2);
    EXPECT_ANSWER(PROCESS(CAPTURE, "take", "expect", file, "teacher"), "everything within 15°");
    EXPECT_SENTENCE(COMPARE("--tolerance", "knees=0"), "degrees");
    EXPECT_SENTENCE(COMPARE("--from", "5", "--to", "3"), "none");
}

static void test_damage_is_no_hindrance(void **state)
{
    (void)state;
    run_sql(file, "UPDATE expectation SET crc = crc + 1");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 1);
    const struct process_result said = COMPARE("--figures");
    EXPECT_ANSWER(said, "Right elbow");
    EXPECT_TRUE(strstr(said.err, "damaged"));
    EXPECT_ANSWER(EXPECT("--clear"), "everything counts");
    EXPECT_INT(PROCESS(CAPTURE, "verify", file).exit_code, 0);
}

static int set_up(void **state)
{
    if (sample_folder_make(state))
        return -1;
    snprintf(file, sizeof file, "%s/takes.reenact", folder);
    snprintf(csv, sizeof csv, "%s/none.csv", folder);
    snprintf(page, sizeof page, "%s/page.html", folder);
    write_recording();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_it_is_said_kept_and_used),
        cmocka_unit_test(test_further_references),
        cmocka_unit_test(test_what_cannot_be_is_refused),
        cmocka_unit_test(test_damage_is_no_hindrance),
    };
    return cmocka_run_group_tests(tests, set_up, sample_folder_remove);
}
