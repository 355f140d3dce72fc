#include "compare/joint_rows.h"

#include "base/portable_math.h"
#include "base/text.h"
#include "formats/joints_csv.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// In how many metres and seconds a unit of the file is, judged by the body's size and the times' steps. ERR_INPUT: the
// times are none that a movement can be compared at; the sentence says the likely cause.
struct joint_units {
    double metres, seconds;
};

// ---------------------------------------------------------------- joint rows

enum status joint_rows_add(struct joint_rows *rows, const struct joint_row *row)
{
    if (rows->count == rows->capacity) {
        const int64_t capacity = rows->capacity ? 2 * rows->capacity : 4096;
        struct joint_row *at = realloc(rows->at, (size_t)capacity * sizeof *at);
        if (!at)
            return fail(ERR_MEMORY, "no memory for a movement's joints");
        rows->at = at;
        rows->capacity = capacity;
    }
    rows->at[rows->count++] = *row;
    return OK;
}

void joint_rows_free(struct joint_rows *rows)
{
    free(rows->at);
    *rows = (struct joint_rows){0};
}

// The end of the rows that have the time of row `first` and follow it.
static int64_t joint_rows_group(const struct joint_rows *rows, int64_t first)
{
    int64_t end = first + 1;
    while (end < rows->count && !(rows->at[end].time < rows->at[first].time) &&
           !(rows->at[end].time > rows->at[first].time))
        end++;
    return end;
}

// ------------------------------------------------------------- order

static int by_time_and_joint(const void *a, const void *b)
{
    const struct joint_row *x = a, *y = b;
    if (x->time < y->time || x->time > y->time)
        return x->time < y->time ? -1 : 1;
    return x->joint - y->joint;
}

// Brings rows into the order of time where the file has another one (a joint after the other, backwards, shuffled).
// Where the same joint comes twice at one time, or few steps go back, the clock has jumped instead: nothing is done.
static enum status joint_rows_sort(struct joint_rows *rows, struct joint_notes *notes)
{
    int64_t times = 0, back = 0, sorted_times = 0;
    for (int64_t i = 0; i < rows->count; i = joint_rows_group(rows, i), times++)
        back += i && rows->at[i].time < rows->at[i - 1].time;
    if (!back)
        return OK;
    const size_t bytes = (size_t)rows->count * sizeof *rows->at;
    struct joint_row *sorted = malloc(bytes);
    if (!sorted)
        return fail(ERR_MEMORY, "no memory to sort a movement's joints");
    memcpy(sorted, rows->at, bytes);
    qsort(sorted, (size_t)rows->count, sizeof *sorted, by_time_and_joint);
    bool twice = false;
    for (int64_t i = 0; i < rows->count; i++) {
        const bool same_time = i && !(sorted[i].time > sorted[i - 1].time);
        twice = twice || (same_time && sorted[i].joint == sorted[i - 1].joint);
        sorted_times += !same_time;
    }
    // Few steps back to times that are not the same again are a clock's. By hand: a quarter, a half.
    if (!twice && (4 * back > times || 2 * sorted_times <= times)) {
        memcpy(rows->at, sorted, bytes);
        joint_note(notes, "the rows are not in the order of time; they were sorted");
    }
    free(sorted);
    return OK;
}

// ------------------------------------------------------------- holes

static bool is_zero(const struct joint_row *row)
{
    return !(fabs(row->place.x) > 0) && !(fabs(row->place.y) > 0) && !(fabs(row->place.z) > 0);
}

// Takes out joints at 0, 0, 0 exactly, as many programs write what they have not seen. A waist, or torso, that is there
// at all times and alone is the origin of its file and stays.
static void joint_rows_drop_zeros(struct joint_rows *rows, struct joint_notes *notes)
{
    int64_t all[JOINT_COUNT] = {0}, zero[JOINT_COUNT] = {0}, dropped = 0, kept = 0, zeros = 0;
    for (int64_t i = 0; i < rows->count; i++) {
        all[rows->at[i].joint]++;
        zero[rows->at[i].joint] += is_zero(&rows->at[i]);
        zeros += is_zero(&rows->at[i]);
    }
    int origin = -1;
    for (int j = JOINT_TORSO; j <= JOINT_WAIST; j++)
        if (all[j] && zero[j] == all[j] && zeros == zero[j])
            origin = j;
    if (origin >= 0)
        return;
    for (int64_t i = 0; i < rows->count; i++) {
        if (is_zero(&rows->at[i]))
            dropped++;
        else
            rows->at[kept++] = rows->at[i];
    }
    rows->count = kept;
    if (dropped)
        joint_note(notes, "%lld joints lie at 0, 0, 0 exactly; they were taken as not seen", (long long)dropped);
}

