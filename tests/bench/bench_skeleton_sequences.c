// Stage "skeleton" on real people, next to the result of the Kinect SDK's tracker on the same images.
#include "platform/sensors/source.h"
#include "tests/bench/bench_skeleton_trials.h"
#include "tests/support/smoothed_film.h"

#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The joints compared, with the SDK's names; of two the nearer counts, and the first is the bone's end.
enum { COMPARED = 14, JOINTS_MOST = 20, FRAMES_MOST = 400, REACH = 4 };

static const struct {
    enum joint ours;
    const char *theirs[2];
} compared[COMPARED] = {
    {JOINT_HEAD, {"head", NULL}},
    {JOINT_NECK, {"shoulder_center", NULL}},
    {JOINT_LEFT_SHOULDER, {"left_shoulder", NULL}},
    {JOINT_RIGHT_SHOULDER, {"right_shoulder", NULL}},
    {JOINT_LEFT_ELBOW, {"left_elbow", NULL}},
    {JOINT_RIGHT_ELBOW, {"right_elbow", NULL}},
    {JOINT_LEFT_HAND, {"left_wrist", "left_hand"}},
    {JOINT_RIGHT_HAND, {"right_wrist", "right_hand"}},
    {JOINT_LEFT_HIP, {"left_hip", NULL}},
    {JOINT_RIGHT_HIP, {"right_hip", NULL}},
    {JOINT_LEFT_KNEE, {"left_knee", NULL}},
    {JOINT_RIGHT_KNEE, {"right_knee", NULL}},
    {JOINT_LEFT_FOOT, {"left_ankle", "left_foot"}},
    {JOINT_RIGHT_FOOT, {"right_ankle", "right_foot"}},
};

static const struct {
    int a, b;
} bone[] = {{2, 4}, {3, 5}, {4, 6}, {5, 7}, {8, 10}, {9, 11}, {10, 12}, {11, 13}};

static const char *const columns[] = {"head",      "neck",      "shoulders", "elbows",    "hands",  "hips",
                                      "knees",     "feet",      "median_mm", "over_80mm", "p95_mm", "bones_x",
                                      "jitter_mm", "theirs_mm", "step_mm",   "lost"};
enum { MEDIAN = 8, OVER, P95, BONES, JITTER, THEIRS, STEP, LOST };

struct sequence {
    struct vec3 ours[FRAMES_MOST][COMPARED];
    struct vec3 theirs[FRAMES_MOST][COMPARED][2]; // the same twice where there is only one
    bool found[FRAMES_MOST];
    int count, lost;
};

static enum status read_theirs(struct sequence *s, const char *folder)
{
    char path[4096], line[256], name[64];
    snprintf(path, sizeof path, "%s/truth/joints_kinect_sdk.csv", folder);
    FILE *file = fopen(path, "r");
    if (!file)
        return fail(ERR_MISSING, "%s: there is no reference to measure by", path);
    double t;
    struct vec3 p;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "%lf,%63[^,],%lf,%lf,%lf", &t, name, &p.x, &p.y, &p.z) != 5)
            continue;
        long frame = lround(t * 30);
        for (int k = 0; k < COMPARED && frame >= 0 && frame < s->count; k++)
            for (int i = 0; i < 2; i++) {
                const char *wanted = compared[k].theirs[compared[k].theirs[i] ? i : 0];
                if (!strcmp(name, wanted))
                    s->theirs[frame][k][i] = p;
            }
    }
    fclose(file);
    for (int f = 0; f < s->count; f++)
        for (int k = 0; k < COMPARED; k++)
            if (s->theirs[f][k][0].z <= 0 || s->theirs[f][k][1].z <= 0)
                return fail(ERR_INPUT, "%s: frame %d has no %s", path, f, compared[k].theirs[0]);
    return OK;
}

static enum status track_sequence(struct smoothed_film *f, const char *folder)
{
    char uri[4096];
    struct source *source;
    struct frame frame;
    snprintf(uri, sizeof uri, "folder:%s", folder);
    enum status status = source_open(&source, uri, SOURCE_SENSOR);
    if (status == OK)
        f->calibration = *source_calibration(source);
    while (status >= 0 && f->count < FRAMES_MOST && (status = source_next(source, &frame)) == OK)
        status = smoothed_film_add(f, frame.time_ns, frame.depth);
    source_close(&source);
    return status < 0 ? status : smoothed_film_track(f);
}

