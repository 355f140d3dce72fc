// NaN, infinity, denormals and zero in every text file that carries a number: calibration.json, tags.json, the lists of
// a folder of images, joints-csv.
#include "capture/mapping/mapper.h"
#include "compare/joint_samples.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"
#include "tests/stability/stability.h"
#include "tests/support/scratch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// The number that a case writes, by index: what text files may hold.
static const char *const numbers[] = {"NaN",   "Infinity", "1e999", "-1e999", "5e-324", "0",
                                      "1e300", "nan",      "inf",   "-0.2",   "",       "0x10"};
enum {
    TEXT_NAN,
    TEXT_INFINITY,
    TEXT_HUGE,
    TEXT_MINUS_HUGE,
    TEXT_DENORMAL,
    TEXT_ZERO,
    TEXT_LARGE,
    TEXT_C_NAN,
    TEXT_C_INF,
    TEXT_NEGATIVE,
    TEXT_NONE,
    TEXT_HEX
};

// What strtod makes of it.
static struct answer as_strtod_reads(const double *in) { return answer_value(strtod(numbers[(int)in[0]], NULL)); }

// ------------------------------------------------------------- calibration.json

enum field { FOCAL, CENTRE, DISTORTION, READOUT, FOCAL_SIGMA, WIDTH_PX, UNIT, TRANSLATION, ROTATION };

// in: the number, the field that holds it.
static struct answer ask_calibration(const double *in)
{
    char field[9][32];
    static const char *const usual[9] = {"525", "319.5", "0.01", "0", "0", "640", "0.001", "0.02", "0"};
    char text[1200];
    struct calibration c;
    struct scratch folder = scratch_make();
    for (int i = 0; i < 9; i++)
        snprintf(field[i], sizeof field[i], "%s", i == (int)in[1] ? numbers[(int)in[0]] : usual[i]);
    snprintf(text, sizeof text,
             "{\"color\": {\"width\": %s, \"height\": 480, \"fx\": %s, \"fy\": 525, \"cx\": %s, \"cy\": 239.5,"
             "\"distortion\": [%s, 0, 0, 0], \"readout_ms\": %s, \"focal_sigma\": %s},"
             "\"depth\": {\"width\": 640, \"height\": 480, \"fx\": 525, \"fy\": 525, \"cx\": 319.5, \"cy\": 239.5,"
             "\"unit_m\": %s}, \"registered\": false,"
             "\"color_from_depth\": {\"translation_m\": [%s, 0, 0], \"rotation\": [%s, 0, 0, 1]}}",
             field[WIDTH_PX], field[FOCAL], field[CENTRE], field[DISTORTION], field[READOUT], field[FOCAL_SIGMA],
             field[UNIT], field[TRANSLATION], field[ROTATION]);
    scratch_text(&folder, "calibration.json", text);
    const enum status status = calibration_read(scratch_file(&folder, "calibration.json"), &c);
    scratch_remove(&folder);
    return answer_status(status, 1);
}

// ------------------------------------------------------------- tags.json

static struct answer ask_side(const double *in)
{
    char text[200];
    struct mapper_tag *tags = NULL;
    int32_t count = 0;
    struct scratch folder = scratch_make();
    snprintf(text, sizeof text, "{\"family\": \"tag36h11\", \"side_m\": {\"0\": %s}}", numbers[(int)in[0]]);
    scratch_text(&folder, "tags.json", text);
    const enum status status = mapper_read_tags(scratch_file(&folder, "tags.json"), &tags, &count);
    free(tags);
    scratch_remove(&folder);
    return answer_status(status, 1);
}

// ------------------------------------------------------------- a folder of images

// in: the text of the second image's time -> images found after the first.
static struct answer ask_times(const double *in)
{
    static const uint16_t depth[8 * 8] = {1000};
    char text[200];
    struct source *source = NULL;
    struct frame frame;
    int frames = 0;
    struct scratch folder = scratch_make();
    scratch_text(&folder, "calibration.json",
                 "{\"depth\": {\"width\": 8, \"height\": 8, \"fx\": 8, \"fy\": 8, \"cx\": 3.5, \"cy\": 3.5}}");
    snprintf(text, sizeof text, "1.0 depth/a.png\n%s depth/a.png\n", numbers[(int)in[0]]);
    scratch_text(&folder, "depth.txt", text);
    scratch_text(&folder, "depth/place", "");
    enum status status = png_write(scratch_file(&folder, "depth/a.png"), PNG_GRAY16, depth, 8, 8);
    char uri[300];
    snprintf(uri, sizeof uri, "folder:%s", folder.path);
    if (status == OK)
        status = source_open(&source, uri, SOURCE_SENSOR);
    while (status == OK && (status = source_next(source, &frame)) == OK)
        frames++;
    source_close(&source);
    scratch_remove(&folder);
    return status == NOTHING ? answer_value(frames) : answer_status(status, frames);
}

