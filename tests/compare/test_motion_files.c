// BVH, TRC and C3D as movements: names, units and axes of many programs, and a sentence for what cannot be read.
#include "tests/support/test.h"

#include "compare/joint_samples.h"
#include "formats/markers.h"
#include "recording/little_endian.h"
#include "reenact/export/armature.h"
#include "tests/support/exercise.h"
#include "tests/support/scratch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 90, MOST_NAMES = 20 };

static struct scratch scratch;

// Of the person who exercises, y down.
static struct vec3 truth(int frame, enum joint joint)
{
    const struct exercise e = exercise_default();
    return exercise_at(&e, frame / 30.0, NULL).joint[joint];
}

// What a file calls its points; NULL: the file has no such joint.
struct naming {
    const char *what;
    const char *name[JOINT_COUNT];
    const char *more[3]; // points that must not be taken for a joint; they lie at the origin
    const char *unit;
    double per_m;
    bool z_up;
};

static const struct naming namings[] = {
    {"ours",
     {"head", "neck", "left_shoulder", "left_elbow", "left_hand", "right_shoulder", "right_elbow", "right_hand",
      "torso", "waist", "left_hip", "left_knee", "left_foot", "right_hip", "right_knee", "right_foot"},
     {NULL},
     "m",
     1,
     false},
    {"Mixamo",
     {"mixamorig:Head", "mixamorig:Neck", "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand",
      "mixamorig:RightArm", "mixamorig:RightForeArm", "mixamorig:RightHand", "mixamorig:Spine1", "mixamorig:Hips",
      "mixamorig:LeftUpLeg", "mixamorig:LeftLeg", "mixamorig:LeftFoot", "mixamorig:RightUpLeg", "mixamorig:RightLeg",
      "mixamorig:RightFoot"},
     {"mixamorig:LeftShoulder", "mixamorig:Spine", "mixamorig:RightToeBase"},
     "cm",
     100,
     false},
    {"Unreal",
     {"head", "neck_01", "upperarm_l", "lowerarm_l", "hand_l", "upperarm_r", "lowerarm_r", "hand_r", "spine_02",
      "pelvis", "thigh_l", "calf_l", "foot_l", "thigh_r", "calf_r", "foot_r"},
     {"root", "clavicle_l", "ball_r"},
     "cm",
     100,
     true},
    {"OpenPose",
     {"Nose", "Neck", "LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist", NULL, "MidHip", "LHip", "LKnee",
      "LAnkle", "RHip", "RKnee", "RAnkle"},
     {"LBigToe", "REye", "LEar"},
     "mm",
     1000,
     true},
    {"Kinect",
     {"Head", "Neck", "ShoulderLeft", "ElbowLeft", "HandLeft", "ShoulderRight", "ElbowRight", "HandRight", "SpineMid",
      "SpineBase", "HipLeft", "KneeLeft", "AnkleLeft", "HipRight", "KneeRight", "AnkleRight"},
     {"FootLeft", "HandTipRight", "ThumbLeft"},
     "m",
     1,
     false},
    {"Character Creator",
     {"CC_Base_Head", "CC_Base_NeckTwist01", "CC_Base_L_Upperarm", "CC_Base_L_Forearm", "CC_Base_L_Hand",
      "CC_Base_R_Upperarm", "CC_Base_R_Forearm", "CC_Base_R_Hand", "CC_Base_Spine01", "CC_Base_Waist",
      "CC_Base_L_Thigh", "CC_Base_L_Calf", "CC_Base_L_Foot", "CC_Base_R_Thigh", "CC_Base_R_Calf", "CC_Base_R_Foot"},
     {"RL_BoneRoot", "CC_Base_L_Clavicle", "CC_Base_R_ToeBase"},
     "cm",
     100,
     false},
    {"no unit, millimetres",
     {"head", "neck", "LeftArm", "LeftForeArm", "LeftHand", "RightArm", "RightForeArm", "RightHand", "Chest", "Hips",
      "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot"},
     {NULL},
     "",
     1000,
     true},
};