// ---------------------------------------------------------------- joint units

// The units of a file, by the size of the body and by the steps of the times.

// A grown person's bones, m, and height: by hand, of the man and the woman in tests/world. What is measured is only
// which power of ten, or inches, and people are 0.5 to 2.6 m tall.
static const double HEIGHT_M = 1.7, MIN_HEIGHT_M = 0.5, MAX_HEIGHT_M = 2.6;
static const struct bone {
    enum joint from, to;
    double length_m;
} bones[] = {
    {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, 0.42},           {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, 0.42},
    {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, 0.42},          {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, 0.42},
    {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, 0.29},     {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, 0.29},
    {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, 0.26},         {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, 0.26},
    {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, 0.35},
};

struct body_at {
    struct vec3 place[JOINT_COUNT];
    bool known[JOINT_COUNT];
};

static struct body_at body_of(const struct joint_rows *rows, int64_t first, int64_t end)
{
    struct body_at b = {0};
    for (int64_t i = first; i < end; i++) {
        b.place[rows->at[i].joint] = rows->at[i].place;
        b.known[rows->at[i].joint] = true;
    }
    return b;
}

// As high as a grown person with bones of these lengths; 0: no bone is known.
static double height_of(const struct body_at *body_at)
{
    double length = 0, usual = 0;
    for (size_t k = 0; k < COUNT_OF(bones); k++)
        if (body_at->known[bones[k].from] && body_at->known[bones[k].to]) {
            length += v3_distance(body_at->place[bones[k].from], body_at->place[bones[k].to]);
            usual += bones[k].length_m;
        }
    return usual > 0 ? HEIGHT_M * length / usual : 0;
}

// The longest way of a joint between two instants.
static double way_of(const struct body_at *a, const struct body_at *b)
{
    double max = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (a->known[j] && b->known[j])
            max = fmax(max, v3_distance(a->place[j], b->place[j]));
    return max;
}

// Medians over the instants, in the file's units; 0: not known.
struct medians {
    double height, step, way;
    bool whole; // all times are whole numbers
    int64_t times;
};

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double find_median(double *values, int64_t count)
{
    if (!count)
        return 0;
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    return values[count / 2];
}

static enum status measure_medians(const struct joint_rows *rows, struct medians *out)
{
    *out = (struct medians){.whole = true};
    for (int64_t i = 0; i < rows->count; i = joint_rows_group(rows, i)) {
        out->whole = out->whole && !(fabs(rows->at[i].time - floor(rows->at[i].time)) > 0);
        out->times++;
    }
    double *height = malloc(3 * ((size_t)out->times + 1) * sizeof *height);
    if (!height)
        return fail(ERR_MEMORY, "no memory to judge a movement's units");
    double *step = height + out->times + 1, *way = step + out->times + 1;
    int64_t heights = 0, steps = 0;
    struct body_at before = {0};
    for (int64_t i = 0, end; i < rows->count; i = end) {
        end = joint_rows_group(rows, i);
        const struct body_at b = body_of(rows, i, end);
        const double h = height_of(&b);
        if (h > 0)
            height[heights++] = h;
        if (i && rows->at[i].time > rows->at[i - 1].time) {
            step[steps] = rows->at[i].time - rows->at[i - 1].time;
            way[steps++] = way_of(&before, &b);
        }
        before = b;
    }
    out->height = find_median(height, heights);
    out->step = find_median(step, steps);
    out->way = find_median(way, steps);
    free(height);
    return OK;
}

