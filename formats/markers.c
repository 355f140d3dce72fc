#include "formats/markers.h"

#include "base/text.h"
#include "recording/little_endian.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void markers_free(struct markers *markers)
{
    free(markers->at);
    *markers = (struct markers){0};
}

// ---------------------------------------------------------------- constant rate

enum { DEFAULT_STEP_NS = 33333333 }; // where there is but one sample, or no clock that goes ahead

static int compare_times(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

// The median step, ns; 0: no memory.
static int64_t usual_step_ns(const struct marker_sample *samples, int64_t count)
{
    if (count < 2)
        return DEFAULT_STEP_NS;
    int64_t *steps = malloc(sizeof *steps * (size_t)(count - 1)), median = 0;
    if (!steps)
        return 0;
    int64_t ahead = 0;
    for (int64_t i = 0; i + 1 < count; i++)
        if (samples[i + 1].time_ns > samples[i].time_ns)
            steps[ahead++] = samples[i + 1].time_ns - samples[i].time_ns;
    qsort(steps, (size_t)ahead, sizeof *steps, compare_times);
    median = ahead ? steps[ahead / 2] : DEFAULT_STEP_NS;
    free(steps);
    return median;
}

// The times from the first sample on, without the clock's jumps. NULL: no memory.
static int64_t *continuous_times(const struct marker_sample *samples, int64_t count, int64_t step_ns)
{
    const int64_t jump_ns = INT64_C(60000000000);
    int64_t *times = malloc(sizeof *times * (size_t)count);
    for (int64_t i = 0; times && i < count; i++) {
        const int64_t gone = i ? samples[i].time_ns - samples[i - 1].time_ns : 0;
        times[i] = i ? times[i - 1] + (gone > jump_ns || gone <= 0 ? step_ns : gone) : 0;
    }
    return times;
}

// The mean step, of a gap as many as it is long. A whole rate where it is within a percent of it.
static double rate_of(const int64_t *times, int64_t count, int64_t step_ns)
{
    double steps = 0;
    for (int64_t i = 0; i + 1 < count; i++)
        steps += fmax(1, floor((double)(times[i + 1] - times[i]) / (double)step_ns + 0.5));
    const double mean_ns = steps > 0 ? (double)times[count - 1] / steps : (double)step_ns,
                 rate = 1e9 / fmax(1, mean_ns), whole = floor(rate + 0.5);
    return whole >= 1 && fabs(rate - whole) < 0.01 * whole ? whole : rate;
}

static void interpolate(const struct skeleton *before, const struct skeleton *after, double share,
                        float out[JOINT_COUNT][3])
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        const bool known = before->confidence[j] > 0 && after->confidence[j] > 0 && v3_finite(before->joint[j]) &&
                           v3_finite(after->joint[j]);
        const struct vec3 p = v3_mix(before->joint[j], after->joint[j], share);
        out[j][0] = known ? (float)p.x : NAN;
        out[j][1] = known ? (float)p.y : NAN;
        out[j][2] = known ? (float)p.z : NAN;
    }
}

static void fill(struct markers *out, const struct marker_sample *samples, const int64_t *times, int64_t count)
{
    static const struct skeleton none;
    int64_t before = 0;
    for (int64_t i = 0; i < out->count; i++) {
        const double at_ns = 1e9 * (double)i / out->rate_hz;
        while (before + 1 < count && (double)times[before + 1] <= at_ns)
            before++;
        const int64_t after = before + 1 < count ? before + 1 : before;
        const double gap_ns = (double)(times[after] - times[before]),
                     share = gap_ns > 0 ? fmin(1, (at_ns - (double)times[before]) / gap_ns) : 0;
        const bool near = gap_ns <= 1e9 * MARKERS_GAP_S || share <= 0;
        interpolate(near ? &samples[before].skeleton : &none, &samples[share > 0 ? after : before].skeleton, share,
                    out->at[i]);
    }
}