static struct vec3 in_file(struct vec3 camera, bool z_up)
{
    return z_up ? v3(camera.x, camera.z, -camera.y) : v3(camera.x, -camera.y, -camera.z);
}

// Writes a TRC file of the person with these names; `extra` is one more name at the end, of a point at the origin.
static const char *write_trc(const struct naming *naming, const char *extra)
{
    const char *name[MOST_NAMES];
    int joint[MOST_NAMES], count = 0;
    char *text;
    size_t bytes;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (naming->name[j]) {
            joint[count] = j;
            name[count++] = naming->name[j];
        }
    for (int k = 0; k < 4; k++) {
        const char *more = k < 3 ? naming->more[k] : extra;
        if (more) {
            joint[count] = JOINT_COUNT;
            name[count++] = more;
        }
    }
    FILE *out = open_memstream(&text, &bytes);
    fprintf(out, "PathFileType\t4\t(X/Y/Z)\tperson.trc\r\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\r\n");
    fprintf(out, "30\t30\t%d\t%d\t%s\r\nFrame#\tTime", FRAMES, count, naming->unit);
    for (int k = 0; k < count; k++)
        fprintf(out, "\t%s\t\t", name[k]);
    fprintf(out, "\r\n\t\tX1\tY1\tZ1\r\n\r\n");
    for (int i = 0; i < FRAMES; i++) {
        fprintf(out, "%d\t%.5f", i + 1, i / 30.0);
        for (int k = 0; k < count; k++) {
            const struct vec3 p =
                joint[k] < JOINT_COUNT ? in_file(truth(i, (enum joint)joint[k]), naming->z_up) : v3(0.001, 0, 0);
            if (i == 7 && k == JOINT_LEFT_HAND)
                fprintf(out, "\t\t\t"); // not seen
            else
                fprintf(out, "\t%.6f\t%.6f\t%.6f", naming->per_m * p.x, naming->per_m * p.y, naming->per_m * p.z);
        }
        fprintf(out, "\r\n");
    }
    fclose(out);
    scratch_write(&scratch, "person.trc", text, bytes);
    free(text);
    return scratch_file(&scratch, "person.trc");
}

// How far the samples' joints are from the truth at worst; but for a turn about the vertical, of which nothing depends:
// by heights above the foot and distances from each other.
static double worst_error(const struct joint_samples *s)
{
    double worst = 0;
    EXPECT_INT(s->count, FRAMES);
    for (int i = 0; i < s->count; i++) {
        EXPECT_NEAR((double)s->at[i].time_ns, i / 30.0 * 1e9, 1e5); // BVH: microseconds a frame
        for (int j = 0; j < JOINT_COUNT; j++)
            for (int k = 0; k < j; k++) {
                const struct skeleton *of = &s->at[i].skeleton;
                const struct vec3 a = truth(i, (enum joint)j), b = truth(i, (enum joint)k);
                if (!(of->confidence[j] > 0) || !(of->confidence[k] > 0))
                    continue;
                worst = fmax(worst, fabs(v3_distance(of->joint[j], of->joint[k]) - v3_distance(a, b)));
                worst = fmax(worst, fabs(of->joint[j].y - of->joint[k].y - (a.y - b.y)));
            }
    }
    return worst;
}

static int joints_known(const struct joint_samples *s, int frame)
{
    int known = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        known += s->at[frame].skeleton.confidence[j] > 0;
    return known;
}

static bool has_note(const struct joint_samples *s, const char *part)
{
    for (int k = 0; k < s->notes.count; k++)
        if (strstr(s->notes.line[k], part))
            return true;
    return false;
}

