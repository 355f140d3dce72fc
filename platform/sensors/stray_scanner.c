// Folders of Stray Scanner, a program that films with a telephone's depth sensor, as a sensor: stray:DIR.
//
//   rgb.mp4              colour, by FFmpeg's libraries
//   depth/000000.png     16-bit millimetres of frame 0, and so on
//   confidence/000000.png 8-bit, 0 to 2; may be missing
//   camera_matrix.csv    the lens: three rows of three numbers, pixels of the film from the corner of the image
//   odometry.csv         timestamp, frame, x, y, z, qx, qy, qz, qw by its header: ARKit's world, camera axes x right,
//                        y down, z forward. Files of before 2022 have x ... qw alone, without a header
//
// (Stray Robots, "Data Specification"). A frame is a row of odometry.csv with the depth image of its number, and of the
// film the image nearest in time, at most half a frame away; without timestamps the image of its number. Rows without
// depth, without a number, or not later than the one before, are counted as dropped. Of a film that is wider than
// COLOR_MAX_PX each two pixels by two become one, as often as that takes.
#include "base/pixels.h"
#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "platform/files/text_file.h"
#include "platform/files/video_reader.h"
#include "platform/sensors/source_internal.h"
#include "platform/sensors/telephone.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// 1920 x 1440 becomes 960 x 720, what Record3D stores: six times the depth's pixels, and a third of the time a frame.
// Chosen by hand.
enum { COLOR_MAX_PX = 1280 };
enum { PATH_BYTES = 4096, COLUMNS = 9, COLUMNS_MAX = 32 };

enum column { TIMESTAMP, FRAME, X, Y, Z, QX, QY, QZ, QW };
static const char *const column_names[COLUMNS] = {"timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"};

struct row {
    int64_t number, time_ns;
};

struct stray {
    char *dir;
    struct telephone telephone;
    struct telephone_poses poses; // by row
    struct row *rows;
    int64_t count, at;
    bool timed; // the rows have times; else they are the film's
    int64_t half_ns;
    struct video_reader *video;
    int width, height, shrink; // of the film, and how many of its pixels along a side become one
    uint8_t *film;             // an image of it
    int64_t image_ns, images;  // of the film's image that was read last, from its start on; images read
    int64_t last_ns;           // of the last frame whose time is the film's
    bool has_image, ended;
    struct source_facts *facts;
};

static enum status path_of(const struct stray *stray, const char *name, char out[PATH_BYTES])
{
    if (snprintf(out, PATH_BYTES, "%s/%s", stray->dir, name) >= PATH_BYTES)
        return fail(ERR_INPUT, "the path %.60s… is too long", stray->dir);
    return OK;
}

// Splits a line at its commas into numbers; the count of them, or -1: one is none.
static int split_numbers(char *line, double out[COLUMNS_MAX])
{
    int count = 0;
    for (char *rest = line, *field; (field = strsep(&rest, ",")) && count < COLUMNS_MAX; count++) {
        field += strspn(field, " \t");
        field[strcspn(field, " \t")] = 0;
        if (!text_number(field, &out[count]))
            return -1;
    }
    return count;
}

// ---------------------------------------------------------------- the lens

static enum status read_lens(const struct stray *stray, struct lens *out)
{
    char path[PATH_BYTES];
    struct text_file file;
    double row[3][COLUMNS_MAX];
    enum status status = path_of(stray, "camera_matrix.csv", path);
    if (status == OK)
        status = text_file_open(&file, path);
    if (status == ERR_MISSING)
        return fail(ERR_INPUT, "%s is missing, without which the lens is not known", path);
    if (status != OK)
        return status;
    for (int i = 0; i < 3 && status == OK; i++) {
        char *line = text_file_line(&file);
        if (!line || split_numbers(line, row[i]) != 3)
            status = fail(ERR_INPUT, "%s: three rows of three numbers are expected", path);
    }
    text_file_close(&file);
    if (status != OK)
        return status;
    const double share = 1.0 / stray->shrink;
    *out = (struct lens){.width = stray->width / stray->shrink,
                         .height = stray->height / stray->shrink,
                         .fx = row[0][0] * share,
                         .fy = row[1][1] * share,
                         .cx = row[0][2] * share - 0.5, // from the corner of the first pixel to its middle
                         .cy = row[1][2] * share - 0.5};
    return OK;
}

// ---------------------------------------------------------------- odometry

