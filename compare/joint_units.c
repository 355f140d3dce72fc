// The units of a joints-csv file, by the size of the body and by the steps of the times.
#include "compare/joint_rows.h"

#include "base/portable_math.h"

#include <stdlib.h>

// A grown person's bones, m, and height: by hand, of the man and the woman in tests/world. What is measured is only
// which power of ten, or inches, and people are 0.5 to 2.6 m tall.
static const double HEIGHT_M = 1.7, LEAST_HEIGHT_M = 0.5, MOST_HEIGHT_M = 2.6;
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

static struct body_at body_of(const struct joint_rows *r, int64_t first, int64_t end)
{
    struct body_at b = {0};
    for (int64_t i = first; i < end; i++) {
        b.place[r->at[i].joint] = r->at[i].place;
        b.known[r->at[i].joint] = true;
    }
    return b;
}

// As high as a grown person with bones of these lengths; 0: no bone is known.
static double height_of(const struct body_at *b)
{
    double length = 0, usual = 0;
    for (size_t k = 0; k < COUNT_OF(bones); k++)
        if (b->known[bones[k].from] && b->known[bones[k].to]) {
            length += v3_distance(b->place[bones[k].from], b->place[bones[k].to]);
            usual += bones[k].length_m;
        }
    return usual > 0 ? HEIGHT_M * length / usual : 0;
}

// The longest way of a joint between two instants.
static double way_of(const struct body_at *a, const struct body_at *b)
{
    double most = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        if (a->known[j] && b->known[j])
            most = fmax(most, v3_distance(a->place[j], b->place[j]));
    return most;
}

// Medians over the instants, in the file's units; 0: not known.
struct medians {
    double height, step, way;
    bool whole; // all times are whole numbers
    int64_t times;
};

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int64_t count)
{
    if (!count)
        return 0;
    qsort(values, (size_t)count, sizeof *values, ascending);
    return values[count / 2];
}

static enum status measure(const struct joint_rows *r, struct medians *out)
{
    *out = (struct medians){.whole = true};
    for (int64_t i = 0; i < r->count; i = joint_rows_group(r, i)) {
        out->whole = out->whole && !(fabs(r->at[i].time - floor(r->at[i].time)) > 0);
        out->times++;
    }
    double *height = malloc(3 * ((size_t)out->times + 1) * sizeof *height);
    if (!height)
        return fail(ERR_MEMORY, "no memory to judge a movement's units");
    double *step = height + out->times + 1, *way = step + out->times + 1;
    int64_t heights = 0, steps = 0;
    struct body_at before = {0};
    for (int64_t i = 0, end; i < r->count; i = end) {
        end = joint_rows_group(r, i);
        const struct body_at b = body_of(r, i, end);
        const double h = height_of(&b);
        if (h > 0)
            height[heights++] = h;
        if (i && r->at[i].time > r->at[i - 1].time) {
            step[steps] = r->at[i].time - r->at[i - 1].time;
            way[steps++] = way_of(&before, &b);
        }
        before = b;
    }
    out->height = median(height, heights);
    out->step = median(step, steps);
    out->way = median(way, steps);
    free(height);
    return OK;
}

static double metres_of(double height, struct joint_notes *notes)
{
    static const struct {
        const char *name;
        double metres;
    } units[] = {{"millimetres", 0.001}, {"centimetres", 0.01}, {"inches", 0.0254}, {"feet", 0.3048}};
    if (!(height > 0) || (height >= LEAST_HEIGHT_M && height <= MOST_HEIGHT_M))
        return 1;
    int best = -1;
    double least = INFINITY;
    for (int k = 0; k < (int)COUNT_OF(units); k++) {
        const double m = height * units[k].metres, off = fabs(portable_log(m / HEIGHT_M));
        if (m >= LEAST_HEIGHT_M && m <= MOST_HEIGHT_M && off < least) {
            least = off;
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
static const double MOST_STEP_S = 0.2501, LEAST_STEP_S = 0.002, MOST_SPEED = 12;
enum { FEW_TIMES = 3 };

static enum status seconds_of(const struct medians *m, const char *path, struct joint_units *out,
                              struct joint_notes *notes)
{
    static const struct {
        const char *name;
        double seconds;
    } units[] = {{"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"nanoseconds", 1e-9}};
    out->seconds = 1;
    if (m->times < FEW_TIMES || (m->step <= MOST_STEP_S && m->step >= LEAST_STEP_S * 0.05))
        return OK;
    if (m->step < MOST_STEP_S)
        return fail(ERR_INPUT, "%s: its times are %.2g apart: they are no seconds; write seconds into the first column",
                    path, m->step);
    for (size_t k = 0; k < COUNT_OF(units); k++) {
        const double step_s = m->step * units[k].seconds;
        if (step_s < LEAST_STEP_S || step_s > MOST_STEP_S || m->way * out->metres > MOST_SPEED * step_s)
            continue;
        joint_note(notes, "its times are %.4g apart: they were read as %s", m->step, units[k].name);
        out->seconds = units[k].seconds;
        return OK;
    }
    if (m->whole)
        return fail(ERR_INPUT,
                    "%s: its times are whole numbers, %.0f apart: if they number the frames, divide them by the frame "
                    "rate; if they are seconds, there are too few frames: at least 4 a second are needed",
                    path, m->step);
    return fail(ERR_INPUT, "%s has a frame every %.2g s only; at least 4 a second are needed, with times in seconds",
                path, m->step);
}

enum status joint_rows_units(const struct joint_rows *r, const char *path, struct joint_units *out,
                             struct joint_notes *notes)
{
    struct medians m;
    *out = (struct joint_units){1, 1};
    enum status status = measure(r, &m);
    if (status != OK)
        return status;
    out->metres = metres_of(m.height, notes);
    return seconds_of(&m, path, out, notes);
}
