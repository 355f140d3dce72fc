// Reading the body's joints from motion files: BVH, TRC and C3D, whose points are found by the names that programs and
// laboratories give them.
#include "base/text.h"
#include "compare/joint_rows.h"
#include "formats/motion_file.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- names

// A file's names, without what they share.
struct name_table {
    const struct motion_points *points;
    char (*plain)[POINT_NAME_BYTES]; // [points]
};

// How much of the name at `first` at least 60 % of all names begin with, up to a mark such as _ or a blank: CC_Base_,
// Character1_, Bip01 and the like.
static size_t shared_prefix(const struct motion_points *points, const char *first)
{
    size_t longest = 0;
    for (size_t length = 1; first[length - 1] && first[length]; length++) {
        int count = 0;
        if (!strchr("_ .|:", first[length - 1]))
            continue;
        for (int c = 0; c < points->points; c++)
            count += !strncmp(points->names[c], first, length);
        longest = 10 * count >= 6 * points->points && points->points > 1 ? length : longest;
    }
    return longest;
}

// Letters and digits alone, small, without a namespace: "mixamorig:LeftFore_Arm" is leftforearm.
static void plain_name(const char *name, char out[POINT_NAME_BYTES])
{
    const char *colon = strrchr(name, ':');
    size_t count = 0;
    for (const char *at = colon && colon[1] ? colon + 1 : name; *at; at++)
        if (isalnum((unsigned char)*at))
            out[count++] = (char)tolower((unsigned char)*at);
    out[count] = 0;
}

static enum status make_name_table(const struct motion_points *points, struct name_table *out)
{
    size_t shared = 0;
    const char *prefix = "";
    *out = (struct name_table){points, malloc((size_t)points->points * sizeof *out->plain)};
    if (!out->plain)
        return fail(ERR_MEMORY, "no memory for the names of points");
    for (int c = 0; c < 2 && c < points->points; c++) { // a root may have a name of its own
        const size_t length = shared_prefix(points, points->names[c]);
        prefix = length > shared ? points->names[c] : prefix;
        shared = length > shared ? length : shared;
    }
    for (int c = 0; c < points->points; c++) {
        const char *name = points->names[c];
        plain_name(shared && !strncmp(name, prefix, shared) && name[shared] ? name + shared : name, out->plain[c]);
    }
    return OK;
}

// The column of that plain name; -1: none. *twice: there is another one of it.
static int find_column(const struct name_table *names, const char *plain, bool *twice)
{
    int found = -1;
    for (int c = 0; c < names->points->points; c++) {
        if (strcmp(names->plain[c], plain) != 0)
            continue;
        *twice = *twice || found >= 0;
        found = found < 0 ? c : found;
    }
    return found;
}

// Words of a limb's joint, with left or l, right or r before or behind them; the earlier ones count where a file has
// several: what HumanIK and Mixamo call shoulder is the clavicle where there is an arm. They are ours, HumanIK's,
// Mixamo's, Unreal's, CMU's, Poser's, Character Creator's, OpenPose's, Kinect's, SMPL's, and Plug-in Gait's of joint
// centres.
enum { WORDS = 8 };
static const struct limb_words {
    enum joint left, right;
    const char *words[WORDS];
} limbs[] = {
    {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, {"arm", "upperarm", "uparm", "sjc", "shldr", "shoulder"}},
    {JOINT_LEFT_ELBOW, JOINT_RIGHT_ELBOW, {"forearm", "lowerarm", "lowarm", "ejc", "elbow"}},
    {JOINT_LEFT_HAND, JOINT_RIGHT_HAND, {"hand", "wjc", "wrist"}},
    {JOINT_LEFT_HIP, JOINT_RIGHT_HIP, {"upleg", "upperleg", "thigh", "hjc", "hip"}},
    {JOINT_LEFT_KNEE, JOINT_RIGHT_KNEE, {"leg", "lowerleg", "lowleg", "shin", "calf", "kjc", "knee"}},
    {JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, {"ankle", "ajc", "foot"}},
};
static const struct middle_words {
    enum joint joint;
    const char *words[WORDS];
} middles[] = {
    {JOINT_WAIST, {"waist", "hips", "pelvis", "midhip", "spinebase", "hip", "root"}},
    {JOINT_NECK, {"neck", "neck01", "spineshoulder", "neck1", "necktwist01"}},
    {JOINT_HEAD, {"head", "nose"}},
};
// Of these the one nearest to the middle between waist and neck is the torso: files number their spines differently.
static const char *const spines[] = {"torso",   "chest",   "spine",    "spine1",    "spine2", "spine3", "spine01",
                                     "spine02", "spine03", "spinemid", "lowerback", "thorax", "abdomen"};