static enum status compare(struct sequence *s, const struct smoothed_film *f, const struct skeleton *got,
                           const char *folder)
{
    s->count = f->count;
    s->lost = 0;
    for (int i = 0; i < f->count; i++) {
        s->found[i] = f->found[i];
        s->lost += !f->found[i];
        for (int k = 0; k < COMPARED; k++)
            s->ours[i][k] = got[i].joint[compared[k].ours];
    }
    return read_theirs(s, folder);
}

static double gap(const struct sequence *s, int frame, int k)
{
    return fmin(v3_distance(s->ours[frame][k], s->theirs[frame][k][0]),
                v3_distance(s->ours[frame][k], s->theirs[frame][k][1]));
}

// Standard deviation of a bone's length.
static double bone_deviation(const struct sequence *s, int a, int b, bool ours)
{
    double sum = 0, sum2 = 0;
    for (int f = 0; f < s->count; f++) {
        double l =
            ours ? v3_distance(s->ours[f][a], s->ours[f][b]) : v3_distance(s->theirs[f][a][0], s->theirs[f][b][0]);
        sum += l;
        sum2 += l * l;
    }
    return sqrt(fmax(0, sum2 / s->count - sum / s->count * (sum / s->count)));
}

// Ratio of their bone-length deviation to ours, geometric mean over the bones.
static double deviation_ratio(const struct sequence *s)
{
    double sum = 0;
    for (size_t i = 0; i < COUNT_OF(bone); i++)
        sum += log(bone_deviation(s, bone[i].a, bone[i].b, false) /
                   fmax(1e-4, bone_deviation(s, bone[i].a, bone[i].b, true)));
    return exp(sum / COUNT_OF(bone));
}

static struct vec3 at(const struct sequence *s, bool ours, int f, int k)
{
    return ours ? s->ours[f][k] : s->theirs[f][k][0];
}

// Slow: compared with `REACH` frames before and after, averaged over as many.
static bool is_slow(const struct sequence *s, bool ours, int f, int k)
{
    struct vec3 go = v3(0, 0, 0);
    for (int i = 1; i <= REACH; i++)
        go = v3_add(go, v3_sub(at(s, ours, f + i, k), at(s, ours, f - i, k)));
    return v3_length(go) / (REACH * (REACH + 1)) * 30 < 0.03; // metres a second
}

// Where both trackers agree that a joint stands still: its rms distance from its own mean over the frames around. NaN:
// nothing stands still.
static void find_jitter(const struct sequence *s, double *ours_m, double *theirs_m)
{
    double sum[2] = {0, 0};
    int count = 0;
    for (int f = REACH; f < s->count - REACH; f++)
        for (int k = 0; k < COMPARED; k++) {
            if (!is_slow(s, true, f, k) || !is_slow(s, false, f, k))
                continue;
            count++;
            for (int ours = 0; ours < 2; ours++) {
                struct vec3 mean = v3(0, 0, 0);
                for (int i = -REACH; i <= REACH; i++)
                    mean = v3_add(mean, v3_scale(at(s, ours, f + i, k), 1.0 / (2 * REACH + 1)));
                struct vec3 off = v3_sub(at(s, ours, f, k), mean);
                sum[ours] += v3_dot(off, off);
            }
        }
    *ours_m = count ? sqrt(sum[1] / count) : NAN;
    *theirs_m = count ? sqrt(sum[0] / count) : NAN;
}

