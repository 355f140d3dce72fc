// Recordings of Record3D (.r3d), a program that films with a telephone's depth sensor, as a sensor: r3d:FILE.
//
// The file is a ZIP archive (as other readers of it have it; its maker publishes no format):
//
//   metadata       JSON: w, h; dw, dh (newer files); K, nine numbers by columns, pixels of w x h from the corner of the
//                  image; perFrameIntrinsicCoeffs [[fx, fy, cx, cy], ...] (newer); fps; frameTimestamps [s, ...]
//                  (newer); poses [[qx, qy, qz, qw, x, y, z], ...] in ARKit's axes
//   rgbd/N.jpg     colour of frame N, from 0 on
//   rgbd/N.depth   32-bit floats, metres, rows from the top, LZFSE; NaN: no reading
//   rgbd/N.conf    a byte a sample, 0 to 2, LZFSE; may be missing
//
// A frame is a depth image with the colour of its number. The lens is that of all frames, the median where they have
// one each: autofocus changes it by less than a hundredth. Images without a time, or not later than the one before, are
// counted as dropped. Colour is handed on as the JPEG that it is, where it is not turned.
#include "base/pixels.h"
#include "base/text.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/files/lzfse.h"
#include "platform/files/zip_file.h"
#include "platform/sensors/source_internal.h"
#include "platform/sensors/telephone.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MEMBER_BYTES = 300 };

static const double DEFAULT_FPS = 60; // of old files, which do not say it

struct image_entry {
    int number; // the N of its name
    int64_t member, time_ns;
};

struct record3d {
    char *path;
    char folder[MEMBER_BYTES]; // of the archive in which it all lies, with its /; most often ""
    struct zip_file *zip;
    struct telephone telephone;
    struct telephone_poses poses;
    struct image_entry *entries; // depth images by their times
    int64_t count, at;
    float *metres;
    uint8_t *confidence, *jpeg;
    struct source_facts *facts;
};

static const char *member_of(const struct record3d *film, const char *name, char out[2 * MEMBER_BYTES])
{
    snprintf(out, 2 * MEMBER_BYTES, "%s%s", film->folder, name);
    return out;
}

// Reads the member; its name in `name`. NOTHING: there is none.
static enum status read_image(struct record3d *film, int number, const char *ending, uint8_t **bytes, size_t *count)
{
    char name[64], member[2 * MEMBER_BYTES];
    snprintf(name, sizeof name, "rgbd/%d.%s", number, ending);
    const int64_t found = zip_file_find(film->zip, member_of(film, name, member));
    return found < 0 ? NOTHING : zip_file_read(film->zip, found, bytes, count);
}

// ---------------------------------------------------------------- metadata

// The last part of a path in an archive.
static bool has_name(const char *path, const char *name)
{
    const char *slash = strrchr(path, '/');
    return !strcmp(slash ? slash + 1 : path, name);
}

static enum status read_metadata(struct record3d *film, struct json **out)
{
    int64_t member = zip_file_find(film->zip, "metadata");
    for (int64_t i = 0; i < zip_file_count(film->zip) && member < 0; i++)
        if (has_name(zip_file_name(film->zip, i), "metadata"))
            member = i;
    if (member < 0)
        return fail(ERR_INPUT, "%s is no recording of Record3D: there is no 'metadata' in the archive", film->path);
    const char *name = zip_file_name(film->zip, member);
    const size_t folder = strlen(name) - strlen("metadata");
    if (folder >= sizeof film->folder)
        return fail(ERR_INPUT, "%s: the folder in the archive has too long a name", film->path);
    memcpy(film->folder, name, folder);
    film->folder[folder] = 0;
    uint8_t *bytes;
    size_t count;
    char where[300];
    snprintf(where, sizeof where, "metadata in %.250s", film->path);
    enum status status = zip_file_read(film->zip, member, &bytes, &count);
    if (status != OK)
        return status;
    status = json_parse((const char *)bytes, count, where, out);
    free(bytes);
    return status;
}

// Exactly `count` numbers. False: it is no such list.
static bool numbers_of(const struct json *list, int count, double *out)
{
    if (!json_is_array(list) || json_count(list) != count)
        return false;
    const struct json *value = json_first(list);
    for (int i = 0; i < count; i++, value = json_next(value))
        if (!json_get_number(value, &out[i]))
            return false;
    return true;
}