static void test_names_of_many_programs(void **state)
{
    (void)state;
    for (size_t k = 0; k < COUNT_OF(namings); k++) {
        struct joint_samples s;
        EXPECT_STATUS(joint_samples_read_motion(write_trc(&namings[k], NULL), &s), OK);
        const double worst = worst_error(&s);
        print_message("%s: %.6f m\n", namings[k].what, worst);
        // A torso that no point has is half-way between waist and neck, 1 cm from the exercise's.
        EXPECT_AT_MOST(worst, namings[k].name[JOINT_TORSO] ? 1e-5 : 0.05);
        EXPECT_INT(joints_known(&s, 0), JOINT_COUNT);
        EXPECT_INT(joints_known(&s, 7), JOINT_COUNT - 1);
        EXPECT_INT(has_note(&s, "millimetres"), !*namings[k].unit);
        EXPECT_INT(has_note(&s, "z up"), namings[k].z_up);
        joint_samples_free(&s);
    }
}

// The markers of Plug-in Gait: hips from the pelvis, joints between two markers.
static void test_markers_on_the_skin(void **state)
{
    (void)state;
    static const char *const names[] = {"LASI", "RASI", "LPSI", "RPSI", "C7",   "CLAV", "T10",  "STRN",
                                        "LSHO", "LELB", "LWRA", "LWRB", "LKNE", "LANK", "RSHO", "RKNE"};
    static const float mm[][3] = {{120, 1000, 80}, {-120, 1000, 80}, {50, 1000, -80}, {-50, 1000, -80},
                                  {0, 1450, -60},  {0, 1430, 60},    {0, 1200, -90},  {0, 1210, 90},
                                  {180, 1400, 0},  {190, 1100, 0},   {180, 850, 20},  {220, 850, -20},
                                  {110, 500, 0},   {110, 80, 0},     {-180, 1400, 0}, {-110, 500, 0}};
    char *text;
    size_t bytes;
    struct joint_samples s;
    FILE *out = open_memstream(&text, &bytes);
    fprintf(out, "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\n100\t100\t9\t16\tmm\nFrame#\tTime");
    for (size_t k = 0; k < COUNT_OF(names); k++)
        fprintf(out, "\tSubject1:%s\t\t", names[k]);
    fprintf(out, "\n\n");
    for (int i = 0; i < 60; i++) {
        fprintf(out, "%d\t%.3f", i, i / 100.0);
        for (size_t k = 0; k < COUNT_OF(names); k++)
            fprintf(out, "\t%.1f\t%.1f\t%.1f", (double)mm[k][0], (double)mm[k][1], (double)mm[k][2]);
        fputc('\n', out);
    }
    fclose(out);
    scratch_write(&scratch, "gait.trc", text, bytes);
    free(text);
    EXPECT_STATUS(joint_samples_read_motion(scratch_file(&scratch, "gait.trc"), &s), OK);
    EXPECT_TRUE(has_note(&s, "markers on the skin"));
    EXPECT_TRUE(has_note(&s, "right_elbow, right_hand"));
    const struct vec3 *joint = s.at[0].skeleton.joint;
    // Bell's: 240 mm between the anterior spines: 33.6 inwards, 72 down, 52.8 back.
    const struct vec3 hip = v3_sub(joint[JOINT_LEFT_HIP], joint[JOINT_WAIST]);
    EXPECT_NEAR(fabs(hip.x), 0.12 - 0.0336, 1e-5);
    EXPECT_NEAR(hip.y, 0.072, 1e-5); // y down
    EXPECT_NEAR(fabs(hip.z), 0.08 - 0.0528, 1e-5);
    EXPECT_NEAR(joint[JOINT_LEFT_HAND].y - joint[JOINT_LEFT_ELBOW].y, 0.25, 1e-5);
    EXPECT_NEAR(joint[JOINT_WAIST].y - joint[JOINT_NECK].y, 0.44, 1e-5);
    joint_samples_free(&s);
}

// The person as markers, y up, metres.
static struct markers person_markers(void)
{
    struct markers m = {.rate_hz = 30, .count = FRAMES, .at = malloc(FRAMES * sizeof *m.at)};
    assert_non_null(m.at);
    for (int i = 0; i < FRAMES; i++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = in_file(truth(i, (enum joint)j), false);
            for (int k = 0; k < 3; k++)
                m.at[i][j][k] = (float)(&p.x)[k];
        }
    return m;
}

