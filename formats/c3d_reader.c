// Reads C3D: a header and parameters in blocks of 512 bytes, then the points of each frame, after them its analog
// samples, which are left out.
#include "base/text.h"
#include "formats/motion_file.h"
#include "recording/little_endian.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { BLOCK = 512, INTEL = 84, DEC = 85, MIPS = 86, GROUPS_MAX = 128 };

struct c3d_bytes {
    const char *name;
    const uint8_t *at;
    size_t count;
    size_t parameters_at, parameters_end;
    bool dec; // floating-point numbers of a VAX
};

static int word_at(const struct c3d_bytes *file, size_t at)
{
    return at + 2 <= file->count ? file->at[at] | file->at[at + 1] << 8 : 0;
}

// DEC's have the two halves exchanged, and a fourth of the value.
static double float_at(const struct c3d_bytes *file, size_t at)
{
    if (at + 4 > file->count)
        return 0;
    const uint8_t *b = file->at + at, dec[4] = {b[2], b[3], b[0], b[1]}, *from = file->dec ? dec : b;
    const float value = get_f32(&from);
    return file->dec ? (double)value / 4 : (double)value;
}

// ---------------------------------------------------------------- parameters

// One parameter's data: so many bytes each (-1: characters), and their number in each dimension.
struct parameter {
    size_t at;
    int type;
    int dimensions, size[7];
};

// The number of the group of that name; 0: there is none.
static int find_group(const struct c3d_bytes *file, const char *name);

// Goes on from the record at `at`; 0: it was the last one.
static size_t next_record(const struct c3d_bytes *file, size_t at)
{
    const size_t length = (size_t)abs((int8_t)file->at[at]), offset_at = at + 2 + length;
    const int step = offset_at + 2 <= file->parameters_end ? word_at(file, offset_at) : 0;
    const size_t next = offset_at + (size_t)step;
    return step && next + 4 < file->parameters_end && file->at[next] ? next : 0;
}

static bool has_name(const struct c3d_bytes *file, size_t at, const char *name)
{
    const size_t length = (size_t)abs((int8_t)file->at[at]);
    return length == strlen(name) && at + 2 + length <= file->parameters_end &&
           !strncasecmp((const char *)file->at + at + 2, name, length);
}

static int find_group(const struct c3d_bytes *file, const char *name)
{
    for (size_t at = file->parameters_at; at; at = next_record(file, at))
        if ((int8_t)file->at[at + 1] < 0 && has_name(file, at, name))
            return -(int8_t)file->at[at + 1];
    return 0;
}

static bool find_parameter(const struct c3d_bytes *file, const char *group, const char *name, struct parameter *out)
{
    const int wanted = find_group(file, group);
    for (size_t at = file->parameters_at; at && wanted; at = next_record(file, at)) {
        if ((int8_t)file->at[at + 1] != wanted || !has_name(file, at, name))
            continue;
        size_t data = at + 2 + strlen(name) + 2;
        if (data + 2 > file->parameters_end || file->at[data + 1] > 7)
            return false;
        *out = (struct parameter){.type = (int8_t)file->at[data], .dimensions = file->at[data + 1]};
        if (data + 2 + (size_t)out->dimensions > file->parameters_end)
            return false;
        size_t bytes = (size_t)abs(out->type);
        for (int k = 0; k < out->dimensions; k++) {
            out->size[k] = file->at[data + 2 + (size_t)k];
            bytes *= (size_t)out->size[k];
        }
        out->at = data + 2 + (size_t)out->dimensions;
        return bytes && out->at + bytes <= file->count;
    }
    return false;
}

// NaN: there is none.
static double number_of(const struct c3d_bytes *file, const char *group, const char *name)
{
    struct parameter p;
    if (!find_parameter(file, group, name, &p))
        return NAN;
    if (p.type == 4)
        return float_at(file, p.at);
    if (p.type == 2 && p.dimensions == 1 && p.size[0] == 2) // two words, low first
        return word_at(file, p.at) + 65536.0 * word_at(file, p.at + 2);
    return p.type == 2 ? word_at(file, p.at) : NAN;
}

static void text_of(const struct c3d_bytes *file, const struct parameter *p, int index, char out[POINT_NAME_BYTES])
{
    const int length = p->dimensions ? p->size[0] : 1;
    const char *at = (const char *)file->at + p->at + (size_t)index * (size_t)length;
    int used = length;
    while (used > 0 && (at[used - 1] == ' ' || !at[used - 1]))
        used--;
    snprintf(out, POINT_NAME_BYTES, "%.*s", used, at);
    text_make_printable(out);
}

// LABELS hold 255 names; more go on in LABELS2 and so on.
static void read_names(const struct c3d_bytes *file, struct motion_points *out)
{
    int count = 0;
    for (int part = 1; part < 10 && count < out->points; part++) {
        char label[16];
        struct parameter p;
        snprintf(label, sizeof label, part > 1 ? "LABELS%d" : "LABELS", part);
        if (!find_parameter(file, "POINT", label, &p) || p.type != -1)
            break;
        const int here = p.dimensions > 1 ? p.size[1] : 1;
        for (int k = 0; k < here && count < out->points; k++)
            text_of(file, &p, k, out->names[count++]);
    }
}