// Which column of the file is which. False: it is no header.
static bool read_header(char *line, int at[COLUMNS])
{
    int column = 0;
    bool found = false;
    for (int i = 0; i < COLUMNS; i++)
        at[i] = -1;
    for (char *rest = line, *field; (field = strsep(&rest, ",")) && column < COLUMNS_MAX; column++) {
        field += strspn(field, " \t");
        field[strcspn(field, " \t")] = 0;
        for (int i = 0; i < COLUMNS; i++)
            if (!strcmp(field, column_names[i])) {
                at[i] = column;
                found = true;
            }
    }
    return found;
}

static enum status add_row(struct stray *stray, const double *numbers, const int at[COLUMNS], int line)
{
    struct row *row = &stray->rows[stray->count];
    struct pose *pose = &stray->poses.at[stray->count];
    const double number = at[FRAME] >= 0 ? numbers[at[FRAME]] : (double)stray->poses.count;
    const double seconds = stray->timed ? numbers[at[TIMESTAMP]] : 0;
    stray->poses.count++;
    if (!(fabs(seconds) < SECONDS_MAX))
        return fail(ERR_INPUT, "%s/odometry.csv, line %d: '%g' is no time in seconds", stray->dir, line, seconds);
    *row = (struct row){number >= 0 && number < 1e6 ? (int64_t)number : -1, (int64_t)round(seconds * 1e9)};
    stray->poses.known[stray->count] =
        telephone_pose((struct quat){numbers[at[QX]], numbers[at[QY]], numbers[at[QZ]], numbers[at[QW]]},
                       v3(numbers[at[X]], numbers[at[Y]], numbers[at[Z]]), TELEPHONE_FORWARD, pose);
    const struct row *before = stray->count ? row - 1 : NULL;
    if (row->number < 0 ||
        (before && (row->number <= before->number || (stray->timed && row->time_ns <= before->time_ns))))
        stray->facts->dropped++;
    else
        stray->count++;
    return OK;
}

static enum status read_rows(struct stray *stray, struct text_file *file)
{
    int at[COLUMNS] = {-1, -1, 0, 1, 2, 3, 4, 5, 6}; // of a file without a header
    double numbers[COLUMNS_MAX];
    enum status status = OK;
    bool first = true;
    for (char *line; status == OK && (line = text_file_line(file)); first = false) {
        char copy[512];
        snprintf(copy, sizeof copy, "%s", line);
        const int count = split_numbers(line, numbers);
        if (count < 0 && first && read_header(copy, at)) {
            for (int i = X; i < COLUMNS; i++)
                if (at[i] < 0)
                    return fail(ERR_INPUT, "%s/odometry.csv has no column '%s'", stray->dir, column_names[i]);
            stray->timed = at[TIMESTAMP] >= 0;
            continue;
        }
        for (int i = 0; i < COLUMNS && status == OK; i++)
            if (at[i] >= count)
                status = fail(ERR_INPUT, "%s/odometry.csv, line %d: '%.40s' is no row of numbers, one for each column",
                              stray->dir, file->line, copy);
        if (status == OK)
            status = add_row(stray, numbers, at, file->line);
    }
    return status;
}