static int compare_numbers(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The median of each of the four numbers, over the frames. False: there are none.
static enum status median_lens(const struct json *list, double out[4])
{
    const int count = json_is_array(list) ? json_count(list) : 0;
    double *of_frames = malloc(4 * (size_t)count * sizeof *of_frames + 1);
    int used = 0;
    if (!of_frames)
        return fail(ERR_MEMORY, "no memory for the lenses of a film");
    for (const struct json *frame = count ? json_first(list) : NULL; frame; frame = json_next(frame)) {
        double numbers[4];
        if (!numbers_of(frame, 4, numbers))
            continue;
        for (int i = 0; i < 4; i++)
            of_frames[i * count + used] = numbers[i];
        used++;
    }
    for (int i = 0; i < 4 && used; i++) {
        qsort(of_frames + i * count, (size_t)used, sizeof *of_frames, compare_numbers);
        out[i] = of_frames[i * count + used / 2];
    }
    free(of_frames);
    return used ? OK : NOTHING;
}

// The lens of the colour images, which have `size` pixels whatever the metadata says.
static enum status read_lens(const struct record3d *film, const struct json *root, const int size[2], struct lens *out)
{
    double k[9], f[4], width = size[0], height = size[1];
    enum status status = median_lens(json_member(root, "perFrameIntrinsicCoeffs"), f);
    if (status < 0)
        return status;
    if (status == NOTHING && !numbers_of(json_member(root, "K"), 9, k))
        return fail(ERR_INPUT, "metadata in %s: the lens 'K', nine numbers, is missing", film->path);
    if (status == NOTHING)
        memcpy(f, (const double[4]){k[0], k[4], k[6], k[7]}, sizeof f);
    json_get_number(json_member(root, "w"), &width);
    json_get_number(json_member(root, "h"), &height);
    if (!(width >= 1 && height >= 1))
        return fail(ERR_INPUT, "metadata in %s: 'w' and 'h' are not the size of an image", film->path);
    const double x = size[0] / width, y = size[1] / height;
    *out = (struct lens){.width = size[0],
                         .height = size[1],
                         .fx = f[0] * x,
                         .fy = f[1] * y,
                         .cx = f[2] * x - 0.5, // from the corner of the first pixel to its middle
                         .cy = f[3] * y - 0.5};
    return OK;
}

static enum status read_poses(struct record3d *film, const struct json *root)
{
    const struct json *list = json_member(root, "poses");
    const int count = json_is_array(list) ? json_count(list) : 0;
    struct telephone_poses *poses = &film->poses;
    poses->at = calloc((size_t)count + 1, sizeof *poses->at);
    poses->known = calloc((size_t)count + 1, sizeof *poses->known);
    if (!poses->at || !poses->known)
        return fail(ERR_MEMORY, "no memory for the poses of %s", film->path);
    for (const struct json *pose = count ? json_first(list) : NULL; pose; pose = json_next(pose)) {
        double n[7];
        const int64_t at = poses->count++;
        poses->known[at] =
            numbers_of(pose, 7, n) && telephone_pose((struct quat){n[0], n[1], n[2], n[3]}, v3(n[4], n[5], n[6]),
                                                     TELEPHONE_BACKWARD, &poses->at[at]);
    }
    return OK;
}

// ---------------------------------------------------------------- frames

// The number N of "rgbd/N.depth" in the film's folder; -1: it is another member.
static int depth_number(const struct record3d *film, const char *name)
{
    const size_t folder = strlen(film->folder);
    if (strncmp(name, film->folder, folder) || strncmp(name + folder, "rgbd/", 5))
        return -1;
    const char *digits = name + folder + 5;
    const size_t count = strspn(digits, "0123456789");
    if (!count || count > 7 || strcmp(digits + count, ".depth"))
        return -1;
    return atoi(digits);
}

static int compare_entries(const void *a, const void *b)
{
    return ((const struct image_entry *)a)->number - ((const struct image_entry *)b)->number;
}

static enum status list_images(struct record3d *film)
{
    film->entries = calloc((size_t)zip_file_count(film->zip) + 1, sizeof *film->entries);
    if (!film->entries)
        return fail(ERR_MEMORY, "no memory for the list of %s", film->path);
    for (int64_t i = 0; i < zip_file_count(film->zip); i++) {
        const int number = depth_number(film, zip_file_name(film->zip, i));
        if (number >= 0)
            film->entries[film->count++] = (struct image_entry){.number = number, .member = i};
    }
    qsort(film->entries, (size_t)film->count, sizeof *film->entries, compare_entries);
    return film->count ? OK : fail(ERR_INPUT, "%s holds no depth images (rgbd/0.depth and so on)", film->path);
}

// The time of frame `number`, by the list of times or the rate. False: it has none.
static bool time_of(const double *times, int count, double fps, int number, int64_t *time_ns)
{
    const double seconds = count && number < count ? times[number] : NAN;
    const double at = count ? seconds : number / fps;
    if (!(fabs(at) < SECONDS_MAX))
        return false;
    *time_ns = (int64_t)round(at * 1e9);
    return true;
}

// Gives the images their times; those that do not rise are left out.
static enum status read_times(struct record3d *film, const struct json *root)
{
    const struct json *list = json_member(root, "frameTimestamps");
    const int count = json_is_array(list) ? json_count(list) : 0;
    double fps = DEFAULT_FPS, *times = malloc((size_t)count * sizeof *times + 1);
    if (!times)
        return fail(ERR_MEMORY, "no memory for the times of %s", film->path);
    const struct json *value = count ? json_first(list) : NULL;
    for (int i = 0; i < count; i++, value = json_next(value))
        if (!json_get_number(value, &times[i]))
            times[i] = NAN;
    json_get_number(json_member(root, "fps"), &fps);
    int64_t kept = 0, time_ns;
    for (int64_t i = 0; i < film->count && fps >= 1; i++) {
        if (!time_of(times, count, fps, film->entries[i].number, &time_ns) ||
            (kept && time_ns <= film->entries[kept - 1].time_ns))
            continue;
        film->entries[kept] = film->entries[i];
        film->entries[kept++].time_ns = time_ns;
    }
    free(times);
    film->facts->dropped = film->count - kept;
    film->count = kept;
    return kept ? OK
                : fail(ERR_INPUT, "metadata in %s: no frame has a time, by 'frameTimestamps' or 'fps'", film->path);
}

// ---------------------------------------------------------------- images

// LZFSE, or as it is. A member of another size is refused.
static enum status unpack(const struct record3d *film, const struct image_entry *entry, const char *what,
                          const uint8_t *bytes, size_t count, uint8_t *out, size_t out_count)
{
    enum status status = OK;
    if (count == out_count)
        memcpy(out, bytes, count);
    else
        status = lzfse_decode(bytes, count, out, out_count);
    if (status == ERR_CORRUPT)
        return fail(ERR_INPUT, "%s, %s of frame %d: %s", film->path, what, entry->number, status_message());
    return status;
}

static enum status read_depth(struct record3d *film, const struct image_entry *entry)
{
    struct telephone *telephone = &film->telephone;
    const size_t samples = (size_t)telephone->width * (size_t)telephone->height;
    uint8_t *bytes;
    size_t count;
    enum status status = zip_file_read(film->zip, entry->member, &bytes, &count);
    if (status != OK)
        return status;
    status = unpack(film, entry, "depth", bytes, count, (uint8_t *)film->metres, samples * sizeof *film->metres);
    free(bytes);
    for (size_t i = 0; i < samples && status == OK; i++) {
        const double mm = round(1e3 * (double)film->metres[i]);
        telephone->mm[i] = mm > 0 && mm < 65535 ? (uint16_t)mm : 0; // NaN, too
    }
    if (status != OK)
        return status;
    status = read_image(film, entry->number, "conf", &bytes, &count);
    if (status != OK)
        return status == NOTHING ? OK : status;
    status = unpack(film, entry, "confidence", bytes, count, film->confidence, samples);
    free(bytes);
    if (status == OK)
        telephone_drop_guesses(telephone, film->confidence);
    return status;
}

static enum status read_color(struct record3d *film, const struct image_entry *entry, struct frame *out)
{
    size_t count;
    int width, height;
    enum status status = read_image(film, entry->number, "jpg", &film->jpeg, &count);
    if (status != OK)
        return status == NOTHING ? OK : status;
    const struct lens *lens = &film->telephone.color;
    status = jpeg_size(film->jpeg, count, &width, &height);
    if (status == OK && (width != lens->width || height != lens->height))
        status =
            fail(ERR_CORRUPT, "it has %d x %d pixels instead of %d x %d", width, height, lens->width, lens->height);
    if (status == OK)
        status = jpeg_decode(film->jpeg, count, film->telephone.rgb, width, height);
    if (status == ERR_CORRUPT || status == ERR_INPUT)
        return fail(ERR_INPUT, "%s, colour of frame %d: %s", film->path, entry->number, status_message());
    if (status != OK)
        return status;
    out->color = telephone_color(&film->telephone);
    film->facts->pairs++;
    if (!film->telephone.turns) {
        out->jpeg = film->jpeg;
        out->jpeg_bytes = count;
    }
    return OK;
}

static enum status record3d_next(void *self, struct frame *out)
{
    struct record3d *film = self;
    free(film->jpeg);
    film->jpeg = NULL;
    if (film->at >= film->count)
        return NOTHING;
    const struct image_entry *entry = &film->entries[film->at++];
    film->facts->remaining = film->count - film->at;
    out->time_ns = entry->time_ns;
    snprintf(out->name, sizeof out->name, "%04d", entry->number);
    telephone_set_odometry(&film->telephone, &film->poses, entry->number, out);
    enum status status = read_depth(film, entry);
    if (status != OK)
        return status;
    out->depth = telephone_depth(&film->telephone);
    return read_color(film, entry, out);
}

// ---------------------------------------------------------------- opening

// The size of the colour images, by the first that can be read; by the metadata where none can.
static enum status color_size(struct record3d *film, const struct json *root, int size[2])
{
    double width = 0, height = 0;
    for (int64_t i = 0; i < film->count && i < 10; i++) {
        uint8_t *bytes;
        size_t count;
        enum status status = read_image(film, film->entries[i].number, "jpg", &bytes, &count);
        if (status == ERR_MEMORY)
            return status;
        if (status != OK)
            continue;
        status = jpeg_size(bytes, count, &size[0], &size[1]);
        free(bytes);
        if (status == OK)
            return OK;
    }
    json_get_number(json_member(root, "w"), &width);
    json_get_number(json_member(root, "h"), &height);
    if (!(width >= 1 && width <= IMAGE_SIDE_MAX && height >= 1 && height <= IMAGE_SIDE_MAX))
        return fail(ERR_INPUT,
                    "%s: none of its first colour images can be read, and 'w' and 'h' are missing in the "
                    "metadata",
                    film->path);
    size[0] = (int)width;
    size[1] = (int)height;
    return OK;
}

// Of the depth images; older files do not say it, and their sensors had 192 x 256 samples or 480 x 640.
static enum status depth_size(struct record3d *film, const struct json *root, const int color[2], int size[2])
{
    double width = 0, height = 0;
    uint8_t *bytes;
    size_t count;
    if (json_get_number(json_member(root, "dw"), &width) && json_get_number(json_member(root, "dh"), &height) &&
        width >= 1 && width <= IMAGE_SIDE_MAX && height >= 1 && height <= IMAGE_SIDE_MAX) {
        size[0] = (int)width;
        size[1] = (int)height;
        return OK;
    }
    enum status status = zip_file_read(film->zip, film->entries[0].member, &bytes, &count);
    if (status != OK)
        return status;
    const size_t first = lzfse_first_size(bytes, count);
    free(bytes);
    const bool small = first <= 4 * 192 * 256, upright = color[0] < color[1];
    size[upright ? 0 : 1] = small ? 192 : 480;
    size[upright ? 1 : 0] = small ? 256 : 640;
    return OK;
}

static enum status open_images(struct record3d *film, const struct json *root)
{
    int color[2], depth[2];
    struct lens lens;
    enum status status = color_size(film, root, color);
    if (status == OK)
        status = depth_size(film, root, color, depth);
    if (status == OK)
        status = read_lens(film, root, color, &lens);
    if (status == OK)
        status = telephone_open(&film->telephone, film->path, &lens, depth, &film->poses, &film->facts->calibration);
    if (status != OK)
        return status;
    const size_t samples = (size_t)depth[0] * (size_t)depth[1];
    film->metres = malloc(samples * sizeof *film->metres);
    film->confidence = malloc(samples);
    return film->metres && film->confidence ? OK : fail(ERR_MEMORY, "no memory for the images of %s", film->path);
}

static enum status open_steps(struct record3d *film)
{
    struct json *root = NULL;
    enum status status = zip_file_open(&film->zip, film->path);
    if (status == OK)
        status = read_metadata(film, &root);
    if (status == OK)
        status = list_images(film);
    if (status == OK)
        status = read_times(film, root);
    if (status == OK)
        status = read_poses(film, root);
    if (status == OK)
        status = open_images(film, root);
    json_free(&root);
    return status;
}

static void record3d_close(void *self)
{
    struct record3d *film = self;
    if (!film)
        return;
    zip_file_close(&film->zip);
    telephone_close(&film->telephone);
    free(film->poses.at);
    free(film->poses.known);
    free(film->entries);
    free(film->metres);
    free(film->confidence);
    free(film->jpeg);
    free(film->path);
    free(film);
}

enum status record3d_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted; // a sensor
    *self = NULL;
    struct record3d *film = calloc(1, sizeof *film);
    if (!film || !(film->path = strdup(where))) {
        free(film);
        return fail(ERR_MEMORY, "no memory to open %s", where);
    }
    film->facts = facts;
    const enum status status = open_steps(film);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        record3d_close(film);
        return failure_restore(&first);
    }
    facts->live = false;
    facts->remaining = film->count;
    *self = film;
    return OK;
}

const struct source_kind record3d_kind = {record3d_next, record3d_close};