static double metres_of(double height, struct joint_notes *notes)
{
    static const struct {
        const char *name;
        double metres;
    } units[] = {{"millimetres", 0.001}, {"centimetres", 0.01}, {"inches", 0.0254}, {"feet", 0.3048}};
    if (!(height > 0) || (height >= MIN_HEIGHT_M && height <= MAX_HEIGHT_M))
        return 1;
    int best = -1;
    double min = INFINITY;
    for (int k = 0; k < (int)COUNT_OF(units); k++) {
        const double m = height * units[k].metres, off = fabs(portable_log(m / HEIGHT_M));
        if (m >= MIN_HEIGHT_M && m <= MAX_HEIGHT_M && off < min) {
            min = off;
            best = k;
        }
    }
    if (best >= 0) {
        joint_note(notes, "the body would be %.0f m tall: its positions were read as %s", height, units[best].name);
        return units[best].metres;
    }
    joint_note(notes, "the body would be %.3g m tall: its positions are in no usual unit and were read as %.1f m",
               height, HEIGHT_M);
    return HEIGHT_M / height;
}

// What movements can be compared at: movement.h bridges gaps up to a quarter of a second. By hand: below 500 Hz; a
// joint that half of the time goes faster than a hand ever does is in another unit.
static const double MAX_STEP_S = 0.2501, MIN_STEP_S = 0.002, MAX_SPEED = 12;
enum { FEW_TIMES = 3 };