static struct answer times_by_strtod(const double *in)
{
    const double t = strtod(numbers[(int)in[0]], NULL);
    return answer_value(t != 1 ? 2 : 1);
}

// ------------------------------------------------------------- joints-csv

enum column { CSV_TIME, CSV_X, CSV_CONFIDENCE, CSV_SIGMA };

// in: the number, the column that holds it, in the second of two rows -> samples read and rows dropped.
static struct answer ask_joints(const double *in)
{
    char cell[4][32], text[300];
    static const char *const usual[4] = {"0.1", "0.2", "1", "0.01"};
    struct joint_samples s = {0};
    struct scratch folder = scratch_make();
    for (int i = 0; i < 4; i++)
        snprintf(cell[i], sizeof cell[i], "%s", i == (int)in[1] ? numbers[(int)in[0]] : usual[i]);
    snprintf(text, sizeof text,
             "timestamp,joint,x_m,y_m,z_m,confidence,sigma_m\n0,neck,0,0,2,1,0.01\n%s,neck,%s,0,2,%s,%s\n",
             cell[CSV_TIME], cell[CSV_X], cell[CSV_CONFIDENCE], cell[CSV_SIGMA]);
    scratch_text(&folder, "joints.csv", text);
    const enum status status = joint_samples_read_csv(scratch_file(&folder, "joints.csv"), &s);
    const double values[2] = {(double)s.count, (double)s.dropped};
    joint_samples_free(&s);
    scratch_remove(&folder);
    return status == OK ? answer_values(values, 2) : answer_status(status, 0);
}

static struct answer two_samples(const double *in)
{
    (void)in;
    return answer_values((double[]){2, 0}, 2);
}

// ------------------------------------------------------------- any JSON

static struct answer ask_json(const double *in)
{
    char text[64];
    double value = 0;
    struct json *root = NULL;
    struct scratch folder = scratch_make();
    snprintf(text, sizeof text, "{\"x\": %s}", numbers[(int)in[0]]);
    scratch_text(&folder, "x.json", text);
    enum status status = json_read(scratch_file(&folder, "x.json"), &root);
    if (status == OK)
        status = json_need_number(root, "x", "x.json", &value);
    json_free(&root);
    scratch_remove(&folder);
    return answer_status(status, value);
}

#define CALIBRATION(what, number, field)                                                                               \
    {                                                                                                                  \
        what, "checked when read", ANSWER_ERROR, ask_calibration, NULL, as_strtod_reads, .in = { number, field }       \
    }
#define CSV_DROPPED(what, number, column)                                                                              \
    {                                                                                                                  \
        what, "left out, and counted", ANSWER_VALUE, ask_joints, NULL, two_samples,                                    \
            .in = {number, column}, .exact = {1, 1}, .exact_count = 2, .unit = "samples, rows"                         \
    }