enum status markers_make(struct markers *out, const struct marker_sample *samples, int64_t count)
{
    *out = (struct markers){0};
    if (count < 1)
        return fail(ERR_INPUT, "no person was tracked, so there is nothing to write");
    const int64_t step_ns = usual_step_ns(samples, count);
    int64_t *times = step_ns ? continuous_times(samples, count, step_ns) : NULL;
    if (!times)
        return fail(ERR_MEMORY, "no memory for the joints at a constant rate");
    out->rate_hz = rate_of(times, count, step_ns);
    const double frames = floor(1e-9 * (double)times[count - 1] * out->rate_hz + 0.01) + 1;
    enum status status = OK;
    if (!(frames <= MARKERS_MAX))
        status = fail(ERR_INPUT, "the take is too long: %.0f frames at %.0f Hz", frames, out->rate_hz);
    out->count = (int64_t)fmin(frames, MARKERS_MAX);
    out->at = status == OK ? malloc((size_t)out->count * sizeof *out->at) : NULL;
    if (status == OK && !out->at)
        status = fail(ERR_MEMORY, "no memory for the joints at a constant rate");
    if (status == OK)
        fill(out, samples, times, count);
    else
        markers_free(out);
    free(times);
    return status;
}

// ---------------------------------------------------------------- TRC

void trc_print(const struct markers *markers, const char *name, FILE *out)
{
    const long long frames = markers->count;
    const char *slash = strrchr(name, '/');
    char shown[TEXT_SHOWN_BYTES]; // a tab or a line's end would be the format's
    fprintf(out, "PathFileType\t4\t(X/Y/Z)\t%s\n", text_shown(slash ? slash + 1 : name, shown));
    fputs("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n", out);
    fprintf(out, "%.3f\t%.3f\t%lld\t%d\tm\t%.3f\t1\t%lld\n", markers->rate_hz, markers->rate_hz, frames, JOINT_COUNT,
            markers->rate_hz, frames);
    fputs("Frame#\tTime", out);
    for (int j = 0; j < JOINT_COUNT; j++)
        fprintf(out, "\t%s\t\t", joint_name((enum joint)j));
    fputs("\n\t", out);
    for (int j = 1; j <= JOINT_COUNT; j++)
        fprintf(out, "\tX%d\tY%d\tZ%d", j, j, j);
    fputs("\n\n", out);
    for (int64_t i = 0; i < markers->count; i++) {
        fprintf(out, "%lld\t%.6f", (long long)i + 1, (double)i / markers->rate_hz);
        for (int j = 0; j < JOINT_COUNT; j++)
            for (int k = 0; k < 3; k++)
                if (isnan(markers->at[i][j][k]))
                    fputc('\t', out);
                else
                    fprintf(out, "\t%.5f", (double)markers->at[i][j][k]);
        fputc('\n', out);
    }
}

// ---------------------------------------------------------------- C3D

enum { BLOCK_BYTES = 512, PARAMETERS_BYTES = 8 * BLOCK_BYTES, LABEL_BYTES = 16, INTEL = 84, C3D_MARK = 0x50 };
static const int64_t FRAMES_IN_HEADER = 65535;

// Parameters as they stand one after the other; group: 1 and up.
struct parameters {
    uint8_t at[PARAMETERS_BYTES];
    size_t count;
};

static void add_byte(struct parameters *p, int value) { p->at[p->count++] = (uint8_t)value; }

static void add_word(struct parameters *p, int value)
{
    put_u16(p->at + p->count, (uint16_t)value);
    p->count += 2;
}

static void add_text(struct parameters *p, const char *text, size_t length)
{
    for (size_t i = 0; i < length; i++)
        add_byte(p, *text ? *text++ : ' ');
}

// The name of a group (group negative) or parameter, and how far the next is from here.
static void add_name(struct parameters *p, int group, const char *name, size_t rest)
{
    add_byte(p, (int)strlen(name));
    add_byte(p, group);
    add_text(p, name, strlen(name));
    add_word(p, (int)(rest + 2));
}

static void add_group(struct parameters *p, int group, const char *name)
{
    add_name(p, -group, name, 1);
    add_byte(p, 0); // no description
}

static void add_integer(struct parameters *p, int group, const char *name, int value)
{
    add_name(p, group, name, 5);
    add_byte(p, 2);
    add_byte(p, 0);
    add_word(p, value);
    add_byte(p, 0);
}

// Two words, low first: as readers of long files expect it.
static void add_long(struct parameters *p, int group, const char *name, int64_t value)
{
    add_name(p, group, name, 8);
    add_byte(p, 2);
    add_byte(p, 1);
    add_byte(p, 2);
    add_word(p, (int)(value & 0xffff));
    add_word(p, (int)(value >> 16));
    add_byte(p, 0);
}