static enum status seconds_of(const struct medians *medians, const char *path, struct joint_units *out,
                              struct joint_notes *notes)
{
    static const struct {
        const char *name;
        double seconds;
    } units[] = {{"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"nanoseconds", 1e-9}};
    out->seconds = 1;
    if (medians->times < FEW_TIMES || (medians->step <= MAX_STEP_S && medians->step >= MIN_STEP_S * 0.05))
        return OK;
    if (medians->step < MAX_STEP_S)
        return fail(ERR_INPUT, "%s: its times are %.2g apart: they are no seconds; write seconds into the first column",
                    path, medians->step);
    for (size_t k = 0; k < COUNT_OF(units); k++) {
        const double step_s = medians->step * units[k].seconds;
        if (step_s < MIN_STEP_S || step_s > MAX_STEP_S || medians->way * out->metres > MAX_SPEED * step_s)
            continue;
        joint_note(notes, "its times are %.4g apart: they were read as %s", medians->step, units[k].name);
        out->seconds = units[k].seconds;
        return OK;
    }
    if (medians->whole)
        return fail(ERR_INPUT,
                    "%s: its times are whole numbers, %.0f apart: if they number the frames, divide them by the frame "
                    "rate; if they are seconds, there are too few frames: at least 4 a second are needed",
                    path, medians->step);
    return fail(ERR_INPUT, "%s has a frame every %.2g s only; at least 4 a second are needed, with times in seconds",
                path, medians->step);
}

static enum status joint_rows_units(const struct joint_rows *rows, const char *path, struct joint_units *out,
                                    struct joint_notes *notes)
{
    struct medians m;
    *out = (struct joint_units){1, 1};
    enum status status = measure_medians(rows, &m);
    if (status != OK)
        return status;
    out->metres = metres_of(m.height, notes);
    return seconds_of(&m, path, out, notes);
}

// ---------------------------------------------------------------- joint axes

// Which way a file's axes point, by the body: a head is above the feet, knees bend forwards.
//
// Up is where a person who stands straight for a second points to. Of others it is the mean, over the samples in which
// a shin and the trunk point the same way, of the direction from the feet to the middle of the trunk, which is balanced
// above them, or of trunk and shins of one who sits; samples more than 45 degrees off are left out. A direction near an
// axis is that axis, and what remains is the tilt of a sensor. Handedness is the sense in which knees bend: from thigh
// to shin about the axis from the right hip to the left. It needs no up. Elbows, which turn further, are asked where
// the knees say nothing.

// By hand, as cosines of 35, 25, 12 and 45 degrees. A camera is tilted by at most 35; other axes are upright, and one
// who sits leans by at most 25. Balance is within 6 degrees of up in all motions of tests/world. A share: a person who
// turns somersaults is upright longer than not.
static const double NEAR_CAMERA = 0.819, NEAR_AXIS = 0.906, NEAR_BALANCE = 0.978, NEAR_UP = 0.707;
static const double UPRIGHT_SHARE = 0.6, MIN_UPRIGHT = 0.1;
static const double PARALLEL = 0.866; // of shin and trunk: 30 degrees

static bool is_joint_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0;
}

static bool find_middle(const struct skeleton *skeleton, enum joint a, enum joint b, struct vec3 *out)
{
    *out = v3_mix(skeleton->joint[a], skeleton->joint[b], 0.5);
    return is_joint_known(skeleton, a) && is_joint_known(skeleton, b);
}

static bool upper_end(const struct skeleton *skeleton, struct vec3 *out)
{
    if (find_middle(skeleton, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, out))
        return true;
    *out = skeleton->joint[is_joint_known(skeleton, JOINT_NECK) ? JOINT_NECK : JOINT_HEAD];
    return is_joint_known(skeleton, JOINT_NECK) || is_joint_known(skeleton, JOINT_HEAD);
}

static bool lower_end(const struct skeleton *skeleton, struct vec3 *out)
{
    if (find_middle(skeleton, JOINT_LEFT_HIP, JOINT_RIGHT_HIP, out))
        return true;
    *out = skeleton->joint[is_joint_known(skeleton, JOINT_WAIST) ? JOINT_WAIST : JOINT_TORSO];
    return is_joint_known(skeleton, JOINT_WAIST) || is_joint_known(skeleton, JOINT_TORSO);
}

// From the hips to the shoulders; of a bust from the shoulders to the head.
static bool trunk_axis(const struct skeleton *skeleton, struct vec3 *axis)
{
    struct vec3 from, to;
    if (!upper_end(skeleton, &to))
        return false;
    if (!lower_end(skeleton, &from)) {
        from = to;
        to = skeleton->joint[JOINT_HEAD];
        if (!is_joint_known(skeleton, JOINT_HEAD))
            return false;
    }
    *axis = v3_unit(v3_sub(to, from));
    return v3_length(*axis) > 0;
}

// ------------------------------------------------------------- up

// Whether the thighs hang down from the hips, as of one who stands.
static bool thighs_hang(const struct skeleton *skeleton, struct vec3 trunk)
{
    static const enum joint thigh[2][2] = {{JOINT_LEFT_KNEE, JOINT_LEFT_HIP}, {JOINT_RIGHT_KNEE, JOINT_RIGHT_HIP}};
    for (int side = 0; side < 2; side++)
        if (is_joint_known(skeleton, thigh[side][0]) && is_joint_known(skeleton, thigh[side][1]) &&
            v3_dot(v3_unit(v3_sub(skeleton->joint[thigh[side][1]], skeleton->joint[thigh[side][0]])), trunk) < 0.5)
            return false;
    return true;
}

// The body's own up where it stands or sits. Of one who stands from the feet to the middle of the trunk, which is
// balanced above them; of one who sits the mean of trunk and shins. legs: whether the file has any.
enum posture { POSTURE_OTHER, POSTURE_SITS, POSTURE_STANDS };

static enum posture upright_axis(const struct skeleton *skeleton, bool legs, struct vec3 *axis)
{
    static const enum joint shin[2][2] = {{JOINT_LEFT_FOOT, JOINT_LEFT_KNEE}, {JOINT_RIGHT_FOOT, JOINT_RIGHT_KNEE}};
    struct vec3 sum, feet, upper, lower;
    if (!trunk_axis(skeleton, &sum))
        return POSTURE_OTHER;
    const struct vec3 trunk = sum;
    bool upright = !legs;
    for (int side = 0; side < 2; side++) {
        if (!is_joint_known(skeleton, shin[side][0]) || !is_joint_known(skeleton, shin[side][1]))
            continue;
        const struct vec3 up = v3_unit(v3_sub(skeleton->joint[shin[side][1]], skeleton->joint[shin[side][0]]));
        if (v3_dot(up, trunk) < PARALLEL)
            continue;
        sum = v3_add(sum, up);
        upright = true;
    }
    const bool stands = find_middle(skeleton, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, &feet) &&
                        upper_end(skeleton, &upper) && lower_end(skeleton, &lower) && thighs_hang(skeleton, trunk);
    *axis = v3_unit(stands ? v3_sub(v3_mix(upper, lower, 0.5), feet) : sum);
    if (!upright)
        return POSTURE_OTHER;
    return stands ? POSTURE_STANDS : POSTURE_SITS;
}

struct up {
    struct vec3 axis; // unit
    double share;     // of the upright samples that agree
    int64_t upright;  // samples
    int64_t standing; // of these
};

static struct vec3 sum_near(const struct joint_samples *samples, bool legs, const struct vec3 *about, struct up *count)
{
    struct vec3 sum = {0, 0, 0}, axis;
    int64_t near = 0;
    count->upright = count->standing = 0;
    for (int64_t i = 0; i < samples->count; i++) {
        const enum posture posture = upright_axis(&samples->at[i].skeleton, legs, &axis);
        if (posture == POSTURE_OTHER)
            continue;
        count->upright++;
        count->standing += posture == POSTURE_STANDS;
        if (about && v3_dot(axis, *about) < NEAR_UP)
            continue;
        near++;
        sum = v3_add(sum, axis);
    }
    count->share = count->upright ? (double)near / (double)count->upright : 0;
    return sum;
}

static struct up find_up(const struct joint_samples *samples)
{
    struct up up = {0};
    bool legs = false;
    for (int64_t i = 0; i < samples->count && !legs; i++) {
        const struct skeleton *skeleton = &samples->at[i].skeleton;
        legs = (is_joint_known(skeleton, JOINT_LEFT_KNEE) && is_joint_known(skeleton, JOINT_LEFT_FOOT)) ||
               (is_joint_known(skeleton, JOINT_RIGHT_KNEE) && is_joint_known(skeleton, JOINT_RIGHT_FOOT));
    }
    up.axis = v3_unit(sum_near(samples, legs, NULL, &up));
    for (int pass = 0; pass < 3; pass++) {
        const struct vec3 about = up.axis;
        up.axis = v3_unit(sum_near(samples, legs, &about, &up));
    }
    return up;
}

// ------------------------------------------------------------- what rests

// How far a point goes in all: the diagonal of the box that holds it but for a twentieth of the time to each side.
struct track {
    float *x[3]; // [samples]
    int64_t count;
};

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double range_of(struct track *track)
{
    double sum = 0;
    if (!track->count)
        return 0;
    for (int k = 0; k < 3; k++) {
        qsort(track->x[k], (size_t)track->count, sizeof(float), compare_floats);
        const int64_t margin = track->count / 20;
        const double range = (double)track->x[k][track->count - 1 - margin] - track->x[k][margin];
        sum += range * range;
    }
    return sqrt(sum);
}

static double joint_range(const struct joint_samples *samples, enum joint a, enum joint b, struct track *track)
{
    track->count = 0;
    for (int64_t i = 0; i < samples->count; i++) {
        struct vec3 p;
        if (!find_middle(&samples->at[i].skeleton, a, b, &p))
            continue;
        track->x[0][track->count] = (float)p.x;
        track->x[1][track->count] = (float)p.y;
        track->x[2][track->count++] = (float)p.z;
    }
    return range_of(track);
}

static bool hands_beyond_head(const struct joint_samples *samples, struct vec3 up)
{
    int64_t beyond = 0, seen = 0;
    for (int64_t i = 0; i < samples->count; i++) {
        const struct skeleton *skeleton = &samples->at[i].skeleton;
        struct vec3 hands;
        if (!find_middle(skeleton, JOINT_LEFT_HAND, JOINT_RIGHT_HAND, &hands) || !is_joint_known(skeleton, JOINT_HEAD))
            continue;
        seen++;
        beyond += v3_dot(v3_sub(hands, skeleton->joint[JOINT_HEAD]), up) > 0;
    }
    return seen && 10 * beyond > 9 * seen;
}

static enum status cannot_tell(const char *path, const char *why)
{
    return fail(ERR_INPUT,
                "%s does not say its axes, and they cannot be told: %s; write '" JOINTS_CSV_MARK
                " camera' (y down) or '" JOINTS_CSV_MARK " room' (z up) as its first line",
                path, why);
}

// A body that stands rests on a foot. Where both feet go about and the trunk lies still, or the hands beyond the head
// do, the body lies, hangs or stands on its hands: its up is not the world's. By hand: 5 cm, 15 cm.
static enum status check_support(const struct joint_samples *samples, const char *path, struct vec3 up)
{
    static const double STILL_M = 0.05, GOING_M = 0.15;
    float *room = malloc(3 * (size_t)samples->count * sizeof *room);
    if (!room)
        return fail(ERR_MEMORY, "no memory to find a movement's axes");
    struct track t = {.x = {room, room + samples->count, room + 2 * samples->count}};
    const double left = joint_range(samples, JOINT_LEFT_FOOT, JOINT_LEFT_FOOT, &t),
                 right = joint_range(samples, JOINT_RIGHT_FOOT, JOINT_RIGHT_FOOT, &t),
                 trunk = joint_range(samples, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, &t), feet = fmin(left, right);
    const bool lies = t.count && trunk < STILL_M;
    const double hands = joint_range(samples, JOINT_LEFT_HAND, JOINT_RIGHT_HAND, &t);
    const bool hangs = t.count && hands < STILL_M && hands_beyond_head(samples, up);
    free(room);
    if (feet < GOING_M || (!lies && !hangs))
        return OK;
    return cannot_tell(path, lies ? "both feet move while the trunk lies still, so the person may be lying"
                                  : "both feet move while the hands beyond the head do not, so the person may hang, or "
                                    "stand on the hands");
}

// ------------------------------------------------------------- handedness

// A joint that bends one way alone, and the sine of the least bend that tells which way: a sensor sees a straight knee
// bent backwards by up to 37 degrees, and an elbow by 25 (Kinect v2, 76 people of KIMORE who stand).
struct hinge {
    enum joint upper, middle, lower;
    double least;
};
static const double KNEE_SINE = 0.643, ELBOW_SINE = 0.5; // 40 and 30 degrees

static void bends_of(const struct skeleton *skeleton, const struct hinge *hinge, struct vec3 left, double bend[2],
                     int64_t *count)
{
    if (!is_joint_known(skeleton, hinge->upper) || !is_joint_known(skeleton, hinge->middle) ||
        !is_joint_known(skeleton, hinge->lower))
        return;
    const struct vec3 upper = v3_unit(v3_sub(skeleton->joint[hinge->middle], skeleton->joint[hinge->upper])),
                      lower = v3_unit(v3_sub(skeleton->joint[hinge->lower], skeleton->joint[hinge->middle]));
    const double sense = v3_dot(v3_cross(upper, lower), left);
    if (!(fabs(sense) > hinge->least))
        return;
    bend[sense > 0] += fabs(sense);
    (*count)++;
}

// 1: the axes are right-handed; -1: left-handed, or left and right are exchanged; 0: not known. doubt: whether elbows
// count, too.
static int find_handedness(const struct joint_samples *samples, bool doubt)
{
    const struct hinge knees[2] = {{JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, KNEE_SINE},
                                   {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, KNEE_SINE}},
                       elbows[2] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, ELBOW_SINE},
                                    {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, ELBOW_SINE}};
    static const enum joint pairs[2][2] = {{JOINT_LEFT_HIP, JOINT_RIGHT_HIP},
                                           {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}};
    double bend[2][2] = {{0}};
    int64_t count[2] = {0, 0};
    for (int64_t i = 0; i < samples->count; i++) {
        const struct skeleton *skeleton = &samples->at[i].skeleton;
        for (int pair = 0; pair < 2; pair++) {
            const enum joint l = pairs[pair][0], r = pairs[pair][1];
            if (!is_joint_known(skeleton, l) || !is_joint_known(skeleton, r))
                continue;
            const struct vec3 left = v3_unit(v3_sub(skeleton->joint[l], skeleton->joint[r]));
            for (int side = 0; side < 2; side++)
                bends_of(skeleton, pair ? &elbows[side] : &knees[side], left, bend[pair], &count[pair]);
        }
    }
    // By hand: ten bent knees, four fifths of them one way; of elbows thrice as many.
    enum { LEAST = 10 };
    static const double CLEAR = 4;
    if (count[0] >= LEAST && fmax(bend[0][0], bend[0][1]) > CLEAR * fmin(bend[0][0], bend[0][1]))
        return bend[0][1] > bend[0][0] ? 1 : -1;
    if (doubt && count[1] >= 3 * LEAST && fmax(bend[1][0], bend[1][1]) > CLEAR * fmin(bend[1][0], bend[1][1]))
        return bend[1][1] > bend[1][0] ? -1 : 1;
    return 0;
}