// Markers of Plug-in Gait: a joint is the mean of these. The hips are computed (hip_centre).
enum { MARKERS = 4 };
static const struct joint_markers {
    enum joint joint;
    const char *markers[MARKERS];
} marker_sets[] = {
    {JOINT_HEAD, {"lfhd", "rfhd", "lbhd", "rbhd"}},
    {JOINT_NECK, {"c7", "clav"}},
    {JOINT_TORSO, {"t10", "strn"}},
    {JOINT_WAIST, {"lasi", "rasi", "lpsi", "rpsi"}},
    {JOINT_WAIST, {"lasi", "rasi", "sacr"}},
    {JOINT_LEFT_SHOULDER, {"lsho"}},
    {JOINT_RIGHT_SHOULDER, {"rsho"}},
    {JOINT_LEFT_ELBOW, {"lelb"}},
    {JOINT_RIGHT_ELBOW, {"relb"}},
    {JOINT_LEFT_HAND, {"lwra", "lwrb"}},
    {JOINT_RIGHT_HAND, {"rwra", "rwrb"}},
    {JOINT_LEFT_KNEE, {"lkne", "lmkne"}},
    {JOINT_LEFT_KNEE, {"lkne"}},
    {JOINT_RIGHT_KNEE, {"rkne", "rmkne"}},
    {JOINT_RIGHT_KNEE, {"rkne"}},
    {JOINT_LEFT_FOOT, {"lank", "lmed"}},
    {JOINT_LEFT_FOOT, {"lank"}},
    {JOINT_RIGHT_FOOT, {"rank", "rmed"}},
    {JOINT_RIGHT_FOOT, {"rank"}},
};

// Where a file has each joint: the mean of `count` columns; 0: nowhere.
struct columns {
    struct joint_columns {
        int count, at[MARKERS];
    } of[JOINT_COUNT];
    bool pelvis_markers; // the hips are to be computed from the markers of the waist
    bool markers;        // some joint is marked on the skin
    const char *twice;   // a name that two columns have; NULL: none
};

static void take_column(struct columns *columns, const struct name_table *names, enum joint joint, const char *plain)
{
    struct joint_columns *of = &columns->of[joint];
    bool twice = false;
    if (of->count)
        return;
    const int column = find_column(names, plain, &twice);
    if (column < 0)
        return;
    *of = (struct joint_columns){1, {column}};
    if (twice)
        columns->twice = names->points->names[column];
}

static void take_limb_words(struct columns *columns, const struct name_table *names)
{
    static const char *const sides[2][2] = {{"left", "l"}, {"right", "r"}};
    for (size_t i = 0; i < COUNT_OF(limbs); i++)
        for (int side = 0; side < 2; side++)
            for (int w = 0; w < WORDS && limbs[i].words[w]; w++)
                for (int s = 0; s < 4; s++) {
                    char plain[POINT_NAME_BYTES];
                    const char *word = limbs[i].words[w], *own = sides[side][s / 2];
                    snprintf(plain, sizeof plain, "%s%s", s % 2 ? word : own, s % 2 ? own : word);
                    take_column(columns, names, side ? limbs[i].right : limbs[i].left, plain);
                }
}

static void take_markers(struct columns *columns, const struct name_table *names)
{
    for (size_t i = 0; i < COUNT_OF(marker_sets); i++) {
        struct joint_columns *of = &columns->of[marker_sets[i].joint], found = {0};
        bool whole = !of->count, twice = false;
        for (int k = 0; k < MARKERS && marker_sets[i].markers[k] && whole; k++) {
            found.at[found.count] = find_column(names, marker_sets[i].markers[k], &twice);
            whole = found.at[found.count] >= 0;
            found.count++;
        }
        if (!whole)
            continue;
        *of = found;
        columns->markers = true;
        if (twice)
            columns->twice = names->points->names[found.at[0]];
        columns->pelvis_markers |= marker_sets[i].joint == JOINT_WAIST;
    }
}

// ---------------------------------------------------------------- points

static struct vec3 point_at(const struct motion_points *points, int64_t frame, int column)
{
    const float *at = points->at + 3 * ((size_t)frame * (size_t)points->points + (size_t)column);
    return v3((double)at[0], (double)at[1], (double)at[2]);
}

