// A take as a folder in the TUM RGB-D layout.
#include "capture/export.h"

#include "base/text.h"
#include "platform/files/file.h"
#include "platform/files/jpeg_metadata.h"
#include "platform/files/output.h"
#include "platform/files/png.h"
#include "platform/sensors/source.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

enum list { LIST_COLOR, LIST_DEPTH, LIST_MASK, LIST_PAIRS, LIST_TRAJECTORY, LIST_JOINTS, LIST_COUNT };

static const struct folder_list {
    const char *file, *images, *heading; // images: the folder of this list's images; NULL: none
} lists[LIST_COUNT] = {
    [LIST_COLOR] = {"rgb.txt", "rgb", "# timestamp filename"},
    [LIST_DEPTH] = {"depth.txt", "depth", "# timestamp filename (PNG, 16 bits: millimetres, 0: no reading)"},
    [LIST_MASK] = {"mask.txt", "mask", "# timestamp filename (PNG, 8 bits: 255 the actor)"},
    [LIST_PAIRS] = {"associations.txt", NULL, NULL}, // as other programs pair images; they take no comment
    [LIST_TRAJECTORY] =
        {"trajectory.txt", NULL,
         "# timestamp tx ty tz qx qy qz qw (world_from_camera, metres; camera x right, y down, z forward)"},
    [LIST_JOINTS] = {"joints.csv", NULL, NULL},
};

struct folder_export {
    struct take *take;
    char dir[PATH_MAX];
    struct output *list[LIST_COUNT];
    uint8_t *gray; // scratch for masks
};

// "DIR/NAME" into path[PATH_MAX].
static enum status join(char *path, const char *dir, const char *name)
{
    if (snprintf(path, PATH_MAX, "%s/%s", dir, name) >= PATH_MAX)
        return fail(ERR_INPUT, "the path %.60s… is too long", dir);
    return OK;
}

static enum status open_lists(struct folder_export *e)
{
    char path[PATH_MAX];
    enum status status = folder_make(e->dir);
    for (int i = 0; i < LIST_COUNT && status == OK; i++) {
        status = join(path, e->dir, lists[i].file);
        if (status == OK)
            status = output_open(&e->list[i], path);
        if (status == OK && lists[i].heading)
            fprintf(output_file(e->list[i]), "%s\n", lists[i].heading);
        if (status == OK && lists[i].images)
            status = join(path, e->dir, lists[i].images);
        if (status == OK && lists[i].images)
            status = folder_make(path);
    }
    return status;
}

static enum status write_image(struct folder_export *e, enum list list, int64_t frame, const uint8_t *bytes,
                               size_t count)
{
    char name[64], path[PATH_MAX];
    snprintf(name, sizeof name, "%s/%06lld.%s", lists[list].images, (long long)frame,
             list == LIST_COLOR ? "jpg" : "png");
    enum status status = join(path, e->dir, name);
    if (status == OK)
        status = file_write(path, bytes, count);
    char time[SECONDS_TEXT_BYTES];
    fprintf(output_file(e->list[list]), "%s %s\n", seconds_text(take_entry(e->take, frame)->time_ns, 9, time), name);
    return status;
}

static enum status write_png(struct folder_export *e, enum list list, int64_t frame, const void *pixels)
{
    const struct lens *l = &take_calibration(e->take)->depth;
    const struct png_layout layout = {list == LIST_DEPTH ? PNG_GRAY16 : PNG_GRAY8, l->width, l->height};
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&layout, pixels, 3, &bytes, &count);
    if (status == OK) {
        status = write_image(e, list, frame, bytes, count);
        free(bytes);
    }
    return status;
}

static enum status write_mask(struct folder_export *e, int64_t frame, const uint8_t *mask)
{
    const struct lens *l = &take_calibration(e->take)->depth;
    const size_t pixels = (size_t)l->width * (size_t)l->height;
    if (!e->gray && !(e->gray = malloc(pixels)))
        return fail(ERR_MEMORY, "no memory for a mask");
    for (size_t i = 0; i < pixels; i++)
        e->gray[i] = mask[i] ? 255 : 0;
    return write_png(e, LIST_MASK, frame, e->gray);
}

static enum status write_color(struct folder_export *e, int64_t frame)
{
    const uint8_t *jpeg;
    size_t count;
    enum status status = take_read_jpeg(e->take, frame, &jpeg, &count);
    if (status != OK)
        return status;
    uint8_t *plain;
    status = jpeg_without_metadata(jpeg, count, &plain, &count);
    if (status == OK)
        status = write_image(e, LIST_COLOR, frame, plain, count);
    free(plain);
    return status;
}