// ------------------------------------------------------------- turning

// Rows of a matrix into the axes of joint_samples.h.
struct turn {
    struct vec3 row[3];
};

static void apply_turn(struct joint_samples *samples, const struct turn *turn)
{
    for (int64_t i = 0; i < samples->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = samples->at[i].skeleton.joint[j];
            samples->at[i].skeleton.joint[j] =
                v3(v3_dot(turn->row[0], p), v3_dot(turn->row[1], p), v3_dot(turn->row[2], p));
        }
}

static double axis_component(struct vec3 v, int axis)
{
    if (axis == 0)
        return v.x;
    return axis == 1 ? v.y : v.z;
}

static struct vec3 unit_along(int axis, double sign)
{
    return v3(axis == 0 ? sign : 0, axis == 1 ? sign : 0, axis == 2 ? sign : 0);
}

// Up as camera axes have it, which files without a line have most often.
static bool is_camera(struct vec3 up) { return -up.y >= NEAR_CAMERA; }

// The axis that up is nearest to, and whether it is up or down.
static struct vec3 nearest_axis(struct vec3 up)
{
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(axis_component(up, k)) > fabs(axis_component(up, axis)))
            axis = k;
    return unit_along(axis, axis_component(up, axis) < 0 ? -1 : 1);
}