static void measure(const struct sequence *s, double value[COUNT_OF(columns)])
{
    static double all[FRAMES_MOST * COMPARED], one[FRAMES_MOST];
    int every = 0;
    for (size_t k = 0; k < COUNT_OF(columns); k++)
        value[k] = 0;
    for (int k = 0; k < COMPARED; k++) {
        int count = 0;
        for (int f = 0; f < s->count; f++) {
            if (s->found[f])
                one[count++] = all[every++] = gap(s, f, k);
            if (f > 0 && s->found[f] && s->found[f - 1])
                value[STEP] = fmax(value[STEP], 1000 * v3_distance(s->ours[f][k], s->ours[f - 1][k]));
        }
        double median = 1000 * bench_percentile(one, count, 0.5);
        int column = k < 2 ? k : 2 + (k - 2) / 2; // of a pair the worse
        value[column] = fmax(value[column], median);
        value[OVER] += median > 80;
    }
    value[MEDIAN] = 1000 * bench_percentile(all, every, 0.5);
    value[P95] = 1000 * bench_percentile(all, every, 0.95);
    value[BONES] = deviation_ratio(s);
    find_jitter(s, &value[JITTER], &value[THEIRS]);
    value[JITTER] *= 1000;
    value[THEIRS] *= 1000;
    value[LOST] = s->lost;
}

// Every `step`th row from `first` on: means, but the maximum of the step and the sum of counts.
static enum status sum_up(struct bench *b, const char *name, double (*values)[COUNT_OF(columns)], size_t count,
                          size_t first, size_t step)
{
    double out[COUNT_OF(columns)] = {0};
    for (size_t k = 0; k < COUNT_OF(columns); k++) {
        size_t used = 0;
        for (size_t i = first; i < count; i += step) {
            double v = values[i][k];
            if (isnan(v))
                continue;
            out[k] = k == STEP ? fmax(out[k], v) : out[k] + v;
            used++;
        }
        if (k != STEP && k != OVER && k != LOST)
            out[k] /= (double)used;
    }
    return bench_add_row(b, name, out);
}

enum { SMOOTHED, ONLINE, KINDS }; // from the whole take, and from the past only

typedef double values_row[COUNT_OF(columns)];

// One row for each kind.
static enum status add_sequence(struct bench *b, const char *folder, struct sequence *s, values_row *values[KINDS],
                                size_t at)
{
    struct smoothed_film f = {0};
    char name[300];
    const char *slash = strrchr(folder, '/');
    enum status status = track_sequence(&f, folder);
    for (int kind = 0; kind < KINDS && status == OK; kind++) {
        status = compare(s, &f, kind == ONLINE ? f.online : f.smoothed, folder);
        if (status != OK)
            break;
        measure(s, values[kind][at]);
        snprintf(name, sizeof name, "%.200s%s", slash ? slash + 1 : folder, kind == ONLINE ? ", online" : "");
        status = bench_add_row(b, name, values[kind][at]);
    }
    smoothed_film_free(&f);
    return status;
}

static enum status add_sums(struct bench *b, values_row *values[KINDS], size_t count)
{
    enum status status = sum_up(b, "first, third, fifth ...", values[SMOOTHED], count, 0, 2);
    if (status == OK)
        status = sum_up(b, "second, fourth, sixth ...", values[SMOOTHED], count, 1, 2);
    if (status == OK)
        status = sum_up(b, "all", values[SMOOTHED], count, 0, 1);
    return status == OK ? sum_up(b, "all, online", values[ONLINE], count, 0, 1) : status;
}

enum status trial_sequences(struct bench *b, const char *folder)
{
    char pattern[4096];
    glob_t folders;
    snprintf(pattern, sizeof pattern, "%s/*/truth/joints_kinect_sdk.csv", folder);
    if (glob(pattern, 0, NULL, &folders) || !folders.gl_pathc)
        return fail(ERR_MISSING, "%s: no folder with truth/joints_kinect_sdk.csv is there", folder);
    struct sequence *s = malloc(sizeof *s);
    values_row *values[KINDS] = {calloc(folders.gl_pathc, sizeof **values), calloc(folders.gl_pathc, sizeof **values)};
    enum status status = s && values[SMOOTHED] && values[ONLINE] ? OK : fail(ERR_MEMORY, "no memory for the bench");
    bench_columns(b, columns, COUNT_OF(columns));
    for (size_t i = 0; i < folders.gl_pathc && status == OK; i++) {
        char *path = folders.gl_pathv[i];
        *strstr(path, "/truth/joints_kinect_sdk.csv") = 0;
        status = add_sequence(b, path, s, values, i);
    }
    if (status == OK)
        status = add_sums(b, values, folders.gl_pathc);
    globfree(&folders);
    free(values[SMOOTHED]);
    free(values[ONLINE]);
    free(s);
    return status;
}
