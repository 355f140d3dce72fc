// A folder of images in the TUM RGB-D layout, as a sensor or a camera.
//
//   rgb.txt, depth.txt   a line for each image: seconds, blank, path below the
//                        folder; lines that begin with # are comments
//   calibration.json     see calibration.c
//
// Colour is JPEG or PNG with 8 bits, depth PNG with 16. Depth in a unit other
// than millimetres is converted and rounded to the nearest; what 16 bits of
// millimetres cannot hold becomes 0 (no depth), and so does 65535, with which
// some programs mark a pixel without a reading.
//
// A camera's frames are those of rgb.txt. A sensor's frames are those of
// depth.txt; each gets the colour image nearest in time, if that is at most
// half a frame away (half the median step of depth.txt) and no other depth
// image is nearer to it. A frame's time and name are those of that list. Where
// none has colour because the two lists' clocks differ, the folder is refused.
//
// Paths lie below the folder: one that climbs out of it with ".." is refused. Links
// are followed. Names are UTF-8 without control characters.
//
// Times must rise. An image that is not later than the one before it is skipped
// and counted as dropped; a list whose times jump back by more than a second is
// refused, because the order of its frames is unknown.
#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/image_file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "platform/files/text_file.h"
#include "platform/sensors/source_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { PATH_BYTES = 4096 };

struct image_entry {
    int64_t time_ns;
    const char *path; // inside the list's text
    int line;
};

struct image_list {
    const char *name;      // "rgb.txt"
    struct text_file file; // all 0: there is no such list
    struct image_entry *entries;
    int64_t count;
    int64_t skipped; // images whose time did not rise
};

struct folder {
    char *dir;
    struct image_list color, depth;
    const struct image_list *lead; // the list that defines the frames
    int64_t *color_of;             // for each depth image the index of its colour image, -1: none; NULL for a camera
    bool numbered;                 // a name is too long for frame.name, or used twice: frames are numbered instead
    uint16_t *to_mm;               // 65536 values: millimetres by the depth image's units
    uint8_t *rgb;                  // the last frame's colour
    uint16_t *mm;                  // and depth
    uint8_t *jpeg;                 // and its JPEG, or NULL
    int64_t at;                    // the next frame
    struct source_facts *facts;
};

// ------------------------------------------------------------- the lists

// Reads decimal seconds at *text, without floating point; digits
// beyond the nanosecond round to the nearest. False: no such number there, or
// beyond SECONDS_MAX, so that any two times' difference is one of int64_t nanoseconds.
static bool read_seconds(const char **text, int64_t *time_ns)
{
    const char *at = *text;
    bool negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    int64_t ns = 0;
    int digits = 0, decimals = 0;
    for (; *at >= '0' && *at <= '9'; at++, digits++)
        if ((ns = ns * 10 + (*at - '0')) > SECONDS_MAX)
            return false;
    if (*at == '.') {
        for (at++; *at >= '0' && *at <= '9'; at++, digits++) {
            if (decimals < 9)
                ns = ns * 10 + (*at - '0');
            else if (decimals == 9)
                ns += *at >= '5';
            decimals++;
        }
    }
    for (; decimals < 9; decimals++)
        ns *= 10;
    if (!digits || (*at != ' ' && *at != '\t'))
        return false;
    *time_ns = negative ? -ns : ns;
    *text = at;
    return true;
}

// Unix times of this century have 10 digits in seconds: more are of a smaller unit. NULL: they are not.
static const char *smaller_unit(size_t digits)
{
    if (digits >= 18)
        return "nanoseconds: divide them by 1000000000";
    if (digits >= 15)
        return "microseconds: divide them by 1000000";
    return digits >= 12 ? "milliseconds: divide them by 1000" : NULL;
}

static enum status refuse_time(const struct image_list *list, const char *dir, const char *line, int number)
{
    const char *unit = smaller_unit(strspn(line, "0123456789"));
    if (unit)
        return fail(ERR_INPUT, "%s/%s, line %d: the times are to be in seconds, and '%.40s' looks like %s", dir,
                    list->name, number, line, unit);
    return fail(ERR_INPUT, "%s/%s, line %d: '%.40s' does not begin with a time in seconds and a file", dir, list->name,
                number, line);
}