static int compare_times(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

// Half the median time between two rows; times count from the first row, as the film's do from its start.
static enum status finish_rows(struct stray *stray)
{
    if (!stray->count)
        return fail(ERR_INPUT, "%s/odometry.csv lists no frame", stray->dir);
    stray->poses.count = stray->count;
    int64_t *steps = malloc((size_t)stray->count * sizeof *steps);
    if (!steps)
        return fail(ERR_MEMORY, "no memory for the times of %s", stray->dir);
    for (int64_t i = 1; i < stray->count; i++)
        steps[i - 1] = stray->rows[i].time_ns - stray->rows[i - 1].time_ns;
    qsort(steps, (size_t)stray->count - 1, sizeof *steps, compare_times);
    stray->half_ns = stray->count > 1 ? steps[(stray->count - 1) / 2] / 2 : 0;
    free(steps);
    return OK;
}

static enum status read_odometry(struct stray *stray)
{
    char path[PATH_BYTES];
    struct text_file file;
    enum status status = path_of(stray, "odometry.csv", path);
    if (status == OK)
        status = text_file_open(&file, path);
    if (status == ERR_MISSING)
        return fail(ERR_INPUT, "%s is no folder of Stray Scanner: there is no odometry.csv in it", stray->dir);
    if (status != OK)
        return status;
    const size_t lines = text_file_lines_left(&file);
    stray->rows = calloc(lines + 1, sizeof *stray->rows);
    stray->poses.at = calloc(lines + 1, sizeof *stray->poses.at);
    stray->poses.known = calloc(lines + 1, sizeof *stray->poses.known);
    if (!stray->rows || !stray->poses.at || !stray->poses.known)
        status = fail(ERR_MEMORY, "no memory for the %zu lines of %s", lines, path);
    if (status == OK)
        status = read_rows(stray, &file);
    text_file_close(&file);
    return status == OK ? finish_rows(stray) : status;
}

// ---------------------------------------------------------------- images

// depth/NUMBER.png or confidence/NUMBER.png, of the depth images' size. NOTHING: there is no such file.
static enum status read_picture(const struct stray *stray, const char *folder, int64_t number, enum png_kind kind,
                                void **pixels)
{
    char name[64], path[PATH_BYTES];
    int width, height;
    snprintf(name, sizeof name, "%s/%06lld.png", folder, (long long)number);
    enum status status = path_of(stray, name, path);
    if (status == OK)
        status = png_read(path, kind, pixels, &width, &height);
    if (status == ERR_MISSING)
        return NOTHING;
    if (status == ERR_CORRUPT)
        return fail(ERR_INPUT, "%s", status_message());
    if (status != OK || !stray->telephone.mm || (width == stray->telephone.width && height == stray->telephone.height))
        return status;
    free(*pixels);
    return fail(ERR_INPUT, "%s has %d x %d pixels, but the depth images before it %d x %d", path, width, height,
                stray->telephone.width, stray->telephone.height);
}

// NOTHING: the row has no depth image.
static enum status read_depth(struct stray *stray, int64_t number)
{
    struct telephone *telephone = &stray->telephone;
    void *pixels;
    enum status status = read_picture(stray, "depth", number, PNG_GRAY16, &pixels);
    if (status != OK)
        return status;
    const size_t samples = (size_t)telephone->width * (size_t)telephone->height;
    memcpy(telephone->mm, pixels, samples * sizeof *telephone->mm);
    free(pixels);
    for (size_t i = 0; i < samples; i++)
        if (telephone->mm[i] == UINT16_MAX)
            telephone->mm[i] = 0;
    status = read_picture(stray, "confidence", number, PNG_GRAY8, &pixels);
    if (status != OK)
        return status == NOTHING ? OK : status;
    telephone_drop_guesses(telephone, pixels);
    free(pixels);
    return OK;
}

// Goes on in the film to the image of that time or number; *found: there is one. ERR_INPUT: it is damaged.
static enum status seek_image(struct stray *stray, const struct row *row, bool *found)
{
    const int64_t wanted_ns = row->time_ns - stray->rows[0].time_ns;
    *found = false;
    while (!stray->ended) {
        if (stray->has_image && stray->timed) {
            *found = llabs(stray->image_ns - wanted_ns) <= stray->half_ns;
            if (*found || stray->image_ns > wanted_ns)
                return OK;
        } else if (stray->has_image) {
            *found = stray->images == row->number + 1;
            if (stray->images > row->number)
                return OK;
        }
        stray->has_image = false;
        const enum status status = video_reader_next(stray->video, &stray->image_ns);
        stray->ended = status == NOTHING;
        stray->has_image = status == OK;
        stray->images += status != NOTHING;
        if (status < 0)
            return status;
    }
    return OK;
}

static enum status read_color(struct stray *stray, const struct row *row, struct frame *out)
{
    bool found;
    enum status status = seek_image(stray, row, &found);
    if (status != OK || !found)
        return status;
    if (!stray->timed)
        out->time_ns = stray->image_ns;
    const struct lens *lens = &stray->telephone.color;
    status = video_reader_image(stray->video, stray->film);
    if (status != OK)
        return status;
    image_shrink(stray->film, stray->width, stray->height, stray->telephone.rgb, lens->width, lens->height);
    out->color = telephone_color(&stray->telephone);
    stray->facts->pairs++;
    return OK;
}

static enum status stray_next(void *self, struct frame *out)
{
    struct stray *stray = self;
    for (;;) {
        if (stray->at >= stray->count)
            return NOTHING;
        const int64_t at = stray->at++;
        const struct row *row = &stray->rows[at];
        stray->facts->remaining = stray->count - stray->at;
        enum status status = read_depth(stray, row->number);
        if (status == NOTHING) {
            stray->facts->dropped++;
            continue;
        }
        out->time_ns = row->time_ns;
        snprintf(out->name, sizeof out->name, "%06lld", (long long)row->number);
        telephone_set_odometry(&stray->telephone, &stray->poses, at, out);
        if (status != OK)
            return status;
        out->depth = telephone_depth(&stray->telephone);
        status = read_color(stray, row, out);
        if (status != OK || stray->timed)
            return status;
        if (!out->color) // the film has ended, and with it the times
            return NOTHING;
        if (out->time_ns > stray->last_ns) {
            stray->last_ns = out->time_ns;
            return OK;
        }
        stray->facts->dropped++;
    }
}

// ---------------------------------------------------------------- opening

static enum status check_folder(const struct stray *stray)
{
    struct stat about;
    const char *kind = file_kind(stray->dir);
    if (!file_exists(stray->dir))
        return fail(ERR_MISSING, "there is no folder %s", stray->dir);
    if (!stat(stray->dir, &about) && !S_ISDIR(about.st_mode))
        return fail(ERR_INPUT, "%s is no folder of Stray Scanner: it is %s", stray->dir, kind ? kind : "a file");
    return OK;
}

static enum status open_video(struct stray *stray)
{
    char path[PATH_BYTES];
    enum status status = path_of(stray, "rgb.mp4", path);
    if (status == OK)
        status = video_reader_open(&stray->video, path);
    if (status == ERR_MISSING)
        return fail(ERR_INPUT, "%s is missing: the folder is not whole", path);
    if (status != OK)
        return status;
    video_reader_size(stray->video, &stray->width, &stray->height);
    stray->shrink = 1;
    while ((stray->width > stray->height ? stray->width : stray->height) / stray->shrink > COLOR_MAX_PX)
        stray->shrink *= 2;
    stray->film = malloc(3 * (size_t)stray->width * (size_t)stray->height);
    return stray->film ? OK : fail(ERR_MEMORY, "no memory for the images of %s", path);
}

// The size of the depth images, by the first that is there and sound.
static enum status depth_size(const struct stray *stray, int size[2])
{
    char name[64], path[PATH_BYTES];
    for (int64_t i = 0; i < stray->count; i++) {
        uint8_t *bytes;
        size_t count;
        snprintf(name, sizeof name, "depth/%06lld.png", (long long)stray->rows[i].number);
        enum status status = path_of(stray, name, path);
        if (status == OK)
            status = file_read(path, &bytes, &count);
        if (status == ERR_MEMORY || status == ERR_INPUT)
            return status;
        if (status != OK)
            continue;
        status = png_size(bytes, count, path, &size[0], &size[1]);
        free(bytes);
        if (status == OK)
            return OK;
    }
    return fail(ERR_INPUT, "%s holds no depth image that can be read (depth/000000.png and so on)", stray->dir);
}

static enum status open_steps(struct stray *stray)
{
    int size[2];
    struct lens lens;
    enum status status = check_folder(stray);
    if (status == OK)
        status = read_odometry(stray);
    if (status == OK)
        status = depth_size(stray, size);
    if (status == OK)
        status = open_video(stray);
    if (status == OK)
        status = read_lens(stray, &lens);
    return status == OK
               ? telephone_open(&stray->telephone, stray->dir, &lens, size, &stray->poses, &stray->facts->calibration)
               : status;
}

static void stray_close(void *self)
{
    struct stray *stray = self;
    if (!stray)
        return;
    video_reader_close(&stray->video);
    telephone_close(&stray->telephone);
    free(stray->poses.at);
    free(stray->poses.known);
    free(stray->rows);
    free(stray->film);
    free(stray->dir);
    free(stray);
}

enum status stray_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted; // a sensor
    *self = NULL;
    struct stray *stray = calloc(1, sizeof *stray);
    if (!stray || !(stray->dir = strdup(where))) {
        free(stray);
        return fail(ERR_MEMORY, "no memory to open %s", where);
    }
    for (size_t n = strlen(stray->dir); n > 1 && stray->dir[n - 1] == '/'; n--)
        stray->dir[n - 1] = 0;
    stray->facts = facts;
    stray->last_ns = INT64_MIN;
    const enum status status = open_steps(stray);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        stray_close(stray);
        return failure_restore(&first);
    }
    facts->live = false;
    facts->remaining = stray->count;
    *self = stray;
    return OK;
}

const struct source_kind stray_kind = {stray_next, stray_close};