// Up becomes -y by a rotation, mirrored in x if so wanted.
static struct turn turn_for(struct vec3 up, bool mirror)
{
    // Some level direction; x where it is one, so that little is turned.
    const bool along = v3_distance(up, nearest_axis(up)) < 1e-9;
    const struct vec3 x = along ? unit_along(fabs(up.x) > 0.5, 1) : v3_perpendicular(up), down = v3_scale(up, -1);
    return (struct turn){{v3_scale(x, mirror ? -1 : 1), down, v3_cross(x, down)}};
}

static const char *axis_words(struct vec3 up, char out[60])
{
    const struct vec3 axis = nearest_axis(up);
    const double off = portable_acos(fmin(1, v3_dot(up, axis)));
    char letter = 'z';
    if (fabs(axis.x) > 0.5)
        letter = 'x';
    else if (fabs(axis.y) > 0.5)
        letter = 'y';
    const int used = snprintf(out, 60, "%c %s", letter, axis.x + axis.y + axis.z > 0 ? "up" : "down");
    if (off > 1e-6)
        snprintf(out + used, 60 - (size_t)used, ", tilted by %.0f degrees", off * 180 / 3.14159265358979323846);
    return out;
}

static const char backwards[] =
    "knees bend backwards: its axes are left-handed, or left and right are exchanged; it was read as left-handed, and "
    "if sides are exchanged, what is said of a side holds for the other";