// Adds the image of one line to the list.
static enum status add_line(struct image_list *list, const char *dir, const char *line, int number)
{
    int64_t time_ns;
    const char *path = line;
    if (!read_seconds(&path, &time_ns))
        return refuse_time(list, dir, line, number);
    path += strspn(path, " \t");
    enum status status = file_check_listed(dir, list->name, number, path);
    if (status != OK)
        return status;
    if (list->count) {
        const struct image_entry *last = &list->entries[list->count - 1];
        if (time_ns < last->time_ns - 1000000000)
            return fail(ERR_INPUT, "%s/%s, line %d: the clock jumps back by %.3f s; split the folder there", dir,
                        list->name, number, 1e-9 * (double)(last->time_ns - time_ns));
        if (time_ns <= last->time_ns) {
            list->skipped++;
            return OK;
        }
    }
    list->entries[list->count++] = (struct image_entry){time_ns, path, number};
    return OK;
}

// ERR_MISSING when there is no such list; ERR_INPUT names file and line.
static enum status read_list(struct image_list *list, const char *dir, const char *name)
{
    char path[PATH_BYTES];
    list->name = name;
    snprintf(path, sizeof path, "%s/%s", dir, name);
    enum status status = text_file_open(&list->file, path);
    if (status != OK)
        return status;
    const size_t lines = text_file_lines_left(&list->file);
    list->entries = malloc(lines * sizeof *list->entries);
    if (!list->entries)
        return fail(ERR_MEMORY, "no memory for the %zu lines of %s", lines, path);
    for (const char *line; (line = text_file_line(&list->file));)
        if ((status = add_line(list, dir, line, list->file.line)) != OK)
            return status;
    return list->count ? OK : fail(ERR_INPUT, "%s lists no picture", path);
}

// ------------------------------------------------------------- the pairs