// NaN: not known.
static struct vec3 mean_at(const struct motion_points *points, int64_t frame, const struct joint_columns *of)
{
    struct vec3 sum = v3(0, 0, 0);
    for (int k = 0; k < of->count; k++)
        sum = v3_add(sum, point_at(points, frame, of->at[k]));
    return of->count ? v3_scale(sum, 1.0 / of->count) : v3(NAN, NAN, NAN);
}

static void take_torso(struct columns *columns, const struct name_table *names)
{
    const struct motion_points *points = names->points;
    double nearest = INFINITY;
    for (size_t i = 0; i < COUNT_OF(spines); i++) {
        struct columns candidate = {.twice = NULL};
        take_column(&candidate, names, JOINT_TORSO, spines[i]);
        if (!candidate.of[JOINT_TORSO].count)
            continue;
        double distance = 1e9; // where nothing is known of it, still better than none
        for (int64_t f = 0; f < points->frames && distance >= 1e9; f++) {
            const struct vec3 waist = mean_at(points, f, &columns->of[JOINT_WAIST]),
                              neck = mean_at(points, f, &columns->of[JOINT_NECK]),
                              at = mean_at(points, f, &candidate.of[JOINT_TORSO]);
            const double d = v3_distance(at, v3_scale(v3_add(waist, neck), 0.5));
            distance = isfinite(d) ? d : distance;
        }
        if (distance < nearest) {
            nearest = distance;
            columns->of[JOINT_TORSO] = candidate.of[JOINT_TORSO];
            columns->twice = candidate.twice ? candidate.twice : columns->twice;
        }
    }
}

static enum status find_columns(const struct motion_points *points, struct columns *out)
{
    struct name_table names;
    *out = (struct columns){.twice = NULL};
    const enum status status = make_name_table(points, &names);
    if (status != OK)
        return status;
    take_limb_words(out, &names);
    for (size_t i = 0; i < COUNT_OF(middles); i++)
        for (int w = 0; w < WORDS && middles[i].words[w]; w++)
            take_column(out, &names, middles[i].joint, middles[i].words[w]);
    take_torso(out, &names);
    take_markers(out, &names);
    free(names.plain);
    return OK;
}

// A hip's centre by the markers of both anterior and of the posterior iliac spines: 14 % of the anterior ones' distance
// towards the middle, 30 % down and 22 % back (Bell, Pedersen & Brand 1990). NaN: not known.
static struct vec3 hip_centre(const struct motion_points *points, int64_t frame, const struct joint_columns *waist,
                              bool left)
{
    const struct vec3 l = point_at(points, frame, waist->at[0]), r = point_at(points, frame, waist->at[1]),
                      back = waist->count > 3 ? v3_scale(v3_add(point_at(points, frame, waist->at[2]),
                                                                point_at(points, frame, waist->at[3])),
                                                         0.5)
                                              : point_at(points, frame, waist->at[2]);
    const struct vec3 across = v3_sub(l, r), middle = v3_scale(v3_add(l, r), 0.5), x = v3_unit(across),
                      up = v3_unit(v3_cross(v3_sub(middle, back), x)), ahead = v3_cross(x, up);
    const double width = v3_length(across);
    const struct vec3 from = left ? l : r, inwards = v3_scale(x, left ? -1 : 1);
    return v3_add(from, v3_add(v3_scale(inwards, 0.14 * width),
                               v3_add(v3_scale(up, -0.30 * width), v3_scale(ahead, -0.22 * width))));
}

// Fills in what others place: the waist between the hips, the neck between the shoulders, the torso between both.
static void fill_between(struct vec3 joint[JOINT_COUNT], enum joint joint_between, enum joint a, enum joint b)
{
    if (!v3_finite(joint[joint_between]))
        joint[joint_between] = v3_scale(v3_add(joint[a], joint[b]), 0.5);
}