static const struct stability_case cases[] = {
    CALIBRATION("calibration.json: focal length NaN", TEXT_NAN, FOCAL),
    CALIBRATION("calibration.json: focal length 1e999", TEXT_HUGE, FOCAL),
    CALIBRATION("calibration.json: focal length 5e-324", TEXT_DENORMAL, FOCAL),
    CALIBRATION("calibration.json: focal length 0", TEXT_ZERO, FOCAL),
    CALIBRATION("calibration.json: principal point 1e999", TEXT_HUGE, CENTRE),
    CALIBRATION("calibration.json: principal point 1e300", TEXT_LARGE, CENTRE),
    CALIBRATION("calibration.json: distortion Infinity", TEXT_INFINITY, DISTORTION),
    CALIBRATION("calibration.json: distortion 1e300", TEXT_LARGE, DISTORTION),
    CALIBRATION("calibration.json: readout 1e999", TEXT_HUGE, READOUT),
    CALIBRATION("calibration.json: readout below 0", TEXT_NEGATIVE, READOUT),
    CALIBRATION("calibration.json: sigma of the focal length 1e300", TEXT_LARGE, FOCAL_SIGMA),
    CALIBRATION("calibration.json: width 1e300", TEXT_LARGE, WIDTH_PX),
    CALIBRATION("calibration.json: width 5e-324", TEXT_DENORMAL, WIDTH_PX),
    CALIBRATION("calibration.json: unit of depth 0", TEXT_ZERO, UNIT),
    CALIBRATION("calibration.json: unit of depth 5e-324", TEXT_DENORMAL, UNIT),
    CALIBRATION("calibration.json: cameras 1e999 m apart", TEXT_HUGE, TRANSLATION),
    CALIBRATION("calibration.json: cameras 1e300 m apart", TEXT_LARGE, TRANSLATION),
    CALIBRATION("calibration.json: rotation of 1e300", TEXT_LARGE, ROTATION),
    {"tags.json: side NaN", "checked when read", ANSWER_ERROR, ask_side, NULL, as_strtod_reads, .in = {TEXT_NAN}},
    {"tags.json: side 1e999", "checked when read", ANSWER_ERROR, ask_side, NULL, as_strtod_reads, .in = {TEXT_HUGE}},
    {"tags.json: side 5e-324", "checked when read", ANSWER_ERROR, ask_side, NULL, as_strtod_reads,
     .in = {TEXT_DENORMAL}},
    {"tags.json: side 0", "checked when read", ANSWER_ERROR, ask_side, NULL, as_strtod_reads, .in = {TEXT_ZERO}},
    {"tags.json: side below 0", "checked when read", ANSWER_ERROR, ask_side, NULL, as_strtod_reads,
     .in = {TEXT_NEGATIVE}},
    {"depth.txt: time NaN", "decimal seconds only", ANSWER_ERROR, ask_times, NULL, times_by_strtod, .in = {TEXT_C_NAN}},
    {"depth.txt: time infinite", "decimal seconds only", ANSWER_ERROR, ask_times, NULL, times_by_strtod,
     .in = {TEXT_C_INF}},
    {"depth.txt: time 1e300", "decimal seconds only", ANSWER_ERROR, ask_times, NULL, times_by_strtod,
     .in = {TEXT_LARGE}},
    {"depth.txt: time 0x10", "decimal seconds only", ANSWER_ERROR, ask_times, NULL, times_by_strtod, .in = {TEXT_HEX}},
    {"depth.txt: no time", "decimal seconds only", ANSWER_ERROR, ask_times, NULL, times_by_strtod, .in = {TEXT_NONE}},
    CSV_DROPPED("joints-csv: time NaN", TEXT_C_NAN, CSV_TIME),
    CSV_DROPPED("joints-csv: time 1e300", TEXT_LARGE, CSV_TIME),
    CSV_DROPPED("joints-csv: time infinite", TEXT_C_INF, CSV_TIME),
    CSV_DROPPED("joints-csv: position NaN", TEXT_C_NAN, CSV_X),
    CSV_DROPPED("joints-csv: position 1e999", TEXT_HUGE, CSV_X),
    CSV_DROPPED("joints-csv: confidence NaN", TEXT_C_NAN, CSV_CONFIDENCE),
    CSV_DROPPED("joints-csv: confidence below 0", TEXT_NEGATIVE, CSV_CONFIDENCE),
    CSV_DROPPED("joints-csv: sigma NaN", TEXT_C_NAN, CSV_SIGMA),
    CSV_DROPPED("joints-csv: sigma below 0", TEXT_NEGATIVE, CSV_SIGMA),
    {"joints-csv: confidence 5e-324", "unknown where a float is 0", ANSWER_VALUE, ask_joints, NULL, two_samples,
     .in = {TEXT_DENORMAL, CSV_CONFIDENCE}, .exact = {1, 0}, .exact_count = 2, .unit = "samples, rows"},
    {"joints-csv: no time", "refused with its line", ANSWER_ERROR, ask_joints, NULL, two_samples,
     .in = {TEXT_NONE, CSV_TIME}},
    {"JSON: a number of 1e999", "finite numbers only", ANSWER_ERROR, ask_json, NULL, as_strtod_reads,
     .in = {TEXT_HUGE}},
    {"JSON: -1e999", "finite numbers only", ANSWER_ERROR, ask_json, NULL, as_strtod_reads, .in = {TEXT_MINUS_HUGE}},
    {"JSON: NaN", "not JSON", ANSWER_ERROR, ask_json, NULL, as_strtod_reads, .in = {TEXT_NAN}},
};
const struct stability_stage stability_readers = {"readers of text", cases, COUNT_OF(cases)};