struct bytes_of {
    uint8_t *at;
    size_t count;
};

static struct bytes_of person_c3d(void)
{
    struct markers m = person_markers();
    struct bytes_of b;
    FILE *out = open_memstream((char **)&b.at, &b.count);
    c3d_print(&m, out);
    fclose(out);
    markers_free(&m);
    return b;
}

enum c3d_kind { C3D_INTEL, C3D_INTEGERS, C3D_DEC };

// VAX's number: the halves exchanged, four times as large.
static void put_dec(uint8_t *at, float value)
{
    uint8_t ieee[4];
    put_f32(ieee, 4 * value);
    const uint8_t dec[4] = {ieee[2], ieee[3], ieee[0], ieee[1]};
    memcpy(at, dec, 4);
}

// The same file with other numbers; the person fits into 16 bits at a tenth of a millimetre but for the depth.
static void change_numbers(struct bytes_of *file, enum c3d_kind kind)
{
    const size_t data = 512 * (size_t)(file->at[16] - 1);
    const float scale = kind == C3D_INTEGERS ? 0.2F : -1;
    if (kind == C3D_INTEL)
        return;
    if (kind == C3D_DEC)
        file->at[515] = 85;
    if (kind == C3D_DEC) {
        put_dec(file->at + 12, scale);
        put_dec(file->at + 20, 30);
    } else {
        put_f32(file->at + 12, scale);
    }
    for (size_t k = 0; data + 4 * k < file->count; k++) {
        float value;
        memcpy(&value, file->at + data + 4 * k, 4);
        if (kind == C3D_DEC)
            put_dec(file->at + data + 4 * k, value);
        else
            put_u16(file->at + data + 2 * k, (uint16_t)(int16_t)lrintf(k % 4 == 3 ? value : value / scale));
    }
    if (kind == C3D_INTEGERS)
        file->count = data + (file->count - data) / 2;
}

static void test_c3d_of_all_machines(void **state)
{
    (void)state;
    for (enum c3d_kind kind = C3D_INTEL; kind <= C3D_DEC; kind++) {
        struct bytes_of file = person_c3d();
        struct joint_samples s;
        change_numbers(&file, kind);
        scratch_write(&scratch, "person.c3d", file.at, file.count);
        EXPECT_TRUE(is_joints_file(scratch_file(&scratch, "person.c3d")));
        EXPECT_STATUS(joint_samples_read_motion(scratch_file(&scratch, "person.c3d"), &s), OK);
        const double worst = worst_error(&s);
        print_message("C3D of kind %d: %.6f m\n", (int)kind, worst);
        EXPECT_AT_MOST(worst, kind == C3D_INTEGERS ? 5e-4 : 1e-5);
        EXPECT_INT(joints_known(&s, 0), JOINT_COUNT);
        joint_samples_free(&s);
        free(file.at);
    }
}

static void test_bvh_of_all_namings(void **state)
{
    (void)state;
    struct markers m = person_markers();
    for (int naming = 0; naming < ARMATURE_NAMINGS; naming++) {
        struct joint_samples s;
        struct armature_fit fit;
        char *text;
        size_t count;
        FILE *out = open_memstream(&text, &count);
        EXPECT_STATUS(armature_bvh_print(&m, (enum armature_naming)naming, out, &fit), OK);
        fclose(out);
        scratch_write(&scratch, "person.bvh", text, count);
        EXPECT_STATUS(joint_samples_read_motion(scratch_file(&scratch, "person.bvh"), &s), OK);
        const double worst = worst_error(&s);
        print_message("BVH: %.6f m, bones %.6f m off\n", worst, fit.max_m);
        EXPECT_AT_MOST(worst, 2 * fit.max_m + 1e-4);
        EXPECT_TRUE(has_note(&s, "centimetres"));
        EXPECT_INT(joints_known(&s, 0), JOINT_COUNT);
        joint_samples_free(&s);
        free(text);
    }
    markers_free(&m);
}