static void add_float(struct parameters *p, int group, const char *name, double value)
{
    add_name(p, group, name, 7);
    add_byte(p, 4);
    add_byte(p, 0);
    put_f32(p->at + p->count, (float)value);
    p->count += 4;
    add_byte(p, 0);
}

static void add_line(struct parameters *p, int group, const char *name, const char *text)
{
    add_name(p, group, name, strlen(text) + 4);
    add_byte(p, -1);
    add_byte(p, 1);
    add_byte(p, (int)strlen(text));
    add_text(p, text, strlen(text));
    add_byte(p, 0);
}

static void add_labels(struct parameters *p, int group, const char *name)
{
    add_name(p, group, name, JOINT_COUNT * LABEL_BYTES + 5);
    add_byte(p, -1);
    add_byte(p, 2);
    add_byte(p, LABEL_BYTES);
    add_byte(p, JOINT_COUNT);
    for (int j = 0; j < JOINT_COUNT; j++)
        add_text(p, joint_name((enum joint)j), LABEL_BYTES);
    add_byte(p, 0);
}

static void make_parameters(const struct markers *markers, struct parameters *p)
{
    const int64_t in_header = markers->count < FRAMES_IN_HEADER ? markers->count : FRAMES_IN_HEADER;
    *p = (struct parameters){.count = 0};
    add_byte(p, 1);
    add_byte(p, C3D_MARK);
    add_byte(p, PARAMETERS_BYTES / BLOCK_BYTES);
    add_byte(p, INTEL);
    add_group(p, 1, "POINT");
    add_integer(p, 1, "USED", JOINT_COUNT);
    add_integer(p, 1, "FRAMES", (int)in_header);
    add_integer(p, 1, "DATA_START", 2 + PARAMETERS_BYTES / BLOCK_BYTES);
    add_float(p, 1, "SCALE", -1); // negative: the data are floating-point numbers
    add_float(p, 1, "RATE", markers->rate_hz);
    add_line(p, 1, "UNITS", "mm");
    add_line(p, 1, "X_SCREEN", "+X");
    add_line(p, 1, "Y_SCREEN", "+Y");
    add_labels(p, 1, "LABELS");
    add_labels(p, 1, "DESCRIPTIONS");
    add_group(p, 2, "ANALOG");
    add_integer(p, 2, "USED", 0);
    add_float(p, 2, "GEN_SCALE", 1);
    add_float(p, 2, "RATE", markers->rate_hz);
    add_group(p, 3, "FORCE_PLATFORM");
    add_integer(p, 3, "USED", 0);
    add_group(p, 4, "TRIAL");
    add_long(p, 4, "ACTUAL_START_FIELD", 1);
    add_long(p, 4, "ACTUAL_END_FIELD", markers->count);
}

static void print_header(const struct markers *markers, FILE *out)
{
    uint8_t header[BLOCK_BYTES] = {2, C3D_MARK}; // the parameters are in the second block
    const int64_t in_header = markers->count < FRAMES_IN_HEADER ? markers->count : FRAMES_IN_HEADER;
    put_u16(header + 2, JOINT_COUNT);
    put_u16(header + 6, 1); // the first frame, and the last
    put_u16(header + 8, (uint16_t)in_header);
    put_u16(header + 10, (uint16_t)(markers->rate_hz * MARKERS_GAP_S));
    put_f32(header + 12, -1);
    put_u16(header + 16, 2 + PARAMETERS_BYTES / BLOCK_BYTES);
    put_f32(header + 20, (float)markers->rate_hz);
    fwrite(header, 1, sizeof header, out);
}

void c3d_print(const struct markers *markers, FILE *out)
{
    struct parameters parameters;
    print_header(markers, out);
    make_parameters(markers, &parameters);
    fwrite(parameters.at, 1, sizeof parameters.at, out);
    for (int64_t i = 0; i < markers->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const float *at = markers->at[i][j];
            const bool known = !isnan(at[0]);
            uint8_t point[16];
            for (int k = 0; k < 3; k++)
                put_f32(point + 4 * k, known ? 1000 * at[k] : 0);
            put_f32(point + 12, known ? 0 : -1);
            fwrite(point, 1, sizeof point, out);
        }
}