static void joints_at(const struct motion_points *points, const struct columns *columns, int64_t frame,
                      struct vec3 joint[JOINT_COUNT])
{
    for (int j = 0; j < JOINT_COUNT; j++)
        joint[j] = mean_at(points, frame, &columns->of[j]);
    if (columns->pelvis_markers && !columns->of[JOINT_LEFT_HIP].count)
        joint[JOINT_LEFT_HIP] = hip_centre(points, frame, &columns->of[JOINT_WAIST], true);
    if (columns->pelvis_markers && !columns->of[JOINT_RIGHT_HIP].count)
        joint[JOINT_RIGHT_HIP] = hip_centre(points, frame, &columns->of[JOINT_WAIST], false);
    fill_between(joint, JOINT_WAIST, JOINT_LEFT_HIP, JOINT_RIGHT_HIP);
    fill_between(joint, JOINT_NECK, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
    fill_between(joint, JOINT_TORSO, JOINT_WAIST, JOINT_NECK);
}

static enum status make_rows(const struct motion_points *points, const struct columns *columns, struct joint_rows *out)
{
    const double metres = points->metres > 0 ? points->metres : 1;
    enum status status = OK;
    for (int64_t i = 0; i < points->frames; i++) {
        struct vec3 joint[JOINT_COUNT];
        joints_at(points, columns, i, joint);
        for (int j = 0; j < JOINT_COUNT && status == OK; j++)
            if (v3_finite(joint[j]))
                status = joint_rows_add(out, &(struct joint_row){.time = points->time_s[i],
                                                                 .place = v3_scale(joint[j], metres),
                                                                 .confidence = 1,
                                                                 .sigma = -1,
                                                                 .joint = (uint8_t)j});
    }
    return status;
}

// ---------------------------------------------------------------- the file

// What the file lacks, as a note.
static void note_columns(const struct columns *columns, const struct motion_points *points, struct joint_notes *notes)
{
    char missing[160] = "";
    for (int j = 0; j < JOINT_COUNT; j++) {
        const bool hip = j == JOINT_LEFT_HIP || j == JOINT_RIGHT_HIP,
                   between = j == JOINT_WAIST || j == JOINT_NECK || j == JOINT_TORSO;
        if (!columns->of[j].count && !between && !(hip && columns->pelvis_markers))
            snprintf(missing + strlen(missing), sizeof missing - strlen(missing), "%s%s", *missing ? ", " : "",
                     joint_name((enum joint)j));
    }
    if (*missing)
        joint_note(notes, "none of its %d points is named as %s would be; what hangs on them is not compared",
                   points->points, missing);
    if (columns->markers)
        joint_note(notes, "joints are taken from markers on the skin, which lie some centimetres beside them");
}

static bool has_both(const struct columns *columns, enum joint left, enum joint right)
{
    return columns->of[left].count && columns->of[right].count;
}

static enum status check_columns(const struct columns *columns, const struct motion_points *points, const char *path)
{
    int known = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        known += columns->of[j].count > 0;
    if (columns->twice)
        return fail(ERR_INPUT,
                    "%s has two points named '%s': which one is meant, or whose, is not known; leave one out", path,
                    columns->twice);
    if (known && !columns->pelvis_markers && !has_both(columns, JOINT_LEFT_HIP, JOINT_RIGHT_HIP) &&
        !has_both(columns, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER))
        return fail(
            ERR_INPUT,
            "neither both hips nor both shoulders are named in %s, so there is nothing to compare; names such as "
            "left_hip, LeftUpLeg, LHip or thigh_l are known",
            path);
    if (!known)
        return fail(ERR_INPUT,
                    "none of the %d points of %s has a joint's name (the first is '%s'); known are the names of "
                    "HumanIK, Mixamo, Unreal, CMU, OpenPose, Kinect, Plug-in Gait, and ours such as left_elbow",
                    points->points, path, points->names[0]);
    return OK;
}

static enum status read_points(const struct motion_points *points, const char *path, struct joint_samples *out)
{
    struct columns columns;
    struct joint_rows rows = {0};
    enum status status = find_columns(points, &columns);
    if (status == OK)
        status = check_columns(&columns, points, path);
    if (status != OK)
        return status;
    note_columns(&columns, points, &out->notes);
    status = make_rows(points, &columns, &rows);
    if (status == OK)
        status = joint_rows_samples(&rows, path, out);
    joint_rows_free(&rows);
    if (status == OK) // where nothing is said, z up is usual in laboratories
        joint_axes_settle_exact(out, points->up == UP_Y ? v3(0, 1, 0) : v3(0, 0, 1));
    return status;
}

bool is_joints_file(const char *path) { return is_motion_points_file(path) || is_joints_csv(path); }

enum status joint_samples_read_file(const char *path, struct joint_samples *out)
{
    return is_motion_points_file(path) ? joint_samples_read_motion(path, out) : joint_samples_read_csv(path, out);
}

enum status joint_samples_read_motion(const char *path, struct joint_samples *out)
{
    struct motion_points points;
    *out = (struct joint_samples){0};
    enum status status = motion_points_read(path, &points);
    if (status == OK)
        status = read_points(&points, path, out);
    motion_points_free(&points);
    if (status == OK)
        joint_samples_start_at_zero(out);
    else
        joint_samples_free(out);
    return status;
}