static void read_words(const struct c3d_bytes *file, struct motion_points *out)
{
    struct parameter p;
    char text[POINT_NAME_BYTES];
    if (find_parameter(file, "POINT", "UNITS", &p) && p.type == -1) {
        text_of(file, &p, 0, text);
        out->metres = !strcasecmp(text, "mm") ? 0.001 : !strcasecmp(text, "cm") ? 0.01 : !strcasecmp(text, "m") ? 1 : 0;
    }
    if (find_parameter(file, "POINT", "Y_SCREEN", &p) && p.type == -1) {
        text_of(file, &p, 0, text);
        const size_t sign = text[0] == '+' || text[0] == '-';
        if (text[sign] == 'Y' || text[sign] == 'Z')
            out->up = text[sign] == 'Y' ? UP_Y : UP_Z;
    }
}

// ---------------------------------------------------------------- points

struct c3d_layout {
    int points, analog; // analog: samples of a frame, all channels
    size_t data_at, number_bytes, frame_bytes;
    double scale, rate_hz; // scale: of integers
    int64_t frames;        // as the file says
};

static int64_t frames_of(const struct c3d_bytes *file)
{
    const double first = number_of(file, "TRIAL", "ACTUAL_START_FIELD"),
                 last = number_of(file, "TRIAL", "ACTUAL_END_FIELD");
    if (last >= first && first >= 0)
        return (int64_t)(last - first) + 1;
    return (int64_t)word_at(file, 8) - word_at(file, 6) + 1;
}

static enum status read_layout(const struct c3d_bytes *file, struct c3d_layout *out)
{
    out->points = word_at(file, 2);
    out->analog = word_at(file, 4);
    out->scale = float_at(file, 12);
    out->rate_hz = float_at(file, 20);
    out->data_at = BLOCK * (size_t)(word_at(file, 16) ? word_at(file, 16) - 1 : 0);
    out->number_bytes = out->scale < 0 ? 4 : 2;
    out->frame_bytes = out->number_bytes * (4 * (size_t)out->points + (size_t)out->analog);
    out->frames = frames_of(file);
    if (!out->points)
        return fail(ERR_INPUT, "%s is an empty C3D file: it has no points", file->name);
    if (!(out->rate_hz > 0.01) || !(out->rate_hz < 1e5))
        return fail(ERR_INPUT, "%s says no rate (%g frames a second), so its frames have no times", file->name,
                    out->rate_hz);
    if (!out->data_at || out->data_at >= file->count)
        return fail(ERR_INPUT, "%s ends before its points; get a whole file", file->name);
    return OK;
}

static void read_frame(const struct c3d_bytes *file, const struct c3d_layout *layout, int64_t frame,
                       struct motion_points *out)
{
    size_t at = layout->data_at + (size_t)frame * layout->frame_bytes;
    float *to = out->at + 3 * (size_t)frame * (size_t)out->points;
    for (int p = 0; p < out->points; p++, to += 3, at += 4 * layout->number_bytes) {
        const bool integers = layout->number_bytes == 2;
        const double residual = integers ? (int16_t)word_at(file, at + 6) : float_at(file, at + 12);
        for (int k = 0; k < 3; k++) {
            const double value = integers ? layout->scale * (int16_t)word_at(file, at + 2 * (size_t)k)
                                          : float_at(file, at + 4 * (size_t)k);
            to[k] = residual < 0 || !isfinite(value) || fabs(value) > 1e9 ? NAN : (float)value;
        }
    }
    out->time_s[frame] = (double)frame / layout->rate_hz;
}

enum status c3d_points_read(const char *name, const uint8_t *bytes, size_t count, struct motion_points *out)
{
    struct c3d_bytes file = {.name = name, .at = bytes, .count = count};
    struct c3d_layout layout;
    out->format = "C3D";
    file.parameters_at = count ? BLOCK * ((size_t)bytes[0] - 1) : 0;
    if (count < 2 * BLOCK || bytes[0] < 2 || file.parameters_at + BLOCK > count)
        return fail(ERR_INPUT, "%s ends in its header; get a whole file", name);
    const int processor = bytes[file.parameters_at + 3];
    if (processor != INTEL && processor != DEC)
        return fail(ERR_INPUT, "%s has numbers of a %s machine, which are not read; convert it to Intel's order", name,
                    processor == MIPS ? "MIPS" : "foreign");
    file.dec = processor == DEC;
    const size_t blocks = bytes[file.parameters_at + 2];
    file.parameters_end = file.parameters_at + BLOCK * (blocks ? blocks : 1);
    file.parameters_end = file.parameters_end < count ? file.parameters_end : count;
    file.parameters_at += 4;
    enum status status = read_layout(&file, &layout);
    if (status != OK)
        return status;
    const int64_t whole = layout.frame_bytes ? (int64_t)((count - layout.data_at) / layout.frame_bytes) : 0;
    if (layout.frames > whole && whole > 0 && layout.frames > 65535)
        layout.frames = whole; // a long file's header cannot say how many there are
    if (layout.frames > whole)
        return fail(ERR_INPUT, "%s ends in the middle: %lld of %lld frames are there; get a whole one", name,
                    (long long)whole, (long long)layout.frames);
    status = motion_points_make_room(out, name, layout.points, layout.frames);
    if (status != OK)
        return status;
    read_names(&file, out);
    read_words(&file, out);
    for (int64_t i = 0; i < layout.frames; i++)
        read_frame(&file, &layout, i, out);
    return OK;
}