#define TRC_HEAD "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\n30\t30\t1\t1\tm\n"
#define BVH_HEAD                                                                                                       \
    "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 "        \
    "0\n}\n}\n"                                                                                                        \
    "MOTION\nFrames: 1\n"

static void test_refuses_in_a_sentence(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } bad[] = {
        {"PathFileType", "ends in its heading"},
        {TRC_HEAD, "ends in its heading"},
        {TRC_HEAD "Frame#\tTime\n", "line 4 names no point"},
        {TRC_HEAD "Frame#\tTime\thead\t\t\n\tX1\tY1\tZ1\n", "no row of numbers"},
        {TRC_HEAD "Frame#\tTime\tM001\t\t\n\tX1\n1\t0\t1\t2\t3\n", "has a joint's name (the first is 'M001')"},
        {TRC_HEAD "Frame#\tTime\thead\t\t\thead\t\t\n\tX1\n1\t0\t1\t2\t3\t1\t2\t3\n", "two points named 'head'"},
        {TRC_HEAD "Frame#\tTime\thead\t\t\n\tX1\n1\tnow\t1\t2\t3\n", "no time in seconds"},
        {TRC_HEAD "Frame#\tTime\tLHip\t\t\tRHip\t\t\n\tX1\n1\t0\t\t\t\t\t\t\n", "no joint that is known"},
        {BVH_HEAD "Frame Time: 0\n0 1 0\n", "its frame time is 0 s"},
        {BVH_HEAD "Frame Time: 0.03\n0 1\n", "ends in the middle"},
        {"HIERARCHY\n", "ends in the middle"},
        {"", "is empty"},
        {"SQLite", "is no BVH, TRC or C3D file"},
        {TRC_HEAD "Frame#\tTime\tLHip\t\t\tLeft_Foot\t\t\n\tX1\n1\t0\t1\t2\t3\t1\t2\t3\n",
         "neither both hips nor both shoulders are named in "},
    };
    for (size_t k = 0; k < COUNT_OF(bad); k++) {
        struct joint_samples s;
        scratch_text(&scratch, "bad", bad[k].text);
        EXPECT_STATUS(joint_samples_read_motion(scratch_file(&scratch, "bad"), &s), ERR_INPUT);
        EXPECT_SAYS(bad[k].says);
    }
    struct joint_samples s;
    EXPECT_STATUS(joint_samples_read_motion(write_trc(&namings[1], "Other:LeftForeArm"), &s), ERR_INPUT);
    EXPECT_SAYS("two points named 'mixamorig:LeftForeArm'");
}

static void test_refuses_broken_c3d(void **state)
{
    (void)state;
    struct bytes_of file = person_c3d();
    struct joint_samples s;
    const struct {
        size_t count, changed;
        uint8_t value;
        const char *says;
    } bad[] = {
        {300, 0, 2, "ends in its header"},    {file.count - 5000, 0, 2, "ends in the middle"},
        {file.count, 515, 86, "MIPS"},        {file.count, 23, 0, "no rate"}, // the exponent of 30
        {file.count, 2, 0, "empty C3D file"},
    };
    for (size_t k = 0; k < COUNT_OF(bad); k++) {
        uint8_t *copy = malloc(file.count);
        memcpy(copy, file.at, file.count);
        copy[bad[k].changed] = bad[k].value;
        scratch_write(&scratch, "bad.c3d", copy, bad[k].count);
        EXPECT_STATUS(joint_samples_read_motion(scratch_file(&scratch, "bad.c3d"), &s), ERR_INPUT);
        EXPECT_SAYS(bad[k].says);
        free(copy);
    }
    free(file.at);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
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
        cmocka_unit_test(test_names_of_many_programs), cmocka_unit_test(test_markers_on_the_skin),
        cmocka_unit_test(test_c3d_of_all_machines),    cmocka_unit_test(test_bvh_of_all_namings),
        cmocka_unit_test(test_refuses_in_a_sentence),  cmocka_unit_test(test_refuses_broken_c3d),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