static enum status apply_stated_axes(struct joint_samples *samples, enum joints_csv_axes said)
{
    static const struct turn from_room = {{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}},
                             mirrored = {{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    if (said == JOINTS_CSV_ROOM)
        apply_turn(samples, &from_room);
    const struct up up = find_up(samples);
    static const double LIES = 0.5;                                  // a cosine: 60 degrees from up; by hand
    const double above = up.share >= UPRIGHT_SHARE ? -up.axis.y : 1; // cosine
    if (find_handedness(samples, false) < 0) {
        joint_note(&samples->notes, "%s", backwards);
        const struct turn turn = above < NEAR_UP ? turn_for(nearest_axis(up.axis), true) : mirrored;
        apply_turn(samples, &turn);
    } else if (above < LIES) {
        joint_note(&samples->notes,
                   "by its line '" JOINTS_CSV_MARK " %s' the person %s; if that is not so, take the line out",
                   joints_csv_axes_names[said], above < -NEAR_UP ? "is upside down" : "lies");
    }
    if (said != JOINTS_CSV_ROOM)
        joint_samples_level(samples);
    return OK;
}

static bool can_be_compared(const struct joint_samples *samples)
{
    bool ever[JOINT_COUNT] = {0};
    for (int64_t i = 0; i < samples->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            ever[j] = ever[j] || is_joint_known(&samples->at[i].skeleton, (enum joint)j);
    return (ever[JOINT_LEFT_HIP] && ever[JOINT_RIGHT_HIP]) || (ever[JOINT_LEFT_SHOULDER] && ever[JOINT_RIGHT_SHOULDER]);
}

// The direction that is to be made up. *up: an axis, where up is near one; what remains is a sensor's tilt, which
// standing tells. False: it is not clear.
static bool settle_up(const struct joint_samples *samples, const struct up *found, struct vec3 *up)
{
    struct vec3 straight;
    const bool stands_straight = joint_samples_standing(samples, &straight) && v3_dot(straight, found->axis) >= NEAR_UP,
               balanced = !stands_straight && 2 * found->standing > found->upright;
    *up = stands_straight ? straight : found->axis;
    const struct vec3 axis = nearest_axis(*up);
    const bool near = balanced ? v3_dot(*up, axis) >= NEAR_BALANCE : is_camera(*up) || v3_dot(*up, axis) >= NEAR_AXIS;
    if (near)
        *up = axis;
    return near || balanced || stands_straight;
}

static void note_axes(struct joint_samples *samples, struct vec3 up, int hand)
{
    char words[60];
    if (-up.y >= 1) {
        if (hand < 0)
            joint_note(&samples->notes, "%s", backwards);
        return;
    }
    const char *right_handed = hand ? "" : "; right-handed ones were taken for granted";
    joint_note(&samples->notes, "it does not say its axes; by the person's head and feet they are %s%s",
               axis_words(up, words), hand < 0 ? ", and left-handed by the knees" : right_handed);
}

static enum status find_out(struct joint_samples *samples, const char *path)
{
    struct vec3 axis;
    const struct up up = find_up(samples);
    if ((double)up.upright < MIN_UPRIGHT * (double)samples->count)
        return cannot_tell(path, "the person neither stands nor sits");
    if (up.share < UPRIGHT_SHARE)
        return cannot_tell(path, "the person is upright and upside down by turns");
    if (!settle_up(samples, &up, &axis))
        return cannot_tell(path, "no axis points up or down, and the person never stands");
    enum status status = is_camera(axis) ? OK : check_support(samples, path, axis);
    if (status != OK)
        return status;
    const int hand = find_handedness(samples, true);
    note_axes(samples, axis, hand);
    if (!(-axis.y >= 1) || hand < 0) {
        const struct turn turn = turn_for(axis, hand < 0);
        apply_turn(samples, &turn);
    }
    joint_samples_level(samples);
    return OK;
}

enum status joint_axes_settle(struct joint_samples *samples, const char *path, int said)
{
    if (!can_be_compared(samples))
        return OK;
    return said >= 0 ? apply_stated_axes(samples, (enum joints_csv_axes)said) : find_out(samples, path);
}

void joint_axes_settle_exact(struct joint_samples *samples, struct vec3 custom)
{
    char words[60];
    if (!can_be_compared(samples))
        return;
    const struct up up = find_up(samples);
    const bool told = (double)up.upright >= MIN_UPRIGHT * (double)samples->count && up.share >= UPRIGHT_SHARE;
    const struct vec3 axis = told ? nearest_axis(up.axis) : custom;
    const int hand = find_handedness(samples, true);
    if (v3_dot(axis, custom) < 0.5)
        joint_note(&samples->notes, "by the person's head and feet its axes are %s", axis_words(axis, words));
    if (hand < 0)
        joint_note(&samples->notes, "%s", backwards);
    const struct turn turn = turn_for(axis, hand < 0);
    apply_turn(samples, &turn);
}

// ---------------------------------------------------------------- samples

// The rows of each time as a sample.
static enum status make_samples(const struct joint_rows *rows, const struct joint_units *units,
                                struct joint_samples *out)
{
    enum status status = OK;
    for (int64_t i = 0, end; i < rows->count && status == OK; i = end) {
        end = joint_rows_group(rows, i);
        const double time_s = rows->at[i].time * units->seconds;
        if (!(fabs(time_s) < SECONDS_MAX)) {
            out->dropped += end - i;
            continue;
        }
        struct joint_sample sample = {.time_ns = (int64_t)(time_s * 1e9 + (time_s < 0 ? -0.5 : 0.5))};
        for (int64_t k = i; k < end; k++) {
            const struct joint_row *row = &rows->at[k];
            sample.skeleton.joint[row->joint] = v3_scale(row->place, units->metres);
            sample.skeleton.confidence[row->joint] = row->confidence;
            sample.sigma_m[row->joint] =
                row->sigma < 0 ? default_sigma_m(row->confidence) : (float)fmin(row->sigma * units->metres, 10);
        }
        status = joint_samples_add(out, &sample);
    }
    return status;
}

enum status joint_rows_samples(struct joint_rows *rows, const char *path, struct joint_samples *out)
{
    struct joint_units units;
    enum status status = joint_rows_sort(rows, &out->notes);
    if (status == OK)
        joint_rows_drop_zeros(rows, &out->notes);
    if (status == OK && !rows->count)
        status = fail(ERR_INPUT, "%s holds no joint that is known at any time", path);
    if (status == OK)
        status = joint_rows_units(rows, path, &units, &out->notes);
    if (status == OK)
        status = make_samples(rows, &units, out);
    if (status == OK && !out->count)
        status = fail(ERR_INPUT, "%s holds no joint that is known at any time", path);
    return status;
}