static int compare_times(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

// The median time between two images; 0 for a list of one.
static enum status median_step(const struct image_list *list, int64_t *step_ns)
{
    int64_t count = list->count - 1;
    *step_ns = 0;
    if (count < 1)
        return OK;
    int64_t *steps = malloc((size_t)count * sizeof *steps);
    if (!steps)
        return fail(ERR_MEMORY, "no memory to pair the pictures of %s", list->name);
    for (int64_t i = 0; i < count; i++)
        steps[i] = list->entries[i + 1].time_ns - list->entries[i].time_ns;
    qsort(steps, (size_t)count, sizeof *steps, compare_times);
    *step_ns = steps[count / 2];
    free(steps);
    return OK;
}

// The index of the entry nearest to `time_ns` (the earlier of two equally near),
// searching from `from` on; `time_ns` must rise from call to call.
static int64_t nearest_entry(const struct image_list *list, int64_t from, int64_t time_ns)
{
    while (from + 1 < list->count &&
           llabs(list->entries[from + 1].time_ns - time_ns) < llabs(list->entries[from].time_ns - time_ns))
        from++;
    return from;
}

// Refuses lists of different clocks where no colour image meets a depth image. Where some meet by chance, they are
// paired, and source_clocks() says it.
static enum status check_clocks(struct folder *folder)
{
    char text[STREAM_CLOCKS_TEXT_BYTES];
    struct source_facts *facts = folder->facts;
    for (int64_t i = 0; i < folder->color.count; i++)
        stream_times_add(&facts->color_times, folder->color.entries[i].time_ns);
    for (int64_t i = 0; i < folder->depth.count; i++)
        stream_times_add(&facts->depth_times, folder->depth.entries[i].time_ns);
    facts->listed = true;
    const struct clock_finding found = stream_clocks_judge(&facts->color_times, &facts->depth_times, facts->pairs);
    if (facts->pairs || found.fault == CLOCKS_AGREE)
        return OK;
    return fail(ERR_INPUT, "%s: %s", folder->dir, stream_clocks_text(&found, true, text));
}

// Two images are a pair when each is the other's nearest and they are at most
// half a frame apart; so no colour image is used twice.
static enum status pair_images(struct folder *folder)
{
    int64_t step_ns;
    enum status status = median_step(&folder->depth, &step_ns);
    if (status != OK)
        return status;
    if (!step_ns && (status = median_step(&folder->color, &step_ns)) != OK)
        return status;
    folder->color_of = malloc((size_t)folder->depth.count * sizeof *folder->color_of);
    if (!folder->color_of)
        return fail(ERR_MEMORY, "no memory to pair the pictures of %s", folder->dir);
    int64_t color = 0, back = 0;
    for (int64_t i = 0; i < folder->depth.count; i++) {
        folder->color_of[i] = -1;
        if (!folder->color.count)
            continue;
        color = nearest_entry(&folder->color, color, folder->depth.entries[i].time_ns);
        back = nearest_entry(&folder->depth, back, folder->color.entries[color].time_ns);
        int64_t apart_ns = llabs(folder->color.entries[color].time_ns - folder->depth.entries[i].time_ns);
        if (back == i && apart_ns <= step_ns / 2) {
            folder->color_of[i] = color;
            folder->facts->pairs++;
        }
    }
    return check_clocks(folder);
}

// ------------------------------------------------------------- the images

static enum status read_bytes(const struct folder *folder, const struct image_list *list,
                              const struct image_entry *entry, char path[PATH_BYTES], uint8_t **bytes, size_t *count)
{
    if (snprintf(path, PATH_BYTES, "%s/%s", folder->dir, entry->path) >= PATH_BYTES)
        return fail(ERR_INPUT, "%s/%s, line %d: the path is too long", folder->dir, list->name, entry->line);
    enum status status = file_read(path, bytes, count);
    if (status == ERR_MISSING)
        return fail(ERR_INPUT, "%s, named in line %d of %s, is missing", path, entry->line, list->name);
    return status;
}

static bool is_jpeg(const uint8_t *bytes, size_t count) { return count >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8; }

static enum status check_size(const char *path, int width, int height, const struct lens *lens, const char *what)
{
    if (width == lens->width && height == lens->height)
        return OK;
    return fail(ERR_INPUT, "%s has %d x %d pixels, but calibration.json says %d x %d for '%s'", path, width, height,
                lens->width, lens->height, what);
}

// A damaged image is bad input: ERR_CORRUPT becomes ERR_INPUT, and the sentence names the file.
static enum status report_damaged_file(enum status status, const char *path)
{
    if (status != ERR_CORRUPT && status != ERR_INPUT)
        return status;
    const char *sentence = status_message();
    return strstr(sentence, path) ? fail(ERR_INPUT, "%s", sentence) : fail(ERR_INPUT, "%s: %s", path, sentence);
}

static bool is_png(const uint8_t *bytes, size_t count)
{
    static const uint8_t mark[4] = {0x89, 'P', 'N', 'G'};
    return count >= sizeof mark && !memcmp(bytes, mark, sizeof mark);
}

static enum status refuse_kind(bool color, const uint8_t *bytes, size_t count, const char *path)
{
    return image_refuse(bytes, count, path, color ? "PNG or JPEG" : "PNG");
}

// Colour as 8-bit RGB, depth as 16 bit.
static enum status read_png(const struct folder *folder, bool color, const char *path, const uint8_t *bytes,
                            size_t count, void **pixels)
{
    const struct calibration *c = &folder->facts->calibration;
    struct png_layout layout = {.kind = color ? PNG_RGB8 : PNG_GRAY16};
    int width, height;
    enum status status = is_png(bytes, count) ? report_damaged_file(png_size(bytes, count, path, &width, &height), path)
                                              : refuse_kind(color, bytes, count, path);
    if (status == OK) // before it is decoded, which may take a thousand times the file's bytes
        status = check_size(path, width, height, color ? &c->color : &c->depth, color ? "color" : "depth");
    return status == OK ? report_damaged_file(png_decode(bytes, count, path, &layout, pixels), path) : status;
}

static enum status read_color(struct folder *folder, const struct image_entry *entry, struct frame *out)
{
    const struct lens *lens = &folder->facts->calibration.color;
    char path[PATH_BYTES];
    uint8_t *bytes;
    size_t count;
    enum status status = read_bytes(folder, &folder->color, entry, path, &bytes, &count);
    if (status != OK)
        return status;
    if (is_jpeg(bytes, count)) {
        int width, height;
        status = report_damaged_file(jpeg_size(bytes, count, &width, &height), path);
        if (status == OK)
            status = check_size(path, width, height, lens, "color");
        if (status == OK)
            status = report_damaged_file(jpeg_decode(bytes, count, folder->rgb, width, height), path);
        if (status == OK) {
            out->jpeg = folder->jpeg = bytes;
            out->jpeg_bytes = count;
            out->color = folder->rgb;
            return OK;
        }
    } else {
        void *pixels;
        status = read_png(folder, true, path, bytes, count, &pixels);
        if (status == OK) {
            memcpy(folder->rgb, pixels, (size_t)lens->width * (size_t)lens->height * 3);
            free(pixels);
            out->color = folder->rgb;
        }
    }
    free(bytes);
    return status;
}

static enum status read_depth(struct folder *folder, const struct image_entry *entry, struct frame *out)
{
    const struct lens *lens = &folder->facts->calibration.depth;
    char path[PATH_BYTES];
    uint8_t *bytes;
    size_t count;
    enum status status = read_bytes(folder, &folder->depth, entry, path, &bytes, &count);
    if (status != OK)
        return status;
    void *pixels;
    status = read_png(folder, false, path, bytes, count, &pixels);
    free(bytes);
    if (status != OK)
        return status;
    size_t area = (size_t)lens->width * (size_t)lens->height;
    const uint16_t *units = pixels;
    for (size_t i = 0; i < area; i++)
        folder->mm[i] = folder->to_mm[units[i]];
    free(pixels);
    out->depth = folder->mm;
    return OK;
}

// Refuses a folder of the wrong image size, or of images of another kind, on opening, by its first image. Other
// faults of that image are reported when it is read.
static enum status check_first(struct folder *folder, const struct image_list *list, const struct lens *lens,
                               const char *what)
{
    char path[PATH_BYTES];
    uint8_t *bytes;
    size_t count;
    int width, height;
    if (!list->count || read_bytes(folder, list, list->entries, path, &bytes, &count) != OK)
        return OK;
    enum status status = OK;
    if (list == &folder->color && is_jpeg(bytes, count)) {
        status = jpeg_size(bytes, count, &width, &height);
        if (status == OK)
            status = check_size(path, width, height, lens, what);
        else
            status = status == ERR_INPUT ? report_damaged_file(status, path)
                                         : OK; // the former: of a kind that none of them can be
    } else if (file_kind_of(bytes, count, count) && !is_png(bytes, count)) {
        status = refuse_kind(list == &folder->color, bytes, count, path);
    } else if (png_size(bytes, count, path, &width, &height) == OK) {
        status = check_size(path, width, height, lens, what);
    }
    free(bytes);
    return status;
}

// ------------------------------------------------------------- names

// The file's name without folder and extension; its length in *length.
static const char *stem_of(const char *path, size_t *length)
{
    const char *slash = strrchr(path, '/');
    const char *stem = slash ? slash + 1 : path;
    const char *dot = strrchr(stem, '.');
    *length = dot && dot > stem ? (size_t)(dot - stem) : strlen(stem);
    return stem;
}

static int compare_stems(const void *a, const void *b)
{
    size_t one, other;
    const char *x = stem_of(*(const char *const *)a, &one), *y = stem_of(*(const char *const *)b, &other);
    const int order = memcmp(x, y, one < other ? one : other);
    return order ? order : (one > other) - (one < other);
}

// Whether the files' names can name the frames: short enough, and no two alike, which would write over one another.
static enum status check_names(const struct image_list *list, bool *usable)
{
    size_t length;
    *usable = true;
    const char **paths = malloc(((size_t)list->count + 1) * sizeof *paths);
    if (!paths)
        return fail(ERR_MEMORY, "no memory for the names in %s", list->name);
    for (int64_t i = 0; i < list->count; i++) {
        paths[i] = list->entries[i].path;
        stem_of(paths[i], &length);
        *usable = *usable && length > 0 && length < sizeof((struct frame *)NULL)->name;
    }
    qsort(paths, (size_t)list->count, sizeof *paths, compare_stems);
    for (int64_t i = 1; i < list->count; i++)
        *usable = *usable && compare_stems(&paths[i - 1], &paths[i]);
    free(paths);
    return OK;
}

// ------------------------------------------------------------- the source kind

static void folder_close(void *self)
{
    struct folder *f = self;
    if (!f)
        return;
    text_file_close(&f->color.file);
    free(f->color.entries);
    text_file_close(&f->depth.file);
    free(f->depth.entries);
    free(f->color_of);
    free(f->to_mm);
    free(f->rgb);
    free(f->mm);
    free(f->jpeg);
    free(f->dir);
    free(f);
}

static enum status read_lists(struct folder *folder, enum source_wanted wanted)
{
    enum status status = read_list(&folder->color, folder->dir, "rgb.txt");
    bool has_color = status == OK;
    if (status == ERR_MISSING && wanted == SOURCE_CAMERA)
        return fail(ERR_MISSING, "%s/rgb.txt is missing: no list of colour pictures, no camera", folder->dir);
    if (status != OK && status != ERR_MISSING)
        return status;
    folder->lead = &folder->color;
    if (wanted == SOURCE_CAMERA)
        return OK;
    folder->lead = &folder->depth;
    status = read_list(&folder->depth, folder->dir, "depth.txt");
    if (status == ERR_MISSING)
        return has_color
                   ? fail(ERR_INPUT, "%s has colour but no depth (depth.txt is missing), so it is no depth sensor",
                          folder->dir)
                   : fail(ERR_MISSING, "%s has neither rgb.txt nor depth.txt: no pictures", folder->dir);
    return status;
}

// Removes the lenses of images that the folder does not have. ERR_INPUT: the lens of images that it has is missing.
static enum status match_calibration(const struct folder *folder, struct calibration *calibration)
{
    if (folder->color.count && !calibration->color.width)
        return fail(ERR_INPUT, "%s/calibration.json: 'color' is missing, but there is an rgb.txt", folder->dir);
    if (folder->depth.count && !calibration->depth.width)
        return fail(ERR_INPUT, "%s/calibration.json: 'depth' is missing, but there is a depth.txt", folder->dir);
    if (!folder->color.count)
        calibration->color = (struct lens){0};
    if (!folder->depth.count)
        calibration->depth = (struct lens){0};
    return OK;
}

static enum status alloc_buffers(struct folder *folder, const struct calibration *calibration, double unit_m)
{
    folder->rgb = malloc((size_t)calibration->color.width * (size_t)calibration->color.height * 3 + 1);
    folder->mm = malloc((size_t)calibration->depth.width * (size_t)calibration->depth.height * sizeof *folder->mm + 1);
    folder->to_mm = calloc(65536, sizeof *folder->to_mm);
    for (int raw = 0; folder->to_mm && raw < 65535; raw++) { // 65535 stays 0
        double mm = round(raw * (unit_m / 0.001));
        folder->to_mm[raw] = mm <= 65535 ? (uint16_t)mm : 0;
    }
    if (!folder->rgb || !folder->mm || !folder->to_mm)
        return fail(ERR_MEMORY, "no memory for the pictures of %s", folder->dir);
    return OK;
}

static enum status open_steps(struct folder *folder, enum source_wanted wanted)
{
    struct calibration *c = &folder->facts->calibration;
    char path[PATH_BYTES];
    double unit_m;
    if (!file_exists(folder->dir))
        return fail(ERR_MISSING, "there is no folder %s", folder->dir);
    struct stat about;
    const char *kind = file_kind(folder->dir);
    if (!stat(folder->dir, &about) && !S_ISDIR(about.st_mode))
        return fail(ERR_INPUT, "%s is no folder of pictures: it is %s", folder->dir, kind ? kind : "a file");
    if (snprintf(path, sizeof path, "%s/calibration.json", folder->dir) >= (int)sizeof path)
        return fail(ERR_INPUT, "the path %.60s… is too long", folder->dir);
    enum status status = calibration_read_with_unit(path, c, &unit_m);
    if (status == OK)
        status = read_lists(folder, wanted);
    if (status == OK)
        status = match_calibration(folder, c);
    if (status == OK && wanted == SOURCE_SENSOR)
        status = pair_images(folder);
    if (status == OK)
        status = check_first(folder, &folder->color, &c->color, "color");
    if (status == OK)
        status = check_first(folder, &folder->depth, &c->depth, "depth");
    if (status == OK)
        status = alloc_buffers(folder, c, unit_m);
    return status;
}

enum status folder_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    *self = NULL;
    struct folder *f = calloc(1, sizeof *f);
    if (!f || !(f->dir = strdup(where))) {
        folder_close(f);
        return fail(ERR_MEMORY, "no memory to open the folder %s", where);
    }
    for (size_t n = strlen(f->dir); n > 1 && f->dir[n - 1] == '/'; n--)
        f->dir[n - 1] = 0;
    f->facts = facts;
    bool usable = true;
    enum status status = open_steps(f, wanted);
    if (status == OK)
        status = check_names(f->lead, &usable);
    if (status != OK) {
        folder_close(f);
        return status;
    }
    f->numbered = !usable;
    facts->live = false;
    facts->remaining = f->lead->count;
    facts->dropped = f->lead->skipped;
    *self = f;
    return OK;
}

static enum status folder_next(void *self, struct frame *out)
{
    struct folder *f = self;
    free(f->jpeg);
    f->jpeg = NULL;
    if (f->at >= f->lead->count)
        return NOTHING;
    int64_t index = f->at++;
    f->facts->remaining = f->lead->count - f->at;
    const struct image_entry *entry = &f->lead->entries[index];
    out->time_ns = entry->time_ns;
    size_t length;
    const char *stem = stem_of(entry->path, &length);
    if (f->numbered)
        snprintf(out->name, sizeof out->name, "%04lld", (long long)index);
    else
        snprintf(out->name, sizeof out->name, "%.*s", (int)length, stem);
    const struct image_entry *color = entry;
    enum status status = OK;
    if (f->lead == &f->depth) {
        color = f->color_of[index] < 0 ? NULL : &f->color.entries[f->color_of[index]];
        status = read_depth(f, entry, out);
    }
    if (status == OK && color)
        status = read_color(f, color, out);
    return status;
}

const struct source_kind folder_kind = {folder_next, folder_close};