static void write_pose(struct folder_export *e, const struct take_entry *entry)
{
    const struct pose *p = &entry->world_from_camera;
    char time[SECONDS_TEXT_BYTES];
    fprintf(output_file(e->list[LIST_TRAJECTORY]), "%s %.6f %.6f %.6f %.7f %.7f %.7f %.7f\n",
            seconds_text(entry->time_ns, 9, time), p->translation.x, p->translation.y, p->translation.z, p->rotation.x,
            p->rotation.y, p->rotation.z, p->rotation.w);
}

// A frame's image in `list`. NOTHING: it has none.
static enum status write_list_image(struct folder_export *e, enum list list, int64_t frame)
{
    struct take_images images;
    if (list == LIST_COLOR)
        return write_color(e, frame);
    const enum status status = take_read(e->take, frame, list == LIST_DEPTH ? TAKE_DEPTH : TAKE_MASK, &images);
    if (status != OK)
        return status;
    if (list == LIST_DEPTH)
        return images.depth ? write_png(e, LIST_DEPTH, frame, images.depth) : NOTHING;
    return images.mask ? write_mask(e, frame, images.mask) : NOTHING;
}

static void write_pair(struct folder_export *e, int64_t frame)
{
    char time[SECONDS_TEXT_BYTES];
    seconds_text(take_entry(e->take, frame)->time_ns, 9, time);
    fprintf(output_file(e->list[LIST_PAIRS]), "%s %s/%06lld.jpg %s %s/%06lld.png\n", time, lists[LIST_COLOR].images,
            (long long)frame, time, lists[LIST_DEPTH].images, (long long)frame);
}

// Each image on its own, so that a damaged one costs no other. *damaged: whether there was one.
static enum status write_frame(struct folder_export *e, int64_t frame, bool *damaged)
{
    const struct take_entry *entry = take_entry(e->take, frame);
    bool written[LIST_MASK + 1];
    *damaged = false;
    for (enum list list = LIST_COLOR; list <= LIST_MASK; list++) {
        const enum status status = write_list_image(e, list, frame);
        written[list] = status == OK;
        *damaged |= status == ERR_CORRUPT;
        if (status < 0 && status != ERR_CORRUPT)
            return status;
    }
    if (written[LIST_COLOR] && written[LIST_DEPTH])
        write_pair(e, frame);
    if (entry->located)
        write_pose(e, entry);
    return OK;
}

static enum status write_frames(struct folder_export *e, const struct progress_watch *watch, int64_t *damaged)
{
    const int64_t frames = take_frame_count(e->take);
    enum status status = OK;
    *damaged = 0;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        bool faulty = false;
        status = progress_continue(watch, (double)i / (double)frames) ? write_frame(e, i, &faulty) : NOTHING;
        *damaged += faulty;
    }
    if (status == OK && *damaged == frames && frames)
        return ERR_CORRUPT; // the last one's sentence
    if (status == OK)
        status = export_joints_csv(e->take, EXPORT_SENSOR, output_file(e->list[LIST_JOINTS]));
    char path[PATH_MAX];
    if (status == OK)
        status = join(path, e->dir, "calibration.json");
    return status == OK ? calibration_write(path, take_calibration(e->take)) : status;
}

enum status export_folder(struct take *take, const char *dir, const struct progress_watch *watch, int64_t *damaged)
{
    struct folder_export e = {.take = take};
    if (file_exists(dir))
        return fail(ERR_EXISTS, "%s exists; give another name", dir);
    if (snprintf(e.dir, sizeof e.dir, "%s.part", dir) >= (int)sizeof e.dir)
        return fail(ERR_INPUT, "the path %.60s… is too long", dir);
    if (file_exists(e.dir))
        return fail(ERR_EXISTS, "%s, an unfinished folder, exists; remove it", e.dir);
    enum status status = open_lists(&e);
    if (status == OK)
        status = write_frames(&e, watch, damaged);
    for (int i = 0; i < LIST_COUNT; i++)
        status = output_close(&e.list[i], status);
    free(e.gray);
    if (status == OK)
        status = folder_rename(e.dir, dir);
    if (status != OK)
        folder_remove(e.dir);
    return status;
}
